/* dem.h - the parts of reading a DEM that are tested and changed apart: judging values, laying a source flat.
 * For files of core/geo only. */
#ifndef SV_GEO_DEM_H
#define SV_GEO_DEM_H

#include "core/geo/raster.h"

#define SV_DEM_HEIGHT_MAX_M 12000.0

/* ---- values (dem_check.c) ---- */

struct sv_dem_check {
    bool has_nodata[2];       /* the file's and the scene's */
    double nodata[2];         /* in the band's own type */
    bool plain;               /* no scale and offset: the customary -9999 means a void, too */
    double scale_m, offset_m; /* height = raw * scale_m + offset_m */
};

enum sv_dem_value { SV_DEM_GOOD, SV_DEM_VOID_DECLARED, SV_DEM_VOID_UNDECLARED };

/* Judges one raw value and writes its height in metres when it is good. */
enum sv_dem_value sv_dem_check_value(const struct sv_dem_check *check, double raw, double *height_m);

/* Metres of a unit's name as files spell it ("m", "ft", "US survey foot", ...); 0 when it is none that we
 * know. */
double sv_dem_unit_m(const char *name);

/* ---- laying flat (dem_warp.c) ---- */

/* Samples in index space and where they are: what raster.h says, after single rows and columns were doubled.
 */
struct sv_dem_source {
    double index[6];
    int width, height;
    const struct sv_crs *crs;
};

struct sv_dem_plan {
    struct sv_crs *crs; /* owned by whoever asked */
    struct sv_geo_grid grid;
    double kept;    /* share of the source's area that lies in the grid's rectangle, 0 .. 1 */
    bool enclosing; /* the rectangle encloses the source instead of lying in it: wedges are to be filled */
};

/* NULL when the source can be taken as it is (axes along east and north up to flips, metres or feet, true to
 * scale within 5 %); else why it has to be warped: "geographic", "rotated", "axes" or "scale". */
const char *sv_dem_why_warp(const struct sv_dem_source *source);
/* Chooses the system and the grid. SV_EFORMAT (coordinates that are no place), SV_ELIMIT (too far across for
 * one flat system, or too many samples). */
SV_MUST_CHECK enum sv_status sv_dem_plan_warp(const struct sv_dem_source *source, const char *why,
                                              const char *path, struct sv_dem_plan *plan,
                                              struct sv_error *error);
/* Bilinear samples of h (source, row 0 in the north as in the file, no NaN) on the plan's grid; what lies
 * outside the source becomes NaN and is counted. */
SV_MUST_CHECK enum sv_status sv_dem_warp(const struct sv_dem_source *source, const float *h,
                                         const struct sv_dem_plan *plan, float *out, uint64_t *outside,
                                         struct sv_error *error);

#endif
