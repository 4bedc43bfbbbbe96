/* compose.c - see compose.h. */
#include "core/view/compose.h"

#include <string.h>

#include "core/base/color.h"

#define PASS_MIN (1.0f / 255)

void sv_compose(size_t count, const float (*light)[4], const uint8_t (*behind)[4], uint8_t (*out)[4])
{
    for (size_t k = 0; k < count; k++) {
        float pass = light[k][3], each = 1;
        if (pass == 1) {
            memmove(out[k], behind[k], 4);
            continue;
        }
        if (pass < PASS_MIN) {
            each = 1 / (1 - pass);
            pass = 0;
        }
        for (int c = 0; c < 3; c++)
            out[k][c] = sv_srgb8_from_linear(each * light[k][c] + pass * sv_linear_from_srgb8[behind[k][c]]);
        out[k][3] = (uint8_t)(255 * (1 - pass) + pass * (float)behind[k][3] + 0.5f);
    }
}
