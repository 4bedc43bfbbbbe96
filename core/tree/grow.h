/* grow.h - a procedural tree: five habits, the same bytes on every machine from (habit, leaves, seed).
 *
 * Broadleaf (an open-grown beech), poplar (Lombardy) and shrub: a crown of foliage lobes with a limb to each,
 * filled by space colonisation (Runions, Lane, Prusinkiewicz 2007). Conifer (Norway spruce): whorls, branches
 * and branchlets by level after Weber and Penn (1995). Palm (Canary date): own construction of arching
 * feather fronds in golden-angle order. Radii by the pipe model with da Vinci's exponent 2.3 (Shinozaki
 * 1964); tapered tubes with bark coordinates and a root flare; thin wood has fewer sides and is thinned to a
 * budget of a quarter of the leaves' triangles (16,000 triangles for small counts).
 *
 * Leaves: one leaf is one card of two triangles with an alpha mask (a conifer's is a needle spray, a palm's a
 * leaflet), attached to its twig, in phyllotactic order, turned to the light. Their size follows from the
 * crown: few leaves are large, many are small, the leaf area stays (grow_leaves.c). A leaf texture is an
 * atlas of 2 x 2 variants of one leaf: a card's uv covers exactly one quarter, fract(2 uv) are the leaf's own
 * coordinates, base at the lower edge. Materials: 0 bark, 1 leaf (absent when there are no leaves). Leafless
 * trees are winter trees, palms keep their bare midribs.
 *
 * Sameness: integer random numbers, and arithmetic from +, -, *, / and sqrt only (grow_math.h); no libm, no
 * contraction. The one exception is crown_color, which goes through the sRGB table (powf) and may differ in
 * its last bits. */
#ifndef SV_TREE_GROW_H
#define SV_TREE_GROW_H

#include "core/tree/mesh.h"

#define SV_HABIT_LIST(X)               \
    X(SV_HABIT_BROADLEAF, "broadleaf") \
    X(SV_HABIT_CONIFER, "conifer")     \
    X(SV_HABIT_POPLAR, "poplar")       \
    X(SV_HABIT_SHRUB, "shrub")         \
    X(SV_HABIT_PALM, "palm")

enum sv_habit {
#define X(name, text) name,
    SV_HABIT_LIST(X)
#undef X
        SV_HABIT_COUNT
};

enum { SV_GROW_LEAVES_MAX = 1000000 };

/* Version of the builder: part of cache keys; raise it whenever the output changes. */
#define SV_GROW_VERSION 3

/* The habit's name, never NULL; "unknown habit" for a value that is none. */
const char *sv_habit_name(enum sv_habit habit);
/* Grows a heap mesh with exactly `leaves` leaves (0 .. SV_GROW_LEAVES_MAX; 0 is a bare tree), measured
 * (mesh.h): base at 0, height 1, occlusion filled in. Any seed is legal. Any thread or process; 39,000 leaves
 * take about a quarter of a second and 15 MB, a million some three seconds and 230 MB. mesh is written on
 * success only. SV_EINVAL, SV_ENOMEM. */
SV_MUST_CHECK enum sv_status sv_tree_grow(enum sv_habit habit, uint32_t leaves, uint64_t seed,
                                          struct sv_tree_mesh *mesh, struct sv_error *error);

#endif
