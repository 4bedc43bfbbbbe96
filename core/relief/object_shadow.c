/* object_shadow.c - see object_shadow.h. */
#include "core/relief/object_shadow.h"

#include <stdlib.h>
#include <string.h>

#include "core/relief/row_front.h"
#include "core/relief/self_shadow.h"

struct sv_relief_shade {
    const struct sv_relief_object *object;
};

enum sv_status sv_relief_shade_create(const struct sv_relief_object *object, struct sv_relief_shade **shade,
                                      struct sv_error *error)
{
    struct sv_relief_shade *made = calloc(1, sizeof *made);
    if (!made)
        return sv_fail(error, SV_ENOMEM, "shade", "no memory");
    made->object = object;
    *shade = made;
    return SV_OK;
}

void sv_relief_shade_destroy(struct sv_relief_shade *shade)
{
    free(shade);
}

static struct sv_vec3 in_frame(const struct sv_relief_frame *frame, struct sv_vec3 v)
{
    return sv_vec3(sv_dot(sv_normalize(frame->a), v), sv_dot(sv_normalize(frame->b), v), sv_dot(frame->f, v));
}

enum sv_status sv_relief_shade_light(struct sv_relief_shade *shade, struct sv_vec3 to_sun,
                                     enum sv_relief_shadow_form form, unsigned faces,
                                     uint8_t *const lit[SV_RELIEF_SHEETS], struct sv_error *error)
{
    enum sv_status status = SV_OK;
    for (int k = 0; status == SV_OK && k < SV_RELIEF_SHEETS; k++) {
        const struct sv_relief *face = sv_relief_sheet(shade->object, k);
        if (!(faces >> k % SV_RELIEF_FACES & 1) || !face->solid_count)
            continue;
        struct sv_vec3 travel = in_frame(&face->frame, sv_scale(to_sun, -1));
        if (form == SV_RELIEF_SHADOW_LINE_SWEEP) {
            struct sv_self_shadow_options options = {.travel = travel, .bias_m = (float)shade->object->texel};
            status = sv_self_shadow(face, &options, lit[k], error);
        } else {
            struct sv_row_front front = {.width = face->width,
                                         .height = face->height,
                                         .dx = sv_length(face->frame.a),
                                         .dy = sv_length(face->frame.b),
                                         .travel = travel,
                                         .height_m = face->displ,
                                         .bias_m = (float)shade->object->texel};
            status = sv_row_front(&front, NULL, NULL, lit[k], error);
        }
    }
    return status;
}
