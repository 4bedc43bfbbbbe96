/* crs.c - coordinate systems by OGR and PROJ: named, compared, transformed, and their north found.
 *
 * Axis order is always easting/longitude first. Nothing here uses the network or reads a file that a text
 * names: a CRS may come from a request. Feet: a system in feet may be the source of a transform; a scene's
 * own system is always made metric (sv_crs_in_metres), so that world units are metres. Vertical systems are
 * ignored. */
#include "core/geo/crs.h"

#include <ctype.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <cpl_conv.h>
#include <cpl_string.h>

#include "core/base/vec.h"
#include "core/geo/gdal_trap.h"

enum { CRS_TEXT_MAX = 65536, MATCH_CONFIDENCE = 70 /* percent; PROJ: equivalent, whatever the name */ };

struct sv_crs {
    OGRSpatialReferenceH srs; /* NULL: local */
    OGRCoordinateTransformationH lonlat_from_crs, crs_from_lonlat;
    double unit_m;
    bool geographic;
    char *name, *wkt;
};

struct sv_crs_transform {
    OGRCoordinateTransformationH handle; /* NULL: the same system, nothing to do */
};

static OGRSpatialReferenceH new_srs(void)
{
    OGRSpatialReferenceH srs = OSRNewSpatialReference(NULL);
    if (srs)
        OSRSetAxisMappingStrategy(srs, OAMS_TRADITIONAL_GIS_ORDER);
    return srs;
}

/* "EPSG:32633" for a system that has a code or equals one that has; else its name. malloc'd. */
static char *find_name(OGRSpatialReferenceH srs)
{
    const char *authority = OSRGetAuthorityName(srs, NULL), *code = OSRGetAuthorityCode(srs, NULL);
    char text[128];
    if (authority && code) {
        snprintf(text, sizeof text, "%s:%s", authority, code);
        return strdup(text);
    }
    int matches = 0, *confidence = NULL;
    OGRSpatialReferenceH *found = OSRFindMatches(srs, NULL, &matches, &confidence);
    text[0] = '\0';
    /* Several systems may fit a definition without a datum of its own equally well: then none of them is its name. */
    bool sole = matches > 0 && (matches == 1 || confidence[1] < confidence[0]);
    if (sole && confidence[0] >= MATCH_CONFIDENCE && OSRGetAuthorityCode(found[0], NULL))
        snprintf(text, sizeof text, "%s:%s", OSRGetAuthorityName(found[0], NULL),
                 OSRGetAuthorityCode(found[0], NULL));
    OSRFreeSRSArray(found);
    CPLFree(confidence);
    const char *own = OSRGetName(srs);
    return strdup(text[0] ? text : own && own[0] ? own : "unnamed");
}

void sv_crs_destroy(struct sv_crs *crs)
{
    if (!crs)
        return;
    OCTDestroyCoordinateTransformation(crs->lonlat_from_crs);
    OCTDestroyCoordinateTransformation(crs->crs_from_lonlat);
    if (crs->srs)
        OSRRelease(crs->srs);
    free(crs->name);
    free(crs->wkt);
    free(crs);
}

enum sv_status sv_crs_create_local(struct sv_crs **crs, struct sv_error *error)
{
    struct sv_crs *c = calloc(1, sizeof *c);
    if (!c)
        return sv_fail(error, SV_ENOMEM, "crs", "out of memory");
    c->unit_m = 1;
    c->name = strdup("local");
    c->wkt = strdup("");
    if (!c->name || !c->wkt) {
        sv_crs_destroy(c);
        return sv_fail(error, SV_ENOMEM, "crs", "out of memory");
    }
    *crs = c;
    return SV_OK;
}

/* Fills c from its srs; errors stay in the caller's trap. name: NULL to find it. */
static bool complete(struct sv_crs *c, OGRSpatialReferenceH lonlat, const char *name)
{
    c->geographic = OSRIsGeographic(c->srs) || OSRIsDerivedGeographic(c->srs);
    c->unit_m = c->geographic ? 0 : OSRGetLinearUnits(c->srs, NULL);
    c->lonlat_from_crs = OCTNewCoordinateTransformation(c->srs, lonlat);
    c->crs_from_lonlat = OCTNewCoordinateTransformation(lonlat, c->srs);
    char *wkt = NULL;
    const char *const wkt1[] = {"FORMAT=WKT1_GDAL", NULL};
    if (OSRExportToWktEx(c->srs, &wkt, wkt1) == OGRERR_NONE && wkt)
        c->wkt = strdup(wkt);
    CPLFree(wkt);
    if (!c->wkt) /* some systems exist in WKT 2 only; geo tags then go without */
        c->wkt = strdup("");
    c->name = name ? strdup(name) : find_name(c->srs);
    return c->lonlat_from_crs && c->crs_from_lonlat && c->wkt && c->name;
}

/* Takes srs. known_name: NULL to find it, which costs a third of a second where there is no code. */
static enum sv_status adopt(OGRSpatialReferenceH srs, const char *known_name, struct sv_crs **crs,
                            struct sv_error *error)
{
    struct sv_gdal_trap trap;
    enum sv_status status = SV_OK;
    struct sv_crs *c = calloc(1, sizeof *c);
    OGRSpatialReferenceH lonlat = new_srs();
    sv_gdal_trap_begin(&trap);
    if (!c || !lonlat) {
        status = sv_fail(error, SV_ENOMEM, "crs", "out of memory");
        OSRRelease(srs);
        goto out;
    }
    c->srs = srs;
    OSRSetAxisMappingStrategy(srs, OAMS_TRADITIONAL_GIS_ORDER);
    if (OSRIsCompound(srs))
        OSRStripVertical(srs);
    if (OSRGetAxesCount(srs) == 3)
        OSRDemoteTo2D(srs, NULL);
    const char *name = OSRGetName(srs);
    bool flat = OSRIsGeographic(srs) || OSRIsDerivedGeographic(srs) || OSRIsProjected(srs);
    if (!flat || OSRIsGeocentric(srs))
        status = sv_fail(error, SV_EUNSUPPORTED, "crs",
                         "\"%.100s\" is neither a projected nor a geographic system", name ? name : "");
    else if (OSRSetWellKnownGeogCS(lonlat, "WGS84") != OGRERR_NONE || !complete(c, lonlat, known_name))
        status = sv_fail(error, SV_EUNSUPPORTED, "crs", "\"%.100s\" has no way to WGS 84: %s",
                         name ? name : "", sv_gdal_trap_text(&trap, "PROJ gave no reason"));
out:
    sv_gdal_trap_end(&trap);
    if (lonlat)
        OSRRelease(lonlat);
    if (status == SV_OK)
        *crs = c;
    else
        sv_crs_destroy(c);
    return status;
}

/* PROJ opens files that a definition names: +init=FILE:code, and grids by path. Grids by plain name ("conus",
 * "@null") are its own. */
static bool names_a_file(const char *text)
{
    if (strstr(text, "init="))
        return true;
    for (const char *p = strstr(text, "grids="); p; p = strstr(p + 1, "grids="))
        if (strcspn(p, "/\\") < strcspn(p, " \t\r\n\"+"))
            return true;
    return false;
}

/* Whether text is a system's definition, not the name of a file or of a host: OGR would open those. */
static bool is_definition(const char *text)
{
    if (names_a_file(text))
        return false;
    static const char *const names[] = {"WGS84", "WGS72", "NAD27", "NAD83"};
    for (size_t i = 0; i < sizeof names / sizeof names[0]; i++)
        if (!strcmp(text, names[i]))
            return true;
    if (text[0] == '{' || !strncmp(text, "+proj=", 6))
        return true;
    static const char *const urls[] = {"http://www.opengis.net/def/crs", "https://www.opengis.net/def/crs",
                                       "http://opengis.net/def/crs"};
    for (size_t i = 0; i < sizeof urls / sizeof urls[0]; i++)
        if (!strncmp(text, urls[i], strlen(urls[i])))
            return true;
    size_t n = strspn(text, "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789_");
    if (n == 0)
        return false;
    size_t bracket = n + strspn(text + n, " \t\r\n");
    if (text[bracket] == '[' || text[bracket] == '(')
        return true;
    if (text[n] != ':' || !text[n + 1])
        return false;
    for (const char *p = text + n; *p; p++)
        if (!isalnum((unsigned char)*p) && !strchr(":_.+-,", *p))
            return false;
    return true;
}

enum sv_status sv_crs_create(const char *text, struct sv_crs **crs, struct sv_error *error)
{
    if (strnlen(text, CRS_TEXT_MAX) >= CRS_TEXT_MAX)
        return sv_fail(error, SV_EINVAL, "crs", "a coordinate system's text of more than %d bytes",
                       CRS_TEXT_MAX - 1);
    if (!is_definition(text))
        return sv_fail(error, SV_EINVAL, "crs",
                       "\"%.100s\" is no coordinate system: give \"EPSG:n\", a PROJ string or WKT", text);
    OGRSpatialReferenceH srs = new_srs();
    if (!srs)
        return sv_fail(error, SV_ENOMEM, "crs", "out of memory");
    struct sv_gdal_trap trap;
    sv_gdal_trap_begin(&trap);
    OGRErr failed = OSRSetFromUserInput(srs, text);
    sv_gdal_trap_end(&trap);
    if (failed) {
        OSRRelease(srs);
        return sv_fail(error, SV_EINVAL, "crs", "\"%.100s\" is no coordinate system: %s", text,
                       sv_gdal_trap_text(&trap, "PROJ does not know it"));
    }
    enum sv_status status = adopt(srs, NULL, crs, error);
    return status == SV_EUNSUPPORTED ? (enum sv_status)SV_EINVAL : status;
}

enum sv_status sv_crs_from_srs(OGRSpatialReferenceH srs, struct sv_crs **crs, struct sv_error *error)
{
    if (!srs || !OSRGetName(srs) || OSRIsLocal(srs))
        return sv_crs_create_local(crs, error);
    OGRSpatialReferenceH copy = OSRClone(srs);
    if (!copy)
        return sv_fail(error, SV_ENOMEM, "crs", "out of memory");
    return adopt(copy, NULL, crs, error);
}

enum sv_status sv_crs_in_metres(const struct sv_crs *crs, struct sv_crs **out, struct sv_error *error)
{
    if (!crs->srs)
        return sv_crs_create_local(out, error);
    OGRSpatialReferenceH srs = OSRClone(crs->srs);
    if (!srs)
        return sv_fail(error, SV_ENOMEM, "crs", "out of memory");
    if (crs->geographic || crs->unit_m == 1)
        return adopt(srs, crs->name, out, error);
    char name[200];
    snprintf(name, sizeof name, "%.180s, in metres", crs->name);
    struct sv_gdal_trap trap;
    sv_gdal_trap_begin(&trap);
    OGRErr failed = OSRSetLinearUnitsAndUpdateParameters(srs, "metre", 1.0);
    sv_gdal_trap_end(&trap);
    if (failed) {
        OSRRelease(srs);
        return sv_fail(error, SV_EUNSUPPORTED, "crs",
                       "%s counts in units of %.9g m and cannot be turned to metres: %s", crs->name,
                       crs->unit_m, sv_gdal_trap_text(&trap, "PROJ gave no reason"));
    }
    enum sv_status status = adopt(srs, NULL, out, error);
    if (status == SV_OK && strncmp((*out)->name, "EPSG:", 5) != 0) {
        free((*out)->name); /* no code of its own: say what it was made from */
        (*out)->name = strdup(name);
    }
    return status;
}

/* UTM zone, 1 .. 60, with the wide zones of Norway and Svalbard (NGA.SIG.0012, 2014, section 7-3). */
static int utm_zone(double lon, double lat)
{
    static const struct {
        double south, north, west, east;
        int zone;
    } exceptions[] = {{56, 64, 3, 12, 32},
                      {72, 84, 0, 9, 31},
                      {72, 84, 9, 21, 33},
                      {72, 84, 21, 33, 35},
                      {72, 84, 33, 42, 37}};
    lon -= 360 * floor((lon + 180) / 360);
    for (size_t i = 0; i < sizeof exceptions / sizeof exceptions[0]; i++)
        if (lat >= exceptions[i].south && lat < exceptions[i].north && lon >= exceptions[i].west &&
            lon < exceptions[i].east)
            return exceptions[i].zone;
    int zone = (int)floor((lon + 180) / 6) + 1;
    return zone < 1 ? 1 : zone > 60 ? 60 : zone;
}

enum sv_status sv_crs_flat_for(double lon_deg, double lat_deg, struct sv_crs **out, struct sv_error *error)
{
    /* 5041, 5042: UPS north and south with easting first */
    int code = lat_deg >= 84   ? 5041
               : lat_deg < -80 ? 5042
                               : (lat_deg < 0 ? 32700 : 32600) + utm_zone(lon_deg, lat_deg);
    char text[24];
    snprintf(text, sizeof text, "EPSG:%d", code);
    return sv_crs_create(text, out, error);
}

bool sv_crs_is_local(const struct sv_crs *crs)
{
    return !crs->srs;
}

bool sv_crs_is_geographic(const struct sv_crs *crs)
{
    return crs->geographic;
}

double sv_crs_unit_m(const struct sv_crs *crs)
{
    return crs->unit_m;
}

const char *sv_crs_name(const struct sv_crs *crs)
{
    return crs->name;
}

int sv_crs_epsg(const struct sv_crs *crs)
{
    int code = 0, used = 0;
    return sscanf(crs->name, "EPSG:%9d%n", &code, &used) == 1 && !crs->name[used] ? code : 0;
}

const char *sv_crs_wkt(const struct sv_crs *crs)
{
    return crs->wkt;
}

double sv_crs_full_turn(const struct sv_crs *crs)
{
    if (!crs->geographic)
        return 0;
    double unit_rad = OSRGetAngularUnits(crs->srs, NULL);
    return unit_rad > 0 ? 2 * SV_PI / unit_rad : 360;
}

static bool same_definition(const struct sv_crs *a, const struct sv_crs *b)
{
    if (!a->srs || !b->srs)
        return !a->srs && !b->srs;
    const char *const options[] = {"IGNORE_DATA_AXIS_TO_SRS_AXIS_MAPPING=YES",
                                   "CRITERION=EQUIVALENT_EXCEPT_AXIS_ORDER_GEOGCRS", NULL};
    return OSRIsSameEx(a->srs, b->srs, options);
}

/* Not same_definition: traditional order makes EPSG:2193 (north first) and its east-first twin give the same
 * numbers, and that is what agreement at places finds. */
bool sv_crs_agrees(const struct sv_crs *a, const struct sv_crs *b, const double extent[4])
{
    if (!a->srs || !b->srs || a->geographic != b->geographic)
        return !a->srs && !b->srs;
    if (same_definition(a, b))
        return true;
    struct sv_crs_transform *t = NULL;
    if (sv_crs_transform_create(a, b, &t, NULL) != SV_OK)
        return false;
    double tolerance = a->geographic ? sv_crs_full_turn(a) / 4e7 : 1 / a->unit_m; /* 1 m */
    bool agrees = true;
    static const double places[5][2] = {{0.5, 0.5}, {0, 0}, {1, 0}, {0, 1}, {1, 1}};
    for (int i = 0; i < 5 && agrees; i++) {
        double x = extent[0] + places[i][0] * (extent[2] - extent[0]), u = x;
        double y = extent[1] + places[i][1] * (extent[3] - extent[1]), v = y;
        agrees = sv_crs_transform_apply(t, &u, &v) && fabs(u - x) <= tolerance && fabs(v - y) <= tolerance;
    }
    sv_crs_transform_destroy(t);
    return agrees;
}

enum sv_status sv_crs_transform_create(const struct sv_crs *from, const struct sv_crs *to,
                                       struct sv_crs_transform **transform, struct sv_error *error)
{
    if (!from->srs != !to->srs)
        return sv_fail(error, SV_EUNSUPPORTED, "crs",
                       "no way from %s to %s: a local system has no place on Earth", from->name, to->name);
    struct sv_crs_transform *t = calloc(1, sizeof *t);
    if (!t)
        return sv_fail(error, SV_ENOMEM, "crs", "out of memory");
    if (!same_definition(from, to)) {
        struct sv_gdal_trap trap;
        sv_gdal_trap_begin(&trap);
        t->handle = OCTNewCoordinateTransformation(from->srs, to->srs);
        sv_gdal_trap_end(&trap);
        if (!t->handle) {
            free(t);
            return sv_fail(error, SV_EUNSUPPORTED, "crs", "no way from %s to %s: %s", from->name, to->name,
                           sv_gdal_trap_text(&trap, "PROJ gave no reason"));
        }
    }
    *transform = t;
    return SV_OK;
}

void sv_crs_transform_destroy(struct sv_crs_transform *transform)
{
    if (!transform)
        return;
    OCTDestroyCoordinateTransformation(transform->handle);
    free(transform);
}

bool sv_crs_transform_is_identity(const struct sv_crs_transform *transform)
{
    return !transform->handle;
}

static bool apply(OGRCoordinateTransformationH handle, double *x, double *y)
{
    if (!isfinite(*x) || !isfinite(*y))
        return false;
    if (!handle)
        return true;
    double u = *x, v = *y;
    int ok = 0;
    struct sv_gdal_trap trap;
    sv_gdal_trap_begin(&trap);
    OCTTransformEx(handle, 1, &u, &v, NULL, &ok);
    sv_gdal_trap_end(&trap);
    if (!ok || !isfinite(u) || !isfinite(v))
        return false;
    *x = u;
    *y = v;
    return true;
}

bool sv_crs_transform_apply(const struct sv_crs_transform *transform, double *x, double *y)
{
    return apply(transform->handle, x, y);
}

void sv_crs_transform_many(const struct sv_crs_transform *transform, size_t count, double *x, double *y,
                           int *ok)
{
    enum { CHUNK = 1 << 16 }; /* OCT counts in int and takes scratch memory by the call */
    struct sv_gdal_trap trap;
    sv_gdal_trap_begin(&trap);
    for (size_t first = 0; first < count; first += CHUNK) {
        size_t n = count - first < CHUNK ? count - first : CHUNK;
        for (size_t i = first; i < first + n; i++)
            ok[i] = 1;
        if (transform->handle)
            OCTTransformEx(transform->handle, (int)n, x + first, y + first, NULL, ok + first);
        for (size_t i = first; i < first + n; i++)
            if (!ok[i] || !isfinite(x[i]) || !isfinite(y[i])) {
                ok[i] = 0;
                x[i] = y[i] = NAN;
            }
    }
    sv_gdal_trap_end(&trap);
}

bool sv_crs_to_lonlat(const struct sv_crs *crs, double x, double y, double *lon_deg, double *lat_deg)
{
    if (!crs->srs || !apply(crs->lonlat_from_crs, &x, &y))
        return false;
    *lon_deg = x;
    *lat_deg = y;
    return true;
}

bool sv_crs_from_lonlat(const struct sv_crs *crs, double lon_deg, double lat_deg, double *x, double *y)
{
    if (!crs->srs || !(fabs(lat_deg) <= 90) || !apply(crs->crs_from_lonlat, &lon_deg, &lat_deg))
        return false;
    *x = lon_deg;
    *y = lat_deg;
    return true;
}

/* Central difference along the meridian; at a pole the step is one-sided. The error of the direction is of
 * the order (step in radians)^2, 1e-11; rounding of metres to 1e-9 over 22 m gives 1e-10. */
double sv_crs_convergence_rad(const struct sv_crs *crs, double x, double y)
{
    const double step_deg = 1e-4;
    double lon, lat, x0, y0, x1, y1;
    if (crs->geographic || !sv_crs_to_lonlat(crs, x, y, &lon, &lat))
        return 0;
    double south = fmax(lat - step_deg, -90), north = fmin(lat + step_deg, 90);
    if (!sv_crs_from_lonlat(crs, lon, south, &x0, &y0) || !sv_crs_from_lonlat(crs, lon, north, &x1, &y1))
        return 0;
    return atan2(x1 - x0, y1 - y0);
}
