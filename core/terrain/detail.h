/* detail.h - fine structure of the ground below the albedo's resolution: blades, tufts and grit, so that a 30
 * m DEM or a 4 m texel is not a blur before one's feet.
 *
 * One tiling picture (made at start out of a fixed seed) is laid over the world at three scales, 233 m, 29 m
 * and 3.1 m, and multiplies the albedo; its mean is 1, so that averages do not change. A scale holds only
 * wavelengths that the albedo cannot hold (the first needs texels above 6 m), fades in as albedo texels are
 * magnified, and out before its repetition shows. All is subdued on snow, and absent on water and other
 * bluish grounds. TWIN: core/terrain/ground_rows.inc; a test compares the two. The tile's coordinates are
 * world metres modulo the period, so the picture stands still on the ground. */
#ifndef SV_TERRAIN_DETAIL_H
#define SV_TERRAIN_DETAIL_H

#include <stdint.h>

#include "core/base/error.h"

enum { SV_TERRAIN_DETAIL_SIDE = 512, SV_TERRAIN_DETAIL_LEVELS = 10 };

enum sv_terrain_detail_scale { SV_DETAIL_BROAD, SV_DETAIL_COARSE, SV_DETAIL_FINE, SV_DETAIL_COUNT };

/* Periods of the scales on the ground, m. */
extern const double sv_terrain_detail_period_m[SV_DETAIL_COUNT];
/* What a scale does: how it is turned against the world, between which mip levels it fades out, and the share
 * of it that albedo texels of a size cannot show themselves. */
struct sv_terrain_detail_form {
    double cosine, sine;
    float fade_from, fade_to, share;
};
struct sv_terrain_detail_form sv_terrain_detail_form(enum sv_terrain_detail_scale scale, double texel_m);
/* Pixels of this size (m) and above show nothing of a scale, with albedo texels of texel_m. */
double sv_terrain_detail_end_m(enum sv_terrain_detail_scale scale, double texel_m);

/* Makes the tile and its mip levels; idempotent. Call before the first use and before any fork. 1.4 MB, for
 * the process's life. SV_ENOMEM. */
SV_MUST_CHECK enum sv_status sv_terrain_detail_init(struct sv_error *error);

/* Level 0 .. LEVELS - 1 of the tile, side 512 >> level, RGBA u8, 128 means 1: blades, tufts, hue, grit.
 * Borrowed. */
const uint8_t *sv_terrain_detail_level(int level);

/* Tile coordinates u, v (in periods, 0 .. 1) of a world place at each scale. In double, since world
 * coordinates have seven digits before the point. */
void sv_terrain_detail_place(double x, double y, double uv[SV_DETAIL_COUNT][2]);

/* Multiplies a linear albedo by the detail at the world place (x, y). pixel_m: size of a pixel at the point's
 * depth, square to the ray (depth / focal_px; orthographic: 1 / px per metre). n_dot_v: cosine between
 * shading normal and ray, > 0 or clamped. texel_m: size of an albedo texel. NaN in any of them leaves the
 * albedo as it is. */
void sv_terrain_detail_apply(double x, double y, double pixel_m, double n_dot_v, double texel_m,
                             float albedo[3]);

#endif
