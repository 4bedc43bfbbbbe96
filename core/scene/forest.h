/* forest.h - the trees that stand in a scene, sorted for drawing, with a hierarchy of boxes for culling.
 *
 * Trees are stored in Morton order of their place on a lattice of the world: two of them stand in the same
 * order whatever else is there. leaf nodes hold up to SV_FOREST_LEAF trees that are neighbours; nodes form an
 * implicit complete binary tree over the order (node boxes bound crowns, not only stems). Plain data, arena.
 */
#ifndef SV_SCENE_FOREST_H
#define SV_SCENE_FOREST_H

#include <stddef.h>
#include <stdint.h>

#include "core/base/arena.h"
#include "core/base/error.h"
#include "core/base/vec.h"

/* Legal tree heights; what data say beyond them is taken as missing. */
#define SV_TREE_HEIGHT_MIN_M 0.05
#define SV_TREE_HEIGHT_MAX_M 150.0

enum { SV_FOREST_LEAF = 32, SV_FOREST_TREES_MAX = 4 << 20 };

struct sv_tree {
    double x, y, z;     /* world, m: base of the stem on the terrain's surface */
    float height_m;     /* 0.05 .. 150 */
    float rotation_rad; /* clockwise seen from above, [0, 2 pi) */
    uint16_t species;   /* index into the scene's species */
    uint16_t reserved;
    uint32_t number; /* 0, 1, ... in the order of the scene file: its id (id.h) */
};

struct sv_forest_node {
    float box_min[3], box_max[3]; /* relative to sv_forest.origin, m */
    uint32_t first, count;        /* trees[first .. first + count) */
};

struct sv_forest {
    struct sv_vec3 origin; /* world place that boxes are relative to: near the middle, on a lattice */
    const struct sv_tree *trees;
    uint32_t count;
    /* nodes[1] is the root, children of k are 2k and 2k + 1; nodes with index >= leaf_first are leaves.
     * node_count is 0 for no trees. A node with count 0 is empty: its box is inverted. */
    const struct sv_forest_node *nodes;
    uint32_t node_count, leaf_first;
};

/* What the builder needs to know of a species to bound a crown. */
struct sv_crown_bound {
    float radius; /* horizontal, in heights */
    float top;    /* 1 for every mesh scaled to its height */
    float bottom; /* <= 0, in heights */
};

/* Sorts trees (taken in any order; the array is reordered in place, and forest->trees borrows it: allocate it
 * from the arena) and builds the hierarchy into the arena. Every species must have its entry in bounds. No
 * trees are legal. SV_ENOMEM; SV_ELIMIT over SV_FOREST_TREES_MAX; SV_EINVAL when a place or height is not
 * finite. */
SV_MUST_CHECK enum sv_status sv_forest_build(struct sv_tree *trees, uint32_t count,
                                             const struct sv_crown_bound *bounds, struct sv_arena *arena,
                                             struct sv_forest *forest, struct sv_error *error);

/* A forest of which some trees go and to which others come. */
struct sv_forest_turnover {
    const struct sv_forest *old;
    const uint8_t *gone;  /* old->count: 1: the tree goes; 0 */
    struct sv_tree *come; /* reordered in place; numbers are above all of old's */
    uint32_t come_count;
};
#define SV_FOREST_CAME UINT32_MAX

/* The forest that sv_forest_build would make of what is there then, in the order of its numbers: trees and
 * nodes go to the arena (sv_forest_bytes of it), old stays as it is. from (room for all of them): index in
 * old, or SV_FOREST_CAME. Linear, but for the sorting of what comes: some 30 ns a tree. Errors as above. */
SV_MUST_CHECK enum sv_status sv_forest_turn_over(const struct sv_forest_turnover *turnover,
                                                 const struct sv_crown_bound *bounds, struct sv_arena *arena,
                                                 struct sv_forest *forest, uint32_t *from,
                                                 struct sv_error *error);
/* What the trees and nodes of a forest take in an arena. */
size_t sv_forest_bytes(uint32_t count);

#endif
