/* renderer_private.h - the renderer's insides, for the files that make and draw it. */
#ifndef SV_VIEW_RENDERER_PRIVATE_H
#define SV_VIEW_RENDERER_PRIVATE_H

#include "core/gl/context.h"
#include "core/gl/target.h"
#include "core/relief/draw_object.h"
#include "core/terrain/draw.h"
#include "core/terrain/ground.h"
#include "core/terrain/shadow_height.h"
#include "core/terrain/shadow_page.h"
#include "core/tree/draw.h"
#include "core/tree/shade.h"
#include "core/truth/truth.h"
#include "core/view/renderer.h"

/* What a place of the sun costs once: kept while it stays. */
struct sun_shadow {
    bool made;
    struct sv_shadow_height terrain;
};

struct sv_renderer {
    const struct sv_scene *scene;
    struct sv_gl_context *gl;
    struct sv_terrain_draw *terrain;
    struct sv_tree_draw *trees;
    struct sv_object_draw *objects; /* NULL: the scene has none */
    struct sv_truth *truth;
    struct sv_tree_shade *shade; /* NULL: no trees */
    struct sv_ground *ground;
    struct sv_shadow_pages *pages;
    struct sun_shadow scene_sun, other_sun; /* the scene's own is made before any fork */
    sv_clock_ms clock;
    struct sv_gl_target *target; /* the last one used: most clients keep their size */
    int target_width, target_height;
    unsigned target_layers;
    struct sv_image ground_color, ground_depth; /* of the target's size, or empty */
};

/* The forest's drawing; nothing for a scene without trees. */
SV_MUST_CHECK enum sv_status sv_renderer_make_trees(struct sv_renderer *r, struct sv_store *store,
                                                    struct sv_error *error);
/* What the scene's own sun costs once: shadow heights of the terrain and, if asked for, light at every tree.
 */
SV_MUST_CHECK enum sv_status sv_renderer_make_sun(struct sv_renderer *r, bool trees, struct sv_error *error);
/* Of the pages that are lit by a sun, with shadows of trees or without. */
uint64_t sv_renderer_shadow_key(struct sv_vec3 to_sun, bool trees);

#endif
