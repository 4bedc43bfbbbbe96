/* compose_avx2.c - two pixels at a time, lanes {r, g, b, pass} of each. TWIN: compose.c, bit for bit. */
#include <immintrin.h>

#include "core/base/color.h"
#include "core/view/compose_kernel.h"

static inline __m256i encode(__m256 v)
{
    v = _mm256_min_ps(_mm256_max_ps(v, _mm256_setzero_ps()), _mm256_set1_ps(1)); /* NaN: 0 */
    __m256 root = _mm256_sqrt_ps(_mm256_sqrt_ps(v)),
           code = _mm256_set1_ps(sv_compose_term[SV_COMPOSE_TERMS - 1]);
    for (int k = SV_COMPOSE_TERMS - 2; k >= 0; k--)
        code = _mm256_add_ps(_mm256_mul_ps(code, root), _mm256_set1_ps(sv_compose_term[k]));
    __m256 straight = _mm256_mul_ps(v, _mm256_set1_ps(SV_COMPOSE_SLOPE));
    code = _mm256_blendv_ps(code, straight, _mm256_cmp_ps(v, _mm256_set1_ps(SV_COMPOSE_BEND), _CMP_LE_OQ));
    return _mm256_cvttps_epi32(_mm256_add_ps(code, _mm256_set1_ps(0.5f)));
}

static inline void two(const float (*light)[4], const uint8_t (*behind)[4], uint8_t (*out)[4])
{
    const __m256 one = _mm256_set1_ps(1), all = _mm256_set1_ps(255);
    __m256 v = _mm256_loadu_ps(light[0]), pass = _mm256_permute_ps(v, 0xff);
    __m128i bytes = _mm_loadl_epi64((const __m128i *)behind);
    if (_mm256_movemask_ps(_mm256_cmp_ps(pass, one, _CMP_EQ_OQ)) == 255) {
        _mm_storel_epi64((__m128i *)out, bytes);
        return;
    }
    __m256i codes = _mm256_cvtepu8_epi32(bytes);
    __m256 closed = _mm256_cmp_ps(pass, _mm256_set1_ps(SV_COMPOSE_PASS_MIN), _CMP_LT_OQ);
    __m256 under = _mm256_setzero_ps();
    if (_mm256_movemask_ps(closed) != 255)
        under = _mm256_i32gather_ps(sv_linear_from_srgb8, codes, 4);
    __m256 each = _mm256_blendv_ps(one, _mm256_div_ps(one, _mm256_sub_ps(one, pass)), closed);
    pass = _mm256_andnot_ps(closed, pass);
    __m256 rgb = _mm256_add_ps(_mm256_mul_ps(each, v), _mm256_mul_ps(pass, under));
    __m256 alpha = _mm256_add_ps(_mm256_add_ps(_mm256_mul_ps(all, _mm256_sub_ps(one, pass)),
                                               _mm256_mul_ps(pass, _mm256_cvtepi32_ps(codes))),
                                 _mm256_set1_ps(0.5f));
    __m256i made = _mm256_blend_epi32(encode(rgb), _mm256_cvttps_epi32(alpha), 0x88);
    __m256 same = _mm256_cmp_ps(_mm256_permute_ps(v, 0xff), one, _CMP_EQ_OQ);
    made = _mm256_blendv_epi8(made, codes, _mm256_castps_si256(same));
    __m256i words = _mm256_packus_epi32(made, made), packed = _mm256_packus_epi16(words, words);
    int first = _mm_cvtsi128_si32(_mm256_castsi256_si128(packed));
    int second = _mm_cvtsi128_si32(_mm256_extracti128_si256(packed, 1));
    _mm_storel_epi64((__m128i *)out, _mm_set_epi32(0, 0, second, first));
}

void sv_compose_avx2(size_t count, const float (*light)[4], const uint8_t (*behind)[4], uint8_t (*out)[4])
{
    size_t pairs = count / 2 * 2;
    for (size_t k = 0; k < pairs; k += 2)
        two(light + k, behind + k, out + k);
    sv_compose_scalar(count - pairs, light + pairs, behind + pairs, out + pairs);
}
