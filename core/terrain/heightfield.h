/* heightfield.h - the terrain's geometry: a regular grid of heights and the triangles between them.
 *
 * Sample (i, j) stands at (x0 + i dx, y0 + j dy, z0 + h[j * width + i]); row 0 is the south row (frames.h). Every cell
 * (i, j) .. (i+1, j+1) is two triangles. THE DIAGONAL ALTERNATES: for i + j even it joins (i, j) and (i+1, j+1), for
 * i + j odd it joins (i+1, j) and (i, j+1). That is the finest level of the 4-8 mesh that the level of detail refines
 * (Lindstrom and Pascucci 2002), so truth, queries and the full-detail drawing share the very same surface.
 * The surface exists on the closed rectangle from the first to the last sample; outside there is nothing. */
#ifndef SV_TERRAIN_HEIGHTFIELD_H
#define SV_TERRAIN_HEIGHTFIELD_H

#include <stdbool.h>
#include <stddef.h>

#include "core/base/vec.h"

enum { SV_HEIGHTFIELD_SIDE_MAX = 16384 }; /* samples a side; and at most 2^26 samples in all */
#define SV_HEIGHTFIELD_SAMPLES_MAX ((size_t)1 << 26)

struct sv_heightfield {
    int width, height; /* samples, each 2 .. SV_HEIGHTFIELD_SIDE_MAX */
    double x0, y0;     /* world place of sample (0, 0), m */
    double dx, dy;     /* spacing, m, > 0 */
    double z0;         /* world height of h = 0, m: keeps floats small */
    float h_min, h_max;
    const float *h; /* width * height finite heights above z0, m; arena */
};

/* World rectangle of the surface: x0 <= x <= x1, y0 <= y <= y1. */
static inline double sv_heightfield_x1(const struct sv_heightfield *f)
{
    return f->x0 + (f->width - 1) * f->dx;
}
static inline double sv_heightfield_y1(const struct sv_heightfield *f)
{
    return f->y0 + (f->height - 1) * f->dy;
}

/* World height of the triangulated surface at (x, y); false outside or for NaN, *z then untouched. */
bool sv_heightfield_height(const struct sv_heightfield *f, double x, double y, double *z);
/* Unit normal of the triangle at (x, y), z > 0; false outside. */
bool sv_heightfield_normal(const struct sv_heightfield *f, double x, double y, struct sv_vec3 *normal);
/* Steepest slope angle of the triangle at (x, y), radians, 0 .. pi/2; false outside. */
bool sv_heightfield_slope(const struct sv_heightfield *f, double x, double y, double *slope_rad);

/* Smooth vertex normal at sample (i, j) by central differences (one-sided at borders): what shading uses. i, j are clamped. */
struct sv_vec3 sv_heightfield_sample_normal(const struct sv_heightfield *f, int i, int j);

#endif
