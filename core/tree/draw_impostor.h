/* draw_impostor.h - far trees by GL: one textured quad a tree, blended back to front. Private to core/tree.
 *
 * The atlases of all species are layers of two array textures, so one draw call takes all trees in one order.
 * Corners and light are worked out on the CPU, 0.1 us a tree: OSMesa runs the vertex stage once an instance,
 * which costs more than that for quads of four vertices. Colour is blended (crowns are antialiased by their
 * baked coverage); depth, id and normal are hard: coverage of at least one half. */
#ifndef SV_TREE_DRAW_IMPOSTOR_H
#define SV_TREE_DRAW_IMPOSTOR_H

#include "core/base/store.h"
#include "core/gl/frame.h"
#include "core/tree/draw.h"
#include "core/tree/draw_cull.h"

struct sv_quad_draw;

/* Takes each species' atlas from the store, or bakes it (and puts it there). */
SV_MUST_CHECK enum sv_status sv_quad_draw_create(const struct sv_tree_draw_species *species,
                                                 int species_count, struct sv_store *store,
                                                 struct sv_quad_draw **draw, struct sv_error *error);
void sv_quad_draw_destroy(struct sv_quad_draw *draw); /* NULL is legal */
/* Draws entries[0 .. count) of trees, farthest first. soft_only: colour alone, no depth, id or normal.
 * lights: what sunlight arrives at each (shade.h); {NULL, NULL}: all of it, by a program that knows nothing
 * of it. */
SV_MUST_CHECK enum sv_status sv_quad_draw_trees(struct sv_quad_draw *draw, const struct sv_gl_frame *frame,
                                                const struct sv_tree *trees,
                                                const struct sv_cull_entry *entries, uint32_t count,
                                                bool soft_only, struct sv_tree_lights lights,
                                                struct sv_error *error);
/* What shade.h needs of a species (frames NULL: not built); valid as long as draw. */
struct sv_shade_species sv_quad_draw_shade_species(const struct sv_quad_draw *draw, int species);
size_t sv_quad_draw_bytes(const struct sv_quad_draw *draw, int species);

#endif
