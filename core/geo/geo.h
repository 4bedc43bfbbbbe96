/* geo.h - everything GDAL, OGR and PROJ do for a scene, behind plain C types. Only files of core/geo include GDAL.
 *
 * Call sv_geo_init once before anything else, in the scene process before any fork: it registers drivers and sets
 * GDAL_NUM_THREADS=1 (design.md section 2). Every data set is closed before a call returns. */
#ifndef SV_GEO_GEO_H
#define SV_GEO_GEO_H

#include <stdbool.h>
#include <stdint.h>

#include "core/base/arena.h"
#include "core/base/error.h"
#include "core/base/image.h"
#include "core/terrain/heightfield.h"

void sv_geo_init(void);

/* ---- coordinate systems (crs.c) ---- */

struct sv_crs; /* opaque; a projected system in metres, or "local" (no CRS known: plain metres) */
struct sv_crs_transform; /* opaque */

/* text: anything OGR's SetFromUserInput takes ("EPSG:32633", WKT, PROJ string). SV_EINVAL with OGR's reason. */
SV_MUST_CHECK enum sv_status sv_crs_create(const char *text, struct sv_crs **crs, struct sv_error *error);
/* The local system: metres, no place on Earth. */
SV_MUST_CHECK enum sv_status sv_crs_create_local(struct sv_crs **crs, struct sv_error *error);
void sv_crs_destroy(struct sv_crs *crs);
bool sv_crs_is_local(const struct sv_crs *crs);
bool sv_crs_is_geographic(const struct sv_crs *crs);
/* "EPSG:32633" when an authority code is known or can be identified, else the CRS's name, "local" for local. */
const char *sv_crs_name(const struct sv_crs *crs);
/* WKT 1, for geo tags; "" for local. */
const char *sv_crs_wkt(const struct sv_crs *crs);

/* Transform from one to another, always easting/longitude first. SV_EUNSUPPORTED when exactly one is local. */
SV_MUST_CHECK enum sv_status sv_crs_transform_create(const struct sv_crs *from, const struct sv_crs *to,
                                                     struct sv_crs_transform **transform, struct sv_error *error);
void sv_crs_transform_destroy(struct sv_crs_transform *transform);
/* false when the point cannot be transformed (then x, y untouched); NaN is false. */
bool sv_crs_transform_apply(const struct sv_crs_transform *transform, double *x, double *y);

/* Lon/lat (WGS 84, degrees) of a place in crs, and back; false for local or when PROJ refuses. */
bool sv_crs_to_lonlat(const struct sv_crs *crs, double x, double y, double *lon_deg, double *lat_deg);
bool sv_crs_from_lonlat(const struct sv_crs *crs, double lon_deg, double lat_deg, double *x, double *y);
/* Meridian convergence at (x, y): the heading of TRUE north counted clockwise from grid north, radians; 0 for local. */
double sv_crs_convergence_rad(const struct sv_crs *crs, double x, double y);

/* ---- elevation (dem.c) ---- */

struct sv_dem_options {
    const char *path;
    const char *crs;         /* for a DEM without one; NULL: none. A DEM that has one keeps its own, and it is an SV_EINVAL to contradict it */
    bool has_nodata;         /* nodata given by the scene file, on top of the file's own */
    double nodata;
    double height_unit_m;    /* 1 for metres, 0.3048 for feet; 0: the file's own unit if it states one, else metres */
};

struct sv_dem_report {
    int source_width, source_height;
    char driver[32];
    bool was_geographic;      /* and so was warped */
    uint64_t voids;           /* samples filled: nodata, NaN, infinite, -32768, beyond +-12,000 m */
    uint64_t voids_undeclared; /* of these: not declared by the file or the scene */
    bool all_void;            /* then the terrain is flat at 0 m */
};

/* Reads any GDAL raster's first band as a height field in *crs (created; caller destroys; local when nothing is known): projected metres kept as they are
 * (feet-based projections are scaled... see dem.c), geographic or non-north-up rasters warped (bilinear) to the UTM zone
 * of their centre at their own mean resolution. Voids are filled smoothly from their rim (GDAL fill, then nearest).
 * One row or column is doubled so that the field has area. Heights go to the arena, relative to field->z0.
 * SV_ENOENT, SV_EFORMAT, SV_ELIMIT (heightfield.h). */
SV_MUST_CHECK enum sv_status sv_dem_read(const struct sv_dem_options *options, struct sv_arena *arena,
                                         struct sv_heightfield *field, struct sv_crs **crs,
                                         struct sv_dem_report *report, struct sv_error *error);

/* ---- imagery (imagery.c) ---- */

struct sv_imagery_options {
    const char *path;
    int bands[3];    /* 1-based; all 0: the file's own RGB, palette, or grey */
    const char *crs; /* for imagery without one: taken to be the scene's when NULL */
};

struct sv_imagery_report {
    int source_width, source_height, bands_used[3];
    char driver[32];
    bool palette, rescaled;    /* rescaled: not bytes, or stretched 2..98 % to bytes */
    bool reduced;              /* averaged down to the texture limit */
    double covered;            /* share of the terrain's rectangle that has imagery, 0..1 */
};

/* Draws the imagery into rgba: RGBA u8 over exactly the field's rectangle, row 0 at the south, alpha 255 where there is imagery and 0
 * elsewhere (nodata, masks, outside). Size: the imagery's own resolution over that rectangle, at most max_side. Nearest for palettes, bilinear
 * or average otherwise. Heap image, caller frees. A file that does not touch the terrain is SV_EOUTSIDE. */
SV_MUST_CHECK enum sv_status sv_imagery_read(const struct sv_imagery_options *options,
                                             const struct sv_heightfield *field, const struct sv_crs *crs,
                                             int max_side, struct sv_image *rgba,
                                             struct sv_imagery_report *report, struct sv_error *error);

/* ---- vector points and polygons (vector.c) ---- */

struct sv_points_options {
    const char *path;
    const char *crs;   /* overrides/gives the file's; NULL: the file's own, for CSV the scene's */
    const char *x, *y; /* CSV columns (defaults "x", "y"); ignored for files that have geometry */
    const char *species, *height, *rotation; /* attribute names; NULL: not read. A name that the file has not is SV_ENOENT */
    const char *where; /* OGR attribute filter, NULL: all */
};

struct sv_point {
    double x, y;          /* scene CRS */
    double height_m;      /* NaN when missing or not a number */
    double rotation_deg;  /* NaN when missing */
    uint32_t species;     /* index into names[], UINT32_MAX when missing or empty */
};

struct sv_points {
    struct sv_point *items; /* heap */
    size_t count;
    char **names; /* distinct species names of the data, in order of appearance; heap */
    size_t name_count;
    uint64_t skipped; /* features without a usable point (empty geometry, not a number, not transformable) */
    bool crs_suspect; /* the file claims (or defaults to) geographic degrees but its coordinates cannot be degrees: it was read as scene metres? see vector.c */
};

/* Reads points from CSV or whatever OGR opens (multi-points count each, polygons and lines by centroid). At most
 * SV_FOREST_TREES_MAX. SV_ENOENT, SV_EFORMAT, SV_EINVAL (filter, crs), SV_ELIMIT. */
SV_MUST_CHECK enum sv_status sv_points_read(const struct sv_points_options *options, const struct sv_crs *scene_crs,
                                            struct sv_points *points, struct sv_error *error);
void sv_points_finish(struct sv_points *points);

struct sv_polygons; /* opaque: (multi)polygons in the scene's CRS */
SV_MUST_CHECK enum sv_status sv_polygons_read(const char *path, const struct sv_crs *scene_crs,
                                              struct sv_polygons **polygons, struct sv_error *error);
void sv_polygons_destroy(struct sv_polygons *polygons);
bool sv_polygons_contain(const struct sv_polygons *polygons, double x, double y);
/* The box that holds them all, scene CRS; false (nothing written) when there is no polygon. */
bool sv_polygons_bounds(const struct sv_polygons *polygons, double min[2], double max[2]);

/* ---- the sun (sun.c) ---- */

/* Sun's place for a moment (seconds since 1970 UTC) and a place, true-north azimuth clockwise, radians. NOAA/Meeus low
 * precision, within 0.01 deg for 1900..2100; refraction not added. NaN in, NaN out. */
void sv_sun_position(double unix_s, double lon_deg, double lat_deg, double *azimuth_rad, double *elevation_rad);

#endif
