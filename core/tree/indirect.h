/* indirect.h - indirect textures of a billboard cloud's planes (Garcia, Patow, Sbert, Szirmay-Kalos 2005).
 *
 * A plane's picture does not hold colours but, a texel, which leaf is here: its kind (0: none), how it is
 * turned and where its middle lies; the leaf's own texture is read through that, so that leaves stay crisp
 * however near the eye is. A texel knows one leaf: where several meet, what the others have in it is lost
 * (the layered form of 2007 keeps them in a table; sv_indirect_layers says what that takes). Kinds are what
 * leaves have in common: part of the texture, size, mirrored or not; sizes are rounded so that there are at
 * most 255. A length of wood is a "leaf" too: an upright rectangle of bark.
 *
 * Besides there are small classical textures (billboard.h, 128 x 128): normals and light, and colour for
 * where leaves are smaller than pixels. No GL; deterministic; sv_color_init has been called. */
#ifndef SV_TREE_INDIRECT_H
#define SV_TREE_INDIRECT_H

#include "core/tree/billboard.h"

/* Kind of the blob in the store; the digit is raised whenever the bake or the layout changes. */
#define SV_INDIRECT_KIND "indir2"

enum { SV_INDIRECT_KINDS = 256, SV_INDIRECT_LEAF_SIDE = 256, SV_INDIRECT_LAYERS_MAX = 16 };

struct sv_indirect_options {
    int side; /* texels a side of a plane's picture: a power of two, 16 .. 1024 */
    struct sv_billboard_options base;
};
#define SV_INDIRECT_OPTIONS_DEFAULT ((struct sv_indirect_options){256, {128, 128, 32, 4}})

struct sv_indirect_kind { /* two texels of the shader's table */
    float half[2];        /* model units: along the texture's u and v */
    float reach;          /* what an offset code of 1 means, model units */
    float layer;          /* of the leaf textures; + 0.5 when mirrored */
    float uv_lo[2], uv_hi[2];
};

struct sv_indirect {
    int plane_count, side, kind_count, layer_count; /* kinds[0] is "none" */
    struct sv_indirect_kind kinds[SV_INDIRECT_KINDS];
    uint8_t *texels; /* heap; plane after plane, side x side x 4, row 0 at the top: offset of the middle along
                        the plane's x and y, from the texel's, (code - 128) / 127 reach; turn, code / 256 of a
                        full turn counter-clockwise; kind */
    uint8_t *leaves; /* heap; level after level, layer after layer: RGBA8, sRGB and the share that the alpha
                        test keeps; LEAF_SIDE a side at level 0 */
    struct sv_billboards base;
};

SV_MUST_CHECK enum sv_status sv_indirect_bake(const struct sv_tree_mesh *mesh,
                                              const struct sv_tree_cloud *cloud,
                                              const struct sv_indirect_options *options,
                                              struct sv_indirect *indirect, struct sv_error *error);
void sv_indirect_finish(struct sv_indirect *indirect); /* legal on a zeroed one */
/* Textures' bytes, mip levels included. */
size_t sv_indirect_bytes(const struct sv_indirect *indirect);
/* The most that a bake will take: how many kinds of leaves there are (32 bytes each) is known afterwards
 * only. */
size_t sv_indirect_most_bytes(const struct sv_tree_mesh *mesh, const struct sv_indirect_options *options,
                              int planes);

/* One block of bytes (heap, caller frees) and back; load takes any bytes: SV_EFORMAT. */
SV_MUST_CHECK enum sv_status sv_indirect_save(const struct sv_indirect *indirect, void **data, size_t *bytes,
                                              struct sv_error *error);
SV_MUST_CHECK enum sv_status sv_indirect_load(const void *data, size_t bytes, struct sv_indirect *indirect,
                                              struct sv_error *error);

/* Where the plane's point (x, y) lies on the leaf of its texel: the kind, and texture coordinates of that
 * leaf's layer; 0 when there is none or it ends before. half: of the plane. Twin: leaf_at in
 * core/gl/shaders/tree_indirect.frag. */
int sv_indirect_leaf_at(const struct sv_indirect *indirect, int plane, const float half[2], float x, float y,
                        float uv[2]);

/* What the layered indirect texture (2007) would take at that side: every texel lists all leaves that touch
 * it. bytes: 4 a texel (where its list begins, how long it is) and 4 an entry, as 2005's. */
struct sv_indirect_layers {
    uint64_t texels, entries; /* texels that show something; leaves in all their lists */
    uint32_t deepest;
    size_t bytes;
};
SV_MUST_CHECK enum sv_status sv_indirect_count_layers(const struct sv_tree_mesh *mesh,
                                                      const struct sv_tree_cloud *cloud, int side,
                                                      struct sv_indirect_layers *layers,
                                                      struct sv_error *error);

#endif
