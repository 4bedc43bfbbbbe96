/* draw.h - trees drawn by OSMesa: polygons near, a baked impostor far, instanced, culled on the forest's
 * hierarchy. */
#ifndef SV_TREE_DRAW_H
#define SV_TREE_DRAW_H

#include "core/base/store.h"
#include "core/gl/frame.h"
#include "core/scene/forest.h"
#include "core/tree/mesh.h"
#include "core/tree/shade.h"

struct sv_tree_draw;

struct sv_tree_draw_species {
    const struct sv_tree_mesh *mesh; /* borrowed for life */
    uint64_t key;                    /* for the store */
    uint32_t tree_count;             /* 0: nothing of it is built */
};

enum sv_tree_form { SV_TREE_FORM_AUTO, SV_TREE_FORM_POLYGON, SV_TREE_FORM_IMPOSTOR };

struct sv_tree_draw_options {
    enum sv_tree_form form;
    double polygon_px;        /* AUTO: trees at least this tall in the picture are polygons ... */
    uint32_t triangle_budget; /* ... nearest first, until this many triangles are spent */
    bool color_only; /* nobody reads depth, id or normal after this call: impostors leave them alone, which is
                        faster */
    const struct sv_tree_shade *shade; /* NULL: no shadows; else made of this drawing, updated for the frame's
                                          sun */
};
#define SV_TREE_DRAW_OPTIONS_DEFAULT \
    ((struct sv_tree_draw_options){SV_TREE_FORM_AUTO, 160, 400000, false, NULL})

struct sv_tree_draw_stats {
    uint32_t polygon_trees, impostor_trees, culled_trees;
    uint64_t triangles;
};

/* Bakes (or takes from the store) the impostors of every species that has trees, uploads everything. Heights
 * in the forest are metres, meshes have height
 * 1. store may be NULL. */
SV_MUST_CHECK enum sv_status sv_tree_draw_create(const struct sv_tree_draw_species *species,
                                                 int species_count, const struct sv_forest *forest,
                                                 struct sv_store *store, struct sv_tree_draw **draw,
                                                 struct sv_error *error);
void sv_tree_draw_destroy(struct sv_tree_draw *draw);
SV_MUST_CHECK enum sv_status sv_tree_draw_forest(struct sv_tree_draw *draw, const struct sv_gl_frame *frame,
                                                 const struct sv_tree_draw_options *options,
                                                 struct sv_tree_draw_stats *stats, struct sv_error *error);
/* The forest in sunlight (shade.h), from the impostors of this drawing, which must outlive it. SV_ENOMEM. */
SV_MUST_CHECK enum sv_status sv_tree_draw_shade_create(const struct sv_tree_draw *draw,
                                                       struct sv_tree_shade **shade, struct sv_error *error);
/* Bytes that a species takes in a form (POLYGON or IMPOSTOR), textures with mip levels; 0 when not built. */
size_t sv_tree_draw_bytes(const struct sv_tree_draw *draw, int species, enum sv_tree_form form);
/* Bakes one species' impostor into the store (needs a current GL context); what the scene process does side
 * by side in forked children. */
SV_MUST_CHECK enum sv_status sv_tree_impostor_prepare(const struct sv_tree_draw_species *species,
                                                      struct sv_store *store, struct sv_error *error);

#endif
