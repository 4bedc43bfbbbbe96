/* test_camera.c - axes, rays, projection, the clip matrix, planes and sample positions. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>

#include "core/base/frames.h"
#include "core/base/rng.h"
#include "core/view/camera.h"

static struct sv_camera random_camera(struct sv_rng *rng, int orthographic)
{
    struct sv_camera c = {.eye = sv_vec3(sv_rng_range(rng, 4e5, 6e5), sv_rng_range(rng, 5e6, 9e6),
                                         sv_rng_range(rng, -100, 4000)),
                          .projection = orthographic ? SV_PROJECTION_ORTHOGRAPHIC : SV_PROJECTION_PERSPECTIVE,
                          .vfov_rad = sv_radians(sv_rng_range(rng, 1, 150)),
                          .ortho_height_m = sv_rng_range(rng, 1, 5000),
                          .width = (int)sv_rng_range(rng, 16, 4097),
                          .height = (int)sv_rng_range(rng, 16, 4097),
                          .near_m = 0.1,
                          .far_m = 20000};
    sv_camera_aim(&c, sv_rng_range(rng, -10, 10), sv_rng_range(rng, -SV_PI / 2, SV_PI / 2),
                  sv_rng_range(rng, -4, 4));
    return c;
}

static void assert_vec(struct sv_vec3 got, double x, double y, double z)
{
    if (!(sv_length(sv_sub(got, sv_vec3(x, y, z))) < 1e-12))
        fail_msg("expected (%g %g %g), got (%.17g %.17g %.17g)", x, y, z, got.x, got.y, got.z);
}

static void headings_and_pitches(void **state)
{
    (void)state;
    struct sv_camera c = {0};
    double s = sqrt(0.5);
    sv_camera_aim(&c, 0, 0, 0);
    assert_vec(c.forward, 0, 1, 0);
    assert_vec(c.right, 1, 0, 0);
    assert_vec(c.up, 0, 0, 1);
    sv_camera_aim(&c, SV_PI / 2, 0, 0); /* east; south is to the right */
    assert_vec(c.forward, 1, 0, 0);
    assert_vec(c.right, 0, -1, 0);
    sv_camera_aim(&c, SV_PI / 2, SV_PI / 4, 0);
    assert_vec(c.forward, s, 0, s);
    assert_vec(c.up, -s, 0, s);
    sv_camera_aim(&c, SV_PI / 2, -SV_PI / 2, 0); /* straight down: the picture's top is the heading */
    assert_vec(c.forward, 0, 0, -1);
    assert_vec(c.up, 1, 0, 0);
    sv_camera_aim(&c, SV_PI / 2, SV_PI / 2, 0); /* straight up: its opposite */
    assert_vec(c.forward, 0, 0, 1);
    assert_vec(c.up, -1, 0, 0);
    sv_camera_aim(&c, 0, 0, SV_PI / 6); /* the right side goes down */
    assert_vec(c.right, sqrt(0.75), 0, -0.5);
    assert_vec(c.up, 0.5, 0, sqrt(0.75));
}

static void axes_are_orthonormal(void **state)
{
    (void)state;
    struct sv_rng rng = sv_rng_seeded(1, 1);
    for (int k = 0; k < 1000; k++) {
        struct sv_camera c = random_camera(&rng, 0);
        assert_true(fabs(sv_length(c.right) - 1) < 1e-12 && fabs(sv_length(c.forward) - 1) < 1e-12);
        struct sv_vec3 x = sv_cross(c.right, c.up);
        assert_vec(x, -c.forward.x, -c.forward.y, -c.forward.z);
    }
}

/* ray -> point -> project returns the picture position and the depth, in UTM-sized coordinates. */
static void project_inverts_ray(void **state)
{
    (void)state;
    struct sv_rng rng = sv_rng_seeded(2, 2);
    for (int k = 0; k < 4000; k++) {
        struct sv_camera c = random_camera(&rng, k % 2);
        double px = sv_rng_range(&rng, 0, c.width), py = sv_rng_range(&rng, 0, c.height);
        double z = exp(sv_rng_range(&rng, log(0.2), log(5e4))), gx, gy, gz;
        struct sv_vec3 o, d;
        sv_camera_ray(&c, px, py, &o, &d);
        assert_true(fabs(sv_dot(d, c.forward) - 1) < 1e-12);
        assert_true(sv_camera_project(&c, sv_add(c.eye, sv_madd(o, d, z)), &gx, &gy, &gz));
        /* A northing of 9e6 has steps of 2e-9 m, seen at depth z (or by px per metre). */
        double step = 4e-9 * sv_camera_focal_px(&c) / (k % 2 ? 1 : z) * (1 + sv_length(d));
        assert_true(fabs(gx - px) < 1e-7 + step && fabs(gy - py) < 1e-7 + step &&
                    fabs(gz - z) < 1e-8 + 1e-12 * z);
        assert_false(sv_camera_project(&c, sv_add(c.eye, sv_madd(o, d, -1)), &gx, &gy, &gz));
    }
}

/* The clip matrix sends a local point to the same place as project, less the sample shift; depth is near / Z
 * or the linear form. */
static void clip_agrees_with_project(void **state)
{
    (void)state;
    struct sv_rng rng = sv_rng_seeded(3, 3);
    for (int k = 0; k < 4000; k++) {
        struct sv_camera c = random_camera(&rng, k % 2);
        double sx = sv_rng_range(&rng, -0.5, 0.5), sy = sv_rng_range(&rng, -0.5, 0.5), px, py, z, q[4];
        struct sv_vec3 p = sv_scale(c.forward, sv_rng_range(&rng, 1, 1000));
        struct sv_mat4 m;
        c.eye = sv_vec3(0, 0, 0);
        p = sv_madd(sv_madd(p, c.right, sv_rng_range(&rng, -500, 500)), c.up, sv_rng_range(&rng, -500, 500));
        assert_true(sv_camera_project(&c, p, &px, &py, &z));
        sv_camera_clip_from_local(&c, sx, sy, &m);
        for (int r = 0; r < 4; r++)
            q[r] = m.m[r][0] * p.x + m.m[r][1] * p.y + m.m[r][2] * p.z + m.m[r][3];
        double gx = (1 + q[0] / q[3]) * 0.5 * c.width, gy = (1 - q[1] / q[3]) * 0.5 * c.height;
        assert_true(fabs(gx - (px - sx)) < 1e-9 * (1 + fabs(px)) &&
                    fabs(gy - (py - sy)) < 1e-9 * (1 + fabs(py)));
        double expected = k % 2 ? (c.far_m - z) / c.far_m : c.near_m / z;
        assert_true(fabs(q[2] / q[3] - expected) < 1e-12);
    }
}

/* Inside all planes just when the point projects into the picture grown by half a pixel. */
static void planes_bound_the_picture(void **state)
{
    (void)state;
    struct sv_rng rng = sv_rng_seeded(4, 4);
    int in = 0;
    for (int k = 0; k < 20000; k++) {
        struct sv_camera c = random_camera(&rng, k % 2);
        double planes[5][4], px, py, z = sv_rng_range(&rng, -100, 1000);
        double mx = sv_rng_range(&rng, -0.6, 1.6) * c.width, my = sv_rng_range(&rng, -0.6, 1.6) * c.height;
        struct sv_vec3 o, d, p;
        c.eye = sv_vec3(0, 0, 0);
        sv_camera_ray(&c, mx, my, &o, &d);
        p = sv_madd(o, d, z);
        sv_camera_planes(&c, planes);
        int inside = 1;
        for (int i = 0; i < 5; i++)
            inside &= planes[i][0] * p.x + planes[i][1] * p.y + planes[i][2] * p.z + planes[i][3] >= 0;
        int shown = sv_camera_project(&c, p, &px, &py, &z) && px >= -0.5 && py >= -0.5 &&
                    px <= c.width + 0.5 && py <= c.height + 0.5;
        assert_int_equal(inside, shown);
        in += inside;
    }
    assert_in_range(in, 2000, 18000);
}

/* Every row, column and square stratum holds exactly one (four, ...) of the samples; mean offset 0; all
 * distinct. */
static void samples_are_stratified(void **state)
{
    (void)state;
    static const int counts[] = {1, 4, 16, 64};
    for (int n = 0; n < 4; n++) {
        int count = counts[n], side = 1 << n, rows[64] = {0}, columns[64] = {0}, boxes[64] = {0};
        double mean_x = 0, mean_y = 0;
        for (int k = 0; k < count; k++) {
            double x, y;
            sv_camera_sample_offset(count, k, &x, &y);
            assert_true(fabs(x) < 0.5 && fabs(y) < 0.5);
            mean_x += x;
            mean_y += y;
            columns[(int)((x + 0.5) * count)]++;
            rows[(int)((y + 0.5) * count)]++;
            boxes[(int)((x + 0.5) * side) + side * (int)((y + 0.5) * side)]++;
        }
        assert_true(fabs(mean_x) < 1e-12 && fabs(mean_y) < 1e-12);
        for (int k = 0; k < count; k++)
            assert_true(rows[k] == 1 && columns[k] == 1 && boxes[k] == 1);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(headings_and_pitches),     cmocka_unit_test(axes_are_orthonormal),
        cmocka_unit_test(project_inverts_ray),      cmocka_unit_test(clip_agrees_with_project),
        cmocka_unit_test(planes_bound_the_picture), cmocka_unit_test(samples_are_stratified),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
