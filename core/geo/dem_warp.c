/* dem_warp.c - brings a DEM in degrees, or one that lies askew, on a north-up grid in metres. See dem.h.
 *
 * The grid is square, its cell the square root of a source cell's area at the centre, so that the number of
 * samples stays. Its rectangle is the largest that fits INTO the source's outline: at the edges slivers are
 * cut off rather than terrain invented. Only where less than KEPT_MIN of the area would be left (a raster
 * turned by 45 degrees, a narrow strip) the rectangle encloses the outline, and the caller fills and counts
 * the wedges. Voids are filled before: nothing here knows them. */
#include "core/geo/dem.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "core/base/vec.h"
#include "core/geo/crs.h"

enum { LATTICE = 257, EDGE = 64, SIDE_PROBES = 129 };
static const double KEPT_MIN = 0.6;
static const double SPAN_MAX_DEG = 20,
                    POLAR_SPAN_MAX_DEG =
                        30; /* from the centre: UTM then stretches by up to 6 %, UPS by 7 % */
static const double SCALE_OFF_MAX =
    0.05; /* national grids stay within 3.5 %; Web Mercator passes 5 % at 18 degrees of latitude */

/* ---- does it need warping? ---- */

static void place(const struct sv_dem_source *s, double i, double j, double *x, double *y)
{
    *x = s->index[0] + i * s->index[1] + j * s->index[2];
    *y = s->index[3] + i * s->index[4] + j * s->index[5];
}

static double ground_distance_m(double lon0, double lat0, double lon1, double lat1)
{
    double a = sin(sv_radians(lat1 - lat0) / 2), b = sin(sv_radians(lon1 - lon0) / 2);
    double h = a * a + cos(sv_radians(lat0)) * cos(sv_radians(lat1)) * b * b;
    return 2 * 6371008.8 * asin(sqrt(fmin(h, 1)));
}

/* Compares 200 m steps east and north of the centre in the source's system with the ground. */
static const char *judge_projected(const struct sv_crs *crs, double x, double y)
{
    double lon, lat, e[2], n[2];
    const double step = 200 / sv_crs_unit_m(crs);
    if (!sv_crs_to_lonlat(crs, x, y, &lon, &lat) || !sv_crs_to_lonlat(crs, x + step, y, &e[0], &e[1]) ||
        !sv_crs_to_lonlat(crs, x, y + step, &n[0], &n[1]))
        return NULL; /* out of the projection's reach: take the numbers as they are */
    double east[2] = {remainder(e[0] - lon, 360), e[1] - lat},
           north[2] = {remainder(n[0] - lon, 360), n[1] - lat};
    bool polar = fabs(lat) >= 60; /* polar grids may well have south up */
    if (east[0] * north[1] - east[1] * north[0] < 0 || (!polar && north[1] < 0))
        return "axes"; /* mirrored (south and west axes), or upside down */
    double kx = 200 / ground_distance_m(lon, lat, e[0], e[1]),
           ky = 200 / ground_distance_m(lon, lat, n[0], n[1]);
    if (fabs(kx - 1) > SCALE_OFF_MAX || fabs(ky - 1) > SCALE_OFF_MAX)
        return "scale";
    return NULL;
}

const char *sv_dem_why_warp(const struct sv_dem_source *s)
{
    if (sv_crs_is_geographic(s->crs))
        return "geographic";
    if (!sv_crs_is_local(s->crs)) {
        double x, y;
        place(s, 0.5 * (s->width - 1), 0.5 * (s->height - 1), &x, &y);
        const char *why = judge_projected(s->crs, x, y);
        if (why)
            return why;
    }
    /* a skew that moves no sample by more than a thousandth of a cell is rounding in somebody's world file */
    const double *a = s->index;
    double skew_x = fabs(a[2]) * s->height, skew_y = fabs(a[4]) * s->width;
    return skew_x > 1e-3 * fabs(a[1]) || skew_y > 1e-3 * fabs(a[5]) ? "rotated" : NULL;
}

/* ---- the outline, in the target's system ---- */

struct outline {
    struct sv_raster_map map; /* borrows the transform below */
    struct sv_crs_transform *source_from_flat, *flat_from_source;
    int width, height;
    bool periodic; /* a whole turn of longitude: no left and right border */
    bool pole[2];  /* and its first, its last row stands half a cell off a pole: the disc within belongs to it
                    */
    double box[4];
    double area; /* of the inside, m2 */
};

static void outline_finish(struct outline *o)
{
    sv_crs_transform_destroy(o->source_from_flat);
    sv_crs_transform_destroy(o->flat_from_source);
}

static bool inside(const struct outline *o, double i, double j, double slack)
{
    bool across = o->periodic || (i >= -slack && i <= o->width - 1 + slack);
    return across && j >= (o->pole[0] ? -0.75 : -slack) &&
           j <= o->height - 1 + (o->pole[1] ? 0.75 : slack); /* false for NaN */
}

/* Ready for questions from places of the flat system; nothing else of *o is set. */
static enum sv_status outline_map(struct outline *o, const struct sv_dem_source *s, const struct sv_crs *flat,
                                  struct sv_error *error)
{
    *o = (struct outline){.width = s->width, .height = s->height};
    enum sv_status status = sv_crs_transform_create(flat, s->crs, &o->source_from_flat, error);
    if (status != SV_OK)
        return status;
    o->map = sv_raster_map_make(s->index, s->width, s->height, s->crs, o->source_from_flat);
    const double *a = s->index;
    double step = fabs(a[1]), quarter = o->map.turn / 4;
    o->periodic =
        o->map.turn > 0 && a[2] == 0 && a[4] == 0 && fabs(step * s->width - o->map.turn) < 0.5 * step;
    o->pole[0] = o->periodic && fabs(a[3]) > quarter - 0.75 * fabs(a[5]);
    o->pole[1] = o->periodic && fabs(a[3] + (s->height - 1) * a[5]) > quarter - 0.75 * fabs(a[5]);
    return SV_OK;
}

/* True if `count` places evenly spaced from (x0, y0) to (x1, y1) lie inside. */
static bool segment_inside(const struct outline *o, double x0, double y0, double x1, double y1)
{
    double x[SIDE_PROBES], y[SIDE_PROBES];
    int scratch[SIDE_PROBES];
    for (int k = 0; k < SIDE_PROBES; k++) {
        double t = k / (double)(SIDE_PROBES - 1);
        x[k] = x0 + t * (x1 - x0);
        y[k] = y0 + t * (y1 - y0);
    }
    sv_raster_map_points(&o->map, SIDE_PROBES, x, y, scratch);
    for (int k = 0; k < SIDE_PROBES; k++)
        if (!inside(o, x[k], y[k], 1e-3))
            return false;
    return true;
}

/* Distance from the centre of a flat system, in degrees on the sphere: for UPS from the pole. */
static double span_deg(double lon0, double lat0, double lon, double lat)
{
    bool polar = lat0 >= 84 || lat0 < -80;
    if (polar)
        return lat0 > 0 ? 90 - lat : 90 + lat;
    return sv_degrees(ground_distance_m(lon0, lat0, lon, lat) / 6371008.8);
}

/* Walks the source's border: bounding box in the flat system, and that it is a place and not too far across.
 */
static enum sv_status walk_border(struct outline *o, const struct sv_dem_source *s, const struct sv_crs *flat,
                                  const char *path, struct sv_error *error)
{
    double lon0 = 0, lat0 = 0, x, y;
    bool on_earth = !sv_crs_is_local(s->crs);
    place(s, 0.5 * (s->width - 1), 0.5 * (s->height - 1), &x, &y);
    if (on_earth && !sv_crs_to_lonlat(s->crs, x, y, &lon0, &lat0))
        return sv_fail(error, SV_EFORMAT, path, "%s: its centre (%g, %g) is no place in %s", path, x, y,
                       sv_crs_name(s->crs));
    bool polar = lat0 >= 84 || lat0 < -80;
    double limit = polar ? POLAR_SPAN_MAX_DEG : SPAN_MAX_DEG;
    o->box[0] = o->box[1] = INFINITY;
    o->box[2] = o->box[3] = -INFINITY;
    for (int k = 0; k < 4 * EDGE; k++) {
        double t = (k % EDGE) / (double)EDGE, w = s->width - 1, h = s->height - 1, lon, lat;
        const double corner[4][2] = {{t * w, 0}, {w, t * h}, {(1 - t) * w, h}, {0, (1 - t) * h}};
        place(s, corner[k / EDGE][0], corner[k / EDGE][1], &x, &y);
        double u = x, v = y;
        if (on_earth && (!sv_crs_to_lonlat(s->crs, x, y, &lon, &lat) || !(fabs(lat) <= 90)))
            return sv_fail(error, SV_EFORMAT, path, "%s: (%g, %g) at its border is no place in %s", path, x,
                           y, sv_crs_name(s->crs));
        if (on_earth && !(span_deg(lon0, lat0, lon, lat) <= limit))
            return sv_fail(error, SV_ELIMIT, path,
                           "%s: reaches %.1f degrees from its centre; one flat system holds at most %g", path,
                           span_deg(lon0, lat0, lon, lat), limit);
        if (!sv_crs_transform_apply(o->flat_from_source, &u, &v))
            return sv_fail(error, SV_EFORMAT, path, "%s: (%g, %g) at its border has no place in %s", path, x,
                           y, sv_crs_name(flat));
        o->box[0] = fmin(o->box[0], u);
        o->box[1] = fmin(o->box[1], v);
        o->box[2] = fmax(o->box[2], u);
        o->box[3] = fmax(o->box[3], v);
    }
    return SV_OK;
}

static enum sv_status outline_init(struct outline *o, const struct sv_dem_source *s,
                                   const struct sv_crs *flat, const char *path, struct sv_error *error)
{
    enum sv_status status = outline_map(o, s, flat, error);
    if (status == SV_OK)
        status = sv_crs_transform_create(s->crs, flat, &o->flat_from_source, error);
    if (status != SV_OK)
        return status;
    return walk_border(o, s, flat, path, error);
}

/* ---- the largest rectangle inside ---- */

/* Largest rectangle of set nodes in a mask of LATTICE x LATTICE nodes: stack of rising column heights, row by
 * row. The answer counts nodes: columns c0 .. c1, rows r0 .. r1, both ends in. False when there is none of 2
 * x 2 or more. */
static bool largest_rectangle(const uint8_t *mask, int *c0, int *r0, int *c1, int *r1)
{
    int height[LATTICE + 1] = {0}, stack[LATTICE + 1];
    long best = 0;
    for (int r = 0; r < LATTICE; r++) {
        int top = 0;
        for (int c = 0; c < LATTICE; c++)
            height[c] = mask[r * LATTICE + c] ? height[c] + 1 : 0;
        height[LATTICE] = 0;
        for (int c = 0; c <= LATTICE; c++) {
            while (top > 0 && height[stack[top - 1]] >= height[c]) {
                int h = height[stack[--top]], left = top > 0 ? stack[top - 1] + 1 : 0;
                long area = (long)(h - 1) * (c - 1 - left);
                if (area > best) {
                    best = area;
                    *c0 = left;
                    *c1 = c - 1;
                    *r0 = r - h + 1;
                    *r1 = r;
                }
            }
            stack[top++] = c;
        }
    }
    return best > 0;
}

/* Moves side k of the rectangle (x0, y0, x1, y1) outwards by up to `reach`, as far as it stays inside. */
static void push_side(const struct outline *o, double rect[4], int k, double reach)
{
    double lo = 0, hi = reach, sign = k < 2 ? -1 : 1, at = rect[k];
    for (int step = 0; step < 24; step++) {
        double mid = 0.5 * (lo + hi), r[4] = {rect[0], rect[1], rect[2], rect[3]};
        r[k] = at + sign * mid;
        bool ok = k % 2 == 0 ? segment_inside(o, r[k], r[1], r[k], r[3])
                             : segment_inside(o, r[0], r[k], r[2], r[k]);
        if (ok)
            lo = mid;
        else
            hi = mid;
    }
    rect[k] = at + sign * lo;
}

static bool inscribe(struct outline *o, double rect[4])
{
    uint8_t *mask = malloc(LATTICE * LATTICE);
    double x[LATTICE], y[LATTICE];
    int scratch[LATTICE], c0 = 0, r0 = 0, c1 = 0, r1 = 0;
    if (!mask)
        return false;
    const double *b = o->box, du = (b[2] - b[0]) / (LATTICE - 1), dv = (b[3] - b[1]) / (LATTICE - 1);
    size_t in = 0;
    for (int r = 0; r < LATTICE; r++) {
        for (int c = 0; c < LATTICE; c++) {
            x[c] = b[0] + c * du;
            y[c] = b[1] + r * dv;
        }
        sv_raster_map_points(&o->map, LATTICE, x, y, scratch);
        for (int c = 0; c < LATTICE; c++)
            in += mask[r * LATTICE + c] = inside(o, x[c], y[c], 1e-3);
    }
    o->area = (double)in * du * dv;
    bool found = largest_rectangle(mask, &c0, &r0, &c1, &r1);
    free(mask);
    if (!found)
        return false;
    rect[0] = b[0] + c0 * du;
    rect[1] = b[1] + r0 * dv;
    rect[2] = b[0] + c1 * du;
    rect[3] = b[1] + r1 * dv;
    for (int k = 0; k < 4; k++)
        push_side(o, rect, k, k % 2 == 0 ? du : dv);
    return true;
}

/* ---- the plan ---- */

/* Square root of the area of a source cell at the centre, in the flat system. */
static double mean_cell(const struct outline *o, const struct sv_dem_source *s)
{
    double i = 0.5 * (s->width - 1), j = 0.5 * (s->height - 1), x[4], y[4];
    const double shift[4][2] = {{-0.5, 0}, {0.5, 0}, {0, -0.5}, {0, 0.5}};
    for (int k = 0; k < 4; k++) {
        place(s, i + shift[k][0], j + shift[k][1], &x[k], &y[k]);
        if (!sv_crs_transform_apply(o->flat_from_source, &x[k], &y[k]))
            return NAN;
    }
    return sqrt(fabs((x[1] - x[0]) * (y[3] - y[2]) - (x[3] - x[2]) * (y[1] - y[0])));
}

static enum sv_status lay_grid(const double rect[4], double cell, const char *path, struct sv_geo_grid *grid,
                               struct sv_error *error)
{
    double nx = fmax(round((rect[2] - rect[0]) / cell) + 1, 2),
           ny = fmax(round((rect[3] - rect[1]) / cell) + 1, 2);
    if (!(nx <= SV_HEIGHTFIELD_SIDE_MAX && ny <= SV_HEIGHTFIELD_SIDE_MAX &&
          nx * ny <= (double)SV_HEIGHTFIELD_SAMPLES_MAX))
        return sv_fail(error, SV_ELIMIT, path,
                       "%s: laid flat it takes %.0f x %.0f samples; at most %d a side and %zu in all", path,
                       nx, ny, SV_HEIGHTFIELD_SIDE_MAX, SV_HEIGHTFIELD_SAMPLES_MAX);
    *grid = (struct sv_geo_grid){
        rect[0], rect[1], (rect[2] - rect[0]) / (nx - 1), (rect[3] - rect[1]) / (ny - 1), (int)nx, (int)ny};
    if (!(grid->dx > 0) || !(grid->dy > 0) || !isfinite(grid->x0) || !isfinite(grid->y0))
        return sv_fail(error, SV_EFORMAT, path, "%s: its samples cover no area on the ground", path);
    return SV_OK;
}

static enum sv_status choose_system(const struct sv_dem_source *s, const char *why, const char *path,
                                    struct sv_crs **flat, struct sv_error *error)
{
    double x, y, lon, lat;
    if (!strcmp(why, "rotated"))
        return sv_crs_in_metres(s->crs, flat, error);
    place(s, 0.5 * (s->width - 1), 0.5 * (s->height - 1), &x, &y);
    if (!sv_crs_to_lonlat(s->crs, x, y, &lon, &lat) || !(fabs(lat) <= 90))
        return sv_fail(error, SV_EFORMAT, path, "%s: its centre (%g, %g) is no place in %s", path, x, y,
                       sv_crs_name(s->crs));
    return sv_crs_flat_for(lon, lat, flat, error);
}

enum sv_status sv_dem_plan_warp(const struct sv_dem_source *s, const char *why, const char *path,
                                struct sv_dem_plan *plan, struct sv_error *error)
{
    struct sv_dem_plan p = {0};
    struct outline o = {0};
    double rect[4];
    enum sv_status status = choose_system(s, why, path, &p.crs, error);
    if (status == SV_OK)
        status = outline_init(&o, s, p.crs, path, error);
    if (status != SV_OK)
        goto out;
    double cell = mean_cell(&o, s);
    if (!(cell > 0)) {
        status = sv_fail(error, SV_EFORMAT, path, "%s: its samples cover no area on the ground", path);
        goto out;
    }
    bool found = inscribe(&o, rect);
    p.kept = found ? fmin((rect[2] - rect[0]) * (rect[3] - rect[1]) / o.area, 1) : 0;
    if (p.kept < KEPT_MIN) {
        memcpy(rect, o.box, sizeof rect);
        p.enclosing = true;
        p.kept = 1;
    }
    status = lay_grid(rect, cell, path, &p.grid, error);
out:
    outline_finish(&o);
    if (status == SV_OK)
        *plan = p;
    else
        sv_crs_destroy(p.crs);
    return status;
}

/* ---- sampling ---- */

static float sample(const struct outline *o, const float *h, double u, double v)
{
    int w = o->width, n = o->height;
    if (o->periodic) { /* columns -0.5 .. w - 0.5: the last one's right neighbour is the first */
        u = u < 0 ? u + w : u;
    } else {
        u = fmin(fmax(u, 0), w - 1);
    }
    v = fmin(fmax(v, 0), n - 1);
    int i0 = (int)u, j0 = (int)v;
    int j1 = j0 + 1 < n ? j0 + 1 : j0, i1 = i0 + 1 < w ? i0 + 1 : o->periodic ? 0 : i0;
    i0 = i0 < w ? i0 : w - 1;
    double s = u - i0, t = v - j0;
    const float *a = h + (size_t)j0 * (size_t)w, *b = h + (size_t)j1 * (size_t)w;
    return (float)((1 - t) * ((1 - s) * (double)a[i0] + s * (double)a[i1]) +
                   t * ((1 - s) * (double)b[i0] + s * (double)b[i1]));
}

enum sv_status sv_dem_warp(const struct sv_dem_source *s, const float *h, const struct sv_dem_plan *plan,
                           float *out, uint64_t *outside, struct sv_error *error)
{
    const struct sv_geo_grid *g = &plan->grid;
    size_t width = (size_t)g->width;
    struct outline o = {0};
    double *u = malloc(2 * SV_RASTER_BAND_ROWS * width * sizeof *u), *v = u + SV_RASTER_BAND_ROWS * width;
    uint64_t count = 0;
    if (!u)
        return sv_fail(error, SV_ENOMEM, "", "out of memory");
    enum sv_status status = outline_map(&o, s, plan->crs, error);
    if (status != SV_OK)
        goto out;
    for (int row = 0; row < g->height; row += SV_RASTER_BAND_ROWS) {
        status = sv_raster_map_band(&o.map, g, row, u, v, error);
        if (status != SV_OK)
            goto out;
        int rows = g->height - row < SV_RASTER_BAND_ROWS ? g->height - row : SV_RASTER_BAND_ROWS;
        for (size_t k = 0; k < (size_t)rows * width; k++) {
            bool in =
                inside(&o, u[k], v[k], 0.5); /* the samples' own area: half a cell beyond the outermost */
            out[(size_t)row * width + k] = in ? sample(&o, h, u[k], v[k]) : NAN;
            count += !in;
        }
    }
    *outside = count;
out:
    outline_finish(&o);
    free(u);
    return status;
}
