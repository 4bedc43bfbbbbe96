/* bench_sprite.c - far trees on the CPU: time by number of trees, and error against 64-sample ray casts.
 *
 *   bench_sprite [--trees N[,N...]] [--eyes N] [--size PX] [--side M] [--store DIR] [--truth] [--pictures
 * DIR] [--walk]
 *
 * A forest of the five demo species, 1 km x 1 km (--side). Each line: trees, eye, ms of cull and sort, of
 * drawing (least of REPEATS), of the GL quads beside it. --truth: mean absolute error, SSIM and gradient
 * energy of the sprites' picture, of the GL quads' and of a one-sample ray cast. Never asserts on time. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

#include "core/base/color.h"
#include "core/base/frames.h"
#include "core/gl/context.h"
#include "core/gl/target.h"
#include "core/image/encode.h"
#include "core/scene/scene.h"
#include "core/terrain/draw.h"
#include "core/terrain/draw_shadow.h"
#include "core/tree/sprite.h"
#include "core/truth/truth.h"
#include "core/view/compare.h"
#include "tests/core/view/scene_kit.h"

enum { REPEATS = 5, COUNTS_MAX = 8 };

struct options {
    int counts[COUNTS_MAX], count, eyes, size, side_m;
    const char *store, *pictures;
    bool truth, walk, quads;
};

struct stage {
    struct sv_scene *scene;
    struct sv_gl_context *gl;
    struct sv_terrain_draw *terrain;
    struct sv_shadow_draw *shadow_draw;
    struct sv_shadow_height heights;
    struct sv_tree_shade *shade;
    struct sv_tree_draw *quads;
    struct sv_sprite_draw *sprites;
    struct sv_truth *truth;
    struct sv_cull_species *cull;
    struct sv_cull_list list;
    struct sv_light light;
};

/* Of this thread: what others do meanwhile does not count. */
static double now_ms(void)
{
    struct timespec t;
    clock_gettime(CLOCK_THREAD_CPUTIME_ID, &t);
    return (double)t.tv_sec * 1e3 + (double)t.tv_nsec * 1e-6;
}

static void must(enum sv_status status, const struct sv_error *error)
{
    if (status == SV_OK)
        return;
    fprintf(stderr, "%s: %s: %s\n", sv_status_text(status), error->field, error->message);
    exit(1);
}

static void load(struct stage *s, int trees, int side_m, struct sv_store *store)
{
    char text[2048];
    int bytes = snprintf(
        text, sizeof text,
        "{\"name\": \"bench\", \"terrain\": {\"procedural\": {\"size_m\": %d, \"samples\": 513, "
        "\"relief_m\": 60, \"seed\": 11}}, \"species\": ["
        "{\"name\": \"beech\", \"procedural\": {\"habit\": \"broadleaf\", \"leaves\": 38952, "
        "\"seed\": 7}},"
        "{\"name\": \"oak\", \"procedural\": {\"habit\": \"broadleaf\", \"leaves\": 39204, \"seed\": "
        "23}},"
        "{\"name\": \"spruce\", \"procedural\": {\"habit\": \"conifer\", \"leaves\": 38952, \"seed\": "
        "3}},"
        "{\"name\": \"poplar\", \"procedural\": {\"habit\": \"poplar\", \"leaves\": 39010, \"seed\": "
        "5}},"
        "{\"name\": \"hazel\", \"procedural\": {\"habit\": \"shrub\", \"leaves\": 38700, \"seed\": "
        "2}}],"
        "\"forest\": [{\"scatter\": {\"count\": %d, \"seed\": 1, \"mix\": {\"beech\": 1, \"oak\": "
        "1, \"spruce\": 1, \"poplar\": 1, \"hazel\": 1}, \"height_m\": [6, 18], \"min_spacing_m\": "
        "2, \"max_slope_deg\": 60}}],"
        "\"sun\": {\"azimuth_deg\": 135, \"elevation_deg\": 40}}",
        side_m, trees);
    struct sv_scene_spec spec;
    struct sv_errors errors;
    sv_errors_init(&errors);
    enum sv_status status = sv_scene_spec_parse(text, (size_t)bytes, "bench.json", &spec, &errors);
    struct sv_scene_options options = {.store = store};
    if (!status)
        status = sv_scene_load(&spec, &options, &s->scene, &errors);
    if (status) {
        fprintf(stderr, "%s\n", errors.count ? errors.items[0].message : "no scene");
        exit(1);
    }
    sv_errors_finish(&errors);
}

static void open_stage(struct stage *s, int trees, const struct options *o, struct sv_store *store)
{
    struct sv_error error;
    memset(s, 0, sizeof *s);
    load(s, trees, o->side_m, store);
    const struct sv_scene *scene = s->scene;
    must(sv_gl_context_create(&s->gl, &error), &error);
    must(sv_terrain_draw_create(&scene->terrain, store, &s->terrain, &error), &error);
    must(sv_shadow_draw_create(&s->shadow_draw, &error), &error);
    sv_light_from_sun(&scene->sun, &s->light);
    must(sv_shadow_height_make(&s->heights, &scene->terrain.field, s->light.to_sun, &error), &error);
    struct sv_tree_draw_species species[8];
    s->cull = calloc(8, sizeof *s->cull);
    for (int k = 0; k < scene->species_count; k++) {
        species[k] = (struct sv_tree_draw_species){&scene->species[k].mesh, scene->species[k].key,
                                                   scene->species[k].tree_count};
        s->cull[k] =
            (struct sv_cull_species){scene->species[k].mesh.radius, scene->species[k].mesh.index_count / 3};
    }
    double since = now_ms();
    must(sv_sprite_draw_create(species, scene->species_count, store, &s->sprites, &error), &error);
    printf("# sprites made or read in %.0f ms; MB a species:", now_ms() - since);
    for (int k = 0; k < scene->species_count; k++)
        printf(" %.1f", (double)sv_sprite_draw_bytes(s->sprites, k) * 1e-6);
    printf("\n");
    struct sv_shade_species shade[8];
    for (int k = 0; k < scene->species_count; k++)
        shade[k] = sv_sprite_draw_shade_species(s->sprites, k);
    must(sv_tree_shade_create(shade, scene->species_count, &scene->forest, &s->shade, &error), &error);
    must(sv_tree_shade_update(s->shade, s->light.to_sun, sv_shadow_height_at, &s->heights, &error), &error);
    if (o->quads)
        must(sv_tree_draw_create(species, scene->species_count, &scene->forest, store, &s->quads, &error),
             &error);
    if (o->truth)
        must(sv_truth_create(scene, &s->truth, &error), &error);
}

static void close_stage(struct stage *s)
{
    sv_truth_destroy(s->truth);
    sv_tree_draw_destroy(s->quads);
    sv_tree_shade_destroy(s->shade);
    sv_sprite_draw_destroy(s->sprites);
    sv_shadow_height_finish(&s->heights);
    sv_shadow_draw_destroy(s->shadow_draw);
    sv_terrain_draw_destroy(s->terrain);
    sv_gl_context_destroy(s->gl);
    sv_cull_list_finish(&s->list);
    free(s->cull);
    sv_scene_destroy(s->scene);
}

static struct sv_camera eye_of(const struct stage *s, const struct options *o, int k)
{
    const struct sv_heightfield *f = &s->scene->terrain.field;
    double turn = 2 * SV_PI * (k + 0.3) / o->eyes, heading = turn + SV_PI;
    double x = f->x0 + 0.5 * o->side_m + 300 * sin(turn), y = f->y0 + 0.5 * o->side_m + 300 * cos(turn);
    double up = o->walk ? 1.7 : 30 + 30.0 * ((k * 5) % 8) / 7;
    struct sv_camera c = {.eye = sv_vec3(x, y, kit_surface(f, x, y) + up),
                          .projection = SV_PROJECTION_PERSPECTIVE,
                          .vfov_rad = sv_radians(60),
                          .width = o->size,
                          .height = o->size,
                          .near_m = 0.1};
    sv_camera_aim(&c, heading, sv_radians(o->walk ? 0 : -12), 0);
    return c;
}

/* Ground and sky with all shadows, as GL draws them; with trees by GL quads when wanted. */
static void draw_ground(struct stage *s, const struct sv_camera *camera, bool quads, struct sv_image *color,
                        struct sv_image *depth, double *quads_ms)
{
    struct sv_error error;
    struct sv_gl_target *target;
    struct sv_gl_frame frame;
    struct sv_gl_shadows shadows;
    memset(&frame, 0, sizeof frame);
    frame.camera = *camera;
    frame.light = s->light;
    struct sv_shadow_scene casters = {.field = &s->scene->terrain.field, .terrain = &s->heights, .key = 1};
    casters.casters[0] = (struct sv_shadow_caster_of){sv_tree_shade_cast, s->shade};
    must(sv_shadow_draw_update(s->shadow_draw, &casters, camera, &shadows, NULL, &error), &error);
    frame.shadows = &shadows;
    must(sv_gl_target_create(camera->width, camera->height, 1u << SV_LAYER_COLOR, &target, &error), &error);
    sv_gl_target_begin(target);
    must(sv_gl_frame_begin(&frame, &error), &error);
    must(sv_terrain_draw(s->terrain, &frame, 0.7, NULL, &error), &error);
    must(sv_sky_draw(&frame, &error), &error);
    if (quads) {
        struct sv_tree_draw_options options = SV_TREE_DRAW_OPTIONS_DEFAULT;
        options.form = SV_TREE_FORM_COARSE;
        options.color_only = true;
        options.shade = s->shade;
        must(sv_gl_target_read(target, SV_LAYER_COLOR, color, &error), &error);
        double since = now_ms();
        must(sv_tree_draw_forest(s->quads, &frame, &options, NULL, &error), &error);
        must(sv_gl_target_read(target, SV_LAYER_COLOR, color, &error), &error);
        *quads_ms = now_ms() - since;
    }
    must(sv_gl_target_read(target, SV_LAYER_COLOR, color, &error), &error);
    must(sv_gl_target_read(target, SV_LAYER_DEPTH, depth, &error), &error);
    sv_gl_target_destroy(target);
}

static void image(int size, int channels, enum sv_pixel_type type, struct sv_image *out)
{
    struct sv_error error;
    must(sv_image_alloc(size, size, channels, type, out, &error), &error);
}

static void ray_cast(const struct stage *s, const struct sv_camera *camera, int samples,
                     struct sv_image *color, double *ms)
{
    struct sv_error error;
    struct sv_truth_options options = {.layers = 1u << SV_LAYER_COLOR,
                                       .samples = samples,
                                       .trees = true,
                                       .shadows = true,
                                       .sky = true,
                                       .row_count = camera->height};
    struct sv_truth_picture picture;
    memset(&picture, 0, sizeof picture);
    picture.color = *color;
    double since = now_ms();
    must(sv_truth_render(s->truth, camera, &s->light, &options, &picture, &error), &error);
    *ms = now_ms() - since;
}

/* As ray_cast, but kept in a file beside the store: 64 samples take a minute. */
static void ray_cast_once(const struct stage *s, const struct options *o, const struct sv_camera *camera,
                          int samples, struct sv_image *color, int trees, int eye, double *ms)
{
    char path[512];
    snprintf(path, sizeof path, "%s/truth_%d_%d_%d_%d_%d%s.raw", o->store ? o->store : ".", trees, o->eyes,
             eye, o->size, samples, o->walk ? "w" : "");
    FILE *file = o->store ? fopen(path, "rb") : NULL;
    bool there = file && fread(color->data, 1, sv_image_bytes(color), file) == sv_image_bytes(color);
    if (file)
        fclose(file);
    if (there)
        return;
    ray_cast(s, camera, samples, color, ms);
    file = o->store ? fopen(path, "wb") : NULL;
    if (file) {
        fwrite(color->data, 1, sv_image_bytes(color), file);
        fclose(file);
    }
}

static void keep(const struct options *o, const struct sv_image *color, const char *name, int trees, int eye)
{
    char text[64];
    if (!o->pictures)
        return;
    snprintf(text, sizeof text, "%s_%d_%d%s", name, trees, eye, o->walk ? "w" : "");
    setenv("SV_TEST_PICTURES", o->pictures, 1);
    kit_keep(color, text);
}

static void report(const char *name, const struct sv_image *picture, const struct sv_image *truth,
                   const struct sv_image *mask, double ms)
{
    struct sv_error error;
    struct sv_compare_result r;
    struct sv_compare_options options = SV_COMPARE_OPTIONS_DEFAULT;
    options.mask = mask;
    must(sv_compare(picture, truth, &options, &r, &error), &error);
    printf("    %-8s mae %6.3f  ssim %.4f  gradient %.3f  rmse %.2f  %.1f ms\n", name, r.mean_abs, r.ssim,
           r.gradient_ratio, r.rmse, ms);
}

/* Pixels where the sprites drew anything. */
static void difference(const struct sv_image *a, const struct sv_image *b, struct sv_image *mask)
{
    const uint8_t *p = a->data, *q = b->data;
    uint8_t *m = mask->data;
    for (size_t k = 0; k < (size_t)a->width * (size_t)a->height; k++)
        m[k] = memcmp(p + 4 * k, q + 4 * k, 3) ? 255 : 0;
}

static void view(struct stage *s, const struct options *o, int trees, int k, double *sum_ms)
{
    struct sv_error error;
    struct sv_camera camera = eye_of(s, o, k);
    struct sv_image ground, depth, picture, quads, truth, one, mask;
    image(o->size, 4, SV_PIXEL_U8, &ground);
    image(o->size, 4, SV_PIXEL_U8, &picture);
    image(o->size, 4, SV_PIXEL_U8, &quads);
    image(o->size, 4, SV_PIXEL_U8, &truth);
    image(o->size, 4, SV_PIXEL_U8, &one);
    image(o->size, 1, SV_PIXEL_U8, &mask);
    image(o->size, 1, SV_PIXEL_F32, &depth);
    double quads_ms = 0, cull_ms = INFINITY, draw_ms = INFINITY, planes[5][4];
    if (o->quads)
        draw_ground(s, &camera, true, &quads, &depth, &quads_ms);
    draw_ground(s, &camera, false, &ground, &depth, NULL);
    sv_camera_planes(&camera, planes);
    struct sv_tree_draw_options options = SV_TREE_DRAW_OPTIONS_DEFAULT;
    options.form = SV_TREE_FORM_COARSE;
    for (int n = 0; n < REPEATS; n++) {
        memcpy(picture.data, ground.data, sv_image_bytes(&ground));
        double since = now_ms();
        must(sv_cull_forest(&s->scene->forest, s->cull, &camera, planes, &options, &s->list, &error), &error);
        cull_ms = fmin(cull_ms, now_ms() - since);
        struct sv_canvas canvas = {.width = o->size,
                                   .height = o->size,
                                   .row_count = o->size,
                                   .depth = depth.data,
                                   .color = picture.data};
        struct sv_sprite_view seen = {.camera = &camera, .light = &s->light};
        struct sv_sprite_list list = {.entries = s->list.entries + s->list.polygon_count,
                                      .count = s->list.impostor_count,
                                      .farthest_first = true};
        since = now_ms();
        must(sv_sprite_draw_trees(s->sprites, &seen, &canvas, s->scene->forest.trees, &list,
                                  sv_tree_shade_lights(s->shade), &error),
             &error);
        draw_ms = fmin(draw_ms, now_ms() - since);
    }
    *sum_ms += cull_ms + draw_ms;
    printf("%6d trees, eye %d: seen %6u  cull %5.2f ms  draw %6.2f ms  quads %6.1f ms\n", trees, k,
           s->list.impostor_count, cull_ms, draw_ms, quads_ms);
    keep(o, &picture, "sprite", trees, k);
    if (o->quads)
        keep(o, &quads, "quads", trees, k);
    if (o->truth) {
        double ms1 = 0;
        ray_cast_once(s, o, &camera, 64, &truth, trees, k, &ms1);
        ray_cast_once(s, o, &camera, 1, &one, trees, k, &ms1);
        difference(&picture, &ground, &mask);
        report("sprites", &picture, &truth, &mask, draw_ms);
        if (o->quads)
            report("quads", &quads, &truth, &mask, quads_ms);
        report("one ray", &one, &truth, &mask, ms1);
        keep(o, &truth, "truth", trees, k);
        keep(o, &one, "one", trees, k);
    }
    struct sv_image *all[] = {&ground, &depth, &picture, &quads, &truth, &one, &mask};
    for (size_t n = 0; n < sizeof all / sizeof all[0]; n++)
        sv_image_free(all[n]);
}

static void parse(int count, char **arguments, struct options *o)
{
    *o = (struct options){.counts = {5000, 20000, 45000}, .count = 3, .eyes = 4, .size = 512, .side_m = 1000};
    for (int k = 1; k < count; k++) {
        const char *a = arguments[k], *next = k + 1 < count ? arguments[k + 1] : "";
        if (strcmp(a, "--truth") == 0)
            o->truth = true;
        else if (strcmp(a, "--walk") == 0)
            o->walk = true;
        else if (strcmp(a, "--quads") == 0)
            o->quads = true;
        else if (strcmp(a, "--eyes") == 0 && ++k)
            o->eyes = atoi(next);
        else if (strcmp(a, "--size") == 0 && ++k)
            o->size = atoi(next);
        else if (strcmp(a, "--side") == 0 && ++k)
            o->side_m = atoi(next);
        else if (strcmp(a, "--store") == 0 && ++k)
            o->store = next;
        else if (strcmp(a, "--pictures") == 0 && ++k)
            o->pictures = next;
        else if (strcmp(a, "--trees") == 0 && ++k) {
            o->count = 0;
            for (const char *p = next; p && *p && o->count < COUNTS_MAX;
                 p = strchr(p, ',') ? strchr(p, ',') + 1 : NULL)
                o->counts[o->count++] = atoi(p);
        } else {
            fprintf(stderr,
                    "bench_sprite [--trees N,...] [--eyes N] [--size PX] [--side M] [--store DIR] [--truth] "
                    "[--quads] [--pictures DIR] [--walk]\n");
            exit(1);
        }
    }
}

int main(int count, char **arguments)
{
    struct options o;
    struct sv_error error;
    struct sv_store *store = NULL;
    parse(count, arguments, &o);
    sv_color_init();
    sv_image_init();
    if (o.store)
        must(sv_store_open(o.store, (uint64_t)4 << 30, &store, &error), &error);
    for (int n = 0; n < o.count; n++) {
        struct stage stage;
        double sum = 0;
        open_stage(&stage, o.counts[n], &o, store);
        for (int k = 0; k < o.eyes; k++)
            view(&stage, &o, o.counts[n], k, &sum);
        printf("%6d trees: mean %.2f ms\n", o.counts[n], sum / o.eyes);
        close_stage(&stage);
    }
    sv_store_close(store);
    return 0;
}
