/* ladder.h - how far each form of a species is from its polygons, measured, and which form that says to use.
 *
 * The error of a form at a size in the picture is given in pixels: by how many pixels the polygons' own picture
 * would have to be shifted to be as far (mean absolute difference of 8-bit sRGB) from itself as the form's
 * picture is. So it grows with blur, with misplaced outlines, with wrong colour and with noise alike, and is
 * free of contrast and lighting (own derivation). Polygons: leaf splats at fraction 1, which are exact
 * (leaf_splat.h), 16 samples a pixel, 8 where trees are large. The leaves' form has four and is
 * thinned out as it is when drawn. Means over SV_LADDER_VIEWS directions, which lie
 * between the sprites' frames as often as on them.
 *
 * The forms of `auto` differ in cost by more than ten times at every size, so cheapest first is a fixed order:
 * sprite, then leaves. No clock, no GL, any process; deterministic; kept in the store. */
#ifndef SV_TREE_LADDER_H
#define SV_TREE_LADDER_H

#include "core/tree/leaf_splat.h"
#include "core/tree/sprite.h"

/* Kind of the blob in the store; the digit is raised whenever forms or measure change. */
#define SV_LADDER_KIND "ladder2"

enum { SV_LADDER_SIZES = 6, SV_LADDER_VIEWS = 4 };
/* From this size on a sprite's texels would be larger than 1.25 px: it would be a blurred enlargement beside sharp
 * ground, whatever its mean error is. */
#define SV_LADDER_MAGNIFIED_PX 320.0

enum sv_ladder_form { SV_LADDER_SPRITE, SV_LADDER_LEAF, SV_LADDER_FORMS };

struct sv_ladder {
    float error_px[SV_LADDER_SIZES][SV_LADDER_FORMS]; /* >= 0 */
};

/* Height of a tree in the picture, px, at rung k: 12, 24, 48 ... */
float sv_ladder_size_px(int rung);

/* Measures one species of drawings that have its forms: some 0.3 s for 39,000 leaves. SV_ENOMEM. */
SV_MUST_CHECK enum sv_status sv_ladder_measure(struct sv_sprite_draw *sprites, struct sv_leaf_splat *leaves,
                                               int species, const struct sv_tree_mesh *mesh,
                                               struct sv_ladder *ladder, struct sv_error *error);
/* Takes a species' ladder from the store, or measures it (and keeps it). store may be NULL. */
SV_MUST_CHECK enum sv_status sv_ladder_obtain(struct sv_sprite_draw *sprites, struct sv_leaf_splat *leaves,
                                              int species, const struct sv_tree_draw_species *given,
                                              struct sv_store *store, struct sv_ladder *ladder,
                                              struct sv_error *error);

/* The error of a form at a size: between rungs linear over the size's logarithm, held at the first; beyond the
 * last a sprite's grows with the root of the size, as it does before (its texels get larger), the leaves' stays. */
double sv_ladder_error_px(const struct sv_ladder *ladder, enum sv_ladder_form form, double size_px);
/* The size from which on sprites are off by more than error_px (> 0) and leaves would be better, but at most
 * SV_LADDER_MAGNIFIED_PX: those trees are drawn leaf by leaf. */
double sv_ladder_near_px(const struct sv_ladder *ladder, double error_px);

#endif
