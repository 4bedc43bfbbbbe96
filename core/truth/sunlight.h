/* sunlight.h - what of the sun's light arrives at the ground, as the ray-cast truth sees it: rows of a
 * lattice of texels.
 *
 * Rows on demand, so that who casts them in idle time can stop after each. One thread. */
#ifndef SV_TRUTH_SUNLIGHT_H
#define SV_TRUTH_SUNLIGHT_H

#include "core/truth/truth.h"

/* Texel (i, j) is the square texel_m wide whose south-west corner is (x0 + i texel_m, y0 + j texel_m), world.
 */
struct sv_truth_lattice {
    double x0, y0, texel_m;
    int first, count; /* columns of a row */
    int samples;      /* a texel: 1, 4, 16, 64, positions of sv_camera_sample_offset */
    bool trees;       /* cast shadows; else terrain and objects alone */
};

/* light_out[k] (lattice->count): share of the samples of texel (first + k, row) whose ground sees the sun,
 * 255: all of them. A sample is on the surface of heightfield.h there; beyond the field it is at its border.
 * A texel's light is its own: the same in whatever row it is asked for. Light that comes from below the
 * horizon: 0. About 1 us a sample. */
void sv_truth_sunlight_row(const struct sv_truth *truth, const struct sv_light *light,
                           const struct sv_truth_lattice *lattice, int row, uint8_t *light_out);

#endif
