/* image.h - pixels in memory: a plain value that every module hands around.
 *
 * Row 0 at the top (pictures) or at the south (terrain textures): the owner's header says which. Rows are contiguous:
 * stride = width * channels * sizeof(type). 8-bit RGB is sRGB, A is linear and straight; floats are linear or metric. */
#ifndef SV_BASE_IMAGE_H
#define SV_BASE_IMAGE_H

#include <stddef.h>
#include <stdint.h>

#include "core/base/error.h"

#define SV_PIXEL_TYPE_LIST(X)                                                                                \
    X(SV_PIXEL_U8, 1)                                                                                        \
    X(SV_PIXEL_U16, 2)                                                                                       \
    X(SV_PIXEL_U32, 4)                                                                                       \
    X(SV_PIXEL_F32, 4)

enum sv_pixel_type {
#define X(name, bytes) name,
    SV_PIXEL_TYPE_LIST(X)
#undef X
        SV_PIXEL_TYPE_COUNT
};

struct sv_image {
    int width, height, channels; /* 1 .. 65536, 1 .. 65536, 1 .. 16; all 0: no image */
    enum sv_pixel_type type;
    void *data; /* owner: whoever filled it; see sv_image_alloc / the arena */
};

/* Bytes of one sample of a type. */
size_t sv_pixel_bytes(enum sv_pixel_type type);
/* Bytes of the whole image. */
size_t sv_image_bytes(const struct sv_image *image);
/* Zeroed heap pixels; out is written on success only. SV_EINVAL on sizes out of range, SV_ENOMEM. */
SV_MUST_CHECK enum sv_status sv_image_alloc(int width, int height, int channels, enum sv_pixel_type type,
                                            struct sv_image *out, struct sv_error *error);
/* Frees pixels that sv_image_alloc gave, and empties the value. Legal on an empty image. */
void sv_image_free(struct sv_image *image);

#endif
