/* The ray march itself, against closed forms: planes, tilted and seen from anywhere; a paraboloid patch by
 * patch; a step with its hole; and its own surface sampled densely on the named reliefs. */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "core/base/rng.h"
#include "tests/core/relief/named_reliefs.h"
#include "tests/core/relief/ray_march.h"

static const struct sv_relief_frame level = {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {0, 0, 1}};

static void make(int width, int height, float cut, float (*height_of)(int i, int j), struct sv_relief *r)
{
    assert_int_equal(sv_relief_alloc(width, height, r, NULL), SV_OK);
    r->frame = level;
    r->cut = cut;
    for (int j = 0; j < height; j++)
        for (int i = 0; i < width; i++) {
            size_t k = (size_t)j * (size_t)width + (size_t)i;
            r->displ[k] = height_of(i, j);
            r->color[k][0] = (uint8_t)(20 * i), r->color[k][1] = (uint8_t)(20 * j), r->color[k][3] = 255;
        }
    sv_relief_measure(r);
}

/* A parallel camera at `eye` that looks along `forward`; its middle ray (pixel (1, 1)) goes through the eye.
 */
static struct sv_camera aim(struct sv_vec3 eye, struct sv_vec3 forward, bool parallel)
{
    struct sv_camera c = {.eye = eye, .width = 2, .height = 2, .near_m = 1e-3, .far_m = 1000};
    c.projection = parallel ? SV_PROJECTION_ORTHOGRAPHIC : SV_PROJECTION_PERSPECTIVE;
    c.vfov_rad = 1, c.ortho_height_m = 2;
    c.forward = sv_normalize(forward);
    c.right =
        sv_normalize(sv_cross(c.forward, fabs(c.forward.z) > 0.9 ? sv_vec3(0, 1, 0) : sv_vec3(0, 0, 1)));
    c.up = sv_cross(c.right, c.forward);
    return c;
}

static float tilted(int i, int j)
{
    return (float)(0.25 * (i + 0.5) - 0.5 * (j + 0.5));
}

static void planes_by_the_plane_equation(void **state)
{
    (void)state;
    struct sv_relief r;
    struct sv_rng rng = sv_rng_seeded(2, 2);
    make(12, 12, INFINITY, tilted, &r);
    struct ray_field *field = ray_field_create(&r);
    double worst = 0;
    int hits = 0;
    for (int k = 0; k < 20000; k++) {
        double x = sv_rng_range(&rng, 0.5, 11.5), y = sv_rng_range(&rng, 0.5, 11.5);
        struct sv_vec3 at = sv_vec3(x, y, 0.25 * x - 0.5 * y);
        struct sv_vec3 eye =
            sv_vec3(sv_rng_range(&rng, -30, 40), sv_rng_range(&rng, -30, 40), sv_rng_range(&rng, -40, 40));
        double side = eye.z - 0.25 * eye.x + 0.5 * eye.y;
        if (fabs(side) < 0.5)
            continue;
        struct sv_camera c = aim(eye, sv_sub(at, eye), k & 1);
        struct ray_seen seen;
        ray_march(field, &c, 1, 1, &seen);
        /* Only the plane is there, and the flat half texel at the border, which another ray may meet first.
         */
        if (seen.kind == RAY_SURFACE && (seen.u < 0.5 || seen.v < 0.5 || seen.u > 11.5 || seen.v > 11.5))
            continue;
        hits++;
        assert_int_equal(seen.kind, RAY_SURFACE);
        worst =
            fmax(worst, fmax(fabs(seen.u - x), fabs(seen.v - y)) * fabs(side) / sv_length(sv_sub(at, eye)));
        assert_true(fabs(seen.depth_m - sv_length(sv_sub(at, eye))) <
                    1e-8 * sv_length(sv_sub(at, eye)) / fabs(side) + 1e-9);
        assert_true(fabs(seen.rgb[0] - 20 * (x - 0.5)) < 1e-4 && fabs(seen.rgb[1] - 20 * (y - 0.5)) < 1e-4);
    }
    print_message("tilted plane: %d rays, worst %.2e texels times the sine of the grazing angle\n", hits,
                  worst);
    assert_true(hits > 15000 && worst < 1e-9);
    ray_field_destroy(field);
    sv_relief_finish(&r);
}

static float bowl(int i, int j)
{
    return (float)((i - 8) * (i - 8) + (j - 8) * (j - 8)) / 16.0f;
}

/* Marches densely (a thousand steps a texel), then halves: slow, and with nothing in common with the
 * quadratic. */
static bool dense(const struct ray_field *field, const struct sv_camera *c, double px, double py, double end,
                  double hit[3])
{
    struct sv_vec3 o, d;
    sv_camera_ray(c, px, py, &o, &d);
    double before = NAN, step = 1e-3, rgb[3], displ;
    for (double t = c->near_m; t < end; t += step) {
        double lo = t - step, hi = t, now = NAN;
        struct sv_vec3 p = sv_add(c->eye, sv_madd(o, d, t));
        if (ray_surface_at(field, p.x, p.y, &displ, rgb))
            now = p.z - displ;
        if (before * now <= 0 && fabs(before - now) < 0.1) {
            for (int k = 0; k < 60; k++) {
                double mid = 0.5 * (lo + hi);
                p = sv_add(c->eye, sv_madd(o, d, mid));
                if (!ray_surface_at(field, p.x, p.y, &displ, rgb))
                    return false;
                if ((p.z - displ) * before > 0)
                    lo = mid;
                else
                    hi = mid;
            }
            hit[0] = p.x, hit[1] = p.y, hit[2] = hi;
            return true;
        }
        before = now;
    }
    return false;
}

static void curved_patches_by_dense_steps(void **state)
{
    (void)state;
    struct sv_relief r;
    struct sv_rng rng = sv_rng_seeded(4, 2);
    make(17, 17, INFINITY, bowl, &r);
    struct ray_field *field = ray_field_create(&r);
    int same = 0, nothing = 0, other = 0;
    double worst = 0;
    for (int k = 0; k < 2000; k++) {
        struct sv_vec3 eye =
            sv_vec3(sv_rng_range(&rng, -10, 27), sv_rng_range(&rng, -10, 27), sv_rng_range(&rng, -6, 20));
        struct sv_vec3 at =
            sv_vec3(sv_rng_range(&rng, 0, 17), sv_rng_range(&rng, 0, 17), sv_rng_range(&rng, 0, 6));
        struct sv_camera c = aim(eye, sv_sub(at, eye), k & 1);
        struct ray_seen seen;
        double hit[3];
        ray_march(field, &c, 1, 1, &seen);
        bool found = dense(field, &c, 1, 1, 80, hit);
        if (found != (seen.kind == RAY_SURFACE) || (found && fabs(hit[2] - seen.depth_m) > 1e-6))
            other++;
        else if (found)
            same++, worst = fmax(worst, fmax(fabs(hit[0] - seen.u), fabs(hit[1] - seen.v)));
        else
            nothing++;
    }
    print_message("bowl: %d rays meet it alike (worst %.1e texels), %d pass it alike, %d differ\n", same,
                  worst, nothing, other);
    /* Dense steps miss what a ray grazes within one step of 1 mm. */
    assert_true(same > 500 && nothing > 100 && other <= 2 && worst < 1e-6);
    ray_field_destroy(field);
    sv_relief_finish(&r);
}

static float step_up(int i, int j)
{
    (void)j;
    return i < 5 ? 0 : 3;
}

static void a_step_is_torn_and_its_hole_found(void **state)
{
    (void)state;
    struct sv_relief r;
    make(10, 10, 1, step_up, &r);
    struct ray_field *field = ray_field_create(&r);
    struct ray_seen seen;
    /* From the low side at 45 degrees: the ray for (x, 0) on the ground; ground, riser (x in (5, 8)),
     * plateau. */
    struct sv_vec3 along = sv_vec3(1, 0, -1);
    for (int k = 0; k < 40; k++) {
        double x = 3.05 + 0.2 * k;
        struct sv_camera c = aim(sv_vec3(x - 20, 4.3, 20), along, true);
        ray_march(field, &c, 1, 1, &seen);
        if (x < 5) {
            assert_int_equal(seen.kind, RAY_SURFACE);
            assert_true(fabs(seen.u - x) < 1e-9 && fabs(seen.displ) < 1e-9);
        } else if (x < 8) { /* enters beneath the plateau: what the ground, carried on, would show */
            assert_int_equal(seen.kind, RAY_HOLE);
            assert_true(fabs(seen.u - x) < 1e-9 && seen.displ == 0 && seen.rgb[0] == 80 && seen.gaps == 1);
            assert_true(fabs(seen.depth_m - 20 * sqrt(2)) < 1e-9);
        } else {
            assert_int_equal(seen.kind, RAY_SURFACE);
            assert_true(fabs(seen.u - (x - 3)) < 1e-9 && fabs(seen.displ - 3) < 1e-9);
        }
    }
    /* Straight down nothing opens; from the high side the ground behind the edge is hidden, not torn. */
    for (int k = 0; k < 100; k++) {
        struct sv_camera c = aim(sv_vec3(0.05 + 0.0999 * k, 4.3, 20), sv_vec3(0, 0, -1), true);
        ray_march(field, &c, 1, 1, &seen);
        assert_true(seen.kind == RAY_SURFACE && seen.gaps == 0);
        c = aim(sv_vec3(0.05 + 0.0999 * k + 20, 4.3, 20), sv_vec3(-1, 0, -1), true);
        ray_march(field, &c, 1, 1, &seen);
        assert_true(seen.kind != RAY_HOLE);
    }
    /* From beneath, the low side is nearer: what opens shows the plateau carried on. */
    struct sv_camera c = aim(sv_vec3(6 - 20 + 0.5, 4.3, -20), sv_vec3(1, 0, 1.1), true);
    ray_march(field, &c, 1, 1, &seen);
    assert_int_equal(seen.kind, RAY_SURFACE);
    c = aim(sv_vec3(4.4 + 20, 4.3, 1.5 - 20), sv_vec3(-1, 0, 1), true);
    ray_march(field, &c, 1, 1, &seen);
    assert_true(seen.kind == RAY_SURFACE || (seen.kind == RAY_HOLE && seen.displ == 3));
    ray_field_destroy(field);
    sv_relief_finish(&r);
}

static float flat_zero(int i, int j)
{
    (void)i, (void)j;
    return 0;
}

static void a_texel_covers_its_square(void **state)
{
    (void)state;
    struct sv_relief r;
    make(3, 3, INFINITY, flat_zero, &r);
    r.color[4][3] = 0; /* the middle one is empty */
    sv_relief_measure(&r);
    struct ray_field *field = ray_field_create(&r);
    for (int j = -5; j < 40; j++)
        for (int i = -5; i < 40; i++) {
            double x = 0.1 * i + 0.003, y = 0.1 * j + 0.007;
            struct sv_camera c = aim(sv_vec3(x, y, -8), sv_vec3(0, 0, 1), true);
            struct ray_seen seen;
            ray_march(field, &c, 1, 1, &seen);
            bool in = x > 0 && x < 3 && y > 0 && y < 3 && !(x > 1 && x < 2 && y > 1 && y < 2);
            assert_int_equal(seen.kind, in ? RAY_SURFACE : RAY_NOTHING);
        }
    ray_field_destroy(field);
    sv_relief_finish(&r);
}

/* Every surface point that a ray reports lies on the ray and on the surface; smooth ones have no hole and no
 * gap. */
static void named_reliefs_are_whole(void **state)
{
    (void)state;
    int kinds[3] = {0};
    for (int k = 0; k < NAMED_COUNT; k++) {
        struct sv_relief r;
        named_relief_make(k, &r);
        assert_int_equal(sv_relief_frame_check(&r.frame, NULL), SV_OK);
        kinds[named_relief_kind(k)]++;
        struct ray_field *field = ray_field_create(&r);
        struct sv_camera c;
        named_relief_camera(&r, sv_radians(25), 0.7 * k, 0.5, k & 1, &c);
        int seen_count = 0, holes = 0;
        for (int j = 0; j < c.height; j++)
            for (int i = 0; i < c.width; i++) {
                struct ray_seen seen;
                double px, py, z;
                ray_march(field, &c, i + 0.5, j + 0.5, &seen);
                holes += seen.kind == RAY_HOLE;
                if (seen.kind != RAY_SURFACE)
                    continue;
                seen_count++;
                struct sv_vec3 x = sv_relief_point(&r.frame, seen.u, seen.v, seen.displ);
                assert_true(sv_camera_project(&c, x, &px, &py, &z));
                assert_true(fabs(px - i - 0.5) < 1e-4 && fabs(py - j - 0.5) < 1e-4);
                assert_true(fabs(z - seen.depth_m) < 1e-6 * (1 + z));
            }
        if (named_relief_kind(k) == NAMED_SMOOTH)
            assert_int_equal(holes, 0);
        assert_true(seen_count * 4 >= c.width * c.height || r.width * r.height < 400);
        ray_field_destroy(field);
        sv_relief_finish(&r);
    }
    print_message("named reliefs: %d smooth, %d stepped, %d noisy\n", kinds[0], kinds[1], kinds[2]);
    assert_true(kinds[0] >= 15 && kinds[1] >= 15 && kinds[2] >= 8);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(planes_by_the_plane_equation),      cmocka_unit_test(curved_patches_by_dense_steps),
        cmocka_unit_test(a_step_is_torn_and_its_hole_found), cmocka_unit_test(a_texel_covers_its_square),
        cmocka_unit_test(named_reliefs_are_whole),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
