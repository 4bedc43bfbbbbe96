/* The real inputs, when they are there: each loads, with the figures that are known of it. Skipped without
 * them. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <cmocka.h>

#include <dirent.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "core/base/rng.h"
#include "core/base/vec.h"
#include "tests/core/geo/synthetic.h"

struct dem {
    struct sv_arena *arena;
    struct sv_heightfield f;
    struct sv_crs *crs;
    struct sv_dem_report r;
};

static const char *data(const char *name)
{
    const char *path = synthetic_data(name);
    if (!path)
        skip();
    return path;
}

static struct dem read_dem(const char *name)
{
    struct sv_dem_options o = {.path = data(name)}; /* or the test ends here: before anything is made */
    struct dem d = {.arena = synthetic_arena()};
    struct sv_error error = {0};
    if (sv_dem_read(&o, d.arena, &d.f, &d.crs, &d.r, &error) != SV_OK)
        fail_msg("%s", error.message);
    for (size_t k = 0; k < (size_t)d.f.width * (size_t)d.f.height; k++)
        assert_true(isfinite(d.f.h[k]));
    return d;
}

static void done(struct dem *d)
{
    sv_crs_destroy(d->crs);
    sv_arena_destroy(d->arena);
}

static const float *nearest(const struct dem *d, double x, double y)
{
    double i = floor((x - d->f.x0) / d->f.dx + 0.5), j = floor((y - d->f.y0) / d->f.dy + 0.5);
    return i >= 0 && j >= 0 && i < d->f.width && j < d->f.height ? &d->f.h[(int)j * d->f.width + (int)i]
                                                                 : NULL;
}

static double z_of(const struct dem *d, const float *h)
{
    return d->f.z0 + (double)*h;
}

/* Figures from the data's own description and from gdalinfo; lo and hi of warped files are looser by what
 * interpolation takes off. */
static void elevations(void **state)
{
    (void)state;
    static const struct {
        const char *name, *driver, *crs, *warped;
        int width, height;
        uint64_t voids;
        double lo, hi, slack;
    } rows[] = {
        {"dem/zion_srtm3_4326.tif", "GTiff", "EPSG:32612", "geographic", 465, 457, 0, 1024, 2892, 60},
        {"dem/N00E010.hgt", "SRTMHGT", "EPSG:32632", "geographic", 1201, 1201, 0, 1, 1005, 12},
        {"dem/gabon_N00E010_utm32n.tif", "GTiff", "EPSG:32632", NULL, 1205, 1197, 112, 1, 1005, 0},
        {"dem/capetown_srtm3_sea_voids_4326.tif", "GTiff", "EPSG:32734", "geographic", 723, 1105, 311658, -28,
         1077, 10},
        {"dem/eno_third_arcsec_nad83.tif", "GTiff", "EPSG:32617", "geographic", 715, 844, 0, 178.0, 241.2, 1},
        {"dem/pycrown_dtm_1m_nztm.tif", "GTiff", "EPSG:2193", NULL, 278, 195, 0, 454.8, 666.1, 0.1},
        {"dem/pycrown_dsm_1m_nztm.tif", "GTiff", "EPSG:2193", NULL, 278, 195, 0, 460.6, 690.4, 0.1},
        {"dem/scbi_10m_utm17n.tif", "GTiff", "EPSG:26917", NULL, 75, 97, 0, 262, 364, 0},
        {"dem/bei_elev_5m_local.tif", "GTiff", "local", NULL, 201, 101, 0, 119.81, 159.48, 0.01},
        /* fits SIRGAS 1995 and 2000 alike, so that neither code is its name */
        {"dem/olinda_srtm_utm25s.tif", "GTiff", "UTM Zone 25, Southern Hemisphere", NULL, 111, 111, 0, -1, 88,
         0},
        {"dem/vinschgau_250m_utm32n.tif", "GTiff", "EPSG:32632", NULL, 252, 194, 445, 388, 3863, 0},
    };
    for (size_t k = 0; k < sizeof rows / sizeof rows[0]; k++) {
        struct dem d = read_dem(rows[k].name);
        const struct sv_dem_report *r = &d.r;
        double lo = d.f.z0 + (double)d.f.h_min, hi = d.f.z0 + (double)d.f.h_max;
        bool ok = !strcmp(r->driver, rows[k].driver) && r->source_width == rows[k].width &&
                  r->source_height == rows[k].height && r->voids == rows[k].voids &&
                  r->voids_undeclared == 0 && !r->all_void && !r->looks_like_degrees &&
                  r->height_unit_m == 1 && r->edge_filled == 0 && r->kept > 0.93;
        ok = ok && (rows[k].crs == NULL || !strcmp(sv_crs_name(d.crs), rows[k].crs));
        ok = ok && (r->warped ? rows[k].warped && !strcmp(r->warped, rows[k].warped) : !rows[k].warped);
        ok = ok && fabs(lo - rows[k].lo) <= rows[k].slack + 1e-3 &&
             fabs(hi - rows[k].hi) <= rows[k].slack + 1e-3;
        if (!ok)
            fail_msg("%s: %s, %s, warped %s, %d x %d, %llu voids, %g .. %g m, kept %g", rows[k].name,
                     r->driver, sv_crs_name(d.crs), r->warped ? r->warped : "no", r->source_width,
                     r->source_height, (unsigned long long)r->voids, lo, hi, r->kept);
        done(&d);
    }
}

/* Samples are pixel centres: the plot's samples are at 0, 5, .. 1000 m. */
static void plot_of_bci(void **state)
{
    (void)state;
    struct dem d = read_dem("dem/bei_elev_5m_local.tif");
    assert_true(d.f.x0 == 0 && d.f.y0 == 0 && d.f.dx == 5 && d.f.dy == 5 && sv_heightfield_x1(&d.f) == 1000 &&
                sv_heightfield_y1(&d.f) == 500);
    done(&d);
}

/* The same ground in degrees and, resampled by others, in UTM. Each side interpolates between 92 m samples of
 * rough ground. */
static void gabon_twice(void **state)
{
    (void)state;
    struct dem a = read_dem("dem/N00E010.hgt"), b = read_dem("dem/gabon_N00E010_utm32n.tif");
    struct sv_rng rng = sv_rng_seeded(3, 0);
    double sum = 0, sum_shifted = 0, worst = 0;
    enum { N = 20000 };
    for (int k = 0; k < N; k++) {
        double x = sv_rng_range(&rng, a.f.x0 + 500, sv_heightfield_x1(&a.f) - 500);
        double y = sv_rng_range(&rng, a.f.y0 + 500, sv_heightfield_y1(&a.f) - 500);
        double za = NAN, zb = NAN, zc = NAN;
        assert_true(sv_heightfield_height(&a.f, x, y, &za) && sv_heightfield_height(&b.f, x, y, &zb) &&
                    sv_heightfield_height(&b.f, x + 46, y + 46, &zc));
        sum += fabs(za - zb);
        sum_shifted += fabs(za - zc);
        worst = fmax(worst, fabs(za - zb));
    }
    if (sum / N > 4 || worst > 80 || sum > 0.7 * sum_shifted)
        fail_msg("mean difference %g m (%g when shifted by half a cell), worst %g m", sum / N,
                 sum_shifted / N, worst);
    done(&a);
    done(&b);
}

/* ---- Cape Town, void by void ---- */

struct raw {
    int width, height;
    double place[6];
    int16_t *z;
};

static struct raw read_raw(const char *path)
{
    struct raw r;
    GDALDatasetH ds = GDALOpen(path, GA_ReadOnly);
    assert_non_null(ds);
    r.width = GDALGetRasterXSize(ds);
    r.height = GDALGetRasterYSize(ds);
    assert_int_equal(GDALGetGeoTransform(ds, r.place), CE_None);
    r.z = malloc((size_t)r.width * (size_t)r.height * sizeof *r.z);
    assert_non_null(r.z);
    assert_int_equal(GDALRasterIO(GDALGetRasterBand(ds, 1), GF_Read, 0, 0, r.width, r.height, r.z, r.width,
                                  r.height, GDT_Int16, 0, 0),
                     CE_None);
    GDALClose(ds);
    return r;
}

/* Floods the voids around (i, j), 4-connected, marking them -30000; counts them and finds the rim's range;
 * true if the border is met. */
static bool flood(struct raw *r, int i, int j, int *stack, int *cells, int *lo, int *hi)
{
    bool border = false;
    int top = 0;
    *cells = 0;
    *lo = 32767;
    *hi = -32768;
    stack[top++] = j * r->width + i;
    r->z[j * r->width + i] = -30000;
    while (top > 0) {
        int at = stack[--top], x = at % r->width, y = at / r->width;
        (*cells)++;
        static const int dx[4] = {-1, 1, 0, 0}, dy[4] = {0, 0, -1, 1};
        for (int k = 0; k < 4; k++) {
            int u = x + dx[k], v = y + dy[k];
            if (u < 0 || v < 0 || u >= r->width || v >= r->height) {
                border = true;
                continue;
            }
            int16_t *z = &r->z[v * r->width + u];
            if (*z == -32768) {
                *z = -30000;
                stack[top++] = v * r->width + u;
            } else if (*z != -30000) {
                *lo = *z < *lo ? *z : *lo;
                *hi = *z > *hi ? *z : *hi;
            }
        }
    }
    return border;
}

static void cape_town(void **state)
{
    (void)state;
    struct dem d = read_dem("dem/capetown_srtm3_sea_voids_4326.tif");
    struct raw raw = read_raw(data("dem/capetown_srtm3_sea_voids_4326.tif"));
    int *stack = malloc((size_t)raw.width * (size_t)raw.height * sizeof *stack), holes = 0, sea_checked = 0;
    assert_non_null(stack);
    for (int j = 0; j < raw.height; j++)
        for (int i = 0; i < raw.width; i++) {
            if (raw.z[j * raw.width + i] != -32768)
                continue;
            int cells, lo, hi;
            bool border = flood(&raw, i, j, stack, &cells, &lo, &hi);
            double lon = raw.place[0] + (i + 0.5) * raw.place[1],
                   lat = raw.place[3] + (j + 0.5) * raw.place[5], x, y, z;
            assert_true(sv_crs_from_lonlat(d.crs, lon, lat, &x, &y));
            bool in_field = sv_heightfield_height(&d.f, x, y, &z);
            if (!border) {
                holes++;
                assert_in_range(cells, 1, 21);
                assert_true(in_field);
                /* the first cell of a hole is surrounded by its rim and by what was made of it */
                assert_true(z >= lo - 5 && z <= hi + 5);
            }
        }
    assert_int_equal(holes, 9);
    assert_true(d.r.voids_flat > 311000 && d.r.flat_level_m >= -5 && d.r.flat_level_m <= 5);
    /* out at sea it is as flat as a board */
    for (double lat = -34.3; lat < -33.6; lat += 0.05) {
        double x, y, z;
        assert_true(sv_crs_from_lonlat(d.crs, 18.29, lat, &x, &y));
        if (sv_heightfield_height(&d.f, x, y, &z)) {
            assert_true(fabs(z - d.r.flat_level_m) < 1e-3);
            sea_checked++;
        }
    }
    assert_true(sea_checked > 5);
    /* Table Mountain is where it is, and 1,085 m high (SRTM rounds it off a little) */
    double x, y, top = 0;
    assert_true(sv_crs_from_lonlat(d.crs, 18.4098, -33.9675, &x, &y));
    for (int k = -5; k <= 5; k++)
        for (int l = -5; l <= 5; l++) {
            const float *h = nearest(&d, x + k * d.f.dx, y + l * d.f.dy);
            assert_non_null(h);
            top = fmax(top, z_of(&d, h));
        }
    assert_true(top > 1040 && top < 1090);
    free(stack);
    free(raw.z);
    done(&d);
}

/* ---- trees ---- */

static struct sv_points read_trees(const char *name, const char *height, const char *scene, const char *crs)
{
    const char *path = data(name);
    struct sv_crs *system = NULL;
    struct sv_points p;
    struct sv_error error = {0};
    assert_int_equal(scene ? sv_crs_create(scene, &system, NULL) : sv_crs_create_local(&system, NULL), SV_OK);
    if (sv_points_read(&(struct sv_points_options){.path = path, .height = height, .crs = crs}, system,
                       &p, &error) != SV_OK)
        fail_msg("%s", error.message);
    sv_crs_destroy(system);
    return p;
}

/* Every inventory as CSV and as GeoJSON: as many trees, at the same places, with the same heights. */
static void inventories(void **state)
{
    (void)state;
    static const struct {
        const char *name, *scene, *height;
        size_t count, heights;
        double lo, hi;
        bool suspect; /* as GeoJSON */
    } rows[] = {
        {"quesnel_utm10n", "EPSG:32610", "height_m", 24465, 24465, 2.0, 42.94, false},
        {"fennoscandia_largeplot", NULL, "height_m", 4460, 4460, 0, 40.3, true},
        {"bei_bci50ha", NULL, NULL, 3604, 0, 0, 0, true},
        {"scbi_forestgeo_utm17n", "EPSG:26917", "height_m", 8832, 482, 2.5, 47.7, false},
        {"kootenay_utm11n", "EPSG:32611", "height_m", 891, 891, 2.01, 13.49, false},
        {"longleaf_wadetract", NULL, NULL, 584, 0, 0, 0, true},
        {"finpines", NULL, "height_m", 126, 126, 0.8, 5.4, true},
        {"neon_osbs029_crowns_utm17n", "EPSG:32617", NULL, 61, 0, 0, 0, false},
    };
    for (size_t k = 0; k < sizeof rows / sizeof rows[0]; k++) {
        char csv[100], json[100];
        snprintf(csv, sizeof csv, "trees/%s.csv", rows[k].name);
        snprintf(json, sizeof json, "trees/%s.geojson", rows[k].name);
        struct sv_points a = read_trees(csv, rows[k].height, rows[k].scene, NULL);
        struct sv_points b = read_trees(json, rows[k].height, rows[k].scene, NULL);
        if (a.count != rows[k].count || b.count != rows[k].count || a.skipped || b.skipped || a.crs_suspect ||
            b.crs_suspect != rows[k].suspect)
            fail_msg("%s: %zu and %zu trees, %d and %d skipped, suspect %d", rows[k].name, a.count, b.count,
                     (int)a.skipped, (int)b.skipped, b.crs_suspect);
        size_t heights = 0;
        double lo = INFINITY, hi = -INFINITY;
        for (size_t n = 0; n < a.count; n++) {
            assert_true(fabs(a.items[n].x - b.items[n].x) < 0.006 &&
                        fabs(a.items[n].y - b.items[n].y) < 0.006);
            double h = a.items[n].height_m;
            assert_true(isnan(h) ? isnan(b.items[n].height_m) : h == b.items[n].height_m);
            heights += !isnan(h);
            lo = isnan(h) ? lo : fmin(lo, h);
            hi = isnan(h) ? hi : fmax(hi, h);
        }
        assert_int_equal(heights, rows[k].heights);
        if (heights)
            assert_true(fabs(lo - rows[k].lo) < 0.01 && fabs(hi - rows[k].hi) < 0.01);
        sv_points_finish(&a);
        sv_points_finish(&b);
    }
}

/* Two canopy models: at each tree's place they have the tree's height, to the centimetre that the inventory
 * keeps. Orientation, half cells, NaN and Float64 nodata would all show. */
static void canopies(void **state)
{
    (void)state;
    static const struct {
        const char *raster, *trees, *crs;
        double void_share, allowed;
    } rows[] = {{"ortho/quesnel_chm_2m_utm10n.tif", "trees/quesnel_utm10n.csv", "EPSG:32610", 0.392, 0.0055},
                {"ortho/kootenay_chm_utm11n.tif", "trees/kootenay_utm11n.csv", "EPSG:32611", 0.109, 0.0055}};
    for (int k = 0; k < 2; k++) {
        struct dem d = read_dem(rows[k].raster);
        struct sv_points p = read_trees(rows[k].trees, "height_m", rows[k].crs, NULL);
        double share = (double)d.r.voids / ((double)d.r.source_width * d.r.source_height), worst = 0;
        assert_true(fabs(share - rows[k].void_share) < 0.001);
        assert_int_equal(d.r.voids_undeclared, 0);
        for (size_t n = 0; n < p.count; n++) {
            const float *h = nearest(&d, p.items[n].x - 1e-6, p.items[n].y + 1e-6);
            assert_non_null(h);
            /* kootenay's places are pixel corners: the height is that of one of the pixels that meet there */
            double off = fabs(z_of(&d, h) - p.items[n].height_m);
            for (int c = 0; k == 1 && c < 9; c++) {
                h = nearest(&d, p.items[n].x + (c % 3 - 1) * 0.26, p.items[n].y + (c / 3 - 1) * 0.26);
                off = h ? fmin(off, fabs(z_of(&d, h) - p.items[n].height_m)) : off;
            }
            worst = fmax(worst, off);
        }
        if (worst > rows[k].allowed)
            fail_msg("%s: a tree is off by %g m", rows[k].raster, worst);
        sv_points_finish(&p);
        done(&d);
    }
}

/* All stems stand on the plot's elevation model; each stands on the sample that GDAL itself finds there. */
static void scbi(void **state)
{
    (void)state;
    struct dem d = read_dem("dem/scbi_10m_utm17n.tif");
    struct raw raw = read_raw(data("dem/scbi_10m_utm17n.tif"));
    struct sv_points p;
    assert_int_equal(
        sv_points_read(&(struct sv_points_options){.path = data("trees/scbi_forestgeo_utm17n.csv"),
                                                   .species = "species"},
                       d.crs, &p, NULL),
        SV_OK);
    assert_int_equal(p.name_count, 53);
    double lo = INFINITY, hi = -INFINITY;
    size_t compared = 0;
    for (size_t n = 0; n < p.count; n++) {
        double z;
        assert_true(sv_heightfield_height(&d.f, p.items[n].x, p.items[n].y, &z));
        lo = fmin(lo, z);
        hi = fmax(hi, z);
        int i = (int)floor((p.items[n].x - raw.place[0]) / raw.place[1]),
            j = (int)floor((p.items[n].y - raw.place[3]) / raw.place[5]);
        const float *h = nearest(&d, p.items[n].x, p.items[n].y);
        double edge_x = fabs(remainder(p.items[n].x - raw.place[0], 10)),
               edge_y = fabs(remainder(p.items[n].y - raw.place[3], 10));
        assert_non_null(h);
        if (edge_x > 1e-6 && edge_y > 1e-6) { /* on a border between two pixels either may be meant */
            assert_true(z_of(&d, h) == raw.z[j * raw.width + i]);
            compared++;
        }
    }
    assert_true(compared > 8700);
    assert_true(lo >= 268 && lo <= 278 && hi >= 334 && hi <= 342);
    free(raw.z);
    sv_points_finish(&p);
    done(&d);
}

/* ---- imagery ---- */

/* Average colour of a rectangle of the picture, given in shares of it from the south-west. */
static void average(const struct sv_image *m, double x0, double y0, double x1, double y1, double rgb[3])
{
    double n = 0;
    rgb[0] = rgb[1] = rgb[2] = 0;
    for (int j = (int)(y0 * m->height); j < (int)(y1 * m->height); j++)
        for (int i = (int)(x0 * m->width); i < (int)(x1 * m->width); i++) {
            const uint8_t *t = (const uint8_t *)m->data + 4 * ((size_t)j * (size_t)m->width + (size_t)i);
            n += t[3] != 0;
            for (int c = 0; c < 3; c++)
                rgb[c] += t[c];
        }
    for (int c = 0; c < 3; c++)
        rgb[c] /= n;
}

static void drapes(void **state)
{
    (void)state;
    struct dem d = read_dem("dem/olinda_srtm_utm25s.tif");
    struct sv_image m;
    struct sv_imagery_report r;
    struct sv_imagery_options o = {.path = data("ortho/olinda_landsat7_utm25s.tif"), .bands = {3, 2, 1}};
    assert_int_equal(sv_imagery_read(&o, &d.f, d.crs, 8192, &m, &r, NULL), SV_OK);
    assert_true(r.covered > 0.999 && !r.rescaled && !r.reduced && abs(m.width - 348) <= 2 &&
                abs(m.height - 348) <= 2);
    /* the Atlantic is in the south-east, blue-green; the town in the west is not */
    double sea[3], town[3];
    average(&m, 0.85, 0.1, 0.99, 0.3, sea);
    average(&m, 0.05, 0.1, 0.3, 0.4, town);
    assert_true(sea[2] > sea[0] + 15 && sea[1] > sea[0] + 15 && town[2] < town[0] + 15);
    sv_image_free(&m);
    done(&d);

    d = read_dem("dem/zion_srtm3_4326.tif");
    o = (struct sv_imagery_options){.path = data("ortho/zion_nlcd2011_utm12n.tif")};
    assert_int_equal(sv_imagery_read(&o, &d.f, d.crs, 8192, &m, &r, NULL), SV_OK);
    assert_true(r.palette && r.covered > 0.99);
    size_t forest = 0, n = (size_t)m.width * (size_t)m.height;
    static const uint8_t colours[8][3] = {{71, 107, 160}, {170, 0, 0},     {178, 173, 163}, {104, 170, 99},
                                          {165, 140, 48}, {201, 201, 119}, {219, 216, 61},  {186, 216, 234}};
    for (size_t k = 0; k < n; k++) {
        const uint8_t *t = (const uint8_t *)m.data + 4 * k;
        bool known = t[3] == 0;
        for (int c = 0; c < 8; c++)
            known = known || !memcmp(t, colours[c], 3);
        assert_true(known); /* no class was mixed with another */
        forest += t[3] && !memcmp(t, colours[3], 3);
    }
    /* 767,537 of 1,458,207 cells of the file are forest; the terrain covers most of it */
    assert_true(fabs((double)forest / (double)n - 0.526) < 0.05);
    sv_image_free(&m);
    /* imagery of another place */
    struct sv_error error = {0};
    o = (struct sv_imagery_options){.path = data("ortho/neon_osbs029_utm17n.tif")};
    assert_int_equal(sv_imagery_read(&o, &d.f, d.crs, 8192, &m, &r, &error), SV_EOUTSIDE);
    assert_non_null(strstr(error.message, "neon_osbs029"));
    done(&d);
}

/* Every picture over a flat field of its own extent. */
static void pictures(void **state)
{
    (void)state;
    static const struct {
        const char *name, *crs;
        double x0, y0, x1, y1, covered;
        bool rescaled;
    } rows[] = {
        {"ortho/neon_osbs029_utm17n.tif", "EPSG:32617", 404211.9, 3285102.9, 404251.9, 3285142.9, 1, false},
        {"ortho/kootenay_ortho_05m_utm11n.tif", "EPSG:32611", 439689, 5526453.5, 439832.5, 5526562.5, 1,
         false},
        {"ortho/kootenay_chm_utm11n.tif", "EPSG:32611", 439689, 5526453.5, 439832.5, 5526562.5, 0.891, true},
        {"ortho/quesnel_chm_2m_utm10n.tif", "EPSG:32610", 492858, 5820046, 494350, 5821362, 0.608, true},
        {"ortho/pycrown_chm_1m_nztm.tif", "EPSG:2193", 1802139.11, 5467295.5, 1802417.11, 5467490.5, 1, true},
        {"ortho/olinda_landsat7_utm25s.tif", "EPSG:31985", 288776.25, 9110728.75, 298722.75, 9120760.75, 1,
         false},
    };
    for (size_t k = 0; k < sizeof rows / sizeof rows[0]; k++) {
        const struct sv_heightfield f = {.width = 11,
                                         .height = 11,
                                         .x0 = rows[k].x0,
                                         .y0 = rows[k].y0,
                                         .dx = (rows[k].x1 - rows[k].x0) / 10,
                                         .dy = (rows[k].y1 - rows[k].y0) / 10};
        struct sv_crs *crs = NULL;
        struct sv_image m;
        struct sv_imagery_report r;
        struct sv_error error = {0};
        assert_int_equal(sv_crs_create(rows[k].crs, &crs, NULL), SV_OK);
        struct sv_imagery_options o = {.path = data(rows[k].name)};
        if (sv_imagery_read(&o, &f, crs, 8192, &m, &r, &error) != SV_OK)
            fail_msg("%s", error.message);
        if (r.rescaled != rows[k].rescaled || fabs(r.covered - rows[k].covered) > 0.004 ||
            m.width != r.source_width || m.height != r.source_height)
            fail_msg("%s: %d x %d, covered %g, rescaled %d", rows[k].name, m.width, m.height, r.covered,
                     r.rescaled);
        sv_image_free(&m);
        sv_crs_destroy(crs);
    }
}

/* The scene process forks after loading: nothing here may have left a thread behind. Runs last. */
static void one_thread(void **state)
{
    (void)state;
    int threads = 0;
    DIR *tasks = opendir("/proc/self/task");
    if (!tasks)
        skip();
    for (struct dirent *e = readdir(tasks); e; e = readdir(tasks))
        threads += e->d_name[0] != '.';
    closedir(tasks);
    assert_int_equal(threads, 1);
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
        cmocka_unit_test(elevations), cmocka_unit_test(plot_of_bci), cmocka_unit_test(gabon_twice),
        cmocka_unit_test(cape_town),  cmocka_unit_test(inventories), cmocka_unit_test(canopies),
        cmocka_unit_test(scbi),       cmocka_unit_test(drapes),      cmocka_unit_test(pictures),
        cmocka_unit_test(one_thread),
    };
    return cmocka_run_group_tests(tests, set_up, NULL);
}
