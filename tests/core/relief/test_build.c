/* Reliefs from numbers: depth buffers made linear, eq. (7) to (9) as they hold and as they are printed,
 * height fields and depth pictures. */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "core/base/rng.h"
#include "core/relief/build.h"

static const struct sv_relief_frame plain = {{5, 6, 7}, {0.5, 0, 0}, {0, 2, 0}, {0, 0, 1}};

/* ---- depth buffers ---- */

/* What a buffer holds for a depth, from the projection's definition, in long double. */
static double forward_value(long double n, long double f, long double z)
{
    return (double)(f * (z - n) / (z * (f - n)));
}

static void depth_comes_back(void **state)
{
    (void)state;
    struct sv_rng rng = sv_rng_seeded(5, 5);
    double worst[3] = {0};
    for (int k = 0; k < 100000; k++) {
        double n = pow(10, sv_rng_range(&rng, -3, 2)), f = n * pow(10, sv_rng_range(&rng, 0.1, 6));
        double z = n * pow(f / n, sv_rng_unit(&rng));
        double d = forward_value(n, f, z);
        struct sv_depth_form form = {SV_DEPTH_FORWARD, n, f};
        /* One ulp of d is that much of z: dz/dd = z^2 (f - n) / (n f). */
        double got = sv_depth_linear(&form, d),
               allowed = 0x1p-53 * z * z * (f - n) / (n * f) + 4 * 0x1p-52 * z;
        if (d < 1)
            worst[0] = fmax(worst[0], fabs(got - z) / allowed);
        form = (struct sv_depth_form){SV_DEPTH_REVERSED_INFINITE, n, 0};
        worst[1] = fmax(worst[1], fabs(sv_depth_linear(&form, n / z) / z - 1) / (2 * 0x1p-52));
        form = (struct sv_depth_form){SV_DEPTH_ORTHOGRAPHIC_REVERSED, 0, f};
        d = (double)(((long double)f - z) / f);
        if (d > 0)
            worst[2] = fmax(worst[2], fabs(sv_depth_linear(&form, d) - z) / (2 * 0x1p-52 * f));
    }
    print_message("depth_linear: worst error, of what rounding allows: forward %.2f, reversed %.2f, "
                  "orthographic %.2f\n",
                  worst[0], worst[1], worst[2]);
    for (int k = 0; k < 3; k++)
        assert_true(worst[k] <= 1);
}

static void forward_depth_with_the_far_plane_at_infinity(void **state)
{
    (void)state;
    struct sv_depth_form form = {SV_DEPTH_FORWARD, 0.5, INFINITY};
    assert_true(sv_depth_linear(&form, 0) == 0.5);
    assert_true(fabs(sv_depth_linear(&form, 0.75) - 2) < 1e-15);
    assert_true(sv_depth_linear(&form, 1) == INFINITY);
}

static void depth_that_is_none(void **state)
{
    (void)state;
    const struct sv_depth_form forms[] = {{SV_DEPTH_FORWARD, 1, 100},
                                          {SV_DEPTH_REVERSED_INFINITE, 1, 0},
                                          {SV_DEPTH_ORTHOGRAPHIC_REVERSED, 0, 100},
                                          {SV_DEPTH_LINEAR, 0, 0}};
    static const double empty[] = {1, 0, 0, INFINITY};
    static const double wrong[] = {NAN, -INFINITY, -1, -1e-300};
    for (int k = 0; k < 4; k++) {
        assert_true(sv_depth_linear(&forms[k], empty[k]) == INFINITY);
        for (int w = 0; w < 4; w++)
            assert_true(isnan(sv_depth_linear(&forms[k], wrong[w])));
        if (k < 3) {
            assert_true(isnan(sv_depth_linear(&forms[k], 1.0000001)));
            assert_true(isnan(sv_depth_linear(&forms[k], INFINITY)));
        }
    }
    static const struct sv_depth_form illegal[] = {
        {SV_DEPTH_FORWARD, 0, 10},
        {SV_DEPTH_FORWARD, 10, 10},
        {SV_DEPTH_FORWARD, NAN, 10},
        {SV_DEPTH_FORWARD, 1, NAN},
        {SV_DEPTH_REVERSED_INFINITE, -1, 0},
        {SV_DEPTH_REVERSED_INFINITE, NAN, 0},
        {SV_DEPTH_FORWARD, -1, -0.5},
        {SV_DEPTH_ORTHOGRAPHIC_REVERSED, 0, 0},
        {SV_DEPTH_ORTHOGRAPHIC_REVERSED, 0, INFINITY},
    };
    for (size_t k = 0; k < sizeof illegal / sizeof *illegal; k++)
        assert_true(isnan(sv_depth_linear(&illegal[k], 0.5)));
    assert_true(sv_depth_linear(&forms[3], 0) == 0 && sv_depth_linear(&forms[3], 12.5) == 12.5);
}

/* ---- eq. (7) to (9) ---- */

/* A panel: plane at `distance` before V at the origin, looking along +y; f = -y to the viewer; n x n texels.
 */
struct panel {
    double distance, n, side;
    struct sv_relief_frame frame;
};

static struct panel make_panel(double distance, double n)
{
    double s = 4 * distance / n;
    return (struct panel){
        distance, n, s, {{-2 * distance, distance, 2 * distance}, {s, 0, 0}, {0, 0, -s}, {0, -1, 0}}};
}

/* eq. (1) with (2): where an eye sees the texel on the plane. */
static void through_eq_1(const struct sv_relief_frame *f, struct sv_vec3 eye, double us, double vs,
                         double displ, double *ui, double *vi)
{
    struct sv_vec3 c = sv_sub(f->origin, eye), bc = sv_cross(f->b, c), ca = sv_cross(c, f->a);
    double det = sv_dot(f->a, bc), k1 = sv_dot(f->f, bc) / det, k2 = sv_dot(f->f, ca) / det;
    double k3 = 1 / sv_dot(c, f->f);            /* eq. 2 */
    *ui = (us + k1 * displ) / (1 + k3 * displ); /* eq. 1 */
    *vi = (vs + k2 * displ) / (1 + k3 * displ);
}

/* Where the eye sees a place on the panel's plane, by intersecting the line with the plane. */
static void seen_on_plane(const struct panel *p, struct sv_vec3 eye, struct sv_vec3 place, double *u,
                          double *v)
{
    double t = (p->distance - eye.y) / (place.y - eye.y), displ;
    sv_relief_locate(&p->frame, sv_madd(eye, sv_sub(place, eye), t), u, v, &displ);
}

/* Largest errors over random texels: of the place (m), of the round trip at V and of the view from a moved
 * eye (texels), when `z_of` says what z is. */
typedef double z_rule(double distance, double depth, double n, double f);
static double z_ours(double distance, double depth, double n, double f)
{
    (void)n, (void)f;
    return distance - depth;
}
static double z_buffer_forward(double distance, double depth, double n, double f)
{
    (void)distance;
    return forward_value(n, f, depth);
}
static double z_buffer_reversed(double distance, double depth, double n, double f)
{
    (void)distance, (void)f;
    return n / depth;
}
static double z_distance(double distance, double depth, double n, double f)
{
    (void)distance, (void)n, (void)f;
    return depth;
}

static void try_rule(z_rule *rule, double worst[3])
{
    struct sv_rng rng = sv_rng_seeded(8, 8);
    worst[0] = worst[1] = worst[2] = 0;
    for (int k = 0; k < 20000; k++) {
        struct panel p = make_panel(sv_rng_range(&rng, 5, 300), 512);
        double u = sv_rng_range(&rng, 128, 384), v = sv_rng_range(&rng, 128, 384), n = 0.9 * p.distance,
               f = 40 * p.distance;
        double depth = p.distance * exp(sv_rng_range(&rng, 0, 3)), z = rule(p.distance, depth, n, f);
        double us = p.n / 2 + (u - p.n / 2) * (1 - z / p.distance),
               vs = p.n / 2 + (v - p.n / 2) * (1 - z / p.distance);
        if (rule == z_ours) { /* the code's own */
            double displ;
            sv_depth_relief(p.distance, p.n, u, v, depth, &us, &vs, &displ);
            assert_true(displ == z);
        }
        struct sv_vec3 ray = sv_sub(sv_relief_point(&p.frame, u, v, 0), sv_vec3(0, 0, 0));
        struct sv_vec3 truth = sv_scale(ray, depth / p.distance);
        worst[0] =
            fmax(worst[0], sv_length(sv_sub(sv_relief_point(&p.frame, us, vs, z), truth)) / p.distance);
        double ui, vi, tu, tv;
        through_eq_1(&p.frame, sv_vec3(0, 0, 0), us, vs, z, &ui, &vi);
        worst[1] = fmax(worst[1], fmax(fabs(ui - u), fabs(vi - v)));
        struct sv_vec3 eye = sv_scale(sv_vec3(0.1, -0.05, 0.04), p.distance);
        through_eq_1(&p.frame, eye, us, vs, z, &ui, &vi);
        seen_on_plane(&p, eye, truth, &tu, &tv);
        worst[2] = fmax(worst[2], fmax(fabs(ui - tu), fabs(vi - tv)));
    }
}

static void eq_8_and_9_hold_for_distance_minus_depth_only(void **state)
{
    (void)state;
    const struct {
        const char *name;
        z_rule *rule;
    } rules[] = {{"z = distance - Z", z_ours},
                 {"z-buffer, forward", z_buffer_forward},
                 {"z-buffer, reversed", z_buffer_reversed},
                 {"z = Z", z_distance}};
    for (int k = 0; k < 4; k++) {
        double worst[3];
        try_rule(rules[k].rule, worst);
        print_message("(7)-(9) with %-20s place off by %.2e distances; (1) at V: %.2e texels, at a moved "
                      "eye: %.2e texels\n",
                      rules[k].name, worst[0], worst[1], worst[2]);
        if (k == 0) {
            assert_true(worst[0] < 1e-13 && worst[1] < 1e-9 && worst[2] < 1e-9);
        } else {
            /* At V the trip through (1) undoes (8), (9) for any z: it cannot tell. The place and every other
             * eye can. */
            assert_true(worst[0] > 1 && worst[2] > 5);
        }
    }
}

static void eq_8_and_9_without_depth(void **state)
{
    (void)state;
    static const double depths[] = {INFINITY, -INFINITY, NAN};
    for (int k = 0; k < 3; k++) {
        double us = 0, vs = 0, displ = 0;
        sv_depth_relief(10, 64, 3, 4, depths[k], &us, &vs, &displ);
        assert_true(isnan(us) && isnan(vs) && isnan(displ));
    }
}

/* ---- builders ---- */

static void heights_become_a_relief(void **state)
{
    (void)state;
    const float heights[6] = {1, -2, NAN, 4, INFINITY, 5};
    const uint8_t color[6][4] = {{1, 2, 3, 255}, {4, 5, 6, 128}, {7, 8, 9, 255},
                                 {9, 9, 9, 127}, {1, 1, 1, 255}, {2, 2, 2, 255}};
    struct sv_relief r;
    assert_int_equal(sv_relief_from_heights(&plain, 3, 2, heights, color, 0.5f, &r, NULL), SV_OK);
    assert_true(r.width == 3 && r.height == 2 && r.cut == 0.5f && r.solid_count == 3);
    assert_true(r.displ_min == -2 && r.displ_max == 5);
    assert_memory_equal(&r.frame, &plain, sizeof plain);
    static const bool solid[6] = {true, true, false, false, false, true};
    for (size_t k = 0; k < 6; k++) {
        assert_int_equal(sv_relief_solid(&r, k), solid[k]);
        if (solid[k])
            assert_true(r.displ[k] == heights[k] && !memcmp(r.color[k], color[k], 4) &&
                        r.normal[k][2] == INT16_MAX && r.normal[k][3] == INT16_MAX);
    }
    assert_true(r.displ[2] == 0 && r.color[2][3] == 0);
    sv_relief_finish(&r);
    assert_int_equal(sv_relief_from_heights(&plain, 1, 1, heights, NULL, INFINITY, &r, NULL), SV_OK);
    assert_true(r.color[0][0] == 128 && r.color[0][3] == 255);
    sv_relief_finish(&r);
}

static void depth_pictures_become_a_relief(void **state)
{
    (void)state;
    /* Eye 20 m before the plane, far 50 m: displ = 20 - 50 (1 - d). */
    const float depth[4] = {0.6f, 1, 0, NAN};
    const struct sv_depth_form form = {SV_DEPTH_ORTHOGRAPHIC_REVERSED, 0, 50};
    struct sv_relief r;
    assert_int_equal(sv_relief_from_depth(&plain, 2, 2, depth, &form, 20, NULL, 1, &r, NULL), SV_OK);
    assert_true(fabsf(r.displ[0]) < 2e-6f && r.displ[1] == 20 && r.solid_count == 2);
    assert_false(sv_relief_solid(&r, 2) || sv_relief_solid(&r, 3));
    sv_relief_finish(&r);
    const float linear[4] = {18, 22.5f, INFINITY, -3};
    const struct sv_depth_form metres = {SV_DEPTH_LINEAR, 0, 0};
    assert_int_equal(sv_relief_from_depth(&plain, 4, 1, linear, &metres, 20, NULL, 1, &r, NULL), SV_OK);
    assert_true(r.displ[0] == 2 && r.displ[1] == -2.5f && r.solid_count == 2);
    sv_relief_finish(&r);
}

static void wrong_input_is_named(void **state)
{
    (void)state;
    const float heights[1] = {0};
    static const float cuts[] = {0, -1, NAN};
    const struct sv_depth_form metres = {SV_DEPTH_LINEAR, 0, 0};
    struct sv_relief r;
    struct sv_error e;
    for (int k = 0; k < 3; k++) {
        assert_int_equal(sv_relief_from_heights(&plain, 1, 1, heights, NULL, cuts[k], &r, &e), SV_EINVAL);
        assert_string_equal(e.field, "cut");
    }
    assert_int_equal(sv_relief_from_heights(&plain, 0, 1, heights, NULL, 1, &r, &e), SV_EINVAL);
    assert_string_equal(e.field, "width");
    struct sv_relief_frame skew = plain;
    skew.b.x = 1;
    assert_int_equal(sv_relief_from_heights(&skew, 1, 1, heights, NULL, 1, &r, &e), SV_EINVAL);
    assert_string_equal(e.field, "frame.b");
    assert_int_equal(sv_relief_from_depth(&plain, 1, 1, heights, &metres, NAN, NULL, 1, &r, &e), SV_EINVAL);
    assert_string_equal(e.field, "depth_at_plane_m");
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(depth_comes_back),
        cmocka_unit_test(forward_depth_with_the_far_plane_at_infinity),
        cmocka_unit_test(depth_that_is_none),
        cmocka_unit_test(eq_8_and_9_hold_for_distance_minus_depth_only),
        cmocka_unit_test(eq_8_and_9_without_depth),
        cmocka_unit_test(heights_become_a_relief),
        cmocka_unit_test(depth_pictures_become_a_relief),
        cmocka_unit_test(wrong_input_is_named),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
