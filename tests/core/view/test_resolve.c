/* test_resolve.c - a request meets a scene: heights above ground, the look-at and orbit forms, what is
 * refused and why. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <string.h>
#include <math.h>
#include <cmocka.h>

#include "core/base/frames.h"
#include "core/base/rng.h"
#include "tests/core/view/scene_kit.h"

static struct sv_scene *scene;

static int setup(void **state)
{
    (void)state;
    scene = kit_scene(&(struct kit_options){.width = 41,
                                            .height = 31,
                                            .x0 = 300000,
                                            .y0 = 9.1e6,
                                            .z0 = 40,
                                            .dx = 10,
                                            .dy = 10,
                                            .relief_m = 60,
                                            .seed = 3});
    return 0;
}

static int teardown(void **state)
{
    (void)state;
    kit_free(scene);
    return 0;
}

static struct sv_view_request at(double x, double y)
{
    struct sv_view_request r = kit_request();
    r.eye.x = 300000 + x;
    r.eye.y = 9.1e6 + y;
    return r;
}

static struct sv_resolved_view resolved(const struct sv_view_request *r)
{
    struct sv_resolved_view view;
    struct sv_error error = {0};
    if (sv_view_resolve(scene, r, &view, NULL, &error))
        fail_msg("%s: %s", error.field, error.message);
    return view;
}

static void refused(const struct sv_view_request *r, enum sv_status status, const char *field)
{
    struct sv_resolved_view view;
    struct sv_error error = {0};
    assert_int_equal(sv_view_resolve(scene, r, &view, NULL, &error), status);
    assert_string_equal(error.field, field);
    assert_true(strlen(error.message) > 10);
}

static void test_heights(void **state)
{
    (void)state;
    struct sv_view_request r = at(123.4, 87.6);
    double ground = kit_surface(&scene->terrain.field, r.eye.x, r.eye.y);
    r.eye.agl = 12.5;
    struct sv_resolved_view v = resolved(&r);
    assert_true(fabs(v.camera.eye.z - ground - 12.5) < 1e-9);
    assert_true(fabs(v.ground_z - ground) < 1e-9);
    r.eye.agl = 0; /* on the ground is not under it */
    (void)resolved(&r);
    r.eye.has_z = true;
    r.eye.z = ground - 0.01;
    double told = NAN;
    struct sv_error error = {0};
    assert_int_equal(sv_view_resolve(scene, &r, &v, &told, &error), SV_EUNDERGROUND);
    assert_true(fabs(told - ground) < 1e-9);
    r = at(-5, 10); /* no ground there: a height above it has no meaning, an absolute one has */
    refused(&r, SV_EOUTSIDE, "eye");
    r.eye.has_z = true;
    r.eye.z = 300;
    v = resolved(&r);
    assert_true(isnan(v.ground_z) && v.camera.eye.z == 300);
    r.eye.z = 1e9;
    refused(&r, SV_EOUTSIDE, "eye");
}

/* The target is in the picture's middle, at its distance; the orbit form from the found angles finds the same
 * eye. */
static void test_look_at_and_orbit(void **state)
{
    (void)state;
    struct sv_rng rng = sv_rng_seeded(1, 1);
    for (int k = 0; k < 500; k++) {
        struct sv_view_request r = at(sv_rng_range(&rng, 5, 395), sv_rng_range(&rng, 5, 295));
        r.eye.agl = sv_rng_range(&rng, 1, 300);
        r.target = (struct sv_place){.form = SV_PLACE_XY,
                                     .x = 300000 + sv_rng_range(&rng, 5, 395),
                                     .y = 9.1e6 + sv_rng_range(&rng, 5, 295),
                                     .agl = sv_rng_range(&rng, 0, 20)};
        struct sv_resolved_view v = resolved(&r);
        double px, py, depth, range = sv_length(sv_sub(v.target, v.camera.eye));
        assert_true(sv_camera_project(&v.camera, v.target, &px, &py, &depth));
        assert_true(fabs(px - 128) < 1e-6 && fabs(py - 128) < 1e-6 && fabs(depth - range) < 1e-6);
        struct sv_view_request orbit = r;
        orbit.eye = (struct sv_place){.form = SV_PLACE_NONE};
        orbit.range_m = range;
        orbit.heading_rad = v.heading_rad;
        orbit.pitch_rad = v.pitch_rad;
        struct sv_resolved_view o = resolved(&orbit);
        assert_true(sv_length(sv_sub(o.camera.eye, v.camera.eye)) < 1e-6);
    }
}

static void test_straight_down(void **state)
{
    (void)state;
    struct sv_view_request r = at(200, 150);
    r.eye.agl = 100;
    r.target = (struct sv_place){.form = SV_PLACE_XY, .x = r.eye.x, .y = r.eye.y};
    struct sv_resolved_view v = resolved(&r);
    assert_true(v.camera.forward.z < -1 + 1e-12 && v.camera.up.y > 1 - 1e-12 && v.camera.right.x > 1 - 1e-12);
    r.target.agl = 100;
    refused(&r, SV_EINVAL, "target");
}

static void test_local_scene_has_no_earth(void **state)
{
    (void)state;
    struct sv_view_request r = at(200, 150);
    r.north_true = true;
    refused(&r, SV_EINVAL, "north");
    r = at(200, 150);
    r.crs_epsg = 32633;
    refused(&r, SV_EINVAL, "crs");
    r = at(200, 150);
    r.has_time = true;
    refused(&r, SV_EINVAL, "time");
    r = at(200, 150);
    r.eye = (struct sv_place){.form = SV_PLACE_LONLAT, .x = 10, .y = 50, .agl = 2};
    refused(&r, SV_EINVAL, "eye");
}

static void test_sun_and_later_features(void **state)
{
    (void)state;
    struct sv_view_request r = at(200, 150);
    struct sv_resolved_view v = resolved(&r);
    assert_true(v.sun.azimuth_rad == scene->sun.azimuth_rad &&
                v.sun.elevation_rad == scene->sun.elevation_rad);
    r.has_sun_azimuth = true;
    r.sun_azimuth_rad = sv_radians(-90);
    v = resolved(&r);
    assert_true(fabs(v.sun.azimuth_rad - sv_radians(270)) < 1e-12 &&
                v.sun.elevation_rad == scene->sun.elevation_rad);
    r.shadows = true;
    v = resolved(&r);
    assert_true(!v.plan.raycast && v.plan.shadows);
    r.trees = SV_TREES_RAYCAST;
    v = resolved(&r);
    assert_true(v.plan.raycast && v.plan.shadows && v.plan.samples == 1);
    r.trees = SV_TREES_DENSITY;
    v = resolved(&r);
    assert_true(!v.plan.raycast && v.plan.trees == SV_TREES_DENSITY && v.plan.draw_trees);
    r = at(200, 150);
    r.quality = SV_QUALITY_REFERENCE;
    v = resolved(&r);
    assert_true(v.plan.raycast && v.plan.samples == 16 && !v.plan.shadows);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_heights),
        cmocka_unit_test(test_look_at_and_orbit),
        cmocka_unit_test(test_straight_down),
        cmocka_unit_test(test_local_scene_has_no_earth),
        cmocka_unit_test(test_sun_and_later_features),
    };
    return cmocka_run_group_tests(tests, setup, teardown);
}
