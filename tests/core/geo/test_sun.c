/* The sun against published positions; refraction is not added, so published refracted figures are compared
 * less it. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <cmocka.h>

#include <math.h>
#include <stdio.h>

#include "core/base/rfc3339.h"
#include "core/base/vec.h"
#include "core/geo/geo.h"

static void position(const char *when, double lon, double lat, double *azimuth_deg, double *elevation_deg)
{
    double t;
    assert_int_equal(sv_rfc3339_parse(when, &t, NULL), SV_OK);
    sv_sun_position(t, lon, lat, azimuth_deg, elevation_deg);
    *azimuth_deg = sv_degrees(*azimuth_deg);
    *elevation_deg = sv_degrees(*elevation_deg);
}

static void near(const char *what, double got, double expected, double allowed)
{
    if (!(fabs(got - expected) <= allowed))
        fail_msg("%s: expected %.6f +- %g, got %.6f", what, expected, allowed, got);
}

/* Reda and Andreas 2004 (NREL/TP-560-34302), table A5.1: zenith 50.11162, azimuth 194.34024, of which
 * refraction 0.016332; before it, e0 = 39.872046. Our bound is that of the method: 0.01 deg. */
static void nrel_example(void **state)
{
    (void)state;
    double a, e;
    position("2003-10-17T12:30:30-07:00", -105.1786, 39.742476, &a, &e);
    near("azimuth", a, 194.34024, 0.01);
    near("elevation before refraction", e, 39.872046, 0.01);
    near("zenith with refraction", 90 - e, 50.11162, 0.02);
}

/* Meeus, Astronomical Algorithms, example 25.a and b: 1992 October 13.0 TD: alpha 198.38082 (low accuracy
 * 198.38083), delta -7.78507 deg. At the pole the elevation is the declination; TD - UT was 59 s then, the
 * sun's declination moves by 0.0003 deg in it. */
static void meeus_example(void **state)
{
    (void)state;
    double a, e;
    position("1992-10-13T00:00:00Z", 0, 90, &a, &e);
    near("declination", e, -7.78507 - 8.794 / 3600 * cos(sv_radians(7.785)), 0.005);
    position("1992-10-13T00:00:00Z", 0, -90, &a, &e);
    near("declination from the south pole", e, 7.78507 - 8.794 / 3600 * cos(sv_radians(7.785)), 0.005);
}

/* Solstices and equinoxes: the sun's declination is the obliquity (23.4393 - 0.0130 T) and zero at the
 * published instants (Meeus, table 27.D and E: June solstice 2000-06-21 01:47:43 TD, March equinox 2000-03-20
 * 07:35:14 TD, here less 64 s). */
static void seasons(void **state)
{
    (void)state;
    double a, e;
    position("2000-06-21T01:46:39Z", 10, 90, &a, &e);
    near("June solstice", e + 8.794 / 3600 * cos(sv_radians(23.44)), 23.4377, 0.004);
    position("2000-03-20T07:34:10Z", 10, 90, &a, &e);
    near("March equinox", e + 8.794 / 3600, 0, 0.005);
}

/* Noon: due south in the north, due north in the south, and highest there. */
static void sides(void **state)
{
    (void)state;
    double a, e, before, after;
    position("2024-06-20T06:00:00Z", 10, 47, &a, &e);
    assert_true(a > 60 && a < 120 && e > 0); /* morning: in the east */
    position("2024-06-20T18:00:00Z", 10, 47, &a, &e);
    assert_true(a > 240 && a < 310);
    position("2024-06-20T11:22:00Z", 10, 47, &a, &e);
    near("noon", a, 180, 1);
    position("2024-12-20T11:18:00Z", 10, -34, &a, &e);
    assert_true(a < 3 || a > 357);
    position("2024-12-20T11:00:00Z", 10, -34, &a, &before);
    position("2024-12-20T11:36:00Z", 10, -34, &a, &after);
    assert_true(e > before && e > after);
}

/* Longitudes a turn apart are the same place; a day has no jumps; odd numbers come back as NaN. */
static void extremes(void **state)
{
    (void)state;
    double a, e, b, f;
    sv_sun_position(1e9, -170, -77.8, &a, &e);
    sv_sun_position(1e9, 190, -77.8, &b, &f);
    near("a turn on", b, a, 1e-9);
    near("a turn on", f, e, 1e-9);
    for (int s = 0; s < 86400; s += 60) {
        sv_sun_position(1.7e9 + s, 0, 51.5, &a, &e);
        sv_sun_position(1.7e9 + s + 60, 0, 51.5, &b, &f);
        assert_true(a >= 0 && a <= 2 * SV_PI && fabs(e) <= SV_PI / 2);
        assert_true(fabs(f - e) < 0.005 && fabs(remainder(b - a, 2 * SV_PI)) < 0.02);
    }
    const double odd[] = {NAN, INFINITY, -INFINITY};
    for (int k = 0; k < 3; k++) {
        sv_sun_position(odd[k], 0, 0, &a, &e);
        assert_true(isnan(a) && isnan(e));
        sv_sun_position(0, odd[k], 0, &a, &e);
        assert_true(isnan(a) && isnan(e));
        sv_sun_position(0, 0, odd[k], &a, &e);
        assert_true(isnan(a) && isnan(e));
    }
    const double far[] = {-62135596800.0, 253402300799.0, 1e15, -0.0}; /* years 1 and 9999, and beyond */
    for (int k = 0; k < 4; k++) {
        sv_sun_position(far[k], 12, 48, &a, &e);
        assert_true(isfinite(a) && isfinite(e));
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(nrel_example), cmocka_unit_test(meeus_example), cmocka_unit_test(seasons),
        cmocka_unit_test(sides),        cmocka_unit_test(extremes),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
