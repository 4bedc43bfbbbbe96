/* vector.c - reads points (trees) from CSV and from whatever OGR opens. Knows no terrain: which points lie on
 * it is the scene's affair, as is what a missing height becomes.
 *
 * A CSV gives its places by two columns (or, as OGR does, by a column WKT); its columns stay text unless an
 * attribute filter needs types, and each number is judged by itself: "12.5 m" is no height, "12,5" is one.
 * Other files give theirs by geometry: points, each member of multi-points and collections, and the centroid
 * of everything with an area (tree crowns). A line is no place of a tree: it counts as skipped. Two passes
 * over memory, one over the file: raw coordinates first, since only all of them together tell whether
 * "degrees" can be degrees (layer.h), then the transform in bulk. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <cpl_conv.h>
#include <cpl_string.h>

#include "core/base/hash.h"
#include "core/geo/crs.h"
#include "core/geo/gdal_trap.h"
#include "core/geo/layer.h"
#include "core/scene/forest.h"

/* ---- distinct names ---- */

struct names {
    char **items;
    size_t count, room;
    uint32_t *slots; /* open addressing: index + 1, 0 empty; slot_count is a power of two */
    size_t slot_count;
};

static void names_finish(struct names *n)
{
    for (size_t k = 0; k < n->count; k++)
        free(n->items[k]);
    free(n->items);
    free(n->slots);
    *n = (struct names){0};
}

static size_t names_slot(const struct names *n, const char *name)
{
    size_t at = (size_t)sv_hash_done(sv_hash_string(0, name)) & (n->slot_count - 1);
    while (n->slots[at] && strcmp(n->items[n->slots[at] - 1], name) != 0)
        at = (at + 1) & (n->slot_count - 1);
    return at;
}

static bool names_grow(struct names *n)
{
    size_t room = n->room ? 2 * n->room : 64, slots = 4 * room;
    char **items = realloc(n->items, room * sizeof *items);
    if (!items)
        return false;
    n->items = items;
    n->room = room;
    uint32_t *fresh = calloc(slots, sizeof *fresh);
    if (!fresh)
        return false;
    free(n->slots);
    n->slots = fresh;
    n->slot_count = slots;
    for (size_t k = 0; k < n->count; k++)
        n->slots[names_slot(n, n->items[k])] = (uint32_t)(k + 1);
    return true;
}

/* Index of a name, made if it is new; false when memory ran out. */
static bool names_intern(struct names *n, const char *name, uint32_t *index)
{
    if (n->count == n->room && !names_grow(n))
        return false;
    size_t at = names_slot(n, name);
    if (!n->slots[at]) {
        char *copy = strdup(name);
        if (!copy)
            return false;
        n->items[n->count++] = copy;
        n->slots[at] = (uint32_t)n->count;
    }
    *index = n->slots[at] - 1;
    return true;
}

/* ---- reading ---- */

struct reading {
    const struct sv_points_options *options;
    struct sv_layer layer;
    int x, y, species, height, rotation; /* columns; -1: none. x >= 0: places come from columns */
    struct sv_point *items;
    size_t count, room;
    struct names names;
    uint64_t skipped;
};

/* Finds every column that a key of the scene file names; one error tells of all that are not there. */
static enum sv_status find_columns(struct reading *r, struct sv_error *error)
{
    const struct sv_points_options *o = r->options;
    bool by_columns = !r->layer.has_geometry || (r->layer.is_csv && (o->x || o->y));
    const struct {
        const char *key, *name;
        int *field;
    } wanted[] = {{"x",
                   !by_columns ? NULL
                   : o->x      ? o->x
                               : "x",
                   &r->x},
                  {"y",
                   !by_columns ? NULL
                   : o->y      ? o->y
                               : "y",
                   &r->y},
                  {"species", o->species, &r->species},
                  {"height_m", o->height, &r->height},
                  {"rotation_deg", o->rotation, &r->rotation}};
    const char *first = NULL;
    char missing[1024] = "", names[256]; /* sv_fail cuts the message earlier, and at a character */
    size_t used = 0;
    for (size_t k = 0; k < sizeof wanted / sizeof wanted[0]; k++) {
        *wanted[k].field = wanted[k].name ? sv_layer_field(&r->layer, wanted[k].name) : -1;
        if (!wanted[k].name || *wanted[k].field >= 0)
            continue;
        int n = snprintf(missing + used, sizeof missing - used, "%s\"%s\" (%s)", first ? ", " : "",
                         wanted[k].name, wanted[k].key);
        first = first ? first : wanted[k].key;
        if (n < 0 || (size_t)n >= sizeof missing - used)
            break;
        used += (size_t)n;
    }
    if (!first)
        return SV_OK;
    sv_layer_field_names(&r->layer, names, sizeof names);
    return sv_fail(error, SV_ENOENT, first, "%s: has no column %s; its columns are: %s", o->path, missing,
                   names);
}

static enum sv_status add_point(struct reading *r, double x, double y, const struct sv_point *attributes,
                                struct sv_error *error)
{
    if (!isfinite(x) || !isfinite(y)) {
        r->skipped++;
        return SV_OK;
    }
    if (r->count == SV_FOREST_TREES_MAX)
        return sv_fail(error, SV_ELIMIT, r->options->path, "%s: holds more than %d points", r->options->path,
                       SV_FOREST_TREES_MAX);
    if (r->count == r->room) {
        size_t room = r->room ? 2 * r->room : 4096;
        struct sv_point *items = realloc(r->items, room * sizeof *items);
        if (!items)
            return sv_fail(error, SV_ENOMEM, r->options->path, "%s: no memory for its points",
                           r->options->path);
        r->items = items;
        r->room = room;
    }
    struct sv_point *p = &r->items[r->count++];
    *p = *attributes;
    p->x = x;
    p->y = y;
    return SV_OK;
}

static enum sv_status add_geometry(struct reading *r, OGRGeometryH g, const struct sv_point *attributes,
                                   struct sv_error *error)
{
    if (!g || OGR_G_IsEmpty(g)) {
        r->skipped++;
        return SV_OK;
    }
    OGRwkbGeometryType type = wkbFlatten(OGR_G_GetGeometryType(g));
    if (type == wkbPoint)
        return add_point(r, OGR_G_GetX(g, 0), OGR_G_GetY(g, 0), attributes, error);
    if (type == wkbMultiPoint || type == wkbGeometryCollection) {
        enum sv_status status = SV_OK;
        int count = OGR_G_GetGeometryCount(g);
        for (int k = 0; k < count && status == SV_OK; k++)
            status = add_geometry(r, OGR_G_GetGeometryRef(g, k), attributes, error);
        return status;
    }
    if (OGR_G_GetDimension(g) < 2) {
        r->skipped++;
        return SV_OK;
    }
    OGRGeometryH centre = OGR_G_CreateGeometry(wkbPoint);
    enum sv_status status = SV_OK;
    if (centre && OGR_G_Centroid(g, centre) == OGRERR_NONE && !OGR_G_IsEmpty(centre))
        status = add_point(r, OGR_G_GetX(centre, 0), OGR_G_GetY(centre, 0), attributes, error);
    else
        r->skipped++;
    if (centre)
        OGR_G_DestroyGeometry(centre);
    return status;
}

/* Index of the species' name: blanks trimmed, made UTF-8 (as Windows-1252 if it is none). */
static bool read_species(struct reading *r, OGRFeatureH feature, uint32_t *index)
{
    *index = UINT32_MAX;
    if (r->species < 0 || !OGR_F_IsFieldSetAndNotNull(feature, r->species))
        return true;
    const char *text = OGR_F_GetFieldAsString(feature, r->species);
    char *name = CPLIsUTF8(text, -1) ? CPLStrdup(text) : CPLRecode(text, "CP1252", CPL_ENC_UTF8);
    char *from = name + strspn(name, " \t\r\n");
    size_t n = strlen(from);
    while (n > 0 && strchr(" \t\r\n", from[n - 1]))
        n--;
    from[n] = '\0';
    bool ok = n == 0 || names_intern(&r->names, from, index);
    CPLFree(name);
    return ok;
}

static enum sv_status add_feature(struct reading *r, OGRFeatureH feature, struct sv_error *error)
{
    struct sv_point p = {.height_m = sv_layer_number(feature, r->height),
                         .rotation_deg = sv_layer_number(feature, r->rotation)};
    if (!read_species(r, feature, &p.species))
        return sv_fail(error, SV_ENOMEM, r->options->path, "%s: no memory for its names", r->options->path);
    if (r->x >= 0)
        return add_point(r, sv_layer_number(feature, r->x), sv_layer_number(feature, r->y), &p, error);
    return add_geometry(r, OGR_F_GetGeometryRef(feature), &p, error);
}

static enum sv_status read_features(struct reading *r, struct sv_error *error)
{
    const char *path = r->options->path;
    if (r->options->where) {
        CPLErrorReset();
        if (OGR_L_SetAttributeFilter(r->layer.handle, r->options->where) != OGRERR_NONE)
            return sv_fail(error, SV_EINVAL, "where", "%s: where \"%.120s\": %s", path, r->options->where,
                           CPLGetLastErrorMsg());
    }
    enum sv_status status = SV_OK;
    OGR_L_ResetReading(r->layer.handle);
    while (status == SV_OK) {
        OGRFeatureH feature = sv_layer_next(&r->layer, path, &status, error);
        if (!feature)
            break;
        status = add_feature(r, feature, error);
        OGR_F_Destroy(feature);
    }
    return status;
}

/* Raw coordinates to the scene's; those that have no place there are dropped and counted. */
static enum sv_status place_points(struct reading *r, const struct sv_crs *scene_crs, bool *suspect,
                                   struct sv_error *error)
{
    size_t n = r->count;
    double *x = malloc((n + 1) * sizeof *x), *y = malloc((n + 1) * sizeof *y);
    int *ok = malloc((n + 1) * sizeof *ok);
    struct sv_crs_transform *t = NULL;
    enum sv_status status = SV_OK;
    if (!x || !y || !ok) {
        status =
            sv_fail(error, SV_ENOMEM, r->options->path, "%s: no memory for its points", r->options->path);
        goto out;
    }
    for (size_t k = 0; k < n; k++) {
        x[k] = r->items[k].x;
        y[k] = r->items[k].y;
    }
    status = sv_layer_transform(&r->layer, r->options->path, r->options->crs, scene_crs, x, y, n, &t, suspect,
                                error);
    if (status != SV_OK)
        goto out;
    sv_crs_transform_many(t, n, x, y, ok);
    r->count = 0;
    for (size_t k = 0; k < n; k++) {
        if (!ok[k]) {
            r->skipped++;
            continue;
        }
        r->items[r->count] = r->items[k];
        r->items[r->count].x = x[k];
        r->items[r->count++].y = y[k];
    }
out:
    sv_crs_transform_destroy(t);
    free(x);
    free(y);
    free(ok);
    return status;
}

enum sv_status sv_points_read(const struct sv_points_options *options, const struct sv_crs *scene_crs,
                              struct sv_points *points, struct sv_error *error)
{
    struct reading r = {.options = options};
    struct sv_gdal_trap trap;
    bool suspect = false;
    sv_gdal_trap_begin(&trap);
    enum sv_status status = sv_layer_open(options->path, options->where != NULL, &trap, &r.layer, error);
    if (status == SV_OK)
        status = find_columns(&r, error);
    if (status == SV_OK)
        status = read_features(&r, error);
    if (status == SV_OK)
        status = place_points(&r, scene_crs, &suspect, error);
    sv_layer_close(&r.layer);
    sv_gdal_trap_end(&trap);
    if (status != SV_OK) {
        free(r.items);
        names_finish(&r.names);
        return status;
    }
    free(r.names.slots);
    *points = (struct sv_points){.items = r.items,
                                 .count = r.count,
                                 .names = r.names.items,
                                 .name_count = r.names.count,
                                 .skipped = r.skipped,
                                 .crs_suspect = suspect};
    return SV_OK;
}

void sv_points_finish(struct sv_points *points)
{
    for (size_t k = 0; k < points->name_count; k++)
        free(points->names[k]);
    free(points->names);
    free(points->items);
    *points = (struct sv_points){0};
}
