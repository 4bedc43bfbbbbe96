/* leaf_pass.h - what the files of leaf_splat share: the object, and the drawing of one tree. Private. */
#ifndef SV_TREE_LEAF_PASS_H
#define SV_TREE_LEAF_PASS_H

#include "core/tree/leaf_kernel.h"

enum { SV_LEAF_TILE = 16 };

struct sv_leaf_species {
    const struct sv_tree_mesh *mesh; /* NULL: has no trees */
    int owner;                       /* species that owns the form */
    bool made;
    struct sv_leaf_form form;
};

/* What is known of a tile's least depth. RAW: more than one sample a pixel, and none of the tile's made yet.
 */
enum sv_leaf_tile_state { SV_LEAF_TILE_KNOWN, SV_LEAF_TILE_OLD, SV_LEAF_TILE_RAW };

/* A cluster in the picture. */
struct sv_leaf_seen_cluster {
    uint32_t cluster, slice;
    float nearest;      /* depth Z, m, of its nearest point */
    int i0, j0, i1, j1; /* pixels it can touch, in the band */
};

struct sv_leaf_splat {
    int species_count;
    struct sv_leaf_species *species;
    const struct sv_leaf_kernel *kernel;
    struct sv_leaf_job *job;
    struct sv_leaf_seen *seen; /* all zero between trees */
    size_t seen_room;
    float *sample_depth;   /* more than one sample a pixel: the band's */
    uint8_t *sample_color; /* alpha 0: no tree */
    size_t sample_room;
    struct sv_leaf_seen_cluster *list, *sorted;
    uint32_t list_room;
    float *tile_far;     /* by tile: least depth in it */
    uint8_t *tile_state; /* enum sv_leaf_tile_state */
    size_t tile_room;
    uint32_t lit_count[SV_TREE_MATERIALS_MAX];
    uint32_t lit[SV_TREE_MATERIALS_MAX][SV_LEAF_LIT];
};

/* What one tree is drawn with. */
struct sv_leaf_pass {
    const struct sv_leaf_kernel *kernel;
    const struct sv_leaf_view *view;
    const struct sv_canvas *canvas; /* the band */
    const struct sv_tree *tree;
    const struct sv_leaf_splat_trees *trees;
    /* Samples across and down a pixel; focal length in them; where the axis meets the picture, in their
     * coordinates (leaf_kernel.h: a sample is a pixel there). */
    int across, down;
    double focal, focal_x, focal_y, center[2];
    int tiles_x;
    uint8_t *color;
    int i0, j0, i1, j1; /* pixels that the tree can have touched, in the band */
    struct sv_leaf_splat_stats stats;
};

/* The species that owns the form; NULL without one. */
struct sv_leaf_species *sv_leaf_owner(const struct sv_leaf_splat *splat, int species);
/* Draws pass->tree into the samples of the band (leaf_tree.c): entry of the list, index of the tree. */
SV_MUST_CHECK enum sv_status sv_leaf_draw_tree(struct sv_leaf_splat *splat, struct sv_leaf_pass *pass,
                                               uint32_t entry, uint32_t index, struct sv_error *error);

#endif
