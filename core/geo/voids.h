/* voids.h - ground where a DEM has none.
 *
 * A void region (4-connected) that is large, reaches the border and has a level rim is water or the like: it
 * is laid flat at the 10th percentile of its rim, so that the sea lies at the foot of its cliffs and no cliff
 * runs out into it. Every other region is a membrane (harmonic: every void the mean of its neighbours, no
 * flow across the raster's border): smooth, without new extremes, so that no ramp leaves the range of the
 * rim. */
#ifndef SV_GEO_VOIDS_H
#define SV_GEO_VOIDS_H

#include <stdint.h>

#include "core/base/error.h"

struct sv_voids_report {
    uint64_t cells, regions;           /* all that were filled */
    uint64_t flat_cells, flat_regions; /* of these: laid flat */
    float flat_level;                  /* height of the largest flat region; 0 when there is none */
};

/* Fills every NaN of h (width x height, any row order) in place; cell_m: mean spacing of samples, against
 * which a rim is called level. At least one value must be a number; finite in, finite out. SV_ENOMEM. */
SV_MUST_CHECK enum sv_status sv_voids_fill(float *h, int width, int height, double cell_m,
                                           struct sv_voids_report *report, struct sv_error *error);

#endif
