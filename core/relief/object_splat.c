/* object_splat.c - splats one sheet of an object: the kernels of warp.h (same pixels, same bits), walked tile
 * row by tile row over the tiles that may face the eye, and without the cells that need not be drawn.
 *
 * A cell that lacks one of its four texels is drawn piece by piece, some thirty times as dear as a full one.
 * Where a face's kept texels end because another face goes on with the surface, what such a cell would add is
 * drawn there: the `rims` of an object (object_rims.c) tell which cells are needed. */
#include "core/relief/object_splat.h"

#include <emmintrin.h>
#include <string.h>

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

static float min2(float a, float b)
{
    return a < b ? a : b;
}

static float max2(float a, float b)
{
    return a > b ? a : b;
}

/* Pixels of a range of places along an axis whose centres are in it, within 0 .. size - 1. */
static int first_pixel(float from)
{
    return from > 0.5f ? (int)(from + 0.5f - 1.0f / 1024) : 0; /* a row too many is tested, none is missed */
}

static int last_pixel(float to, int size)
{
    return to < (float)size ? (int)(to + 0.5f) - 1 : size - 1;
}

/* The pixels of a row's four that `mask` names. */
static void draw_four(struct sv_warp_job *job, const struct triangle *t, size_t p, int mask, __m128 s4,
                      __m128 r4)
{
    struct sv_warp_pixels to = sv_warp_pixels_of(job->buffer);
    float s[4], r[4];
    _mm_storeu_ps(s, s4);
    _mm_storeu_ps(r, r4);
    for (; mask; mask &= mask - 1) {
        int k = __builtin_ctz((unsigned)mask);
        float d = min2(max2(t->d + s[k] * t->e1[2] + r[k] * t->e2[2], 0), 1);
        job->pixels += sv_warp_put(to, p + (size_t)k, d, t->texel,
                                   sv_warp_place(t->s + s[k] * t->s1, t->r + r[k] * t->r2, t->full));
    }
}

/* Pixels whose centres it holds. One that is turned away or seen edge-on is not drawn: bodies are closed. */
static void draw_triangle(struct sv_warp_job *job, const struct triangle *t)
{
    const struct sv_warp_buffer *b = job->buffer;
    float e1x = t->e1[0], e1y = t->e1[1], e2x = t->e2[0], e2y = t->e2[1], det = e1x * e2y - e1y * e2x;
    float size = fabsf(e1x) + fabsf(e1y) + fabsf(e2x) + fabsf(e2y);
    if (!(det * t->turn > size * size * EDGE_ON) || !(size <= 2 * LARGE_PX))
        return;
    float bx = t->doubled ? e1x + e2x : 0, by = t->doubled ? e1y + e2y : 0;
    int j0 = first_pixel(t->y + min2(min2(0, e1y), min2(e2y, by)));
    int j1 = last_pixel(t->y + max2(max2(0, e1y), max2(e2y, by)), b->height);
    int i0 = first_pixel(t->x + min2(min2(0, e1x), min2(e2x, bx)));
    int i1 = last_pixel(t->x + max2(max2(0, e1x), max2(e2x, bx)), b->width);
    float inverse = 1 / det;
    const __m128 s_x = _mm_set1_ps(e2y * inverse), r_x = _mm_set1_ps(-e1y * inverse);
    const __m128 low = _mm_set1_ps(-SV_WARP_EDGE), high = _mm_set1_ps(1 + SV_WARP_EDGE);
    const __m128 dx0 = _mm_add_ps(_mm_set1_ps((float)i0 + 0.5f - t->x), _mm_setr_ps(0, 1, 2, 3));
    for (int j = j0; j <= j1; j++) {
        float dy = (float)j + 0.5f - t->y;
        __m128 s0 = _mm_set1_ps(-dy * e2x * inverse), r0 = _mm_set1_ps(dy * e1x * inverse), dx = dx0;
        for (int i = i0; i <= i1; i += 4, dx = _mm_add_ps(dx, _mm_set1_ps(4))) {
            __m128 s = _mm_add_ps(s0, _mm_mul_ps(dx, s_x)), r = _mm_add_ps(r0, _mm_mul_ps(dx, r_x));
            __m128 most = t->doubled ? _mm_max_ps(s, r) : _mm_add_ps(s, r);
            __m128 in = _mm_and_ps(_mm_cmpge_ps(_mm_min_ps(s, r), low), _mm_cmple_ps(most, high));
            int mask = _mm_movemask_ps(in) & (i1 - i < 3 ? (2 << (i1 - i)) - 1 : 15);
            if (mask)
                draw_four(job, t, (size_t)j * (size_t)b->width + (size_t)i, mask, s, r);
        }
    }
}

/* A full cell that the kernels leave (large, or far from a parallelogram), by its own coordinates (s, r): its
 * corners are (0, 0), (1, 0), (0, 1), (s3, r3). False: it is neither convex nor small, or folded in the
 * picture. */
static bool draw_quad(struct sv_warp_job *job, const struct sv_warp_row *up, const struct sv_warp_row *lo,
                      int c)
{
    float x0 = up->x[c], y0 = up->y[c], e1x = up->x[c + 1] - x0, e1y = up->y[c + 1] - y0;
    float e2x = lo->x[c] - x0, e2y = lo->y[c] - y0, e3x = lo->x[c + 1] - x0, e3y = lo->y[c + 1] - y0;
    float det = e1x * e2y - e1y * e2x, det_far = (e3x - e2x) * (e3y - e1y) - (e3y - e2y) * (e3x - e1x);
    if (det <= 0 && det_far <= 0)
        return true; /* turned away */
    float left = min2(min2(0, e1x), min2(e2x, e3x)), right = max2(max2(0, e1x), max2(e2x, e3x));
    float top = min2(min2(0, e1y), min2(e2y, e3y)), bottom = max2(max2(0, e1y), max2(e2y, e3y));
    float inverse = 1 / det, s3 = (e3x * e2y - e3y * e2x) * inverse, r3 = (e3y * e1x - e3x * e1y) * inverse;
    if (!(det > (right - left) * (bottom - top) * EDGE_ON && right - left <= LARGE_PX &&
          bottom - top <= LARGE_PX) ||
        !(s3 > 0 && r3 > 0 && s3 + r3 > 1 && s3 < 8 && r3 < 8))
        return false;
    const struct sv_warp_buffer *b = job->buffer;
    struct triangle t = {.d = up->d[c], .s1 = 1, .r2 = 1, .texel = job->tag0 + (uint32_t)c, .full = 1};
    t.e1[2] = up->d[c + 1] - t.d;
    t.e2[2] = lo->d[c] - t.d;
    int j0 = first_pixel(y0 + top), j1 = last_pixel(y0 + bottom, b->height);
    int i0 = first_pixel(x0 + left), i1 = last_pixel(x0 + right, b->width);
    const __m128 s_x = _mm_set1_ps(e2y * inverse), r_x = _mm_set1_ps(-e1y * inverse);
    const __m128 low = _mm_set1_ps(-SV_WARP_EDGE), one = _mm_set1_ps(1), s_3 = _mm_set1_ps(s3),
                 r_3 = _mm_set1_ps(r3);
    const __m128 s_31 = _mm_set1_ps(s3 - 1), r_31 = _mm_set1_ps(r3 - 1);
    const __m128 dx0 = _mm_add_ps(_mm_set1_ps((float)i0 + 0.5f - x0), _mm_setr_ps(0, 1, 2, 3));
    for (int j = j0; j <= j1; j++) {
        float dy = (float)j + 0.5f - y0;
        __m128 s0 = _mm_set1_ps(-dy * e2x * inverse), r0 = _mm_set1_ps(dy * e1x * inverse), dx = dx0;
        for (int i = i0; i <= i1; i += 4, dx = _mm_add_ps(dx, _mm_set1_ps(4))) {
            __m128 s = _mm_add_ps(s0, _mm_mul_ps(dx, s_x)), r = _mm_add_ps(r0, _mm_mul_ps(dx, r_x));
            /* Beyond the edges (1, 0) - (s3, r3) and (0, 1) - (s3, r3)? */
            __m128 a = _mm_sub_ps(_mm_mul_ps(s_31, r), _mm_mul_ps(r_3, _mm_sub_ps(s, one)));
            __m128 e = _mm_sub_ps(_mm_mul_ps(r_31, s), _mm_mul_ps(s_3, _mm_sub_ps(r, one)));
            __m128 least = _mm_min_ps(_mm_min_ps(s, r), _mm_min_ps(a, e));
            int mask = _mm_movemask_ps(_mm_cmpge_ps(least, low)) & (i1 - i < 3 ? (2 << (i1 - i)) - 1 : 15);
            if (mask)
                draw_four(job, &t, (size_t)j * (size_t)b->width + (size_t)i, mask, _mm_min_ps(s, one),
                          _mm_min_ps(r, one));
        }
    }
    return true;
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
    reach = max2(reach, fabsf(far.e1[0]) + fabsf(far.e1[1]) + fabsf(far.e2[0]) + fabsf(far.e2[1]));
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
    float x0 = min2(up->min_x, lo->min_x), x1 = max2(up->max_x, lo->max_x);
    float y0 = min2(up->min_y, lo->min_y), y1 = max2(up->max_y, lo->max_y);
    const float reach = LARGE_PX; /* of what a cell covers beyond its texels' centres */
    if (!(x0 <= x1) || !(x1 >= -reach && y1 >= -reach && x0 <= (float)buffer->width + reach &&
                         y0 <= (float)buffer->height + reach))
        return;
    int listed = kernel->cells(job, up, lo, n, slow);
    for (int k = 0; k < listed; k++) {
        int c = slow[k];
        bool full = is_full(up, lo, c, job->source->cut);
        if (rim[c] != (full ? SV_RELIEF_CELL_FULL : SV_RELIEF_CELL_RIM))
            continue; /* not needed, or not full only for what is turned away */
        if (!full)
            draw_quarters(job, up, lo, c);
        else if (!draw_quad(job, up, lo, c) && !draw_full(job, up, lo, c))
            sv_warp_cell(job, up, lo, c);
    }
    x0 = max2(x0 - reach, 0), y0 = max2(y0 - reach, 0);
    x1 = min2(x1 + reach + 1, (float)buffer->width), y1 = min2(y1 + reach + 1, (float)buffer->height);
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

/* Which texels of a row face the eye, columns first .. first + count - 1: n . (eye - place) > 0 (NaN: no).
 * What lies outside of the sheet does not. */
static void face_row(const struct sv_relief_facing *f, const struct sv_warp_source *source, int first,
                     int count, int j, uint8_t *out)
{
    int from = first < 0 ? -first : 0, to = first + count > source->width ? source->width - first : count;
    memset(out, 0, (size_t)count);
    if (j < 0 || j >= source->height)
        return;
    const size_t row = (size_t)j * (size_t)source->width + (size_t)(first + from);
    const int16_t *restrict nu = f->normal[0] + row, *restrict nv = f->normal[1] + row;
    const int16_t *restrict nf = f->normal[2] + row;
    const float *restrict t = source->t + row;
    float u = f->eye[0] - ((float)(first + from) + 0.5f) * f->pitch,
          v = f->eye[1] - ((float)j + 0.5f) * f->pitch;
    int32_t faces[SV_WARP_ROW + 16];
    const int n = to - from;
    for (int i = 0; i < n; i++) {
        float along = (float)nu[i] * (u - (float)i * f->pitch) + (float)nv[i] * v;
        faces[i] = -(along + (float)nf[i] * (f->eye[2] - f->near * t[i]) > 0);
    }
    for (int i = 0; i < n; i++)
        out[from + i] = (uint8_t)faces[i];
}

/* Entries of a row without a neighbour (or themselves) that faces the eye are nothing: no cell at them does.
 * facing: the rows above, at and below, from the column before the first entry. */
static void drop_averted(uint8_t facing[3][SV_WARP_ROW + 16], int n, struct sv_warp_row *row)
{
    uint8_t any[SV_WARP_ROW + 16];
    for (int i = 0; i < n + 2; i++)
        any[i] = facing[0][i] | facing[1][i] | facing[2][i];
    for (int i = 0; i < n; i++)
        row->t[i] = (any[i] | any[i + 1] | any[i + 2]) ? row->t[i] : NAN;
}

void sv_relief_splat(const struct sv_warp_source *source, unsigned k, const uint8_t *rims,
                     const struct sv_relief_facing *facing, const struct sv_relief_span *spans,
                     int span_count, struct sv_warp_buffer *buffer, struct sv_warp_stats *stats)
{
    const struct sv_warp_kernel *kernel = kernel_here();
    struct sv_warp_row rows[2];
    uint8_t front[3][SV_WARP_ROW + 16];
    struct sv_warp_job job = {.source = source,
                              .buffer = buffer,
                              .budget = (int64_t)SV_WARP_LAYERS * buffer->width * buffer->height};
    const size_t stride = (size_t)source->width + 1; /* cells of a row: column -1 first */
    for (int s = 0; s < span_count; s++) {
        const struct sv_relief_span *span = &spans[s];
        for (int column = span->column0 - 1; column < span->column1; column += COLUMNS) {
            int left = span->column1 - column, n = left < COLUMNS ? left : COLUMNS;
            job.column = column;
            face_row(facing, source, column - 1, n + 3, span->row0 - 2, front[0]);
            face_row(facing, source, column - 1, n + 3, span->row0 - 1, front[1]);
            for (int j = span->row0 - 1; j <= span->row1; j++) {
                struct sv_warp_row *up = &rows[(j - 1) & 1], *lo = &rows[j & 1];
                uint32_t solid = load_row(kernel, source, column, n + 1, j, lo);
                face_row(facing, source, column - 1, n + 3, j + 1, front[2]);
                drop_averted(front, n + 1, lo);
                memmove(front[0], front[1], 2 * sizeof front[0]);
                if (j < span->row0)
                    continue;
                stats->texels += solid;
                job.row = j - 1;
                job.tag0 = (uint32_t)k << SV_WARP_TEXEL_BITS;
                job.tag0 += (uint32_t)((j - 1) * source->width + column);
                draw_cells(kernel, &job, up, lo, n, rims + (size_t)j * stride + (size_t)(column + 1));
            }
        }
    }
    stats->pixels += job.pixels;
}
