/* test_terrain_patch.c - ray against patch, held to every triangle of the field in long double (Moeller and
 * Trumbore 1997). */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <math.h>
#include <cmocka.h>

#include "core/base/rng.h"
#include "core/truth/terrain_patch.h"

typedef long double real;

static bool triangle(const real a[3], const real b[3], const real c[3], const real o[3], const real d[3],
                     real *t)
{
    real e1[3], e2[3], p[3], s[3], q[3];
    for (int k = 0; k < 3; k++) {
        e1[k] = b[k] - a[k];
        e2[k] = c[k] - a[k];
        s[k] = o[k] - a[k];
    }
    p[0] = d[1] * e2[2] - d[2] * e2[1];
    p[1] = d[2] * e2[0] - d[0] * e2[2];
    p[2] = d[0] * e2[1] - d[1] * e2[0];
    real det = e1[0] * p[0] + e1[1] * p[1] + e1[2] * p[2];
    if (fabsl(det) < 1e-18L)
        return false;
    real u = (s[0] * p[0] + s[1] * p[1] + s[2] * p[2]) / det;
    q[0] = s[1] * e1[2] - s[2] * e1[1];
    q[1] = s[2] * e1[0] - s[0] * e1[2];
    q[2] = s[0] * e1[1] - s[1] * e1[0];
    real v = (d[0] * q[0] + d[1] * q[1] + d[2] * q[2]) / det;
    *t = (e2[0] * q[0] + e2[1] * q[1] + e2[2] * q[2]) / det;
    return u >= -1e-12L && v >= -1e-12L && u + v <= 1 + 1e-12L;
}

static real brute(const struct sv_heightfield *f, struct sv_vec3 o, struct sv_vec3 d)
{
    real best = INFINITY, ro[3] = {o.x, o.y, o.z}, rd[3] = {d.x, d.y, d.z};
    for (int j = 0; j + 1 < f->height; j++)
        for (int i = 0; i + 1 < f->width; i++) {
            real corner[4][3];
            for (int k = 0; k < 4; k++) {
                int ci = i + (k & 1), cj = j + (k >> 1);
                corner[k][0] = (real)f->x0 + ci * (real)f->dx;
                corner[k][1] = (real)f->y0 + cj * (real)f->dy;
                corner[k][2] = (real)f->z0 + (real)f->h[cj * f->width + ci];
            }
            static const int even[2][3] = {{0, 1, 3}, {0, 3, 2}}, odd[2][3] = {{0, 1, 2}, {1, 3, 2}};
            for (int k = 0; k < 2; k++) {
                const int *v = (i + j) % 2 == 0 ? even[k] : odd[k];
                real t;
                if (triangle(corner[v[0]], corner[v[1]], corner[v[2]], ro, rd, &t) && t > 0 && t < best)
                    best = t;
            }
        }
    return best;
}

static void test_rays(void **state)
{
    (void)state;
    enum { W = 27, H = 19 };
    static float h[W * H];
    struct sv_rng rng = sv_rng_seeded(5, 1);
    struct sv_heightfield f = {W, H, 400000.25, 4e6 + 0.5, 2, 3, 800, 0, 40, h};
    f.h_min = INFINITY;
    f.h_max = -INFINITY;
    for (int k = 0; k < W * H; k++) {
        h[k] = (float)sv_rng_range(&rng, 0, 12);
        f.h_min = fminf(f.h_min, h[k]);
        f.h_max = fmaxf(f.h_max, h[k]);
    }
    struct sv_vec3 origin = sv_vec3(400025, 4000030, 800);
    struct sv_terrain_patches patches;
    assert_int_equal(sv_terrain_patches_init(&patches, &f, origin, NULL), SV_OK);
    int hits = 0;
    for (int k = 0; k < 20000; k++) {
        struct sv_vec3 o = sv_vec3(sv_rng_range(&rng, 399990, 400070), sv_rng_range(&rng, 3999990, 4000070),
                                   sv_rng_range(&rng, 795, 830));
        struct sv_vec3 d =
            sv_vec3(sv_rng_range(&rng, -1, 1), sv_rng_range(&rng, -1, 1), sv_rng_range(&rng, -1, 0.4));
        if (k % 7 == 0)
            d.x = 0; /* along a row of samples, through vertices and down a plumb line */
        if (k % 11 == 0)
            d.y = 0;
        if (k % 13 == 0)
            o.x = 400000.25 + 2 * (k % 20);
        struct sv_patch_ray ray = {sv_sub(o, origin), d};
        double best = INFINITY;
        for (unsigned p = 0; p < (unsigned)(patches.columns * patches.rows); p++) {
            double t;
            if (sv_terrain_patch_intersect(&patches, p, &ray, 0, best, &t)) {
                assert_true(t < best);
                best = t;
            }
        }
        real truth = brute(&f, o, d);
        hits += isfinite((double)truth);
        /* Double arithmetic on coordinates of 4e6 m: 1e-9 m in place, divided by the angle at which the plane
         * is met. */
        if (isfinite((double)truth) != isfinite(best) ||
            (isfinite(best) && fabs(best - (double)truth) > 1e-6))
            fail_msg("ray %d from (%.9g %.9g %.9g) along (%.17g %.17g %.17g): got %.12g, expected %.12Lg", k,
                     o.x, o.y, o.z, d.x, d.y, d.z, best, truth);
    }
    printf("20000 rays, %d hit\n", hits);
    assert_true(hits > 4000 && hits < 19000);
    sv_terrain_patches_finish(&patches);
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(test_rays)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
