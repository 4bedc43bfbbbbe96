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
#include "core/relief/object_splat_kernel.h"
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

/* A picture of two sources that shows any texels at random places, torn ones too, in runs. */
static void any_picture(struct sv_rng *rng, const struct sv_relief_seen *seen, struct sv_warp_buffer *buffer)
{
    for (int p = 0; p < buffer->width * buffer->height; p++) {
        unsigned k = sv_rng_next(rng) >> 63;
        bool full = sv_rng_unit(rng) < 0.9;
        int i = (int)(sv_rng_unit(rng) * (seen->width[k] - full));
        int j = (int)(sv_rng_unit(rng) * (seen->height[k] - full));
        uint32_t texel = k << SV_WARP_TEXEL_BITS | (uint32_t)(j * seen->width[k] + i);
        buffer->texel[p] = sv_rng_unit(rng) < 0.3 ? SV_WARP_EMPTY : texel;
        buffer->place[p] = (uint16_t)((sv_rng_next(rng) >> 48 & 0xfffe) | full);
        double same = sv_rng_unit(rng);
        int from = same < 0.3 && p > 0 ? p - 1 : same < 0.6 && p >= buffer->width ? p - buffer->width : p;
        buffer->texel[p] = buffer->texel[from];
        buffer->place[p] = buffer->place[from] & (uint16_t)(sv_rng_unit(rng) < 0.1 ? 0xfffe : 0xffff);
    }
    buffer->x0 = buffer->y0 = 0;
    buffer->x1 = buffer->width, buffer->y1 = buffer->height;
}

/* At each level the groups of all texels that a pixel may mix, and of no others but what a row reads beyond
 * its end. */
static void test_find_seen(void **state)
{
    (void)state;
    enum { SIDE = 80, MOST = 12 * SIDE };
    struct sv_rng rng = sv_rng_seeded(33, 0);
    for (int round = 0; round < 60; round++) {
        static uint8_t room[2][SV_RELIEF_SEEN_ROOM(SIDE, SIDE)], group[3][2][MOST], truth[2][SIDE * SIDE];
        struct sv_relief_seen seen;
        struct sv_warp_buffer buffer;
        assert_int_equal(sv_warp_buffer_create(round % 20 ? 1 + round : 530, 2, &buffer, NULL), SV_OK);
        for (int k = 0; k < 2; k++) {
            seen.width[k] = 2 + (int)(sv_rng_unit(&rng) * (SIDE - 2));
            seen.height[k] = 2 + (int)(sv_rng_unit(&rng) * (SIDE - 2));
            seen.cell[k] = room[k] + seen.width[k] + 1;
        }
        any_picture(&rng, &seen, &buffer);
        memset(truth, 0, sizeof truth);
        for (int p = 0; p < buffer.width * buffer.height; p++) {
            if (buffer.texel[p] == SV_WARP_EMPTY)
                continue;
            int k = (int)(buffer.texel[p] >> SV_WARP_TEXEL_BITS), w = seen.width[k], h = seen.height[k];
            int at = (int)(buffer.texel[p] & SV_WARP_TEXEL_MASK), less = buffer.place[p] & 1 ? 0 : 1;
            for (int j = at / w - less; j <= at / w + 1; j++)
                for (int i = at % w - less; i <= at % w + 1; i++)
                    if (i >= 0 && j >= 0 && i < w && j < h)
                        truth[k][j * w + i] = 1;
        }
        for (int level = SV_SIMD_SCALAR; level <= (int)sv_simd_level(); level++) {
            for (int k = 0; k < 2; k++)
                seen.group[k] = group[level][k];
            uint32_t shown = sv_relief_find_seen_at((enum sv_simd)level, &buffer, &seen, 2);
            for (int k = 0; k < 2; k++) {
                int stride = (seen.width[k] + 7) / 8, any = 0;
                for (int g = 0; g < stride * seen.height[k]; g++) {
                    int column = g % stride * 8,
                        end = column + 8 < seen.width[k] ? column + 8 : seen.width[k];
                    bool needed = false;
                    for (int i = column; i < end; i++)
                        needed = needed || truth[k][g / stride * seen.width[k] + i];
                    any |= group[level][k][g];
                    assert_int_equal(group[level][k][g], group[0][k][g]);
                    assert_true(group[level][k][g] ? needed || end == seen.width[k] : !needed);
                }
                assert_int_equal(shown >> k & 1, any);
            }
        }
        sv_warp_buffer_finish(&buffer);
    }
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
        cmocka_unit_test(test_find_seen),
        cmocka_unit_test(test_light_in_warp),
        cmocka_unit_test(test_many_warps),
    };
    return cmocka_run_group_tests(tests, set_up, NULL);
}
