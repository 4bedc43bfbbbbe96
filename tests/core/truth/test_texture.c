/* test_texture.c - bilinear repeat sampling against the definition in double. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <math.h>
#include <cmocka.h>

#include "core/base/color.h"
#include "core/base/rng.h"
#include "core/truth/texture.h"

static double linear(uint8_t v)
{
    double x = v / 255.0;
    return x <= 0.04045 ? x / 12.92 : pow((x + 0.055) / 1.055, 2.4);
}

static void test_against_definition(void **state)
{
    (void)state;
    enum { W = 5, H = 3 };
    uint8_t data[W * H * 4];
    struct sv_rng rng = sv_rng_seeded(1, 2);
    for (size_t k = 0; k < sizeof data; k++)
        data[k] = (uint8_t)sv_rng_next(&rng);
    struct sv_image image = {W, H, 4, SV_PIXEL_U8, data};
    sv_color_init();
    for (int k = 0; k < 5000; k++) {
        float u = (float)sv_rng_range(&rng, -3, 3), v = (float)sv_rng_range(&rng, -3, 3), got[4];
        sv_texture_rgba(&image, u, v, got);
        double x = (double)u * W - 0.5, y = (double)v * H - 0.5, fx = x - floor(x), fy = y - floor(y);
        for (int c = 0; c < 4; c++) {
            double sum = 0;
            for (int t = 0; t < 4; t++) {
                int i = ((int)floor(x) + (t & 1)) % W, j = ((int)floor(y) + (t >> 1)) % H;
                uint8_t s = data[((j < 0 ? j + H : j) * W + (i < 0 ? i + W : i)) * 4 + c];
                sum += ((t & 1) ? fx : 1 - fx) * ((t >> 1) ? fy : 1 - fy) * (c < 3 ? linear(s) : s / 255.0);
            }
            assert_true(fabs(sum - (double)got[c]) < 2e-5);
        }
        assert_true(fabsf(got[3] - sv_texture_alpha(&image, u, v)) < 1e-6f);
    }
    const float odd[] = {NAN, INFINITY, -INFINITY, 1e30f, -1e30f, 0.0f, -0.0f, 1e-42f};
    for (size_t k = 0; k < sizeof odd / sizeof *odd; k++) {
        float a = sv_texture_alpha(&image, odd[k], 0.3f);
        assert_true(a >= 0 && a <= 1);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(test_against_definition)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
