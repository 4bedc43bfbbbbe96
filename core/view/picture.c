/* picture.c - see picture.h. */
#include "core/view/picture.h"

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
        struct sv_image like = sv_picture_layer(k, camera->width, row_count);
        enum sv_status status =
            sv_image_alloc(like.width, like.height, like.channels, like.type, &picture->layer[k], error);
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
