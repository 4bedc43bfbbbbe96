/* loading.h - what the parts of sv_scene_load share: the scene in the making, and how to tell news and
 * errors. Private to core/scene. */
#ifndef SV_SCENE_LOADING_H
#define SV_SCENE_LOADING_H

#include "core/scene/scene.h"

struct sv_loading {
    const struct sv_scene_spec *spec;
    const struct sv_scene_options *options;
    struct sv_scene *scene;
    struct sv_errors *errors;
    bool waited; /* before_species was called */
};

/* One line to the log. */
void sv_loading_note(const struct sv_loading *l, int level, const char *format, ...) SV_PRINTF(3, 4);
/* Adds an error under a key path; the message names the scene file, then what error says. */
void sv_loading_fail(const struct sv_loading *l, const struct sv_error *error, const char *path, ...)
    SV_PRINTF(3, 4);

/* Height field and coordinate system, from a DEM or made; then imagery, colours and normals. False after an
 * error was added. */
bool sv_loading_ground(struct sv_loading *l);
bool sv_loading_colors(struct sv_loading *l);

/* All trees of the scene file's "forest", heap (caller frees), numbered in order; *trees may be NULL when
 * there are none. False after an error was added. */
bool sv_loading_plant(const struct sv_loading *l, struct sv_tree **trees, uint32_t *count);

/* Rotation of a tree, radians in [0, 2 pi), from degrees, or (NaN, infinite) from a hash of its place. */
float sv_loading_rotation(double rotation_deg, double x, double y);
/* An object on its ground, without its model and number. SV_EOUTSIDE. */
SV_MUST_CHECK enum sv_status sv_loading_place(const struct sv_scene *scene, const struct sv_object_spec *spec,
                                              struct sv_scene_object *out, struct sv_error *error);
/* Frees what patches added (patch_apply.c). */
void sv_scene_extras_finish(struct sv_scene *scene);
/* The scene file's "objects": models into the arena, each file once; places on the ground. False after errors
 * were added (objects[k].model, objects[k] for a place outside the terrain). */
bool sv_loading_objects(struct sv_loading *l);
/* Calls options->before_species, the first time. */
void sv_loading_await_builders(struct sv_loading *l);

/* The version of the scene: its spec, its inputs as they lie on disk, and the builders. */
uint64_t sv_loading_version(const struct sv_loading *l);

/* Hash of a file or folder as an input: path, and names, sizes and times of all files that share its stem
 * ("a.shp", "a.dbf" ...). One that is not there hashes as such. */
uint64_t sv_loading_input_hash(uint64_t h, const char *path);

#endif
