/* renderer.c - see renderer.h. Draws directly: terrain, sky, objects, trees by OSMesa, or everything by Embree. */
#include "core/view/renderer.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "core/base/color.h"
#include "core/base/hash.h"
#include "core/gl/frame.h"
#include "core/view/renderer_private.h"

void sv_renderer_destroy(struct sv_renderer *renderer)
{
    if (!renderer)
        return;
    sv_gl_target_destroy(renderer->target);
    sv_image_free(&renderer->ground_color);
    sv_image_free(&renderer->ground_depth);
    sv_shadow_height_finish(&renderer->scene_sun.terrain);
    sv_shadow_height_finish(&renderer->other_sun.terrain);
    sv_shadow_pages_destroy(renderer->pages);
    sv_ground_destroy(renderer->ground);
    sv_tree_shade_destroy(renderer->shade);
    sv_truth_destroy(renderer->truth);
    sv_object_draw_destroy(renderer->objects);
    sv_tree_draw_destroy(renderer->trees);
    sv_terrain_draw_destroy(renderer->terrain);
    sv_gl_context_destroy(renderer->gl);
    free(renderer);
}

enum sv_status sv_renderer_make_trees(struct sv_renderer *r, struct sv_store *store, struct sv_error *error)
{
    const struct sv_scene *scene = r->scene;
    if (scene->forest.count == 0)
        return SV_OK;
    struct sv_tree_draw_species *species = calloc((size_t)scene->species_count, sizeof *species);
    if (!species)
        return sv_fail(error, SV_ENOMEM, NULL, "no memory for %d species", scene->species_count);
    for (int k = 0; k < scene->species_count; k++)
        species[k] = (struct sv_tree_draw_species){&scene->species[k].mesh, scene->species[k].key,
                                                   scene->species[k].tree_count};
    enum sv_status status =
        sv_tree_draw_create(species, scene->species_count, &scene->forest, store, &r->trees, error);
    free(species);
    return status;
}

/* ---- shadows ---- */

static enum sv_status make_sun(struct sv_renderer *r, struct sun_shadow *sun, struct sv_vec3 to_sun,
                               struct sv_error *error)
{
    sun->made = false;
    enum sv_status status = sv_shadow_height_make(&sun->terrain, &r->scene->terrain.field, to_sun, error);
    sun->made = status == SV_OK;
    return status;
}

static bool is_sun(const struct sun_shadow *sun, struct sv_vec3 to_sun)
{
    struct sv_vec3 s = sun->terrain.to_sun;
    return sun->made && s.x == to_sun.x && s.y == to_sun.y && s.z == to_sun.z;
}

/* The shadow heights of the sun, made unless it is one of the two that are kept. */
static enum sv_status want_sun(struct sv_renderer *r, struct sv_vec3 to_sun, struct sun_shadow **sun,
                               struct sv_error *error)
{
    *sun = is_sun(&r->scene_sun, to_sun) ? &r->scene_sun : &r->other_sun;
    return is_sun(*sun, to_sun) ? SV_OK : make_sun(r, *sun, to_sun, error);
}

enum sv_status sv_renderer_make_sun(struct sv_renderer *r, bool trees, struct sv_error *error)
{
    struct sv_light light;
    sv_light_from_sun(&r->scene->sun, &light);
    enum sv_status status = SV_OK;
    if (!is_sun(&r->scene_sun, light.to_sun) && light.to_sun.z > 0)
        status = make_sun(r, &r->scene_sun, light.to_sun, error);
    if (!status && r->trees && !r->shade)
        status = sv_tree_draw_shade_create(r->trees, &r->shade, error);
    if (!status && r->shade && trees && light.to_sun.z > 0)
        status = sv_tree_shade_update(r->shade, light.to_sun, sv_shadow_height_at, &r->scene_sun.terrain, error);
    return status;
}

uint64_t sv_renderer_shadow_key(struct sv_vec3 to_sun, bool trees)
{
    uint64_t key = sv_hash_double(sv_hash_double(sv_hash_double(SV_HASH_INIT, to_sun.x), to_sun.y), to_sun.z);
    return sv_hash_u64(key, trees);
}

/* Everything that keeps the sun at to_sun (above the horizon) off the ground, ready to be asked for. */
static enum sv_status use_shadows(struct sv_renderer *r, struct sv_vec3 to_sun, bool trees, struct sv_error *error)
{
    struct sun_shadow *sun;
    enum sv_status status = want_sun(r, to_sun, &sun, error);
    if (status)
        return status;
    struct sv_shadow_scene scene = {.field = &r->scene->terrain.field, .terrain = &sun->terrain};
    trees = trees && r->shade;
    scene.key = sv_renderer_shadow_key(to_sun, trees);
    if (trees) {
        status = sv_tree_shade_update(r->shade, to_sun, sv_shadow_height_at, &sun->terrain, error);
        if (status)
            return status;
        scene.casters[0] = (struct sv_shadow_caster_of){sv_tree_shade_cast, r->shade};
    }
    if (r->objects) {
        sv_object_draw_sun(r->objects, to_sun);
        scene.casters[SV_SHADOW_CASTERS_MAX - 1] =
            (struct sv_shadow_caster_of){sv_object_draw_cast, r->objects};
    }
    sv_shadow_pages_use(r->pages, &scene);
    return SV_OK;
}

/* *shadows: there are any. */
static enum sv_status prepare_shadows(struct sv_renderer *r, const struct sv_resolved_view *view,
                                      const struct sv_gl_frame *frame, bool *shadows, struct sv_error *error)
{
    *shadows = view->plan.shadows && frame->light.to_sun.z > 0; /* at night there is no sunlight to keep off */
    return *shadows ? use_shadows(r, frame->light.to_sun, view->plan.draw_trees, error) : SV_OK;
}

enum sv_status sv_renderer_warm_shadows(struct sv_renderer *renderer, struct sv_error *error)
{
    struct sv_light light;
    sv_light_from_sun(&renderer->scene->sun, &light);
    if (!(light.to_sun.z > 0))
        return SV_OK;
    enum sv_status status = use_shadows(renderer, light.to_sun, true, error);
    if (!status)
        (void)sv_shadow_pages_fill_whole(renderer->pages,
                                         (double)renderer->scene->forest.count + renderer->scene->object_count);
    return status;
}

enum sv_status sv_renderer_create(const struct sv_scene *scene, const struct sv_renderer_options *options,
                                  struct sv_renderer **renderer, struct sv_error *error)
{
    struct sv_renderer *r = calloc(1, sizeof *r);
    if (!r)
        return sv_fail(error, SV_ENOMEM, NULL, "no memory for a renderer");
    r->scene = scene;
    r->clock = options->clock;
    sv_color_init();
    enum sv_status status = sv_gl_context_create(&r->gl, error);
    if (!status)
        status = sv_terrain_draw_create(&scene->terrain, options->store, &r->terrain, error);
    if (!status)
        status = sv_ground_create(&scene->terrain, &r->ground, error);
    if (!status)
        status = sv_renderer_make_trees(r, options->store, error);
    if (!status && scene->object_count > 0)
        status = sv_object_draw_create(scene, options->store, &r->objects, error);
    if (!status)
        status = sv_shadow_pages_create(&r->pages, error);
    if (!status)
        status = sv_renderer_make_sun(r, true, error);
    if (!status && options->truth)
        status = sv_truth_create(scene, &r->truth, error);
    if (status) {
        sv_renderer_destroy(r);
        return status;
    }
    *renderer = r;
    return SV_OK;
}

void sv_picture_finish(struct sv_picture *picture)
{
    for (int k = 0; k < SV_LAYER_COUNT; k++)
        sv_image_free(&picture->layer[k]);
}

static const struct {
    int channels;
    enum sv_pixel_type type;
} layer_form[SV_LAYER_COUNT] = {
    [SV_LAYER_COLOR] = {4, SV_PIXEL_U8},
    [SV_LAYER_DEPTH] = {1, SV_PIXEL_F32},
    [SV_LAYER_NORMAL] = {3, SV_PIXEL_F32},
    [SV_LAYER_ID] = {1, SV_PIXEL_U32},
};

static enum sv_status alloc_picture(const struct sv_camera *camera, unsigned layers, struct sv_picture *picture,
                                    struct sv_error *error)
{
    for (int k = 0; k < SV_LAYER_COUNT; k++) {
        if (!(layers & 1u << k))
            continue;
        enum sv_status status = sv_image_alloc(camera->width, camera->height, layer_form[k].channels,
                                               layer_form[k].type, &picture->layer[k], error);
        if (status)
            return status;
    }
    return SV_OK;
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

static enum sv_status want_target(struct sv_renderer *r, int width, int height, unsigned layers,
                                  struct sv_error *error)
{
    if (r->target && r->target_width == width && r->target_height == height && r->target_layers == layers)
        return SV_OK;
    sv_gl_target_destroy(r->target);
    r->target = NULL;
    sv_image_free(&r->ground_color);
    sv_image_free(&r->ground_depth);
    enum sv_status status = sv_gl_target_create(width, height, layers, &r->target, error);
    if (!status && layers & 1u << SV_LAYER_COLOR)
        status = sv_image_alloc(width, height, 4, SV_PIXEL_U8, &r->ground_color, error);
    if (!status && layers & 1u << SV_LAYER_COLOR)
        status = sv_image_alloc(width, height, 1, SV_PIXEL_F32, &r->ground_depth, error);
    if (status)
        return status;
    r->target_width = width;
    r->target_height = height;
    r->target_layers = layers;
    return SV_OK;
}

static double share_of_trees(void *shade, struct sv_vec3 place)
{
    return sv_tree_shade_share(shade, place);
}

static enum sv_status draw_objects(struct sv_renderer *r, const struct sv_resolved_view *view,
                                   const struct sv_gl_frame *frame, bool shadows, unsigned layers,
                                   struct sv_object_draw_stats *stats, struct sv_error *error)
{
    struct sv_object_draw_options options = {.relief_texel_px = view->plan.relief_texel_px,
                                             .layers = layers,
                                             .shadows = shadows};
    struct sun_shadow *sun = NULL;
    if (options.shadows && want_sun(r, frame->light.to_sun, &sun, error) == SV_OK) {
        options.ground = sv_shadow_height_at;
        options.ground_context = &sun->terrain;
        if (r->shade && view->plan.draw_trees) {
            options.trees = share_of_trees;
            options.trees_context = r->shade;
        }
    }
    return sv_object_draw_view(r->objects, frame, &options, stats, error);
}

enum sv_tree_form sv_renderer_tree_form(enum sv_trees trees)
{
    static const enum sv_tree_form forms[SV_TREES_COUNT] = {
        [SV_TREES_AUTO] = SV_TREE_FORM_AUTO,
        [SV_TREES_POLYGON] = SV_TREE_FORM_POLYGON,
        [SV_TREES_BILLBOARD] = SV_TREE_FORM_BILLBOARD,
        [SV_TREES_INDIRECT] = SV_TREE_FORM_INDIRECT,
        [SV_TREES_DENSITY] = SV_TREE_FORM_DENSITY,
        [SV_TREES_DENSITY_PAPER] = SV_TREE_FORM_DENSITY_PAPER,
        [SV_TREES_COARSE] = SV_TREE_FORM_COARSE,
    };
    return forms[trees];
}

static enum sv_status read_layers(struct sv_renderer *r, unsigned layers, struct sv_picture *picture,
                                  struct sv_error *error)
{
    enum sv_status status = SV_OK;
    for (int k = 0; k < SV_LAYER_COUNT && !status; k++)
        if (layers & 1u << k)
            status = sv_gl_target_read(r->target, (enum sv_layer)k, &picture->layer[k], error);
    return status;
}

/* The picture as what trees are drawn over on the CPU; scratch is put where it lacks colour. */
static enum sv_status canvas_of(struct sv_renderer *r, struct sv_picture *picture, unsigned layers,
                                struct sv_image *scratch, struct sv_canvas *canvas, struct sv_error *error)
{
    struct sv_image *depth = layers & 1u << SV_LAYER_DEPTH ? &picture->layer[SV_LAYER_DEPTH] : &r->ground_depth;
    struct sv_image *color = layers & 1u << SV_LAYER_COLOR ? &picture->layer[SV_LAYER_COLOR] : scratch;
    int width = r->target_width, height = r->target_height;
    enum sv_status status = SV_OK;
    if (!depth->data)
        status = sv_image_alloc(width, height, 1, SV_PIXEL_F32, depth, error);
    if (!status && !color->data)
        status = sv_image_alloc(width, height, 4, SV_PIXEL_U8, color, error);
    if (!status && depth == &r->ground_depth)
        status = sv_gl_target_read(r->target, SV_LAYER_DEPTH, depth, error);
    *canvas = (struct sv_canvas){.width = width,
                                 .height = height,
                                 .row_count = height,
                                 .depth = depth->data,
                                 .color = color->data,
                                 .id = layers & 1u << SV_LAYER_ID ? picture->layer[SV_LAYER_ID].data : NULL,
                                 .normal = layers & 1u << SV_LAYER_NORMAL ? picture->layer[SV_LAYER_NORMAL].data
                                                                          : NULL};
    return status;
}

/* The trees of a view: in the target, or over what has been read from it. */
static enum sv_status draw_trees(struct sv_renderer *r, const struct sv_resolved_view *view,
                                 const struct sv_gl_frame *frame, bool shadows, const struct sv_canvas *canvas,
                                 struct sv_draw_stats *stats, struct sv_error *error)
{
    struct sv_tree_draw_stats trees = {0};
    struct sv_tree_draw_options options = SV_TREE_DRAW_OPTIONS_DEFAULT;
    options.form = sv_renderer_tree_form(view->plan.trees);
    options.error_px = view->plan.tree_error_px;
    options.leaf_samples = view->plan.samples > 1 ? 1 : view->plan.leaf_samples;
    options.color_only = r->target_layers == 1u << SV_LAYER_COLOR;
    options.shade = shadows ? r->shade : NULL;
    options.canvas = canvas;
    enum sv_status status = sv_tree_draw_forest(r->trees, frame, &options, &trees, error);
    if (!status && stats)
        for (int k = 0; k < SV_TREE_FORM_COUNT; k++) {
            bool near = k == SV_TREE_FORM_LEAF || k == SV_TREE_FORM_POLYGON;
            *(near ? &stats->near_trees : &stats->far_trees) += trees.trees[k];
        }
    return status;
}

/* Terrain, and the sky behind it. They come before the trees: their soft edges blend over it. */
static enum sv_status draw_ground(struct sv_renderer *r, const struct sv_resolved_view *view,
                                  const struct sv_gl_frame *frame, bool shadows, bool sky, unsigned layers,
                                  struct sv_terrain_draw_stats *stats, struct sv_error *error)
{
    bool depth_only = !(layers & (1u << SV_LAYER_ID | 1u << SV_LAYER_NORMAL));
    enum sv_status status =
        sv_terrain_draw(r->terrain, frame, view->plan.terrain_error_px, depth_only, stats, error);
    if (status || !(layers & 1u << SV_LAYER_COLOR))
        return status;
    status = sv_gl_target_read(r->target, SV_LAYER_DEPTH, &r->ground_depth, error);
    if (status)
        return status;
    struct sv_ground_view ground = {.camera = &frame->camera,
                                    .light = &frame->light,
                                    .shift_x_px = frame->shift_x_px,
                                    .shift_y_px = frame->shift_y_px,
                                    .shadows = shadows ? r->pages : NULL,
                                    .sky = sky,
                                    .depth = r->ground_depth.data};
    sv_ground_shade(r->ground, &ground, r->ground_color.data);
    return sv_gl_target_write(r->target, &r->ground_color, error);
}

/* One pass: everything once, at one sample position, into the layers of the picture. Depth stays as GL has it. */
static enum sv_status draw_pass(struct sv_renderer *r, const struct sv_resolved_view *view, bool sky, unsigned layers,
                                double shift_x, double shift_y, struct sv_picture *picture,
                                struct sv_draw_stats *stats, struct sv_error *error)
{
    enum sv_status status = want_target(r, view->camera.width, view->camera.height, layers, error);
    if (status)
        return status;
    struct sv_gl_frame frame;
    memset(&frame, 0, sizeof frame);
    frame.camera = view->camera;
    frame.shift_x_px = shift_x;
    frame.shift_y_px = shift_y;
    sv_light_from_sun(&view->sun, &frame.light);
    frame.light.air = view->air;
    bool shadows;
    status = prepare_shadows(r, view, &frame, &shadows, error);
    if (status)
        return status;
    sv_gl_target_begin(r->target);
    status = sv_gl_frame_begin(&frame, error);
    struct sv_terrain_draw_stats terrain = {0};
    if (!status)
        status = draw_ground(r, view, &frame, shadows, sky, layers, &terrain, error);
    struct sv_object_draw_stats objects = {0};
    if (!status && r->objects)
        status = draw_objects(r, view, &frame, shadows, layers, &objects, error);
    if (stats)
        *stats = (struct sv_draw_stats){.terrain_triangles = terrain.triangles,
                                        .terrain_error_px = terrain.max_error_px,
                                        .polygon_objects = objects.polygon_objects,
                                        .relief_objects = objects.relief_objects};
    bool trees = r->trees && view->plan.draw_trees, canvas_form = sv_tree_form_on_canvas(sv_renderer_tree_form(view->plan.trees));
    if (!status && trees && !canvas_form)
        status = draw_trees(r, view, &frame, shadows, NULL, stats, error);
    if (!status)
        status = read_layers(r, layers, picture, error);
    if (!status && trees && canvas_form) {
        struct sv_image scratch = {0};
        struct sv_canvas canvas;
        status = canvas_of(r, picture, layers, &scratch, &canvas, error);
        if (!status)
            status = draw_trees(r, view, &frame, shadows, &canvas, stats, error);
        sv_image_free(&scratch);
    }
    return status ? status : sv_gl_check("draw_pass", error);
}

/* Premultiplied -> straight alpha, in linear light, in place. Fully opaque pixels, the usual case, are left alone. */
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
                                        struct sv_picture *picture, struct sv_timings *timings,
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
        status = draw_pass(r, view, sky, 1u << SV_LAYER_COLOR, dx, dy, picture, stats, error);
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
                                  const struct sv_resolved_view *view, struct sv_picture *picture,
                                  struct sv_timings *timings, struct sv_draw_stats *stats, struct sv_error *error)
{
    unsigned layers = request->layers;
    if (view->plan.samples > 1 && layers & 1u << SV_LAYER_COLOR) {
        enum sv_status status = draw_supersampled(r, view, request->sky, picture, timings, stats, error);
        if (status)
            return status;
        layers &= ~(1u << SV_LAYER_COLOR);
    }
    double since = now(r);
    enum sv_status status = SV_OK;
    if (layers) { /* depth, normal and id are never averaged: the pixel's centre decides */
        status = draw_pass(r, view, request->sky, layers, 0, 0, picture, stats, error);
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

static enum sv_status draw_raycast(struct sv_renderer *r, const struct sv_view_request *request,
                                   const struct sv_resolved_view *view, struct sv_picture *picture,
                                   struct sv_timings *timings, struct sv_error *error)
{
    double since = now(r);
    if (!r->truth) {
        enum sv_status status = sv_truth_create(r->scene, &r->truth, error);
        if (status)
            return status;
    }
    struct sv_light light;
    sv_light_from_sun(&view->sun, &light);
    light.air = view->air;
    struct sv_truth_options options = {.layers = request->layers,
                                       .samples = view->plan.samples,
                                       .trees = view->plan.draw_trees,
                                       .shadows = view->plan.shadows,
                                       .sky = request->sky,
                                       .row_first = 0,
                                       .row_count = view->camera.height};
    struct sv_truth_picture out = {picture->layer[SV_LAYER_COLOR], picture->layer[SV_LAYER_DEPTH],
                                   picture->layer[SV_LAYER_NORMAL], picture->layer[SV_LAYER_ID]};
    enum sv_status status = sv_truth_render(r->truth, &view->camera, &light, &options, &out, error);
    stage(r, timings, SV_STAGE_NEAR, since);
    return status;
}

enum sv_status sv_renderer_draw(struct sv_renderer *renderer, const struct sv_view_request *request,
                                const struct sv_resolved_view *view, struct sv_picture *out,
                                struct sv_timings *timings, struct sv_draw_stats *stats, struct sv_error *error)
{
    struct sv_picture picture = {0};
    struct sv_draw_stats own = {0};
    enum sv_status status = alloc_picture(&view->camera, request->layers, &picture, error);
    if (!status)
        status = view->plan.raycast
                     ? draw_raycast(renderer, request, view, &picture, timings, error)
                     : draw_raster(renderer, request, view, &picture, timings, stats ? stats : &own, error);
    if (status) {
        sv_picture_finish(&picture);
        return status;
    }
    *out = picture;
    return SV_OK;
}

const struct sv_tree_draw *sv_renderer_trees(const struct sv_renderer *renderer)
{
    return renderer->trees;
}

const struct sv_object_draw *sv_renderer_objects(const struct sv_renderer *renderer)
{
    return renderer->objects;
}
