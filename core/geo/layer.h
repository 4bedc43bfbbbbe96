/* layer.h - opening the vector layer of a file: what reading points and reading polygons have in common. For
 * files of core/geo only. */
#ifndef SV_GEO_LAYER_H
#define SV_GEO_LAYER_H

#include <gdal.h>
#include <ogr_api.h>

#include "core/geo/geo.h"

struct sv_layer {
    GDALDatasetH dataset;
    OGRLayerH handle; /* the first layer with geometry, else the first */
    OGRFeatureDefnH fields;
    bool is_csv;
    bool is_geojson; /* RFC 7946: claims WGS 84 whatever its numbers are, unless it has the old crs member */
    bool has_geometry;
};

/* Opens path read-only. typed: columns of a CSV get types from what is in them (attribute filters need that),
 * else they stay text. SV_ENOENT, SV_EFORMAT. Must be called, and *layer used, within a trap; reason is that
 * trap. */
struct sv_gdal_trap;
SV_MUST_CHECK enum sv_status sv_layer_open(const char *path, bool typed, const struct sv_gdal_trap *trap,
                                           struct sv_layer *layer, struct sv_error *error);
void sv_layer_close(struct sv_layer *layer);

/* Next feature or NULL; *status is SV_EIO (error filled) when that is because the file breaks off, else
 * SV_OK. */
OGRFeatureH sv_layer_next(struct sv_layer *layer, const char *path, enum sv_status *status,
                          struct sv_error *error);

/* Column by name: exact, else without regard to case and blanks around it. -1 when there is none. */
int sv_layer_field(const struct sv_layer *layer, const char *name);
/* "x, y, species" ... as much as fits, for error texts. */
void sv_layer_field_names(const struct sv_layer *layer, char *text, size_t size);
/* Number in a column: NaN for null, empty, text, infinite. Text may have blanks around it and a decimal
 * comma. */
double sv_layer_number(OGRFeatureH feature, int field);

/* Chooses what system the layer's coordinates are in: `given` if there is one, else the file's own, else the
 * scene's. x, y: all coordinates that were found. *suspect: the file says (or, as GeoJSON, is taken to say)
 * degrees, but more than a tenth of the coordinates cannot be degrees, or the scene is local and the file
 * GeoJSON: then the scene's own. The transform to the scene is created. SV_EINVAL (given), SV_EUNSUPPORTED.
 */
SV_MUST_CHECK enum sv_status sv_layer_transform(const struct sv_layer *layer, const char *path,
                                                const char *given, const struct sv_crs *scene_crs,
                                                const double *x, const double *y, size_t count,
                                                struct sv_crs_transform **transform, bool *suspect,
                                                struct sv_error *error);

#endif
