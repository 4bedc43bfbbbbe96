/* object_lookup_avx2.c - eight texels at once: the same arithmetic in the same order as object_lookup.c. */
#include <immintrin.h>

#include "core/relief/object_lookup.h"

static inline __m256 splat(float v)
{
    return _mm256_set1_ps(v);
}

static inline __m256 madd(__m256 sum, __m256 a, float b)
{
    return _mm256_add_ps(sum, _mm256_mul_ps(a, splat(b)));
}

static inline __m256 dot(const __m256 n[3], const float v[3])
{
    return madd(madd(_mm256_mul_ps(n[0], splat(v[0])), n[1], v[1]), n[2], v[2]);
}

static inline __m256 load_part(const int16_t *part)
{
    return _mm256_cvtepi32_ps(_mm256_cvtepi16_epi32(_mm_loadu_si128((const __m128i *)(const void *)part)));
}

/* Weight that passes in one row of the map: entries index and index + 1, fetched as pairs. */
static inline __m256 weigh(const float *depth, __m256i index, __m256 d, __m256 rest, __m256 fx)
{
    const long long *pairs = (const long long *)(const void *)depth;
    __m256 near = _mm256_castsi256_ps(_mm256_i32gather_epi64(pairs, _mm256_castsi256_si128(index), 4));
    __m256 far = _mm256_castsi256_ps(_mm256_i32gather_epi64(pairs, _mm256_extracti128_si256(index, 1), 4));
    __m256d left = _mm256_castps_pd(_mm256_shuffle_ps(near, far, _MM_SHUFFLE(2, 0, 2, 0)));
    __m256d right = _mm256_castps_pd(_mm256_shuffle_ps(near, far, _MM_SHUFFLE(3, 1, 3, 1)));
    __m256 p = _mm256_castpd_ps(_mm256_permute4x64_pd(left, _MM_SHUFFLE(3, 1, 2, 0)));
    __m256 q = _mm256_castpd_ps(_mm256_permute4x64_pd(right, _MM_SHUFFLE(3, 1, 2, 0)));
    return _mm256_add_ps(_mm256_and_ps(_mm256_cmp_ps(d, p, _CMP_GE_OQ), rest),
                         _mm256_and_ps(_mm256_cmp_ps(d, q, _CMP_GE_OQ), fx));
}

static inline __m256 passes(const struct sv_relief_lookup *map, __m256 x, __m256 y, __m256 d)
{
    const __m256 zero = _mm256_setzero_ps(), one = splat(1);
    __m256 in = _mm256_and_ps(_mm256_cmp_ps(x, zero, _CMP_GE_OQ), _mm256_cmp_ps(y, zero, _CMP_GE_OQ));
    in = _mm256_and_ps(in, _mm256_cmp_ps(x, splat((float)(map->width - 1)), _CMP_LT_OQ));
    in = _mm256_and_ps(in, _mm256_cmp_ps(y, splat((float)(map->height - 1)), _CMP_LT_OQ));
    __m256i i = _mm256_cvttps_epi32(_mm256_and_ps(x, in)), j = _mm256_cvttps_epi32(_mm256_and_ps(y, in));
    __m256 fx = _mm256_sub_ps(x, _mm256_cvtepi32_ps(i)), fy = _mm256_sub_ps(y, _mm256_cvtepi32_ps(j));
    __m256i p = _mm256_add_epi32(_mm256_mullo_epi32(j, _mm256_set1_epi32(map->width)), i);
    __m256i q = _mm256_add_epi32(p, _mm256_set1_epi32(map->width));
    __m256 rest = _mm256_sub_ps(one, fx);
    __m256 upper = weigh(map->depth, p, d, rest, fx), lower = weigh(map->depth, q, d, rest, fx);
    __m256 share = _mm256_add_ps(upper, _mm256_mul_ps(_mm256_sub_ps(lower, upper), fy));
    return _mm256_blendv_ps(one, share, in);
}

/* Texels i .. i + 7 of the sheet, of which `turned` turn to the sun. */
static inline void look_up8(const struct sv_relief_lookup *lookup, const struct sv_relief_lookup_sheet *sheet,
                            struct sv_relief_eight eight, size_t i, const __m256 n[3], __m256 turned)
{
    __m256 h = _mm256_loadu_ps(sheet->displ + i), at[3];
    __m256 u = _mm256_add_ps(splat((float)eight.column + 0.5f), _mm256_setr_ps(0, 1, 2, 3, 4, 5, 6, 7));
    for (int k = 0; k < 3; k++) {
        const float *m = lookup->at[k];
        __m256 sum = madd(splat(m[3] + m[1] * ((float)eight.row + 0.5f)), u, m[0]);
        at[k] = _mm256_add_ps(madd(sum, h, m[2]), dot(n, lookup->offset[k]));
    }
    __m256 share = _mm256_and_ps(passes(lookup, at[0], at[1], at[2]), turned);
    if (sheet->incoming) {
        __m256 under = _mm256_sub_ps(_mm256_loadu_ps(sheet->incoming + i), h);
        __m256 crevice = _mm256_and_ps(_mm256_cmp_ps(under, splat(lookup->low), _CMP_GT_OQ),
                                       _mm256_cmp_ps(under, splat(lookup->high), _CMP_LT_OQ));
        share = _mm256_andnot_ps(crevice, share);
    }
    __m256i level = _mm256_cvttps_epi32(_mm256_add_ps(_mm256_mul_ps(splat(255), share), splat(0.5f)));
    __m128i words = _mm_packus_epi32(_mm256_castsi256_si128(level), _mm256_extracti128_si256(level, 1));
    _mm_storel_epi64((__m128i *)(void *)(sheet->lit + i), _mm_packus_epi16(words, words));
}

void sv_relief_lookup_avx2(const struct sv_relief_lookup *lookup, const struct sv_relief_lookup_sheet *sheet,
                           const struct sv_relief_eight *list, int count)
{
    for (int k = 0; k < count; k++) {
        size_t i = (size_t)list[k].row * (size_t)sheet->width + (size_t)list[k].column;
        __m256i color = _mm256_loadu_si256((const __m256i *)(const void *)(sheet->color + i));
        const __m256 n[3] = {load_part(sheet->normal[0] + i), load_part(sheet->normal[1] + i),
                             load_part(sheet->normal[2] + i)};
        __m256 turned = _mm256_cmp_ps(dot(n, lookup->sun), _mm256_setzero_ps(), _CMP_GT_OQ);
        turned = _mm256_and_ps(turned, _mm256_castsi256_ps(_mm256_srai_epi32(color, 31)));
        if (_mm256_movemask_ps(turned))
            look_up8(lookup, sheet, list[k], i, n, turned);
        else
            _mm_storel_epi64((__m128i *)(void *)(sheet->lit + i), _mm_setzero_si128());
    }
}
