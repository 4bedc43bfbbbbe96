/* private.h - the parts of core/image among themselves: WebP by libwebp, our own readers of SGI, TGA and DDS,
 * a look at headers of OpenEXR, tags added to a finished TIFF. */
#ifndef SV_IMAGE_PRIVATE_H
#define SV_IMAGE_PRIVATE_H

#include "core/image/encode.h"

/* Lossy WebP of a u8 image of 3 or 4 channels, 1..16383 a side, quality 1..100. Fresh heap bytes. */
SV_MUST_CHECK enum sv_status sv_webp_encode(const struct sv_image *image, int quality, void **bytes,
                                            size_t *size, struct sv_error *error);
/* A still WebP picture as u8 with 3 channels, or 4 when it has alpha (straight). Heap image. Any bytes are
 * legal input: SV_EFORMAT, SV_EUNSUPPORTED (an animation). */
SV_MUST_CHECK enum sv_status sv_webp_decode(const void *bytes, size_t size, struct sv_image *image,
                                            struct sv_error *error);

/* SV_ELIMIT when a picture's claim (sides > 0) is over SV_DECODE_SIDE_MAX a side, over 2 GiB of pixels, or
 * over 1 MiB and `expansion` times its file: a few bytes that claim a gigabyte are refused before it is
 * touched. */
SV_MUST_CHECK enum sv_status sv_image_check_claim(int width, int height, int channels, size_t sample_bytes,
                                                  size_t file_bytes, size_t expansion,
                                                  struct sv_error *error);

/* An SGI picture (.rgb) as u8 or u16 with 1 to 4 channels, row 0 at the top. Heap image. Any bytes are legal
 * input: SV_EFORMAT. */
SV_MUST_CHECK enum sv_status sv_sgi_decode(const void *bytes, size_t size, struct sv_image *image,
                                           struct sv_error *error);

/* A TGA picture as u8 with 3 channels, or 4 when it has alpha, row 0 at the top. Heap image. Any bytes are
 * legal input: SV_EFORMAT. */
SV_MUST_CHECK enum sv_status sv_tga_decode(const void *bytes, size_t size, struct sv_image *image,
                                           struct sv_error *error);

/* The top level of a DDS picture as u8 RGBA, row 0 at the top. Heap image. Any bytes are legal input:
 * SV_EFORMAT. */
SV_MUST_CHECK enum sv_status sv_dds_decode(const void *bytes, size_t size, struct sv_image *image,
                                           struct sv_error *error);

/* SV_EFORMAT when an attribute in the headers of an OpenEXR file (its magic is there) claims more bytes than follow it,
 * or the headers do not end. Any other bytes are legal input. */
SV_MUST_CHECK enum sv_status sv_exr_check(const void *bytes, size_t size, struct sv_error *error);

/* Rewrites the directory of a classic little-endian TIFF (*bytes, from malloc, of *size bytes; may be moved):
 * takes the DateTime tag out, so that equal pictures give equal bytes, and adds GeoTIFF tags when geo is not
 * NULL. Any bytes are legal input: SV_EFORMAT, with *bytes as they were. */
SV_MUST_CHECK enum sv_status sv_geotiff_finish(void **bytes, size_t *size, const struct sv_geo_tags *geo,
                                               struct sv_error *error);

#endif
