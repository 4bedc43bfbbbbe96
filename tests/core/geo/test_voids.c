/* Filling of voids against closed forms: a harmonic function must come back, a sea must lie flat. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <cmocka.h>

#include <math.h>
#include <stdbool.h>
#include <stdlib.h>

#include "core/base/rng.h"
#include "core/geo/voids.h"

static float *grid(int width, int height, double (*f)(double, double))
{
    float *h = malloc((size_t)width * (size_t)height * sizeof *h);
    assert_non_null(h);
    for (int j = 0; j < height; j++)
        for (int i = 0; i < width; i++)
            h[j * width + i] = (float)f(i, j);
    return h;
}

static void fill(float *h, int width, int height, struct sv_voids_report *report)
{
    assert_int_equal(sv_voids_fill(h, width, height, 30, report, NULL), SV_OK);
    for (int k = 0; k < width * height; k++)
        assert_true(isfinite(h[k]));
}

static double plane(double x, double y)
{
    return 3 * x - 2 * y + 100;
}

static double saddle(double x, double y)
{
    return 0.01 * ((x - 100) * (x - 100) - (y - 90) * (y - 90)); /* harmonic, discretely, too */
}

/* Inner holes in a harmonic surface: what is filled in differs by at most 1 % of the range of the rim. */
static void inner_holes(void **state)
{
    (void)state;
    static const int radius[] = {0, 1, 3, 10, 40};
    double (*const surfaces[])(double, double) = {plane, saddle};
    for (int s = 0; s < 2; s++)
        for (int k = 0; k < 5; k++) {
            enum { W = 200, H = 180 };
            float *h = grid(W, H, surfaces[s]);
            int r = radius[k], count = 0;
            double lo = INFINITY, hi = -INFINITY, worst = 0;
            for (int j = 0; j < H; j++)
                for (int i = 0; i < W; i++) {
                    double d = hypot(i - 95, j - 85);
                    if (d <= r + 1) {
                        lo = fmin(lo, (double)h[j * W + i]);
                        hi = fmax(hi, (double)h[j * W + i]);
                    }
                    if (d <= r) {
                        h[j * W + i] = NAN;
                        count++;
                    }
                }
            struct sv_voids_report report;
            fill(h, W, H, &report);
            assert_int_equal(report.cells, count);
            assert_int_equal(report.regions, 1);
            assert_int_equal(report.flat_cells, 0);
            for (int j = 0; j < H; j++)
                for (int i = 0; i < W; i++)
                    worst = fmax(worst, fabs((double)h[j * W + i] - surfaces[s](i, j)));
            if (worst > 0.01 * (hi - lo))
                fail_msg("surface %d, radius %d: off by %g of a range of %g", s, r, worst, hi - lo);
            free(h);
        }
}

static double ridges(double x, double y)
{
    return 500 + 300 * sin(0.2 * x) * cos(0.13 * y);
}

/* A border strip of mountains: no value outside the range of the rim, no flat plate. */
static void border_strip(void **state)
{
    (void)state;
    enum { W = 150, H = 120 };
    float *h = grid(W, H, ridges), lo = INFINITY, hi = -INFINITY;
    for (int j = 0; j < H; j++) {
        for (int i = W - 20; i < W; i++)
            h[j * W + i] = NAN;
        float rim = h[j * W + W - 21];
        lo = rim < lo ? rim : lo;
        hi = rim > hi ? rim : hi;
    }
    struct sv_voids_report report;
    fill(h, W, H, &report);
    assert_int_equal(report.flat_regions, 0);
    for (int j = 0; j < H; j++)
        for (int i = W - 20; i < W; i++)
            assert_true(h[j * W + i] >= lo - 0.01f && h[j * W + i] <= hi + 0.01f);
    free(h);
}

static double coast(double x, double y)
{
    (void)y;
    double land = x - 100;
    return land < 0 ? NAN : 1 + 0.5 * fmod(land * 7 + y * 3, 5) + 0.02 * land * land;
}

/* A sea with a low shore and one cliff of 300 m: flat, at the shore's level, the cliff notwithstanding. */
static void sea(void **state)
{
    (void)state;
    enum { W = 300, H = 200 };
    float *h = grid(W, H, coast);
    for (int j = 90; j < 110; j++)
        for (int i = 100; i < 110; i++)
            h[j * W + i] = 300;
    struct sv_voids_report report;
    fill(h, W, H, &report);
    assert_int_equal(report.regions, 1);
    assert_int_equal(report.flat_cells, 100 * H);
    for (int k = 0; k < W * H; k++)
        if (k % W < 100)
            assert_true(h[k] == report.flat_level);
    assert_true(report.flat_level >= 1 && report.flat_level < 2);
    free(h);
}

/* One number in a sea of voids, one row, one column, dust: always finite, always within the range of what is
 * known. */
static void odd_shapes(void **state)
{
    (void)state;
    static const int sizes[][2] = {{1, 1}, {1, 7}, {7, 1}, {2, 2}, {64, 64}, {65, 33}, {257, 3}};
    struct sv_rng rng = sv_rng_seeded(7, 0);
    for (size_t s = 0; s < sizeof sizes / sizeof sizes[0]; s++)
        for (int share = 0; share <= 3; share++) {
            int w = sizes[s][0], n = sizes[s][1];
            float *h = malloc((size_t)(w * n) * sizeof *h), lo = 5, hi = 5;
            assert_non_null(h);
            for (int k = 0; k < w * n; k++) {
                h[k] = sv_rng_unit(&rng) * 3 < share ? (float)sv_rng_range(&rng, -1e4, 1e4) : NAN;
                if (k == w * n / 2)
                    h[k] = 5;
                lo = h[k] < lo ? h[k] : lo;
                hi = h[k] > hi ? h[k] : hi;
            }
            struct sv_voids_report report;
            fill(h, w, n, &report);
            float slack = 1e-6f * (hi - lo); /* rounding of means to float */
            for (int k = 0; k < w * n; k++)
                assert_true(h[k] >= lo - slack && h[k] <= hi + slack);
            free(h);
        }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(inner_holes),
        cmocka_unit_test(border_strip),
        cmocka_unit_test(sea),
        cmocka_unit_test(odd_shapes),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
