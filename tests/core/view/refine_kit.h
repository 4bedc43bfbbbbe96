/* refine_kit.h - a small wood on a DEM, a view of it from cells, and what refines them. */
#ifndef SV_TESTS_REFINE_KIT_H
#define SV_TESTS_REFINE_KIT_H

#include "core/view/cells_refine.h"
#include "core/view/compare.h"
#include "tests/core/view/scene_kit.h"

struct refine_stage {
    struct sv_scene *scene;
    struct sv_cell_cache *cache;
    struct sv_renderer *renderer;
    struct sv_view_request request;
    struct sv_resolved_view view;
    struct sv_draw_stats stats;
};

/* A square view of so many pixels a side, from agl_m over the ground, looking down by 0.5 rad. */
void refine_kit_open(int side, double agl_m, struct refine_stage *stage);
void refine_kit_close(struct refine_stage *stage);
/* The stage's view; the caller's to free. */
struct sv_image refine_kit_draw(struct refine_stage *stage);
struct sv_image refine_kit_draw_layer(struct refine_stage *stage, enum sv_layer layer);
/* The same in another form. */
struct sv_image refine_kit_draw_as(const struct refine_stage *stage, enum sv_relief_mode relief,
                                   enum sv_trees trees, int samples);
/* Refines until all is whole that options tell, or so many rows are drawn. */
struct sv_cells_refine_report refine_kit_refine(struct refine_stage *stage,
                                                struct sv_cells_refine_options options, int rows);
struct sv_compare_result refine_kit_compare(const struct sv_image *picture, const struct sv_image *truth);

#endif
