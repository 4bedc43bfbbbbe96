/* picture.h - a drawn view before encoding: one image a layer. */
#ifndef SV_VIEW_PICTURE_H
#define SV_VIEW_PICTURE_H

#include "core/base/error.h"
#include "core/base/image.h"
#include "core/view/camera.h"

/* The layers asked for, in the order of enum sv_layer, heap images, straight alpha (while a view is being
 * drawn: premultiplied). */
struct sv_picture {
    struct sv_image
        layer[SV_LAYER_COUNT]; /* COLOR u8 x 4; DEPTH f32; NORMAL f32 x 3; ID u32; empty when not asked for */
};

/* What a picture's image of that layer is like, without its data. */
static inline struct sv_image sv_picture_layer(int layer, int width, int height)
{
    static const struct {
        int channels;
        enum sv_pixel_type type;
    } forms[SV_LAYER_COUNT] = {
        [SV_LAYER_COLOR] = {4, SV_PIXEL_U8},
        [SV_LAYER_DEPTH] = {1, SV_PIXEL_F32},
        [SV_LAYER_NORMAL] = {3, SV_PIXEL_F32},
        [SV_LAYER_ID] = {1, SV_PIXEL_U32},
    };
    return (struct sv_image){
        .width = width, .height = height, .channels = forms[layer].channels, .type = forms[layer].type};
}

/* Images of the camera's size for a bit set of layers. SV_ENOMEM (what was made is in the picture: finish
 * it). */
SV_MUST_CHECK enum sv_status sv_picture_alloc(const struct sv_camera *camera, unsigned layers,
                                              struct sv_picture *picture, struct sv_error *error);
/* The same of row_count rows (at least one) of the camera's. */
SV_MUST_CHECK enum sv_status sv_picture_alloc_rows(const struct sv_camera *camera, int row_count, unsigned layers,
                                                   struct sv_picture *picture, struct sv_error *error);
void sv_picture_finish(struct sv_picture *picture);

#endif
