/* leaf_avx2.h - small words of the AVX2 kernels of leaf splats. Private to NAME_avx2.c files. */
#ifndef SV_TREE_LEAF_AVX2_H
#define SV_TREE_LEAF_AVX2_H

#include <immintrin.h>
#include <stdint.h>

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
static const uint64_t pack[256] = {PACK64(0), PACK64(64), PACK64(128), PACK64(192)};

static inline __m256i order_of(unsigned mask)
{
    return _mm256_cvtepu8_epi32(_mm_loadl_epi64((const __m128i *)&pack[mask]));
}

static inline void store_packed(float *to, __m256 v, __m256i order)
{
    _mm256_storeu_ps(to, _mm256_permutevar8x32_ps(v, order));
}

static inline void store_packed_i(void *to, __m256i v, __m256i order)
{
    _mm256_storeu_si256(to, _mm256_permutevar8x32_epi32(v, order));
}

static inline __m256 splat(float v)
{
    return _mm256_set1_ps(v);
}

static inline __m256 mul(__m256 a, __m256 b)
{
    return _mm256_mul_ps(a, b);
}

static inline __m256 add(__m256 a, __m256 b)
{
    return _mm256_add_ps(a, b);
}

static inline __m256 sub(__m256 a, __m256 b)
{
    return _mm256_sub_ps(a, b);
}

static inline __m256 in_order(__m256 a, __m256 b) /* a <= b, false for NaN */
{
    return _mm256_cmp_ps(a, b, _CMP_LE_OQ);
}

static inline unsigned bits_of(__m256 mask)
{
    return (unsigned)_mm256_movemask_ps(mask);
}

#endif
