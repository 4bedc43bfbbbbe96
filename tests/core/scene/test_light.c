/* test_light.c - the clear day: its scale, its colours by the hour, and the shading rules of light.h. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <string.h>
#include <cmocka.h>

#include "core/base/frames.h"
#include "core/base/rng.h"
#include "core/scene/light.h"

static struct sv_light light_at(double azimuth_deg, double elevation_deg)
{
    struct sv_light l;
    sv_light_from_sun(&(struct sv_sun){sv_radians(azimuth_deg), sv_radians(elevation_deg)}, &l);
    return l;
}

static struct sv_vec3 direction(struct sv_rng *rng)
{
    return sv_direction(sv_rng_range(rng, -4, 4), sv_rng_range(rng, -SV_PI / 2, SV_PI / 2));
}

static void test_scale(void **state)
{
    (void)state;
    static const float white[3] = {1, 1, 1};
    struct sv_light l = light_at(0, 90);
    float rgb[3];
    for (int c = 0; c < 3; c++)
        assert_true(fabsf(l.sun_rgb[c] + l.sky_rgb[c] - 1) < 1e-3f);
    l = light_at(100, 40); /* the default sun: white is bright, not burnt out; grass is in the middle of the scale */
    sv_light_surface(&l, sv_vec3(0, 0, 1), white, 1, 1, rgb);
    assert_true(rgb[1] > 0.75f && rgb[1] < 0.95f);
    static const float grass[3] = {0.06f, 0.10f, 0.03f};
    sv_light_surface(&l, sv_vec3(0, 0, 1), grass, 1, 1, rgb);
    assert_true(rgb[1] > 0.14f && rgb[1] < 0.24f);
}

static void test_direction(void **state)
{
    (void)state;
    struct sv_rng rng = sv_rng_seeded(1, 0);
    for (int k = 0; k < 1000; k++) {
        double a = sv_rng_range(&rng, -400, 400), e = sv_rng_range(&rng, -90, 90);
        struct sv_light l = light_at(a, e);
        struct sv_vec3 d = sv_direction(sv_radians(a), sv_radians(e));
        assert_true(sv_length(sv_sub(d, l.to_sun)) < 1e-12);
    }
    struct sv_light l = light_at(90, 0); /* the east */
    assert_true(l.to_sun.x > 0.999);
}

/* Every elevation: finite, never black, never negative; no step between neighbours; the sun gone at and below
 * the horizon, warmer the lower it stands. */
static void test_hours(void **state)
{
    (void)state;
    struct sv_light last = light_at(0, -95);
    for (double e = -95; e <= 95; e += 0.05) {
        struct sv_light l = light_at(0, e);
        const float *const sets[] = {l.sun_rgb,    l.sky_rgb,     l.ground_rgb,
                                     l.zenith_rgb, l.horizon_rgb, l.air_rgb};
        const float *const before[] = {last.sun_rgb,    last.sky_rgb,     last.ground_rgb,
                                       last.zenith_rgb, last.horizon_rgb, last.air_rgb};
        for (int s = 0; s < 6; s++)
            for (int c = 0; c < 3; c++) {
                assert_true(sets[s][c] >= 0 && sets[s][c] <= 1.5f);
                assert_true(s == 0 || sets[s][c] > 0);
                assert_true(fabsf(sets[s][c] - before[s][c]) < 0.02f);
            }
        assert_true((e <= 0) == (l.sun_rgb[0] == 0));
        if (e > 1)
            assert_true(l.sun_rgb[0] >= l.sun_rgb[1] && l.sun_rgb[1] >= l.sun_rgb[2]);
        if (e > 3 && e < 90)
            assert_true(l.sun_rgb[2] / l.sun_rgb[0] >= last.sun_rgb[2] / last.sun_rgb[0] - 1e-6f);
        assert_true(l.zenith_rgb[2] > l.zenith_rgb[0]); /* blue above */
        last = l;
    }
    struct sv_light night = light_at(0, -40);
    assert_true(night.sky_rgb[2] > night.sky_rgb[0] && night.sky_rgb[2] < 0.1f);
}

/* The tone curve: the identity up to a half, smooth and rising there, below 1 for whatever comes. */
static void test_tone(void **state)
{
    (void)state;
    static const float odd[] = {0, -0.0f, -1, NAN, -INFINITY, 1e-42f};
    for (size_t k = 0; k < sizeof odd / sizeof *odd; k++)
        assert_true(sv_light_tone(odd[k]) >= 0 && sv_light_tone(odd[k]) < 1e-30f);
    float last = 0.001f / 1.01f;
    for (float v = 0.001f; v < 50; v *= 1.01f) {
        float t = sv_light_tone(v);
        assert_true(t > last && t < 1 && t <= v);
        assert_true(v > 0.5f || t == v);
        assert_true(t - last <= 1.001f * (v - v / 1.01f) + 1e-6f); /* no slope above 1: no kink at a half */
        last = t;
    }
    assert_true(sv_light_tone(INFINITY) == 1 && sv_light_tone(3e38f) == 1);
}

static double tone(double c)
{
    return c <= 0.5 ? c : 0.5 + 0.5 * (2 * c - 1) / (1 + (2 * c - 1));
}

/* The rules of the header, written out in double. */
static void test_rules(void **state)
{
    (void)state;
    struct sv_rng rng = sv_rng_seeded(2, 0);
    for (int k = 0; k < 5000; k++) {
        struct sv_light l = light_at(sv_rng_range(&rng, 0, 360), sv_rng_range(&rng, -20, 90));
        struct sv_vec3 n = direction(&rng), viewer = direction(&rng), m = n;
        float albedo[3], rgb[3], occlusion = (float)sv_rng_unit(&rng), visible = (float)sv_rng_unit(&rng);
        float translucency = (float)sv_rng_unit(&rng);
        for (int c = 0; c < 3; c++)
            albedo[c] = (float)sv_rng_unit(&rng);
        sv_light_surface(&l, n, albedo, occlusion, visible, rgb);
        for (int c = 0; c < 3; c++) {
            double t = 0.5 + 0.5 * n.z,
                   ambient =
                       ((double)l.ground_rgb[c] * (1 - t) + (double)l.sky_rgb[c] * t) * (double)occlusion;
            double want = (double)albedo[c] *
                          ((double)l.sun_rgb[c] * fmax(0, sv_dot(n, l.to_sun)) * (double)visible + ambient);
            assert_true(fabs((double)rgb[c] - tone(want * (double)SV_LIGHT_EXPOSURE)) < 2e-6);
        }
        sv_light_leaf(&l, n, viewer, albedo, occlusion, translucency, visible, rgb);
        if (sv_dot(n, viewer) < 0)
            m = sv_scale(n, -1);
        double n_l = sv_dot(m, l.to_sun), sun = n_l >= 0 ? n_l : (double)translucency * -n_l;
        for (int c = 0; c < 3; c++) {
            double t = 0.5 + 0.5 * m.z,
                   ambient =
                       ((double)l.ground_rgb[c] * (1 - t) + (double)l.sky_rgb[c] * t) * (double)occlusion;
            double want = (double)albedo[c] * ((double)l.sun_rgb[c] * sun * (double)visible + ambient);
            assert_true(fabs((double)rgb[c] - tone(want * (double)SV_LIGHT_EXPOSURE)) < 2e-6);
        }
    }
}

static float brightness(const float rgb[3])
{
    return rgb[0] + rgb[1] + rgb[2];
}

static void test_sky(void **state)
{
    (void)state;
    struct sv_light l = light_at(135, 40);
    float zenith[3], horizon[3], sun[3], near_sun[3], opposite[3], below[3];
    sv_light_sky(&l, sv_vec3(0, 0, 1), zenith);
    sv_light_sky(&l, sv_direction(sv_radians(-45), 0.001), horizon);
    sv_light_sky(&l, l.to_sun, sun);
    sv_light_sky(&l, sv_direction(sv_radians(135), sv_radians(35)), near_sun);
    sv_light_sky(&l, sv_direction(sv_radians(-45), sv_radians(35)), opposite);
    sv_light_sky(&l, sv_vec3(0, 0, -1), below);
    assert_true(horizon[0] / horizon[2] > 1.5f * zenith[0] / zenith[2]); /* whitish against blue */
    assert_true(brightness(horizon) > brightness(zenith));
    assert_true(brightness(sun) > 4 && brightness(near_sun) < 3);
    assert_true(brightness(near_sun) > 1.02f * brightness(opposite));
    assert_true(brightness(below) > 0.1f && brightness(below) < brightness(horizon));
    struct sv_rng rng = sv_rng_seeded(6, 0);
    for (int k = 0; k < 20000; k++) { /* finite and positive everywhere, no step at the horizon */
        struct sv_light any = light_at(sv_rng_range(&rng, 0, 360), sv_rng_range(&rng, -90, 90));
        float rgb[3], up[3], down[3];
        sv_light_sky(&any, direction(&rng), rgb);
        double a = sv_rng_range(&rng, 0, 7);
        if (fabs(any.to_sun.z) > 0.02) { /* the disc itself ends at the horizon */
            sv_light_sky(&any, sv_direction(a, 1e-6), up);
            sv_light_sky(&any, sv_direction(a, -1e-6), down);
            for (int c = 0; c < 3; c++)
                assert_true(fabsf(up[c] - down[c]) < 1e-4f);
        }
        for (int c = 0; c < 3; c++)
            assert_true(rgb[c] > 0 && rgb[c] < 10);
    }
}

/* The disc is as large as the sun: radius 4.65 mrad, soft by a third of one. */
static void test_disc(void **state)
{
    (void)state;
    struct sv_light l = light_at(135, 40);
    float in[3], out[3];
    sv_light_sky(&l, sv_direction(sv_radians(135), sv_radians(40) + 4.3e-3), in);
    sv_light_sky(&l, sv_direction(sv_radians(135), sv_radians(40) + 5.1e-3), out);
    assert_true(in[0] - out[0] > 2.9f * l.sun_rgb[0]);
}

static void test_air(void **state)
{
    (void)state;
    struct sv_light l = light_at(135, 40);
    float rgb[3] = {0.1f, 0.2f, 0.3f};
    sv_light_air(&l, 1e9, rgb);
    assert_true(rgb[0] == 0.1f && rgb[1] == 0.2f && rgb[2] == 0.3f); /* off by default */
    l.air = true;
    sv_light_air(&l, 0, rgb);
    assert_true(rgb[0] == 0.1f && rgb[1] == 0.2f && rgb[2] == 0.3f);
    float half[3] = {0.1f, 0.2f, 0.3f};
    sv_light_air(&l, (double)l.air_length_m * log(2), half);
    for (int c = 0; c < 3; c++)
        assert_true(fabsf(half[c] - 0.5f * (rgb[c] + l.air_rgb[c])) < 1e-6f);
    sv_light_air(&l, INFINITY, rgb);
    assert_true(rgb[0] == l.air_rgb[0] && rgb[1] == l.air_rgb[1] && rgb[2] == l.air_rgb[2]);
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(test_scale), cmocka_unit_test(test_direction),
                                       cmocka_unit_test(test_hours), cmocka_unit_test(test_tone), cmocka_unit_test(test_rules),
                                       cmocka_unit_test(test_sky),   cmocka_unit_test(test_disc),
                                       cmocka_unit_test(test_air)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
