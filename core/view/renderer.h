/* renderer.h - a scene made ready to draw (GL textures, baked forms, ray-cast structures), and the drawing of
 * a view. */
#ifndef SV_VIEW_RENDERER_H
#define SV_VIEW_RENDERER_H

#include "core/scene/patch_apply.h"
#include "core/view/bands.h"
#include "core/view/picture.h"
#include "core/view/resolve.h"
#include "core/view/timings.h"

struct sv_renderer;
struct sv_tree_draw;
struct sv_object_draw;
struct sv_cell_cache;
struct sv_cells_report;
struct sv_cells_refine_options;
struct sv_cells_refine_report;

/* Monotonic milliseconds; given from above so that core has no clock of its own. */
typedef double (*sv_clock_ms)(void);

struct sv_renderer_options {
    struct sv_store *store;      /* may be NULL */
    sv_clock_ms clock;           /* may be NULL: timings stay negative */
    bool truth;                  /* build the ray-cast reference now; otherwise at its first use */
    struct sv_cell_cache *cells; /* of relief panels, borrowed; NULL: every view is drawn directly */
    unsigned cells_slot;         /* of this process in it */
};

SV_MUST_CHECK enum sv_status sv_renderer_create(const struct sv_scene *scene,
                                                const struct sv_renderer_options *options,
                                                struct sv_renderer **renderer, struct sv_error *error);
void sv_renderer_destroy(struct sv_renderer *renderer);
SV_MUST_CHECK enum sv_status sv_renderer_draw(struct sv_renderer *renderer,
                                              const struct sv_view_request *request,
                                              const struct sv_resolved_view *view, struct sv_picture *picture,
                                              struct sv_timings *timings, struct sv_draw_stats *stats,
                                              struct sv_error *error);
/* A band of rows of a view, for one of several processes that draw the picture. */
struct sv_renderer_band {
    int row_first, row_count;     /* row_count at least 1 */
    const struct sv_bands *bands; /* what they share; NULL: all of the picture is drawn here */
};
/* The band alone, byte for byte as in the whole: layers of its rows. Views of sv_bands_can; else the band is
 * the whole. Whoever has all bands tells what they took together (sv_renderer_drawn). stats and timings may
 * be NULL. */
SV_MUST_CHECK enum sv_status
sv_renderer_draw_band(struct sv_renderer *renderer, const struct sv_view_request *request,
                      const struct sv_resolved_view *view, const struct sv_renderer_band *band,
                      struct sv_picture *picture, struct sv_timings *timings, struct sv_draw_stats *stats,
                      struct sv_draw_took *took, struct sv_error *error);
/* What a whole picture took, for choices to come. */
void sv_renderer_drawn(struct sv_renderer *renderer, const struct sv_resolved_view *view,
                       const struct sv_draw_took *took);
/* For a process that was forked since: its slot of the cells' cache. Negative: it has none, and draws every
 * view directly. */
void sv_renderer_use_cells_slot(struct sv_renderer *renderer, int slot);
/* Builds panels of cells that the view would be drawn from, at most `most` of them that nobody else is
 * building: *built of them, and *left are still missing then. Nothing is built for a view that cells cannot
 * draw. */
SV_MUST_CHECK enum sv_status sv_renderer_build_cells(struct sv_renderer *renderer,
                                                     const struct sv_view_request *request,
                                                     const struct sv_resolved_view *view, uint32_t most,
                                                     uint32_t *built, uint32_t *left, struct sv_error *error);
/* Refines panels of cells that the view is drawn from (cells_refine.h); the ray-cast reference is built where
 * it is not there yet. Nothing is refined for a view that cells cannot draw. */
SV_MUST_CHECK enum sv_status
sv_renderer_refine_cells(struct sv_renderer *renderer, const struct sv_view_request *request,
                         const struct sv_resolved_view *view, const struct sv_cells_refine_options *options,
                         struct sv_cells_refine_report *report, struct sv_error *error);
/* Casts what the scene's own sun throws on all of the ground, as fine as takes a few seconds at most:
 * before forks, so that all share it. Pictures are the same without. */
SV_MUST_CHECK enum sv_status sv_renderer_warm_shadows(struct sv_renderer *renderer, struct sv_error *error);
/* The scene has changed in place (core/scene/patch_apply.h): makes again what the delta touches, so that
 * pictures are those of a renderer that was created with the scene as it is now. A species that has got its
 * first tree and an object of a new model are built, through the store; what else there is to do takes a
 * fraction of a second, however many trees there are, but for light at more than SV_DIRECT_SUN_TREES of them
 * (a new sun, thousands of trees all over the forest), which is left to the first view that wants it. After
 * an error the renderer is of no use. Not while anything is drawn. */
SV_MUST_CHECK enum sv_status sv_renderer_change(struct sv_renderer *renderer,
                                                const struct sv_scene_delta *delta, struct sv_store *store,
                                                struct sv_error *error);
/* What the last view that was drawn from cells was drawn with (cells.h); zeros before the first. Borrowed. */
const struct sv_cells_report *sv_renderer_cells_report(const struct sv_renderer *renderer);
/* The forest's drawing, for its sizes (sv_tree_draw_bytes); NULL when the scene has no trees. Borrowed. */
const struct sv_tree_draw *sv_renderer_trees(const struct sv_renderer *renderer);
/* The objects' drawing, for its sizes (sv_object_draw_relief_bytes); NULL when there are none. Borrowed. */
const struct sv_object_draw *sv_renderer_objects(const struct sv_renderer *renderer);
/* Encodes as request->format says (layers named as exr does). Heap bytes. */
SV_MUST_CHECK enum sv_status sv_picture_encode(const struct sv_picture *picture,
                                               const struct sv_view_request *request,
                                               const struct sv_resolved_view *view, int epsg, void **bytes,
                                               size_t *size, struct sv_error *error);

#endif
