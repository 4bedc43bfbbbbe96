/* draw_mesh.h - tree polygons by GL: meshes uploaded once a species, drawn instanced, nearest first. Used by
 * core/tree and by core/relief for objects. */
#ifndef SV_TREE_DRAW_MESH_H
#define SV_TREE_DRAW_MESH_H

#include "core/gl/frame.h"
#include "core/tree/draw.h"
#include "core/tree/draw_cull.h"

struct sv_mesh_draw;

/* Uploads the meshes of the species whose tree_count is not 0; species that share a mesh share the upload.
 * id_first: what layer=id shows is id_first + sv_tree.number (SV_ID_TREE_FIRST; SV_ID_OBJECT_FIRST for
 * objects, core/scene/id.h). Borrows the meshes for life. SV_ENOMEM, SV_EINTERNAL. */
SV_MUST_CHECK enum sv_status sv_mesh_draw_create(const struct sv_tree_draw_species *species,
                                                 int species_count, uint32_t id_first,
                                                 struct sv_mesh_draw **draw, struct sv_error *error);
void sv_mesh_draw_destroy(struct sv_mesh_draw *draw); /* NULL is legal */
/* Draws entries[0 .. count) of trees. lights: what sunlight arrives at each (shade.h); {NULL, NULL}: all of
 * it, by programs that know nothing of it. */
SV_MUST_CHECK enum sv_status sv_mesh_draw_trees(struct sv_mesh_draw *draw, const struct sv_gl_frame *frame,
                                                const struct sv_tree *trees,
                                                const struct sv_cull_entry *entries, uint32_t count,
                                                struct sv_tree_lights lights, struct sv_error *error);

#endif
