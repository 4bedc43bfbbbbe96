/* sweep.c - see sweep.h: a face as the kernels take it, the blocks, and the column kernel in plain loops. */
#include "core/cell/sweep.h"

#include <assert.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "core/base/simd.h"
#include "core/cell/sweep_kernel.h"

/* ---- blocks ---- */

struct sv_sweep_blocks {
    int width, height; /* blocks */
    float *top;
};

static int blocks_of(int samples)
{
    return (samples - 2) / SV_SWEEP_BLOCK + 1;
}

static float block_top(const struct sv_heightfield *f, int bi, int bj)
{
    int i0 = bi * SV_SWEEP_BLOCK, j0 = bj * SV_SWEEP_BLOCK;
    int i1 = i0 + SV_SWEEP_BLOCK < f->width ? i0 + SV_SWEEP_BLOCK : f->width - 1;
    int j1 = j0 + SV_SWEEP_BLOCK < f->height ? j0 + SV_SWEEP_BLOCK : f->height - 1;
    float top = -INFINITY;
    for (int j = j0; j <= j1; j++)
        for (int i = i0; i <= i1; i++) {
            float h = f->h[(size_t)j * (size_t)f->width + (size_t)i];
            top = h > top ? h : top;
        }
    return top;
}

enum sv_status sv_sweep_blocks_create(const struct sv_heightfield *field, struct sv_sweep_blocks **blocks,
                                      struct sv_error *error)
{
    int w = blocks_of(field->width), h = blocks_of(field->height);
    struct sv_sweep_blocks *made = malloc(sizeof *made);
    float *top = malloc((size_t)w * (size_t)h * sizeof *top);
    if (!made || !top) {
        free(made);
        free(top);
        return sv_fail(error, SV_ENOMEM, "terrain", "no memory for %d x %d blocks of heights", w, h);
    }
    for (int j = 0; j < h; j++)
        for (int i = 0; i < w; i++)
            top[(size_t)j * (size_t)w + (size_t)i] = block_top(field, i, j);
    *made = (struct sv_sweep_blocks){w, h, top};
    *blocks = made;
    return SV_OK;
}

void sv_sweep_blocks_destroy(struct sv_sweep_blocks *blocks)
{
    if (!blocks)
        return;
    free(blocks->top);
    free(blocks);
}

/* Rounding of a tangent is below 4 of its 2^-24; this is far above. */
#define TANGENT_SLACK 1e-5
/* Of a place across, in samples: sv_sweep_job's places are good to 2^-10 (16384 samples in 24 bits). */
#define PLACE_SLACK 0.01f

int sv_sweep_hidden(const struct sv_sweep_job *job, int g, float low, float high, float tangent)
{
    int end = g + SV_SWEEP_BLOCK < job->lines - 1 ? g + SV_SWEEP_BLOCK : job->lines - 1;
    int row = (job->reversed ? job->lines - 1 - end : g) / SV_SWEEP_BLOCK;
    float last = (float)(job->across - 2);
    low = low - PLACE_SLACK + (float)job->base;
    high = high + PLACE_SLACK + (float)job->base;
    int b0 = low > 0 ? (int)(low < last ? low : last) / SV_SWEEP_BLOCK : 0;
    int b1 = high > 0 ? (int)(high < last ? high : last) / SV_SWEEP_BLOCK : 0;
    const float *top = job->block + (ptrdiff_t)row * job->block_line;
    float most = top[(ptrdiff_t)b0 * job->block_side];
    for (int b = b0 + 1; b <= b1; b++) {
        float t = top[(ptrdiff_t)b * job->block_side];
        most = t > most ? t : most;
    }
    double above = (double)most - job->eye_h - job->eye_h_low;
    double at = sv_sweep_line_m(job, above > 0 ? g : end);
    return above < (tangent - TANGENT_SLACK * fabsf(tangent)) * at;
}

/* ---- a face ---- */

/* What a face is in terms of the field's rows and columns. */
struct grain {
    int lines, across, line, side; /* strides in field order */
    double eye_line, eye_side;     /* in field order, samples */
    double step_m, side_m;
    int block_line, block_side;
    bool reversed;
    double right; /* a step to the right is that far up the side's order */
};

static struct grain grain_of(const struct sv_sweep *sweep)
{
    const struct sv_heightfield *f = sweep->field;
    double x = (sweep->v.x - f->x0) / f->dx, y = (sweep->v.y - f->y0) / f->dy;
    int w = f->width, h = f->height, blocks = blocks_of(w);
    bool east_west = sweep->face == SV_CELL_EAST || sweep->face == SV_CELL_WEST;
    struct sv_vec3 right, up, forward;
    sv_cell_face_axes(sweep->face, &right, &up, &forward);
    struct grain g = east_west
                         ? (struct grain){w, h, 1, w, x, y, f->dx, f->dy, 1, blocks, forward.x < 0, right.y}
                         : (struct grain){h, w, w, 1, y, x, f->dy, f->dx, blocks, 1, forward.y < 0, right.x};
    return g;
}

/* Lines in the order in which the eye meets them, the eye's height split, and where the profile begins;
 * false: no ground beyond the plane. */
static bool set_job(const struct sv_sweep *sweep, const struct grain *g, struct sv_sweep_job *job)
{
    const struct sv_heightfield *f = sweep->field;
    double eye_h = sweep->v.z - f->z0;
    *job = (struct sv_sweep_job){.h = f->h + (g->reversed ? (size_t)(g->lines - 1) * (size_t)g->line : 0),
                                 .line = g->reversed ? -g->line : g->line,
                                 .side = g->side,
                                 .lines = g->lines,
                                 .across = g->across,
                                 .flip = g->reversed ? (g->lines + 1) & 1 : 0,
                                 .eye_line = g->reversed ? g->lines - 1 - g->eye_line : g->eye_line,
                                 .step_m = g->step_m,
                                 .eye_side = g->eye_side,
                                 .eye_h = (float)eye_h,
                                 .distance_m = (float)sweep->distance_m,
                                 .size = sweep->size,
                                 .block = sweep->blocks ? sweep->blocks->top : NULL,
                                 .block_line = g->block_line,
                                 .block_side = g->block_side,
                                 .reversed = g->reversed};
    job->eye_h_low = (float)(eye_h - (double)job->eye_h);
    double begin = job->eye_line + sweep->distance_m / g->step_m;
    if (!(begin < g->lines - 1) || !(fabs(g->eye_side) < 1e9))
        return false;
    job->first = begin > 0 ? (int)begin : 0;
    job->begin = begin > 0 ? (float)(begin - job->first) : 0;
    job->base = (int32_t)floor(g->eye_side);
    job->place = (float)(g->eye_side - job->base);
    return true;
}

void sv_sweep_by(const struct sv_sweep *sweep, sv_sweep_columns *columns, float *q)
{
    static const int LANES = 8;
    float tangent[SV_SWEEP_SIZE_MAX + 1], drift[SV_SWEEP_SIZE_MAX + 8];
    int n = sweep->size;
    struct grain grain = grain_of(sweep);
    struct sv_sweep_job job;
    assert(n >= 1 && n <= SV_SWEEP_SIZE_MAX && sweep->distance_m > 0 && sweep->reach >= 1 &&
           sweep->reach <= 1.25);
    memset(q, 0, (size_t)n * (size_t)n * sizeof *q);
    if (!set_job(sweep, &grain, &job))
        return;
    double texel = 2 * sweep->reach / n, first = 0.5 * texel - sweep->reach;
    for (int k = 0; k < n; k++) {
        tangent[k] = (float)(first + (k - sweep->shift_y) * texel);
        drift[k] = (float)((first + (k + sweep->shift_x) * texel) * grain.right / grain.side_m);
    }
    tangent[n] = INFINITY;
    for (int k = n; k < n + LANES; k++)
        drift[k] = drift[n - 1];
    job.tangent = tangent;
    job.drift = drift;
    job.q = q;
    for (int k = 0; k < n; k += LANES) {
        double widest = fmax(fabs((double)drift[k]), fabs((double)drift[k + LANES - 1]));
        job.substeps = (int)(widest * job.step_m) + 1;
        columns(&job, k);
    }
}

void sv_sweep(const struct sv_sweep *sweep, float *q)
{
    if (sweep->face == SV_CELL_DOWN || sweep->face == SV_CELL_UP)
        sv_sweep_steep(sweep, q);
    else
        sv_sweep_by(sweep, sv_simd_level() == SV_SIMD_AVX2 ? sv_sweep_columns_avx2 : sv_sweep_columns_scalar,
                    q);
}

/* ---- columns ---- */

int sv_sweep_end(const struct sv_sweep_job *job, int column, int count)
{
    double last = 0;
    for (int k = column; k < column + count; k++) {
        double drift = (double)job->drift[k];
        double way = drift > 0 ? job->across - 1 - job->eye_side : job->eye_side;
        double out = drift != 0 ? way / fabs(drift) : INFINITY; /* m forward */
        last = out > last ? out : last;
    }
    double end = job->eye_line + last / job->step_m + 2; /* a strip more than is left, for rounding */
    return end < job->lines - 1 ? (int)end : job->lines - 1;
}

float sv_sweep_corner(const float n[2], const float f[2], float u, float v, int anti)
{
    if (u == 0)
        return n[0] + (n[1] - n[0]) * v; /* as the far line of the strip before has it */
    if (anti && u + v <= 1)
        return (n[0] + u * (f[0] - n[0])) + v * (n[1] - n[0]);
    if (anti)
        return (f[1] - (1 - u) * (f[1] - n[1])) - (1 - v) * (f[1] - f[0]);
    if (u >= v)
        return (n[0] + u * (f[0] - n[0])) + v * (f[1] - f[0]);
    return (n[0] + v * (n[1] - n[0])) + u * (f[1] - n[1]);
}

/* A column's walk: the next row to be filled, and the profile's last corner. */
struct walk {
    int row;
    float t, inverse_s; /* t NaN: the profile begins here */
};

/* The profile goes on to (t, 1 / s): rows that it rises to, by q affine in the tangent. */
static void go_on(const struct sv_sweep_job *job, int column, float h, float s, struct walk *w)
{
    float inverse_s = 1.0f / s, t = h * inverse_s;
    if (job->tangent[w->row] <= t) {
        bool begins = !(w->t == w->t);
        float slope = (inverse_s - w->inverse_s) / (t - w->t);
        for (; job->tangent[w->row] <= t; w->row++) {
            float q = (w->inverse_s + (job->tangent[w->row] - w->t) * slope) * job->distance_m;
            if (!begins)
                job->q[(size_t)(job->size - 1 - w->row) * (size_t)job->size + (size_t)column] = q < 1 ? q : 1;
        }
    }
    w->t = t;
    w->inverse_s = inverse_s;
}

/* A sample's height above the eye; NaN outside of the field. */
static float sample(const struct sv_sweep_job *job, int line, int c)
{
    c += job->base;
    if (c < 0 || c >= job->across)
        return NAN;
    return (job->h[(ptrdiff_t)line * job->line + (ptrdiff_t)c * job->side] - job->eye_h) - job->eye_h_low;
}

struct cell {
    int c;
    float n[2], f[2];
};

static void enter(const struct sv_sweep_job *job, int g, int c, struct cell *cell)
{
    *cell = (struct cell){
        c, {sample(job, g, c), sample(job, g, c + 1)}, {sample(job, g + 1, c), sample(job, g + 1, c + 1)}};
}

static int is_anti(const struct sv_sweep_job *job, int g, int c)
{
    return (g + c + job->base + job->flip) & 1;
}

/* Where the azimuth v0 + u dv crosses the cell's diagonal: the corner there, if it lies between two u. */
static void cross_diagonal(const struct sv_sweep_job *job, int column, int g, const struct cell *cell,
                           float v0, float dv, float from, float to, float near, struct walk *w)
{
    int anti = is_anti(job, g, cell->c);
    float v = v0 - (float)cell->c;
    float u = anti ? (1 - v) / (1 + dv) : v / (1 - dv);
    float p = anti ? cell->n[1] : cell->n[0], q = anti ? cell->f[0] : cell->f[1];
    if (u > from && u < to)
        go_on(job, column, p + (q - p) * u, near + u * (float)job->step_m, w);
}

/* The part of strip g from u = from to u = to, in which at most one line along the view is crossed. */
static void pass(const struct sv_sweep_job *job, int column, int g, float from, float to, float near,
                 float v0, float v1, struct cell *cell, struct walk *w)
{
    float dv = job->drift[column] * (float)job->step_m;
    float v = to == 1 ? v1 : v0 + dv * to;
    int c = (int)floorf(v);
    int turn = c > cell->c ? 1 : c < cell->c ? -1 : 0;
    if (turn == 0) {
        cross_diagonal(job, column, g, cell, v0, dv, from, to, near, w);
    } else {
        int side = turn > 0;
        float u = ((float)(cell->c + side) - v0) / dv;
        u = u > from ? u : from;
        u = u < to ? u : to;
        cross_diagonal(job, column, g, cell, v0, dv, from, u, near, w);
        float n = cell->n[side], f = cell->f[side];
        go_on(job, column, n + (f - n) * u, near + u * (float)job->step_m, w);
        cell->c += turn;
        int outer = cell->c + side;
        cell->n[!side] = n;
        cell->f[!side] = f;
        cell->n[side] = sample(job, g, outer);
        cell->f[side] = sample(job, g + 1, outer);
        cross_diagonal(job, column, g, cell, v0, dv, u, to, near, w);
    }
}

static float place_at(const struct sv_sweep_job *job, int column, double line_m)
{
    return job->place + (float)line_m * job->drift[column];
}

static void walk_column(const struct sv_sweep_job *job, int column)
{
    const int end = sv_sweep_end(job, column, 1);
    const float step = (float)job->step_m, part = 1 / (float)job->substeps;
    struct walk w = {.t = NAN};
    struct cell cell;
    bool entered = false;
    for (int g = job->first; g < end && w.row < job->size; g++) {
        double near_m = sv_sweep_line_m(job, g), far_m = sv_sweep_line_m(job, g + 1);
        float near = (float)near_m, far = (float)far_m;
        float v0 = place_at(job, column, near_m), v1 = place_at(job, column, far_m);
        float u = g == job->first ? job->begin : 0, tangent = job->tangent[w.row];
        if (g > job->first && sv_sweep_at_block(job, g)) {
            float v8 = place_at(job, column, sv_sweep_line_m(job, g + SV_SWEEP_BLOCK));
            if (sv_sweep_hidden(job, g, fminf(v0, v8), fmaxf(v0, v8), tangent)) {
                g += SV_SWEEP_BLOCK - 1;
                entered = false;
                continue;
            }
        }
        if (!entered) {
            float v = u > 0 ? v0 + job->drift[column] * step * u : v0, s = near + u * step;
            enter(job, g, (int)floorf(v), &cell);
            go_on(job, column, sv_sweep_corner(cell.n, cell.f, u, v - (float)cell.c, is_anti(job, g, cell.c)),
                  s, &w);
            entered = true;
        } else {
            cell.n[0] = cell.f[0];
            cell.n[1] = cell.f[1];
            cell.f[0] = sample(job, g + 1, cell.c);
            cell.f[1] = sample(job, g + 1, cell.c + 1);
        }
        for (int k = 1; k <= job->substeps; k++) {
            float to = k < job->substeps ? (float)k * part : 1;
            if (to > u) {
                pass(job, column, g, u, to, near, v0, v1, &cell, &w);
                u = to;
            }
        }
        go_on(job, column, cell.f[0] + (cell.f[1] - cell.f[0]) * (v1 - (float)cell.c), far, &w);
    }
}

void sv_sweep_columns_scalar(const struct sv_sweep_job *job, int column)
{
    for (int k = column; k < column + 8 && k < job->size; k++)
        walk_column(job, k);
}
