/* test_object_casters.c - depth of quadrilaterals in parallel light: against points and planes in double, and
 * AVX2 against scalar, bit by bit. What an object casts as a whole is judged by rays in test_object.c. */
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
#include "core/relief/object_casters.h"

enum { WIDTH = 37, HEIGHT = 29, EIGHTS = 5 };

static struct sv_relief_map any_map(struct sv_rng *rng, float *depth)
{
    struct sv_relief_map map = {.depth = depth, .width = WIDTH, .height = HEIGHT};
    bool full = sv_rng_unit(rng) < 0.5;
    map.du = full ? 2 : sv_rng_unit(rng) < 0.5 ? -1 : 1;
    map.dv = full ? 2 : sv_rng_unit(rng) < 0.5 ? -1 : 1;
    for (int k = 0; k < 3; k++)
        for (int c = 0; c < 3; c++)
            map.at[k][c] = (float)sv_rng_range(rng, -1, 1) * (k < 2 ? 1 : 0.01f);
    map.at[0][3] = (float)sv_rng_range(rng, 0, WIDTH);
    map.at[1][3] = (float)sv_rng_range(rng, 0, HEIGHT);
    map.at[2][3] = 0.5f;
    memset(depth, 0, sizeof(float) * WIDTH * HEIGHT);
    return map;
}

static void any_quads(struct sv_rng *rng, struct sv_relief_quads *quads, bool level)
{
    for (int n = 0; n < 8; n++) {
        quads->u[n] = (int16_t)sv_rng_range(rng, -20, 20);
        quads->v[n] = (int16_t)sv_rng_range(rng, -20, 20);
        for (int k = 0; k < 4; k++)
            quads->t[k][n] = (float)sv_rng_range(rng, -3, 3);
        if (level) /* a parallelogram */
            quads->t[3][n] = quads->t[1][n] + (quads->t[2][n] - quads->t[0][n]);
    }
}

/* A parallelogram's corner and sides in double: x, y, depth. */
struct truth {
    double at[3], e1[3], e2[3], det;
};

static struct truth truth_of(const struct sv_relief_map *map, const struct sv_relief_quads *q, int lane)
{
    struct truth t;
    for (int k = 0; k < 3; k++) {
        double m[4], first = (double)q->t[0][lane];
        for (int c = 0; c < 4; c++)
            m[c] = (double)map->at[k][c];
        t.at[k] = m[0] * q->u[lane] + m[1] * q->v[lane] + m[2] * first + m[3];
        t.e1[k] = m[0] * (double)map->du + m[2] * ((double)q->t[1][lane] - first);
        t.e2[k] = m[1] * (double)map->dv + m[2] * ((double)q->t[2][lane] - first);
    }
    t.det = t.e1[0] * t.e2[1] - t.e1[1] * t.e2[0];
    return t;
}

/* Of each pixel the greatest depth of those that hold its centre; pixels within
 * 1/100 of an edge may be either (SV_WARP_EDGE is 1/1024 of a side, coordinates round at 1e-5), and so may
 * all of a sliver. Depths are sums of a few terms below 1: to 1e-5 on sides that are not slivers. */
static void test_truth(void **state)
{
    (void)state;
    struct sv_rng rng = sv_rng_seeded(51, 0);
    static float depth[WIDTH * HEIGHT];
    long inside = 0, outside = 0;
    for (int round = 0; round < 3000; round++) {
        struct sv_relief_map map = any_map(&rng, depth);
        struct sv_relief_quads quads;
        any_quads(&rng, &quads, true);
        (sv_simd_level() >= SV_SIMD_AVX2 ? sv_relief_cast_avx2 : sv_relief_cast_scalar)(&map, &quads, 1);
        for (int p = 0; p < WIDTH * HEIGHT; p++) {
            double most = 0;
            bool unsure = false;
            for (int lane = 0; lane < 8; lane++) {
                struct truth t = truth_of(&map, &quads, lane);
                double x = p % WIDTH + 0.5 - t.at[0], y = p / WIDTH + 0.5 - t.at[1];
                double s = (x * t.e2[1] - y * t.e2[0]) / t.det, r = (y * t.e1[0] - x * t.e1[1]) / t.det;
                double least = fmin(fmin(s, r), fmin(1 - s, 1 - r));
                bool sliver = fabs(t.det) < 0.05;
                if (least > 0.01 && !sliver)
                    most = fmax(most, t.at[2] + s * t.e1[2] + r * t.e2[2]);
                unsure = unsure || (least > (sliver ? -10 : -0.01) && (least < 0.01 || sliver));
            }
            if (unsure)
                continue;
            if (fabs(most - (double)depth[p]) > 1e-5)
                fail_msg("round %d, pixel %d: %.7g, not %.7g", round, p, (double)depth[p], most);
            inside += most > 0;
            outside += most == 0;
        }
    }
    printf("quadrilaterals: %ld pixels inside, %ld outside\n", inside, outside);
    assert_true(inside > 10000 && outside > 10000);
}

static void test_avx2_is_scalar(void **state)
{
    (void)state;
    if (sv_simd_level() < SV_SIMD_AVX2) {
        printf("skipped: no AVX2 here\n");
        skip();
    }
    static const float ODD[] = {NAN, INFINITY, -INFINITY, 1e-40f, -0.0f, 3e38f, -3e38f, 0};
    struct sv_rng rng = sv_rng_seeded(52, 0);
    static float plain[WIDTH * HEIGHT], wide[WIDTH * HEIGHT];
    long drawn = 0;
    for (int round = 0; round < 4000; round++) {
        size_t count = (size_t)round % (EIGHTS + 1);
        /* Exactly as much as is named, so that a read beyond is seen by the address sanitizer. */
        struct sv_relief_quads *quads = malloc(count * sizeof *quads + 1);
        assert_non_null(quads);
        struct sv_relief_map map = any_map(&rng, plain);
        for (size_t n = 0; n < count; n++) {
            any_quads(&rng, &quads[n], false);
            for (int k = 0; k < 32; k++)
                if (sv_rng_unit(&rng) < 0.02)
                    quads[n].t[k / 8][k % 8] = ODD[sv_rng_next(&rng) >> 61];
        }
        sv_relief_cast_scalar(&map, quads, count);
        map.depth = wide;
        memset(wide, 0, sizeof wide);
        sv_relief_cast_avx2(&map, quads, count);
        assert_memory_equal(plain, wide, sizeof plain);
        for (int p = 0; p < WIDTH * HEIGHT; p++)
            drawn += plain[p] > 0;
        free(quads);
    }
    printf("avx2 is scalar: %ld pixels\n", drawn);
    assert_true(drawn > 10000);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_truth),
        cmocka_unit_test(test_avx2_is_scalar),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
