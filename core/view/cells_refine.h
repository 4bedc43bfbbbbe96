/* cells_refine.h - panels in demand, drawn again from the ray-cast truth and put in place of the built ones
 * (panels_refine.h), a row at a time: for workers that have nothing else to do. Before them come pages of the
 * shadows that fall on ground which is drawn directly (cells_shadow.h): the finest first, they are cheap.
 *
 * A panel takes longer than a worker is idle for, so what is begun is kept from call to call, reserved in the
 * cache, until it is whole, or the scene changes, or another view is refined that does not use it. Views find
 * the built one all the while. One thread, that of the cells. */
#ifndef SV_VIEW_CELLS_REFINE_H
#define SV_VIEW_CELLS_REFINE_H

#include "core/truth/truth.h"
#include "core/view/cells.h"

struct sv_cells_refiner;

/* options: as cells was made with; its slot as it is now. Borrows all else for life. SV_ENOMEM. */
SV_MUST_CHECK enum sv_status sv_cells_refiner_create(const struct sv_scene *scene,
                                                     const struct sv_truth *truth, struct sv_cells *cells,
                                                     const struct sv_cells_options *options,
                                                     struct sv_cells_refiner **refiner,
                                                     struct sv_error *error);
void sv_cells_refiner_destroy(
    struct sv_cells_refiner *refiner); /* NULL is legal; gives back what it reserved */
/* Lets go of what is begun: before the scene or the truth changes. */
void sv_cells_refiner_drop(struct sv_cells_refiner *refiner);

struct sv_cells_refine_options {
    int samples;                 /* a texel: 1, 4, 16, 64 */
    int scale;                   /* texels of a refined panel to one of a built one, along a side, >= 1 */
    bool shadows_alone;          /* panels stay as they are */
    uint32_t most;               /* panels and pages to make whole */
    bool (*stop)(void *context); /* polled after each row: a call gets on by a row at least; NULL: never */
    void *context;
};
struct sv_cells_refine_report {
    uint32_t refined; /* panels and pages that are whole now, */
    uint32_t shadows; /* of these pages */
    uint32_t left;    /* that are to be refined still, but for those that others refine now */
};

/* Refines the shadows of the view and then its panels that are built and not refined yet, nearest ring first,
 * until all are or as many as is said, or `stop` is true. Panels that are missing, that show nothing, or for
 * which the cache has no room now are passed over. */
SV_MUST_CHECK enum sv_status sv_cells_refine(struct sv_cells_refiner *refiner,
                                             const struct sv_resolved_view *view,
                                             const struct sv_cells_refine_options *options,
                                             struct sv_cells_refine_report *report, struct sv_error *error);

#endif
