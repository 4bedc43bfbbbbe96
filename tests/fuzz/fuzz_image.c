/* fuzz_image.c - pictures of every format that textures come in, sound and broken (fuzz_main.h): any bytes
 * decode to a picture of a legal size or are refused with a reason. The first byte picks the extension that
 * the reader is told. */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "core/image/encode.h"
#include "tests/fuzz/fuzz_main.h"

const char *const fuzz_words[] = {"\xff\xff\xff\xff",
                                  "\xff\xff\xff\x7f",
                                  "\x80\x80",
                                  "IHDR",
                                  "IDAT",
                                  "PLTE",
                                  "tRNS",
                                  "RIFF",
                                  "VP8 ",
                                  "VP8L",
                                  "ALPH",
                                  "DXT1",
                                  "DXT5",
                                  "DX10",
                                  "II*",
                                  "MM",
                                  "BM",
                                  "GIF89a",
                                  "8BPS",
                                  "#?RADIANCE",
                                  "P6",
                                  "P5",
                                  "channels",
                                  "zip",
                                  "\xff\xd8\xff\xdb",
                                  "\xff\xc0",
                                  NULL};

static const char *const extensions[] = {NULL,  "png", "jpg", "webp", "tif", "exr", "tga",
                                         "sgi", "dds", "bmp", "gif",  "psd", "hdr", "pnm"};
enum { EXTENSIONS = sizeof extensions / sizeof *extensions, SIDE_MAX = 64 };

static long decoded, refused;

static void broken(const char *promise)
{
    fprintf(stderr, "fuzz_image: %s\n", promise);
    abort();
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    static bool ready;
    if (!ready)
        sv_image_init();
    ready = true;
    const char *extension = size ? extensions[data[0] % EXTENSIONS] : NULL;
    const uint8_t *bytes = size ? data + 1 : data;
    size = size ? size - 1 : 0;
    struct sv_image image = {0};
    struct sv_error error = {0};
    bool alpha = false;
    enum sv_status status = sv_image_decode_bytes(bytes, size, extension, SIDE_MAX, &image, &alpha, &error);
    if (status == SV_OK) {
        decoded++;
        if (image.width < 1 || image.width > SIDE_MAX || image.height < 1 || image.height > SIDE_MAX ||
            image.channels != 4 || image.type != SV_PIXEL_U8)
            broken("a decoded picture has an illegal size");
        unsigned sum = 0;
        for (size_t i = 0; i < sv_image_bytes(&image); i++)
            sum += ((unsigned char *)image.data)[i];
        for (size_t i = 3; !alpha && i < sv_image_bytes(&image); i += 4)
            if (((unsigned char *)image.data)[i] != 255)
                broken("a picture without alpha is not opaque");
        (void)sum;
        sv_image_free(&image);
        return 0;
    }
    refused++;
    if (image.data || !error.message[0] ||
        (status != SV_EFORMAT && status != SV_ELIMIT && status != SV_ENOMEM && status != SV_EUNSUPPORTED &&
         status != SV_EINTERNAL)) {
        fprintf(stderr, "%s: '%s'\n", sv_status_text(status), error.message);
        broken("a refusal has no reason, or left something behind");
    }
    return 0;
}

/* One of our own formats, 1 to 20 pixels a side, any legal type. */
static size_t seed_encoded(struct sv_rng *rng, uint8_t *out)
{
    static const struct {
        enum sv_format format;
        enum sv_pixel_type type;
        int channels;
    } kinds[] = {{SV_FORMAT_PNG, SV_PIXEL_U8, 4},   {SV_FORMAT_PNG, SV_PIXEL_U16, 3},
                 {SV_FORMAT_PNG, SV_PIXEL_U8, 1},   {SV_FORMAT_JPEG, SV_PIXEL_U8, 3},
                 {SV_FORMAT_JPEG, SV_PIXEL_U8, 1},  {SV_FORMAT_WEBP, SV_PIXEL_U8, 3},
                 {SV_FORMAT_WEBP, SV_PIXEL_U8, 4},  {SV_FORMAT_TIFF, SV_PIXEL_U8, 4},
                 {SV_FORMAT_TIFF, SV_PIXEL_F32, 1}, {SV_FORMAT_TIFF, SV_PIXEL_U16, 3},
                 {SV_FORMAT_EXR, SV_PIXEL_U8, 4},   {SV_FORMAT_EXR, SV_PIXEL_F32, 3},
                 {SV_FORMAT_EXR, SV_PIXEL_U32, 1}};
    static const char *const names[] = {"R", "G", "B", "A"};
    size_t k = sv_rng_next(rng) % (sizeof kinds / sizeof *kinds);
    struct sv_image image;
    struct sv_error error;
    int w = 1 + (int)(sv_rng_next(rng) % 20), h = 1 + (int)(sv_rng_next(rng) % 20);
    if (sv_image_alloc(w, h, kinds[k].channels, kinds[k].type, &image, &error) != SV_OK)
        broken("no memory for a seed");
    for (size_t i = 0; i < sv_image_bytes(&image); i++)
        ((unsigned char *)image.data)[i] = (unsigned char)(i * 7 + (sv_rng_next(rng) >> 60));
    struct sv_encode_layer layer = {&image, names};
    struct sv_encode_options options = {kinds[k].format, 85, NULL};
    void *bytes;
    size_t size;
    if (sv_image_encode(&layer, 1, &options, &bytes, &size, &error) != SV_OK || size > FUZZ_INPUT_MAX - 1)
        broken("a seed does not encode");
    memcpy(out, bytes, size);
    free(bytes);
    sv_image_free(&image);
    return size;
}

/* Headers of formats that only others write; random pixels follow. */
static size_t seed_foreign(struct sv_rng *rng, uint8_t *out, uint8_t *extension)
{
    static const struct {
        uint8_t extension;
        size_t size;
        const char *header;
        size_t body;
    } kinds[] = {
        {6, 18, "\0\0\2\0\0\0\0\0\0\0\0\0\4\0\4\0\x20\x28", 64},
        {6, 18, "\0\0\x0a\0\0\0\0\0\0\0\0\0\4\0\4\0\x18\0", 80},
        {6, 18, "\0\1\1\0\0\4\0\x18\0\0\0\0\4\0\4\0\x08\0", 40},
        {7, 20, "\x01\xda\0\1\0\3\0\4\0\4\0\3\0\0\0\0\0\0\0\xff", 492 + 48},
        {7, 20, "\x01\xda\1\1\0\3\0\4\0\4\0\3\0\0\0\0\0\0\0\xff", 700},
        {9, 54,
         "BM\x66\0\0\0\0\0\0\0\x36\0\0\0\x28\0\0\0\4\0\0\0\4\0\0\0\1\0\x18\0\0\0\0\0\x30\0\0\0\0\0\0\0\0\0\0"
         "\0\0\0\0\0\0\0\0\0",
         48},
        {10, 32, "GIF89a\4\0\4\0\x80\0\0\0\0\0\xff\xff\xff,\0\0\0\0\4\0\4\0\0\2\5\x84", 10},
        {11, 26, "8BPS\0\1\0\0\0\0\0\0\0\3\0\0\0\4\0\0\0\4\0\x08\0\3", 64},
        {12, 44, "#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y 4 +X 4\n", 64},
        {13, 11, "P6\n4 4\n255\n", 48},
        {13, 11, "P5\n4 4\n255\n", 16},
    };
    size_t k = sv_rng_next(rng) % (sizeof kinds / sizeof *kinds);
    memcpy(out, kinds[k].header, kinds[k].size);
    for (size_t i = 0; i < kinds[k].body; i++)
        out[kinds[k].size + i] = (uint8_t)(sv_rng_next(rng) >> 56);
    *extension = kinds[k].extension;
    return kinds[k].size + kinds[k].body;
}

/* A DDS of 8 x 8: DXT1, DXT3, DXT5 or plain BGRA. */
static size_t seed_dds(struct sv_rng *rng, uint8_t *out)
{
    static const char *const codes[] = {"DXT1", "DXT3", "DXT5", NULL};
    size_t k = sv_rng_next(rng) % 4;
    memset(out, 0, 128);
    memcpy(out, "DDS |", 5);
    out[8] = 7, out[9] = 0x10, out[12] = 8, out[16] = 8, out[76] = 32, out[80] = codes[k] ? 4 : 0x41,
    out[109] = 0x10;
    if (codes[k]) {
        memcpy(out + 84, codes[k], 4);
    } else {
        out[88] = 32, out[94] = 0xff, out[97] = 0xff, out[100] = 0xff, out[107] = 0xff;
    }
    for (size_t i = 128; i < 128 + 256; i++)
        out[i] = (uint8_t)(sv_rng_next(rng) >> 56);
    return 128 + 256;
}

size_t fuzz_seed_input(struct sv_rng *rng, uint8_t out[FUZZ_INPUT_MAX])
{
    out[0] = 0;
    switch (sv_rng_next(rng) % 4) {
    case 0:
        out[0] = 8;
        return 1 + seed_dds(rng, out + 1);
    case 1:
        return 1 + seed_foreign(rng, out + 1, out);
    default:
        return 1 + seed_encoded(rng, out + 1);
    }
}

void fuzz_report(void)
{
    printf("%ld decoded, %ld refused\n", decoded, refused);
}
