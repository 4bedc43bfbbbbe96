/* object_cast.c - see object_casters.h: the scalar kernel. */
#include <math.h>
#include <stddef.h>

#include "core/relief/object_casters.h"
#include "core/relief/object_splat_kernel.h"

/* A quadrilateral in the map by corner 0 and what the others add to it: x, y, depth. */
struct quad {
    float at[3], e1[3], e2[3], e3[3];
};

static struct quad project(const struct sv_relief_map *map, const struct sv_relief_quads *quads, int lane)
{
    float u = quads->u[lane], v = quads->v[lane], t = quads->t[0][lane];
    struct quad q;
    for (int k = 0; k < 3; k++) {
        const float *m = map->at[k];
        float along_u = m[0] * map->du, along_v = m[1] * map->dv;
        q.at[k] = ((m[3] + m[0] * u) + m[1] * v) + m[2] * t;
        q.e1[k] = along_u + m[2] * (quads->t[1][lane] - t);
        q.e2[k] = along_v + m[2] * (quads->t[2][lane] - t);
        q.e3[k] = (along_u + along_v) + m[2] * (quads->t[3][lane] - t);
    }
    return q;
}

/* Least and most of what corners add. */
static void extent(const struct quad *q, int axis, float *least, float *most)
{
    float a = sv_relief_min2(q->e1[axis], q->e2[axis]), b = sv_relief_max2(q->e1[axis], q->e2[axis]);
    *least = sv_relief_min2(sv_relief_min2(q->e3[axis], 0), a);
    *most = sv_relief_max2(sv_relief_max2(q->e3[axis], 0), b);
}

/* First pixel and number of those whose centres lie in [lo, hi]. */
static int pixels(float lo, float hi, int size, int *first)
{
    const float end = (float)size;
    float a = ceilf(sv_relief_min2(sv_relief_max2(lo - 0.5f, 0), end));
    float b = floorf(sv_relief_max2(sv_relief_min2(hi - 0.5f, end - 1), -1));
    *first = (int)a;
    return (int)((b - a) + 1);
}

static void draw(const struct sv_relief_map *map, const struct quad *q)
{
    float det = q->e1[0] * q->e2[1] - q->e1[1] * q->e2[0], lo[3], hi[3];
    for (int k = 0; k < 3; k++)
        extent(q, k, &lo[k], &hi[k]);
    if (!(fabsf(det) > ((hi[0] - lo[0]) * (hi[1] - lo[1])) * SV_RELIEF_EDGE_ON))
        return;
    int i0, j0, nx = pixels(q->at[0] + lo[0], q->at[0] + hi[0], map->width, &i0);
    int ny = pixels(q->at[1] + lo[1], q->at[1] + hi[1], map->height, &j0);
    float scale = 1 / det, sx = q->e2[1] * scale, sy = q->e2[0] * scale, rx = q->e1[1] * scale,
          ry = q->e1[0] * scale;
    float s3 = q->e3[0] * sx - q->e3[1] * sy, r3 = q->e3[1] * ry - q->e3[0] * rx;
    bool convex = s3 > 0 && r3 > 0 && s3 + r3 > 1;
    float s1 = convex ? 1 : sv_relief_max2(s3, 1), r1 = convex ? 1 : sv_relief_max2(r3, 1);
    float a_r = convex ? s3 - 1 : 0, a_s = convex ? r3 : 1, e_s = convex ? r3 - 1 : 0, e_r = convex ? s3 : 1;
    float x0 = ((float)i0 + 0.5f) - q->at[0], y0 = ((float)j0 + 0.5f) - q->at[1];
    float d_min = q->at[2] + lo[2], d_max = q->at[2] + hi[2];
    for (int ky = 0; ky < ny; ky++) {
        float dy = y0 + (float)ky, s_row = dy * sy, r_row = dy * ry;
        float *row = map->depth + (ptrdiff_t)(j0 + ky) * map->width + i0;
        for (int kx = 0; kx < nx; kx++) {
            float dx = x0 + (float)kx, s = dx * sx - s_row, r = r_row - dx * rx;
            float a = a_r * r - a_s * (s - s1), e = e_s * s - e_r * (r - r1);
            float least = sv_relief_min2(sv_relief_min2(s, r), sv_relief_min2(a, e));
            float d = (q->at[2] + s * q->e1[2]) + r * q->e2[2];
            d = sv_relief_min2(sv_relief_max2(d, d_min), d_max);
            if (least >= -SV_WARP_EDGE)
                row[kx] = sv_relief_max2(d, row[kx]); /* NaN: as it was */
        }
    }
}

void sv_relief_cast_scalar(const struct sv_relief_map *map, const struct sv_relief_quads *quads, size_t count)
{
    for (size_t n = 0; n < count; n++)
        for (int lane = 0; lane < 8; lane++) {
            struct quad q = project(map, &quads[n], lane);
            draw(map, &q);
        }
}
