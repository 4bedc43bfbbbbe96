/* test_shadow.c - shadow rays of the ray-cast truth against geometry in closed form: a sheet of known size on
 * a stem of no width over flat ground; its alpha mask; a ridge that shades the plain behind it; a sun that
 * has set. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <math.h>
#include <cmocka.h>

#include "core/base/frames.h"
#include "core/scene/id.h"
#include "core/truth/truth.h"
#include "tests/core/truth/sheet_kit.h"
#include "tests/core/view/scene_kit.h"

enum { SIDE = 160 };

static const double SPAN_M = 40; /* of the orthographic picture, straight down on the field's centre */

/* For each pixel of the map: 1 lit ground, 0 shaded ground, -1 no ground. Lit and shaded differ by far in
 * colour. */
static void map(const struct sv_scene *scene, double azimuth, double elevation, double x, double y,
                double span, int8_t *lit)
{
    struct sv_view_request r = kit_request();
    r.width = r.height = SIDE;
    r.projection = SV_PROJECTION_ORTHOGRAPHIC;
    r.ortho_height_m = span;
    r.eye.x = x;
    r.eye.y = y;
    r.eye.agl = 300;
    r.pitch_rad = -SV_PI / 2;
    r.trees = SV_TREES_RAYCAST;
    r.shadows = true;
    r.has_sun_azimuth = r.has_sun_elevation = true;
    r.sun_azimuth_rad = azimuth;
    r.sun_elevation_rad = elevation;
    struct sv_resolved_view view;
    struct sv_truth *truth;
    struct sv_error error = {0};
    struct sv_light light;
    struct sv_truth_picture on, off;
    assert_int_equal(sv_view_resolve(scene, &r, &view, NULL, &error), SV_OK);
    assert_int_equal(sv_truth_create(scene, &truth, &error), SV_OK);
    sv_light_from_sun(&view.sun, &light);
    struct sv_truth_options options = {.layers = 1u << SV_LAYER_COLOR | 1u << SV_LAYER_ID,
                                       .samples = 1,
                                       .trees = true,
                                       .sky = true,
                                       .row_count = SIDE};
    for (int k = 0; k < 2; k++) {
        struct sv_truth_picture *p = k ? &on : &off;
        memset(p, 0, sizeof *p);
        assert_int_equal(sv_image_alloc(SIDE, SIDE, 4, SV_PIXEL_U8, &p->color, &error), SV_OK);
        assert_int_equal(sv_image_alloc(SIDE, SIDE, 1, SV_PIXEL_U32, &p->id, &error), SV_OK);
        options.shadows = k == 1;
        assert_int_equal(sv_truth_render(truth, &view.camera, &light, &options, p, &error), SV_OK);
    }
    for (int k = 0; k < SIDE * SIDE; k++) {
        int a = ((uint8_t *)on.color.data)[4 * k + 1], b = ((uint8_t *)off.color.data)[4 * k + 1];
        lit[k] = (int8_t)(((uint32_t *)on.id.data)[k] != SV_ID_TERRAIN ? -1 : a == b);
    }
    sv_image_free(&on.color);
    sv_image_free(&on.id);
    sv_image_free(&off.color);
    sv_image_free(&off.id);
    sv_truth_destroy(truth);
}

/* The sheet's shadow on flat ground is the sheet itself, moved away from the sun by height / tan(elevation).
 */
static void sheet_case(double azimuth_deg, double elevation_deg, double rotation_deg, bool masked)
{
    struct sv_scene *scene = sheet_kit_flat_scene();
    const double cx = 600064, cy = 4000064, height = 6, half_m = 3;
    struct sv_tree *tree = sv_arena_alloc(scene->arena, 1, sizeof *tree);
    *tree = (struct sv_tree){.x = cx,
                             .y = cy,
                             .z = kit_surface(&scene->terrain.field, cx, cy),
                             .height_m = (float)height,
                             .rotation_rad = (float)sv_radians(rotation_deg)};
    sheet_kit_put(scene, half_m / height, tree, masked);
    static int8_t lit[SIDE * SIDE];
    map(scene, sv_radians(azimuth_deg), sv_radians(elevation_deg), cx, cy, SPAN_M, lit);
    struct sv_vec3 sun = sv_direction(sv_radians(azimuth_deg), sv_radians(elevation_deg));
    long shaded = 0, wrong = 0;
    for (int k = 0; k < SIDE * SIDE; k++) {
        double x = (k % SIDE + 0.5 - SIDE / 2) * SPAN_M / SIDE,
               y = (SIDE / 2 - k / SIDE - 0.5) * SPAN_M / SIDE;
        /* back along the light to the sheet's height, then into the sheet's own axes */
        struct sv_vec3 at = sv_vec3(x + sun.x / sun.z * height, y + sun.y / sun.z * height, 0);
        at = sv_rotate_clockwise(at, -sv_radians(rotation_deg));
        double edge = fmax(fabs(at.x), fabs(at.y)) - half_m, middle = masked ? at.x : -1;
        if (lit[k] < 0 || fabs(edge) < 0.05 || (edge < 0 && fabs(middle) < 0.15))
            continue; /* under the sheet, or within 5 cm of a border, or of the mask's blurred one */
        bool shadow = edge < 0 && middle < 0;
        shaded += shadow;
        wrong += lit[k] == shadow;
    }
    printf("sheet, sun %.0f/%.0f, turned %.0f%s: %ld pixels of shadow, %ld wrong\n", azimuth_deg,
           elevation_deg, rotation_deg, masked ? ", half masked" : "", shaded, wrong);
    assert_true(shaded > 40);
    assert_int_equal(wrong, 0);
    kit_free(scene);
}

static void test_sheet(void **state)
{
    (void)state;
    sheet_case(135, 45, 0, false);
    sheet_case(0, 30, 20, false);
    sheet_case(287, 25, 75, false);
}

static void test_mask(void **state)
{
    (void)state;
    sheet_case(160, 40, 0, true);
    sheet_case(250, 30, 50, true);
}

/* A wall of ground 10 m high and one cell thick along x = const, sun in the west: the plain behind it is dark
 * as far as height / tan(elevation) from the wall's crest, and lit beyond. */
static void test_ridge(void **state)
{
    (void)state;
    struct sv_scene *scene = sheet_kit_flat_scene();
    struct sv_heightfield *f = &scene->terrain.field;
    float *h = sv_arena_alloc(scene->arena, 33 * 33, sizeof *h);
    for (int k = 0; k < 33 * 33; k++)
        h[k] = k % 33 == 8 ? 10 : 0;
    f->h = h;
    f->h_min = 0;
    f->h_max = 10;
    static int8_t lit[SIDE * SIDE];
    const double crest = 8 * 4 - 64, elevation = 25,
                 reach = 10 / tan(sv_radians(elevation)); /* x from the centre */
    map(scene, sv_radians(270), sv_radians(elevation), 600064, 4000064, 100, lit);
    long checked[2] = {0};
    for (int k = 0; k < SIDE * SIDE; k++) {
        double x = (k % SIDE + 0.5 - SIDE / 2) * 100.0 / SIDE;
        if (x < crest + 5 || fabs(x - crest - reach) < 0.1)
            continue;
        int want = x > crest + reach;
        checked[want]++;
        if (lit[k] != want)
            fail_msg("ridge: ground %.2f m behind the crest is %d, expected %d (shadow %.2f m long)",
                     x - crest, lit[k], want, reach);
    }
    assert_true(checked[0] > 1000 && checked[1] > 1000);
    kit_free(scene);
}

/* At and below the horizon there is no sunlight: shadows change nothing, and flat ground does not shade
 * itself at dawn. */
static void test_low_sun(void **state)
{
    (void)state;
    struct sv_scene *scene = sheet_kit_flat_scene();
    static int8_t lit[SIDE * SIDE];
    static const double elevations[] = {-30, 0, 0.5, 3, 90};
    for (size_t k = 0; k < sizeof elevations / sizeof *elevations; k++) {
        map(scene, sv_radians(77), sv_radians(elevations[k]), 600064, 4000064, SPAN_M, lit);
        for (int i = 0; i < SIDE * SIDE; i++)
            assert_int_equal(lit[i], 1);
    }
    kit_free(scene);
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(test_sheet), cmocka_unit_test(test_mask),
                                       cmocka_unit_test(test_ridge), cmocka_unit_test(test_low_sun)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
