/* heightfield.c - height, slope and normal of the triangulated surface at a place.
 *
 * One function finds the triangle under (x, y) and gives its plane; the queries read from it. The plane is
 * evaluated in double from float samples, so a result is exact to a few ulp of the height. Points on an edge
 * shared by two triangles give the same height from either side up to rounding. */
#include "core/terrain/heightfield.h"

/* The triangle under a point: height above z0 there, and its gradient. */
struct plane {
    double h, h_x, h_y;
};

static double sample(const struct sv_heightfield *f, int i, int j)
{
    return (double)f->h[(size_t)j * (size_t)f->width + (size_t)i];
}

/* Index of the cell that holds offset t (in cells), and the part of t inside it, 0..1. */
static int cell_of(double t, int samples, double *part)
{
    int i = t > 0 ? (t < samples - 2 ? (int)t : samples - 2) : 0;
    *part = sv_clamp(t - i, 0.0, 1.0);
    return i;
}

static bool plane_at(const struct sv_heightfield *f, double x, double y, struct plane *p)
{
    if (!(x >= f->x0 && x <= sv_heightfield_x1(f) && y >= f->y0 && y <= sv_heightfield_y1(f)))
        return false; /* NaN ends here as well */
    double s, t;
    int i = cell_of((x - f->x0) / f->dx, f->width, &s);
    int j = cell_of((y - f->y0) / f->dy, f->height, &t);
    double h00 = sample(f, i, j), h10 = sample(f, i + 1, j);
    double h01 = sample(f, i, j + 1), h11 = sample(f, i + 1, j + 1);
    double hs, ht;            /* per cell */
    if (((i + j) & 1) == 0) { /* diagonal (0,0)-(1,1) */
        bool south_east = s >= t;
        hs = south_east ? h10 - h00 : h11 - h01;
        ht = south_east ? h11 - h10 : h01 - h00;
        p->h = h00 + s * hs + t * ht;
    } else if (s + t <= 1) { /* diagonal (1,0)-(0,1), south-west half */
        hs = h10 - h00;
        ht = h01 - h00;
        p->h = h00 + s * hs + t * ht;
    } else { /* north-east half */
        hs = h11 - h01;
        ht = h11 - h10;
        p->h = h11 - (1 - s) * hs - (1 - t) * ht;
    }
    p->h_x = hs / f->dx;
    p->h_y = ht / f->dy;
    return true;
}

bool sv_heightfield_height(const struct sv_heightfield *f, double x, double y, double *z)
{
    struct plane p;
    if (!plane_at(f, x, y, &p))
        return false;
    *z = f->z0 + p.h;
    return true;
}

bool sv_heightfield_normal(const struct sv_heightfield *f, double x, double y, struct sv_vec3 *normal)
{
    struct plane p;
    if (!plane_at(f, x, y, &p))
        return false;
    *normal = sv_normalize(sv_vec3(-p.h_x, -p.h_y, 1));
    return true;
}

bool sv_heightfield_slope(const struct sv_heightfield *f, double x, double y, double *slope_rad)
{
    struct plane p;
    if (!plane_at(f, x, y, &p))
        return false;
    *slope_rad = atan(sqrt(p.h_x * p.h_x + p.h_y * p.h_y));
    return true;
}

static int clamp_index(int i, int last)
{
    return i < 0 ? 0 : i > last ? last : i;
}

struct sv_vec3 sv_heightfield_sample_normal(const struct sv_heightfield *f, int i, int j)
{
    i = clamp_index(i, f->width - 1);
    j = clamp_index(j, f->height - 1);
    int w = i > 0 ? i - 1 : i, e = i < f->width - 1 ? i + 1 : i;
    int s = j > 0 ? j - 1 : j, n = j < f->height - 1 ? j + 1 : j;
    double h_x = (sample(f, e, j) - sample(f, w, j)) / ((e - w) * f->dx);
    double h_y = (sample(f, i, n) - sample(f, i, s)) / ((n - s) * f->dy);
    return sv_normalize(sv_vec3(-h_x, -h_y, 1));
}
