/* panels_refine.h - the panels of cells drawn again from the ray-cast truth (core/truth/texels.h), at many
 * samples a texel: what an idle worker does for panels in demand. The same panel as sv_panels_draw makes, of
 * polygons in place of sprites and splats.
 *
 * Measured (walkthrough --refine 16, one pose of a flight at 512 x 512 from panels of 1024, against 64
 * samples of the truth): mean absolute error 2.9 levels and SSIM 0.927 over 5,000 trees, 3.3 and 0.893 over
 * 45,000; a ray cast of four samples a pixel 5.1 and 0.843, 6.1 and 0.775. 16 panels take 103 s of processor
 * time, 17 of 45,000 trees 229 s. Before texels of refined panels were blended bilinearly (one overview at
 * 256 x 256): 3.9 and 0.858 at 16 samples, 6.0 and 0.739 at 4, 10.6 and 0.582 at 1; built panels 5.2 and
 * 0.736. 1 to 2.5 us a sample. What is drawn directly gains
 * nothing, but for the shadows on the ground (cells_shadow.h).
 *
 * Row by row: a panel of 1024 x 1024 texels takes minutes, and who draws it must be free for a view at any
 * time. One thread. */
#ifndef SV_VIEW_PANELS_REFINE_H
#define SV_VIEW_PANELS_REFINE_H

#include "core/truth/truth.h"
#include "core/view/panels.h"

struct sv_panels_refinement;

/* Begins to draw the panel. samples: 1, 4, 16 or 64. Borrows scene and truth until it is destroyed; the
 * order's view is copied. When the scene changes, it is only to be destroyed. Errors of sv_panel_room_create
 * and sv_truth_part_create. */
SV_MUST_CHECK enum sv_status sv_panels_refine_begin(const struct sv_scene *scene,
                                                    const struct sv_truth *truth,
                                                    const struct sv_panels_order *order, int samples,
                                                    struct sv_panels_refinement **refinement,
                                                    struct sv_error *error);
/* Draws the next row; false when none is left, and the panel is whole. */
bool sv_panels_refine_row(struct sv_panels_refinement *refinement);
/* Bytes of the block that holds the whole panel. */
size_t sv_panels_refine_measure(struct sv_panels_refinement *refinement);
/* Writes it, measured, into a block of at least as many bytes. Errors of sv_panel_write. */
SV_MUST_CHECK enum sv_status sv_panels_refine_write(const struct sv_panels_refinement *refinement,
                                                    void *block, size_t bytes, struct sv_error *error);
/* NULL is legal. */
void sv_panels_refine_destroy(struct sv_panels_refinement *refinement);

#endif
