/* crown_warp_scalar.c - the kernels of crown_warp.h in plain loops: the reference. */
#include <math.h>

#include "core/cell/crown_warp_kernel.h"

const struct sv_crown_kernel sv_crown_scalar = {sv_crown_tile_scalar, sv_crown_row_scalar};

/* ---- splat ---- */

/* Pixels of one axis whose centres are within `half` of x: first, and how many (0 or less: none). */
static int pixels_within(float x, float half, float lo, float hi, int *first)
{
    float centre = x - 0.5f, a = ceilf(centre - half), b = floorf(centre + half);
    a = a > lo ? a : lo;
    b = b < hi ? b : hi;
    float count = b - a + 1;
    *first = count > 0 ? (int)a : 0;
    return count > 0 ? (int)count : 0;
}

/* Half a box: of the texel's square, grown, no more than SV_CROWN_HALF_MAX. */
static float half_box(const struct sv_crown_splat *s, int row, float x, float inverse)
{
    float across = fabsf((s->hu[row] - x * s->hu[3]) * inverse);
    float along = fabsf((s->hv[row] - x * s->hv[3]) * inverse);
    float half = (across + along) + SV_CROWN_GROW;
    return half < SV_CROWN_HALF_MAX ? half : SV_CROWN_HALF_MAX;
}

static void put_texel(const struct sv_crown_splat *s, const float p[4], uint32_t tag)
{
    float inverse = 1.0f / p[3], x = p[0] * inverse, y = p[1] * inverse, d = p[2] * inverse;
    if (!(p[3] > 0 && d >= 0 && d <= 1 && fabsf(x) <= SV_CROWN_FAR_PX && fabsf(y) <= SV_CROWN_FAR_PX))
        return;
    int i0, j0, nx = pixels_within(x, half_box(s, 0, x, inverse), s->lo_x, s->hi_x, &i0);
    int ny = pixels_within(y, half_box(s, 1, y, inverse), s->lo_y, s->hi_y, &j0);
    if (nx <= 0 || ny <= 0)
        return;
    uint64_t key = sv_crown_key(s->buffer->epoch, sv_crown_bits(d + 0.0f), tag);
    for (int j = 0; j < ny; j++) {
        uint64_t *keys = s->buffer->keys + sv_crown_at(s->buffer, i0, j0 + j);
        for (int i = 0; i < nx; i++)
            keys[i] = key > keys[i] ? key : keys[i];
    }
}

void sv_crown_tile_scalar(const struct sv_crown_splat *s, int tx, int ty)
{
    int size = s->layer->size, i0 = tx * SV_PANEL_TILE, j0 = ty * SV_PANEL_TILE;
    int n = size - i0 < SV_PANEL_TILE ? size - i0 : SV_PANEL_TILE;
    int rows = size - j0 < SV_PANEL_TILE ? size - j0 : SV_PANEL_TILE;
    double xs = (2.0 * i0 + 1) / size - 1, ys = 1 - (2.0 * j0 + 1) / size;
    float at[4];
    for (int k = 0; k < 4; k++)
        at[k] = (float)(s->m[k][0] * xs + s->m[k][1] * ys + s->m[k][3]);
    for (int j = 0; j < rows; j++) {
        size_t first = (size_t)(j0 + j) * (size_t)size + (size_t)i0;
        for (int i = 0; i < n; i++) {
            uint16_t code = s->layer->q[first + (size_t)i];
            float p[4];
            if (code == 0)
                continue;
            for (int k = 0; k < 4; k++)
                p[k] = ((at[k] + (float)j * s->dv[k]) + (float)i * s->du[k]) + (float)code * s->dc[k];
            put_texel(s, p, s->tag + (uint32_t)first + (uint32_t)i);
        }
    }
}

/* ---- resolve ---- */

/* The key of what a pixel shows, 0 for nothing: its own, or the farthest of its neighbours'. */
static uint64_t shown_key(const struct sv_crown_buffer *buffer, size_t at)
{
    const uint64_t *keys = buffer->keys;
    if (keys[at] > buffer->epoch)
        return keys[at];
    uint64_t best = UINT64_MAX;
    for (int j = -1; j <= 1; j++)
        for (int i = -1; i <= 1; i++) {
            uint64_t key = keys[(ptrdiff_t)at + j * buffer->stride + i];
            best = key > buffer->epoch && key < best ? key : best;
        }
    return best == UINT64_MAX ? 0 : best;
}

static float clamp(float v, float lo, float hi) /* NaN: lo */
{
    v = v > lo ? v : lo;
    return v < hi ? v : hi;
}

/* Premultiplied linear colour and coverage between four texels, each times 255 * 255 * 256. */
static void blend(const struct sv_panel_layer *layer, float u, float v, float out[4])
{
    int last = layer->size - 2, i = (int)u, j = (int)v;
    i = i < last ? i : last;
    j = j < last ? j : last;
    int wu = (int)((u - (float)i) * 256);
    float fv = v - (float)j;
    const uint8_t(*t)[4] = layer->color + (size_t)j * (size_t)layer->size + (size_t)i;
    const uint8_t(*b)[4] = t + layer->size;
    for (int c = 0; c < 4; c++) {
        int top = t[0][c] * (c < 3 ? t[0][c] : 255) * (256 - wu) + t[1][c] * (c < 3 ? t[1][c] : 255) * wu;
        int low = b[0][c] * (c < 3 ? b[0][c] : 255) * (256 - wu) + b[1][c] * (c < 3 ? b[1][c] : 255) * wu;
        out[c] = (float)top + fv * ((float)low - (float)top);
    }
}

/* A key's texel seen through the pixel (x, y) of the picture, composed under what has been gathered. */
static void show(const struct sv_crown_resolve *r, uint64_t key, float x, float y, float light[4])
{
    uint32_t tag = ((uint32_t)key & SV_CROWN_TAG_MASK) ^ SV_CROWN_TAG_MASK;
    const struct sv_crown_inverse *s = &r->sources[tag >> SV_CROWN_TEXEL_BITS];
    if (!s->legal)
        return;
    float code = (float)s->layer->q[tag & SV_CROWN_TEXEL_MASK], p[3], out[4];
    for (int k = 0; k < 3; k++)
        p[k] = (s->at[k] + x * s->dx[k]) + y * s->dy[k];
    float inverse = 1.0f / p[2], along = 1 + code * s->gw;
    float u = ((p[0] * inverse) * along + code * s->gu) + s->middle;
    float v = ((p[1] * inverse) * along + code * s->gv) + s->middle;
    blend(s->layer, clamp(u, 0, s->last), clamp(v, 0, s->last), out);
    float pass = light[3] * (1.0f / (255 * 255 * 256));
    for (int c = 0; c < 3; c++)
        light[c] += pass * out[c];
    light[3] -= pass * out[3];
}

bool sv_crown_row_scalar(const struct sv_crown_resolve *r, int row, int first, int last)
{
    struct sv_crown_buffer *buffer = r->buffer;
    bool done = true;
    for (int i = first; i < last; i++) {
        size_t p = (size_t)row * (size_t)buffer->width + (size_t)i;
        float *light = r->light[p];
        if (!(light[3] >= SV_CROWN_PASS_MIN))
            continue;
        uint64_t key = shown_key(buffer, sv_crown_at(buffer, i, buffer->row_first + row));
        uint32_t bits = (uint32_t)(key >> SV_CROWN_DEPTH_SHIFT) & 0x3fffffff;
        float d;
        memcpy(&d, &bits, sizeof d);
        if (key && !(r->depth && d < r->depth[p] * r->keep))
            show(r, key, (float)i, (float)(buffer->row_first + row), light);
        done &= !(light[3] >= SV_CROWN_PASS_MIN);
    }
    return done;
}
