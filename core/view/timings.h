/* timings.h - the stages of one view, how long each took, and what was drawn: plain values that cross the
 * process border.
 *
 * The daemon turns them into Server-Timing; the renderer fills them. No clock and no drawing here. */
#ifndef SV_VIEW_TIMINGS_H
#define SV_VIEW_TIMINGS_H

#include <stdbool.h>
#include <stdint.h>

#define SV_STAGE_LIST(X)               \
    X(SV_STAGE_QUEUE, "queue")         \
    X(SV_STAGE_PLAN, "plan")           \
    X(SV_STAGE_CELL, "cell")           \
    X(SV_STAGE_WARP, "warp")           \
    X(SV_STAGE_NEAR, "near")           \
    X(SV_STAGE_COMPOSITE, "composite") \
    X(SV_STAGE_ENCODE, "encode")       \
    X(SV_STAGE_TOTAL, "total")

enum sv_stage {
#define X(name, text) name,
    SV_STAGE_LIST(X)
#undef X
        SV_STAGE_COUNT
};

struct sv_timings {
    double ms[SV_STAGE_COUNT]; /* negative: the stage did not run */
};

/* What relief panels had to do with a picture. */
#define SV_CELL_USE_LIST(X)           \
    X(SV_CELL_USE_NONE, "none")       \
    X(SV_CELL_USE_BYPASS, "bypass")   \
    X(SV_CELL_USE_BUILT, "built")     \
    X(SV_CELL_USE_HIT, "hit")

enum sv_cell_use_kind {
#define X(name, text) name,
    SV_CELL_USE_LIST(X)
#undef X
        SV_CELL_USE_COUNT
};

struct sv_cell_use {
    uint32_t kind;    /* enum sv_cell_use_kind. bypass: panels could have served, but it was drawn directly */
    uint32_t hits;    /* panels that were there, */
    uint32_t refined; /* of these refined ones, or such as show nothing, */
    uint32_t built;   /* and those that were built for it */
    uint32_t shadows_left; /* 1: shadows on the ground could be refined */
    uint64_t id;           /* of the cell; 0 with none */
};

/* Whether all panels were refined ones, and the shadows on the ground. */
static inline bool sv_cell_use_refined(const struct sv_cell_use *use)
{
    return use->built == 0 && use->refined == use->hits && use->shadows_left == 0;
}

/* What drawing took, without the building of panels, and from what level of cells (core/cell/admit.h); level negative:
 * nothing that is to be remembered. */
struct sv_draw_took {
    int32_t level;
    double ms;
};

struct sv_draw_stats {
    uint32_t terrain_triangles;
    uint32_t near_trees,
        far_trees; /* as leaves or polygons one by one; in all other forms. Fading ones count twice */
    uint32_t polygon_objects, relief_objects;
    double terrain_error_px;
    struct sv_cell_use cell;
};

#endif
