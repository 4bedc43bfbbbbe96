/* region.h - how far an eye may go from a panel's reference point V: exactly (M), and by predicted error
 * (M_eps).
 *
 * All offsets are eye - V over the panel's distance D, world axes; for one face (alpha, beta, gamma) are its
 * components along the face's right, up, forward. A panel is a plane at distance D with stored tangents |xs|,
 * |ys| <= 1; the paper's panel reaches to tangents of 2 as seen from V.
 *
 * M = { |x|+|y|, |x|+|z|, |y|+|z| <= 1 } (algorithms.md 2.3; paper 1, section 5, figure 7) are the eyes from
 * which all that four sides hold is seen on their panels of the paper's size. It says nothing of what comes
 * into view from behind an edge, nor of the size of texels; that is what the prediction is for (2.4, 2.6),
 * and M_eps = r M with the largest r for which it stays within a tolerance. Plain values, any thread. */
#ifndef SV_CELL_REGION_H
#define SV_CELL_REGION_H

#include <stdbool.h>

#include "core/base/vec.h"
#include "core/cell/jumps.h"
#include "core/cell/lattice.h"

/* Whether the offset is in M (closed); false for NaN. */
bool sv_region_holds(struct sv_vec3 offset);

/* Who looks: a perspective camera of any heading, and what errors of the two kinds count for. */
struct sv_region_view {
    double focal_px;
    int width, height;  /* px */
    double hole_weight; /* error of a pixel that shows what fills a hole, in the unit of the tolerance */
    double
        pixel_weight; /* error a pixel for being one pixel off: the picture's mean gradient, same unit a px */
};

struct sv_region_panel {
    enum sv_cell_face face;
    int size;      /* texels a side over 90 degrees */
    double q_most; /* largest q that it holds: 1, or what crowns that reach across the plane have */
    struct sv_cell_jumps jumps;
};

struct sv_region_error {
    double hole_share;  /* upper bound of disoccluded pixels over those that the panel covers, >= 0 */
    double texel_px;    /* upper bound of a texel's side in the picture */
    double position_px; /* upper bound of how far from its texel's content a point of it is drawn */
    double total;       /* hole_weight * hole_share + pixel_weight * position_px */
};

/* The prediction for one panel and offset. Own derivation on algorithms.md 2.4: the gap between neighbours of
 * q1 > q2 is (gamma xs - alpha)(q1 - q2) / ((1 - gamma q1)(1 - gamma q2)) in tangents; summed over rows and
 * columns share <= (size / 2) (|alpha| S_x + |beta| S_y + |gamma| (xx + yy)) m / texels, S_x the falling
 * jumps for alpha > 0 (what is nearer on the left moves left and opens to its right), the rising ones else,
 * S_y alike; m is what gap, row and covered area stretch at most: with g = gamma q_most, (1 - g)^-3 forward,
 * (1 - g)^2 back. A texel is 2 F / size px on the axis, 1 / (1 - g) that when approached, times sec^2 at the
 * picture's corner; position: half its diagonal, and q's rounding to 2^-16. All are INFINITY for an eye at or
 * beyond the panel's plane or its nearest content, and for NaN; no texels: no holes. */
struct sv_region_error sv_region_predict(const struct sv_region_panel *panel, struct sv_vec3 offset,
                                         const struct sv_region_view *view);

/* The largest r in [0, 1) such that no panel's prediction exceeds the tolerance for an eye anywhere in r M
 * about V, or, with V at the top, anywhere in r M moved down by r; to 2^-20. 0 when not even at V. count >=
 * 0: none: just under 1. */
double sv_region_radius(const struct sv_region_panel *panels, int count, bool top,
                        const struct sv_region_view *view, double tolerance);

/* The lattice step over distance (lattice.h) of the largest cells whose eyes all stay in M_eps: half that
 * radius, as the ways from a reference point down its chain to the eye are less than two steps long. Held to
 * SV_REGION_PITCH_LEAST times a power of 2, so that views of nearly one tolerance share their panels, and to
 * at most SV_CELL_PITCH_MAX; never less than SV_REGION_PITCH_LEAST, even where its cells do not keep the
 * tolerance. */
#define SV_REGION_PITCH_LEAST 0.0125
double sv_region_pitch(const struct sv_region_panel *panels, int count, bool top,
                       const struct sv_region_view *view, double tolerance);

/* The hard bound: the largest r such that no gap between texels whose q differ by at most jump is wider than
 * eps_px anywhere in r M about V: r / (1 - r)^2 = kappa, kappa = eps_px / (focal_px jump); for a camera not
 * aligned with the panel, give focal_px times sec^2 of the picture's corner. 0 for eps_px <= 0, 1 for jump <=
 * 0; NaN: 0. */
double sv_region_radius_hard(double eps_px, double focal_px, double jump);

#endif
