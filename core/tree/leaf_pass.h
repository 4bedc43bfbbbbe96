/* leaf_pass.h - what the files of leaf_splat share: the object, and the drawing of one tree. Private. */
#ifndef SV_TREE_LEAF_PASS_H
#define SV_TREE_LEAF_PASS_H

#include "core/tree/leaf_kernel.h"

enum { SV_LEAF_BLOCK = 32 }; /* pixels: what others draw between is cut into (sv_leaf_between) */

struct sv_leaf_species {
    const struct sv_tree_mesh *mesh; /* NULL: has no trees */
    int owner;                       /* species that owns the form */
    bool made;
    struct sv_leaf_form form;
};

/* What is known of a tile's least depth. RAW: a sampled pass, and none of the tile's samples made yet. */
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
    float *sample_depth;   /* of a sampled pass: the band's */
    uint8_t *sample_color; /* alpha 0: no tree */
    size_t sample_room;
    struct sv_leaf_seen_cluster *list, *sorted;
    uint32_t list_room;
    float *tile_far;       /* by tile: least depth in it, or less: what it was before */
    uint8_t *tile_state;   /* enum sv_leaf_tile_state */
    uint8_t *tile_touched; /* clusters of the tree at hand were drawn into it; all zero between trees */
    uint8_t *tile_fresh;   /* trees have changed it since it was last taken (sv_leaf_between) */
    size_t tile_room;
    bool exhaustive; /* tests: trees and clusters that are hidden are drawn all the same */
    uint32_t lit_count[SV_TREE_MATERIALS_MAX];
    uint32_t lit[SV_TREE_MATERIALS_MAX][SV_LEAF_LIT];
};

/* Others draw between lists of trees (draw_mixed.c). */
struct sv_leaf_between {
    void *context;
    void (*begun)(void *context, int tx, int ty); /* the tile's samples were made */
    uint8_t *fresh; /* blocks of leaf tiles, row by row: set where one is drawn into */
    int columns;    /* of them a row */
};

/* What one tree is drawn with. */
struct sv_leaf_pass {
    const struct sv_leaf_kernel *kernel;
    const struct sv_leaf_view *view;
    const struct sv_canvas *canvas; /* the band */
    const struct sv_tree *tree;
    const struct sv_leaf_splat_trees *trees;
    const struct sv_leaf_between *between; /* NULL: nobody */
    bool sampled; /* samples are apart from the canvas: several a pixel, or between */
    /* Samples across and down a pixel; focal length in them; where the axis meets the picture, in their
     * coordinates (leaf_kernel.h: a sample is a pixel there). */
    int across, down;
    double focal, focal_x, focal_y, center[2];
    int tiles_x;
    size_t tiles;
    uint8_t *color;
    int i0, j0, i1, j1; /* pixels that the tree can have touched, in the band */
    struct sv_leaf_splat_stats stats;
};

/* Samples of this depth hide everything: legal depths are at most 1. */
#define SV_LEAF_CLOSED 2.0f

/* A pass over the camera's canvases with trees->samples a pixel. SV_EINVAL: not a number of samples. */
SV_MUST_CHECK enum sv_status sv_leaf_pass_init(const struct sv_leaf_splat *splat,
                                               const struct sv_leaf_view *view, int samples,
                                               struct sv_leaf_pass *pass, struct sv_error *error);
/* pass->canvas is a band now; draws trees of pass->trees into it, nearest first; the samples of a sampled
 * pass stay in the splat. SV_ENOMEM. */
SV_MUST_CHECK enum sv_status sv_leaf_band_begin(struct sv_leaf_splat *splat, struct sv_leaf_pass *pass,
                                                struct sv_error *error);
SV_MUST_CHECK enum sv_status sv_leaf_band_draw(struct sv_leaf_splat *splat, struct sv_leaf_pass *pass,
                                               struct sv_error *error);

/* The species that owns the form; NULL without one. */
struct sv_leaf_species *sv_leaf_owner(const struct sv_leaf_splat *splat, int species);
/* Draws pass->tree into the samples of the band (leaf_tree.c): entry of the list, index of the tree. */
SV_MUST_CHECK enum sv_status sv_leaf_draw_tree(struct sv_leaf_splat *splat, struct sv_leaf_pass *pass,
                                               uint32_t entry, uint32_t index, struct sv_error *error);

#endif
