/* coloring.h - a plausible natural colour for bare heights: by slope, height and land form (convexity, drainage). */
#ifndef SV_TERRAIN_COLORING_H
#define SV_TERRAIN_COLORING_H

#include "core/base/arena.h"
#include "core/terrain/terrain.h"

/* Fills terrain->albedo (and terrain->normal) for terrain->field into the arena. imagery (may be NULL): RGBA u8 over the field's rectangle, row 0 south; where its alpha
 * is below 255 the natural colour shows through. latitude_deg steers the heights of tree line and snow (NaN: 45). */
SV_MUST_CHECK enum sv_status sv_terrain_color(struct sv_terrain *terrain, const struct sv_image *imagery,
                                              double latitude_deg, struct sv_arena *arena, struct sv_error *error);

#endif
