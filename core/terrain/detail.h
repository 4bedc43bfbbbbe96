/* detail.h - fine structure of the ground below the albedo's resolution: blades, tufts and grit, so that a 30
 * m DEM or a 4 m texel is not a blur before one's feet.
 *
 * One tiling picture (made at start out of a fixed seed) is laid over the world at two scales, 29 m and 3.1
 * m, and multiplies the albedo; its mean is 1, so that averages do not change. It fades in as albedo texels
 * are magnified, holds only wavelengths that the albedo cannot hold, fades by its own mip levels with
 * distance, is subdued on snow, and is absent on water and other bluish grounds. TWIN:
 * core/gl/shaders/detail.glsl; a test compares the two. The tile's coordinates are world metres modulo the
 * period, so the picture stands still on the ground. */
#ifndef SV_TERRAIN_DETAIL_H
#define SV_TERRAIN_DETAIL_H

#include <stdint.h>

#include "core/base/error.h"

enum { SV_TERRAIN_DETAIL_SIDE = 512, SV_TERRAIN_DETAIL_LEVELS = 10 };

/* Periods of the two scales on the ground, m; the second is turned by SV_TERRAIN_DETAIL_COS, _SIN against the
 * first. */
#define SV_TERRAIN_DETAIL_COARSE_M 29.0
#define SV_TERRAIN_DETAIL_FINE_M 3.1
#define SV_TERRAIN_DETAIL_COS 0.8
#define SV_TERRAIN_DETAIL_SIN 0.6

/* Makes the tile and its mip levels; idempotent. Call before the first use and before any fork. 1.4 MB, for
 * the process's life. SV_ENOMEM. */
SV_MUST_CHECK enum sv_status sv_terrain_detail_init(struct sv_error *error);

/* Level 0 .. LEVELS - 1 of the tile, side 512 >> level, RGBA u8, 128 means 1: blades, tufts, hue, grit.
 * Borrowed. */
const uint8_t *sv_terrain_detail_level(int level);

/* Tile coordinates (in periods, 0 .. 1) of a world place: coarse u, v, fine u, v. In double, since world
 * coordinates have seven digits before the point. */
void sv_terrain_detail_place(double x, double y, double uv[4]);

/* Multiplies a linear albedo by the detail at the world place (x, y). pixel_m: size of a pixel at the point's
 * depth, square to the ray (depth / focal_px; orthographic: 1 / px per metre). n_dot_v: cosine between
 * shading normal and ray, > 0 or clamped. texel_m: size of an albedo texel. NaN in any of them leaves the
 * albedo as it is. */
void sv_terrain_detail_apply(double x, double y, double pixel_m, double n_dot_v, double texel_m,
                             float albedo[3]);

#endif
