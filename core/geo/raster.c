/* raster.c - see raster.h. */
#include "core/geo/raster.h"

#include <errno.h>
#include <float.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include <cpl_string.h>
#include <cpl_vsi.h>

#include "core/geo/crs.h"
#include "core/geo/gdal_trap.h"

/* Why GDALOpenEx would not: a file that is not there, one that may not be read, or one that is no raster. */
static enum sv_status open_failed(const char *path, const struct sv_gdal_trap *trap, struct sv_error *error)
{
    VSIStatBufL info;
    if (VSIStatL(path, &info) != 0 && !strchr(path, ':'))
        return sv_fail(error, SV_ENOENT, path, "%s: no such file", path);
    if (path[0] == '/' && strncmp(path, "/vsi", 4) != 0 && access(path, R_OK) != 0)
        return sv_fail(error, SV_ENOENT, path, "%s: cannot be read: %s", path, strerror(errno));
    return sv_fail(error, SV_EFORMAT, path, "%s: not a raster that GDAL reads: %s", path,
                   sv_gdal_trap_text(trap, "no driver knows it"));
}

static enum sv_status read_place(struct sv_raster *r, const char *path, struct sv_error *error)
{
    double g[6];
    if (GDALGetGeoTransform(r->dataset, g) != CE_None) {
        if (GDALGetGCPCount(r->dataset) > 0 || GDALGetMetadata(r->dataset, "RPC"))
            return sv_fail(error, SV_EFORMAT, path,
                           "%s: has ground control points or RPCs only; rectify it first (gdalwarp)", path);
        const double plain[6] = {0, 1, 0, r->height, 0, -1};
        memcpy(g, plain, sizeof g);
        r->has_place = false;
    } else {
        r->has_place = true;
    }
    double det = g[1] * g[5] - g[2] * g[4];
    for (int k = 0; k < 6; k++)
        if (!isfinite(g[k]))
            det = 0;
    if (!isfinite(det) || fabs(det) < DBL_MIN)
        return sv_fail(error, SV_EFORMAT, path,
                       "%s: its geotransform (%g, %g, %g, %g, %g, %g) gives the samples no area", path, g[0],
                       g[1], g[2], g[3], g[4], g[5]);
    memcpy(r->index, g, sizeof g);
    r->index[0] = g[0] + 0.5 * g[1] + 0.5 * g[2];
    r->index[3] = g[3] + 0.5 * g[4] + 0.5 * g[5];
    OGRSpatialReferenceH srs = GDALGetSpatialRef(r->dataset);
    enum sv_status status = sv_crs_from_srs(srs, &r->crs, error);
    if (status != SV_OK)
        return status;
    r->has_crs = !sv_crs_is_local(r->crs);
    if (sv_crs_is_local(r->crs) && srs && OSRIsLocal(srs) && r->has_place) {
        double unit =
            OSRGetLinearUnits(srs, NULL); /* a plot system in feet: made metres here, once and for all */
        for (int k = 0; k < 6 && unit > 0; k++)
            r->index[k] *= unit;
    }
    if (r->has_crs && !r->has_place)
        return sv_fail(error, SV_EFORMAT, path, "%s: has a coordinate system (%s) but no place in it", path,
                       sv_crs_name(r->crs));
    return SV_OK;
}

enum sv_status sv_raster_open(const char *path, struct sv_raster *raster, struct sv_error *error)
{
    struct sv_raster r = {0};
    struct sv_gdal_trap trap;
    enum sv_status status = SV_OK;
    sv_gdal_trap_begin(&trap);
    r.dataset = GDALOpenEx(path, GDAL_OF_RASTER | GDAL_OF_READONLY | GDAL_OF_VERBOSE_ERROR, NULL, NULL, NULL);
    if (!r.dataset) {
        status = open_failed(path, &trap, error);
        goto out;
    }
    r.width = GDALGetRasterXSize(r.dataset);
    r.height = GDALGetRasterYSize(r.dataset);
    r.band_count = GDALGetRasterCount(r.dataset);
    snprintf(r.driver, sizeof r.driver, "%s", GDALGetDriverShortName(GDALGetDatasetDriver(r.dataset)));
    char **parts = GDALGetMetadata(r.dataset, "SUBDATASETS");
    const char *part = CSLFetchNameValue(parts, "SUBDATASET_1_NAME");
    if (r.band_count < 1)
        status = part ? sv_fail(error, SV_EFORMAT, path,
                                "%s: holds several rasters; name one of them, such as %s", path, part)
                      : sv_fail(error, SV_EFORMAT, path, "%s: has no band", path);
    else
        status = read_place(&r, path, error);
out:
    sv_gdal_trap_end(&trap);
    if (status == SV_OK)
        *raster = r;
    else
        sv_raster_close(&r);
    return status;
}

void sv_raster_close(struct sv_raster *raster)
{
    struct sv_gdal_trap trap;
    sv_gdal_trap_begin(&trap);
    if (raster->dataset)
        GDALClose(raster->dataset);
    sv_gdal_trap_end(&trap);
    sv_crs_destroy(raster->crs);
    *raster = (struct sv_raster){0};
}

void sv_raster_extent(const double a[6], int width, int height, double extent[4])
{
    extent[0] = extent[1] = INFINITY;
    extent[2] = extent[3] = -INFINITY;
    for (int c = 0; c < 4; c++) {
        double i = c & 1 ? width - 1 : 0, j = c & 2 ? height - 1 : 0;
        double x = a[0] + i * a[1] + j * a[2], y = a[3] + i * a[4] + j * a[5];
        extent[0] = fmin(extent[0], x);
        extent[1] = fmin(extent[1], y);
        extent[2] = fmax(extent[2], x);
        extent[3] = fmax(extent[3], y);
    }
}

enum sv_status sv_raster_give_crs(struct sv_raster *raster, const char *path, const char *text,
                                  struct sv_error *error)
{
    if (!text)
        return SV_OK;
    struct sv_crs *given = NULL;
    enum sv_status status = sv_crs_create(text, &given, error);
    if (status != SV_OK)
        return status;
    double extent[4];
    sv_raster_extent(raster->index, raster->width, raster->height, extent);
    if (!raster->has_place) {
        status = sv_fail(error, SV_EFORMAT, path, "%s: crs %s is given, but the file has no place in it",
                         path, text);
    } else if (raster->has_crs && !sv_crs_agrees(raster->crs, given, extent)) {
        status = sv_fail(error, SV_EINVAL, "crs", "%s: crs %s is given, but the file itself says %s", path,
                         text, sv_crs_name(raster->crs));
    } else if (!raster->has_crs) {
        sv_crs_destroy(raster->crs);
        raster->crs = given;
        raster->has_crs = true;
        given = NULL;
    }
    sv_crs_destroy(given);
    return status;
}

double sv_raster_nodata_as(GDALDataType type, double nodata)
{
    if (type != GDT_Float32 && type != GDT_CFloat32)
        return nodata;
    if (isnan(nodata) || fabs(nodata) <= FLT_MAX)
        return (double)(float)nodata;
    /* "-3.4028235e+38" in a header is a rounded FLT_MAX; what is larger yet can only stand for an infinity */
    return copysign(fabs(nodata) <= FLT_MAX * (1 + 1e-6) ? FLT_MAX : INFINITY, nodata);
}

bool sv_raster_nodata(GDALRasterBandH band, double *nodata)
{
    int has = 0;
    double value;
    GDALDataType type = GDALGetRasterDataType(band);
    if (type == GDT_Int64)
        value = (double)GDALGetRasterNoDataValueAsInt64(band, &has);
    else if (type == GDT_UInt64)
        value = (double)GDALGetRasterNoDataValueAsUInt64(band, &has);
    else
        value = GDALGetRasterNoDataValue(band, &has);
    if (has)
        *nodata = sv_raster_nodata_as(type, value);
    return has != 0;
}

bool sv_raster_has_mask(GDALRasterBandH band)
{
    int flags = GDALGetMaskFlags(band);
    return !(flags & (GMF_ALL_VALID | GMF_NODATA)) && (flags & (GMF_PER_DATASET | GMF_ALPHA));
}

struct sv_raster_map sv_raster_map_make(const double a[6], int width, int height,
                                        const struct sv_crs *raster_crs,
                                        const struct sv_crs_transform *raster_from_scene)
{
    struct sv_raster_map map = {.raster_from_scene = raster_from_scene, .turn = sv_crs_full_turn(raster_crs)};
    map.centre_x = a[0] + 0.5 * (width - 1) * a[1] + 0.5 * (height - 1) * a[2];
    /* Inverted about the middle sample, not the coordinates' origin: seven-digit northings stay out of the
     * products. */
    double det = a[1] * a[5] - a[2] * a[4];
    map.inverse[0] = a[0];
    map.inverse[3] = a[3];
    map.inverse[1] = a[5] / det;
    map.inverse[2] = -a[2] / det;
    map.inverse[4] = -a[4] / det;
    map.inverse[5] = a[1] / det;
    return map;
}

void sv_raster_map_points(const struct sv_raster_map *map, size_t count, double *x, double *y, int *scratch)
{
    const double *m = map->inverse;
    sv_crs_transform_many(map->raster_from_scene, count, x, y, scratch);
    for (size_t k = 0; k < count; k++) {
        double px = x[k];
        if (map->turn > 0)
            px += map->turn * round((map->centre_x - px) / map->turn);
        double u = px - m[0], v = y[k] - m[3];
        x[k] = m[1] * u + m[2] * v;
        y[k] = m[4] * u + m[5] * v;
    }
}

/* Nodes of one band: rows `row` and `row` + 16, and the middles between, at every 16th column. */
struct nodes {
    size_t columns;
    double *x[3], *y[3]; /* first row, last row, middles */
    int *scratch;
};

static void ask(const struct sv_raster_map *map, const struct sv_geo_grid *g, double row, double column_shift,
                size_t columns, double *x, double *y, int *scratch)
{
    for (size_t c = 0; c < columns; c++) {
        x[c] = g->x0 + ((double)(c * SV_RASTER_BAND_ROWS) + column_shift) * g->dx;
        y[c] = g->y0 + row * g->dy;
    }
    sv_raster_map_points(map, columns, x, y, scratch);
}

static bool interpolable(const struct nodes *n, size_t c)
{
    const double bound =
        0.02; /* samples: at a slope of 45 degrees a height is off by 2 % of a cell at most */
    double u = 0.25 * (n->x[0][c] + n->x[0][c + 1] + n->x[1][c] + n->x[1][c + 1]);
    double v = 0.25 * (n->y[0][c] + n->y[0][c + 1] + n->y[1][c] + n->y[1][c + 1]);
    return fabs(u - n->x[2][c]) <= bound && fabs(v - n->y[2][c]) <= bound; /* false for NaN */
}

static void fill_cell(const struct sv_raster_map *map, const struct sv_geo_grid *g, const struct nodes *n,
                      int row, int rows, size_t c, double *u, double *v)
{
    enum { STEP = SV_RASTER_BAND_ROWS };
    size_t first = c * STEP, width = (size_t)g->width, end = first + STEP < width ? first + STEP : width;
    bool smooth = interpolable(n, c);
    for (int j = 0; j < rows; j++) {
        double *uj = u + (size_t)j * width, *vj = v + (size_t)j * width, t = (double)j / STEP;
        if (!smooth) {
            int scratch[STEP];
            for (size_t i = first; i < end; i++) {
                uj[i] = g->x0 + (double)i * g->dx;
                vj[i] = g->y0 + (row + j) * g->dy;
            }
            sv_raster_map_points(map, end - first, uj + first, vj + first, scratch);
            continue;
        }
        double u0 = n->x[0][c] + t * (n->x[1][c] - n->x[0][c]);
        double u1 = n->x[0][c + 1] + t * (n->x[1][c + 1] - n->x[0][c + 1]);
        double v0 = n->y[0][c] + t * (n->y[1][c] - n->y[0][c]);
        double v1 = n->y[0][c + 1] + t * (n->y[1][c + 1] - n->y[0][c + 1]);
        for (size_t i = first; i < end; i++) {
            double s = (double)(i - first) / STEP;
            uj[i] = u0 + s * (u1 - u0);
            vj[i] = v0 + s * (v1 - v0);
        }
    }
}

enum sv_status sv_raster_map_band(const struct sv_raster_map *map, const struct sv_geo_grid *grid, int row,
                                  double *u, double *v, struct sv_error *error)
{
    enum { STEP = SV_RASTER_BAND_ROWS };
    int rows = grid->height - row < STEP ? grid->height - row : STEP;
    size_t cells = ((size_t)grid->width + STEP - 1) / STEP;
    struct nodes n = {.columns = cells + 1};
    double *places = malloc(6 * n.columns * sizeof *places);
    n.scratch = malloc(n.columns * sizeof *n.scratch);
    enum sv_status status = SV_OK;
    if (!places || !n.scratch) {
        status = sv_fail(error, SV_ENOMEM, "", "out of memory");
        goto out;
    }
    for (int k = 0; k < 3; k++) {
        n.x[k] = places + (size_t)(2 * k) * n.columns;
        n.y[k] = places + (size_t)(2 * k + 1) * n.columns;
    }
    ask(map, grid, row, 0, n.columns, n.x[0], n.y[0], n.scratch);
    ask(map, grid, row + STEP, 0, n.columns, n.x[1], n.y[1], n.scratch);
    ask(map, grid, row + 0.5 * STEP, 0.5 * STEP, cells, n.x[2], n.y[2], n.scratch);
    for (size_t c = 0; c < cells; c++)
        fill_cell(map, grid, &n, row, rows, c, u, v);
out:
    free(places);
    free(n.scratch);
    return status;
}
