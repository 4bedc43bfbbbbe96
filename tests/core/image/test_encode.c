/* test_encode.c - what encoders write is what readers of their own (GDAL's, ours) get back: exact where the
 * format is lossless, within a stated bound where it is not; what a format cannot hold is refused; a forked
 * child can encode. */
#include <math.h>
#include <setjmp.h>
#include <signal.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <sys/wait.h>
#include <unistd.h>

#include <cmocka.h>

#include <cpl_vsi.h>
#include <gdal.h>

#include "core/base/color.h"
#include "core/base/rng.h"
#include "core/image/encode.h"
#include "tests/core/image/picture.h"

static const char *const rgba_names[] = {"R", "G", "B", "A"};
static const char *const z_names[] = {"Z"};
static const char *const id_names[] = {"id"};
static const char *const normal_names[] = {"N.X", "N.Y", "N.Z"};

/* Fails with the library's own words. */
static void ok(enum sv_status status, const struct sv_error *error)
{
    if (status != SV_OK)
        fail_msg("%s: %s: %s", sv_status_text(status), error->field, error->message);
}

static struct sv_image make_image(int w, int h, int channels, enum sv_pixel_type type)
{
    struct sv_error e;
    struct sv_image image;
    ok(sv_image_alloc(w, h, channels, type, &image, &e), &e);
    return image;
}

/* Every byte random: no structure for a codec to lean on. Floats get finite values, NaN and infinities. */
static struct sv_image noise_image(int w, int h, int channels, enum sv_pixel_type type, uint64_t seed)
{
    struct sv_image image = make_image(w, h, channels, type);
    struct sv_rng rng = sv_rng_seeded(seed, 1);
    size_t n = (size_t)w * (size_t)h * (size_t)channels;
    for (size_t i = 0; i < sv_image_bytes(&image); i++)
        ((unsigned char *)image.data)[i] = (unsigned char)(sv_rng_next(&rng) >> 56);
    if (type == SV_PIXEL_F32)
        for (size_t i = 0; i < n; i++)
            ((float *)image.data)[i] = i % 97 == 5   ? INFINITY
                                       : i % 97 == 6 ? -INFINITY
                                       : i % 97 == 7 ? NAN
                                                     : (float)sv_rng_range(&rng, -1e6, 1e6);
    return image;
}

static void encode(const struct sv_image *image, const char *const *names, enum sv_format format, int quality,
                   void **bytes, size_t *size)
{
    struct sv_error e;
    struct sv_encode_layer layer = {image, names};
    struct sv_encode_options options = {format, quality, NULL};
    ok(sv_image_encode(&layer, 1, &options, bytes, size, &e), &e);
    assert_true(*size > 20);
}

/* Bands of the picture as GDAL reads them, interleaved. */
static struct sv_image gdal_read(void *bytes, size_t size, GDALDataType type, enum sv_pixel_type as)
{
    VSILFILE *f = VSIFileFromMemBuffer("/vsimem/picture", bytes, size, 0);
    assert_non_null(f);
    VSIFCloseL(f);
    GDALDatasetH ds = GDALOpen("/vsimem/picture", GA_ReadOnly);
    assert_non_null(ds);
    int w = GDALGetRasterXSize(ds), h = GDALGetRasterYSize(ds), n = GDALGetRasterCount(ds);
    assert_int_equal(GDALGetRasterDataType(GDALGetRasterBand(ds, 1)), type);
    struct sv_image image = make_image(w, h, n, as);
    int s = (int)sv_pixel_bytes(as);
    assert_int_equal(
        GDALDatasetRasterIO(ds, GF_Read, 0, 0, w, h, image.data, w, h, type, n, NULL, n * s, n * s * w, s),
        CE_None);
    if (n == 2 || n == 4)
        assert_int_equal(GDALGetRasterColorInterpretation(GDALGetRasterBand(ds, n)), GCI_AlphaBand);
    GDALClose(ds);
    VSIUnlink("/vsimem/picture");
    return image;
}

/* Bits, but one NaN is as good as another. */
static void same_pixels(const struct sv_image *a, const struct sv_image *b)
{
    assert_int_equal(a->width, b->width);
    assert_int_equal(a->height, b->height);
    assert_int_equal(a->channels, b->channels);
    assert_int_equal(a->type, b->type);
    if (a->type != SV_PIXEL_F32) {
        assert_memory_equal(a->data, b->data, sv_image_bytes(a));
        return;
    }
    for (size_t i = 0; i < sv_image_bytes(a) / 4; i++) {
        float x = ((float *)a->data)[i], y = ((float *)b->data)[i];
        if (!(x == y || (isnan(x) && isnan(y))))
            fail_msg("sample %zu: %a became %a", i, x, y);
    }
}

/* Straight alpha included: colour under alpha 0 comes back as it went in. */
static void test_lossless(void **state)
{
    (void)state;
    static const struct {
        enum sv_format format;
        enum sv_pixel_type type;
        GDALDataType gdal;
        unsigned channels; /* bit set */
    } rows[] = {
        {SV_FORMAT_PNG, SV_PIXEL_U8, GDT_Byte, 1 << 1 | 1 << 2 | 1 << 3 | 1 << 4},
        {SV_FORMAT_PNG, SV_PIXEL_U16, GDT_UInt16, 1 << 1 | 1 << 2 | 1 << 3 | 1 << 4},
        {SV_FORMAT_TIFF, SV_PIXEL_U8, GDT_Byte, 1 << 1 | 1 << 2 | 1 << 3 | 1 << 4},
        {SV_FORMAT_TIFF, SV_PIXEL_U16, GDT_UInt16, 1 << 1 | 1 << 3 | 1 << 4},
        {SV_FORMAT_TIFF, SV_PIXEL_U32, GDT_UInt32, 1 << 1},
        {SV_FORMAT_TIFF, SV_PIXEL_F32, GDT_Float32, 1 << 1 | 1 << 3},
    };
    static const int sizes[][2] = {{1, 1}, {16, 16}, {67, 45}, {300, 3}};
    for (size_t r = 0; r < sizeof rows / sizeof *rows; r++)
        for (int n = 1; n <= 4; n++)
            for (size_t k = 0; k < sizeof sizes / sizeof *sizes && rows[r].channels >> n & 1; k++) {
                struct sv_image in = noise_image(sizes[k][0], sizes[k][1], n, rows[r].type, r * 100 + k);
                struct sv_error e;
                void *bytes;
                size_t size;
                encode(&in, rgba_names, rows[r].format, 85, &bytes, &size);
                struct sv_image out = gdal_read(bytes, size, rows[r].gdal, rows[r].type);
                same_pixels(&in, &out);
                sv_image_free(&out);
                ok(sv_image_decode_raw(bytes, size, NULL, &out, &e), &e);
                same_pixels(&in, &out);
                sv_image_free(&out);
                sv_image_free(&in);
                free(bytes);
            }
}

static double mean_error(const struct sv_image *a, const struct sv_image *rgba, int channels)
{
    double sum = 0;
    size_t n = (size_t)a->width * (size_t)a->height;
    for (size_t i = 0; i < n; i++)
        for (int c = 0; c < channels; c++)
            sum += abs(((unsigned char *)a->data)[i * (size_t)a->channels + (size_t)c] -
                       ((unsigned char *)rgba->data)[i * 4 + (size_t)c]);
    return sum / (double)n / channels;
}

static struct sv_image drop_alpha(const struct sv_image *rgba)
{
    struct sv_image rgb = make_image(rgba->width, rgba->height, 3, SV_PIXEL_U8);
    for (int i = 0; i < rgba->width * rgba->height; i++)
        memcpy((char *)rgb.data + 3 * i, (char *)rgba->data + 4 * i, 3);
    return rgb;
}

/* Higher quality: more bytes, less error, and at 95 next to none: 3 levels is what 4:4:4 at 95 leaves of this
 * noisy picture. */
static void test_lossy(void **state)
{
    (void)state;
    struct sv_image rgba, rgb;
    picture_make(200, 150, &rgba, NULL, NULL);
    rgb = drop_alpha(&rgba);
    static const enum sv_format formats[] = {SV_FORMAT_JPEG, SV_FORMAT_WEBP};
    for (int f = 0; f < 2; f++) {
        double last = 1e9;
        size_t last_size = 0;
        static const int qualities[] = {1, 30, 60, 85, 95, 100};
        for (int k = 0; k < 6; k++) {
            struct sv_error e;
            struct sv_image out;
            bool alpha;
            void *bytes;
            size_t size;
            encode(&rgb, NULL, formats[f], qualities[k], &bytes, &size);
            ok(sv_image_decode_bytes(bytes, size, NULL, 4096, &out, &alpha, &e), &e);
            double error = mean_error(&rgb, &out, 3);
            assert_false(alpha);
            assert_true(error < last);
            assert_true(size > last_size);
            if (qualities[k] == 95)
                assert_true(error < (formats[f] == SV_FORMAT_JPEG ? 3 : 6)); /* webp has no 4:4:4 */
            last = error, last_size = size;
            sv_image_free(&out);
            free(bytes);
        }
    }
    sv_image_free(&rgb);
    sv_image_free(&rgba);
}

/* WebP: alpha is kept without loss, and colour under opaque pixels is not darkened by it. */
static void test_webp_alpha(void **state)
{
    (void)state;
    struct sv_image rgba, out;
    struct sv_error e;
    bool alpha;
    void *bytes;
    size_t size;
    picture_make(200, 150, &rgba, NULL, NULL);
    encode(&rgba, NULL, SV_FORMAT_WEBP, 90, &bytes, &size);
    ok(sv_image_decode_bytes(bytes, size, "webp", 4096, &out, &alpha, &e), &e);
    assert_true(alpha);
    double sum = 0, weight = 0;
    for (int i = 0; i < 200 * 150; i++) {
        const unsigned char *p = (unsigned char *)rgba.data + 4 * i, *q = (unsigned char *)out.data + 4 * i;
        assert_int_equal(p[3], q[3]);
        if (p[3] > 0)
            sum += q[0] - p[0] + q[1] - p[1] + q[2] - p[2], weight += 3;
    }
    assert_true(fabs(sum / weight) < 1); /* premultiplied colour would be 20 levels darker */
    sv_image_free(&out);
    sv_image_free(&rgba);
    free(bytes);
}

/* EXR holds linear light times alpha in half floats: 11 significant bits, so 2^-11 relative (round to
 * nearest). */
static void test_exr_color(void **state)
{
    (void)state;
    struct sv_image in = make_image(256, 256, 4, SV_PIXEL_U8), out;
    for (int i = 0; i < 256 * 256; i++) {
        unsigned char *p = (unsigned char *)in.data + 4 * i;
        p[0] = (unsigned char)i, p[1] = (unsigned char)(255 - i), p[2] = 128, p[3] = (unsigned char)(i >> 8);
    }
    struct sv_error e;
    void *bytes;
    size_t size;
    encode(&in, rgba_names, SV_FORMAT_EXR, 85, &bytes, &size);
    ok(sv_image_decode_raw(bytes, size, NULL, &out, &e), &e);
    assert_int_equal(out.type, SV_PIXEL_F32);
    for (int i = 0; i < 256 * 256; i++)
        for (int c = 0; c < 4; c++) {
            const unsigned char *p = (unsigned char *)in.data + 4 * i;
            double v = p[c] / 255.0, a = p[3] / 255.0;
            double linear = v <= 0.04045 ? v / 12.92 : pow((v + 0.055) / 1.055, 2.4);
            double want = c == 3 ? a : linear * a, got = ((float *)out.data)[4 * i + c];
            if (fabs(got - want) > want * 0x1p-11 + 0x1p-25 + 1e-7)
                fail_msg("code %d alpha %d: %.9g, not %.9g", p[c], p[3], got, want);
        }
    sv_image_free(&out);
    bool alpha; /* and as a texture it is straight sRGB again */
    ok(sv_image_decode_bytes(bytes, size, NULL, 4096, &out, &alpha, &e), &e);
    assert_true(alpha);
    for (int i = 0; i < 256 * 256; i++)
        for (int c = 0; c < 4; c++)
            if (((unsigned char *)in.data)[4 * i + 3] > 8)
                assert_in_range(
                    ((unsigned char *)out.data)[4 * i + c] + 1 - ((unsigned char *)in.data)[4 * i + c], 0, 2);
    sv_image_free(&out);
    sv_image_free(&in);
    free(bytes);
}

/* Colour, depth, normal and id in one file, each with its own type, ids exact to 32 bits. */
static void test_exr_layers(void **state)
{
    (void)state;
    struct sv_image rgba, depth, id, normal = noise_image(97, 61, 3, SV_PIXEL_F32, 9);
    picture_make(97, 61, &rgba, &depth, &id);
    ((uint32_t *)id.data)[5] = UINT32_C(0xFFFFFFFF);
    struct sv_encode_layer layers[] = {
        {&rgba, rgba_names}, {&depth, z_names}, {&normal, normal_names}, {&id, id_names}};
    struct sv_encode_options options = {SV_FORMAT_EXR, 85, NULL};
    struct sv_error e;
    void *bytes;
    size_t size;
    ok(sv_image_encode(layers, 4, &options, &bytes, &size, &e), &e);
    struct sv_image out;
    ok(sv_image_decode_channel(bytes, size, NULL, "Z", &out, &e), &e);
    same_pixels(&depth, &out);
    sv_image_free(&out);
    ok(sv_image_decode_channel(bytes, size, NULL, "id", &out, &e), &e);
    same_pixels(&id, &out);
    sv_image_free(&out);
    for (int c = 0; c < 3; c++) {
        ok(sv_image_decode_channel(bytes, size, "exr", normal_names[c], &out, &e), &e);
        for (int i = 0; i < 97 * 61; i++) {
            float want = ((float *)normal.data)[3 * i + c], got = ((float *)out.data)[i];
            assert_true(want == got || (isnan(want) && isnan(got)));
        }
        sv_image_free(&out);
    }
    ok(sv_image_decode_channel(bytes, size, "exr", "G", &out, &e), &e);
    for (int i = 0; i < 97 * 61; i++) {
        const unsigned char *p = (unsigned char *)rgba.data + 4 * i;
        double want = sv_linear_from_srgb(p[1] / 255.0f) * p[3] / 255.0;
        assert_true(fabs(((float *)out.data)[i] - want) <= want * 0x1p-11 + 1e-7);
    }
    sv_image_free(&out);
    assert_int_equal(sv_image_decode_channel(bytes, size, "exr", "nothing", &out, &e), SV_ENOENT);
    free(bytes);
    sv_image_free(&rgba);
    sv_image_free(&depth);
    sv_image_free(&id);
    sv_image_free(&normal);
}

static enum sv_status try_encode(int w, int h, int channels, enum sv_pixel_type type, enum sv_format format,
                                 int quality, struct sv_error *e)
{
    struct sv_image image = make_image(w, h, channels, type);
    struct sv_encode_layer layer = {&image, channels <= 4 ? rgba_names : NULL};
    struct sv_encode_options options = {format, quality, NULL};
    void *bytes = NULL;
    size_t size = 77;
    enum sv_status status = sv_image_encode(&layer, 1, &options, &bytes, &size, e);
    if (status != SV_OK) { /* out-parameters are written on success only */
        assert_null(bytes);
        assert_int_equal(size, 77);
    }
    free(bytes);
    sv_image_free(&image);
    return status;
}

static void test_refused(void **state)
{
    (void)state;
    struct sv_error e;
    assert_int_equal(try_encode(8, 8, 4, SV_PIXEL_U8, SV_FORMAT_JPEG, 85, &e), SV_EUNSUPPORTED);
    assert_non_null(strstr(e.message, "jpeg"));
    assert_non_null(strstr(e.message, "4"));
    assert_int_equal(try_encode(8, 8, 1, SV_PIXEL_F32, SV_FORMAT_JPEG, 85, &e), SV_EUNSUPPORTED);
    assert_int_equal(try_encode(8, 8, 1, SV_PIXEL_F32, SV_FORMAT_PNG, 85, &e), SV_EUNSUPPORTED);
    assert_int_equal(try_encode(8, 8, 1, SV_PIXEL_U32, SV_FORMAT_PNG, 85, &e), SV_EUNSUPPORTED);
    assert_int_equal(try_encode(8, 8, 1, SV_PIXEL_U8, SV_FORMAT_WEBP, 85, &e), SV_EUNSUPPORTED);
    assert_int_equal(try_encode(8, 8, 3, SV_PIXEL_U16, SV_FORMAT_WEBP, 85, &e), SV_EUNSUPPORTED);
    assert_int_equal(try_encode(8, 8, 3, SV_PIXEL_U16, SV_FORMAT_EXR, 85, &e), SV_EUNSUPPORTED);
    assert_int_equal(try_encode(16384, 1, 3, SV_PIXEL_U8, SV_FORMAT_WEBP, 85, &e), SV_ELIMIT);
    assert_int_equal(try_encode(65501, 1, 3, SV_PIXEL_U8, SV_FORMAT_JPEG, 85, &e), SV_ELIMIT);
    assert_int_equal(try_encode(8, 8, 3, SV_PIXEL_U8, SV_FORMAT_JPEG, 0, &e), SV_EINVAL);
    assert_int_equal(try_encode(8, 8, 3, SV_PIXEL_U8, SV_FORMAT_JPEG, 101, &e), SV_EINVAL);
    assert_non_null(strstr(e.message, "1..100"));
    assert_int_equal(try_encode(8, 8, 3, SV_PIXEL_U8, SV_FORMAT_COUNT, 85, &e), SV_EINVAL);
    assert_int_equal(try_encode(8, 8, 5, SV_PIXEL_F32, SV_FORMAT_EXR, 85, &e), SV_EINVAL); /* no names */

    struct sv_image a = make_image(8, 8, 3, SV_PIXEL_U8), b = make_image(8, 9, 1, SV_PIXEL_F32), none = {0};
    struct sv_encode_layer layers[] = {{&a, rgba_names}, {&b, z_names}};
    struct sv_encode_options options = {SV_FORMAT_EXR, 85, NULL};
    void *bytes;
    size_t size;
    assert_int_equal(sv_image_encode(layers, 2, &options, &bytes, &size, &e), SV_EINVAL); /* sizes differ */
    layers[1] = layers[0];
    assert_int_equal(sv_image_encode(layers, 2, &options, &bytes, &size, &e), SV_EINVAL); /* names repeat */
    options.format = SV_FORMAT_TIFF;
    assert_int_equal(sv_image_encode(layers, 2, &options, &bytes, &size, &e), SV_EUNSUPPORTED);
    assert_int_equal(sv_image_encode(layers, 0, &options, &bytes, &size, &e), SV_EINVAL);
    assert_int_equal(sv_image_encode(layers, 9, &options, &bytes, &size, &e), SV_EINVAL);
    layers[0].image = &none;
    assert_int_equal(sv_image_encode(layers, 1, &options, &bytes, &size, &e), SV_EINVAL);
    struct sv_geo_tags geo = {0, 0, 1, 1, 0, 0};
    options = (struct sv_encode_options){SV_FORMAT_PNG, 85, &geo};
    layers[0].image = &a;
    assert_int_equal(sv_image_encode(layers, 1, &options, &bytes, &size, &e), SV_EUNSUPPORTED);
    sv_image_free(&a);
    sv_image_free(&b);
}

/* The same picture gives the same bytes, whatever the clock says. */
static void test_deterministic(void **state)
{
    (void)state;
    struct sv_image rgba;
    picture_make(64, 64, &rgba, NULL, NULL);
    struct sv_image rgb = drop_alpha(&rgba);
    void *bytes[2][SV_FORMAT_COUNT];
    size_t size[2][SV_FORMAT_COUNT];
    for (int k = 0; k < 2; k++) {
        for (int f = 0; f < SV_FORMAT_COUNT; f++)
            encode(&rgb, rgba_names, (enum sv_format)f, 85, &bytes[k][f], &size[k][f]);
        if (k == 0)
            usleep(1100000);
    }
    for (int f = 0; f < SV_FORMAT_COUNT; f++) {
        assert_int_equal(size[0][f], size[1][f]);
        assert_memory_equal(bytes[0][f], bytes[1][f], size[0][f]);
        free(bytes[0][f]);
        free(bytes[1][f]);
    }
    sv_image_free(&rgb);
    sv_image_free(&rgba);
}

static void in_child(void)
{
    struct sv_image rgba, depth, id;
    picture_make(512, 512, &rgba, &depth, &id);
    struct sv_image rgb = drop_alpha(&rgba);
    for (int f = 0; f < SV_FORMAT_COUNT; f++) {
        void *bytes;
        size_t size;
        encode(f == SV_FORMAT_JPEG ? &rgb : &rgba, rgba_names, (enum sv_format)f, 85, &bytes, &size);
        struct sv_error e;
        struct sv_image out;
        ok(sv_image_decode_bytes(bytes, size, NULL, 4096, &out, NULL, &e), &e);
        sv_image_free(&out);
        free(bytes);
    }
    struct sv_encode_layer layers[] = {{&rgba, rgba_names}, {&depth, z_names}, {&id, id_names}};
    struct sv_encode_options options = {SV_FORMAT_EXR, 85, NULL};
    struct sv_error e;
    void *bytes;
    size_t size;
    ok(sv_image_encode(layers, 3, &options, &bytes, &size, &e), &e);
    _exit(42);
}

/* After init, and after an encode of each kind before the fork, children encode and decode every format: no
 * lock, no thread pool of the parent's is waited for. */
static void test_fork(void **state)
{
    (void)state;
    struct sv_image rgba;
    picture_make(64, 64, &rgba, NULL, NULL);
    for (int warm = 0; warm < 2; warm++) {
        pid_t pid = fork();
        assert_true(pid >= 0);
        if (pid == 0) {
            alarm(20); /* five seconds at full speed; sanitizers take their time */
            in_child();
        }
        int status;
        assert_int_equal(waitpid(pid, &status, 0), pid);
        assert_true(WIFEXITED(status));
        assert_int_equal(WEXITSTATUS(status), 42);
        for (int f = SV_FORMAT_PNG; f < SV_FORMAT_COUNT && warm == 0; f++) {
            void *bytes;
            size_t size;
            encode(&rgba, rgba_names, (enum sv_format)f, 85, &bytes, &size);
            free(bytes);
        }
    }
    sv_image_free(&rgba);
}

static int setup(void **state)
{
    (void)state;
    sv_image_init();
    sv_image_init(); /* twice does no harm */
    GDALAllRegister();
    return 0;
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_fork),      cmocka_unit_test(test_lossless),
        cmocka_unit_test(test_lossy),     cmocka_unit_test(test_webp_alpha),
        cmocka_unit_test(test_exr_color), cmocka_unit_test(test_exr_layers),
        cmocka_unit_test(test_refused),   cmocka_unit_test(test_deterministic),
    };
    return cmocka_run_group_tests(tests, setup, NULL);
}
