/* bands.h - one picture that several processes draw, of each a band of its rows.
 *
 * Bands are parts of the whole, byte for byte, as long as all are drawn in one way. With relief=auto what
 * that is is decided by what was measured (core/cell/admit.h), which changes from moment to moment: so the
 * first that decides tells the others. How, is for whoever starts the processes. No drawing here. */
#ifndef SV_VIEW_BANDS_H
#define SV_VIEW_BANDS_H

#include "core/view/resolved.h"

/* What those who draw one picture share. */
struct sv_bands {
    void *context;
    /* The level that was agreed on; when none is yet, that becomes `level` unless it is negative. Negative:
     * none is. */
    int (*agree)(void *context, int level);
};

/* Whether a view is drawn in bands. Not in paper 1's own way, which takes the whole picture's z-buffer; and
 * not with trees in forms that OSMesa draws, which are there to be measured: each band would transform all of
 * them, and the first would build them. */
static inline bool sv_bands_can(const struct sv_resolved_view *view)
{
    static const bool by_gl[SV_TREES_COUNT] = {[SV_TREES_POLYGON] = true,
                                               [SV_TREES_BILLBOARD] = true,
                                               [SV_TREES_INDIRECT] = true,
                                               [SV_TREES_DENSITY] = true,
                                               [SV_TREES_DENSITY_PAPER] = true};
    const struct sv_plan *plan = &view->plan;
    return plan->relief != SV_RELIEF_PAPER && (plan->raycast || !plan->draw_trees || !by_gl[plan->trees]);
}

#endif
