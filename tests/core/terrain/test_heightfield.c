/* test_heightfield.c - height, normal and slope against the triangles themselves, in long double.
 *
 * The reference knows nothing of cells and halves: it walks over every triangle of the grid, built from the
 * header's rule of the alternating diagonal, and takes the barycentric height of one that holds the point. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>
#include <cmocka.h>

#include "core/base/rng.h"
#include "core/terrain/heightfield.h"

typedef long double real;

struct vertex {
    real x, y, z;
};

static struct vertex corner(const struct sv_heightfield *f, int i, int j)
{
    return (struct vertex){(real)f->x0 + i * (real)f->dx, (real)f->y0 + j * (real)f->dy,
                           (real)f->z0 + (real)f->h[j * f->width + i]};
}

/* Barycentric height at (x, y) of a triangle that holds it (with a hair of slack), and its gradient. */
static bool in_triangle(const struct vertex t[3], real x, real y, real *z, real gradient[2])
{
    real d = (t[1].x - t[0].x) * (t[2].y - t[0].y) - (t[2].x - t[0].x) * (t[1].y - t[0].y);
    real b = ((x - t[0].x) * (t[2].y - t[0].y) - (t[2].x - t[0].x) * (y - t[0].y)) / d;
    real c = ((t[1].x - t[0].x) * (y - t[0].y) - (x - t[0].x) * (t[1].y - t[0].y)) / d;
    const real slack = 1e-9L;
    if (b < -slack || c < -slack || b + c > 1 + slack)
        return false;
    *z = t[0].z + b * (t[1].z - t[0].z) + c * (t[2].z - t[0].z);
    gradient[0] = ((t[1].z - t[0].z) * (t[2].y - t[0].y) - (t[2].z - t[0].z) * (t[1].y - t[0].y)) / d;
    gradient[1] = ((t[2].z - t[0].z) * (t[1].x - t[0].x) - (t[1].z - t[0].z) * (t[2].x - t[0].x)) / d;
    return true;
}

static bool reference(const struct sv_heightfield *f, real x, real y, real *z, real gradient[2])
{
    for (int j = 0; j + 1 < f->height; j++)
        for (int i = 0; i + 1 < f->width; i++) {
            struct vertex sw = corner(f, i, j), se = corner(f, i + 1, j), nw = corner(f, i, j + 1),
                          ne = corner(f, i + 1, j + 1);
            bool rising = (i + j) % 2 == 0; /* (i, j) - (i + 1, j + 1) */
            const struct vertex first[3] = {sw, se, rising ? ne : nw};
            const struct vertex second[3] = {rising ? sw : se, ne, nw};
            if (in_triangle(first, x, y, z, gradient) || in_triangle(second, x, y, z, gradient))
                return true;
        }
    return false;
}

static void check_at(const struct sv_heightfield *f, double x, double y)
{
    real expected = 0, gradient[2];
    double z = -1e300, slope = -1;
    struct sv_vec3 n = {0, 0, 0};
    assert_true(reference(f, x, y, &expected, gradient));
    assert_true(sv_heightfield_height(f, x, y, &z));
    /* Rounding of x - x0 is exact to an ulp of x (1e-9 m at 7 digits), times a slope of at most 100 here. */
    if (!(fabsl((real)z - expected) <= 1e-7L))
        fail_msg("(%.17g, %.17g): expected %.12Lg, got %.17g", x, y, expected, z);
    assert_true(sv_heightfield_normal(f, x, y, &n) && sv_heightfield_slope(f, x, y, &slope));
    assert_true(fabs(sv_length(n) - 1) < 1e-14 && n.z > 0);
    assert_true(fabs(cos(slope) - n.z) < 1e-12);
}

/* Where only one triangle holds the point its normal is that triangle's. */
static void check_normal(const struct sv_heightfield *f, double x, double y)
{
    real z, g[2];
    struct sv_vec3 n;
    assert_true(reference(f, x, y, &z, g) && sv_heightfield_normal(f, x, y, &n));
    assert_true(fabs(-n.x / n.z - (double)g[0]) < 1e-6 && fabs(-n.y / n.z - (double)g[1]) < 1e-6);
}

static struct sv_heightfield make(int width, int height, double x0, double y0, double dx, double dy,
                                  uint64_t seed)
{
    struct sv_rng rng = sv_rng_seeded(seed, 1);
    float *h = malloc((size_t)(width * height) * sizeof *h);
    for (int k = 0; k < width * height; k++)
        h[k] = (float)sv_rng_range(&rng, 0, 20);
    return (struct sv_heightfield){width, height, x0, y0, dx, dy, 400, 0, 20, h};
}

static const struct {
    int width, height;
    double x0, y0, dx, dy;
} FIELDS[] = {{2, 2, 0, 0, 1, 1},
              {3, 2, -7, 3, 0.5, 2},
              {9, 7, 500120.25, 5200340.5, 10, 12.5},
              {5, 8, 3e6, 7e6, 89.994, 0.25}};
enum { FIELD_COUNT = sizeof FIELDS / sizeof FIELDS[0] };

static struct sv_heightfield field(int k)
{
    return make(FIELDS[k].width, FIELDS[k].height, FIELDS[k].x0, FIELDS[k].y0, FIELDS[k].dx, FIELDS[k].dy,
                (uint64_t)k);
}

static void test_random(void **state)
{
    (void)state;
    for (int k = 0; k < FIELD_COUNT; k++) {
        struct sv_heightfield f = field(k);
        struct sv_rng rng = sv_rng_seeded(5, (uint64_t)k);
        for (int n = 0; n < 3000; n++) {
            double x = sv_rng_range(&rng, f.x0, sv_heightfield_x1(&f)),
                   y = sv_rng_range(&rng, f.y0, sv_heightfield_y1(&f));
            check_at(&f, x, y);
            check_normal(&f, x, y);
        }
        free((void *)f.h);
    }
}

/* Samples, edges of cells, diagonals of both kinds, the rim and its corners. */
static void test_edges(void **state)
{
    (void)state;
    for (int k = 0; k < FIELD_COUNT; k++) {
        struct sv_heightfield f = field(k);
        for (int j = 0; j < f.height; j++)
            for (int i = 0; i < f.width; i++) {
                double z, x = i + 1 < f.width ? f.x0 + i * f.dx : sv_heightfield_x1(&f);
                double y = j + 1 < f.height ? f.y0 + j * f.dy : sv_heightfield_y1(&f);
                assert_true(sv_heightfield_height(&f, x, y, &z));
                assert_true(fabs(z - (f.z0 + (double)f.h[j * f.width + i])) < 1e-7);
                for (int n = 1; n < 8 && i + 1 < f.width && j + 1 < f.height; n++) {
                    check_at(&f, x + n * f.dx / 8, y);
                    check_at(&f, x, y + n * f.dy / 8);
                    check_at(&f, x + n * f.dx / 8, y + n * f.dy / 8);
                    check_at(&f, x + n * f.dx / 8, y + f.dy - n * f.dy / 8);
                }
            }
        free((void *)f.h);
    }
}

static void test_outside(void **state)
{
    (void)state;
    struct sv_heightfield f = field(2);
    double x0 = f.x0, y0 = f.y0, x1 = sv_heightfield_x1(&f), y1 = sv_heightfield_y1(&f);
    const double xm = 0.5 * (x0 + x1), ym = 0.5 * (y0 + y1);
    const double bad[][2] = {{nextafter(x0, -INFINITY), ym},
                             {nextafter(x1, INFINITY), ym},
                             {xm, nextafter(y0, -INFINITY)},
                             {xm, nextafter(y1, INFINITY)},
                             {NAN, ym},
                             {xm, NAN},
                             {NAN, NAN},
                             {INFINITY, ym},
                             {xm, -INFINITY},
                             {1e300, 1e300},
                             {-1e300, ym},
                             {0, 0}};
    for (size_t k = 0; k < sizeof bad / sizeof bad[0]; k++) {
        double z = 7, slope = 8;
        struct sv_vec3 n = {1, 2, 3};
        assert_false(sv_heightfield_height(&f, bad[k][0], bad[k][1], &z));
        assert_false(sv_heightfield_slope(&f, bad[k][0], bad[k][1], &slope));
        assert_false(sv_heightfield_normal(&f, bad[k][0], bad[k][1], &n));
        assert_true(z == 7 && slope == 8 && n.x == 1 && n.y == 2 && n.z == 3);
    }
    const double rim[][2] = {{x0, y0}, {x1, y0}, {x0, y1}, {x1, y1}, {x1, ym}, {xm, y1}};
    for (size_t k = 0; k < sizeof rim / sizeof rim[0]; k++) {
        double z;
        assert_true(sv_heightfield_height(&f, rim[k][0], rim[k][1], &z));
    }
    free((void *)f.h);
}

/* The two diagonals bend the surface differently: a lone peak shows which is which. */
static void test_diagonal_named(void **state)
{
    (void)state;
    float h[9] = {0, 0, 0, 0, 0, 0, 0, 0, 0};
    struct sv_heightfield f = {3, 3, 0, 0, 1, 1, 0, 0, 1, h};
    double z;
    h[0] = h[4] = 1; /* (0,0) and (1,1): the crest of cell (0,0) runs between them */
    assert_true(sv_heightfield_height(&f, 0.5, 0.5, &z) && z == 1);
    h[0] = h[4] = 0;
    h[1] = h[5] = 1; /* (1,0) and (2,1) in cell (1,0), i + j odd: no crest between these two */
    assert_true(sv_heightfield_height(&f, 1.5, 0.5, &z) && z == 0);
    h[1] = h[5] = 0;
    h[2] = h[4] = 1; /* (2,0) and (1,1): its crest */
    assert_true(sv_heightfield_height(&f, 1.5, 0.5, &z) && z == 1);
}

static void test_slope_of_planes(void **state)
{
    (void)state;
    float h[16];
    struct sv_heightfield f = {4, 4, 0, 0, 2, 3, 0, 0, 1, h};
    for (int deg = 0; deg < 90; deg += 5) {
        double rise = tan(sv_radians(deg));
        for (int k = 0; k < 16; k++)
            h[k] = (float)(rise * (0.6 * 2 * (k % 4) + 0.8 * 3 * (k / 4)));
        double slope;
        assert_true(sv_heightfield_slope(&f, 3.1, 4.7, &slope));
        assert_true(fabs(sv_degrees(slope) - deg) < 1e-3); /* heights are floats */
        struct sv_vec3 n = sv_heightfield_sample_normal(&f, 1, 2), m;
        assert_true(sv_heightfield_normal(&f, 3.1, 4.7, &m) && sv_length(sv_sub(n, m)) < 1e-4);
        for (int k = -9; k < 12; k++) /* any index is legal, and on a plane all agree */
            assert_true(sv_length(sv_sub(sv_heightfield_sample_normal(&f, k, -k), m)) < 1e-4);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(test_random), cmocka_unit_test(test_edges),
                                       cmocka_unit_test(test_outside), cmocka_unit_test(test_diagonal_named),
                                       cmocka_unit_test(test_slope_of_planes)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
