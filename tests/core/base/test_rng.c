/* test_rng.c - rng.h, hash.h and noise.h: known values, and what they promise. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <cmocka.h>

#include "core/base/hash.h"
#include "core/base/noise.h"

/* splitmix64 from state 0: the generator's published first outputs (Vigna, splitmix64.c; Java's
 * SplittableRandom). */
static void test_known(void **state)
{
    (void)state;
    struct sv_rng rng = {0};
    assert_true(sv_rng_next(&rng) == UINT64_C(0xE220A8397B1DCDAF));
    assert_true(sv_rng_next(&rng) == UINT64_C(0x6E789E6AA1B965F4));
    assert_true(sv_rng_next(&rng) == UINT64_C(0x06C45D188009454F));
}

/* Chi-square over 256 bins, 256,000 draws, of many streams: 5 sigma of a distribution with mean 255, variance
 * 510. */
static void test_uniform(void **state)
{
    (void)state;
    for (uint64_t stream = 0; stream < 20; stream++) {
        struct sv_rng rng = sv_rng_seeded(7, stream);
        int bins[256] = {0};
        double chi = 0;
        for (int k = 0; k < 256000; k++) {
            double u = sv_rng_unit(&rng);
            assert_true(u >= 0 && u < 1);
            bins[(int)(u * 256)]++;
        }
        for (int k = 0; k < 256; k++)
            chi += (bins[k] - 1000.0) * (bins[k] - 1000.0) / 1000.0;
        assert_true(chi > 255 - 5 * 22.6 && chi < 255 + 5 * 22.6);
    }
}

static void test_streams_differ(void **state)
{
    (void)state;
    struct sv_rng a = sv_rng_seeded(1, 1), b = sv_rng_seeded(1, 2), c = sv_rng_seeded(2, 1);
    uint64_t x = sv_rng_next(&a), y = sv_rng_next(&b), z = sv_rng_next(&c);
    assert_true(x != y && x != z && y != z);
}

static uint64_t hash_of(const void *data, size_t n)
{
    return sv_hash_done(sv_hash_bytes(SV_HASH_INIT, data, n));
}

/* Every single flipped bit of a block changes its hash. */
static void test_hash_flips(void **state)
{
    (void)state;
    unsigned char block[100];
    for (size_t k = 0; k < sizeof block; k++)
        block[k] = (unsigned char)(k * 37);
    uint64_t whole = hash_of(block, sizeof block);
    for (size_t bit = 0; bit < 8 * sizeof block; bit++) {
        block[bit / 8] ^= (unsigned char)(1u << bit % 8);
        assert_true(hash_of(block, sizeof block) != whole);
        block[bit / 8] ^= (unsigned char)(1u << bit % 8);
    }
    assert_true(hash_of(block, sizeof block) == whole);
}

static void test_hash_fields(void **state)
{
    (void)state;
    uint64_t ab = sv_hash_string(sv_hash_string(SV_HASH_INIT, "a"), "bc");
    uint64_t ac = sv_hash_string(sv_hash_string(SV_HASH_INIT, "ab"), "c");
    assert_true(ab != ac);
    assert_true(sv_hash_double(1, 0.0) == sv_hash_double(1, -0.0));
    assert_true(sv_hash_double(1, NAN) == sv_hash_double(1, -NAN));
    assert_true(sv_hash_double(1, 1.0) != sv_hash_double(1, 1.0000000000000002));
}

/* The noise's slope against central differences: their error is h^2 / 6 times the third derivative, some 60
 * here. */
static void test_noise_slope(void **state)
{
    (void)state;
    struct sv_rng rng = sv_rng_seeded(3, 0);
    const double h = 1e-5;
    for (int k = 0; k < 20000; k++) {
        double x = sv_rng_range(&rng, -50, 50), y = sv_rng_range(&rng, -50, 50);
        struct sv_noise n = sv_noise_at(11, x, y);
        double dx = (sv_noise_at(11, x + h, y).v - sv_noise_at(11, x - h, y).v) / (2 * h);
        double dy = (sv_noise_at(11, x, y + h).v - sv_noise_at(11, x, y - h).v) / (2 * h);
        assert_true(fabs(n.dx - dx) < 1e-7 && fabs(n.dy - dy) < 1e-7);
        assert_true(fabs(n.v) <= 1);
    }
}

/* At lattice points the noise is 0, and across cell borders it has no step. */
static void test_noise_lattice(void **state)
{
    (void)state;
    for (int i = -20; i < 20; i++)
        for (int j = -20; j < 20; j++) {
            assert_true(sv_noise_at(5, i, j).v == 0);
            double before = sv_noise_at(5, i - 1e-12, j + 0.37).v, after = sv_noise_at(5, i, j + 0.37).v;
            assert_true(fabs(before - after) < 1e-11);
        }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_known),          cmocka_unit_test(test_uniform),
        cmocka_unit_test(test_streams_differ), cmocka_unit_test(test_hash_flips),
        cmocka_unit_test(test_hash_fields),    cmocka_unit_test(test_noise_slope),
        cmocka_unit_test(test_noise_lattice)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
