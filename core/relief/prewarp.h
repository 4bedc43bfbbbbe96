/* prewarp.h - paper 1's own way: warp the texture on its own plane, then let texture mapping do the rest
 * (section 2).
 *
 * Derivation of (1)-(4), with c = O - eye, X = eye + c + u_s a + v_s b + d f, d = displ. The texel must land
 * on the plane's point (u_i, v_i) that the eye sees it through: c + u_s a + v_s b + d f = tau (c + u_i a +
 * v_i b). Dot with b x c, c x a, f (a, b square to f): tau u_i = u_s + k1 d,  tau v_i = v_s + k2 d,  tau = 1
 * + k3 d                              eq. (1) k1 = f.(b x c) / a.(b x c),  k2 = f.(c x a) / a.(b x c),  k3 =
 * 1 / (c.f)                  eq. (2) right for either sign of f. Parallel projection along c: u_i = u_s + k4
 * d, v_i = v_s + k5 d   eq. (3) k4 = -(c.a) / (|a|^2 c.f),  k5 = -(c.b) / (|b|^2 c.f) eq. (4), SIGN
 * CORRECTED: the limit of k1 for an eye infinitely far is -(c.a)/(|a|^2 c.f); both are unchanged by c -> -c
 * and flip under f -> -f, so no convention saves the printed sign (algorithms.md 1.1; a test shows the
 * printed form fail). */
#ifndef SV_RELIEF_PREWARP_H
#define SV_RELIEF_PREWARP_H

#include "core/relief/relief.h"

struct sv_prewarp {
    double k[5]; /* k1, k2, k3 (perspective) or k[3], k[4] = k4, k5 (parallel); the others 0 */
    bool parallel;
    double near; /* smallest tau = 1 + k3 displ that is drawn, > 0 */
};

/* SV_EINVAL, naming the angle, when the eye is in the plane (|c.f| too small against |c|: det -> 0 is the
 * same event) or not finite. The eye may be on either side; what lies behind the plane through the eye
 * parallel to the texture (tau <= near) is not drawn. */
SV_MUST_CHECK enum sv_status sv_prewarp_perspective(const struct sv_relief_frame *frame, struct sv_vec3 eye,
                                                    struct sv_prewarp *prewarp, struct sv_error *error);
/* direction: of the view (or of light), any length; SV_EINVAL when it lies in the plane. */
SV_MUST_CHECK enum sv_status sv_prewarp_parallel(const struct sv_relief_frame *frame,
                                                 struct sv_vec3 direction, struct sv_prewarp *prewarp,
                                                 struct sv_error *error);
/* eq. (1), (3). False (nothing written) where tau <= near or anything is not finite. */
bool sv_prewarp_point(const struct sv_prewarp *prewarp, double us, double vs, double displ, double *ui,
                      double *vi);

/* The warped texture: a window of the plane, in texels of the relief, at any resolution. */
struct sv_warped {
    int width, height;          /* samples */
    double u0, v0, u1, v1;      /* the window: sample (i, j) is at u0 + (i + 0.5) (u1 - u0) / width, ... */
    uint8_t (*color)[4];        /* sRGB straight; alpha 0: nothing landed */
    float *displ;               /* of the surface seen through the sample, m along f */
    uint32_t holes, holes_left; /* samples of disocclusions before and after filling */
    void *block;
};
void sv_warped_finish(struct sv_warped *warped);

struct sv_prewarp_options {
    int width, height;         /* samples of the result; 0: one a texel */
    const uint8_t (*color)[4]; /* NULL: the relief's own; else lit colours of the same layout */
    bool fill;                 /* holes from the far side */
};

/* The two-pass serial warp: rows by u_i, carrying v_i of the original texel along (not recomputed from
 * interpolated displ), then columns by v_i; texels in occlusion-compatible order (McMillan): from the border
 * towards the epipole. The window is what the relief's warped outline needs, at most four times its size a
 * side about its middle. */
SV_MUST_CHECK enum sv_status sv_prewarp_two_pass(const struct sv_relief *relief,
                                                 const struct sv_prewarp *prewarp,
                                                 const struct sv_prewarp_options *options,
                                                 struct sv_warped *warped, struct sv_error *error);

#endif
