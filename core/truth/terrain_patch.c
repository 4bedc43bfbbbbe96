#include "core/truth/terrain_patch.h"

#include <math.h>
#include <stdlib.h>

enum { CELLS = SV_TERRAIN_PATCH_CELLS };

enum sv_status sv_terrain_patches_init(struct sv_terrain_patches *patches, const struct sv_heightfield *field,
                                       struct sv_vec3 origin, struct sv_error *error)
{
    struct sv_terrain_patches p = {.field = field, .origin = origin};
    p.columns = (field->width - 1 + CELLS - 1) / CELLS;
    p.rows = (field->height - 1 + CELLS - 1) / CELLS;
    p.range = malloc((size_t)p.columns * (size_t)p.rows * sizeof *p.range);
    if (!p.range)
        return sv_fail(error, SV_ENOMEM, NULL, "no memory for %d x %d terrain patches", p.columns, p.rows);
    for (int r = 0; r < p.rows; r++)
        for (int c = 0; c < p.columns; c++) {
            float lo = INFINITY, hi = -INFINITY;
            for (int j = r * CELLS; j <= (r + 1) * CELLS && j < field->height; j++)
                for (int i = c * CELLS; i <= (c + 1) * CELLS && i < field->width; i++) {
                    float h = field->h[(size_t)j * (size_t)field->width + (size_t)i];
                    lo = fminf(lo, h);
                    hi = fmaxf(hi, h);
                }
            float *range = p.range[(size_t)r * (size_t)p.columns + (size_t)c];
            range[0] = lo;
            range[1] = hi;
        }
    *patches = p;
    return SV_OK;
}

void sv_terrain_patches_finish(struct sv_terrain_patches *patches)
{
    free(patches->range);
    *patches = (struct sv_terrain_patches){0};
}

/* A ray in grid units: i, j count samples, z stays in metres above field->z0. */
struct grid_ray {
    double i, j, z, di, dj, dz;
};

static struct grid_ray to_grid(const struct sv_terrain_patches *patches, const struct sv_patch_ray *ray)
{
    const struct sv_heightfield *f = patches->field;
    return (struct grid_ray){(patches->origin.x - f->x0 + ray->origin.x) / f->dx,
                             (patches->origin.y - f->y0 + ray->origin.y) / f->dy,
                             patches->origin.z - f->z0 + ray->origin.z,
                             ray->direction.x / f->dx,
                             ray->direction.y / f->dy,
                             ray->direction.z};
}

/* Crossing of the ray with the plane through the corner heights of one half of a cell. a is the height at (0,
 * 0) of the half's own corner frame: z = a + u (b - a) + v (c - a). inside tells which (u, v) belong to this
 * half; its edges are widened by a hair, and the surface is continuous there, so no ray slips between two
 * halves. */
static const double hair = 1e-9;

struct half {
    double z00, su, sv; /* height at the cell's corner (0, 0), slopes along i and j: z = z00 + su u + sv v */
};

static bool half_hit(const struct half *h, const struct grid_ray *r, double u0, double v0, double *t)
{
    /* z(t) - plane(t) = 0 */
    double gap = r->z - (h->z00 + h->su * u0 + h->sv * v0);
    double rate = r->dz - h->su * r->di - h->sv * r->dj;
    if (rate == 0)
        return false;
    *t = -gap / rate;
    return true;
}

static bool cell_hit(const struct sv_heightfield *f, const struct grid_ray *r, int i, int j, double t_min,
                     double t_max, double *t_out)
{
    const float *p = f->h + (size_t)j * (size_t)f->width + (size_t)i;
    double h00 = (double)p[0], h10 = (double)p[1], h01 = (double)p[f->width], h11 = (double)p[f->width + 1];
    bool even = ((i + j) & 1) == 0;
    /* even: halves v <= u (00, 10, 11) and v >= u (00, 11, 01); odd: u + v <= 1 (00, 10, 01) and u + v >= 1.
     */
    struct half halves[2];
    if (even) {
        halves[0] = (struct half){h00, h10 - h00, h11 - h10};
        halves[1] = (struct half){h00, h11 - h01, h01 - h00};
    } else {
        halves[0] = (struct half){h00, h10 - h00, h01 - h00};
        halves[1] = (struct half){h10 + h01 - h11, h11 - h01, h11 - h10};
    }
    bool found = false;
    for (int k = 0; k < 2; k++) {
        double t;
        if (!half_hit(&halves[k], r, r->i - i, r->j - j, &t) || !(t > t_min) || !(t < t_max))
            continue;
        double u = r->i - i + t * r->di, v = r->j - j + t * r->dj;
        if (u < -hair || u > 1 + hair || v < -hair || v > 1 + hair)
            continue;
        double side = even ? u - v : 1 - u - v; /* >= 0: first half */
        if (k == 0 ? side < -hair : side > hair)
            continue;
        t_max = t;
        *t_out = t;
        found = true;
    }
    return found;
}

/* Clips [t0, t1] to where lo <= p + t d <= hi. */
static bool clip(double p, double d, double lo, double hi, double *t0, double *t1)
{
    if (d == 0)
        return p >= lo && p <= hi;
    double a = (lo - p) / d, b = (hi - p) / d;
    *t0 = fmax(*t0, fmin(a, b));
    *t1 = fmin(*t1, fmax(a, b));
    return *t0 <= *t1;
}

bool sv_terrain_patch_intersect(const struct sv_terrain_patches *patches, unsigned patch,
                                const struct sv_patch_ray *ray, double t_min, double t_max, double *t)
{
    const struct sv_heightfield *f = patches->field;
    struct grid_ray r = to_grid(patches, ray);
    int column = (int)(patch % (unsigned)patches->columns), row = (int)(patch / (unsigned)patches->columns);
    int i0 = column * CELLS, j0 = row * CELLS;
    int i1 = i0 + CELLS < f->width - 1 ? i0 + CELLS : f->width - 1;
    int j1 = j0 + CELLS < f->height - 1 ? j0 + CELLS : f->height - 1;
    double enter = t_min, leave = t_max;
    if (!clip(r.i, r.di, i0 - hair, i1 + hair, &enter, &leave) ||
        !clip(r.j, r.dj, j0 - hair, j1 + hair, &enter, &leave) ||
        !clip(r.z, r.dz, (double)patches->range[patch][0] - 1e-6, (double)patches->range[patch][1] + 1e-6,
              &enter, &leave))
        return false;
    int i = (int)sv_clamp(floor(r.i + enter * r.di), i0, i1 - 1);
    int j = (int)sv_clamp(floor(r.j + enter * r.dj), j0, j1 - 1);
    int step_i = r.di > 0 ? 1 : -1, step_j = r.dj > 0 ? 1 : -1;
    double next_i = r.di == 0 ? INFINITY : (i + (step_i > 0) - r.i) / r.di;
    double next_j = r.dj == 0 ? INFINITY : (j + (step_j > 0) - r.j) / r.dj;
    double delta_i = r.di == 0 ? INFINITY : fabs(1 / r.di), delta_j = r.dj == 0 ? INFINITY : fabs(1 / r.dj);
    for (int k = 0; k < 4 * CELLS; k++) {
        if (cell_hit(f, &r, i, j, t_min, t_max, t))
            return true; /* cells are met in order of t: the first crossing is the nearest */
        if (fmin(next_i, next_j) > leave)
            return false;
        if (next_i < next_j) {
            i += step_i;
            next_i += delta_i;
            if (i < i0 || i >= i1)
                return false;
        } else {
            j += step_j;
            next_j += delta_j;
            if (j < j0 || j >= j1)
                return false;
        }
    }
    return false;
}

static void bounds(const struct RTCBoundsFunctionArguments *args)
{
    const struct sv_terrain_patches *p = args->geometryUserPtr;
    const struct sv_heightfield *f = p->field;
    int column = (int)(args->primID % (unsigned)p->columns), row = (int)(args->primID / (unsigned)p->columns);
    int i1 = (column + 1) * CELLS < f->width - 1 ? (column + 1) * CELLS : f->width - 1;
    int j1 = (row + 1) * CELLS < f->height - 1 ? (row + 1) * CELLS : f->height - 1;
    double x0 = f->x0 - p->origin.x, y0 = f->y0 - p->origin.y, z0 = f->z0 - p->origin.z;
    const float *range = p->range[args->primID];
    /* Widened by the float steps that narrowing rays and boxes may cost (relative 2^-22 of the coordinate,
     * and 1 mm). */
    double x = x0 + column * CELLS * f->dx, x1 = x0 + i1 * f->dx, y = y0 + row * CELLS * f->dy,
           y1 = y0 + j1 * f->dy;
    double pad_x = 1e-3 + fmax(fabs(x), fabs(x1)) * 0x1p-22, pad_y = 1e-3 + fmax(fabs(y), fabs(y1)) * 0x1p-22;
    double pad_z = 1e-3 + fmax(fabs(z0 + (double)range[0]), fabs(z0 + (double)range[1])) * 0x1p-22;
    struct RTCBounds *o = args->bounds_o;
    o->lower_x = (float)(x - pad_x);
    o->upper_x = (float)(x1 + pad_x);
    o->lower_y = (float)(y - pad_y);
    o->upper_y = (float)(y1 + pad_y);
    o->lower_z = (float)(z0 + (double)range[0] - pad_z);
    o->upper_z = (float)(z0 + (double)range[1] + pad_z);
}

static void intersect(const struct RTCIntersectFunctionNArguments *args)
{
    if (args->N != 1 || !args->valid[0])
        return;
    const struct sv_patch_context *context = (const struct sv_patch_context *)(const void *)args->context;
    struct RTCRayHit *rh = (struct RTCRayHit *)(void *)args->rayhit;
    double t;
    if (!sv_terrain_patch_intersect(args->geometryUserPtr, args->primID, &context->ray, (double)rh->ray.tnear,
                                    (double)rh->ray.tfar, &t))
        return;
    rh->ray.tfar = (float)t;
    rh->hit.geomID = args->geomID;
    rh->hit.primID = args->primID;
    rh->hit.instID[0] = RTC_INVALID_GEOMETRY_ID;
    rh->hit.u = rh->hit.v = 0;
    rh->hit.Ng_x = rh->hit.Ng_y = 0;
    rh->hit.Ng_z = 1;
}

static void occluded(const struct RTCOccludedFunctionNArguments *args)
{
    if (args->N != 1 || !args->valid[0])
        return;
    const struct sv_patch_context *context = (const struct sv_patch_context *)(const void *)args->context;
    struct RTCRay *ray = (struct RTCRay *)(void *)args->ray;
    double t;
    if (sv_terrain_patch_intersect(args->geometryUserPtr, args->primID, &context->ray, (double)ray->tnear,
                                   (double)ray->tfar, &t))
        ray->tfar = -INFINITY;
}

RTCGeometry sv_terrain_patches_geometry(RTCDevice device, struct sv_terrain_patches *patches)
{
    RTCGeometry geometry = rtcNewGeometry(device, RTC_GEOMETRY_TYPE_USER);
    if (!geometry)
        return NULL;
    rtcSetGeometryUserPrimitiveCount(geometry, (unsigned)patches->columns * (unsigned)patches->rows);
    rtcSetGeometryUserData(geometry, patches);
    rtcSetGeometryBoundsFunction(geometry, bounds, NULL);
    rtcSetGeometryIntersectFunction(geometry, intersect);
    rtcSetGeometryOccludedFunction(geometry, occluded);
    rtcCommitGeometry(geometry);
    return geometry;
}
