/* sweep_steep.c - the faces that look straight down and up: triangles of the field drawn into q.
 *
 * Own derivation (homogeneous rasterisation, Olano and Greer 1997, without their matrix inverse): the ray d =
 * (xs, ys, 1) meets the plane of P0 P1 P2 (along right, up, forward from V) at Z d = sum b_k P_k, so that b_k
 * / Z = e_k(d) = (P_l x P_m) . d / det(P0, P1, P2) is affine over the face. Inside: all e_k >= 0; their sum
 * is 1 / Z, whatever is behind the eye. */
#include <math.h>
#include <string.h>

#include "core/cell/sweep_kernel.h"

struct face {
    const struct sv_sweep *sweep;
    struct sv_vec3 right, up, forward;
    float *q;
};

/* Affine over the face in texel columns and rows: value at the centre of texel (0, 0) of samples, steps. */
struct affine {
    double at, by_i, by_j;
};

static struct affine affine_of(const struct face *f, struct sv_vec3 n, double scale)
{
    int size = f->sweep->size;
    double reach = f->sweep->reach, step = 2 * reach / size;
    double x0 = (0.5 + f->sweep->shift_x) * step - reach, y0 = reach - (0.5 + f->sweep->shift_y) * step;
    return (struct affine){(n.x * x0 + n.y * y0 + n.z) * scale, n.x * step * scale, -n.y * step * scale};
}

/* Narrows [*lo, *hi] to where a + i b >= 0. */
static void narrow(double a, double b, double *lo, double *hi)
{
    static const double SLACK =
        1e-9; /* texels: neighbours round a shared edge apart by 1e-12; both may have what is on it */
    if (b > 0)
        *lo = fmax(*lo, -a / b - SLACK);
    else if (b < 0)
        *hi = fmin(*hi, -a / b + SLACK);
    else if (a < 0)
        *hi = -1;
}

/* sign: -1 for the ground's underside, which is kept as -q until all is drawn. */
static void draw_row(const struct face *f, const struct affine e[3], float sign, int j, double first,
                     double last)
{
    double a[3], lo = first, hi = last, value = 0, slope = 0;
    for (int k = 0; k < 3; k++) {
        a[k] = e[k].at + j * e[k].by_j;
        narrow(a[k], e[k].by_i, &lo, &hi);
        value += a[k];
        slope += e[k].by_i;
    }
    value *= f->sweep->distance_m; /* q, affine */
    slope *= f->sweep->distance_m;
    narrow(1 - value, -slope, &lo, &hi);
    if (!(ceil(lo) <= floor(hi)))
        return;
    float *q = f->q + (size_t)j * (size_t)f->sweep->size;
    for (int i = (int)ceil(lo); i <= (int)floor(hi); i++) {
        float here = (float)(value + i * slope);
        if (here > fabsf(q[i]))
            q[i] = sign * (here < 1 ? here : 1);
    }
}

/* Box, in texels, of the part of a triangle beyond the plane; false: there is none in the face. */
static bool box_of(const struct face *f, const struct sv_vec3 p[3], double box[4])
{
    double size = f->sweep->size, half = 0.5 * size / f->sweep->reach, d = f->sweep->distance_m,
           last = size - 1;
    double x0 = INFINITY, x1 = -INFINITY, y0 = INFINITY, y1 = -INFINITY;
    for (int k = 0; k < 3; k++) {
        struct sv_vec3 a = p[k], b = p[(k + 1) % 3];
        struct sv_vec3 at[2] = {a, sv_madd(a, sv_sub(b, a), (d - a.z) / (b.z - a.z))};
        bool use[2] = {a.z >= d, (a.z - d) * (b.z - d) < 0};
        for (int m = 0; m < 2; m++)
            if (use[m]) {
                double z = m ? d : a.z;
                x0 = fmin(x0, at[m].x / z);
                x1 = fmax(x1, at[m].x / z);
                y0 = fmin(y0, at[m].y / z);
                y1 = fmax(y1, at[m].y / z);
            }
    }
    double cx = 0.5 * size - 0.5 - f->sweep->shift_x, cy = 0.5 * size - 0.5 - f->sweep->shift_y;
    box[0] = fmax(ceil(x0 * half + cx - 1e-6), 0);
    box[1] = fmin(floor(x1 * half + cx + 1e-6), last);
    box[2] = fmax(ceil(-y1 * half + cy - 1e-6), 0);
    box[3] = fmin(floor(-y0 * half + cy + 1e-6), last);
    return box[0] <= box[1] && box[2] <= box[3];
}

/* Corners counter-clockwise from above: their determinant in the left-handed frame of a face is then above 0.
 */
static void draw_triangle(const struct face *f, struct sv_vec3 a, struct sv_vec3 b, struct sv_vec3 c)
{
    const struct sv_vec3 p[3] = {a, b, c};
    double box[4];
    if (!box_of(f, p, box))
        return;
    double det = sv_dot(a, sv_cross(b, c));
    if (det == 0)
        return; /* seen edge-on */
    struct affine e[3];
    for (int k = 0; k < 3; k++)
        e[k] = affine_of(f, sv_cross(p[(k + 1) % 3], p[(k + 2) % 3]), 1 / det);
    for (int j = (int)box[2]; j <= (int)box[3]; j++)
        draw_row(f, e, det > 0 ? 1 : -1, j, box[0], box[1]);
}

static struct sv_vec3 corner(const struct face *f, int i, int j)
{
    const struct sv_heightfield *h = f->sweep->field;
    struct sv_vec3 p = sv_vec3(h->x0 + i * h->dx, h->y0 + j * h->dy,
                               h->z0 + (double)h->h[(size_t)j * (size_t)h->width + (size_t)i]);
    p = sv_sub(p, f->sweep->v);
    return sv_vec3(sv_dot(p, f->right), sv_dot(p, f->up), sv_dot(p, f->forward));
}

static void draw_cell(const struct face *f, int i, int j)
{
    struct sv_vec3 p00 = corner(f, i, j), p10 = corner(f, i + 1, j), p01 = corner(f, i, j + 1),
                   p11 = corner(f, i + 1, j + 1);
    double far = fmax(fmax(p00.z, p10.z), fmax(p01.z, p11.z));
    if (far < f->sweep->distance_m)
        return;
    far *= f->sweep->reach;
    if (fmin(p00.x, p10.x) > far || fmax(p00.x, p10.x) < -far || fmin(p00.y, p01.y) > far ||
        fmax(p00.y, p01.y) < -far)
        return;
    bool anti = (i + j) & 1;
    draw_triangle(f, p00, p10, anti ? p01 : p11);
    draw_triangle(f, anti ? p10 : p00, p11, p01);
}

/* Cells first .. last of a row of `samples` that come within reach of an eye at `at` (in samples). */
static void range(double at, double reach, int samples, int *first, int *last)
{
    *first = (int)sv_clamp(floor(at - reach), 0, samples - 1);
    *last = (int)sv_clamp(floor(at + reach), -1, samples - 2);
}

void sv_sweep_steep(const struct sv_sweep *sweep, float *q)
{
    struct face f = {.sweep = sweep, .q = q};
    const struct sv_heightfield *h = sweep->field;
    int i0, i1, j0, j1;
    sv_cell_face_axes(sweep->face, &f.right, &f.up, &f.forward);
    memset(q, 0, (size_t)sweep->size * (size_t)sweep->size * sizeof *q);
    double eye = sweep->v.z - h->z0;
    double reach = f.forward.z < 0 ? eye - (double)h->h_min
                                   : (double)h->h_max - eye; /* what is farther is beside the face */
    if (!(reach >= sweep->distance_m))
        return;
    range((sweep->v.x - h->x0) / h->dx, 1.01 * sweep->reach * reach / h->dx, h->width, &i0, &i1);
    range((sweep->v.y - h->y0) / h->dy, 1.01 * sweep->reach * reach / h->dy, h->height, &j0, &j1);
    for (int j = j0; j <= j1; j++)
        for (int i = i0; i <= i1; i++)
            draw_cell(&f, i, j);
    for (size_t k = 0; k < (size_t)sweep->size * (size_t)sweep->size; k++)
        q[k] = q[k] > 0 ? q[k] : 0;
}
