/* draw_object.h - the objects of a scene in a picture by OSMesa: polygons near, relief textures far; and the
 * shadows that they throw.
 *
 * Which form: an object is drawn from its relief textures when a texel of theirs is at most relief_texel_px
 * in the picture, and from its polygons when even the finest texel is larger: the rule of screen-space error.
 * Of each relief there are coarser ones (half the resolution each, down to SV_RELIEF_RESOLUTION_MIN), baked
 * with it and kept on disk, so that what is small in the picture costs little: the coarsest that obeys the
 * rule is warped. Equal (model, resolution) share meshes and bakes, equal (model, heading, light) share lit
 * colours and shadow maps.
 *
 * Order in a picture: after terrain and sky, before trees (their soft edges blend over objects). All layers
 * of core/gl/target.h are written.
 *
 * Shadows. An object shades itself (polygons: shadow map of object_sun.h; reliefs: object.h), is shaded by
 * the terrain and by other objects (below a height, taken at its middle: see `ground` and
 * sv_object_draw_cast), by trees (one share of sunlight for all of it: see `trees`), and casts its silhouette
 * on the ground (sv_object_draw_cast). Objects do not shade trees. */
#ifndef SV_RELIEF_DRAW_OBJECT_H
#define SV_RELIEF_DRAW_OBJECT_H

#include "core/base/store.h"
#include "core/gl/frame.h"
#include "core/relief/object.h"
#include "core/scene/scene.h"
#include "core/terrain/shadow_window.h"

struct sv_object_draw;

/* World height up to which the terrain keeps the sun away at world (x, y); at or below the ground, -INFINITY
 * or NaN: nothing does. */
typedef double (*sv_object_ground)(void *context, double x, double y);

/* Share of sunlight that trees leave at a place of the world, 0..1. */
typedef double (*sv_object_trees)(void *context, struct sv_vec3 place);

struct sv_object_draw_options {
    double relief_texel_px;  /* >= 0; 0: polygons only; INFINITY: reliefs only */
    unsigned layers;         /* what is read from the target: bit set of 1u << enum sv_layer */
    bool shadows;            /* for the frame's sun */
    sv_object_ground ground; /* or NULL: the terrain shades no object */
    void *ground_context;
    sv_object_trees trees; /* or NULL: trees shade no object */
    void *trees_context;
};

struct sv_object_draw_stats {
    uint32_t polygon_objects, relief_objects, culled_objects;
    uint64_t triangles; /* of the polygons */
    uint64_t texels;    /* of the reliefs, warped */
    uint32_t holes, holes_left;
};

/* Bakes (or takes from the store) the reliefs of every model and resolution, uploads every mesh. Needs a
 * current GL context. Borrows scene for life. store may be NULL. SV_ENOMEM, SV_EINTERNAL. */
SV_MUST_CHECK enum sv_status sv_object_draw_create(const struct sv_scene *scene, struct sv_store *store,
                                                   struct sv_object_draw **draw, struct sv_error *error);
void sv_object_draw_destroy(struct sv_object_draw *draw); /* NULL is legal */
/* Draws what of the objects the frame sees into the current target. stats may be NULL. SV_EINVAL when
 * relief_texel_px is negative or NaN; SV_ENOMEM. */
SV_MUST_CHECK enum sv_status sv_object_draw_view(struct sv_object_draw *draw, const struct sv_gl_frame *frame,
                                                 const struct sv_object_draw_options *options,
                                                 struct sv_object_draw_stats *stats, struct sv_error *error);

/* Makes a direction to the sun (unit, world) current for sv_object_draw_cast and shadow_height; free when it
 * is the current one. to_sun.z <= 0: night, nothing is cast. sv_object_draw_view does it for its frame's sun
 * when shadows are on. No GL. */
void sv_object_draw_sun(struct sv_object_draw *draw, struct sv_vec3 to_sun);
/* An sv_shadow_caster (context: the sv_object_draw): casts every object whose shadow can fall on the window.
 * Silhouettes are made when first needed and kept while the sun stays. */
void sv_object_draw_cast(void *draw, struct sv_shadow_window *window);
/* Trees have come or gone: forgets what they keep off the objects. */
void sv_object_draw_forget_trees(struct sv_object_draw *draw);
/* Bytes of the relief textures of an object (shared by equal ones), coarser ones included. */
size_t sv_object_draw_relief_bytes(const struct sv_object_draw *draw, int object);
/* Builds the reliefs of one model into the store; needs a current GL context. What the scene process does
 * side by side in forked children. */
SV_MUST_CHECK enum sv_status sv_object_relief_prepare(const struct sv_tree_mesh *mesh, uint64_t key,
                                                      int resolution, struct sv_store *store,
                                                      struct sv_error *error);

#endif
