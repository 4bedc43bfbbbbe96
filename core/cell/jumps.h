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

enum { SV_CELL_JUMPS_SIZE_MAX = 4096 };

/* Of a panel of size * size texels (1 .. 4096) over 90 degrees; q > 0 holds something, others (finite) count
 * as 0, infinitely far. Steps of at most cut (>= 0) are within one surface (warp.h tears at more). Any
 * thread; 4 ms for 1024 x 1024. */
void sv_cell_jumps_measure(const float *q, int size, float cut, struct sv_cell_jumps *jumps);
/* The same of codes, q = code / 32768 (panel.h). */
void sv_cell_jumps_measure_codes(const uint16_t *q, int size, float cut, struct sv_cell_jumps *jumps);

#endif
