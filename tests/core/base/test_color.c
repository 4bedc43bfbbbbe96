/* test_color.c - the sRGB tables against the standard's formula in long double. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <cmocka.h>

#include "core/base/color.h"
#include "core/base/rng.h"

static long double linear(long double v)
{
    return v <= 0.04045L ? v / 12.92L : powl((v + 0.055L) / 1.055L, 2.4L);
}

static void test_decode(void **state)
{
    (void)state;
    for (int k = 0; k < 256; k++)
        assert_true(fabsl((long double)sv_linear_from_srgb8[k] - linear(k / 255.0L)) <
                    2e-7L); /* powf: 1 ulp at 1 */
}

static void test_round_trip(void **state)
{
    (void)state;
    for (int k = 0; k < 256; k++) {
        assert_int_equal(sv_srgb8_from_linear(sv_linear_from_srgb8[k]), k);
        float v = (float)k / 255.0f;
        assert_true(fabsf(sv_srgb_from_linear(sv_linear_from_srgb(v)) - v) < 1e-6f);
    }
}

/* Nearest code: the value lies between the linear values of k - 1/2 and k + 1/2, up to float rounding of the
 * border. */
static void test_nearest(void **state)
{
    (void)state;
    struct sv_rng rng = sv_rng_seeded(1, 2);
    for (int n = 0; n < 200000; n++) {
        float v = (float)sv_rng_unit(&rng);
        v = n % 2 ? v : v * v * v; /* dark codes lie dense */
        int k = sv_srgb8_from_linear(v);
        long double lo = k > 0 ? linear((k - 0.5L) / 255) : -1, hi = k < 255 ? linear((k + 0.5L) / 255) : 2;
        if (!((long double)v >= lo - 1e-7L && (long double)v <= hi + 1e-7L))
            fail_msg("%.9g gave code %d", (double)v, k);
    }
}

static void test_edges(void **state)
{
    (void)state;
    assert_int_equal(sv_srgb8_from_linear(-1), 0);
    assert_int_equal(sv_srgb8_from_linear(-0.0f), 0);
    assert_int_equal(sv_srgb8_from_linear(NAN), 0);
    assert_int_equal(sv_srgb8_from_linear(INFINITY), 255);
    assert_int_equal(sv_srgb8_from_linear(-INFINITY), 0);
    assert_int_equal(sv_srgb8_from_linear(1e30f), 255);
    assert_int_equal(sv_srgb8_from_linear(0x1p-149f), 0);
    assert_int_equal(sv_srgb8_from_linear(0.99999994f), 255);
}

static int set_up(void **state)
{
    (void)state;
    sv_color_init();
    sv_color_init();
    return 0;
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(test_decode), cmocka_unit_test(test_round_trip),
                                       cmocka_unit_test(test_nearest), cmocka_unit_test(test_edges)};
    return cmocka_run_group_tests(tests, set_up, NULL);
}
