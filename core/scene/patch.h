/* patch.h - a small change of a scene as plain values: the sun, trees and objects that come and go.
 *
 * api/patch_parse.h reads one from JSON; core/scene/patch_apply.h makes it so. Removal comes before addition:
 * it takes of what stood before the patch. */
#ifndef SV_SCENE_PATCH_H
#define SV_SCENE_PATCH_H

#include "core/scene/scene_file.h"

/* A place is x, y (scene CRS, m) or lon, lat (degrees); those not given are NaN. */
struct sv_patch_tree {
    double x, y, lon, lat;
    int species;                   /* index in the scene's */
    double height_m, rotation_deg; /* NaN: rotation by a hash of the place, as for points of a scene file */
};

struct sv_patch_add {
    bool is_scatter;
    struct sv_patch_tree tree;
    struct sv_scatter_spec scatter; /* within: the text of a GeoJSON geometry, or NULL */
};

struct sv_patch_near {
    double x, y, lon, lat, radius_m;
};

struct sv_scene_patch {
    double sun_azimuth_deg, sun_elevation_deg; /* NaN: as it is; azimuth from grid north */
    double sun_time_s;                         /* since 1970; NaN: none */
    struct sv_patch_add *add;
    int add_count;
    uint32_t *tree_ids; /* as in layer=id; all of these lists are heap */
    int tree_id_count;
    char *within; /* GeoJSON text; NULL: none */
    bool has_near;
    struct sv_patch_near near;
    struct sv_object_spec *objects;
    int object_count;
    uint32_t *object_ids;
    int object_id_count;
};

void sv_scene_patch_finish(struct sv_scene_patch *patch);

#endif
