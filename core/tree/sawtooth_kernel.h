/* sawtooth_kernel.h - |S(g)|^2 of a row at all frequencies (sawtooth.h, a): what the scalar and the AVX2
 * kernel share. Private to sawtooth.c, sawtooth_avx2.c and their test. */
#ifndef SV_TREE_SAWTOOTH_KERNEL_H
#define SV_TREE_SAWTOOTH_KERNEL_H

#include "core/tree/sawtooth.h"

/* z(code / 255), and exp(-2 pi i g t) for each pixel t and frequency g. */
struct sv_sawtooth_table {
    float re[256], im[256];
    float cosine[SV_SAWTOOTH_WINDOW][SV_SAWTOOTH_FREQUENCIES],
        sine[SV_SAWTOOTH_WINDOW][SV_SAWTOOTH_FREQUENCIES]; /* sine: of the negative angle */
};
const struct sv_sawtooth_table *sv_sawtooth_table(void);

/* Adds to power the row of codes; bit t of mask: pixel t shows a leaf. Both kernels give the same bits. */
void sv_sawtooth_power_scalar(const struct sv_sawtooth_table *table, const uint8_t code[SV_SAWTOOTH_WINDOW],
                              uint32_t mask, float power[SV_SAWTOOTH_FREQUENCIES]);
void sv_sawtooth_power_avx2(const struct sv_sawtooth_table *table, const uint8_t code[SV_SAWTOOTH_WINDOW],
                            uint32_t mask, float power[SV_SAWTOOTH_FREQUENCIES]);

#endif
