/* encode.h - pictures to bytes and back, by OpenImageIO behind C (encode.cpp and decode.cpp let no exception
 * out).
 *
 * sv_image_init first, before any fork: OpenImageIO threads=1, exr_threads=-1 (design.md section 2). */
#ifndef SV_IMAGE_ENCODE_H
#define SV_IMAGE_ENCODE_H

#include <stdbool.h>
#include <stddef.h>

#include "core/base/image.h"

#define SV_FORMAT_LIST(X)                   \
    X(SV_FORMAT_JPEG, "jpeg", "image/jpeg") \
    X(SV_FORMAT_PNG, "png", "image/png")    \
    X(SV_FORMAT_WEBP, "webp", "image/webp") \
    X(SV_FORMAT_TIFF, "tiff", "image/tiff") \
    X(SV_FORMAT_EXR, "exr", "image/x-exr")

enum sv_format {
#define X(name, text, media) name,
    SV_FORMAT_LIST(X)
#undef X
        SV_FORMAT_COUNT
};

enum { SV_ENCODE_LAYERS_MAX = 8, SV_DECODE_SIDE_MAX = 16384 };

void sv_image_init(void);

/* One channel group of a picture: pixels and the names of their channels ("R","G","B","A"; "Z";
 * "N.X","N.Y","N.Z"; "id"). */
struct sv_encode_layer {
    const struct sv_image *image;
    const char *const *channel_names; /* image->channels of them */
};

struct sv_geo_tags {           /* for TIFF of an orthographic view */
    double origin_x, origin_y; /* world place of the top left corner of the top left pixel */
    double pixel_x, pixel_y;   /* m, > 0 */
    double rotation_rad;       /* heading of the picture's up direction; 0: north up */
    int epsg;                  /* 0: unknown */
};

struct sv_encode_options {
    enum sv_format format;
    int quality;                        /* 1..100, lossy formats */
    const struct sv_geo_tags *geo_tags; /* TIFF; NULL: none */
};

/* Encodes layers (1 .. 8, equal sizes; several only for exr) into fresh heap bytes. Types: u8 for jpeg (3
 * channels; 4th dropped is an error), png, webp, tiff, exr (u8 sRGB is stored linear half in exr); f32 and
 * u32 for tiff and exr; a type the format cannot hold is SV_EUNSUPPORTED. */
SV_MUST_CHECK enum sv_status sv_image_encode(const struct sv_encode_layer *layers, int count,
                                             const struct sv_encode_options *options, void **bytes,
                                             size_t *size, struct sv_error *error);

/* Reads a picture file, or bytes of one (extension without dot tells the type, e.g. "png"; NULL: sniffed), as
 * u8 sRGB with 4 channels (grey spread, alpha 255 when absent, has_alpha told), row 0 at the top; larger than
 * max_side is averaged down. Heap image. SV_ENOENT, SV_EFORMAT, SV_ELIMIT over 16384 a side. */
SV_MUST_CHECK enum sv_status sv_image_decode_file(const char *path, int max_side, struct sv_image *rgba,
                                                  bool *has_alpha, struct sv_error *error);
SV_MUST_CHECK enum sv_status sv_image_decode_bytes(const void *bytes, size_t size, const char *extension,
                                                   int max_side, struct sv_image *rgba, bool *has_alpha,
                                                   struct sv_error *error);
/* Reads any picture as it is (float, uint, any channels): tests and tools. Heap image. */
SV_MUST_CHECK enum sv_status sv_image_decode_raw(const void *bytes, size_t size, const char *extension,
                                                 struct sv_image *image, struct sv_error *error);
/* One channel by its name in the type it has there (an exr may hold u32 ids beside halves). SV_ENOENT. */
SV_MUST_CHECK enum sv_status sv_image_decode_channel(const void *bytes, size_t size, const char *extension,
                                                     const char *channel, struct sv_image *image,
                                                     struct sv_error *error);

#endif
