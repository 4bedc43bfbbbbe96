/* terrain_shade.h - colour and normal of the ground as core/terrain/ground.h shades them: its scalar twin.
 *
 * Twin of core/terrain/ground_rows.inc. Albedo is read bilinearly at level 0 (the truth supersamples instead of using mip
 * levels), the shading normal bilinearly from the normal texture, the ground's fine detail from core/terrain/detail.h. */
#ifndef SV_TRUTH_TERRAIN_SHADE_H
#define SV_TRUTH_TERRAIN_SHADE_H

#include "core/base/vec.h"
#include "core/terrain/terrain.h"

/* (x, y) world; pixel_m: size of a pixel at that depth (depth / focal_px); to_viewer unit. albedo linear. Outside the terrain:
 * its border. sv_terrain_detail_init has been called. */
void sv_terrain_shade(const struct sv_terrain *terrain, double x, double y, double pixel_m,
                      struct sv_vec3 to_viewer, float albedo[3], struct sv_vec3 *normal);

#endif
