/* imagery.c - drapes a georeferenced picture over a height field's rectangle. Mends nothing: black is black,
 * colours are not balanced.
 *
 * Flow: open -> system -> size of the texture (the imagery's own resolution, at most max_side) -> the part of
 * the file under the terrain, read at about that resolution (imagery_window.c) -> each texel looks up its
 * place in it. Averages are of encoded values, as in the overviews that files bring along. */
#include "core/geo/imagery.h"

#include <float.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "core/geo/crs.h"
#include "core/geo/gdal_trap.h"

struct draping {
    const struct sv_imagery_options *options;
    const struct sv_heightfield *field;
    const struct sv_crs *crs;
    struct sv_raster raster;
    struct sv_crs_transform *raster_from_scene, *scene_from_raster;
    struct sv_raster_map map;
    struct sv_geo_grid grid; /* texel centres */
    struct sv_imagery_window window;
    struct sv_imagery_report report;
};

static void draping_finish(struct draping *d)
{
    free(d->window.rgba);
    sv_crs_transform_destroy(d->raster_from_scene);
    sv_crs_transform_destroy(d->scene_from_raster);
    sv_raster_close(&d->raster);
}

/* A picture without any georeference covers the terrain's rectangle from corner to corner. */
static void fit(struct draping *d)
{
    const struct sv_heightfield *f = d->field;
    double cx = (f->width - 1) * f->dx / d->raster.width, cy = (f->height - 1) * f->dy / d->raster.height;
    const double index[6] = {f->x0 + 0.5 * cx, cx, 0, sv_heightfield_y1(f) - 0.5 * cy, 0, -cy};
    memcpy(d->raster.index, index, sizeof index);
    d->report.fitted = true;
}

static enum sv_status locate(struct draping *d, struct sv_error *error)
{
    const char *path = d->options->path;
    enum sv_status status = sv_raster_give_crs(&d->raster, path, d->options->crs, error);
    if (status != SV_OK)
        return status;
    if (!d->raster.has_place && !sv_crs_is_local(d->crs))
        return sv_fail(
            error, SV_EFORMAT, path,
            "%s: has no georeference (neither geotransform nor world file), and the terrain is in %s", path,
            sv_crs_name(d->crs));
    if (!d->raster.has_place)
        fit(d);
    /* without a system of its own, the scene's */
    const struct sv_crs *own = d->raster.has_crs ? d->raster.crs : d->crs;
    struct sv_error why = {0};
    status = sv_crs_transform_create(d->crs, own, &d->raster_from_scene, &why);
    if (status == SV_OK)
        status = sv_crs_transform_create(own, d->crs, &d->scene_from_raster, &why);
    if (status != SV_OK)
        return sv_fail(error, status, path, "%s: %s", path, why.message);
    d->map =
        sv_raster_map_make(d->raster.index, d->raster.width, d->raster.height, own, d->raster_from_scene);
    const double *a = d->raster.index;
    d->report.warped = !sv_crs_transform_is_identity(d->raster_from_scene) || a[2] != 0 || a[4] != 0;
    return SV_OK;
}

/* ---- size of the texture ---- */

/* How far a pixel reaches in the scene: step[0] and step[1], the ways to the next column and the next row, at
 * the terrain's centre (or, when that is not on the imagery's system, at the imagery's). */
static bool pixel_steps(const struct draping *d, double step[2][2])
{
    const struct sv_heightfield *f = d->field;
    double x = 0.5 * (f->x0 + sv_heightfield_x1(f)), y = 0.5 * (f->y0 + sv_heightfield_y1(f));
    int scratch;
    const double *a = d->raster.index;
    sv_raster_map_points(&d->map, 1, &x, &y, &scratch);
    if (!isfinite(x) || !isfinite(y)) {
        x = 0.5 * (d->raster.width - 1);
        y = 0.5 * (d->raster.height - 1);
    }
    for (int k = 0; k < 2; k++) {
        double ends[2][2];
        for (int s = 0; s < 2; s++) {
            double i = x + (k == 0 ? s - 0.5 : 0), j = y + (k == 1 ? s - 0.5 : 0);
            ends[s][0] = a[0] + i * a[1] + j * a[2];
            ends[s][1] = a[3] + i * a[4] + j * a[5];
            if (!sv_crs_transform_apply(d->scene_from_raster, &ends[s][0], &ends[s][1]))
                return false;
        }
        step[k][0] = fabs(ends[1][0] - ends[0][0]);
        step[k][1] = fabs(ends[1][1] - ends[0][1]);
    }
    return true;
}

static int texels(double extent, double cell, int max_side, bool *reduced)
{
    double n = ceil(extent / cell - 1e-3); /* a cell of 10 cm at northings of 5e6 m is only known to 1e-8 */
    *reduced |= n > max_side;
    return n > max_side ? max_side : n >= 1 ? (int)n : 1;
}

/* Sets the grid of texels and how many of the file's pixels go into one, along its columns and rows. */
static enum sv_status choose_size(struct draping *d, int max_side, double shrink[2], struct sv_error *error)
{
    const struct sv_heightfield *f = d->field;
    double step[2][2], w = (f->width - 1) * f->dx, h = (f->height - 1) * f->dy;
    if (!pixel_steps(d, step))
        return sv_fail(error, SV_EOUTSIDE, d->options->path, "%s: does not lie on the terrain",
                       d->options->path);
    double cell_x = fmax(step[0][0], step[1][0]), cell_y = fmax(step[0][1], step[1][1]);
    struct sv_geo_grid *g = &d->grid;
    g->width = texels(w, fmax(cell_x, DBL_MIN), max_side, &d->report.reduced);
    g->height = texels(h, fmax(cell_y, DBL_MIN), max_side, &d->report.reduced);
    g->dx = w / g->width;
    g->dy = h / g->height;
    g->x0 = f->x0 + 0.5 * g->dx;
    g->y0 = f->y0 + 0.5 * g->dy;
    for (int k = 0; k < 2; k++) {
        bool along_x = step[k][0] * cell_y >= step[k][1] * cell_x;
        shrink[k] = fmax(along_x ? g->dx / cell_x : g->dy / cell_y, 1);
    }
    return SV_OK;
}

/* ---- the part of the file ---- */

/* Clips [lo - margin, hi + margin] (index space) to the pixels 0 .. count - 1; false when nothing is left. */
static bool clip(double lo, double hi, double margin, int count, int *first, int *span)
{
    double a = fmax(floor(lo - margin), 0), b = fmin(ceil(hi + margin), count - 1);
    if (!(hi >= -0.5 && lo <= count - 0.5 && a <= b))
        return false;
    *first = (int)a;
    *span = (int)(b - a) + 1;
    return true;
}

static enum sv_status choose_window(struct draping *d, const double shrink[2], struct sv_error *error)
{
    enum { PROBES = 65 };
    const struct sv_heightfield *f = d->field;
    double x[PROBES], y[PROBES], lo[2] = {INFINITY, INFINITY}, hi[2] = {-INFINITY, -INFINITY};
    int scratch[PROBES];
    for (int r = 0; r < PROBES; r++) {
        for (int c = 0; c < PROBES; c++) {
            x[c] = f->x0 + (double)c / (PROBES - 1) * (f->width - 1) * f->dx;
            y[c] = f->y0 + (double)r / (PROBES - 1) * (f->height - 1) * f->dy;
        }
        sv_raster_map_points(&d->map, PROBES, x, y, scratch);
        for (int c = 0; c < PROBES; c++) {
            if (!isfinite(x[c]) || !isfinite(y[c]))
                continue;
            lo[0] = fmin(lo[0], x[c]);
            hi[0] = fmax(hi[0], x[c]);
            lo[1] = fmin(lo[1], y[c]);
            hi[1] = fmax(hi[1], y[c]);
        }
    }
    struct sv_imagery_window *w = &d->window;
    /* bilinear needs a pixel more on each side; a curved outline may bulge a little between the probes */
    double margin_i = 2 * shrink[0] + 2 + 1e-3 * (hi[0] - lo[0]),
           margin_j = 2 * shrink[1] + 2 + 1e-3 * (hi[1] - lo[1]);
    if (!clip(lo[0], hi[0], margin_i, d->raster.width, &w->x, &w->span_x) ||
        !clip(lo[1], hi[1], margin_j, d->raster.height, &w->y, &w->span_y))
        return sv_fail(error, SV_EOUTSIDE, d->options->path, "%s: does not touch the terrain",
                       d->options->path);
    w->width = (int)fmax(ceil(w->span_x / shrink[0]), 1);
    w->height = (int)fmax(ceil(w->span_y / shrink[1]), 1);
    w->i0 = w->x;
    w->j0 = w->y;
    w->scale_i = (double)w->width / w->span_x;
    w->scale_j = (double)w->height / w->span_y;
    return SV_OK;
}

/* ---- looking up ---- */

static void nearest(const struct sv_imagery_window *w, double u, double v, uint8_t out[4])
{
    double i = fmin(fmax(floor(u + 0.5), 0), w->width - 1), j = fmin(fmax(floor(v + 0.5), 0), w->height - 1);
    memcpy(out, w->rgba + 4 * ((size_t)j * (size_t)w->width + (size_t)i), 4);
}

/* Bilinear over what is no hole; a hole where holes weigh more than half. */
static void bilinear(const struct sv_imagery_window *w, double u, double v, uint8_t out[4])
{
    u = fmin(fmax(u, 0), w->width - 1);
    v = fmin(fmax(v, 0), w->height - 1);
    int i0 = (int)u, j0 = (int)v, i1 = i0 + 1 < w->width ? i0 + 1 : i0, j1 = j0 + 1 < w->height ? j0 + 1 : j0;
    double s = u - i0, t = v - j0, sum[3] = {0, 0, 0}, solid = 0;
    const double weight[4] = {(1 - s) * (1 - t), s * (1 - t), (1 - s) * t, s * t};
    const size_t row0 = (size_t)j0 * (size_t)w->width, row1 = (size_t)j1 * (size_t)w->width;
    const size_t at[4] = {row0 + (size_t)i0, row0 + (size_t)i1, row1 + (size_t)i0, row1 + (size_t)i1};
    for (int k = 0; k < 4; k++) {
        const uint8_t *p = w->rgba + 4 * at[k];
        if (!p[3])
            continue;
        solid += weight[k];
        for (int c = 0; c < 3; c++)
            sum[c] += weight[k] * p[c];
    }
    memset(out, 0, 4);
    if (solid < 0.5)
        return;
    for (int c = 0; c < 3; c++)
        out[c] = (uint8_t)(sum[c] / solid + 0.5);
    out[3] = 255;
}

static enum sv_status look_up(const struct draping *d, uint8_t *rgba, uint64_t *inside, uint64_t *covered,
                              struct sv_error *error)
{
    const struct sv_geo_grid *g = &d->grid;
    const struct sv_imagery_window *w = &d->window;
    size_t width = (size_t)g->width;
    double *u = malloc(2 * SV_RASTER_BAND_ROWS * width * sizeof *u), *v = u + SV_RASTER_BAND_ROWS * width;
    enum sv_status status = u ? SV_OK : sv_fail(error, SV_ENOMEM, "", "out of memory");
    *inside = *covered = 0;
    for (int row = 0; status == SV_OK && row < g->height; row += SV_RASTER_BAND_ROWS) {
        status = sv_raster_map_band(&d->map, g, row, u, v, error);
        int rows = g->height - row < SV_RASTER_BAND_ROWS ? g->height - row : SV_RASTER_BAND_ROWS;
        size_t n = status == SV_OK ? (size_t)rows * width : 0;
        for (size_t k = 0; k < n; k++) {
            /* false for NaN; the slack lets a texel on the very border be in */
            if (!(u[k] >= -0.5 - 1e-6 && u[k] <= d->raster.width - 0.5 + 1e-6 && v[k] >= -0.5 - 1e-6 &&
                  v[k] <= d->raster.height - 0.5 + 1e-6))
                continue;
            uint8_t *out = rgba + 4 * ((size_t)row * width + k);
            double x = (u[k] + 0.5 - w->i0) * w->scale_i - 0.5, y = (v[k] + 0.5 - w->j0) * w->scale_j - 0.5;
            if (d->report.palette)
                nearest(w, x, y, out);
            else
                bilinear(w, x, y, out);
            if (!out[3])
                memset(out, 0, 4);
            (*inside)++;
            *covered += out[3] != 0;
        }
    }
    free(u);
    return status;
}

/* All until pixels are read. */
static enum sv_status prepare(struct draping *d, int max_side, struct sv_error *error)
{
    double shrink[2];
    if (max_side < 1 || max_side > 65536)
        return sv_fail(error, SV_EINVAL, "max_side", "%d: must be 1 .. 65536", max_side);
    enum sv_status status = sv_raster_open(d->options->path, &d->raster, error);
    if (status != SV_OK)
        return status;
    d->report.source_width = d->raster.width;
    d->report.source_height = d->raster.height;
    memcpy(d->report.driver, d->raster.driver, sizeof d->report.driver);
    status = sv_imagery_choose_bands(&d->raster, d->options, &d->report, error);
    if (status == SV_OK)
        status = locate(d, error);
    if (status == SV_OK)
        status = choose_size(d, max_side, shrink, error);
    return status == SV_OK ? choose_window(d, shrink, error) : status;
}

enum sv_status sv_imagery_read(const struct sv_imagery_options *options, const struct sv_heightfield *field,
                               const struct sv_crs *crs, int max_side, struct sv_image *rgba,
                               struct sv_imagery_report *report, struct sv_error *error)
{
    struct draping d = {.options = options, .field = field, .crs = crs};
    struct sv_image image = {0};
    struct sv_gdal_trap trap;
    uint64_t inside = 0, covered = 0;
    sv_gdal_trap_begin(&trap);
    enum sv_status status = prepare(&d, max_side, error);
    if (status == SV_OK)
        status = sv_imagery_read_window(&d.raster, options->path, &d.window, &d.report, &trap, error);
    if (status == SV_OK)
        status = sv_image_alloc(d.grid.width, d.grid.height, 4, SV_PIXEL_U8, &image, error);
    if (status == SV_OK)
        status = look_up(&d, image.data, &inside, &covered, error);
    if (status == SV_OK && inside == 0)
        status = sv_fail(error, SV_EOUTSIDE, options->path, "%s: does not touch the terrain", options->path);
    if (status == SV_OK) {
        d.report.covered = (double)covered / ((double)image.width * image.height);
        *rgba = image;
        *report = d.report;
    } else {
        sv_image_free(&image);
    }
    sv_gdal_trap_end(&trap);
    draping_finish(&d);
    return status;
}
