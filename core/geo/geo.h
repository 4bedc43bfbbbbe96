/* geo.h - everything GDAL, OGR and PROJ do for a scene, behind plain C types. Only files of core/geo include
 * GDAL.
 *
 * Call sv_geo_init once before anything else, in the scene process before any fork: it registers drivers and
 * sets GDAL_NUM_THREADS=1 (design.md section 2). Every data set is closed before a call returns. */
#ifndef SV_GEO_GEO_H
#define SV_GEO_GEO_H

#include <stdbool.h>
#include <stdint.h>

#include "core/base/arena.h"
#include "core/base/error.h"
#include "core/base/image.h"
#include "core/terrain/heightfield.h"

/* Idempotent. From then on GDAL, OGR and PROJ print nothing; PROJ never uses the network. */
void sv_geo_init(void);

/* ---- coordinate systems (crs.c) ---- */

struct sv_crs; /* opaque; projected, geographic, or "local" (no CRS known: plain metres). A scene's own is
                  projected metres or local */
struct sv_crs_transform; /* opaque */

/* text: a definition that OGR's SetFromUserInput takes ("EPSG:32633", "urn:ogc:def:crs:EPSG::32633", WKT,
 * PROJ string, PROJJSON, "WGS84"). Names of files and of hosts are refused: the text may come from a request.
 * A vertical part is dropped. SV_EINVAL with OGR's reason. */
SV_MUST_CHECK enum sv_status sv_crs_create(const char *text, struct sv_crs **crs, struct sv_error *error);
/* The local system: metres, no place on Earth. */
SV_MUST_CHECK enum sv_status sv_crs_create_local(struct sv_crs **crs, struct sv_error *error);
void sv_crs_destroy(struct sv_crs *crs);
bool sv_crs_is_local(const struct sv_crs *crs);
bool sv_crs_is_geographic(const struct sv_crs *crs);
/* Metres in a unit of a projected system: 1 for a scene's own, 0.3048... for one in feet (which may be
 * transformed from and to); 1 for local, 0 for geographic. */
double sv_crs_unit_m(const struct sv_crs *crs);
/* "EPSG:32633" when an authority code is known or can be identified, else the CRS's name, "local" for local.
 */
const char *sv_crs_name(const struct sv_crs *crs);
/* 32633 of "EPSG:32633"; 0 when the system has no EPSG code, as one that was turned from feet to metres. */
int sv_crs_epsg(const struct sv_crs *crs);
/* WKT 1, for geo tags; "" for local (and for the few systems that WKT 1 cannot say). */
const char *sv_crs_wkt(const struct sv_crs *crs);

/* Transform from one to another, always easting/longitude first; of the same system to itself it changes
 * nothing, to the last bit. SV_EUNSUPPORTED when exactly one is local, or when PROJ knows no way. */
SV_MUST_CHECK enum sv_status sv_crs_transform_create(const struct sv_crs *from, const struct sv_crs *to,
                                                     struct sv_crs_transform **transform,
                                                     struct sv_error *error);
void sv_crs_transform_destroy(struct sv_crs_transform *transform);
/* false when the point cannot be transformed (then x, y untouched); NaN is false. */
bool sv_crs_transform_apply(const struct sv_crs_transform *transform, double *x, double *y);
/* True when source and target are the same system. */
bool sv_crs_transform_is_identity(const struct sv_crs_transform *transform);

/* Lon/lat (WGS 84, degrees) of a place in crs, and back; false for local or when PROJ refuses. */
bool sv_crs_to_lonlat(const struct sv_crs *crs, double x, double y, double *lon_deg, double *lat_deg);
bool sv_crs_from_lonlat(const struct sv_crs *crs, double lon_deg, double lat_deg, double *x, double *y);
/* Where true north is: the heading of TRUE north at (x, y) counted clockwise from grid north, radians, -pi ..
 * pi; 0 for local and geographic. So heading_from_grid_north = heading_from_true_north + this. It is minus
 * the surveyors' meridian convergence: in a transverse Mercator about -(lon - lon0) sin(lat), negative (true
 * north to the left) in the north-east of a zone. */
double sv_crs_convergence_rad(const struct sv_crs *crs, double x, double y);

/* ---- elevation (dem.c) ---- */

struct sv_dem_options {
    const char *path;
    const char *crs; /* for a DEM without one; NULL: none. A DEM that has one keeps its own, and it is an
                        SV_EINVAL to contradict it */
    bool has_nodata; /* nodata given by the scene file, on top of the file's own */
    double nodata;
    double height_unit_m; /* 1 for metres, 0.3048 for feet; 0: the file's own unit if it states one, else
                             metres */
};

struct sv_dem_report {
    int source_width, source_height;
    char driver[32];
    bool was_geographic; /* the file is in degrees, and so was warped */
    const char *warped;  /* why it was warped: "geographic", "rotated", "axes" (south or west axes), "scale"
                            (Web Mercator and others that are more than 5 % off true lengths); NULL: taken as
                            it is. Static text */
    double kept; /* warped: share of the source's area in the field, 0 .. 1 (slivers at the edges are cut) */
    uint64_t edge_filled; /* warped: samples of the field outside the source, invented; 0 unless the outline
                             lies so askew that cutting would have cost 40 % */
    uint64_t voids; /* samples of the file that were filled: nodata, masked, NaN, infinite, -32768, -32767,
                       -9999 (in bands without scale), beyond +-12,000 m */
    uint64_t voids_undeclared; /* of these: not declared by the file or the scene */
    uint64_t void_regions;     /* that they form (4-connected) */
    uint64_t voids_flat;       /* of the voids: laid flat as water, see below */
    double flat_level_m;       /* at which height, the largest such region; 0 when there is none */
    bool all_void;             /* then the terrain is flat at 0 m */
    double height_unit_m;      /* what heights were multiplied by */
    bool looks_like_degrees;   /* no CRS known, but place and cells look like degrees, not metres: terrain.crs
                                  is missing? */
};

/* Reads any GDAL raster's first band as a height field in *crs (created; caller destroys): samples are pixel
 * centres. Place: projected metres are kept to the bit, rows and columns in whatever order; projections in
 * feet become the same projection in metres; a file without CRS (and options->crs NULL) is local; one without
 * any georeference has 1 m cells, its south-west corner at (0, 0). Degrees, rotated rasters and the others
 * that report->warped names are warped (bilinear) at their own mean resolution: rotated ones in their own
 * system, all others to WGS 84 / UTM of their centre (zones of Norway and Svalbard as UTM has them; UPS from
 * 84 N and from 80 S on); the field is the largest north-up rectangle inside them.
 * Heights: nodata is
 * compared in the band's own type; scale and offset of the band apply; then the unit. Vertical datums are not
 * converted.
 * Voids are filled before any warping: a large one that reaches the border and has a level rim (sea) is laid
 * flat at its rim's 10th percentile, all others get a smooth membrane that never leaves the range of the rim.
 * One row or column is doubled, half a cell to either side. Heights go to the arena, relative to field->z0 (a
 * whole number). Limits (SV_ELIMIT) of heightfield.h hold for the file and for the field, and are checked
 * before heights are read; degrees may reach at most 20 degrees from the centre. Costs 4 bytes a sample of
 * the arena, as much of heap if warped, and 3 a sample and 4 a void of heap while voids are filled.
 * SV_ENOENT, SV_EFORMAT, SV_EINVAL (options), SV_EIO (the file breaks off), SV_ENOMEM. */
SV_MUST_CHECK enum sv_status sv_dem_read(const struct sv_dem_options *options, struct sv_arena *arena,
                                         struct sv_heightfield *field, struct sv_crs **crs,
                                         struct sv_dem_report *report, struct sv_error *error);

/* ---- imagery (imagery.c) ---- */

struct sv_imagery_options {
    const char *path;
    int bands[3];    /* 1-based; all 0: the file's own RGB, palette, or grey */
    const char *crs; /* for imagery without one: taken to be the scene's when NULL. One that contradicts the
                        file's is SV_EINVAL */
};

struct sv_imagery_report {
    int source_width, source_height, bands_used[3];
    char driver[32];
    bool palette, rescaled; /* rescaled: not bytes, so each band was stretched from its 2nd .. 98th percentile
                               to bytes */
    double stretch[3][2];   /* rescaled: those percentiles */
    bool reduced;           /* averaged down to the texture limit */
    bool warped;            /* lies in another system than the scene, or askew */
    bool fitted;            /* has no georeference at all, and was laid over the whole (local) terrain */
    uint64_t specks; /* pixels of a photo at nodata that were kept as white or black: small, and not at the
                        file's border */
    double covered;  /* share of the terrain's rectangle that has imagery, 0..1 */
};

/* Draws the imagery into rgba: RGBA u8 over exactly the field's rectangle, row 0 at the south, alpha 255
 * where there is imagery and 0 (all four bytes) elsewhere: nodata (where all bands used have it; not specks,
 * see above), masks, alpha under one half, outside. Nothing else is taken for a hole: black stays black.
 * Size: the imagery's own resolution over that rectangle, 1 .. max_side a side (max_side 1 .. 65536). Bands:
 * without options->bands the file's red, green and blue, else its palette, else bands 1, 2, 3 of three and
 * more, else band 1 as grey. Palettes are read by nearest sample and never averaged, the rest bilinear; too
 * large imagery is averaged down first, from the file's overviews where it has some. Other systems, degrees
 * and rotated rasters are warped. A scene of local metres takes imagery without CRS only; a file without any
 * georeference is laid over the whole of a local terrain, and is SV_EFORMAT elsewhere. Heap image, caller
 * frees. A file that does not touch the terrain is SV_EOUTSIDE. SV_ENOENT, SV_EFORMAT, SV_EINVAL (bands,
 * crs), SV_EIO, SV_ENOMEM. Costs about 16 bytes of heap a texel while it runs. */
SV_MUST_CHECK enum sv_status sv_imagery_read(const struct sv_imagery_options *options,
                                             const struct sv_heightfield *field, const struct sv_crs *crs,
                                             int max_side, struct sv_image *rgba,
                                             struct sv_imagery_report *report, struct sv_error *error);

/* ---- vector points and polygons (vector.c) ---- */

struct sv_points_options {
    const char *path;
    const char *crs; /* overrides/gives the file's; NULL: the file's own, and the scene's for files that have
                        none (CSV) */
    const char *x, *y; /* CSV columns (defaults "x", "y"); ignored for files that have geometry */
    const char *species, *height,
        *rotation;     /* attribute names; NULL: not read. A name that the file has not is SV_ENOENT */
    const char *where; /* OGR attribute filter, NULL: all. Columns of a CSV then have the type that all their
                          values fit */
};

struct sv_point {
    double x, y;     /* scene CRS */
    double height_m; /* NaN when missing or not a number; else as it stands in the file, be it 0, negative or
                        huge */
    double rotation_deg; /* NaN when missing or not a number */
    uint32_t species;    /* index into names[], UINT32_MAX when missing or empty */
};

struct sv_points {
    struct sv_point *items; /* heap */
    size_t count;
    char **names; /* distinct species names of the data, in order of appearance, UTF-8, blanks around them cut
                     off; heap */
    size_t name_count;
    uint64_t skipped; /* features without a usable point (empty geometry, a line, not a number, not
                         transformable) */
    bool crs_suspect; /* no crs was given, the file says degrees (GeoJSON always does), but more than a tenth
                         of its coordinates cannot be degrees, or it is GeoJSON and the scene is local: it was
                         read as the scene's own metres */
};

/* Reads points from CSV (comma, semicolon, tab; BOM; .txt and .dat too) or the first layer with geometry of
 * whatever OGR opens: points, each member of multi-points and collections, polygons by centroid; a
 * line is no place.
 * Columns are found by their exact name, else without regard to case. Numbers in text may have a decimal
 * comma; "12 m", "NA", "inf" are no numbers. At most SV_FOREST_TREES_MAX points. No point at all is SV_OK
 * with count 0. SV_ENOENT (file, column), SV_EFORMAT, SV_EINVAL (filter, crs), SV_EUNSUPPORTED (a place on
 * Earth and a local scene), SV_ELIMIT, SV_EIO (the file breaks off), SV_ENOMEM. The error's field is the
 * scene file's key that is at fault (x, y, species, height_m, rotation_deg, where, crs; the first one when
 * several columns are missing, all of which the message names), else the path. */
SV_MUST_CHECK enum sv_status sv_points_read(const struct sv_points_options *options,
                                            const struct sv_crs *scene_crs, struct sv_points *points,
                                            struct sv_error *error);
void sv_points_finish(struct sv_points *points);

struct sv_polygons; /* opaque: (multi)polygons in the scene's CRS; read only once made */
/* Reads all polygons of the first layer with geometry; other geometry is passed over. Whose system: as for
 * points. At most 2^24 vertices. SV_EFORMAT also when there is no polygon, or a vertex has no place in the
 * scene's system. */
SV_MUST_CHECK enum sv_status sv_polygons_read(const char *path, const struct sv_crs *scene_crs,
                                              struct sv_polygons **polygons, struct sv_error *error);
/* The same for the text of a GeoJSON object, instead of a file's. */
SV_MUST_CHECK enum sv_status sv_polygons_parse(const char *geojson, const struct sv_crs *scene_crs,
                                               struct sv_polygons **polygons, struct sv_error *error);
void sv_polygons_destroy(struct sv_polygons *polygons);
/* In any of them, holes left out; on a shared border in exactly one of two; false for NaN. 0.03 us for a
 * simple outline, 0.5 us for a jagged one of 2000 corners. */
bool sv_polygons_contain(const struct sv_polygons *polygons, double x, double y);
/* The box that holds them all, scene CRS; false (nothing written) when there is no polygon. */
bool sv_polygons_bounds(const struct sv_polygons *polygons, double min[2], double max[2]);

/* ---- the sun (sun.c) ---- */

/* Sun's place for a moment (seconds since 1970 UTC) and a place, true-north azimuth clockwise, radians.
 * NOAA/Meeus low precision, within 0.01 deg for 1900..2100; refraction not added. NaN in, NaN out. */
void sv_sun_position(double unix_s, double lon_deg, double lat_deg, double *azimuth_rad,
                     double *elevation_rad);

#endif
