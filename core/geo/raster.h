/* raster.h - what reading heights and reading imagery have in common: opening a raster, knowing where its
 * samples are, and finding the samples under places of the scene. For files of core/geo only.
 *
 * Index space: sample (pixel CENTRE) (i, j) of the file, column i from the left, row j from the top, is at
 * (i, j): 0 .. width - 1. An affine a[6] leads to the file's coordinates: x = a0 + i a1 + j a2, y = a3 + i a4
 * + j a5. AREA_OR_POINT is GDAL's affair: its geotransform is that of pixel corners in either case. */
#ifndef SV_GEO_RASTER_H
#define SV_GEO_RASTER_H

#include <gdal.h>

#include "core/geo/geo.h"

struct sv_raster {
    GDALDatasetH dataset;
    int width, height, band_count;
    double index[6]; /* affine of index space (above) */
    bool has_place; /* the file has a geotransform; else index is 1 m cells, row 0 in the north, corner at the
                       origin */
    bool has_crs;
    struct sv_crs *crs; /* the file's own or the one given for it; local when neither is there */
    char driver[32];
};

/* Opens path read-only. SV_ENOENT, SV_EFORMAT (not a raster, no band, only ground control points, degenerate
 * geotransform). */
SV_MUST_CHECK enum sv_status sv_raster_open(const char *path, struct sv_raster *raster,
                                            struct sv_error *error);
void sv_raster_close(struct sv_raster *raster);
/* Applies a CRS given for the file; SV_EINVAL when the file has another. NULL: nothing happens. */
SV_MUST_CHECK enum sv_status sv_raster_give_crs(struct sv_raster *raster, const char *path, const char *crs,
                                                struct sv_error *error);
/* x0, y0, x1, y1 of the samples' hull in the file's coordinates. */
void sv_raster_extent(const double index[6], int width, int height, double extent[4]);

/* A raster band's nodata as its own type holds it, so that == decides; false when none is declared. */
bool sv_raster_nodata(GDALRasterBandH band, double *nodata);
/* The same for a value that somebody else declares for a band of this type. */
double sv_raster_nodata_as(GDALDataType type, double nodata);
/* 1, 4, ...: the flags of a band's mask that matter: 0 none, 1 a mask of its own or alpha. */
bool sv_raster_has_mask(GDALRasterBandH band);

/* A north-up grid of samples in the scene; row 0 is the south row. */
struct sv_geo_grid {
    double x0, y0, dx, dy;
    int width, height;
};

/* From places of the scene to the file's index space. */
struct sv_raster_map {
    const struct sv_crs_transform *raster_from_scene; /* borrowed */
    double inverse[6];
    double turn,
        centre_x; /* geographic: a whole turn, and the longitude to stay within half a turn of; 0 otherwise */
};

/* index must be invertible (sv_raster_open sees to it). */
struct sv_raster_map sv_raster_map_make(const double index[6], int width, int height,
                                        const struct sv_crs *raster_crs,
                                        const struct sv_crs_transform *raster_from_scene);
/* x, y (scene) become i, j (index space) in place; NaN where there is no answer. scratch: count ints. */
void sv_raster_map_points(const struct sv_raster_map *map, size_t count, double *x, double *y, int *scratch);

enum { SV_RASTER_BAND_ROWS = 16 };
/* i and j (index space) of rows [row, row + SV_RASTER_BAND_ROWS) of the grid, as far as it reaches; u and v
 * hold width * SV_RASTER_BAND_ROWS values. PROJ is asked at every 16th sample and at each 16 x 16 cell's
 * middle; a cell where bilinear interpolation would be off by more than 0.02 samples there is computed sample
 * by sample. SV_ENOMEM. */
SV_MUST_CHECK enum sv_status sv_raster_map_band(const struct sv_raster_map *map,
                                                const struct sv_geo_grid *grid, int row, double *u, double *v,
                                                struct sv_error *error);

#endif
