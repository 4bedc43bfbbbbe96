/* test_coloring.c - natural colours where they can be told: sea, snow, walls, meadows, by albedo; imagery
 * laid over; normals. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "core/base/color.h"
#include "core/base/rng.h"
#include "core/terrain/coloring.h"
#include "core/terrain/land_form.h"

static struct sv_arena *arena;

static int set_up(void **state)
{
    struct sv_error error;
    (void)state;
    sv_color_init();
    return sv_arena_create((size_t)1 << 30, &arena, &error);
}

static int tear_down(void **state)
{
    (void)state;
    sv_arena_destroy(arena);
    return 0;
}

typedef double (*height_function)(double u, double v);

static struct sv_terrain make_terrain(int width, int height, double cell_m, double z0, height_function shape)
{
    float *h = sv_arena_alloc(arena, (size_t)width * (size_t)height, sizeof *h);
    struct sv_heightfield f = {width, height, 0, 0, cell_m, cell_m, z0, INFINITY, -INFINITY, h};
    assert_non_null(h);
    for (int j = 0; j < height; j++)
        for (int i = 0; i < width; i++) {
            float v = (float)shape((double)i / (width - 1), (double)j / (height - 1));
            h[(size_t)j * (size_t)width + (size_t)i] = v;
            f.h_min = fminf(f.h_min, v);
            f.h_max = fmaxf(f.h_max, v);
        }
    return (struct sv_terrain){.field = f};
}

static void color(struct sv_terrain *t, const struct sv_image *imagery, double latitude_deg)
{
    struct sv_error error;
    if (sv_terrain_color(t, imagery, latitude_deg, arena, &error))
        fail_msg("%s", error.message);
}

/* Mean linear albedo of the texels whose (u, v) lie in a box. */
static void mean_albedo(const struct sv_terrain *t, double u0, double v0, double u1, double v1, double rgb[3])
{
    const struct sv_image *a = &t->albedo;
    double n = 0;
    memset(rgb, 0, 3 * sizeof *rgb);
    for (int j = (int)(v0 * a->height); j < (int)(v1 * a->height); j++)
        for (int i = (int)(u0 * a->width); i < (int)(u1 * a->width); i++, n++)
            for (int c = 0; c < 3; c++)
                rgb[c] += (double)sv_linear_from_srgb8[(
                    (const uint8_t *)a->data)[4 * ((size_t)j * (size_t)a->width + (size_t)i) + (size_t)c]];
    for (int c = 0; c < 3; c++)
        rgb[c] /= n;
}

static double luminance(const double rgb[3])
{
    return 0.2126 * rgb[0] + 0.7152 * rgb[1] + 0.0722 * rgb[2];
}

static double gentle(double u, double v)
{
    return 20 * sin(5 * u) * cos(4 * v);
}
static double wall(double u, double v)
{
    (void)v;
    return u > 0.4 && u < 0.6 ? (u - 0.4) * 20000 : u >= 0.6 ? 4000 : 0;
}
static double coast(double u, double v)
{
    (void)v;
    return u < 0.5 ? 0 : (u - 0.5) * 400;
}
static double flat(double u, double v)
{
    (void)u;
    (void)v;
    return 0;
}
static double rising(double u, double v)
{
    (void)v;
    return 4000 * u;
}
static double noisy(double u, double v)
{
    return 100 * sin(40 * u + 3 * sin(17 * v)) + 80 * cos(33 * v);
}

static void meadows_are_green_and_dark(void **state)
{
    (void)state;
    struct sv_terrain t = make_terrain(200, 160, 5, 400, gentle);
    double rgb[3];
    color(&t, NULL, 47);
    assert_int_equal(t.albedo.width, 199 * 4);
    assert_int_equal(t.albedo.height, 159 * 4);
    mean_albedo(&t, 0, 0, 1, 1, rgb);
    assert_true(rgb[1] > rgb[0] && rgb[0] > rgb[2]);
    assert_true(luminance(rgb) > 0.05 && luminance(rgb) < 0.15);
    assert_false(t.has_imagery);
}

static void walls_are_rock(void **state)
{
    (void)state;
    struct sv_terrain t = make_terrain(300, 100, 30, 0, wall); /* a slope of 66 degrees between flats */
    double rock[3], grass[3];
    color(&t, NULL, 30);
    mean_albedo(&t, 0.43, 0.1, 0.5, 0.9, rock);
    mean_albedo(&t, 0.05, 0.1, 0.3, 0.9, grass);
    assert_true(luminance(rock) > 0.12 && luminance(rock) < 0.3);
    assert_true(rock[0] >= rock[1] && rock[1] >= rock[2]);
    assert_true(luminance(rock) > 1.2 * luminance(grass));
}

/* The snow line of 46.5 degrees lies near 3000 m; at the equator 4000 m are green, at 80 degrees 500 m are
 * white. */
static void snow_follows_height_and_latitude(void **state)
{
    (void)state;
    double low[3], high[3];
    struct sv_terrain alps = make_terrain(400, 60, 60, 0, rising);
    color(&alps, NULL, 46.5);
    mean_albedo(&alps, 0.1, 0, 0.45, 1, low);
    mean_albedo(&alps, 0.87, 0, 1, 1, high);
    assert_true(luminance(low) < 0.2 && luminance(high) > 0.6);
    struct sv_terrain equator = make_terrain(400, 60, 60, 0, rising);
    color(&equator, NULL, 0);
    mean_albedo(&equator, 0.87, 0, 1, 1, high);
    assert_true(luminance(high) < 0.25);
    struct sv_terrain arctic = make_terrain(200, 60, 20, 1500, gentle);
    color(&arctic, NULL, -80);
    mean_albedo(&arctic, 0, 0, 1, 1, high);
    assert_true(luminance(high) > 0.6);
}

static void flats_at_sea_level_are_water(void **state)
{
    (void)state;
    double sea[3], land[3], beach[3];
    struct sv_terrain t = make_terrain(300, 200, 30, 0, coast);
    color(&t, NULL, 40);
    mean_albedo(&t, 0.02, 0, 0.45, 1, sea);
    mean_albedo(&t, 0.7, 0, 1, 1, land);
    mean_albedo(&t, 0.501, 0, 0.504, 1, beach);
    assert_true(luminance(sea) < 0.05 && sea[2] > sea[1] && sea[1] > sea[0]);
    assert_true(land[2] < land[1]);
    assert_true(luminance(beach) > 1.3 * luminance(land));
    struct sv_terrain meadow = make_terrain(300, 200, 30, 15, coast); /* the same, 15 m above the sea */
    color(&meadow, NULL, 40);
    mean_albedo(&meadow, 0.02, 0, 0.45, 1, sea);
    assert_true(sea[1] > sea[2]);
    struct sv_terrain level =
        make_terrain(100, 100, 30, 0, flat); /* level everywhere: somebody's plane, not a sea */
    color(&level, NULL, 40);
    mean_albedo(&level, 0, 0, 1, 1, sea);
    assert_true(sea[1] > sea[2]);
    struct sv_terrain plot = make_terrain(12, 12, 1, 0, gentle); /* too small for a sea */
    color(&plot, NULL, 40);
    mean_albedo(&plot, 0, 0, 1, 1, sea);
    assert_true(sea[1] > sea[2]);
}

/* What a photograph's code becomes as an albedo: 0.58 of its linear value (imagery_tone.h). */
static uint8_t photo_albedo(uint8_t code)
{
    return sv_srgb8_from_linear(sv_linear_from_srgb8[code] * 0.58f);
}

/* Imagery is laid where it is opaque, mixed in linear light where it is half, and absent where alpha is 0.
 */
static void imagery_lies_over_it(void **state)
{
    (void)state;
    enum { SIDE = 90 };
    static uint8_t pixels[SIDE * SIDE * 4];
    struct sv_image imagery = {SIDE, SIDE, 4, SV_PIXEL_U8, pixels};
    struct sv_terrain t = make_terrain(31, 31, 10, 300, gentle), bare = t;
    double rgb[3];
    for (int k = 0; k < SIDE * SIDE; k++) {
        const uint8_t pixel[4] = {200, 10, 250, (uint8_t)(k % SIDE < 30 ? 255 : k % SIDE < 60 ? 128 : 0)};
        memcpy(pixels + 4 * k, pixel, 4);
    }
    color(&t, &imagery, 47);
    color(&bare, NULL, 47);
    assert_true(t.has_imagery && t.albedo.width == SIDE && t.albedo.height == SIDE);
    const uint8_t want[4] = {photo_albedo(200), photo_albedo(10), photo_albedo(250), 255};
    assert_memory_equal(t.albedo.data, want, 4);
    mean_albedo(&t, 0.4, 0, 0.6, 1, rgb);
    assert_true(rgb[2] > 0.4 * 0.58 * (double)sv_linear_from_srgb8[250] &&
                rgb[2] < 0.6 * 0.58 * (double)sv_linear_from_srgb8[250] + 0.05);
    mean_albedo(&t, 0.7, 0, 1, 1, rgb);
    assert_true(rgb[1] > rgb[2]);
    for (int k = 0; k < SIDE * SIDE; k++)
        pixels[4 * k + 3] = 255;
    color(&t, &imagery, 47);
    for (int k = 0; k < SIDE * SIDE; k++)
        assert_memory_equal((uint8_t *)t.albedo.data + 4 * k, want, 4);
    imagery.channels = 3;
    struct sv_error error;
    assert_int_equal(sv_terrain_color(&t, &imagery, 47, arena, &error), SV_EINVAL);
}

/* Codes of a raw, hazy band: 40 .. 110 where a photograph has 0 .. 255. Toned, dark ground is dark, bright
 * ground has 0.4, order and hue stay; a photograph is left alone. */
static void raw_bands_are_toned(void **state)
{
    (void)state;
    enum { SIDE = 64 };
    static uint8_t pixels[SIDE * SIDE * 4];
    struct sv_image imagery = {SIDE, SIDE, 4, SV_PIXEL_U8, pixels};
    struct sv_terrain t = make_terrain(31, 31, 10, 300, gentle);
    for (int k = 0; k < SIDE * SIDE; k++) {
        const uint8_t pixel[4] = {(uint8_t)(30 + 70 * k / (SIDE * SIDE)),
                                  (uint8_t)(40 + 70 * k / (SIDE * SIDE)),
                                  (uint8_t)(60 + 30 * k / (SIDE * SIDE)), 255};
        memcpy(pixels + 4 * k, pixel, 4);
    }
    color(&t, &imagery, 47);
    const uint8_t *first = t.albedo.data, *last = first + 4 * (SIDE * SIDE - 1);
    for (int c = 0; c < 3; c++)
        assert_true((double)sv_linear_from_srgb8[first[c]] < 0.03);
    assert_true(fabs((double)sv_linear_from_srgb8[last[1]] - 0.4) < 0.02 && last[0] < last[1] &&
                last[2] < last[0]);
    for (int k = 1; k < SIDE * SIDE; k++)
        assert_true(first[4 * k + 1] >= first[4 * k - 3]);
    memset(pixels, 255, 4 * SIDE); /* one and a half percent of white: a photograph */
    color(&t, &imagery, 47);
    for (size_t k = 0; k < sizeof pixels; k++)
        assert_int_equal(((const uint8_t *)t.albedo.data)[k], k % 4 == 3 ? 255 : photo_albedo(pixels[k]));
}

static void normals_decode_to_unit_vectors(void **state)
{
    (void)state;
    struct sv_terrain t = make_terrain(61, 47, 7, 0, noisy);
    color(&t, NULL, (double)NAN);
    assert_true(t.normal.width == 61 && t.normal.height == 47 && t.normal.channels == 2);
    for (int j = 0; j < 47; j++)
        for (int i = 0; i < 61; i++) {
            const uint8_t *p = (const uint8_t *)t.normal.data + 2 * (j * 61 + i);
            struct sv_vec3 n = sv_heightfield_sample_normal(&t.field, i, j);
            assert_true(fabs((p[0] - 128) / 127.0 - n.x) <= 0.5 / 127 + 1e-9);
            assert_true(fabs((p[1] - 128) / 127.0 - n.y) <= 0.5 / 127 + 1e-9);
        }
}

/* The colour is that of natural ground everywhere: nothing black, nothing glaring, whatever the field. */
static void all_albedos_are_plausible(void **state)
{
    (void)state;
    static const struct {
        int width, height;
        double cell_m, z0;
        height_function shape;
    } odd[] = {{2, 2, 1, 0, flat},       {2, 300, 90, 5, noisy},   {3, 3, 0.01, -400, gentle},
               {80, 70, 1000, 0, noisy}, {64, 64, 2, 8000, noisy}, {4200, 9, 3, 100, gentle}};
    for (size_t k = 0; k < sizeof odd / sizeof odd[0]; k++) {
        struct sv_terrain t =
            make_terrain(odd[k].width, odd[k].height, odd[k].cell_m, odd[k].z0, odd[k].shape);
        color(&t, NULL, k % 2 ? -35 : 60);
        assert_true(t.albedo.width >= 1 && t.albedo.width <= 4096);
        const uint8_t *p = t.albedo.data;
        for (size_t n = 0; n < (size_t)t.albedo.width * (size_t)t.albedo.height; n++, p += 4) {
            double light = 0;
            for (int c = 0; c < 3; c++)
                light += (double)sv_linear_from_srgb8[p[c]] / 3;
            if (!(light > 0.008 && light < 0.85 && p[3] == 255))
                fail_msg("field %zu, texel %zu: sRGB %u %u %u %u", k, n, p[0], p[1], p[2], p[3]);
        }
    }
}

/* A valley's floor is wet and its rims are not; a ridge is convex, a gully concave. */
static void land_form_knows_valleys(void **state)
{
    (void)state;
    struct sv_terrain t = make_terrain(201, 201, 5, 100, noisy);
    float *h = (float *)(uintptr_t)t.field.h;
    struct sv_land_form form;
    struct sv_error error;
    for (int j = 0; j < 201; j++)
        for (int i = 0; i < 201; i++)
            h[j * 201 + i] = (float)(0.8 * fabs(i - 100.0) * 2 + j * 0.5); /* a V that falls to the south */
    assert_int_equal(sv_land_form_init(&t.field, &form, &error), SV_OK);
    struct sv_land_sample floor_ = sv_land_form_at(&form, 0.5, 0.2), side = sv_land_form_at(&form, 0.15, 0.5);
    assert_true(floor_.wet > 0.8f && side.wet < 0.5f);
    assert_true(floor_.fine < -0.02f && floor_.broad < -0.02f);
    assert_true(fabsf(side.fine) < 0.02f && fabs((double)side.east + 0.32) < 0.01 &&
                fabs((double)side.north - 0.1) < 0.01);
    assert_true(side.sea == 0 && side.shore == 1000);
    sv_land_form_finish(&form);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(meadows_are_green_and_dark),
        cmocka_unit_test(walls_are_rock),
        cmocka_unit_test(snow_follows_height_and_latitude),
        cmocka_unit_test(flats_at_sea_level_are_water),
        cmocka_unit_test(imagery_lies_over_it),
        cmocka_unit_test(raw_bands_are_toned),
        cmocka_unit_test(normals_decode_to_unit_vectors),
        cmocka_unit_test(all_albedos_are_plausible),
        cmocka_unit_test(land_form_knows_valleys),
    };
    return cmocka_run_group_tests(tests, set_up, tear_down);
}
