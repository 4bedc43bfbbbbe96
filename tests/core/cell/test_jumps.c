/* test_jumps.c - sums of depth steps: a closed form, and a plain loop over all pairs in double. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>

#include <cmocka.h>

#include "core/base/rng.h"
#include "core/cell/jumps.h"

#include <math.h>

enum { N_MAX = 41 };

static void expect(double got, double want)
{
    /* A row's eight sums in float: 6 additions of at most 1 each, rounded to 2^-24 of themselves. */
    assert_true(fabs(got - want) <= 1e-6 * (1 + want));
}

/* A square of q = 1/2 before nothing: each of its sides is one step a texel. */
static void test_square(void **state)
{
    (void)state;
    static float q[32 * 32];
    struct sv_cell_jumps s;
    for (int j = 8; j < 24; j++)
        for (int i = 4; i < 24; i++)
            q[j * 32 + i] = 0.5f;
    sv_cell_jumps_measure(q, 32, 0.1f, &s);
    assert_int_equal(s.texels, 16 * 20);
    expect(s.x_plus, 16 * 0.5);
    expect(s.x_minus, 16 * 0.5);
    expect(s.y_plus, 20 * 0.5);
    expect(s.y_minus, 20 * 0.5);
    expect(s.xx, 16 * 0.5 * (0.75 + 0.5)); /* sides at xs = -3/4 and 1/2 */
    expect(s.yy, 20 * 0.5 * (0.5 + 0.5));
    sv_cell_jumps_measure(q, 32, 0.5f, &s);
    expect(s.x_plus + s.x_minus + s.y_plus + s.y_minus + s.xx + s.yy, 0);
}

static struct sv_cell_jumps plain(const double *q, int n, double cut)
{
    struct sv_cell_jumps s = {.texels = 0};
    for (int j = 0; j < n; j++)
        for (int i = 0; i < n; i++) {
            double here = q[j * n + i];
            s.texels += here > 0;
            if (i + 1 < n) {
                double d = q[j * n + i + 1] - here;
                if (fabs(d) > cut) {
                    *(d > 0 ? &s.x_plus : &s.x_minus) += fabs(d);
                    s.xx += fabs((2.0 * (i + 1) / n - 1) * d);
                }
            }
            if (j > 0) {
                double d = q[(j - 1) * n + i] - here;
                if (fabs(d) > cut) {
                    *(d > 0 ? &s.y_plus : &s.y_minus) += fabs(d);
                    s.yy += fabs((1 - 2.0 * j / n) * d);
                }
            }
        }
    return s;
}

static void compare(const struct sv_cell_jumps *got, const struct sv_cell_jumps *want)
{
    assert_int_equal(got->texels, want->texels);
    expect(got->x_plus, want->x_plus);
    expect(got->x_minus, want->x_minus);
    expect(got->y_plus, want->y_plus);
    expect(got->y_minus, want->y_minus);
    expect(got->xx, want->xx);
    expect(got->yy, want->yy);
}

static void test_random(void **state)
{
    (void)state;
    static double q[N_MAX * N_MAX];
    static float f[N_MAX * N_MAX];
    static uint16_t codes[N_MAX * N_MAX];
    static const int sizes[] = {1, 2, 7, 8, 9, 16, 17, N_MAX};
    struct sv_rng rng = sv_rng_seeded(5, 1);
    for (size_t k = 0; k < sizeof sizes / sizeof sizes[0]; k++) {
        int n = sizes[k];
        double cut = 0.2 + 0.5 / 65536; /* between two codes' differences */
        struct sv_cell_jumps s;
        for (int p = 0; p < n * n; p++) {
            codes[p] = (uint16_t)(sv_rng_range(&rng, 0, 1) < 0.3 ? 0 : sv_rng_range(&rng, 1, 65535));
            q[p] = codes[p] / 32768.0;
            f[p] = (float)q[p];
        }
        struct sv_cell_jumps want = plain(q, n, cut);
        sv_cell_jumps_measure(f, n, (float)cut, &s);
        compare(&s, &want);
        sv_cell_jumps_measure_codes(codes, n, (float)cut, &s);
        compare(&s, &want);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(test_square), cmocka_unit_test(test_random)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
