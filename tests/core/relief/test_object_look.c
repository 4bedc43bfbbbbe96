/* test_object_look.c - light that is put in the warp: what is seen is what a look shows that is lit as a
 * whole. */
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
#include "core/base/rng.h"
#include "core/gl/context.h"
#include "core/relief/object.h"
#include "tests/experiments/object_kit.h"

/* Odd, so that rows do not end with a group of eight texels. */
enum { RESOLUTION = 93, WIDTH = 163, HEIGHT = 141, VIEWS = 24 };

struct view {
    struct sv_relief_place place;
    struct sv_camera camera;
    struct sv_light light;
    struct sv_relief_look_options options;
};

static int set_up(void **state)
{
    static struct sv_gl_context *context;
    struct sv_error error;
    sv_color_init();
    *state = NULL;
    return sv_gl_context_create(&context, &error) != SV_OK;
}

/* From cells of a third of a pixel to cells of twelve. */
static struct view any_view(struct sv_rng *rng, int k)
{
    double azimuth = 2 * SV_PI * sv_rng_unit(rng), elevation = SV_PI * (sv_rng_unit(rng) - 0.5);
    struct view v = {.place = {{9 * sv_rng_unit(rng), 4, 1}, 2, 6 * sv_rng_unit(rng)}};
    v.camera = (struct sv_camera){.vfov_rad = 0.45, .width = WIDTH, .height = HEIGHT, .near_m = 0.05};
    if (k % 5 == 4)
        v.camera.projection = SV_PROJECTION_ORTHOGRAPHIC, v.camera.ortho_height_m = 3, v.camera.far_m = 50;
    struct sv_vec3 middle = sv_add(v.place.place, sv_vec3(0, 0, 1));
    v.camera.eye = sv_madd(middle, sv_direction(azimuth, elevation), 1.6 + 12 * sv_rng_unit(rng));
    sv_camera_aim(&v.camera, azimuth + SV_PI, -elevation, 0);
    const struct sv_sun sun = {2 * SV_PI * sv_rng_unit(rng), sv_rng_range(rng, -0.1, 1.5)};
    sv_light_from_sun(&sun, &v.light);
    v.options = (struct sv_relief_look_options){.lit = true,
                                                .shadow = (enum sv_relief_shadow_form)(k % 3),
                                                .specular = 0.3f,
                                                .shininess = 20,
                                                .has_viewer = true,
                                                .eye = v.camera.eye,
                                                .taken = k % 4 == 3 ? 0.4 : 0,
                                                .shade_height_m = k % 4 == 2 ? 2 : -INFINITY};
    return v;
}

static uint32_t draw(const struct sv_relief_object *object, struct sv_relief_look *look, const struct view *v,
                     struct sv_warp_buffer *buffer, uint8_t (*rgba)[4])
{
    struct sv_error error;
    struct sv_warp_stats stats = {0};
    const struct sv_warp_source *sources;
    unsigned count, faces = sv_relief_object_faces(object, &v->place, &v->camera);
    memset(rgba, 0, (size_t)WIDTH * HEIGHT * 4);
    assert_int_equal(sv_relief_look_light(look, &v->place, &v->light, &v->options, faces, &error), SV_OK);
    assert_int_equal(sv_relief_look_warp(look, &v->place, &v->camera, 0, 0, faces, buffer, &sources, &count,
                                         &stats, &error),
                     SV_OK);
    sv_warp_resolve(sources, count, buffer, rgba);
    return stats.pixels;
}

/* Each view has another light, so that a texel that is seen but was left out still has the last one's. */
static void test_light_in_warp(void **state)
{
    (void)state;
    static uint8_t all[WIDTH * HEIGHT][4], some[WIDTH * HEIGHT][4];
    struct sv_rng rng = sv_rng_seeded(31, 0);
    uint64_t pixels = 0;
    struct sv_warp_buffer buffer;
    struct sv_error error;
    assert_int_equal(sv_warp_buffer_create(WIDTH, HEIGHT, &buffer, &error), SV_OK);
    for (int body = 0; body < OBJECT_KIT_COUNT; body++) {
        struct sv_tree_mesh mesh = object_kit_make((enum object_kit_body)body);
        struct sv_relief_object object;
        struct sv_relief_look *whole, *in_warp;
        assert_int_equal(sv_relief_object_bake(&mesh, RESOLUTION, &object, &error), SV_OK);
        assert_int_equal(sv_relief_look_create(&object, &whole, &error), SV_OK);
        assert_int_equal(sv_relief_look_create(&object, &in_warp, &error), SV_OK);
        for (int k = 0; k < VIEWS; k++) {
            struct view v = any_view(&rng, k);
            draw(&object, whole, &v, &buffer, all);
            v.options.in_warp = true;
            pixels += draw(&object, in_warp, &v, &buffer, some);
            for (size_t p = 0; p < (size_t)WIDTH * HEIGHT; p++)
                if (memcmp(all[p], some[p], 4) != 0)
                    fail_msg("%s, view %d, pixel %zu: %d %d %d %d, not %d %d %d %d", object_kit_names[body],
                             k, p, some[p][0], some[p][1], some[p][2], some[p][3], all[p][0], all[p][1],
                             all[p][2], all[p][3]);
        }
        sv_relief_look_destroy(whole);
        sv_relief_look_destroy(in_warp);
        sv_relief_object_finish(&object);
        sv_tree_mesh_finish(&mesh);
    }
    sv_warp_buffer_finish(&buffer);
    print_message("light in the warp: the same pictures, %llu pixels\n", (unsigned long long)pixels);
    assert_true(pixels > 100000);
}

/* One look serves warp after warp of one light. */
static void test_many_warps(void **state)
{
    (void)state;
    static uint8_t first[WIDTH * HEIGHT][4], again[WIDTH * HEIGHT][4];
    struct sv_rng rng = sv_rng_seeded(32, 0);
    struct view v = any_view(&rng, 1), other = any_view(&rng, 1);
    struct sv_tree_mesh mesh = object_kit_make(OBJECT_KIT_URN);
    struct sv_relief_object object;
    struct sv_relief_look *look;
    struct sv_warp_buffer buffer;
    struct sv_warp_stats stats = {0};
    const struct sv_warp_source *sources;
    struct sv_error error;
    unsigned count, faces;
    assert_int_equal(sv_warp_buffer_create(WIDTH, HEIGHT, &buffer, &error), SV_OK);
    assert_int_equal(sv_relief_object_bake(&mesh, RESOLUTION, &object, &error), SV_OK);
    assert_int_equal(sv_relief_look_create(&object, &look, &error), SV_OK);
    v.options.in_warp = true;
    assert_true(draw(&object, look, &v, &buffer, first) > 1000);
    const struct sv_camera *cameras[] = {&other.camera, &v.camera};
    for (int k = 0; k < 2; k++) {
        faces = sv_relief_object_faces(&object, &v.place, cameras[k]);
        assert_int_equal(sv_relief_look_warp(look, &v.place, cameras[k], 0, 0, faces, &buffer, &sources,
                                             &count, &stats, &error),
                         SV_OK);
    }
    memset(again, 0, sizeof again);
    sv_warp_resolve(sources, count, &buffer, again);
    assert_memory_equal(first, again, sizeof first);
    sv_relief_look_destroy(look);
    sv_relief_object_finish(&object);
    sv_tree_mesh_finish(&mesh);
    sv_warp_buffer_finish(&buffer);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_light_in_warp),
        cmocka_unit_test(test_many_warps),
    };
    return cmocka_run_group_tests(tests, set_up, NULL);
}
