/* object_splat.c - splats one sheet of an object: the kernels of warp.h (same pixels, same bits), walked tile
 * row by tile row over the tiles that may face the eye, and without the cells that need not be drawn.
 *
 * A cell that lacks one of its four texels is drawn piece by piece, some thirty times as dear as a full one.
 * Where a face's kept texels end because another face goes on with the surface, what such a cell would add is
 * drawn there: the `rims` of an object (object_rims.c) tell which cells are needed. */
#include "core/relief/object_splat.h"

#include <math.h>
#include <string.h>

#include "core/relief/object_splat_kernel.h"

enum { COLUMNS = SV_WARP_STRIP, BEYOND = 8 /* entries that vector stores may run over */ };

static void set_nothing(struct sv_warp_row *row, int from, int to)
{
    for (int i = from; i < to; i++) {
        row->x[i] = row->y[i] = row->d[i] = 0;
        row->t[i] = NAN;
    }
}

/* Texels first .. first + n - 1 of row j; what lies outside of the source is nothing. */
static uint32_t load_row(const struct sv_warp_kernel *kernel, const struct sv_warp_source *source, int first,
                         int n, int j, struct sv_warp_row *row)
{
    struct sv_warp_line line;
    int from = first < 0 ? -first : 0, to = first + n > source->width ? source->width - first : n;
    row->min_x = row->min_y = INFINITY;
    row->max_x = row->max_y = -INFINITY;
    if (j < 0 || j >= source->height) {
        set_nothing(row, 0, n + BEYOND);
        return 0;
    }
    set_nothing(row, 0, from);
    set_nothing(row, to, n + BEYOND);
    for (int k = 0; k < 4; k++) {
        const double *m = source->map.m[k];
        line.base[k] = (float)(m[0] * (first + 0.5) + m[1] * (j + 0.5) + m[3]);
        line.du[k] = (float)m[0];
        line.dt[k] = (float)m[2];
    }
    size_t texel = (size_t)j * (size_t)source->width + (size_t)(first + from);
    return kernel->project(&line, source->t + texel, source->color + texel, to - from, from, row);
}

static struct sv_relief_corners corners_of(const struct sv_warp_job *job, const struct sv_warp_row *up,
                                           const struct sv_warp_row *lo, int c)
{
    struct sv_relief_corners q = {.texel = job->tag0 + (uint32_t)c};
    for (int k = 0; k < 4; k++) {
        const struct sv_warp_row *row = k < 2 ? up : lo;
        q.x[k] = row->x[c + (k & 1)];
        q.y[k] = row->y[c + (k & 1)];
        q.d[k] = row->d[c + (k & 1)];
    }
    return q;
}

static bool is_full(const struct sv_warp_row *up, const struct sv_warp_row *lo, int c, float cut)
{
    return fabsf(up->t[c] - up->t[c + 1]) <= cut && fabsf(lo->t[c] - lo->t[c + 1]) <= cut &&
           fabsf(up->t[c] - lo->t[c]) <= cut && fabsf(up->t[c + 1] - lo->t[c + 1]) <= cut;
}

/* Half-edge from texel k of a cell to its neighbour `way` (0 along the row, 1 along the column): to the
 * middle between them where they are one surface, else flat on at the texel's own t. step: +1 or -1 texel. */
static void half_edge(const struct sv_warp_job *job, const float here[3], const float there[3], bool joined,
                      int way, float step, float inverse_w, float out[3])
{
    for (int k = 0; k < 3; k++) {
        const double *m = job->source->map.m[k];
        float flat = ((float)m[way] - here[k] * (float)job->source->map.m[3][way]) * inverse_w * step;
        out[k] = 0.5f * (joined ? there[k] - here[k] : flat);
    }
}

/* What a splat holds on to. */
struct work {
    const struct sv_warp_kernel *kernel;
    struct sv_warp_job job;
    bool wide; /* AVX2: small full cells, and quarters of others, wait until eight are together */
    struct sv_relief_waiting waiting, quarters;
    uint16_t listed[SV_RELIEF_WAITING_ROOM];
};

/* Pixels from (x0, y0) to (x1, y1) may be written. */
static void touch(struct sv_warp_buffer *buffer, float x0, float y0, float x1, float y1)
{
    float w = (float)buffer->width, h = (float)buffer->height;
    if (x1 >= 0 && y1 >= 0 && x0 <= w && y0 <= h)
        sv_warp_touch(buffer, (int)sv_relief_max2(x0 - 1, 0), (int)sv_relief_max2(y0 - 1, 0),
                      (int)sv_relief_min2(x1 + 2, w), (int)sv_relief_min2(y1 + 2, h));
}

/* Depth that a flat surface would have beyond what there is. */
static float held_depth(float d)
{
    return sv_relief_min2(sv_relief_max2(d, 0), 1);
}

/* Draws quarter k by its edges, or lets it wait. One that is turned away or seen edge-on is not drawn: bodies
 * are closed. */
static void take_quarter(struct work *work, int k, const float here[3], const float e1[3], const float e2[3],
                         uint32_t texel)
{
    float det = e1[0] * e2[1] - e1[1] * e2[0];
    float size = fabsf(e1[0]) + fabsf(e1[1]) + fabsf(e2[0]) + fabsf(e2[1]);
    if (!((k == 1 || k == 2 ? -det : det) > size * size * SV_RELIEF_EDGE_ON) ||
        !(size <= 2 * SV_RELIEF_LARGE_PX))
        return;
    const struct sv_relief_corners q = {
        .x = {here[0], here[0] + e1[0], here[0] + e2[0], here[0] + e1[0] + e2[0]},
        .y = {here[1], here[1] + e1[1], here[1] + e2[1], here[1] + e1[1] + e2[1]},
        .d = {here[2], held_depth(here[2] + e1[2]), held_depth(here[2] + e2[2]),
              held_depth(here[2] + e1[2] + e2[2])},
        .texel = texel,
    };
    struct sv_relief_waiting *w = &work->quarters;
    touch(work->job.buffer, sv_relief_least(q.x), sv_relief_least(q.y), sv_relief_most(q.x),
          sv_relief_most(q.y));
    if (!work->wide || size > SV_WARP_SMALL - 1) { /* of `size` px: at most SV_WARP_SMALL pixels a side */
        sv_relief_draw_quarter(&work->job, &q, k, work->wide);
        return;
    }
    for (int i = 0; i < 4; i++)
        w->x[i][w->count] = q.x[i], w->y[i][w->count] = q.y[i], w->d[i][w->count] = q.d[i];
    w->texel[w->count] = texel;
    w->needed[w->count++] = (uint32_t)k;
    if (w->count == SV_RELIEF_WAITING) {
        sv_relief_draw_quarters_avx2(&work->job, w, w->count);
        w->count = 0;
    }
}

/* A cell that is not full, piece by piece. */
static void draw_quarters(struct work *work, const struct sv_warp_row *up, const struct sv_warp_row *lo,
                          int c)
{
    const struct sv_warp_job *job = &work->job;
    for (int k = 0; k < 4; k++) {
        const struct sv_warp_row *row = k < 2 ? up : lo, *other = k < 2 ? lo : up;
        int e = c + (k & 1), beside = c + 1 - (k & 1);
        if (!(row->t[e] == row->t[e]))
            continue;
        const double *m = job->source->map.m[3];
        double u = job->column + e + 0.5, v = job->row + (k >> 1) + 0.5;
        float inverse_w = (float)(1 / (m[0] * u + m[1] * v + m[2] * (double)row->t[e] + m[3])),
              cut = job->source->cut, e1[3], e2[3];
        const float here[3] = {row->x[e], row->y[e], row->d[e]},
                    across[3] = {row->x[beside], row->y[beside], row->d[beside]};
        const float along[3] = {other->x[e], other->y[e], other->d[e]};
        half_edge(job, here, across, fabsf(row->t[e] - row->t[beside]) <= cut, 0, k & 1 ? -1 : 1, inverse_w,
                  e1);
        half_edge(job, here, along, fabsf(row->t[e] - other->t[e]) <= cut, 1, k >> 1 ? -1 : 1, inverse_w, e2);
        take_quarter(work, k, here, e1, e2,
                     job->tag0 + (uint32_t)e + (uint32_t)(k >> 1) * (uint32_t)job->source->width);
    }
}

static void draw_full_cell(struct work *work, const struct sv_warp_row *up, const struct sv_warp_row *lo,
                           int c)
{
    struct sv_relief_corners q = corners_of(&work->job, up, lo, c);
    if (!sv_relief_draw_quad(&work->job, &q, work->wide) && !sv_relief_draw_full(&work->job, &q))
        sv_warp_cell(&work->job, up, lo, c);
}

/* Cells that are drawn one by one, of those between two rows. */
static void draw_left(struct work *work, const struct sv_warp_row *up, const struct sv_warp_row *lo, int n,
                      const uint8_t *rim)
{
    int listed = work->kernel->cells(&work->job, up, lo, n, work->listed);
    for (int k = 0; k < listed; k++) {
        int c = work->listed[k];
        bool full = is_full(up, lo, c, work->job.source->cut);
        if (rim[c] != (full ? SV_RELIEF_CELL_FULL : SV_RELIEF_CELL_RIM))
            continue; /* not needed, or not full only for what is turned away */
        if (full)
            draw_full_cell(work, up, lo, c);
        else
            draw_quarters(work, up, lo, c);
    }
}

/* Draws the first `count` cells that wait, and moves the others to their place. */
static void draw_waiting(struct work *work, int count)
{
    struct sv_relief_waiting *w = &work->waiting;
    int listed = sv_relief_draw_waiting_avx2(&work->job, w, count, work->listed), rest = w->count - count;
    for (int k = 0; k < listed; k++) {
        int at = work->listed[k];
        struct sv_relief_corners q = {.texel = w->texel[at]};
        for (int i = 0; i < 4; i++)
            q.x[i] = w->x[i][at], q.y[i] = w->y[i][at], q.d[i] = w->d[i][at];
        sv_relief_draw_full(&work->job, &q); /* small */
    }
    for (int i = 0; i < 4; i++) {
        memmove(w->x[i], w->x[i] + count, (size_t)rest * sizeof(float));
        memmove(w->y[i], w->y[i] + count, (size_t)rest * sizeof(float));
        memmove(w->d[i], w->d[i] + count, (size_t)rest * sizeof(float));
    }
    memmove(w->texel, w->texel + count, (size_t)rest * sizeof(uint32_t));
    memmove(w->needed, w->needed + count, (size_t)rest * sizeof(uint32_t));
    w->count = rest;
}

static void put_off(struct work *work, const struct sv_warp_row *up, const struct sv_warp_row *lo, int n,
                    const uint8_t *rim)
{
    int listed = sv_relief_put_off_avx2(&work->job, up, lo, n, rim, &work->waiting, work->listed);
    for (int k = 0; k < listed; k++) {
        int c = work->listed[k];
        if (rim[c] == SV_RELIEF_CELL_FULL)
            draw_full_cell(work, up, lo, c);
        else
            draw_quarters(work, up, lo, c);
    }
    if (work->waiting.count >= SV_RELIEF_WAITING)
        draw_waiting(work, work->waiting.count & ~7);
}

/* Cells between two rows; rim: of the first cell. */
static void draw_cells(struct work *work, const struct sv_warp_row *up, const struct sv_warp_row *lo, int n,
                       const uint8_t *rim)
{
    struct sv_warp_buffer *buffer = work->job.buffer;
    float x0 = sv_relief_min2(up->min_x, lo->min_x), x1 = sv_relief_max2(up->max_x, lo->max_x);
    float y0 = sv_relief_min2(up->min_y, lo->min_y), y1 = sv_relief_max2(up->max_y, lo->max_y);
    const float reach = SV_RELIEF_LARGE_PX; /* of what a cell covers beyond its texels' centres */
    if (!(x0 <= x1) || !(x1 >= -reach && y1 >= -reach && x0 <= (float)buffer->width + reach &&
                         y0 <= (float)buffer->height + reach))
        return;
    if (work->wide)
        put_off(work, up, lo, n, rim);
    else
        draw_left(work, up, lo, n, rim);
    touch(buffer, x0, y0, x1, y1); /* full cells; others do so for themselves */
}

static const struct sv_warp_kernel *kernel_of(enum sv_simd level)
{
    switch (level) {
    case SV_SIMD_SCALAR:
        return &sv_warp_scalar;
    case SV_SIMD_SSE2:
        return &sv_warp_sse2;
    case SV_SIMD_AVX2:
        return &sv_warp_avx2;
    }
    return &sv_warp_scalar;
}

/* The cells at texels of a span, in columns column .. column + n. */
static void splat_strip(struct work *work, const struct sv_relief_span *span, int column, int n,
                        const struct sv_relief_facing *facing, const uint8_t *rims, unsigned k,
                        struct sv_warp_stats *stats)
{
    const struct sv_warp_source *source = work->job.source;
    const size_t stride = (size_t)source->width + 1; /* cells of a row: column -1 first */
    struct sv_warp_row rows[2];
    uint8_t front[3][SV_RELIEF_FRONT];
    work->job.column = column;
    for (int j = span->row0 - 2; j <= span->row1 + 1; j++) {
        uint8_t *of_row = front[(j + 3) % 3];
        if (work->wide)
            sv_relief_front_avx2(facing, source, column - 1, n + 3, j, of_row);
        else
            sv_relief_front_scalar(facing, source, column - 1, n + 3, j, of_row);
        int i = j - 1; /* whose neighbours are known now */
        if (i < span->row0 - 1)
            continue;
        uint8_t *const around[3] = {front[(i + 2) % 3], front[(i + 3) % 3], of_row};
        struct sv_warp_row *up = &rows[(i + 1) & 1], *lo = &rows[i & 1];
        uint32_t solid = load_row(work->kernel, source, column, n + 1, i, lo);
        if (work->wide)
            sv_relief_drop_avx2(around, n + 1, lo);
        else
            sv_relief_drop_scalar(around, n + 1, lo);
        if (i < span->row0)
            continue;
        stats->texels += solid;
        work->job.row = i - 1;
        work->job.tag0 = (uint32_t)k << SV_WARP_TEXEL_BITS;
        work->job.tag0 += (uint32_t)((i - 1) * source->width + column);
        draw_cells(work, up, lo, n, rims + (size_t)i * stride + (size_t)(column + 1));
    }
}

void sv_relief_splat_at(enum sv_simd level, const struct sv_warp_source *source, unsigned k,
                        const uint8_t *rims, const struct sv_relief_facing *facing,
                        const struct sv_relief_span *spans, int span_count, struct sv_warp_buffer *buffer,
                        struct sv_warp_stats *stats)
{
    struct work work;
    work.kernel = kernel_of(level);
    work.job = (struct sv_warp_job){.source = source,
                                    .buffer = buffer,
                                    .budget = (int64_t)SV_WARP_LAYERS * buffer->width * buffer->height};
    work.wide = level == SV_SIMD_AVX2;
    work.waiting.count = work.quarters.count = 0; /* and nothing more: the rest is large */
    for (int s = 0; s < span_count; s++) {
        const struct sv_relief_span *span = &spans[s];
        for (int column = span->column0 - 1; column < span->column1; column += COLUMNS) {
            int left = span->column1 - column, n = left < COLUMNS ? left : COLUMNS;
            splat_strip(&work, span, column, n, facing, rims, k, stats);
        }
    }
    if (work.waiting.count > 0)
        draw_waiting(&work, work.waiting.count);
    if (work.quarters.count > 0)
        sv_relief_draw_quarters_avx2(&work.job, &work.quarters, work.quarters.count);
    stats->pixels += work.job.pixels;
}

void sv_relief_splat(const struct sv_warp_source *source, unsigned k, const uint8_t *rims,
                     const struct sv_relief_facing *facing, const struct sv_relief_span *spans,
                     int span_count, struct sv_warp_buffer *buffer, struct sv_warp_stats *stats)
{
    sv_relief_splat_at(sv_simd_level(), source, k, rims, facing, spans, span_count, buffer, stats);
}
