/* scene_facts.h - what there is to tell about a loaded scene: plain values, borrowed strings. The scene
 * process fills it and has api/scene_doc.h write the document of GET /v1/scene from it. Angles are radians,
 * lengths metres. */
#ifndef SV_SCENE_SCENE_FACTS_H
#define SV_SCENE_SCENE_FACTS_H

#include <stdbool.h>
#include <stdint.h>

enum { SV_FORM_FACTS_MAX = 8 };

/* A form that a species can be drawn in: "polygon", "billboard", ... and what it takes in memory, or will. */
struct sv_form_facts {
    const char *form;
    uint64_t bytes;
    bool built; /* it is in memory or on disk; false: built when a view first asks for it */
};

struct sv_species_facts {
    const char *name;
    uint32_t tree_count, leaf_count, triangle_count, vertex_count;
    struct sv_form_facts forms[SV_FORM_FACTS_MAX];
    int form_count;
};

struct sv_object_facts {
    uint32_t number; /* of its id (id.h) */
    const char *model;
    double x, y, z, heading_rad, height_m; /* z: of its base */
    int relief_resolution;
    uint32_t triangle_count;
    uint64_t relief_bytes; /* of its six relief textures; equal objects share them. 0: not built */
};

struct sv_scene_facts {
    const char *name;
    uint64_t version;

    const char *crs_name;                      /* "EPSG:32633", a name, or "local" */
    int epsg;                                  /* 0: none known */
    double x_min, y_min, x_max, y_max;         /* of the terrain, in the CRS */
    bool has_lonlat;                           /* the scene has a place on Earth */
    double lon_min, lat_min, lon_max, lat_max; /* of a box around it */
    double convergence_rad;                    /* heading of true north from grid north at its centre */

    int terrain_width, terrain_height; /* samples */
    double spacing_x_m, spacing_y_m;
    double z_min, z_max;
    uint64_t voids_filled;
    bool procedural, has_imagery;

    const struct sv_species_facts *species;
    int species_count;
    uint32_t tree_count;
    /* Trees of the data that are not there, or not as the data says: */
    uint64_t outside_terrain, unusable, not_placed; /* not_placed: scatter found no room */
    uint64_t heights_defaulted, species_defaulted;

    const struct sv_object_facts *objects;
    int object_count;

    double sun_azimuth_rad, sun_elevation_rad; /* azimuth from grid north */
    double relief_distance_m;
    int relief_resolution;

    uint64_t pixels_max, sample_pixels_max; /* configured limits of a view; 0: not known here */
    uint64_t shared_bytes;                  /* of the scene's arena: one copy for all workers */
    double load_s;                          /* how long it took to load; negative: not known */
};

#endif
