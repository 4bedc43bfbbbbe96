/* density_tune.c - how much finer mip levels a species' planes are drawn from than their texels ask for (own
 * derivation).
 *
 * Planes that lie over one another average what they show once more, so a crown of prefiltered planes looks
 * softer than the crown; a finer level brings the contrast back, and too fine a one flickers. By how much
 * depends on the species, on how large its leaves are and how many planes overlap, and on the distance: one
 * number a species left crowns of large leaves too soft from near and too sharp from far. So it is measured
 * at every scale (density.h): from around, the tree as polygons at 16 samples a pixel and as planes at one,
 * both grey, in the light of one sun and the sky, before a flat sky; the number is the one that gives the
 * planes' pictures the polygons' gradient energy (core/view/compare.h). Large pictures are compared in blocks
 * of BLOCK pixels, one in four. */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "core/base/color.h"
#include "core/base/vec.h"
#include "core/scene/light.h"
#include "core/tree/cloud_light.h"
#include "core/tree/density_look.h"
#include "core/tree/density_private.h"
#include "core/tree/impostor_guess.h"

enum { STEPS = 5, VIEWS_MAX = 8, SIDE_MAX = 1024, BLOCK = 16, SPARSE = 128 };
/* Samples of a raster; those of a pixel are 8 x 8, fewer where they would be more than that: with 4 x 4 the
 * noise of leaves smaller than a pixel is a fifth of the energy. */
enum { SUB = 8, SAMPLES_MAX = 3 << 20 };
/* Share of the polygons' energy that is aimed at. */
static const double AIM = 1;
static const float COARSEST = 0.5f, FINEST = -2.5f;
static const float SKY = 0.5f;      /* linear */
static const float EDGE_ON = 0.05f; /* draw_cloud.c */
/* To the sun: no view has it behind it or before it. */
static const struct sv_sun SUN = {0.6, 0.7};

/* Views of a scale: pictures that are small are many. */
static const int VIEWS[SV_DENSITY_SCALES] = {2, 2, 4, 8, 8, 8};

/* One view of the tree: its planes, where they lie in the picture, and its energy as polygons. */
struct seen {
    float at[2], along[2][2], lod, depth;
    int plane;
};

struct sight {
    float right[3], up[3], toward[3], px; /* model units a pixel */
    float left, top;
    int width, height, sub, count;
    struct sv_cloud_shift shift;
    struct seen planes[SV_DENSITY_PLANES_MAX]; /* farthest first */
};

struct tuning {
    struct sv_density_work *work;
    struct sv_density_levels levels;
    float sharp;
    struct sv_light light;
    struct sv_cloud_light cloud_light;
    float sun[3], sun_grey, sky_grey, ground_grey;
    float *picture; /* SIDE_MAX squared */
};

static float dot3(const float a[3], const float b[3])
{
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

static float grey_of(const float rgb[3])
{
    return 0.2126f * rgb[0] + 0.7152f * rgb[1] + 0.0722f * rgb[2];
}

static float unit(float v)
{
    return v > 0 ? v < 1 ? v : 1 : 0;
}

/* light.h's rule in grey. */
static float lit(const struct tuning *t, float albedo, float n_z, float sun, float occlusion)
{
    float ambient = t->ground_grey + (t->sky_grey - t->ground_grey) * (0.5f + 0.5f * n_z);
    return sv_light_tone(albedo * (t->sun_grey * sun + ambient * occlusion) * SV_LIGHT_EXPOSURE);
}

/* Whether a pixel counts: all of small pictures. */
static bool counts(const struct sight *s, int i, int j)
{
    return (s->width <= SPARSE && s->height <= SPARSE) || ((i / BLOCK) % 2 == 0 && (j / BLOCK) % 2 == 0);
}

/* Sum of squared differences between neighbours that count, of sRGB codes. */
static double energy(const struct sight *s, const float *picture)
{
    double sum = 0;
    for (int j = 0; j + 1 < s->height; j++)
        for (int i = 0; i + 1 < s->width; i++) {
            const float *p = picture + j * s->width + i;
            if (!counts(s, i, j) || !counts(s, i + 1, j + 1))
                continue;
            int at = sv_srgb8_from_linear(p[0]);
            int right = sv_srgb8_from_linear(p[1]) - at, below = sv_srgb8_from_linear(p[s->width]) - at;
            sum += right * right + below * below;
        }
    return sum;
}

/* ---- the tree as polygons ---- */

static float polygon_sample(const struct tuning *t, const struct sight *sight, int i, int j)
{
    const struct sv_raster *r = &t->work->bake.raster;
    size_t at = (size_t)j * (size_t)r->width + (size_t)i;
    float w[3], rgb[3], uv[2] = {0}, open[4] = {0}, n[3] = {0}, occlusion = 0;
    if (r->triangle[at] == SV_RASTER_NONE)
        return SKY;
    const uint32_t *index = r->mesh->indices + r->triangle[at];
    const struct sv_tree_material *material = &r->mesh->materials[r->material[at]];
    sv_raster_weights(r, i, j, w);
    for (int k = 0; k < 3; k++) {
        const struct sv_tree_vertex *v = &r->mesh->vertices[index[k]];
        for (int c = 0; c < 2; c++)
            uv[c] += w[k] * v->uv[c];
        for (int c = 0; c < 3; c++)
            n[c] += w[k] * (float)v->normal[c];
        for (int c = 0; c < 4; c++)
            open[c] += w[k] * (float)v->open[c] * (1.0f / 127.0f);
        occlusion += w[k] * (float)v->occlusion * (1.0f / 65535.0f);
    }
    sv_raster_color(r, r->material[at], uv[0], uv[1], rgb);
    float length = sqrtf(dot3(n, n)),
          turn = (dot3(n, sight->toward) < 0 ? -1 : 1) / (length > 0 ? length : 1);
    float n_l = dot3(n, t->sun) * turn, through = material->is_leaf ? material->translucency : 0;
    float sun = (n_l >= 0 ? n_l : through * -n_l) * unit(dot3(open, t->sun) + open[3]);
    return lit(t, grey_of(rgb), n[2] * turn, sun, occlusion);
}

static void draw_polygons(const struct tuning *t, const struct sight *sight)
{
    int sub = sight->sub;
    for (int p = 0; p < sight->width * sight->height; p++) {
        int i = p % sight->width, j = p / sight->width;
        float sum = 0;
        for (int n = 0; n < sub * sub && counts(sight, i, j); n++)
            sum += polygon_sample(t, sight, i * sub + n % sub, j * sub + n / sub);
        t->picture[p] = sum / (float)(sub * sub);
    }
}

/* ---- and as planes ---- */

static int by_depth(const void *a, const void *b)
{
    const struct seen *p = a, *q = b;
    return p->depth != q->depth ? (p->depth > q->depth) - (p->depth < q->depth) : p->plane - q->plane;
}

/* Level of detail of a plane at a pixel of one model unit. */
static float lod_of(const struct sv_cloud_plane *p, float facing)
{
    return 0.5f * log2f(SV_DENSITY_TILE * SV_DENSITY_TILE / (4 * p->half[0] * p->half[1] * fabsf(facing)));
}

/* Mean of lod_of over the planes, by how large they are seen. */
static float mean_lod(const struct sv_tree_cloud *cloud, const float toward[3])
{
    float sum = 0, weight = 0;
    for (int k = 0; k < cloud->plane_count; k++) {
        const struct sv_cloud_plane *p = &cloud->planes[k];
        float facing = fabsf(dot3(p->normal, toward)), area = p->half[0] * p->half[1] * facing;
        if (p->piece_count == 0 || facing < EDGE_ON)
            continue;
        sum += area * lod_of(p, facing);
        weight += area;
    }
    return weight > 0 ? sum / weight : 7;
}

/* Plane coordinates of pixel (i, j) are at + i along[0] + j along[1], -1 .. 1 over the rectangle. */
static void see_planes(const struct sv_tree_cloud *cloud, struct sight *sight)
{
    sight->count = 0;
    for (int k = 0; k < cloud->plane_count; k++) {
        const struct sv_cloud_plane *p = &cloud->planes[k];
        float facing = dot3(p->normal, sight->toward), px = sight->px;
        if (p->piece_count == 0 || fabsf(facing) < EDGE_ON)
            continue;
        struct seen *s = &sight->planes[sight->count++];
        *s = (struct seen){.plane = k, .depth = dot3(p->centre, sight->toward)};
        for (int a = 0; a < 2; a++) {
            const float *axis = a ? p->v : p->u;
            /* along the view, back to the plane: x right + y up + z toward lies in it for z = -(n . (x right
             * + y up - c)) / n . toward */
            float slide = dot3(axis, sight->toward) / facing;
            float right = dot3(axis, sight->right) - slide * dot3(p->normal, sight->right),
                  up = dot3(axis, sight->up) - slide * dot3(p->normal, sight->up);
            float origin = slide * dot3(p->normal, p->centre) - dot3(axis, p->centre);
            float x0 = sight->left + 0.5f * px, y0 = sight->top - 0.5f * px;
            s->at[a] = (origin + right * x0 + up * y0) / p->half[a];
            s->along[0][a] = right * px / p->half[a];
            s->along[1][a] = -up * px / p->half[a];
        }
        s->lod = lod_of(p, facing) + log2f(px);
    }
    qsort(sight->planes, (size_t)sight->count, sizeof *sight->planes, by_depth);
}

/* Twin of cloud_light in tree_cloud.glsl, in grey: m turned to the viewer. */
static float plane_light(const struct tuning *t, const struct sight *sight, int k, float x, float y,
                         const float rgb[3], const float normal[4])
{
    const struct sv_density *density = t->work->out;
    const struct sv_density_plane *plane = &density->planes[k];
    const struct sv_cloud_plane *p = &t->work->cloud->planes[k];
    const float *rule = density->translucency;
    float m[3], open = sv_density_quadratic_at(&plane->open[3], x, y);
    for (int c = 0; c < 3; c++) {
        m[c] = normal[0] * p->u[c] + normal[1] * p->v[c] + normal[2] * p->normal[c];
        open += t->sun[c] * sv_density_quadratic_at(&plane->open[c], x, y);
    }
    float turn = dot3(m, sight->toward) < 0 ? -1.0f : 1.0f;
    float through = unit(rgb[0] * rule[0] + rgb[1] * rule[1] + rgb[2] * rule[2] + rule[3]);
    for (int c = 0; c < 3; c++)
        m[c] *= turn;
    float leaf = t->cloud_light.translucency > 0 ? unit(through / t->cloud_light.translucency) : 1;
    float sun = sv_guess_leaf_sun(m, t->sun, through) * (1 + (sight->shift.sun - 1) * leaf) * unit(open);
    return lit(t, grey_of(rgb), fminf(fmaxf(m[2] + sight->shift.lift * leaf, -1), 1), sun,
               fminf(normal[3] * (1 + (sight->shift.sky - 1) * leaf), 1));
}

/* Planes, blended, one sample a pixel, levels `finer` off. */
static void draw_planes(const struct tuning *t, const struct sight *sight, float finer)
{
    int pixels = sight->width * sight->height;
    for (int p = 0; p < pixels; p++)
        t->picture[p] = SKY;
    for (int k = 0; k < sight->count; k++) {
        const struct seen *s = &sight->planes[k];
        float lod = s->lod + finer;
        for (int p = 0; p < pixels; p++) {
            int i = p % sight->width, j = p / sight->width;
            float x = s->at[0] + (float)i * s->along[0][0] + (float)j * s->along[1][0],
                  y = s->at[1] + (float)i * s->along[0][1] + (float)j * s->along[1][1], rgb[3], normal[4];
            if (!(fabsf(x) < 1 && fabsf(y) < 1) || !counts(sight, i, j))
                continue;
            float u = 0.5f + 0.5f * x, v = 0.5f - 0.5f * y;
            float cover = sv_density_plain_cover(&t->levels, t->sharp, s->plane, u, v, lod, rgb);
            if (!(cover > 0))
                continue;
            sv_density_plain_normal(&t->levels, s->plane, u, v, lod, normal);
            t->picture[p] += cover * (plane_light(t, sight, s->plane, x, y, rgb, normal) - t->picture[p]);
        }
    }
}

/* ---- */

/* View k of `count`: from around, every other one from somewhat above. */
static void aim(int k, int count, struct sight *sight)
{
    double a = 2 * SV_PI * k / (count > 2 ? count : 4), e = k % 2 ? 0.35 : 0;
    sight->toward[0] = (float)(cos(a) * cos(e));
    sight->toward[1] = (float)(sin(a) * cos(e));
    sight->toward[2] = (float)sin(e);
    sight->right[0] = (float)-sin(a);
    sight->right[1] = (float)cos(a);
    sight->right[2] = 0;
    sight->up[0] = sight->toward[1] * sight->right[2] - sight->toward[2] * sight->right[1];
    sight->up[1] = sight->toward[2] * sight->right[0] - sight->toward[0] * sight->right[2];
    sight->up[2] = sight->toward[0] * sight->right[1] - sight->toward[1] * sight->right[0];
}

/* Places the picture about the mesh, a pixel of sky around it, and the mesh in the raster. */
static enum sv_status place(struct sv_raster *r, const struct sv_tree_mesh *mesh, struct sight *s,
                            struct sv_error *error)
{
    float lo[2] = {INFINITY, INFINITY}, hi[2] = {-INFINITY, -INFINITY};
    const float *axes[2] = {s->right, s->up};
    for (uint32_t i = 0; i < mesh->vertex_count; i++)
        for (int a = 0; a < 2; a++) {
            float at = dot3(mesh->vertices[i].position, axes[a]);
            lo[a] = fminf(lo[a], at);
            hi[a] = fmaxf(hi[a], at);
        }
    float most = mesh->vertex_count ? fmaxf(hi[0] - lo[0], hi[1] - lo[1]) : 0;
    s->px = fmaxf(s->px, most / (SIDE_MAX - 3));
    s->width = mesh->vertex_count ? (int)((hi[0] - lo[0]) / s->px) + 3 : 3;
    s->height = mesh->vertex_count ? (int)((hi[1] - lo[1]) / s->px) + 3 : 3;
    s->left = lo[0] - s->px;
    s->top = hi[1] + s->px;
    s->sub = SUB;
    while (s->sub > 1 && s->width * s->height * s->sub * s->sub > SAMPLES_MAX)
        s->sub--;
    enum sv_status status = sv_raster_resize(r, s->width * s->sub, s->height * s->sub, error);
    if (!status)
        status = sv_raster_set_mesh(r, mesh, error);
    for (uint32_t i = 0; i < mesh->vertex_count && !status; i++) {
        const float *p = mesh->vertices[i].position;
        r->x[i] = (dot3(p, s->right) - s->left) * (float)s->sub / s->px;
        r->y[i] = (s->top - dot3(p, s->up)) * (float)s->sub / s->px;
        r->z[i] = dot3(p, s->toward);
    }
    return status;
}

/* Sets view k of a scale up and adds its polygons' energy. */
static enum sv_status look(struct tuning *t, int scale, int k, struct sight *sight, double *truth,
                           struct sv_error *error)
{
    aim(k, VIEWS[scale], sight);
    sight->px = exp2f((float)(scale + SV_DENSITY_SCALE_FIRST) - mean_lod(t->work->cloud, sight->toward));
    sight->shift = sv_cloud_light_shift(&t->cloud_light, sight->toward, t->sun);
    enum sv_status status = place(&t->work->bake.raster, t->work->mesh, sight, error);
    if (status)
        return status;
    sv_raster_draw(&t->work->bake.raster);
    see_planes(t->work->cloud, sight);
    draw_polygons(t, sight);
    *truth += energy(sight, t->picture);
    return SV_OK;
}

static enum sv_status tune_scale(struct tuning *t, int scale, struct sv_error *error)
{
    struct sight sights[VIEWS_MAX];
    double truth = 0;
    enum sv_status status = SV_OK;
    for (int v = 0; v < VIEWS[scale] && !status; v++)
        status = look(t, scale, v, &sights[v], &truth, error);
    float lo = FINEST, hi = COARSEST;
    for (int n = 0; n < STEPS && !status; n++) { /* energy falls as levels get coarser */
        double sum = 0;
        float middle = 0.5f * (lo + hi);
        for (int v = 0; v < VIEWS[scale]; v++) {
            draw_planes(t, &sights[v], middle);
            sum += energy(&sights[v], t->picture);
        }
        if (sum > AIM * truth)
            lo = middle;
        else
            hi = middle;
    }
    t->work->out->finer[scale] = 0.5f * (lo + hi);
    return status;
}

static void set_light(struct tuning *t)
{
    sv_light_from_sun(&SUN, &t->light);
    t->sun[0] = (float)t->light.to_sun.x;
    t->sun[1] = (float)t->light.to_sun.y;
    t->sun[2] = (float)t->light.to_sun.z;
    t->sun_grey = grey_of(t->light.sun_rgb);
    t->sky_grey = grey_of(t->light.sky_rgb);
    t->ground_grey = grey_of(t->light.ground_rgb);
}

enum sv_status sv_density_tune(struct sv_density_work *work, struct sv_error *error)
{
    struct tuning t = {.work = work};
    enum sv_status status = sv_density_levels_init(work->out, &t.levels, error);
    if (status)
        return status;
    t.picture = malloc((size_t)SIDE_MAX * SIDE_MAX * sizeof *t.picture);
    if (!t.picture)
        status = sv_fail(error, SV_ENOMEM, "density", "no memory to tune a density texture");
    set_light(&t);
    if (!status)
        status = sv_cloud_light_measure(work->mesh, work->cloud, &t.cloud_light, error);
    sv_density_texels(work->out, work->rgba);
    t.sharp = sv_density_sharp_scale(work->out, work->rgba);
    for (int k = 0; k < SV_DENSITY_SCALES && !status; k++)
        status = tune_scale(&t, k, error);
    free(t.picture);
    sv_density_levels_finish(&t.levels);
    return status;
}
