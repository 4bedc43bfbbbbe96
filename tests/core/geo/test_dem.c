/* Elevation from rasters made here, whose heights are known at every place: geometry, voids, units, systems,
 * limits. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <cmocka.h>

#include <fcntl.h>
#include <float.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cpl_vsi.h>

#include "core/base/vec.h"
#include "tests/core/geo/synthetic.h"

#define PATH "/vsimem/dem.tif"

struct dem {
    struct sv_arena *arena;
    struct sv_heightfield f;
    struct sv_crs *crs;
    struct sv_dem_report r;
};

static struct dem read_dem(const struct sv_dem_options *o)
{
    struct dem d = {.arena = synthetic_arena()};
    struct sv_error error = {0};
    if (sv_dem_read(o, d.arena, &d.f, &d.crs, &d.r, &error) != SV_OK)
        fail_msg("%s: %s", o->path, error.message);
    size_t n = (size_t)d.f.width * (size_t)d.f.height;
    assert_true(d.f.width >= 2 && d.f.height >= 2 && d.f.dx > 0 && d.f.dy > 0 && d.f.z0 == floor(d.f.z0));
    float lo = INFINITY, hi = -INFINITY;
    for (size_t k = 0; k < n; k++) {
        assert_true(isfinite(d.f.h[k]));
        lo = d.f.h[k] < lo ? d.f.h[k] : lo;
        hi = d.f.h[k] > hi ? d.f.h[k] : hi;
    }
    assert_true(lo == d.f.h_min && hi == d.f.h_max);
    return d;
}

static struct dem read_path(void)
{
    return read_dem(&(struct sv_dem_options){.path = PATH});
}

static void done(struct dem *d)
{
    sv_crs_destroy(d->crs);
    sv_arena_destroy(d->arena);
    synthetic_remove(PATH);
}

/* Expects a refusal with this status, whose text has this word in it. */
static void refused(const struct sv_dem_options *o, enum sv_status expected, const char *word)
{
    struct sv_arena *arena = synthetic_arena();
    struct sv_heightfield f;
    struct sv_crs *crs = NULL;
    struct sv_dem_report r;
    struct sv_error error = {0};
    enum sv_status status = sv_dem_read(o, arena, &f, &crs, &r, &error);
    if (status != expected || crs || !strstr(error.message, word))
        fail_msg("%s: expected \"%s\" and \"%s\", got \"%s\": %s", o->path, sv_status_text(expected), word,
                 sv_status_text(status), error.message);
    sv_arena_destroy(arena);
}

static void near(const char *what, double got, double expected, double allowed)
{
    if (!(fabs(got - expected) <= allowed))
        fail_msg("%s: expected %.9g +- %g, got %.9g", what, expected, allowed, got);
}

static double height(const struct dem *d, double x, double y)
{
    double z = NAN;
    if (!sv_heightfield_height(&d->f, x, y, &z))
        fail_msg("(%.3f, %.3f) lies outside the field", x, y);
    return z;
}

/* ---- geometry ---- */

static double numbered(void *context, int band, int i, int j)
{
    (void)context;
    return 100 * band + i + 0.125 * j;
}

static const double UTM_PLACE[6] = {500000, 30, 0, 5200000, 0, -20};

/* Samples are pixel centres, row 0 of the field is the file's last; heights come through to the bit. */
static void straight(void **state)
{
    (void)state;
    synthetic_write(
        &(struct synthetic){PATH, 7, 5, 1, GDT_Float32, UTM_PLACE, "EPSG:32632", .value = numbered});
    struct dem d = read_path();
    assert_int_equal(d.f.width, 7);
    assert_int_equal(d.f.height, 5);
    assert_true(d.f.x0 == 500015 && d.f.y0 == 5200000 - 4.5 * 20 && d.f.dx == 30 && d.f.dy == 20);
    for (int j = 0; j < 5; j++)
        for (int i = 0; i < 7; i++)
            assert_true(d.f.z0 + (double)d.f.h[j * 7 + i] == numbered(NULL, 1, i, 4 - j));
    assert_string_equal(sv_crs_name(d.crs), "EPSG:32632");
    assert_string_equal(d.r.driver, "GTiff");
    assert_null(d.r.warped);
    assert_true(d.r.source_width == 7 && d.r.source_height == 5 && d.r.voids == 0 && d.r.kept == 1);
    done(&d);
}

/* The same ground with rows from the south, columns from the east, or both, is the same field. */
static void flips(void **state)
{
    (void)state;
    synthetic_write(
        &(struct synthetic){PATH, 7, 5, 1, GDT_Float32, UTM_PLACE, "EPSG:32632", .value = numbered});
    struct dem a = read_path();
    const double x1 = 500000 + 7 * 30, y1 = 5200000 - 5 * 20;
    const double places[3][6] = {
        {500000, 30, 0, y1, 0, 20}, {x1, -30, 0, 5200000, 0, -20}, {x1, -30, 0, y1, 0, 20}};
    for (int k = 0; k < 3; k++) {
        synthetic_write(
            &(struct synthetic){PATH, 7, 5, 1, GDT_Float32, places[k], "EPSG:32632", .value = numbered});
        struct dem b = read_path();
        bool up = k != 1, west = k != 0;
        assert_true(b.f.x0 == a.f.x0 && b.f.y0 == a.f.y0 && b.f.dx == a.f.dx && b.f.dy == a.f.dy);
        for (int j = 0; j < 5; j++)
            for (int i = 0; i < 7; i++)
                assert_true(b.f.z0 + (double)b.f.h[j * 7 + i] ==
                            numbered(NULL, 1, west ? 6 - i : i, up ? j : 4 - j));
        done(&b);
    }
    done(&a);
}

static void one_sample(void **state)
{
    (void)state;
    static const int sizes[3][2] = {{1, 1}, {1, 4}, {4, 1}};
    for (int k = 0; k < 3; k++) {
        int w = sizes[k][0], h = sizes[k][1];
        synthetic_write(
            &(struct synthetic){PATH, w, h, 1, GDT_Int16, UTM_PLACE, "EPSG:32632", .value = numbered});
        struct dem d = read_path();
        assert_int_equal(d.f.width, w == 1 ? 2 : w);
        assert_int_equal(d.f.height, h == 1 ? 2 : h);
        /* a doubled axis covers exactly the pixel */
        if (w == 1) {
            near("west", d.f.x0, 500000, 1e-9);
            near("east", sv_heightfield_x1(&d.f), 500030, 1e-9);
        }
        if (h == 1) {
            near("south", d.f.y0, 5199980, 1e-9);
            near("north", sv_heightfield_y1(&d.f), 5200000, 1e-9);
        }
        near("height", height(&d, sv_heightfield_x1(&d.f), sv_heightfield_y1(&d.f)), 100 + w - 1, 1e-6);
        near("height", height(&d, d.f.x0, sv_heightfield_y1(&d.f)), 100, 1e-6);
        done(&d);
    }
}

static void cell_sizes(void **state)
{
    (void)state;
    static const double cells[] = {0.01, 1000, 1e-6, 1e5};
    for (size_t k = 0; k < 4; k++) {
        const double place[6] = {5, cells[k], 0, 7, 0, -cells[k]};
        synthetic_write(&(struct synthetic){PATH, 40, 30, 1, GDT_Float64, place, NULL, .value = numbered});
        struct dem d = read_path();
        near("dx", d.f.dx, cells[k], cells[k] * 1e-9);
        near("dy", d.f.dy, cells[k], cells[k] * 1e-9);
        assert_true(sv_crs_is_local(d.crs));
        assert_int_equal(d.r.looks_like_degrees,
                         cells[k] < 0.1); /* cannot be told apart from a small model: a hint, no more */
        done(&d);
    }
}

/* ---- voids ---- */

/* Heights 50 .. 59 with one odd value at each of the places (3 k + 1, 2). */
struct odd {
    double values[8];
};

static double with_odd(void *context, int band, int i, int j)
{
    (void)band;
    const struct odd *odd = context;
    if (j == 2 && i % 3 == 1 && i / 3 < 8)
        return odd->values[i / 3];
    return 50 + i % 10;
}

static void count_voids(GDALDataType type, const struct odd *odd, const char *nodata, const double *given,
                        uint64_t voids, uint64_t undeclared)
{
    const double place[6] = {0, 10, 0, 0, 0, -10};
    synthetic_write(&(struct synthetic){PATH, 24, 6, 1, type, place, "EPSG:25833", .nodata = nodata,
                                        .value = with_odd, .context = (void *)odd});
    struct sv_dem_options o = {.path = PATH, .has_nodata = given != NULL, .nodata = given ? *given : 0};
    struct dem d = read_dem(&o);
    if (d.r.voids != voids || d.r.voids_undeclared != undeclared)
        fail_msg("%s, nodata %s: expected %d voids, %d undeclared, got %d, %d", GDALGetDataTypeName(type),
                 nodata ? nodata : "none", (int)voids, (int)undeclared, (int)d.r.voids,
                 (int)d.r.voids_undeclared);
    double good_min = 50, good_max = 59;
    for (int k = 0; k < 8; k++)
        if (fabs(odd->values[k]) <= 12000 && odd->values[k] > -9000) {
            good_min = fmin(good_min, odd->values[k]);
            good_max = fmax(good_max, odd->values[k]);
        }
    near("lowest", d.f.z0 + (double)d.f.h_min, good_min, 10); /* a void may have taken the extreme */
    near("highest", d.f.z0 + (double)d.f.h_max, good_max, 10);
    done(&d);
}

static void odd_values(void **state)
{
    (void)state;
    const struct odd floats = {{NAN, INFINITY, -INFINITY, 1e30, -1e30, -32768, -9999, 12001}};
    count_voids(GDT_Float32, &floats, NULL, NULL, 8, 8);
    count_voids(GDT_Float64, &floats, NULL, NULL, 8, 8);
    count_voids(GDT_Float32, &floats, "nan", NULL, 8, 7);
    count_voids(GDT_Float32, &floats, "-9999", NULL, 8, 7);
    const double given = 12001;
    count_voids(GDT_Float32, &floats, "-9999", &given, 8, 6);
    /* what floats and doubles make of the same text; 12000 and negative heights are heights */
    const struct odd lowest = {{-3.4e38, (double)-FLT_MAX, 0, -1, 12000, -430, 54, 55}};
    count_voids(GDT_Float32, &lowest, "-3.4e38", NULL, 2, 1);
    count_voids(GDT_Float32, &lowest, "-3.4028235e+38", NULL, 2, 1);
    count_voids(GDT_Float64, &lowest, "-3.4e38", NULL, 2, 1);
    const double stated = -3.4e38;
    count_voids(GDT_Float32, &lowest, NULL, &stated, 2, 1);
    const struct odd shorts = {{-32768, -32767, -9999, 0, -1, 12000, 12001, 32767}};
    count_voids(GDT_Int16, &shorts, NULL, NULL, 5, 5);
    count_voids(GDT_Int16, &shorts, "-32768", NULL, 5, 4);
    count_voids(GDT_Int16, &shorts, "0", NULL, 6, 5); /* whoever declares 0 means it */
    const struct odd unsigneds = {{65535, 65534, 0, 12000, 12001, 52, 52, 52}};
    count_voids(GDT_UInt16, &unsigneds, "65535", NULL, 3, 2);
    count_voids(GDT_UInt16, &unsigneds, "-1", NULL, 3, 3);
    count_voids(GDT_Int32, &shorts, "-2147483648", NULL, 5, 5);
}

static double nothing(void *context, int band, int i, int j)
{
    (void)context;
    (void)band;
    return (i + j) % 2 ? -32768 : NAN;
}

static void all_void(void **state)
{
    (void)state;
    static const char *const systems[] = {"EPSG:32632", "EPSG:4326"};
    for (int k = 0; k < 2; k++) {
        const double utm[6] = {500000, 30, 0, 5200000, 0, -20}, degrees[6] = {10, 0.001, 0, 47, 0, -0.001};
        synthetic_write(&(struct synthetic){PATH, 30, 20, 1, GDT_Float32, k ? degrees : utm, systems[k],
                                            .value = nothing});
        struct dem d = read_path();
        assert_true(d.r.all_void);
        assert_int_equal(d.r.voids, 600);
        assert_true(d.f.z0 == 0 && d.f.h_min == 0 && d.f.h_max == 0);
        done(&d);
    }
}

static double masked(void *context, int band, int i, int j)
{
    (void)context;
    return band == 2 ? (i < 3 && j < 3 ? 0 : 255) : 40 + i + j;
}

/* A second band that is alpha hides samples, as declared voids. */
static void alpha_band(void **state)
{
    (void)state;
    synthetic_write(&(struct synthetic){PATH, 20, 10, 2, GDT_Byte, UTM_PLACE, "EPSG:32632", .value = masked});
    GDALDatasetH ds = GDALOpen(PATH, GA_Update);
    assert_non_null(ds);
    GDALSetRasterColorInterpretation(GDALGetRasterBand(ds, 2), GCI_AlphaBand);
    GDALClose(ds);
    struct dem d = read_path();
    assert_int_equal(d.r.voids, 9);
    assert_int_equal(d.r.voids_undeclared, 0);
    done(&d);
}

/* ---- units ---- */

static double constant(void *context, int band, int i, int j)
{
    (void)band;
    (void)i;
    (void)j;
    return *(const double *)context;
}

static void units(void **state)
{
    (void)state;
    double raw = 1000;
    static const struct {
        const char *unit;
        double scale, given, metres;
    } rows[] = {
        {NULL, 0, 0, 1000},  {"m", 0, 0, 1000},
        {"ft", 0, 0, 304.8}, {"US survey foot", 0, 0, 1000 * 1200.0 / 3937.0},
        {"ft", 0, 1, 1000},  {NULL, 0, 0.3048, 304.8},
        {NULL, 0.1, 0, 100}, {"ft", 0.1, 0, 30.48},
        {"cm", 0, 0, 10},    {"bananas", 0, 0, 1000},
    };
    for (size_t k = 0; k < sizeof rows / sizeof rows[0]; k++) {
        synthetic_write(&(struct synthetic){PATH, 4, 4, 1, GDT_Float64, UTM_PLACE, "EPSG:32632",
                                            .unit = rows[k].unit, .scale = rows[k].scale, .value = constant,
                                            .context = &raw});
        struct dem d = read_dem(&(struct sv_dem_options){.path = PATH, .height_unit_m = rows[k].given});
        near(rows[k].unit ? rows[k].unit : "no unit", d.f.z0 + (double)d.f.h[0], rows[k].metres, 1e-4);
        done(&d);
    }
    refused(&(struct sv_dem_options){.path = PATH, .height_unit_m = -1}, SV_EINVAL, "above 0");
    refused(&(struct sv_dem_options){.path = PATH, .height_unit_m = NAN}, SV_EINVAL, "above 0");
}

/* A projection in US survey feet becomes the same one in metres: EPSG:2225 -> EPSG:26941; the vertical unit
 * of a compound system counts. */
static void feet(void **state)
{
    (void)state;
    const double ft = 1200.0 / 3937.0, place[6] = {6000000, 100, 0, 2000000, 0, -50};
    double raw = 1000;
    synthetic_write(&(struct synthetic){PATH, 4, 4, 1, GDT_Float32, place, "EPSG:2225", .value = constant,
                                        .context = &raw});
    struct dem d = read_path();
    assert_string_equal(sv_crs_name(d.crs), "EPSG:2225, in metres");
    assert_true(sv_crs_unit_m(d.crs) == 1);
    struct sv_crs *metres = NULL;
    double lon[2], lat[2];
    assert_int_equal(sv_crs_create("EPSG:26941", &metres, NULL), SV_OK);
    assert_true(sv_crs_to_lonlat(metres, d.f.x0, d.f.y0, &lon[0], &lat[0]));
    assert_true(sv_crs_to_lonlat(d.crs, d.f.x0, d.f.y0, &lon[1], &lat[1]));
    near("longitude", lon[1], lon[0], 1e-8);
    near("latitude", lat[1], lat[0], 1e-8);
    sv_crs_destroy(metres);
    near("x0", d.f.x0, 6000050 * ft, 1e-6);
    near("y0", d.f.y0, (2000000 - 3.5 * 50) * ft, 1e-6);
    near("dx", d.f.dx, 100 * ft, 1e-9);
    near("height", d.f.z0 + (double)d.f.h[0], 1000, 1e-4);
    done(&d);
    synthetic_write(&(struct synthetic){PATH, 4, 4, 1, GDT_Float32, place, "EPSG:2225+6360",
                                        .value = constant, .context = &raw});
    d = read_path();
    near("height in survey feet", d.f.z0 + (double)d.f.h[0], 1000 * ft, 1e-4);
    done(&d);
}

/* ---- warping ---- */

/* Heights that are a gentle wave over the ground's own metres, wherever the raster's samples lie. */
struct ground {
    const double *place;
    struct sv_crs_transform *metres_from_raster;
    double turn;
};

static double wave(double x, double y)
{
    return 300 + 0.0005 * x + 40 * sin(x / 3000) * cos(y / 4000);
}

static double over_ground(void *context, int band, int i, int j)
{
    (void)band;
    const struct ground *g = context;
    const double *p = g->place;
    double x = p[0] + (i + 0.5) * p[1] + (j + 0.5) * p[2], y = p[3] + (i + 0.5) * p[4] + (j + 0.5) * p[5];
    if (!sv_crs_transform_apply(g->metres_from_raster, &x, &y))
        return -32768;
    return wave(x, y);
}

/* Writes `wave` of the system `metres` into a raster of the system `own`, reads it, and compares every sample
 * of the field. bound: the wave's curvature, 40 m / (3 km)^2, over half a cell's diagonal, twice over for
 * bilinear and for slack. */
static struct dem warp_and_compare(int width, int height_px, const double place[6], const char *own,
                                   const char *metres, double allowed)
{
    struct sv_crs *a = NULL, *b = NULL;
    if (own) {
        assert_int_equal(sv_crs_create(own, &a, NULL), SV_OK);
        assert_int_equal(sv_crs_create(metres, &b, NULL), SV_OK);
    } else {
        assert_int_equal(sv_crs_create_local(&a, NULL), SV_OK);
        assert_int_equal(sv_crs_create_local(&b, NULL), SV_OK);
    }
    struct ground g = {.place = place};
    assert_int_equal(sv_crs_transform_create(a, b, &g.metres_from_raster, NULL), SV_OK);
    synthetic_write(&(struct synthetic){PATH, width, height_px, 1, GDT_Float64, place, own,
                                        .value = over_ground, .context = &g});
    struct dem d = read_path();
    assert_string_equal(sv_crs_name(d.crs), sv_crs_name(b));
    assert_int_equal(d.r.voids, 0);
    for (int j = 0; j < d.f.height; j++)
        for (int i = 0; i < d.f.width; i++) {
            double x = d.f.x0 + i * d.f.dx, y = d.f.y0 + j * d.f.dy;
            double off = fabs(d.f.z0 + (double)d.f.h[(size_t)j * (size_t)d.f.width + (size_t)i] - wave(x, y));
            if (d.r.edge_filled == 0 && !(off <= allowed))
                fail_msg("%s: sample (%d, %d) of %d x %d off by %g m", own ? own : "local", i, j, d.f.width,
                         d.f.height, off);
        }
    sv_crs_transform_destroy(g.metres_from_raster);
    sv_crs_destroy(a);
    sv_crs_destroy(b);
    return d;
}

static void degrees(void **state)
{
    (void)state;
    static const struct {
        double lon, lat, cell;
        const char *utm;
        double kept;
    } rows[] = {
        {10.5, 47.2, 1.0 / 1200, "EPSG:32632", 0.95},
        {-78.1, 38.9, 1.0 / 1200, "EPSG:32617", 0.9},
        {18.4, -34.0, 1.0 / 1200, "EPSG:32734", 0.9},
        {5.3, 60.4, 1.0 / 1200, "EPSG:32632", 0.85} /* zone 32 reaches out to Bergen */,
        {179.95, -17, 1.0 / 1200, "EPSG:32760", 0.9} /* across the antimeridian */,
        {10, 0, 1.0 / 1200, "EPSG:32632", 0.99},
        {15, 83.5, 1.0 / 1200, "EPSG:32633", 0.9},
        {0, 85, 1.0 / 1200, "EPSG:5041", 0.9},
        {-150, -81, 1.0 / 600, "EPSG:5042", 0.6},
    };
    for (size_t k = 0; k < sizeof rows / sizeof rows[0]; k++) {
        const double c = rows[k].cell, place[6] = {rows[k].lon - 120 * c, c, 0, rows[k].lat + 100 * c, 0, -c};
        struct dem d = warp_and_compare(240, 200, place, "EPSG:4326", rows[k].utm, 0.3);
        assert_string_equal(d.r.warped, "geographic");
        assert_true(d.r.was_geographic);
        if (d.r.edge_filled == 0 && d.r.kept < rows[k].kept)
            fail_msg("%s: kept %g of the area only", rows[k].utm, d.r.kept);
        near("square cells", d.f.dx / d.f.dy, 1, 0.02);
        done(&d);
    }
}

/* The whole cap round the south pole, 360 degrees of it: no seam at 180 degrees, no hole at the pole. */
static void pole(void **state)
{
    (void)state;
    const double place[6] = {-180, 0.25, 0, -88.5, 0, -1.0 / 240};
    struct dem d = warp_and_compare(1440, 360, place, "EPSG:4326", "EPSG:5042", 0.6);
    double x, y;
    assert_int_equal(d.r.edge_filled, 0);
    assert_true(sv_crs_from_lonlat(d.crs, 0, -90, &x, &y));
    near("the pole", height(&d, x, y), wave(x, y), 3);
    done(&d);
}

static void rotated(void **state)
{
    (void)state;
    static const double turns[] = {1, 12, 45, 90, 200};
    for (size_t k = 0; k < 5; k++) {
        double a = sv_radians(turns[k]), c = 25 * cos(a), s = 25 * sin(a);
        const double place[6] = {500000, c, s, 5200000, s, -c};
        struct dem d = warp_and_compare(200, 150, place, "EPSG:32632", "EPSG:32632", 0.05);
        assert_string_equal(d.r.warped, "rotated");
        near("cell", d.f.dx, 25, 0.3);
        if (turns[k] < 2 || turns[k] == 90)
            assert_true(d.r.edge_filled == 0 && d.r.kept > 0.95);
        done(&d);
        struct dem local = warp_and_compare(200, 150, place, NULL, NULL, 0.05);
        done(&local);
    }
    /* a narrow strip askew: enclosed, its wedges counted, all finite */
    const double strip[6] = {500000, 20, 20, 5200000, 20, -20};
    synthetic_write(
        &(struct synthetic){PATH, 300, 10, 1, GDT_Float32, strip, "EPSG:32632", .value = numbered});
    struct dem d = read_path();
    assert_true(d.r.edge_filled > 0 && d.r.edge_filled < (uint64_t)d.f.width * (uint64_t)d.f.height);
    done(&d);
    /* one sample, turned */
    synthetic_write(&(struct synthetic){PATH, 1, 1, 1, GDT_Float32, strip, "EPSG:32632", .value = numbered});
    d = read_path();
    near("height", d.f.z0 + (double)d.f.h[0], 100, 1e-6);
    done(&d);
}

/* Web Mercator's metres are no metres at 60 degrees north; southing and westing are no northing and easting.
 */
static void odd_projections(void **state)
{
    (void)state;
    const double mercator[6] = {1200000, 100, 0, 8400000, 0, -100};
    struct dem d = warp_and_compare(200, 150, mercator, "EPSG:3857", "EPSG:32632", 0.2);
    assert_string_equal(d.r.warped, "scale");
    near("a cell on the ground", d.f.dx, 50, 1);
    done(&d);
    /* Hartebeesthoek94 / Lo19: first coordinate to the west, second to the south */
    const double lo19[6] = {50000, -30, 0, 3760000, 0, 30};
    d = warp_and_compare(200, 150, lo19, "EPSG:2048", "EPSG:32734", 0.2);
    assert_string_equal(d.r.warped, "axes");
    done(&d);
    /* UTM past its zone, LAEA Europe: taken as they are */
    const double far[6] = {900000, 30, 0, 5200000, 0, -30}, laea[6] = {4300000, 30, 0, 3000000, 0, -30};
    d = warp_and_compare(20, 15, far, "EPSG:32632", "EPSG:32632", 1e-3);
    assert_null(d.r.warped);
    done(&d);
    d = warp_and_compare(20, 15, laea, "EPSG:3035", "EPSG:3035", 1e-3);
    assert_null(d.r.warped);
    done(&d);
}

/* ---- systems given, refusals ---- */

static void given_crs(void **state)
{
    (void)state;
    synthetic_write(&(struct synthetic){PATH, 7, 5, 1, GDT_Float32, UTM_PLACE, NULL, .value = numbered});
    struct dem d = read_dem(&(struct sv_dem_options){.path = PATH, .crs = "EPSG:32632"});
    assert_string_equal(sv_crs_name(d.crs), "EPSG:32632");
    sv_crs_destroy(d.crs);
    sv_arena_destroy(d.arena);
    const double degree_place[6] = {10, 0.001, 0, 47, 0, -0.001};
    synthetic_write(&(struct synthetic){PATH, 70, 50, 1, GDT_Float32, degree_place, NULL, .value = numbered});
    d = read_path();
    assert_true(d.r.looks_like_degrees);
    sv_crs_destroy(d.crs);
    sv_arena_destroy(d.arena);
    d = read_dem(&(struct sv_dem_options){.path = PATH, .crs = "EPSG:4326"});
    assert_string_equal(d.r.warped, "geographic");
    assert_false(d.r.looks_like_degrees);
    sv_crs_destroy(d.crs);
    sv_arena_destroy(d.arena);
    synthetic_write(
        &(struct synthetic){PATH, 7, 5, 1, GDT_Float32, UTM_PLACE, "EPSG:32632", .value = numbered});
    refused(&(struct sv_dem_options){.path = PATH, .crs = "EPSG:32633"}, SV_EINVAL, "EPSG:32633");
    refused(&(struct sv_dem_options){.path = PATH, .crs = "EPSG:4326"}, SV_EINVAL, "EPSG:4326");
    refused(&(struct sv_dem_options){.path = PATH, .crs = "moon"}, SV_EINVAL, "moon");
    d = read_dem(
        &(struct sv_dem_options){.path = PATH, .crs = "EPSG:25832"}); /* ETRS89: the same within a metre */
    done(&d);
}

static void no_georeference(void **state)
{
    (void)state;
    synthetic_write(&(struct synthetic){PATH, 7, 5, 1, GDT_Byte, NULL, NULL, .value = numbered});
    struct dem d = read_path();
    assert_true(d.f.x0 == 0.5 && d.f.y0 == 0.5 && d.f.dx == 1 && d.f.dy == 1 && !d.r.looks_like_degrees);
    near("south-west", d.f.z0 + (double)d.f.h[0], 100.5, 0.6); /* bytes: 100.5 rounds */
    sv_crs_destroy(d.crs);
    sv_arena_destroy(d.arena);
    refused(&(struct sv_dem_options){.path = PATH, .crs = "EPSG:32632"}, SV_EFORMAT, "no place");
    synthetic_remove(PATH);
}

static void limits(void **state)
{
    (void)state;
    synthetic_write(
        &(struct synthetic){PATH, 20000, 10, 1, GDT_Byte, UTM_PLACE, "EPSG:32632", .value = NULL});
    refused(&(struct sv_dem_options){.path = PATH}, SV_ELIMIT, "20000 x 10");
    synthetic_write(
        &(struct synthetic){PATH, 16000, 16000, 1, GDT_Float32, UTM_PLACE, "EPSG:32632", .value = NULL});
    refused(&(struct sv_dem_options){.path = PATH}, SV_ELIMIT, "67108864");
    const double world[6] = {-180, 1, 0, 90, 0, -1}, wide[6] = {0, 0.5, 0, 5, 0, -0.5};
    synthetic_write(&(struct synthetic){PATH, 360, 180, 1, GDT_Int16, world, "EPSG:4326", .value = NULL});
    refused(&(struct sv_dem_options){.path = PATH}, SV_ELIMIT, "degrees");
    synthetic_write(&(struct synthetic){PATH, 100, 20, 1, GDT_Int16, wide, "EPSG:4326", .value = NULL});
    refused(&(struct sv_dem_options){.path = PATH}, SV_ELIMIT, "degrees");
    /* a legal file whose field would not be: a strip of 2 x 16000 samples, turned by 45 degrees */
    const double strip[6] = {500000, 20, 20, 5200000, 20, -20};
    synthetic_write(&(struct synthetic){PATH, 16000, 2, 1, GDT_Int16, strip, "EPSG:32632", .value = NULL});
    refused(&(struct sv_dem_options){.path = PATH}, SV_ELIMIT, "laid flat");
    synthetic_remove(PATH);
}

static void write_text(const char *path, const char *text, size_t bytes)
{
    VSILFILE *f = VSIFOpenL(path, "wb");
    assert_non_null(f);
    assert_int_equal(VSIFWriteL(text, 1, bytes, f), bytes);
    VSIFCloseL(f);
}

/* Runs with standard error in a file, which must stay empty: GDAL prints nothing of its own. */
static void bad_files(void **state)
{
    (void)state;
    char name[] = "/tmp/sv_test_dem_XXXXXX";
    int file = mkstemp(name), kept = dup(2);
    assert_true(file >= 0 && kept >= 0);
    dup2(file, 2);
    refused(&(struct sv_dem_options){.path = "/vsimem/nothing.tif"}, SV_ENOENT, "no such file");
    refused(&(struct sv_dem_options){.path = "/nowhere/dem.tif"}, SV_ENOENT, "/nowhere/dem.tif");
    refused(&(struct sv_dem_options){.path = ""}, SV_ENOENT, "no such file");
    write_text(PATH, "hello", 5);
    refused(&(struct sv_dem_options){.path = PATH}, SV_EFORMAT, "not a raster");
    const double flat[6] = {0, 1, 0, 0, 1e-320, 0}, mad[6] = {0, 1e300, 0, 0, 0, -1e300};
    synthetic_write(&(struct synthetic){PATH, 9, 9, 1, GDT_Int16, mad, "EPSG:4326", .value = NULL});
    refused(&(struct sv_dem_options){.path = PATH}, SV_EFORMAT, "");
    const double beyond[6] = {0, 0.01, 0, 120, 0, -0.01};
    synthetic_write(&(struct synthetic){PATH, 9, 9, 1, GDT_Int16, beyond, "EPSG:4326", .value = NULL});
    refused(&(struct sv_dem_options){.path = PATH}, SV_EFORMAT, "no place");
    (void)flat;
    /* breaks off in the middle of its heights */
    synthetic_write(
        &(struct synthetic){PATH, 300, 300, 1, GDT_Float64, UTM_PLACE, "EPSG:32632", .value = numbered});
    vsi_l_offset size;
    GByte *bytes = VSIGetMemFileBuffer(PATH, &size, FALSE);
    char *half = malloc(size);
    assert_non_null(half);
    memcpy(half, bytes, size);
    write_text("/vsimem/half.tif", half, size / 2);
    free(half);
    refused(&(struct sv_dem_options){.path = "/vsimem/half.tif"}, SV_EIO, "/vsimem/half.tif");
    VSIUnlink("/vsimem/half.tif");
    synthetic_remove(PATH);
    dup2(kept, 2);
    close(kept);
    struct stat info;
    assert_int_equal(fstat(file, &info), 0);
    close(file);
    unlink(name);
    assert_int_equal(info.st_size, 0);
}

/* ---- a large one ---- */

static double hills(void *context, int band, int i, int j)
{
    (void)context;
    (void)band;
    if (i + j < 800)
        return -32768; /* a corner of 320,000 voids */
    return 800 + 200 * sin(i * 0.02) * cos(j * 0.03) + (i * 7 + j * 13) % 5;
}

/* Voids of a third of a large grid: filled, and within a few seconds even under a sanitizer; the test's
 * time-out is the bound. */
static void many_voids(void **state)
{
    (void)state;
    synthetic_write(
        &(struct synthetic){PATH, 1000, 1000, 1, GDT_Int16, UTM_PLACE, "EPSG:32632", .value = hills});
    struct dem d = read_path();
    assert_int_equal(d.r.voids, 320400);
    assert_int_equal(d.r.voids_undeclared, 320400);
    assert_int_equal(d.r.void_regions, 1);
    assert_int_equal(d.r.voids_flat, 0); /* its rim goes up and down */
    assert_true(d.f.z0 + (double)d.f.h_min >= 599 && d.f.z0 + (double)d.f.h_max <= 1005);
    done(&d);
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
        cmocka_unit_test(straight),        cmocka_unit_test(flips),      cmocka_unit_test(one_sample),
        cmocka_unit_test(cell_sizes),      cmocka_unit_test(odd_values), cmocka_unit_test(all_void),
        cmocka_unit_test(alpha_band),      cmocka_unit_test(units),      cmocka_unit_test(feet),
        cmocka_unit_test(degrees),         cmocka_unit_test(pole),       cmocka_unit_test(rotated),
        cmocka_unit_test(odd_projections), cmocka_unit_test(given_crs),  cmocka_unit_test(no_georeference),
        cmocka_unit_test(limits),          cmocka_unit_test(bad_files),  cmocka_unit_test(many_voids),
    };
    return cmocka_run_group_tests(tests, set_up, NULL);
}
