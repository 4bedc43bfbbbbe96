/* scatter.h - trees strewn over a terrain: deterministic from the seed on every machine, blue-noise spacing. */
#ifndef SV_SCENE_SCATTER_H
#define SV_SCENE_SCATTER_H

#include "core/geo/geo.h"
#include "core/scene/forest.h"
#include "core/scene/scene_file.h"

struct sv_scatter_report {
    uint32_t placed; /* fewer than count when the spacing, slope or polygon leave no room: say so */
    uint64_t rejected_slope, rejected_polygon, rejected_spacing;
};

/* Appends at most spec->count trees to out (room for count; heap or arena). The distances between any two of them are >= min_spacing_m; polygons may be
 * NULL. x, y, height, rotation, species set, z on the surface; number left 0. */
SV_MUST_CHECK enum sv_status sv_scatter(const struct sv_scatter_spec *spec, int species_count,
                                        const struct sv_heightfield *field, const struct sv_polygons *polygons,
                                        struct sv_tree *out, struct sv_scatter_report *report, struct sv_error *error);

#endif
