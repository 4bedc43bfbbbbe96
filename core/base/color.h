/* color.h - the sRGB transfer curve (IEC 61966-2-1), both ways, exact and by table. */
#ifndef SV_BASE_COLOR_H
#define SV_BASE_COLOR_H

#include <math.h>
#include <stdint.h>

/* v in [0, 1] encoded -> linear; outside that range the curve's own continuation, NaN stays NaN. */
static inline float sv_linear_from_srgb(float v)
{
    return v <= 0.04045f ? v / 12.92f : powf((v + 0.055f) / 1.055f, 2.4f);
}
static inline float sv_srgb_from_linear(float v)
{
    return v <= 0.0031308f ? v * 12.92f : 1.055f * powf(v, 1.0f / 2.4f) - 0.055f;
}

/* Linear value of each 8-bit sRGB code, built once by sv_color_init (idempotent; call before any fork). */
extern float sv_linear_from_srgb8[256];
void sv_color_init(void);

/* What vectors of sv_srgb8_from_linear read: code at the bottom of each of 4096 equal bins of 0..1, at most one below
 * any value in it, and the smallest linear value of each code (the last: infinity). After sv_color_init. */
extern int32_t sv_srgb8_bin[4097];
extern float sv_srgb8_threshold[257];

/* Linear light -> nearest 8-bit sRGB code; clamps; NaN gives 0. Exact to the nearest code (table + one compare). */
uint8_t sv_srgb8_from_linear(float v);

#endif
