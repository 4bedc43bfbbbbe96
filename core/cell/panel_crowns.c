/* panel_crowns.c - crowns of a panel out of a drawn canvas: decode, mean, codes; unknown q from neighbours;
 * tiles. One pass each, row by row, in plain loops that compilers turn into vectors. */
#include "core/cell/panel.h"

#include <stdlib.h>
#include <string.h>

#include "core/base/color.h"

static uint16_t code_of_q(double q)
{
    double code = q * SV_PANEL_Q_ONE + 0.5;
    return (uint16_t)(code < 1 ? 1 : code > 65535 ? 65535 : code);
}

static uint8_t code_of_root(double linear)
{
    return (uint8_t)(255 * sqrt(linear < 1 ? linear : 1) + 0.5);
}

/* A pixel's q, or 0 where it is unknown. */
static double q_of(const struct sv_panel_drawing *drawing, size_t pixel)
{
    float d = drawing->depth[pixel];
    bool known = d > 0 && !(drawing->opaque && drawing->opaque[pixel] == d);
    return known ? d * drawing->q_per_depth : 0;
}

/* One pixel a texel: a table of codes. Returns how many texels show something of unknown q. */
static size_t take_row(const struct sv_panel_drawing *drawing, const uint8_t root[256], int row,
                       const struct sv_panel_room *room)
{
    size_t unknown = 0, first = (size_t)row * (size_t)room->size;
    const uint8_t *from = drawing->color + 4 * first;
    memset(room->color + first, 0, (size_t)room->size * 4);
    memset(room->q + first, 0, (size_t)room->size * sizeof *room->q);
    for (int i = 0; i < room->size; i++) {
        const uint8_t *p = from + 4 * i;
        if (p[3] == 0)
            continue;
        uint8_t *c = room->color[first + (size_t)i];
        double q = q_of(drawing, first + (size_t)i);
        for (int k = 0; k < 3; k++)
            c[k] = root[p[k]];
        c[3] = p[3];
        room->q[first + (size_t)i] = q > 0 ? code_of_q(q) : 0;
        unknown += !(q > 0);
    }
    return unknown;
}

/* scale x scale pixels a texel. */
static size_t mean_texel(const struct sv_panel_drawing *drawing, size_t pixel, size_t stride, size_t texel,
                         const struct sv_panel_room *room)
{
    float sum[3] = {0, 0, 0};
    double q_sum = 0;
    unsigned covered = 0, q_weight = 0, n = (unsigned)drawing->scale;
    for (unsigned j = 0; j < n; j++)
        for (unsigned i = 0; i < n; i++) {
            size_t at = pixel + j * stride + i;
            const uint8_t *p = drawing->color + 4 * at;
            if (p[3] == 0)
                continue;
            double q = q_of(drawing, at);
            for (int k = 0; k < 3; k++)
                sum[k] += sv_linear_from_srgb8[p[k]];
            covered += p[3];
            q_sum += q * p[3];
            q_weight += q > 0 ? p[3] : 0;
        }
    uint8_t *c = room->color[texel];
    unsigned a = (covered + n * n / 2) / (n * n);
    memset(c, 0, 4);
    room->q[texel] = 0;
    if (a == 0)
        return 0;
    for (int k = 0; k < 3; k++)
        c[k] = code_of_root(sum[k] / (float)(n * n));
    c[3] = (uint8_t)a;
    room->q[texel] = q_weight > 0 ? code_of_q(q_sum / q_weight) : 0;
    return q_weight == 0;
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

static void set_tile(const struct sv_panel_room *room, int x0, int y0, struct sv_panel_tile *tile)
{
    int size = room->size, x1 = x0 + SV_PANEL_TILE < size ? x0 + SV_PANEL_TILE : size;
    int y1 = y0 + SV_PANEL_TILE < size ? y0 + SV_PANEL_TILE : size;
    unsigned low = 65535, high = 0, count = 0;
    for (int j = y0; j < y1; j++) {
        const uint16_t *q = room->q + (size_t)j * (size_t)size;
        for (int i = x0; i < x1; i++) {
            unsigned code = q[i], sought = code ? code : 65535;
            low = sought < low ? sought : low;
            high = code > high ? code : high;
            count += code != 0;
        }
    }
    *tile = (struct sv_panel_tile){(uint16_t)(count ? low : 0), (uint16_t)high, (uint16_t)count, 0};
}

void sv_panel_set_tiles(const struct sv_panel_room *room)
{
    int side = sv_panel_tiles(room->size);
    for (int j = 0; j < side; j++)
        for (int i = 0; i < side; i++)
            set_tile(room, i * SV_PANEL_TILE, j * SV_PANEL_TILE, &room->tiles[j * side + i]);
}

enum sv_status sv_panel_crowns(const struct sv_panel_drawing *drawing, const struct sv_panel_room *room,
                               struct sv_error *error)
{
    uint8_t root[256];
    size_t unknown = 0, size = (size_t)room->size, n = (size_t)drawing->scale;
    sv_color_init();
    for (int k = 0; k < 256; k++)
        root[k] = code_of_root(sv_linear_from_srgb8[k]);
    for (size_t j = 0; j < size; j++) {
        if (n == 1)
            unknown += take_row(drawing, root, (int)j, room);
        for (size_t i = 0; i < size && n > 1; i++)
            unknown += mean_texel(drawing, (j * n * size + i) * n, n * size, j * size + i, room);
    }
    if (unknown > 0) {
        enum sv_status status = spread(room, error);
        if (status != SV_OK)
            return status;
    }
    sv_panel_set_tiles(room);
    return SV_OK;
}
