/* object_seen_avx2.c - the cells that a row of pixels names, eight pixels at a time: what is new is packed
 * together first, because which pixels are cannot be foretold. */
#include <immintrin.h>
#include <string.h>

#include "core/relief/object_splat_kernel.h"
#include "core/relief/warp_list_avx2.h"

int sv_relief_names_avx2(const uint32_t *texel, const uint16_t *place, int count, uint32_t *above,
                         uint32_t *names)
{
    const __m256i none = _mm256_set1_epi32(-1), one = _mm256_set1_epi32(1);
    const __m256i turn = _mm256_setr_epi32(7, 0, 1, 2, 3, 4, 5, 6);
    __m256i before = none; /* the eight pixels before, turned by one */
    int n = 0, i = 0;
    for (; i + 8 <= count; i += 8) {
        __m256i t = _mm256_loadu_si256((const __m256i *)(const void *)(texel + i));
        __m256i full = _mm256_cvtepu16_epi32(_mm_loadu_si128((const __m128i *)(const void *)(place + i)));
        __m256i name = _mm256_or_si256(_mm256_add_epi32(t, t), _mm256_and_si256(full, one));
        name = _mm256_or_si256(name, _mm256_cmpeq_epi32(t, none));
        __m256i turned = _mm256_permutevar8x32_epi32(name, turn);
        __m256i *kept = (__m256i *)(void *)(above + i);
        __m256i old = _mm256_cmpeq_epi32(name, _mm256_blend_epi32(turned, before, 1));
        old = _mm256_or_si256(old, _mm256_cmpeq_epi32(name, _mm256_loadu_si256(kept)));
        old = _mm256_or_si256(old, _mm256_cmpeq_epi32(name, none));
        _mm256_storeu_si256(kept, name);
        before = turned;
        unsigned fresh = ~(unsigned)_mm256_movemask_ps(_mm256_castsi256_ps(old)) & 255;
        _mm256_storeu_si256((__m256i *)(void *)(names + n),
                            _mm256_permutevar8x32_epi32(name, sv_warp_order(fresh)));
        n += __builtin_popcount(fresh);
    }
    return n + sv_relief_names_scalar(texel + i, place + i, count - i, above + i, names + n);
}

int sv_relief_beside_avx2(const uint8_t *cell, int width, uint8_t *group)
{
    const __m256i zero = _mm256_setzero_si256();
    const uint8_t *upper = cell - width;
    int i = 0;
    for (; i + 32 <= width; i += 32, group += 4) {
        __m256i a = _mm256_loadu_si256((const __m256i *)(const void *)(cell + i));
        __m256i b = _mm256_loadu_si256((const __m256i *)(const void *)(cell + i - 1));
        __m256i c = _mm256_loadu_si256((const __m256i *)(const void *)(upper + i));
        __m256i d = _mm256_loadu_si256((const __m256i *)(const void *)(upper + i - 1));
        __m256i any = _mm256_or_si256(_mm256_or_si256(a, b), _mm256_or_si256(c, d));
        __m256i none = _mm256_cmpeq_epi64(any, zero);
        /* a byte of each of four: 0 where none is */
        __m128i words = _mm_packs_epi32(_mm256_castsi256_si128(none), _mm256_extracti128_si256(none, 1));
        int32_t four = _mm_cvtsi128_si32(_mm_shuffle_epi8(
            words, _mm_setr_epi8(0, 4, 8, 12, -1, -1, -1, -1, -1, -1, -1, -1, -1, -1, -1, -1)));
        four = ~four & 0x01010101;
        memcpy(group, &four, 4);
    }
    return i;
}
