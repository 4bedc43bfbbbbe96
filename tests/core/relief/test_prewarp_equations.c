/* test_prewarp_equations.c - eq. (1)-(4) of paper 1 as core/relief/prewarp.h derives them, against rays met
 * with the plane in long double; the printed (4) fails; singular places are answered. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <string.h>

#include <cmocka.h>

#include "core/base/rng.h"
#include "core/relief/build.h"
#include "core/relief/prewarp.h"

typedef long double real;

struct real3 {
    real x, y, z;
};

static struct real3 real3_of(struct sv_vec3 v)
{
    return (struct real3){v.x, v.y, v.z};
}
static real dot_l(struct real3 a, struct real3 b)
{
    return a.x * b.x + a.y * b.y + a.z * b.z;
}
static struct real3 madd_l(struct real3 a, struct real3 b, real s)
{
    return (struct real3){a.x + b.x * s, a.y + b.y * s, a.z + b.z * s};
}

/* Where the line from X (relative to O, as everything here: O may be far away) along `along` meets the plane,
 * in texels. */
static void meet_plane(const struct sv_relief_frame *frame, struct real3 x, struct real3 along, real *u,
                       real *v)
{
    struct real3 f = real3_of(frame->f), a = real3_of(frame->a), b = real3_of(frame->b);
    struct real3 p = madd_l(x, along, -dot_l(x, f) / dot_l(along, f));
    *u = dot_l(p, a) / dot_l(a, a);
    *v = dot_l(p, b) / dot_l(b, b);
}

static struct real3 place_l(const struct sv_relief_frame *f, real u, real v, real d)
{
    struct real3 none = {0, 0, 0};
    return madd_l(madd_l(madd_l(none, real3_of(f->a), u), real3_of(f->b), v), real3_of(f->f), d);
}

static struct sv_vec3 random_unit(struct sv_rng *rng)
{
    double z = sv_rng_range(rng, -1, 1), phi = sv_rng_range(rng, 0, 2 * SV_PI), r = sqrt(1 - z * z);
    return sv_vec3(r * cos(phi), r * sin(phi), z);
}

/* Any attitude, both hands, texels of 1 mm to 1 km, at UTM coordinates one time in four. */
static struct sv_relief_frame random_frame(struct sv_rng *rng)
{
    struct sv_relief_frame frame;
    struct sv_vec3 x = random_unit(rng), y, z = random_unit(rng);
    z = sv_normalize(sv_cross(x, z));
    y = sv_cross(z, x);
    double far = sv_rng_unit(rng) < 0.25 ? 1 : 0;
    frame.a = sv_scale(x, pow(10, sv_rng_range(rng, -3, 3)));
    frame.b = sv_scale(y, sv_length(frame.a) * pow(10, sv_rng_range(rng, -1, 1)));
    frame.f = sv_rng_next(rng) & 1 ? z : sv_scale(z, -1);
    frame.origin = sv_vec3(500000 * far + sv_rng_range(rng, -100, 100), 4e6 * far, 0);
    return frame;
}

/* ---- equations ---- */

/* Tolerance: c.f, c.a and f.a carry rounding of some eps |c|, so that k1 d has a relative error of eps
 * |c|/|c.f|; a, b and f are square to some eps only, so that vs b has a part along a, and us a + vs b one
 * along f, which tau takes for distance; tau magnifies all of it. Each of these is a sum of some ten
 * products: 256 half ulps of the sum. */
static real allowed(const struct sv_relief_frame *f, struct sv_vec3 c, double us, double vs, double d,
                    real tau, real ui, double side)
{
    real depth = fabs(sv_dot(c, f->f)), steep = sv_length(c) / depth;
    real flat = us * sv_length(f->a) + vs * sv_length(f->b);
    return 64 * 0x1p-53L *
           (flat / side + sv_length(c) / side * fabs(d) / depth * steep +
            fabsl(ui) * (1 + fabs(d) / depth * steep + flat / depth) + 1e-6L) /
           tau;
}

static void equations_meet_the_rays(void **state)
{
    (void)state;
    enum { COUNT = 100000 };
    struct sv_rng rng = sv_rng_seeded(31, 1);
    real worst = 0, plain = 0;
    int tried = 0, front = 0, hand = 0;
    while (tried < COUNT) {
        struct sv_relief_frame f = random_frame(&rng);
        double texel = sv_length(f.a), us = sv_rng_range(&rng, 0, 512), vs = sv_rng_range(&rng, 0, 512);
        struct sv_vec3 eye = sv_madd(f.origin, random_unit(&rng), texel * pow(10, sv_rng_range(&rng, -1, 5)));
        double d = texel * sv_rng_range(&rng, -300, 300), ui, vi;
        struct sv_prewarp p;
        struct sv_error error;
        if (sv_prewarp_perspective(&f, eye, &p, &error) || 1 + p.k[2] * d <= p.near)
            continue;
        real u, v;
        struct real3 x = place_l(&f, us, vs, d), from_eye = madd_l(real3_of(f.origin), real3_of(eye), -1);
        meet_plane(&f, x, madd_l(x, from_eye, 1), &u, &v);
        assert_true(sv_prewarp_point(&p, us, vs, d, &ui, &vi));
        struct sv_vec3 c = sv_sub(f.origin, eye);
        real tau = 1 + (real)d / sv_dot(c, f.f);
        real off_u = fabsl(ui - u), off_v = fabsl(vi - v);
        real share = fmaxl(off_u / allowed(&f, c, us, vs, d, tau, u, texel),
                           off_v / allowed(&f, c, us, vs, d, tau, v, sv_length(f.b)));
        if (share > worst)
            worst = share;
        if (tau > 0.1L && fabs(sv_dot(c, f.f)) > 0.2 * sv_length(c))
            plain = fmaxl(plain, fmaxl(off_u / (1 + fabsl(u)), off_v / (1 + fabsl(v))));
        if (share > 1)
            fail_msg("seed 31, case %d: (us, vs, d) = (%.17g, %.17g, %.17g): expected (%.17Lg, %.17Lg), got "
                     "(%.17g, %.17g), %Lg of what is allowed",
                     tried, us, vs, d, u, v, ui, vi, share);
        front += !p.behind;
        hand += sv_dot(sv_cross(f.a, f.b), f.f) > 0;
        tried++;
    }
    print_message("(1), (2): %d cases, %d with the eye in front, %d right-handed: worst %.3Lf of the bound; "
                  "%.2Lg of |u| + 1 where nothing is steep\n",
                  tried, front, hand, worst, plain);
    assert_true(front > COUNT / 4 && front < COUNT * 3 / 4 && hand > COUNT / 4 && hand < COUNT * 3 / 4);
    assert_true(plain < 1e-9L);
}

/* (2) as printed, by triple products: the short form in use is the same. */
static void short_form_is_the_printed_two(void **state)
{
    (void)state;
    struct sv_rng rng = sv_rng_seeded(31, 2);
    for (int n = 0; n < 10000; n++) {
        struct sv_relief_frame f = random_frame(&rng);
        f.origin = sv_vec3(0, 0, 0);
        struct sv_vec3 eye = sv_scale(random_unit(&rng), 100 * sv_length(f.a)), c = sv_scale(eye, -1);
        struct sv_prewarp p;
        struct sv_error error;
        if (sv_prewarp_perspective(&f, eye, &p, &error) || fabs(sv_dot(c, f.f)) < 0.01 * sv_length(c))
            continue;
        double det = sv_dot(f.a, sv_cross(f.b, c));
        double scale = fabs(p.k[0]) + 1 / sv_length(f.a);
        assert_true(fabs(sv_dot(f.f, sv_cross(f.b, c)) / det - p.k[0]) < 1e-10 * scale);
        scale = fabs(p.k[1]) + 1 / sv_length(f.b);
        assert_true(fabs(sv_dot(f.f, sv_cross(c, f.a)) / det - p.k[1]) < 1e-10 * scale);
    }
}

/* (4): ours by rays and as the limit of (2); what is printed is off by twice the shift. */
static void printed_four_fails(void **state)
{
    (void)state;
    struct sv_rng rng = sv_rng_seeded(31, 3);
    int tried = 0, wrong_by_ray = 0, wrong_by_limit = 0;
    real ours_ray = 0, ours_limit = 0;
    while (tried < 20000) {
        struct sv_relief_frame f = random_frame(&rng);
        double texel = sv_length(f.a), us = sv_rng_range(&rng, 0, 512), vs = sv_rng_range(&rng, 0, 512);
        struct sv_vec3 c = random_unit(&rng);
        double d = texel * sv_rng_range(&rng, -50, 50), ui, vi, lu = NAN, lv = NAN;
        double depth = sv_dot(c, f.f);
        if (fabs(depth) < 0.05)
            continue;
        struct sv_prewarp p, far;
        struct sv_error error;
        assert_int_equal(sv_prewarp_parallel(&f, sv_scale(c, 3), &p, &error), SV_OK);
        struct sv_vec3 eye = sv_madd(f.origin, c, -1e7 * texel);
        assert_int_equal(sv_prewarp_perspective(&f, eye, &far, &error), SV_OK);
        assert_true(sv_prewarp_point(&p, us, vs, d, &ui, &vi) && sv_prewarp_point(&far, us, vs, d, &lu, &lv));
        real u, v;
        meet_plane(&f, place_l(&f, us, vs, d), real3_of(c), &u, &v);
        double printed_u = us + d * sv_dot(c, f.a) / (sv_dot(f.a, f.a) * depth); /* eq. 4 as printed */
        ours_ray = fmaxl(ours_ray, fmaxl(fabsl(ui - u), fabsl(vi - v)) / (1 + fabsl(u) + fabsl(v)));
        /* at 1e7 texels, tau is off 1 by up to 50 / (0.05 1e7) */
        ours_limit = fmaxl(ours_limit, fmaxl(fabs(ui - lu), fabs(vi - lv)) / (1 + fabsl(u) + fabsl(v)));
        if (fabs(ui - us) < 0.01)
            continue;
        wrong_by_ray += fabsl(printed_u - u) > 1.9L * fabsl(u - us);
        wrong_by_limit += fabs(printed_u - lu) > 0.5 * fabs(lu - us);
        tried++;
    }
    print_message("(4): ours is off by %.2Lg of |u| + |v| + 1 by rays, %.2Lg against (2) from 1e7 texels; as "
                  "printed, %d and %d of %d cases are wrong by twice the shift\n",
                  ours_ray, ours_limit, wrong_by_ray, wrong_by_limit, tried);
    assert_true(ours_ray < 1e-9L && ours_limit < 2e-4L);
    assert_int_equal(wrong_by_ray, tried);
    assert_true(wrong_by_limit > tried * 99 / 100);
}

static struct sv_relief_frame plain_frame(void)
{
    return (struct sv_relief_frame){sv_vec3(0, 0, 0), sv_vec3(1, 0, 0), sv_vec3(0, 1, 0), sv_vec3(0, 0, 1)};
}

static void singular_places_are_answered(void **state)
{
    (void)state;
    struct sv_relief_frame f = plain_frame();
    struct sv_prewarp p;
    struct sv_error error;
    assert_int_equal(sv_prewarp_perspective(&f, sv_vec3(-10, 0, 5e-6), &p, &error), SV_EINVAL);
    assert_string_equal(error.field, "eye");
    assert_non_null(strstr(error.message, "degrees"));
    assert_int_equal(sv_prewarp_perspective(&f, sv_vec3(-10, 0, 2e-5), &p, &error), SV_OK);
    assert_int_equal(sv_prewarp_perspective(&f, sv_vec3(0, 0, 0), &p, &error), SV_EINVAL);
    assert_int_equal(sv_prewarp_perspective(&f, sv_vec3(NAN, 0, 1), &p, &error), SV_EINVAL);
    assert_int_equal(sv_prewarp_perspective(&f, sv_vec3(INFINITY, 0, 1), &p, &error), SV_EINVAL);
    assert_int_equal(sv_prewarp_parallel(&f, sv_vec3(1, 1, 1e-7), &p, &error), SV_EINVAL);
    assert_string_equal(error.field, "direction");
    assert_int_equal(sv_prewarp_parallel(&f, sv_vec3(0, 0, 0), &p, &error), SV_EINVAL);
    assert_int_equal(sv_prewarp_parallel(&f, sv_vec3(0, 0, -1e-200), &p, &error), SV_OK);
    f.a = sv_vec3(0, 0, 0);
    assert_int_equal(sv_prewarp_parallel(&f, sv_vec3(0, 0, -1), &p, &error), SV_EINVAL);
    f = plain_frame();
    double u = 7, v = 7;
    assert_int_equal(sv_prewarp_perspective(&f, sv_vec3(3, 4, 10), &p, &error), SV_OK);
    assert_true(p.epipole[0] == 3 && p.epipole[1] == 4 && !p.behind);
    assert_true(sv_prewarp_point(&p, 1, 2, 9.98, &u, &v));
    u = v = 7;
    assert_false(sv_prewarp_point(&p, 1, 2, 9.9999, &u, &v)); /* tau 1e-5 */
    assert_false(sv_prewarp_point(&p, 1, 2, 11, &u, &v));
    assert_false(sv_prewarp_point(&p, 1, 2, NAN, &u, &v));
    assert_false(sv_prewarp_point(&p, INFINITY, 2, 0, &u, &v));
    assert_true(u == 7 && v == 7);
}

/* A texel of a panel, put by (7)-(9) where it stands and seen along a ray from the eye, lands where (1) with
 * zeta says; the eye anywhere in front of the plane, gamma of either sign and 0. Tolerance: numbers of n / (1
 * - gamma) <= 640 texels after some ten roundings: 640 * 10 * 2^-53 < 1e-12, and as much again by tau >= 0.1:
 * 1e-11. */
static void panels_land_where_rays_say(void **state)
{
    (void)state;
    struct sv_rng rng = sv_rng_seeded(5, 1);
    const double n = 64;
    struct sv_relief_frame f = plain_frame();
    long drawn = 0;
    for (int k = 0; k < 20000; k++) {
        double d = sv_rng_range(&rng, 20, 200), gamma = k % 8 == 0 ? 0 : sv_rng_range(&rng, -0.9, 0.9);
        struct sv_vec3 v = {n / 2, n / 2, d};
        struct sv_vec3 eye = {v.x + sv_rng_range(&rng, -0.9, 0.9) * d, v.y + sv_rng_range(&rng, -0.9, 0.9) * d,
                              v.z - gamma * d};
        double u = sv_rng_range(&rng, 0, n), w = sv_rng_range(&rng, 0, n);
        double z = d * pow(10, sv_rng_range(&rng, -0.3, 4)), us, vs, displ, ui, vi;
        struct sv_prewarp p;
        struct sv_error error;
        assert_int_equal(sv_prewarp_panel(&f, v, eye, &p, &error), SV_OK);
        sv_depth_relief(d, n, u, w, z, &us, &vs, &displ);
        bool seen = sv_prewarp_point(&p, u, w, displ * d / z, &ui, &vi);
        if (z < (gamma + 0.1) * d) /* behind the eye, or too near to it for the tolerance */
            continue;
        assert_true(seen);
        struct real3 x = place_l(&f, us, vs, displ), e = real3_of(eye);
        real tu, tv;
        meet_plane(&f, x, madd_l(x, e, -1), &tu, &tv);
        assert_true(fabsl(ui - tu) <= 1e-11L * (1 + fabsl(tu)) && fabsl(vi - tv) <= 1e-11L * (1 + fabsl(tv)));
        assert_int_equal(p.outward, p.k[2] > 0);
        drawn++;
    }
    assert_true(drawn > 15000);
    struct sv_prewarp p;
    struct sv_error error;
    struct sv_vec3 v = {n / 2, n / 2, 50};
    assert_int_equal(sv_prewarp_panel(&f, v, sv_vec3(32, 32, 0), &p, &error), SV_EINVAL);
    assert_int_equal(sv_prewarp_panel(&f, v, sv_vec3(32, 32, -5), &p, &error), SV_EINVAL);
    assert_string_equal(error.field, "eye");
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(equations_meet_the_rays),
        cmocka_unit_test(short_form_is_the_printed_two),
        cmocka_unit_test(printed_four_fails),
        cmocka_unit_test(singular_places_are_answered),
        cmocka_unit_test(panels_land_where_rays_say),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
