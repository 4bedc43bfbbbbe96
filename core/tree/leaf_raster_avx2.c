/* leaf_raster_avx2.c - raster and settle of leaf_raster.c, eight pieces, hits or pixels at a time; operation
 * for operation the scalar ones, so that the pictures are equal. */
#include <math.h>

#include "core/tree/leaf_avx2.h"
#include "core/tree/leaf_kernel.h"
#include "core/tree/leaf_shade.h"

struct plane {
    __m256 f[3];
};

struct planes {
    struct plane s, r, q, d;
};

static inline __m256 at(const struct plane *p, __m256 x, __m256 y)
{
    return add(add(mul(p->f[1], y), p->f[2]), mul(p->f[0], x));
}

static inline struct plane cross(const __m256 a[3], const __m256 b[3])
{
    return (struct plane){{sub(mul(a[1], b[2]), mul(a[2], b[1])), sub(mul(a[2], b[0]), mul(a[0], b[2])),
                           sub(mul(a[0], b[1]), mul(a[1], b[0]))}};
}

static inline void scale(struct plane *p, __m256 g)
{
    for (int k = 0; k < 3; k++)
        p->f[k] = mul(p->f[k], g);
}

static inline void set_perspective(const struct sv_leaf_eye *eye, const __m256 v[9], __m256 i0, __m256 j0,
                                   struct planes *p)
{
    __m256 w[3][3];
    for (int n = 0; n < 3; n++) {
        w[n][0] = sub(v[3 * n], mul(i0, v[3 * n + 2]));
        w[n][1] = sub(v[3 * n + 1], mul(j0, v[3 * n + 2]));
        w[n][2] = v[3 * n + 2];
    }
    p->q = cross(w[1], w[2]);
    p->s = cross(w[2], w[0]);
    p->r = cross(w[0], w[1]);
    __m256 volume = add(add(mul(w[0][0], p->q.f[0]), mul(w[0][1], p->q.f[1])), mul(w[0][2], p->q.f[2]));
    __m256 g = _mm256_div_ps(splat(eye->near_m), volume);
    scale(&p->q, g);
    scale(&p->s, g);
    scale(&p->r, g);
    p->d = p->q;
}

static inline void set_orthographic(const struct sv_leaf_eye *eye, const __m256 v[9], __m256 i0, __m256 j0,
                                    struct planes *p)
{
    __m256 a = sub(v[0], i0), b = sub(v[1], j0), minus = splat(-0.0f), f = splat(1 / eye->far_m);
    __m256 g = _mm256_div_ps(splat(1), sub(mul(v[3], v[7]), mul(v[4], v[6])));
    p->s = (struct plane){{v[7], _mm256_xor_ps(v[6], minus), sub(mul(v[6], b), mul(v[7], a))}};
    p->r = (struct plane){{_mm256_xor_ps(v[4], minus), v[3], sub(mul(a, v[4]), mul(b, v[3]))}};
    scale(&p->s, g);
    scale(&p->r, g);
    p->q = (struct plane){{_mm256_setzero_ps(), _mm256_setzero_ps(), splat(1)}};
    for (int k = 0; k < 3; k++)
        p->d.f[k] = mul(add(mul(p->s.f[k], v[5]), mul(p->r.f[k], v[8])), _mm256_xor_ps(f, minus));
    p->d.f[2] = add(sub(splat(1), mul(v[2], f)), p->d.f[2]);
}

static inline __m256 inside(__m256 s, __m256 r, __m256 q, bool card)
{
    __m256 edge = mul(splat(SV_LEAF_EDGE), q), most = add(q, edge), low = _mm256_xor_ps(edge, splat(-0.0f));
    __m256 in = _mm256_and_ps(in_order(low, s), in_order(low, r));
    if (card)
        return _mm256_and_ps(in, _mm256_and_ps(in_order(s, most), in_order(r, most)));
    return _mm256_and_ps(in, in_order(add(s, r), most));
}

static inline __m256 depth_legal(__m256 d)
{
    return _mm256_and_ps(_mm256_cmp_ps(d, _mm256_setzero_ps(), _CMP_GT_OQ), in_order(d, splat(1)));
}

static inline void hit(struct sv_leaf_hits *hits, unsigned bits, __m256i pixel, __m256i piece, __m256 d,
                       __m256 s, __m256 r)
{
    __m256i order = order_of(bits);
    int n = hits->count;
    store_packed_i(hits->pixel + n, pixel, order);
    store_packed_i(hits->piece + n, piece, order);
    store_packed(hits->d + n, d, order);
    store_packed(hits->s + n, s, order);
    store_packed(hits->r + n, r, order);
    hits->count = n + __builtin_popcount(bits);
}

static inline __m256 more_than(__m256i count, int k)
{
    return _mm256_castsi256_ps(_mm256_cmpgt_epi32(count, _mm256_set1_epi32(k)));
}

/* Pixel (kx, ky) of eight boxes. */
static inline void slot(struct sv_leaf_job *job, const struct planes *p, __m256 mask, int kx, int ky,
                        __m256i pixel, __m256i piece, bool card)
{
    __m256 x = splat((float)kx), y = splat((float)ky);
    __m256 s = at(&p->s, x, y), r = at(&p->r, x, y), q = at(&p->q, x, y), d = at(&p->d, x, y);
    mask = _mm256_and_ps(mask, _mm256_and_ps(inside(s, r, q, card), depth_legal(d)));
    if (!bits_of(mask))
        return;
    __m256 held = _mm256_mask_i32gather_ps(_mm256_setzero_ps(), job->depth, pixel, mask, 4);
    unsigned bits = bits_of(_mm256_and_ps(mask, in_order(held, d)));
    if (bits)
        hit(&job->hits, bits, pixel, piece, d, s, r);
}

static inline int most_of(__m256i v)
{
    int lane[LANES], most = 0;
    _mm256_storeu_si256((__m256i *)(void *)lane, v);
    for (int i = 0; i < LANES; i++)
        most = lane[i] > most ? lane[i] : most;
    return most;
}

static inline void raster_eight(struct sv_leaf_job *job, const struct sv_leaf_queue *queue, int n, bool card,
                                bool orthographic)
{
    __m256 v[9];
    struct planes p;
    for (int k = 0; k < 9; k++)
        v[k] = _mm256_load_ps(queue->v[k] + n);
    __m256i i0 = _mm256_load_si256((const __m256i *)(const void *)(queue->i0 + n));
    __m256i j0 = _mm256_load_si256((const __m256i *)(const void *)(queue->j0 + n));
    __m256i nx = _mm256_load_si256((const __m256i *)(const void *)(queue->nx + n));
    __m256i ny = _mm256_load_si256((const __m256i *)(const void *)(queue->ny + n));
    __m256i piece = _mm256_load_si256((const __m256i *)(const void *)(queue->piece + n));
    __m256 x0 = _mm256_cvtepi32_ps(i0), y0 = _mm256_cvtepi32_ps(j0);
    if (orthographic)
        set_orthographic(&job->eye, v, x0, y0, &p);
    else
        set_perspective(&job->eye, v, x0, y0, &p);
    const __m256i lane = _mm256_setr_epi32(0, 1, 2, 3, 4, 5, 6, 7), width = _mm256_set1_epi32(job->eye.width);
    int lanes = queue->count - n;
    nx = _mm256_and_si256(nx, _mm256_cmpgt_epi32(_mm256_set1_epi32(lanes), lane)); /* the queue's end */
    /* Rows above and below the band are not there. */
    __m256i above = _mm256_sub_epi32(_mm256_set1_epi32(job->eye.row_first), j0);
    ny = _mm256_min_epi32(ny, _mm256_add_epi32(above, _mm256_set1_epi32(job->eye.row_count)));
    __m256i pixel = _mm256_sub_epi32(i0, _mm256_mullo_epi32(above, width));
    int columns = most_of(nx),
        rows = most_of(_mm256_and_si256(ny, _mm256_cmpgt_epi32(nx, _mm256_setzero_si256())));
    for (int ky = 0; ky < rows; ky++) {
        __m256 row = _mm256_andnot_ps(more_than(above, ky), more_than(ny, ky));
        for (int kx = 0; kx < columns; kx++)
            slot(job, &p, _mm256_and_ps(row, more_than(nx, kx)), kx, ky,
                 _mm256_add_epi32(pixel, _mm256_set1_epi32(kx)), piece, card);
        pixel = _mm256_add_epi32(pixel, width);
    }
}

/* ---- large pieces: a row at a time, and of a row what may be inside ---- */

enum { EDGES = 4 };
/* Farther out than any column: no bound. */
static const float FAR_PX = 1e9f;

/* Columns that may be inside, of row y: from the largest low[k][0] y + low[k][1] to the least of high. */
struct spans {
    __m256 low[EDGES][2], high[EDGES][2];
};

static inline __m256 absolute(__m256 v)
{
    return _mm256_andnot_ps(splat(-0.0f), v);
}

/* The edge f[0] x + f[1] y + f[2] >= 0 bounds columns below where it rises and above where it falls. What
 * rounding of it (size: the largest sum of its terms' magnitudes, of which inside() rounds 2^-22) and of the
 * bound can do is let in; NaN bounds nothing. */
static inline void bound(const struct plane *f, __m256 size, __m256 rows, __m256 low[2], __m256 high[2])
{
    __m256 zero = _mm256_setzero_ps(), each = _mm256_div_ps(splat(-1), f->f[0]);
    __m256 slope = mul(f->f[1], each), from = mul(f->f[2], each);
    __m256 slack = add(mul(size, absolute(each)), add(mul(absolute(slope), rows), absolute(from)));
    slack = add(mul(slack, splat(0x1p-19f)), splat(0x1p-6f));
    __m256 rises = _mm256_cmp_ps(f->f[0], zero, _CMP_GT_OQ), falls = _mm256_cmp_ps(f->f[0], zero, _CMP_LT_OQ);
    low[0] = _mm256_and_ps(rises, slope);
    low[1] = _mm256_blendv_ps(splat(-FAR_PX), sub(from, slack), rises);
    high[0] = _mm256_and_ps(falls, slope);
    high[1] = _mm256_blendv_ps(splat(FAR_PX), add(from, slack), falls);
}

/* The conditions of inside() for eight pieces, as edges. */
static inline void spans_of(const struct planes *p, __m256 columns, __m256 rows, bool card,
                            struct spans *spans)
{
    struct plane edge[EDGES];
    __m256 size = _mm256_setzero_ps(), out = splat(SV_LEAF_EDGE), most = splat(1 + SV_LEAF_EDGE);
    const __m256 reach[3] = {columns, rows, splat(1)};
    for (int k = 0; k < 3; k++) {
        __m256 s = p->s.f[k], r = p->r.f[k], q = p->q.f[k];
        size = add(size, mul(reach[k], add(add(absolute(s), absolute(r)), absolute(q))));
        edge[0].f[k] = add(s, mul(out, q));
        edge[1].f[k] = add(r, mul(out, q));
        edge[2].f[k] = sub(mul(most, q), card ? s : add(s, r));
        edge[3].f[k] = card ? sub(mul(most, q), r) : edge[2].f[k];
    }
    for (int k = 0; k < EDGES; k++)
        bound(&edge[k], size, rows, spans->low[k], spans->high[k]);
}

static inline __m256 lane_of(__m256 v, int i)
{
    return _mm256_permutevar8x32_ps(v, _mm256_set1_epi32(i));
}

static inline void lane_planes(const struct planes *from, int i, struct planes *to)
{
    const struct plane *a[4] = {&from->s, &from->r, &from->q, &from->d};
    struct plane *b[4] = {&to->s, &to->r, &to->q, &to->d};
    for (int n = 0; n < 4; n++)
        for (int k = 0; k < 3; k++)
            b[n]->f[k] = lane_of(a[n]->f[k], i);
}

static inline void lane_spans(const struct spans *from, int i, struct spans *to)
{
    for (int k = 0; k < EDGES; k++)
        for (int n = 0; n < 2; n++) {
            to->low[k][n] = lane_of(from->low[k][n], i);
            to->high[k][n] = lane_of(from->high[k][n], i);
        }
}

/* First column and end of rows y .. y + 7 of one piece's box, which has nx columns. */
static inline void eight_spans(const struct spans *s, int y, int nx, int32_t first[LANES], int32_t end[LANES])
{
    const __m256 lane = _mm256_setr_ps(0, 1, 2, 3, 4, 5, 6, 7);
    __m256 fy = add(splat((float)y), lane), low = _mm256_setzero_ps(), high = splat((float)(nx - 1));
    for (int k = 0; k < EDGES; k++) { /* NaN: what was there stays */
        low = _mm256_max_ps(add(mul(s->low[k][0], fy), s->low[k][1]), low);
        high = _mm256_min_ps(add(mul(s->high[k][0], fy), s->high[k][1]), high);
    }
    high = _mm256_max_ps(high, splat(-1));
    low = _mm256_min_ps(low, splat((float)nx));
    _mm256_storeu_si256((__m256i *)(void *)first, _mm256_cvttps_epi32(low));
    _mm256_storeu_si256((__m256i *)(void *)end, _mm256_cvttps_epi32(add(_mm256_floor_ps(high), splat(1))));
}

/* Columns x .. end - 1 of row y of a piece's box; pixel: of its column 0. */
static inline void raster_span(struct sv_leaf_job *job, const struct planes *p, int pixel, int y, int x,
                               int end, __m256i piece, bool card)
{
    const __m256i lane = _mm256_setr_epi32(0, 1, 2, 3, 4, 5, 6, 7);
    __m256 fy = splat((float)y);
    for (; x < end; x += LANES) {
        __m256i column = _mm256_add_epi32(_mm256_set1_epi32(x), lane);
        __m256i there = _mm256_cmpgt_epi32(_mm256_set1_epi32(end), column);
        __m256 fx = _mm256_cvtepi32_ps(column), d = at(&p->d, fx, fy);
        __m256 held = _mm256_maskload_ps(job->depth + pixel + x, there);
        __m256 mask = _mm256_and_ps(_mm256_castsi256_ps(there), in_order(held, d));
        if (!bits_of(mask)) /* most of a crown: spans hold little that is not inside */
            continue;
        __m256 s = at(&p->s, fx, fy), r = at(&p->r, fx, fy), q = at(&p->q, fx, fy);
        unsigned bits = bits_of(_mm256_and_ps(mask, _mm256_and_ps(inside(s, r, q, card), depth_legal(d))));
        if (bits)
            hit(&job->hits, bits, _mm256_add_epi32(_mm256_set1_epi32(pixel), column), piece, d, s, r);
        if (job->hits.count >= SV_LEAF_HITS)
            sv_leaf_avx2.settle(job);
    }
}

/* One piece of any size. */
static inline void raster_rows(struct sv_leaf_job *job, const struct sv_leaf_queue *queue, int n,
                               const struct planes *p, const struct spans *spans, bool card)
{
    __m256i piece = _mm256_set1_epi32((int)queue->piece[n]);
    int rows[2], pixel = (queue->j0[n] - job->eye.row_first) * job->eye.width + queue->i0[n];
    (void)sv_leaf_rows(&job->eye, queue->j0[n], queue->ny[n], rows);
    for (int y = rows[0]; y < rows[1]; y += LANES) {
        int32_t first[LANES], end[LANES];
        eight_spans(spans, y, queue->nx[n], first, end);
        for (int k = 0; k < LANES && y + k < rows[1]; k++)
            raster_span(job, p, pixel + (y + k) * job->eye.width, y + k, first[k], end[k], piece, card);
    }
}

static inline void raster_large(struct sv_leaf_job *job, const struct sv_leaf_queue *queue, int n, bool card,
                                bool orthographic)
{
    __m256 v[9];
    struct planes p, one;
    struct spans spans, one_spans;
    for (int k = 0; k < 9; k++)
        v[k] = _mm256_load_ps(queue->v[k] + n);
    __m256 i0 = _mm256_cvtepi32_ps(_mm256_load_si256((const __m256i *)(const void *)(queue->i0 + n)));
    __m256 j0 = _mm256_cvtepi32_ps(_mm256_load_si256((const __m256i *)(const void *)(queue->j0 + n)));
    __m256 nx = _mm256_cvtepi32_ps(_mm256_load_si256((const __m256i *)(const void *)(queue->nx + n)));
    __m256 ny = _mm256_cvtepi32_ps(_mm256_load_si256((const __m256i *)(const void *)(queue->ny + n)));
    if (orthographic)
        set_orthographic(&job->eye, v, i0, j0, &p);
    else
        set_perspective(&job->eye, v, i0, j0, &p);
    spans_of(&p, nx, ny, card, &spans);
    for (int i = 0; i < LANES && n + i < queue->count; i++) {
        lane_planes(&p, i, &one);
        lane_spans(&spans, i, &one_spans);
        raster_rows(job, queue, n + i, &one, &one_spans, card);
    }
}

static inline void raster_queue(struct sv_leaf_job *job, int q, bool card, bool orthographic)
{
    struct sv_leaf_queue *queue = &job->queue[q];
    for (int n = 0; n < queue->count && job->mask; n++) /* settle will want them */
        _mm_prefetch((const char *)&job->form->records[queue->piece[n]], _MM_HINT_T0);
    for (int n = 0; n < queue->count; n += LANES) {
        if (q == SV_LEAF_QUEUES - 1)
            raster_large(job, queue, n, card, orthographic);
        else
            raster_eight(job, queue, n, card, orthographic);
        if (job->hits.count >= SV_LEAF_HITS)
            sv_leaf_avx2.settle(job);
    }
    queue->count = 0;
}

static void raster(struct sv_leaf_job *job, int q)
{
    if (job->eye.orthographic)
        raster_queue(job, q, job->card, true);
    else if (job->card)
        raster_queue(job, q, true, false);
    else
        raster_queue(job, q, false, false);
}

/* ---- settle ---- */

static inline __m256i wrap_low(__m256i i, int size)
{
    return _mm256_add_epi32(i, _mm256_and_si256(_mm256_srai_epi32(i, 31), _mm256_set1_epi32(size)));
}

static inline __m256i wrap_high(__m256i i, int size)
{
    __m256i next = _mm256_add_epi32(i, _mm256_set1_epi32(1)), all = _mm256_set1_epi32(size);
    __m256i over = _mm256_cmpgt_epi32(all, next);
    return _mm256_sub_epi32(next, _mm256_andnot_si256(over, all));
}

static inline __m256 texel_of(__m256 u, int size)
{
    __m256 x = sub(mul(sub(u, _mm256_floor_ps(u)), splat((float)size)), splat(0.5f));
    return _mm256_and_ps(x, _mm256_and_ps(in_order(splat(-1), x), in_order(x, splat((float)size))));
}

/* Of the chosen lanes (by their sign) alone: others would miss the cache for nothing. */
static inline __m256 alpha_at(const int *rgba, __m256i index, __m256i chosen)
{
    __m256i texel = _mm256_mask_i32gather_epi32(_mm256_setzero_si256(), rgba, index, chosen, 4);
    return _mm256_cvtepi32_ps(_mm256_srli_epi32(texel, 24));
}

static inline __m256 mix(__m256 a, __m256 b, __m256 t)
{
    return add(a, mul(sub(b, a), t));
}

/* Places of eight hits in their textures: the first halves of their records, columns for rows. */
static inline void load_uv(const struct sv_leaf_job *job, const uint32_t *piece, __m256 f[6])
{
    __m256 a[4], b[4];
    for (int k = 0; k < 4; k++) {
        const float *low = job->form->records[piece[k]].uv, *high = job->form->records[piece[k + 4]].uv;
        a[k] = _mm256_insertf128_ps(_mm256_castps128_ps256(_mm_load_ps(low)), _mm_load_ps(high), 1);
        b[k] = _mm256_insertf128_ps(_mm256_castps128_ps256(_mm_load_ps(low + 4)), _mm_load_ps(high + 4), 1);
    }
    __m256 p = _mm256_unpacklo_ps(a[0], a[1]), q = _mm256_unpacklo_ps(a[2], a[3]);
    __m256 u = _mm256_unpackhi_ps(a[0], a[1]), v = _mm256_unpackhi_ps(a[2], a[3]);
    f[0] = _mm256_shuffle_ps(p, q, 0x44);
    f[1] = _mm256_shuffle_ps(p, q, 0xee);
    f[2] = _mm256_shuffle_ps(u, v, 0x44);
    f[3] = _mm256_shuffle_ps(u, v, 0xee);
    p = _mm256_unpacklo_ps(b[0], b[1]), q = _mm256_unpacklo_ps(b[2], b[3]);
    f[4] = _mm256_shuffle_ps(p, q, 0x44);
    f[5] = _mm256_shuffle_ps(p, q, 0xee);
}

/* Returns the bits of hits that the mask lets be. */
static inline unsigned are_there(const struct sv_leaf_job *job, int n, __m256 s, __m256 r)
{
    const struct sv_leaf_map *map = job->mask;
    const int *rgba = (const int *)(const void *)map->rgba;
    __m256 f[6];
    load_uv(job, job->hits.piece + n, f);
    __m256 x = texel_of(add(add(f[0], mul(s, f[2])), mul(r, f[4])), map->width);
    __m256 y = texel_of(add(add(f[1], mul(s, f[3])), mul(r, f[5])), map->height);
    __m256 bx = _mm256_floor_ps(x), by = _mm256_floor_ps(y), fu = sub(x, bx), fv = sub(y, by);
    __m256i i = _mm256_cvttps_epi32(bx), j = _mm256_cvttps_epi32(by), w = _mm256_set1_epi32(map->width);
    __m256i i0 = wrap_low(i, map->width), j0 = _mm256_mullo_epi32(wrap_low(j, map->height), w);
    __m256i at0 = _mm256_add_epi32(j0, i0), shift = _mm256_and_si256(at0, _mm256_set1_epi32(15));
    __m256i class = _mm256_i32gather_epi32((const int *)map->classes, _mm256_srli_epi32(at0, 4), 4);
    class = _mm256_srlv_epi32(class, _mm256_add_epi32(shift, shift));
    unsigned in = bits_of(_mm256_castsi256_ps(_mm256_slli_epi32(class, 31)));
    __m256i between = _mm256_slli_epi32(class, 30);
    if (!bits_of(_mm256_castsi256_ps(between)))
        return in;
    __m256i i1 = wrap_high(i, map->width), j1 = _mm256_mullo_epi32(wrap_high(j, map->height), w);
    __m256i at1 = _mm256_add_epi32(j0, i1), at2 = _mm256_add_epi32(j1, i0), at3 = _mm256_add_epi32(j1, i1);
    __m256 top = mix(alpha_at(rgba, at0, between), alpha_at(rgba, at1, between), fu);
    __m256 low = mix(alpha_at(rgba, at2, between), alpha_at(rgba, at3, between), fu);
    __m256 alpha = mul(mul(mix(top, low, fv), splat(1.0f / 255.0f)), splat(job->alpha_factor));
    __m256 there = _mm256_cmp_ps(alpha, splat(job->alpha_cutoff), _CMP_NLT_UQ);
    return in | (bits_of(there) & bits_of(_mm256_castsi256_ps(between)));
}

static inline __m256 held(__m256 v)
{
    return _mm256_min_ps(_mm256_max_ps(v, _mm256_setzero_ps()), splat(1));
}

static inline __m256i sixteen(__m256 v)
{
    return _mm256_cvttps_epi32(add(mul(v, splat(65535)), splat(0.5f)));
}

static inline void settle_eight(struct sv_leaf_job *job, int n)
{
    const struct sv_leaf_hits *hits = &job->hits;
    __m256 d = _mm256_load_ps(hits->d + n), s = _mm256_load_ps(hits->s + n), r = _mm256_load_ps(hits->r + n);
    __m256 inverse = job->eye.orthographic ? splat(1) : _mm256_div_ps(splat(1), d);
    s = held(mul(s, inverse));
    r = held(mul(r, inverse));
    unsigned left = job->mask ? are_there(job, n, s, r) : 255;
    uint32_t place[LANES];
    _mm256_storeu_si256((__m256i *)(void *)place,
                        _mm256_or_si256(sixteen(s), _mm256_slli_epi32(sixteen(r), 16)));
    for (; left; left &= left - 1) {
        int i = __builtin_ctz(left);
        sv_leaf_put(job, hits->pixel[n + i], hits->d[n + i], hits->piece[n + i], place[i]);
    }
}

static void settle(struct sv_leaf_job *job)
{
    int n = 0, count = job->hits.count;
    for (; n + LANES <= count; n += LANES)
        settle_eight(job, n);
    sv_leaf_settle_run(job, n, count);
    job->hits.count = 0;
}

static float least(const float *depth, int stride, int w, int h)
{
    const __m256i lane = _mm256_setr_epi32(0, 1, 2, 3, 4, 5, 6, 7);
    __m256 low = splat(INFINITY);
    for (int j = 0; j < h; j++)
        for (int i = 0; i < w; i += LANES) {
            __m256i in = _mm256_cmpgt_epi32(_mm256_set1_epi32(w - i), lane);
            __m256 v = _mm256_maskload_ps(depth + (size_t)j * (size_t)stride + (size_t)i, in);
            low = _mm256_min_ps(_mm256_blendv_ps(low, v, _mm256_castsi256_ps(in)), low);
        }
    float lanes[LANES], best = INFINITY;
    _mm256_storeu_ps(lanes, low);
    for (int i = 0; i < LANES; i++)
        best = sv_leaf_min(lanes[i], best);
    return best;
}

const struct sv_leaf_kernel sv_leaf_avx2 = {.project = sv_leaf_project_avx2,
                                            .raster = raster,
                                            .settle = settle,
                                            .shade = sv_leaf_shade_avx2,
                                            .least = least};
