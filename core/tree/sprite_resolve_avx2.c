/* sprite_resolve_avx2.c - canvas to tile and back, 8 pixels at a time. TWIN: sprite_resolve.c, bit for bit.
 */
#include <immintrin.h>

#include "core/base/color.h"
#include "core/tree/sprite_private.h"

void sv_sprite_tile_load_avx2(const struct sv_canvas *canvas, const struct sv_camera *camera, int columns,
                              int rows, struct sv_sprite_state *state, struct sv_sprite_tile *tile)
{
    bool orthographic = camera->projection == SV_PROJECTION_ORTHOGRAPHIC;
    const __m256 none = _mm256_setzero_ps(), one = _mm256_set1_ps(1), sky = _mm256_set1_ps(__builtin_inff());
    const __m256 range = _mm256_set1_ps(orthographic ? (float)camera->far_m : (float)camera->near_m);
    __m256 farthest = none;
    sv_sprite_tile_clear(columns, rows, state, tile);
    for (int j = 0; j < rows; j++) {
        const float *depth = canvas->depth + sv_canvas_at(canvas, state->x0, state->y0 + j);
        float *z = tile->z + j * SV_SPRITE_TILE;
        for (int i = 0; i + SV_SPRITE_LANES <= columns; i += SV_SPRITE_LANES) {
            __m256 d = _mm256_loadu_ps(depth + i);
            __m256 m = orthographic ? _mm256_mul_ps(range, _mm256_sub_ps(one, d)) : _mm256_div_ps(range, d);
            _mm256_storeu_ps(z + i, _mm256_blendv_ps(sky, m, _mm256_cmp_ps(d, none, _CMP_GT_OQ)));
        }
        sv_sprite_load_row(camera, depth, columns / SV_SPRITE_LANES * SV_SPRITE_LANES, columns, z);
        for (int i = 0; i < SV_SPRITE_TILE; i += SV_SPRITE_LANES)
            farthest = _mm256_max_ps(_mm256_loadu_ps(z + i), farthest);
    }
    float lanes[SV_SPRITE_LANES];
    _mm256_storeu_ps(lanes, farthest);
    for (int k = 0; k < SV_SPRITE_LANES; k++)
        state->far_z = lanes[k] > state->far_z ? lanes[k] : state->far_z;
}

/* sv_srgb8_from_linear. */
static inline __m256i encode(__m256 v)
{
    const __m256 one = _mm256_set1_ps(1);
    const __m256i step = _mm256_set1_epi32(1);
    v = _mm256_min_ps(_mm256_max_ps(v, _mm256_setzero_ps()), one); /* NaN: 0 */
    __m256i bin = _mm256_cvttps_epi32(_mm256_mul_ps(v, _mm256_set1_ps(4096)));
    __m256i code = _mm256_i32gather_epi32(sv_srgb8_bin, bin, 4);
    __m256 next = _mm256_i32gather_ps(sv_srgb8_threshold, _mm256_add_epi32(code, step), 4);
    return _mm256_sub_epi32(code, _mm256_castps_si256(_mm256_cmp_ps(v, next, _CMP_GE_OQ)));
}

static inline __m256i channel(__m256i pixels, int shift, __m256 gathered, __m256 pass)
{
    __m256i code = _mm256_and_si256(_mm256_srli_epi32(pixels, shift), _mm256_set1_epi32(255));
    __m256 under = _mm256_i32gather_ps(sv_linear_from_srgb8, code, 4);
    return _mm256_slli_epi32(encode(_mm256_add_ps(gathered, _mm256_mul_ps(pass, under))), shift);
}

static inline void store_group(uint8_t *color, const struct sv_sprite_tile *tile, size_t k)
{
    const __m256 one = _mm256_set1_ps(1), all = _mm256_set1_ps(255), half = _mm256_set1_ps(0.5f);
    __m256 pass = _mm256_loadu_ps(tile->pass + k), same = _mm256_cmp_ps(pass, one, _CMP_EQ_OQ);
    if (_mm256_movemask_ps(same) == 255)
        return;
    __m256i pixels = _mm256_loadu_si256((const __m256i *)color);
    __m256 open = _mm256_cmp_ps(pass, _mm256_set1_ps(SV_SPRITE_PASS_MIN), _CMP_GE_OQ);
    __m256 each = _mm256_blendv_ps(_mm256_div_ps(one, _mm256_sub_ps(one, pass)), one, open);
    pass = _mm256_and_ps(pass, open);
    __m256i red = channel(pixels, 0, _mm256_mul_ps(each, _mm256_loadu_ps(tile->red + k)), pass);
    __m256i green = channel(pixels, 8, _mm256_mul_ps(each, _mm256_loadu_ps(tile->green + k)), pass);
    __m256i blue = channel(pixels, 16, _mm256_mul_ps(each, _mm256_loadu_ps(tile->blue + k)), pass);
    __m256 alpha = _mm256_mul_ps(all, _mm256_sub_ps(one, pass));
    alpha = _mm256_add_ps(alpha, _mm256_mul_ps(pass, _mm256_cvtepi32_ps(_mm256_srli_epi32(pixels, 24))));
    __m256i a = _mm256_slli_epi32(_mm256_cvttps_epi32(_mm256_add_ps(alpha, half)), 24);
    __m256i made = _mm256_or_si256(_mm256_or_si256(red, green), _mm256_or_si256(blue, a));
    _mm256_storeu_si256((__m256i *)color, _mm256_blendv_epi8(made, pixels, _mm256_castps_si256(same)));
}

void sv_sprite_tile_store_avx2(const struct sv_canvas *canvas, int columns, int rows,
                               const struct sv_sprite_state *state, const struct sv_sprite_tile *tile)
{
    int whole = columns / SV_SPRITE_LANES * SV_SPRITE_LANES;
    for (int j = 0; j < rows; j++) {
        uint8_t *color = canvas->color + 4 * sv_canvas_at(canvas, state->x0, state->y0 + j);
        for (int i = 0; i < whole; i += SV_SPRITE_LANES)
            store_group(color + 4 * i, tile, (size_t)(j * SV_SPRITE_TILE + i));
        sv_sprite_store_row(color, tile, (size_t)(j * SV_SPRITE_TILE), whole, columns);
    }
}
