/* test_sawtooth.c - periods of synthetic UV textures, known by construction; noise and emptiness; the two
 * kernels; sums in long double. */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "core/base/rng.h"
#include "core/base/simd.h"
#include "core/tree/sawtooth.h"
#include "core/tree/sawtooth_kernel.h"

enum { W = SV_SAWTOOTH_WINDOW, ROWS = SV_SAWTOOTH_ROWS_MAX };

static long full(long small, long large)
{
    return getenv("SV_TEST_FULL") ? large : small;
}

/* Rows of ramps with a period, each row with a phase of its own; pixel t shows a leaf with a given chance. */
struct synthetic {
    uint8_t code[ROWS][W], mask[ROWS][W];
};

static void make_ramps(struct sv_rng *rng, double period, bool falling, double cover, struct synthetic *s)
{
    for (int r = 0; r < ROWS; r++) {
        double phase = sv_rng_unit(rng);
        for (int t = 0; t < W; t++) {
            long double x = (long double)t / (long double)period + (long double)phase;
            double u = (double)(x - floorl(x));
            s->code[r][t] = (uint8_t)floor(255 * (falling ? 1 - u : u) + 0.5);
            s->mask[r][t] = sv_rng_unit(rng) < cover;
        }
    }
}

static struct sv_sawtooth fit(const struct synthetic *s, int rows)
{
    struct sv_sawtooth_options options = SV_SAWTOOTH_OPTIONS_DEFAULT;
    struct sv_sawtooth_window window = {s->code[0], s->mask[0], 1, W, rows};
    return sv_sawtooth_fit(&window, &options);
}

static void check_period(uint64_t seed, double period, bool falling, const struct sv_sawtooth *got,
                         double allowed)
{
    double off = fabs((double)got->period - period) / period;
    if (!(off <= allowed) || got->falling != falling)
        fail_msg("seed %llu: period %.9g %s: got %.9g %s, off by %.3f %%, allowed %.3f %%",
                 (unsigned long long)seed, period, falling ? "falling" : "rising", (double)got->period,
                 got->falling ? "falling" : "rising", 100 * off, 100 * allowed);
}

/* Acceptance: 4 to 24 px, any phase, mirrored or not, one row of 16 pixels: within 2 %. Above 16 px most
 * windows hold no wrap. What is left is 8-bit rounding: a code is off by r = 1 / (255 sqrt(12)) rms, a slope
 * from 16 points by r / sqrt(sum (t - 7.5)^2) = r / 18.4 = 6.1e-5 cycles a px, 0.15 % of the slope at 24 px;
 * worst of many some 4 times that. */
static void test_known_periods(void **state)
{
    (void)state;
    double worst = 0, worst_wrapless = 0;
    long n = full(4000, 200000), wrapless = 0;
    for (long k = 0; k < n; k++) {
        struct sv_rng rng = sv_rng_seeded(71, (uint64_t)k);
        struct synthetic s;
        double period = sv_rng_range(&rng, 4, 24);
        bool falling = k & 1, wraps = false;
        make_ramps(&rng, period, falling, 2, &s);
        struct sv_sawtooth got = fit(&s, 1);
        check_period((uint64_t)k, period, falling, &got, 0.02);
        assert_true(got.correlation > 0.99f);
        for (int t = 1; t < W; t++)
            wraps |= abs(s.code[0][t] - s.code[0][t - 1]) > 128;
        double off = fabs((double)got.period - period) / period;
        worst = fmax(worst, off);
        worst_wrapless = wraps ? worst_wrapless : fmax(worst_wrapless, off);
        wrapless += !wraps;
    }
    printf("%ld windows: off by %.2f %% at worst; %ld without a wrap: %.2f %%\n", n, 100 * worst, wrapless,
           100 * worst_wrapless);
    assert_true(wrapless > n / 20);
}

/* Windows half empty, of four rows with unrelated phases, and columns instead of rows. */
static void test_masked_and_columns(void **state)
{
    (void)state;
    for (long k = 0; k < full(2000, 50000); k++) {
        struct sv_rng rng = sv_rng_seeded(72, (uint64_t)k);
        struct synthetic s, turned;
        double period = sv_rng_range(&rng, 4, 24);
        make_ramps(&rng, period, k & 1, 0.6, &s);
        struct sv_sawtooth got = fit(&s, 4), across;
        check_period((uint64_t)k, period, k & 1, &got, 0.02);
        for (int r = 0; r < W; r++)
            for (int t = 0; t < W; t++) {
                turned.code[t][r] = s.code[r][t];
                turned.mask[t][r] = s.mask[r][t];
            }
        struct sv_sawtooth_options options = SV_SAWTOOTH_OPTIONS_DEFAULT;
        struct sv_sawtooth_window columns = {turned.code[0], turned.mask[0], W, 1, 4};
        across = sv_sawtooth_fit(&columns, &options);
        assert_memory_equal(&got.period, &across.period, sizeof got.period);
        assert_true(got.falling == across.falling && got.coverage == across.coverage);
    }
}

static void test_no_leaf(void **state)
{
    (void)state;
    struct synthetic s;
    memset(&s, 0, sizeof s);
    for (int rows = 1; rows <= ROWS; rows++) {
        struct sv_sawtooth got = fit(&s, rows);
        assert_true(got.period == 0 && got.coverage == 0 && got.correlation == 0);
    }
    /* The chance of a leaf found in noise is at most options.chance for one row (P is exact there but for the
     * search between grid points, which a factor 4 covers): 1e-4 of n windows and Poisson's spread. */
    static const int rows_of[] = {1, 2, 4, 16};
    static const double cover_of[] = {2, 0.8, 0.5, 0.3};
    for (int c = 0; c < 4; c++)
        for (int i = 0; i < 4; i++) {
            long found = 0, n = full(4000, 100000) / rows_of[i];
            for (long k = 0; k < n; k++) {
                struct sv_rng rng = sv_rng_seeded(73 + (uint64_t)(4 * c + i), (uint64_t)k);
                for (int r = 0; r < ROWS; r++)
                    for (int t = 0; t < W; t++) {
                        s.code[r][t] = (uint8_t)(sv_rng_next(&rng) >> 56);
                        s.mask[r][t] = sv_rng_unit(&rng) < cover_of[c];
                    }
                found += fit(&s, rows_of[i]).period != 0;
            }
            double expected = 4e-4 * (double)n;
            if ((double)found > expected + 4 * sqrt(expected) + 1)
                fail_msg("%d rows, cover %.1f: %ld of %ld windows of noise are leaves", rows_of[i],
                         cover_of[c], found, n);
        }
}

/* Too few pixels for any ramp to be believed. */
static void test_few_pixels(void **state)
{
    (void)state;
    struct synthetic s;
    struct sv_rng rng = sv_rng_seeded(74, 0);
    make_ramps(&rng, 8, false, 2, &s);
    struct sv_sawtooth_options options = SV_SAWTOOTH_OPTIONS_DEFAULT;
    options.coverage = 0;
    struct sv_sawtooth_window window = {s.code[0], s.mask[0], 1, W, 1};
    for (int kept = 0; kept <= W; kept++) {
        for (int t = 0; t < W; t++)
            s.mask[0][t] = t < kept;
        struct sv_sawtooth got = sv_sawtooth_fit(&window, &options);
        if (kept <= 2)
            assert_true(got.period == 0);
        if (kept >= 6)
            check_period(0, 8, false, &got, 0.02);
    }
}

/* Periods of 1 and 255, constants, options out of range. */
static void test_extremes(void **state)
{
    (void)state;
    struct synthetic s;
    struct sv_rng rng = sv_rng_seeded(75, 0);
    /* A period of 1 puts the same value on every pixel: a constant, which is given as the longest. */
    make_ramps(&rng, 1, false, 2, &s);
    assert_true(fit(&s, 1).period == 255);
    /* 255: a slope of one code a pixel, known to 6.1e-5 / 0.0039 = 1.6 % rms */
    for (int k = 0; k < 500; k++) {
        make_ramps(&rng, 255, k & 1, 2, &s);
        struct sv_sawtooth got = fit(&s, 1);
        assert_true(got.period > 0 && got.period <= 255 && isfinite(got.period));
        if (fabs((double)got.period - 255) > 0.08 * 255)
            fail_msg("period 255: got %.6g", (double)got.period);
    }
    /* 2 px and below is not looked for: an answer in range, or none, and no NaN. */
    static const double odd[] = {1.0001, 1.5, 1.999, 2, 2.5, 3, 1e-3, 1e6};
    for (size_t k = 0; k < sizeof odd / sizeof *odd; k++) {
        make_ramps(&rng, odd[k], false, 2, &s);
        struct sv_sawtooth got = fit(&s, 4);
        assert_true(got.period == 0 || (got.period >= 3 && got.period <= 255));
    }
    static const float bad[] = {NAN, INFINITY, -INFINITY, -0.0f, -5, 1e-40f, 1e30f};
    make_ramps(&rng, 8, false, 2, &s);
    struct sv_sawtooth_window window = {s.code[0], s.mask[0], 1, W, 3};
    for (size_t a = 0; a < sizeof bad / sizeof *bad; a++)
        for (size_t b = 0; b < sizeof bad / sizeof *bad; b++) {
            struct sv_sawtooth_options options = {bad[a], bad[b], bad[a], bad[b]};
            struct sv_sawtooth got = sv_sawtooth_fit(&window, &options);
            assert_true(got.period >= 0 && got.correlation >= 0 && got.correlation <= 1);
        }
    window.rows = 0;
    struct sv_sawtooth_options usual = SV_SAWTOOTH_OPTIONS_DEFAULT;
    assert_true(sv_sawtooth_fit(&window, &usual).period == 0);
}

/* Formula 1 against long double at places up to 1e6 and beyond. x and w are doubles, so what they stand for
 * is exact; the quotient rounds once. */
static void test_formula(void **state)
{
    (void)state;
    assert_true(sv_sawtooth_at(0, 4) == 0 && sv_sawtooth_at(1, 4) == 0.25 && sv_sawtooth_at(-1, 4) == 0.75);
    assert_true(sv_sawtooth_at(1e6, 1) == 0 && sv_sawtooth_at(1e6 + 0.5, 1) == 0.5);
    assert_true(sv_sawtooth_at(1e6, 255) == 145.0 / 255); /* 1e6 = 3921 * 255 + 145 */
    assert_true(sv_sawtooth_at(NAN, 4) == 0 && sv_sawtooth_at(4, NAN) == 0 && sv_sawtooth_at(4, 0) == 0);
    assert_true(sv_sawtooth_at(4, -1) == 0 && sv_sawtooth_at(INFINITY, 4) == 0 &&
                sv_sawtooth_at(4, INFINITY) == 0 && sv_sawtooth_at(-0.0, 3) == 0);
    struct sv_rng rng = sv_rng_seeded(76, 0);
    for (int k = 0; k < 20000; k++) {
        double w = sv_rng_range(&rng, 1, 255), x = sv_rng_range(&rng, -2e6, 2e6);
        long double r = fmodl((long double)x, (long double)w);
        long double want = (r < 0 ? r + (long double)w : r) / (long double)w;
        double got = sv_sawtooth_at(x, w);
        assert_true(got >= 0 && got < 1);
        double off = fabs(got - (double)want);
        assert_true(fmin(off, 1 - off) <= 4e-16);
    }
    assert_true(sv_sawtooth_at(-1e-30, 5) < 1); /* rounds to a whole period: 0, not 1 */
}

/* The scalar kernel against the sum in long double. Values and factors are rounded to 6e-8, 16 of them add
 * up: |S| is off by 16 * 2e-7, its square by 2 * 16 of that. */
static void test_power(void **state)
{
    (void)state;
    struct sv_rng rng = sv_rng_seeded(77, 0);
    for (int n = 0; n < 200; n++) {
        uint8_t code[W];
        float power[SV_SAWTOOTH_FREQUENCIES];
        uint32_t mask = (uint32_t)(sv_rng_next(&rng) >> 48);
        for (int t = 0; t < W; t++)
            code[t] = (uint8_t)(sv_rng_next(&rng) >> 56);
        for (int k = 0; k < SV_SAWTOOTH_FREQUENCIES; k++)
            power[k] = 7;
        sv_sawtooth_power_scalar(sv_sawtooth_table(), code, mask, power);
        for (int k = 0; k < SV_SAWTOOTH_FREQUENCIES; k++) {
            long double re = 0, im = 0, g = (long double)k / SV_SAWTOOTH_FREQUENCIES - 0.5L;
            for (int t = 0; t < W; t++)
                if (mask >> t & 1) {
                    long double angle = 2 * 3.14159265358979323846L * (code[t] / 255.0L - g * t);
                    re += cosl(angle), im += sinl(angle);
                }
            assert_true(fabsl((long double)power[k] - 7 - (re * re + im * im)) < 2e-4L);
        }
    }
}

static void test_kernels_agree(void **state)
{
    (void)state;
    if (!__builtin_cpu_supports("avx2")) {
        print_message("skipped: this CPU has no AVX2\n");
        skip();
    }
    struct sv_rng rng = sv_rng_seeded(78, 0);
    for (int n = 0; n < 2000; n++) {
        uint8_t code[W];
        float one[SV_SAWTOOTH_FREQUENCIES], two[SV_SAWTOOTH_FREQUENCIES + 1];
        uint32_t mask = n == 0   ? 0
                        : n == 1 ? 0xFFFF
                        : n < 20 ? 1u << (n % 16)
                                 : (uint32_t)(sv_rng_next(&rng) >> 48);
        for (int t = 0; t < W; t++)
            code[t] = (uint8_t)(sv_rng_next(&rng) >> 56);
        for (int k = 0; k < SV_SAWTOOTH_FREQUENCIES; k++)
            one[k] = two[k + 1] = n % 7 == 6 ? NAN : (float)sv_rng_unit(&rng);
        sv_sawtooth_power_scalar(sv_sawtooth_table(), code, mask, one);
        sv_sawtooth_power_avx2(sv_sawtooth_table(), code, mask, two + 1); /* not aligned */
        if (n % 7 != 6)
            assert_memory_equal(one, two + 1, sizeof one);
        else
            for (int k = 0; k < SV_SAWTOOTH_FREQUENCIES; k++)
                assert_true(isnan(one[k]) && isnan(two[k + 1]));
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_known_periods), cmocka_unit_test(test_masked_and_columns),
        cmocka_unit_test(test_no_leaf),       cmocka_unit_test(test_few_pixels),
        cmocka_unit_test(test_extremes),      cmocka_unit_test(test_formula),
        cmocka_unit_test(test_power),         cmocka_unit_test(test_kernels_agree),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
