/* refine_kit.c - see refine_kit.h. */
#include "tests/core/view/refine_kit.h"

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdlib.h>

#include <cmocka.h>

#include "core/cell/cache.h"
#include "tests/core/tree/kept_bakes.h"

static const size_t CACHE_BYTES = (size_t)64 << 20;

void refine_kit_open(int side, double agl_m, struct refine_stage *stage)
{
    struct kit_options options = {.width = 65,
                                  .height = 65,
                                  .x0 = -160,
                                  .y0 = -160,
                                  .z0 = 100,
                                  .dx = 5,
                                  .dy = 5,
                                  .relief_m = 6,
                                  .seed = 3,
                                  .species = 1,
                                  .leaves = 400,
                                  .trees = 120,
                                  .spread_m = 120,
                                  .height_min_m = 5,
                                  .height_max_m = 9};
    struct sv_error error = {0};
    void *memory = aligned_alloc(4096, CACHE_BYTES);
    *stage = (struct refine_stage){.scene = kit_scene(&options)};
    if (sv_cell_cache_make(memory, CACHE_BYTES, &SV_CELL_CACHE_OPTIONS_DEFAULT, &stage->cache, &error) ||
        sv_renderer_create(stage->scene,
                           &(struct sv_renderer_options){.store = kept_bakes(), .cells = stage->cache},
                           &stage->renderer, &error))
        fail_msg("%s", error.message);
    stage->request = kit_request();
    stage->request.width = stage->request.height = side;
    stage->request.eye.agl = agl_m;
    stage->request.pitch_rad = -0.5;
    stage->request.relief = SV_RELIEF_ON;
    stage->request.relief_resolution = 64;
    stage->request.relief_distance_m = 25;
    stage->request.shadows = true;
}

void refine_kit_close(struct refine_stage *stage)
{
    sv_renderer_destroy(stage->renderer);
    free(stage->cache);
    kit_free(stage->scene);
}

struct sv_image refine_kit_draw_layer(struct refine_stage *stage, enum sv_layer layer)
{
    struct sv_error error = {0};
    struct sv_picture picture;
    stage->request.layers = 1u << layer;
    if (sv_view_resolve(stage->scene, &stage->request, &stage->view, NULL, &error) ||
        sv_renderer_draw(stage->renderer, &stage->request, &stage->view, &picture, NULL, &stage->stats,
                         &error))
        fail_msg("%s: %s", error.field, error.message);
    return picture.layer[layer];
}

struct sv_image refine_kit_draw(struct refine_stage *stage)
{
    return refine_kit_draw_layer(stage, SV_LAYER_COLOR);
}

struct sv_image refine_kit_draw_as(const struct refine_stage *stage, enum sv_relief_mode relief,
                                   enum sv_trees trees, int samples)
{
    struct refine_stage other = *stage;
    other.request.relief = relief;
    other.request.trees = trees;
    other.request.samples = samples;
    return refine_kit_draw(&other);
}

static bool after_rows(void *context)
{
    return --*(int *)context <= 0;
}

struct sv_cells_refine_report refine_kit_refine(struct refine_stage *stage,
                                                struct sv_cells_refine_options options, int rows)
{
    struct sv_error error = {0};
    struct sv_cells_refine_report report;
    options.scale = 1;
    options.stop = after_rows;
    options.context = &rows;
    if (sv_renderer_refine_cells(stage->renderer, &stage->request, &stage->view, &options, &report, &error))
        fail_msg("%s: %s", error.field, error.message);
    return report;
}

struct sv_compare_result refine_kit_compare(const struct sv_image *picture, const struct sv_image *truth)
{
    struct sv_error error = {0};
    struct sv_compare_result r;
    if (sv_compare(picture, truth, &SV_COMPARE_OPTIONS_DEFAULT, &r, &error))
        fail_msg("%s", error.message);
    return r;
}
