/* leaf_form.h - a species' mesh made ready for leaf splats (leaf_splat.h): pieces in blocks of eight, in
 * clusters. Private to the splats.
 *
 * A piece is a parallelogram P0 + s E1 + r E2, s and r in 0..1 (a leaf card: two triangles of the mesh), or a
 * triangle (s + r <= 1). A leaf is what hangs together of a leafy material, up to LEAF_TRIANGLES triangles;
 * larger leafy sheets, and wood, are not thinned out. Pieces are sorted by material and kind, then along a
 * Morton curve of their leaves' middles, cut into clusters, and inside a cluster by rank: the order in which
 * leaves come and go as a tree is thinned out (the first ones stay longest). Ranks are a golden-ratio sequence
 * along the curve, so that every part of the crown thins out evenly. */
#ifndef SV_TREE_LEAF_FORM_H
#define SV_TREE_LEAF_FORM_H

#include "core/tree/mesh.h"

enum { SV_LEAF_LANES = 8, SV_LEAF_CLUSTER = 64, SV_LEAF_TRIANGLES = 8 };

/* Eight pieces, model space. Lanes without a piece are NaN in p0. */
struct sv_leaf_block {
    float p0[3][SV_LEAF_LANES], e1[3][SV_LEAF_LANES], e2[3][SV_LEAF_LANES];
};

/* What thinning out needs of them. */
struct sv_leaf_fade {
    float middle[3][SV_LEAF_LANES]; /* of the piece's leaf: about which it grows */
    float rank[SV_LEAF_LANES];      /* 0..1; the leaf is there at fractions above it */
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

struct sv_leaf_form {
    const struct sv_tree_mesh *mesh; /* borrowed */
    struct sv_leaf_block *blocks;    /* 32-byte aligned, block_count */
    struct sv_leaf_fade *fades;      /* the same */
    struct sv_leaf_cluster *clusters;
    uint32_t block_count, cluster_count;
    /* By piece (8 block + lane): the mesh's vertices at P0, P0 + E1, P0 + E1 + E2, P0 + E2; a triangle's are P0,
     * P0 + E1, P0 + E2 and SV_LEAF_NO_VERTEX. */
    uint32_t (*corners)[4];
    float (*uv)[6]; /* at P0, and what it grows by along s and r */
    uint8_t *material;
    uint32_t leaf_count; /* leaves that may be thinned out */
    float leaf_area;     /* their mean, heights^2 */
    size_t bytes;
};

#define SV_LEAF_NO_VERTEX UINT32_C(0xffffffff)

/* Builds the form (heap). Some 20 ms for 78,000 triangles. SV_ENOMEM. */
SV_MUST_CHECK enum sv_status sv_leaf_form_init(const struct sv_tree_mesh *mesh, struct sv_leaf_form *form,
                                               struct sv_error *error);
void sv_leaf_form_finish(struct sv_leaf_form *form); /* zeroed is legal */

#endif
