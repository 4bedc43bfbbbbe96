/* shade_pass.c - see shade_pass.h: the scalar reference. */
#include "core/tree/shade_pass.h"

#include <math.h>

void sv_shade_pass_scalar(const struct sv_shade_row *row, bool far, uint16_t *light,
                          struct sv_shade_cell *cell)
{
    struct sv_shade_cell sums = *cell;
    for (int i = 0; i < row->count; i += SV_SHADE_LANES)
        for (int k = 0; k < SV_SHADE_LANES; k++) {
            const float *m = row->mixed + row->left[i + k];
            float own = m[0] + row->part[i + k] * (m[1] - m[0]), through = 1 - own;
            float half = sqrtf(through > SV_SHADE_PASS_MIN ? through : SV_SHADE_PASS_MIN);
            float left = light[i + k], given = left / half, weight = own + row->bare[i + k];
            float read = !far ? left : given < SV_SHADE_FULL ? given : SV_SHADE_FULL;
            sums.light[k] += weight * read;
            sums.weight[k] += weight;
            light[i + k] = (uint16_t)(left * half + 0.5f);
        }
    *cell = sums;
}

void sv_shade_mix_scalar(const uint8_t *a, const uint8_t *b, float above, float below, int width,
                         float *mixed)
{
    for (int u = 0; u < width; u++)
        mixed[u] = (float)a[u] * above + (float)b[u] * below;
}
