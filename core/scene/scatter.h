/* scatter.h - trees strewn over a terrain: deterministic from the seed on every machine, blue-noise spacing.
 */
#ifndef SV_SCENE_SCATTER_H
#define SV_SCENE_SCATTER_H

#include "core/geo/geo.h"
#include "core/scene/forest.h"
#include "core/scene/scene_file.h"

struct sv_scatter_report {
    uint32_t placed; /* fewer than count when the spacing, slope or polygon leave no room: say so */
    /* Darts that hit ground too steep or outside the polygons, and those nearer than min_spacing_m to a tree.
     */
    uint64_t rejected_slope, rejected_polygon, rejected_spacing;
};

/* Writes at most spec->count trees to out (room for count; heap or arena). No two stand nearer than
 * min_spacing_m; each stands on ground no steeper than max_slope_deg and inside the polygons (NULL: anywhere
 * on the terrain). Where there is room they spread out further, as blue noise. x, y, z (on the surface),
 * height, rotation and species are set, number is left 0. Of the trees placed each species has exactly its
 * share (spec->mix, species_count entries, sum 1), rounded by largest remainders, in stands. The same spec,
 * terrain and polygons give the same trees on every machine. About 1 us a tree. SV_EINVAL, SV_ELIMIT,
 * SV_ENOMEM. */
SV_MUST_CHECK enum sv_status sv_scatter(const struct sv_scatter_spec *spec, int species_count,
                                        const struct sv_heightfield *field,
                                        const struct sv_polygons *polygons, struct sv_tree *out,
                                        struct sv_scatter_report *report, struct sv_error *error);

#endif
