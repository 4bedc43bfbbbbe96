/* jumps.h - sums of a panel's jumps in depth: what can open when the eye leaves V.
 *
 * dq is the step of q = distance / Z from one texel to its neighbour to the right (x) or above (y); of a step
 * inside one surface (a slope that is drawn as a sheet) nothing opens, and it is not counted.
 * algorithms.md 2.6. */
#ifndef SV_CELL_JUMPS_H
#define SV_CELL_JUMPS_H

#include <stdint.h>

struct sv_cell_jumps {
    double x_plus,
        x_minus; /* sums of dq to the right: of the rising steps, of the falling ones (both >= 0) */
    double y_plus, y_minus; /* the same upward */
    double xx, yy;   /* sums of |xs dq| to the right and of |ys dq| upward, xs and ys midway between the two
                                 texels: what moving forward or back opens */
    uint32_t texels; /* that hold something */
};

#endif
