/* shadow_window.h - direct sunlight that arrives at the ground, on square grids about the eye, coarser with
 * distance.
 *
 * A window is one grid: for each texel the share of sunlight left after the terrain's own shadow
 * (shadow_height.h) and after the silhouettes (core/relief/silhouette.h) of trees and objects, each projected
 * along the light onto the ground AT ITS TRUE HEIGHT there (the height hand-over of design.md section 5;
 * paper 1, 3.3.2 would take a plane). The terrain's shader reads the finest window that holds a place; mip
 * levels make it smooth far away. Row 0 is the south row. */
#ifndef SV_TERRAIN_SHADOW_WINDOW_H
#define SV_TERRAIN_SHADOW_WINDOW_H

#include <stdint.h>

#include "core/relief/silhouette.h"
#include "core/terrain/heightfield.h"

enum { SV_SHADOW_WINDOW_SIDE = 1024 };

struct sv_shadow_window {
    double x0, y0; /* world place of the south-west corner of texel (0, 0) */
    double texel_m;
    double z0; /* world height that ground[] counts from */
    float ground_min, ground_max;
    float *ground;  /* SIDE * SIDE: height of the ground at texel centres, m above z0 */
    uint8_t *light; /* SIDE * SIDE: share of sunlight, 255: all */
};

/* Multiplies light by (1 - coverage) where the silhouette of a body at `place` (world) falls on the window's
 * ground; bilinear in the silhouette, box-filtered when its texels are finer than the window's. Bodies whose
 * shadow misses the window cost a few nanoseconds. */
void sv_shadow_window_cast(struct sv_shadow_window *window, const struct sv_silhouette *silhouette,
                           struct sv_vec3 place, double scale);

/* Casts everything that the caller knows of into a window: called once for each window that is made. */
typedef void (*sv_shadow_caster)(void *context, struct sv_shadow_window *window);

#endif
