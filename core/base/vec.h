/* vec.h - small vectors and 4 x 4 matrices in double, all inline.
 *
 * Matrices are row-major, act on column vectors, and are named dst_from_src. Narrowing to float happens only in
 * sv_mat4_to_float, at the GL border, after everything large has been subtracted in double. */
#ifndef SV_BASE_VEC_H
#define SV_BASE_VEC_H

#include <math.h>

#define SV_PI 3.14159265358979323846

struct sv_vec3 {
    double x, y, z;
};

struct sv_mat4 {
    double m[4][4]; /* m[row][column] */
};

static inline struct sv_vec3 sv_vec3(double x, double y, double z)
{
    return (struct sv_vec3){x, y, z};
}
static inline struct sv_vec3 sv_add(struct sv_vec3 a, struct sv_vec3 b)
{
    return sv_vec3(a.x + b.x, a.y + b.y, a.z + b.z);
}
static inline struct sv_vec3 sv_sub(struct sv_vec3 a, struct sv_vec3 b)
{
    return sv_vec3(a.x - b.x, a.y - b.y, a.z - b.z);
}
static inline struct sv_vec3 sv_scale(struct sv_vec3 a, double s)
{
    return sv_vec3(a.x * s, a.y * s, a.z * s);
}
static inline struct sv_vec3 sv_madd(struct sv_vec3 a, struct sv_vec3 b, double s)
{
    return sv_vec3(a.x + b.x * s, a.y + b.y * s, a.z + b.z * s);
}
static inline double sv_dot(struct sv_vec3 a, struct sv_vec3 b)
{
    return a.x * b.x + a.y * b.y + a.z * b.z;
}
static inline struct sv_vec3 sv_cross(struct sv_vec3 a, struct sv_vec3 b)
{
    return sv_vec3(a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x);
}
static inline double sv_length(struct sv_vec3 a)
{
    return sqrt(sv_dot(a, a));
}
/* Unit vector along a; (0,0,0) stays (0,0,0). */
static inline struct sv_vec3 sv_normalize(struct sv_vec3 a)
{
    double n = sv_length(a);
    return n > 0 ? sv_scale(a, 1.0 / n) : a;
}
static inline double sv_clamp(double v, double lo, double hi)
{
    return v < lo ? lo : v > hi ? hi : v;
}
static inline double sv_radians(double degrees)
{
    return degrees * (SV_PI / 180.0);
}
static inline double sv_degrees(double radians)
{
    return radians * (180.0 / SV_PI);
}

static inline struct sv_mat4 sv_mat4_mul(const struct sv_mat4 *a, const struct sv_mat4 *b)
{
    struct sv_mat4 r;
    for (int i = 0; i < 4; i++)
        for (int j = 0; j < 4; j++)
            r.m[i][j] = a->m[i][0] * b->m[0][j] + a->m[i][1] * b->m[1][j] + a->m[i][2] * b->m[2][j] +
                        a->m[i][3] * b->m[3][j];
    return r;
}

/* Writes m as 16 floats in GL's column-major order. */
static inline void sv_mat4_to_float(const struct sv_mat4 *m, float out[16])
{
    for (int i = 0; i < 4; i++)
        for (int j = 0; j < 4; j++)
            out[j * 4 + i] = (float)m->m[i][j];
}

#endif
