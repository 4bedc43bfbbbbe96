/* row_front.h - parallel light over a field of heights, by a front of shadow heights that is carried along
 * the light (algorithms.md 3.2; a restatement of paper 1, 3.3.1, that needs no gathers).
 *
 * P(x, y) is the height of the shadow surface at a sample: below it the light is hidden. `in` is the greatest
 * height towards the light less the fall of the light on the way, P = max(h, in), dark iff h < in - bias.
 *
 * The front marches along the light's major axis, a row of samples at a time, m the lateral shift a row, |m|
 * <= 1. Carrying P itself and interpolating it again at every row (3.2 as written) blurs it by sqrt(m (1 - m)
 * rows) samples, so the front is carried on the SHEARED grid: ray k stands at x = k + m r in row r. Heights
 * are interpolated once, where a ray crosses a row of samples or a column of them; a sample takes the mean of
 * the two rays beside it, in the smaller of two readings (of shadow height, and of depth below it), and to
 * that its own ray through the row before, which is exact. m r = s + f is the same for a whole row, so that
 * each interpolation is two unaligned loads (own derivation; test_self_shadow.c has the shares of samples
 * that differ from a ray march).
 *
 * drop, the fall of the light a row, is formed from l itself (never from a tangent: l.z = 0 gives drop 0; l
 * straight down, or so steep that the drop a row exceeds all heights, is answered before: in = none, P = h).
 * Rays carry h + r drop, counted from a row at most 31 back: the rounding of r drop does not add up with the
 * rows.
 *
 * Where there is nothing (outside the field, NaN) a ray carries "none". Between a real sample and none the
 * surface reaches half way, at the real one's height: no value is ever mixed with the stand-in for none.
 * Nothing enters at the borders. Used for terrain, trees, relief faces and panels alike. */
#ifndef SV_RELIEF_ROW_FRONT_H
#define SV_RELIEF_ROW_FRONT_H

#include <stddef.h>
#include <stdint.h>

#include "core/base/error.h"
#include "core/base/simd.h"
#include "core/base/vec.h"

/* Shadow height where nothing is hidden; heights that count lie between it and its negative. */
#define SV_ROW_FRONT_NONE (-1e6f)

struct sv_row_front {
    int width, height;     /* samples, >= 1; sample (i, j) at (i dx, j dy) */
    double dx, dy;         /* m, 1e-9 .. 1e9 */
    struct sv_vec3 travel; /* l: x along i, y along j, z up; unit (1e-6); z <= 0. z > 0: light from below:
                              every real sample is dark, P = incoming = 1e6 */
    const float *height_m; /* NaN, and what is not within +-1e6: casts nothing, is lit */
    const float *initial;  /* or NULL: shadow heights that come in from elsewhere, one a sample; NaN or
                              <= SV_ROW_FRONT_NONE: none; above 1e6: 1e6. They are carried on along the light
                              as heights are */
    float bias_m;          /* finite, >= 0 */
};

/* shadow_height: P, width * height, or NULL. incoming: `in` before the sample's own height is taken in
 * (initial at the sample included), or NULL. lit: 255 / 0, or NULL. All three are finite for any input. Every
 * SIMD level gives the same bits. Threads: any; about 100 bytes a sample of one row (or, for light along x,
 * of one column) of memory are taken for the call. SV_EINVAL names what is out of range; SV_ENOMEM. */
SV_MUST_CHECK enum sv_status sv_row_front(const struct sv_row_front *field, float *shadow_height,
                                          float *incoming, uint8_t *lit, struct sv_error *error);
/* The same with the kernels of `level` (at most what the machine has): tests, benchmarks. */
SV_MUST_CHECK enum sv_status sv_row_front_at(enum sv_simd level, const struct sv_row_front *field,
                                             float *shadow_height, float *incoming, uint8_t *lit,
                                             struct sv_error *error);

#endif
