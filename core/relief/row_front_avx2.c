/* row_front_avx2.c - AVX2 kernels of the row front: the same operations in the same order as the scalar ones
 * in row_front.c, so that every bit agrees (no fused multiply-add). The end of a row is done by eight samples
 * of which some are done again, to the same end. */
#include "core/relief/row_front_kernel.h"

#include <immintrin.h>
#include <stdbool.h>

#include "core/relief/row_front.h"

static int take_avx2(int count, const float *height, const float *initial, float *own, float *shadow,
                     float *caster)
{
    const __m256 sign = _mm256_set1_ps(-0.0f), top = _mm256_set1_ps(-SV_ROW_FRONT_NONE),
                 none = _mm256_set1_ps(SV_ROW_FRONT_NONE), nothing = _mm256_set1_ps(SV_FRONT_VOID);
    __m256 least = top;
    if (count < 8)
        return sv_front_scalar.take(count, height, initial, own, shadow, caster);
    for (int end = 8; end < count + 8; end += 8) {
        int i = (end < count ? end : count) - 8;
        __m256 h = _mm256_loadu_ps(height + i);
        __m256 real = _mm256_cmp_ps(_mm256_andnot_ps(sign, h), top, _CMP_LT_OQ);
        h = _mm256_blendv_ps(nothing, h, real);
        _mm256_storeu_ps(own + i, h);
        if (initial) {
            __m256 p = _mm256_loadu_ps(initial + i);
            __m256 some = _mm256_cmp_ps(p, none, _CMP_GT_OQ);
            p = _mm256_blendv_ps(nothing, _mm256_min_ps(p, top), some);
            _mm256_storeu_ps(shadow + i, p);
            h = _mm256_max_ps(h, p);
            _mm256_storeu_ps(caster + i, h);
        }
        least = _mm256_min_ps(least, h);
    }
    return _mm256_movemask_ps(_mm256_cmp_ps(least, _mm256_set1_ps(SV_FRONT_REAL), _CMP_GT_OQ)) == 0xFF;
}

static inline __m256 mix(__m256 a, __m256 b, __m256 weight)
{
    return _mm256_add_ps(a, _mm256_mul_ps(_mm256_sub_ps(b, a), weight));
}

static inline __m256 between(__m256 a, __m256 b, __m256 weight, __m256 nearer)
{
    __m256 mixed = mix(a, b, weight);
    __m256 real = _mm256_cmp_ps(_mm256_min_ps(a, b), _mm256_set1_ps(SV_FRONT_REAL), _CMP_GT_OQ);
    return _mm256_blendv_ps(nearer, mixed, real);
}

static void cross_avx2(int count, const float *before, const float *after, float t, float lift, float *ray)
{
    const __m256 weight = _mm256_set1_ps(t), up = _mm256_set1_ps(lift);
    const float *nearer = t < 0.5f ? before : after;
    if (count < 8) {
        sv_front_scalar.cross(count, before, after, t, lift, ray);
        return;
    }
    for (int end = 8; end < count + 8; end += 8) {
        int i = (end < count ? end : count) - 8;
        __m256 h = between(_mm256_loadu_ps(before + i), _mm256_loadu_ps(after + i), weight,
                           _mm256_loadu_ps(nearer + i));
        _mm256_storeu_ps(ray + i, _mm256_max_ps(_mm256_add_ps(h, up), _mm256_loadu_ps(ray + i)));
    }
}

/* Eight samples' lit bytes from a mask of lanes. */
static inline void store_lit(__m256 dark, uint8_t *lit)
{
    __m256i d = _mm256_castps_si256(dark);
    __m128i w = _mm_packs_epi32(_mm256_castsi256_si128(d), _mm256_extracti128_si256(d, 1));
    __m128i b = _mm_packs_epi16(w, w);
    _mm_storel_epi64((__m128i *)(void *)lit, _mm_andnot_si128(b, _mm_set1_epi8(-1)));
}

/* As between; whole: known that both are real. */
static inline __m256 between_if(int whole, __m256 a, __m256 b, __m256 weight, __m256 nearer)
{
    return whole ? mix(a, b, weight) : between(a, b, weight, nearer);
}

/* arrive() of row_front.c for eight samples. */
static inline __m256 arrive(int whole, const struct sv_front_row *row, int i, __m256 f, __m256 left,
                            __m256 right)
{
    const __m256 real = _mm256_set1_ps(SV_FRONT_REAL);
    __m256 r = _mm256_loadu_ps(row->ray + i), l = _mm256_loadu_ps(row->ray + i - 1),
           c = _mm256_loadu_ps(row->caster + i);
    __m256 in = _mm256_sub_ps(between(r, l, f, row->fraction < 0.5f ? r : l), _mm256_set1_ps(row->lift));
    __m256 surface = mix(right, left, f);
    __m256 relative = _mm256_add_ps(in, _mm256_sub_ps(c, surface)), least = _mm256_min_ps(relative, in);
    if (whole)
        return least;
    __m256 known = _mm256_and_ps(_mm256_cmp_ps(_mm256_min_ps(left, right), real, _CMP_GT_OQ),
                                 _mm256_cmp_ps(c, real, _CMP_GT_OQ));
    return _mm256_blendv_ps(in, least, known);
}

/* arrive_near() of row_front.c. */
static inline __m256 arrive_near(int whole, const struct sv_front_row *row, int i)
{
    const __m256 slant = _mm256_set1_ps(row->slant), half = _mm256_set1_ps(0.5f * row->slant);
    __m256 c = _mm256_loadu_ps(row->caster + i), b = _mm256_loadu_ps(row->before + i),
           cn = _mm256_loadu_ps(row->caster + i + row->side),
           bn = _mm256_loadu_ps(row->before + i + row->side);
    __m256 far = between_if(whole, b, bn, slant, row->slant < 0.5f ? b : bn);
    __m256 middle = between_if(whole, between_if(whole, c, cn, half, c), between_if(whole, b, bn, half, b),
                               _mm256_set1_ps(0.5f), far);
    return _mm256_max_ps(_mm256_sub_ps(far, _mm256_set1_ps(row->drop)),
                         _mm256_sub_ps(middle, _mm256_set1_ps(0.5f * row->drop)));
}

/* Samples i .. i + 7; whole: they and their neighbours on either side are real, in this row and the one
 * before. */
static inline void row_block(int whole, const struct sv_front_row *row, int i)
{
    const __m256 f = _mm256_set1_ps(row->fraction), real = _mm256_set1_ps(SV_FRONT_REAL);
    __m256 cl = _mm256_loadu_ps(row->caster + i - 1), c = _mm256_loadu_ps(row->caster + i),
           cr = _mm256_loadu_ps(row->caster + i + 1);
    __m256 left = between_if(whole, cl, c, f, row->fraction < 0.5f ? cl : c),
           right = between_if(whole, c, cr, f, row->fraction < 0.5f ? c : cr);
    __m256 in = _mm256_max_ps(arrive(whole, row, i, f, left, right), arrive_near(whole, row, i));
    _mm256_storeu_ps(row->ray_next + i, _mm256_max_ps(_mm256_add_ps(right, _mm256_set1_ps(row->lift)),
                                                      _mm256_loadu_ps(row->ray + i)));
    if (row->initial)
        in = _mm256_max_ps(in, _mm256_loadu_ps(row->initial + i));
    in = _mm256_max_ps(in, _mm256_set1_ps(SV_ROW_FRONT_NONE));
    __m256 own = _mm256_loadu_ps(row->own + i);
    if (row->incoming)
        _mm256_storeu_ps(row->incoming + i, in);
    if (row->height)
        _mm256_storeu_ps(row->height + i, _mm256_max_ps(own, in));
    if (row->lit)
        store_lit(_mm256_and_ps(_mm256_cmp_ps(own, real, _CMP_GT_OQ),
                                _mm256_cmp_ps(own, _mm256_sub_ps(in, _mm256_set1_ps(row->bias)), _CMP_LT_OQ)),
                  row->lit + i);
}

static void row_avx2(const struct sv_front_row *given)
{
    const struct sv_front_row row = *given; /* a copy that no store can touch */
    if (row.count < 8) {
        sv_front_scalar.row(given);
        return;
    }
    int i = 0;
    for (; i + 8 <= row.count && (i == 0 || !row.whole); i += 8)
        row_block(0, &row, i);
    for (; i + 9 <= row.count; i += 8)
        row_block(1, &row, i);
    if (i < row.count)
        row_block(0, &row, row.count - 8);
}

/* 8 x 8 floats across their diagonal. */
static inline __attribute__((always_inline)) void turn_block(const float *in, int64_t in_stride, float *out,
                                                             int64_t out_stride)
{
    __m256 r[8], t[8];
    for (int k = 0; k < 8; k++)
        r[k] = _mm256_loadu_ps(in + k * in_stride);
    for (int k = 0; k < 4; k++) {
        t[2 * k] = _mm256_unpacklo_ps(r[2 * k], r[2 * k + 1]);
        t[2 * k + 1] = _mm256_unpackhi_ps(r[2 * k], r[2 * k + 1]);
    }
    for (int k = 0; k < 2; k++) {
        r[4 * k] = _mm256_shuffle_ps(t[4 * k], t[4 * k + 2], 0x44);
        r[4 * k + 1] = _mm256_shuffle_ps(t[4 * k], t[4 * k + 2], 0xEE);
        r[4 * k + 2] = _mm256_shuffle_ps(t[4 * k + 1], t[4 * k + 3], 0x44);
        r[4 * k + 3] = _mm256_shuffle_ps(t[4 * k + 1], t[4 * k + 3], 0xEE);
    }
    for (int k = 0; k < 4; k++) {
        _mm256_storeu_ps(out + k * out_stride, _mm256_permute2f128_ps(r[k], r[k + 4], 0x20));
        _mm256_storeu_ps(out + (k + 4) * out_stride, _mm256_permute2f128_ps(r[k], r[k + 4], 0x31));
    }
}

enum { AHEAD = 16 }; /* rows: 8 to 64 measure alike */

/* Eight rows of the large array: no hardware looks ahead over rows of a page each. */
static inline void look_ahead(const float *at, int64_t stride, int count)
{
    for (int k = 0; k < 8; k++)
        for (int q = 0; q < count; q += 16)
            __builtin_prefetch(at + k * stride + q);
}

static void turn_avx2(int columns, int rows, const float *in, int64_t in_stride, float *out,
                      int64_t out_stride)
{
    int wide = columns & ~7, high = rows & ~7;
    bool by_rows = rows >= columns;
    int outer = by_rows ? high : wide, inner = by_rows ? wide : high;
    for (int p = 0; p < outer; p += 8) {
        if (p + AHEAD + 8 <= outer)
            look_ahead(by_rows ? in + (p + AHEAD) * in_stride : out + (p + AHEAD) * out_stride,
                       by_rows ? in_stride : out_stride, inner);
        for (int q = 0; q < inner; q += 8) {
            int i = by_rows ? q : p, j = by_rows ? p : q;
            turn_block(in + j * in_stride + i, in_stride, out + i * out_stride + j, out_stride);
        }
    }
    if (wide < columns)
        sv_front_scalar.turn(columns - wide, high, in + wide, in_stride, out + wide * out_stride, out_stride);
    if (high < rows)
        sv_front_scalar.turn(columns, rows - high, in + high * in_stride, in_stride, out + high, out_stride);
}

/* 8 x 8 bytes across their diagonal. */
static inline void turn_bytes_block(const uint8_t *in, int64_t in_stride, uint8_t *out, int64_t out_stride)
{
    __m128i r[8];
    for (int k = 0; k < 8; k++)
        r[k] = _mm_loadl_epi64((const __m128i *)(const void *)(in + k * in_stride));
    for (int k = 0; k < 4; k++)
        r[k] = _mm_unpacklo_epi8(r[2 * k], r[2 * k + 1]); /* pairs of rows, columns 0 .. 7 */
    __m128i a = _mm_unpacklo_epi16(r[0], r[1]), b = _mm_unpackhi_epi16(r[0], r[1]);
    __m128i c = _mm_unpacklo_epi16(r[2], r[3]), d = _mm_unpackhi_epi16(r[2], r[3]);
    __m128i t[4] = {_mm_unpacklo_epi32(a, c), _mm_unpackhi_epi32(a, c), _mm_unpacklo_epi32(b, d),
                    _mm_unpackhi_epi32(b, d)};
    for (int k = 0; k < 4; k++) {
        _mm_storel_epi64((__m128i *)(void *)(out + 2 * k * out_stride), t[k]);
        _mm_storel_epi64((__m128i *)(void *)(out + (2 * k + 1) * out_stride), _mm_unpackhi_epi64(t[k], t[k]));
    }
}

static void turn_bytes_avx2(int columns, int rows, const uint8_t *in, int64_t in_stride, uint8_t *out,
                            int64_t out_stride)
{
    int wide = columns & ~7, high = rows & ~7;
    for (int i = 0; i < wide; i += 8) {
        for (int k = 0; k < 8 && i + AHEAD + 8 <= wide; k++) {
            __builtin_prefetch(out + (i + AHEAD + k) * out_stride, 1);
            __builtin_prefetch(out + (i + AHEAD + k) * out_stride + rows - 1, 1);
        }
        for (int j = 0; j < high; j += 8)
            turn_bytes_block(in + j * in_stride + i, in_stride, out + i * out_stride + j, out_stride);
    }
    if (wide < columns)
        sv_front_scalar.turn_bytes(columns - wide, high, in + wide, in_stride, out + wide * out_stride,
                                   out_stride);
    if (high < rows)
        sv_front_scalar.turn_bytes(columns, rows - high, in + high * in_stride, in_stride, out + high,
                                   out_stride);
}

const struct sv_front_kernels sv_front_avx2 = {take_avx2, cross_avx2, row_avx2, turn_avx2, turn_bytes_avx2};
