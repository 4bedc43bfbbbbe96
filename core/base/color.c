#include "core/base/color.h"

float sv_linear_from_srgb8[256];
float sv_srgb8_threshold[257];
int32_t sv_srgb8_bin[4097];

void sv_color_init(void)
{
    if (sv_linear_from_srgb8[255] > 0)
        return;
    for (int k = 1; k < 256; k++)
        sv_srgb8_threshold[k] = sv_linear_from_srgb(((float)k - 0.5f) / 255.0f);
    sv_srgb8_threshold[256] = INFINITY;
    int code = 0;
    for (int b = 0; b <= 4096; b++) {
        while (code < 255 && sv_srgb8_threshold[code + 1] <= (float)b / 4096.0f)
            code++;
        sv_srgb8_bin[b] = code;
    }
    for (int k = 0; k < 256; k++)
        sv_linear_from_srgb8[k] = sv_linear_from_srgb((float)k / 255.0f);
}

uint8_t sv_srgb8_from_linear(float v)
{
    if (!(v > 0))
        return 0;
    if (v >= 1)
        return 255;
    int code = sv_srgb8_bin[(int)(v * 4096.0f)];
    while (code < 255 && v >= sv_srgb8_threshold[code + 1])
        code++;
    return (uint8_t)code;
}
