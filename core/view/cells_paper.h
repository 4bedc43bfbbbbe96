/* cells_paper.h - a view drawn as paper 1, section 5, draws it (relief=paper): for measuring the direct warp
 * (cells.h) against.
 *
 * One ring, of the view's relief distance D. Panels of 4 D x 4 D about a reference point V, of which only
 * what a 90-degree pyramid sees is ever filled, and kept (the view's relief resolution over 90 degrees):
 * drawn from V by OSMesa and the kernels of trees, the z-buffer made displ by (7) to (9) (build.h), each view
 * pre-warped in two serial passes (prewarp.h) and texture-mapped as quads (draw_prewarp.h), opposite wedge
 * first, own wedge last. V stays while the eye is in its region M (region.h); then comes the next one, of the
 * diamond lattice in plan (figure 7), as high over the ground as the eye, or, where the land is too steep for
 * that, the eye's own place. What is in the cube of half side D about V is geometry, drawn each frame.
 *
 * Departures, with their reasons. Steep views end above or below all four sides, so a panel above and one
 * below are drawn where a view sees them: M is the same for six (algorithms.md 2.3). Trees are whole: one
 * whose axis meets the cube is near, every other is in panels, and its crown may reach into the cube. Pixels
 * where a panel has nothing but the ground or an object is seen (cracks half a texel wide at the plane, and
 * what comes out from behind an edge with nothing but sky behind it) take that geometry, which is at hand.
 * Sky is no texel. One thread, with the context of `direct`. */
#ifndef SV_VIEW_CELLS_PAPER_H
#define SV_VIEW_CELLS_PAPER_H

#include "core/view/direct.h"

struct sv_cells_paper;

struct sv_cells_paper_report {
    struct sv_vec3 v;          /* the reference point */
    uint32_t built;            /* panels, for this view */
    uint32_t warped;           /* panels that this view is drawn from */
    uint64_t holes;            /* samples of the pre-warped textures, filled from the far side */
    uint64_t geometry;         /* pixels beyond the cube that no panel holds */
    double ms[SV_STAGE_COUNT]; /* cell, warp, near, composite; negative: did not run */
};

/* Borrows scene and direct for life; clock_ms may be NULL. SV_ENOMEM, SV_EINTERNAL. */
SV_MUST_CHECK enum sv_status sv_cells_paper_create(const struct sv_scene *scene, struct sv_direct *direct,
                                                   double (*clock_ms)(void), struct sv_cells_paper **cells,
                                                   struct sv_error *error);
void sv_cells_paper_destroy(struct sv_cells_paper *cells); /* NULL is legal */

/* Draws a view (one that sv_cells_can) into rgba (width * height * 4; sRGB, premultiplied; alpha 255
 * everywhere where sky is true). Panels of the last two cells are kept. What is drawn depends on which V was
 * current before. Errors of direct.h; SV_EINVAL: the view's distance or resolution is none. */
SV_MUST_CHECK enum sv_status sv_cells_paper_draw(struct sv_cells_paper *cells,
                                                 const struct sv_resolved_view *view, bool sky, uint8_t *rgba,
                                                 struct sv_cells_paper_report *report,
                                                 struct sv_draw_stats *stats, struct sv_error *error);

#endif
