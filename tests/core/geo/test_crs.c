/* Coordinate systems against published coordinates and closed forms. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <cmocka.h>

#include <math.h>
#include <stdio.h>
#include <string.h>
#include <sys/wait.h>
#include <unistd.h>

#include "core/base/vec.h"
#include "core/geo/crs.h"
#include "core/geo/geo.h"

static struct sv_crs *make(const char *text)
{
    struct sv_crs *crs = NULL;
    struct sv_error error = {0};
    if (sv_crs_create(text, &crs, &error) != SV_OK)
        fail_msg("%s: %s", text, error.message);
    return crs;
}

static void names(void **state)
{
    (void)state;
    struct sv_crs *utm = make("EPSG:32633"), *lonlat = make("WGS84"), *local = NULL;
    assert_string_equal(sv_crs_name(utm), "EPSG:32633");
    assert_int_equal(sv_crs_epsg(utm), 32633);
    assert_non_null(strstr(sv_crs_wkt(utm), "PROJCS[\"WGS 84 / UTM zone 33N\""));
    assert_false(sv_crs_is_geographic(utm));
    assert_true(sv_crs_is_geographic(lonlat));
    assert_int_equal(sv_crs_create_local(&local, NULL), SV_OK);
    assert_true(sv_crs_is_local(local));
    assert_string_equal(sv_crs_name(local), "local");
    assert_int_equal(sv_crs_epsg(local), 0);
    assert_string_equal(sv_crs_wkt(local), "");
    /* one that has no code itself, but is one that has */
    struct sv_crs *same = make("+proj=utm +zone=33 +datum=WGS84 +units=m +no_defs");
    assert_string_equal(sv_crs_name(same), "EPSG:32633");
    struct sv_crs *urn = make("urn:ogc:def:crs:EPSG::25832"), *wkt = make(sv_crs_wkt(utm));
    assert_string_equal(sv_crs_name(urn), "EPSG:25832");
    assert_string_equal(sv_crs_name(wkt), "EPSG:32633");
    /* a vertical part is dropped */
    struct sv_crs *compound = make("EPSG:25832+5783");
    assert_string_equal(sv_crs_name(compound), "EPSG:25832");
    struct sv_crs *mercator = make("+proj=merc +a=6378137 +b=6378137 +units=m +nadgrids=@null +no_defs");
    struct sv_crs *all[] = {utm, lonlat, local, same, urn, wkt, compound, mercator};
    for (size_t k = 0; k < sizeof all / sizeof all[0]; k++)
        sv_crs_destroy(all[k]);
    sv_crs_destroy(NULL);
}

/* A definition without a datum fits every system on its ellipsoid: one that is alone is meant, of two
 * neither. */
static void no_name_by_a_guess(void **state)
{
    (void)state;
    struct sv_crs *two =
        make("PROJCS[\"UTM Zone 25, Southern Hemisphere\",GEOGCS[\"GRS 1980\",DATUM[\"unknown\","
             "SPHEROID[\"GRS80\",6378137,298.257222101]],PRIMEM[\"Greenwich\",0],"
             "UNIT[\"degree\",0.0174532925199433]],PROJECTION[\"Transverse_Mercator\"],"
             "PARAMETER[\"latitude_of_origin\",0],PARAMETER[\"central_meridian\",-33],"
             "PARAMETER[\"scale_factor\",0.9996],PARAMETER[\"false_easting\",500000],"
             "PARAMETER[\"false_northing\",10000000],UNIT[\"metre\",1]]");
    assert_string_equal(sv_crs_name(two), "UTM Zone 25, Southern Hemisphere");
    assert_int_equal(sv_crs_epsg(two), 0);
    struct sv_crs *sirgas = make("EPSG:31985"); /* its numbers are the same, whatever its name */
    const double extent[4] = {288776, 9110729, 298723, 9120761};
    assert_true(sv_crs_agrees(two, sirgas, extent));
    sv_crs_destroy(two);
    two = make(
        "PROJCS[\"mine\",GEOGCS[\"SIRGAS 2000\",DATUM[\"Sistema_de_Referencia_Geocentrico_para_las_AmericaS_"
        "2000\",SPHEROID[\"GRS 1980\",6378137,298.257222101]],PRIMEM[\"Greenwich\",0],"
        "UNIT[\"degree\",0.0174532925199433]],PROJECTION[\"Transverse_Mercator\"],"
        "PARAMETER[\"latitude_of_origin\",0],PARAMETER[\"central_meridian\",-33],"
        "PARAMETER[\"scale_factor\",0.9996],PARAMETER[\"false_easting\",500000],"
        "PARAMETER[\"false_northing\",10000000],UNIT[\"metre\",1]]");
    assert_int_equal(sv_crs_epsg(two), 31985); /* its datum says which */
    sv_crs_destroy(two);
    sv_crs_destroy(sirgas);
}

static void refusals(void **state)
{
    (void)state;
    static const char *const bad[] = {
        "",
        "EPSG:999999",
        "nonsense",
        "/etc/passwd",
        "http://example.com/x.prj",
        "tests/core/geo/test_crs.c",
        "EPSG:5783" /* heights */,
        "EPSG:4978" /* geocentric */,
        "+proj=nothing",
        "PROJCS[",
        "{\"type\":",
        "file:/etc/passwd",
        "32633",
        "+proj=longlat +ellps=clrk66 +nadgrids=/dev/zero",
        "+proj=longlat +ellps=clrk66 +nadgrids=@../x",
        "+proj=utm +zone=33 +init=/etc/passwd:x",
    };
    for (size_t k = 0; k < sizeof bad / sizeof bad[0]; k++) {
        struct sv_crs *crs = (struct sv_crs *)&crs; /* must not be written */
        struct sv_error error = {0};
        enum sv_status status = sv_crs_create(bad[k], &crs, &error);
        if (status != SV_EINVAL || crs != (struct sv_crs *)&crs || !error.message[0])
            fail_msg("\"%s\": status %d, \"%s\"", bad[k], (int)status, error.message);
    }
}

static void near(const char *what, double got, double expected, double allowed)
{
    if (!(fabs(got - expected) <= allowed))
        fail_msg("%s: expected %.9g +- %g, got %.9g", what, expected, allowed, got);
}

/* The CN Tower, 43 38 33.24 N 79 23 13.7 W, is UTM 17 630084 4833438 (NGA's and many textbooks' example); and
 * OGP 373-7-2, 3.5.3.1 gives for the Transverse Mercator of the British grid: 50 30 N 0 30 E (OSGB 36) is E
 * 577274.99 N 69740.50. */
static void published_places(void **state)
{
    (void)state;
    struct sv_crs *utm = make("EPSG:32617");
    double x, y, lon, lat;
    assert_true(
        sv_crs_from_lonlat(utm, -(79 + 23 / 60.0 + 13.7 / 3600), 43 + 38 / 60.0 + 33.24 / 3600, &x, &y));
    near("easting", x, 630084, 1);
    near("northing", y, 4833438, 1);
    assert_true(sv_crs_to_lonlat(utm, x, y, &lon, &lat));
    near("longitude", lon, -(79 + 23 / 60.0 + 13.7 / 3600), 1e-9);
    struct sv_crs *grid = make("EPSG:27700"), *osgb = make("EPSG:4277");
    struct sv_crs_transform *t;
    assert_int_equal(sv_crs_transform_create(osgb, grid, &t, NULL), SV_OK);
    x = 0.5;
    y = 50.5;
    assert_true(sv_crs_transform_apply(t, &x, &y));
    near("easting", x, 577274.99, 0.01);
    near("northing", y, 69740.50, 0.01);
    sv_crs_transform_destroy(t);
    sv_crs_destroy(grid);
    sv_crs_destroy(osgb);
    sv_crs_destroy(utm);
}

/* EPSG:2193 (north first) and EPSG:4326 (latitude first) are taken easting and longitude first all the same.
 */
static void axis_order(void **state)
{
    (void)state;
    struct sv_crs *nztm = make("EPSG:2193");
    double lon, lat;
    assert_true(sv_crs_to_lonlat(nztm, 1802278, 5467393, &lon,
                                 &lat)); /* gdalinfo of the sample: 175d24'7.7"E 40d55'10.5"S */
    near("longitude", lon, 175.40214, 1e-4);
    near("latitude", lat, -40.91957, 1e-4);
    sv_crs_destroy(nztm);
}

static void no_change_is_exact(void **state)
{
    (void)state;
    struct sv_crs *a = make("EPSG:25832"), *b = make("EPSG:25832"), *local = NULL,
                  *other = make("EPSG:32633");
    struct sv_crs_transform *t;
    assert_int_equal(sv_crs_transform_create(a, b, &t, NULL), SV_OK);
    assert_true(sv_crs_transform_is_identity(t));
    double x = 123456.789012345, y = 5.1e6 + 1.0 / 3;
    const double x0 = x, y0 = y;
    assert_true(sv_crs_transform_apply(t, &x, &y));
    assert_true(x == x0 && y == y0);
    x = NAN;
    assert_false(sv_crs_transform_apply(t, &x, &y));
    sv_crs_transform_destroy(t);
    assert_int_equal(sv_crs_create_local(&local, NULL), SV_OK);
    struct sv_error error = {0};
    assert_int_equal(sv_crs_transform_create(local, a, &t, &error), SV_EUNSUPPORTED);
    assert_int_equal(sv_crs_transform_create(a, local, &t, &error), SV_EUNSUPPORTED);
    assert_int_equal(sv_crs_transform_create(local, local, &t, &error), SV_OK);
    assert_true(sv_crs_transform_apply(t, &y, &y));
    sv_crs_transform_destroy(t);
    /* neighbouring zones: there and back */
    struct sv_crs_transform *back;
    assert_int_equal(sv_crs_transform_create(other, a, &t, NULL), SV_OK);
    assert_int_equal(sv_crs_transform_create(a, other, &back, NULL), SV_OK);
    x = 166021.44;
    y = 5207294.3;
    double u = x, v = y;
    assert_true(sv_crs_transform_apply(t, &u, &v));
    assert_true(fabs(u - x) > 1e5);
    assert_true(sv_crs_transform_apply(back, &u, &v));
    near("x", u, x, 1e-4);
    near("y", v, y, 1e-4);
    u = INFINITY;
    assert_false(sv_crs_transform_apply(back, &u, &v));
    u = v = 1e300;
    double kept = u;
    if (!sv_crs_transform_apply(back, &u, &v))
        assert_true(u == kept && v == kept);
    sv_crs_transform_destroy(t);
    sv_crs_transform_destroy(back);
    sv_crs_destroy(a);
    sv_crs_destroy(b);
    sv_crs_destroy(other);
    sv_crs_destroy(local);
}

/* True north lies at -(lon - lon0) sin(lat) from grid north to first order in the distance from the meridian;
 * the next term is a third of (d lon)^3 sin cos^2: under 5e-5 rad at 3 degrees. At the pole of UPS north it
 * is minus the longitude, in the south plus. */
static void convergence(void **state)
{
    (void)state;
    static const struct {
        const char *crs;
        double lon0, lon, lat;
    } rows[] = {
        {"EPSG:32633", 15, 17.9, 47.2},  {"EPSG:32633", 15, 12.1, 68.0},  {"EPSG:32633", 15, 15, 50},
        {"EPSG:32734", 21, 18.4, -34.0}, {"EPSG:32760", 177, 179.9, -78}, {"EPSG:32632", 9, 10.5, 0.001},
    };
    for (size_t k = 0; k < sizeof rows / sizeof rows[0]; k++) {
        struct sv_crs *crs = make(rows[k].crs);
        double x, y, d = sv_radians(rows[k].lon - rows[k].lon0), phi = sv_radians(rows[k].lat);
        assert_true(sv_crs_from_lonlat(crs, rows[k].lon, rows[k].lat, &x, &y));
        near(rows[k].crs, sv_crs_convergence_rad(crs, x, y), -d * sin(phi), 6e-5);
        sv_crs_destroy(crs);
    }
    struct sv_crs *north = make("EPSG:5041"), *south = make("EPSG:5042"), *local = NULL;
    double x, y;
    assert_true(sv_crs_from_lonlat(north, 30, 88, &x, &y));
    near("UPS north", sv_crs_convergence_rad(north, x, y), -sv_radians(30), 1e-6);
    assert_true(sv_crs_from_lonlat(south, 30, -88, &x, &y));
    near("UPS south", sv_crs_convergence_rad(south, x, y), sv_radians(30), 1e-6);
    assert_true(isfinite(sv_crs_convergence_rad(north, 2000000, 2000000))); /* the pole itself */
    assert_int_equal(sv_crs_create_local(&local, NULL), SV_OK);
    assert_true(sv_crs_convergence_rad(local, 5, 5) == 0);
    assert_true(sv_crs_convergence_rad(north, NAN, 0) == 0);
    sv_crs_destroy(north);
    sv_crs_destroy(south);
    sv_crs_destroy(local);
}

/* US survey feet: 1200 / 3937 m. EPSG:2225 and EPSG:26941 are California zone 1 in feet and in metres. */
static void feet(void **state)
{
    (void)state;
    struct sv_crs *ft = make("EPSG:2225"), *m = make("EPSG:26941");
    near("unit", sv_crs_unit_m(ft), 1200.0 / 3937.0, 1e-12);
    near("unit", sv_crs_unit_m(m), 1, 0);
    struct sv_crs_transform *t;
    assert_int_equal(sv_crs_transform_create(ft, m, &t, NULL), SV_OK);
    double x = 6000000, y = 2000000;
    assert_true(sv_crs_transform_apply(t, &x, &y));
    near("x", x, 6000000 * 1200.0 / 3937.0, 1e-3);
    near("y", y, 2000000 * 1200.0 / 3937.0, 1e-3);
    sv_crs_transform_destroy(t);
    /* The code is that of the system in feet: metres must not go about under it (a GeoTIFF would lie 200 km
     * off). */
    struct sv_crs *turned = NULL;
    assert_int_equal(sv_crs_in_metres(ft, &turned, NULL), SV_OK);
    near("unit", sv_crs_unit_m(turned), 1, 0);
    assert_int_equal(sv_crs_epsg(ft), 2225);
    assert_true(sv_crs_epsg(turned) == 0 || sv_crs_epsg(turned) == 26941);
    sv_crs_destroy(turned);
    sv_crs_destroy(ft);
    sv_crs_destroy(m);
}

/* Systems may be made in a forked child, too: a worker does it for a request's crs. */
static void after_fork(void **state)
{
    (void)state;
    struct sv_crs *utm = make("EPSG:32633");
    pid_t child = fork();
    assert_true(child >= 0);
    if (child == 0) {
        struct sv_crs *other = NULL;
        struct sv_crs_transform *t = NULL;
        double x = 500000, y = 5.2e6, lon, lat;
        alarm(20); /* a hang fails the test */
        bool ok = sv_crs_create("EPSG:3035", &other, NULL) == SV_OK &&
                  sv_crs_transform_create(utm, other, &t, NULL) == SV_OK &&
                  sv_crs_transform_apply(t, &x, &y) && sv_crs_to_lonlat(utm, 500000, 5.2e6, &lon, &lat) &&
                  fabs(lon - 15) < 1e-9;
        _exit(ok ? 0 : 1);
    }
    int status = -1;
    assert_true(waitpid(child, &status, 0) == child);
    assert_int_equal(status, 0);
    sv_crs_destroy(utm);
}

static int set_up(void **state)
{
    (void)state;
    sv_geo_init();
    sv_geo_init();
    return 0;
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(names),       cmocka_unit_test(no_name_by_a_guess),
        cmocka_unit_test(refusals),    cmocka_unit_test(published_places),
        cmocka_unit_test(axis_order),  cmocka_unit_test(no_change_is_exact),
        cmocka_unit_test(convergence), cmocka_unit_test(feet),
        cmocka_unit_test(after_fork),
    };
    return cmocka_run_group_tests(tests, set_up, NULL);
}
