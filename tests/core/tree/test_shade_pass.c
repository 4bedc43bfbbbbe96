/* test_shade_pass.c - the inner loop of light among trees: the scalar kernel against long double, the AVX2
 * one against its bits, on rows of every length, in memory that ends where the row does. */
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
#include "core/tree/shade_pass.h"

enum { ROUNDS = 4000, COUNT_MAX = 64, WIDTH_MAX = 128 };

struct fixture {
    int left[COUNT_MAX], count, width;
    float part[COUNT_MAX], bare[COUNT_MAX], mixed[WIDTH_MAX + 2];
    uint16_t light[COUNT_MAX];
};

/* Rows as stand.c makes them; coverage up to 1, where next to nothing passes. */
static void make(struct sv_rng *rng, struct fixture *f)
{
    f->count = SV_SHADE_LANES * (int)(sv_rng_next(rng) % (COUNT_MAX / SV_SHADE_LANES + 1));
    f->width = 1 + (int)(sv_rng_next(rng) % WIDTH_MAX);
    for (int u = 0; u < f->width + 2; u++)
        f->mixed[u] = u == 0 || u > f->width || sv_rng_next(rng) % 4 == 0 ? 0 : (float)sv_rng_unit(rng);
    if (sv_rng_next(rng) % 4 == 0)
        f->mixed[1 + f->width / 2] = 1;
    for (int i = 0; i < f->count; i++) {
        f->left[i] = (int)(sv_rng_next(rng) % (uint64_t)(f->width + 1));
        f->part[i] = sv_rng_next(rng) % 4 == 0 ? 0 : (float)sv_rng_unit(rng);
        f->bare[i] = sv_rng_next(rng) % 4 == 0 ? 0 : 0.02f;
        f->light[i] = sv_rng_next(rng) % 8 == 0 ? 0 : (uint16_t)sv_rng_next(rng);
    }
}

/* Runs a kernel on a copy of the light that is exactly as long as the row, so that sanitizers see a step
 * beyond. */
static void run(sv_shade_pass *pass, const struct fixture *f, bool far, uint16_t out[COUNT_MAX],
                struct sv_shade_cell *cell)
{
    size_t bytes = (size_t)f->count * sizeof(uint16_t);
    uint16_t *light = malloc(bytes + 1);
    assert_non_null(light);
    memcpy(light, f->light, bytes);
    const struct sv_shade_row row = {f->left, f->part, f->bare, f->mixed, f->count};
    for (int k = 0; k < SV_SHADE_LANES; k++) { /* what earlier rows have left */
        cell->light[k] = (float)(1000 * k);
        cell->weight[k] = (float)k;
    }
    pass(&row, far, light, cell);
    memcpy(out, light, bytes);
    free(light);
}

/* Six float operations lie between input and light left, each off by 2^-24 of up to 65535: 0.025 of a step;
 * it is rounded to the nearest. What is given back is divided by a half >= 1/64, whose error relative to
 * itself is that of 1 - c, 2^-23 / 2^-12. Sums have up to 8 terms a lane. */
static void scalar_is_what_the_header_says(void **state)
{
    (void)state;
    struct sv_rng rng = sv_rng_seeded(77, 1);
    for (int n = 0; n < ROUNDS; n++) {
        struct fixture f;
        uint16_t got[COUNT_MAX];
        struct sv_shade_cell cell;
        bool far = n & 1;
        long double light[SV_SHADE_LANES], weight[SV_SHADE_LANES];
        make(&rng, &f);
        run(sv_shade_pass_scalar, &f, far, got, &cell);
        for (int k = 0; k < SV_SHADE_LANES; k++) {
            light[k] = 1000 * k;
            weight[k] = k;
        }
        for (int i = 0; i < f.count; i++) {
            long double m0 = (long double)f.mixed[f.left[i]], m1 = (long double)f.mixed[f.left[i] + 1];
            long double own = m0 + (long double)f.part[i] * (m1 - m0);
            long double half = sqrtl(fmaxl(1 - own, 1.0L / 4096)), w = own + (long double)f.bare[i];
            long double left = f.light[i], read = far ? fminl(left / half, 65535) : left;
            light[i % SV_SHADE_LANES] += w * read;
            weight[i % SV_SHADE_LANES] += w;
            assert_true(fabsl((long double)got[i] - left * half) <=
                        0.5L + 0.5L * half * 0x1p-11L * left + 0.03L);
        }
        for (int k = 0; k < SV_SHADE_LANES; k++) {
            assert_true(fabsl((long double)cell.weight[k] - weight[k]) <= 1e-5L);
            assert_true(fabsl((long double)cell.light[k] - light[k]) <=
                        8 * 1.02L * 65535 * (0x1p-11L + 0x1p-20L));
        }
    }
}

static void avx2_gives_the_same_bits(void **state)
{
    (void)state;
    if (sv_simd_level() < SV_SIMD_AVX2) {
        printf("no AVX2 here\n");
        skip();
    }
    struct sv_rng rng = sv_rng_seeded(78, 1);
    for (int n = 0; n < ROUNDS; n++) {
        struct fixture f;
        uint16_t a[COUNT_MAX], b[COUNT_MAX];
        struct sv_shade_cell one, two;
        make(&rng, &f);
        run(sv_shade_pass_scalar, &f, n & 1, a, &one);
        run(sv_shade_pass_avx2, &f, n & 1, b, &two);
        assert_memory_equal(a, b, (size_t)f.count * sizeof *a);
        assert_memory_equal(&one, &two, sizeof one);
    }
    for (int width = 0; width <= WIDTH_MAX; width++) {
        uint8_t *rows = malloc(2 * (size_t)width + 1);
        float *mixed[2] = {malloc((size_t)width * sizeof(float) + 1),
                           malloc((size_t)width * sizeof(float) + 1)};
        assert_true(rows && mixed[0] && mixed[1]);
        for (int u = 0; u < 2 * width; u++)
            rows[u] = (uint8_t)sv_rng_next(&rng);
        float above = (float)sv_rng_unit(&rng) / 255, below = 1.0f / 255 - above;
        sv_shade_mix_scalar(rows, rows + width, above, below, width, mixed[0]);
        sv_shade_mix_avx2(rows, rows + width, above, below, width, mixed[1]);
        for (int u = 0; u < width; u++) {
            double want = rows[u] * (double)above + rows[width + u] * (double)below;
            assert_true(fabs((double)mixed[0][u] - want) <= 0x1p-22);
        }
        assert_memory_equal(mixed[0], mixed[1], (size_t)width * sizeof(float));
        free(rows);
        free(mixed[0]);
        free(mixed[1]);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(scalar_is_what_the_header_says),
                                       cmocka_unit_test(avx2_gives_the_same_bits)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
