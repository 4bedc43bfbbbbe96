/* compose_kernel.h - the kernels behind compose.h. */
#ifndef SV_VIEW_COMPOSE_KERNEL_H
#define SV_VIEW_COMPOSE_KERNEL_H

#include <stddef.h>
#include <stdint.h>

#define SV_COMPOSE_PASS_MIN (1.0f / 255)

/* The sRGB code of linear light v, without tables: 255 (1.055 v^(5/12) - 0.055) as a polynomial of v^(1/4)
 * between the curve's bend and 1 (the first terms of its Chebyshev series), off by 0.0021 of a code at most.
 */
#define SV_COMPOSE_BEND 0.0031308f
#define SV_COMPOSE_SLOPE (12.92f * 255)
enum { SV_COMPOSE_TERMS = 6 };
static const float sv_compose_term[SV_COMPOSE_TERMS] = {-15.6782505f, 41.6913508f, 318.693893f,
                                                        -144.683873f, 71.6476189f, -16.6720625f};

void sv_compose_scalar(size_t count, const float (*light)[4], const uint8_t (*behind)[4], uint8_t (*out)[4]);
void sv_compose_avx2(size_t count, const float (*light)[4], const uint8_t (*behind)[4], uint8_t (*out)[4]);

#endif
