/* panels.h - draws the panels of cells: crowns and ground (core/cell/panel.h). */
#ifndef SV_VIEW_PANELS_H
#define SV_VIEW_PANELS_H

#include "core/cell/panel.h"
#include "core/view/direct.h"

struct sv_panels;

/* Tangent at the edge of a ground panel of that size: one texel beyond its face, so that neighbours leave no
 * crack. */
double sv_panels_ground_reach(int size);

/* Borrows scene and direct for life. SV_ENOMEM. */
SV_MUST_CHECK enum sv_status sv_panels_create(const struct sv_scene *scene, struct sv_direct *direct,
                                              struct sv_panels **panels, struct sv_error *error);
void sv_panels_destroy(struct sv_panels *panels); /* NULL is legal */

/* A panel to be drawn under a view's light and plan; the view's camera is not read. */
struct sv_panels_order {
    struct sv_panel_about about; /* layers: exactly one */
    struct sv_cell_shell shell;  /* of crowns */
    const struct sv_resolved_view *view;
};

/* The camera at its reference point that sees its face, a pixel a texel. */
struct sv_camera sv_panels_camera(const struct sv_panels_order *order);
/* Texels a side that it needs: order->about.size, or SV_PANEL_SIZE_MIN of a panel of crowns that shows none.
 */
SV_MUST_CHECK enum sv_status sv_panels_size(struct sv_panels *panels, const struct sv_panels_order *order,
                                            int *size, struct sv_error *error);
/* Draws it, and keeps it until the next one is drawn; *bytes: of the block that holds it. Errors of direct.h.
 */
SV_MUST_CHECK enum sv_status sv_panels_draw(struct sv_panels *panels, const struct sv_panels_order *order,
                                            size_t *bytes, struct sv_error *error);
/* Writes the panel that was drawn last into a block of at least as many bytes. Errors of sv_panel_write. */
SV_MUST_CHECK enum sv_status sv_panels_write(const struct sv_panels *panels, void *block, size_t bytes,
                                             struct sv_error *error);

/* The half side of the largest cube of a ring, outermost first, about its place's reference point that
 * touches neither ground nor object: that ring, or -1. */
int sv_panels_free_ring(const struct sv_panels *panels, const struct sv_cell_rings *rings,
                        const struct sv_cell_place chain[SV_CELL_RINGS_MAX]);

#endif
