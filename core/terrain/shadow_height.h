/* shadow_height.h - the shadow that a height field casts on itself: how far below or above the edge of its
 * shadow each sample stands.
 *
 * Two sweeps of the row front (core/relief/row_front.h), one for each limb of the sun's disc (0.53 degrees
 * across), give the heights above which the whole disc is seen and below which nothing of it is; what is kept
 * is the sample's own height less these: `full` and `none`, full <= none. A place is lit where full >= 0 and
 * dark where none <= 0; between lies the penumbra, as wide as the caster is far (paper 1 has a hard edge).
 * Kept as differences, they can be interpolated without the ground's own relief between samples coming in.
 *
 * Fields of more than SV_SHADOW_HEIGHT_SIDE samples a side are averaged down by whole numbers first: what is
 * finer does not cast. What stands outside the field casts nothing. */
#ifndef SV_TERRAIN_SHADOW_HEIGHT_H
#define SV_TERRAIN_SHADOW_HEIGHT_H

#include <stdint.h>

#include "core/base/error.h"
#include "core/terrain/heightfield.h"

enum { SV_SHADOW_HEIGHT_SIDE = 2048 };

struct sv_shadow_height {
    const struct sv_heightfield *field; /* borrowed */
    struct sv_vec3 to_sun;
    int width, height;     /* samples of the map */
    double x0, y0, dx, dy; /* world place of sample (0, 0), spacing, m */
    float *full, *none;    /* width * height, m; at most SV_SHADOW_HEIGHT_CLEAR */
    float *heights;        /* averaged ones; NULL: the field's own */
};

/* Margins are cut here: farther from the shadow's edge they mean nothing, and would blur it. */
#define SV_SHADOW_HEIGHT_CLEAR 1000.0f

/* Makes the map for the sun at to_sun (unit, world, z > 0), into a zeroed struct or one made for the same
 * field before (its memory is used again). 3 ms a million samples. SV_EINVAL for another direction;
 * SV_ENOMEM: what was there before is undefined, but may be made again or finished. */
SV_MUST_CHECK enum sv_status sv_shadow_height_make(struct sv_shadow_height *map,
                                                   const struct sv_heightfield *field, struct sv_vec3 to_sun,
                                                   struct sv_error *error);
void sv_shadow_height_finish(struct sv_shadow_height *map); /* legal on a zeroed one */

/* Share of the sun that is seen at margins full and none, 0 .. 1, smooth; soft_m: the penumbra's height is
 * never taken below this (the map's own resolution), > 0. */
static inline float sv_shadow_height_share(float full, float none, float soft_m)
{
    float wide = none - full;
    float t = 0.5f + 0.5f * (full + none) / (wide > soft_m ? wide : soft_m);
    t = t < 0 ? 0 : t > 1 ? 1 : t;
    return t * t * (3 - 2 * t);
}
/* soft_m for a grid of that spacing: half of what the light drops over it, or half of it for steep light. */
double sv_shadow_height_soft_m(const struct sv_shadow_height *map, double spacing_m);

/* World height up to which the terrain keeps half of the sun away at world (x, y); -INFINITY where the ground
 * sees it, and outside. An sv_shade_ground (core/tree/shade.h); map: a struct sv_shadow_height. */
double sv_shadow_height_at(void *map, double x, double y);

#endif
