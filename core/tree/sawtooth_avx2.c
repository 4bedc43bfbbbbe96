/* sawtooth_avx2.c - sv_sawtooth_power_scalar, eight frequencies a step; products and sums in the same order
 * and never fused, so that results are equal bit by bit. */
#include "core/tree/sawtooth_kernel.h"

#include <immintrin.h>

enum { LANES = 8, GROUPS = 4, PASSES = SV_SAWTOOTH_FREQUENCIES / (LANES * GROUPS) };

void sv_sawtooth_power_avx2(const struct sv_sawtooth_table *table, const uint8_t code[SV_SAWTOOTH_WINDOW],
                            uint32_t mask, float power[SV_SAWTOOTH_FREQUENCIES])
{
    for (int pass = 0; pass < PASSES; pass++) {
        int first = pass * LANES * GROUPS;
        __m256 re[GROUPS], im[GROUPS];
        for (int k = 0; k < GROUPS; k++)
            re[k] = im[k] = _mm256_setzero_ps();
        for (uint32_t left = mask; left; left &= left - 1) {
            int t = __builtin_ctz(left);
            __m256 zr = _mm256_set1_ps(table->re[code[t]]), zi = _mm256_set1_ps(table->im[code[t]]);
            for (int k = 0; k < GROUPS; k++) {
                __m256 c = _mm256_loadu_ps(table->cosine[t] + first + LANES * k);
                __m256 s = _mm256_loadu_ps(table->sine[t] + first + LANES * k);
                re[k] = _mm256_add_ps(re[k], _mm256_sub_ps(_mm256_mul_ps(zr, c), _mm256_mul_ps(zi, s)));
                im[k] = _mm256_add_ps(im[k], _mm256_add_ps(_mm256_mul_ps(zr, s), _mm256_mul_ps(zi, c)));
            }
        }
        for (int k = 0; k < GROUPS; k++) {
            float *at = power + first + LANES * k;
            __m256 p = _mm256_add_ps(_mm256_mul_ps(re[k], re[k]), _mm256_mul_ps(im[k], im[k]));
            _mm256_storeu_ps(at, _mm256_add_ps(_mm256_loadu_ps(at), p));
        }
    }
}
