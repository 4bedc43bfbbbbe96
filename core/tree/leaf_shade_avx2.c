/* leaf_shade_avx2.c - leaf_shade.c, eight pixels at a time; operation for operation the scalar one. */
#include <immintrin.h>
#include <math.h>

#include "core/base/color.h"
#include "core/tree/leaf_shade.h"

enum { LANES = 8, VERTEX_WORDS = sizeof(struct sv_tree_vertex) / 4 };

_Static_assert(sizeof(struct sv_tree_vertex) == 32, "words of a vertex: position, normal and occlusion, uv, open");

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
    __m256 curve = sub(mul(power, octave), splat(255 * 0.055f)), line = mul(c, splat(255 * 12.92f));
    return _mm256_cvtps_epi32(_mm256_blendv_ps(line, curve, _mm256_cmp_ps(c, splat(1.0f / 256), _CMP_GE_OQ)));
}

struct spots {
    __m256i word[3]; /* of the vertices, in words from the first */
    __m256 w[3];
};

static inline __m256i gather(const void *base, __m256i index)
{
    return _mm256_i32gather_epi32((const int *)base, index, 4);
}

static inline struct spots spots_of(const struct sv_leaf_form *form, __m256i piece, __m256i place)
{
    const uint32_t *corners = form->corners[0];
    __m256i at = _mm256_slli_epi32(piece, 2), v[4];
    for (int k = 0; k < 4; k++)
        v[k] = gather(corners + k, at);
    __m256 unit = splat(1.0f / 65535);
    __m256 s = mul(_mm256_cvtepi32_ps(_mm256_and_si256(place, _mm256_set1_epi32(0xffff))), unit);
    __m256 r = mul(_mm256_cvtepi32_ps(_mm256_srli_epi32(place, 16)), unit);
    __m256 single = _mm256_castsi256_ps(_mm256_cmpeq_epi32(v[3], _mm256_set1_epi32(-1)));
    __m256 upper = _mm256_cmp_ps(s, r, _CMP_GE_OQ), first = _mm256_or_ps(single, upper);
    __m256 b = _mm256_blendv_ps(s, sub(s, r), _mm256_andnot_ps(single, upper));
    __m256 c = _mm256_blendv_ps(sub(r, s), r, first);
    __m256i pick = _mm256_castps_si256(first);
    struct spots spots = {{v[0], _mm256_blendv_epi8(v[2], v[1], pick), _mm256_blendv_epi8(v[3], v[2], pick)},
                          {sub(splat(1), add(b, c)), b, c}};
    for (int k = 0; k < 3; k++)
        spots.word[k] = _mm256_slli_epi32(spots.word[k], 3);
    return spots;
}

static inline __m256 mix3(const struct spots *spots, const __m256 v[3])
{
    return add(add(mul(spots->w[0], v[0]), mul(spots->w[1], v[1])), mul(spots->w[2], v[2]));
}

static inline __m256 low_short(__m256i v)
{
    return _mm256_cvtepi32_ps(_mm256_srai_epi32(_mm256_slli_epi32(v, 16), 16));
}

/* Normal (world, unit) and occlusion. */
static inline void normals_of(const struct sv_leaf_form *form, const struct spots *spots, const float turn[2],
                              __m256 n[3], __m256 *occlusion)
{
    const uint32_t *words = (const uint32_t *)(const void *)form->mesh->vertices;
    __m256 x[3], y[3], z[3], o[3];
    for (int k = 0; k < 3; k++) {
        __m256i xy = gather(words + 3, spots->word[k]), zo = gather(words + 4, spots->word[k]);
        x[k] = low_short(xy);
        y[k] = _mm256_cvtepi32_ps(_mm256_srai_epi32(xy, 16));
        z[k] = low_short(zo);
        o[k] = _mm256_cvtepi32_ps(_mm256_srli_epi32(zo, 16));
    }
    __m256 mx = mix3(spots, x), my = mix3(spots, y);
    n[0] = add(mul(splat(turn[0]), mx), mul(splat(turn[1]), my));
    n[1] = sub(mul(splat(turn[0]), my), mul(splat(turn[1]), mx));
    n[2] = mix3(spots, z);
    __m256 inverse = _mm256_div_ps(splat(1), _mm256_sqrt_ps(_mm256_max_ps(dot(n, n), splat(1e-20f))));
    for (int k = 0; k < 3; k++)
        n[k] = mul(n[k], inverse);
    *occlusion = mul(mix3(spots, o), splat(1.0f / 65535));
}

static inline __m256 texel_of(__m256 u, int size)
{
    __m256 x = sub(mul(sub(u, _mm256_floor_ps(u)), splat((float)size)), splat(0.5f));
    __m256 legal = _mm256_and_ps(_mm256_cmp_ps(x, splat(-1), _CMP_GE_OQ),
                                 _mm256_cmp_ps(x, splat((float)size), _CMP_LE_OQ));
    return _mm256_and_ps(x, legal);
}

static inline void wrap(__m256i i, int size, __m256i out[2])
{
    __m256i next = _mm256_add_epi32(i, _mm256_set1_epi32(1)), all = _mm256_set1_epi32(size);
    out[0] = _mm256_add_epi32(i, _mm256_and_si256(_mm256_srai_epi32(i, 31), all));
    out[1] = _mm256_sub_epi32(next, _mm256_andnot_si256(_mm256_cmpgt_epi32(all, next), all));
}

static inline __m256 mix(__m256 a, __m256 b, __m256 t)
{
    return add(a, mul(sub(b, a), t));
}

static inline void albedos_of(const struct sv_leaf_form *form, const struct sv_tree_material *material,
                              const struct spots *spots, __m256 rgb[3])
{
    const struct sv_image *image = &material->albedo;
    const uint32_t *words = (const uint32_t *)(const void *)form->mesh->vertices;
    for (int c = 0; c < 3; c++)
        rgb[c] = splat(material->base_color[c]);
    if (!image->data)
        return;
    __m256 u[3], v[3];
    for (int k = 0; k < 3; k++) {
        u[k] = _mm256_castsi256_ps(gather(words + 5, spots->word[k]));
        v[k] = _mm256_castsi256_ps(gather(words + 6, spots->word[k]));
    }
    __m256 x = texel_of(mix3(spots, u), image->width), y = texel_of(mix3(spots, v), image->height);
    __m256 bx = _mm256_floor_ps(x), by = _mm256_floor_ps(y), fu = sub(x, bx), fv = sub(y, by);
    __m256i i[2], j[2], texel[4];
    wrap(_mm256_cvttps_epi32(bx), image->width, i);
    wrap(_mm256_cvttps_epi32(by), image->height, j);
    for (int k = 0; k < 4; k++) {
        __m256i row = _mm256_mullo_epi32(j[k >> 1], _mm256_set1_epi32(image->width));
        texel[k] = gather(image->data, _mm256_add_epi32(row, i[k & 1]));
    }
    for (int c = 0; c < 3; c++) {
        __m256 a[4];
        for (int k = 0; k < 4; k++) {
            __m256i level = _mm256_and_si256(_mm256_srli_epi32(texel[k], 8 * c), _mm256_set1_epi32(255));
            a[k] = _mm256_i32gather_ps(sv_linear_from_srgb8, level, 4);
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

static inline __m256 arriving(const struct sv_leaf_light *light, bool orthographic, const struct sights *sights)
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
    const uint32_t *words = (const uint32_t *)(const void *)paint->job->form->mesh->vertices;
    const float *d = light->model_sun;
    __m256 open[3];
    for (int k = 0; k < 3; k++) {
        __m256i v = gather(words + 7, spots->word[k]);
        __m256 t = add(mul(byte_of(v, 0), splat(d[0])), mul(byte_of(v, 1), splat(d[1])));
        t = add(add(t, mul(byte_of(v, 2), splat(d[2]))), byte_of(v, 3));
        open[k] = held(mul(t, splat(1.0f / 127)), 1);
    }
    __m256 mean = mix3(spots, open);
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
    __m256 rgb[3], occlusion, minus = splat(-0.0f), visible = visible_of(paint, sights, spots);
    normals_of(paint->job->form, spots, light->turn, n, &occlusion);
    albedos_of(paint->job->form, paint->material, spots, rgb);
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

static inline void put_eight(const struct sv_leaf_paint *paint, __m256i pixel, __m256i code, const __m256 n[3])
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
    struct sights sights = sights_of(paint, i, j, d);
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
