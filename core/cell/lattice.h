/* lattice.h - rings of cells around an eye: which reference point each ring's panels are drawn from, and in
 * which ring a thing stands.
 *
 * Ring 0 is the nearest. Ring j has a distance D_j, doubling from ring to ring, and reference points V on a
 * face-centred lattice (i + j + k even) of step s_j = pitch D_j, whose cells are the rhombic dodecahedra |dx|
 * + |dy|, |dx| + |dz|, |dy| + |dz| <= s_j (paper 1, section 5: region M, scaled by the pitch). An eye picks
 * V_0; V_{j+1} is the point of ring j + 1 that owns V_j, so that what ring j shows depends on V_j alone: it
 * shows what stands outside cube(V_j, D_j) and meets cube(V_{j+1}, D_{j+1}); the last ring has no outer cube.
 * Cubes (axis-aligned, half side D) nest.
 *
 * V is at its cell's centre or, for eyes over the crowns, at the cell's top corner, centre + (0, 0, s_j):
 * then no eye is above any V of its chain (algorithms.md 2.6: moving down opens no holes). Distances, own
 * derivation: steps halve and cells are one convex shape, so the ways from V_j down the chain to the eye add
 * up to a cell of (2 - 2^-j) s_j about V_j, moved down by as much with V at the top: a pitch of half the
 * radius that a ring's panels bear (region.h) keeps every ring. A cell reaches s_j from its centre along an
 * axis and no farther along any, so |V_j - V_{j+1}| <= s_{j+1} along each axis, 2 s_{j+1} along z with V at
 * the top. Cubes nest where 2 s_{j+1} + D_j <= D_{j+1}, that is pitch <= 1/4; for a tree with a crown the
 * inner one may be larger by D_j / 2 (core/base/shell.h), and they nest where pitch <= 1/8. Plain values, any
 * thread. */
#ifndef SV_CELL_LATTICE_H
#define SV_CELL_LATTICE_H

#include <stdbool.h>
#include <stdint.h>

#include "core/base/vec.h"

enum sv_cell_face {
    SV_CELL_EAST,
    SV_CELL_NORTH,
    SV_CELL_WEST,
    SV_CELL_SOUTH,
    SV_CELL_DOWN,
    SV_CELL_UP,
    SV_CELL_FACES
};
enum { SV_CELL_RINGS_MAX = 12, SV_CELL_NEAR = -1 };

/* A little under 1/8, so that rounding cannot make cubes cross: 0.01 D_1 is left, coordinates of 1e7 m round
 * to 2e-9 m. */
#define SV_CELL_PITCH_MAX 0.12

struct sv_cell_rings {
    int count;                            /* 1 .. SV_CELL_RINGS_MAX; 0: made from what is not legal */
    double distance_m[SV_CELL_RINGS_MAX]; /* rising, each exactly twice the one before */
    double pitch;                         /* lattice step over distance */
};
struct sv_cell_place {
    int32_t ring, i, j, k; /* i + j + k even; the cell's centre is at (i, j, k) pitch distance_m[ring] */
    struct sv_vec3 v;      /* the reference point, world */
};

/* Rings of distances outer_m / 2^n inward to the one nearest inner_m (by ratio; inner_m >= outer_m: one
 * ring), at most SV_CELL_RINGS_MAX. outer_m and inner_m > 0 and finite, 0 < pitch <= SV_CELL_PITCH_MAX; else
 * count is 0. */
void sv_cell_rings_make(double outer_m, double inner_m, double pitch, struct sv_cell_rings *rings);

/* The places of all rings for an eye (world): chain[0 .. count - 1]. top: V at the top of its cell, else at
 * its centre. A point that several cells touch goes to one of them, the same always. False, with nothing
 * written, where a coordinate is NaN or beyond 2^30 lattice steps, or count is 0. */
bool sv_cell_chain(const struct sv_cell_rings *rings, struct sv_vec3 eye, bool top,
                   struct sv_cell_place chain[SV_CELL_RINGS_MAX]);
/* The place of the next ring outward: the chain's rule, from V alone. place->ring < count - 1. */
struct sv_cell_place sv_cell_next(const struct sv_cell_rings *rings, const struct sv_cell_place *place,
                                  bool top);
/* The place of that index, as a chain has it (a panel's description names it so). */
struct sv_cell_place sv_cell_place_at(const struct sv_cell_rings *rings, int ring, int32_t i, int32_t j,
                                      int32_t k, bool top);

/* Unit axes of a face in world axes, as sv_camera_aim would turn there: right x up = -forward. Sides have up
 * = +z; DOWN has north up, UP south. */
void sv_cell_face_axes(enum sv_cell_face face, struct sv_vec3 *right, struct sv_vec3 *up,
                       struct sv_vec3 *forward);

/* Whether the upright segment from foot to foot + (0, 0, height_m), height_m >= 0, meets the closed cube
 * about v of half side distance_m. NaN meets no cube. */
bool sv_cell_in_cube(struct sv_vec3 v, double distance_m, struct sv_vec3 foot, double height_m);

/* What ring `place->ring` shows when V stands there: the shell between two cubes. */
struct sv_cell_shell {
    struct sv_vec3 v, outer_v;
    double distance_m, outer_m; /* outer_m: INFINITY for the last ring */
};
struct sv_cell_shell sv_cell_shell(const struct sv_cell_rings *rings, const struct sv_cell_place *place,
                                   bool top);
/* Whether a tree of that axis (as in sv_cell_in_cube), whose crown reaches reach_m around it, belongs to the
 * shell, whose cubes are grown for it (core/base/shell.h). */
bool sv_cell_in_shell(const struct sv_cell_shell *shell, struct sv_vec3 foot, double height_m,
                      double reach_m);
/* Whether anything in the box (low <= high along each axis) can be seen on the panel of that face: false only
 * where it lies all outside the face's pyramid, all inside the inner cube, or all outside the outer one. What
 * counts for a tree is a box around its axis, crown and shadow. NaN: true. */
bool sv_cell_sees_box(const struct sv_cell_shell *shell, enum sv_cell_face face, struct sv_vec3 low,
                      struct sv_vec3 high);
/* The one ring of a chain in whose shell the tree is, or SV_CELL_NEAR where it is in cube(V_0, D_0). NaN:
 * the last ring. */
int sv_cell_ring_of(const struct sv_cell_rings *rings, const struct sv_cell_place *chain, struct sv_vec3 foot,
                    double height_m, double reach_m);

/* All that tells one panel from another. */
struct sv_cell_key_parts {
    struct sv_cell_place place;
    enum sv_cell_face face;
    int layer;      /* what the panel holds: any number that the caller gives a meaning */
    int size;       /* texels a side */
    uint64_t light; /* bin of the light */
    uint64_t
        scene; /* key of all that does not change while panels live: scene, projection, builder's version */
};
/* 64-bit key of a panel, never 0. Rings enter with the place's distance, the pitch, and whether it is the
 * last. */
uint64_t sv_cell_key(const struct sv_cell_rings *rings, const struct sv_cell_key_parts *parts);

#endif
