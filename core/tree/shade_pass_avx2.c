/* shade_pass_avx2.c - see shade_pass.h: eight texels at a time. Products and sums are kept apart, as the
 * scalar kernel has them (nothing is contracted: CMakeLists.txt). */
#include "core/tree/shade_pass.h"

#include <immintrin.h>

void sv_shade_pass_avx2(const struct sv_shade_row *row, bool far, uint16_t *light, struct sv_shade_cell *cell)
{
    const __m256 one = _mm256_set1_ps(1), least = _mm256_set1_ps(SV_SHADE_PASS_MIN),
                 full = _mm256_set1_ps(SV_SHADE_FULL), round = _mm256_set1_ps(0.5f);
    __m256 lights = _mm256_loadu_ps(cell->light), weights = _mm256_loadu_ps(cell->weight);
    for (int i = 0; i < row->count; i += SV_SHADE_LANES) {
        __m256i at = _mm256_loadu_si256((const __m256i *)(const void *)(row->left + i));
        __m256 m0 = _mm256_i32gather_ps(row->mixed, at, 4), m1 = _mm256_i32gather_ps(row->mixed + 1, at, 4);
        __m256 own = _mm256_add_ps(m0, _mm256_mul_ps(_mm256_loadu_ps(row->part + i), _mm256_sub_ps(m1, m0)));
        __m256 half = _mm256_sqrt_ps(_mm256_max_ps(_mm256_sub_ps(one, own), least));
        __m128i codes = _mm_loadu_si128((const __m128i *)(const void *)(light + i));
        __m256 left = _mm256_cvtepi32_ps(_mm256_cvtepu16_epi32(codes)), read = left;
        if (far)
            read = _mm256_min_ps(_mm256_div_ps(left, half), full);
        __m256 weight = _mm256_add_ps(own, _mm256_loadu_ps(row->bare + i));
        lights = _mm256_add_ps(lights, _mm256_mul_ps(weight, read));
        weights = _mm256_add_ps(weights, weight);
        __m256i kept = _mm256_cvttps_epi32(_mm256_add_ps(_mm256_mul_ps(left, half), round));
        kept = _mm256_permute4x64_epi64(_mm256_packus_epi32(kept, kept), 0xD8);
        _mm_storeu_si128((__m128i *)(void *)(light + i), _mm256_castsi256_si128(kept));
    }
    _mm256_storeu_ps(cell->light, lights);
    _mm256_storeu_ps(cell->weight, weights);
}

void sv_shade_mix_avx2(const uint8_t *a, const uint8_t *b, float above, float below, int width, float *mixed)
{
    const __m256 up = _mm256_set1_ps(above), down = _mm256_set1_ps(below);
    int u = 0;
    for (; u + 8 <= width; u += 8) {
        __m256 p =
            _mm256_cvtepi32_ps(_mm256_cvtepu8_epi32(_mm_loadl_epi64((const __m128i *)(const void *)(a + u))));
        __m256 q =
            _mm256_cvtepi32_ps(_mm256_cvtepu8_epi32(_mm_loadl_epi64((const __m128i *)(const void *)(b + u))));
        _mm256_storeu_ps(mixed + u, _mm256_add_ps(_mm256_mul_ps(p, up), _mm256_mul_ps(q, down)));
    }
    sv_shade_mix_scalar(a + u, b + u, above, below, width - u, mixed + u);
}
