/* webp.c - WebP out, by libwebp itself: OpenImageIO 2.4 fixes libwebp's method at 6, its slowest (table in
 * encode.h). */
#include "core/image/private.h"

#include <stdlib.h>

#include <webp/encode.h>

/* Chosen by measurement (encode.h): method 1 takes half the time of 2 and gives files 6 % larger. */
enum { WEBP_METHOD = 1 };

static int import_pixels(WebPPicture *picture, const struct sv_image *image)
{
    picture->width = image->width;
    picture->height = image->height;
    int stride = image->width * image->channels;
    return image->channels == 4 ? WebPPictureImportRGBA(picture, image->data, stride)
                                : WebPPictureImportRGB(picture, image->data, stride);
}

enum sv_status sv_webp_encode(const struct sv_image *image, int quality, void **bytes, size_t *size,
                              struct sv_error *error)
{
    if (image->width > WEBP_MAX_DIMENSION || image->height > WEBP_MAX_DIMENSION)
        return sv_fail(error, SV_ELIMIT, "image", "%d x %d: webp holds at most %d a side", image->width,
                       image->height, WEBP_MAX_DIMENSION);
    WebPConfig config;
    WebPPicture picture;
    if (!WebPConfigInit(&config) || !WebPPictureInit(&picture))
        return sv_fail(error, SV_EINTERNAL, "image", "libwebp of another version than its header");
    config.quality = (float)quality;
    config.method = WEBP_METHOD;
    config.thread_level = 0;
    WebPMemoryWriter writer;
    WebPMemoryWriterInit(&writer);
    picture.writer = WebPMemoryWrite;
    picture.custom_ptr = &writer;
    enum sv_status status = SV_OK;
    if (!import_pixels(&picture, image) || !WebPEncode(&config, &picture)) {
        bool memory = picture.error_code == VP8_ENC_ERROR_OUT_OF_MEMORY ||
                      picture.error_code == VP8_ENC_ERROR_BITSTREAM_OUT_OF_MEMORY;
        status = sv_fail(error, memory ? SV_ENOMEM : SV_EINTERNAL, "image", "libwebp error %d",
                         picture.error_code);
    } else {
        *bytes = writer.mem; /* from WebPMalloc, which is malloc */
        *size = writer.size;
        writer.mem = NULL;
    }
    WebPPictureFree(&picture);
    WebPMemoryWriterClear(&writer);
    return status;
}
