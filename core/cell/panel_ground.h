/* panel_ground.h - the ground panel of a face: depth by sweep.h, colour by core/terrain/ground.h, as
 * core/relief/warp.h takes it; and the map with which it is warped.
 *
 * q is the window depth of a square camera at V with its near plane at D, so that the ground's own shading
 * (light, pages of shadow) works on it as on a drawn picture. Colour depends on V by its mip levels alone
 * (and by the air, when it is on). */
#ifndef SV_CELL_PANEL_GROUND_H
#define SV_CELL_PANEL_GROUND_H

#include "core/cell/sweep.h"
#include "core/relief/warp.h"
#include "core/terrain/ground.h"

struct sv_panel_ground_options {
    struct sv_sweep sweep; /* its shifts are not read */
    const struct sv_ground *ground;
    const struct sv_light *light;
    struct sv_shadow_pages *shadows; /* with a scene in use; NULL: no shadows */
    int samples; /* 1, or 4: colour is the mean, in linear light, of 2 x 2 samples on the texel's own surface
                  */
    float cut;   /* samples whose q is off by at most this are on it; samples 4 only */
};

/* Fills q and color (size * size each; sRGB straight; alpha 255 where q > 0, else 0 and black). With 4
 * samples ground that none of them meets (thinner than half a texel) is left out. Scratch from the heap with
 * 4 samples: 24 bytes a texel. SV_ENOMEM. */
SV_MUST_CHECK enum sv_status sv_panel_ground_make(const struct sv_panel_ground_options *options, float *q,
                                                  uint8_t (*color)[4], struct sv_error *error);

/* The camera that sees a face: at V, 2 atan(reach) high and wide, near plane D, size x size. */
struct sv_camera sv_panel_ground_camera(const struct sv_sweep *sweep);
/* The map of a face of that size to a camera's picture, t = q (warp.h). shift as in
 * sv_camera_clip_from_local. */
void sv_panel_ground_map(const struct sv_sweep *sweep, const struct sv_camera *camera, double shift_x_px,
                         double shift_y_px, struct sv_warp_map *map);

#endif
