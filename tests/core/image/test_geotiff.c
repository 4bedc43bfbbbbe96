/* test_geotiff.c - GDAL finds a picture where it was said to lie: origin, pixel size, rotation, EPSG code. */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <unistd.h>

#include <cmocka.h>

#include <cpl_vsi.h>
#include <gdal.h>
#include <ogr_srs_api.h>

#include "core/image/encode.h"
#include "core/image/private.h"

static void write_tiff(int channels, enum sv_pixel_type type, const struct sv_geo_tags *geo, void **bytes,
                       size_t *size)
{
    struct sv_error e;
    struct sv_image image;
    assert_int_equal(sv_image_alloc(40, 30, channels, type, &image, &e), SV_OK);
    for (size_t i = 0; i < sv_image_bytes(&image); i++)
        ((unsigned char *)image.data)[i] = (unsigned char)(i * 37);
    static const char *const names[] = {"R", "G", "B", "A"};
    struct sv_encode_layer layer = {&image, names};
    struct sv_encode_options options = {SV_FORMAT_TIFF, 85, geo};
    if (sv_image_encode(&layer, 1, &options, bytes, size, &e) != SV_OK)
        fail_msg("%s: %s", e.field, e.message);
    sv_image_free(&image);
}

static GDALDatasetH open_bytes(void *bytes, size_t size)
{
    VSILFILE *f = VSIFileFromMemBuffer("/vsimem/geo.tif", bytes, size, 0);
    assert_non_null(f);
    VSIFCloseL(f);
    return GDALOpen("/vsimem/geo.tif", GA_ReadOnly);
}

static void check_place(const struct sv_geo_tags *geo, int channels, enum sv_pixel_type type)
{
    void *bytes;
    size_t size;
    write_tiff(channels, type, geo, &bytes, &size);
    GDALDatasetH ds = open_bytes(bytes, size);
    assert_non_null(ds);
    double g[6];
    assert_int_equal(GDALGetGeoTransform(ds, g), CE_None);
    /* a pixel's corner (i, j), placed by hand: i steps to the right, j down, turned clockwise by the rotation
     */
    for (int k = 0; k < 4; k++) {
        double i = k & 1 ? 40 : 0, j = k & 2 ? 30 : 0, r = geo->rotation_rad;
        double right = i * geo->pixel_x, up = -j * geo->pixel_y;
        double x = geo->origin_x + right * cos(r) + up * sin(r),
               y = geo->origin_y - right * sin(r) + up * cos(r);
        assert_true(fabs(g[0] + g[1] * i + g[2] * j - x) < 1e-9 * fabs(x) + 1e-9);
        assert_true(fabs(g[3] + g[4] * i + g[5] * j - y) < 1e-9 * fabs(y) + 1e-9);
    }
    OGRSpatialReferenceH srs = GDALGetSpatialRef(ds);
    if (geo->epsg) {
        assert_non_null(srs);
        const char *code = OSRGetAuthorityCode(srs, NULL);
        assert_non_null(code);
        assert_int_equal(atoi(code), geo->epsg);
    }
    assert_null(GDALGetMetadataItem(ds, "TIFFTAG_DATETIME", NULL));
    GDALClose(ds);
    VSIUnlink("/vsimem/geo.tif");
    free(bytes);
}

static void test_places(void **state)
{
    (void)state;
    const struct sv_geo_tags places[] = {
        {500000, 5200000, 0.5, 0.5, 0, 32633},
        {292000.25, 9115000.75, 0.1, 0.2, 0, 31985},
        {-1000, 0, 10, 10, 1.0, 32733},
        {500000, 5200000, 2, 3, -2.5, 25832},
        {0, 0, 1, 1, 3.141592653589793, 2193},
        {1e7, -1e7, 1000, 1000, 0, 3857},
        {12345.678, 987654.321, 0.01, 0.01, 0.3, 0},
    };
    for (size_t i = 0; i < sizeof places / sizeof *places; i++) {
        check_place(&places[i], 3, SV_PIXEL_U8);
        check_place(&places[i], 4, SV_PIXEL_U8);
        check_place(&places[i], 1, SV_PIXEL_F32);
    }
}

static void test_pixels_stay(void **state)
{
    (void)state;
    const struct sv_geo_tags geo = {500000, 5200000, 0.5, 0.5, 0.7, 32633};
    void *with, *without;
    size_t n, m;
    struct sv_error e;
    struct sv_image a, b;
    write_tiff(4, SV_PIXEL_U8, &geo, &with, &n);
    write_tiff(4, SV_PIXEL_U8, NULL, &without, &m);
    assert_int_equal(sv_image_decode_raw(with, n, NULL, &a, &e), SV_OK);
    assert_int_equal(sv_image_decode_raw(without, m, NULL, &b, &e), SV_OK);
    assert_memory_equal(a.data, b.data, sv_image_bytes(&a));
    sv_image_free(&a);
    sv_image_free(&b);
    free(with);
    free(without);
}

static void test_refused(void **state)
{
    (void)state;
    const struct sv_geo_tags bad[] = {
        {NAN, 0, 1, 1, 0, 0}, {0, INFINITY, 1, 1, 0, 0}, {0, 0, 0, 1, 0, 0},  {0, 0, 1, -1, 0, 0},
        {0, 0, NAN, 1, 0, 0}, {0, 0, 1, 1, NAN, 0},      {0, 0, 1, 1, 0, -5}, {0, 0, 1, 1, 0, 102008},
    };
    struct sv_image image;
    struct sv_error e;
    assert_int_equal(sv_image_alloc(4, 4, 3, SV_PIXEL_U8, &image, &e), SV_OK);
    struct sv_encode_layer layer = {&image, NULL};
    for (size_t i = 0; i < sizeof bad / sizeof *bad; i++) {
        struct sv_encode_options options = {SV_FORMAT_TIFF, 85, &bad[i]};
        void *bytes;
        size_t size;
        assert_int_equal(sv_image_encode(&layer, 1, &options, &bytes, &size, &e), SV_EINVAL);
        assert_string_equal(e.field, "geo_tags");
    }
    sv_image_free(&image);
}

/* Any bytes: every truncation and every changed byte of the directory is refused or leaves a file of the same
 * length. */
static void test_any_bytes(void **state)
{
    (void)state;
    const struct sv_geo_tags geo = {1, 2, 3, 4, 0.5, 32633};
    void *bytes;
    size_t size;
    write_tiff(1, SV_PIXEL_U8, NULL, &bytes, &size);
    for (size_t n = 0; n <= size; n++) {
        void *copy = malloc(n + 1);
        size_t m = n;
        assert_non_null(copy);
        memcpy(copy, bytes, n);
        enum sv_status status = sv_geotiff_finish(&copy, &m, &geo, NULL);
        assert_true(status == SV_OK || status == SV_EFORMAT);
        assert_true(status == SV_OK ? m > n : m == n);
        free(copy);
    }
    for (size_t i = 0; i < 200 && i < size; i++)
        for (int v = 0; v < 256; v += 5) {
            void *copy = malloc(size);
            size_t m = size;
            assert_non_null(copy);
            memcpy(copy, bytes, size);
            ((unsigned char *)copy)[i] = (unsigned char)v;
            enum sv_status status = sv_geotiff_finish(&copy, &m, v & 1 ? &geo : NULL, NULL);
            assert_true(status == SV_OK || status == SV_EFORMAT);
            free(copy);
        }
    free(bytes);
}

static int setup(void **state)
{
    (void)state;
    sv_image_init();
    GDALAllRegister();
    return 0;
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_places),
        cmocka_unit_test(test_pixels_stay),
        cmocka_unit_test(test_refused),
        cmocka_unit_test(test_any_bytes),
    };
    return cmocka_run_group_tests(tests, setup, NULL);
}
