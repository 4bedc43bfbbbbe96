/* rings.c - see rings.h. */
#include "core/view/rings.h"

/* Rings of crowns go inward to about CROWNS_INNER_M: crowns are up to some 5 m wide, and a crown may reach
 * half the way across its ring's plane. Ground has no width: it goes on inward. */
#define CROWNS_INNER_M 6.0
#define GROUND_INNER_M 1.5
/* The outermost ring is that many scene distances away: crowns far behind one another, that move apart when the eye
 * does, are then in rings of their own. */
#define OUTWARD 4

bool sv_view_rings(const struct sv_resolved_view *view, struct sv_view_rings *rings)
{
    /* V at the tops of cells (design.md 6) opens no holes in the ground, but crowns, a texel of which is a crown and what
     * is seen through it, come apart: from 0.4 D above, skylines grew solid. So V is in the middle. */
    struct sv_view_rings r = {.top = false};
    sv_cell_rings_make(view->plan.relief_distance_m * OUTWARD, GROUND_INNER_M, view->plan.relief_pitch, &r.rings);
    if (!sv_cell_chain(&r.rings, view->camera.eye, r.top, r.chain))
        return false;
    while (r.crowns_first < r.rings.count - 1 && r.rings.distance_m[r.crowns_first] < CROWNS_INNER_M)
        r.crowns_first++;
    *rings = r;
    return true;
}
