/* shade_pass.h - light passes half a tree: the inner loop of shade_stand.c, a row of texels at a time.
 * Private to core/tree.
 *
 * A row is whole groups of SV_SHADE_LANES texels, so that a kernel never reads or writes beyond a tile. For
 * texel i the coverage is c = m[0] + part (m[1] - m[0]), m = mixed + left[i]: bilinear in the silhouette,
 * whose two rows are mixed already. A half lets sqrt(1 - c) through, at least sqrt(SV_SHADE_PASS_MIN); the
 * light that is there is read with the weight c + bare[i], on the far side with what the near one has taken
 * given back (it is the tree's own), then multiplied. Sums are kept lane by lane: all kernels give the same
 * bits. */
#ifndef SV_TREE_SHADE_PASS_H
#define SV_TREE_SHADE_PASS_H

#include <stdbool.h>
#include <stdint.h>

enum { SV_SHADE_LANES = 8, SV_SHADE_FULL = 65535 };
/* Of what passes a tree, because its half is divided by: below, the canvas' steps tell. */
#define SV_SHADE_PASS_MIN (1.0f / 4096)

struct sv_shade_row {
    const int *left; /* texels' columns in mixed */
    const float *part, *bare, *mixed;
    int count; /* texels: a multiple of SV_SHADE_LANES */
};

struct sv_shade_cell {
    float light[SV_SHADE_LANES], weight[SV_SHADE_LANES];
};

/* light: count texels, share of light * SV_SHADE_FULL. mixed: coverages, 0..1, one column beyond left. */
typedef void sv_shade_pass(const struct sv_shade_row *row, bool far, uint16_t *light,
                           struct sv_shade_cell *cell);
sv_shade_pass sv_shade_pass_scalar, sv_shade_pass_avx2;

/* mixed[u] = a[u] above + b[u] below, u < width. */
typedef void sv_shade_mix(const uint8_t *a, const uint8_t *b, float above, float below, int width,
                          float *mixed);
sv_shade_mix sv_shade_mix_scalar, sv_shade_mix_avx2;

#endif
