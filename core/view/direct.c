/* direct.c - see direct.h. */
#include "core/view/direct.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "core/base/color.h"
#include "core/base/hash.h"
#include "core/cell/panel_ground.h"
#include "core/gl/frame.h"
#include "core/view/direct_private.h"

/* Panels are seen through a warp that blends their texels: leaves, which cost some twenty times as much as sprites
 * there, begin at larger sizes than in pictures. On a walk among 5,000 trees, against 64 samples of the truth
 * (tests/experiments/walkthrough): mean 5.14 and SSIM 0.826 with 1, 5.19 and 0.824 with 1.2, 6.10 and 0.804 (of other
 * poses) with 1.6; a ray cast of one sample has 5.83 and 0.767. The dearest panel over 45,000 trees takes 204 to 237 ms
 * with 1, 123 to 128 with 1.2. A step into the next cell (test_cells_pictures) changes at most 2.0 levels more than one
 * within it with 1, 2.9 with 1.2, 3.1 with 1.25. A longer fade between the forms makes steps smoother and is not worth
 * it: from 0.6 of the size on (FADE_FROM of core/tree/draw.c; 0.8) 2.3, and all panels over 45,000 trees take 1.2 times
 * as long; from 0.7 of 1.4 times the size on 2.1 or 2.3 in the time of now, and one of four walks is off by 8.04, SSIM
 * 0.698, in place of 7.40 and 0.722. */
#define PANEL_NEAR_SCALE 1.2

static void finish_target(struct direct_target *target)
{
    sv_gl_target_destroy(target->gl);
    sv_image_free(&target->ground_color);
    sv_image_free(&target->ground_depth);
    *target = (struct direct_target){0};
}

void sv_direct_destroy(struct sv_direct *direct)
{
    if (!direct)
        return;
    for (int k = 0; k < TARGETS; k++)
        finish_target(&direct->targets[k]);
    sv_shadow_height_finish(&direct->scene_sun.terrain);
    sv_shadow_height_finish(&direct->other_sun.terrain);
    sv_shadow_pages_destroy(direct->pages);
    sv_ground_destroy(direct->ground);
    sv_tree_shade_destroy(direct->shade);
    sv_object_draw_destroy(direct->objects);
    sv_tree_draw_destroy(direct->trees);
    sv_terrain_draw_destroy(direct->terrain);
    sv_gl_context_destroy(direct->gl);
    free(direct);
}

enum sv_status sv_direct_make_trees(struct sv_direct *r, struct sv_store *store, struct sv_error *error)
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

static enum sv_status make_sun(struct sv_direct *r, struct sun_shadow *sun, struct sv_vec3 to_sun,
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
static enum sv_status want_sun(struct sv_direct *r, struct sv_vec3 to_sun, struct sun_shadow **sun,
                               struct sv_error *error)
{
    *sun = is_sun(&r->scene_sun, to_sun) ? &r->scene_sun : &r->other_sun;
    return is_sun(*sun, to_sun) ? SV_OK : make_sun(r, *sun, to_sun, error);
}

enum sv_status sv_direct_make_sun(struct sv_direct *r, bool trees, struct sv_error *error)
{
    struct sv_light light;
    sv_light_from_sun(&r->scene->sun, &light);
    enum sv_status status = SV_OK;
    if (!is_sun(&r->scene_sun, light.to_sun) && light.to_sun.z > 0)
        status = make_sun(r, &r->scene_sun, light.to_sun, error);
    if (!status && r->trees && !r->shade)
        status = sv_tree_draw_shade_create(r->trees, &r->shade, error);
    if (!status && r->shade && trees && light.to_sun.z > 0)
        status =
            sv_tree_shade_update(r->shade, light.to_sun, sv_shadow_height_at, &r->scene_sun.terrain, error);
    return status;
}

uint64_t sv_direct_shadow_key(struct sv_vec3 to_sun, bool trees)
{
    uint64_t key = sv_hash_double(sv_hash_double(sv_hash_double(SV_HASH_INIT, to_sun.x), to_sun.y), to_sun.z);
    return sv_hash_u64(key, trees);
}

/* Everything that keeps the sun at to_sun (above the horizon) off the ground, ready to be asked for. */
static enum sv_status use_shadows(struct sv_direct *r, struct sv_vec3 to_sun, bool trees,
                                  struct sv_error *error)
{
    struct sun_shadow *sun;
    enum sv_status status = want_sun(r, to_sun, &sun, error);
    if (status)
        return status;
    struct sv_shadow_scene scene = {
        .field = &r->scene->terrain.field, .terrain = &sun->terrain, .refined = r->refined};
    trees = trees && r->shade;
    scene.key = sv_direct_shadow_key(to_sun, trees);
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

void sv_direct_use_refined(struct sv_direct *direct, const struct sv_shadow_source *source)
{
    direct->refined = source ? *source : (struct sv_shadow_source){0};
}

struct sv_shadow_pages *sv_direct_pages(struct sv_direct *direct)
{
    return direct->pages;
}

/* *shadows: there are any. */
static enum sv_status prepare_shadows(struct sv_direct *r, const struct sv_resolved_view *view,
                                      const struct sv_gl_frame *frame, bool *shadows, struct sv_error *error)
{
    *shadows =
        view->plan.shadows && frame->light.to_sun.z > 0; /* at night there is no sunlight to keep off */
    return *shadows ? use_shadows(r, frame->light.to_sun, view->plan.draw_trees, error) : SV_OK;
}

enum sv_status sv_direct_warm_shadows(struct sv_direct *direct, double most_s, struct sv_error *error)
{
    struct sv_light light;
    sv_light_from_sun(&direct->scene->sun, &light);
    if (!(light.to_sun.z > 0))
        return SV_OK;
    enum sv_status status = use_shadows(direct, light.to_sun, true, error);
    if (!status)
        (void)sv_shadow_pages_fill_whole(direct->pages,
                                         (double)direct->scene->forest.count + direct->scene->object_count, most_s);
    return status;
}

enum sv_status sv_direct_create(const struct sv_scene *scene, struct sv_store *store,
                                struct sv_direct **direct, struct sv_error *error)
{
    struct sv_direct *r = calloc(1, sizeof *r);
    if (!r)
        return sv_fail(error, SV_ENOMEM, NULL, "no memory to draw a scene");
    r->scene = scene;
    sv_color_init();
    enum sv_status status = sv_gl_context_create(&r->gl, error);
    if (!status)
        status = sv_terrain_draw_create(&scene->terrain, store, &r->terrain, error);
    if (!status)
        status = sv_ground_create(&scene->terrain, &r->ground, error);
    if (!status)
        status = sv_direct_make_trees(r, store, error);
    if (!status && scene->object_count > 0)
        status = sv_object_draw_create(scene, store, &r->objects, error);
    if (!status)
        status = sv_shadow_pages_create(&r->pages, error);
    if (!status)
        status = sv_direct_make_sun(r, true, error);
    if (status) {
        sv_direct_destroy(r);
        return status;
    }
    *direct = r;
    return SV_OK;
}

/* targets[0] becomes one of that size and those layers. */
static enum sv_status want_target(struct sv_direct *r, int width, int height, unsigned layers,
                                  struct sv_error *error)
{
    int k = 0;
    while (k < TARGETS - 1 && !(r->targets[k].gl && r->targets[k].width == width &&
                                r->targets[k].height == height && r->targets[k].layers == layers))
        k++;
    struct direct_target t = r->targets[k];
    memmove(&r->targets[1], &r->targets[0], (size_t)k * sizeof t);
    r->targets[0] = t;
    if (t.gl && t.width == width && t.height == height && t.layers == layers)
        return SV_OK;
    finish_target(&r->targets[0]);
    struct direct_target *to = &r->targets[0];
    enum sv_status status = sv_gl_target_create(width, height, layers, &to->gl, error);
    if (!status && layers & 1u << SV_LAYER_COLOR)
        status = sv_image_alloc(width, height, 4, SV_PIXEL_U8, &to->ground_color, error);
    if (!status && layers & 1u << SV_LAYER_COLOR)
        status = sv_image_alloc(width, height, 1, SV_PIXEL_F32, &to->ground_depth, error);
    if (status)
        return status;
    to->width = width;
    to->height = height;
    to->layers = layers;
    return SV_OK;
}

static double share_of_trees(void *shade, struct sv_vec3 place)
{
    return sv_tree_shade_share(shade, place);
}

static enum sv_status draw_objects(struct sv_direct *r, const struct sv_resolved_view *view,
                                   const struct sv_gl_frame *frame, bool shadows, unsigned layers,
                                   struct sv_object_draw_stats *stats, struct sv_error *error)
{
    struct sv_object_draw_options options = {
        .relief_texel_px = view->plan.relief_texel_px, .layers = layers, .shadows = shadows};
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

enum sv_tree_form sv_direct_tree_form(enum sv_trees trees)
{
    static const enum sv_tree_form forms[SV_TREES_COUNT] = {
        [SV_TREES_AUTO] = SV_TREE_FORM_AUTO,           [SV_TREES_POLYGON] = SV_TREE_FORM_POLYGON,
        [SV_TREES_BILLBOARD] = SV_TREE_FORM_BILLBOARD, [SV_TREES_INDIRECT] = SV_TREE_FORM_INDIRECT,
        [SV_TREES_DENSITY] = SV_TREE_FORM_DENSITY,     [SV_TREES_DENSITY_PAPER] = SV_TREE_FORM_DENSITY_PAPER,
        [SV_TREES_COARSE] = SV_TREE_FORM_COARSE,
    };
    return forms[trees];
}

static enum sv_status read_layers(struct sv_direct *r, const struct sv_direct_pass *pass, struct sv_picture *picture,
                                  struct sv_error *error)
{
    enum sv_status status = SV_OK;
    for (int k = 0; k < SV_LAYER_COUNT && !status; k++)
        if (pass->layers & 1u << k)
            status = sv_gl_target_read_rows(r->targets[0].gl, (enum sv_layer)k, pass->row_first, &picture->layer[k],
                                            error);
    return status;
}

/* The first rows of an image, as many as the band has. */
static struct sv_image band_of(const struct sv_image *image, const struct sv_direct_pass *pass)
{
    struct sv_image band = *image;
    band.height = pass->row_count;
    return band;
}

/* The picture as what trees are drawn over on the CPU; scratch is put where it lacks colour. */
static enum sv_status canvas_of(struct sv_direct *r, struct sv_picture *picture, const struct sv_direct_pass *pass,
                                struct sv_image *scratch, struct sv_canvas *canvas, struct sv_error *error)
{
    unsigned layers = pass->layers;
    struct sv_image *depth =
        layers & 1u << SV_LAYER_DEPTH ? &picture->layer[SV_LAYER_DEPTH] : &r->targets[0].ground_depth;
    struct sv_image *color = layers & 1u << SV_LAYER_COLOR ? &picture->layer[SV_LAYER_COLOR] : scratch;
    int width = r->targets[0].width, height = r->targets[0].height;
    enum sv_status status = SV_OK;
    if (!depth->data)
        status = sv_image_alloc(width, height, 1, SV_PIXEL_F32, depth, error);
    if (!status && !color->data)
        status = sv_image_alloc(width, pass->row_count, 4, SV_PIXEL_U8, color, error);
    if (!status && depth == &r->targets[0].ground_depth) {
        struct sv_image band = band_of(depth, pass);
        status = sv_gl_target_read_rows(r->targets[0].gl, SV_LAYER_DEPTH, pass->row_first, &band, error);
    }
    *canvas = (struct sv_canvas){
        .width = width,
        .height = height,
        .row_first = pass->row_first,
        .row_count = pass->row_count,
        .depth = depth->data,
        .color = color->data,
        .id = layers & 1u << SV_LAYER_ID ? picture->layer[SV_LAYER_ID].data : NULL,
        .normal = layers & 1u << SV_LAYER_NORMAL ? picture->layer[SV_LAYER_NORMAL].data : NULL};
    return status;
}

/* The trees of a view: in the target, or over what has been read from it. */
static enum sv_status draw_trees(struct sv_direct *r, const struct sv_resolved_view *view,
                                 const struct sv_gl_frame *frame, bool shadows,
                                 const struct sv_tree_shell *shell, const struct sv_canvas *canvas,
                                 struct sv_draw_stats *stats, struct sv_error *error)
{
    struct sv_tree_draw_stats trees = {0};
    struct sv_tree_draw_options options = SV_TREE_DRAW_OPTIONS_DEFAULT;
    options.form = sv_direct_tree_form(view->plan.trees);
    options.error_px = view->plan.tree_error_px;
    options.near_scale = canvas && canvas->surface ? PANEL_NEAR_SCALE : 1;
    options.leaf_samples = view->plan.samples > 1 ? 1 : view->plan.leaf_samples;
    options.color_only = !canvas && r->targets[0].layers == 1u << SV_LAYER_COLOR;
    options.shell = shell;
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
static enum sv_status draw_ground(struct sv_direct *r, const struct sv_resolved_view *view,
                                  const struct sv_gl_frame *frame, bool shadows, const struct sv_direct_pass *pass,
                                  struct sv_terrain_draw_stats *stats, struct sv_error *error)
{
    struct direct_target *t = &r->targets[0];
    bool depth_only = !(pass->layers & (1u << SV_LAYER_ID | 1u << SV_LAYER_NORMAL));
    enum sv_status status =
        sv_terrain_draw(r->terrain, frame, view->plan.terrain_error_px, depth_only, stats, error);
    if (status || !(pass->layers & 1u << SV_LAYER_COLOR))
        return status;
    struct sv_image depth = band_of(&t->ground_depth, pass), color = band_of(&t->ground_color, pass);
    status = sv_gl_target_read_rows(t->gl, SV_LAYER_DEPTH, pass->row_first, &depth, error);
    if (status)
        return status;
    struct sv_ground_view ground = {.camera = &frame->camera,
                                    .light = &frame->light,
                                    .shift_x_px = frame->shift_x_px,
                                    .shift_y_px = frame->shift_y_px,
                                    .shadows = shadows ? r->pages : NULL,
                                    .sky = pass->sky,
                                    .row_first = pass->row_first,
                                    .row_count = pass->row_count,
                                    .depth = depth.data};
    sv_ground_shade(r->ground, &ground, color.data);
    return sv_gl_target_write_rows(t->gl, pass->row_first, &color, error);
}

static void frame_of(const struct sv_resolved_view *view, double shift_x_px, double shift_y_px,
                     struct sv_gl_frame *frame)
{
    memset(frame, 0, sizeof *frame);
    frame->camera = view->camera;
    frame->shift_x_px = shift_x_px;
    frame->shift_y_px = shift_y_px;
    sv_light_from_sun(&view->sun, &frame->light);
    frame->light.air = view->air;
}

/* What trees are drawn over: terrain, sky and objects, into the target. */
static enum sv_status draw_opaque(struct sv_direct *r, const struct sv_resolved_view *view,
                                  const struct sv_gl_frame *frame, bool shadows,
                                  const struct sv_direct_pass *pass, struct sv_draw_stats *stats,
                                  struct sv_error *error)
{
    struct sv_terrain_draw_stats terrain = {0};
    struct sv_object_draw_stats objects = {0};
    enum sv_status status = draw_ground(r, view, frame, shadows, pass, &terrain, error);
    if (!status && r->objects)
        status = draw_objects(r, view, frame, shadows, pass->layers, &objects, error);
    if (stats)
        *stats = (struct sv_draw_stats){.terrain_triangles = terrain.triangles,
                                        .terrain_error_px = terrain.max_error_px,
                                        .polygon_objects = objects.polygon_objects,
                                        .relief_objects = objects.relief_objects};
    return status;
}

enum sv_status sv_direct_draw(struct sv_direct *r, const struct sv_resolved_view *view,
                              const struct sv_direct_pass *asked, struct sv_picture *picture,
                              struct sv_draw_stats *stats, struct sv_error *error)
{
    struct sv_direct_pass band = *asked;
    const struct sv_direct_pass *pass = &band;
    band.row_count = asked->row_count > 0 ? asked->row_count : view->camera.height;
    enum sv_status status = want_target(r, view->camera.width, view->camera.height, pass->layers, error);
    if (status)
        return status;
    struct sv_gl_frame frame;
    frame_of(view, pass->shift_x_px, pass->shift_y_px, &frame);
    frame.row_first = pass->row_first;
    frame.row_count = pass->row_count;
    bool shadows;
    status = prepare_shadows(r, view, &frame, &shadows, error);
    if (status)
        return status;
    sv_gl_target_begin_rows(r->targets[0].gl, pass->row_first, pass->row_count);
    status = sv_gl_frame_begin(&frame, error);
    if (!status)
        status = draw_opaque(r, view, &frame, shadows, pass, stats, error);
    bool trees = r->trees && pass->trees && view->plan.draw_trees;
    bool canvas_form = sv_tree_form_on_canvas(sv_direct_tree_form(view->plan.trees));
    if (!status && trees && !canvas_form)
        status = draw_trees(r, view, &frame, shadows, NULL, NULL, stats, error);
    if (!status)
        status = read_layers(r, pass, picture, error);
    if (!status && trees && canvas_form) {
        struct sv_image scratch = {0};
        struct sv_canvas canvas;
        status = canvas_of(r, picture, pass, &scratch, &canvas, error);
        if (!status)
            status = draw_trees(r, view, &frame, shadows, NULL, &canvas, stats, error);
        sv_image_free(&scratch);
    }
    return status ? status : sv_gl_check("sv_direct_draw", error);
}

enum sv_status sv_direct_draw_trees(struct sv_direct *r, const struct sv_resolved_view *view,
                                    const struct sv_tree_shell *shell, const struct sv_canvas *canvas,
                                    struct sv_draw_stats *stats, struct sv_error *error)
{
    struct sv_gl_frame frame;
    bool shadows;
    if (!r->trees || !view->plan.draw_trees)
        return SV_OK;
    frame_of(view, 0, 0, &frame);
    enum sv_status status = prepare_shadows(r, view, &frame, &shadows, error);
    if (!status)
        status = sv_gl_frame_begin(&frame, error);
    return status ? status : draw_trees(r, view, &frame, shadows, shell, canvas, stats, error);
}

enum sv_status sv_direct_sees_trees(struct sv_direct *r, const struct sv_resolved_view *view,
                                    const struct sv_tree_shell *shell, bool *any, struct sv_error *error)
{
    double planes[5][4];
    uint32_t count = 0;
    sv_camera_planes(&view->camera, planes);
    enum sv_status status = SV_OK;
    if (r->trees && view->plan.draw_trees)
        status = sv_tree_draw_count(r->trees, &view->camera, planes, shell, &count, error);
    if (!status)
        *any = count > 0;
    return status;
}

enum sv_status sv_direct_light(struct sv_direct *r, const struct sv_resolved_view *view,
                               struct sv_cell_light *light, struct sv_error *error)
{
    struct sv_gl_frame frame;
    bool shadows;
    frame_of(view, 0, 0, &frame);
    enum sv_status status = prepare_shadows(r, view, &frame, &shadows, error);
    if (status)
        return status;
    *light = (struct sv_cell_light){0};
    if (shadows)
        light->to_sun = frame.light.to_sun;
    if (shadows && r->shade && view->plan.draw_trees)
        light->texel_m = sv_tree_shade_texel_m(r->shade);
    return SV_OK;
}

enum sv_status sv_direct_shade_ground(struct sv_direct *r, const struct sv_resolved_view *view, bool sky,
                                      int row_first, int row_count, const float *depth, const uint8_t *hidden,
                                      uint8_t *rgba, struct sv_error *error)
{
    struct sv_gl_frame frame;
    bool shadows;
    frame_of(view, 0, 0, &frame);
    enum sv_status status = prepare_shadows(r, view, &frame, &shadows, error);
    if (status)
        return status;
    struct sv_ground_view ground = {.camera = &frame.camera,
                                    .light = &frame.light,
                                    .shadows = shadows ? r->pages : NULL,
                                    .sky = sky,
                                    .row_first = row_first,
                                    .row_count = row_count,
                                    .depth = depth,
                                    .hidden = hidden};
    sv_ground_shade(r->ground, &ground, rgba);
    return SV_OK;
}

enum sv_status sv_direct_ground_panel(struct sv_direct *r, const struct sv_resolved_view *view,
                                      const struct sv_sweep *sweep, float *q, uint8_t (*color)[4],
                                      struct sv_error *error)
{
    struct sv_gl_frame frame;
    bool shadows;
    frame_of(view, 0, 0, &frame);
    enum sv_status status = prepare_shadows(r, view, &frame, &shadows, error);
    if (status)
        return status;
    struct sv_panel_ground_options options = {
        .sweep = *sweep, .ground = r->ground, .light = &frame.light, .shadows = shadows ? r->pages : NULL};
    sv_panel_ground_make(&options, q, color);
    return SV_OK;
}

const struct sv_tree_draw *sv_direct_trees(const struct sv_direct *direct)
{
    return direct->trees;
}

const struct sv_object_draw *sv_direct_objects(const struct sv_direct *direct)
{
    return direct->objects;
}
