/* crs.h - what files of core/geo may see of a coordinate system. Others use geo.h. */
#ifndef SV_GEO_CRS_H
#define SV_GEO_CRS_H

#include <ogr_srs_api.h>

#include "core/geo/geo.h"

/* Borrows srs (cloned). A vertical part is dropped; an engineering (local) system gives the local one. NULL
 * gives local. */
SV_MUST_CHECK enum sv_status sv_crs_from_srs(OGRSpatialReferenceH srs, struct sv_crs **crs,
                                             struct sv_error *error);
/* The same projection with the metre as its unit: coordinates times sv_crs_unit_m(crs) are coordinates in
 * *out. */
SV_MUST_CHECK enum sv_status sv_crs_in_metres(const struct sv_crs *crs, struct sv_crs **out,
                                              struct sv_error *error);
/* WGS 84 / UTM of that place (with the zones of Norway and Svalbard), UPS from 84 degrees north and from 80
 * south on. */
SV_MUST_CHECK enum sv_status sv_crs_flat_for(double lon_deg, double lat_deg, struct sv_crs **out,
                                             struct sv_error *error);

/* A whole turn of longitude in the units of a geographic system (360 for degrees); 0 for others. */
double sv_crs_full_turn(const struct sv_crs *crs);
/* The same system, by definition or because five places of the box come out within 1 m; extent: x0, y0, x1,
 * y1. */
bool sv_crs_agrees(const struct sv_crs *a, const struct sv_crs *b, const double extent[4]);

/* In place; ok[i] tells which points came through finite, the others are left as NaN. */
void sv_crs_transform_many(const struct sv_crs_transform *transform, size_t count, double *x, double *y,
                           int *ok);

#endif
