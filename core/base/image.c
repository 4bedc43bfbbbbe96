#include "core/base/image.h"

#include <stdlib.h>

size_t sv_pixel_bytes(enum sv_pixel_type type)
{
    static const size_t bytes[] = {
#define X(name, size) [name] = size,
        SV_PIXEL_TYPE_LIST(X)
#undef X
    };
    return (unsigned)type < SV_PIXEL_TYPE_COUNT ? bytes[type] : 0;
}

size_t sv_image_bytes(const struct sv_image *image)
{
    return (size_t)image->width * (size_t)image->height * (size_t)image->channels * sv_pixel_bytes(image->type);
}

enum sv_status sv_image_alloc(int width, int height, int channels, enum sv_pixel_type type, struct sv_image *out,
                              struct sv_error *error)
{
    if (width < 1 || width > 65536 || height < 1 || height > 65536 || channels < 1 || channels > 16 ||
        (unsigned)type >= SV_PIXEL_TYPE_COUNT)
        return sv_fail(error, SV_EINVAL, "image", "%d x %d x %d is outside 1..65536 x 1..65536 x 1..16", width,
                       height, channels);
    struct sv_image image = {width, height, channels, type, NULL};
    image.data = calloc(1, sv_image_bytes(&image));
    if (!image.data)
        return sv_fail(error, SV_ENOMEM, "image", "no memory for %d x %d x %d", width, height, channels);
    *out = image;
    return SV_OK;
}

void sv_image_free(struct sv_image *image)
{
    free(image->data);
    *image = (struct sv_image){0};
}
