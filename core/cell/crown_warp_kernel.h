/* crown_warp_kernel.h - what the files of the warp of crowns share: the buffer, set-up of a source, kernels
 * at each SIMD level. Private to core/cell/crown_warp*.c and their tests.
 *
 * The buffer holds a key a pixel, 64 bits: epoch (5, below a 0), bits of the float d in [0, 1] (30),
 * source and texel (slot and place in it: sv_panel_layer.q's index), inverted (4 + 24). With an epoch of at
 * most 30 keys are finite doubles of the same order, too. The largest wins, so that nearer beats farther and
 * no order of drawing matters; a clear is a new epoch, which beats all that is there, and empties memory once
 * in 30 times. Around the band lies an apron of SV_CROWN_OPEN pixels, splatted like the rest, for resolve
 * looks at neighbours.
 *
 * The same arithmetic in the same order at every level (no fused multiply-add, true divisions). */
#ifndef SV_CELL_CROWN_WARP_KERNEL_H
#define SV_CELL_CROWN_WARP_KERNEL_H

#include <stdbool.h>
#include <string.h>

#include "core/base/simd.h"
#include "core/cell/crown_warp.h"

enum { SV_CROWN_APRON = SV_CROWN_OPEN, SV_CROWN_BLOCK = 16 };
enum { SV_CROWN_EPOCH_SHIFT = 58, SV_CROWN_DEPTH_SHIFT = 28, SV_CROWN_TEXEL_BITS = 24, SV_CROWN_EPOCHS = 30 };
#define SV_CROWN_TAG_MASK ((UINT32_C(1) << SV_CROWN_DEPTH_SHIFT) - 1)
#define SV_CROWN_TEXEL_MASK ((UINT32_C(1) << SV_CROWN_TEXEL_BITS) - 1)
/* Texels that land farther away than this (px) are not drawn. */
#define SV_CROWN_FAR_PX 1e8f

struct sv_crown_buffer {
    int width, row_first, row_count;
    int stride;     /* keys a row, with the apron and room for vectors */
    int origin;     /* where the key of column 0, picture row 0 is, or would be */
    int nowhere;    /* a key that is no pixel's */
    uint64_t epoch; /* 1 .. SV_CROWN_EPOCHS, shifted to its place */
    uint64_t *keys; /* row_count and the apron's rows */
    int blocks_x, blocks_y, closed_count;
    uint8_t *closed; /* of blocks of 16 x 16 pixels of the band: nothing passes any more */
    uint8_t *shown;  /* ... resolve may find a key there, or beside it, since the last clear */
    float *least;    /* of closed ones: texels of less depth are behind all that has been gathered there */
    uint8_t *spent; /* ... something went over some pixel, which is marked as one that lets nothing through */
    float (*over)[4]; /* of a row of blocks: light in front of what has been gathered (resolve_front) */
};

/* The key of column i, row j of the band. */
static inline const uint64_t *sv_crown_at(const struct sv_crown_buffer *buffer, int i, int j)
{
    return buffer->keys + (ptrdiff_t)(j + SV_CROWN_APRON) * buffer->stride + i + SV_CROWN_APRON;
}

static inline uint32_t sv_crown_bits(float v)
{
    uint32_t bits;
    memcpy(&bits, &v, sizeof bits);
    return bits;
}

static inline uint64_t sv_crown_key(uint64_t epoch, uint32_t depth_bits, uint32_t tag)
{
    return epoch | (uint64_t)depth_bits << SV_CROWN_DEPTH_SHIFT | (tag ^ SV_CROWN_TAG_MASK);
}

/* The depth of a key. */
static inline float sv_crown_depth(uint64_t key)
{
    uint32_t bits = (uint32_t)(key >> SV_CROWN_DEPTH_SHIFT) & 0x3fffffff;
    float d;
    memcpy(&d, &bits, sizeof d);
    return d;
}

/* One source, ready to splat. Row k of the map at texel (i, j) of a tile with code c is ((at[k] + j dv[k]) +
 * i du[k]) + c dc[k], at[] of the tile's first texel. */
struct sv_crown_splat {
    const struct sv_panel_layer *layer;
    struct sv_crown_buffer *buffer;
    const double (*m)[4];
    float du[4], dv[4], dc[4];
    float lo_x, hi_x, lo_y, hi_y; /* pixels that may be written, as floats: columns, picture rows */
    uint32_t tag;                 /* of texel 0 */
};

/* A tile of a source, of all 16 x 16 texels (none is occupied beyond the panel's end). Half a texel's box is
 * spread / w^2 and SV_CROWN_GROW. */
struct sv_crown_tile_at {
    uint32_t texel; /* the first */
    float at[4], spread_x, spread_y;
};
/* Pixels that are drawn, columns and picture rows, the last ones included; x1 < x0: none. */
struct sv_crown_box {
    int x0, x1, y0, y1;
};
/* Returns a box that holds all pixels that were drawn. */
typedef struct sv_crown_box (*sv_crown_tile)(const struct sv_crown_splat *splat,
                                             const struct sv_crown_tile_at *tile);

/* One source, ready to resolve: r_x, r_y, r_w at (x, y) is (at[k] + x dx[k]) + y dy[k], the first two times
 * size / 2 and -size / 2; u = (r_x / r_w) (1 + c gw) + c gu + middle, v alike, c the code. */
struct sv_crown_inverse {
    const struct sv_panel_layer *layer;
    bool legal, opens;
    float at[3], dx[3], dy[3];
    float steep, early;             /* a weight w between texels becomes w steep - early, held to 0 .. 1 */
    float gw, gu, gv, middle, last; /* middle: (size - 1) / 2; last: size - 1 */
    int side;                       /* tiles */
};

struct sv_crown_resolve {
    const struct sv_crown_inverse *sources;
    struct sv_crown_buffer *buffer;
    const float *depth; /* of the band, or NULL */
    float keep;         /* 1 - tolerance */
    bool opens;         /* some source does */
    float (*light)[4];
    size_t skip; /* pixels of the band before the first one of light */
};
/* Pixels i0 <= i < i1, j0 <= j < j1 of the band (j counts from its first row); true when all of them are done
 * afterwards. */
typedef bool (*sv_crown_block)(const struct sv_crown_resolve *resolve, int i0, int i1, int j0, int j1);

/* Whether pixel (i, j) of the band, that no texel covers, shows what the key of a neighbour has there: the
 * same body, or nothing, or what is amid covered pixels. Beside a silhouette the panel has what stands far
 * behind it, which is drawn where it is seen from here, and not here. */
bool sv_crown_fills(const struct sv_crown_resolve *resolve, uint64_t key, int i, int j);

/* Where a pixel (x, y) of the picture sees a key's texel: on which source, at the depth of which code. */
struct sv_crown_place {
    const struct sv_crown_inverse *source; /* NULL: nowhere */
    uint32_t texel;                        /* the key's own */
    float code, u, v;
};
struct sv_crown_place sv_crown_locate(const struct sv_crown_resolve *resolve, uint64_t key, float x, float y);

/* The first keys that a pixel that nothing covers or fills has around it: those of the ways (columns, rows)
 * of at most SV_CROWN_OPEN steps, not above the epoch where there is none. */
enum { SV_CROWN_WAYS = 8 };
extern const int sv_crown_ways[SV_CROWN_WAYS][2];
/* Shows at pixel (i, j) of the band the farthest of them that goes on behind what V sees there, if any does.
 */
void sv_crown_show_behind(const struct sv_crown_resolve *resolve, const uint64_t keys[SV_CROWN_WAYS], int i,
                          int j);

struct sv_crown_kernel {
    sv_crown_tile tile;
    sv_crown_block block;
};
extern const struct sv_crown_kernel sv_crown_scalar, sv_crown_avx2;

void sv_crown_splat_at(const struct sv_crown_kernel *kernel, const struct sv_crown_source *sources,
                       unsigned count, struct sv_crown_buffer *buffer, struct sv_crown_stats *stats);
void sv_crown_resolve_at(const struct sv_crown_kernel *kernel, const struct sv_crown_source *sources,
                         unsigned count, struct sv_crown_buffer *buffer, const float *depth, float tolerance,
                         float (*light)[4]);
void sv_crown_resolve_front_at(const struct sv_crown_kernel *kernel, const struct sv_crown_source *sources,
                               unsigned count, struct sv_crown_buffer *buffer, const float *front,
                               float (*light)[4]);
const struct sv_crown_kernel *sv_crown_kernel_of(enum sv_simd level);

/* Premultiplied colours are blended in whole numbers: 255 * 255 * 256 is 1, less this so that they fit into
 * 16 bits with a sign. */
#define SV_CROWN_BIAS 32768
#define SV_CROWN_UNIT (255.0f * 255.0f * 256.0f)

#endif
