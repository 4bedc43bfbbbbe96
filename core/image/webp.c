/* webp.c - WebP by libwebp itself: OpenImageIO 2.4.7 fixes the writer's method at 6, the slowest, and its
 * reader multiplies colour by alpha whatever it is asked (both measured: table in encode.h, test_encode.c).
 */
#include "core/image/private.h"

#include <stdlib.h>

#include <webp/decode.h>
#include <webp/encode.h>

/* Chosen by measurement (table in encode.h). */
enum { WEBP_METHOD = 1 };
/* Flat colour without loss goes further, but no texture is that. */
enum { EXPANSION = 2000 };

static int import_pixels(WebPPicture *picture, const struct sv_image *image)
{
    picture->width = image->width;
    picture->height = image->height;
    int stride = image->width * image->channels;
    return image->channels == 4 ? WebPPictureImportRGBA(picture, image->data, stride)
                                : WebPPictureImportRGB(picture, image->data, stride);
}

static bool configure(WebPConfig *config, int quality)
{
    if (!WebPConfigInit(config))
        return false;
    config->quality = (float)quality;
    config->method = WEBP_METHOD;
    return WebPValidateConfig(config);
}

enum sv_status sv_webp_encode(const struct sv_image *image, int quality, void **bytes, size_t *size,
                              struct sv_error *error)
{
    WebPConfig config;
    WebPPicture picture;
    if (!configure(&config, quality) || !WebPPictureInit(&picture))
        return sv_fail(error, SV_EINTERNAL, "image", "libwebp refuses its configuration");
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
        *bytes = writer.mem; /* WebPMalloc is malloc */
        *size = writer.size;
        WebPMemoryWriterInit(&writer);
    }
    WebPPictureFree(&picture);
    WebPMemoryWriterClear(&writer);
    return status;
}

enum sv_status sv_webp_decode(const void *bytes, size_t size, struct sv_image *image, struct sv_error *error)
{
    WebPBitstreamFeatures features;
    if (WebPGetFeatures(bytes, size, &features) != VP8_STATUS_OK)
        return sv_fail(error, SV_EFORMAT, "image", "webp: broken header");
    if (features.has_animation)
        return sv_fail(error, SV_EUNSUPPORTED, "image", "webp: an animation");
    struct sv_image out;
    int channels = features.has_alpha ? 4 : 3;
    enum sv_status status =
        sv_image_check_claim(features.width, features.height, channels, 1, size, EXPANSION, error);
    if (status == SV_OK)
        status = sv_image_alloc(features.width, features.height, channels, SV_PIXEL_U8, &out, error);
    if (status != SV_OK)
        return status;
    int stride = features.width * channels;
    size_t room = sv_image_bytes(&out);
    const uint8_t *done = channels == 4 ? WebPDecodeRGBAInto(bytes, size, out.data, room, stride)
                                        : WebPDecodeRGBInto(bytes, size, out.data, room, stride);
    if (!done) {
        sv_image_free(&out);
        return sv_fail(error, SV_EFORMAT, "image", "webp: broken data");
    }
    *image = out;
    return SV_OK;
}
