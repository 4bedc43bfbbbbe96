/* texture.h - a tree's texture read as GL reads it at level 0: wrap repeat, bilinear, sRGB decoded before filtering.
 *
 * Twin of textureLod(sampler, uv, 0) in core/gl/shaders/tree_polygon.frag; the alpha test of both must agree (mesh.h). */
#ifndef SV_TRUTH_TEXTURE_H
#define SV_TRUTH_TEXTURE_H

#include "core/base/image.h"

/* image: RGBA u8, row 0 at v = 0. */
float sv_texture_alpha(const struct sv_image *image, float u, float v);
/* Linear rgb and alpha; rgb is what GL gives: filtered without regard to alpha. */
void sv_texture_rgba(const struct sv_image *image, float u, float v, float rgba[4]);

#endif
