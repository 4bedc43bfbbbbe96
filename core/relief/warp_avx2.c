/* warp_avx2.c - the kernels of warp_splat.c, eight texels or cells at a time. Operation for operation the
 * scalar ones, so that the pictures are equal. */
#include <immintrin.h>
#include <math.h>

#include "core/relief/warp_list_avx2.h"

#define LANES 8
/* For each mask of eight lanes the chosen ones, packed to the front, a byte each. */
#define BELOW(m, i) ((m) & ((1 << (i)) - 1))
#define BITS2(m) (((m)&1) + ((m) >> 1 & 1))
#define BITS(m) (BITS2(m) + BITS2((m) >> 2) + BITS2((m) >> 4) + BITS2((m) >> 6))
#define LANE(m, i) (((m) >> (i)&1) ? (uint64_t)(i) << 8 * BITS(BELOW(m, i)) : 0)
#define PACK(m) \
    (LANE(m, 0) | LANE(m, 1) | LANE(m, 2) | LANE(m, 3) | LANE(m, 4) | LANE(m, 5) | LANE(m, 6) | LANE(m, 7))
#define PACK4(m) PACK(m), PACK((m) + 1), PACK((m) + 2), PACK((m) + 3)
#define PACK16(m) PACK4(m), PACK4((m) + 4), PACK4((m) + 8), PACK4((m) + 12)
#define PACK64(m) PACK16(m), PACK16((m) + 16), PACK16((m) + 32), PACK16((m) + 48)
const uint64_t sv_warp_pack[256] = {PACK64(0), PACK64(64), PACK64(128), PACK64(192)};

static inline __m256 absolute(__m256 x)
{
    return _mm256_andnot_ps(_mm256_set1_ps(-0.0f), x);
}

static inline __m256 in_order(__m256 a, __m256 b) /* a <= b, false for NaN */
{
    return _mm256_cmp_ps(a, b, _CMP_LE_OQ);
}

static inline __m256 along(const struct sv_warp_line *line, int k, __m256 e, __m256 h)
{
    __m256 flat = _mm256_add_ps(_mm256_set1_ps(line->base[k]), _mm256_mul_ps(e, _mm256_set1_ps(line->du[k])));
    return _mm256_add_ps(flat, _mm256_mul_ps(h, _mm256_set1_ps(line->dt[k])));
}

static float fold(__m256 v, int largest)
{
    float lane[LANES];
    _mm256_storeu_ps(lane, v);
    float best = lane[0];
    for (int i = 1; i < LANES; i++)
        best = (largest ? lane[i] > best : lane[i] < best) ? lane[i] : best;
    return best;
}

struct extent {
    __m256 min_x, max_x, min_y, max_y;
};

/* What is not drawn is NaN here, which leaves the bound (the second operand) as it is. */
static inline void extent_add(struct extent *extent, __m256 x, __m256 y)
{
    extent->min_x = _mm256_min_ps(x, extent->min_x);
    extent->max_x = _mm256_max_ps(x, extent->max_x);
    extent->min_y = _mm256_min_ps(y, extent->min_y);
    extent->max_y = _mm256_max_ps(y, extent->max_y);
}

/* Projects eight texels; returns the mask of solid ones. */
static inline unsigned project8(const struct sv_warp_line *line, const float *t, const uint8_t (*color)[4],
                                __m256 e, int at, struct sv_warp_row *row, struct extent *extent)
{
    __m256 h = _mm256_loadu_ps(t), zero = _mm256_setzero_ps(), one = _mm256_set1_ps(1);
    __m256 far_px = _mm256_set1_ps(SV_WARP_FAR_PX);
    __m256 alpha = _mm256_loadu_ps((const float *)color); /* its sign bit is alpha's 128 */
    __m256 w = along(line, 3, e, h), inverse = _mm256_div_ps(one, w);
    __m256 x = _mm256_mul_ps(along(line, 0, e, h), inverse);
    __m256 y = _mm256_mul_ps(along(line, 1, e, h), inverse);
    __m256 d = _mm256_mul_ps(along(line, 2, e, h), inverse);
    __m256 solid = _mm256_castsi256_ps(_mm256_srai_epi32(_mm256_castps_si256(alpha), 31));
    solid = _mm256_and_ps(solid, in_order(absolute(h), _mm256_set1_ps(SV_WARP_T_MAX)));
    __m256 drawn = _mm256_and_ps(solid, _mm256_cmp_ps(w, zero, _CMP_GT_OQ));
    drawn = _mm256_and_ps(drawn, _mm256_and_ps(in_order(zero, d), in_order(d, one)));
    drawn = _mm256_and_ps(drawn, _mm256_and_ps(in_order(absolute(x), far_px), in_order(absolute(y), far_px)));
    __m256 absent = _mm256_xor_ps(drawn, _mm256_cmp_ps(one, one, _CMP_EQ_OQ)); /* all ones: a NaN */
    _mm256_storeu_ps(row->t + at, _mm256_or_ps(h, absent));
    _mm256_storeu_ps(row->x + at, _mm256_and_ps(x, drawn));
    _mm256_storeu_ps(row->y + at, _mm256_and_ps(y, drawn));
    _mm256_storeu_ps(row->d + at, _mm256_and_ps(d, drawn));
    extent_add(extent, _mm256_or_ps(x, absent), _mm256_or_ps(y, absent));
    return (unsigned)_mm256_movemask_ps(solid);
}

static uint32_t project(const struct sv_warp_line *line, const float *t, const uint8_t (*color)[4], int n,
                        int at, struct sv_warp_row *row)
{
    uint32_t solid = 0;
    int i = 0;
    struct extent extent = {_mm256_set1_ps(row->min_x), _mm256_set1_ps(row->max_x),
                            _mm256_set1_ps(row->min_y), _mm256_set1_ps(row->max_y)};
    const __m256 lane = _mm256_setr_ps(0, 1, 2, 3, 4, 5, 6, 7);
    for (; i + LANES <= n; i += LANES) {
        __m256 e = _mm256_add_ps(_mm256_set1_ps((float)(at + i)), lane);
        solid += (uint32_t)__builtin_popcount(project8(line, t + i, color + i, e, at + i, row, &extent));
    }
    row->min_x = fold(extent.min_x, 0);
    row->max_x = fold(extent.max_x, 1);
    row->min_y = fold(extent.min_y, 0);
    row->max_y = fold(extent.max_y, 1);
    return solid + sv_warp_project_scalar(line, t + i, color + i, n - i, at + i, row);
}

/* Eight cells: corners, and what the scalar version calls quad. */
struct quads {
    __m256 x0, y0, sx, sy, rx, ry, s_max, r_max, d0, ds, dr, d_min, d_max, box;
    __m256i i0, j0, nx, ny;
};

/* First pixel and number of those whose centres lie in [lo, hi]; the number is 0 or less when there is none.
 */
static inline __m256i pixel_range(__m256 lo, __m256 hi, int size, __m256i *first)
{
    __m256 half = _mm256_set1_ps(0.5f);
    __m256 a = _mm256_ceil_ps(_mm256_max_ps(_mm256_sub_ps(lo, half), _mm256_setzero_ps()));
    __m256 b = _mm256_floor_ps(_mm256_min_ps(_mm256_sub_ps(hi, half), _mm256_set1_ps((float)(size - 1))));
    *first = _mm256_cvtps_epi32(a);
    return _mm256_cvtps_epi32(_mm256_add_ps(_mm256_sub_ps(b, a), _mm256_set1_ps(1)));
}

static inline __m256 min4(__m256 a, __m256 b, __m256 c, __m256 d)
{
    return _mm256_min_ps(_mm256_min_ps(a, b), _mm256_min_ps(c, d));
}

static inline __m256 max4(__m256 a, __m256 b, __m256 c, __m256 d)
{
    return _mm256_max_ps(_mm256_max_ps(a, b), _mm256_max_ps(c, d));
}

static inline __m256 joined(const float *a, const float *b, __m256 cut)
{
    return in_order(absolute(_mm256_sub_ps(_mm256_loadu_ps(a), _mm256_loadu_ps(b))), cut);
}

/* Boxes of eight cells; the mask of those that hold a pixel centre. */
static inline __m256 boxes(const struct sv_warp_row *up, const struct sv_warp_row *lo, int c,
                           const struct sv_warp_buffer *buffer, struct quads *q)
{
    __m256 x00 = _mm256_loadu_ps(up->x + c), x10 = _mm256_loadu_ps(up->x + c + 1);
    __m256 x01 = _mm256_loadu_ps(lo->x + c), x11 = _mm256_loadu_ps(lo->x + c + 1);
    __m256 y00 = _mm256_loadu_ps(up->y + c), y10 = _mm256_loadu_ps(up->y + c + 1);
    __m256 y01 = _mm256_loadu_ps(lo->y + c), y11 = _mm256_loadu_ps(lo->y + c + 1);
    __m256 x0 = min4(x00, x10, x01, x11), x1 = max4(x00, x10, x01, x11);
    __m256 y0 = min4(y00, y10, y01, y11), y1 = max4(y00, y10, y01, y11);
    q->nx = pixel_range(x0, x1, buffer->width, &q->i0);
    q->ny = pixel_range(y0, y1, buffer->height, &q->j0);
    q->box = _mm256_mul_ps(_mm256_sub_ps(x1, x0), _mm256_sub_ps(y1, y0));
    __m256i zero = _mm256_setzero_si256();
    __m256i shown = _mm256_and_si256(_mm256_cmpgt_epi32(q->nx, zero), _mm256_cmpgt_epi32(q->ny, zero));
    __m256i end = _mm256_add_epi32(q->j0, q->ny);
    shown = _mm256_and_si256(shown, _mm256_cmpgt_epi32(_mm256_set1_epi32(buffer->end), q->j0));
    return _mm256_castsi256_ps(
        _mm256_and_si256(shown, _mm256_cmpgt_epi32(end, _mm256_set1_epi32(buffer->first))));
}

static inline __m256 cross(__m256 ax, __m256 by, __m256 ay, __m256 bx) /* ax by - ay bx */
{
    return _mm256_sub_ps(_mm256_mul_ps(ax, by), _mm256_mul_ps(ay, bx));
}

/* Sets up eight cells; the mask of those that are fast. */
static inline __m256 quads_set(const struct sv_warp_row *up, const struct sv_warp_row *lo, int c,
                               struct quads *q)
{
    __m256 x0 = _mm256_loadu_ps(up->x + c), y0 = _mm256_loadu_ps(up->y + c), one = _mm256_set1_ps(1);
    __m256 e1x = _mm256_sub_ps(_mm256_loadu_ps(up->x + c + 1), x0);
    __m256 e1y = _mm256_sub_ps(_mm256_loadu_ps(up->y + c + 1), y0);
    __m256 e2x = _mm256_sub_ps(_mm256_loadu_ps(lo->x + c), x0);
    __m256 e2y = _mm256_sub_ps(_mm256_loadu_ps(lo->y + c), y0);
    __m256 e3x = _mm256_sub_ps(_mm256_loadu_ps(lo->x + c + 1), x0);
    __m256 e3y = _mm256_sub_ps(_mm256_loadu_ps(lo->y + c + 1), y0);
    __m256 det = cross(e1x, e2y, e1y, e2x), inverse = _mm256_div_ps(one, det);
    __m256 edge = _mm256_set1_ps(SV_WARP_EDGE), twist = _mm256_set1_ps(SV_WARP_TWIST);
    q->sx = _mm256_mul_ps(e2y, inverse);
    q->sy = _mm256_mul_ps(e2x, inverse);
    q->rx = _mm256_mul_ps(e1y, inverse);
    q->ry = _mm256_mul_ps(e1x, inverse);
    __m256 s3 = cross(e3x, q->sx, e3y, q->sy), r3 = cross(e3y, q->ry, e3x, q->rx);
    q->x0 = x0;
    q->y0 = y0;
    q->s_max = _mm256_add_ps(_mm256_max_ps(s3, one), edge);
    q->r_max = _mm256_add_ps(_mm256_max_ps(r3, one), edge);
    __m256 d10 = _mm256_loadu_ps(up->d + c + 1), d01 = _mm256_loadu_ps(lo->d + c);
    __m256 d11 = _mm256_loadu_ps(lo->d + c + 1);
    q->d0 = _mm256_loadu_ps(up->d + c);
    q->ds = _mm256_sub_ps(d10, q->d0);
    q->dr = _mm256_sub_ps(d01, q->d0);
    q->d_min = min4(q->d0, d10, d01, d11);
    q->d_max = max4(q->d0, d10, d01, d11);
    __m256i large = _mm256_or_si256(_mm256_cmpgt_epi32(q->nx, _mm256_set1_epi32(SV_WARP_SMALL)),
                                    _mm256_cmpgt_epi32(q->ny, _mm256_set1_epi32(SV_WARP_SMALL)));
    __m256 fast = in_order(_mm256_mul_ps(q->box, _mm256_set1_ps(SV_WARP_SLIVER)), absolute(det));
    fast = _mm256_and_ps(fast, in_order(absolute(_mm256_sub_ps(s3, one)), twist));
    fast = _mm256_and_ps(fast, in_order(absolute(_mm256_sub_ps(r3, one)), twist));
    return _mm256_andnot_ps(_mm256_castsi256_ps(large), fast);
}

/* sv_warp_place; s and r are above -1 / 128, which is cut to 0 without being asked for. */
static inline __m256i place_of(__m256 s, __m256 r)
{
    __m256 a = _mm256_min_ps(_mm256_mul_ps(s, _mm256_set1_ps(256)), _mm256_set1_ps(255));
    __m256 b = _mm256_min_ps(_mm256_mul_ps(r, _mm256_set1_ps(128)), _mm256_set1_ps(127));
    __m256i u = _mm256_slli_epi32(_mm256_cvttps_epi32(a), 8);
    __m256i v = _mm256_slli_epi32(_mm256_cvttps_epi32(b), 1);
    return _mm256_or_si256(u, v);
}

/* One pixel of each cell's box; column carries place[]'s flag, too. */
static inline void slot(const struct quads *q, __m256 mask, __m256 s, __m256 r, __m256i pixel, __m256i column,
                        struct sv_warp_list *list)
{
    __m256 least = _mm256_set1_ps(-SV_WARP_EDGE);
    mask = _mm256_and_ps(mask, _mm256_and_ps(in_order(least, s), in_order(s, q->s_max)));
    mask = _mm256_and_ps(mask, _mm256_and_ps(in_order(least, r), in_order(r, q->r_max)));
    unsigned bits = (unsigned)_mm256_movemask_ps(mask);
    if (bits == 0)
        return;
    __m256 d = _mm256_add_ps(_mm256_add_ps(q->d0, _mm256_mul_ps(s, q->ds)), _mm256_mul_ps(r, q->dr));
    d = _mm256_min_ps(_mm256_max_ps(d, q->d_min), q->d_max);
    sv_warp_list_add(list, bits, pixel, d, _mm256_or_si256(column, place_of(s, r)));
}

static inline __m256 more_than(__m256i count, int k)
{
    return _mm256_castsi256_ps(_mm256_cmpgt_epi32(count, _mm256_set1_epi32(k)));
}

static inline __m256 offset_of(__m256i first, __m256 from)
{
    return _mm256_sub_ps(_mm256_add_ps(_mm256_cvtepi32_ps(first), _mm256_set1_ps(0.5f)), from);
}

/* Those of them whose row is drawn. */
static inline __m256 in_band(const struct sv_warp_buffer *buffer, __m256i row, __m256 mask)
{
    __m256i above = _mm256_cmpgt_epi32(_mm256_set1_epi32(buffer->first), row);
    __m256i within = _mm256_andnot_si256(above, _mm256_cmpgt_epi32(_mm256_set1_epi32(buffer->end), row));
    return _mm256_and_ps(mask, _mm256_castsi256_ps(within));
}

static inline void quads_draw(const struct quads *q, __m256 fast, int c, const struct sv_warp_buffer *buffer,
                              struct sv_warp_list *list)
{
    const int width = buffer->width;
    const __m256i lane = _mm256_setr_epi32(1, 0x10001, 0x20001, 0x30001, 0x40001, 0x50001, 0x60001, 0x70001);
    __m256i column = _mm256_add_epi32(_mm256_set1_epi32(c << 16), lane);
    __m256i first = _mm256_add_epi32(_mm256_mullo_epi32(q->j0, _mm256_set1_epi32(width)), q->i0);
    __m256 dx0 = offset_of(q->i0, q->x0), dy0 = offset_of(q->j0, q->y0);
    __m256 sx0 = _mm256_mul_ps(dx0, q->sx), rx0 = _mm256_mul_ps(dx0, q->rx);
    for (int ky = 0; ky < SV_WARP_SMALL; ky++) {
        __m256 mask = _mm256_and_ps(fast, more_than(q->ny, ky));
        if (_mm256_movemask_ps(mask) == 0)
            return;
        mask = in_band(buffer, _mm256_add_epi32(q->j0, _mm256_set1_epi32(ky)), mask);
        __m256 dy = _mm256_add_ps(dy0, _mm256_set1_ps((float)ky));
        __m256 sy = _mm256_mul_ps(dy, q->sy), ry = _mm256_mul_ps(dy, q->ry);
        slot(q, mask, _mm256_sub_ps(sx0, sy), _mm256_sub_ps(ry, rx0), first, column, list);
        for (int kx = 1; kx < SV_WARP_SMALL; kx++) {
            __m256 more = _mm256_and_ps(mask, more_than(q->nx, kx));
            if (_mm256_movemask_ps(more) == 0)
                break;
            __m256 dx = _mm256_add_ps(dx0, _mm256_set1_ps((float)kx));
            __m256 s = _mm256_sub_ps(_mm256_mul_ps(dx, q->sx), sy);
            __m256 r = _mm256_sub_ps(ry, _mm256_mul_ps(dx, q->rx));
            slot(q, more, s, r, _mm256_add_epi32(first, _mm256_set1_epi32(kx)), column, list);
        }
        first = _mm256_add_epi32(first, _mm256_set1_epi32(width));
    }
}

static inline unsigned there(const float *t)
{
    __m256 v = _mm256_loadu_ps(t);
    return (unsigned)_mm256_movemask_ps(_mm256_cmp_ps(v, v, _CMP_ORD_Q));
}

static int cells(struct sv_warp_job *job, const struct sv_warp_row *up, const struct sv_warp_row *lo, int n,
                 uint16_t *slow)
{
    struct sv_warp_list list;
    __m256 cut = _mm256_set1_ps(job->source->cut);
    int listed = 0;
    list.count = 0; /* and nothing more: the rest is large */
    for (int c = job->from; c < n; c += LANES) {
        struct quads q;
        unsigned inside = n - c < LANES ? (1u << (n - c)) - 1 : 255;
        __m256 full =
            _mm256_and_ps(joined(up->t + c, up->t + c + 1, cut), joined(lo->t + c, lo->t + c + 1, cut));
        full = _mm256_and_ps(full, joined(up->t + c, lo->t + c, cut));
        full = _mm256_and_ps(full, joined(up->t + c + 1, lo->t + c + 1, cut));
        __m256 shown = _mm256_and_ps(full, boxes(up, lo, c, job->buffer, &q));
        unsigned full_bits = (unsigned)_mm256_movemask_ps(full), left = 0;
        if (_mm256_movemask_ps(shown)) {
            __m256 fast = _mm256_and_ps(shown, quads_set(up, lo, c, &q));
            left = (unsigned)_mm256_movemask_ps(_mm256_andnot_ps(fast, shown));
            quads_draw(&q, fast, c, job->buffer, &list);
            if (list.count >= SV_WARP_LIST)
                sv_warp_list_put(&list, job, NULL);
        }
        if (full_bits != 255)
            left |= (there(up->t + c) | there(up->t + c + 1) | there(lo->t + c) | there(lo->t + c + 1)) &
                    ~full_bits;
        for (left &= inside; left; left &= left - 1)
            slow[listed++] = (uint16_t)(c + __builtin_ctz(left));
    }
    sv_warp_list_put(&list, job, NULL);
    return listed;
}

const struct sv_warp_kernel sv_warp_avx2 = {.project = project, .cells = cells};
