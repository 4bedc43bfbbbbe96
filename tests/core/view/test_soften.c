/* test_soften.c - the softened layer against the definition in double, and what follows from it. */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <string.h>

#include <cmocka.h>

#include "core/base/color.h"
#include "core/base/rng.h"
#include "core/view/soften.h"

enum { SIDE = 37 };
static uint8_t layer[SIDE * SIDE][4];
static float light[SIDE * SIDE][4];

static double linear(double code)
{
    double v = code / 255;
    return v <= 0.04045 ? v / 12.92 : pow((v + 0.055) / 1.055, 2.4);
}

static double value(int width, int rows, int i, int j, int c)
{
    i = i < 0 ? 0 : i < width ? i : width - 1;
    j = j < 0 ? 0 : j < rows ? j : rows - 1;
    const uint8_t *p = layer[j * width + i];
    return c == 3 ? p[3] / 255.0 : linear(p[c]);
}

/* Float sums of nine products of values up to 1 round by a few 2^-24. */
static void check(int width, int rows)
{
    const double w[3] = {SV_SOFTEN_SIDE, 1 - 2 * SV_SOFTEN_SIDE, SV_SOFTEN_SIDE};
    struct sv_error error;
    assert_int_equal(sv_soften(width, rows, SV_SOFTEN_SIDE, (const uint8_t(*)[4])layer, light, &error), SV_OK);
    for (int j = 0; j < rows; j++)
        for (int i = 0; i < width; i++)
            for (int c = 0; c < 4; c++) {
                double sum = 0;
                for (int k = 0; k < 9; k++)
                    sum += w[k % 3] * w[k / 3] * value(width, rows, i + k % 3 - 1, j + k / 3 - 1, c);
                double want = c == 3 ? 1 - sum : sum, got = light[j * width + i][c];
                if (fabs(want - got) > 1e-6)
                    fail_msg("%d x %d, pixel (%d, %d) channel %d: expected %.7f, got %.7f", width, rows, i, j,
                             c, want, got);
            }
}

static void softened_as_defined(void **state)
{
    (void)state;
    struct sv_rng rng = sv_rng_seeded(26, 3);
    static const int sizes[][2] = {{1, 1}, {1, 5}, {5, 1}, {2, 2}, {3, 3}, {8, 4}, {SIDE, SIDE}};
    sv_color_init();
    for (size_t k = 0; k < sizeof sizes / sizeof *sizes; k++)
        for (int share = 0; share <= 10; share += 2) { /* rows of nothing too */
            memset(layer, 0, sizeof layer);
            for (int p = 0; p < sizes[k][0] * sizes[k][1]; p++) {
                if (p / sizes[k][0] % 5 > 1 || sv_rng_range(&rng, 0, 10) >= share)
                    continue;
                for (int c = 0; c < 4; c++)
                    layer[p][c] = (uint8_t)sv_rng_range(&rng, c < 3 ? 0 : 1, 256);
            }
            check(sizes[k][0], sizes[k][1]);
        }
}

/* Nothing lets all light through, exactly: it is composed without rounding. */
static void nothing_stays_nothing(void **state)
{
    (void)state;
    struct sv_error error;
    memset(layer, 0, sizeof layer);
    assert_int_equal(sv_soften(SIDE, SIDE, SV_SOFTEN_SIDE, (const uint8_t(*)[4])layer, light, &error), SV_OK);
    for (int p = 0; p < SIDE * SIDE; p++)
        for (int c = 0; c < 4; c++)
            assert_true(light[p][c] == (c == 3 ? 1 : 0));
}

/* What is whole stays so: nothing is seen through it. */
static void whole_stays_whole(void **state)
{
    (void)state;
    struct sv_error error;
    memset(layer, 255, sizeof layer);
    assert_int_equal(sv_soften(SIDE, SIDE, SV_SOFTEN_SIDE, (const uint8_t(*)[4])layer, light, &error), SV_OK);
    for (int p = 0; p < SIDE * SIDE; p++)
        assert_true(fabsf(light[p][0] - 1) < 1e-6f && fabsf(light[p][3]) < 1e-6f);
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(softened_as_defined),
                                       cmocka_unit_test(nothing_stays_nothing),
                                       cmocka_unit_test(whole_stays_whole)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
