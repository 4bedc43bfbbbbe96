/* object_splat.c - splats one sheet of an object: the kernels of warp.h (same pixels, same bits), walked tile
 * row by tile row over the tiles that may face the eye, and without the cells that need not be drawn.
 *
 * A cell that lacks one of its four texels is drawn piece by piece, some thirty times as dear as a full one.
 * Where a face's kept texels end because another face goes on with the surface, what such a cell would add is
 * drawn there: the `rims` of an object (object_rims.c) tell which cells are needed. */
#include "core/relief/object_splat.h"

#include "core/relief/warp_kernel.h"

/* Cells larger than this are rare, and drawn row by row. */
#define LARGE_PX 64.0f
/* |e1 x e2| over the square of all their lengths, below which a cell is seen edge-on: 0.05 px wide at 10 px.
 */
#define EDGE_ON (1.0f / 4096)
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

/* A triangle in the picture by one corner and its two edges, with depth and place (in a texel or a cell). */
struct triangle {
    float x, y, d, e1[3], e2[3]; /* e: by x, y, d */
    float s, r, s1, r2;          /* place of the corner; what edge 1 adds to s, edge 2 to r */
    float turn;                  /* sign of edge 1 x edge 2 when it faces the eye */
    bool doubled;                /* the parallelogram instead */
    uint32_t texel, full;
};

/* Narrows [lo, hi] to where a + b x >= 0. */
static void clip_row(float a, float b, float *lo, float *hi)
{
    float at = -a / b;
    *lo = b > 0 && at > *lo ? at : *lo;
    *hi = b < 0 && at < *hi ? at : *hi;
    if (b == 0 && a < 0)
        *hi = -INFINITY;
}

static void draw_run(struct sv_warp_job *job, const struct triangle *t, size_t p, int count, float s,
                     float ds, float r, float dr)
{
    struct sv_warp_pixels to = sv_warp_pixels_of(job->buffer);
    for (int i = 0; i < count; i++, p++, s += ds, r += dr) {
        float d = fminf(fmaxf(t->d + s * t->e1[2] + r * t->e2[2], 0), 1);
        job->pixels +=
            sv_warp_put(to, p, d, t->texel, sv_warp_place(t->s + s * t->s1, t->r + r * t->r2, t->full));
    }
}

/* Pixels whose centres it holds. One that is turned away or seen edge-on is not drawn: bodies are closed. */
static void draw_triangle(struct sv_warp_job *job, const struct triangle *t)
{
    const struct sv_warp_buffer *b = job->buffer;
    float det = t->e1[0] * t->e2[1] - t->e1[1] * t->e2[0], both = t->doubled ? t->e1[1] + t->e2[1] : 0;
    float top = fminf(fminf(0, t->e1[1]), fminf(t->e2[1], both)),
          bottom = fmaxf(fmaxf(0, t->e1[1]), fmaxf(t->e2[1], both));
    float size = fabsf(t->e1[0]) + fabsf(t->e1[1]) + fabsf(t->e2[0]) + fabsf(t->e2[1]);
    if (!(det * t->turn > size * size * EDGE_ON) || !(size <= LARGE_PX))
        return;
    float inverse = 1 / det, s_x = t->e2[1] * inverse, s_y = -t->e2[0] * inverse;
    float r_x = -t->e1[1] * inverse, r_y = t->e1[0] * inverse;
    int j0 = (int)fmaxf(ceilf(t->y + top - 0.5f), 0),
        j1 = (int)fminf(t->y + bottom - 0.5f, (float)b->height - 1);
    for (int j = j0; j <= j1; j++) {
        float dy = (float)j + 0.5f - t->y, s0 = dy * s_y, r0 = dy * r_y;
        float lo = 0.5f - t->x, hi = (float)b->width - 0.5f - t->x; /* dx of the first and last column */
        clip_row(s0 + SV_WARP_EDGE, s_x, &lo, &hi);
        clip_row(r0 + SV_WARP_EDGE, r_x, &lo, &hi);
        if (t->doubled) {
            clip_row(1 + SV_WARP_EDGE - s0, -s_x, &lo, &hi);
            clip_row(1 + SV_WARP_EDGE - r0, -r_x, &lo, &hi);
        } else {
            clip_row(1 + SV_WARP_EDGE - s0 - r0, -(s_x + r_x), &lo, &hi);
        }
        if (!(lo <= hi))
            continue;
        int i0 = (int)fmaxf(ceilf(t->x + lo - 0.5f), 0),
            i1 = (int)fminf(floorf(t->x + hi - 0.5f), (float)b->width - 1);
        float dx = (float)i0 + 0.5f - t->x;
        draw_run(job, t, (size_t)j * (size_t)b->width + (size_t)i0, i1 - i0 + 1, s0 + dx * s_x, s_x,
                 r0 + dx * r_x, r_x);
    }
}

static void edge_between(const struct sv_warp_row *a, int from, const struct sv_warp_row *b, int to,
                         float e[3])
{
    e[0] = b->x[to] - a->x[from];
    e[1] = b->y[to] - a->y[from];
    e[2] = b->d[to] - a->d[from];
}

/* A full cell that the kernels leave (large, or far from a parallelogram): two triangles. False: too large.
 */
static bool draw_full(struct sv_warp_job *job, const struct sv_warp_row *up, const struct sv_warp_row *lo,
                      int c)
{
    struct triangle t = {.x = up->x[c], .y = up->y[c], .d = up->d[c], .s1 = 1, .r2 = 1, .turn = 1, .full = 1};
    struct triangle far = {.x = lo->x[c + 1],
                           .y = lo->y[c + 1],
                           .d = lo->d[c + 1],
                           .s = 1,
                           .r = 1,
                           .s1 = -1,
                           .r2 = -1,
                           .turn = 1,
                           .full = 1};
    t.texel = far.texel = job->tag0 + (uint32_t)c;
    edge_between(up, c, up, c + 1, t.e1);
    edge_between(up, c, lo, c, t.e2);
    edge_between(lo, c + 1, lo, c, far.e1);
    edge_between(lo, c + 1, up, c + 1, far.e2);
    float reach = fabsf(t.e1[0]) + fabsf(t.e1[1]) + fabsf(t.e2[0]) + fabsf(t.e2[1]);
    reach = fmaxf(reach, fabsf(far.e1[0]) + fabsf(far.e1[1]) + fabsf(far.e2[0]) + fabsf(far.e2[1]));
    if (!(reach <= LARGE_PX))
        return false;
    draw_triangle(job, &t);
    draw_triangle(job, &far);
    return true;
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

/* A cell that is not full, piece by piece. */
static void draw_quarters(struct sv_warp_job *job, const struct sv_warp_row *up, const struct sv_warp_row *lo,
                          int c)
{
    for (int k = 0; k < 4; k++) {
        const struct sv_warp_row *row = k < 2 ? up : lo, *other = k < 2 ? lo : up;
        int e = c + (k & 1), beside = c + 1 - (k & 1);
        if (!(row->t[e] == row->t[e]))
            continue;
        const double *m = job->source->map.m[3];
        double u = job->column + e + 0.5, v = job->row + (k >> 1) + 0.5;
        float inverse_w = (float)(1 / (m[0] * u + m[1] * v + m[2] * (double)row->t[e] + m[3])),
              cut = job->source->cut;
        const float here[3] = {row->x[e], row->y[e], row->d[e]},
                    across[3] = {row->x[beside], row->y[beside], row->d[beside]};
        const float along[3] = {other->x[e], other->y[e], other->d[e]};
        struct triangle q = {.x = here[0], .y = here[1], .d = here[2], .s = 0.5f, .r = 0.5f, .doubled = true};
        q.turn = k == 1 || k == 2 ? -1 : 1;
        q.s1 = k & 1 ? -0.5f : 0.5f;
        q.r2 = k >> 1 ? -0.5f : 0.5f;
        q.texel = job->tag0 + (uint32_t)e + (uint32_t)(k >> 1) * (uint32_t)job->source->width;
        half_edge(job, here, across, fabsf(row->t[e] - row->t[beside]) <= cut, 0, 2 * q.s1, inverse_w, q.e1);
        half_edge(job, here, along, fabsf(row->t[e] - other->t[e]) <= cut, 1, 2 * q.r2, inverse_w, q.e2);
        draw_triangle(job, &q);
    }
}

/* Cells between two rows; rim: of the first cell. */
static void draw_cells(const struct sv_warp_kernel *kernel, struct sv_warp_job *job,
                       const struct sv_warp_row *up, const struct sv_warp_row *lo, int n, const uint8_t *rim)
{
    uint16_t slow[SV_WARP_STRIP];
    struct sv_warp_buffer *buffer = job->buffer;
    float x0 = fminf(up->min_x, lo->min_x), x1 = fmaxf(up->max_x, lo->max_x);
    float y0 = fminf(up->min_y, lo->min_y), y1 = fmaxf(up->max_y, lo->max_y);
    const float reach = LARGE_PX; /* of what a cell covers beyond its texels' centres */
    if (!(x0 <= x1) || !(x1 >= -reach && y1 >= -reach && x0 <= (float)buffer->width + reach &&
                         y0 <= (float)buffer->height + reach))
        return;
    int listed = kernel->cells(job, up, lo, n, slow);
    for (int k = 0; k < listed; k++) {
        int c = slow[k];
        if (!rim[c])
            continue;
        if (!is_full(up, lo, c, job->source->cut))
            draw_quarters(job, up, lo, c);
        else if (!draw_full(job, up, lo, c))
            sv_warp_cell(job, up, lo, c);
    }
    x0 = fmaxf(x0 - reach, 0), y0 = fmaxf(y0 - reach, 0);
    x1 = fminf(x1 + reach + 1, (float)buffer->width), y1 = fminf(y1 + reach + 1, (float)buffer->height);
    sv_warp_touch(buffer, (int)x0, (int)y0, (int)x1, (int)y1);
}

static const struct sv_warp_kernel *kernel_here(void)
{
    switch (sv_simd_level()) {
    case SV_SIMD_SCALAR:
        return &sv_warp_scalar;
    case SV_SIMD_SSE2:
        return &sv_warp_sse2;
    case SV_SIMD_AVX2:
        return &sv_warp_avx2;
    }
    return &sv_warp_scalar;
}

void sv_relief_splat(const struct sv_warp_source *source, unsigned k, const uint8_t *rims,
                     const struct sv_relief_span *spans, int span_count, struct sv_warp_buffer *buffer,
                     struct sv_warp_stats *stats)
{
    const struct sv_warp_kernel *kernel = kernel_here();
    struct sv_warp_row rows[2];
    struct sv_warp_job job = {.source = source,
                              .buffer = buffer,
                              .budget = (int64_t)SV_WARP_LAYERS * buffer->width * buffer->height};
    const size_t stride = (size_t)source->width + 1; /* cells of a row: column -1 first */
    for (int s = 0; s < span_count; s++) {
        const struct sv_relief_span *span = &spans[s];
        for (int column = span->column0 - 1; column < span->column1; column += COLUMNS) {
            int left = span->column1 - column, n = left < COLUMNS ? left : COLUMNS;
            job.column = column;
            load_row(kernel, source, column, n + 1, span->row0 - 1, &rows[(span->row0 - 1) & 1]);
            for (int j = span->row0; j <= span->row1; j++) {
                struct sv_warp_row *up = &rows[(j - 1) & 1], *lo = &rows[j & 1];
                stats->texels += load_row(kernel, source, column, n + 1, j, lo);
                job.row = j - 1;
                job.tag0 = (uint32_t)k << SV_WARP_TEXEL_BITS;
                job.tag0 += (uint32_t)((j - 1) * source->width + column);
                draw_cells(kernel, &job, up, lo, n, rims + (size_t)j * stride + (size_t)(column + 1));
            }
        }
    }
    stats->pixels += job.pixels;
}
