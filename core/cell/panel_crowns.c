/* panel_crowns.c - crowns of a panel out of a drawn canvas: decode, mean, codes; unknown q from neighbours.
 * One pass each, row by row, in plain loops that compilers turn into vectors. */
#include "core/cell/panel.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "core/base/color.h"

static inline uint16_t code_of_q(float q)
{
    float code = q * SV_PANEL_Q_ONE + 0.5f;
    return (uint16_t)(code < 1 ? 1 : code > 65535 ? 65535 : code);
}

/* A pixel's q, or 0 where it is unknown. */
static inline float q_of(const struct sv_panel_drawing *drawing, float q_per_depth, size_t pixel)
{
    float d = drawing->depth[pixel];
    bool known = d > 0 && !(drawing->opaque && drawing->opaque[pixel] == d);
    return known ? d * q_per_depth : 0;
}

/* One pixel a texel: a table of codes. Returns how many texels show something of unknown q. */
static size_t take_row(const struct sv_panel_drawing *drawing, const uint8_t root[256], int row,
                       const struct sv_panel_room *room)
{
    size_t unknown = 0, first = (size_t)row * (size_t)room->size;
    const uint8_t *from = drawing->color + 4 * first;
    float q_per_depth = (float)drawing->q_per_depth;
    memset(room->color + first, 0, (size_t)room->size * 4);
    memset(room->q + first, 0, (size_t)room->size * sizeof *room->q);
    for (int i = 0; i < room->size; i++) {
        const uint8_t *p = from + 4 * i;
        if (p[3] == 0)
            continue;
        uint8_t *c = room->color[first + (size_t)i];
        float q = q_of(drawing, q_per_depth, first + (size_t)i);
        for (int k = 0; k < 3; k++)
            c[k] = root[p[k]];
        c[3] = p[3];
        room->q[first + (size_t)i] = q > 0 ? code_of_q(q) : 0;
        unknown += !(q > 0);
    }
    return unknown;
}

/* The mean of scale x scale pixels, the first of which is `pixel`; true when it shows something of unknown q.
 */
static inline bool mean_texel(const struct sv_panel_drawing *drawing, const int scale, size_t pixel,
                              size_t stride, uint8_t color[4], uint16_t *code)
{
    float sum[3] = {0, 0, 0}, q_sum = 0, q_weight = 0, q_per_depth = (float)drawing->q_per_depth;
    const float area = (float)(scale * scale);
    unsigned covered = 0;
    memset(color, 0, 4);
    *code = 0;
    for (int k = 0; k < scale * scale; k++)
        covered += drawing->color[4 * (pixel + (size_t)(k / scale) * stride + (size_t)(k % scale)) + 3];
    unsigned a = (covered + (unsigned)(scale * scale) / 2) / (unsigned)(scale * scale);
    if (a == 0)
        return false;
    for (int k = 0; k < scale * scale; k++) {
        size_t at = pixel + (size_t)(k / scale) * stride + (size_t)(k % scale);
        const uint8_t *p = drawing->color + 4 * at;
        float q = q_of(drawing, q_per_depth, at), weight = q > 0 ? p[3] : 0;
        for (int c = 0; c < 3; c++)
            sum[c] += sv_linear_from_srgb8[p[c]];
        q_sum += q * weight;
        q_weight += weight;
    }
    for (int c = 0; c < 3; c++)
        color[c] = (uint8_t)(255 * sqrtf(fminf(sum[c] / area, 1)) + 0.5f);
    color[3] = (uint8_t)a;
    if (q_weight > 0)
        *code = code_of_q(q_sum / q_weight);
    return !(q_weight > 0);
}

static size_t mean_row(const struct sv_panel_drawing *drawing, int row, const struct sv_panel_room *room)
{
    size_t scale = (size_t)drawing->scale, size = (size_t)room->size, unknown = 0;
    for (size_t i = 0; i < size; i++) {
        size_t texel = (size_t)row * size + i, pixel = ((size_t)row * scale * size + i) * scale;
        if (scale == 2) /* the usual one, unrolled */
            unknown += mean_texel(drawing, 2, pixel, 2 * size, room->color[texel], &room->q[texel]);
        else
            unknown +=
                mean_texel(drawing, drawing->scale, pixel, scale * size, room->color[texel], &room->q[texel]);
    }
    return unknown;
}

/* The largest code on the square of `reach` texels around (i, j), 0 where none is known. */
static uint16_t largest_around(const uint16_t *q, int size, int i, int j, int reach)
{
    uint16_t best = 0;
    for (int y = j - reach; y <= j + reach; y++) {
        bool whole = y == j - reach || y == j + reach;
        for (int x = i - reach; x <= i + reach && y >= 0 && y < size; x += whole ? 1 : 2 * reach) {
            uint16_t code = x >= 0 && x < size ? q[(size_t)y * (size_t)size + (size_t)x] : 0;
            best = code > best ? code : best;
        }
    }
    return best;
}

/* Gives texels that show something without a q the one of known neighbours. */
static enum sv_status spread(const struct sv_panel_room *room, struct sv_error *error)
{
    int size = room->size;
    size_t texels = (size_t)size * (size_t)size;
    uint16_t *known = malloc(texels * sizeof *known), far_code = 0;
    if (!known)
        return sv_fail(error, SV_ENOMEM, "panel", "no memory for %zu texels", texels);
    memcpy(known, room->q, texels * sizeof *known);
    for (size_t k = 0; k < texels; k++)
        far_code = known[k] != 0 && (far_code == 0 || known[k] < far_code) ? known[k] : far_code;
    for (size_t k = 0; k < texels; k++) {
        if (known[k] != 0 || room->color[k][3] == 0)
            continue;
        int i = (int)(k % (size_t)size), j = (int)(k / (size_t)size);
        uint16_t code = 0;
        for (int reach = 1; reach <= SV_PANEL_REACH && code == 0; reach++)
            code = largest_around(known, size, i, j, reach);
        room->q[k] = code ? code : far_code ? far_code : SV_PANEL_Q_ONE;
    }
    free(known);
    return SV_OK;
}

enum sv_status sv_panel_crowns(const struct sv_panel_drawing *drawing, const struct sv_panel_room *room,
                               struct sv_error *error)
{
    uint8_t root[256];
    size_t unknown = 0;
    sv_color_init();
    for (int k = 0; k < 256; k++)
        root[k] = (uint8_t)(255 * sqrtf(sv_linear_from_srgb8[k]) + 0.5f);
    for (int j = 0; j < room->size; j++)
        unknown += drawing->scale == 1 ? take_row(drawing, root, j, room) : mean_row(drawing, j, room);
    return unknown > 0 ? spread(room, error) : SV_OK;
}
