/* test_row_front.c - the row front's own promises: every SIMD level gives the same bits, nothing is read or
 * written outside, holes, borders, tiles, closed forms, extreme numbers. (Shares that differ from a ray march
 * over fifty lights: test_self_shadow.c.) */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/mman.h>
#include <unistd.h>

#include <cmocka.h>

#include "core/base/rng.h"
#include "core/relief/row_front.h"
#include "shadow_fields.h"

/* n floats that end (or begin) at a page that must not be touched. */
struct guarded {
    char *map;
    size_t bytes;
    float *at;
};

static struct guarded guard(size_t n, bool at_end)
{
    size_t page = (size_t)sysconf(_SC_PAGESIZE), need = n * sizeof(float),
           body = (need + page - 1) / page * page;
    struct guarded g = {.bytes = body + 2 * page};
    g.map = mmap(NULL, g.bytes, PROT_READ | PROT_WRITE, MAP_PRIVATE | MAP_ANONYMOUS, -1, 0);
    assert_ptr_not_equal(g.map, MAP_FAILED);
    assert_int_equal(mprotect(g.map, page, PROT_NONE), 0);
    assert_int_equal(mprotect(g.map + page + body, page, PROT_NONE), 0);
    g.at = (float *)(void *)(g.map + page + (at_end ? body - need : 0));
    return g;
}

static struct sv_vec3 some_light(struct sv_rng *rng, int k)
{
    double a = k % 4 == 0 ? k * SV_PI / 4 : sv_rng_range(rng, 0, 2 * SV_PI),
           e = sv_rng_range(rng, 0, SV_PI / 2);
    return sv_normalize(sv_vec3(cos(a) * cos(e), sin(a) * cos(e), -sin(e)));
}

static float odd_height(struct sv_rng *rng)
{
    static const float odd[] = {NAN, INFINITY, -INFINITY, 1e9f, -1e9f, 1e-40f, -0.0f, 999999, -999999, 3e38f};
    uint64_t pick = sv_rng_next(rng) % 40;
    return pick < 10 ? odd[pick] : (float)sv_rng_range(rng, -3, 9);
}

static void levels_agree_inside_guard_pages(void **state)
{
    (void)state;
    static const int sides[] = {1, 2, 3, 7, 8, 9, 15, 16, 17, 31, 33, 63, 64, 65, 130};
    struct sv_rng rng = sv_rng_seeded(5, 7);
    int runs = 0;
    for (int a = 0; a < 15; a++)
        for (int b = 0; b < 15; b++)
            for (int k = 0; k < 6; k++, runs++) {
                int w = sides[a], h = sides[b];
                size_t n = (size_t)w * (size_t)h;
                struct guarded height = guard(n, k & 1), initial = guard(n, k & 1), p[2], in[2], lit[2];
                for (size_t t = 0; t < n; t++) {
                    height.at[t] = k < 2 ? (float)sv_rng_range(&rng, 0, 9) : odd_height(&rng);
                    initial.at[t] = sv_rng_next(&rng) % 8 ? SV_ROW_FRONT_NONE : odd_height(&rng);
                }
                struct sv_row_front f = {
                    w, h, 1.5, 1, some_light(&rng, k), height.at, k % 3 ? initial.at : NULL, 0.01f};
                for (int level = 0; level < 2; level++) {
                    p[level] = guard(n, k & 1);
                    in[level] = guard(n, k & 1);
                    lit[level] = guard((n + 3) / 4, k & 1);
                    assert_int_equal(sv_row_front_at(level ? sv_simd_level() : SV_SIMD_SCALAR, &f,
                                                     p[level].at, in[level].at, (uint8_t *)lit[level].at,
                                                     NULL),
                                     SV_OK);
                }
                assert_memory_equal(p[0].at, p[1].at, n * sizeof(float));
                assert_memory_equal(in[0].at, in[1].at, n * sizeof(float));
                assert_memory_equal(lit[0].at, lit[1].at, n);
                struct guarded all[] = {height, initial, p[0], p[1], in[0], in[1], lit[0], lit[1]};
                for (int g = 0; g < 8; g++)
                    munmap(all[g].map, all[g].bytes);
            }
    printf("%d fields of 1 x 1 to 130 x 130: scalar and level %d give the same bits\n", runs,
           (int)sv_simd_level());
}

/* P, in and lit hold together as the header says, and stay finite. */
static void check_promises(const struct sv_row_front *f, const float *p, const float *in, const uint8_t *lit)
{
    for (int t = 0; t < f->width * f->height; t++) {
        bool real = fabsf(f->height_m[t]) < 1e6f;
        assert_true(isfinite(p[t]) && isfinite(in[t]) && fabsf(p[t]) <= 1e6f && fabsf(in[t]) <= 1e6f);
        assert_true(p[t] == fmaxf(real ? f->height_m[t] : SV_ROW_FRONT_NONE, in[t]));
        assert_int_equal(lit[t], real && (f->travel.z > 0 || f->height_m[t] < in[t] - f->bias_m) ? 0 : 255);
        assert_true(!f->initial || !(f->initial[t] <= 1e6f) || in[t] >= f->initial[t]);
    }
}

static void extremes_are_answered(void **state)
{
    (void)state;
    struct sv_rng rng = sv_rng_seeded(8, 3);
    float height[144], initial[144], p[144], in[144];
    uint8_t lit[144];
    int done = 0;
    for (int k = 0; k < 200000; k++) {
        int w = 1 + (int)(sv_rng_next(&rng) % 12), h = 1 + (int)(sv_rng_next(&rng) % 12);
        for (int t = 0; t < w * h; t++) {
            height[t] = odd_height(&rng);
            initial[t] = odd_height(&rng);
        }
        struct sv_vec3 l = some_light(&rng, k);
        if (k % 5 == 0)
            l = sv_vec3(0, 0, -1);
        if (k % 7 == 0)
            l = sv_normalize(sv_vec3(sv_rng_range(&rng, -1, 1) * 1e-300, 1e-12, -1));
        if (k % 11 == 0)
            l.z = k & 1 ? 0 : -l.z;
        l = sv_normalize(l);
        if (sv_length(l) < 0.5)
            l = sv_vec3(1, 0, 0);
        struct sv_row_front f = {w,
                                 h,
                                 pow(10, sv_rng_range(&rng, -9, 9)),
                                 pow(10, sv_rng_range(&rng, -9, 9)),
                                 l,
                                 height,
                                 k & 2 ? initial : NULL,
                                 k & 4 ? 0 : (float)sv_rng_range(&rng, 0, 1e6)};
        assert_int_equal(sv_row_front(&f, p, in, lit, NULL), SV_OK);
        check_promises(&f, p, in, lit);
        done++;
    }
    printf("%d random extreme fields: finite, and P = max(h, in), dark iff h < in - bias\n", done);
}

/* A wall across the field: P behind it falls by tan(theta) a metre, however far, and however slanting the
 * light. */
static void walls_throw_exact_shadows(void **state)
{
    (void)state;
    enum { W = 900, H = 300 };
    static float h[W * H], p[W * H];
    double worst = 0;
    for (int k = 0; k < 7; k++) {
        double m = -0.9 + 0.3 * k, e = sv_radians(2);
        struct sv_vec3 l = sv_normalize(sv_vec3(m, 1, 0));
        l = sv_vec3(l.x * cos(e), l.y * cos(e), -sin(e));
        memset(h, 0, sizeof h);
        for (int i = 0; i < W; i++)
            h[5 * W + i] = 20;
        struct sv_row_front f = {W, H, 1, 1, l, h, NULL, 0};
        assert_int_equal(sv_row_front(&f, p, NULL, NULL, NULL), SV_OK);
        for (int j = 6; j < H; j++) {
            double expect = fmax(0, 20 - (j - 5) * tan(e) * sqrt(1 + m * m));
            worst = fmax(worst, fabs((double)p[j * W + W / 2] - expect));
        }
    }
    printf("P behind a wall after 294 rows: off by at most %.6f m\n", worst);
    /* float P of 20 m: half an ulp (1e-6) a rounding, two a rebase of 32 rows, and the lift's own */
    assert_true(worst < 2e-4);
}

/* A thin mast keeps its whole height in its shadow: carried on the sheared grid it does not fade with
 * distance. */
static void thin_things_keep_their_height(void **state)
{
    (void)state;
    enum { W = 300, H = 220 };
    static float h[W * H], p[W * H];
    double m = 0.37, e = sv_radians(3);
    struct sv_vec3 l = sv_normalize(sv_vec3(m, 1, 0));
    l = sv_vec3(l.x * cos(e), l.y * cos(e), -sin(e));
    memset(h, 0, sizeof h);
    for (int i = 49; i <= 51; i++)
        h[2 * W + i] = 40;
    struct sv_row_front f = {W, H, 1, 1, l, h, NULL, 0};
    assert_int_equal(sv_row_front(&f, p, NULL, NULL, NULL), SV_OK);
    double low = 1;
    for (int j = 3; j < H; j++) {
        float top = 0;
        for (int i = 0; i < W; i++)
            top = fmaxf(top, p[j * W + i]);
        low = fmin(low, (double)top / (40 - (j - 2) * tan(e) * sqrt(1 + m * m)));
    }
    printf("a mast of 3 samples keeps at least %.4f of its height over 217 rows\n", low);
    assert_true(low > 0.99);
}

/* Two tiles, the second given the first one's P as it arrives, are one field. Light along an axis: to the bit
 * but for rounding. */
static void tiles_hand_over(void **state)
{
    (void)state;
    enum { N = 96 };
    struct shadow_field whole = shadow_fields[5];
    whole.width = N;
    whole.height = 2 * N;
    float *h = shadow_field_heights(&whole);
    static float p[2 * N * N], q[N * N], initial[N * N];
    double e = sv_radians(6);
    struct sv_row_front f = {N, 2 * N, 1, 1, sv_vec3(0, cos(e), -sin(e)), h, NULL, 0};
    assert_int_equal(sv_row_front(&f, p, NULL, NULL, NULL), SV_OK);
    for (int t = 0; t < N * N; t++)
        initial[t] = t < N ? p[(N - 1) * N + t] - (float)tan(e) : SV_ROW_FRONT_NONE;
    f.height = N;
    f.height_m = h + N * N;
    f.initial = initial;
    assert_int_equal(sv_row_front(&f, q, NULL, NULL, NULL), SV_OK);
    double worst = 0;
    for (int t = 0; t < N * N; t++)
        worst = fmax(worst, fabs((double)(q[t] - p[N * N + t])));
    printf("two tiles against one field: P differs by at most %.2g m\n", worst);
    assert_true(worst < 1e-4);
    free(h);
}

/* Turning the field by quarters and mirroring it turns the shadow along. */
static void all_quarters_are_alike(void **state)
{
    (void)state;
    enum { N = 70 };
    struct sv_rng rng = sv_rng_seeded(4, 4);
    static float h[N * N], g[N * N], p[N * N], q[N * N];
    for (int t = 0; t < N * N; t++)
        h[t] = (float)sv_rng_range(&rng, 0, 4);
    for (int k = 0; k < 40; k++) {
        struct sv_vec3 l = some_light(&rng, 1 + 4 * k % 37 + (k % 3)), turned = sv_vec3(-l.y, l.x, l.z);
        for (int j = 0; j < N; j++)
            for (int i = 0; i < N; i++)
                g[i * N + (N - 1 - j)] = h[j * N + i]; /* (x, y) -> (-y, x) */
        struct sv_row_front f = {N, N, 2, 2, l, h, NULL, 0}, t = {N, N, 2, 2, turned, g, NULL, 0};
        assert_int_equal(sv_row_front(&f, p, NULL, NULL, NULL), SV_OK);
        assert_int_equal(sv_row_front(&t, q, NULL, NULL, NULL), SV_OK);
        for (int j = 0; j < N; j++)
            for (int i = 0; i < N; i++)
                assert_true(fabsf(p[j * N + i] - q[i * N + (N - 1 - j)]) < 1e-4f);
    }
}

static void holes_cast_nothing_and_are_lit(void **state)
{
    (void)state;
    struct shadow_field f = shadow_fields[5];
    f.width = f.height = 96;
    float *h = shadow_field_heights(&f);
    size_t n = 96 * 96;
    uint8_t *truth = malloc(n), *lit = malloc(n);
    for (int j = 0; j < 96; j++)
        for (int i = 0; i < 96; i++)
            if (hypot(i - 40, j - 55) < 14 || (i > 70 && j < 20))
                h[j * 96 + i] = NAN;
    double worst = 0, mean = 0;
    for (int k = 0; k < SHADOW_LIGHTS; k++) {
        struct sv_row_front r = {96, 96, 1, 1, shadow_light(k), h, NULL, 0.05f};
        assert_int_equal(sv_row_front(&r, NULL, NULL, lit, NULL), SV_OK);
        shadow_truth(&f, h, shadow_light(k), 0.05, truth);
        size_t differ = 0;
        for (size_t t = 0; t < n; t++) {
            differ += lit[t] != truth[t];
            assert_true(!isnan(h[t]) || lit[t] == 255);
        }
        worst = fmax(worst, 100.0 * (double)differ / (double)n);
        mean += 100.0 * (double)differ / (double)n / SHADOW_LIGHTS;
    }
    printf("a field with holes: worst %.2f %%, mean %.2f %% of samples differ from the march\n", worst, mean);
    assert_true(worst <= 2.0);
    free(h);
    free(truth);
    free(lit);
}

static void singular_lights_and_wrong_arguments(void **state)
{
    (void)state;
    float h[6] = {1, NAN, 3, -2, 5e6f, 0}, p[6], in[6], initial[6] = {9, 9, NAN, -1e6f, 1e7f, -5};
    uint8_t lit[6];
    struct sv_row_front f = {3, 2, 1, 1, {0, 0, -1}, h, NULL, 0};
    assert_int_equal(sv_row_front(&f, p, in, lit, NULL), SV_OK);
    for (int t = 0; t < 6; t++)
        assert_true(lit[t] == 255 && in[t] == SV_ROW_FRONT_NONE);
    assert_true(p[0] == 1 && p[1] == SV_ROW_FRONT_NONE && p[4] == SV_ROW_FRONT_NONE);
    f.initial = initial;
    assert_int_equal(sv_row_front(&f, p, in, lit, NULL), SV_OK);
    static const uint8_t masked[6] = {0, 255, 255, 255, 255, 255};
    assert_memory_equal(lit, masked, 6);
    assert_true(p[4] == 1e6f && in[5] == -5);
    f.travel = sv_normalize(sv_vec3(1, 1, 0.1));
    assert_int_equal(sv_row_front(&f, p, in, lit, NULL), SV_OK);
    static const uint8_t below[6] = {0, 255, 0, 0, 255, 0};
    assert_memory_equal(lit, below, 6);
    assert_true(p[0] == 1e6f && in[3] == 1e6f);
    struct sv_error e;
    f.width = 0;
    assert_int_equal(sv_row_front(&f, p, in, lit, &e), SV_EINVAL);
    f.width = 3;
    f.dy = 0;
    assert_int_equal(sv_row_front(&f, p, in, lit, &e), SV_EINVAL);
    assert_string_equal(e.field, "dx");
    f.dy = 1;
    f.travel = sv_vec3(NAN, 0, 0);
    assert_int_equal(sv_row_front(&f, p, in, lit, &e), SV_EINVAL);
    assert_string_equal(e.field, "travel");
    f.travel = sv_vec3(0, 0, -1);
    f.bias_m = NAN;
    assert_int_equal(sv_row_front(&f, p, in, lit, &e), SV_EINVAL);
    assert_string_equal(e.field, "bias_m");
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(levels_agree_inside_guard_pages),
        cmocka_unit_test(extremes_are_answered),
        cmocka_unit_test(walls_throw_exact_shadows),
        cmocka_unit_test(thin_things_keep_their_height),
        cmocka_unit_test(tiles_hand_over),
        cmocka_unit_test(all_quarters_are_alike),
        cmocka_unit_test(holes_cast_nothing_and_are_lit),
        cmocka_unit_test(singular_lights_and_wrong_arguments),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
