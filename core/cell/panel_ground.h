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
    struct sv_sweep sweep;
    const struct sv_ground *ground; /* of the terrain whose field is swept */
    const struct sv_light *light;
    struct sv_shadow_pages *shadows; /* with a scene in use; NULL: no shadows */
};

/* Neighbours whose q differ by more are torn apart when a ground panel is warped (warp.h), in units of 2 /
 * size. From 4 to 16 the pictures are equally near to the drawn ones (0.6 levels at the mean, eyes up to 0.2
 * D off V); below, slopes are torn that are one; at 64 what opens behind a ridge is smeared. */
#define SV_PANEL_GROUND_CUT 8.0f

/* Fills q and color (size * size each; sRGB straight; alpha 255 where q > 0, else 0). One sample a texel:
 * four (2 x 2, on the texel's own surface) brought warped pictures from 0.39 to 0.365 levels of a ray-cast
 * truth, at five times the cost; a drawn picture has 0.40. */
void sv_panel_ground_make(const struct sv_panel_ground_options *options, float *q, uint8_t (*color)[4]);

/* The camera that sees a face: at V, 2 atan(reach) high and wide, near plane D, size x size. */
struct sv_camera sv_panel_ground_camera(const struct sv_sweep *sweep);
/* The map of a face of that size to a camera's picture, t = q (warp.h). shift as in
 * sv_camera_clip_from_local. */
void sv_panel_ground_map(const struct sv_sweep *sweep, const struct sv_camera *camera, double shift_x_px,
                         double shift_y_px, struct sv_warp_map *map);

#endif
