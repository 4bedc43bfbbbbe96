/* Point in polygon against plain even-odd over all edges, and against shapes whose inside is known. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <cmocka.h>

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <cpl_vsi.h>

#include "core/base/rng.h"
#include "core/base/vec.h"
#include "tests/core/geo/synthetic.h"

#define PATH "/vsimem/stand.geojson"
#define UTM33 "\"crs\":{\"type\":\"name\",\"properties\":{\"name\":\"urn:ogc:def:crs:EPSG::32633\"}},"

static void write_features(const char *crs, const char *geometries)
{
    VSILFILE *f = VSIFOpenL(PATH, "wb");
    assert_non_null(f);
    const char *parts[] = {"{\"type\":\"FeatureCollection\",", crs,
                           "\"features\":[{\"type\":\"Feature\",\"properties\":{},\"geometry\":", geometries,
                           "}]}"};
    for (size_t k = 0; k < 5; k++)
        VSIFWriteL(parts[k], 1, strlen(parts[k]), f);
    VSIFCloseL(f);
}

static struct sv_crs *make(const char *text)
{
    struct sv_crs *crs = NULL;
    assert_int_equal(text ? sv_crs_create(text, &crs, NULL) : sv_crs_create_local(&crs, NULL), SV_OK);
    return crs;
}

static struct sv_polygons *read_polygons(const char *scene)
{
    struct sv_polygons *p = NULL;
    struct sv_error error = {0};
    struct sv_crs *crs = make(scene);
    if (sv_polygons_read(PATH, crs, &p, &error) != SV_OK)
        fail_msg("%s", error.message);
    sv_crs_destroy(crs);
    return p;
}

static void refused(const char *scene, enum sv_status expected, const char *word)
{
    struct sv_polygons *p = NULL;
    struct sv_error error = {0};
    struct sv_crs *crs = make(scene);
    enum sv_status status = sv_polygons_read(PATH, crs, &p, &error);
    if (status != expected || p || !strstr(error.message, word))
        fail_msg("expected \"%s\" and \"%s\", got \"%s\": %s", sv_status_text(expected), word,
                 sv_status_text(status), error.message);
    sv_crs_destroy(crs);
}

/* A square with a hole; a second one that overlaps the first; an island in the hole. */
static void holes_and_unions(void **state)
{
    (void)state;
    write_features(UTM33,
                   "{\"type\":\"MultiPolygon\",\"coordinates\":["
                   "[[[0,0],[100,0],[100,100],[0,100],[0,0]],[[20,20],[60,20],[60,60],[20,60],[20,20]]],"
                   "[[[80,80],[150,80],[150,150],[80,150],[80,80]]],"
                   "[[[30,30],[40,30],[40,40],[30,40],[30,30]]]]}");
    struct sv_polygons *p = read_polygons("EPSG:32633");
    static const struct {
        double x, y;
        bool in;
    } rows[] = {{10, 10, true},   {50, 50, false},  {35, 35, true},        {90, 90, true},
                {120, 120, true}, {70, 120, false}, {-1, 50, false},       {151, 90, false},
                {NAN, 50, false}, {50, NAN, false}, {10, INFINITY, false}, {-INFINITY, 1, false},
                {10, 20, true},   {10, 60, true},   {1e300, 1e300, false}};
    for (size_t k = 0; k < sizeof rows / sizeof rows[0]; k++)
        if (sv_polygons_contain(p, rows[k].x, rows[k].y) != rows[k].in)
            fail_msg("(%g, %g) should be %s", rows[k].x, rows[k].y, rows[k].in ? "inside" : "outside");
    double min[2], max[2];
    assert_true(sv_polygons_bounds(p, min, max));
    assert_true(min[0] == 0 && min[1] == 0 && max[0] == 150 && max[1] == 150);
    sv_polygons_destroy(p);
    VSIUnlink(PATH);
}

/* Neighbours that share a border, corners and all: every place of the whole belongs to exactly one. */
static void shared_borders(void **state)
{
    (void)state;
    struct sv_polygons *p[4];
    for (int k = 0; k < 4; k++) {
        char text[400];
        double x = 10 * (k % 2), y = 10 * (k / 2);
        snprintf(text, sizeof text,
                 "{\"type\":\"Polygon\",\"coordinates\":[[[%g,%g],[%g,%g],[%g,%g],[%g,%g],[%g,%g]]]}", x, y,
                 x + 10, y, x + 10, y + 10, x, y + 10, x, y);
        write_features(UTM33, text);
        p[k] = read_polygons("EPSG:32633");
    }
    for (double y = 0; y < 20; y += 1.25)
        for (double x = 0; x < 20; x += 1.25) {
            int count = 0;
            for (int k = 0; k < 4; k++)
                count += sv_polygons_contain(p[k], x, y);
            if (count != 1)
                fail_msg("(%g, %g) lies in %d of the four squares", x, y, count);
        }
    for (int k = 0; k < 4; k++)
        sv_polygons_destroy(p[k]);
    VSIUnlink(PATH);
}

enum { STAR = 2000 };

static bool even_odd(const double (*v)[2], double x, double y)
{
    bool in = false;
    for (int a = 0, b = STAR - 1; a < STAR; b = a++)
        if ((v[a][1] > y) != (v[b][1] > y) &&
            x < (v[b][0] - v[a][0]) * (y - v[a][1]) / (v[b][1] - v[a][1]) + v[a][0])
            in = !in;
    return in;
}

/* A jagged star of 2000 corners, at UTM coordinates: the same answer as the plain loop at 20,000 random
 * places. */
static void against_plain_loop(void **state)
{
    (void)state;
    static double v[STAR][2];
    struct sv_rng rng = sv_rng_seeded(11, 0);
    size_t room = STAR * 60 + 200, used = 0;
    char *text = malloc(room);
    assert_non_null(text);
    used += (size_t)snprintf(text, room, "{\"type\":\"Polygon\",\"coordinates\":[[");
    for (int k = 0; k <= STAR; k++) {
        if (k < STAR) {
            double a = 2 * SV_PI * k / STAR, r = sv_rng_range(&rng, 300, 1000);
            v[k][0] = floor((500000 + r * cos(a)) * 1024) / 1024; /* exact in text */
            v[k][1] = floor((5200000 + r * sin(a)) * 1024) / 1024;
        }
        used += (size_t)snprintf(text + used, room - used, "%s[%.10f,%.10f]", k ? "," : "", v[k % STAR][0],
                                 v[k % STAR][1]);
    }
    snprintf(text + used, room - used, "]]}");
    write_features(UTM33, text);
    free(text);
    struct sv_polygons *p = read_polygons("EPSG:32633");
    int inside = 0;
    for (int k = 0; k < 20000; k++) {
        double x = 500000 + sv_rng_range(&rng, -1100, 1100), y = 5200000 + sv_rng_range(&rng, -1100, 1100);
        bool in = even_odd((const double(*)[2])v, x, y);
        if (sv_polygons_contain(p, x, y) != in)
            fail_msg("seed 11, place %d: (%.9f, %.9f) should be %s", k, x, y, in ? "inside" : "outside");
        inside += in;
    }
    assert_in_range(inside, 3000, 12000);
    sv_polygons_destroy(p);
    VSIUnlink(PATH);
}

/* Two corners on the 60th parallel, 2 degrees apart: the straight line in degrees bulges 850 m to the south
 * of the chord in UTM (half of it by the chord's sag, L^2 tan(lat) / 8 R). A place 300 m inside the parallel
 * must be inside. */
static void long_edges(void **state)
{
    (void)state;
    write_features("",
                   "{\"type\":\"Polygon\",\"coordinates\":[[[14,60],[16,60],[16,60.5],[14,60.5],[14,60]]]}");
    struct sv_polygons *p = read_polygons("EPSG:32633");
    struct sv_crs *utm = make("EPSG:32633");
    for (double lon = 14.01; lon < 16; lon += 0.1) {
        static const struct {
            double lat;
            bool in;
        } rows[] = {{60.0001, true}, {59.9999, false}, {60.4999, true}, {60.5001, false}};
        for (int k = 0; k < 4; k++) {
            double x, y;
            assert_true(sv_crs_from_lonlat(utm, lon, rows[k].lat, &x, &y));
            assert_int_equal(sv_polygons_contain(p, x, y), rows[k].in);
        }
    }
    sv_crs_destroy(utm);
    sv_polygons_destroy(p);
    VSIUnlink(PATH);
}

static void odd_files(void **state)
{
    (void)state;
    refused(NULL, SV_ENOENT, "no such file");
    write_features("", "{\"type\":\"Point\",\"coordinates\":[1,2]}");
    refused(NULL, SV_EFORMAT, "no polygon");
    write_features("", "null");
    refused(NULL, SV_EFORMAT, "no polygon");
    write_features("", "{\"type\":\"Polygon\",\"coordinates\":[]}");
    refused(NULL, SV_EFORMAT, "no polygon");
    write_features(UTM33, "{\"type\":\"Polygon\",\"coordinates\":[[[0,0],[9,0],[9,9],[0,0]]]}");
    refused(NULL, SV_EUNSUPPORTED, "local");
    write_features("", "{\"type\":\"Polygon\",\"coordinates\":[[[0,0],[1e300,0],[1e300,1e300],[0,0]]]}");
    struct sv_polygons *p = read_polygons("EPSG:32633"); /* no degrees: metres, and huge */
    assert_false(sv_polygons_contain(p, -1, -1));
    assert_true(sv_polygons_contain(p, 9e299, 1e299));
    sv_polygons_destroy(p);
    /* plot metres in a local scene; a polygon without area; collections */
    write_features(
        "", "{\"type\":\"GeometryCollection\",\"geometries\":[{\"type\":\"Point\",\"coordinates\":[1,2]},"
            "{\"type\":\"Polygon\",\"coordinates\":[[[0,0],[50,0],[50,0],[0,0]]]},"
            "{\"type\":\"Polygon\",\"coordinates\":[[[0,0],[50,0],[50,50],[0,50],[0,0]]]}]}");
    p = read_polygons(NULL);
    assert_true(sv_polygons_contain(p, 25, 25) && !sv_polygons_contain(p, 51, 25));
    sv_polygons_destroy(p);
    sv_polygons_destroy(NULL);
    VSIUnlink(PATH);
}

static int set_up(void **state)
{
    (void)state;
    sv_geo_init();
    return 0;
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(holes_and_unions),   cmocka_unit_test(shared_borders),
        cmocka_unit_test(against_plain_loop), cmocka_unit_test(long_edges),
        cmocka_unit_test(odd_files),
    };
    return cmocka_run_group_tests(tests, set_up, NULL);
}
