/* coloring.h - a plausible natural colour for bare heights: by slope, height and land form (convexity,
 * drainage, sea), with imagery laid over it where there is any. Deterministic; patterns are anchored to the
 * field.
 *
 * Colours are linear albedos as measured in nature (grass 0.05 .. 0.12, rock 0.15 .. 0.27, snow 0.75), stored
 * as sRGB. Tree line and snow line follow the latitude. It knows no climate but that: a desert at 60 degrees
 * is drawn green. */
#ifndef SV_TERRAIN_COLORING_H
#define SV_TERRAIN_COLORING_H

#include "core/base/arena.h"
#include "core/terrain/terrain.h"

/* Version of the builder: part of cache keys; raise it whenever the output changes. */
#define SV_COLORING_VERSION 2

/* Fills terrain->albedo, terrain->normal and terrain->has_imagery for terrain->field; pixels into the arena.
 * imagery (may be NULL): RGBA u8 over the field's rectangle, row 0 south, at most SV_TERRAIN_TEXTURE_SIDE_MAX
 * a side; where its alpha is below 255 the natural colour shows through, and the albedo has its size. Without
 * it the albedo has up to 4 texels a sample, none smaller than 0.9 m, and at most 4096 a side. latitude_deg
 * steers the heights of tree line and snow (NaN: 45). SV_EINVAL for other imagery, SV_ENOMEM. */
SV_MUST_CHECK enum sv_status sv_terrain_color(struct sv_terrain *terrain, const struct sv_image *imagery,
                                              double latitude_deg, struct sv_arena *arena,
                                              struct sv_error *error);

#endif
