/* patching.h - what the parts of sv_scene_patch_apply share: the scene as it will be, in the making. Private
 * to core/scene. Nothing of the scene is written before everything is there. */
#ifndef SV_SCENE_PATCHING_H
#define SV_SCENE_PATCHING_H

#include "core/scene/loading.h"
#include "core/scene/patch_apply.h"

struct sv_patching {
    struct sv_scene *scene;
    const struct sv_scene_patch *patch;
    const struct sv_scene_patch_options *options;
    struct sv_errors *errors;
    size_t errors_before;
    struct sv_scene_delta delta;
    uint64_t sum; /* what the version is made of (scene.h), as it will be */
    struct sv_sun sun;
    /* Trees: */
    uint8_t *gone;        /* of the forest; heap */
    struct sv_tree *come; /* heap */
    uint32_t come_count, next_tree;
    struct sv_species *species; /* of the scene's memory; NULL: none is other */
    struct sv_arena *arena;     /* of the forest to be */
    struct sv_forest forest;
    /* Objects: of the scene's memory; NULL: as before */
    struct sv_scene_object *objects;
    struct sv_object_model *models;
    int object_count, model_count;
    uint32_t next_object;
    struct sv_change_box *boxes; /* of what changed; heap */
    size_t box_count;
};

/* Adds an error under a key path. */
void sv_patching_fail(struct sv_patching *p, const struct sv_error *error, const char *path, ...)
    SV_PRINTF(3, 4);
/* x and y in the scene's metres of a place of either kind. False after an error was added. */
bool sv_patching_place(struct sv_patching *p, const double given[4], const char *path, double *x, double *y);
/* Zeroed memory that lives as long as the scene; NULL without memory. */
void *sv_patching_alloc(struct sv_patching *p, size_t bytes);
/* The mesh in memory that lives as long as the scene. */
SV_MUST_CHECK enum sv_status sv_patching_keep_mesh(struct sv_patching *p, const struct sv_tree_mesh *mesh,
                                                   struct sv_tree_mesh *kept, struct sv_error *error);
void sv_patching_box(struct sv_patching *p, struct sv_vec3 foot, double height_m, double radius_m);

/* The parts; false after errors were added. */
bool sv_patching_trees(struct sv_patching *p);
bool sv_patching_objects(struct sv_patching *p);

#endif
