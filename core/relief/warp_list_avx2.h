/* warp_list_avx2.h - pixels of eight cells at a time on their way into the buffer: those that are covered are
 * packed into a list first, because the scatter is quick only when nothing else is in its loop. Private to
 * the AVX2 kernels of the warp and of relief objects. */
#ifndef SV_RELIEF_WARP_LIST_AVX2_H
#define SV_RELIEF_WARP_LIST_AVX2_H

#include <immintrin.h>

#include "core/relief/warp_kernel.h"

/* Pixels that may be listed before the list is emptied, and what eight cells may add to it. */
enum { SV_WARP_LIST = 1024, SV_WARP_LIST_STEP = 8 * SV_WARP_SMALL * SV_WARP_SMALL };
/* Pixels are fetched this many entries before they are drawn. */
enum { SV_WARP_LIST_AHEAD = 16 };

/* code: number of the cell << 16 | place[] of the pixel. */
struct sv_warp_list {
    int count;
    uint32_t pixel[SV_WARP_LIST + SV_WARP_LIST_STEP + SV_WARP_LIST_AHEAD],
        code[SV_WARP_LIST + SV_WARP_LIST_STEP + 8];
    float d[SV_WARP_LIST + SV_WARP_LIST_STEP + 8];
};

/* For each mask of eight lanes the chosen ones, packed to the front, a byte each. */
extern const uint64_t sv_warp_pack[256];

static inline __m256i sv_warp_order(unsigned mask)
{
    return _mm256_cvtepu8_epi32(_mm_loadl_epi64((const __m128i *)(const void *)&sv_warp_pack[mask]));
}

/* The largest of eight, at least 0. */
static inline int sv_warp_largest(__m256i v)
{
    __m128i m = _mm_max_epi32(_mm256_castsi256_si128(v), _mm256_extracti128_si256(v, 1));
    m = _mm_max_epi32(m, _mm_shuffle_epi32(m, 0x4e));
    m = _mm_max_epi32(m, _mm_shuffle_epi32(m, 0xb1));
    int most = _mm_cvtsi128_si32(m);
    return most > 0 ? most : 0;
}

static inline void sv_warp_list_add(struct sv_warp_list *list, unsigned mask, __m256i pixel, __m256 d,
                                    __m256i code)
{
    __m256i order = sv_warp_order(mask);
    int n = list->count;
    _mm256_storeu_si256((__m256i *)(list->pixel + n), _mm256_permutevar8x32_epi32(pixel, order));
    _mm256_storeu_si256((__m256i *)(list->code + n), _mm256_permutevar8x32_epi32(code, order));
    _mm256_storeu_ps(list->d + n, _mm256_permutevar8x32_ps(d, order));
    list->count = n + __builtin_popcount(mask);
}

/* Empties the list into the buffer, as sv_warp_put does, but without a branch: which pixels are won cannot be
 * foretold. Texel of cell number k: tags[k], or tag0 + k when there are no tags. Depth and texel are one
 * number, whose order is that of sv_warp_put. */
static inline void sv_warp_list_put(struct sv_warp_list *list, struct sv_warp_job *job, const uint32_t *tags)
{
    struct sv_warp_pixels to = sv_warp_pixels_of(job->buffer);
    uint32_t pixels = 0, tag0 = job->tag0;
    int count = list->count;
    for (int i = 0; i < SV_WARP_LIST_AHEAD; i++)
        list->pixel[count + i] = 0;
    for (int i = 0; i < count; i++) {
        size_t p = list->pixel[i], ahead = list->pixel[i + SV_WARP_LIST_AHEAD];
        __builtin_prefetch(&to.depth[ahead], 1);
        __builtin_prefetch(&to.texel[ahead], 1);
        __builtin_prefetch(&to.place[ahead], 1);
        uint32_t code = list->code[i], held = to.texel[p], other = to.place[p], place = code & 0xffff;
        uint32_t texel = tags ? tags[code >> 16] : tag0 + (code >> 16);
        int32_t before, now;
        memcpy(&before, &to.depth[p], sizeof before);
        memcpy(&now, &list->d[i], sizeof now);
        int64_t old = (int64_t)before * (INT64_C(1) << 32) + ~held;
        int64_t new = (int64_t)now *(INT64_C(1) << 32) + ~texel;
        uint64_t wins = (uint64_t)(new > old) | ((uint64_t)(new == old) & (uint64_t)(place > other));
        uint64_t key = (uint64_t)old ^ (((uint64_t)old ^ (uint64_t) new) & -wins);
        pixels += (uint32_t)wins & (uint32_t)(held == SV_WARP_EMPTY);
        now = (int32_t)(key >> 32);
        memcpy(&to.depth[p], &now, sizeof now);
        to.texel[p] = ~(uint32_t)key;
        to.place[p] = (uint16_t)(other ^ ((other ^ place) & (uint32_t)-wins));
    }
    job->pixels += pixels;
    list->count = 0;
}

#endif
