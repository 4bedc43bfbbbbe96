/* terrain_patch.h - the terrain as user geometry of Embree: patches of 8 x 8 cells, walked cell by cell in double.
 *
 * Triangles of a height field need no stored triangles: a patch knows its box, and a ray that enters it steps from cell to
 * cell (Amanatides and Woo 1987) and meets the two planes of each. This takes about 2 bytes a sample in place of Embree's
 * 100 and more, and hits the very surface of heightfield.h (alternating diagonal) to double precision. */
#ifndef SV_TRUTH_TERRAIN_PATCH_H
#define SV_TRUTH_TERRAIN_PATCH_H

#include <embree3/rtcore.h>

#include "core/base/error.h"
#include "core/terrain/heightfield.h"

enum { SV_TERRAIN_PATCH_CELLS = 8 };

/* A ray in double, relative to the field's frame origin; what the float ray of Embree was narrowed from. */
struct sv_patch_ray {
    struct sv_vec3 origin, direction;
};

/* The context that every rtcIntersect1/rtcOccluded1 on a scene with terrain must be given. */
struct sv_patch_context {
    struct RTCIntersectContext embree; /* first: Embree passes a pointer to this */
    struct sv_patch_ray ray;
};

struct sv_terrain_patches {
    const struct sv_heightfield *field;
    struct sv_vec3 origin; /* world place that rays are relative to */
    int columns, rows;     /* patches */
    float (*range)[2];     /* lowest and highest h of each patch, heap */
};

SV_MUST_CHECK enum sv_status sv_terrain_patches_init(struct sv_terrain_patches *patches,
                                                     const struct sv_heightfield *field, struct sv_vec3 origin,
                                                     struct sv_error *error);
void sv_terrain_patches_finish(struct sv_terrain_patches *patches);
/* The geometry, committed, its user data the patches (borrowed for life). */
RTCGeometry sv_terrain_patches_geometry(RTCDevice device, struct sv_terrain_patches *patches);

/* Nearest crossing of the ray with one patch in (t_min, t_max); false when there is none. Both faces count. */
bool sv_terrain_patch_intersect(const struct sv_terrain_patches *patches, unsigned patch,
                                const struct sv_patch_ray *ray, double t_min, double t_max, double *t);

#endif
