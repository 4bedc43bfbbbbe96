/* compose.c - see compose.h: the reference, and the choice. TWIN: compose_avx2.c. */
#include "core/view/compose.h"

#include <math.h>
#include <string.h>

#include "core/base/color.h"
#include "core/base/simd.h"
#include "core/view/compose_kernel.h"

static uint8_t encode(float v)
{
    v = v > 0 ? v : 0; /* NaN: 0 */
    v = v < 1 ? v : 1;
    float root = sqrtf(sqrtf(v)), code = sv_compose_term[SV_COMPOSE_TERMS - 1];
    for (int k = SV_COMPOSE_TERMS - 2; k >= 0; k--)
        code = code * root + sv_compose_term[k];
    return (uint8_t)((v <= SV_COMPOSE_BEND ? v * SV_COMPOSE_SLOPE : code) + 0.5f);
}

void sv_compose_scalar(size_t count, const float (*light)[4], const uint8_t (*behind)[4], uint8_t (*out)[4])
{
    for (size_t k = 0; k < count; k++) {
        float pass = light[k][3], each = 1;
        if (pass == 1) {
            memmove(out[k], behind[k], 4);
            continue;
        }
        if (pass < SV_COMPOSE_PASS_MIN) {
            each = 1 / (1 - pass);
            pass = 0;
        }
        uint8_t alpha = (uint8_t)(255 * (1 - pass) + pass * (float)behind[k][3] + 0.5f);
        for (int c = 0; c < 3; c++)
            out[k][c] = encode(each * light[k][c] + pass * sv_linear_from_srgb8[behind[k][c]]);
        out[k][3] = alpha;
    }
}

void sv_compose(size_t count, const float (*light)[4], const uint8_t (*behind)[4], uint8_t (*out)[4])
{
    (sv_simd_level() == SV_SIMD_AVX2 ? sv_compose_avx2 : sv_compose_scalar)(count, light, behind, out);
}
