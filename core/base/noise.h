/* noise.h - smooth gradient noise over the plane, the same bits on every machine.
 *
 * Perlin (2002) with his quintic fade and its exact derivatives; gradients come from an integer hash and are
 * of unit length (sqrt is correctly rounded everywhere). Only + - * / sqrt floor are used: no libm function
 * whose last bit may differ decides anything. Coordinates beyond +-2^31 cells wrap round. */
#ifndef SV_BASE_NOISE_H
#define SV_BASE_NOISE_H

#include <math.h>

#include "core/base/rng.h"

struct sv_noise {
    double v, dx, dy; /* value, about -0.8 .. 0.8, mean 0; its slope per cell */
};

/* Gradient at lattice point (i, j): a point of the unit circle. */
static inline void sv_noise_gradient(uint64_t seed, int64_t i, int64_t j, double *gx, double *gy)
{
    uint64_t h = sv_mix64(seed ^ ((uint64_t)(uint32_t)i | (uint64_t)(uint32_t)j << 32));
    double x = (double)(int32_t)(h >> 32) * 0x1p-31, y = (double)(int32_t)(uint32_t)h * 0x1p-31;
    double n = x * x + y * y;
    double s = n > 1e-6 ? 1.0 / sqrt(n) : 0;
    *gx = s > 0 ? x * s : 1;
    *gy = s > 0 ? y * s : 0;
}

/* Noise of one seed (mix it well: sv_mix64) at (x, y); one cell is one unit. */
static inline struct sv_noise sv_noise_at(uint64_t seed, double x, double y)
{
    double fx = floor(x), fy = floor(y);
    int64_t i = (int64_t)fx, j = (int64_t)fy;
    double u = x - fx, v = y - fy;
    double ax, ay, bx, by, cx, cy, ex, ey;
    sv_noise_gradient(seed, i, j, &ax, &ay);
    sv_noise_gradient(seed, i + 1, j, &bx, &by);
    sv_noise_gradient(seed, i, j + 1, &cx, &cy);
    sv_noise_gradient(seed, i + 1, j + 1, &ex, &ey);
    double a = ax * u + ay * v, b = bx * (u - 1) + by * v;
    double c = cx * u + cy * (v - 1), e = ex * (u - 1) + ey * (v - 1);
    double s = u * u * u * (u * (u * 6 - 15) + 10), t = v * v * v * (v * (v * 6 - 15) + 10);
    double ds = 30 * u * u * (u * (u - 2) + 1), dt = 30 * v * v * (v * (v - 2) + 1);
    double k = a - b - c + e;
    return (struct sv_noise){
        a + s * (b - a) + t * (c - a) + s * t * k,
        ax + s * (bx - ax) + t * (cx - ax) + s * t * (ax - bx - cx + ex) + ds * (b - a + t * k),
        ay + s * (by - ay) + t * (cy - ay) + s * t * (ay - by - cy + ey) + dt * (c - a + s * k)};
}

/* Sum of `octaves` octaves, each of half the wavelength and half the weight; about -1 .. 1. */
static inline double sv_noise_sum(uint64_t seed, double x, double y, int octaves)
{
    double sum = 0, weight = 1;
    for (int k = 0; k < octaves; k++) {
        sum += weight * sv_noise_at(sv_mix64(seed + (uint64_t)k), x, y).v;
        x = 2 * x + 17.3; /* off the lattice of the octave before */
        y = 2 * y - 9.7;
        weight *= 0.5;
    }
    return sum;
}

#endif
