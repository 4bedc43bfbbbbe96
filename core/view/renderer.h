/* renderer.h - a scene made ready to draw (GL textures, baked forms, ray-cast structures), and the drawing of a view. */
#ifndef SV_VIEW_RENDERER_H
#define SV_VIEW_RENDERER_H

#include "core/view/resolve.h"

struct sv_renderer;

#define SV_STAGE_LIST(X)                                                                                     \
    X(SV_STAGE_QUEUE, "queue")                                                                               \
    X(SV_STAGE_PLAN, "plan")                                                                                 \
    X(SV_STAGE_CELL, "cell")                                                                                 \
    X(SV_STAGE_WARP, "warp")                                                                                 \
    X(SV_STAGE_NEAR, "near")                                                                                 \
    X(SV_STAGE_COMPOSITE, "composite")                                                                       \
    X(SV_STAGE_ENCODE, "encode")                                                                             \
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

/* Monotonic milliseconds; given from above so that core has no clock of its own. */
typedef double (*sv_clock_ms)(void);

struct sv_renderer_options {
    struct sv_store *store; /* may be NULL */
    sv_clock_ms clock;      /* may be NULL: timings stay negative */
    bool truth;             /* build the ray-cast reference now; otherwise at its first use */
};

/* A drawn view before encoding: the layers asked for, in the order of enum sv_layer, heap images, straight alpha. */
struct sv_picture {
    struct sv_image layer[SV_LAYER_COUNT]; /* COLOR u8 x 4; DEPTH f32; NORMAL f32 x 3; ID u32; empty when not asked for */
};

struct sv_draw_stats {
    uint32_t terrain_triangles, polygon_trees, impostor_trees;
    double terrain_error_px;
};

SV_MUST_CHECK enum sv_status sv_renderer_create(const struct sv_scene *scene, const struct sv_renderer_options *options,
                                                struct sv_renderer **renderer, struct sv_error *error);
void sv_renderer_destroy(struct sv_renderer *renderer);
SV_MUST_CHECK enum sv_status sv_renderer_draw(struct sv_renderer *renderer, const struct sv_view_request *request,
                                              const struct sv_resolved_view *view, struct sv_picture *picture,
                                              struct sv_timings *timings, struct sv_draw_stats *stats,
                                              struct sv_error *error);
void sv_picture_finish(struct sv_picture *picture);
/* Encodes as request->format says (layers named as exr does). Heap bytes. */
SV_MUST_CHECK enum sv_status sv_picture_encode(const struct sv_picture *picture, const struct sv_view_request *request,
                                               const struct sv_resolved_view *view, int epsg, void **bytes, size_t *size,
                                               struct sv_error *error);

#endif
