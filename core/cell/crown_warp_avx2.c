/* crown_warp_avx2.c - the kernels of crown_warp_scalar.c, eight texels or pixels at a time, operation for
 * operation the same, so that the pictures are equal. */
#include <immintrin.h>

#include "core/cell/crown_warp_kernel.h"

enum { LANES = 8 };

static inline __m256 absolute(__m256 x)
{
    return _mm256_andnot_ps(_mm256_set1_ps(-0.0f), x);
}

static inline __m256 in_order(__m256 a, __m256 b) /* a <= b, false for NaN */
{
    return _mm256_cmp_ps(a, b, _CMP_LE_OQ);
}

/* ---- splat ---- */

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
static const uint64_t packed_lanes[256] = {PACK64(0), PACK64(64), PACK64(128), PACK64(192)};

/* Pixels of boxes beyond their first, on their way into the buffer: packed into a list first, because which
 * pixels are won cannot be foretold, and a loop without branches does that best. Pixel k takes keys[slot[k]].
 */
enum { LIST = 1024, LIST_STEP = LANES * (2 * SV_CROWN_HALF_MAX + 1) * (2 * SV_CROWN_HALF_MAX + 1) };
struct list {
    int count;
    uint32_t pixel[LIST + LIST_STEP], slot[LIST + LIST_STEP];
    uint64_t keys[SV_PANEL_TILE * SV_PANEL_TILE]; /* of the tile's texels, each group of eight in key_order */
};
static const uint8_t key_order[LANES] = {0, 1, 4, 5, 2, 3, 6, 7}; /* where a lane's key is */

static inline void put(uint64_t *held, uint64_t key)
{
    *held = key > *held ? key : *held;
}

static inline void list_put(struct list *list, uint64_t *keys)
{
    for (int k = 0; k < list->count; k++)
        put(&keys[list->pixel[k]], list->keys[list->slot[k]]);
    list->count = 0;
}

/* Least and largest pixels of what is drawn of a tile, lane by lane. */
struct bounds {
    __m256i x0, x1, y0, y1;
};

static inline int least_of(__m256i v)
{
    __m128i m = _mm_min_epi32(_mm256_castsi256_si128(v), _mm256_extracti128_si256(v, 1));
    m = _mm_min_epi32(m, _mm_shuffle_epi32(m, 0x4e));
    return _mm_cvtsi128_si32(_mm_min_epi32(m, _mm_shuffle_epi32(m, 0xb1)));
}

/* What eight texels of a row need. */
struct texels {
    __m256 at[4], dc[4], spread_x, spread_y, lo_x, hi_x, lo_y, hi_y;
    __m256i epoch; /* upper halves of keys */
};

struct span {
    __m256i first, last;
    __m256 some; /* first <= last */
};

static inline struct span pixels_within(__m256 x, __m256 half, __m256 lo, __m256 hi)
{
    half = _mm256_add_ps(half, _mm256_set1_ps(SV_CROWN_GROW));
    half = _mm256_min_ps(half, _mm256_set1_ps(SV_CROWN_HALF_MAX));
    __m256 centre = _mm256_sub_ps(x, _mm256_set1_ps(0.5f));
    __m256 a = _mm256_max_ps(_mm256_ceil_ps(_mm256_sub_ps(centre, half)), lo);
    __m256 b = _mm256_min_ps(_mm256_floor_ps(_mm256_add_ps(centre, half)), hi);
    return (struct span){_mm256_cvttps_epi32(a), _mm256_cvttps_epi32(b), in_order(a, b)};
}

/* Bits of d as the middle of keys, tags inverted below them. */
static inline void store_keys(__m256i d, __m256i low, __m256i epoch, uint64_t *keys)
{
    low = _mm256_or_si256(low, _mm256_slli_epi32(d, SV_CROWN_DEPTH_SHIFT));
    __m256i high = _mm256_or_si256(epoch, _mm256_srli_epi32(d, 32 - SV_CROWN_DEPTH_SHIFT));
    _mm256_storeu_si256((__m256i *)(void *)keys, _mm256_unpacklo_epi32(low, high));
    _mm256_storeu_si256((__m256i *)(void *)(keys + 4), _mm256_unpackhi_epi32(low, high));
}

static inline void list_add(struct list *list, unsigned mask, __m256i pixel, __m256i slot)
{
    __m256i order = _mm256_cvtepu8_epi32(_mm_loadl_epi64((const __m128i *)(const void *)&packed_lanes[mask]));
    int n = list->count;
    _mm256_storeu_si256((__m256i *)(void *)(list->pixel + n), _mm256_permutevar8x32_epi32(pixel, order));
    _mm256_storeu_si256((__m256i *)(void *)(list->slot + n), _mm256_permutevar8x32_epi32(slot, order));
    list->count = n + __builtin_popcount(mask);
}

static inline unsigned lanes_in(__m256i a, __m256i b)
{
    return (unsigned)_mm256_movemask_ps(_mm256_castsi256_ps(_mm256_and_si256(a, b)));
}

/* Lists the pixels of eight boxes but for each one's first. */
static inline void list_boxes(struct list *list, int stride, __m256i live, const struct span *x,
                              const struct span *y, __m256i at, int slot)
{
    __m256i last_x = _mm256_sub_epi32(x->last, x->first), last_y = _mm256_sub_epi32(y->last, y->first);
    __m256i slots = _mm256_cvtepu8_epi32(_mm_loadl_epi64((const __m128i *)(const void *)key_order));
    slots = _mm256_add_epi32(slots, _mm256_set1_epi32(slot));
    for (int j = 0; lanes_in(live, live); j++) {
        __m256i in = live, pixel = at;
        for (int i = 0; lanes_in(in, in); i++) {
            if (i + j > 0)
                list_add(list, lanes_in(in, in), pixel, slots);
            in = _mm256_and_si256(in, _mm256_cmpgt_epi32(last_x, _mm256_set1_epi32(i)));
            pixel = _mm256_add_epi32(pixel, _mm256_set1_epi32(1));
        }
        live = _mm256_and_si256(live, _mm256_cmpgt_epi32(last_y, _mm256_set1_epi32(j)));
        at = _mm256_add_epi32(at, _mm256_set1_epi32(stride));
    }
}

/* Eight texels of codes q, the first of which is number `slot` of the tile; low: their tags, inverted. */
static inline void draw8(const struct sv_crown_buffer *buffer, const struct texels *t, __m256i q, __m256i low,
                         int slot, struct list *list, struct bounds *bounds)
{
    __m256 code = _mm256_cvtepi32_ps(q), zero = _mm256_setzero_ps(), one = _mm256_set1_ps(1), p[4];
    for (int k = 0; k < 4; k++)
        p[k] = _mm256_add_ps(t->at[k], _mm256_mul_ps(code, t->dc[k]));
    __m256 inverse = _mm256_div_ps(one, p[3]), square = _mm256_mul_ps(inverse, inverse);
    __m256 x = _mm256_mul_ps(p[0], inverse), y = _mm256_mul_ps(p[1], inverse);
    __m256i d = _mm256_castps_si256(_mm256_mul_ps(p[2], inverse));
    __m256 away = _mm256_add_ps(absolute(x), absolute(y));
    __m256 drawn =
        _mm256_and_ps(_mm256_cmp_ps(p[3], zero, _CMP_GT_OQ), _mm256_cmp_ps(code, zero, _CMP_GT_OQ));
    drawn = _mm256_and_ps(drawn, in_order(away, _mm256_set1_ps(SV_CROWN_FAR_PX)));
    __m256i legal = _mm256_cmpeq_epi32(_mm256_min_epu32(d, _mm256_castps_si256(one)), d);
    drawn = _mm256_and_ps(drawn, _mm256_castsi256_ps(legal));
    struct span across = pixels_within(x, _mm256_mul_ps(t->spread_x, square), t->lo_x, t->hi_x);
    struct span along = pixels_within(y, _mm256_mul_ps(t->spread_y, square), t->lo_y, t->hi_y);
    drawn = _mm256_and_ps(drawn, _mm256_and_ps(across.some, along.some));
    __m256i live = _mm256_castps_si256(drawn);
    if (_mm256_testz_si256(live, live))
        return;
    uint32_t pixel[LANES];
    uint64_t *keys = list->keys + slot;
    bounds->x0 = _mm256_min_epi32(bounds->x0, _mm256_blendv_epi8(bounds->x0, across.first, live));
    bounds->x1 = _mm256_max_epi32(bounds->x1, _mm256_blendv_epi8(bounds->x1, across.last, live));
    bounds->y0 = _mm256_min_epi32(bounds->y0, _mm256_blendv_epi8(bounds->y0, along.first, live));
    bounds->y1 = _mm256_max_epi32(bounds->y1, _mm256_blendv_epi8(bounds->y1, along.last, live));
    __m256i at = _mm256_mullo_epi32(along.first, _mm256_set1_epi32(buffer->stride));
    at = _mm256_add_epi32(_mm256_add_epi32(at, across.first), _mm256_set1_epi32(buffer->origin));
    __m256i more = _mm256_or_si256(_mm256_cmpgt_epi32(across.last, across.first),
                                   _mm256_cmpgt_epi32(along.last, along.first));
    store_keys(d, low, t->epoch, keys);
    _mm256_storeu_si256((__m256i *)(void *)pixel,
                        _mm256_blendv_epi8(_mm256_set1_epi32(buffer->nowhere), at, live));
    for (int k = 0; k < LANES; k++)
        put(&buffer->keys[pixel[k]], keys[key_order[k]]);
    if (!lanes_in(live, more))
        return;
    list_boxes(list, buffer->stride, live, &across, &along, at, slot);
    if (list->count >= LIST)
        list_put(list, buffer->keys);
}

static void texels_set(const struct sv_crown_splat *s, const struct sv_crown_tile_at *at, struct texels *t)
{
    for (int k = 0; k < 4; k++)
        t->dc[k] = _mm256_set1_ps(s->dc[k]);
    t->spread_x = _mm256_set1_ps(at->spread_x);
    t->spread_y = _mm256_set1_ps(at->spread_y);
    t->lo_x = _mm256_set1_ps(s->lo_x);
    t->hi_x = _mm256_set1_ps(s->hi_x);
    t->lo_y = _mm256_set1_ps(s->lo_y);
    t->hi_y = _mm256_set1_ps(s->hi_y);
    t->epoch = _mm256_set1_epi32((int)(s->buffer->epoch >> 32));
}

static struct sv_crown_box tile_avx2(const struct sv_crown_splat *s, const struct sv_crown_tile_at *at)
{
    const __m256i lane = _mm256_setr_epi32(0, 1, 2, 3, 4, 5, 6, 7);
    struct list list;
    struct texels t;
    __m256 across[2][4];
    const __m256i none = _mm256_set1_epi32(INT32_MAX);
    struct bounds bounds = {none, _mm256_setzero_si256(), none, _mm256_setzero_si256()};
    list.count = 0;
    texels_set(s, at, &t);
    for (int g = 0; g < 2; g++) {
        __m256 i = _mm256_cvtepi32_ps(_mm256_add_epi32(lane, _mm256_set1_epi32(g * LANES)));
        for (int k = 0; k < 4; k++)
            across[g][k] = _mm256_mul_ps(i, _mm256_set1_ps(s->du[k]));
    }
    for (int j = 0; j < SV_PANEL_TILE; j++) {
        __m128 row = _mm_mul_ps(_mm_set1_ps((float)j), _mm_loadu_ps(s->dv));
        float first[4];
        _mm_storeu_ps(first, _mm_add_ps(_mm_loadu_ps(at->at), row));
        for (int g = 0; g < SV_PANEL_TILE / LANES; g++) {
            int slot = j * SV_PANEL_TILE + g * LANES;
            uint32_t texel = at->texel + (uint32_t)slot;
            __m256i q =
                _mm256_cvtepu16_epi32(_mm_loadu_si128((const __m128i *)(const void *)(s->layer->q + texel)));
            if (_mm256_testz_si256(q, q))
                continue;
            for (int k = 0; k < 4; k++)
                t.at[k] = _mm256_add_ps(_mm256_set1_ps(first[k]), across[g][k]);
            __m256i low =
                _mm256_sub_epi32(_mm256_set1_epi32((int)(SV_CROWN_TAG_MASK - s->tag - texel)), lane);
            draw8(s->buffer, &t, q, low, slot, &list, &bounds);
        }
    }
    list_put(&list, s->buffer->keys);
    const __m256i all = _mm256_set1_epi32(-1); /* the largest is the least, all bits turned */
    return (struct sv_crown_box){least_of(bounds.x0), ~least_of(_mm256_xor_si256(bounds.x1, all)),
                                 least_of(bounds.y0), ~least_of(_mm256_xor_si256(bounds.y1, all))};
}

/* ---- resolve ---- */

static inline __m256i load4(const uint64_t *keys)
{
    return _mm256_loadu_si256((const __m256i *)(const void *)keys);
}

/* Whether any pixel of the box and `reach` around it holds a key. */
static bool any_key(const struct sv_crown_buffer *buffer, int reach, int i0, int i1, int j0, int j1)
{
    __m256d any = _mm256_setzero_pd();
    for (int j = j0 - reach; j < j1 + reach; j++) {
        const uint64_t *keys = sv_crown_at(buffer, i0 - reach, j);
        for (int i = 0; i < i1 - i0 + 2 * reach; i += 4) /* rows have room for more than the apron */
            any = _mm256_max_pd(any, _mm256_castsi256_pd(load4(keys + i)));
    }
    __m256i epoch = _mm256_set1_epi64x((long long)buffer->epoch);
    return _mm256_movemask_epi8(_mm256_cmpgt_epi64(_mm256_castpd_si256(any), epoch)) != 0;
}

/* The largest of the keys around each of four pixels. Keys are positive and, as doubles, in the same order.
 */
static inline __m256i largest_around(const uint64_t *keys, ptrdiff_t stride, const int reach)
{
    __m256d best = _mm256_setzero_pd();
    for (int j = -reach; j <= reach; j++)
        for (int i = -reach; i <= reach; i++)
            best = _mm256_max_pd(best, _mm256_castsi256_pd(load4(keys + j * stride + i)));
    return _mm256_castpd_si256(best);
}

/* Four pixels' keys, or the nearest ones of the first square around each that has any. */
static inline __m256i shown_keys(const uint64_t *keys, ptrdiff_t stride, __m256i epoch, bool open)
{
    __m256i best = load4(keys), there = _mm256_cmpgt_epi64(best, epoch);
    if (!open || _mm256_movemask_epi8(there) == -1)
        return best;
    best = _mm256_blendv_epi8(largest_around(keys, stride, 1), best, there);
    there = _mm256_cmpgt_epi64(best, epoch);
    if (_mm256_movemask_epi8(there) == -1)
        return best;
    return _mm256_blendv_epi8(largest_around(keys, stride, SV_CROWN_REACH), best, there);
}

/* Eight pixels of one row: keys taken apart. */
struct shown {
    __m256i tag, any;
    __m256 d;
};

static inline __m256i even_words(__m256i low, __m256i high)
{
    __m256 v = _mm256_shuffle_ps(_mm256_castsi256_ps(low), _mm256_castsi256_ps(high), 0x88);
    return _mm256_permute4x64_epi64(_mm256_castps_si256(v), 0xd8);
}

static inline struct shown take_apart(__m256i low, __m256i high, __m256i epoch)
{
    __m256i tag = even_words(low, high), mask = _mm256_set1_epi32((int)SV_CROWN_TAG_MASK);
    __m256i d = even_words(_mm256_srli_epi64(low, SV_CROWN_DEPTH_SHIFT),
                           _mm256_srli_epi64(high, SV_CROWN_DEPTH_SHIFT));
    __m256i any = even_words(_mm256_cmpgt_epi64(low, epoch), _mm256_cmpgt_epi64(high, epoch));
    d = _mm256_and_si256(d, _mm256_set1_epi32(0x3fffffff));
    return (struct shown){_mm256_andnot_si256(tag, mask), any, _mm256_castsi256_ps(d)};
}

static inline __m256 clamp(__m256 v, __m256 hi) /* to [0, hi]; NaN: 0 */
{
    return _mm256_min_ps(_mm256_max_ps(v, _mm256_setzero_ps()), hi);
}

/* Where eight pixels lie on their panel: index of the upper left colour of four, weights between columns (two
 * 16-bit words) and rows. */
struct place {
    __m256i color, across;
    __m256 along;
};

/* Eight codes, in plain loads: gathers take several times as long. */
static inline __m256i load_codes(const uint16_t *q, const uint32_t texel[LANES])
{
    __m128i low = _mm_cvtsi32_si128(q[texel[0]]), high = _mm_cvtsi32_si128(q[texel[4]]);
    low = _mm_insert_epi16(low, q[texel[1]], 2);
    high = _mm_insert_epi16(high, q[texel[5]], 2);
    low = _mm_insert_epi16(low, q[texel[2]], 4);
    high = _mm_insert_epi16(high, q[texel[6]], 4);
    low = _mm_insert_epi16(low, q[texel[3]], 6);
    high = _mm_insert_epi16(high, q[texel[7]], 6);
    return _mm256_set_m128i(high, low);
}

/* Slots of eight tiles: a tile's last 16 bits. */
static inline __m256i slots_of(const struct sv_panel_layer *layer, __m256i tile)
{
    const int *words = (const int *)(const void *)layer->tiles;
    tile = _mm256_i32gather_epi32(words + 1, tile, sizeof *layer->tiles);
    return _mm256_min_epu32(_mm256_srli_epi32(tile, 16), _mm256_set1_epi32((int)layer->last_slot));
}

/* Index of the colours of texels (i, j). */
static inline __m256i colors_at(const struct sv_crown_inverse *s, __m256i i, __m256i j)
{
    const __m256i inner = _mm256_set1_epi32(SV_PANEL_TILE - 1);
    __m256i tile = _mm256_mullo_epi32(_mm256_srli_epi32(j, 4), _mm256_set1_epi32(s->side));
    tile = _mm256_add_epi32(tile, _mm256_srli_epi32(i, 4));
    i = _mm256_and_si256(i, inner);
    j = _mm256_and_si256(j, inner);
    __m256i at = _mm256_add_epi32(_mm256_mullo_epi32(j, _mm256_set1_epi32(SV_PANEL_SLOT_SIDE)), i);
    __m256i first = _mm256_mullo_epi32(slots_of(s->layer, tile), _mm256_set1_epi32(SV_PANEL_SLOT_COLORS));
    return _mm256_add_epi32(first, at);
}

static inline __m256 steepen(const struct sv_crown_inverse *s, __m256 weight)
{
    __m256 w = _mm256_sub_ps(_mm256_mul_ps(weight, _mm256_set1_ps(s->steep)), _mm256_set1_ps(s->early));
    return clamp(w, _mm256_set1_ps(1));
}

static inline struct place locate(const struct sv_crown_inverse *s, __m256i texel, __m256 x, __m256 y)
{
    uint32_t texels[LANES];
    _mm256_storeu_si256((__m256i *)(void *)texels, texel);
    __m256 c = _mm256_cvtepi32_ps(load_codes(s->layer->q, texels)), p[3];
    for (int k = 0; k < 3; k++)
        p[k] =
            _mm256_add_ps(_mm256_add_ps(_mm256_set1_ps(s->at[k]), _mm256_mul_ps(x, _mm256_set1_ps(s->dx[k]))),
                          _mm256_mul_ps(y, _mm256_set1_ps(s->dy[k])));
    __m256 one = _mm256_set1_ps(1), inverse = _mm256_div_ps(one, p[2]);
    __m256 along = _mm256_add_ps(one, _mm256_mul_ps(c, _mm256_set1_ps(s->gw)));
    __m256 u = _mm256_mul_ps(_mm256_mul_ps(p[0], inverse), along);
    __m256 v = _mm256_mul_ps(_mm256_mul_ps(p[1], inverse), along);
    u = _mm256_add_ps(_mm256_add_ps(u, _mm256_mul_ps(c, _mm256_set1_ps(s->gu))), _mm256_set1_ps(s->middle));
    v = _mm256_add_ps(_mm256_add_ps(v, _mm256_mul_ps(c, _mm256_set1_ps(s->gv))), _mm256_set1_ps(s->middle));
    u = clamp(u, _mm256_set1_ps(s->last));
    v = clamp(v, _mm256_set1_ps(s->last));
    __m256i last = _mm256_set1_epi32(s->layer->size - 2);
    __m256i i = _mm256_min_epi32(_mm256_cvttps_epi32(u), last),
            j = _mm256_min_epi32(_mm256_cvttps_epi32(v), last);
    __m256 fu = steepen(s, _mm256_sub_ps(u, _mm256_cvtepi32_ps(i)));
    __m256i w = _mm256_cvttps_epi32(_mm256_mul_ps(fu, _mm256_set1_ps(256)));
    struct place place;
    place.color = colors_at(s, i, j);
    place.across = _mm256_or_si256(_mm256_slli_epi32(w, 16), _mm256_sub_epi32(_mm256_set1_epi32(256), w));
    place.along = steepen(s, _mm256_sub_ps(v, _mm256_cvtepi32_ps(j)));
    return place;
}

/* Two pixels' neighbours in one row, blended: four floats each. */
static inline __m256 blend_row(const uint8_t (*a)[4], const uint8_t (*b)[4], __m256i across)
{
    const __m128i pairs = _mm_setr_epi8(0, 4, 1, 5, 2, 6, 3, 7, 8, 12, 9, 13, 10, 14, 11, 15);
    __m128 left = _mm_castsi128_ps(_mm_loadl_epi64((const __m128i *)(const void *)a));
    __m128i bytes = _mm_castps_si128(_mm_loadh_pi(left, (const __m64 *)(const void *)b));
    __m256i c = _mm256_cvtepu8_epi16(_mm_shuffle_epi8(bytes, pairs));
    __m256i by = _mm256_blend_epi16(c, _mm256_set1_epi16(255), 0xc0);
    c = _mm256_xor_si256(_mm256_mullo_epi16(c, by), _mm256_set1_epi16((short)SV_CROWN_BIAS));
    return _mm256_cvtepi32_ps(_mm256_madd_epi16(c, across));
}

/* Pixels 2 k and 2 k + 1 of eight. */
static inline __m256 blend2(const struct sv_panel_layer *layer, const struct place *place,
                            const uint32_t *colors, __m256i pair)
{
    const uint8_t(*upper)[4] = layer->color, (*lower)[4] = layer->color + SV_PANEL_SLOT_SIDE;
    __m256i across = _mm256_permutevar8x32_epi32(place->across, pair);
    __m256 along = _mm256_permutevar8x32_ps(place->along, pair);
    __m256 top = blend_row(upper + colors[0], upper + colors[1], across);
    __m256 low = blend_row(lower + colors[0], lower + colors[1], across);
    __m256 mean = _mm256_add_ps(top, _mm256_mul_ps(along, _mm256_sub_ps(low, top)));
    return _mm256_add_ps(mean, _mm256_set1_ps(SV_CROWN_BIAS * 256.0f));
}

/* Composes the chosen of eight pixels, all of one source. */
static inline void compose(const struct sv_crown_inverse *s, __m256i texel, __m256i chosen, __m256 x,
                           __m256 y, float (*light)[4])
{
    const float one = 1 / SV_CROWN_UNIT;
    const __m256 unit = _mm256_setr_ps(one, one, one, -one, one, one, one, -one);
    uint32_t colors[LANES];
    texel = _mm256_and_si256(texel, chosen);
    struct place place = locate(s, texel, x, y);
    _mm256_storeu_si256((__m256i *)(void *)colors, place.color);
    unsigned mask = (unsigned)_mm256_movemask_ps(_mm256_castsi256_ps(chosen));
    for (int k = 0; k < LANES / 2; k++) {
        if (!(mask >> 2 * k & 3))
            continue;
        __m256i pair = _mm256_add_epi32(_mm256_setr_epi32(0, 0, 0, 0, 1, 1, 1, 1), _mm256_set1_epi32(2 * k));
        __m256 out = blend2(s->layer, &place, colors + 2 * k, pair);
        __m256 l = _mm256_loadu_ps(light[2 * k]), pass = _mm256_mul_ps(_mm256_permute_ps(l, 0xff), unit);
        out = _mm256_add_ps(l, _mm256_mul_ps(pass, out));
        if ((mask >> 2 * k & 3) != 3)
            out = _mm256_blendv_ps(l, out, _mm256_castsi256_ps(_mm256_permutevar8x32_epi32(chosen, pair)));
        _mm256_storeu_ps(light[2 * k], out);
    }
}

/* What passes at eight pixels. */
static inline __m256 passing(float (*light)[4])
{
    __m256 a = _mm256_loadu_ps(light[0]), b = _mm256_loadu_ps(light[2]);
    __m256 c = _mm256_loadu_ps(light[4]), d = _mm256_loadu_ps(light[6]);
    __m256 ab = _mm256_unpackhi_ps(a, b), cd = _mm256_unpackhi_ps(c, d); /* b0 b2 a0 a2 | b1 b3 a1 a3 */
    __m256 v = _mm256_shuffle_ps(ab, cd, 0xee);                          /* 0 2 4 6 | 1 3 5 7 */
    return _mm256_permutevar8x32_ps(v, _mm256_setr_epi32(0, 4, 1, 5, 2, 6, 3, 7));
}

static inline unsigned open_of(float (*light)[4])
{
    __m256 open = _mm256_cmp_ps(passing(light), _mm256_set1_ps(SV_CROWN_PASS_MIN), _CMP_GE_OQ);
    return (unsigned)_mm256_movemask_ps(open);
}

static inline __m256i lanes_of(unsigned mask)
{
    const __m256i bit = _mm256_setr_epi32(1, 2, 4, 8, 16, 32, 64, 128);
    return _mm256_cmpeq_epi32(_mm256_and_si256(_mm256_set1_epi32((int)mask), bit), bit);
}

static inline unsigned over(__m256i keys, __m256i epoch)
{
    return (unsigned)_mm256_movemask_pd(_mm256_castsi256_pd(_mm256_cmpgt_epi64(keys, epoch)));
}

/* Of eight pixels that no texel covers, those that show what their neighbours' keys have there. */
static unsigned fills(const struct sv_crown_resolve *r, unsigned mask, __m256i low, __m256i high, int i,
                      int j)
{
    uint64_t keys[LANES];
    unsigned shown = 0;
    _mm256_storeu_si256((__m256i *)(void *)keys, low);
    _mm256_storeu_si256((__m256i *)(void *)(keys + 4), high);
    for (; mask; mask &= mask - 1) {
        int k = __builtin_ctz(mask);
        shown |= (unsigned)sv_crown_fills(r, keys[k], i + k, j) << k;
    }
    return shown;
}

/* What opens at those of eight pixels that show nothing so far. */
static void look_around(const struct sv_crown_resolve *r, const uint64_t *own, unsigned bare, int i, int j)
{
    const __m256i epoch = _mm256_set1_epi64x((long long)r->buffer->epoch);
    uint64_t first[SV_CROWN_WAYS][LANES];
    unsigned any = 0;
    for (int way = 0; way < SV_CROWN_WAYS; way++) {
        ptrdiff_t step = sv_crown_ways[way][1] * (ptrdiff_t)r->buffer->stride + sv_crown_ways[way][0];
        __m256i low = _mm256_setzero_si256(), high = low;
        for (int n = SV_CROWN_OPEN; n > 0; n--) {
            __m256i a = load4(own + n * step), b = load4(own + n * step + 4);
            low = _mm256_blendv_epi8(low, a, _mm256_cmpgt_epi64(a, epoch));
            high = _mm256_blendv_epi8(high, b, _mm256_cmpgt_epi64(b, epoch));
        }
        any |= over(low, epoch) | over(high, epoch) << 4;
        _mm256_storeu_si256((__m256i *)(void *)first[way], low);
        _mm256_storeu_si256((__m256i *)(void *)(first[way] + 4), high);
    }
    for (bare &= any; bare; bare &= bare - 1) {
        int lane = __builtin_ctz(bare);
        uint64_t keys[SV_CROWN_WAYS];
        for (int way = 0; way < SV_CROWN_WAYS; way++)
            keys[way] = first[way][lane];
        sv_crown_show_behind(r, keys, i + lane, j);
    }
}

/* Eight pixels from (i, j) of the band on; returns whether they are done. */
static inline bool draw_pixels(const struct sv_crown_resolve *r, int i, int j)
{
    struct sv_crown_buffer *buffer = r->buffer;
    size_t p = (size_t)j * (size_t)buffer->width + (size_t)i;
    float(*light)[4] = r->light + (p - r->skip);
    unsigned open = open_of(light);
    if (open == 0)
        return true;
    const uint64_t *keys = sv_crown_at(buffer, i, j);
    __m256i epoch = _mm256_set1_epi64x((long long)buffer->epoch);
    __m256i low = shown_keys(keys, buffer->stride, epoch, open & 15);
    __m256i high = shown_keys(keys + 4, buffer->stride, epoch, open >> 4);
    struct shown shown = take_apart(low, high, epoch);
    unsigned mask = open & (unsigned)_mm256_movemask_ps(_mm256_castsi256_ps(shown.any));
    if (mask && r->depth) {
        __m256 limit = _mm256_mul_ps(_mm256_loadu_ps(r->depth + p), _mm256_set1_ps(r->keep));
        mask &= ~(unsigned)_mm256_movemask_ps(_mm256_cmp_ps(shown.d, limit, _CMP_LT_OQ));
    }
    unsigned covered = over(load4(keys), epoch) | over(load4(keys + 4), epoch) << 4, empty = mask & ~covered;
    if (empty)
        mask ^= empty ^ fills(r, empty, low, high, i, j);
    if (r->opens && (open & ~mask & ~covered))
        look_around(r, keys, open & ~mask & ~covered, i, j);
    if (mask == 0)
        return open_of(light) == 0;
    __m256i number = _mm256_srli_epi32(shown.tag, SV_CROWN_TEXEL_BITS), left = lanes_of(mask);
    __m256i texel = _mm256_and_si256(shown.tag, _mm256_set1_epi32((int)SV_CROWN_TEXEL_MASK));
    __m256 x = _mm256_add_ps(_mm256_set1_ps((float)i), _mm256_setr_ps(0, 1, 2, 3, 4, 5, 6, 7));
    __m256 y = _mm256_set1_ps((float)(buffer->row_first + j));
    uint32_t numbers[LANES];
    _mm256_storeu_si256((__m256i *)(void *)numbers, number);
    while (mask) { /* source by source: two where faces meet */
        uint32_t k = numbers[__builtin_ctz(mask)];
        __m256i chosen = _mm256_and_si256(left, _mm256_cmpeq_epi32(number, _mm256_set1_epi32((int)k)));
        if (r->sources[k].legal)
            compose(&r->sources[k], texel, chosen, x, y, light);
        mask &= ~(unsigned)_mm256_movemask_ps(_mm256_castsi256_ps(chosen));
    }
    return open_of(light) == 0;
}

static bool block_avx2(const struct sv_crown_resolve *r, int i0, int i1, int j0, int j1)
{
    bool done = true;
    int whole = i0 + (i1 - i0) / LANES * LANES;
    if (!any_key(r->buffer, r->opens ? SV_CROWN_OPEN : SV_CROWN_REACH, i0, i1, j0, j1))
        return false;
    for (int j = j0; j < j1; j++)
        for (int i = i0; i < whole; i += LANES)
            done &= draw_pixels(r, i, j);
    if (whole < i1)
        done &= sv_crown_scalar.block(r, whole, i1, j0, j1);
    return done;
}

const struct sv_crown_kernel sv_crown_avx2 = {tile_avx2, block_avx2};
