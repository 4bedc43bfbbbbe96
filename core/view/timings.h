/* timings.h - the stages of one view, how long each took, and what was drawn: plain values that cross the
 * process border.
 *
 * The daemon turns them into Server-Timing; the renderer fills them. No clock and no drawing here. */
#ifndef SV_VIEW_TIMINGS_H
#define SV_VIEW_TIMINGS_H

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

struct sv_draw_stats {
    uint32_t terrain_triangles;
    uint32_t near_trees,
        far_trees; /* as leaves or polygons one by one; in all other forms. Fading ones count twice */
    uint32_t polygon_objects, relief_objects;
    double terrain_error_px;
};

#endif
