/* sprite.h - far trees on the CPU: impostors with depth, nearest first, into a canvas (canvas.h).
 *
 * Each tree is one flat picture in space (impostor.h), or a blend of neighbouring pictures while the view
 * passes from one to the next, its texels moved by their depth off the picture's plane; lit as trees are
 * everywhere (core/scene/light.h, shade.h). Trees are taken nearest first and composed in linear light under
 * what light still passes (front to back), tile by tile: once a tile lets nothing through, what lies behind
 * costs nothing there. So time follows the picture's size more than the number of trees. Colour under the
 * trees is the canvas' own.
 *
 * Depth of what is opaque hides trees pixel by pixel. A tree smaller than a pixel keeps its share of
 * coverage. The kernels are scalar and AVX2 (core/base/simd.h), bit for bit equal. No GL. One thread at a
 * time an object; deterministic. */
#ifndef SV_TREE_SPRITE_H
#define SV_TREE_SPRITE_H

#include "core/base/store.h"
#include "core/scene/light.h"
#include "core/tree/canvas.h"
#include "core/tree/draw.h"
#include "core/tree/draw_cull.h"
#include "core/tree/shade.h"
#include "core/view/camera.h"

struct sv_sprite_draw;

/* Takes each species' atlas from the store, or bakes it (and puts it there); species of one mesh share it.
 * What has no trees (tree_count 0) is not built. store may be NULL. SV_ENOMEM. */
SV_MUST_CHECK enum sv_status sv_sprite_draw_create(const struct sv_tree_draw_species *species,
                                                   int species_count, struct sv_store *store,
                                                   struct sv_sprite_draw **draw, struct sv_error *error);
/* Builds a species that had no trees before; nothing for one that is there. */
SV_MUST_CHECK enum sv_status sv_sprite_draw_add(struct sv_sprite_draw *draw, int k,
                                                const struct sv_tree_draw_species *species,
                                                struct sv_store *store, struct sv_error *error);
void sv_sprite_draw_destroy(struct sv_sprite_draw *draw); /* NULL is legal */

/* Bakes one species' atlas into the store, unless it is there. */
SV_MUST_CHECK enum sv_status sv_sprite_prepare(const struct sv_tree_draw_species *species,
                                               struct sv_store *store, struct sv_error *error);

struct sv_sprite_view {
    const struct sv_camera *camera;
    const struct sv_light *light;
    double shift_x_px, shift_y_px; /* the sample inside the pixel (camera.h), each in (-0.5, 0.5) */
};

struct sv_sprite_list {
    const struct sv_cull_entry *entries; /* sorted by distance */
    const float *shares; /* of each entry, 0..1: what share of its leaves is there (cross-fades): the power to which the
                            light that passes it is raised, in 64ths; NULL: 1 */
    uint32_t count;
    bool farthest_first; /* false: nearest first, as sv_cull_forest gives them */
};

/* Draws trees[entries[k].tree] over the canvas, whose width and height are the camera's. lights: what
 * sunlight arrives at each (shade.h); {NULL, NULL}: all of it. id and normal planes, where there are any, and
 * then depth too, take what shows at the place where half of the view is covered. Entries of species that
 * were not built are left out. SV_EINVAL when canvas and camera do not fit; SV_ENOMEM (the canvas may be
 * half drawn). */
SV_MUST_CHECK enum sv_status sv_sprite_draw_trees(struct sv_sprite_draw *draw,
                                                  const struct sv_sprite_view *view,
                                                  const struct sv_canvas *canvas, const struct sv_tree *trees,
                                                  const struct sv_sprite_list *list,
                                                  struct sv_tree_lights lights, struct sv_error *error);

/* What shade.h needs of a species (frames NULL: not built); valid as long as draw. */
struct sv_shade_species sv_sprite_draw_shade_species(const struct sv_sprite_draw *draw, int species);
/* Bytes of a species' atlas; 0 when not built. */
size_t sv_sprite_draw_bytes(const struct sv_sprite_draw *draw, int species);

#endif
