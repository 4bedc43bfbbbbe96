/* object_shadow.h - which texels of a relief object's faces see the sun: the shadow of each face on itself
 * (paper 1, section 3.3.1) and of all faces on each other (3.3.2). Private to the object: object_look.c uses
 * it. */
#ifndef SV_RELIEF_OBJECT_SHADOW_H
#define SV_RELIEF_OBJECT_SHADOW_H

#include "core/relief/object.h"

struct sv_relief_shade;

SV_MUST_CHECK enum sv_status sv_relief_shade_create(const struct sv_relief_object *object,
                                                    struct sv_relief_shade **shade, struct sv_error *error);
void sv_relief_shade_destroy(struct sv_relief_shade *shade);
/* lit[k], width * height of sheet k: share of sunlight * 255, for the faces in the bit set and what is hidden
 * behind them. sheet: of the object, with the colours that are warped (alpha 0 where they are not). to_sun:
 * unit, model space. groups[k]: what is needed of sheet k (lighting.h; NULL: nothing); NULL: all of them.
 * SV_ENOMEM. */
SV_MUST_CHECK enum sv_status sv_relief_shade_light(struct sv_relief_shade *shade,
                                                   const struct sv_relief sheet[SV_RELIEF_SHEETS],
                                                   struct sv_vec3 to_sun, enum sv_relief_shadow_form form,
                                                   unsigned faces, const uint8_t *const *groups,
                                                   uint8_t *const lit[SV_RELIEF_SHEETS],
                                                   struct sv_error *error);

#endif
