/* layer.c - see layer.h. */
#include "core/geo/layer.h"

#include <ctype.h>
#include <errno.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <strings.h>
#include <unistd.h>

#include <cpl_conv.h>
#include <cpl_string.h>
#include <cpl_vsi.h>

#include "core/geo/crs.h"
#include "core/geo/gdal_trap.h"

static enum sv_status open_failed(const char *path, const struct sv_gdal_trap *trap, struct sv_error *error)
{
    VSIStatBufL info;
    if (VSIStatL(path, &info) != 0 && !strchr(path, ':'))
        return sv_fail(error, SV_ENOENT, path, "%s: no such file", path);
    if (path[0] == '/' && strncmp(path, "/vsi", 4) != 0 && access(path, R_OK) != 0)
        return sv_fail(error, SV_ENOENT, path, "%s: cannot be read: %s", path, strerror(errno));
    return sv_fail(error, SV_EFORMAT, path, "%s: neither CSV nor a vector file that OGR reads: %s", path,
                   sv_gdal_trap_text(trap, "no driver knows it"));
}

/* A table whose name does not end in .csv is one all the same; OGR wants to be told. */
static bool is_plain_table(const char *path)
{
    static const char *const ends[] = {"txt", "dat", "tab.txt"};
    const char *end = CPLGetExtension(path);
    for (size_t i = 0; i < sizeof ends / sizeof ends[0]; i++)
        if (!strcasecmp(end, ends[i]))
            return true;
    return false;
}

static void choose_layer(struct sv_layer *l)
{
    int count = GDALDatasetGetLayerCount(l->dataset);
    for (int k = 0; k < count && !l->has_geometry; k++) {
        OGRLayerH layer = GDALDatasetGetLayer(l->dataset, k);
        if (!layer)
            continue;
        bool has = OGR_L_GetGeomType(layer) != wkbNone;
        if (!l->handle || has)
            l->handle = layer;
        l->has_geometry = has;
    }
    if (l->handle)
        l->fields = OGR_L_GetLayerDefn(l->handle);
}

enum sv_status sv_layer_open(const char *path, bool typed, const struct sv_gdal_trap *trap,
                             struct sv_layer *layer, struct sv_error *error)
{
    const unsigned flags = GDAL_OF_VECTOR | GDAL_OF_READONLY | GDAL_OF_VERBOSE_ERROR;
    struct sv_layer l = {0};
    char *prefixed = NULL;
    GDALDriverH driver = GDALIdentifyDriverEx(path, GDAL_OF_VECTOR, NULL, NULL);
    if (!driver && is_plain_table(path) && asprintf(&prefixed, "CSV:%s", path) >= 0)
        driver = GDALGetDriverByName("CSV");
    l.is_csv = driver && !strcmp(GDALGetDriverShortName(driver), "CSV");
    if (l.is_csv) {
        static const char *const only_csv[] = {"CSV", NULL};
        static const char *const as_text[] = {"AUTODETECT_TYPE=NO", "EMPTY_STRING_AS_NULL=YES", NULL};
        static const char *const as_typed[] = {"AUTODETECT_TYPE=YES", "AUTODETECT_SIZE_LIMIT=0",
                                               "EMPTY_STRING_AS_NULL=YES", NULL};
        l.dataset = GDALOpenEx(prefixed ? prefixed : path, flags, only_csv, typed ? as_typed : as_text, NULL);
    } else {
        l.dataset = GDALOpenEx(path, flags, NULL, NULL, NULL);
    }
    free(prefixed);
    if (!l.dataset)
        return open_failed(path, trap, error);
    const char *name = GDALGetDriverShortName(GDALGetDatasetDriver(l.dataset));
    l.is_csv = !strcmp(name, "CSV");
    l.is_geojson = !strcmp(name, "GeoJSON") || !strcmp(name, "GeoJSONSeq") || !strcmp(name, "TopoJSON");
    choose_layer(&l);
    if (!l.handle) {
        GDALClose(l.dataset);
        return sv_fail(error, SV_EFORMAT, path, "%s: has no layer", path);
    }
    *layer = l;
    return SV_OK;
}

void sv_layer_close(struct sv_layer *layer)
{
    if (layer->dataset)
        GDALClose(layer->dataset);
    *layer = (struct sv_layer){0};
}

OGRFeatureH sv_layer_next(struct sv_layer *layer, const char *path, enum sv_status *status,
                          struct sv_error *error)
{
    CPLErrorReset();
    OGRFeatureH feature = OGR_L_GetNextFeature(layer->handle);
    *status = SV_OK;
    if (!feature && CPLGetLastErrorType() >= CE_Failure)
        *status = sv_fail(error, SV_EIO, path, "%s: breaks off: %s", path, CPLGetLastErrorMsg());
    return feature;
}

/* Whether the name, blanks around it left out, equals the wanted one but for case. */
static bool same_name(const char *name, const char *wanted)
{
    while (isspace((unsigned char)*name))
        name++;
    size_t n = strlen(name);
    while (n > 0 && isspace((unsigned char)name[n - 1]))
        n--;
    return n == strlen(wanted) && !strncasecmp(name, wanted, n);
}

int sv_layer_field(const struct sv_layer *layer, const char *name)
{
    int count = OGR_FD_GetFieldCount(layer->fields);
    for (int k = 0; k < count; k++)
        if (!strcmp(OGR_Fld_GetNameRef(OGR_FD_GetFieldDefn(layer->fields, k)), name))
            return k;
    for (int k = 0; k < count; k++)
        if (same_name(OGR_Fld_GetNameRef(OGR_FD_GetFieldDefn(layer->fields, k)), name))
            return k;
    return -1;
}

void sv_layer_field_names(const struct sv_layer *layer, char *text, size_t size)
{
    int count = OGR_FD_GetFieldCount(layer->fields);
    size_t used = 0;
    snprintf(text, size, "none");
    for (int k = 0; k < count && used + 1 < size; k++) {
        int n = snprintf(text + used, size - used, "%s%s", k ? ", " : "",
                         OGR_Fld_GetNameRef(OGR_FD_GetFieldDefn(layer->fields, k)));
        if (n < 0 || (size_t)n >= size - used)
            return;
        used += (size_t)n;
    }
}

static double number_of_text(const char *text)
{
    while (isspace((unsigned char)*text))
        text++;
    const char *comma = strchr(text, ',');
    bool decimal_comma = comma && !strchr(text, '.') && !strchr(comma + 1, ',');
    char *end = NULL;
    double value = CPLStrtodDelim(text, &end, decimal_comma ? ',' : '.');
    if (end == text)
        return NAN;
    while (isspace((unsigned char)*end))
        end++;
    return *end == '\0' && isfinite(value) ? value : NAN;
}

double sv_layer_number(OGRFeatureH feature, int field)
{
    if (field < 0 || !OGR_F_IsFieldSetAndNotNull(feature, field))
        return NAN;
    double value;
    switch (OGR_Fld_GetType(OGR_F_GetFieldDefnRef(feature, field))) {
    case OFTInteger:
    case OFTInteger64:
    case OFTReal:
        value = OGR_F_GetFieldAsDouble(feature, field);
        return isfinite(value) ? value : NAN;
    default: /* OGR's enum, not ours: it may grow */
        return number_of_text(OGR_F_GetFieldAsString(feature, field));
    }
}

/* Whether more than a tenth of the places cannot be degrees: a few slips of the pen must not turn a file into
 * another one. */
static bool cannot_be_degrees(const double *x, const double *y, size_t count)
{
    size_t odd = 0;
    for (size_t k = 0; k < count; k++)
        odd += fabs(y[k]) > 90 || fabs(x[k]) > 360;
    return odd > count / 10;
}

enum sv_status sv_layer_transform(const struct sv_layer *layer, const char *path, const char *given,
                                  const struct sv_crs *scene_crs, const double *x, const double *y,
                                  size_t count, struct sv_crs_transform **transform, bool *suspect,
                                  struct sv_error *error)
{
    struct sv_crs *own = NULL;
    OGRSpatialReferenceH srs = OGR_L_GetSpatialRef(layer->handle);
    enum sv_status status = given ? sv_crs_create(given, &own, error)
                            : srs ? sv_crs_from_srs(srs, &own, error)
                                  : SV_OK;
    if (status != SV_OK)
        return status;
    bool odd = false;
    if (!given && own && sv_crs_is_geographic(own))
        odd = cannot_be_degrees(x, y, count) || (layer->is_geojson && sv_crs_is_local(scene_crs));
    struct sv_error why = {0};
    status = sv_crs_transform_create(own && !odd ? own : scene_crs, scene_crs, transform, &why);
    sv_crs_destroy(own);
    if (status != SV_OK)
        return sv_fail(error, status, given ? "crs" : path, "%s: %s", path, why.message);
    *suspect = odd;
    return SV_OK;
}
