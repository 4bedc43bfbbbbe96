/* rings.c - see rings.h. */
#include "core/view/rings.h"

/* Rings of crowns go inward to about CROWNS_INNER_M: crowns are up to some 5 m wide, and a crown may reach
 * half the way across its ring's plane. Ground has no width: it goes on inward. */
#define CROWNS_INNER_M 6.0
#define GROUND_INNER_M 1.5
/* From which height over the ground on reference points are at the tops of cells. */
#define TOP_AGL_M 3000.0

bool sv_view_rings(const struct sv_resolved_view *view, struct sv_view_rings *rings)
{
    struct sv_view_rings r = {.top = view->camera.eye.z - view->ground_z > TOP_AGL_M};
    sv_cell_rings_make(view->plan.relief_distance_m, GROUND_INNER_M, SV_VIEW_RINGS_PITCH, &r.rings);
    if (!sv_cell_chain(&r.rings, view->camera.eye, r.top, r.chain))
        return false;
    while (r.crowns_first < r.rings.count - 1 && r.rings.distance_m[r.crowns_first] < CROWNS_INNER_M)
        r.crowns_first++;
    *rings = r;
    return true;
}
