/* impostor_bake.c - draws a mesh from each frame's direction and boils 3 x 3 samples down to a texel.
 *
 * The plane of a frame (own derivation). A point seen at (x, y) of the frame's picture with depth d towards
 * the viewer is q = x right + y up + d toward. The quad puts it at q' = x right + y up + (a + b x + c y)
 * toward; from an eye that is off the frame's direction by a small angle e, q' is seen |d - (a + b x + c y)|
 * sin(e) from where q would be. So a, b, c are those of the least squares of that difference over all
 * samples, the stem's foot (0, 0, 0) counting as many samples, the more so the lower the view. b and c are
 * held below SLOPE_MAX: a steeper plane would be seen edge-on from places that the frame still serves. */
#include "core/tree/impostor.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "core/base/color.h"
#include "core/tree/impostor_raster.h"
#include "core/tree/least_squares.h"

enum { SUB = 3, SAMPLES = SUB * SV_IMPOSTOR_CELL };

/* tan of the steepest tilt of a quad against its frame: neighbours are at most 18 degrees apart, half of that
 * plus 60 stays well under 90. Own choice. */
static const double SLOPE_MAX = 1.2;
/* Share of the foot in a plane's fit at the horizon, against all samples together. */
static const double FOOT_WEIGHT = 0.35;

/* Sums of what is seen in a texel. */
struct texel {
    float rgb[3], normal[3], occlusion, depth, translucency;
    float open[4];           /* openness to the sun, slope in model space, and mean */
    float square[6], weight; /* brightness x products of the normal's components */
    int count;
};

struct bake {
    struct sv_impostor *out;
    struct sv_raster raster;
    struct sv_raster_view view;
    /* Normal equations: of the frame's plane (d from 1, x, y), and of the species' translucency from colour
     * (r, g, b, 1). */
    double plane[SV_UNKNOWNS_MAX][SV_UNKNOWNS_MAX + 1], leaf[SV_UNKNOWNS_MAX][SV_UNKNOWNS_MAX + 1];
    double square[6], weight; /* of the frame: as in a texel */
};

static float dot3(const float a[3], const float b[3])
{
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

/* Adds the seen sample (i, j) of the raster. */
static void add_sample(const struct bake *b, size_t at, int i, int j, struct texel *texel)
{
    const struct sv_raster *r = &b->raster;
    const struct sv_tree_material *material = &r->mesh->materials[r->material[at]];
    const uint32_t *index = r->mesh->indices + r->triangle[at];
    const struct sv_tree_vertex *v[3];
    float w[3], n[3] = {0}, uv[2] = {0}, occlusion = 0, rgb[3];
    float open[4] = {0};
    sv_raster_weights(r, i, j, w);
    for (int k = 0; k < 3; k++)
        v[k] = &r->mesh->vertices[index[k]];
    for (int k = 0; k < 3; k++) {
        for (int c = 0; c < 3; c++)
            n[c] += w[k] * (float)v[k]->normal[c];
        uv[0] += w[k] * v[k]->uv[0];
        uv[1] += w[k] * v[k]->uv[1];
        occlusion += w[k] * (float)v[k]->occlusion;
        for (int c = 0; c < 4; c++)
            open[c] += w[k] * (float)v[k]->open[c] * (1.0f / 127.0f);
    }
    float length = sqrtf(dot3(n, n)), facing = dot3(n, b->view.toward);
    float unit = length > 0 ? (facing < 0 ? -1 : 1) / length : 0;
    sv_raster_color(r, r->material[at], uv[0], uv[1], rgb);
    for (int c = 0; c < 3; c++)
        texel->rgb[c] += rgb[c];
    float m[3] = {unit * dot3(n, b->view.right), unit * dot3(n, b->view.up), unit * facing};
    float bright = rgb[0] + rgb[1] + rgb[2];
    for (int c = 0; c < 3; c++) {
        texel->normal[c] += m[c];
        texel->square[c] += bright * m[c] * m[c];
    }
    texel->square[3] += bright * m[0] * m[1];
    texel->square[4] += bright * m[0] * m[2];
    texel->square[5] += bright * m[1] * m[2];
    texel->weight += bright;
    texel->occlusion += occlusion * (1.0f / 65535.0f);
    for (int c = 0; c < 4; c++)
        texel->open[c] += open[c];
    texel->depth += r->depth[at];
    texel->translucency += material->is_leaf ? material->translucency : 0;
    texel->count++;
}

static uint8_t unit_code(float v)
{
    return (uint8_t)(fminf(fmaxf(v, 0), 1) * 255.0f + 0.5f);
}

static void put_texel(const struct bake *b, const struct texel *t, size_t at)
{
    uint8_t *albedo = b->out->albedo + at, *normal = b->out->normal + at, *open = b->out->open + at;

    const float all = (float)(SUB * SUB);
    float each = 1.0f / (float)t->count;
    for (int c = 0; c < 3; c++) {
        albedo[c] = sv_srgb8_from_linear(t->rgb[c] / all);
        normal[c] = unit_code(0.5f + 0.5f * t->normal[c] * each);
        open[c] = unit_code(0.5f + 0.5f * t->open[c] * each);
    }
    albedo[3] = unit_code((float)t->count / all);
    normal[3] = unit_code(t->occlusion * each);
    open[3] = unit_code(t->open[3] * each);
}

/* Boils the samples of texel (i, j) of the frame down, and notes their depth and translucency. */
static void resolve_texel(struct bake *b, int i, int j, size_t texel_at)
{
    struct texel t = {.count = 0};
    for (int sj = j * SUB; sj < (j + 1) * SUB; sj++)
        for (int si = i * SUB; si < (i + 1) * SUB; si++) {
            size_t at = (size_t)sj * SAMPLES + (size_t)si;
            if (b->raster.triangle[at] != SV_RASTER_NONE)
                add_sample(b, at, si, sj, &t);
        }
    if (t.count == 0)
        return;
    put_texel(b, &t, texel_at);
    double count = t.count, step = (double)b->view.step * SUB;
    const double place[3] = {1, (double)b->view.left + (i + 0.5) * step,
                             (double)b->view.top - (j + 0.5) * step};
    const double color[4] = {(double)t.rgb[0] / count, (double)t.rgb[1] / count, (double)t.rgb[2] / count, 1};
    sv_least_squares_add(b->plane, 3, place, (double)t.depth / count, count);
    for (int c = 0; c < 6; c++)
        b->square[c] += (double)t.square[c];
    b->weight += (double)t.weight;
    sv_least_squares_add(b->leaf, 4, color, (double)t.translucency / count, count);
}

/* The quad's plane; falls back to the plane square to the view through the axis' middle. */
static void fit_plane(struct bake *b, struct sv_impostor_frame *f)
{
    double across = 1 - (double)f->toward[2] * (double)f->toward[2], seen = b->plane[0][0];
    double plane[3] = {0.5 * (double)f->toward[2], 0, 0};
    const double foot[3] = {1, 0, 0};
    sv_least_squares_add(b->plane, 3, foot, 0, FOOT_WEIGHT * across * seen);
    /* A little of "no slope", so that a bare pole still has an answer. */
    b->plane[1][1] += 1e-3 * seen;
    b->plane[2][2] += 1e-3 * seen;
    double fitted[SV_UNKNOWNS_MAX], total = b->plane[0][0];
    double mid[2] = {b->plane[0][1] / total, b->plane[0][2] / total};
    if (seen > 0 && sv_least_squares_solve(3, b->plane, fitted)) {
        double slope = sqrt(fitted[1] * fitted[1] + fitted[2] * fitted[2]);
        double hold = slope > SLOPE_MAX ? SLOPE_MAX / slope : 1;
        plane[1] = fitted[1] * hold;
        plane[2] = fitted[2] * hold;
        /* Holding the slope turns the plane about the middle of what is seen. */
        plane[0] = fitted[0] + (fitted[1] - plane[1]) * mid[0] + (fitted[2] - plane[2]) * mid[1];
    }
    float side = b->view.step * (float)SAMPLES;
    double at = plane[0] + plane[1] * (double)b->view.left + plane[2] * (double)b->view.top;
    for (int c = 0; c < 3; c++) {
        f->origin[c] = b->view.left * f->right[c] + b->view.top * f->up[c] + (float)at * f->toward[c];
        f->along_s[c] = side * (f->right[c] + (float)plane[1] * f->toward[c]);
        f->along_t[c] = -side * (f->up[c] + (float)plane[2] * f->toward[c]);
    }
    f->texels = (float)SV_IMPOSTOR_CELL / side;
}

static void set_basis(int frame, struct sv_impostor_frame *f)
{
    sv_impostor_direction(frame, f->toward);
    float *t = f->toward, across = sqrtf(t[0] * t[0] + t[1] * t[1]);
    /* Level and to the viewer's right: up x toward; seen from the zenith, north is up. */
    f->right[0] = across > 0 ? -t[1] / across : 1;
    f->right[1] = across > 0 ? t[0] / across : 0;
    f->right[2] = 0;
    f->up[0] = t[1] * f->right[2] - t[2] * f->right[1];
    f->up[1] = t[2] * f->right[0] - t[0] * f->right[2];
    f->up[2] = t[0] * f->right[1] - t[1] * f->right[0];
}

static void bake_frame(struct bake *b, int frame)
{
    struct sv_impostor_frame *f = &b->out->frames[frame];
    set_basis(frame, f);
    b->view = (struct sv_raster_view){.right = f->right, .up = f->up, .toward = f->toward};
    memset(b->plane, 0, sizeof b->plane);
    memset(b->square, 0, sizeof b->square);
    b->weight = 0;
    sv_raster_aim(&b->raster, &b->view);
    sv_raster_draw(&b->raster);
    int column = frame % SV_IMPOSTOR_GRID * SV_IMPOSTOR_CELL,
        row = frame / SV_IMPOSTOR_GRID * SV_IMPOSTOR_CELL;
    int lo[2] = {SV_IMPOSTOR_CELL, SV_IMPOSTOR_CELL}, hi[2] = {0, 0};
    for (int j = 0; j < SV_IMPOSTOR_CELL; j++)
        for (int i = 0; i < SV_IMPOSTOR_CELL; i++) {
            size_t at = 4 * ((size_t)(row + j) * SV_IMPOSTOR_SIDE + (size_t)(column + i));
            resolve_texel(b, i, j, at);
            if (b->out->albedo[at + 3] == 0)
                continue;
            lo[0] = i < lo[0] ? i : lo[0];
            lo[1] = j < lo[1] ? j : lo[1];
            hi[0] = i + 1 > hi[0] ? i + 1 : hi[0];
            hi[1] = j + 1 > hi[1] ? j + 1 : hi[1];
        }
    fit_plane(b, f);
    /* |c| = 3/16 + 15/16 c^2 + terms of fourth order and up, by Legendre polynomials. */
    for (int c = 0; c < 6; c++)
        f->scatter[c] =
            (c < 3 ? 3.0f / 16 : 0) + (b->weight > 0 ? (float)(15.0 / 16 * b->square[c] / b->weight)
                                       : c < 3       ? 5.0f / 16
                                                     : 0);
    f->s_min = (float)lo[0] / SV_IMPOSTOR_CELL;
    f->t_min = (float)lo[1] / SV_IMPOSTOR_CELL;
    f->s_max = (float)hi[0] / SV_IMPOSTOR_CELL;
    f->t_max = (float)hi[1] / SV_IMPOSTOR_CELL;
}

enum sv_status sv_impostor_bake(const struct sv_tree_mesh *mesh, struct sv_impostor *impostor,
                                struct sv_error *error)
{
    size_t texels = (size_t)SV_IMPOSTOR_SIDE * SV_IMPOSTOR_SIDE;
    struct sv_impostor made = {
        .albedo = calloc(texels, 4), .normal = calloc(texels, 4), .open = calloc(texels, 4)};
    struct bake bake = {.out = &made};
    enum sv_status status = SV_OK;
    if (!made.albedo || !made.normal || !made.open)
        status = sv_fail(error, SV_ENOMEM, "impostor", "no memory for an atlas");
    if (!status)
        status = sv_raster_init(mesh, SAMPLES, SAMPLES, &bake.raster, error);
    if (status) {
        sv_impostor_finish(&made);
        return status;
    }
    for (int k = 0; k < SV_IMPOSTOR_FRAMES; k++)
        bake_frame(&bake, k);
    sv_translucency_rule(bake.leaf, bake.out->translucency);
    sv_raster_finish(&bake.raster);
    *impostor = made;
    return SV_OK;
}
