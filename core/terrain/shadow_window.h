/* shadow_window.h - direct sunlight that arrives at the ground, on a square grid.
 *
 * A window is one grid: for each texel the share of sunlight left after the terrain's own shadow
 * (shadow_height.h) and after the silhouettes (core/relief/silhouette.h) of trees and objects, each projected
 * along the light onto the ground AT ITS TRUE HEIGHT there (the height hand-over of design.md section 5;
 * paper 1, 3.3.2 would take a plane). Row 0 is the south row. Which windows there are: shadow_page.h.
 *
 * Flow: sv_shadow_window_alloc once; then for each window sv_shadow_window_fill (ground and terrain's
 * shadow) and the casters' sv_shadow_window_cast. */
#ifndef SV_TERRAIN_SHADOW_WINDOW_H
#define SV_TERRAIN_SHADOW_WINDOW_H

#include <stdbool.h>
#include <stdint.h>

#include "core/base/error.h"
#include "core/relief/silhouette.h"
#include "core/terrain/shadow_height.h"
#include "core/view/camera.h"

/* Most texels a side; texels a side of the squares whose lowest and highest ground is known. */
enum { SV_SHADOW_WINDOW_SIDE = 1024, SV_SHADOW_WINDOW_BLOCK = 32 };

struct sv_shadow_window {
    int side;      /* texels a side, a multiple of BLOCK */
    double x0, y0; /* world place of the south-west corner of texel (0, 0) */
    double texel_m;
    double z0; /* world height that ground[] counts from */
    float ground_min, ground_max;
    float *ground;      /* side * side: height of the ground at texel centres, m above z0 */
    uint8_t *light;     /* side * side: share of sunlight, 255: all */
    float (*blocks)[2]; /* (side / BLOCK) squared: lowest and highest ground of each square; NULL: not known
                           (slower) */
};

/* Takes the three arrays from the heap. SV_ENOMEM; SV_EINVAL for a side that is not a multiple of BLOCK, up
 * to SIDE. */
SV_MUST_CHECK enum sv_status sv_shadow_window_alloc(struct sv_shadow_window *window, int side,
                                                    struct sv_error *error);
void sv_shadow_window_finish(struct sv_shadow_window *window); /* legal on a zeroed one */

/* Where a window lies: south-west corner of its texel (0, 0), and texel. */
struct sv_shadow_place {
    double x0, y0, texel_m;
};

/* Moves the window there: z0, ground and blocks of the field, light of the terrain's own shadow. Ground is
 * the surface of heightfield.h (its triangles: bodies stand on them, and a bilinear surface would part them
 * from their shadows by a quarter of a cell's twist); beyond the field, the height of its border. terrain: of
 * the same field, or NULL: all light. About 2 ns a texel. */
void sv_shadow_window_fill(struct sv_shadow_window *window, const struct sv_heightfield *field,
                           const struct sv_shadow_height *terrain, struct sv_shadow_place place);

/* Multiplies light by (1 - coverage) where the silhouette of a body at `place` (world) falls on the window's
 * ground; bilinear in the silhouette, box-filtered when its texels are finer than the window's (up to 4 x 4
 * samples a texel: a caster with a choice of silhouettes takes one whose texels are about the window's).
 *
 * scale: m for one unit of the silhouette's lengths (corner, width_m, height_m, depths), > 0: a tree's height
 * for the silhouette of its species. right need not be level, but work is bounded best when it is. Ground
 * whose depth along the light is less than where the body begins (first, else first_m) stays as it is. Light
 * that comes from below, or at less than a quarter of a degree above the horizon (there is next to none),
 * casts nothing; the same for anything not finite and for scale <= 0. The shadow ends where it meets ground
 * above the body's highest ray. Bodies whose shadow misses the window cost a few nanoseconds, others about 1
 * ns a texel of it; texels that are dark already are passed over. All SIMD levels give the same bytes. */
void sv_shadow_window_cast(struct sv_shadow_window *window, const struct sv_silhouette *silhouette,
                           struct sv_vec3 place, double scale);

/* Casts everything that the caller knows of into a window: called once for each window that is made. */
typedef void (*sv_shadow_caster)(void *context, struct sv_shadow_window *window);

#endif
