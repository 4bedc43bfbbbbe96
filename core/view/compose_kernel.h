/* compose_kernel.h - the kernels behind compose.h. */
#ifndef SV_VIEW_COMPOSE_KERNEL_H
#define SV_VIEW_COMPOSE_KERNEL_H

#include <stddef.h>
#include <stdint.h>

#define SV_COMPOSE_PASS_MIN (1.0f / 255)

void sv_compose_scalar(size_t count, const float (*light)[4], const uint8_t (*behind)[4], uint8_t (*out)[4]);
void sv_compose_avx2(size_t count, const float (*light)[4], const uint8_t (*behind)[4], uint8_t (*out)[4]);

#endif
