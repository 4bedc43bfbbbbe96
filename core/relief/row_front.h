/* row_front.h - parallel light over a field of heights, by a row of shadow heights that is carried along the
 * light (algorithms.md 3.2; a restatement of paper 1, 3.3.1, that needs no gathers).
 *
 * P(x, y) is the height of the shadow surface at a sample: below it the light is hidden. Marching along the
 * major axis of the light, in = lerp(P_previous, x - m) - drop,   P = max(h, in),   dark iff h < in - bias m
 * the lateral shift a row, drop = (distance between rows along the light's ground track) tan(theta), formed
 * from l itself (never from a tangent: l.f = 0 gives drop 0, l straight down is answered before: P = h). The
 * front starts at SV_ROW_FRONT_NONE = -1e6 m below nothing, not at minus infinity, so that interpolation
 * stays finite. Used for terrain, trees, relief faces and panels alike. */
#ifndef SV_RELIEF_ROW_FRONT_H
#define SV_RELIEF_ROW_FRONT_H

#include <stddef.h>
#include <stdint.h>

#include "core/base/error.h"
#include "core/base/vec.h"

#define SV_ROW_FRONT_NONE (-1e6f)

struct sv_row_front {
    int width, height;     /* samples, >= 1; sample (i, j) at (i dx, j dy) */
    double dx, dy;         /* m, > 0 */
    struct sv_vec3 travel; /* l: x along i, y along j, z up; unit; z <= 0. z > 0: light from below: everything
                              is dark, P = +INFINITY stand-in 1e6 */
    const float *height_m; /* finite or NaN; NaN and anything beyond +-1e6: casts nothing, is lit */
    const float *initial;  /* or NULL: shadow heights that come in from elsewhere, one a sample
                              (SV_ROW_FRONT_NONE: none) */
    float bias_m;          /* >= 0 */
};

/* shadow_height: P, width * height, or NULL. incoming: `in` before the sample's own height is taken in, or
 * NULL. lit: 255 / 0, or NULL. Any SIMD level gives the same lit but for rounding at ties. SV_EINVAL names
 * what is out of range; SV_ENOMEM. */
SV_MUST_CHECK enum sv_status sv_row_front(const struct sv_row_front *field, float *shadow_height,
                                          float *incoming, uint8_t *lit, struct sv_error *error);

#endif
