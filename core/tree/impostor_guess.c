/* impostor_guess.c - see impostor_guess.h: Legendre polynomials of order 0 and 2, midpoint rule over c in
 * 0..1. */
#include "core/tree/impostor_guess.h"

#include <math.h>

enum { LENGTHS = SV_GUESS_LENGTHS, HEIGHTS = 32 };

/* Twin of the guess in core/gl/shaders/tree_leaf.glsl, leaf_sun: mean |n.l| for a mean normal of length rho
 * that makes an angle of cosine c with l. */
static float guess(float rho, float c)
{
    float loose = 1 - rho, c2 = c * c, across = fminf(0.8f * loose, 0.5f);
    return sqrtf(fmaxf(across + (1 - 3 * across) * c2, 0)) * (1 - loose * (0.56f - 0.4f * c2));
}

float sv_guess_leaf_sun(const float m[3], const float l[3], float t)
{
    float rho2 = fminf(fmaxf(m[0] * m[0] + m[1] * m[1] + m[2] * m[2], 1e-6f), 1);
    float rho = sqrtf(rho2), along = m[0] * l[0] + m[1] * l[1] + m[2] * l[2];
    float mean = guess(rho, fminf(fabsf(along) / rho, 1));
    return fmaxf(0, 0.5f * ((1 + t) * mean + (1 - t) * along));
}

void sv_guess_table_make(struct sv_guess_table *table)
{
    for (int k = 0; k <= LENGTHS; k++) {
        float p0 = 0, p2 = 0;
        for (int i = 0; i < HEIGHTS; i++) {
            float c = ((float)i + 0.5f) / HEIGHTS, g = guess((float)k / LENGTHS, c) / HEIGHTS;
            p0 += g;
            p2 += 5 * g * (1.5f * c * c - 0.5f);
        }
        table->even[k] = p0 - 0.5f * p2;
        table->square[k] = 1.5f * p2;
    }
}

void sv_guess_add(const struct sv_guess_table *table, float weight, const float m[3], float sum[6])
{
    float rho2 = m[0] * m[0] + m[1] * m[1] + m[2] * m[2];
    int k = (int)(fminf(sqrtf(rho2), 1) * LENGTHS + 0.5f);
    float even = weight * table->even[k], square = weight * table->square[k] / fmaxf(rho2, 1e-6f);
    for (int c = 0; c < 3; c++)
        sum[c] += even + square * m[c] * m[c];
    sum[3] += square * m[0] * m[1];
    sum[4] += square * m[0] * m[2];
    sum[5] += square * m[1] * m[2];
}
