/* grow_parts.h - what the files of the grower share; private to core/tree/grow*.c and the two texture files.
 *
 * A tree under construction is a list of nodes, each after its parent, and a list of bearers: the twigs,
 * branchlets or fronds that leaves sit on. Data flows: a habit adds nodes and bearers (grow_crown.c,
 * grow_conifer.c, grow_palm.c, on grow_skeleton.c), the pipe model gives radii, grow_wood.c thins the nodes
 * to the triangle budget and makes tubes, grow_leaves.c puts cards on the bearers. Lengths are heights of the
 * tree until grow.c makes the height exactly 1. Memory that runs out sets `failed`, which grow.c checks after
 * each stage; indices stay valid. */
#ifndef SV_TREE_GROW_PARTS_H
#define SV_TREE_GROW_PARTS_H

#include <stdbool.h>
#include <stdint.h>

#include "core/base/image.h"
#include "core/base/rng.h"
#include "core/base/vec.h"
#include "core/tree/grow.h"

enum sv_grow_kind { SV_GROW_TRUNK, SV_GROW_LIMB, SV_GROW_BRANCH, SV_GROW_TWIG };

struct sv_grow_node {
    struct sv_vec3 p;
    double pipe;   /* tips that hang on it: radius^2.3 in units of a tip's */
    double radius; /* heights */
    double swell;  /* factor on what the pipe model says, 1 */
    int parent;    /* -1 for node 0 */
    int main;      /* the child that continues its tube, -1 at a tip */
    double along;  /* of a free node: where it sits on its parent's segment, 0 (grandparent) .. 1 (parent) */
    uint8_t kind;  /* enum sv_grow_kind */
    bool free; /* starts a tube of its own at its own place; a free trunk node stands on the ground, apart */
    bool keep; /* never thinned out */
    bool skip; /* thinned out: lies on the straight line between its kept neighbours */
};

/* A chain that bears leaves: base, then nodes first .. first + count - 1. */
struct sv_grow_bearer {
    int base, first, count;
    double weight;       /* its share of the leaves */
    struct sv_vec3 face; /* where its flat side looks, roughly up; unit */
};

struct sv_grow_tree {
    struct sv_grow_node *nodes;
    int node_count, node_capacity;
    struct sv_grow_bearer *bearers;
    int bearer_count, bearer_capacity;
    bool failed;
};

/* How leaves sit on a habit's bearers, and how large they are together. */
struct sv_grow_leaf_style {
    double aspect;        /* card length / width */
    double area_index;    /* leaf area over the mean of the crown's ground and side projections */
    double turn_rad;      /* between one leaf and the next about the twig: pi distichous, 2.39996 golden */
    double angle_rad;     /* between twig and leaf */
    double start;         /* leafless share of the bearer at its base */
    double droop;         /* how far gravity bends the leaf's axis, 0 .. 1 */
    double up, out, wild; /* weights of light from above, from outside, and of chance in the leaf's facing */
    double pinnate; /* > 0: leaflets of a frond, paired, longest in the middle: this share of the frond's
                       length */
    float translucency;
};

struct sv_grow_habit {
    void (*build)(struct sv_grow_tree *tree, enum sv_habit habit, uint32_t leaves, struct sv_rng *rng);
    double trunk_radius; /* heights, at breast height */
    double flare;        /* how much wider the foot is */
    int flare_lobes;
    struct sv_grow_leaf_style leaf;
};

/* grow_skeleton.c */
enum { SV_GROW_NODES_MAX = 2000000 };
/* Adds a node and returns its index; on lack of memory sets failed and returns 0. */
int sv_grow_add(struct sv_grow_tree *tree, struct sv_vec3 p, int parent, enum sv_grow_kind kind);
/* Adds a node on the segment that ends at parent: where a side branch starts. */
int sv_grow_add_free(struct sv_grow_tree *tree, int parent, double along, enum sv_grow_kind kind);
void sv_grow_bear(struct sv_grow_tree *tree, const struct sv_grow_bearer *bearer);
/* Direction in which the branch arrives at a node; up at node 0 and at free ones. */
struct sv_vec3 sv_grow_heading(const struct sv_grow_tree *tree, int node);
/* Counts tips into pipe and finds every node's main child. */
void sv_grow_count_tips(struct sv_grow_tree *tree);
void sv_grow_tree_finish(struct sv_grow_tree *tree);

struct sv_grow_colonise {
    double step, influence, kill; /* D, d_i, d_k of Runions et al. */
    double inertia;               /* weight of the parent's direction */
    struct sv_vec3 tropism;       /* added to the mean direction to the attractors */
    int iterations_max, nodes_max;
};
/* Space colonisation from the nodes that are there towards the points; spends points[0..count). */
void sv_grow_colonise(struct sv_grow_tree *tree, struct sv_vec3 *points, int count,
                      const struct sv_grow_colonise *options, struct sv_rng *rng);
/* Rounds the corners of limbs and branches (kind >= from), passes times. */
void sv_grow_smooth(struct sv_grow_tree *tree, enum sv_grow_kind from, int passes);

struct sv_grow_twigs {
    int count;        /* as near as the tips allow */
    double reach;     /* twigs sit where the branch goes on for at most this far */
    double length;    /* mean, heights */
    double angle_rad; /* to the branch */
    double turn_rad;  /* about the branch from one to the next */
    double flat;      /* 0: all around; 1: in the branch's horizontal plane */
    double lift;      /* up-turn (negative: droop) over the twig's length */
    int segments;
};
void sv_grow_add_twigs(struct sv_grow_tree *tree, const struct sv_grow_twigs *options, struct sv_rng *rng);
/* Pipe model: radii from the tips, scaled so that the thickest stem at breast height has trunk_radius. */
void sv_grow_radii(struct sv_grow_tree *tree, double trunk_radius);

/* Habits */
void sv_grow_crown(struct sv_grow_tree *tree, enum sv_habit habit, uint32_t leaves, struct sv_rng *rng);
void sv_grow_conifer(struct sv_grow_tree *tree, enum sv_habit habit, uint32_t leaves, struct sv_rng *rng);
void sv_grow_palm(struct sv_grow_tree *tree, enum sv_habit habit, uint32_t leaves, struct sv_rng *rng);

/* Geometry: both append to the mesh's heap arrays, which must have room (grow_wood.c, grow_leaves.c). */
struct sv_grow_wood_plan {
    double tolerance, sides; /* what the budget left */
    uint32_t triangles, vertices;
};
/* Chooses detail for at most `budget` triangles (more only when the coarsest tree needs more), and thins the
 * nodes. */
struct sv_grow_wood_plan sv_grow_plan_wood(struct sv_grow_tree *tree, double trunk_radius, uint32_t budget);
void sv_grow_wood(const struct sv_grow_tree *tree, const struct sv_grow_habit *habit,
                  const struct sv_grow_wood_plan *plan, uint64_t seed, struct sv_tree_mesh *mesh);
/* Exactly `leaves` cards; coverage is the leaf's share of its card. */
void sv_grow_leaves(const struct sv_grow_tree *tree, const struct sv_grow_habit *habit, uint32_t leaves,
                    double coverage, struct sv_rng *rng, struct sv_tree_mesh *mesh);

/* Textures: RGBA u8 sRGB. The leaf's is an atlas of 2 x 2 variants, each with its base at the cell's lower
 * edge; *coverage is the share of texels that the mask (alpha >= 0.5) keeps. */
SV_MUST_CHECK enum sv_status sv_leaf_texture(enum sv_habit habit, uint64_t seed, struct sv_image *image,
                                             double *coverage, struct sv_error *error);
SV_MUST_CHECK enum sv_status sv_bark_texture(enum sv_habit habit, uint64_t seed, struct sv_image *image,
                                             struct sv_error *error);

#endif
