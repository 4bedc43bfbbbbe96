/* test_compose.c - composed bytes against the definition in double, both kernels alike, at every tail. */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <string.h>

#include <cmocka.h>

#include "core/base/color.h"
#include "core/base/rng.h"
#include "core/base/simd.h"
#include "core/view/compose_kernel.h"

enum { PIXELS = 4099 };
static float light[PIXELS][4];
static uint8_t behind[PIXELS][4], scalar[PIXELS + 1][4], vector[PIXELS + 1][4];

static double linear(double code)
{
    double v = code / 255;
    return v <= 0.04045 ? v / 12.92 : pow((v + 0.055) / 1.055, 2.4);
}

static double srgb(double v)
{
    v = fmin(fmax(v, 0), 1);
    return 255 * (v <= 0.0031308 ? v * 12.92 : 1.055 * pow(v, 1 / 2.4) - 0.055);
}

static void fill(uint64_t seed)
{
    struct sv_rng rng = sv_rng_seeded(seed, 0);
    for (int k = 0; k < PIXELS; k++) {
        int kind = (int)sv_rng_range(&rng, 0, 4);
        float pass = kind == 0   ? 1
                     : kind == 1 ? 0
                     : kind == 2 ? (float)sv_rng_range(&rng, 0, 0.006)
                                 : (float)sv_rng_range(&rng, 0, 1);
        for (int c = 0; c < 3; c++) {
            light[k][c] = (float)sv_rng_range(&rng, 0, 1.2) * (1 - pass);
            behind[k][c] = (uint8_t)sv_rng_range(&rng, 0, 256);
        }
        light[k][3] = pass;
        behind[k][3] = (uint8_t)sv_rng_range(&rng, 0, 256);
    }
}

/* Truth: the header's sentence. The nearest code, but for the rounding of float light: 1e-6 of linear light
 * is at most 1e-6 * 12.92 * 255 = 0.0033 levels off. */
static void composed_as_defined(void **state)
{
    (void)state;
    sv_color_init();
    fill(1);
    sv_compose_scalar(PIXELS, (const float(*)[4])light, (const uint8_t(*)[4])behind, scalar);
    for (int k = 0; k < PIXELS; k++) {
        double pass = (double)light[k][3], each = 1;
        if (pass == 1) {
            assert_memory_equal(scalar[k], behind[k], 4);
            continue;
        }
        if (pass < 1.0 / 255) {
            each = 1 / (1 - pass);
            pass = 0;
        }
        for (int c = 0; c < 3; c++) {
            double want = srgb(each * (double)light[k][c] + pass * linear(behind[k][c]));
            if (fabs(want - scalar[k][c]) > 0.5 + 0.01)
                fail_msg("pixel %d channel %d: expected %.4f, got %d", k, c, want, scalar[k][c]);
        }
        assert_true(fabs(255 * (1 - pass) + pass * behind[k][3] - scalar[k][3]) <= 0.5 + 1e-4);
    }
}

static void levels_agree(void **state)
{
    (void)state;
    if (sv_simd_level() != SV_SIMD_AVX2)
        skip();
    fill(2);
    light[5][0] = NAN;
    light[6][1] = INFINITY;
    light[7][2] = -1;
    for (int count = 0; count < PIXELS; count = count < 40 ? count + 1 : count + 1013) {
        memset(scalar, 7, sizeof scalar);
        memset(vector, 7, sizeof vector);
        sv_compose_scalar((size_t)count, (const float(*)[4])light, (const uint8_t(*)[4])behind, scalar);
        sv_compose_avx2((size_t)count, (const float(*)[4])light, (const uint8_t(*)[4])behind, vector);
        assert_memory_equal(scalar, vector, sizeof scalar);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(composed_as_defined), cmocka_unit_test(levels_agree)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
