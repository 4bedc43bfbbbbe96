/* test_sprite_truth.c - a small forest of far trees on the CPU against ray casts of 64 samples a pixel: the
 * sprites' picture is no farther from them than a ray cast of one sample, and as sharp. Ground and its depth
 * are the ray caster's own, so that trees alone make the difference. */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "core/base/color.h"
#include "core/base/frames.h"
#include "core/tree/sprite.h"
#include "core/truth/truth.h"
#include "core/view/compare.h"
#include "tests/core/view/scene_kit.h"

enum { SIDE = 160, SPECIES = 3, VIEWS = 3 };

static struct sv_scene *scene;
static struct sv_truth *truth;
static struct sv_sprite_draw *draw;

static void ok(enum sv_status status, const struct sv_error *error)
{
    if (status != SV_OK)
        fail_msg("%s: %s: %s", sv_status_text(status), error->field, error->message);
}

static int setup(void **state)
{
    (void)state;
    struct sv_error error;
    sv_color_init();
    struct kit_options options = {.width = 65,
                                  .height = 65,
                                  .x0 = 600000,
                                  .y0 = 9000000,
                                  .z0 = 500,
                                  .dx = 8,
                                  .dy = 8,
                                  .seed = 5,
                                  .species = SPECIES,
                                  .leaves = 8000,
                                  .trees = 400,
                                  .spread_m = 110,
                                  .height_min_m = 8,
                                  .height_max_m = 20};
    scene = kit_scene(&options);
    struct sv_tree_draw_species species[SPECIES];
    for (int k = 0; k < SPECIES; k++)
        species[k] = (struct sv_tree_draw_species){&scene->species[k].mesh, scene->species[k].key,
                                                   scene->species[k].tree_count};
    ok(sv_sprite_draw_create(species, SPECIES, NULL, &draw, &error), &error);
    ok(sv_truth_create(scene, &truth, &error), &error);
    return 0;
}

static int teardown(void **state)
{
    (void)state;
    sv_truth_destroy(truth);
    sv_sprite_draw_destroy(draw);
    kit_free(scene);
    return 0;
}

/* From 60 to 150 m before the forest's edge: crowns of 20 to 60 px. */
static struct sv_camera view_of(int k)
{
    static const double heading_deg[VIEWS] = {10, 130, 250}, up_m[VIEWS] = {30, 60, 15},
                        back_m[VIEWS] = {200, 230, 180};
    struct sv_vec3 toward = sv_direction(sv_radians(heading_deg[k]), 0);
    struct sv_camera c = {.projection = SV_PROJECTION_PERSPECTIVE,
                          .vfov_rad = sv_radians(50),
                          .width = SIDE,
                          .height = SIDE,
                          .near_m = 0.1};
    c.eye = sv_madd(sv_vec3(600256, 9000256, 500 + up_m[k]), toward, -back_m[k]);
    sv_camera_aim(&c, sv_radians(heading_deg[k]), -atan(up_m[k] / back_m[k]), 0);
    return c;
}

static void cast(const struct sv_camera *camera, const struct sv_light *light, int samples, bool trees,
                 struct sv_image *color, struct sv_image *depth)
{
    struct sv_error error;
    struct sv_truth_options options = {.layers = 1u << SV_LAYER_COLOR | (depth ? 1u << SV_LAYER_DEPTH : 0),
                                       .samples = samples,
                                       .trees = trees,
                                       .sky = true,
                                       .row_count = SIDE};
    struct sv_truth_picture picture;
    memset(&picture, 0, sizeof picture);
    ok(sv_image_alloc(SIDE, SIDE, 4, SV_PIXEL_U8, color, &error), &error);
    picture.color = *color;
    if (depth) {
        ok(sv_image_alloc(SIDE, SIDE, 1, SV_PIXEL_F32, depth, &error), &error);
        picture.depth = *depth;
    }
    ok(sv_truth_render(truth, camera, light, &options, &picture, &error), &error);
}

/* The forest's sprites over the ray caster's ground. */
static void draw_sprites(const struct sv_camera *camera, const struct sv_light *light, struct sv_image *color)
{
    struct sv_error error;
    struct sv_image depth;
    struct sv_cull_species species[SPECIES];
    struct sv_cull_list cull = {.room = 0};
    double planes[5][4];
    cast(camera, light, 64, false, color, &depth);
    float *d = depth.data;
    for (int k = 0; k < SIDE * SIDE; k++)
        d[k] = d[k] < INFINITY ? (float)camera->near_m / d[k] : 0;
    for (int k = 0; k < SPECIES; k++)
        species[k] = (struct sv_cull_species){scene->species[k].mesh.radius};
    sv_camera_planes(camera, planes);
    ok(sv_cull_forest(&scene->forest, species, camera, planes, NULL, &cull, &error), &error);
    struct sv_canvas canvas = {
        .width = SIDE, .height = SIDE, .row_count = SIDE, .depth = depth.data, .color = color->data};
    struct sv_sprite_view view = {.camera = camera, .light = light};
    struct sv_sprite_list list = {
        .entries = cull.entries, .count = cull.count};
    assert_true(list.count > 100);
    ok(sv_sprite_draw_trees(draw, &view, &canvas, scene->forest.trees, &list,
                            (struct sv_tree_lights){NULL, NULL}, &error),
       &error);
    sv_cull_list_finish(&cull);
    sv_image_free(&depth);
}

static void compare(const struct sv_image *picture, const struct sv_image *want,
                    struct sv_compare_result *result)
{
    struct sv_error error;
    struct sv_compare_options options = SV_COMPARE_OPTIONS_DEFAULT;
    ok(sv_compare(picture, want, &options, result, &error), &error);
}

static void no_worse_than_one_sample(void **state)
{
    (void)state;
    struct sv_light light;
    sv_light_from_sun(&(struct sv_sun){sv_radians(135), sv_radians(40)}, &light);
    for (int k = 0; k < VIEWS; k++) {
        struct sv_camera camera = view_of(k);
        struct sv_image want, one, made;
        struct sv_compare_result r, peer;
        cast(&camera, &light, 64, true, &want, NULL);
        cast(&camera, &light, 1, true, &one, NULL);
        draw_sprites(&camera, &light, &made);
        compare(&made, &want, &r);
        compare(&one, &want, &peer);
        printf("view %d: mean absolute %.2f (one sample %.2f), SSIM %.3f (%.3f), gradient %.3f (%.3f)\n", k,
               r.mean_abs, peer.mean_abs, r.ssim, peer.ssim, r.gradient_ratio, peer.gradient_ratio);
        kit_keep(&made, k == 0 ? "sprites_0" : k == 1 ? "sprites_1" : "sprites_2");
        kit_keep(&want, k == 0 ? "truth_0" : k == 1 ? "truth_1" : "truth_2");
        assert_true(r.mean_abs <= peer.mean_abs);
        assert_true(r.ssim >= peer.ssim);
        assert_true(r.gradient_ratio > 0.7 && r.gradient_ratio < 1.3);
        sv_image_free(&want);
        sv_image_free(&one);
        sv_image_free(&made);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(no_worse_than_one_sample)};
    return cmocka_run_group_tests(tests, setup, teardown);
}
