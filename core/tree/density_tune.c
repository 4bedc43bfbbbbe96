/* density_tune.c - how much finer mip levels a species' planes are drawn from than their texels ask for (own
 * derivation).
 *
 * Planes that lie over one another average what they show once more, so a crown of prefiltered planes looks
 * softer than the crown; a finer level brings the contrast back, and too fine a one flickers. By how much
 * depends on the species: on how large its leaves are and how many planes overlap. So it is measured: from
 * two sides, the tree as polygons at 16 samples a pixel and as planes at one, both in grey, lit by openness
 * alone, before a flat sky, TALL px tall; the offset is the one that gives the planes' picture the polygons'
 * gradient energy (core/view/compare.h). */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "core/base/color.h"
#include "core/tree/density_look.h"
#include "core/tree/density_private.h"

enum { TALL = 100, SUB = 4, SIDE_MAX = 400, STEPS = 4, VIEWS = 2 };
/* Share of the polygons' energy that is aimed at: light on single leaves, which grey lacks, adds the rest.
 * Found over eleven trees at five distances by tests/experiments/forest_fig4, so that ratios lie about 1 with
 * it. */
static const double AIM = 0.82;
static const float COARSEST = 0.3f, FINEST = -1.2f;
static const float SKY = 0.5f, EXPOSURE = 2.4f; /* linear; SV_LIGHT_EXPOSURE */
static const float EDGE_ON = 0.1f;              /* draw_cloud.c */

static float grey(const float rgb[3], float open)
{
    float y = 0.2126f * rgb[0] + 0.7152f * rgb[1] + 0.0722f * rgb[2];
    return y * EXPOSURE * (0.3f + 0.7f * (open > 0 ? open < 1 ? open : 1 : 0));
}

/* Sum of squared differences between neighbours, of sRGB codes. */
static double energy(const float *picture, int side)
{
    double sum = 0;
    for (int j = 0; j + 1 < side; j++)
        for (int i = 0; i + 1 < side; i++) {
            int at = sv_srgb8_from_linear(picture[j * side + i]);
            int right = sv_srgb8_from_linear(picture[j * side + i + 1]) - at,
                below = sv_srgb8_from_linear(picture[(j + 1) * side + i]) - at;
            sum += right * right + below * below;
        }
    return sum;
}

/* Polygons: what raster has drawn, SUB x SUB samples a pixel. */
static void draw_polygons(const struct sv_raster *r, int side, float *picture)
{
    for (int p = 0; p < side * side; p++) {
        picture[p] = 0;
        for (int n = 0; n < SUB * SUB; n++) {
            int i = p % side * SUB + n % SUB, j = p / side * SUB + n / SUB;
            size_t at = (size_t)j * (size_t)r->width + (size_t)i;
            float w[3], rgb[3], uv[2] = {0}, open = 0, v = SKY;
            if (r->triangle[at] != SV_RASTER_NONE) {
                const uint32_t *index = r->mesh->indices + r->triangle[at];
                sv_raster_weights(r, i, j, w);
                for (int k = 0; k < 3; k++) {
                    const struct sv_tree_vertex *x = &r->mesh->vertices[index[k]];
                    uv[0] += w[k] * x->uv[0], uv[1] += w[k] * x->uv[1];
                    open += w[k] * (float)x->open[3] * (1.0f / 127.0f);
                }
                sv_raster_color(r, r->material[at], uv[0], uv[1], rgb);
                v = grey(rgb, open);
            }
            picture[p] += v * (1.0f / (SUB * SUB));
        }
    }
}

static float dot3(const float a[3], const float b[3])
{
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

/* A plane as it is seen: plane coordinates of pixel (i, j) are at + i along[0] + j along[1], -1 .. 1 over its
 * rectangle. */
struct seen {
    float at[2], along[2][2], lod, depth;
    int plane;
};

static int by_depth(const void *a, const void *b)
{
    const struct seen *p = a, *q = b;
    return p->depth != q->depth ? (p->depth > q->depth) - (p->depth < q->depth) : p->plane - q->plane;
}

/* The planes in view, farthest first; returns their number. */
static int see_planes(const struct sv_tree_cloud *cloud, const struct sv_raster_view *view, float px,
                      struct seen out[SV_DENSITY_PLANES_MAX])
{
    int count = 0;
    for (int k = 0; k < cloud->plane_count; k++) {
        const struct sv_cloud_plane *p = &cloud->planes[k];
        float facing = dot3(p->normal, view->toward);
        if (p->piece_count == 0 || fabsf(facing) < EDGE_ON)
            continue;
        struct seen *s = &out[count++];
        *s = (struct seen){.plane = k, .depth = dot3(p->centre, view->toward)};
        for (int a = 0; a < 2; a++) {
            const float *axis = a ? p->v : p->u;
            /* along the view, back to the plane: x right + y up + z toward lies in it for z = -(n . (x right
             * + y up - c)) / n . toward */
            float slide = dot3(axis, view->toward) / facing;
            float right = dot3(axis, view->right) - slide * dot3(p->normal, view->right),
                  up = dot3(axis, view->up) - slide * dot3(p->normal, view->up);
            float origin = slide * dot3(p->normal, p->centre) - dot3(axis, p->centre);
            float x0 = view->left + 0.5f * px, y0 = view->top - 0.5f * px;
            s->at[a] = (origin + right * x0 + up * y0) / p->half[a];
            s->along[0][a] = right * px / p->half[a];
            s->along[1][a] = -up * px / p->half[a];
        }
        float texels =
            px * px * SV_DENSITY_TILE * SV_DENSITY_TILE / (4 * p->half[0] * p->half[1] * fabsf(facing));
        s->lod = 0.5f * log2f(texels);
    }
    qsort(out, (size_t)count, sizeof *out, by_depth);
    return count;
}

/* Planes, blended, one sample a pixel, levels `finer` off. */
static void draw_planes(const struct sv_density *density, const struct sv_density_levels *levels, float sharp,
                        const struct seen *seen, int count, float finer, int side, float *picture)
{
    for (int p = 0; p < side * side; p++)
        picture[p] = SKY;
    for (int k = 0; k < count; k++) {
        const struct seen *s = &seen[k];
        const struct sv_density_plane *plane = &density->planes[s->plane];
        for (int p = 0; p < side * side; p++) {
            float i = (float)(p % side), j = (float)(p / side);
            float x = s->at[0] + i * s->along[0][0] + j * s->along[1][0],
                  y = s->at[1] + i * s->along[0][1] + j * s->along[1][1], rgb[3];
            if (!(fabsf(x) < 1 && fabsf(y) < 1))
                continue;
            float cover = sv_density_plain_cover(levels, sharp, s->plane, 0.5f + 0.5f * x, 0.5f - 0.5f * y,
                                                 s->lod + finer, rgb);
            if (cover > 0)
                picture[p] +=
                    cover * (grey(rgb, sv_density_quadratic_at(&plane->open[3], x, y)) - picture[p]);
        }
    }
}

static enum sv_status tune(struct sv_density_work *work, const struct sv_density_levels *levels, float sharp,
                           float *picture, struct sv_error *error)
{
    static const float AXES[VIEWS][3][3] = {{{1, 0, 0}, {0, 0, 1}, {0, -1, 0}},
                                            {{0, 1, 0}, {0, 0, 1}, {1, 0, 0}}};
    struct sv_raster *r = &work->bake.raster;
    struct seen seen[VIEWS][SV_DENSITY_PLANES_MAX];
    int count[VIEWS], side = (int)(TALL * fmaxf(1, 2 * work->mesh->radius)) + 2;
    double truth = 0;
    side = side < SIDE_MAX ? side : SIDE_MAX;
    enum sv_status status = sv_raster_resize(r, side * SUB, side * SUB, error);
    if (!status)
        status = sv_raster_set_mesh(r, work->mesh, error);
    for (int v = 0; !status && v < VIEWS; v++) {
        struct sv_raster_view view = {.right = AXES[v][0], .up = AXES[v][1], .toward = AXES[v][2]};
        sv_raster_aim(r, &view);
        sv_raster_draw(r);
        draw_polygons(r, side, picture);
        truth += energy(picture, side);
        count[v] = see_planes(work->cloud, &view, view.step * SUB, seen[v]);
    }
    float lo = FINEST, hi = COARSEST;
    for (int n = 0; !status && n < STEPS; n++) { /* energy falls as levels get coarser */
        double sum = 0;
        float middle = 0.5f * (lo + hi);
        for (int v = 0; v < VIEWS; v++) {
            draw_planes(work->out, levels, sharp, seen[v], count[v], middle, side, picture);
            sum += energy(picture, side);
        }
        if (sum > AIM * truth)
            lo = middle;
        else
            hi = middle;
    }
    work->out->finer = 0.5f * (lo + hi);
    return status;
}

enum sv_status sv_density_tune(struct sv_density_work *work, struct sv_error *error)
{
    struct sv_density_levels levels;
    float *picture = malloc((size_t)SIDE_MAX * SIDE_MAX * sizeof *picture);
    if (!picture)
        return sv_fail(error, SV_ENOMEM, "density", "no memory to tune a density texture");
    enum sv_status status = sv_density_levels_init(work->out, &levels, error);
    if (!status) {
        sv_density_texels(work->out, work->rgba);
        status = tune(work, &levels, sv_density_sharp_scale(work->out, work->rgba), picture, error);
        sv_density_levels_finish(&levels);
    }
    free(picture);
    return status;
}
