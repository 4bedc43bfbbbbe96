/* dem.c - reads elevation through GDAL into a height field. Does not blend several files, and takes the first
 * band only.
 *
 * Flow: open -> system and place -> limits (before a byte of heights is read) -> heights in strips, judged
 * one by one, as floats above z0 with NaN for voids -> voids filled, in the file's own grid -> the height
 * field, straight (flips of rows and columns are exact) or warped (dem_warp.c).
 *
 * Units: a projection in feet is turned into the same projection in metres, and x, y are multiplied; heights
 * take the unit that the scene file gives, else that of the band, else that of the file's vertical system,
 * else metres. A file without any georeference (a height map as PNG) has cells of 1 m, its south-west corner
 * at (0, 0). */
#include "core/geo/dem.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "core/geo/crs.h"
#include "core/geo/gdal_trap.h"
#include "core/geo/voids.h"

/* All that lives while a DEM is read. */
struct reading {
    const char *path;
    struct sv_raster raster;
    struct sv_dem_check check;
    GDALRasterBandH band;
    bool masked;
    struct sv_dem_source source; /* after doubling; crs borrowed from raster */
    const char *why_warp;        /* NULL: straight */
    struct sv_dem_plan plan;
    float *h; /* the source's samples, row 0 in the north as in the file: arena if straight, else heap */
    bool h_on_heap;
    double z0;
    bool has_z0;
    struct sv_dem_report report;
};

static void reading_finish(struct reading *r)
{
    if (r->h_on_heap)
        free(r->h);
    sv_crs_destroy(r->plan.crs);
    sv_raster_close(&r->raster);
}

static enum sv_status check_options(const struct sv_dem_options *o, struct sv_error *error)
{
    if (!(o->height_unit_m >= 0 && o->height_unit_m <= 1e6))
        return sv_fail(error, SV_EINVAL, "height_unit_m",
                       "%g: must be above 0 and at most 1e6 m (0: the file's own)", o->height_unit_m);
    return SV_OK;
}

static enum sv_status check_size(const struct reading *r, struct sv_error *error)
{
    int w = r->raster.width, h = r->raster.height;
    if (w > SV_HEIGHTFIELD_SIDE_MAX || h > SV_HEIGHTFIELD_SIDE_MAX ||
        (size_t)w * (size_t)h > SV_HEIGHTFIELD_SAMPLES_MAX)
        return sv_fail(
            error, SV_ELIMIT, r->path,
            "%s: %d x %d samples; at most %d a side and %zu in all (cut or average it, e.g. gdalwarp -tr)",
            r->path, w, h, SV_HEIGHTFIELD_SIDE_MAX, SV_HEIGHTFIELD_SAMPLES_MAX);
    return SV_OK;
}

/* Metres in a unit of height: what the scene says, else what the file says. */
static double height_unit(const struct reading *r, const struct sv_dem_options *o)
{
    if (o->height_unit_m > 0)
        return o->height_unit_m;
    double unit = sv_dem_unit_m(GDALGetRasterUnitType(r->band));
    OGRSpatialReferenceH srs = GDALGetSpatialRef(r->raster.dataset);
    if (unit == 0 && srs && OSRIsCompound(srs))
        unit = OSRGetTargetLinearUnits(srs, "VERT_CS", NULL);
    return unit > 0 ? unit : 1;
}

static void prepare_check(struct reading *r, const struct sv_dem_options *o)
{
    struct sv_dem_check *c = &r->check;
    int has = 0;
    double scale = GDALGetRasterScale(r->band, &has);
    if (!has || !isfinite(scale) || scale == 0)
        scale = 1;
    double offset = GDALGetRasterOffset(r->band, &has);
    if (!has || !isfinite(offset))
        offset = 0;
    double unit = height_unit(r, o);
    c->plain = scale == 1 && offset == 0;
    c->scale_m = scale * unit;
    c->offset_m = offset * unit;
    c->has_nodata[0] = sv_raster_nodata(r->band, &c->nodata[0]);
    c->has_nodata[1] = o->has_nodata;
    c->nodata[1] = sv_raster_nodata_as(GDALGetRasterDataType(r->band), o->nodata);
    r->masked = sv_raster_has_mask(r->band);
    r->report.height_unit_m = unit;
}

/* A raster of one column (row) is one of two, half a cell to either side: then it has the area that its cells
 * had. */
static void prepare_source(struct reading *r)
{
    struct sv_dem_source *s = &r->source;
    *s = (struct sv_dem_source){.width = r->raster.width, .height = r->raster.height, .crs = r->raster.crs};
    memcpy(s->index, r->raster.index, sizeof s->index);
    if (s->width == 1) {
        s->index[0] -= 0.5 * s->index[1];
        s->index[3] -= 0.5 * s->index[4];
        s->width = 2;
    }
    if (s->height == 1) {
        s->index[0] -= 0.5 * s->index[2];
        s->index[3] -= 0.5 * s->index[5];
        s->height = 2;
    }
}

/* Degrees without a system, read as metres, would give a world a metre wide: worth a warning. */
static bool looks_like_degrees(const struct reading *r)
{
    double extent[4];
    sv_raster_extent(r->source.index, r->source.width, r->source.height, extent);
    double cell = fabs(r->source.index[1]);
    return sv_crs_is_local(r->raster.crs) && r->raster.has_place && extent[0] >= -180.5 &&
           extent[2] <= 360.5 && extent[1] >= -90.5 && extent[3] <= 90.5 && cell < 0.1 &&
           (extent[2] - extent[0]) < 60;
}

/* ---- heights ---- */

/* Judges one row of raw values into out; NaN for voids. */
static void judge_row(struct reading *r, const double *raw, const uint8_t *mask, int n, float *out)
{
    for (int i = 0; i < n; i++) {
        double z = 0;
        enum sv_dem_value value =
            mask && !mask[i] ? SV_DEM_VOID_DECLARED : sv_dem_check_value(&r->check, raw[i], &z);
        r->report.voids += value != SV_DEM_GOOD;
        r->report.voids_undeclared += value == SV_DEM_VOID_UNDECLARED;
        if (value == SV_DEM_GOOD && !r->has_z0) {
            r->z0 = floor(z); /* a whole number: heights near it stay exact */
            r->has_z0 = true;
        }
        out[i] = value == SV_DEM_GOOD ? (float)(z - r->z0) : NAN;
    }
}

static enum sv_status read_strips(struct reading *r, int strip, double *raw, uint8_t *mask,
                                  struct sv_error *error)
{
    int w = r->raster.width, h = r->raster.height;
    struct sv_gdal_trap trap;
    enum sv_status status = SV_OK;
    sv_gdal_trap_begin(&trap);
    for (int j = 0; j < h && status == SV_OK; j += strip) {
        int rows = h - j < strip ? h - j : strip;
        CPLErr failed = GDALRasterIO(r->band, GF_Read, 0, j, w, rows, raw, w, rows, GDT_Float64, 0, 0);
        if (!failed && mask)
            failed =
                GDALRasterIO(GDALGetMaskBand(r->band), GF_Read, 0, j, w, rows, mask, w, rows, GDT_Byte, 0, 0);
        if (failed)
            status = sv_fail(error, SV_EIO, r->path, "%s: cannot read rows %d to %d: %s", r->path, j,
                             j + rows - 1, sv_gdal_trap_text(&trap, "GDAL gave no reason"));
        for (int k = 0; k < rows && status == SV_OK; k++)
            judge_row(r, raw + (size_t)k * (size_t)w, mask ? mask + (size_t)k * (size_t)w : NULL, w,
                      r->h + (size_t)(j + k) * (size_t)r->source.width);
    }
    sv_gdal_trap_end(&trap);
    return status;
}

/* Rows (and columns) that doubling added are copies. */
static void copy_doubled(struct reading *r)
{
    int w = r->source.width, h = r->source.height;
    if (r->raster.width < w)
        for (int j = 0; j < r->raster.height; j++)
            r->h[(size_t)j * 2 + 1] = r->h[(size_t)j * 2];
    if (r->raster.height < h)
        memcpy(r->h + w, r->h, (size_t)w * sizeof *r->h);
}

static enum sv_status read_heights(struct reading *r, struct sv_arena *arena, struct sv_error *error)
{
    size_t w = (size_t)r->source.width, n = w * (size_t)r->source.height;
    int block_w = 0, block_h = 0;
    GDALGetBlockSize(r->band, &block_w, &block_h);
    int strip = block_h >= 16 && block_h <= 512 ? block_h : 64;
    r->h_on_heap = r->why_warp != NULL;
    r->h = r->h_on_heap ? malloc(n * sizeof *r->h) : sv_arena_alloc(arena, n, sizeof *r->h);
    double *raw = malloc((size_t)strip * w * sizeof *raw);
    uint8_t *mask = r->masked ? malloc((size_t)strip * w) : NULL;
    enum sv_status status;
    if (!r->h || !raw || (r->masked && !mask))
        status = sv_fail(error, SV_ENOMEM, r->path, "%s: no memory for %zu heights", r->path, n);
    else
        status = read_strips(r, strip, raw, mask, error);
    free(raw);
    free(mask);
    if (status != SV_OK)
        return status;
    copy_doubled(r);
    return SV_OK;
}

static enum sv_status fill_voids(struct reading *r, struct sv_error *error)
{
    struct sv_dem_report *report = &r->report;
    size_t n = (size_t)r->source.width * (size_t)r->source.height;
    report->all_void = report->voids == (uint64_t)r->raster.width * (uint64_t)r->raster.height;
    if (report->all_void) {
        memset(r->h, 0, n * sizeof *r->h);
        r->z0 = 0;
        return SV_OK;
    }
    struct sv_voids_report filled;
    const double *a = r->source.index;
    double cell = sqrt(fabs(a[1] * a[5] - a[2] * a[4])) *
                  (sv_crs_is_geographic(r->raster.crs) ? 4.0075e7 / sv_crs_full_turn(r->raster.crs)
                   : sv_crs_is_local(r->raster.crs)    ? 1
                                                       : sv_crs_unit_m(r->raster.crs));
    enum sv_status status = sv_voids_fill(r->h, r->source.width, r->source.height, cell, &filled, error);
    if (status != SV_OK)
        return status;
    report->void_regions = filled.regions;
    report->voids_flat = filled.flat_cells;
    report->flat_level_m = filled.flat_regions ? (double)filled.flat_level + r->z0 : 0;
    return SV_OK;
}

/* ---- the height field ---- */

static void swap_rows(float *a, float *b, size_t n)
{
    for (size_t i = 0; i < n; i++) {
        float t = a[i];
        a[i] = b[i];
        b[i] = t;
    }
}

/* The source as it is, turned so that row 0 is in the south and column 0 in the west. */
static void take_straight(struct reading *r, struct sv_heightfield *f)
{
    struct sv_dem_source *s = &r->source;
    double unit = sv_crs_is_local(s->crs) ? 1 : sv_crs_unit_m(s->crs);
    size_t w = (size_t)s->width;
    double x0 = s->index[0], y0 = s->index[3];
    if (s->index[1] < 0) {
        x0 += s->index[1] * (s->width - 1);
        for (size_t j = 0; j < (size_t)s->height; j++)
            for (size_t i = 0; i < w / 2; i++)
                swap_rows(r->h + j * w + i, r->h + j * w + w - 1 - i, 1);
    }
    if (s->index[5] < 0) {
        y0 += s->index[5] * (s->height - 1);
        for (size_t j = 0; j < (size_t)s->height / 2; j++)
            swap_rows(r->h + j * w, r->h + ((size_t)s->height - 1 - j) * w, w);
    }
    *f = (struct sv_heightfield){.width = s->width,
                                 .height = s->height,
                                 .x0 = x0 * unit,
                                 .y0 = y0 * unit,
                                 .dx = fabs(s->index[1]) * unit,
                                 .dy = fabs(s->index[5]) * unit,
                                 .z0 = r->z0,
                                 .h = r->h};
}

static enum sv_status take_warped(struct reading *r, struct sv_arena *arena, struct sv_heightfield *f,
                                  struct sv_error *error)
{
    const struct sv_geo_grid *g = &r->plan.grid;
    size_t n = (size_t)g->width * (size_t)g->height;
    float *h = sv_arena_alloc(arena, n, sizeof *h);
    if (!h)
        return sv_fail(error, SV_ENOMEM, r->path, "%s: no memory for %zu heights", r->path, n);
    uint64_t outside = 0;
    enum sv_status status = sv_dem_warp(&r->source, r->h, &r->plan, h, &outside, error);
    if (status != SV_OK)
        return status;
    if (outside == n) /* a raster so small and askew that every grid sample misses it */
        memset(h, 0, n * sizeof *h);
    struct sv_voids_report filled;
    status = sv_voids_fill(h, g->width, g->height, sqrt(g->dx * g->dy), &filled, error);
    if (status != SV_OK)
        return status;
    r->report.edge_filled = outside;
    r->report.kept = r->plan.kept;
    *f = (struct sv_heightfield){.width = g->width,
                                 .height = g->height,
                                 .x0 = g->x0,
                                 .y0 = g->y0,
                                 .dx = g->dx,
                                 .dy = g->dy,
                                 .z0 = r->z0,
                                 .h = h};
    return SV_OK;
}

static void find_range(struct sv_heightfield *f)
{
    size_t n = (size_t)f->width * (size_t)f->height;
    f->h_min = INFINITY;
    f->h_max = -INFINITY;
    for (size_t k = 0; k < n; k++) {
        f->h_min = f->h[k] < f->h_min ? f->h[k] : f->h_min;
        f->h_max = f->h[k] > f->h_max ? f->h[k] : f->h_max;
    }
}

/* Opens, places and plans: all that can be refused without reading heights. */
static enum sv_status prepare(struct reading *r, const struct sv_dem_options *o, struct sv_error *error)
{
    enum sv_status status = check_options(o, error);
    if (status == SV_OK)
        status = sv_raster_open(o->path, &r->raster, error);
    if (status == SV_OK)
        status = check_size(r, error);
    if (status == SV_OK)
        status = sv_raster_give_crs(&r->raster, o->path, o->crs, error);
    if (status != SV_OK)
        return status;
    struct sv_gdal_trap trap;
    sv_gdal_trap_begin(&trap);
    r->band = GDALGetRasterBand(r->raster.dataset, 1);
    prepare_check(r, o);
    sv_gdal_trap_end(&trap);
    prepare_source(r);
    r->report.source_width = r->raster.width;
    r->report.source_height = r->raster.height;
    memcpy(r->report.driver, r->raster.driver, sizeof r->report.driver);
    r->report.was_geographic = sv_crs_is_geographic(r->raster.crs);
    r->report.looks_like_degrees = looks_like_degrees(r);
    r->report.kept = 1;
    r->report.warped = r->why_warp = sv_dem_why_warp(&r->source);
    if (r->why_warp)
        return sv_dem_plan_warp(&r->source, r->why_warp, r->path, &r->plan, error);
    return sv_crs_in_metres(r->raster.crs, &r->plan.crs, error);
}

enum sv_status sv_dem_read(const struct sv_dem_options *options, struct sv_arena *arena,
                           struct sv_heightfield *field, struct sv_crs **crs, struct sv_dem_report *report,
                           struct sv_error *error)
{
    struct reading r = {.path = options->path};
    struct sv_heightfield f = {0};
    enum sv_status status = prepare(&r, options, error);
    if (status == SV_OK)
        status = read_heights(&r, arena, error);
    if (status == SV_OK)
        status = fill_voids(&r, error);
    if (status == SV_OK && r.why_warp)
        status = take_warped(&r, arena, &f, error);
    else if (status == SV_OK)
        take_straight(&r, &f);
    if (status == SV_OK) {
        find_range(&f);
        *field = f;
        *crs = r.plan.crs;
        r.plan.crs = NULL;
        *report = r.report;
    }
    reading_finish(&r);
    return status;
}
