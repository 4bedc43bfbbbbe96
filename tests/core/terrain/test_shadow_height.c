/* test_shadow_height.c - the terrain's shadow against marching along the sun's ray on the height field, at
 * UTM coordinates with dx != dy; the penumbra against its closed form; fields that are averaged down. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <cmocka.h>

#include "core/base/frames.h"
#include "core/terrain/shadow_height.h"

enum { WIDTH = 257, HEIGHT = 193 };

static struct sv_heightfield make_field(int width, int height, double dx, double dy,
                                        float (*shape)(double x, double y))
{
    struct sv_heightfield f = {.width = width,
                               .height = height,
                               .x0 = 497512.25,
                               .y0 = 5203410.5,
                               .dx = dx,
                               .dy = dy,
                               .z0 = 812.5,
                               .h_min = INFINITY,
                               .h_max = -INFINITY};
    float *h = malloc((size_t)width * (size_t)height * sizeof *h);
    assert_non_null(h);
    for (int j = 0; j < height; j++)
        for (int i = 0; i < width; i++) {
            float v = shape(i * dx, j * dy);
            h[(size_t)j * (size_t)width + (size_t)i] = v;
            f.h_min = fminf(f.h_min, v);
            f.h_max = fmaxf(f.h_max, v);
        }
    f.h = h;
    return f;
}

static float hills(double x, double y)
{
    return (float)(30 * sin(x / 61) * cos(y / 83) + 14 * sin(x / 23 + y / 31) + 5 * cos(y / 17 - x / 40));
}
static float flat(double x, double y)
{
    (void)x;
    (void)y;
    return 3;
}
/* A wall of 40 m that runs north, its crest at x = 120. */
static float wall(double x, double y)
{
    (void)y;
    return (float)fmax(0, 40 - fabs(x - 120) * 8);
}

static double surface(const struct sv_heightfield *f, double gi, double gj)
{
    int i = gi < f->width - 1 ? (int)gi : f->width - 2, j = gj < f->height - 1 ? (int)gj : f->height - 2;
    double u = gi - i, v = gj - j;
    const float *p = f->h + (size_t)j * (size_t)f->width + (size_t)i;
    return ((double)p[0] * (1 - u) + (double)p[1] * u) * (1 - v) +
           ((double)p[f->width] * (1 - u) + (double)p[f->width + 1] * u) * v;
}

/* Height by which the ground rises above the ray from a sample to the sun, at worst; the first cell, where
 * the ray starts on the surface, does not count. */
static double worst(const struct sv_heightfield *f, int i, int j, struct sv_vec3 to_sun)
{
    double level = hypot(to_sun.x, to_sun.y), found = -INFINITY, h = (double)f->h[j * f->width + i];
    double cell = fmin(f->dx, f->dy);
    for (double d = cell; d < 4000; d += 0.1 * cell) {
        double gi = i + d * to_sun.x / level / f->dx, gj = j + d * to_sun.y / level / f->dy;
        double ray = h + d * to_sun.z / level;
        if (!(gi >= 0 && gj >= 0 && gi <= f->width - 1 && gj <= f->height - 1) || ray > (double)f->h_max)
            break;
        found = fmax(found, surface(f, gi, gj) - ray);
    }
    return found;
}

static void against_marching(void **state)
{
    (void)state;
    struct sv_heightfield f = make_field(WIDTH, HEIGHT, 3, 5, hills);
    struct sv_shadow_height map = {0};
    struct sv_error error = {0};
    long samples = 0, wrong = 0, dark = 0;
    for (int k = 0; k < 16; k++) {
        double azimuth = sv_radians(k * 22.5), elevation = sv_radians(4 + 3.3 * k);
        assert_int_equal(sv_shadow_height_make(&map, &f, sv_direction(azimuth, elevation), &error), SV_OK);
        struct sv_vec3 high = sv_direction(azimuth, elevation + sv_radians(0.265)),
                       low = sv_direction(azimuth, elevation - sv_radians(0.265));
        long here = 0, count = 0;
        for (int j = 1; j < HEIGHT - 1; j += 2)
            for (int i = 1; i < WIDTH - 1; i += 2) {
                size_t at = (size_t)j * WIDTH + (size_t)i;
                assert_true(isfinite(map.full[at]) && map.full[at] <= map.none[at] + 1e-3f);
                bool none = worst(&f, i, j, high) > 0, full = worst(&f, i, j, low) <= 0;
                here += none != (map.none[at] <= 0);
                here += full != (map.full[at] >= 0);
                dark += none;
                count += 2;
            }
        printf("sun %5.1f / %4.1f: %.2f %% of %ld decisions differ\n", k * 22.5, 4 + 3.3 * k,
               100.0 * (double)here / (double)count, count);
        wrong += here;
        samples += count;
    }
    printf("all: %.2f %% of %ld differ, %.1f %% of samples dark\n", 100.0 * (double)wrong / (double)samples,
           samples, 200.0 * (double)dark / (double)samples);
    assert_true(dark * 20 > samples); /* there is something to be wrong about */
    assert_true(wrong * 50 <= samples);
    sv_shadow_height_finish(&map);
    free((void *)(uintptr_t)f.h);
}

/* Behind a wall the two limbs' heights part by D (tan(e + r) - tan(e - r)), D the distance to the crest. */
static void penumbra(void **state)
{
    (void)state;
    struct sv_heightfield f = make_field(401, 9, 1, 2, wall);
    struct sv_shadow_height map = {0};
    struct sv_error error = {0};
    double e = sv_radians(12), r = sv_radians(0.265);
    assert_int_equal(sv_shadow_height_make(&map, &f, sv_direction(sv_radians(270), e), &error), SV_OK);
    for (int i = 140; i < 400; i += 20) {
        double d = i - 120, want = d * (tan(e + r) - tan(e - r));
        size_t at = (size_t)4 * 401 + (size_t)i;
        double got = (double)map.none[at] - (double)map.full[at];
        /* ground is 0 there: full = -(40 - d tan(e - r)) */
        double edge = d * tan(e - r) - 40;
        if (edge < d * tan(e)) /* beyond, the ground just before comes in instead of the wall */
            assert_true(fabs(got - want) <= 0.02 * want + 1e-3 || (double)map.none[at] > 0);
        if (edge < 0)
            assert_true(fabs((double)map.full[at] - edge) <= 0.02);
    }
    double x = f.x0 + 150, y = f.y0 + 8;
    printf("30 m behind a wall of 40 m, sun at 12: shadow up to %.3f m, expected %.3f\n",
           sv_shadow_height_at(&map, x, y) - f.z0, 40 - 30 * tan(e));
    assert_true(fabs(sv_shadow_height_at(&map, x, y) - (f.z0 + 40 - 30 * tan(e))) < 0.02);
    assert_true(sv_shadow_height_at(&map, f.x0 + 350, y) == -INFINITY); /* 230 m behind: 48.9 m of drop */
    assert_true(sv_shadow_height_at(&map, f.x0 - 1, y) == -INFINITY);
    assert_true(sv_shadow_height_at(&map, NAN, y) == -INFINITY);
    sv_shadow_height_finish(&map);
    free((void *)(uintptr_t)f.h);
}

static void flat_is_lit(void **state)
{
    (void)state;
    struct sv_heightfield f = make_field(64, 48, 30, 30, flat);
    struct sv_shadow_height map = {0};
    struct sv_error error = {0};
    static const double elevations[] = {0.01, 0.3, 1, 5, 45, 89.9, 90};
    for (size_t k = 0; k < sizeof elevations / sizeof elevations[0]; k++) {
        struct sv_vec3 s = sv_direction(1.1, sv_radians(elevations[k]));
        assert_int_equal(sv_shadow_height_make(&map, &f, s, &error), SV_OK);
        float soft = (float)sv_shadow_height_soft_m(&map, 1);
        for (int n = 0; n < 64 * 48; n++) {
            if (!(map.full[n] >= 0) ||
                (elevations[k] > 0.5 && sv_shadow_height_share(map.full[n], map.none[n], soft) != 1))
                fail_msg("sun at %g, sample %d: full %g, none %g, soft %g", elevations[k], n,
                         (double)map.full[n], (double)map.none[n], (double)soft);
        }
    }
    static const struct sv_vec3 bad[] = {{0, 0, -1}, {1, 0, 0}, {0, 0, 2}, {NAN, 0, 1}};
    for (size_t k = 0; k < sizeof bad / sizeof bad[0]; k++)
        assert_int_equal(sv_shadow_height_make(&map, &f, bad[k], &error), SV_EINVAL);
    sv_shadow_height_finish(&map);
    free((void *)(uintptr_t)f.h);
}

/* 2300 samples: averaged by 2; the wall's shadow is as long as before, to a sample. */
static void averaged(void **state)
{
    (void)state;
    struct sv_heightfield f = make_field(2300, 12, 1, 1, wall);
    struct sv_shadow_height map = {0};
    struct sv_error error = {0};
    double e = sv_radians(20);
    assert_int_equal(sv_shadow_height_make(&map, &f, sv_direction(sv_radians(270), e), &error), SV_OK);
    assert_true(map.width == 1150 && map.height == 6 && map.dx == 2 && map.x0 == f.x0 + 0.5);
    double end = 120;
    while (isfinite(sv_shadow_height_at(&map, f.x0 + end + 5, f.y0 + 6)))
        end += 0.25;
    double want = 120 + 40 / tan(e), low = 120 + 34 / tan(e); /* averages lower the crest by at most 6 m */
    printf("averaged: shadow ends at %.2f m, expected %.2f .. %.2f\n", end + 5, low, want);
    assert_true(end + 5 >= low - 2 && end + 5 <= want + 2);
    sv_shadow_height_finish(&map);
    free((void *)(uintptr_t)f.h);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(against_marching),
        cmocka_unit_test(penumbra),
        cmocka_unit_test(flat_is_lit),
        cmocka_unit_test(averaged),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
