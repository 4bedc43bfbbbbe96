/* encode.h - pictures to bytes and back, by OpenImageIO behind C (encode.cpp and decode.cpp let no exception
 * out); WebP by libwebp, and SGI, TGA and DDS by readers of our own.
 *
 * sv_image_init first, before any fork: OpenImageIO threads=1, exr_threads=-1, so that forked children can
 * encode (tested). All calls are stateless; one thread at a time. Nothing here prints (libpng itself has a
 * line on standard error for a damaged PNG). Equal input gives equal bytes: no file carries a time.
 *
 * Settings, chosen by `tests/core/image/sweep_encode 512` (a made-up landscape), and with a forest photo
 * stretched to 512 (second pair); best of five on one core of a shared 2-core x86-64 machine, OpenImageIO
 * 2.4.7, libwebp 1.2.4. ms and kB:
 *   jpeg  q85 4:2:0 baseline             1.5   51 |  2.2  121   chosen (4:4:4 from q90 on)
 *         q85 4:4:4                      1.6   61 |  3.3  144
 *         q85 4:2:0 progressive          8.8   47 |   16  111
 *   png   default (level 6)               56  230 |   67  494
 *         level 1, filter up              10  249 |   30  473   chosen
 *         level 1, no filter              12  236 |   28  491
 *   webp  q85 by OpenImageIO             103   40 |  167  117   always method 6, whatever webp:method says
 *         q85 libwebp method 0           9.6   67 |   27  122
 *         q85 libwebp method 1            13   48 |   22  121   chosen, by libwebp itself (webp.c)
 *         q85 libwebp method 4            36   42 |   52  118
 *   tiff  default (zip 6)                 44  242 |   61  489
 *         zip, tiff:zipquality 1          10  250 |   26  496   chosen
 *         lzw                             14  264 |   21  716
 *         float depth: zip 1              14  341               chosen; none 1.3 and 1049
 *   exr   half RGB: piz                   26  370 |   27  593   chosen when all channels are half
 *         half RGB: zip 1                 35  749 |   35  884
 *         float depth: zip 1              32  673               chosen for all else
 *         float depth: piz                62  576
 *         float depth: rle                 7  895
 *         u32 ids: zip 1                 4.6   19               chosen; piz 20 and 59 */
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

/* Sets OpenImageIO's threads and builds its tables and ours. Idempotent; before any other call here and
 * before any fork. */
void sv_image_init(void);

/* One channel group of a picture: pixels and the names of their channels ("R","G","B","A"; "Z";
 * "N.X","N.Y","N.Z"; "id"). */
struct sv_encode_layer {
    const struct sv_image *image;
    const char *const *channel_names; /* image->channels of them, unique in the file; only exr needs them */
};

struct sv_geo_tags {           /* for TIFF of an orthographic view */
    double origin_x, origin_y; /* world place of the top left corner of the top left pixel */
    double pixel_x, pixel_y;   /* m, > 0 */
    double rotation_rad;       /* heading of the picture's up direction; 0: north up */
    int epsg;                  /* of a projected system, 1024..32766 (what GeoTIFF can name); 0: unknown */
};

struct sv_encode_options {
    enum sv_format format;
    int quality;                        /* 1..100, lossy formats */
    const struct sv_geo_tags *geo_tags; /* TIFF; NULL: none */
};

/* Encodes layers (1 .. SV_ENCODE_LAYERS_MAX, equal sizes; several only for exr) into fresh heap bytes (caller
 * frees). What a format holds:
 *   jpeg  u8, 1 or 3 channels (a fourth would be lost: refused), sides to 65500
 *   png   u8, u16, 1 to 4 channels (grey, grey and alpha, RGB, RGBA)
 *   webp  u8, 3 or 4 channels, sides to 16383; colour is lossy, alpha exact
 *   tiff  u8, u16, u32, f32; u8 and u16 of 2 or 4 channels: the last is alpha
 *   exr   u8 (sRGB, stored as linear half; of 2 or 4 channels the last is alpha, and colour is multiplied
 *         by it, as exr demands), u32 and f32 as they are; each channel keeps its own type
 * Alpha is straight in all but exr; NaN and infinities pass through f32.
 * SV_EUNSUPPORTED: the format cannot hold it, the message says what; SV_EINVAL: quality, names, sizes, geo
 * tags; SV_ELIMIT: too large for the format; SV_ENOMEM. */
SV_MUST_CHECK enum sv_status sv_image_encode(const struct sv_encode_layer *layers, int count,
                                             const struct sv_encode_options *options, void **bytes,
                                             size_t *size, struct sv_error *error);

/* Reads a picture file, or bytes of one, as u8 sRGB with 4 channels (grey spread, palette expanded, alpha
 * straight and 255 when absent, has_alpha (may be NULL) told), row 0 at the top; a picture with a side over
 * max_side (>= 1) is averaged down to it, in linear light weighted by alpha. Heap image. Formats: png, jpeg,
 * tiff, webp, exr, sgi (rgb), tga, dds, bmp, gif (first frame), hdr, pnm, told by their bytes; extension
 * (no dot, any case, may be NULL) matters for tga only, which has no magic. 16-bit integers are taken as
 * sRGB, floats as linear. Any bytes are legal input. SV_ENOENT, SV_EIO (the file), SV_EFORMAT, SV_ELIMIT over
 * SV_DECODE_SIDE_MAX a side, files over 1 GiB, pixels over 2 GiB, or more than its format can pack into its
 * bytes (from 1 MiB on); SV_EINVAL (max_side), SV_ENOMEM. */
SV_MUST_CHECK enum sv_status sv_image_decode_file(const char *path, int max_side, struct sv_image *rgba,
                                                  bool *has_alpha, struct sv_error *error);
SV_MUST_CHECK enum sv_status sv_image_decode_bytes(const void *bytes, size_t size, const char *extension,
                                                   int max_side, struct sv_image *rgba, bool *has_alpha,
                                                   struct sv_error *error);
/* Reads any picture of up to 16 channels as it is (u8, u16, u32; every float, and channels of mixed types, as
 * f32; exr stays premultiplied): tests and tools. Heap image. */
SV_MUST_CHECK enum sv_status sv_image_decode_raw(const void *bytes, size_t size, const char *extension,
                                                 struct sv_image *image, struct sv_error *error);
/* One channel by its name in the type it has there (an exr may hold u32 ids beside halves, which come as
 * f32). SV_ENOENT. */
SV_MUST_CHECK enum sv_status sv_image_decode_channel(const void *bytes, size_t size, const char *extension,
                                                     const char *channel, struct sv_image *image,
                                                     struct sv_error *error);

#endif
