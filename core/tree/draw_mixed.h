/* draw_mixed.h - leaf splats and sprites of one view, nearest first, as one picture. Private to core/tree.
 *
 * Both gather what they show in front of what is there: a pixel lets a share of the light pass, 1 at first. A
 * leaf takes its sample's share of it, samples taken once and for all; a sprite its coverage. So whatever
 * lies behind pixels that let no light through (samples that are all taken; less than SV_SPRITE_PASS_MIN)
 * costs next to nothing there, in either form, and a tree whose whole box lies so is dropped. Leaves of trees
 * that no sprite lies between, tile by tile, are hidden by depth; else a crown hides by its distance
 * (draw_cull.h). */
#ifndef SV_TREE_DRAW_MIXED_H
#define SV_TREE_DRAW_MIXED_H

#include "core/tree/leaf_splat.h"
#include "core/tree/sprite.h"

struct sv_mixed_draw {
    struct sv_leaf_splat *leaves;
    struct sv_sprite_draw *sprites;
    struct sv_leaf_view view;
    const struct sv_canvas *canvas;  /* without ids and normals, of the camera's size */
    struct sv_leaf_splat_trees near; /* lists by rising keys */
    struct sv_sprite_list far;
};

/* Draws both lists over the canvas. A tree in both: leaves before the sprite, which shows in their gaps.
 * Depth of a canvas that is no surface: where leaves cover half of a pixel or more. SV_ENOMEM; SV_EINVAL as
 * of sv_leaf_splat_draw. */
SV_MUST_CHECK enum sv_status sv_mixed_draw(const struct sv_mixed_draw *draw, struct sv_error *error);

#endif
