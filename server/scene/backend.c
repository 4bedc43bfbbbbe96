/* backend.c - the real backend of a scene process: core/scene loads, core/view draws, core/image encodes.
 *
 * Order matters: libraries are told to start no threads before anything else; species and impostors are built
 * side by side in forked children into the store while the terrain is loaded; then GL is warmed here, before
 * any worker is forked, so that all of them share its memory. */
#include "server/scene/backend.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

#include "api/patch_parse.h"
#include "api/scene_doc.h"
#include "core/geo/geo.h"
#include "core/image/encode.h"
#include "core/relief/draw_object.h"
#include "core/scene/scene.h"
#include "core/tree/draw.h"
#include "core/view/cells_refine.h"
#include "core/view/direct.h"
#include "core/view/renderer.h"
#include "core/view/resolve.h"
#include "core/view/warm.h"
#include "server/log.h"
#include "server/scene/prepare.h"

struct sv_backend {
    struct sv_store *store;
    struct sv_scene *scene;
    struct sv_renderer *renderer;
    struct sv_cells_memory cells;
    int epsg;
    double load_s;
    uint64_t pixels_max, sample_pixels_max; /* for the document */
    char *document;
};

static double now_ms(void)
{
    struct timespec t;
    clock_gettime(CLOCK_MONOTONIC, &t);
    return (double)t.tv_sec * 1e3 + (double)t.tv_nsec * 1e-6;
}

static void log_news(void *context, int level, const char *message)
{
    (void)context;
    sv_log(level ? SV_LOG_WARNING : SV_LOG_INFO, "load", "%s", message);
}

/* ---- the scene's document ---- */

static void lonlat_box(const struct sv_scene *scene, struct sv_scene_facts *facts)
{
    enum { STEPS = 8 }; /* points a side: the outline bends in degrees */
    facts->lon_min = facts->lat_min = 1e9;
    facts->lon_max = facts->lat_max = -1e9;
    for (int i = 0; i <= STEPS; i++)
        for (int j = 0; j <= STEPS; j++) {
            double x = facts->x_min + (facts->x_max - facts->x_min) * i / STEPS, lon;
            double y = facts->y_min + (facts->y_max - facts->y_min) * j / STEPS, lat;
            if (!sv_crs_to_lonlat(scene->crs, x, y, &lon, &lat))
                return;
            facts->lon_min = lon < facts->lon_min ? lon : facts->lon_min;
            facts->lon_max = lon > facts->lon_max ? lon : facts->lon_max;
            facts->lat_min = lat < facts->lat_min ? lat : facts->lat_min;
            facts->lat_max = lat > facts->lat_max ? lat : facts->lat_max;
        }
    facts->has_lonlat = true;
}

static void place_facts(const struct sv_backend *backend, struct sv_scene_facts *facts)
{
    const struct sv_scene *scene = backend->scene;
    const struct sv_heightfield *field = &scene->terrain.field;
    facts->crs_name = sv_crs_name(scene->crs);
    facts->epsg = backend->epsg;
    facts->x_min = field->x0;
    facts->y_min = field->y0;
    facts->x_max = sv_heightfield_x1(field);
    facts->y_max = sv_heightfield_y1(field);
    lonlat_box(scene, facts);
    facts->convergence_rad = sv_crs_convergence_rad(scene->crs, 0.5 * (facts->x_min + facts->x_max),
                                                    0.5 * (facts->y_min + facts->y_max));
    facts->terrain_width = field->width;
    facts->terrain_height = field->height;
    facts->spacing_x_m = field->dx;
    facts->spacing_y_m = field->dy;
    facts->z_min = field->z0 + field->h_min;
    facts->z_max = field->z0 + field->h_max;
    facts->procedural = scene->spec.terrain.dem == NULL;
    facts->has_imagery = scene->terrain.has_imagery;
}

static void species_facts(const struct sv_backend *backend, struct sv_species_facts *out)
{
    const struct sv_tree_draw *draw = sv_renderer_trees(backend->renderer);
    for (int i = 0; i < backend->scene->species_count; i++) {
        const struct sv_species *species = &backend->scene->species[i];
        out[i] = (struct sv_species_facts){.name = species->name,
                                           .tree_count = species->tree_count,
                                           .leaf_count = species->mesh.leaf_count,
                                           .triangle_count = species->mesh.index_count / 3,
                                           .vertex_count = species->mesh.vertex_count};
        for (int k = SV_TREE_FORM_AUTO + 1; draw && species->tree_count > 0 && k < SV_TREE_FORM_COUNT; k++) {
            enum sv_tree_form form = (enum sv_tree_form)k;
            out[i].forms[out[i].form_count++] =
                (struct sv_form_facts){sv_tree_form_name(form), sv_tree_draw_bytes(draw, i, form),
                                       sv_tree_draw_built(draw, i, form)};
        }
    }
}

static void object_facts(const struct sv_backend *backend, int i, struct sv_object_facts *out)
{
    const struct sv_scene *scene = backend->scene;
    const struct sv_object_draw *draw = sv_renderer_objects(backend->renderer);
    const struct sv_scene_object *o = &scene->objects[i];
    *out = (struct sv_object_facts){.number = o->number,
                                    .model = scene->models[o->model].file,
                                    .x = o->x,
                                    .y = o->y,
                                    .z = o->z,
                                    .heading_rad = o->heading_rad,
                                    .height_m = o->height_m,
                                    .relief_resolution = o->relief_resolution,
                                    .triangle_count = scene->models[o->model].mesh.index_count / 3,
                                    .relief_bytes = draw ? sv_object_draw_relief_bytes(draw, i) : 0};
}

static char *make_document(const struct sv_backend *backend)
{
    const struct sv_scene *scene = backend->scene;
    struct sv_species_facts *species = calloc((size_t)scene->species_count + 1, sizeof *species);
    struct sv_object_facts *objects = calloc((size_t)scene->object_count + 1, sizeof *objects);
    struct sv_scene_facts facts = {.name = scene->name,
                                   .version = scene->version,
                                   .species = species,
                                   .species_count = scene->species_count,
                                   .tree_count = scene->forest.count,
                                   .voids_filled = scene->counts.voids_filled,
                                   .outside_terrain = scene->counts.outside_terrain,
                                   .unusable = scene->counts.unusable,
                                   .not_placed = scene->counts.not_placed,
                                   .heights_defaulted = scene->counts.heights_defaulted,
                                   .species_defaulted = scene->counts.species_defaulted,
                                   .objects = objects,
                                   .object_count = scene->object_count,
                                   .sun_azimuth_rad = scene->sun.azimuth_rad,
                                   .sun_elevation_rad = scene->sun.elevation_rad,
                                   .relief_distance_m = scene->relief_distance_m,
                                   .relief_resolution = scene->relief_resolution,
                                   .pixels_max = backend->pixels_max,
                                   .sample_pixels_max = backend->sample_pixels_max,
                                   .shared_bytes = sv_arena_used(scene->arena),
                                   .load_s = backend->load_s};
    char *document = NULL;
    size_t bytes;
    if (species && objects) {
        place_facts(backend, &facts);
        species_facts(backend, species);
        for (int i = 0; i < scene->object_count; i++)
            object_facts(backend, i, &objects[i]);
        document = sv_api_scene_doc(&facts, &bytes);
    }
    free(species);
    free(objects);
    return document;
}

bool sv_backend_renew_document(struct sv_backend *backend)
{
    char *document = make_document(backend);
    if (!document)
        return false;
    free(backend->document);
    backend->document = document;
    return true;
}

/* ---- loading ---- */

static void await_species(void *prepare)
{
    sv_prepare_wait(prepare);
}

static enum sv_status load_scene(struct sv_backend *backend, const struct sv_backend_options *options,
                                 struct sv_errors *errors)
{
    struct sv_scene_spec spec;
    enum sv_status status = sv_scene_spec_read(options->scene_path, &spec, errors);
    if (status != SV_OK)
        return status;
    struct sv_prepare *prepare = sv_prepare_start(&spec, backend->store, options->processes);
    struct sv_scene_options scene_options = {.store = backend->store,
                                             .log = log_news,
                                             .before_species = await_species,
                                             .before_species_context = prepare};
    status = sv_scene_load(&spec, &scene_options, &backend->scene, errors);
    sv_prepare_destroy(prepare);
    if (status != SV_OK)
        sv_scene_spec_finish(&spec);
    return status;
}

/* Without memory for panels every view is drawn directly. */
static void make_cells(struct sv_backend *backend, uint64_t bytes)
{
    struct sv_error error;
    if (bytes > 0 && sv_cells_memory_make(bytes, &backend->cells, &error) != SV_OK)
        sv_log(SV_LOG_WARNING, "cells", "%s: %s: there are no relief cells", error.field, error.message);
}

static enum sv_status make_renderer(struct sv_backend *backend, bool warm, struct sv_errors *errors)
{
    struct sv_error error;
    /* The ray-cast structures are built before the fork, so that all workers share them; 0.3 s for the demo.
     */
    struct sv_renderer_options renderer_options = {.store = backend->store,
                                                   .clock = now_ms,
                                                   .truth = warm,
                                                   .cells = backend->cells.cache,
                                                   .cells_slot = SV_CELL_CACHE_SLOTS - 1};
    enum sv_status status = sv_renderer_create(backend->scene, &renderer_options, &backend->renderer, &error);
    if (status != SV_OK)
        sv_errors_add(errors, status, error.field, "%s", error.message);
    else if (warm && sv_view_warm(backend->renderer, backend->scene, 1u << SV_LAYER_COLOR, &error) != SV_OK)
        sv_log(SV_LOG_WARNING, "load", "warming up: %s: %s", error.field, error.message);
    return status;
}

enum sv_status sv_backend_load(const struct sv_backend_options *options, struct sv_backend **out,
                               struct sv_errors *errors)
{
    struct sv_error error;
    double start = now_ms();
    struct sv_backend *backend = calloc(1, sizeof *backend);
    if (!backend) {
        sv_errors_add(errors, SV_ENOMEM, "", "out of memory");
        return SV_ENOMEM;
    }
    sv_image_init();
    sv_geo_init();
    if (options->cache_dir && options->cache_dir[0] &&
        sv_store_open(options->cache_dir, options->cache_budget_bytes, &backend->store, &error) != SV_OK)
        sv_log(SV_LOG_WARNING, "store", "%s: %s: what is built is not kept", error.field, error.message);
    enum sv_status status = load_scene(backend, options, errors);
    if (status == SV_OK) {
        backend->epsg = sv_crs_epsg(backend->scene->crs);
        make_cells(backend, options->cells_bytes);
        status = make_renderer(backend, !options->one_picture, errors);
    }
    if (status == SV_OK) {
        backend->load_s = (now_ms() - start) * 1e-3;
        backend->pixels_max = options->pixels_max;
        backend->sample_pixels_max = options->sample_pixels_max;
        if (!sv_backend_renew_document(backend)) {
            sv_errors_add(errors, SV_ENOMEM, "", "out of memory");
            status = SV_ENOMEM;
        }
    }
    if (status == SV_OK)
        *out = backend;
    /* On failure the process ends at once: nothing is taken down first. */
    return status;
}

/* ---- a patch ---- */

static enum sv_status apply(struct sv_backend *backend, const struct sv_scene_patch *patch,
                            struct sv_scene_change *change, struct sv_errors *errors)
{
    struct sv_scene_patch_options options = {.store = backend->store, .log = log_news};
    struct sv_scene_delta delta;
    struct sv_error error;
    double start = now_ms();
    enum sv_status status = sv_scene_patch_apply(backend->scene, patch, &options, &delta, errors);
    if (status != SV_OK)
        return status;
    double middle = now_ms();
    status = sv_renderer_change(backend->renderer, &delta, backend->store, &error);
    if (status != SV_OK)
        sv_errors_add(errors, SV_EINTERNAL, error.field, "%s", error.message);
    sv_log(SV_LOG_INFO, "patch", "scene %.1f ms, what is drawn %.1f ms", middle - start, now_ms() - middle);
    *change = delta.change;
    sv_scene_delta_finish(&delta);
    return status;
}

enum sv_status sv_backend_patch(struct sv_backend *backend, const char *text, size_t bytes,
                                struct sv_scene_change *change, struct sv_errors *errors)
{
    struct sv_scene_patch patch;
    enum sv_status status = sv_api_patch_parse(text, bytes, &backend->scene->spec, &patch, errors);
    if (status != SV_OK)
        return status;
    status = apply(backend, &patch, change, errors);
    sv_scene_patch_finish(&patch);
    if (status != SV_OK)
        return status;
    if (sv_backend_renew_document(backend))
        return SV_OK;
    sv_errors_add(errors, SV_ENOMEM, "", "out of memory");
    return SV_ENOMEM;
}

void sv_backend_facts(const struct sv_backend *backend, struct sv_backend_facts *facts)
{
    *facts = (struct sv_backend_facts){.version = backend->scene->version,
                                       .epsg = backend->epsg,
                                       .relief_distance_m = backend->scene->relief_distance_m,
                                       .document = backend->document};
}

enum sv_status sv_backend_resolve(struct sv_backend *backend, const struct sv_view_request *request,
                                  struct sv_resolved_view *view, bool *has_ground, double *ground_z,
                                  struct sv_error *error)
{
    enum sv_status status = sv_view_resolve(backend->scene, request, view, ground_z, error);
    *has_ground = status == SV_EUNDERGROUND;
    return status;
}

/* ---- relief cells ---- */

const struct sv_cells_memory *sv_backend_cells(const struct sv_backend *backend)
{
    return &backend->cells;
}

void sv_backend_use_slot(struct sv_backend *backend, int slot)
{
    sv_renderer_use_cells_slot(backend->renderer, slot);
}

enum sv_status sv_backend_ahead(struct sv_backend *backend, const struct sv_view_request *request, uint32_t most,
                                uint32_t *built, uint32_t *left, struct sv_error *error)
{
    struct sv_resolved_view view;
    enum sv_status status = sv_view_resolve(backend->scene, request, &view, NULL, error);
    if (status == SV_OK)
        status = sv_renderer_build_cells(backend->renderer, request, &view, most, built, left, error);
    return status;
}

enum sv_status sv_backend_refine(struct sv_backend *backend, const struct sv_view_request *request,
                                 const struct sv_backend_refine_options *options, uint32_t *refined,
                                 uint32_t *left, struct sv_error *error)
{
    struct sv_resolved_view view;
    struct sv_cells_refine_report report;
    /* As large as they are: a place that is often seen costs no more memory than others. */
    struct sv_cells_refine_options how = {
        .samples = options->samples, .scale = 1, .most = 1, .stop = options->stop, .context = options->context};
    enum sv_status status = sv_view_resolve(backend->scene, request, &view, NULL, error);
    if (status == SV_OK)
        status = sv_renderer_refine_cells(backend->renderer, request, &view, &how, &report, error);
    if (status == SV_OK) {
        *refined = report.refined;
        *left = report.left;
    }
    return status;
}

/* ---- forms of trees ---- */

int sv_backend_lacks(const struct sv_backend *backend, const struct sv_resolved_view *view)
{
    const struct sv_tree_draw *draw = sv_renderer_trees(backend->renderer);
    enum sv_tree_form form = sv_direct_tree_form(view->plan.trees);
    if (!backend->store || !draw || !view->plan.draw_trees || view->plan.raycast)
        return 0;
    for (int k = 0; k < backend->scene->species_count; k++)
        if (!sv_tree_draw_built(draw, k, form))
            return (int)form;
    return 0;
}

void sv_backend_build(const struct sv_backend *backend, int form)
{
    struct sv_error error;
    double start = now_ms();
    const char *name = sv_tree_form_name((enum sv_tree_form)form);
    if (sv_tree_draw_build(sv_renderer_trees(backend->renderer), (enum sv_tree_form)form, &error) != SV_OK)
        sv_log(SV_LOG_WARNING, "build", "form %s: %s: %s", name, error.field, error.message);
    else
        sv_log(SV_LOG_INFO, "build", "form %s of all species in %.0f ms", name, now_ms() - start);
}

enum sv_status sv_backend_draw(struct sv_backend *backend, const struct sv_view_request *request,
                               const struct sv_resolved_view *view, int epsg, void **bytes, size_t *size,
                               struct sv_timings *timings, struct sv_draw_stats *stats,
                               struct sv_error *error)
{
    struct sv_picture picture;
    memset(&picture, 0, sizeof picture);
    enum sv_status status =
        sv_renderer_draw(backend->renderer, request, view, &picture, timings, stats, error);
    if (status != SV_OK)
        return status;
    double start = now_ms();
    status = sv_picture_encode(&picture, request, view, epsg, bytes, size, error);
    timings->ms[SV_STAGE_ENCODE] = now_ms() - start;
    sv_picture_finish(&picture);
    return status;
}

enum sv_status sv_backend_draw_band(struct sv_backend *backend, const struct sv_view_request *request,
                                    const struct sv_resolved_view *view, const struct sv_backend_band *band,
                                    struct sv_picture *picture, struct sv_bands_part *part, struct sv_error *error)
{
    struct sv_renderer_band rows = {
        .row_first = band->row_first, .row_count = band->row_count, .bands = &band->shared};
    memset(picture, 0, sizeof *picture);
    return sv_renderer_draw_band(backend->renderer, request, view, &rows, picture, &part->timings, &part->stats,
                                 &part->took, error);
}

enum sv_status sv_backend_encode(struct sv_backend *backend, const struct sv_view_request *request,
                                 const struct sv_resolved_view *view, const struct sv_picture *picture, int epsg,
                                 struct sv_bands_part *part, void **bytes, size_t *size, struct sv_error *error)
{
    double start = now_ms();
    sv_renderer_drawn(backend->renderer, view, &part->took);
    enum sv_status status = sv_picture_encode(picture, request, view, epsg, bytes, size, error);
    part->timings.ms[SV_STAGE_ENCODE] = now_ms() - start;
    return status;
}
