/* cells.h - a view drawn from relief panels of the cells that the eye is in, and what is near drawn over
 * them.
 *
 * Trees stand in rings of panels around the eye (core/cell/lattice.h): each ring is a layer, warped
 * (crown_warp.h) and composed front to back, so that rings show through one another's gaps. Ground is opaque:
 * one set of panels about a reference point whose cube touches neither ground nor object, warped as sheets
 * (core/relief/warp.h); where no cube is free (eyes close to the ground) it is drawn directly. What hides
 * what between trees and ground is decided pixel by pixel by depth. Trees within the innermost cube are in
 * front of all rings: they are drawn directly, of one sample a pixel, softened (soften.h) and taken as the
 * first light; what they hide is neither warped nor shaded.
 *
 * Panels are built when a view needs them and kept in a cache (core/cell/cache.h) that processes may share.
 * Paper 1, section 5; design.md section 6. One thread. */
#ifndef SV_VIEW_CELLS_H
#define SV_VIEW_CELLS_H

#include "core/cell/cache.h"
#include "core/view/bands.h"
#include "core/view/cells_shadow.h"
#include "core/view/direct.h"
#include "core/view/panels.h"
#include "core/view/picture.h"

struct sv_cells;

struct sv_cells_options {
    struct sv_cell_cache *cache; /* borrowed */
    unsigned slot;               /* of this process in it */
    double (*clock_ms)(void);
};

/* Borrows direct and scene for life. SV_ENOMEM. */
SV_MUST_CHECK enum sv_status sv_cells_create(const struct sv_scene *scene, struct sv_direct *direct,
                                             const struct sv_cells_options *options, struct sv_cells **cells,
                                             struct sv_error *error);
void sv_cells_destroy(struct sv_cells *cells); /* NULL is legal */

/* What a view is drawn with. */
struct sv_cells_report {
    uint64_t id;               /* of the eye's innermost cell; stays while the eye does */
    uint32_t hits, built;      /* panels: that were there, that were built for this view */
    uint32_t refined;          /* of hits; panels that show nothing are as good as refined */
    uint64_t hole_pixels;      /* of the ground before filling */
    uint64_t holes_left;       /* ... and after */
    uint32_t left;             /* panels that are missing still (sv_cells_build) */
    int level;                 /* rings of panels that were used, outermost first (core/cell/admit.h) */
    bool ground_direct;        /* the ground was drawn directly, */
    bool shadows_left;         /* in shadows of which some could be refined */
    double ms[SV_STAGE_COUNT]; /* cell, warp, near, composite; negative: did not run */
};

/* Whether the view can be drawn from cells at all: perspective, one sample, colour alone, trees in the form
 * auto, texels of at most 4 pixels. */
bool sv_cells_can(const struct sv_resolved_view *view, unsigned layers);
/* This process, which was forked since, has that slot of the cache. */
void sv_cells_use_slot(struct sv_cells *cells, unsigned slot);
struct sv_cells_draw_options {
    bool sky;
    bool all; /* from all rings of panels; else from those of the whole picture that are there or pay (core/cell/admit.h) */
    int row_first, row_count;      /* at least one */
    const struct sv_bands *bands;  /* others draw the other rows of the picture; NULL: nobody does */
};
/* Draws rows row_first .. row_first + row_count - 1 of a view into rgba (width * row_count * 4; sRGB, premultiplied;
 * alpha 255 everywhere where sky is true). SV_ENOENT, with nothing drawn, where not all rings are asked for and none pays. What no ring shows is drawn directly. A panel that others are building, or that the cache has no room for,
 * is built for this view alone, in memory that goes with it. */
SV_MUST_CHECK enum sv_status sv_cells_draw(struct sv_cells *cells, const struct sv_resolved_view *view,
                                           const struct sv_cells_draw_options *options, uint8_t *rgba,
                                           struct sv_cells_report *report, struct sv_draw_stats *stats,
                                           struct sv_error *error);
/* Builds panels that the view needs and that are neither there nor being built by others, at most `most` of
 * them; report->left tells how many that leaves. What the cache has no room for is not built. Errors of
 * sv_panels_draw. */
SV_MUST_CHECK enum sv_status sv_cells_build(struct sv_cells *cells, const struct sv_resolved_view *view,
                                            uint32_t most, struct sv_cells_report *report,
                                            struct sv_error *error);
/* The scene has changed in place, and what direct drawing keeps of it: drops what the change can be seen on
 * (cells_change.h). Before any process of the scene as it is now draws. */
void sv_cells_changed(struct sv_cells *cells, const struct sv_scene_change *change);

/* A panel as it is kept, and as it is drawn at full size. */
struct sv_cells_panel {
    struct sv_cell_cache_label label;
    struct sv_panels_order order; /* borrows the view */
};
enum { SV_CELLS_PANELS_MAX = (SV_CELL_RINGS_MAX + 1) * SV_CELL_FACES };
/* The panels that the whole of a view is drawn from, there or not, near ones first. */
SV_MUST_CHECK enum sv_status sv_cells_wanted(struct sv_cells *cells, const struct sv_resolved_view *view,
                                             struct sv_cells_panel panels[SV_CELLS_PANELS_MAX], int *count,
                                             struct sv_error *error);

/* The pages of shadow that it wants refined, and which they are (core/view/cells_shadow.h): none where the
 * ground is drawn from panels or nothing throws shadows. */
SV_MUST_CHECK enum sv_status sv_cells_wanted_shadows(struct sv_cells *cells,
                                                     const struct sv_resolved_view *view,
                                                     struct sv_cells_shadow *shadow,
                                                     struct sv_shadow_wish wishes[SV_CELLS_SHADOWS_MAX],
                                                     size_t *count, struct sv_error *error);

#endif
