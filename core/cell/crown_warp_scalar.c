/* crown_warp_scalar.c - the kernels of crown_warp.h in plain loops: the reference. */
#include <math.h>

#include "core/cell/crown_warp_kernel.h"

/* ---- splat ---- */

/* Pixels of one axis whose centres are within `half` and SV_CROWN_GROW of x. */
static void pixels_within(float x, float half, float lo, float hi, float *first, float *last)
{
    float centre = x - 0.5f;
    half += SV_CROWN_GROW;
    half = half < SV_CROWN_HALF_MAX ? half : SV_CROWN_HALF_MAX;
    float a = ceilf(centre - half), b = floorf(centre + half);
    *first = a > lo ? a : lo;
    *last = b < hi ? b : hi;
}

static void box_add(struct sv_crown_box *box, int x0, int x1, int y0, int y1)
{
    bool none = box->x1 < box->x0;
    box->x0 = none || x0 < box->x0 ? x0 : box->x0;
    box->x1 = none || x1 > box->x1 ? x1 : box->x1;
    box->y0 = none || y0 < box->y0 ? y0 : box->y0;
    box->y1 = none || y1 > box->y1 ? y1 : box->y1;
}

static void put_texel(const struct sv_crown_splat *s, const struct sv_crown_tile_at *at, const float p[4],
                      uint32_t tag, struct sv_crown_box *box)
{
    float inverse = 1.0f / p[3], square = inverse * inverse;
    float x = p[0] * inverse, y = p[1] * inverse, d = p[2] * inverse, i0, i1, j0, j1;
    if (!(p[3] > 0 && sv_crown_bits(d) <= sv_crown_bits(1) && fabsf(x) + fabsf(y) <= SV_CROWN_FAR_PX))
        return;
    pixels_within(x, at->spread_x * square, s->lo_x, s->hi_x, &i0, &i1);
    pixels_within(y, at->spread_y * square, s->lo_y, s->hi_y, &j0, &j1);
    if (!(i0 <= i1 && j0 <= j1))
        return;
    box_add(box, (int)i0, (int)i1, (int)j0, (int)j1);
    uint64_t key = sv_crown_key(s->buffer->epoch, sv_crown_bits(d), tag);
    for (int j = (int)j0; j <= (int)j1; j++) {
        uint64_t *keys = s->buffer->keys + s->buffer->origin + (ptrdiff_t)j * s->buffer->stride;
        for (int i = (int)i0; i <= (int)i1; i++)
            keys[i] = key > keys[i] ? key : keys[i];
    }
}

static struct sv_crown_box draw_tile(const struct sv_crown_splat *s, const struct sv_crown_tile_at *at)
{
    struct sv_crown_box box = {0, -1, 0, -1};
    for (int j = 0; j < SV_PANEL_TILE; j++)
        for (int i = 0; i < SV_PANEL_TILE; i++) {
            uint32_t texel = at->texel + (uint32_t)(j * SV_PANEL_TILE + i);
            uint16_t code = s->layer->q[texel];
            float p[4];
            if (code == 0)
                continue;
            for (int k = 0; k < 4; k++)
                p[k] = ((at->at[k] + (float)j * s->dv[k]) + (float)i * s->du[k]) + (float)code * s->dc[k];
            put_texel(s, at, p, s->tag + texel, &box);
        }
    return box;
}

/* ---- resolve ---- */

/* The key of what a pixel shows: its own, or the nearest one of the first square around it that has any; not
 * above the epoch: nothing. */
static uint64_t shown_key(const struct sv_crown_buffer *buffer, const uint64_t *own)
{
    uint64_t best = *own;
    for (int reach = 1; reach <= SV_CROWN_REACH && best <= buffer->epoch; reach++)
        for (int j = -reach; j <= reach; j++)
            for (int i = -reach; i <= reach; i++) {
                uint64_t key = own[j * buffer->stride + i];
                best = key > best ? key : best;
            }
    return best;
}

static float clamp(float v, float lo, float hi) /* NaN: lo */
{
    v = v > lo ? v : lo;
    return v < hi ? v : hi;
}

static float steepen(const struct sv_crown_inverse *s, float weight)
{
    return clamp(weight * s->steep - s->early, 0, 1);
}

static int linear_of(uint8_t code, int channel) /* 255 * 255: all */
{
    return code * (channel < 3 ? code : 255) - SV_CROWN_BIAS;
}

/* Premultiplied linear colour and coverage between four texels, times SV_CROWN_UNIT. */
static void blend(const struct sv_crown_inverse *s, float u, float v, float out[4])
{
    const struct sv_panel_layer *layer = s->layer;
    int last = layer->size - 2, i = (int)u, j = (int)v;
    i = i < last ? i : last;
    j = j < last ? j : last;
    int wu = (int)(steepen(s, u - (float)i) * 256);
    float fv = steepen(s, v - (float)j);
    const uint8_t(*t)[4] = (const uint8_t(*)[4])(const void *)sv_panel_color(layer, i, j);
    const uint8_t(*b)[4] = t + SV_PANEL_SLOT_SIDE;
    for (int c = 0; c < 4; c++) {
        float top = (float)(linear_of(t[0][c], c) * (256 - wu) + linear_of(t[1][c], c) * wu);
        float low = (float)(linear_of(b[0][c], c) * (256 - wu) + linear_of(b[1][c], c) * wu);
        out[c] = (top + fv * (low - top)) + SV_CROWN_BIAS * 256.0f;
    }
}

struct sv_crown_place sv_crown_locate(const struct sv_crown_resolve *r, uint64_t key, float x, float y)
{
    uint32_t tag = ((uint32_t)key & SV_CROWN_TAG_MASK) ^ SV_CROWN_TAG_MASK;
    const struct sv_crown_inverse *s = &r->sources[tag >> SV_CROWN_TEXEL_BITS];
    if (!s->legal)
        return (struct sv_crown_place){NULL, 0, 0, 0, 0};
    uint32_t texel = tag & SV_CROWN_TEXEL_MASK;
    float code = (float)s->layer->q[texel], p[3];
    for (int k = 0; k < 3; k++)
        p[k] = (s->at[k] + x * s->dx[k]) + y * s->dy[k];
    float inverse = 1.0f / p[2], along = 1 + code * s->gw;
    float u = ((p[0] * inverse) * along + code * s->gu) + s->middle;
    float v = ((p[1] * inverse) * along + code * s->gv) + s->middle;
    return (struct sv_crown_place){s, texel, code, clamp(u, 0, s->last), clamp(v, 0, s->last)};
}

/* Whether keys lie above, below, left and right of a pixel. */
static bool is_amid(const struct sv_crown_buffer *buffer, const uint64_t *own)
{
    unsigned sides = 0;
    for (int j = -SV_CROWN_REACH; j <= SV_CROWN_REACH; j++)
        for (int i = -SV_CROWN_REACH; i <= SV_CROWN_REACH; i++)
            if (own[j * buffer->stride + i] > buffer->epoch)
                sides |= (unsigned)(j < 0) | (unsigned)(j > 0) << 1 | (unsigned)(i < 0) << 2 |
                         (unsigned)(i > 0) << 3;
    return sides == 15;
}

bool sv_crown_fills(const struct sv_crown_resolve *r, uint64_t key, int i, int j)
{
    struct sv_crown_place at = sv_crown_locate(r, key, (float)i, (float)(r->buffer->row_first + j));
    if (!at.source)
        return false;
    float code = (float)sv_panel_code(at.source->layer, (int)(at.u + 0.5f), (int)(at.v + 0.5f));
    return code == 0 || fabsf(code - at.code) <= SV_CROWN_SAME * at.code ||
           is_amid(r->buffer, sv_crown_at(r->buffer, i, j));
}

/* A key's texel seen through the pixel (x, y) of the picture, composed under what has been gathered. */
static void show(const struct sv_crown_resolve *r, uint64_t key, float x, float y, float light[4])
{
    struct sv_crown_place at = sv_crown_locate(r, key, x, y);
    float out[4];
    if (!at.source)
        return;
    blend(at.source, at.u, at.v, out);
    float pass = light[3] * (1 / SV_CROWN_UNIT);
    for (int c = 0; c < 3; c++)
        light[c] += pass * out[c];
    light[3] -= pass * out[3];
}

/* What opens at a pixel that shows nothing so far. */
static void look_around(const struct sv_crown_resolve *r, const uint64_t *own, int i, int j)
{
    uint64_t keys[SV_CROWN_WAYS];
    for (int way = 0; way < SV_CROWN_WAYS; way++) {
        ptrdiff_t step = sv_crown_ways[way][1] * (ptrdiff_t)r->buffer->stride + sv_crown_ways[way][0];
        int n = 1;
        while (n < SV_CROWN_OPEN && own[n * step] <= r->buffer->epoch)
            n++;
        keys[way] = own[n * step];
    }
    sv_crown_show_behind(r, keys, i, j);
}

static bool draw_block(const struct sv_crown_resolve *r, int i0, int i1, int j0, int j1)
{
    struct sv_crown_buffer *buffer = r->buffer;
    bool done = true;
    for (int j = j0; j < j1; j++)
        for (int i = i0; i < i1; i++) {
            size_t p = (size_t)j * (size_t)buffer->width + (size_t)i;
            float *light = r->light[p - r->skip];
            if (!(light[3] >= SV_CROWN_PASS_MIN))
                continue;
            const uint64_t *own = sv_crown_at(buffer, i, j);
            uint64_t key = shown_key(buffer, own);
            bool covered = *own > buffer->epoch;
            if (key > buffer->epoch && !(r->depth && sv_crown_depth(key) < r->depth[p] * r->keep) &&
                (covered || sv_crown_fills(r, key, i, j)))
                show(r, key, (float)i, (float)(buffer->row_first + j), light);
            else if (r->opens && !covered)
                look_around(r, own, i, j);
            done &= !(light[3] >= SV_CROWN_PASS_MIN);
        }
    return done;
}

const struct sv_crown_kernel sv_crown_scalar = {draw_tile, draw_block};
