/* renderer.c - see renderer.h. Pictures of one or many passes of direct.h, or of Embree. */
#include "core/view/renderer.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "core/base/color.h"
#include "core/view/cells.h"
#include "core/view/cells_paper.h"
#include "core/view/cells_refine.h"
#include "core/view/direct.h"
#include "core/terrain/shadow_page.h"
#include "core/truth/truth.h"

struct sv_renderer {
    const struct sv_scene *scene;
    struct sv_direct *direct;
    struct sv_truth *truth;
    struct sv_cells *cells; /* NULL: none */
    struct sv_cells_paper *paper; /* NULL: not asked for yet */
    struct sv_cells_refiner *refiner; /* NULL: not used yet */
    struct sv_cell_cache *cache;
    unsigned slot; /* of cache */
    struct sv_cells_report report; /* of the last view drawn from cells */
    sv_clock_ms clock;
};

void sv_renderer_destroy(struct sv_renderer *renderer)
{
    if (!renderer)
        return;
    sv_cells_refiner_destroy(renderer->refiner);
    sv_truth_destroy(renderer->truth);
    sv_cells_destroy(renderer->cells);
    sv_cells_paper_destroy(renderer->paper);
    sv_direct_destroy(renderer->direct);
    free(renderer);
}

enum sv_status sv_renderer_create(const struct sv_scene *scene, const struct sv_renderer_options *options,
                                  struct sv_renderer **renderer, struct sv_error *error)
{
    struct sv_renderer *r = calloc(1, sizeof *r);
    if (!r)
        return sv_fail(error, SV_ENOMEM, NULL, "no memory for a renderer");
    r->scene = scene;
    r->clock = options->clock;
    enum sv_status status = sv_direct_create(scene, options->store, &r->direct, error);
    if (!status && options->cells) {
        r->cache = options->cells;
        r->slot = options->cells_slot;
        struct sv_cells_options cells = {options->cells, options->cells_slot, options->clock};
        status = sv_cells_create(scene, r->direct, &cells, &r->cells, error);
    }
    if (!status && options->truth)
        status = sv_truth_create(scene, &r->truth, error);
    if (status) {
        sv_renderer_destroy(r);
        return status;
    }
    *renderer = r;
    return SV_OK;
}

void sv_renderer_use_cells_slot(struct sv_renderer *renderer, int slot)
{
    renderer->slot = slot >= 0 ? (unsigned)slot : 0;
    if (renderer->cells && slot >= 0) {
        sv_cells_use_slot(renderer->cells, (unsigned)slot);
        return;
    }
    sv_cells_destroy(renderer->cells);
    renderer->cells = NULL;
}

enum sv_status sv_renderer_build_cells(struct sv_renderer *renderer, const struct sv_view_request *request,
                                       const struct sv_resolved_view *view, uint32_t most, uint32_t *built,
                                       uint32_t *left, struct sv_error *error)
{
    struct sv_cells_report report = {0};
    enum sv_status status = SV_OK;
    if (renderer->cells && view->plan.relief != SV_RELIEF_OFF && sv_cells_can(view, request->layers))
        status = sv_cells_build(renderer->cells, view, most, &report, error);
    if (!status) {
        *built = report.built;
        *left = report.left;
    }
    return status;
}

static enum sv_status want_truth(struct sv_renderer *r, struct sv_error *error)
{
    return r->truth ? SV_OK : sv_truth_create(r->scene, &r->truth, error);
}

enum sv_status sv_renderer_refine_cells(struct sv_renderer *renderer, const struct sv_view_request *request,
                                        const struct sv_resolved_view *view,
                                        const struct sv_cells_refine_options *options,
                                        struct sv_cells_refine_report *report, struct sv_error *error)
{
    struct sv_renderer *r = renderer;
    *report = (struct sv_cells_refine_report){0};
    if (!r->cells || view->plan.relief == SV_RELIEF_OFF || !sv_cells_can(view, request->layers))
        return SV_OK;
    enum sv_status status = want_truth(r, error);
    struct sv_cells_options cells = {r->cache, r->slot, r->clock};
    if (!status && !r->refiner)
        status = sv_cells_refiner_create(r->scene, r->truth, r->cells, &cells, &r->refiner, error);
    return status ? status : sv_cells_refine(r->refiner, view, options, report, error);
}

enum sv_status sv_renderer_warm_shadows(struct sv_renderer *renderer, struct sv_error *error)
{
    return sv_direct_warm_shadows(renderer->direct, SV_SHADOW_PAGES_WHOLE_S, error);
}

static enum sv_status change_truth(struct sv_renderer *r, const struct sv_scene_delta *delta,
                                   struct sv_error *error)
{
    struct sv_truth_change change = {.gone = delta->gone,
                                     .gone_count = delta->change.trees_removed,
                                     .came = delta->came,
                                     .came_count = delta->change.trees_added,
                                     .objects = delta->objects};
    return r->truth && (delta->trees || delta->objects) ? sv_truth_change(r->truth, &change, error) : SV_OK;
}

enum sv_status sv_renderer_change(struct sv_renderer *r, const struct sv_scene_delta *delta,
                                  struct sv_store *store, struct sv_error *error)
{
    if (r->refiner)
        sv_cells_refiner_drop(r->refiner);
    enum sv_status status = sv_direct_change(r->direct, delta, store, error);
    if (!status)
        status = change_truth(r, delta, error);
    if (!status && r->cells)
        sv_cells_changed(r->cells, &delta->change);
    return status;
}

static double now(const struct sv_renderer *r)
{
    return r->clock ? r->clock() : 0;
}

static void stage(const struct sv_renderer *r, struct sv_timings *timings, enum sv_stage which, double since)
{
    if (!timings || !r->clock)
        return;
    double ms = now(r) - since;
    timings->ms[which] = timings->ms[which] < 0 ? ms : timings->ms[which] + ms;
}

/* Premultiplied -> straight alpha, in linear light, in place. Fully opaque pixels, the usual case, are left
 * alone. */
static void straighten(struct sv_image *color)
{
    uint8_t *p = color->data;
    size_t n = (size_t)color->width * (size_t)color->height;
    for (size_t i = 0; i < n; i++, p += 4) {
        if (p[3] == 255 || p[3] == 0)
            continue;
        float a = (float)p[3] / 255.0f;
        for (int c = 0; c < 3; c++)
            p[c] = sv_srgb8_from_linear(sv_linear_from_srgb8[p[c]] / a);
    }
}

/* Window depth (reversed) -> metres along forward; 0 is the sky. */
static void depth_to_metres(const struct sv_camera *camera, struct sv_image *depth)
{
    float *d = depth->data;
    size_t n = (size_t)depth->width * (size_t)depth->height;
    bool perspective = camera->projection == SV_PROJECTION_PERSPECTIVE;
    for (size_t i = 0; i < n; i++)
        d[i] = !(d[i] > 0)   ? INFINITY
               : perspective ? (float)(camera->near_m / (double)d[i])
                             : (float)(camera->far_m * (1.0 - (double)d[i]));
}

/* Mean of several passes in linear light, at the sample positions that the ray caster uses too. */
static enum sv_status draw_supersampled(struct sv_renderer *r, const struct sv_resolved_view *view, bool sky,
                                        const struct sv_renderer_band *band, struct sv_picture *picture, struct sv_timings *timings,
                                        struct sv_draw_stats *stats, struct sv_error *error)
{
    struct sv_image *color = &picture->layer[SV_LAYER_COLOR];
    size_t n = (size_t)color->width * (size_t)color->height * 4;
    float *sum = calloc(n, sizeof *sum);
    if (!sum)
        return sv_fail(error, SV_ENOMEM, NULL, "no memory for %zu samples", n);
    enum sv_status status = SV_OK;
    int samples = view->plan.samples;
    for (int k = 0; k < samples && !status; k++) {
        double dx, dy, since = now(r);
        sv_camera_sample_offset(samples, k, &dx, &dy);
        struct sv_direct_pass pass = {1u << SV_LAYER_COLOR, sky, true, dx, dy, band->row_first, band->row_count};
        status = sv_direct_draw(r->direct, view, &pass, picture, stats, error);
        stage(r, timings, SV_STAGE_NEAR, since);
        since = now(r);
        const uint8_t *p = color->data;
        for (size_t i = 0; i < n && !status; i += 4) {
            for (int c = 0; c < 3; c++)
                sum[i + (size_t)c] += sv_linear_from_srgb8[p[i + (size_t)c]];
            sum[i + 3] += (float)p[i + 3];
        }
        stage(r, timings, SV_STAGE_COMPOSITE, since);
    }
    double since = now(r);
    uint8_t *p = color->data;
    float scale = 1.0f / (float)samples;
    for (size_t i = 0; i < n && !status; i += 4) {
        for (int c = 0; c < 3; c++)
            p[i + (size_t)c] = sv_srgb8_from_linear(sum[i + (size_t)c] * scale);
        p[i + 3] = (uint8_t)lrintf(sum[i + 3] * scale);
    }
    free(sum);
    stage(r, timings, SV_STAGE_COMPOSITE, since);
    return status;
}

static enum sv_status draw_raster(struct sv_renderer *r, const struct sv_view_request *request,
                                  const struct sv_resolved_view *view, const struct sv_renderer_band *band,
                                  struct sv_picture *picture, struct sv_timings *timings, struct sv_draw_stats *stats,
                                  struct sv_error *error)
{
    unsigned layers = request->layers;
    if (view->plan.samples > 1 && layers & 1u << SV_LAYER_COLOR) {
        enum sv_status status = draw_supersampled(r, view, request->sky, band, picture, timings, stats, error);
        if (status)
            return status;
        layers &= ~(1u << SV_LAYER_COLOR);
    }
    double since = now(r);
    enum sv_status status = SV_OK;
    if (layers) { /* depth, normal and id are never averaged: the pixel's centre decides */
        struct sv_direct_pass pass = {layers, request->sky, true, 0, 0, band->row_first, band->row_count};
        status = sv_direct_draw(r->direct, view, &pass, picture, stats, error);
        if (!status && layers & 1u << SV_LAYER_DEPTH)
            depth_to_metres(&view->camera, &picture->layer[SV_LAYER_DEPTH]);
        stage(r, timings, SV_STAGE_NEAR, since);
    }
    since = now(r);
    if (!status && !request->sky && picture->layer[SV_LAYER_COLOR].data)
        straighten(&picture->layer[SV_LAYER_COLOR]);
    stage(r, timings, SV_STAGE_COMPOSITE, since);
    return status;
}

static int64_t pixels_of(const struct sv_resolved_view *view)
{
    return (int64_t)view->camera.width * view->camera.height;
}

static void add_stages(const double ms[SV_STAGE_COUNT], struct sv_timings *timings)
{
    for (int k = 0; k < SV_STAGE_COUNT && timings; k++)
        if (ms[k] >= 0)
            timings->ms[k] = fmax(timings->ms[k], 0) + ms[k];
}

static enum sv_status draw_paper(struct sv_renderer *r, const struct sv_view_request *request,
                                 const struct sv_resolved_view *view, struct sv_picture *picture,
                                 struct sv_timings *timings, struct sv_draw_stats *stats,
                                 struct sv_error *error)
{
    struct sv_cells_paper_report report;
    enum sv_status status = SV_OK;
    if (!r->paper)
        status = sv_cells_paper_create(r->scene, r->direct, r->clock, &r->paper, error);
    if (status)
        return status;
    status = sv_cells_paper_draw(r->paper, view, request->sky, picture->layer[SV_LAYER_COLOR].data, &report,
                                 stats, error);
    add_stages(report.ms, timings);
    if (!status && !request->sky)
        straighten(&picture->layer[SV_LAYER_COLOR]);
    return status;
}

/* SV_ENOENT, with nothing drawn: to be drawn directly. */
static enum sv_status draw_cells(struct sv_renderer *r, const struct sv_view_request *request,
                                 const struct sv_resolved_view *view, const struct sv_renderer_band *band,
                                 struct sv_picture *picture, struct sv_timings *timings,
                                 struct sv_draw_stats *stats, struct sv_draw_took *took, struct sv_error *error)
{
    struct sv_cells_report report;
    uint8_t *rgba = picture->layer[SV_LAYER_COLOR].data;
    double since = now(r);
    struct sv_cells_draw_options options = {.sky = request->sky,
                                            .all = view->plan.relief == SV_RELIEF_ON,
                                            .row_first = band->row_first,
                                            .row_count = band->row_count,
                                            .bands = band->bands};
    enum sv_status status = sv_cells_draw(r->cells, view, &options, rgba, &report, stats, error);
    stats->cell = (struct sv_cell_use){.kind = SV_CELL_USE_BYPASS, .id = report.id};
    if (status)
        return status;
    stats->cell.kind = report.built > 0 ? SV_CELL_USE_BUILT : report.hits > 0 ? SV_CELL_USE_HIT : SV_CELL_USE_NONE;
    stats->cell.hits = report.hits;
    stats->cell.built = report.built;
    stats->cell.refined = report.refined;
    stats->cell.shadows_left = report.shadows_left;
    *took = (struct sv_draw_took){report.level, now(r) - since - fmax(report.ms[SV_STAGE_CELL], 0)};
    r->report = report;
    add_stages(report.ms, timings);
    if (!request->sky)
        straighten(&picture->layer[SV_LAYER_COLOR]);
    return SV_OK;
}

static enum sv_status draw_raycast(struct sv_renderer *r, const struct sv_view_request *request,
                                   const struct sv_resolved_view *view, const struct sv_renderer_band *band,
                                   struct sv_picture *picture, struct sv_timings *timings, struct sv_error *error)
{
    double since = now(r);
    enum sv_status status = want_truth(r, error);
    if (status)
        return status;
    struct sv_light light;
    sv_light_from_sun(&view->sun, &light);
    light.air = view->air;
    struct sv_truth_options options = {.layers = request->layers,
                                       .samples = view->plan.samples,
                                       .trees = view->plan.draw_trees,
                                       .shadows = view->plan.shadows,
                                       .sky = request->sky,
                                       .row_first = band->row_first,
                                       .row_count = band->row_count};
    struct sv_truth_picture out = {picture->layer[SV_LAYER_COLOR], picture->layer[SV_LAYER_DEPTH],
                                   picture->layer[SV_LAYER_NORMAL], picture->layer[SV_LAYER_ID]};
    status = sv_truth_render(r->truth, &view->camera, &light, &options, &out, error);
    stage(r, timings, SV_STAGE_NEAR, since);
    return status;
}

void sv_renderer_drawn(struct sv_renderer *renderer, const struct sv_resolved_view *view,
                       const struct sv_draw_took *took)
{
    if (renderer->cells && took->level >= 0)
        sv_cell_cache_drawn(renderer->cache, pixels_of(view), took->level, took->ms * 1e-3);
}

enum sv_status sv_renderer_draw_band(struct sv_renderer *renderer, const struct sv_view_request *request,
                                     const struct sv_resolved_view *view, const struct sv_renderer_band *band,
                                     struct sv_picture *out, struct sv_timings *timings,
                                     struct sv_draw_stats *stats, struct sv_draw_took *took,
                                     struct sv_error *error)
{
    struct sv_picture picture = {0};
    struct sv_draw_stats own = {0}, *told = stats ? stats : &own;
    enum sv_status status =
        sv_picture_alloc_rows(&view->camera, band->row_count, request->layers, &picture, error);
    bool can = view->plan.relief != SV_RELIEF_OFF && sv_cells_can(view, request->layers);
    bool paper = can && view->plan.relief == SV_RELIEF_PAPER, cells = can && !paper && renderer->cells;
    told->cell = (struct sv_cell_use){.kind = view->plan.relief == SV_RELIEF_ON ? SV_CELL_USE_BYPASS : SV_CELL_USE_NONE};
    *took = (struct sv_draw_took){.level = -1};
    if (!status && view->plan.raycast)
        status = draw_raycast(renderer, request, view, band, &picture, timings, error);
    else if (!status)
        status = cells   ? draw_cells(renderer, request, view, band, &picture, timings, told, took, error)
                 : paper ? draw_paper(renderer, request, view, &picture, timings, told, error)
                         : SV_ENOENT;
    if (status == SV_ENOENT && !view->plan.raycast) {
        struct sv_cell_use cell = told->cell;
        double since = now(renderer);
        status = draw_raster(renderer, request, view, band, &picture, timings, told, error);
        told->cell = cell;
        if (sv_cells_can(view, request->layers))
            *took = (struct sv_draw_took){0, now(renderer) - since};
    }
    if (status) {
        sv_picture_finish(&picture);
        return status;
    }
    *out = picture;
    return SV_OK;
}

enum sv_status sv_renderer_draw(struct sv_renderer *renderer, const struct sv_view_request *request,
                                const struct sv_resolved_view *view, struct sv_picture *picture,
                                struct sv_timings *timings, struct sv_draw_stats *stats,
                                struct sv_error *error)
{
    struct sv_renderer_band whole = {.row_count = view->camera.height};
    struct sv_draw_took took;
    enum sv_status status =
        sv_renderer_draw_band(renderer, request, view, &whole, picture, timings, stats, &took, error);
    if (!status)
        sv_renderer_drawn(renderer, view, &took);
    return status;
}

const struct sv_cells_report *sv_renderer_cells_report(const struct sv_renderer *renderer)
{
    return &renderer->report;
}

const struct sv_tree_draw *sv_renderer_trees(const struct sv_renderer *renderer)
{
    return sv_direct_trees(renderer->direct);
}

const struct sv_object_draw *sv_renderer_objects(const struct sv_renderer *renderer)
{
    return sv_direct_objects(renderer->direct);
}
