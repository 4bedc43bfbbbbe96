/* scene_file.h - the scene file of the wire contract (section 7) as plain values: parsed, checked, nothing
 * loaded.
 *
 * Every unknown key, wrong type and out-of-range value is collected with its key path
 * ("forest[1].scatter.count"), so that one run tells all. Paths are resolved against the scene file's folder.
 * Angles stay in degrees here: this is the file; sv_scene_load converts. */
#ifndef SV_SCENE_SCENE_FILE_H
#define SV_SCENE_SCENE_FILE_H

#include <stdbool.h>
#include <stdint.h>

#include "core/base/error.h"
#include "core/tree/grow.h"

enum { SV_SCENE_SPECIES_MAX = 256, SV_SCENE_NAME_MAX = 64 };

struct sv_terrain_spec {
    char *dem; /* NULL: procedural */
    char *imagery, *crs;
    bool has_nodata;
    double nodata, height_unit_m; /* 0: the file's own */
    int imagery_bands[3];         /* 0: the file's own */
    double size_m, relief_m;      /* procedural */
    int samples;
    uint64_t seed;
};

struct sv_species_spec {
    char name[SV_SCENE_NAME_MAX];
    char *model; /* NULL: procedural */
    enum sv_habit habit;
    uint32_t leaves;
    uint64_t seed;
};

struct sv_species_map {
    char *from; /* name in the data, or "*" */
    int species;
};

struct sv_points_spec {
    char *points, *x, *y, *species, *height, *rotation, *crs, *where;
    int default_species; /* -1: none given */
    double default_height_m, min_height_m;
    struct sv_species_map *map;
    int map_count;
};

struct sv_scatter_spec {
    uint32_t count;
    uint64_t seed;
    double *mix; /* share of each species of the scene, sums to 1; species_count entries */
    double height_m[2], min_spacing_m, max_slope_deg;
    char *within; /* polygon file, NULL: the whole terrain */
};

struct sv_forest_spec {
    bool is_scatter;
    struct sv_points_spec points;
    struct sv_scatter_spec scatter;
};

struct sv_object_spec {
    char *model;
    double x, y, heading_deg, height_m;
    int relief_resolution;
};

struct sv_scene_spec {
    char *path; /* of the scene file */
    char name[SV_SCENE_NAME_MAX];
    struct sv_terrain_spec terrain;
    struct sv_species_spec *species;
    int species_count;
    struct sv_forest_spec *forest;
    int forest_count;
    struct sv_object_spec *objects;
    int object_count;
    double sun_azimuth_deg, sun_elevation_deg;
    bool has_relief; /* the file speaks of it; its values stand at their defaults otherwise */
    double relief_distance_m;
    int relief_resolution;
};

/* Parses text (NUL-terminated, of `bytes` bytes without the NUL) as the scene file at path. Any bytes are
 * legal input. On any error the list is not empty, the status is the first one's, and *spec is not written.
 */
SV_MUST_CHECK enum sv_status sv_scene_spec_parse(const char *text, size_t bytes, const char *path,
                                                 struct sv_scene_spec *spec, struct sv_errors *errors);
/* Reads the file (at most 64 MiB) and parses it; also checks that every file it names exists and can be read.
 */
SV_MUST_CHECK enum sv_status sv_scene_spec_read(const char *path, struct sv_scene_spec *spec,
                                                struct sv_errors *errors);
void sv_scene_spec_finish(struct sv_scene_spec *spec);

#endif
