/* test_procedural.c - the relief is met, the same seed gives the same land everywhere, and water finds its
 * way. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <cmocka.h>

#include "core/base/hash.h"
#include "core/terrain/erosion.h"
#include "core/terrain/procedural.h"

static struct sv_arena *arena;

static struct sv_heightfield make(double size_m, int samples, double relief_m, uint64_t seed)
{
    const struct sv_procedural_options options = {size_m, samples, relief_m, seed};
    struct sv_heightfield f;
    struct sv_error e;
    if (sv_terrain_procedural(&options, arena, &f, &e) != SV_OK)
        fail_msg("%s: %s", e.field, e.message);
    return f;
}

static void check_relief(const struct sv_heightfield *f, double relief_m)
{
    float lo = INFINITY, hi = -INFINITY;
    for (size_t k = 0; k < (size_t)f->width * (size_t)f->height; k++) {
        assert_true(isfinite(f->h[k]));
        lo = fminf(lo, f->h[k]);
        hi = fmaxf(hi, f->h[k]);
    }
    assert_true(lo == 0 && hi == (float)relief_m);
    assert_true(f->h_min == lo && f->h_max == hi && f->z0 == 0);
}

static void test_relief(void **state)
{
    (void)state;
    static const struct {
        double size_m, relief_m;
        int samples;
    } rows[] = {{2000, 150, 257}, {1, 0.1, 2},           {1e6, 9000, 65},
                {10, 0, 33},      {333.3, 12.345678, 3}, {5000, 1e-30, 20}};
    for (size_t k = 0; k < sizeof rows / sizeof rows[0]; k++)
        for (uint64_t seed = 0; seed < 2; seed++) {
            struct sv_heightfield f = make(rows[k].size_m, rows[k].samples, rows[k].relief_m, seed);
            check_relief(&f, rows[k].relief_m);
            assert_int_equal(f.width, rows[k].samples);
            assert_int_equal(f.height, rows[k].samples);
            assert_true(f.x0 == 0 && f.y0 == 0);
            assert_true(fabs(sv_heightfield_x1(&f) - rows[k].size_m) < 1e-9 * rows[k].size_m);
        }
}

/* Pinned: these bits on every machine and compiler. A change of the builder changes them on purpose, and then
 * SV_PROCEDURAL_VERSION goes up. */
static void test_pinned(void **state)
{
    (void)state;
    struct sv_heightfield f = make(2000, 300, 150, 42);
    uint64_t h = sv_hash_done(sv_hash_bytes(SV_HASH_INIT, f.h, 300 * 300 * sizeof *f.h));
    assert_int_equal(h, UINT64_C(0xF5CC16EC45B27EB0));
    struct sv_heightfield again = make(2000, 300, 150, 42), other = make(2000, 300, 150, 43);
    assert_memory_equal(f.h, again.h, 300 * 300 * sizeof *f.h);
    assert_memory_not_equal(f.h, other.h, 300 * 300 * sizeof *f.h);
}

/* The same seed is the same land whatever the sampling: correlation of 129 and 513 samples at common places.
 */
static void test_same_land(void **state)
{
    (void)state;
    struct sv_heightfield a = make(1000, 129, 100, 5), b = make(1000, 513, 100, 5);
    double n = 129 * 129, sa = 0, sb = 0, saa = 0, sbb = 0, sab = 0;
    for (int j = 0; j < 129; j++)
        for (int i = 0; i < 129; i++) {
            double u = (double)a.h[j * 129 + i], v = (double)b.h[4 * j * 513 + 4 * i];
            sa += u;
            sb += v;
            saa += u * u;
            sbb += v * v;
            sab += u * v;
        }
    double r = (n * sab - sa * sb) / sqrt((n * saa - sa * sa) * (n * sbb - sb * sb));
    if (!(r > 0.95))
        fail_msg("correlation %.3f", r);
}

/* Looks like land: hills are no noise (the steepest is far from vertical), and most of it is neither flat nor
 * a cliff. */
static void test_slopes(void **state)
{
    (void)state;
    for (uint64_t seed = 1; seed < 3; seed++) {
        struct sv_heightfield f = make(2000, 513, 150, seed);
        double sum = 0;
        int steep = 0, n = 0;
        for (double y = 5; y < 2000; y += 13)
            for (double x = 5; x < 2000; x += 13, n++) {
                double slope;
                assert_true(sv_heightfield_slope(&f, x, y, &slope));
                sum += sv_degrees(slope);
                steep += sv_degrees(slope) > 45;
            }
        if (!(sum / n > 5 && sum / n < 25 && steep < 0.02 * n))
            fail_msg("seed %llu: mean slope %.1f deg, %d of %d over 45 deg", (unsigned long long)seed,
                     sum / n, steep, n);
    }
}

static void test_refused(void **state)
{
    (void)state;
    static const struct sv_procedural_options bad[] = {{0, 10, 1, 1},     {NAN, 10, 1, 1},  {1e7, 10, 1, 1},
                                                       {10, 1, 1, 1},     {10, 8193, 1, 1}, {10, 10, -1, 1},
                                                       {10, 10, 9001, 1}, {10, 10, NAN, 1}};
    for (size_t k = 0; k < sizeof bad / sizeof bad[0]; k++) {
        struct sv_heightfield f = {.width = 99};
        struct sv_error e;
        assert_int_equal(sv_terrain_procedural(&bad[k], arena, &f, &e), SV_EINVAL);
        assert_int_equal(f.width, 99);
    }
}

/* ---- erosion alone ---- */

enum { SIDE = 65 };

/* After rain on any ground every sample's water leaves by an outlet: the outlets' areas add up to the whole
 * square. */
static void test_all_water_leaves(void **state)
{
    (void)state;
    static float h[SIDE * SIDE], uplift[SIDE * SIDE], area[SIDE * SIDE];
    static uint8_t outlet[SIDE * SIDE];
    struct sv_rng rng = sv_rng_seeded(8, 8);
    for (int k = 0; k < SIDE * SIDE; k++) {
        h[k] = (float)sv_rng_unit(&rng); /* nothing but pits and peaks */
        uplift[k] = 0.1f;
    }
    outlet[5] = outlet[SIDE * SIDE - 1] = 1;
    struct sv_erosion e = {SIDE, h, outlet, uplift, area};
    const struct sv_erosion_options o = {1, 0.01, 4, 0.1, 3};
    float held = h[5];
    assert_int_equal(sv_erosion_run(&e, &o, NULL), SV_OK);
    double sum = (double)area[5] + (double)area[SIDE * SIDE - 1];
    assert_true(fabs(sum * (SIDE - 1) * (SIDE - 1) - SIDE * SIDE) < 0.5); /* float sums of 4,225 parts */
    assert_true(h[5] == held);
    memset(outlet, 0, sizeof outlet);
    assert_int_equal(sv_erosion_run(&e, &o, NULL), SV_EINVAL);
}

/* Steady state of one channel: in a valley one sample wide that rises at rate U, K sqrt(A) slope = U. */
static void test_steady_channel(void **state)
{
    (void)state;
    static float h[SIDE * SIDE], uplift[SIDE * SIDE], area[SIDE * SIDE];
    static uint8_t outlet[SIDE * SIDE];
    for (int k = 0; k < SIDE * SIDE; k++) {
        h[k] = 0.001f * (float)(k % SIDE); /* falls to the west */
        uplift[k] = 1;
        outlet[k] = k % SIDE == 0;
    }
    struct sv_erosion e = {SIDE, h, outlet, uplift, area};
    const struct sv_erosion_options o = {400, 0.1, 4, 0, 1};
    assert_int_equal(sv_erosion_run(&e, &o, NULL), SV_OK);
    double cell = 1.0 / (SIDE - 1);
    int checked = 0;
    for (int y = 1; y + 1 < SIDE; y++)
        for (int x = 1; x + 1 < SIDE; x++) {
            int k = y * SIDE + x;
            double steepest = 0;
            for (int v = -1; v <= 1; v++)
                for (int u = -1; u <= 1; u++)
                    if (u || v)
                        steepest = fmax(steepest,
                                        (double)(h[k] - h[k + v * SIDE + u]) / (cell * sqrt(u * u + v * v)));
            /* Receivers wobble among slopes of 0.3 .. 1 of the steepest; the biggest channels keep theirs. */
            if ((double)area[k] > 0.05) {
                double expected = 1 / (4 * sqrt((double)area[k]));
                assert_true(steepest > 0.5 * expected && steepest < 2.5 * expected);
                checked++;
            }
        }
    assert_true(checked > 5);
}

static int set_up(void **state)
{
    (void)state;
    return sv_arena_create((size_t)1 << 32, &arena, NULL) == SV_OK ? 0 : -1;
}

static int tear_down(void **state)
{
    (void)state;
    sv_arena_destroy(arena);
    return 0;
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_relief),        cmocka_unit_test(test_pinned),
        cmocka_unit_test(test_same_land),     cmocka_unit_test(test_slopes),
        cmocka_unit_test(test_refused),       cmocka_unit_test(test_all_water_leaves),
        cmocka_unit_test(test_steady_channel)};
    return cmocka_run_group_tests(tests, set_up, tear_down);
}
