/* leaf_shade.h - light on the pixels that a tree has won; see leaf_kernel.h. The twin of tree_mesh.frag and
 * tree_mesh.vert in C, per pixel: colour, id, normal; seen[] is emptied behind. Private. */
#ifndef SV_TREE_LEAF_SHADE_H
#define SV_TREE_LEAF_SHADE_H

#include "core/tree/leaf_kernel.h"

/* pixel: column | row << 16, in the band. */
void sv_leaf_shade_scalar(const struct sv_leaf_paint *paint, const uint32_t *pixel, int n);
void sv_leaf_shade_avx2(const struct sv_leaf_paint *paint, const uint32_t *pixel, int n);

/* 2^t for t in [-120, 0]: a polynomial through Chebyshev nodes, error 5e-6 of the value. */
static const float sv_leaf_exp2[5] = {1.0000035f, 0.69297292f, 0.24160436f, 0.051744998f, 0.013670309f};
/* c^(1 / 2.4) = m^(1 / 2.4) 2^(e / 2.4): a cubic in m (core/relief/lighting_avx2.c: 0.03 levels), and 255
 * * 1.055 * the power of 2 by the exponent's low three bits; below 2^-8 two straight pieces, the curve's own
 * and, from its bend on, a chord (0.02 levels; held on to, the first is off by 0.2 there). */
static const float sv_leaf_root[4] = {0.46108379f, 0.68860106f, -0.17331086f, 0.023732815f};
static const float sv_leaf_octave[8] = {35.627757f,  47.557350f,  63.481447f,  84.737565f,
                                        113.111079f, 150.985177f, 201.541031f, 26.690661f};
#define SV_LEAF_LINE (255 * 12.92f)
#define SV_LEAF_CHORD 3031.69f
#define SV_LEAF_CHORD_AT_0 0.842f
/* tree_crown in tree_light.glsl: the hot spot's height, and its exponent in powers of 2. */
#define SV_LEAF_HOT 0.32f
#define SV_LEAF_HOT_EXP2 (12.5f * 1.44269504f)

#endif
