/* sawtooth.h - the period of the ramps that lie in a window of a UV texture (paper 2, section 3.2).
 *
 * Leaves drawn with a texture coordinate as colour are ramps of 0 .. 255 (paper, figure 2). The paper
 * correlates a window of 16 pixels with the sawtooth f(x) = x/w - floor(x/w) (formula 1) over the periods w
 * that a leaf can have, and takes the best as the density of leaves there.
 *
 * How it is done here (own derivation). A sawtooth of period w and any phase is a straight line on the
 * circle: with z(v) = exp(2 pi i v), z(f(x + a)) = z(a/w) exp(2 pi i x/w). So the correlation of a row of
 * values v_t with the sawtooth of period w, at the best of all phases, is |S(1/w)| / n, with S(g) = sum over
 * t of z(v_t) exp(-2 pi i g t)                                                      (a) n the number of
 * pixels that show a leaf. That replaces the search for the phase by one sum; a mirrored leaf, whose ramp
 * falls, is a g below 0; and where no ramp wraps, S still has its peak at the ramp's slope, since z turns by
 * slope alone, so w comes from the slope as design.md section 4 asks. Several rows of a window, each with its
 * own phase, count together: R^2 = sum |S_row|^2 / sum n_row^2.
 *
 * No leaf: where few pixels show one, or where the best R could be chance. Of N pixels with random values in
 * r rows, R^2 exceeds x with about the probability P, the larger of sum over j < r of binomial(N - 1, j) x^j
 * (1 - x)^(N - 1 - j)                                      (b) (N/r)^(r/2) (pi N (1 - x))^(m/2) / (gamma(m/2
 * + 1) (2 pi)^m),  m = N - r:                         (c) b for many pixels (the law of Beta, were z normal
 * and not of length 1), c for few, all of whose angles must then lie close to a line (volume of a ball of
 * angles). SV_SAWTOOTH_FREQUENCIES of them are tried; a window whose chance, P times that, is above
 * options.chance is no leaf. */
#ifndef SV_TREE_SAWTOOTH_H
#define SV_TREE_SAWTOOTH_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

enum {
    SV_SAWTOOTH_WINDOW = 16,      /* pixels of a row; paper, 3.2 */
    SV_SAWTOOTH_ROWS_MAX = 16,    /* rows of a window */
    SV_SAWTOOTH_FREQUENCIES = 64, /* g = k / 64 - 1/2: four to the width of S's main lobe, so that a peak
                                     between two of them loses 2 % at most */
};

struct sv_sawtooth_options {
    float period_min; /* px, 2 or more (NaN or less counts as 2); shorter periods are not looked for */
    float period_max; /* px, up to 255 and more; longer ones, and constants, are given as this. NaN: 255 */
    float coverage;   /* share of the window that must show a leaf */
    float chance;     /* of being noise, above which a window is no leaf; 0..1 */
};
#define SV_SAWTOOTH_OPTIONS_DEFAULT ((struct sv_sawtooth_options){3, 255, 0.25f, 1e-4f})

/* A window: pixel t of row r is code[r * row_step + t * step] and shows a leaf where mask, laid out alike, is
 * not 0; columns are rows with the steps exchanged. */
struct sv_sawtooth_window {
    const uint8_t *code, *mask;
    ptrdiff_t step, row_step;
    int rows; /* 1 .. SV_SAWTOOTH_ROWS_MAX */
};

struct sv_sawtooth {
    float period;      /* px, period_min .. period_max; 0: no leaf */
    bool falling;      /* the ramp is mirrored */
    float correlation; /* R at the period, 0..1; also where it was too little */
    float coverage;    /* share of the window that shows a leaf */
};

/* Formula 1, exact to the rounding of double: x/w - floor(x/w), in [0, 1). 0 where w is not above 0 or
 * anything is not finite. */
double sv_sawtooth_at(double x, double w);

/* The best period of a window. Some 0.3 us a row with AVX2. Any thread. */
struct sv_sawtooth sv_sawtooth_fit(const struct sv_sawtooth_window *window,
                                   const struct sv_sawtooth_options *options);

#endif
