/* rings.h - the rings of cells that a view's eye is in: one rule for who draws panels, who routes views and
 * who lists cells.
 *
 * Plain values, any thread. */
#ifndef SV_VIEW_RINGS_H
#define SV_VIEW_RINGS_H

#include <stdbool.h>

#include "core/cell/lattice.h"
#include "core/view/resolved.h"

struct sv_view_rings {
    struct sv_cell_rings rings;
    struct sv_cell_place chain[SV_CELL_RINGS_MAX];
    bool top;         /* reference points are at the tops of cells */
    int crowns_first; /* innermost ring of crowns */
};

/* From the eye, plan.relief_distance_m and plan.relief_pitch. False, with nothing written, where there
 * are no cells: a distance that is not above 0, an eye that is not finite or too far out (sv_cell_chain). */
bool sv_view_rings(const struct sv_resolved_view *view, struct sv_view_rings *rings);

#endif
