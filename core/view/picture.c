/* picture.c - see picture.h. */
#include "core/view/picture.h"

static const struct {
    int channels;
    enum sv_pixel_type type;
} layer_form[SV_LAYER_COUNT] = {
    [SV_LAYER_COLOR] = {4, SV_PIXEL_U8},
    [SV_LAYER_DEPTH] = {1, SV_PIXEL_F32},
    [SV_LAYER_NORMAL] = {3, SV_PIXEL_F32},
    [SV_LAYER_ID] = {1, SV_PIXEL_U32},
};

enum sv_status sv_picture_alloc(const struct sv_camera *camera, unsigned layers, struct sv_picture *picture,
                                struct sv_error *error)
{
    return sv_picture_alloc_rows(camera, camera->height, layers, picture, error);
}

enum sv_status sv_picture_alloc_rows(const struct sv_camera *camera, int row_count, unsigned layers,
                                     struct sv_picture *picture, struct sv_error *error)
{
    for (int k = 0; k < SV_LAYER_COUNT; k++) {
        if (!(layers & 1u << k))
            continue;
        enum sv_status status = sv_image_alloc(camera->width, row_count, layer_form[k].channels,
                                               layer_form[k].type, &picture->layer[k], error);
        if (status)
            return status;
    }
    return SV_OK;
}

void sv_picture_finish(struct sv_picture *picture)
{
    for (int k = 0; k < SV_LAYER_COUNT; k++)
        sv_image_free(&picture->layer[k]);
}
