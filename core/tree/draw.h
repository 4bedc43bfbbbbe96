/* draw.h - a forest drawn: which trees a view can see, each in a form that shows it well enough.
 *
 * Forms (design.md section 4): polygons and billboard clouds are drawn by OSMesa into the bound target; the
 * coarse form (sprite.h) and `auto`, which is leaf splats near and sprites far, on the CPU over what GL has
 * drawn before (canvas.h). Only what a view asks for is built: meshes and clouds when first drawn, sprites
 * and leaf forms with the drawing itself, because nearly every view needs them and workers then share them.
 */
#ifndef SV_TREE_DRAW_H
#define SV_TREE_DRAW_H

#include "core/base/store.h"
#include "core/gl/frame.h"
#include "core/scene/forest.h"
#include "core/tree/canvas.h"
#include "core/tree/mesh.h"
#include "core/tree/shade.h"

struct sv_tree_draw;

struct sv_tree_draw_species {
    const struct sv_tree_mesh *mesh; /* borrowed for life */
    uint64_t key;                    /* for the store */
    uint32_t tree_count;             /* 0: nothing of it is built */
};

/* Names as in /v1/scene and trees=. */
#define SV_TREE_FORM_LIST(X)                       \
    X(SV_TREE_FORM_AUTO, "auto")                   \
    X(SV_TREE_FORM_POLYGON, "polygon")             \
    X(SV_TREE_FORM_BILLBOARD, "billboard")         \
    X(SV_TREE_FORM_INDIRECT, "indirect")           \
    X(SV_TREE_FORM_DENSITY, "density")             \
    X(SV_TREE_FORM_DENSITY_PAPER, "density_paper") \
    X(SV_TREE_FORM_COARSE, "coarse")               \
    X(SV_TREE_FORM_LEAF, "leaf")

enum sv_tree_form {
#define X(name, text) name,
    SV_TREE_FORM_LIST(X)
#undef X
        SV_TREE_FORM_COUNT
};
const char *sv_tree_form_name(enum sv_tree_form form);
/* Whether the form is drawn on the CPU: sv_tree_draw_forest then wants a canvas. */
bool sv_tree_form_on_canvas(enum sv_tree_form form);

/* Between two cubes with sides along the axes: outside of the inner one, not outside of the outer one. A tree
 * is in a cube when its axis, foot to top, meets it as it is grown for the crown (core/base/shell.h); so
 * nested cubes part a forest into trees that are in one shell each. */
struct sv_tree_shell {
    struct sv_vec3 inner, outer; /* centres, world */
    double inner_m, outer_m;     /* half sides; inner_m < 0: none; outer_m = INFINITY: none */
};

struct sv_tree_draw_options {
    enum sv_tree_form form;
    double error_px; /* AUTO: trees are sprites where those are off by at most this (ladder.h), > 0 */
    double
        near_scale; /* AUTO: leaves begin at so many times the size at which they would by the ladder, > 0 */
    int leaf_samples; /* a pixel, of leaf splats, into a canvas of colour and depth alone: 1, 2, 4, 8, 16;
                         else 1 */
    bool color_only;  /* nobody reads depth, id or normal after this call: blended forms leave them alone */
    const struct sv_tree_shade *shade; /* NULL: no shadows; else made of this drawing, updated for the frame's
                                          sun */
    const struct sv_canvas *canvas; /* forms on the CPU: what terrain and objects left, of the frame's size */
    const struct sv_tree_shell *shell; /* NULL: all trees */
};
#define SV_TREE_DRAW_OPTIONS_DEFAULT \
    ((struct sv_tree_draw_options){SV_TREE_FORM_AUTO, 1, 1, 4, false, NULL, NULL, NULL})

/* A tree that fades from one form into the other counts in both. */
struct sv_tree_draw_stats {
    uint32_t trees[SV_TREE_FORM_COUNT]; /* drawn in each form; [AUTO]: 0 */
    uint32_t culled_trees;
};

/* Builds (or takes from the store) what `auto` needs of every species that has trees. Heights in the forest
 * are metres, meshes have height 1. store may be NULL; it is kept. */
SV_MUST_CHECK enum sv_status sv_tree_draw_create(const struct sv_tree_draw_species *species,
                                                 int species_count, const struct sv_forest *forest,
                                                 struct sv_store *store, struct sv_tree_draw **draw,
                                                 struct sv_error *error);
/* The forest has changed in place: species as for create, as many as before, with their trees of now. Builds
 * what has got its first tree; what has lost its last one stays. Errors as for create (the drawing is of no
 * use then). */
SV_MUST_CHECK enum sv_status sv_tree_draw_change(struct sv_tree_draw *draw,
                                                 const struct sv_tree_draw_species *species,
                                                 struct sv_error *error);
/* What the forest in sunlight needs of a species (shade.h). */
struct sv_shade_species sv_tree_draw_shade_species(const struct sv_tree_draw *draw, int species);
void sv_tree_draw_destroy(struct sv_tree_draw *draw);
/* SV_EINVAL: error_px is not above 0, or the canvas does not fit. */
SV_MUST_CHECK enum sv_status sv_tree_draw_forest(struct sv_tree_draw *draw, const struct sv_gl_frame *frame,
                                                 const struct sv_tree_draw_options *options,
                                                 struct sv_tree_draw_stats *stats, struct sv_error *error);
/* How many trees of the shell (NULL: of all) sv_tree_draw_forest would draw; planes as sv_camera_planes gives
 * them. */
SV_MUST_CHECK enum sv_status sv_tree_draw_count(struct sv_tree_draw *draw, const struct sv_camera *camera,
                                                const double planes[5][4], const struct sv_tree_shell *shell,
                                                uint32_t *count, struct sv_error *error);
/* The forest in sunlight (shade.h), from the sprites of this drawing, which must outlive it. SV_ENOMEM. */
SV_MUST_CHECK enum sv_status sv_tree_draw_shade_create(const struct sv_tree_draw *draw,
                                                       struct sv_tree_shade **shade, struct sv_error *error);
/* From which height in the picture on, px, trees of a species are leaf splats in AUTO; INFINITY for a species
 * without trees. */
double sv_tree_draw_near_px(const struct sv_tree_draw *draw, int species, double error_px);
/* Bytes that a species takes in a form, textures with mip levels: as measured once it is built here; before,
 * by the sizes of what will be built (of billboard clouds the textures alone: planes take 0.6 MB more). 0 for
 * AUTO and for a species without trees. */
size_t sv_tree_draw_bytes(const struct sv_tree_draw *draw, int species, enum sv_tree_form form);
/* Whether nothing is left to be built of the form before it is drawn: it is there, or in the store. */
bool sv_tree_draw_built(const struct sv_tree_draw *draw, int species, enum sv_tree_form form);
/* Builds into the store what a form lacks, species by species; no GL, any process, in the background of
 * drawing too (draw is only read). Without a store it would be lost: nothing is done. */
SV_MUST_CHECK enum sv_status sv_tree_draw_build(const struct sv_tree_draw *draw, enum sv_tree_form form,
                                                struct sv_error *error);
/* Builds into the store what sv_tree_draw_create would build of one species; any process, no GL. */
SV_MUST_CHECK enum sv_status sv_tree_draw_prepare(const struct sv_tree_draw_species *species,
                                                  struct sv_store *store, struct sv_error *error);

#endif
