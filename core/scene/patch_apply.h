/* patch_apply.h - a patch (patch.h) applied to a loaded scene.
 *
 * sv_scene_patch_apply makes a scene that is in memory what a scene file with that change would have made it:
 * in place, so that all who point at the scene see the new one, and tells them by a delta what they have to
 * make again. It is meant for a process of its own, the successor of the one that loaded
 * (server/scene/backend.h).
 *
 * Trees and objects keep their numbers, and so their ids (id.h), for as long as they stand; what comes gets
 * the next numbers, in the order of the patch; a number that was given is not given again. So an id names the
 * same tree in every version that a scene was patched to. (Another scene file, or the same one with other
 * points, numbers anew.) */
#ifndef SV_SCENE_PATCH_APPLY_H
#define SV_SCENE_PATCH_APPLY_H

#include "core/scene/change.h"
#include "core/scene/patch.h"
#include "core/scene/scene.h"

/* What of a scene is other than before; heap, for who derives from it. */
struct sv_scene_delta {
    struct sv_scene_change change;
    bool trees, objects;  /* some came or went */
    struct sv_tree *gone; /* change.trees_removed, in rising order of their numbers */
    uint32_t *from; /* of every tree of now: its index before, or SV_FOREST_CAME (forest.h); NULL: no tree
                       changed */
    uint32_t *came; /* change.trees_added: indices in the forest of now */
};

struct sv_scene_patch_options {
    struct sv_store *store; /* may be NULL */
    sv_scene_log log;       /* may be NULL */
    void *log_context;
};

/* Changes the scene. Geometry in degrees or in the scene's metres is told apart as for the files that a scene
 * file names (layer.h). A species that gets its first tree and a model that nothing showed are built, through
 * the store. Linear in the trees of the scene, some 100 ns each, when trees change. On errors (key paths as
 * in the patch, "trees.add[3]"; all are told) the scene is as it was, but for meshes: SV_EOUTSIDE: off the
 * terrain; SV_ENOENT: no tree or object has that id; SV_EINVAL: a moment for a scene without a place on
 * Earth, a geometry that is none; SV_ELIMIT, SV_ENOMEM, and what building a model gives. */
SV_MUST_CHECK enum sv_status sv_scene_patch_apply(struct sv_scene *scene, const struct sv_scene_patch *patch,
                                                  const struct sv_scene_patch_options *options,
                                                  struct sv_scene_delta *delta, struct sv_errors *errors);
void sv_scene_delta_finish(struct sv_scene_delta *delta);

#endif
