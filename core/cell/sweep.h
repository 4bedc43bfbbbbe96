/* sweep.h - the ground that a face of a cell shows: for each of its texels, how far the terrain is.
 *
 * Texel (i, j) of a face of n x n looks along xs right + ys up + forward from V, xs = reach (2 (i + 0.5 +
 * shift_x) / n - 1), ys = reach (1 - 2 (j + 0.5 + shift_y) / n) (row 0 at the top; reach 1: 90 degrees; a
 * little more: faces overlap, so that what moves at their borders does not part); q = D / Z, Z the metres
 * along forward of the first ground that it meets at Z >= D; 0 < q <= 1, and 0 where it meets none. q is the
 * window depth of a 90-degree camera at V whose near plane is D.
 *
 * Side faces: a column is one azimuth, and sees of its profile whatever rises above all that is nearer
 * (Koiso's running maximum, with the eye for the light; algorithms.md 0.5, A1). The profile is walked
 * exactly: its corners are where the azimuth crosses the lines and the alternating diagonals of the field
 * (heightfield.h), and between two corners q is affine in ys, for plane ground has an affine depth in any
 * perspective (A1 has Z instead). So there is no step to choose and no error but rounding. Blocks of ground
 * that lie wholly below what is seen already are passed over. DOWN and UP are drawn triangle by triangle, q
 * affine over each, the largest wins.
 *
 * Ground nearer than the plane is left out and hides nothing; but a ray that is below the ground where it
 * meets the plane, or comes in below the field's edge, sees nothing (0): the underside is never shown, nor
 * what lies behind it. Where the cube touches no ground (as cells are chosen) there is no such ray, and Z >=
 * D for all that the face sees. Outside the field there is nothing. No GL; any thread; two sweeps of one
 * field may run at once. */
#ifndef SV_CELL_SWEEP_H
#define SV_CELL_SWEEP_H

#include "core/base/error.h"
#include "core/cell/lattice.h"
#include "core/terrain/heightfield.h"

enum { SV_SWEEP_SIZE_MAX = 4096 };

/* The largest height of each block of SV_SWEEP_BLOCK cells a side: 1/64 of the field's memory. */
struct sv_sweep_blocks;
enum { SV_SWEEP_BLOCK = 8 };

/* Of the field (borrowed for life): one pass over it. SV_ENOMEM. */
SV_MUST_CHECK enum sv_status sv_sweep_blocks_create(const struct sv_heightfield *field,
                                                    struct sv_sweep_blocks **blocks, struct sv_error *error);
void sv_sweep_blocks_destroy(struct sv_sweep_blocks *blocks); /* NULL is legal */

struct sv_sweep {
    const struct sv_heightfield *field;
    const struct sv_sweep_blocks
        *blocks;       /* of that field; NULL: nothing is passed over. The same bits either way */
    struct sv_vec3 v;  /* world, finite; may lie outside the field */
    double distance_m; /* D > 0 */
    enum sv_cell_face face;
    int size;                /* n: 1 .. SV_SWEEP_SIZE_MAX */
    double reach;            /* tangent at the face's edges, 1 .. 1.25 */
    double shift_x, shift_y; /* texels, -0.5 .. 0.5: where in the texel the sample lies, x right, y down */
};

/* Writes all of q (size * size). Scalar and AVX2 give the same bits. */
void sv_sweep(const struct sv_sweep *sweep, float *q);

#endif
