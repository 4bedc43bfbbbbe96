/* shadow_height.c - see shadow_height.h. */
#include "core/terrain/shadow_height.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "core/relief/row_front.h"

/* Half of the sun's disc. */
static const double LIMB_RAD = 0.265 * SV_PI / 180;

static int divisor(const struct sv_heightfield *f)
{
    int side = f->width > f->height ? f->width : f->height;
    return (side + SV_SHADOW_HEIGHT_SIDE - 1) / SV_SHADOW_HEIGHT_SIDE;
}

/* Means of n x n samples; what is left over at the far borders belongs to the last ones. */
static void average(const struct sv_heightfield *f, int n, int width, int height, float *out)
{
    for (int j = 0; j < height; j++)
        for (int i = 0; i < width; i++) {
            int i1 = i + 1 < width ? (i + 1) * n : f->width, j1 = j + 1 < height ? (j + 1) * n : f->height;
            double sum = 0;
            for (int b = j * n; b < j1; b++)
                for (int a = i * n; a < i1; a++)
                    sum += (double)f->h[(size_t)b * (size_t)f->width + (size_t)a];
            out[(size_t)j * (size_t)width + (size_t)i] = (float)(sum / ((double)(i1 - i * n) * (j1 - j * n)));
        }
}

static enum sv_status prepare(struct sv_shadow_height *map, const struct sv_heightfield *field,
                              struct sv_error *error)
{
    if (map->full && map->none && map->field == field)
        return SV_OK;
    sv_shadow_height_finish(map);
    int n = divisor(field);
    map->field = field;
    map->width = field->width / n > 1 ? field->width / n : 1;
    map->height = field->height / n > 1 ? field->height / n : 1;
    map->dx = field->dx * n;
    map->dy = field->dy * n;
    map->x0 = field->x0 + 0.5 * (n - 1) * field->dx;
    map->y0 = field->y0 + 0.5 * (n - 1) * field->dy;
    size_t count = (size_t)map->width * (size_t)map->height;
    map->full = malloc(count * sizeof *map->full);
    map->none = malloc(count * sizeof *map->none);
    map->heights = n > 1 ? malloc(count * sizeof *map->heights) : NULL;
    if (!map->full || !map->none || (n > 1 && !map->heights))
        return sv_fail(error, SV_ENOMEM, NULL, "no memory for shadow heights of %d x %d samples", map->width,
                       map->height);
    if (n > 1)
        average(field, n, map->width, map->height, map->heights);
    return SV_OK;
}

/* Heights less those that come in for light at this elevation. */
static enum sv_status sweep(const struct sv_shadow_height *map, double elevation_rad, float *margin,
                            struct sv_error *error)
{
    struct sv_vec3 s = map->to_sun;
    double level = hypot(s.x, s.y), c = cos(elevation_rad);
    const float *h = map->heights ? map->heights : map->field->h;
    struct sv_vec3 travel = level > 0 ? sv_vec3(-s.x / level * c, -s.y / level * c, -sin(elevation_rad))
                                      : sv_vec3(0, -c, -sin(elevation_rad));
    struct sv_row_front front = {.width = map->width,
                                 .height = map->height,
                                 .dx = map->dx,
                                 .dy = map->dy,
                                 .travel = sv_normalize(travel),
                                 .height_m = h};
    enum sv_status status = sv_row_front(&front, NULL, margin, NULL, error);
    if (status)
        return status;
    size_t count = (size_t)map->width * (size_t)map->height;
    for (size_t k = 0; k < count; k++) {
        float m = h[k] - margin[k];
        margin[k] = m < SV_SHADOW_HEIGHT_CLEAR ? m : SV_SHADOW_HEIGHT_CLEAR;
    }
    return SV_OK;
}

enum sv_status sv_shadow_height_make(struct sv_shadow_height *map, const struct sv_heightfield *field,
                                     struct sv_vec3 to_sun, struct sv_error *error)
{
    if (!(fabs(sv_length(to_sun) - 1) < 1e-6) || !(to_sun.z > 0))
        return sv_fail(error, SV_EINVAL, "to_sun", "(%g, %g, %g) is not a direction above the horizon",
                       to_sun.x, to_sun.y, to_sun.z);
    enum sv_status status = prepare(map, field, error);
    if (status)
        return status;
    map->to_sun = to_sun;
    double elevation = atan2(to_sun.z, hypot(to_sun.x, to_sun.y));
    status = sweep(map, fmax(elevation - LIMB_RAD, 0), map->full, error);
    if (!status)
        status = sweep(map, fmin(elevation + LIMB_RAD, SV_PI / 2), map->none, error);
    return status;
}

void sv_shadow_height_finish(struct sv_shadow_height *map)
{
    free(map->full);
    free(map->none);
    free(map->heights);
    memset(map, 0, sizeof *map);
}

double sv_shadow_height_soft_m(const struct sv_shadow_height *map, double spacing_m)
{
    double cell = fmax(sqrt(map->dx * map->dy), spacing_m);
    return fmax(0.5 * cell * map->to_sun.z / fmax(hypot(map->to_sun.x, map->to_sun.y), 0.01), 1e-4);
}

static double bilinear(const struct sv_shadow_height *map, const float *of, double x, double y)
{
    double gi = sv_clamp((x - map->x0) / map->dx, 0, map->width - 1);
    double gj = sv_clamp((y - map->y0) / map->dy, 0, map->height - 1);
    int i = (int)gi, j = (int)gj;
    int i1 = i + 1 < map->width ? i + 1 : i, j1 = j + 1 < map->height ? j + 1 : j;
    double u = gi - i, v = gj - j;
    const float *p = of + (size_t)j * (size_t)map->width, *q = of + (size_t)j1 * (size_t)map->width;
    return ((double)p[i] * (1 - u) + (double)p[i1] * u) * (1 - v) +
           ((double)q[i] * (1 - u) + (double)q[i1] * u) * v;
}

double sv_shadow_height_at(void *context, double x, double y)
{
    const struct sv_shadow_height *map = context;
    double ground;
    if (!map->full || !sv_heightfield_height(map->field, x, y, &ground))
        return -INFINITY;
    double margin = 0.5 * (bilinear(map, map->full, x, y) + bilinear(map, map->none, x, y));
    return margin < 0 ? ground - margin : -INFINITY;
}
