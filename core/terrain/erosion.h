/* erosion.h - rivers and slopes at work on a square grid of heights: what turns noise into a landscape. */
#ifndef SV_TERRAIN_EROSION_H
#define SV_TERRAIN_EROSION_H

#include <stdint.h>

#include "core/base/error.h"

struct sv_erosion {
    int side;              /* samples a side, 3 .. 4097 */
    float *h;              /* side * side heights, any unit; changed in place */
    const uint8_t *outlet; /* side * side: 1 where water leaves and the height is held; at least one */
    const float *uplift;   /* side * side: rise a unit of time */
    float *area;           /* side * side, written: share of the square that drains through a sample */
};

struct sv_erosion_options {
    int steps;
    double dt;       /* time of one step */
    double strength; /* K: incision = K * sqrt(area) * slope, with the side of the square as unit of length */
    double diffusion; /* creep of slopes: share of the distance to the neighbours' mean that a step closes, 0
                         .. 0.5 */
    uint64_t seed;    /* of the wobble that keeps channels off the grid's directions */
};

/* SV_ENOMEM; SV_EINVAL without an outlet. */
SV_MUST_CHECK enum sv_status sv_erosion_run(struct sv_erosion *erosion,
                                            const struct sv_erosion_options *options, struct sv_error *error);

#endif
