/* Imagery from rasters made here: every texel's colour is known from its place. */
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

#include "tests/core/geo/synthetic.h"

#define PATH "/vsimem/picture.tif"

/* A field of 1000 m x 800 m in UTM 32, or local. */
static const struct sv_heightfield FIELD = {
    .width = 101, .height = 81, .x0 = 500000, .y0 = 5200000, .dx = 10, .dy = 10};

struct picture {
    struct sv_image image;
    struct sv_imagery_report r;
};

static struct sv_crs *make(const char *text)
{
    struct sv_crs *crs = NULL;
    if (text)
        assert_int_equal(sv_crs_create(text, &crs, NULL), SV_OK);
    else
        assert_int_equal(sv_crs_create_local(&crs, NULL), SV_OK);
    return crs;
}

static struct picture read_picture(const struct sv_imagery_options *o, const char *scene, int max_side)
{
    struct picture p;
    struct sv_error error = {0};
    struct sv_crs *crs = make(scene);
    if (sv_imagery_read(o, &FIELD, crs, max_side, &p.image, &p.r, &error) != SV_OK)
        fail_msg("%s", error.message);
    sv_crs_destroy(crs);
    assert_true(p.image.channels == 4 && p.image.type == SV_PIXEL_U8);
    assert_true(p.image.width >= 1 && p.image.width <= max_side && p.image.height >= 1 &&
                p.image.height <= max_side);
    const uint8_t *d = p.image.data;
    for (int k = 0; k < p.image.width * p.image.height; k++) /* holes are all zero, the rest opaque */
        assert_true(d[4 * k + 3] == 255 || (d[4 * k] | d[4 * k + 1] | d[4 * k + 2] | d[4 * k + 3]) == 0);
    return p;
}

static struct picture read_plain(const char *scene, int max_side)
{
    return read_picture(&(struct sv_imagery_options){.path = PATH}, scene, max_side);
}

static void refused(const struct sv_imagery_options *o, const char *scene, enum sv_status expected,
                    const char *word)
{
    struct sv_image image = {0};
    struct sv_imagery_report r;
    struct sv_error error = {0};
    struct sv_crs *crs = make(scene);
    enum sv_status status = sv_imagery_read(o, &FIELD, crs, 1024, &image, &r, &error);
    if (status != expected || image.data || !strstr(error.message, word))
        fail_msg("expected \"%s\" and \"%s\", got \"%s\": %s", sv_status_text(expected), word,
                 sv_status_text(status), error.message);
    sv_crs_destroy(crs);
}

static const uint8_t *texel(const struct picture *p, int i, int j)
{
    assert_true(i >= 0 && j >= 0 && i < p->image.width && j < p->image.height);
    return (const uint8_t *)p->image.data + 4 * ((size_t)j * (size_t)p->image.width + (size_t)i);
}

static void done(struct picture *p)
{
    sv_image_free(&p->image);
    synthetic_remove(PATH);
}

/* Red grows eastwards by one a column, green northwards by one a row from the bottom, blue marks the bands.
 */
static double ramps(void *context, int band, int i, int j)
{
    int rows = *(int *)context;
    return band == 1 ? i : band == 2 ? rows - 1 - j : 10 * band;
}

static void whole_pixels(void **state)
{
    (void)state;
    int rows = 160;
    const double place[6] = {500000, 5, 0, 5200800, 0, -5}; /* exactly the field's rectangle */
    synthetic_write(&(struct synthetic){PATH, 200, 160, 3, GDT_Byte, place, "EPSG:32632", .value = ramps,
                                        .context = &rows});
    struct picture p = read_plain("EPSG:32632", 4096);
    assert_true(p.image.width == 200 && p.image.height == 160);
    for (int j = 0; j < 160; j++)
        for (int i = 0; i < 200; i++) {
            const uint8_t *t = texel(&p, i, j);
            assert_true(t[0] == i && t[1] == j && t[2] == 30 && t[3] == 255);
        }
    assert_true(p.r.covered == 1 && !p.r.reduced && !p.r.warped && !p.r.rescaled && !p.r.palette);
    assert_true(p.r.bands_used[0] == 1 && p.r.bands_used[1] == 2 && p.r.bands_used[2] == 3);
    done(&p);
}

static void chosen_bands(void **state)
{
    (void)state;
    int rows = 160;
    const double place[6] = {500000, 5, 0, 5200800, 0, -5};
    synthetic_write(&(struct synthetic){PATH, 200, 160, 6, GDT_Byte, place, "EPSG:32632", .value = ramps,
                                        .context = &rows});
    struct picture p =
        read_picture(&(struct sv_imagery_options){.path = PATH, .bands = {6, 5, 1}}, "EPSG:32632", 4096);
    const uint8_t *t = texel(&p, 7, 9);
    assert_true(t[0] == 60 && t[1] == 50 && t[2] == 7);
    sv_image_free(&p.image);
    refused(&(struct sv_imagery_options){.path = PATH, .bands = {7, 1, 1}}, "EPSG:32632", SV_EINVAL,
            "band 7");
    refused(&(struct sv_imagery_options){.path = PATH, .bands = {1, 0, 1}}, "EPSG:32632", SV_EINVAL,
            "band 0");
    /* one band alone is grey */
    synthetic_write(&(struct synthetic){PATH, 200, 160, 1, GDT_Byte, place, "EPSG:32632", .value = ramps,
                                        .context = &rows});
    p = read_plain("EPSG:32632", 4096);
    t = texel(&p, 123, 9);
    assert_true(t[0] == 123 && t[1] == 123 && t[2] == 123);
    done(&p);
}

/* Larger than the terrain, smaller than it, beside it; coarser than a texel; south-up. */
static void places(void **state)
{
    (void)state;
    int rows = 240;
    const double larger[6] = {499500, 10, 0, 5201600, 0, -10};
    synthetic_write(&(struct synthetic){PATH, 200, 240, 3, GDT_Byte, larger, "EPSG:32632", .value = ramps,
                                        .context = &rows});
    struct picture p = read_plain("EPSG:32632", 4096);
    assert_true(p.image.width == 100 && p.image.height == 80 && p.r.covered == 1);
    for (int j = 0; j < 80; j += 7)
        for (int i = 0; i < 100; i += 7)
            assert_true(texel(&p, i, j)[0] == i + 50 && texel(&p, i, j)[1] == j + 80);
    sv_image_free(&p.image);
    const double smaller[6] = {500250, 10, 0, 5200600, 0, -10};
    rows = 40;
    synthetic_write(&(struct synthetic){PATH, 50, 40, 3, GDT_Byte, smaller, "EPSG:32632", .value = ramps,
                                        .context = &rows});
    p = read_plain("EPSG:32632", 4096);
    assert_true(fabs(p.r.covered - 0.25) < 1e-9);
    assert_true(texel(&p, 24, 30)[3] == 0 && texel(&p, 25, 20)[3] == 255 && texel(&p, 74, 59)[3] == 255 &&
                texel(&p, 75, 59)[3] == 0 && texel(&p, 74, 60)[3] == 0);
    assert_true(texel(&p, 25, 20)[0] == 0 && texel(&p, 74, 59)[0] == 49 && texel(&p, 74, 59)[1] == 39);
    sv_image_free(&p.image);
    const double south_up[6] = {500250, 10, 0, 5200200, 0, 10};
    synthetic_write(&(struct synthetic){PATH, 50, 40, 3, GDT_Byte, south_up, "EPSG:32632", .value = ramps,
                                        .context = &rows});
    p = read_plain("EPSG:32632", 4096);
    assert_true(texel(&p, 25, 20)[1] == 39 && texel(&p, 74, 59)[1] == 0);
    sv_image_free(&p.image);
    const double beside[6] = {502000, 10, 0, 5200600, 0, -10},
                 coarse[6] = {499000, 3000, 0, 5202000, 0, -3000};
    synthetic_write(&(struct synthetic){PATH, 50, 40, 3, GDT_Byte, beside, "EPSG:32632", .value = ramps,
                                        .context = &rows});
    refused(&(struct sv_imagery_options){.path = PATH}, "EPSG:32632", SV_EOUTSIDE, "does not touch");
    rows = 1;
    synthetic_write(
        &(struct synthetic){PATH, 1, 1, 3, GDT_Byte, coarse, "EPSG:32632", .value = ramps, .context = &rows});
    p = read_plain("EPSG:32632", 4096);
    assert_true(p.image.width == 1 && p.image.height == 1 && texel(&p, 0, 0)[2] == 30);
    done(&p);
}

/* Too large: averaged, so that a fine checkerboard becomes grey, and the ramp keeps its slope. */
static double checkers(void *context, int band, int i, int j)
{
    (void)context;
    return band == 1 ? 255 * ((i + j) % 2) : band == 2 ? i / 4 : 7;
}

static void reduced(void **state)
{
    (void)state;
    const double place[6] = {500000, 1, 0, 5200800, 0, -1};
    synthetic_write(
        &(struct synthetic){PATH, 1000, 800, 3, GDT_Byte, place, "EPSG:32632", .value = checkers});
    struct picture p = read_plain("EPSG:32632", 100);
    assert_true(p.r.reduced && p.image.width == 100 && p.image.height == 100);
    for (int j = 0; j < 100; j++)
        for (int i = 0; i < 100; i++) {
            assert_in_range(texel(&p, i, j)[0], 126, 129);
            assert_in_range(texel(&p, i, j)[1] + 2, (i * 10 + 5) / 4, (i * 10 + 5) / 4 + 4);
        }
    done(&p);
}

static double sixteen_bits(void *context, int band, int i, int j)
{
    (void)context;
    (void)band;
    return i == 3 && j == 3   ? 65000
           : i == 4 && j == 4 ? 0
                              : 1000 + 10 * i; /* 1000 .. 2990 but for two outliers */
}

static double with_nan(void *context, int band, int i, int j)
{
    (void)context;
    (void)band;
    return j < 40 ? NAN : i == 0 ? INFINITY : 5 * i;
}

static double same(void *context, int band, int i, int j)
{
    (void)context;
    (void)band;
    (void)i;
    (void)j;
    return 4711;
}

static void stretched(void **state)
{
    (void)state;
    const double place[6] = {500000, 5, 0, 5200800, 0, -5};
    synthetic_write(
        &(struct synthetic){PATH, 200, 160, 3, GDT_UInt16, place, "EPSG:32632", .value = sixteen_bits});
    struct picture p = read_plain("EPSG:32632", 4096);
    assert_true(p.r.rescaled);
    for (int c = 0; c < 3; c++) { /* 2 % of 200 columns: the 4th and the 196th */
        assert_true(fabs(p.r.stretch[c][0] - 1040) <= 10 && fabs(p.r.stretch[c][1] - 2950) <= 10);
        assert_true(texel(&p, 0, 5)[c] == 0 && texel(&p, 199, 5)[c] == 255);
        assert_in_range(texel(&p, 100, 5)[c], 126, 130);
    }
    sv_image_free(&p.image);
    synthetic_write(
        &(struct synthetic){PATH, 200, 160, 1, GDT_Float32, place, "EPSG:32632", .value = with_nan});
    p = read_plain("EPSG:32632", 4096);
    assert_true(texel(&p, 50, 150)[3] == 0 && texel(&p, 50, 20)[3] == 255 && texel(&p, 0, 20)[3] == 0);
    assert_true(fabs(p.r.covered - 0.75 * 199 / 200) < 1e-9);
    sv_image_free(&p.image);
    synthetic_write(&(struct synthetic){PATH, 200, 160, 1, GDT_Float64, place, "EPSG:32632", .value = same});
    p = read_plain("EPSG:32632", 4096);
    assert_true(texel(&p, 50, 50)[0] == 128 && texel(&p, 50, 50)[3] == 255);
    sv_image_free(&p.image);
    /* all of it nodata: touches the terrain, but covers nothing */
    synthetic_write(&(struct synthetic){PATH, 200, 160, 1, GDT_Float64, place, "EPSG:32632", .nodata = "4711",
                                        .value = same});
    p = read_plain("EPSG:32632", 4096);
    assert_true(p.r.covered == 0);
    done(&p);
}

/* Byte photo, nodata 0 in each band: the collar (40 columns) is a hole, a black dot inside is not, nor is
 * pure red. */
static double collar(void *context, int band, int i, int j)
{
    (void)context;
    if (i < 40)
        return 0;
    if (i >= 100 && i < 110 && j >= 50 && j < 60)
        return 0;
    if (i >= 100 && i < 160 && j >= 90 && j < 140) /* 3000 pixels: a missing tile */
        return 0;
    return band == 1 ? 200 : i < 150 ? 0 : 90;
}

static void nodata(void **state)
{
    (void)state;
    const double place[6] = {500000, 5, 0, 5200800, 0, -5};
    synthetic_write(&(struct synthetic){PATH, 200, 160, 3, GDT_Byte, place, "EPSG:32632", .nodata = "0",
                                        .value = collar});
    struct picture p = read_plain("EPSG:32632", 4096);
    assert_true(texel(&p, 20, 50)[3] == 0 && texel(&p, 120, 159 - 100)[3] == 0);
    assert_true(texel(&p, 105, 159 - 55)[3] == 255 && texel(&p, 105, 159 - 55)[0] == 0);
    assert_true(texel(&p, 80, 10)[3] == 255 && texel(&p, 80, 10)[0] == 200);
    assert_int_equal(p.r.specks, 100);
    sv_image_free(&p.image);
    /* undeclared, black is black */
    synthetic_write(&(struct synthetic){PATH, 200, 160, 3, GDT_Byte, place, "EPSG:32632", .value = collar});
    p = read_plain("EPSG:32632", 4096);
    assert_true(p.r.covered == 1);
    done(&p);
}

static double with_alpha(void *context, int band, int i, int j)
{
    (void)context;
    (void)j;
    return band == 4 ? (i < 60 ? 0 : i < 80 ? 100 : i < 100 ? 160 : 255) : 20 * band;
}

static void alpha(void **state)
{
    (void)state;
    const double place[6] = {500000, 5, 0, 5200800, 0, -5};
    synthetic_write(
        &(struct synthetic){PATH, 200, 160, 4, GDT_Byte, place, "EPSG:32632", .value = with_alpha});
    GDALDatasetH ds = GDALOpen(PATH, GA_Update);
    assert_non_null(ds);
    GDALSetRasterColorInterpretation(GDALGetRasterBand(ds, 4), GCI_AlphaBand);
    GDALClose(ds);
    struct picture p = read_plain("EPSG:32632", 4096);
    assert_true(texel(&p, 30, 8)[3] == 0 && texel(&p, 70, 8)[3] == 0 && texel(&p, 90, 8)[3] == 255 &&
                texel(&p, 150, 8)[2] == 60);
    assert_true(fabs(p.r.covered - 0.6) < 1e-9);
    done(&p);
}

static double classes(void *context, int band, int i, int j)
{
    (void)context;
    (void)band;
    return (i / 10 + j / 10) % 3; /* 3 classes; 2 has no entry in the palette */
}

/* Palettes: only their own colours appear, in another system and reduced, too. */
static void palette(void **state)
{
    (void)state;
    const double utm33[6] = {43000, 5, 0, 5218800, 0, -5};
    synthetic_write(&(struct synthetic){PATH, 400, 400, 1, GDT_Byte, utm33, "EPSG:32633", .value = classes});
    GDALDatasetH ds = GDALOpen(PATH, GA_Update);
    GDALColorTableH table = GDALCreateColorTable(GPI_RGB);
    const GDALColorEntry red = {200, 10, 20, 255}, green = {10, 180, 30, 255}, clear = {1, 2, 3, 0};
    GDALSetColorEntry(table, 0, &red);
    GDALSetColorEntry(table, 1, &green);
    GDALSetColorEntry(table, 2, &clear);
    GDALSetRasterColorTable(GDALGetRasterBand(ds, 1), table);
    GDALDestroyColorTable(table);
    /* GeoTIFF keeps no alpha in its palettes; PAM does, but GTiff ignores it: use nodata for the third class
     */
    GDALSetRasterNoDataValue(GDALGetRasterBand(ds, 1), 2);
    GDALClose(ds);
    for (int side = 4096; side >= 50; side /= 9) {
        struct picture p = read_plain("EPSG:32632", side);
        int seen[3] = {0, 0, 0};
        assert_true(p.r.palette && p.r.warped);
        for (int k = 0; k < p.image.width * p.image.height; k++) {
            const uint8_t *t = texel(&p, k % p.image.width, k / p.image.width);
            bool is_red = t[0] == 200 && t[1] == 10 && t[2] == 20,
                 is_green = t[0] == 10 && t[1] == 180 && t[2] == 30;
            assert_true(is_red || is_green || t[3] == 0);
            seen[is_red ? 0 : is_green ? 1 : 2]++;
        }
        int n = p.image.width * p.image.height;
        for (int c = 0; c < 3; c++)
            assert_in_range(seen[c], side > 1000 ? n / 4 : n / 10,
                            n / 2); /* averaged holes give way to what is there */
        sv_image_free(&p.image);
    }
    synthetic_remove(PATH);
}

/* In degrees: red and green tell longitude and latitude of every texel. */
struct degrees {
    double lon, lat, cell;
    struct sv_crs *utm;
};

static double of_place(void *context, int band, int i, int j)
{
    const struct degrees *d = context;
    double x, y;
    if (!sv_crs_from_lonlat(d->utm, d->lon + (i + 0.5) * d->cell, d->lat - (j + 0.5) * d->cell, &x, &y))
        return 0;
    double v = band == 1 ? (x - FIELD.x0) / 5 : band == 2 ? (y - FIELD.y0) / 5 : 99;
    return v < 0 ? 0 : v > 255 ? 255 : floor(v + 0.5);
}

static void warped(void **state)
{
    (void)state;
    struct degrees d = {8.99, 46.97, 5e-5, make("EPSG:32632")};
    double x, y;
    assert_true(sv_crs_from_lonlat(d.utm, d.lon, d.lat, &x, &y));
    assert_true(x < FIELD.x0 && y > FIELD.y0 + 800);
    const double place[6] = {d.lon, d.cell, 0, d.lat, 0, -d.cell};
    synthetic_write(&(struct synthetic){PATH, 700, 500, 3, GDT_Byte, place, "EPSG:4326", .value = of_place,
                                        .context = &d});
    struct picture p = read_plain("EPSG:32632", 4096);
    assert_true(p.r.warped && p.r.covered == 1);
    for (int j = 0; j < p.image.height; j += 3)
        for (int i = 0; i < p.image.width; i += 3) {
            double red = (i + 0.5) / p.image.width * 200, green = (j + 0.5) / p.image.height * 160;
            assert_true(fabs(texel(&p, i, j)[0] - red) <= 1.2 && fabs(texel(&p, i, j)[1] - green) <= 1.2);
        }
    sv_image_free(&p.image);
    sv_crs_destroy(d.utm);
    /* turned by 30 degrees about the field's middle */
    const double c = 5 * cos(0.5), s = 5 * sin(0.5);
    const double turned[6] = {500500 - 150 * c - 150 * s, c, s, 5200400 - 150 * s + 150 * c, s, -c};
    int rows = 300;
    synthetic_write(&(struct synthetic){PATH, 300, 300, 2, GDT_Byte, turned, "EPSG:32632", .value = ramps,
                                        .context = &rows});
    p = read_picture(&(struct sv_imagery_options){.path = PATH, .bands = {1, 1, 1}}, "EPSG:32632", 4096);
    for (int j = 0; j < p.image.height; j++)
        for (int i = 0; i < p.image.width; i++) {
            double u = 500000 + (i + 0.5) / p.image.width * 1000 - turned[0];
            double v = 5200000 + (j + 0.5) / p.image.height * 800 - turned[3];
            double column = (u * c + v * s) / 25 - 0.5;
            if (column > 0 && column < 254 && texel(&p, i, j)[3])
                assert_true(fabs(texel(&p, i, j)[0] - column) <= 0.6);
        }
    done(&p);
}

static void local_scenes(void **state)
{
    (void)state;
    int rows = 40;
    synthetic_write(
        &(struct synthetic){PATH, 50, 40, 3, GDT_Byte, NULL, NULL, .value = ramps, .context = &rows});
    struct picture p = read_plain(NULL, 4096);
    assert_true(p.r.fitted && p.image.width == 50 && p.image.height == 40 && p.r.covered == 1);
    assert_true(texel(&p, 49, 39)[0] == 49 && texel(&p, 49, 39)[1] == 39 && texel(&p, 0, 0)[1] == 0);
    sv_image_free(&p.image);
    refused(&(struct sv_imagery_options){.path = PATH}, "EPSG:32632", SV_EFORMAT, "no georeference");
    const double place[6] = {500000, 5, 0, 5200800, 0, -5};
    synthetic_write(&(struct synthetic){PATH, 200, 160, 3, GDT_Byte, place, "EPSG:32632", .value = ramps,
                                        .context = &rows});
    refused(&(struct sv_imagery_options){.path = PATH}, NULL, SV_EUNSUPPORTED, "local");
    refused(&(struct sv_imagery_options){.path = PATH, .crs = "EPSG:32633"}, "EPSG:32632", SV_EINVAL,
            "EPSG:32633");
    /* without a system: the scene's, or the one given */
    synthetic_write(
        &(struct synthetic){PATH, 200, 160, 3, GDT_Byte, place, NULL, .value = ramps, .context = &rows});
    p = read_plain("EPSG:32632", 4096);
    assert_true(p.r.covered == 1 && !p.r.warped);
    sv_image_free(&p.image);
    p = read_plain(NULL, 4096);
    assert_true(p.r.covered == 1 && !p.r.fitted);
    sv_image_free(&p.image);
    refused(&(struct sv_imagery_options){.path = PATH, .crs = "EPSG:32633"}, "EPSG:32632", SV_EOUTSIDE,
            "touch");
    synthetic_remove(PATH);
    refused(&(struct sv_imagery_options){.path = "/vsimem/none.png"}, NULL, SV_ENOENT, "/vsimem/none.png");
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
        cmocka_unit_test(whole_pixels), cmocka_unit_test(chosen_bands), cmocka_unit_test(places),
        cmocka_unit_test(reduced),      cmocka_unit_test(stretched),    cmocka_unit_test(nodata),
        cmocka_unit_test(alpha),        cmocka_unit_test(palette),      cmocka_unit_test(warped),
        cmocka_unit_test(local_scenes),
    };
    return cmocka_run_group_tests(tests, set_up, NULL);
}
