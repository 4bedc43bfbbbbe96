/* lighting_avx2.c - eight texels of light at once (AVX2 and FMA; chosen in lighting.c).
 *
 * As the scalar one, with four things written otherwise, each with its bound in levels of 255:
 * - albedo: of codes from 11 on a quartic, least in its greatest error in levels (0.05), instead of a gather.
 * - tone: above 1/2 it is 1 - 1 / (4 c), the same curve (t = 2 c - 1: 1/2 + t / (2 (1 + t)) = 1 - 1 / (4 c)).
 * - sRGB code: c = m 2^e, m in [1, 2): 255 (1.055 2^(e / 2.4) m^(1 / 2.4) - 0.055), the power of 2 by a table
 * of eight (c from 2^-8 to 1), that of m by a cubic through Chebyshev nodes (error 1.1e-4: 0.03 levels).
 * Below 2^-8 the curve's straight piece is held on to, past its end at 0.0031: 0.2 levels.
 * - (n.h)^s: exp2(s / 2 log2((n.h)^2)), h never formed: (n.h)^2 = (n.l + n.v)^2 / (2 + 2 l.v). log2 to 9e-7,
 * so that the whole is right to 5e-4 at s = 1000. Rounded to codes all of it stays within one level of the
 * scalar one: tested. */
#include "core/relief/lighting_kernel.h"

#include <immintrin.h>

static inline __m256 splat(float v)
{
    return _mm256_set1_ps(v);
}

/* Exposed light -> sRGB code as int32; NaN and below 0: 0. */
static inline __m256i code_from_exposed(__m256 exposed)
{
    const __m256 octave = _mm256_setr_ps(35.627757f, 47.557350f, 63.481447f, 84.737565f, 113.111079f,
                                         150.985177f, 201.541031f, 26.690661f);
    exposed = _mm256_min_ps(_mm256_max_ps(exposed, _mm256_setzero_ps()), splat(1e6f));
    __m256 shoulder = _mm256_sub_ps(splat(1), _mm256_div_ps(splat(0.25f), exposed));
    __m256 c = _mm256_blendv_ps(exposed, shoulder, _mm256_cmp_ps(exposed, splat(0.5f), _CMP_GT_OQ));
    __m256i bits = _mm256_castps_si256(c);
    __m256 m = _mm256_castsi256_ps(_mm256_or_si256(_mm256_and_si256(bits, _mm256_set1_epi32(0x007fffff)),
                                                   _mm256_set1_epi32(0x3f800000)));
    __m256 power = _mm256_fmadd_ps(m, splat(0.023732815f), splat(-0.17331086f));
    power = _mm256_fmadd_ps(power, m, splat(0.68860106f));
    power = _mm256_fmadd_ps(power, m, splat(0.46108379f));
    /* The exponent's low three bits tell the eight octaves apart. */
    __m256 scale = _mm256_permutevar8x32_ps(octave, _mm256_srli_epi32(bits, 23));
    __m256 curve = _mm256_fmsub_ps(power, scale, splat(255 * 0.055f));
    __m256 line = _mm256_mul_ps(c, splat(255 * 12.92f));
    return _mm256_cvtps_epi32(_mm256_blendv_ps(line, curve, _mm256_cmp_ps(c, splat(1.0f / 256), _CMP_GE_OQ)));
}

/* sRGB codes as int32, 0 .. 255 -> light. */
static inline __m256 linear_from_code(__m256i code)
{
    __m256 x = _mm256_cvtepi32_ps(code);
    __m256 y = _mm256_fmadd_ps(x, splat(-2.7290068e-11f), splat(3.1592204e-08f));
    y = _mm256_fmadd_ps(y, x, splat(8.6423131e-06f));
    y = _mm256_fmadd_ps(y, x, splat(0.0001101128f));
    y = _mm256_fmadd_ps(y, x, splat(0.0010636908f));
    return _mm256_blendv_ps(y, _mm256_mul_ps(x, splat(1 / (255 * 12.92f))),
                            _mm256_cmp_ps(x, splat(10.5f), _CMP_LT_OQ));
}

/* x^p for x in (0, 1], p >= 0.5. */
static inline __m256 power_of(__m256 x, __m256 p)
{
    const __m256i root_half = _mm256_set1_epi32(0x3f3504f3);
    __m256i bits = _mm256_castps_si256(x);
    __m256i e = _mm256_srai_epi32(_mm256_sub_epi32(bits, root_half), 23);
    __m256 m = _mm256_castsi256_ps(_mm256_sub_epi32(bits, _mm256_slli_epi32(e, 23)));
    __m256 q = _mm256_fmadd_ps(m, splat(0.16818659f), splat(-1.2770834f));
    q = _mm256_fmadd_ps(q, m, splat(4.1587378f));
    q = _mm256_fmadd_ps(q, m, splat(-7.5873714f));
    q = _mm256_fmadd_ps(q, m, splat(8.5383414f));
    q = _mm256_fmadd_ps(q, m, splat(-6.2945769f));
    q = _mm256_fmadd_ps(q, m, splat(3.7364643f));
    __m256 log2 = _mm256_fmadd_ps(q, _mm256_sub_ps(m, splat(1)), _mm256_cvtepi32_ps(e));
    __m256 t = _mm256_max_ps(_mm256_mul_ps(log2, p), splat(-120));
    __m256 whole = _mm256_floor_ps(t), part = _mm256_sub_ps(t, whole);
    __m256 r = _mm256_fmadd_ps(part, splat(0.013670309f), splat(0.051744998f));
    r = _mm256_fmadd_ps(r, part, splat(0.24160436f));
    r = _mm256_fmadd_ps(r, part, splat(0.69297292f));
    r = _mm256_fmadd_ps(r, part, splat(1.0000035f));
    __m256i two = _mm256_slli_epi32(_mm256_add_epi32(_mm256_cvtps_epi32(whole), _mm256_set1_epi32(127)), 23);
    return _mm256_mul_ps(r, _mm256_castsi256_ps(two));
}

static inline __m256 dot(const __m256 n[3], const float v[3])
{
    __m256 sum = _mm256_mul_ps(n[0], splat(v[0]));
    sum = _mm256_fmadd_ps(n[1], splat(v[1]), sum);
    return _mm256_fmadd_ps(n[2], splat(v[2]), sum);
}

/* Normals * 32767 and sky occlusion * 32767 of eight texels. */
static inline void load_normals(const int16_t (*normal)[4], __m256 n[4])
{
    __m256i near = _mm256_loadu_si256((const __m256i *)(const void *)normal);
    __m256i far = _mm256_loadu_si256((const __m256i *)(const void *)(normal + 4));
    __m256 a = _mm256_castsi256_ps(_mm256_permute2x128_si256(near, far, 0x20));
    __m256 b = _mm256_castsi256_ps(_mm256_permute2x128_si256(near, far, 0x31));
    __m256i xy = _mm256_castps_si256(_mm256_shuffle_ps(a, b, _MM_SHUFFLE(2, 0, 2, 0)));
    __m256i zo = _mm256_castps_si256(_mm256_shuffle_ps(a, b, _MM_SHUFFLE(3, 1, 3, 1)));
    n[0] = _mm256_cvtepi32_ps(_mm256_srai_epi32(_mm256_slli_epi32(xy, 16), 16));
    n[1] = _mm256_cvtepi32_ps(_mm256_srai_epi32(xy, 16));
    n[2] = _mm256_cvtepi32_ps(_mm256_srai_epi32(_mm256_slli_epi32(zo, 16), 16));
    n[3] = _mm256_cvtepi32_ps(_mm256_srai_epi32(zo, 16));
}

static inline void load_planes(const int16_t *const plane[4], size_t i, __m256 n[4])
{
    for (int c = 0; c < 4; c++) {
        __m128i part = _mm_loadu_si128((const __m128i *)(const void *)(plane[c] + i));
        n[c] = _mm256_cvtepi32_ps(_mm256_cvtepi16_epi32(part));
    }
}

/* What does not depend on the albedo, of CHUNK eights. One loop for it, one for what mirrors, one for the
 * colours: from its normal to its code a texel is one long chain, of which shorter loops overlap more; and
 * which eights mirror cannot be foretold. */
enum { CHUNK = 16 };
struct chunk {
    __m256 sun[CHUNK], open[CHUNK], up[CHUNK], shine[CHUNK]; /* up: times open; shine: (n.h)^2 at first */
};

static inline size_t texel_of(const struct sv_relief_light_sheet *sheet, struct sv_relief_eight at)
{
    return (size_t)at.row * (size_t)sheet->width + (size_t)at.column;
}

/* (n.h)^2 where it counts, else 0. n_l: n.l; sun: over 0 where the sun is seen. */
static inline __m256 halfway(const struct sv_relief_light_row *light, const __m256 n[3], __m256 n_l,
                             __m256 sun, struct sv_relief_eight at, const float *displ)
{
    const __m256 zero = _mm256_setzero_ps();
    __m256 u = _mm256_add_ps(splat((float)at.column + 0.5f), _mm256_setr_ps(0, 1, 2, 3, 4, 5, 6, 7));
    const __m256 e[3] = {_mm256_fnmadd_ps(u, splat(light->pitch[0]), splat(light->eye[0])),
                         splat(light->eye[1] - ((float)at.row + 0.5f) * light->pitch[1]),
                         _mm256_sub_ps(splat(light->eye[2]), _mm256_loadu_ps(displ))};
    __m256 square = _mm256_fmadd_ps(e[0], e[0], _mm256_fmadd_ps(e[1], e[1], _mm256_mul_ps(e[2], e[2])));
    __m256 n_e = _mm256_fmadd_ps(n[0], e[0], _mm256_fmadd_ps(n[1], e[1], _mm256_mul_ps(n[2], e[2])));
    __m256 good = _mm256_and_ps(_mm256_cmp_ps(n_e, zero, _CMP_GT_OQ), _mm256_cmp_ps(sun, zero, _CMP_GT_OQ));
    good = _mm256_and_ps(good, _mm256_cmp_ps(square, splat(INFINITY), _CMP_LT_OQ));
    __m256 nearness = _mm256_div_ps(splat(1), _mm256_sqrt_ps(square));
    __m256 n_v = _mm256_mul_ps(n_e, _mm256_mul_ps(nearness, splat(1.0f / 32767)));
    __m256 l_v = _mm256_mul_ps(dot(e, light->sun_unit), nearness);
    __m256 sum = _mm256_add_ps(n_l, n_v);
    __m256 n_h2 = _mm256_div_ps(_mm256_mul_ps(sum, sum), _mm256_fmadd_ps(l_v, splat(2), splat(2)));
    n_h2 = _mm256_min_ps(_mm256_max_ps(n_h2, splat(1e-30f)), splat(1)); /* NaN: 1e-30, and not good */
    good = _mm256_and_ps(good, _mm256_cmp_ps(n_h2, splat(light->faint), _CMP_GE_OQ));
    return _mm256_and_ps(n_h2, good);
}

/* Returns how many of the chunk's eights mirror; their numbers are listed. */
static inline __attribute__((always_inline)) int light_chunk(const struct sv_relief_light_row *light,
                                                             const struct sv_relief_light_sheet *sheet,
                                                             const struct sv_relief_eight *list, int count,
                                                             bool planes, struct chunk *chunk, int *mirrors)
{
    const __m256 zero = _mm256_setzero_ps();
    int listed = 0;
    for (int k = 0; k < count; k++) {
        size_t i = texel_of(sheet, list[k]);
        __m256 n[4], lit = splat(255);
        _mm_prefetch((const char *)(sheet->color + i), _MM_HINT_T0);
        _mm_prefetch((const char *)(sheet->rgba + i), _MM_HINT_T0);
        if (planes)
            load_planes(sheet->plane, i, n);
        else
            load_normals(sheet->normal + i, n);
        if (sheet->lit)
            lit = _mm256_cvtepi32_ps(
                _mm256_cvtepu8_epi32(_mm_loadl_epi64((const __m128i *)(const void *)(sheet->lit + i))));
        __m256 n_l = dot(n, light->to_sun), up = _mm256_add_ps(dot(n, light->up), splat(0.5f));
        __m256 sun = _mm256_mul_ps(_mm256_max_ps(n_l, zero), lit);
        chunk->sun[k] = sun;
        chunk->open[k] = n[3];
        chunk->up[k] = _mm256_mul_ps(up, n[3]);
        chunk->shine[k] = zero;
        if (!light->specular || !_mm256_movemask_ps(_mm256_cmp_ps(sun, zero, _CMP_GT_OQ)))
            continue;
        __m256 n_h2 = halfway(light, n, n_l, sun, list[k], sheet->displ + i);
        chunk->shine[k] = n_h2;
        mirrors[listed] = k;
        listed += _mm256_movemask_ps(_mm256_cmp_ps(n_h2, zero, _CMP_GT_OQ)) != 0;
    }
    return listed;
}

/* The mirror's share of light, (n.h)^shininess, in place of (n.h)^2. */
static inline void mirror_chunk(const struct sv_relief_light_row *light,
                                const struct sv_relief_light_sheet *sheet, const struct sv_relief_eight *list,
                                const int *mirrors, int count, struct chunk *chunk)
{
    const __m256 half = splat(0.5f * light->shininess);
    for (int m = 0; m < count; m++) {
        int k = mirrors[m];
        __m256 n_h2 = chunk->shine[k], lit = splat(255);
        if (sheet->lit)
            lit = _mm256_cvtepi32_ps(_mm256_cvtepu8_epi32(
                _mm_loadl_epi64((const __m128i *)(const void *)(sheet->lit + texel_of(sheet, list[k])))));
        __m256 some = _mm256_cmp_ps(n_h2, _mm256_setzero_ps(), _CMP_GT_OQ);
        __m256 power = power_of(_mm256_max_ps(n_h2, splat(1e-30f)), half);
        chunk->shine[k] = _mm256_mul_ps(lit, _mm256_and_ps(power, some));
    }
}

static inline void color_chunk(const struct sv_relief_light_row *light, const struct chunk *chunk,
                               const struct sv_relief_light_sheet *sheet, const struct sv_relief_eight *list,
                               int count)
{
    const __m256i byte = _mm256_set1_epi32(255), alpha = _mm256_set1_epi32((int)0xff000000);
    for (int k = 0; k < count; k++) {
        size_t i = texel_of(sheet, list[k]);
        __m256i color = _mm256_loadu_si256((const __m256i *)(const void *)(sheet->color + i));
        __m256i seen = _mm256_and_si256(color, alpha);
        for (int c = 0; c < 3; c++) {
            __m256 albedo = linear_from_code(_mm256_and_si256(_mm256_srli_epi32(color, 8 * c), byte));
            __m256 sum = _mm256_mul_ps(chunk->up[k], splat(light->ground_sky[c]));
            sum = _mm256_fmadd_ps(chunk->open[k], splat(light->ground[c]), sum);
            sum = _mm256_fmadd_ps(chunk->sun[k], splat(light->sun[c]), sum);
            __m256 shine = _mm256_mul_ps(chunk->shine[k], splat(light->mirror[c]));
            __m256i code = code_from_exposed(_mm256_fmadd_ps(albedo, sum, shine));
            seen = _mm256_or_si256(seen, _mm256_slli_epi32(code, 8 * c));
        }
        __m256 picked = _mm256_blendv_ps(_mm256_castsi256_ps(color), _mm256_castsi256_ps(seen),
                                         _mm256_castsi256_ps(color)); /* by alpha's top bit */
        _mm256_storeu_si256((__m256i *)(void *)(sheet->rgba + i), _mm256_castps_si256(picked));
    }
}

/* Of the next chunk: rows of a picture's eights are too short for the hardware to look ahead. */
static inline void fetch_planes(const struct sv_relief_light_sheet *sheet, const struct sv_relief_eight *list,
                                int count)
{
    for (int k = 0; k < count; k++) {
        size_t i = texel_of(sheet, list[k]);
        for (int c = 0; c < 4; c++)
            _mm_prefetch((const char *)(sheet->plane[c] + i), _MM_HINT_T0);
        _mm_prefetch((const char *)(sheet->displ + i), _MM_HINT_T0);
    }
}

void sv_relief_light_avx2(const struct sv_relief_light_row *light, const struct sv_relief_light_sheet *sheet,
                          const struct sv_relief_eight *list, int count)
{
    struct chunk chunk;
    int mirrors[CHUNK];
    for (int n; count > 0; count -= n, list += n) {
        n = count < CHUNK ? count : CHUNK;
        int listed = sheet->plane[0] ? light_chunk(light, sheet, list, n, true, &chunk, mirrors)
                                     : light_chunk(light, sheet, list, n, false, &chunk, mirrors);
        if (sheet->plane[0])
            fetch_planes(sheet, list + n, count - n < CHUNK ? count - n : CHUNK);
        mirror_chunk(light, sheet, list, mirrors, listed, &chunk);
        color_chunk(light, &chunk, sheet, list, n);
    }
}
