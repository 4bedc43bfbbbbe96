/* cast.h - shadows of relief textures on other relief textures (paper 1, section 3.3.2).
 *
 * (1) Reliefs are ordered by nearness to the light. (2) Each one's silhouette is its texels pre-warped along
 * the light (eq. (3), (4) as corrected). (3) It is projected along the light onto the plane of every relief
 * of lower priority; sums (unions) are their shadow textures. (4) They are the first S of the self-shadow
 * pass (self_shadow.h, initial). Departure, selectable: the paper projects onto the receiver's PLANE, which
 * is wrong by displ cot(theta) where the receiver stands off it; the height hand-over instead keeps, for each
 * receiver texel, the height below which the light is hidden (row_front.h, initial), formed from the caster's
 * own surface, so that the receiver's displ decides. */
#ifndef SV_RELIEF_CAST_H
#define SV_RELIEF_CAST_H

#include "core/relief/relief.h"
#include "core/relief/silhouette.h"

/* Order of priority: writes indices of reliefs, the one nearest to the light first (by the depth along travel
 * of the middle of what it holds; ties by index). travel: unit, in the reliefs' common space. SV_ENOMEM. */
SV_MUST_CHECK enum sv_status sv_cast_order(const struct sv_relief *const *reliefs, int count,
                                           struct sv_vec3 travel, int *order, struct sv_error *error);

/* Silhouette of one relief as the light sees it (parallel pre-warp onto a plane square to the light). Heap;
 * sv_cast_silhouette_finish. texel_m: resolution, > 0. */
SV_MUST_CHECK enum sv_status sv_cast_silhouette(const struct sv_relief *relief, struct sv_vec3 travel,
                                                double texel_m, struct sv_silhouette *silhouette,
                                                struct sv_error *error);
void sv_cast_silhouette_finish(struct sv_silhouette *silhouette);

enum sv_cast_form {
    SV_CAST_PLANE,  /* the paper's: shadow texture on the receiver's plane */
    SV_CAST_HEIGHT, /* at each receiver texel's own displ */
};

/* Adds the silhouette's shadow to `dark` (receiver's width * height, 0: dark, start with 255): the shadow
 * texture of the receiver. */
SV_MUST_CHECK enum sv_status sv_cast_shadow(const struct sv_silhouette *silhouette,
                                            const struct sv_relief *receiver, enum sv_cast_form form,
                                            uint8_t *dark, struct sv_error *error);

#endif
