/* draw_cloud.h - trees drawn as billboard clouds by GL: the planes of cloud.h, textured in one of several
 * forms.
 *
 * A form is a row of a table (draw_cloud_form.h): how its textures are made (any process), uploaded, and
 * which fragment shader reads them. Light is that of tree_mesh.frag, so that forms shade alike. A plane
 * covers the octagon about what it shows; one that is seen nearly edge-on is left out.
 *
 * Colour is blended, farthest tree first and in each tree farthest plane first: a texel's coverage is a share
 * of the pixel, and what planes behind each other leave open multiplies. Depth, id and normal are hard: an
 * alpha test, nearest first, in a second pass. Against an alpha test for colour (the papers' way, which a
 * form may choose: one pass) blending costs 1.3 to 2 times as much and halves the error: a tree of 100 px is
 * off by 8 of 255 instead of 13, nearer than its own polygons drawn with one sample a pixel (11).
 *
 * A species' cloud and a form's textures are made when first drawn, or taken from the store; prepare makes
 * them beforehand, in any process. One thread at a time an object. */
#ifndef SV_TREE_DRAW_CLOUD_H
#define SV_TREE_DRAW_CLOUD_H

#include "core/base/store.h"
#include "core/gl/frame.h"
#include "core/tree/cloud.h"
#include "core/tree/draw.h"
#include "core/tree/draw_cull.h"

enum sv_cloud_form {
    SV_CLOUD_FORM_BILLBOARD,
    SV_CLOUD_FORM_INDIRECT,
    SV_CLOUD_FORM_DENSITY,
    SV_CLOUD_FORM_DENSITY_PAPER,
    SV_CLOUD_FORM_COUNT
};

struct sv_cloud_draw;

/* "billboard" and the like; NULL for a value that is none. */
const char *sv_cloud_form_name(enum sv_cloud_form form);

/* Borrows the meshes for life, keeps store (may be NULL). Builds nothing yet. Species of tree_count 0 are
 * never drawn; species that share a mesh share their clouds. SV_ENOMEM, SV_EINTERNAL. */
SV_MUST_CHECK enum sv_status sv_cloud_draw_create(const struct sv_tree_draw_species *species,
                                                  int species_count, struct sv_store *store,
                                                  const struct sv_cloud_options *options,
                                                  struct sv_cloud_draw **draw, struct sv_error *error);
void sv_cloud_draw_destroy(struct sv_cloud_draw *draw); /* NULL is legal */
/* Builds a species' form if it is not there yet: done by the first draw otherwise. */
SV_MUST_CHECK enum sv_status sv_cloud_draw_build(struct sv_cloud_draw *draw, int species,
                                                 enum sv_cloud_form form, struct sv_error *error);
/* Draws entries[0 .. count) of trees, which come nearest first. color_only: nobody reads depth, id or normal
 * after this call (forms with an alpha test write them nevertheless). lights: what sunlight arrives at each
 * (shade.h); {NULL, NULL}: all of it. */
SV_MUST_CHECK enum sv_status sv_cloud_draw_trees(struct sv_cloud_draw *draw, enum sv_cloud_form form,
                                                 const struct sv_gl_frame *frame, const struct sv_tree *trees,
                                                 const struct sv_cull_entry *entries, uint32_t count,
                                                 bool color_only, struct sv_tree_lights lights,
                                                 struct sv_error *error);
/* GL bytes of a species in a form: textures with mip levels, and the planes; 0 when it is not built. */
size_t sv_cloud_draw_bytes(const struct sv_cloud_draw *draw, int species, enum sv_cloud_form form);
/* What the form's textures will take of that (planes take 0.6 MB more), whether or not it is built. */
size_t sv_cloud_form_bytes(const struct sv_tree_mesh *mesh, enum sv_cloud_form form,
                           const struct sv_cloud_options *options);
/* Whether the store has all that drawing the form needs. */
bool sv_cloud_form_kept(const struct sv_tree_draw_species *species, enum sv_cloud_form form,
                        const struct sv_cloud_options *options, struct sv_store *store);
/* The species' cloud; NULL when it is not built. */
const struct sv_tree_cloud *sv_cloud_draw_cloud(const struct sv_cloud_draw *draw, int species);

/* Makes what the form needs of a species and keeps it in the store; no GL, any process. Who else builds the
 * same then waits for it (sv_store_claim). */
SV_MUST_CHECK enum sv_status sv_cloud_form_prepare(const struct sv_tree_draw_species *species,
                                                   enum sv_cloud_form form,
                                                   const struct sv_cloud_options *options,
                                                   struct sv_store *store, struct sv_error *error);

#endif
