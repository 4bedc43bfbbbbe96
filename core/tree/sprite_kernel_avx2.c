/* sprite_kernel_avx2.c - trees into a tile, 8 pixels at a time. TWIN: sprite_kernel.c; no fused multiply-add,
 * whole divisions and roots, so that both give the same bits. */
#include <immintrin.h>

#include "core/tree/sprite_private.h"

#define V __m256
#define I __m256i

static inline V set(float v)
{
    return _mm256_set1_ps(v);
}

static inline V add(V a, V b)
{
    return _mm256_add_ps(a, b);
}

static inline V sub(V a, V b)
{
    return _mm256_sub_ps(a, b);
}

static inline V mul(V a, V b)
{
    return _mm256_mul_ps(a, b);
}

/* As the scalar clamp: NaN gives lo. */
static inline V clamp(V v, V lo, V hi)
{
    return _mm256_min_ps(_mm256_max_ps(v, lo), hi);
}

static inline V at(const struct sv_sprite_affine *f, V x, float y)
{
    return add(set(f->at + f->row * y), mul(set(f->column), x));
}

/* Byte n of each word as a float. */
static inline V byte(I words, int n)
{
    I b = n == 3 ? _mm256_srli_epi32(words, 24)
                 : _mm256_and_si256(n ? _mm256_srli_epi32(words, 8 * n) : words, _mm256_set1_epi32(255));
    return _mm256_cvtepi32_ps(b);
}

static inline I word(const void *base, int n, I index)
{
    return _mm256_i32gather_epi32((const int *)base + n, index, 8);
}

/* Both words of 8 texels: 4 loads of 64 bits at a time. */
struct words {
    I first, second;
};

static inline struct words pairs(const void *base, I index)
{
    I a = _mm256_i32gather_epi64((const long long *)base, _mm256_castsi256_si128(index), 8);
    I b = _mm256_i32gather_epi64((const long long *)base, _mm256_extracti128_si256(index, 1), 8);
    V low = _mm256_shuffle_ps(_mm256_castsi256_ps(a), _mm256_castsi256_ps(b), 0x88);
    V high = _mm256_shuffle_ps(_mm256_castsi256_ps(a), _mm256_castsi256_ps(b), 0xDD);
    /* Lanes 0 1 4 5 2 3 6 7, as pairs: the middle ones change places. */
    return (struct words){_mm256_permute4x64_epi64(_mm256_castps_si256(low), 0xD8),
                          _mm256_permute4x64_epi64(_mm256_castps_si256(high), 0xD8)};
}

static inline I smooth_index(const struct sv_sprite *s, I i, I j)
{
    const I round = _mm256_set1_epi32((1 << s->shift) - 1);
    const __m128i shift = _mm_cvtsi32_si128(s->shift);
    I si = _mm256_srl_epi32(_mm256_add_epi32(i, round), shift);
    I sj = _mm256_srl_epi32(_mm256_add_epi32(j, round), shift);
    return _mm256_add_epi32(_mm256_mullo_epi32(sj, _mm256_set1_epi32(s->smooth_stride)), si);
}

struct shown {
    V alpha, red, green, blue, z, normal[3];
};

struct place {
    V u, v, z;
};

static inline struct place locate(const struct sv_sprite *s, V x, float y)
{
    V inverse = _mm256_div_ps(set(1), at(&s->c, x, y));
    V u0 = at(&s->u, x, y), v0 = at(&s->v, x, y), z0 = at(&s->z, x, y);
    struct place p = {mul(u0, inverse), mul(v0, inverse), mul(z0, inverse)};
    if (!s->move)
        return p;
    const V none = _mm256_setzero_ps();
    I i = _mm256_cvttps_epi32(clamp(p.u, none, set(s->u_max)));
    I j = _mm256_cvttps_epi32(clamp(p.v, none, set(s->v_max)));
    V code = byte(word(s->smooth, 1, smooth_index(s, i, j)), 1);
    V e = add(set(s->depth_first), mul(set(s->depth_step), code));
    p.u = mul(add(u0, mul(at(&s->u_depth, x, y), e)), inverse);
    p.v = mul(add(v0, mul(at(&s->v_depth, x, y), e)), inverse);
    p.z = mul(add(z0, mul(set(s->z_depth), e)), inverse);
    return p;
}

static inline V leaf_sun(const V m[3], const float l[3], V t, float gain)
{
    const V one = set(1), none = _mm256_setzero_ps();
    V rho2 = add(add(mul(m[0], m[0]), mul(m[1], m[1])), mul(m[2], m[2]));
    rho2 = clamp(rho2, set(1e-6f), one);
    V loose = sub(one, _mm256_sqrt_ps(rho2));
    V along = add(add(mul(m[0], set(l[0])), mul(m[1], set(l[1]))), mul(m[2], set(l[2])));
    V c2 = _mm256_min_ps(_mm256_div_ps(mul(along, along), rho2), one);
    V across = _mm256_min_ps(mul(set(0.8f), loose), set(0.5f));
    V mean = add(across, mul(sub(one, mul(set(3), across)), c2));
    mean = mul(_mm256_sqrt_ps(_mm256_max_ps(mean, none)),
               sub(one, mul(loose, sub(set(0.56f), mul(set(0.4f), c2)))));
    V sum = add(mul(add(one, t), mul(mean, set(gain))), mul(sub(one, t), along));
    return _mm256_max_ps(mul(set(0.5f), sum), none);
}

static inline V grid_light(const struct sv_sprite *s, V u, V v)
{
    const V none = _mm256_setzero_ps();
    V column = add(add(mul(set(s->column[0]), u), mul(set(s->column[1]), v)), set(s->column[2]));
    V row = add(add(mul(set(s->row[0]), u), mul(set(s->row[1]), v)), set(s->row[2]));
    column = clamp(column, none, set(1));
    row = clamp(row, none, set(3));
    I k = _mm256_cvttps_epi32(_mm256_min_ps(row, set(2)));
    V part = sub(row, _mm256_cvtepi32_ps(k)), nodes = _mm256_loadu_ps(s->light);
    V a = _mm256_permutevar8x32_ps(nodes, k);
    V b = _mm256_permutevar8x32_ps(nodes, _mm256_add_epi32(k, _mm256_set1_epi32(1)));
    V c = _mm256_permutevar8x32_ps(nodes, _mm256_add_epi32(k, _mm256_set1_epi32(4)));
    V d = _mm256_permutevar8x32_ps(nodes, _mm256_add_epi32(k, _mm256_set1_epi32(5)));
    V first = add(a, mul(sub(b, a), part)), second = add(c, mul(sub(d, c), part));
    return add(first, mul(sub(second, first), column));
}

static inline V tone(V c)
{
    const V one = set(1), half = set(0.5f);
    V t = _mm256_max_ps(sub(mul(set(2), c), one), _mm256_setzero_ps());
    return add(_mm256_min_ps(c, half), mul(half, _mm256_div_ps(t, add(one, t))));
}

static inline V channel(const struct sv_sprite_light *light, int c, V root, V sun, V up, V occlusion,
                        float keep)
{
    root = mul(root, set(1.0f / 255.0f));
    V ambient = add(set(light->ground_rgb[c]), mul(set(light->sky_rgb[c] - light->ground_rgb[c]), up));
    ambient = mul(ambient, occlusion);
    V lit = tone(mul(mul(root, root), add(mul(set(light->sun_rgb[c]), sun), ambient)));
    return add(set(light->air_rgb[c]), mul(sub(lit, set(light->air_rgb[c])), set(keep)));
}

static inline void shade(const struct sv_sprite_light *light, const struct sv_sprite *s, struct words texel,
                         struct words smooth, V u, V v, float keep, struct shown *out)
{
    I low = texel.first, high = texel.second, w0 = smooth.first, w1 = smooth.second;
    const V each = set(1.0f / 255.0f), one = set(1), half = set(0.5f);
    V *m = out->normal;
    for (int c = 0; c < 3; c++)
        m[c] = sub(mul(byte(high, c), set(2.0f / 255.0f)), one);
    V visible = add(set(s->open_at), mul(set(s->open[0]), byte(w0, 1)));
    visible = add(visible, mul(set(s->open[1]), byte(w0, 2)));
    visible = add(visible, mul(set(s->open[2]), byte(w0, 3)));
    visible = add(visible, mul(set(s->open[3]), byte(w1, 0)));
    visible = mul(clamp(visible, _mm256_setzero_ps(), one), grid_light(s, u, v));
    V out_by = sub(byte(high, 3), set(128));
    visible = mul(visible, _mm256_max_ps(add(one, mul(out_by, set(s->stand))), _mm256_setzero_ps()));
    V sun = mul(leaf_sun(m, s->sun, mul(byte(w1, 2), each), s->gain), visible);
    V up = add(half, mul(half, add(mul(m[1], set(s->up[0])), mul(m[2], set(s->up[1])))));
    V occlusion = mul(mul(byte(w0, 0), each),
                      _mm256_max_ps(add(one, mul(out_by, set(s->stand_sky))), _mm256_setzero_ps()));
    out->red = channel(light, 0, byte(low, 0), sun, up, occlusion, keep);
    out->green = channel(light, 1, byte(low, 1), sun, up, occlusion, keep);
    out->blue = channel(light, 2, byte(low, 2), sun, up, occlusion, keep);
}

/* Between four texels. */
static inline V coverage(const struct sv_sprite *s, V u, V v)
{
    I i = _mm256_cvttps_epi32(u), j = _mm256_cvttps_epi32(v);
    V fu = sub(u, _mm256_cvtepi32_ps(i)), fv = sub(v, _mm256_cvtepi32_ps(j));
    I index = _mm256_add_epi32(_mm256_mullo_epi32(j, _mm256_set1_epi32(s->stride)), i);
    const struct sv_sprite_texel *next = s->texels + s->stride;
    V a = byte(word(s->texels, 0, index), 3), b = byte(word(s->texels, 2, index), 3);
    V c = byte(word(next, 0, index), 3), d = byte(word(next, 2, index), 3);
    V above = add(a, mul(sub(b, a), fu)), below = add(c, mul(sub(d, c), fu));
    return add(above, mul(sub(below, above), fv));
}

/* Lanes that lie in blocks where something may be covered (sprite_atlas.h). */
static inline V in_block(const struct sv_sprite *s, V u, V v)
{
    I i = _mm256_cvttps_epi32(mul(u, set(s->block_u))), j = _mm256_cvttps_epi32(mul(v, set(s->block_v)));
    I bit = _mm256_or_si256(_mm256_slli_epi32(j, 4), i);
    I rows = _mm256_permutevar8x32_epi32(_mm256_loadu_si256((const I *)s->blocks), _mm256_srli_epi32(bit, 5));
    I shifted = _mm256_srlv_epi32(rows, _mm256_and_si256(bit, _mm256_set1_epi32(31)));
    I one = _mm256_set1_epi32(1);
    return _mm256_castsi256_ps(_mm256_cmpeq_epi32(_mm256_and_si256(shifted, one), one));
}

/* Asks for the texels of the rows to come: a picture's first row comes out of memory late enough. */
static inline void prefetch(const struct sv_sprite *s, I index)
{
    const char *ahead = (const char *)(s->texels + 3 * s->stride);
    long first = _mm_cvtsi128_si32(_mm256_castsi256_si128(index));
    _mm_prefetch(ahead + 8 * first, _MM_HINT_T0);
}

/* False when no lane shows anything. */
static inline bool show(const struct sv_sprite_light *light, const struct sv_sprite *s, V x, float y,
                        V limit_z, float keep, struct shown *out)
{
    const V none = _mm256_setzero_ps(), half = set(0.5f);
    struct place p = locate(s, x, y);
    V seen = _mm256_and_ps(_mm256_cmp_ps(p.z, set(light->near_z), _CMP_GE_OQ),
                           _mm256_cmp_ps(p.z, limit_z, _CMP_LE_OQ));
    V u = clamp(p.u, none, set(s->u_max)), v = clamp(p.v, none, set(s->v_max));
    seen = _mm256_and_ps(seen, in_block(s, u, v));
    if (_mm256_movemask_ps(seen) == 0)
        return false;
    I i = _mm256_cvttps_epi32(add(u, half)), j = _mm256_cvttps_epi32(add(v, half));
    I index = _mm256_add_epi32(_mm256_mullo_epi32(j, _mm256_set1_epi32(s->stride)), i);
    prefetch(s, index);
    struct words texel = pairs(s->texels, index);
    V covered = s->between ? coverage(s, u, v) : byte(texel.first, 3);
    out->alpha = _mm256_and_ps(mul(covered, set(s->weight)), seen);
    out->z = _mm256_and_ps(p.z, seen);
    if (_mm256_movemask_ps(_mm256_cmp_ps(out->alpha, none, _CMP_GT_OQ)) == 0)
        return false;
    shade(light, s, texel, pairs(s->smooth, smooth_index(s, i, j)), u, v, keep, out);
    return true;
}

static inline void add_normal(const struct sv_sprite *s, const struct shown *one, V sum[3])
{
    const float *r = s->right, *t = s->top;
    const float toward[3] = {r[1] * t[2] - r[2] * t[1], r[2] * t[0] - r[0] * t[2], r[0] * t[1] - r[1] * t[0]};
    const V *m = one->normal;
    for (int c = 0; c < 3; c++) {
        V n = add(add(mul(m[0], set(r[c])), mul(m[1], set(t[c]))), mul(m[2], set(toward[c])));
        sum[c] = add(sum[c], mul(one->alpha, n));
    }
}

/* Where half of the view is covered for the first time. */
static inline void mark_hard(const struct sv_sprite_tree *tree, const struct shown *sum, V pass, V left,
                             size_t k, struct sv_sprite_hard *hard)
{
    const V none = _mm256_setzero_ps(), half = set(0.5f);
    V before = _mm256_loadu_ps(hard->z + k);
    V now = hard->surface ? _mm256_cmp_ps(pass, half, _CMP_GT_OQ)
                          : _mm256_and_ps(_mm256_cmp_ps(before, none, _CMP_EQ_OQ),
                                          _mm256_cmp_ps(left, half, _CMP_LE_OQ));
    now = _mm256_and_ps(now, _mm256_cmp_ps(sum->alpha, none, _CMP_GT_OQ));
    if (_mm256_movemask_ps(now) == 0)
        return;
    I mask = _mm256_castps_si256(now);
    _mm256_maskstore_ps(hard->z + k, mask, _mm256_div_ps(sum->z, sum->alpha));
    if (hard->depth_only)
        return;
    const V *n = sum->normal;
    V square = add(add(mul(n[0], n[0]), mul(n[1], n[1])), mul(n[2], n[2]));
    V each = _mm256_div_ps(set(1), _mm256_sqrt_ps(_mm256_max_ps(square, set(1e-12f))));
    _mm256_maskstore_epi32((int *)hard->id + k, mask, _mm256_set1_epi32((int)tree->id));
    for (int c = 0; c < 3; c++)
        _mm256_maskstore_ps(hard->normal[c] + k, mask, mul(n[c], each));
}

/* What covers of a tree a share of which is there (SV_SPRITE_SHARE). */
static inline V share_of(V alpha, uint32_t share)
{
    V root = _mm256_max_ps(sub(set(1), alpha), set(sv_sprite_share_least(share))), pass = set(1);
    for (int bit = SV_SPRITE_SHARE_BITS; bit-- > 0;) {
        root = _mm256_sqrt_ps(root);
        if (share >> bit & 1)
            pass = mul(pass, root);
    }
    return sub(set(1), pass);
}

/* Draws 8 pixels; returns whether any still lets light through. */
static inline bool draw_group(const struct sv_sprite_light *light, const struct sv_sprite_tree *tree,
                              const struct sv_sprite *sprites, V x, float y, size_t k,
                              struct sv_sprite_tile *tile, struct sv_sprite_hard *hard)
{
    const V none = _mm256_setzero_ps();
    struct shown sum = {none, none, none, none, none, {none, none, none}};
    V pass = _mm256_loadu_ps(tile->pass + k), open = _mm256_cmp_ps(pass, set(SV_SPRITE_PASS_MIN), _CMP_GE_OQ);
    V limit_z = _mm256_and_ps(_mm256_loadu_ps(tile->z + k), open); /* 0: nothing is in front of it */
    bool any = false;
    for (uint32_t n = 0; n < tree->count; n++) {
        struct shown one;
        if (!show(light, &sprites[n], x, y, limit_z, tree->keep, &one))
            continue;
        any = true;
        sum.alpha = add(sum.alpha, one.alpha);
        sum.red = add(sum.red, mul(one.alpha, one.red));
        sum.green = add(sum.green, mul(one.alpha, one.green));
        sum.blue = add(sum.blue, mul(one.alpha, one.blue));
        if (hard) {
            sum.z = add(sum.z, mul(one.alpha, one.z));
            if (!hard->depth_only)
                add_normal(&sprites[n], &one, sum.normal);
        }
    }
    if (!any)
        return true;
    V covers = sum.alpha, lit = pass;
    if (tree->share < SV_SPRITE_SHARE) {
        covers = share_of(sum.alpha, tree->share);
        lit = mul(pass, _mm256_div_ps(covers, _mm256_max_ps(sum.alpha, set(1e-6f))));
    }
    V left = mul(pass, sub(set(1), _mm256_min_ps(covers, set(1))));
    _mm256_storeu_ps(tile->red + k, add(_mm256_loadu_ps(tile->red + k), mul(lit, sum.red)));
    _mm256_storeu_ps(tile->green + k, add(_mm256_loadu_ps(tile->green + k), mul(lit, sum.green)));
    _mm256_storeu_ps(tile->blue + k, add(_mm256_loadu_ps(tile->blue + k), mul(lit, sum.blue)));
    _mm256_storeu_ps(tile->pass + k, left);
    if (hard)
        mark_hard(tree, &sum, pass, left, k, hard);
    return _mm256_movemask_ps(_mm256_cmp_ps(left, set(SV_SPRITE_PASS_MIN), _CMP_GE_OQ)) != 0;
}

static inline void draw_row(const struct sv_sprite_light *light, const struct sv_sprite_tree *tree,
                            const struct sv_sprite *sprites, int row, unsigned span,
                            struct sv_sprite_state *state, struct sv_sprite_tile *tile,
                            struct sv_sprite_hard *hard)
{
    float y = (float)(state->y0 + row - tree->y0);
    unsigned open = state->open[row] & span;
    while (open) {
        int g = __builtin_ctz(open);
        open &= open - 1;
        int column = g * SV_SPRITE_LANES;
        V x = _mm256_cvtepi32_ps(_mm256_add_epi32(_mm256_set1_epi32(state->x0 + column - tree->x0),
                                                  _mm256_setr_epi32(0, 1, 2, 3, 4, 5, 6, 7)));
        if (!draw_group(light, tree, sprites, x, y, (size_t)(row * SV_SPRITE_TILE + column), tile, hard)) {
            state->open[row] = (uint8_t)(state->open[row] & ~(1u << g));
            state->open_groups--;
        }
    }
}

void sv_sprite_kernel_avx2(const struct sv_sprite_light *light, const struct sv_sprite_tree *trees,
                           const struct sv_sprite *sprites, const uint32_t *order, uint32_t count,
                           struct sv_sprite_state *state, struct sv_sprite_tile *tile,
                           struct sv_sprite_hard *hard)
{
    const int groups = SV_SPRITE_TILE / SV_SPRITE_LANES;
    for (uint32_t k = 0; k < count && state->open_groups > 0; k++) {
        const struct sv_sprite_tree *tree = &trees[order[k]];
        if (tree->near_z > state->far_z)
            continue;
        int left = tree->x0 > state->x0 ? (tree->x0 - state->x0) / SV_SPRITE_LANES : 0;
        int right = (tree->x1 - 1 - state->x0) / SV_SPRITE_LANES;
        right = right < groups ? right : groups - 1;
        unsigned span = (2u << right) - (1u << left);
        int first = tree->y0 > state->y0 ? tree->y0 - state->y0 : 0, end = tree->y1 - state->y0;
        end = end < SV_SPRITE_TILE ? end : SV_SPRITE_TILE;
        for (int row = first; row < end; row++)
            draw_row(light, tree, sprites + tree->first, row, span, state, tile, hard);
    }
}
