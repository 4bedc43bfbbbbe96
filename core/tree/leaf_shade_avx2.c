/* leaf_shade_avx2.c - leaf_shade.c, eight pixels at a time; operation for operation the scalar one. */
#include <math.h>

#include "core/base/color.h"
#include "core/tree/leaf_avx2.h"
#include "core/tree/leaf_shade.h"

_Static_assert(sizeof(struct sv_leaf_record) == 64, "a record is two vectors of eight words");

static inline __m256 dot(const __m256 a[3], const __m256 b[3])
{
    return add(add(mul(a[0], b[0]), mul(a[1], b[1])), mul(a[2], b[2]));
}

static inline __m256 dot_with(const __m256 a[3], const float b[3])
{
    return add(add(mul(a[0], splat(b[0])), mul(a[1], splat(b[1]))), mul(a[2], splat(b[2])));
}

static inline __m256 held(__m256 v, float most)
{
    return _mm256_min_ps(_mm256_max_ps(v, _mm256_setzero_ps()), splat(most));
}

static inline __m256 power_of_2(__m256 t)
{
    t = _mm256_max_ps(t, splat(-120));
    __m256 whole = _mm256_floor_ps(t), part = sub(t, whole), r = splat(sv_leaf_exp2[4]);
    for (int k = 3; k >= 0; k--)
        r = add(mul(r, part), splat(sv_leaf_exp2[k]));
    __m256i two = _mm256_slli_epi32(_mm256_add_epi32(_mm256_cvtps_epi32(whole), _mm256_set1_epi32(127)), 23);
    return mul(r, _mm256_castsi256_ps(two));
}

static inline __m256i code_of(__m256 c)
{
    c = held(c, 1);
    __m256i bits = _mm256_castps_si256(c);
    __m256 m = _mm256_castsi256_ps(_mm256_or_si256(_mm256_and_si256(bits, _mm256_set1_epi32(0x007fffff)),
                                                   _mm256_set1_epi32(0x3f800000)));
    __m256 power = splat(sv_leaf_root[3]);
    for (int k = 2; k >= 0; k--)
        power = add(mul(power, m), splat(sv_leaf_root[k]));
    __m256 octave = _mm256_permutevar8x32_ps(_mm256_loadu_ps(sv_leaf_octave), _mm256_srli_epi32(bits, 23));
    __m256 curve = sub(mul(power, octave), splat(255 * 0.055f));
    __m256 chord = add(mul(c, splat(SV_LEAF_CHORD)), splat(SV_LEAF_CHORD_AT_0));
    __m256 line = _mm256_min_ps(mul(c, splat(SV_LEAF_LINE)), chord);
    return _mm256_cvtps_epi32(_mm256_blendv_ps(line, curve, _mm256_cmp_ps(c, splat(1.0f / 256), _CMP_GE_OQ)));
}

static inline __m256i gather(const void *base, __m256i index)
{
    return _mm256_i32gather_epi32((const int *)base, index, 4);
}

/* Columns for rows. */
static inline void transpose(__m256 v[8])
{
    __m256 a[8], b[8];
    for (int k = 0; k < 8; k += 2) {
        a[k] = _mm256_unpacklo_ps(v[k], v[k + 1]);
        a[k + 1] = _mm256_unpackhi_ps(v[k], v[k + 1]);
    }
    for (int k = 0; k < 8; k += 4) {
        b[k] = _mm256_shuffle_ps(a[k], a[k + 2], 0x44);
        b[k + 1] = _mm256_shuffle_ps(a[k], a[k + 2], 0xee);
        b[k + 2] = _mm256_shuffle_ps(a[k + 1], a[k + 3], 0x44);
        b[k + 3] = _mm256_shuffle_ps(a[k + 1], a[k + 3], 0xee);
    }
    for (int k = 0; k < 4; k++) {
        v[k] = _mm256_permute2f128_ps(b[k], b[k + 4], 0x20);
        v[k + 4] = _mm256_permute2f128_ps(b[k], b[k + 4], 0x31);
    }
}

struct spots {
    __m256 s, r, w[4];
    __m256 uv[6];
    __m256i occlusion[2], normal[4], open[4]; /* words of the records */
};

static inline struct spots spots_of(const struct sv_leaf_form *form, __m256i piece, __m256i place)
{
    struct spots spots;
    uint32_t of[LANES];
    __m256 low[LANES], high[LANES], unit = splat(1.0f / 65535), zero = _mm256_setzero_ps();
    _mm256_storeu_si256((__m256i *)(void *)of, piece);
    for (int k = 0; k < LANES; k++) {
        const float *record = (const float *)(const void *)&form->records[of[k]];
        low[k] = _mm256_load_ps(record);
        high[k] = _mm256_load_ps(record + 8);
    }
    transpose(low);
    transpose(high);
    for (int k = 0; k < 6; k++)
        spots.uv[k] = low[k];
    for (int k = 0; k < 2; k++)
        spots.occlusion[k] = _mm256_castps_si256(low[6 + k]);
    for (int k = 0; k < 4; k++) {
        spots.normal[k] = _mm256_castps_si256(high[k]);
        spots.open[k] = _mm256_castps_si256(high[4 + k]);
    }
    __m256 s = mul(_mm256_cvtepi32_ps(_mm256_and_si256(place, _mm256_set1_epi32(0xffff))), unit);
    __m256 r = mul(_mm256_cvtepi32_ps(_mm256_srli_epi32(place, 16)), unit);
    __m256 card = _mm256_castsi256_ps(_mm256_slli_epi32(spots.normal[0], 1)); /* SV_LEAF_CARD is the sign */
    spots.s = s;
    spots.r = r;
    spots.w[1] = _mm256_blendv_ps(s, _mm256_max_ps(sub(s, r), zero), card);
    spots.w[2] = _mm256_blendv_ps(r, _mm256_min_ps(s, r), card);
    spots.w[3] = _mm256_blendv_ps(zero, _mm256_max_ps(sub(r, s), zero), card);
    spots.w[0] = sub(splat(1), add(add(spots.w[1], spots.w[2]), spots.w[3]));
    return spots;
}

static inline __m256 mix4(const struct spots *spots, const __m256 v[4])
{
    return add(add(mul(spots->w[0], v[0]), mul(spots->w[1], v[1])),
               add(mul(spots->w[2], v[2]), mul(spots->w[3], v[3])));
}

static inline __m256 occlusions_of(const struct spots *spots)
{
    __m256 o[4];
    for (int c = 0; c < 4; c++) {
        __m256i pair = spots->occlusion[c >> 1];
        o[c] = _mm256_cvtepi32_ps(c & 1 ? _mm256_srli_epi32(pair, 16)
                                        : _mm256_and_si256(pair, _mm256_set1_epi32(0xffff)));
    }
    return mul(mix4(spots, o), splat(1.0f / 65535));
}

/* World axes, unit. */
static inline void normals_of(const struct spots *spots, const float turn[2], __m256 n[3])
{
    __m256 x[4], y[4], z[4];
    for (int c = 0; c < 4; c++) {
        __m256i v = spots->normal[c];
        x[c] = _mm256_cvtepi32_ps(_mm256_srai_epi32(_mm256_slli_epi32(v, 22), 22));
        y[c] = _mm256_cvtepi32_ps(_mm256_srai_epi32(_mm256_slli_epi32(v, 12), 22));
        z[c] = _mm256_cvtepi32_ps(_mm256_srai_epi32(_mm256_slli_epi32(v, 2), 22));
    }
    __m256 mx = mix4(spots, x), my = mix4(spots, y);
    n[0] = add(mul(splat(turn[0]), mx), mul(splat(turn[1]), my));
    n[1] = sub(mul(splat(turn[0]), my), mul(splat(turn[1]), mx));
    n[2] = mix4(spots, z);
    __m256 inverse = _mm256_div_ps(splat(1), _mm256_sqrt_ps(_mm256_max_ps(dot(n, n), splat(1e-20f))));
    for (int k = 0; k < 3; k++)
        n[k] = mul(n[k], inverse);
}

static inline __m256 texel_of(__m256 u, __m256 size)
{
    __m256 x = sub(mul(sub(u, _mm256_floor_ps(u)), size), splat(0.5f));
    __m256 legal = _mm256_and_ps(_mm256_cmp_ps(x, splat(-1), _CMP_GE_OQ), _mm256_cmp_ps(x, size, _CMP_LE_OQ));
    return _mm256_and_ps(x, legal);
}

static inline void wrap(__m256i i, __m256i size, __m256i out[2])
{
    __m256i next = _mm256_add_epi32(i, _mm256_set1_epi32(1));
    out[0] = _mm256_add_epi32(i, _mm256_and_si256(_mm256_srai_epi32(i, 31), size));
    out[1] = _mm256_sub_epi32(next, _mm256_andnot_si256(_mm256_cmpgt_epi32(size, next), size));
}

static inline __m256 mix(__m256 a, __m256 b, __m256 t)
{
    return add(a, mul(sub(b, a), t));
}

static inline __m256i levels_of(const struct sv_leaf_paint *paint, __m256 z)
{
    __m256 texels = mul(splat(paint->texels), paint->job->eye.orthographic ? splat(1) : z);
    __m256i level =
        _mm256_sub_epi32(_mm256_srli_epi32(_mm256_castps_si256(texels), 23), _mm256_set1_epi32(127));
    level = _mm256_max_epi32(level, _mm256_setzero_si256());
    return _mm256_min_epi32(level, _mm256_set1_epi32(paint->map->level_count - 1));
}

static inline __m256i of_level(const void *table, __m256i level)
{
    return _mm256_permutevar8x32_epi32(_mm256_loadu_si256((const __m256i *)table), level);
}

/* Texels of eight lanes: from the small levels, and one by one from level 0 where a lane wants that. */
static inline __m256i texels_at(const struct sv_leaf_map *map, __m256i level, __m256i at)
{
    __m256i whole = _mm256_cmpeq_epi32(level, _mm256_setzero_si256());
    __m256i small = _mm256_andnot_si256(whole, _mm256_set1_epi32(-1));
    __m256i index = _mm256_add_epi32(of_level(map->offset, level), at), zero = _mm256_setzero_si256();
    __m256i v = _mm256_mask_i32gather_epi32(zero, (const int *)(const void *)map->levels, index, small, 4);
    if (_mm256_movemask_epi8(whole))
        v = _mm256_mask_i32gather_epi32(v, (const int *)(const void *)map->rgba, at, whole, 4);
    return v;
}

static inline void albedos_of(const struct sv_leaf_paint *paint, const struct spots *spots, __m256 z,
                              __m256 rgb[3])
{
    const struct sv_leaf_map *map = paint->map;
    const __m256 *uv = spots->uv;
    for (int c = 0; c < 3; c++)
        rgb[c] = splat(paint->material->base_color[c]);
    if (!map->rgba)
        return;
    __m256i level = levels_of(paint, z), w = of_level(map->widths, level), h = of_level(map->heights, level);
    __m256 u = add(add(uv[0], mul(spots->s, uv[2])), mul(spots->r, uv[4]));
    __m256 v = add(add(uv[1], mul(spots->s, uv[3])), mul(spots->r, uv[5]));
    __m256 x = texel_of(u, _mm256_cvtepi32_ps(w)), y = texel_of(v, _mm256_cvtepi32_ps(h));
    __m256 bx = _mm256_floor_ps(x), by = _mm256_floor_ps(y), fu = sub(x, bx), fv = sub(y, by);
    __m256i i[2], j[2], texel[4];
    wrap(_mm256_cvttps_epi32(bx), w, i);
    wrap(_mm256_cvttps_epi32(by), h, j);
    for (int k = 0; k < 4; k++)
        texel[k] = texels_at(map, level, _mm256_add_epi32(_mm256_mullo_epi32(j[k >> 1], w), i[k & 1]));
    for (int c = 0; c < 3; c++) {
        __m256 a[4];
        for (int k = 0; k < 4; k++) {
            __m256i code = _mm256_and_si256(_mm256_srli_epi32(texel[k], 8 * c), _mm256_set1_epi32(255));
            a[k] = _mm256_i32gather_ps(sv_linear_from_srgb8, code, 4);
        }
        rgb[c] = mul(mix(mix(a[0], a[1], fu), mix(a[2], a[3], fu), fv), rgb[c]);
    }
}

static inline __m256 functional(const float f[3], __m256 i, __m256 j)
{
    return add(add(mul(splat(f[0]), i), mul(splat(f[1]), j)), splat(f[2]));
}

struct sights {
    __m256 i, j, z, distance, to_viewer[3];
};

static inline struct sights sights_of(const struct sv_leaf_paint *paint, __m256i i, __m256i j, __m256 d)
{
    const struct sv_leaf_eye *eye = &paint->job->eye;
    const struct sv_leaf_light *light = paint->light;
    struct sights sights = {.i = _mm256_cvtepi32_ps(i), .j = _mm256_cvtepi32_ps(j)};
    if (eye->orthographic) {
        sights.distance = sights.z = mul(sub(splat(1), d), splat(eye->far_m));
        for (int k = 0; k < 3; k++)
            sights.to_viewer[k] = splat(light->to_viewer[k]);
        return sights;
    }
    __m256 ray[3];
    for (int k = 0; k < 3; k++)
        ray[k] = functional(light->ray[k], sights.i, sights.j);
    __m256 length = _mm256_sqrt_ps(dot(ray, ray)), inverse = _mm256_div_ps(splat(-1), length);
    sights.z = _mm256_div_ps(splat(eye->near_m), d);
    sights.distance = mul(sights.z, length);
    for (int k = 0; k < 3; k++)
        sights.to_viewer[k] = mul(ray[k], inverse);
    return sights;
}

static inline __m256 on_grid(const float f[5], bool orthographic, const struct sights *sights)
{
    __m256 z0 = orthographic ? splat(1) : sights->z, z1 = orthographic ? sights->z : _mm256_setzero_ps();
    return add(add(mul(functional(f, sights->i, sights->j), z0), mul(splat(f[3]), z1)), splat(f[4]));
}

static inline __m256 arriving(const struct sv_leaf_light *light, bool orthographic,
                              const struct sights *sights)
{
    __m256 column = held(on_grid(light->column, orthographic, sights), SV_SHADE_COLUMNS - 1);
    __m256 row = held(on_grid(light->row, orthographic, sights), SV_SHADE_ROWS - 1);
    __m256 first = _mm256_setzero_ps(), second = first;
    for (int k = 0; k < SV_SHADE_ROWS; k++) {
        __m256 off = _mm256_andnot_ps(splat(-0.0f), sub(row, splat((float)k)));
        __m256 near = _mm256_max_ps(sub(splat(1), off), _mm256_setzero_ps());
        first = add(first, mul(near, splat(light->share[0][k])));
        second = add(second, mul(near, splat(light->share[1][k])));
    }
    return mix(first, second, column);
}

static inline __m256 byte_of(__m256i v, int at)
{
    return _mm256_cvtepi32_ps(_mm256_srai_epi32(_mm256_slli_epi32(v, 24 - 8 * at), 24));
}

static inline __m256 visible_of(const struct sv_leaf_paint *paint, const struct sights *sights,
                                const struct spots *spots)
{
    const struct sv_leaf_light *light = paint->light;
    const float *d = light->model_sun;
    __m256 open[4];
    for (int c = 0; c < 4; c++) {
        __m256i v = spots->open[c];
        __m256 t = add(mul(byte_of(v, 0), splat(d[0])), mul(byte_of(v, 1), splat(d[1])));
        t = add(add(t, mul(byte_of(v, 2), splat(d[2]))), byte_of(v, 3));
        open[c] = held(mul(t, splat(1.0f / 127)), 1);
    }
    __m256 mean = mix4(spots, open);
    if (!light->shadows)
        return mean;
    __m256 facing = sub(dot_with(sights->to_viewer, light->to_sun), splat(1));
    __m256 hot = power_of_2(_mm256_min_ps(mul(facing, splat(SV_LEAF_HOT_EXP2)), _mm256_setzero_ps()));
    __m256 crown = mul(splat(light->crown), add(splat(1), mul(splat(SV_LEAF_HOT), hot)));
    mean = _mm256_min_ps(mul(mean, crown), splat(1));
    return mul(mean, arriving(light, paint->job->eye.orthographic, sights));
}

/* Codes of eight pixels; n: the normal, turned to the viewer. */
static inline __m256i light_of(const struct sv_leaf_paint *paint, const struct sights *sights,
                               const struct spots *spots, __m256 n[3])
{
    const struct sv_leaf_light *light = paint->light;
    __m256 rgb[3], minus = splat(-0.0f), visible = visible_of(paint, sights, spots);
    __m256 occlusion = occlusions_of(spots);
    normals_of(spots, light->turn, n);
    albedos_of(paint, spots, sights->z, rgb);
    __m256 away = _mm256_cmp_ps(dot(n, sights->to_viewer), _mm256_setzero_ps(), _CMP_LT_OQ);
    for (int k = 0; k < 3; k++)
        n[k] = _mm256_xor_ps(n[k], _mm256_and_ps(away, minus));
    __m256 n_l = dot_with(n, light->to_sun), up = add(splat(0.5f), mul(splat(0.5f), n[2]));
    float passes = paint->material->is_leaf ? paint->material->translucency : 0;
    __m256 front = _mm256_cmp_ps(n_l, _mm256_setzero_ps(), _CMP_GE_OQ);
    __m256 sun = mul(_mm256_blendv_ps(mul(n_l, splat(-passes)), n_l, front), visible);
    __m256 clear = light->air ? power_of_2(mul(sights->distance, splat(light->air_scale))) : splat(1);
    __m256i code = _mm256_set1_epi32((int)0xff000000);
    for (int c = 0; c < 3; c++) {
        __m256 ambient =
            mul(add(splat(light->ground[c]), mul(splat(light->sky[c] - light->ground[c]), up)), occlusion);
        __m256 lit = mul(rgb[c], add(mul(splat(light->sun[c]), sun), ambient));
        __m256 shoulder = sub(splat(1), _mm256_div_ps(splat(0.25f), lit));
        lit = _mm256_blendv_ps(lit, shoulder, _mm256_cmp_ps(lit, splat(0.5f), _CMP_GT_OQ));
        if (light->air)
            lit = add(splat(light->air_rgb[c]), mul(sub(lit, splat(light->air_rgb[c])), clear));
        code = _mm256_or_si256(code, _mm256_slli_epi32(code_of(lit), 8 * c));
    }
    return code;
}

static inline void put_eight(const struct sv_leaf_paint *paint, __m256i pixel, __m256i code,
                             const __m256 n[3])
{
    uint32_t at[LANES], rgba[LANES];
    float normal[3][LANES];
    _mm256_storeu_si256((__m256i *)(void *)at, pixel);
    _mm256_storeu_si256((__m256i *)(void *)rgba, code);
    for (int i = 0; i < LANES; i++) {
        memcpy(paint->color[at[i]], &rgba[i], 4);
        paint->job->seen[at[i]] = (struct sv_leaf_seen){0, 0};
    }
    for (int i = 0; paint->id && i < LANES; i++)
        paint->id[at[i]] = paint->light->id;
    if (!paint->normal)
        return;
    for (int k = 0; k < 3; k++)
        _mm256_storeu_ps(normal[k], n[k]);
    for (int i = 0; i < LANES; i++)
        for (int k = 0; k < 3; k++)
            paint->normal[at[i]][k] = normal[k][i];
}

static inline void shade_eight(const struct sv_leaf_paint *paint, const uint32_t *list)
{
    const struct sv_leaf_job *job = paint->job;
    __m256i at = _mm256_loadu_si256((const __m256i *)(const void *)list), one = _mm256_set1_epi32(1);
    __m256i i = _mm256_and_si256(at, _mm256_set1_epi32(0xffff)), j = _mm256_srli_epi32(at, 16);
    __m256i pixel = _mm256_add_epi32(_mm256_mullo_epi32(j, _mm256_set1_epi32(job->eye.width)), i);
    __m256i twice = _mm256_add_epi32(pixel, pixel);
    __m256i piece = _mm256_sub_epi32(gather(&job->seen->piece, twice), one);
    __m256i place = gather(&job->seen->place, twice);
    __m256 d = _mm256_i32gather_ps(job->depth, pixel, 4), n[3];
    __m256i row = _mm256_add_epi32(j, _mm256_set1_epi32(job->eye.row_first));
    struct sights sights = sights_of(paint, i, row, d);
    struct spots spots = spots_of(job->form, piece, place);
    __m256i code = light_of(paint, &sights, &spots, n);
    put_eight(paint, pixel, code, n);
}

void sv_leaf_shade_avx2(const struct sv_leaf_paint *paint, const uint32_t *pixel, int n)
{
    int k = 0;
    for (; k + LANES <= n; k += LANES)
        shade_eight(paint, pixel + k);
    sv_leaf_shade_scalar(paint, pixel + k, n - k);
}
