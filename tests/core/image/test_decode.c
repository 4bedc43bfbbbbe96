/* test_decode.c - pictures into textures: palette, grey, 16 bits, TGA, SGI, DDS written byte by byte here,
 * averages against sums in double, and bytes that are no picture. */
#include <math.h>
#include <sys/resource.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <unistd.h>

#include <cmocka.h>

#include "core/base/color.h"
#include "core/base/rng.h"
#include "core/image/encode.h"
#include "tests/core/image/picture.h"

static struct sv_image decode(const void *bytes, size_t size, const char *extension, bool *alpha)
{
    struct sv_image image;
    struct sv_error e;
    if (sv_image_decode_bytes(bytes, size, extension, SV_DECODE_SIDE_MAX, &image, alpha, &e) != SV_OK)
        fail_msg("%s", e.message);
    assert_int_equal(image.channels, 4);
    assert_int_equal(image.type, SV_PIXEL_U8);
    return image;
}

static void expect(const struct sv_image *image, int x, int y, int r, int g, int b, int a)
{
    const unsigned char *p = (const unsigned char *)image->data + 4 * (y * image->width + x);
    if (p[0] != r || p[1] != g || p[2] != b || p[3] != a)
        fail_msg("(%d, %d): %d %d %d %d, not %d %d %d %d", x, y, p[0], p[1], p[2], p[3], r, g, b, a);
}

static void *encode(const struct sv_image *image, enum sv_format format, size_t *size)
{
    static const char *const names[] = {"R", "G", "B", "A"}, *const one[] = {"Y"};
    struct sv_encode_layer layer = {image, image->channels < 3 ? one : names};
    struct sv_encode_options options = {format, 95, NULL};
    struct sv_error e;
    void *bytes;
    if (sv_image_encode(&layer, 1, &options, &bytes, size, &e) != SV_OK)
        fail_msg("%s", e.message);
    return bytes;
}

static struct sv_image make(int w, int h, int channels, enum sv_pixel_type type)
{
    struct sv_image image;
    struct sv_error e;
    assert_int_equal(sv_image_alloc(w, h, channels, type, &image, &e), SV_OK);
    return image;
}

static uint32_t crc(const unsigned char *p, size_t n)
{
    uint32_t c = UINT32_C(0xFFFFFFFF);
    for (size_t i = 0; i < n; i++) {
        c ^= p[i];
        for (int k = 0; k < 8; k++)
            c = c & 1 ? UINT32_C(0xEDB88320) ^ (c >> 1) : c >> 1;
    }
    return ~c;
}

static void put32(unsigned char *p, uint32_t v)
{
    p[0] = (unsigned char)(v >> 24), p[1] = (unsigned char)(v >> 16), p[2] = (unsigned char)(v >> 8),
    p[3] = (unsigned char)v;
}

static size_t chunk(unsigned char *out, const char *type, const void *data, size_t n)
{
    put32(out, (uint32_t)n);
    memcpy(out + 4, type, 4);
    if (n)
        memcpy(out + 8, data, n);
    put32(out + 8 + n, crc(out + 4, n + 4));
    return n + 12;
}

/* A PNG with its data in one stored deflate block. */
static size_t make_png(unsigned char *out, uint32_t w, uint32_t h, int depth, int color, const void *plte,
                       size_t plte_size, const void *trns, size_t trns_size, const unsigned char *raw,
                       size_t raw_size)
{
    unsigned char ihdr[13] = {0}, z[512] = {0x78, 1, 1};
    memcpy(out, "\x89PNG\r\n\x1a\n", 8);
    size_t n = 8;
    put32(ihdr, w);
    put32(ihdr + 4, h);
    ihdr[8] = (unsigned char)depth, ihdr[9] = (unsigned char)color;
    n += chunk(out + n, "IHDR", ihdr, 13);
    if (plte)
        n += chunk(out + n, "PLTE", plte, plte_size);
    if (trns)
        n += chunk(out + n, "tRNS", trns, trns_size);
    z[3] = (unsigned char)raw_size, z[4] = (unsigned char)(raw_size >> 8), z[5] = (unsigned char)~z[3],
    z[6] = (unsigned char)~z[4];
    memcpy(z + 7, raw, raw_size);
    uint32_t a = 1, b = 0;
    for (size_t i = 0; i < raw_size; i++)
        a = (a + raw[i]) % 65521, b = (b + a) % 65521;
    put32(z + 7 + raw_size, b << 16 | a);
    n += chunk(out + n, "IDAT", z, raw_size + 11);
    return n + chunk(out + n, "IEND", NULL, 0);
}

static void test_png_kinds(void **state)
{
    (void)state;
    unsigned char png[2048];
    bool alpha;
    /* palette with transparency, 3 x 2 */
    static const unsigned char palette[] = {255, 0, 0, 0, 255, 0, 10, 20, 30}, trns[] = {255, 0, 128};
    static const unsigned char rows[] = {0, 0, 1, 2, 0, 2, 1, 0};
    size_t n = make_png(png, 3, 2, 8, 3, palette, 9, trns, 3, rows, 8);
    struct sv_image image = decode(png, n, NULL, &alpha);
    assert_true(alpha && image.width == 3 && image.height == 2);
    expect(&image, 0, 0, 255, 0, 0, 255);
    expect(&image, 1, 0, 0, 255, 0, 0);
    expect(&image, 2, 0, 10, 20, 30, 128);
    expect(&image, 0, 1, 10, 20, 30, 128);
    sv_image_free(&image);
    /* palette without, 2 bits a pixel: 0 1 2 | 2 1 0 */
    static const unsigned char bits[] = {0, 0x18, 0, 0x90};
    n = make_png(png, 3, 2, 2, 3, palette, 9, NULL, 0, bits, 4);
    image = decode(png, n, "jpg", &alpha); /* a wrong extension does not mislead */
    assert_false(alpha);
    expect(&image, 1, 0, 0, 255, 0, 255);
    expect(&image, 0, 1, 10, 20, 30, 255);
    sv_image_free(&image);
    /* one bit grey */
    static const unsigned char mono[] = {0, 0xA0, 0, 0x40};
    n = make_png(png, 3, 2, 1, 0, NULL, 0, NULL, 0, mono, 4);
    image = decode(png, n, NULL, &alpha);
    expect(&image, 0, 0, 255, 255, 255, 255);
    expect(&image, 1, 0, 0, 0, 0, 255);
    expect(&image, 1, 1, 255, 255, 255, 255);
    sv_image_free(&image);
}

/* Grey, grey and alpha, RGB, RGBA in 8 and 16 bits, through our own encoders (which GDAL vouches for in
 * test_encode). */
static void test_channels(void **state)
{
    (void)state;
    for (int n = 1; n <= 4; n++)
        for (int wide = 0; wide < 2; wide++) {
            struct sv_image in = make(5, 3, n, wide ? SV_PIXEL_U16 : SV_PIXEL_U8);
            for (int i = 0; i < 15 * n; i++) {
                unsigned v = (unsigned)(i * 61 + 7) & 255;
                if (wide)
                    ((uint16_t *)in.data)[i] = (uint16_t)(v * 257);
                else
                    ((unsigned char *)in.data)[i] = (unsigned char)v;
            }
            size_t size;
            bool alpha;
            void *bytes = encode(&in, SV_FORMAT_PNG, &size);
            struct sv_image out = decode(bytes, size, NULL, &alpha);
            assert_true(alpha == (n == 2 || n == 4));
            for (int i = 0; i < 15; i++) {
                int c[4];
                for (int k = 0; k < 4; k++) {
                    int from = k == 3 ? n - 1 : n < 3 ? 0 : k;
                    c[k] = k == 3 && n % 2 ? 255 : ((i * n + from) * 61 + 7) & 255;
                }
                expect(&out, i % 5, i / 5, c[0], c[1], c[2], c[3]);
            }
            sv_image_free(&out);
            sv_image_free(&in);
            free(bytes);
        }
}

/* Formats that models bring and we do not write: TGA (bottom row first, no magic), SGI, DDS. */
static void test_other_formats(void **state)
{
    (void)state;
    bool alpha;
    struct sv_error e;
    struct sv_image image;
    unsigned char tga[18 + 2 * 2 * 4] = {0, 0, 2, [12] = 2, [14] = 2, [16] = 32, [17] = 8};
    static const unsigned char bgra[] = {1, 2, 3, 255, 4, 5, 6, 0, 7, 8, 9, 128, 10, 11, 12, 255};
    memcpy(tga + 18, bgra, 16);
    assert_int_equal(sv_image_decode_bytes(tga, sizeof tga, NULL, 16, &image, NULL, &e),
                     SV_EFORMAT); /* nothing tells */
    image = decode(tga, sizeof tga, "TGA", &alpha);
    assert_true(alpha);
    expect(&image, 0, 1, 3, 2, 1, 255);
    expect(&image, 1, 1, 6, 5, 4, 0);
    expect(&image, 0, 0, 9, 8, 7, 128);
    sv_image_free(&image);
    /* palette of three from index 5, run-length coded, top row first, with an id of two bytes: 5 5 5 | 7 6 5
     */
    static const unsigned char map[] = {2,   1,   9, 5, 0, 3, 0, 24, 0, 0, 0, 0,    3, 0, 2, 0, 8, 0x20,
                                        'i', 'd', 1, 2, 3, 4, 5, 6,  7, 8, 9, 0x82, 5, 2, 7, 6, 5};
    image = decode(map, sizeof map, "tga", &alpha);
    assert_false(alpha);
    expect(&image, 2, 0, 3, 2, 1, 255);
    expect(&image, 0, 1, 9, 8, 7, 255);
    expect(&image, 1, 1, 6, 5, 4, 255);
    sv_image_free(&image);
    unsigned char outside[sizeof map];
    memcpy(outside, map, sizeof map);
    outside[30] = 8; /* an index past the palette, and one before it */
    assert_int_equal(sv_image_decode_bytes(outside, sizeof outside, "tga", 16, &image, NULL, &e), SV_EFORMAT);
    outside[30] = 4;
    assert_int_equal(sv_image_decode_bytes(outside, sizeof outside, "tga", 16, &image, NULL, &e), SV_EFORMAT);
    /* 16 bits with an alpha bit, from the right: red opaque, blue clear */
    static const unsigned char five[] = {0, 0, 2, 0, 0, 0,  0,    0,    0,    0,    0,
                                         0, 2, 0, 1, 0, 16, 0x31, 0x00, 0xFC, 0x1F, 0x00};
    image = decode(five, sizeof five, "tga", &alpha);
    assert_true(alpha);
    expect(&image, 1, 0, 255, 0, 0, 255);
    expect(&image, 0, 0, 0, 0, 255, 0);
    sv_image_free(&image);
    /* SGI: 2 x 2, 3 planes, bottom row first */
    unsigned char sgi[512 + 12] = {1, 0xDA, 0, 1, 0, 3, 0, 2, 0, 2, 0, 3, [19] = 255};
    for (int i = 0; i < 12; i++)
        sgi[512 + i] = (unsigned char)(10 * i + 1);
    image = decode(sgi, sizeof sgi, NULL, &alpha);
    assert_false(alpha);
    expect(&image, 0, 1, 1, 41, 81, 255);
    expect(&image, 1, 0, 31, 71, 111, 255);
    sv_image_free(&image);
    /* the same rows run-length coded: a run, then literals */
    unsigned char rle[512 + 48 + 7] = {1, 0xDA, 1, 1, 0, 3, 0, 2, 0, 2, 0, 3, [19] = 255};
    for (int i = 0; i < 6; i++) /* rows 0 and 1 of each channel: offset and length */
        put32(rle + 512 + 4 * i, i % 2 ? 563 : 560), put32(rle + 536 + 4 * i, i % 2 ? 4 : 3);
    memcpy(rle + 560, "\x02\x07\0\x82\x08\x09\0", 7);
    image = decode(rle, sizeof rle, NULL, &alpha);
    expect(&image, 0, 1, 7, 7, 7, 255);
    expect(&image, 1, 0, 9, 9, 9, 255);
    sv_image_free(&image);
    put32(rle + 512, 565); /* a row that runs out of the file */
    assert_int_equal(sv_image_decode_bytes(rle, sizeof rle, NULL, 16, &image, NULL, &e), SV_EFORMAT);
    /* DDS: one DXT1 block, red and black by turns */
    unsigned char dds[128 + 8] = "DDS ";
    static const struct {
        int at, value;
    } words[] = {{4, 124}, {8, 0x1007}, {12, 4},          {16, 4},      {20, 8},
                 {76, 32}, {80, 4},     {84, 0x31545844}, {108, 0x1000}};
    for (size_t i = 0; i < sizeof words / sizeof *words; i++)
        for (int k = 0; k < 4; k++)
            dds[words[i].at + k] = (unsigned char)(words[i].value >> (8 * k));
    dds[128] = 0, dds[129] = 0xF8;                    /* colour 0: red, 5:6:5 */
    dds[132] = dds[133] = dds[134] = dds[135] = 0x44; /* 0, 1, 0, 1 */
    image = decode(dds, sizeof dds, NULL, &alpha);
    assert_int_equal(image.width, 4);
    expect(&image, 0, 0, 255, 0, 0, 255);
    expect(&image, 1, 3, 0, 0, 0, 255);
    sv_image_free(&image);
    dds[132] = 0xE4; /* 0, 1, 2, 3: two thirds, one third */
    image = decode(dds, sizeof dds, NULL, &alpha);
    expect(&image, 2, 0, 170, 0, 0, 255);
    expect(&image, 3, 0, 85, 0, 0, 255);
    sv_image_free(&image);
    dds[128] = 0, dds[129] = 0, dds[130] = 0, dds[131] = 0xF8; /* first below second: half way, and clear */
    image = decode(dds, sizeof dds, NULL, &alpha);
    expect(&image, 2, 0, 127, 0, 0, 255);
    expect(&image, 3, 0, 0, 0, 0, 0);
    sv_image_free(&image);
    assert_int_equal(sv_image_decode_bytes(dds, sizeof dds - 1, NULL, 16, &image, NULL, &e), SV_EFORMAT);
    /* DXT5: alpha from 200 to 60 in sevenths; DXT3: four bits of alpha */
    unsigned char dxt[128 + 16];
    memcpy(dxt, dds, 128);
    memset(dxt + 128, 0, 16);
    dxt[87] = '5';
    dxt[128] = 200, dxt[129] = 60, dxt[130] = 0x88, dxt[131] = 0xC6, dxt[132] = 0xFA; /* 0 1 2 3 4 5 6 7 */
    dxt[136] = 0xE0, dxt[137] = 0x07;                                                 /* green */
    image = decode(dxt, sizeof dxt, NULL, &alpha);
    static const int ramp[8] = {200, 60, 180, 160, 140, 120, 100, 80};
    for (int i = 0; i < 8; i++)
        expect(&image, i % 4, i / 4, 0, 255, 0, ramp[i]);
    sv_image_free(&image);
    dxt[87] = '3';
    image = decode(dxt, sizeof dxt, NULL, &alpha);
    expect(&image, 0, 0, 0, 255, 0, 8 * 17);
    expect(&image, 1, 0, 0, 255, 0, 12 * 17);
    sv_image_free(&image);
    /* plain, 16 bits 5:6:5 */
    for (size_t i = 0; i < 9; i++)
        dxt[80 + (i < 1 ? i : i + 7)] = (unsigned char)"\x40\x10\0\0\0\0\xF8\0\0"[i];
    dxt[92] = 0, dxt[93] = 0xF8, dxt[96] = 0xE0, dxt[97] = 0x07, dxt[100] = 0x1F, dxt[104] = 0;
    dxt[12] = 2, dxt[16] = 4, dxt[128] = 0x1F, dxt[129] = 0xF8;
    image = decode(dxt, sizeof dxt, NULL, &alpha);
    expect(&image, 0, 0, 255, 0, 255, 255);
    sv_image_free(&image);
}

static void test_real_sgi(void **state)
{
    (void)state;
    const char *root = getenv("SV_DATA");
    char path[1024];
    snprintf(path, sizeof path, "%s/objects/church/big-church.rgb", root && *root ? root : "../shared/data");
    if (access(path, R_OK) != 0) {
        print_message("skipped: no real textures (SV_DATA)\n");
        skip();
    }
    struct sv_image image;
    struct sv_error e;
    bool alpha;
    assert_int_equal(sv_image_decode_file(path, 4096, &image, &alpha, &e), SV_OK);
    assert_int_equal(image.width, 64);
    assert_int_equal(image.height, 64);
    sv_image_free(&image);
}

/* max_side: area averages in linear light, colour weighted by alpha, against sums in double over the same
 * boxes. */
static void test_average(void **state)
{
    (void)state;
    struct sv_image in = make(30, 20, 4, SV_PIXEL_U8), out;
    struct sv_rng rng = sv_rng_seeded(4, 4);
    for (int i = 0; i < 30 * 20 * 4; i++)
        ((unsigned char *)in.data)[i] = (unsigned char)(sv_rng_next(&rng) >> 56);
    for (int i = 0; i < 30; i++) /* a box of nothing but alpha 0 */
        ((unsigned char *)in.data)[4 * (i / 5 % 5 * 30 + i % 5) + 3] = 0;
    size_t size;
    struct sv_error e;
    void *bytes = encode(&in, SV_FORMAT_PNG, &size);
    assert_int_equal(sv_image_decode_bytes(bytes, size, NULL, 6, &out, NULL, &e), SV_OK);
    assert_int_equal(out.width, 6);
    assert_int_equal(out.height, 4);
    for (int y = 0; y < 4; y++)
        for (int x = 0; x < 6; x++) {
            double sum[4] = {0}, plain[3] = {0};
            for (int k = 0; k < 25; k++) {
                const unsigned char *p =
                    (unsigned char *)in.data + 4 * ((5 * y + k / 5) * 30 + 5 * x + k % 5);
                for (int c = 0; c < 3; c++) {
                    double v = p[c] / 255.0, l = v <= 0.04045 ? v / 12.92 : pow((v + 0.055) / 1.055, 2.4);
                    sum[c] += l * p[3] / 255.0, plain[c] += l / 25;
                }
                sum[3] += p[3] / 255.0;
            }
            const unsigned char *q = (unsigned char *)out.data + 4 * (6 * y + x);
            assert_true(fabs(q[3] - sum[3] / 25 * 255) < 0.51);
            for (int c = 0; c < 3; c++) {
                double l = sum[3] > 0 ? sum[c] / sum[3] : plain[c];
                double s = l <= 0.0031308 ? l * 12.92 : 1.055 * pow(l, 1 / 2.4) - 0.055;
                assert_true(fabs(q[c] - s * 255) < 0.52);
            }
        }
    sv_image_free(&out);
    assert_int_equal(sv_image_decode_bytes(bytes, size, NULL, 1, &out, NULL, &e),
                     SV_OK); /* odd shapes keep one pixel */
    assert_true(out.width == 1 && out.height == 1);
    sv_image_free(&out);
    assert_int_equal(sv_image_decode_bytes(bytes, size, NULL, 0, &out, NULL, &e), SV_EINVAL);
    sv_image_free(&in);
    free(bytes);
}

/* Linear floats become sRGB; infinities and NaN something defined. */
static void test_float(void **state)
{
    (void)state;
    struct sv_image in = make(4, 1, 3, SV_PIXEL_F32);
    static const float v[12] = {0,        0.5f, 1,         2,      -1,         0.2158605f,
                                INFINITY, NAN,  -INFINITY, 1e-30f, 0.0031308f, 0.99f};
    memcpy(in.data, v, sizeof v);
    size_t size;
    bool alpha;
    void *bytes = encode(&in, SV_FORMAT_EXR, &size);
    struct sv_image out = decode(bytes, size, NULL, &alpha);
    assert_false(alpha);
    expect(&out, 0, 0, 0, 188, 255, 255);
    expect(&out, 1, 0, 255, 0, 128, 255);
    expect(&out, 2, 0, 255, 0, 0, 255);
    expect(&out, 3, 0, 0, 10, 254, 255);
    sv_image_free(&out);
    sv_image_free(&in);
    free(bytes);
}

static void test_refused(void **state)
{
    (void)state;
    struct sv_image image;
    struct sv_error e;
    assert_int_equal(sv_image_decode_file("/nonexistent/x.png", 64, &image, NULL, &e), SV_ENOENT);
    assert_non_null(strstr(e.field, "x.png"));
    assert_int_equal(sv_image_decode_file("/tmp", 64, &image, NULL, &e), SV_EFORMAT);
    assert_int_equal(sv_image_decode_bytes("", 0, "png", 64, &image, NULL, &e), SV_EFORMAT);
    assert_int_equal(sv_image_decode_bytes(NULL, 0, NULL, 64, &image, NULL, &e), SV_EFORMAT);
    assert_int_equal(sv_image_decode_bytes("plain text is no picture", 24, "png", 64, &image, NULL, &e),
                     SV_EFORMAT);
    assert_int_equal(sv_image_decode_bytes("plain text is no picture", 24, "mp4", 64, &image, NULL, &e),
                     SV_EFORMAT);
    /* over the limit: the header alone says so, nothing is allocated for it */
    unsigned char png[256], tga[18 + 64] = {0, 0, 2, [12] = 0x20, [13] = 0x4E, [14] = 1, [16] = 24};
    size_t n = make_png(png, 20000, 20000, 8, 2, NULL, 0, NULL, 0, png, 0);
    assert_int_equal(sv_image_decode_bytes(png, n, NULL, 64, &image, NULL, &e), SV_ELIMIT);
    assert_non_null(strstr(e.message, "16384"));
    assert_int_equal(sv_image_decode_bytes(tga, sizeof tga, "tga", 64, &image, NULL, &e), SV_ELIMIT);
    n = make_png(png, 16384, 16384, 16, 6, NULL, 0, NULL, 0, png, 0); /* 2 GiB of pixels is the most */
    enum sv_status status = sv_image_decode_bytes(png, n, NULL, 64, &image, NULL, &e);
    assert_true(status == SV_EFORMAT || status == SV_ELIMIT);
}

static long peak_kb(void)
{
    struct rusage usage;
    getrusage(RUSAGE_SELF, &usage);
    return usage.ru_maxrss;
}

/* What an attribute of OpenEXR claims is believed only where the file holds as much: no memory on its word.
 */
static void test_exr_claims(void **state)
{
    (void)state;
    struct sv_image in = make(5, 3, 3, SV_PIXEL_F32), out;
    memset(in.data, 0, sv_image_bytes(&in));
    size_t size, at = 8;
    struct sv_error e;
    unsigned char *bytes = encode(&in, SV_FORMAT_EXR, &size);
    int attributes = 0;
    while (bytes[at]) {
        at += strlen((char *)bytes + at) + 1;
        const char *type = (char *)bytes + at;
        at += strlen(type) + 1;
        unsigned char kept[4];
        uint32_t value;
        memcpy(kept, bytes + at, 4);
        memcpy(&value, bytes + at, 4); /* little-endian, as this machine */
        if (strcmp(type, "string") == 0) {
            long before = peak_kb();
            memcpy(bytes + at, &(uint32_t){0x40000000}, 4);
            assert_int_equal(sv_image_decode_bytes(bytes, size, NULL, 64, &out, NULL, &e), SV_EFORMAT);
            assert_true(peak_kb() - before < 100 << 10);
            attributes++;
        }
        for (int k = 0; k < 2; k++) { /* one byte more than there is */
            memcpy(bytes + at, &(uint32_t){(uint32_t)(size - at - 4) + (k ? 1 : 0x80000000u)}, 4);
            assert_int_equal(sv_image_decode_bytes(bytes, size, NULL, 64, &out, NULL, &e), SV_EFORMAT);
        }
        memcpy(bytes + at, kept, 4);
        at += 4 + value;
    }
    assert_true(attributes > 0);
    for (size_t cut = 4; cut <= at; cut++) /* headers that do not end */
        assert_int_equal(sv_image_decode_bytes(bytes, cut, NULL, 64, &out, NULL, &e), SV_EFORMAT);
    assert_int_equal(sv_image_decode_bytes(bytes, size, NULL, 64, &out, NULL, &e), SV_OK);
    sv_image_free(&out);
    sv_image_free(&in);
    free(bytes);
}

/* Every truncation and 2000 flips of every format: an answer, never a crash; what decodes has the size it
 * claims. */
static void test_damaged(void **state)
{
    (void)state;
    struct sv_image rgba;
    picture_make(40, 30, &rgba, NULL, NULL);
    struct sv_image rgb = make(40, 30, 3, SV_PIXEL_U8);
    for (int i = 0; i < 1200; i++)
        memcpy((char *)rgb.data + 3 * i, (char *)rgba.data + 4 * i, 3);
    struct sv_rng rng = sv_rng_seeded(11, 3);
    for (int f = 0; f < SV_FORMAT_COUNT; f++) {
        size_t size;
        unsigned char *bytes = encode(f == SV_FORMAT_JPEG ? &rgb : &rgba, (enum sv_format)f, &size);
        unsigned char *copy = malloc(size);
        assert_non_null(copy);
        for (int k = 0; k < 1000; k++) {
            size_t n = k < 500 ? (size_t)((double)size * k / 500) : size;
            memcpy(copy, bytes, size);
            for (int j = 0; k >= 500 && j < 1 + k % 4; j++)
                copy[sv_rng_next(&rng) % size] = (unsigned char)(sv_rng_next(&rng) >> 56);
            struct sv_image out = {0};
            struct sv_error e = {0};
            enum sv_status status = sv_image_decode_bytes(copy, n, NULL, 64, &out, NULL, &e);
            assert_true(status == SV_OK || e.message[0]);
            assert_true(status == SV_OK ? out.width >= 1 && out.width <= 64 && out.data : !out.data);
            sv_image_free(&out);
        }
        free(copy);
        free(bytes);
    }
    sv_image_free(&rgb);
    sv_image_free(&rgba);
}

static int setup(void **state)
{
    (void)state;
    sv_image_init();
    return 0;
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_exr_claims), /* first: it looks at the most memory that the process has had */
        cmocka_unit_test(test_png_kinds),     cmocka_unit_test(test_channels),
        cmocka_unit_test(test_other_formats), cmocka_unit_test(test_real_sgi),
        cmocka_unit_test(test_average),       cmocka_unit_test(test_float),
        cmocka_unit_test(test_refused),       cmocka_unit_test(test_damaged),
    };
    return cmocka_run_group_tests(tests, setup, NULL);
}
