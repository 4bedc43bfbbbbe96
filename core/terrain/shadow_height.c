/* shadow_height.c - see shadow_height.h. */
#include "core/terrain/shadow_height.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "core/relief/row_front.h"

/* Half of the sun's disc. */
static const double LIMB_RAD = 0.265 * SV_PI / 180;
/* Straight down there is no track to sweep along; nor is there a shadow. */
static const double STEEPEST_RAD = 89 * SV_PI / 180;

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

/* One step back along the light's major axis, in samples: to (i - back_i, j - back_j), one of them +-1 and
 * the other a fraction; drop: what the light falls on the way. */
struct step {
    double back_i, back_j, drop;
};

static struct step make_step(const struct sv_shadow_height *map, struct sv_vec3 travel)
{
    double i = travel.x / map->dx, j = travel.y / map->dy, most = fmax(fabs(i), fabs(j));
    return (struct step){i / most, j / most, -travel.z / most};
}

static int held(int i, int count)
{
    return i < 0 ? 0 : i < count ? i : count - 1;
}

/* What a row's margins are made of: its heights and shadow surface, and the surface one step before, between
 * the rows p and q (q's share v) at the columns i + shift and i + shift + 1 (the second one's share u). */
struct row {
    const float *h, *surface, *p, *q;
    float u, v, drop;
    int shift;
};

/* Columns first .. end, all of whose neighbours are there. In the dark how far
 * below the surface; in the light how far above what comes in from a step before. (The sweep's own incoming
 * heights would do for the dark; in the light they come from anywhere within the cell before, and edges that
 * are interpolated between the two would waver.) */
static void margins(const struct row *r, int first, int end, float *margin)
{
    const float *h = r->h, *surface = r->surface, *p = r->p, *q = r->q;
    float u = r->u, v = r->v, drop = r->drop;
    int at = r->shift;
    for (int i = first; i < end; i++) {
        float low = p[i + at] + (p[i + at + 1] - p[i + at]) * u;
        float high = q[i + at] + (q[i + at + 1] - q[i + at]) * u;
        float lit = h[i] - (low + (high - low) * v - drop), dark = h[i] - surface[i];
        lit = lit > 0 ? lit : 0;
        lit = lit < SV_SHADOW_HEIGHT_CLEAR ? lit : SV_SHADOW_HEIGHT_CLEAR;
        margin[i] = dark < 0 ? dark : lit;
    }
}

static void margin_row(const struct row *r, int width, float *margin)
{
    int first = r->shift < 0 ? -r->shift : 0, end = r->shift + 1 > 0 ? width - r->shift - 1 : width;
    end = end < first ? first : end;
    for (int i = 0; i < width; i++) {
        if (i == first)
            i = end;
        if (i >= width)
            break;
        int a = held(i + r->shift, width), b = held(i + r->shift + 1, width);
        float p[2] = {r->p[a], r->p[b]}, q[2] = {r->q[a], r->q[b]};
        struct row one = {r->h + i, r->surface + i, p, q, r->u, r->v, r->drop, 0};
        margins(&one, 0, 1, margin + i);
    }
    margins(r, first, end, margin);
}

/* Margins for light at this elevation. */
static enum sv_status sweep(const struct sv_shadow_height *map, double elevation_rad, float *surface,
                            float *margin, struct sv_error *error)
{
    struct sv_vec3 s = map->to_sun;
    double level = hypot(s.x, s.y), c = cos(elevation_rad);
    const float *h = map->heights ? map->heights : map->field->h;
    struct sv_vec3 travel = level > 0 ? sv_vec3(-s.x / level * c, -s.y / level * c, -sin(elevation_rad))
                                      : sv_vec3(0, -c, -sin(elevation_rad));
    travel = sv_normalize(travel);
    struct sv_row_front front = {.width = map->width,
                                 .height = map->height,
                                 .dx = map->dx,
                                 .dy = map->dy,
                                 .travel = travel,
                                 .height_m = h};
    enum sv_status status = sv_row_front(&front, surface, NULL, NULL, error);
    if (status)
        return status;
    struct step step = make_step(map, travel);
    double rows = floor(-step.back_j), columns = floor(-step.back_i);
    size_t w = (size_t)map->width;
    for (int j = 0; j < map->height; j++) {
        int a = held(j + (int)rows, map->height), b = held(j + (int)rows + 1, map->height);
        struct row row = {.h = h + (size_t)j * w,
                          .surface = surface + (size_t)j * w,
                          .p = surface + (size_t)a * w,
                          .q = surface + (size_t)b * w,
                          .u = (float)(-step.back_i - columns),
                          .v = (float)(-step.back_j - rows),
                          .drop = (float)step.drop,
                          .shift = (int)columns};
        margin_row(&row, map->width, margin + (size_t)j * w);
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
    float *surface = malloc((size_t)map->width * (size_t)map->height * sizeof *surface);
    if (!surface)
        return sv_fail(error, SV_ENOMEM, NULL, "no memory for a shadow's surface of %d x %d samples",
                       map->width, map->height);
    status =
        sweep(map, fmin(fmax(elevation - LIMB_RAD, 0), STEEPEST_RAD - LIMB_RAD), surface, map->full, error);
    if (!status)
        status = sweep(map, fmin(elevation + LIMB_RAD, STEEPEST_RAD), surface, map->none, error);
    free(surface);
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
    double slope = map->to_sun.z / fmax(hypot(map->to_sun.x, map->to_sun.y), 1e-9);
    return sv_clamp(0.5 * cell * fmin(slope, 2), 1e-4, 0.5 * (double)SV_SHADOW_HEIGHT_CLEAR);
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
