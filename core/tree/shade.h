/* shade.h - trees in sunlight: what they keep from the ground, and what the terrain and their neighbours keep
 * from them.
 *
 * For one direction of the sun (update) there are two results:
 * - silhouettes of every species as the sun sees it, in SV_SHADE_TURNS turns about the stem, prefiltered;
 *   cast() puts those of all trees that can reach a shadow window (core/terrain/shadow_window.h) into it;
 * - the share of sunlight that arrives at each tree, on a small grid of its own (SV_SHADE_COLUMNS in depth
 *   along the light, SV_SHADE_ROWS along "up" as the sun sees it), after the terrain's shadow and the crowns
 * of other trees, never its own: the tree's own crown is sv_tree_vertex.open. draw.h takes it as
 * options.shade.
 *
 * Own derivation of the second: in the plane square to the light a tree's shade is a picture (paper 1, 3.3.2,
 * step (2)). A tree is two halves, the one nearer to the sun and the one behind it, of equal transmittance;
 * halves of all trees are taken in the order in which light reaches them; each first reads what light is left
 * in its outline, then multiplies its own transmittance into the picture. So every tree costs its own texels
 * twice, however long shadows are, the light that all get together is what the sun sees of the stand, and
 * crowns that reach into each other are lit on top and dark below, as one share a tree would not have it.
 *
 * Silhouettes come from the impostor's frames (impostor.h), laid into space as its quads are, so that nothing
 * is rasterised when the sun moves. No GL. One thread at a time an object. Deterministic: results depend on
 * forest, species and sun alone, never on earlier suns. */
#ifndef SV_TREE_SHADE_H
#define SV_TREE_SHADE_H

#include "core/scene/forest.h"
#include "core/terrain/shadow_window.h"
#include "core/tree/impostor.h"

enum { SV_SHADE_TURNS = 16, SV_SHADE_COLUMNS = 2, SV_SHADE_ROWS = 4, SV_SHADE_SUNS = 3 };

/* What is known of a species. */
struct sv_shade_species {
    const struct sv_impostor_frame *frames; /* SV_IMPOSTOR_FRAMES, borrowed for life; NULL: has no trees */
    const uint8_t *coverage; /* SV_IMPOSTOR_SIDE squared, row 0 at the top: share covered, * 255; borrowed */
    float radius;            /* of the crown, in heights */
};

/* Light that arrives at a tree: share of sunlight * 255 at the grid's nodes; [c][r], r from the lowest up. */
struct sv_tree_light {
    uint8_t share[SV_SHADE_COLUMNS][SV_SHADE_ROWS];
};

/* Where a point of a tree lies on that grid: with p = (point - foot) / height in world axes, column
 * coordinate p . across[0..2] + across[3] (0: middle of the far half, 1: of the near one; held in 0..1) and
 * row coordinate p . along[0..2] + along[3] (0 .. SV_SHADE_ROWS - 1; held there); the share is bilinear
 * between. */
struct sv_tree_light_axes {
    float across[4], along[4];
};

/* For the draw calls: of_tree is indexed as sv_forest.trees, of_species by sv_tree.species. */
struct sv_tree_lights {
    const struct sv_tree_light *of_tree;
    const struct sv_tree_light_axes *of_species;
};

struct sv_tree_shade;

/* World height up to which the terrain (and what else stands there) keeps the sun away at world (x, y); at or
 * below the ground, or -INFINITY or NaN: nothing does. */
typedef double (*sv_shade_ground)(void *context, double x, double y);

/* Borrows forest and what species point to for life. An update takes 8 bytes a tree and up to 0.4 MB a
 * species for each of the SV_SHADE_SUNS that are kept, and 32 bytes a tree and up to 32 MB while it runs.
 * Species that share frames share silhouettes. SV_ENOMEM; SV_EINVAL when a tree is of a species without
 * frames. */
SV_MUST_CHECK enum sv_status sv_tree_shade_create(const struct sv_shade_species *species, int species_count,
                                                  const struct sv_forest *forest,
                                                  struct sv_tree_shade **shade, struct sv_error *error);
void sv_tree_shade_destroy(struct sv_tree_shade *shade); /* NULL is legal */

/* Makes the shade of the sun at to_sun (unit, world) current; free for one of the last SV_SHADE_SUNS.
 * to_sun.z
 * <= 0: night: nothing is cast and no sunlight arrives. ground NULL: no shadow of the terrain. The terrain is
 * taken to be the same for the same sun. SV_EINVAL for a direction that is not finite or of length 0;
 * SV_ENOMEM (the shade before stays current). */
SV_MUST_CHECK enum sv_status sv_tree_shade_update(struct sv_tree_shade *shade, struct sv_vec3 to_sun,
                                                  sv_shade_ground ground, void *ground_context,
                                                  struct sv_error *error);

/* The forest has changed in place (sv_forest_turn_over). */
struct sv_tree_shade_change {
    const struct sv_shade_species
        *species;               /* as many as before, borrowed for life; what has come has frames now */
    const struct sv_tree *gone; /* trees that stood there */
    uint32_t gone_count;
    const uint32_t *from; /* as sv_forest_turn_over gives it */
    struct sv_vec3
        to_sun; /* whose light is carried over, if it is one of those kept; the others are dropped */
    sv_shade_ground ground;
    void *ground_context;
    uint32_t most; /* of more trees the light is not found again: that sun is dropped, too */
};

/* Finds the light of one sun again where the change can be felt (shade_again.c): at a million trees some
 * milliseconds for a tree, a fifth of a second for 300 all over them. It is what an update would give that
 * knows nothing of before, except when the change makes the number of tiles pass the bound at which the
 * picture of light is made coarser; and all trees are taken again when a step of its texel's size is passed.
 * That sun is current then, none if it was not kept or is dropped. SV_ENOMEM, SV_EINVAL (the shade is of no
 * use then). */
SV_MUST_CHECK enum sv_status sv_tree_shade_change(struct sv_tree_shade *shade,
                                                  const struct sv_tree_shade_change *change,
                                                  struct sv_error *error);

/* Whether the sun at to_sun is one of those that are kept: an update for it is free. */
bool sv_tree_shade_keeps(const struct sv_tree_shade *shade, struct sv_vec3 to_sun);

/* An sv_shadow_caster (context: the sv_tree_shade): casts every tree whose shadow can fall on the window.
 * Nothing before the first update, and at night. */
void sv_tree_shade_cast(void *shade, struct sv_shadow_window *window);

/* Share of sunlight that trees leave at a place of the world, 0..1: what is seen sunward of it, each tree at
 * its outline's coverage, the order along the light taken by the trees' middles. 1 before the first update; 0
 * at night. What scene objects are lit by. Some microseconds. */
double sv_tree_shade_share(const struct sv_tree_shade *shade, struct sv_vec3 place);

/* Light of the current sun; valid until the next update. {NULL, NULL} before the first. */
struct sv_tree_lights sv_tree_shade_lights(const struct sv_tree_shade *shade);

/* Texel of the picture of light that the current sun's lights were taken from, m: with forest and sun it
 * tells them. 0: there are none. */
double sv_tree_shade_texel_m(const struct sv_tree_shade *shade);

/* Share of sunlight at a point p of a tree (world axes, from the foot, in heights), 0..1. Twin: tree_light in
 * core/gl/shaders/tree_light.glsl. */
float sv_tree_light_at(const struct sv_tree_light *light, const struct sv_tree_light_axes *axes,
                       const float p[3]);

/* What sv_tree_vertex.open is multiplied by (and the product held to 1) where shadows are cast. open is the
 * mean over all leaves at a place; rays say that what is SEEN of a crown gets less light from a high sun, and
 * more when the viewer looks along the light and sees what the sun sees (the hot spot). Fitted to the truth's
 * mean light on four species under suns of 5 to 80 degrees, seen from four sides (own derivation). facing:
 * cosine between the directions to the viewer and to the sun. Twin: tree_crown in
 * core/gl/shaders/tree_light.glsl. */
float sv_tree_crown_light(float to_sun_z, float facing);

#endif
