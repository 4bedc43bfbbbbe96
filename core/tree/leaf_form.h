/* leaf_form.h - a species' mesh made ready for leaf splats (leaf_splat.h): pieces in blocks of eight, in
 * clusters. Private to the splats.
 *
 * A piece is a parallelogram P0 + s E1 + r E2, s and r in 0..1 (a leaf card: two triangles of the mesh), or a
 * triangle (s + r <= 1). A leaf is what hangs together of a leafy material, up to LEAF_TRIANGLES triangles;
 * larger leafy sheets, and wood, are not thinned out. Pieces are sorted by material and kind, then along a
 * Morton curve of their leaves' middles, cut into clusters, and inside a cluster by rank: the order in which
 * leaves come and go as a tree is thinned out (the first ones stay longest). Ranks are a golden-ratio
 * sequence along the curve, so that every part of the crown thins out evenly. What is not thinned out has ranks
 * piece by piece, in which it comes while a tree fades in. */
#ifndef SV_TREE_LEAF_FORM_H
#define SV_TREE_LEAF_FORM_H

#include "core/tree/mesh.h"

enum { SV_LEAF_LANES = 8, SV_LEAF_CLUSTER = 64, SV_LEAF_TRIANGLES = 8, SV_LEAF_LEVELS = 8 };

/* Eight pieces, model space. Lanes without a piece are NaN in p0. */
struct sv_leaf_block {
    float p0[3][SV_LEAF_LANES], e1[3][SV_LEAF_LANES], e2[3][SV_LEAF_LANES];
};

/* What thinning out needs of them. */
struct sv_leaf_fade {
    float middle[3][SV_LEAF_LANES]; /* of the piece's leaf, or of itself: about which it grows */
    float rank[SV_LEAF_LANES];      /* 0..1; the piece is there at fractions above it */
};

struct sv_leaf_cluster {
    float middle[3], radius; /* sphere about the leaves' middles (unthinned pieces: about their corners) */
    float reach;             /* of a leaf's corners from its middle; 0 for what is not thinned out */
    uint32_t block, block_count;
    uint8_t material;
    bool card;   /* parallelograms; else triangles */
    bool thins;  /* its leaves may be left out */
    bool masked; /* alpha decides */
};

/* What light and mask need of a piece: one cache line. Corners in the order P0, P0 + E1, P0 + E1 + E2, P0 +
 * E2; of a triangle P0, P0 + E1, P0 + E2 and nothing. */
struct sv_leaf_record {
    float uv[6];           /* at P0, and what it grows by along s and r */
    uint16_t occlusion[4]; /* as in the mesh */
    uint32_t normal[4];    /* three times 10 bits, signed, / 511; SV_LEAF_CARD in the first one's bit 30 */
    int8_t open[4][4];     /* as in the mesh */
};
#define SV_LEAF_CARD (UINT32_C(1) << 30)

/* A material's texture. Alpha is asked at level 0 by the rule of mesh.h: whether all four texels about a
 * place are over the cutoff, or none, is noted; only between is it interpolated. Colour of pixels that hold
 * many texels comes from smaller levels (box filter in linear light, weighted by alpha), which is nearer to
 * the mean that it stands for than one texel would be, and does not miss the cache. */
struct sv_leaf_map {
    const uint8_t (*rgba)[4]; /* level 0: the mesh's; NULL: no texture */
    int width, height;
    uint32_t *classes;    /* NULL: no mask; 2 bits a place of level 0: SV_LEAF_OUT, _IN, _MIXED */
    uint8_t (*levels)[4]; /* levels 1 .. level_count - 1, one after the other */
    int level_count;
    uint32_t offset[SV_LEAF_LEVELS]; /* in `levels`; of level 0 unused */
    int32_t widths[SV_LEAF_LEVELS], heights[SV_LEAF_LEVELS];
    float density; /* texels of level 0 a height, mean over the pieces */
};
enum { SV_LEAF_OUT, SV_LEAF_IN, SV_LEAF_MIXED };

struct sv_leaf_form {
    const struct sv_tree_mesh *mesh; /* borrowed */
    struct sv_leaf_block *blocks;    /* 32-byte aligned, block_count */
    struct sv_leaf_fade *fades;      /* the same */
    struct sv_leaf_cluster *clusters;
    struct sv_leaf_cluster whole; /* bounds all clusters, as one of leaves */
    uint32_t block_count, cluster_count;
    struct sv_leaf_record *records; /* by piece: 8 block + lane; 64-byte aligned */
    uint8_t *material;
    uint32_t leaf_count; /* leaves that may be thinned out */
    float leaf_area;     /* their mean, heights^2 */
    struct sv_leaf_map maps[SV_TREE_MATERIALS_MAX];
    size_t bytes;
};

/* Builds the form (heap). Some 20 ms for 78,000 triangles. SV_ENOMEM. */
SV_MUST_CHECK enum sv_status sv_leaf_form_init(const struct sv_tree_mesh *mesh, struct sv_leaf_form *form,
                                               struct sv_error *error);
/* Fills the maps and adds their bytes (leaf_map.c); densities are there. */
SV_MUST_CHECK enum sv_status sv_leaf_maps_init(struct sv_leaf_form *form, struct sv_error *error);
void sv_leaf_form_finish(struct sv_leaf_form *form); /* zeroed is legal */

#endif
