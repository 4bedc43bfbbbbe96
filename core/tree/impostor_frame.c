/* impostor_frame.c - draws a mesh from a frame's direction and sums up sub x sub samples a texel.
 *
 * The plane of a frame (own derivation). A point seen at (x, y) of the frame's picture with depth d towards
 * the viewer is q = x right + y up + d toward. The quad puts it at q' = x right + y up + (a + b x + c y)
 * toward; from an eye that is off the frame's direction by a small angle e, q' is seen |d - (a + b x + c y)|
 * sin(e) from where q would be. So a, b, c are those of the least squares of that difference over all
 * samples, the stem's foot (0, 0, 0) counting as many samples, the more so the lower the view. b and c are
 * held below SLOPE_MAX: a steeper plane would be seen edge-on from places that the frame still serves. */
#include "core/tree/impostor_frame.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

/* tan of the steepest tilt of a quad against its frame: neighbours are at most 18 degrees apart, half of that
 * plus 60 stays well under 90. Own choice. */
static const double SLOPE_MAX = 1.2;
/* Share of the foot in a plane's fit at the horizon, against all samples together. */
static const double FOOT_WEIGHT = 0.35;

static float dot3(const float a[3], const float b[3])
{
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

/* Adds the seen sample (i, j) of the raster. */
static void add_sample(struct sv_frame_bake *b, size_t at, int i, int j, struct sv_frame_texel *texel)
{
    const struct sv_raster *r = &b->raster;
    const struct sv_tree_material *material = &r->mesh->materials[r->material[at]];
    const uint32_t *index = r->mesh->indices + r->triangle[at];
    const struct sv_tree_vertex *v[3];
    float w[3], n[3] = {0}, uv[2] = {0}, occlusion = 0, rgb[3], open[4] = {0};
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
        b->square[c] += (double)(bright * m[c] * m[c]);
    }
    b->square[3] += (double)(bright * m[0] * m[1]);
    b->square[4] += (double)(bright * m[0] * m[2]);
    b->square[5] += (double)(bright * m[1] * m[2]);
    b->weight += (double)bright;
    texel->occlusion += occlusion * (1.0f / 65535.0f);
    for (int c = 0; c < 4; c++)
        texel->open[c] += open[c];
    texel->depth += r->depth[at];
    texel->translucency += material->is_leaf ? material->translucency : 0;
    texel->count++;
}

/* Sums the samples of texel (i, j) up, and notes their depth. */
static void sum_texel(struct sv_frame_bake *b, double plane[SV_UNKNOWNS_MAX][SV_UNKNOWNS_MAX + 1], int i, int j)
{
    struct sv_frame_texel *t = &b->texels[(size_t)j * (size_t)b->cell + (size_t)i];
    memset(t, 0, sizeof *t);
    for (int sj = j * b->sub; sj < (j + 1) * b->sub; sj++)
        for (int si = i * b->sub; si < (i + 1) * b->sub; si++) {
            size_t at = (size_t)sj * (size_t)b->raster.width + (size_t)si;
            if (b->raster.triangle[at] != SV_RASTER_NONE)
                add_sample(b, at, si, sj, t);
        }
    if (!(t->count > 0))
        return;
    double count = (double)t->count, step = (double)b->view.step * b->sub;
    const double place[3] = {1, (double)b->view.left + (i + 0.5) * step,
                             (double)b->view.top - (j + 0.5) * step};
    sv_least_squares_add(plane, 3, place, (double)t->depth / count, count);
}

/* The quad's plane; falls back to the plane square to the view through the axis' middle. */
static void fit_plane(struct sv_frame_bake *b, double sums[SV_UNKNOWNS_MAX][SV_UNKNOWNS_MAX + 1],
                      struct sv_impostor_frame *f)
{
    double across = 1 - (double)f->toward[2] * (double)f->toward[2], seen = sums[0][0];
    double *plane = b->plane;
    const double square_to_view[3] = {0.5 * (double)f->toward[2], 0, 0};
    memcpy(plane, square_to_view, sizeof square_to_view);
    const double foot[3] = {1, 0, 0};
    sv_least_squares_add(sums, 3, foot, 0, FOOT_WEIGHT * across * seen);
    /* A little of "no slope", so that a bare pole still has an answer. */
    sums[1][1] += 1e-3 * seen;
    sums[2][2] += 1e-3 * seen;
    double fitted[SV_UNKNOWNS_MAX], total = sums[0][0];
    double mid[2] = {sums[0][1] / total, sums[0][2] / total};
    if (seen > 0 && sv_least_squares_solve(3, sums, fitted)) {
        double slope = sqrt(fitted[1] * fitted[1] + fitted[2] * fitted[2]);
        double hold = slope > SLOPE_MAX ? SLOPE_MAX / slope : 1;
        plane[1] = fitted[1] * hold;
        plane[2] = fitted[2] * hold;
        /* Holding the slope turns the plane about the middle of what is seen. */
        plane[0] = fitted[0] + (fitted[1] - plane[1]) * mid[0] + (fitted[2] - plane[2]) * mid[1];
    }
    float side = b->view.step * (float)b->raster.width;
    double at = plane[0] + plane[1] * (double)b->view.left + plane[2] * (double)b->view.top;
    for (int c = 0; c < 3; c++) {
        f->origin[c] = b->view.left * f->right[c] + b->view.top * f->up[c] + (float)at * f->toward[c];
        f->along_s[c] = side * (f->right[c] + (float)plane[1] * f->toward[c]);
        f->along_t[c] = -side * (f->up[c] + (float)plane[2] * f->toward[c]);
    }
    f->texels = (float)b->cell / side;
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

void sv_frame_bake_draw(struct sv_frame_bake *b, int index)
{
    struct sv_impostor_frame *f = &b->frame;
    double sums[SV_UNKNOWNS_MAX][SV_UNKNOWNS_MAX + 1] = {{0}};
    *f = (struct sv_impostor_frame){.texels = 0};
    set_basis(index, f);
    b->view = (struct sv_raster_view){.right = f->right, .up = f->up, .toward = f->toward};
    memset(b->square, 0, sizeof b->square);
    b->weight = 0;
    sv_raster_aim(&b->raster, &b->view);
    sv_raster_draw(&b->raster);
    const int empty[4] = {b->cell, 0, b->cell, 0};
    memcpy(b->box, empty, sizeof empty);
    for (int j = 0; j < b->cell; j++)
        for (int i = 0; i < b->cell; i++) {
            sum_texel(b, sums, i, j);
            if (!(b->texels[(size_t)j * (size_t)b->cell + (size_t)i].count > 0))
                continue;
            b->box[0] = i < b->box[0] ? i : b->box[0];
            b->box[1] = i + 1 > b->box[1] ? i + 1 : b->box[1];
            b->box[2] = j < b->box[2] ? j : b->box[2];
            b->box[3] = j + 1 > b->box[3] ? j + 1 : b->box[3];
        }
    fit_plane(b, sums, f);
    /* |c| = 3/16 + 15/16 c^2 + terms of fourth order and up, by Legendre polynomials. */
    for (int c = 0; c < 6; c++)
        f->scatter[c] =
            (c < 3 ? 3.0f / 16 : 0) + (b->weight > 0 ? (float)(15.0 / 16 * b->square[c] / b->weight)
                                       : c < 3       ? 5.0f / 16
                                                     : 0);
    f->s_min = (float)b->box[0] / (float)b->cell;
    f->s_max = (float)b->box[1] / (float)b->cell;
    f->t_min = (float)b->box[2] / (float)b->cell;
    f->t_max = (float)b->box[3] / (float)b->cell;
}

enum sv_status sv_frame_bake_init(const struct sv_tree_mesh *mesh, int cell, int sub,
                                  struct sv_frame_bake *bake, struct sv_error *error)
{
    *bake = (struct sv_frame_bake){.cell = cell, .sub = sub};
    bake->texels = malloc((size_t)cell * (size_t)cell * sizeof *bake->texels);
    if (!bake->texels)
        return sv_fail(error, SV_ENOMEM, "impostor", "no memory for a frame of %d x %d", cell, cell);
    enum sv_status status = sv_raster_init(mesh, cell * sub, cell * sub, &bake->raster, error);
    if (status)
        sv_frame_bake_finish(bake);
    return status;
}

void sv_frame_bake_finish(struct sv_frame_bake *bake)
{
    sv_raster_finish(&bake->raster);
    free(bake->texels);
    *bake = (struct sv_frame_bake){.texels = NULL};
}
