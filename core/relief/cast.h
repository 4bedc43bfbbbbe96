/* cast.h - shadows of relief textures on other relief textures (paper 1, section 3.3.2).
 *
 * (1) Reliefs are ordered by nearness to the light. (2) Each one's silhouette is its texels pre-warped along
 * the light (eq. (3)), onto a plane square to the light: the division by c.f of (4) falls away, so that light
 * parallel to the relief's own plane is no special case. (3) It is projected along the light onto every
 * relief of lower priority; unions are their shadow textures. (4) They are the first S of the self-shadow
 * pass (self_shadow.h, initial).
 *
 * Departure, selectable: the paper projects onto the receiver's PLANE, which is wrong by displ cot(theta)
 * where the receiver stands off it, and trusts the order alone. The height form looks up each receiver texel
 * where it stands, at its own displ, and compares its depth along the light with the depth at which the
 * caster begins. So it needs no order, and holds for a caster that crosses the receiver's plane. It is exact
 * for each texel but for the silhouette's resolution; shadow heights handed into row_front.h's initial would
 * add nothing: they say the same of a texel, by a number that depends on the receiver's axes. */
#ifndef SV_RELIEF_CAST_H
#define SV_RELIEF_CAST_H

#include "core/relief/relief.h"
#include "core/relief/silhouette.h"

/* Order of priority: writes indices of reliefs, the one nearest to the light first (by the depth along travel
 * of the middle of the box of its solid texels; ties by index; what holds nothing comes last). travel: unit,
 * in the reliefs' common space. SV_EINVAL, SV_ENOMEM. */
SV_MUST_CHECK enum sv_status sv_cast_order(const struct sv_relief *const *reliefs, int count,
                                           struct sv_vec3 travel, int *order, struct sv_error *error);

/* Silhouette of one relief as the light sees it. Coverage is 255 or 0, `first` the depth along the light at
 * which the body begins (INFINITY: not covered; finite for any displ: held at 1e38 m). A pixel is covered
 * when its centre lies behind the surface: bilinear cells between untorn solid texels (two triangles each, so
 * that there are no pin-holes at any magnification), at outlines each texel's own box. Seen edge-on a surface
 * covers nothing. texel_m: side of a pixel, > 0; raised where a side would have more than 4096 of them. An
 * empty relief has a silhouette that covers nothing. Heap; sv_cast_silhouette_finish. SV_EINVAL, SV_ENOMEM.
 */
SV_MUST_CHECK enum sv_status sv_cast_silhouette(const struct sv_relief *relief, struct sv_vec3 travel,
                                                double texel_m, struct sv_silhouette *silhouette,
                                                struct sv_error *error);
void sv_cast_silhouette_finish(struct sv_silhouette *silhouette); /* legal on a zeroed one */

enum sv_cast_form {
    SV_CAST_PLANE,  /* the paper's: shadow texture on the receiver's plane, all of it behind first_m */
    SV_CAST_HEIGHT, /* at each receiver texel's own displ, behind `first` */
};

/* Adds the silhouette's shadow to `dark` (receiver's width * height, 0: dark, start with 255): the shadow
 * texture of the receiver. A texel is dark when coverage is 128 or more and its depth is more than one and a
 * half pixels behind where the body begins (so that a surface that two reliefs share does not shade itself).
 * Empty texels are left alone, as is everything outside of the silhouette. Light parallel to the receiver's
 * plane, square to it or from behind it: nothing special. SV_EINVAL for a frame that is none. */
SV_MUST_CHECK enum sv_status sv_cast_shadow(const struct sv_silhouette *silhouette,
                                            const struct sv_relief *receiver, enum sv_cast_form form,
                                            uint8_t *dark, struct sv_error *error);

#endif
