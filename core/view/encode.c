/* encode.c - a drawn picture to the bytes that a client asked for: which channels, under which names, in which type. */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "core/base/frames.h"
#include "core/view/renderer.h"

static const char *const color_names[] = {"R", "G", "B", "A"};
static const char *const depth_names[] = {"Z"};
static const char *const normal_names[] = {"N.X", "N.Y", "N.Z"};
static const char *const id_names[] = {"id"};

static const char *const *const layer_names[SV_LAYER_COUNT] = {
    [SV_LAYER_COLOR] = color_names,
    [SV_LAYER_DEPTH] = depth_names,
    [SV_LAYER_NORMAL] = normal_names,
    [SV_LAYER_ID] = id_names,
};

/* RGBA -> RGB: the sky is on, or the format has no alpha. */
static enum sv_status drop_alpha(const struct sv_image *rgba, struct sv_image *rgb, struct sv_error *error)
{
    enum sv_status status = sv_image_alloc(rgba->width, rgba->height, 3, SV_PIXEL_U8, rgb, error);
    if (status)
        return status;
    const uint8_t *s = rgba->data;
    uint8_t *d = rgb->data;
    for (size_t i = 0, n = (size_t)rgba->width * (size_t)rgba->height; i < n; i++, s += 4, d += 3)
        memcpy(d, s, 3);
    return SV_OK;
}

/* Unit normal components -1 .. 1 -> 0 .. 255, 0 -> 128 (rounded): the usual normal map. The sky's (0,0,0) is 128,128,128. */
static enum sv_status normal_to_u8(const struct sv_image *normal, struct sv_image *rgb, struct sv_error *error)
{
    enum sv_status status = sv_image_alloc(normal->width, normal->height, 3, SV_PIXEL_U8, rgb, error);
    if (status)
        return status;
    const float *s = normal->data;
    uint8_t *d = rgb->data;
    for (size_t i = 0, n = (size_t)normal->width * (size_t)normal->height * 3; i < n; i++)
        d[i] = (uint8_t)lrint(sv_clamp((double)s[i] * 127.5 + 127.5, 0, 255));
    return SV_OK;
}

/* Geo tags exist where a picture is a map: orthographic, straight down. */
static bool geo_tags(const struct sv_view_request *request, const struct sv_resolved_view *view, int epsg,
                     struct sv_geo_tags *tags)
{
    const struct sv_camera *c = &view->camera;
    if (request->format != SV_FORMAT_TIFF || c->projection != SV_PROJECTION_ORTHOGRAPHIC || c->forward.z > -1 + 1e-9)
        return false;
    double pixel = c->ortho_height_m / c->height;
    struct sv_vec3 corner = sv_madd(sv_madd(c->eye, c->up, pixel * c->height / 2), c->right, -pixel * c->width / 2);
    double heading = atan2(c->up.x, c->up.y);
    *tags = (struct sv_geo_tags){corner.x, corner.y, pixel, pixel, fabs(heading) < 1e-12 ? 0 : heading, epsg};
    return true;
}

enum sv_status sv_picture_encode(const struct sv_picture *picture, const struct sv_view_request *request,
                                 const struct sv_resolved_view *view, int epsg, void **bytes, size_t *size,
                                 struct sv_error *error)
{
    struct sv_encode_layer layers[SV_LAYER_COUNT];
    struct sv_image converted[SV_LAYER_COUNT] = {{0}};
    int count = 0;
    enum sv_status status = SV_OK;
    for (int k = 0; k < SV_LAYER_COUNT && !status; k++) {
        const struct sv_image *image = &picture->layer[k];
        if (!image->data)
            continue;
        if (k == SV_LAYER_COLOR && (request->sky || request->format == SV_FORMAT_JPEG))
            status = drop_alpha(image, &converted[k], error);
        if (k == SV_LAYER_NORMAL && request->format == SV_FORMAT_PNG)
            status = normal_to_u8(image, &converted[k], error);
        layers[count].image = converted[k].data ? &converted[k] : image;
        layers[count++].channel_names = k == SV_LAYER_NORMAL && converted[k].data ? color_names : layer_names[k];
    }
    struct sv_geo_tags tags;
    struct sv_encode_options options = {.format = request->format, .quality = request->q};
    if (geo_tags(request, view, epsg, &tags))
        options.geo_tags = &tags;
    if (!status)
        status = sv_image_encode(layers, count, &options, bytes, size, error);
    for (int k = 0; k < SV_LAYER_COUNT; k++)
        sv_image_free(&converted[k]);
    return status;
}
