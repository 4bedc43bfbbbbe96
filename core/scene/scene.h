/* scene.h - a loaded scene: what every picture is drawn from. Filled once by sv_scene_load, then read only.
 *
 * Flow: scene_file -> geo (DEM, imagery, points), terrain (procedural, colouring), tree (import, grow),
 * scatter -> forest -> arena, sealed. No GL here: core/view/renderer.h makes the textures and baked forms
 * from it. */
#ifndef SV_SCENE_SCENE_H
#define SV_SCENE_SCENE_H

#include "core/base/arena.h"
#include "core/base/store.h"
#include "core/geo/geo.h"
#include "core/scene/forest.h"
#include "core/scene/light.h"
#include "core/scene/scene_file.h"
#include "core/terrain/terrain.h"
#include "core/tree/mesh.h"

struct sv_species {
    char name[SV_SCENE_NAME_MAX];
    struct sv_tree_mesh mesh; /* arena */
    uint64_t key;             /* hash of all that the mesh was made from: key of what is baked from it */
    uint32_t tree_count;
};

/* A model that objects stand for: one for each file, however many objects show it. */
struct sv_object_model {
    const char *file;         /* path of the model; borrowed from the scene's spec */
    struct sv_tree_mesh mesh; /* arena; model space as for trees (frames.h), nothing in it is a leaf */
    uint64_t key;             /* hash of all that the mesh was made from: key of what is baked from it */
    uint32_t object_count;
};

/* One entry of the scene file's "objects", in its order, or one that came later. */
struct sv_scene_object {
    uint32_t number;    /* 0, 1, ... in the order of the scene file: its id (id.h) */
    int model;          /* index in sv_scene.models */
    double x, y, z;     /* world: where the model's anchor stands (import.h), z: the ground there */
    double heading_rad; /* clockwise from grid north that the model's -Z (north) is turned to; 0 .. 2 pi */
    double height_m;
    int relief_resolution; /* texels along the longest side of its box */
};

/* What of the inputs is not in the scene as it was given; the log says the same in words. */
struct sv_scene_counts {
    uint64_t voids_filled;                          /* samples of the DEM */
    uint64_t outside_terrain, unusable, not_placed; /* points; not_placed: scattered trees without room */
    uint64_t heights_defaulted, species_defaulted;
};

struct sv_scene {
    char name[SV_SCENE_NAME_MAX];
    uint64_t version; /* of a patched scene: hash of loaded_version and patched; else hash of the scene file,
                         of every input's path, size and mtime, and of the builders' versions */
    struct sv_crs *crs;
    struct sv_terrain terrain;
    const struct sv_species *species;
    int species_count;
    struct sv_forest forest;
    struct sv_sun sun;
    const struct sv_scene_object *objects; /* arena */
    int object_count;
    const struct sv_object_model *models; /* arena; of the objects */
    int model_count;
    double relief_distance_m;
    int relief_resolution;
    struct sv_scene_counts counts;
    struct sv_arena *arena;
    struct sv_scene_spec spec; /* owned */
    /* Of a scene that was patched (patch_apply.h): */
    uint64_t generation; /* patches since it was loaded */
    uint64_t loaded_version;
    uint64_t patched; /* sum of the hashes of what came, less those of what went: 0 when all is as it was */
    uint32_t next_tree, next_object; /* numbers, at least; 0: one more than the highest */
    struct sv_arena *forest_arena;   /* NULL: the forest is in arena */
    struct sv_scene_extra *extras;   /* memory of species, models and objects */
};

/* One line of news while loading ("terrain: filled 9 voids ..."). level: 0 information, 1 warning. */
typedef void (*sv_scene_log)(void *context, int level, const char *message);

struct sv_scene_options {
    struct sv_store *store; /* may be NULL */
    sv_scene_log log;       /* may be NULL */
    void *log_context;
    size_t arena_bytes; /* address space to reserve; 0: 64 GiB */
    /* Called at most once, when the terrain and its colours are there, before the first species or model of
     * an object is looked up in the store; may be NULL. Whoever builds these into the store side by side is
     * waited for here. */
    void (*before_species)(void *context);
    void *before_species_context;
};

/* Builds the scene; takes *spec (it is emptied) on success only. Errors collect as for the file. */
SV_MUST_CHECK enum sv_status sv_scene_load(struct sv_scene_spec *spec, const struct sv_scene_options *options,
                                           struct sv_scene **scene, struct sv_errors *errors);
void sv_scene_destroy(struct sv_scene *scene);
/* Of the scene as it was loaded, whatever it was patched to since. */
uint64_t sv_scene_loaded_version(const struct sv_scene *scene);
/* The sun for a moment (seconds since 1970 UTC) at the scene's centre, azimuth from grid north, 0 .. 2 pi;
 * false (untouched) when the scene has no place on Earth. */
bool sv_scene_sun_at(const struct sv_scene *scene, double unix_s, struct sv_sun *sun);

/* One species alone (import or grow, measured, through the store): what sv_scene_load does for each; the
 * scene process calls it in forked children first, so that species build side by side into the store. Heap
 * mesh. */
SV_MUST_CHECK enum sv_status sv_species_build(const struct sv_species_spec *spec, struct sv_store *store,
                                              struct sv_tree_mesh *mesh, uint64_t *key,
                                              struct sv_errors *notes, struct sv_error *error);

/* The same for the model of an object (sv_object_import). */
SV_MUST_CHECK enum sv_status sv_object_build(const char *model, struct sv_store *store,
                                             struct sv_tree_mesh *mesh, uint64_t *key,
                                             struct sv_errors *notes, struct sv_error *error);

#endif
