/* warp_resolve_avx2.c - colours of full cells, eight pixels at a time: the same integers as blend_full in
 * warp_resolve.c. What is torn or filled among the eight goes the plain way. */
#include <immintrin.h>

#include "core/relief/warp_kernel.h"

enum { LANES = 8 };

/* Pairs of texels (left, right) of four cells: 16-bit channels of the left ones, and of the right ones, in
 * the order of cells 0, 1 | 2, 3. */
static inline void split_pairs(__m256i pairs, __m256i *left, __m256i *right)
{
    __m256i zero = _mm256_setzero_si256();
    __m256i even = _mm256_unpacklo_epi8(pairs, zero), odd = _mm256_unpackhi_epi8(pairs, zero);
    *left = _mm256_slli_epi16(_mm256_unpacklo_epi64(even, odd), 6);
    *right = _mm256_slli_epi16(_mm256_unpackhi_epi64(even, odd), 6);
}

static inline __m256i lerp(__m256i from, __m256i to, __m256i part)
{
    return _mm256_add_epi16(from, _mm256_mulhrs_epi16(_mm256_sub_epi16(to, from), part));
}

/* Weight of each of four pixels (32 bits a lane, 15 used), repeated for the four channels. */
static inline __m256i spread(__m128i part)
{
    const __m256i order = _mm256_setr_epi8(0, 1, 0, 1, 0, 1, 0, 1, 8, 9, 8, 9, 8, 9, 8, 9, 0, 1, 0, 1, 0, 1,
                                           0, 1, 8, 9, 8, 9, 8, 9, 8, 9);
    return _mm256_shuffle_epi8(_mm256_cvtepu32_epi64(part), order);
}

/* Four pixels: 16-bit channels of their colours. */
static inline __m256i blend4(const uint8_t (*color)[4], __m128i texel, __m128i below, __m128i u, __m128i v)
{
    __m256i left, right, part = spread(u);
    const long long *pairs = (const long long *)(const void *)color;
    split_pairs(_mm256_i32gather_epi64(pairs, texel, 4), &left, &right);
    __m256i top = lerp(left, right, part);
    split_pairs(_mm256_i32gather_epi64(pairs, below, 4), &left, &right);
    __m256i both = lerp(top, lerp(left, right, part), spread(v));
    return _mm256_srli_epi16(_mm256_add_epi16(both, _mm256_set1_epi16(32)), 6);
}

/* Colours of eight pixels; lanes that are not `chosen` are anything. */
static inline __m256i blend8(const struct sv_warp_source *source, __m256i texel, __m256i place,
                             __m256i chosen)
{
    __m256i index = _mm256_and_si256(texel, _mm256_set1_epi32((int)SV_WARP_TEXEL_MASK));
    index = _mm256_and_si256(index, chosen); /* a source with one full cell has one at texel 0's place */
    __m256i below = _mm256_add_epi32(index, _mm256_set1_epi32(source->width));
    __m256i u = _mm256_add_epi32(_mm256_slli_epi32(_mm256_srli_epi32(place, 8), 7), _mm256_set1_epi32(64));
    __m256i v = _mm256_and_si256(_mm256_srli_epi32(place, 1), _mm256_set1_epi32(127));
    v = _mm256_add_epi32(_mm256_slli_epi32(v, 8), _mm256_set1_epi32(128));
    __m256i low = blend4(source->color, _mm256_castsi256_si128(index), _mm256_castsi256_si128(below),
                         _mm256_castsi256_si128(u), _mm256_castsi256_si128(v));
    __m256i high =
        blend4(source->color, _mm256_extracti128_si256(index, 1), _mm256_extracti128_si256(below, 1),
               _mm256_extracti128_si256(u, 1), _mm256_extracti128_si256(v, 1));
    return _mm256_permute4x64_epi64(_mm256_packus_epi16(low, high), 0xd8);
}

/* Eight pixels from p on: those in full cells together, the others one by one. */
static inline void resolve8(const struct sv_warp_source *sources, const struct sv_warp_buffer *buffer, int j,
                            int i, uint8_t (*rgba)[4])
{
    size_t p = (size_t)j * (size_t)buffer->width + (size_t)i;
    const __m256i one = _mm256_set1_epi32(1);
    __m256i texel = _mm256_loadu_si256((const __m256i *)(buffer->texel + p));
    __m256i nothing = _mm256_cmpeq_epi32(texel, _mm256_set1_epi32(-1));
    unsigned left = ~(unsigned)_mm256_movemask_ps(_mm256_castsi256_ps(nothing)) & 255;
    if (left == 0)
        return;
    __m256i place = _mm256_cvtepu16_epi32(_mm_loadu_si128((const __m128i *)(buffer->place + p)));
    __m256i full = _mm256_cmpeq_epi32(_mm256_and_si256(place, one), one);
    full = _mm256_andnot_si256(nothing, full);
    __m256i number = _mm256_srli_epi32(texel, SV_WARP_TEXEL_BITS), seen = _mm256_setzero_si256();
    const unsigned quick = (unsigned)_mm256_movemask_ps(_mm256_castsi256_ps(full));
    for (unsigned rest = quick; rest;) { /* source by source: two where faces meet */
        unsigned k = buffer->texel[p + (unsigned)__builtin_ctz(rest)] >> SV_WARP_TEXEL_BITS;
        __m256i chosen = _mm256_and_si256(full, _mm256_cmpeq_epi32(number, _mm256_set1_epi32((int)k)));
        seen = _mm256_blendv_epi8(seen, blend8(&sources[k], texel, place, chosen), chosen);
        rest &= ~(unsigned)_mm256_movemask_ps(_mm256_castsi256_ps(chosen));
    }
    if (quick == 255)
        _mm256_storeu_si256((__m256i *)(void *)(rgba + p), seen);
    else if (quick)
        _mm256_maskstore_epi32((int *)(void *)(rgba + p), full, seen);
    for (left &= ~quick; left; left &= left - 1) {
        int at = i + __builtin_ctz(left);
        sv_warp_resolve_run(sources, buffer, j, at, at + 1, rgba);
    }
}

void sv_warp_resolve_avx2(const struct sv_warp_source *sources, const struct sv_warp_buffer *buffer,
                          uint8_t (*rgba)[4])
{
    for (int j = buffer->y0; j < buffer->y1; j++) {
        int i = buffer->x0;
        for (; i + LANES <= buffer->x1; i += LANES)
            resolve8(sources, buffer, j, i, rgba);
        sv_warp_resolve_run(sources, buffer, j, i, buffer->x1, rgba);
    }
}
