/* leaf_splat.h - near trees drawn on the CPU: a species' mesh, leaf cards as parallelograms, into a canvas.
 *
 * Exact at fraction 1 (and level_0): the picture that trees=polygon has at one sample a pixel (the alpha rule
 * of mesh.h, the light of tree_mesh.frag), found per pixel by the ray through its centre. At smaller
 * fractions a tree is thinned out after Cook, Halstead, Planck and Ryu, "Stochastic simplification of
 * aggregate detail" (SIGGRAPH 2007, section 3): leaves are left out in a stored random order, those that stay
 * grow in area so that the sum stays; the last ones shrink to nothing before they go, so that nothing pops.
 *
 * Forms are made from meshes when first drawn, or before any fork by sv_leaf_splat_prepare. No GL. One thread
 * at a time an object. A function of its arguments alone: the same picture at every SIMD level. */
#ifndef SV_TREE_LEAF_SPLAT_H
#define SV_TREE_LEAF_SPLAT_H

#include "core/scene/forest.h"
#include "core/scene/light.h"
#include "core/tree/canvas.h"
#include "core/tree/draw.h"
#include "core/tree/draw_cull.h"
#include "core/tree/shade.h"
#include "core/view/camera.h"

struct sv_leaf_splat;

struct sv_leaf_view {
    struct sv_camera camera;
    struct sv_light light;
    double shift_x_px, shift_y_px; /* the sample inside the pixel (sv_camera_sample_offset) */
};

/* What is drawn: entries[0 .. count) of trees, nearest first for speed alone. */
struct sv_leaf_splat_trees {
    const struct sv_tree *trees;
    const struct sv_cull_entry *entries;
    uint32_t count;
    const float
        *fraction; /* by entry: share of the leaves, 0..1, that is drawn; NULL: sv_leaf_splat_fraction */
    const float *weight; /* by entry: share of those that has come, 0..1, for cross-fades; NULL: 1 */
    int samples;  /* a pixel: 1, 2, 4, 8 or 16, on a lattice of its own; more than 1: colour alone (below) */
    bool level_0; /* colour from the textures' own texels, as trees=polygon has it; else from the level whose
                     texels are about a pixel: nearer to the mean over the pixel, and faster */
    struct sv_tree_lights lights; /* {NULL, NULL}: no shadows */
    uint32_t id_first;            /* id is this + sv_tree.number */
};

struct sv_leaf_splat_stats {
    uint32_t trees, hidden_trees;       /* drawn, in each band; hidden by what is nearer, all of them */
    uint32_t clusters, hidden_clusters; /* of those drawn: seen by the camera; hidden by what is nearer */
    uint64_t pixels;     /* shaded */
};

/* Borrows meshes for life; species whose tree_count is 0 have no form. Species that share a mesh share the
 * form. SV_ENOMEM. */
SV_MUST_CHECK enum sv_status sv_leaf_splat_create(const struct sv_tree_draw_species *species,
                                                  int species_count, struct sv_leaf_splat **splat,
                                                  struct sv_error *error);
void sv_leaf_splat_destroy(struct sv_leaf_splat *splat); /* NULL is legal */
/* Lets a species have a form that had no trees before; nothing for one that may have it already. */
void sv_leaf_splat_add(struct sv_leaf_splat *splat, int k, const struct sv_tree_mesh *mesh);
/* Makes a species' form now. */
SV_MUST_CHECK enum sv_status sv_leaf_splat_prepare(struct sv_leaf_splat *splat, int species,
                                                   struct sv_error *error);
/* Bytes of a species' form, 0 when not made. */
size_t sv_leaf_splat_bytes(const struct sv_leaf_splat *splat, int species);

/* Share of a tree's leaves that a picture needs of it at a height of height_px, 0..1: 1 near by; below,
 * leaves are left out until those that stay are about a pixel large. Continuous in height_px. 1 for a species
 * without leaves or without a form. */
float sv_leaf_splat_fraction(const struct sv_leaf_splat *splat, int species, double height_px);

/* Draws trees into the canvas' band. More than one sample a pixel: the colour is the mean in linear light of
 * what the samples show, the canvas' own colour where they show nothing of the trees (so that what lies
 * behind, far trees too, is to be there before); depth is written where half of them or more show a tree,
 * that of the nearest. SV_ENOMEM (the canvas holds some of the trees then); SV_EINVAL for a canvas that is
 * not of the camera's size, for a tree of a species without a mesh, for another number of samples, and for
 * more than one with a plane of ids or normals. stats may be NULL. */
SV_MUST_CHECK enum sv_status sv_leaf_splat_draw(struct sv_leaf_splat *splat, const struct sv_leaf_view *view,
                                                const struct sv_canvas *canvas,
                                                const struct sv_leaf_splat_trees *trees,
                                                struct sv_leaf_splat_stats *stats, struct sv_error *error);

#endif
