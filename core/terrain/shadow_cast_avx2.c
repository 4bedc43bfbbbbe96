/* shadow_cast_avx2.c - eight texels of a row at once; same operations in the same order as the scalar one. */
#include <immintrin.h>
#include <string.h>

#include "core/terrain/shadow_cast.h"

/* Bytes base and base + 1 of each lane in its low 16 bits; what lies outside the block reads as anything, but
 * nothing outside is touched. last: size of the block less 4. */
static inline __m256i pair_at(const uint8_t *bytes, __m256i base, __m256i last)
{
    __m256i at = _mm256_min_epi32(_mm256_max_epi32(base, _mm256_setzero_si256()), last);
    __m256i v = _mm256_i32gather_epi32((const int *)(const void *)bytes, at, 1);
    __m256i off = _mm256_slli_epi32(_mm256_sub_epi32(base, at), 3);
    return _mm256_or_si256(_mm256_srlv_epi32(v, off),
                           _mm256_sllv_epi32(v, _mm256_sub_epi32(_mm256_setzero_si256(), off)));
}

static inline __m256 low_byte(__m256i v, __m256i keep)
{
    return _mm256_cvtepi32_ps(_mm256_and_si256(_mm256_and_si256(v, _mm256_set1_epi32(255)), keep));
}

/* Lanes whose ground lies behind the body's beginning. */
static inline __m256i behind(const struct sv_shadow_cast *c, __m256i i, __m256i j, __m256 u, __m256 v,
                             __m256 d)
{
    __m256 first = _mm256_set1_ps(c->first_d);
    if (c->first) {
        const __m256 half = _mm256_set1_ps(0.5f);
        __m256i zero = _mm256_setzero_si256();
        i = _mm256_sub_epi32(i, _mm256_castps_si256(_mm256_cmp_ps(u, half, _CMP_GE_OQ)));
        j = _mm256_sub_epi32(j, _mm256_castps_si256(_mm256_cmp_ps(v, half, _CMP_GE_OQ)));
        i = _mm256_min_epi32(_mm256_max_epi32(i, zero), _mm256_set1_epi32(c->width - 1));
        j = _mm256_min_epi32(_mm256_max_epi32(j, zero), _mm256_set1_epi32(c->height - 1));
        first = _mm256_i32gather_ps(
            c->first, _mm256_add_epi32(_mm256_mullo_epi32(j, _mm256_set1_epi32(c->width)), i), 4);
    }
    return _mm256_castps_si256(_mm256_cmp_ps(d, first, _CMP_GE_OQ));
}

static inline __m256 coverage8(const struct sv_shadow_cast *c, __m256 s, __m256 t, __m256 d)
{
    const __m256 minus = _mm256_set1_ps(-1);
    const __m256i none = _mm256_set1_epi32(-1);
    __m256 in =
        _mm256_and_ps(_mm256_and_ps(_mm256_cmp_ps(s, minus, _CMP_GT_OQ), _mm256_cmp_ps(t, minus, _CMP_GT_OQ)),
                      _mm256_and_ps(_mm256_cmp_ps(s, _mm256_set1_ps((float)c->width), _CMP_LT_OQ),
                                    _mm256_cmp_ps(t, _mm256_set1_ps((float)c->height), _CMP_LT_OQ)));
    if (_mm256_testz_ps(in, in))
        return _mm256_setzero_ps();
    s = _mm256_and_ps(s, in);
    t = _mm256_and_ps(t, in);
    __m256 fs = _mm256_floor_ps(s), ft = _mm256_floor_ps(t);
    __m256 u = _mm256_sub_ps(s, fs), v = _mm256_sub_ps(t, ft);
    __m256i i = _mm256_cvttps_epi32(fs), j = _mm256_cvttps_epi32(ft);
    __m256i ok = _mm256_and_si256(_mm256_castps_si256(in), behind(c, i, j, u, v, d));
    __m256i wide = _mm256_set1_epi32(c->width), last = _mm256_set1_epi32(c->width * c->height - 4);
    __m256i base = _mm256_add_epi32(_mm256_mullo_epi32(j, wide), i);
    __m256i p = pair_at(c->coverage, base, last),
            q = pair_at(c->coverage, _mm256_add_epi32(base, wide), last);
    __m256i left = _mm256_and_si256(ok, _mm256_cmpgt_epi32(i, none));
    __m256i right = _mm256_and_si256(ok, _mm256_cmpgt_epi32(_mm256_set1_epi32(c->width - 1), i));
    __m256i near = _mm256_cmpgt_epi32(j, none), far = _mm256_cmpgt_epi32(_mm256_set1_epi32(c->height - 1), j);
    __m256 a = low_byte(p, _mm256_and_si256(left, near));
    __m256 b = low_byte(_mm256_srli_epi32(p, 8), _mm256_and_si256(right, near));
    __m256 e = low_byte(q, _mm256_and_si256(left, far));
    __m256 f = low_byte(_mm256_srli_epi32(q, 8), _mm256_and_si256(right, far));
    __m256 low = _mm256_add_ps(a, _mm256_mul_ps(_mm256_sub_ps(b, a), u));
    __m256 high = _mm256_add_ps(e, _mm256_mul_ps(_mm256_sub_ps(f, e), u));
    return _mm256_add_ps(low, _mm256_mul_ps(_mm256_sub_ps(high, low), v));
}

static inline __m256i mean8(const struct sv_shadow_cast *c, __m256 s, __m256 t, __m256 d)
{
    __m256 sum = _mm256_setzero_ps();
    for (int b = 0; b < c->samples_t; b++)
        for (int a = 0; a < c->samples_s; a++) {
            __m256 off_s = _mm256_set1_ps(c->offset_s[a]), off_t = _mm256_set1_ps(c->offset_t[b]);
            sum = _mm256_add_ps(sum, coverage8(c, _mm256_add_ps(s, off_s), _mm256_add_ps(t, off_t), d));
        }
    sum = _mm256_mul_ps(sum, _mm256_set1_ps(c->share));
    return _mm256_cvttps_epi32(_mm256_add_ps(sum, _mm256_set1_ps(0.5f)));
}

static inline void darken8(uint8_t *light, __m256i cover)
{
    __m256i x = _mm256_cvtepu8_epi32(_mm_loadl_epi64((const __m128i *)(const void *)light));
    x = _mm256_mullo_epi32(x, _mm256_sub_epi32(_mm256_set1_epi32(255), cover));
    x = _mm256_add_epi32(x, _mm256_set1_epi32(128));
    x = _mm256_srli_epi32(_mm256_add_epi32(x, _mm256_srli_epi32(x, 8)), 8);
    __m256i kept = _mm256_cmpgt_epi32(x, _mm256_set1_epi32(SV_SHADOW_DARK - 1));
    x = _mm256_and_si256(x, _mm256_or_si256(kept, _mm256_cmpeq_epi32(cover, _mm256_setzero_si256())));
    __m128i half = _mm_packus_epi32(_mm256_castsi256_si128(x), _mm256_extracti128_si256(x, 1));
    _mm_storel_epi64((__m128i *)(void *)light, _mm_packus_epi16(half, half));
}

void sv_shadow_cast_row_avx2(const struct sv_shadow_cast *c, float s, float t, float d, int count,
                             const float *ground, uint8_t *light)
{
    const __m256 lane = _mm256_setr_ps(0, 1, 2, 3, 4, 5, 6, 7);
    int i = 0;
    int wide = c->width > (1 << 15) || c->height > (1 << 15) || c->width * c->height < 4 ? 0 : count;
    for (; i + 8 <= wide; i += 8) {
        uint64_t eight;
        memcpy(&eight, light + i, sizeof eight);
        if (!eight)
            continue;
        __m256 k = _mm256_add_ps(_mm256_set1_ps((float)i), lane), g = _mm256_loadu_ps(ground + i);
        __m256 sk = _mm256_add_ps(_mm256_set1_ps(s), _mm256_mul_ps(k, _mm256_set1_ps(c->step_s)));
        __m256 tk = _mm256_add_ps(_mm256_set1_ps(t), _mm256_mul_ps(k, _mm256_set1_ps(c->step_t)));
        __m256 dk = _mm256_add_ps(_mm256_set1_ps(d), _mm256_mul_ps(k, _mm256_set1_ps(c->step_d)));
        sk = _mm256_add_ps(sk, _mm256_mul_ps(g, _mm256_set1_ps(c->height_s)));
        tk = _mm256_add_ps(tk, _mm256_mul_ps(g, _mm256_set1_ps(c->height_t)));
        dk = _mm256_add_ps(dk, _mm256_mul_ps(g, _mm256_set1_ps(c->height_d)));
        __m256i cover = mean8(c, sk, tk, dk);
        if (!_mm256_testz_si256(cover, cover))
            darken8(light + i, cover);
    }
    for (; i < count; i++) { /* as the scalar one, whose count of texels starts at the row's first */
        float k = (float)i, g = ground[i];
        if (!light[i])
            continue;
        float cover =
            sv_shadow_cast_mean(c, (s + k * c->step_s) + g * c->height_s,
                                (t + k * c->step_t) + g * c->height_t, (d + k * c->step_d) + g * c->height_d);
        light[i] = sv_shadow_darken(light[i], (unsigned)(cover + 0.5f));
    }
}
