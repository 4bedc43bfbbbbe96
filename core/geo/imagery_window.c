/* imagery_window.c - reads part of a raster as RGBA bytes: bands chosen, palettes looked up, other types
 * stretched, holes found.
 *
 * A pixel is a hole where the file's mask or alpha says so, where every band used that declares nodata has it
 * (a photo with nodata 255 in each band keeps its reds), where a value is not finite, and where a palette has
 * no such entry or a transparent one. But a photo whose nodata is a colour that cameras see (white 255, black
 * 0) has specks of it that are no holes: regions of under SPECK pixels that do not reach the file's border
 * keep that colour. */
#include "core/geo/imagery.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "core/geo/gdal_trap.h"

enum { STRETCH_SAMPLES = 1 << 20, SPECK = 1024 /* pixels; a glint or a shadow, not a missing tile */ };

/* ---- bands ---- */

static int find_interpretation(const struct sv_raster *r, GDALColorInterp wanted)
{
    for (int b = 1; b <= r->band_count; b++)
        if (GDALGetRasterColorInterpretation(GDALGetRasterBand(r->dataset, b)) == wanted)
            return b;
    return 0;
}

enum sv_status sv_imagery_choose_bands(const struct sv_raster *r, const struct sv_imagery_options *o,
                                       struct sv_imagery_report *report, struct sv_error *error)
{
    int *used = report->bands_used;
    if (o->bands[0] || o->bands[1] || o->bands[2]) {
        for (int k = 0; k < 3; k++) {
            if (o->bands[k] < 1 || o->bands[k] > r->band_count)
                return sv_fail(error, SV_EINVAL, "imagery_bands", "%s: has no band %d; it has bands 1 .. %d",
                               o->path, o->bands[k], r->band_count);
            used[k] = o->bands[k];
        }
        return SV_OK;
    }
    const int rgb[3] = {find_interpretation(r, GCI_RedBand), find_interpretation(r, GCI_GreenBand),
                        find_interpretation(r, GCI_BlueBand)};
    int alpha = find_interpretation(r, GCI_AlphaBand);
    int colours = r->band_count - (alpha ? 1 : 0);
    if (rgb[0] && rgb[1] && rgb[2]) {
        memcpy(used, rgb, sizeof rgb);
    } else if (GDALGetRasterColorTable(GDALGetRasterBand(r->dataset, 1))) {
        used[0] = used[1] = used[2] = 1;
        report->palette = true;
    } else {
        for (int k = 0; k < 3; k++)
            used[k] = colours >= 3 ? k + 1 : 1;
    }
    return SV_OK;
}

/* ---- reading ---- */

/* What is in reading.holes beside a count of bands: met by the flood that is under way, a speck, a hole by
 * nodata, any other hole. */
enum { FLOODED = 252, SPECKLE = 253, HOLE = 254, HOLE_FOR_SURE = 255 };

struct reading {
    const struct sv_raster *raster;
    struct sv_imagery_window *w;
    GDALRasterIOExtraArg how; /* resampling */
    uint8_t *holes;           /* a pixel: the number of bands at nodata, or a state (below) */
    int declaring;            /* bands used that declare nodata */
};

static CPLErr read_part(const struct reading *r, GDALRasterBandH band, void *to, GDALDataType type,
                        GSpacing pixel)
{
    const struct sv_imagery_window *w = r->w;
    GDALRasterIOExtraArg how = r->how;
    return GDALRasterIOEx(band, GF_Read, w->x, w->y, w->span_x, w->span_y, to, w->width, w->height, type,
                          pixel, pixel * w->width, &how);
}

static bool is_nodata(double value, double nodata)
{
    return value == nodata || (isnan(value) && isnan(nodata));
}

static CPLErr read_bytes(struct reading *r, GDALRasterBandH band, int channel)
{
    size_t n = (size_t)r->w->width * (size_t)r->w->height;
    uint8_t *to = r->w->rgba + channel;
    CPLErr failed = read_part(r, band, to, GDT_Byte, 4);
    double nodata;
    if (failed || !sv_raster_nodata(band, &nodata))
        return failed;
    r->declaring++;
    for (size_t k = 0; k < n; k++)
        r->holes[k] += is_nodata(to[4 * k], nodata);
    return CE_None;
}

static int by_value(const void *a, const void *b)
{
    float x = *(const float *)a, y = *(const float *)b;
    return (x > y) - (x < y);
}

/* 2nd and 98th percentile of what is neither nodata nor infinite, from at most STRETCH_SAMPLES values; 0, 0
 * for none. */
static bool percentiles(const double *v, size_t n, bool has_nodata, double nodata, double range[2])
{
    size_t step = n / STRETCH_SAMPLES + 1, count = 0;
    float *some = malloc((n / step + 1) * sizeof *some);
    if (!some)
        return false;
    for (size_t k = 0; k < n; k += step)
        if (isfinite(v[k]) && !(has_nodata && is_nodata(v[k], nodata)))
            some[count++] = (float)v[k];
    qsort(some, count, sizeof *some, by_value);
    range[0] = count ? (double)some[(size_t)(0.02 * (double)(count - 1) + 0.5)] : 0;
    range[1] = count ? (double)some[(size_t)(0.98 * (double)(count - 1) + 0.5)] : 0;
    free(some);
    return true;
}

static CPLErr read_stretched(struct reading *r, GDALRasterBandH band, int channel, double *scratch,
                             double range[2])
{
    size_t n = (size_t)r->w->width * (size_t)r->w->height;
    CPLErr failed = read_part(r, band, scratch, GDT_Float64, 8);
    if (failed)
        return failed;
    double nodata = 0;
    bool has = sv_raster_nodata(band, &nodata);
    r->declaring += has;
    if (!percentiles(scratch, n, has, nodata, range))
        return CE_Failure;
    double gain = range[1] > range[0] ? 255 / (range[1] - range[0]) : 0;
    for (size_t k = 0; k < n; k++) {
        double v = scratch[k];
        if (has && is_nodata(v, nodata))
            r->holes[k]++;
        else if (!isfinite(v))
            r->holes[k] = HOLE_FOR_SURE;
        double level = gain > 0 ? (v - range[0]) * gain : 128; /* one value all over: mid grey */
        r->w->rgba[4 * k + (size_t)channel] = (uint8_t)(level > 0 ? level < 255 ? level + 0.5 : 255 : 0);
    }
    return CE_None;
}

static CPLErr read_palette(struct reading *r, GDALRasterBandH band, double *scratch)
{
    size_t n = (size_t)r->w->width * (size_t)r->w->height;
    CPLErr failed = read_part(r, band, scratch, GDT_Float64, 8);
    GDALColorTableH table = GDALGetRasterColorTable(band);
    double nodata = 0;
    bool has = sv_raster_nodata(band, &nodata);
    int entries = table ? GDALGetColorEntryCount(table) : 0;
    for (size_t k = 0; !failed && k < n; k++) {
        double v = scratch[k];
        GDALColorEntry e = {0, 0, 0, 0};
        uint8_t *to = r->w->rgba + 4 * k;
        if (v >= 0 && v < entries && !(has && is_nodata(v, nodata)))
            GDALGetColorEntryAsRGB(table, (int)v, &e);
        to[0] = (uint8_t)e.c1;
        to[1] = (uint8_t)e.c2;
        to[2] = (uint8_t)e.c3;
        if (e.c4 < 128)
            r->holes[k] = HOLE_FOR_SURE;
    }
    return failed;
}

/* The bands in turn; a band used twice is read once. */
static CPLErr read_bands(struct reading *r, struct sv_imagery_report *report, double *scratch)
{
    const int *used = report->bands_used;
    size_t n = (size_t)r->w->width * (size_t)r->w->height;
    if (report->palette)
        return read_palette(r, GDALGetRasterBand(r->raster->dataset, used[0]), scratch);
    for (int c = 0; c < 3; c++) {
        int same = c > 0 && used[c] == used[c - 1] ? c - 1 : c > 1 && used[c] == used[0] ? 0 : -1;
        if (same >= 0) {
            for (size_t k = 0; k < n; k++)
                r->w->rgba[4 * k + (size_t)c] = r->w->rgba[4 * k + (size_t)same];
            memcpy(report->stretch[c], report->stretch[same], sizeof report->stretch[c]);
            continue;
        }
        GDALRasterBandH band = GDALGetRasterBand(r->raster->dataset, used[c]);
        CPLErr failed = report->rescaled ? read_stretched(r, band, c, scratch, report->stretch[c])
                                         : read_bytes(r, band, c);
        if (failed)
            return failed;
    }
    return CE_None;
}

/* Floods from `seed` until SPECK pixels are met, the file's border, or what is known to be a hole: then all
 * flooded are holes, too, else they are a speck. Every pixel is flooded once, so the whole is linear. */
static void flood_speck(struct reading *r, uint32_t seed)
{
    uint32_t queue[SPECK];
    size_t count = 0;
    int width = r->w->width, height = r->w->height;
    bool hole = false;
    queue[count++] = seed;
    r->holes[seed] = FLOODED;
    for (size_t next = 0; next < count && !hole; next++) {
        int i = (int)(queue[next] % (uint32_t)width), j = (int)(queue[next] / (uint32_t)width);
        for (int k = 0; k < 8 && !hole; k++) {
            static const int di[8] = {-1, 1, 0, 0, -1, 1, -1, 1}, dj[8] = {0, 0, -1, 1, -1, -1, 1, 1};
            int x = i + di[k], y = j + dj[k];
            if (x < 0 || y < 0 || x >= width || y >= height) {
                /* the border of the part that was read is only the file's where the part reaches it */
                hole = (x < 0 && r->w->x == 0) || (y < 0 && r->w->y == 0) ||
                       (x >= width && r->w->x + r->w->span_x == r->raster->width) ||
                       (y >= height && r->w->y + r->w->span_y == r->raster->height);
                continue;
            }
            uint32_t at = (uint32_t)y * (uint32_t)width + (uint32_t)x;
            if (r->holes[at] == HOLE || r->holes[at] == HOLE_FOR_SURE)
                hole = true;
            if (r->holes[at] != r->declaring)
                continue;
            hole = hole || count == SPECK;
            if (!hole) {
                r->holes[at] = FLOODED;
                queue[count++] = at;
            }
        }
    }
    for (size_t k = 0; k < count; k++)
        r->holes[queue[k]] = hole ? HOLE : SPECKLE;
}

static void find_specks(struct reading *r, struct sv_imagery_report *report)
{
    size_t n = (size_t)r->w->width * (size_t)r->w->height;
    if (r->declaring == 0 || report->palette || report->rescaled)
        return;
    for (size_t k = 0; k < n; k++)
        if (r->holes[k] == r->declaring)
            flood_speck(r, (uint32_t)k);
    for (size_t k = 0; k < n; k++)
        report->specks += r->holes[k] == SPECKLE;
}

static CPLErr read_holes(struct reading *r, struct sv_imagery_report *report)
{
    size_t n = (size_t)r->w->width * (size_t)r->w->height;
    GDALRasterBandH first = GDALGetRasterBand(r->raster->dataset, report->bands_used[0]);
    bool masked = sv_raster_has_mask(first);
    CPLErr failed = masked ? read_part(r, GDALGetMaskBand(first), r->w->rgba + 3, GDT_Byte, 4) : CE_None;
    find_specks(r, report);
    for (size_t k = 0; !failed && k < n; k++) {
        uint8_t *p = r->w->rgba + 4 * k, state = r->holes[k];
        bool hole = state >= HOLE || (r->declaring > 0 && state == r->declaring) || (masked && p[3] < 128);
        p[3] = hole ? 0 : 255;
    }
    return failed;
}

enum sv_status sv_imagery_read_window(const struct sv_raster *raster, const char *path,
                                      struct sv_imagery_window *w, struct sv_imagery_report *report,
                                      const struct sv_gdal_trap *trap, struct sv_error *error)
{
    struct reading r = {.raster = raster, .w = w};
    INIT_RASTERIO_EXTRA_ARG(r.how);
    bool shrunk = w->width < w->span_x || w->height < w->span_y;
    r.how.eResampleAlg = !shrunk ? GRIORA_NearestNeighbour : report->palette ? GRIORA_Mode : GRIORA_Average;
    for (int c = 0; c < 3; c++)
        report->rescaled |=
            !report->palette &&
            GDALGetRasterDataType(GDALGetRasterBand(raster->dataset, report->bands_used[c])) != GDT_Byte;
    size_t n = (size_t)w->width * (size_t)w->height;
    double *scratch = report->palette || report->rescaled ? malloc(n * sizeof *scratch) : NULL;
    r.holes = calloc(n, 1);
    w->rgba = malloc(4 * n);
    enum sv_status status = SV_OK;
    if (!r.holes || !w->rgba || ((report->palette || report->rescaled) && !scratch))
        status =
            sv_fail(error, SV_ENOMEM, path, "%s: no memory for %d x %d pixels", path, w->width, w->height);
    else if (read_bands(&r, report, scratch) != CE_None || read_holes(&r, report) != CE_None)
        status = sv_fail(error, SV_EIO, path, "%s: cannot read its pixels: %s", path,
                         sv_gdal_trap_text(trap, "GDAL gave no reason"));
    free(scratch);
    free(r.holes);
    if (status != SV_OK) {
        free(w->rgba);
        w->rgba = NULL;
    }
    return status;
}
