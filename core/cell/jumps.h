/* jumps.h - how much of a panel opens when the eye moves, from the steps between neighbouring texels' q.
 *
 * With q = D / Z and an eye (alpha, beta, gamma) = (right, up, forward) off V, in units of D, a texel's
 * content moves by q (gamma xs - alpha) to the right and q (gamma ys - beta) up, in tangents, to first order
 * (algorithms.md 2.2, 2.4: over 1 - gamma q in full). Between neighbours whose q differ by d = q_right -
 * q_left (or q_upper - q_lower) a gap of width d (gamma xs - alpha) opens where that is above 0. Its sum over
 * all neighbours, for each axis and sign of motion, bounds the hole area for any small motion
 * (algorithms.md 2.6: conservative, for small gaps close by stretching). Own derivation of the sums. */
#ifndef SV_CELL_JUMPS_H
#define SV_CELL_JUMPS_H

#include <stdint.h>

/* The sums that region.h predicts from: q's steps to the right and upward, rising and falling (all >= 0). */
struct sv_cell_jumps {
    double x_plus, x_minus;
    double y_plus, y_minus;
    double xx, yy;   /* of |xs dq| to the right and of |ys dq| upward, xs and ys midway between the two texels: what
                        moving forward or back opens */
    uint32_t texels; /* that hold something */
};

/* Sums over pairs of neighbours; texels that hold something: q > 0. An empty texel counts as q = 0. */
struct sv_jumps {
    uint64_t covered; /* texels with q > 0 */
    int size;         /* of the panel */
    double right_less,
        right_more; /* of -d and d, where d < 0 and d > 0, left to right: open for alpha > 0, alpha < 0 */
    double up_less, up_more; /* upwards: open for beta > 0, beta < 0 */
    double out_more,
        out_less; /* of xs d + ys d and its negative, each where above 0: open for gamma > 0, gamma < 0 */
};

/* Of a panel of size * size (1 .. 4096); steps of at most cut (>= 0) are left out: they stay one surface
 * (warp.h). */
void sv_jumps_measure(const float *q, int size, float cut, struct sv_jumps *jumps);
/* The same of codes (q = code / 32768, panel.h). */
void sv_jumps_measure_codes(const uint16_t *q, int size, float cut, struct sv_jumps *jumps);

/* Texels' worth of holes that an eye so far off V opens at most, to first order; over `covered` it is their
 * share. */
double sv_jumps_opened(const struct sv_jumps *jumps, double alpha, double beta, double gamma);

#endif
