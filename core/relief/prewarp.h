/* prewarp.h - paper 1's own way: warp the texture on its own plane, then let texture mapping do the rest
 * (section 2; Oliveira, Bishop and McAllister 2000).
 *
 * Derivation of (1)-(4). c = O - eye and X = eye + c + us a + vs b + d f, d = displ(us, vs). The texel must
 * land on the point (ui, vi) of the plane that the eye sees it through:
 *     c + us a + vs b + d f = tau (c + ui a + vi b)
 * Dot with b x c, c x a and f (a, b square to f):
 *     tau ui = us + k1 d,   tau vi = vs + k2 d,   tau = 1 + k3 d                                      eq. (1)
 *     k1 = f.(b x c) / a.(b x c),   k2 = f.(c x a) / a.(b x c),   k3 = 1 / (c.f)                      eq. (2)
 * for either sign of f and either handedness: all three triple products flip together. tau is the ray's
 * parameter, 0 at the eye and 1 at the plane. a, b, f being square to each other, f.(b x c) = (f x b).c and
 * a.(b x c) = c.(a x b) reduce to
 *     k1 = -(c.a) / (|a|^2 c.f) = eu k3,   k2 = -(c.b) / (|b|^2 c.f) = ev k3
 * with (eu, ev) = (-(c.a)/|a|^2, -(c.b)/|b|^2) the foot of the eye on the plane in texels: the epipole, since
 *     ui - eu = (us - eu) / tau                                                                (own form of
 * 1) Texels move along lines through e and never change sides of it.
 *
 * Parallel projection along c: X + s c lies in the plane for s = -d / (c.f):
 *     ui = us + k4 d,   vi = vs + k5 d                                                                eq. (3)
 *     k4 = -(c.a) / (|a|^2 c.f),   k5 = -(c.b) / (|b|^2 c.f)                          eq. (4), SIGN CORRECTED
 * the very k1, k2 of (2), whose value does not depend on |c|, while k3 -> 0. Both stay under c -> -c and flip
 * under f -> -f, as the printed ones do, so no convention saves the printed sign (a test shows it fail).
 *
 * What is in front of what. Two texels on one ray have us - eu = tau (ui - eu) and vs - ev = tau (vi - ev)
 * with the same (ui, vi): the one farther from the eye (larger tau) is farther from e, on the same side of
 * it, in u and in v. Drawing from the border of the texture towards e is therefore drawing from far to near,
 * whichever side of the plane the eye is on (McMillan's order; both signs of k3 are tested). Parallel
 * projection: e is infinitely far, against the direction of view as seen on the plane. On one ray tau - 1 = d
 * / (c.f) orders as -d for an eye in front (c.f < 0) and as +d for one behind. */
#ifndef SV_RELIEF_PREWARP_H
#define SV_RELIEF_PREWARP_H

#include "core/relief/relief.h"

/* The eye counts as in the plane when |c.f| is below this share of |c|: c.f then holds 10 digits of 16. */
#define SV_PREWARP_SINE_MIN 1e-6
/* tau at and below which nothing is drawn: there displ in float still gives u_i - e to 1 part in 16,000. */
#define SV_PREWARP_NEAR 0x1p-10
enum { SV_PREWARP_SIDE_MAX = 16384 }; /* samples a side of a warped texture */

struct sv_prewarp {
    double k[5]; /* k1, k2, k3 (perspective) or k[3], k[4] = k4, k5 (parallel); the others 0 */
    bool parallel;
    double near;       /* smallest tau = 1 + k3 displ that is drawn, > 0 */
    double epipole[2]; /* (eu, ev), texels; parallel: +-INFINITY, or 0 where texels do not move that way */
    bool behind;       /* the eye is on the side that f points away from: small displ are the near ones */
    bool outward;      /* a panel whose eye has moved back: what is farther from e is nearer */
};

/* SV_EINVAL, naming the angle, when the eye is in the plane (|c.f| below SV_PREWARP_SINE_MIN of |c|, or of a
 * texel's side where O is nearer than that: det -> 0 is the same event) or not finite. The eye may be on
 * either side; what lies behind the plane through the eye parallel to the texture (tau <= near) is not drawn.
 */
SV_MUST_CHECK enum sv_status sv_prewarp_perspective(const struct sv_relief_frame *frame, struct sv_vec3 eye,
                                                    struct sv_prewarp *prewarp, struct sv_error *error);
/* A panel of a cell (paper 1, section 5): texel (u, v) is what the reference point V, D = -(O - V).f > 0 in
 * front of the plane, sees through (u, v), so that it stands at (8), (9) of build.h, off the grid. Those put
 * into (1), z = displ, Z = D - z, (eu, ev) the foot of the eye, (ru, rv) that of V:
 *     ui - ru = ((u - ru) Z / D + (eu - ru) k3 z) / (1 + k3 z)
 * and, above and below times D / Z, with zeta = z D / Z, since D / Z = 1 + zeta / D:
 *     ui - ru = ((u - ru) + (eu - ru) k3 zeta) / (1 + (k3 + 1/D) zeta)                     (own derivation)
 * which is (1) again for a relief that holds zeta = D (q - 1) on its regular grid: straight lines stay
 * straight, so all that is said of reliefs holds, and zeta stays in (-D, D] however far things are. k3 + 1/D
 * = -gamma / (D (1 - gamma)): an eye that moves back (gamma < 0) has what is nearer at the larger tau, and
 * wants the order from the epipole outward; gamma = 0: e is infinitely far. The eye must be in front of the
 * plane. Errors as above. */
SV_MUST_CHECK enum sv_status sv_prewarp_panel(const struct sv_relief_frame *frame, struct sv_vec3 reference,
                                              struct sv_vec3 eye, struct sv_prewarp *prewarp,
                                              struct sv_error *error);
/* direction: the way that one looks (or light travels), any length; SV_EINVAL when it lies in the plane. The
 * sense matters to what hides what, not to k4, k5. */
SV_MUST_CHECK enum sv_status sv_prewarp_parallel(const struct sv_relief_frame *frame,
                                                 struct sv_vec3 direction, struct sv_prewarp *prewarp,
                                                 struct sv_error *error);
/* eq. (1), (3). False (nothing written) where tau <= near or anything is not finite. */
bool sv_prewarp_point(const struct sv_prewarp *prewarp, double us, double vs, double displ, double *ui,
                      double *vi);

#define SV_WARPED_NONE UINT32_MAX

/* The warped texture: a window of the plane, in texels of the relief, at any resolution. */
struct sv_warped {
    int width, height;          /* samples */
    double u0, v0, u1, v1;      /* the window: sample (i, j) is at u0 + (i + 0.5) (u1 - u0) / width, ... */
    uint8_t (*color)[4];        /* sRGB; alpha 255, or all four 0: nothing landed */
    float *displ;               /* of the surface seen through the sample, m along f; 0 where none is */
    uint32_t *texel;            /* of the relief, row * width + column: the nearest one; SV_WARPED_NONE */
    uint32_t holes, holes_left; /* samples of disocclusions before and after filling */
    bool columns_first;         /* the order of passes that was taken */
    void *block;
};
void sv_warped_finish(struct sv_warped *warped); /* legal on a zeroed one */

enum sv_prewarp_order { SV_PREWARP_ORDER_AUTO, SV_PREWARP_ROWS_FIRST, SV_PREWARP_COLUMNS_FIRST };

struct sv_prewarp_options {
    int width, height;           /* samples of the result, 1 .. SV_PREWARP_SIDE_MAX; 0: one a texel */
    const uint8_t (*color)[4];   /* NULL: the relief's own; else lit colours of the same layout */
    bool fill;                   /* holes from the far side */
    enum sv_prewarp_order order; /* AUTO: pass 1 along the axis where it compresses less of what shifts */
};

/* The two-pass serial warp: rows by u_i, carrying v_i of the original texels along (not recomputed from
 * interpolated displ), then columns by v_i, in occlusion-compatible order and without a depth buffer; the
 * method is told in prewarp_two_pass.c. Solidity is the relief's own (colour given in options decides nothing
 * but colour). The window is the rectangle of whole texels that the relief's warped outline needs, at most
 * four times the texture's size a side about its middle; the texture's own rectangle when nothing is drawn.
 * Colour is interpolated in code values between adjacent texels of one surface (relief.h, cut).
 *
 * Holes are samples where nothing lands and through which the wall that stands on a torn edge would be seen;
 * see-through texels make none. SV_EINVAL (sizes, prewarp not made by the functions above), SV_ENOMEM. */
SV_MUST_CHECK enum sv_status sv_prewarp_two_pass(const struct sv_relief *relief,
                                                 const struct sv_prewarp *prewarp,
                                                 const struct sv_prewarp_options *options,
                                                 struct sv_warped *warped, struct sv_error *error);

#endif
