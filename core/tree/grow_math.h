/* grow_math.h - the few transcendental functions that growing needs, from IEEE +, -, *, / and sqrt alone.
 *
 * libm's sin, pow and the like may differ in their last bits from one C library to the next; one bit is
 * enough for space colonisation to take another branch. These give the same bits wherever double is IEEE 754
 * and nothing is contracted
 * (-ffp-contract=off; sqrt, floor, frexp and ldexp are exact by definition), so a tree is the same tree on
 * every machine. Errors: sine and cosine 1e-13, power 1e-12 relative, for |x| < 1e6: far below a float's
 * step. */
#ifndef SV_TREE_GROW_MATH_H
#define SV_TREE_GROW_MATH_H

#include <math.h>

#include "core/base/rng.h"
#include "core/base/vec.h"

/* sin and cos of x, |x| < 1e6: Cody and Waite reduction to [-pi/4, pi/4], then the Taylor series. */
static inline void sv_grow_sincos(double x, double *s, double *c)
{
    double k = floor(x * (2 / SV_PI) + 0.5);
    double r = (x - k * 1.57079632673412561417) - k * 6.07710050650619224932e-11;
    double q = r * r;
    double sine =
        r * (1 + q * (-1 / 6.0 +
                      q * (1 / 120.0 + q * (-1 / 5040.0 +
                                            q * (1 / 362880.0 - q * (1 / 39916800.0 - q / 6227020800.0))))));
    double cosine =
        1 +
        q * (-1 / 2.0 +
             q * (1 / 24.0 +
                  q * (-1 / 720.0 +
                       q * (1 / 40320.0 - q * (1 / 3628800.0 - q * (1 / 479001600.0 - q / 87178291200.0))))));
    int quadrant = (int)(k - 4 * floor(k / 4));
    double swap_s = quadrant & 1 ? cosine : sine, swap_c = quadrant & 1 ? sine : cosine;
    *s = quadrant & 2 ? -swap_s : swap_s;
    *c = quadrant == 1 || quadrant == 2 ? -swap_c : swap_c;
}
static inline double sv_grow_sin(double x)
{
    double s, c;
    sv_grow_sincos(x, &s, &c);
    return s;
}
static inline double sv_grow_cos(double x)
{
    double s, c;
    sv_grow_sincos(x, &s, &c);
    return c;
}

/* x^y for 0 < x < 1e300 and |y log2 x| < 1000; 0 for x <= 0. */
static inline double sv_grow_pow(double x, double y)
{
    if (!(x > 0))
        return 0;
    int e;
    double m = frexp(x, &e);
    if (m < 0.70710678118654752)
        m *= 2, e--;
    double s = (m - 1) / (m + 1), q = s * s, series = 0;
    for (int k = 21; k >= 1; k -= 2)
        series = 1.0 / k + q * series;
    double l = y * (e + s * series * 2.88539008177792681472); /* 2 / ln 2 */
    double whole = floor(l + 0.5), f = (l - whole) * 0.69314718055994530942, power = 1;
    for (int k = 14; k >= 1; k--)
        power = 1 + power * f / k;
    return ldexp(power, (int)whole);
}

/* A unit vector at right angles to the unit vector d. */
static inline struct sv_vec3 sv_grow_side(struct sv_vec3 d)
{
    struct sv_vec3 a = fabs(d.z) < 0.9 ? sv_vec3(0, 0, 1) : sv_vec3(1, 0, 0);
    return sv_normalize(sv_cross(a, d));
}

/* v turned about the unit axis by angle_rad (Rodrigues). */
static inline struct sv_vec3 sv_grow_turn(struct sv_vec3 v, struct sv_vec3 axis, double angle_rad)
{
    double s, c;
    sv_grow_sincos(angle_rad, &s, &c);
    struct sv_vec3 r = sv_scale(v, c);
    r = sv_madd(r, sv_cross(axis, v), s);
    return sv_madd(r, axis, sv_dot(axis, v) * (1 - c));
}

/* A vector inside the unit ball's bounding cube, made a unit vector: random enough for jitter. */
static inline struct sv_vec3 sv_grow_random_unit(struct sv_rng *rng)
{
    for (;;) {
        double x = sv_rng_range(rng, -1, 1), y = sv_rng_range(rng, -1, 1), z = sv_rng_range(rng, -1, 1);
        double n = x * x + y * y + z * z;
        if (n > 1e-4 && n <= 1)
            return sv_scale(sv_vec3(x, y, z), 1 / sqrt(n));
    }
}

static inline struct sv_vec3 sv_grow_mix(struct sv_vec3 a, struct sv_vec3 b, double t)
{
    return sv_madd(sv_scale(a, 1 - t), b, t);
}

/* Value noise in [-1, 1] on a lattice that repeats every period_x, period_y cells: what tiles when those are
 * the texture's own counts. */
static inline double sv_grow_noise(double x, double y, int period_x, int period_y, uint64_t seed)
{
    double fx = floor(x), fy = floor(y), u = x - fx, v = y - fy, corner[4];
    for (int k = 0; k < 4; k++) {
        long ix = (long)fx + (k & 1), iy = (long)fy + (k >> 1);
        ix = ((ix % period_x) + period_x) % period_x;
        iy = ((iy % period_y) + period_y) % period_y;
        uint64_t h = sv_mix64(sv_mix64(seed + (uint64_t)ix) + (uint64_t)iy);
        corner[k] = (double)(h >> 11) * 0x1p-52 - 1;
    }
    u = u * u * (3 - 2 * u);
    v = v * v * (3 - 2 * v);
    double low = corner[0] + u * (corner[1] - corner[0]), high = corner[2] + u * (corner[3] - corner[2]);
    return low + v * (high - low);
}

#endif
