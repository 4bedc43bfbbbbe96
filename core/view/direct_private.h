/* direct_private.h - the insides of direct drawing, for the files that make and draw it. */
#ifndef SV_VIEW_DIRECT_PRIVATE_H
#define SV_VIEW_DIRECT_PRIVATE_H

#include "core/gl/context.h"
#include "core/gl/target.h"
#include "core/relief/draw_object.h"
#include "core/terrain/draw.h"
#include "core/terrain/ground.h"
#include "core/terrain/shadow_height.h"
#include "core/terrain/shadow_page.h"
#include "core/tree/draw.h"
#include "core/tree/shade.h"
#include "core/view/direct.h"

/* What a place of the sun costs once: kept while it stays. */
struct sun_shadow {
    bool made;
    struct sv_shadow_height terrain;
};

/* A framebuffer and what is read back from it. Two are kept: pictures and panels take turns. */
struct direct_target {
    struct sv_gl_target *gl;
    int width, height;
    unsigned layers;
    struct sv_image ground_color, ground_depth; /* of the target's size, or empty */
};
enum { TARGETS = 2 };

struct sv_direct {
    const struct sv_scene *scene;
    struct sv_gl_context *gl;
    struct sv_terrain_draw *terrain;
    struct sv_tree_draw *trees;     /* NULL: no trees */
    struct sv_object_draw *objects; /* NULL: the scene has none */
    struct sv_tree_shade *shade;    /* NULL: no trees */
    struct sv_ground *ground;
    struct sv_shadow_pages *pages;
    struct sv_shadow_source refined;        /* of pages */
    struct sun_shadow scene_sun, other_sun; /* the scene's own is made before any fork */
    struct direct_target targets[TARGETS];  /* the last one used first */
};

/* The forest's drawing; nothing for a scene without trees. */
SV_MUST_CHECK enum sv_status sv_direct_make_trees(struct sv_direct *r, struct sv_store *store,
                                                  struct sv_error *error);
/* What the scene's own sun costs once: shadow heights of the terrain and, if asked for, light at every tree.
 */
SV_MUST_CHECK enum sv_status sv_direct_make_sun(struct sv_direct *r, bool trees, struct sv_error *error);
/* Of the pages that are lit by a sun, with shadows of trees or without. */
uint64_t sv_direct_shadow_key(struct sv_vec3 to_sun, bool trees);

#endif
