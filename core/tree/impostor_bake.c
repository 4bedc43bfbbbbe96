/* impostor_bake.c - draws a mesh from each frame's direction and boils 4 x 4 samples down to a texel.
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

enum { SUB = SV_RASTER_SIDE / SV_IMPOSTOR_CELL };

/* tan of the steepest tilt of a quad against its frame: neighbours are at most 18 degrees apart, half of that
 * plus 60 stays well under 90. Own choice. */
static const double SLOPE_MAX = 1.2;
/* Share of the foot in a plane's fit at the horizon, against all samples together. */
static const double FOOT_WEIGHT = 0.35;

/* Sums of what is seen in a texel, or in a whole frame. */
struct texel {
    float rgb[3], normal[3], occlusion;
    int count;
};

struct bake {
    struct sv_impostor *out;
    struct sv_raster raster;
    struct sv_raster_view view;
    double moments[3][4]; /* normal equations of the plane: rows 1, x, y; columns 1, x, y, d */
    double translucency, seen;
};

static float dot3(const float a[3], const float b[3])
{
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

/* Adds the seen sample (i, j) of the raster. */
static void add_sample(const struct bake *b, size_t at, int i, int j, struct texel *texel)
{
    const struct sv_raster *r = &b->raster;
    const uint32_t *index = r->mesh->indices + r->triangle[at];
    const struct sv_tree_vertex *v[3];
    float x[3], y[3], w[3], n[3] = {0}, uv[2] = {0}, occlusion = 0, rgb[3];
    for (int k = 0; k < 3; k++) {
        v[k] = &r->mesh->vertices[index[k]];
        x[k] = r->x[index[k]];
        y[k] = r->y[index[k]];
    }
    float px = (float)i + 0.5f, py = (float)j + 0.5f;
    float area = (x[1] - x[0]) * (y[2] - y[0]) - (x[2] - x[0]) * (y[1] - y[0]);
    w[1] = ((px - x[0]) * (y[2] - y[0]) - (x[2] - x[0]) * (py - y[0])) / area;
    w[2] = ((x[1] - x[0]) * (py - y[0]) - (px - x[0]) * (y[1] - y[0])) / area;
    w[0] = 1 - w[1] - w[2];
    for (int k = 0; k < 3; k++) {
        for (int c = 0; c < 3; c++)
            n[c] += w[k] * (float)v[k]->normal[c];
        uv[0] += w[k] * v[k]->uv[0];
        uv[1] += w[k] * v[k]->uv[1];
        occlusion += w[k] * (float)v[k]->occlusion;
    }
    float length = sqrtf(dot3(n, n)), facing = dot3(n, b->view.toward);
    float unit = length > 0 ? (facing < 0 ? -1 : 1) / length : 0;
    sv_raster_color(r, r->material[at], uv[0], uv[1], rgb);
    for (int c = 0; c < 3; c++)
        texel->rgb[c] += rgb[c];
    texel->normal[0] += unit * dot3(n, b->view.right);
    texel->normal[1] += unit * dot3(n, b->view.up);
    texel->normal[2] += unit * facing;
    texel->occlusion += occlusion * (1.0f / 65535.0f);
    texel->count++;
}

static void add_moment(struct bake *b, double weight, double x, double y, double d)
{
    const double row[3] = {1, x, y}, column[4] = {1, x, y, d};
    for (int i = 0; i < 3; i++)
        for (int k = 0; k < 4; k++)
            b->moments[i][k] += weight * row[i] * column[k];
}

static uint8_t unit_code(float v)
{
    return (uint8_t)(fminf(fmaxf(v, 0), 1) * 255.0f + 0.5f);
}

static void put_texel(const struct texel *t, uint8_t albedo[4], uint8_t normal[4])
{
    const float all = (float)(SUB * SUB);
    if (t->count == 0)
        return;
    float each = 1.0f / (float)t->count;
    for (int c = 0; c < 3; c++) {
        albedo[c] = sv_srgb8_from_linear(t->rgb[c] / all);
        normal[c] = unit_code(0.5f + 0.5f * t->normal[c] * each);
    }
    albedo[3] = unit_code((float)t->count / all);
    normal[3] = unit_code(t->occlusion * each);
}

/* Boils the samples of texel (i, j) of the frame down, and notes their depths. */
static void resolve_texel(struct bake *b, int i, int j, uint8_t albedo[4], uint8_t normal[4])
{
    struct texel texel = {{0}, {0}, 0, 0};
    for (int sj = j * SUB; sj < (j + 1) * SUB; sj++)
        for (int si = i * SUB; si < (i + 1) * SUB; si++) {
            size_t at = (size_t)sj * SV_RASTER_SIDE + (size_t)si;
            if (b->raster.triangle[at] == SV_RASTER_NONE)
                continue;
            add_sample(b, at, si, sj, &texel);
            const struct sv_tree_material *m = &b->raster.mesh->materials[b->raster.material[at]];
            b->translucency += (double)m->translucency;
            b->seen += 1;
            add_moment(b, 1, (double)(b->view.left + ((float)si + 0.5f) * b->view.step),
                       (double)(b->view.top - ((float)sj + 0.5f) * b->view.step),
                       (double)b->raster.depth[at]);
        }
    put_texel(&texel, albedo, normal);
}

/* Solves the 3 x 3 system by elimination with pivots; false when it is singular (nothing seen, or all on a
 * line). */
static bool solve(double m[3][4], double out[3])
{
    for (int k = 0; k < 3; k++) {
        int best = k;
        for (int i = k + 1; i < 3; i++)
            best = fabs(m[i][k]) > fabs(m[best][k]) ? i : best;
        for (int c = 0; c < 4; c++) {
            double swap = m[k][c];
            m[k][c] = m[best][c];
            m[best][c] = swap;
        }
        if (!(fabs(m[k][k]) > 1e-9 * (1 + fabs(m[0][0]))))
            return false;
        for (int i = 0; i < 3; i++) {
            double f = i == k ? 0 : m[i][k] / m[k][k];
            for (int c = k; c < 4; c++)
                m[i][c] -= f * m[k][c];
        }
    }
    for (int k = 0; k < 3; k++)
        out[k] = m[k][3] / m[k][k];
    return true;
}

/* The quad's plane; falls back to the plane square to the view through the axis' middle. */
static void fit_plane(struct bake *b, struct sv_impostor_frame *f)
{
    double across = 1 - (double)f->toward[2] * (double)f->toward[2], seen = b->moments[0][0];
    double plane[3] = {0.5 * (double)f->toward[2], 0, 0};
    add_moment(b, FOOT_WEIGHT * across * seen, 0, 0, 0);
    /* A little of "no slope", so that a bare pole still has an answer. */
    b->moments[1][1] += 1e-3 * seen;
    b->moments[2][2] += 1e-3 * seen;
    double fitted[3], total = b->moments[0][0];
    double mid[2] = {b->moments[0][1] / total, b->moments[0][2] / total};
    if (seen > 0 && solve(b->moments, fitted)) {
        double slope = sqrt(fitted[1] * fitted[1] + fitted[2] * fitted[2]);
        double hold = slope > SLOPE_MAX ? SLOPE_MAX / slope : 1;
        plane[1] = fitted[1] * hold;
        plane[2] = fitted[2] * hold;
        /* Holding the slope turns the plane about the middle of what is seen. */
        plane[0] = fitted[0] + (fitted[1] - plane[1]) * mid[0] + (fitted[2] - plane[2]) * mid[1];
    }
    float side = b->view.step * (float)SV_RASTER_SIDE;
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
    memset(b->moments, 0, sizeof b->moments);
    sv_raster_aim(&b->raster, &b->view);
    sv_raster_draw(&b->raster);
    int column = frame % SV_IMPOSTOR_GRID * SV_IMPOSTOR_CELL,
        row = frame / SV_IMPOSTOR_GRID * SV_IMPOSTOR_CELL;
    int lo[2] = {SV_IMPOSTOR_CELL, SV_IMPOSTOR_CELL}, hi[2] = {0, 0};
    for (int j = 0; j < SV_IMPOSTOR_CELL; j++)
        for (int i = 0; i < SV_IMPOSTOR_CELL; i++) {
            size_t at = 4 * ((size_t)(row + j) * SV_IMPOSTOR_SIDE + (size_t)(column + i));
            resolve_texel(b, i, j, b->out->albedo + at, b->out->normal + at);
            if (b->out->albedo[at + 3] == 0)
                continue;
            lo[0] = i < lo[0] ? i : lo[0];
            lo[1] = j < lo[1] ? j : lo[1];
            hi[0] = i + 1 > hi[0] ? i + 1 : hi[0];
            hi[1] = j + 1 > hi[1] ? j + 1 : hi[1];
        }
    fit_plane(b, f);
    f->s_min = (float)lo[0] / SV_IMPOSTOR_CELL;
    f->t_min = (float)lo[1] / SV_IMPOSTOR_CELL;
    f->s_max = (float)hi[0] / SV_IMPOSTOR_CELL;
    f->t_max = (float)hi[1] / SV_IMPOSTOR_CELL;
}

enum sv_status sv_impostor_bake(const struct sv_tree_mesh *mesh, struct sv_impostor *impostor,
                                struct sv_error *error)
{
    size_t texels = (size_t)SV_IMPOSTOR_SIDE * SV_IMPOSTOR_SIDE;
    struct sv_impostor made = {.albedo = calloc(texels, 4), .normal = calloc(texels, 4)};
    struct bake bake = {.out = &made};
    enum sv_status status = SV_OK;
    if (!made.albedo || !made.normal)
        status = sv_fail(error, SV_ENOMEM, "impostor", "no memory for an atlas");
    if (!status)
        status = sv_raster_init(mesh, &bake.raster, error);
    if (status) {
        sv_impostor_finish(&made);
        return status;
    }
    for (int k = 0; k < SV_IMPOSTOR_FRAMES; k++)
        bake_frame(&bake, k);
    made.translucency = bake.seen > 0 ? (float)(bake.translucency / bake.seen) : 0;
    made.spread = 1;
    sv_raster_finish(&bake.raster);
    *impostor = made;
    return SV_OK;
}
