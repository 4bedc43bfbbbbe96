/* panel.h - what is seen from a cell's reference point through one face, kept to be warped: memory of the
 * layers, and crowns out of a drawn canvas.
 *
 * A builder draws all texels of a panel into a room, memory of its own. What is kept of it is ONE block of
 * memory (it may be shared between processes): a header, then its layers, of which only what shows something
 * is stored; so a block's size is known when the panel is drawn. size x size texels over the 90 degrees of a
 * face; texel (i, j), row 0 at the top, looks along xs = 2 (i + 0.5) / size - 1 to the right and ys = 1 - 2
 * (j + 0.5) / size up (tangents). What it shows is at depth Z along the face's forward, stored as q = D / Z,
 * D the ring's distance: 0 infinitely far, 1 on the face's plane, up to 2 for crowns that reach over it
 * (algorithms.md 2.1, 2.2).
 *
 * Crowns are see-through: colour premultiplied by coverage, rgb = 255 sqrt(linear), a = 255 coverage; q a
 * code of 1 / 32768. A texel is occupied where its code is not 0: where it shows something (elsewhere colour
 * is 0, too). Tiles of 16 x 16 texels say how many are occupied and between which q, so that empty ones cost
 * nothing, and in which slot they are stored: a slot holds the codes of a tile, and its colours with those of
 * the texels right of it and below, so that any four texels that are blended lie in one slot. Tiles that show
 * nothing, nor have a neighbour there that does, share one last slot of zeros.
 *
 * Ground is opaque, as core/relief/warp.h takes it: sRGB straight, a 255 or 0, q in float (0: nothing);
 * stored from the first row that shows something to the last.
 *
 * Nothing here checks texels and tiles: any bits are legal, and readers stay in bounds whatever they hold
 * (slots beyond the last are taken for it). Plain values; any thread, but a block has one writer and is read
 * only when it is whole. */
#ifndef SV_CELL_PANEL_H
#define SV_CELL_PANEL_H

#include <stddef.h>
#include <stdint.h>

#include "core/base/error.h"
#include "core/cell/lattice.h"

enum { SV_PANEL_SIZE_MIN = 16, SV_PANEL_SIZE_MAX = 4096, SV_PANEL_TILE = 16 };
enum { SV_PANEL_CROWNS = 1, SV_PANEL_GROUND = 2 }; /* layers, as bits */
enum {
    SV_PANEL_SHADOW = 4
}; /* no panel: a page of shadow that is kept among them (core/view/cells_shadow.h) */
/* The code of q = 1. */
#define SV_PANEL_Q_ONE 32768
/* Arrays begin at multiples of this many bytes of the block, and this many are readable after each. */
enum { SV_PANEL_ALIGN = 64 };
/* A slot: codes of a tile, row by row; colours of SV_PANEL_SLOT_SIDE rows. */
enum {
    SV_PANEL_SLOT_SIDE = SV_PANEL_TILE + 1,
    SV_PANEL_SLOT_CODES = SV_PANEL_TILE * SV_PANEL_TILE,
    SV_PANEL_SLOT_COLORS = SV_PANEL_SLOT_SIDE * SV_PANEL_SLOT_SIDE
};

struct sv_panel_tile {
    uint16_t q_min, q_max; /* of occupied texels */
    uint16_t count;        /* of them; 0: the tile is empty */
    uint16_t slot;
};

/* Crowns, to read. Tiles row by row, sv_panel_tiles(size) a side, those of the last row and column cut off at
 * the panel's end: beyond it codes and colours are 0. */
struct sv_panel_layer {
    int size;
    uint32_t last_slot; /* the empty one: slots are 0 .. last_slot */
    const uint8_t (*color)[4];
    const uint16_t *q;
    const struct sv_panel_tile *tiles;
};
/* Rows first .. first + rows - 1 of size; nothing shows elsewhere. */
struct sv_panel_ground {
    int size, first, rows;
    const uint8_t (*color)[4];
    const float *q;
};

/* What a panel is; written into the header. */
struct sv_panel_about {
    uint64_t key;               /* the caller's own */
    struct sv_cell_place place; /* its ring and reference point */
    double distance_m;          /* D */
    enum sv_cell_face face;
    int size;        /* SV_PANEL_SIZE_MIN .. SV_PANEL_SIZE_MAX */
    unsigned layers; /* SV_PANEL_CROWNS | SV_PANEL_GROUND, at least one */
};

/* A panel to read; borrows the block. Layers that are not there have size 0 and NULL. */
struct sv_panel {
    struct sv_panel_about about;
    struct sv_panel_layer crowns;
    struct sv_panel_ground ground;
};

/* All texels of a panel, to draw; arrays of layers that are not there are NULL. */
struct sv_panel_room {
    int size;
    uint8_t (*color)[4];
    uint16_t *q;
    struct sv_panel_tile *tiles;
    uint32_t last_slot;
    uint8_t (*ground_color)[4];
    float *ground_q;
    int ground_first, ground_rows;
};

/* Tiles a side: size / 16, rounded up. */
static inline int sv_panel_tiles(int size)
{
    return (size + SV_PANEL_TILE - 1) / SV_PANEL_TILE;
}

/* The slot of a tile. */
static inline uint32_t sv_panel_slot(const struct sv_panel_layer *layer, int tile)
{
    uint32_t slot = layer->tiles[tile].slot;
    return slot < layer->last_slot ? slot : layer->last_slot;
}
/* Texel (i, j) of crowns: its code, or colour. */
static inline uint16_t sv_panel_code(const struct sv_panel_layer *layer, int i, int j)
{
    uint32_t slot = sv_panel_slot(layer, j / SV_PANEL_TILE * sv_panel_tiles(layer->size) + i / SV_PANEL_TILE);
    return layer
        ->q[slot * SV_PANEL_SLOT_CODES + (uint32_t)(j % SV_PANEL_TILE * SV_PANEL_TILE + i % SV_PANEL_TILE)];
}
static inline const uint8_t *sv_panel_color(const struct sv_panel_layer *layer, int i, int j)
{
    uint32_t slot = sv_panel_slot(layer, j / SV_PANEL_TILE * sv_panel_tiles(layer->size) + i / SV_PANEL_TILE);
    return layer->color[slot * SV_PANEL_SLOT_COLORS +
                        (uint32_t)(j % SV_PANEL_TILE * SV_PANEL_SLOT_SIDE + i % SV_PANEL_TILE)];
}

/* Memory to draw panels of that size in, content undefined. SV_EINVAL (size, layers), SV_ENOMEM. */
SV_MUST_CHECK enum sv_status sv_panel_room_create(int size, unsigned layers, struct sv_panel_room *room,
                                                  struct sv_error *error);
void sv_panel_room_finish(struct sv_panel_room *room); /* of a zeroed room: legal */
/* The room is drawn: sets tiles and rows that are stored. Returns the bytes of the block that it needs, a
 * multiple of SV_PANEL_ALIGN. */
size_t sv_panel_measure(struct sv_panel_room *room);
/* Writes a measured room as a block, whole. block: at least as many bytes as measured, aligned to
 * SV_PANEL_ALIGN. SV_EINVAL (about.face, about.size, about.layers not those of the room, D not positive, the
 * block too small or not aligned), with nothing written. */
SV_MUST_CHECK enum sv_status sv_panel_write(const struct sv_panel_room *room,
                                            const struct sv_panel_about *about, void *block, size_t bytes,
                                            struct sv_error *error);
/* Reads a block that another process may have written: the header is copied once and checked in full; tiles
 * and texels are not (see above). SV_EFORMAT: not a panel, another version, or one that does not fit into
 * `bytes`. */
SV_MUST_CHECK enum sv_status sv_panel_open(const void *block, size_t bytes, struct sv_panel *panel,
                                           struct sv_error *error);

/* Crowns drawn from the reference point, as a builder hands them over: planes of a canvas (canvas.h) of size
 * * scale squared, whose camera stands there, looks along the face's forward and spans its 90 degrees. */
struct sv_panel_drawing {
    const uint8_t *color; /* RGBA, sRGB code of linear light, premultiplied by coverage */
    const float *depth;   /* reversed window depth of the crowns' surface; not > 0, or NaN: unknown */
    const float
        *opaque;        /* what depth was before the crowns: the same value now is unknown; NULL: all known */
    double q_per_depth; /* D over the camera's near plane */
    int scale;          /* pixels a texel along a side, 1 .. SV_PANEL_SCALE_MAX */
};
enum { SV_PANEL_SCALE_MAX = 8, SV_PANEL_REACH = 4 };

/* Draws a room's crowns layer. Drawings of scale 2 are worth their price: against a supersampled picture of a
 * forest (tests/experiments/cell_crowns) a warp from V had an SSIM of 0.92 to 0.98 with them, 0.73 to 0.85
 * with scale 1; the mean q was a little better than the nearest.
 *
 * A texel is the mean of its scale x scale pixels in linear light, empty where
 * its coverage rounds to code 0; its q is the mean of those pixels that show something and know their q,
 * weighted by coverage. A texel that shows something whose q is unknown takes the largest known one at the
 * least distance (largest of row's and column's), up to SV_PANEL_REACH texels, else that of the farthest
 * known texel of the panel (1 where there is none). q is rounded to nearest and kept within codes 1 .. 65535.
 * SV_ENOMEM, with the layer half drawn. */
SV_MUST_CHECK enum sv_status sv_panel_crowns(const struct sv_panel_drawing *drawing,
                                             const struct sv_panel_room *room, struct sv_error *error);

#endif
