/* polygons.c - (multi)polygons of a vector file, and fast answers to "is this place in one of them".
 *
 * Even-odd within a polygon (its holes count), union over polygons. The edges are sorted into horizontal
 * rows; a query looks at one row, its edges grouped by polygon: with E edges in about as many rows a query
 * meets a handful of them. An edge belongs to the half-open range of y from its lower to its upper end, so
 * that a place on a border shared by two polygons is in exactly one of them, and no ray through a vertex
 * counts twice (Haines 1994, "Point in polygon strategies"). Long edges are split before they are
 * transformed: a straight line in degrees is no straight line in metres. */
#include <float.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "core/geo/crs.h"
#include "core/geo/gdal_trap.h"
#include "core/geo/layer.h"

enum {
    VERTICES_MAX = 1 << 24,
    ROWS_MAX = 1 << 16,
    ROW_ENTRIES = 16 /* per edge, bounds the index's memory */
};
/* Longest edge that is transformed in one piece, in units of the file: 0.005 degrees is 550 m, whose parallel
 * bends by 6 mm * tan(latitude); 1000 m between two projections bends by millimetres. */
static const double SPLIT_DEG = 0.005, SPLIT_M = 1000;

struct edge {
    double x0, y0, x1, y1; /* y0 < y1 */
    uint32_t polygon;
};

struct sv_polygons {
    double *x, *y; /* all rings' vertices, one after the other */
    size_t vertices, vertex_room;
    struct ring {
        size_t first, count;
        uint32_t polygon;
    } * rings;
    size_t ring_count, ring_room;
    uint32_t polygon_count;
    struct edge *edges; /* by polygon */
    size_t edge_count;
    double box[4], row_height;
    uint32_t rows, *row_first, *row_edges; /* edges of row r: row_edges[row_first[r] .. row_first[r + 1]) */
};

void sv_polygons_destroy(struct sv_polygons *p)
{
    if (!p)
        return;
    free(p->x);
    free(p->y);
    free(p->rings);
    free(p->edges);
    free(p->row_first);
    free(p->row_edges);
    free(p);
}

/* ---- collecting rings ---- */

static bool vertices_reserve(struct sv_polygons *p, size_t more)
{
    if (p->vertices + more <= p->vertex_room)
        return true;
    size_t room = p->vertex_room ? p->vertex_room : 1024;
    while (room < p->vertices + more)
        room *= 2;
    double *x = realloc(p->x, room * sizeof *x);
    if (x)
        p->x = x;
    double *y = realloc(p->y, room * sizeof *y);
    if (y)
        p->y = y;
    if (!x || !y)
        return false;
    p->vertex_room = room;
    return true;
}

static enum sv_status add_ring(struct sv_polygons *p, OGRGeometryH ring, const char *path,
                               struct sv_error *error)
{
    int count = OGR_G_GetPointCount(ring);
    if (count < 3)
        return SV_OK;
    if (p->vertices + (size_t)count > VERTICES_MAX)
        return sv_fail(error, SV_ELIMIT, path, "%s: holds more than %d vertices", path, VERTICES_MAX);
    if (!vertices_reserve(p, (size_t)count))
        return sv_fail(error, SV_ENOMEM, path, "%s: no memory for its polygons", path);
    if (p->ring_count == p->ring_room) {
        size_t room = p->ring_room ? 2 * p->ring_room : 64;
        struct ring *rings = realloc(p->rings, room * sizeof *rings);
        if (!rings)
            return sv_fail(error, SV_ENOMEM, path, "%s: no memory for its polygons", path);
        p->rings = rings;
        p->ring_room = room;
    }
    p->rings[p->ring_count++] = (struct ring){p->vertices, (size_t)count, p->polygon_count};
    for (int k = 0; k < count; k++) {
        double x = OGR_G_GetX(ring, k), y = OGR_G_GetY(ring, k);
        if (!isfinite(x) || !isfinite(y))
            return sv_fail(error, SV_EFORMAT, path, "%s: a polygon has a vertex that is not a number", path);
        p->x[p->vertices] = x;
        p->y[p->vertices++] = y;
    }
    return SV_OK;
}

static enum sv_status add_geometry(struct sv_polygons *p, OGRGeometryH g, const char *path,
                                   struct sv_error *error)
{
    enum sv_status status = SV_OK;
    OGRwkbGeometryType type = g ? wkbFlatten(OGR_G_GetGeometryType(g)) : wkbNone;
    int parts = g ? OGR_G_GetGeometryCount(g) : 0;
    if (type == wkbPolygon && parts > 0) {
        for (int k = 0; k < parts && status == SV_OK; k++)
            status = add_ring(p, OGR_G_GetGeometryRef(g, k), path, error);
        p->polygon_count++;
    } else if (type == wkbMultiPolygon || type == wkbGeometryCollection) {
        for (int k = 0; k < parts && status == SV_OK; k++)
            status = add_geometry(p, OGR_G_GetGeometryRef(g, k), path, error);
    } else if (g && OGR_GT_IsNonLinear(type)) {
        OGRGeometryH straight = OGR_G_GetLinearGeometry(g, 0, NULL);
        if (straight && !OGR_GT_IsNonLinear(wkbFlatten(OGR_G_GetGeometryType(straight))))
            status = add_geometry(p, straight, path, error);
        OGR_G_DestroyGeometry(straight);
    }
    return status;
}

static enum sv_status collect(struct sv_polygons *p, struct sv_layer *layer, const char *path,
                              struct sv_error *error)
{
    enum sv_status status = SV_OK;
    while (status == SV_OK) {
        OGRFeatureH feature = sv_layer_next(layer, path, &status, error);
        if (!feature)
            break;
        status = add_geometry(p, OGR_F_GetGeometryRef(feature), path, error);
        OGR_F_Destroy(feature);
    }
    if (status == SV_OK && p->ring_count == 0)
        return sv_fail(error, SV_EFORMAT, path, "%s: holds no polygon", path);
    return status;
}

/* ---- to the scene's system ---- */

/* Splits all edges longer than `longest`, in place of the vertices; the limit on vertices holds for the
 * outcome. */
static enum sv_status split_edges(struct sv_polygons *p, double longest, const char *path,
                                  struct sv_error *error)
{
    struct sv_polygons q = {0};
    enum sv_status status = SV_OK;
    for (size_t r = 0; r < p->ring_count && status == SV_OK; r++) {
        struct ring *ring = &p->rings[r];
        size_t first = q.vertices;
        for (size_t k = 0; k < ring->count && status == SV_OK; k++) {
            size_t a = ring->first + k, b = ring->first + (k + 1) % ring->count;
            double pieces = fmax(ceil(hypot(p->x[b] - p->x[a], p->y[b] - p->y[a]) / longest), 1);
            if (!((double)q.vertices + pieces <= VERTICES_MAX))
                status = sv_fail(error, SV_ELIMIT, path,
                                 "%s: holds edges so long that splitting them takes more than %d vertices",
                                 path, VERTICES_MAX);
            else if (!vertices_reserve(&q, (size_t)pieces))
                status = sv_fail(error, SV_ENOMEM, path, "%s: no memory for its polygons", path);
            for (size_t s = 0; status == SV_OK && s < (size_t)pieces; s++) {
                double t = (double)s / pieces;
                q.x[q.vertices] = p->x[a] + t * (p->x[b] - p->x[a]);
                q.y[q.vertices++] = p->y[a] + t * (p->y[b] - p->y[a]);
            }
        }
        ring->first = first;
        ring->count = q.vertices - first;
    }
    free(p->x);
    free(p->y);
    p->x = q.x;
    p->y = q.y;
    p->vertices = q.vertices;
    p->vertex_room = q.vertex_room;
    return status;
}

static enum sv_status place_rings(struct sv_polygons *p, const struct sv_layer *layer, const char *path,
                                  const struct sv_crs *scene_crs, struct sv_error *error)
{
    struct sv_crs_transform *t = NULL;
    bool suspect = false;
    int *ok = NULL;
    enum sv_status status =
        sv_layer_transform(layer, path, NULL, scene_crs, p->x, p->y, p->vertices, &t, &suspect, error);
    if (status != SV_OK || sv_crs_transform_is_identity(t))
        goto out;
    OGRSpatialReferenceH srs = OGR_L_GetSpatialRef(layer->handle);
    status = split_edges(p, srs && OSRIsGeographic(srs) ? SPLIT_DEG : SPLIT_M, path, error);
    if (status != SV_OK)
        goto out;
    ok = malloc(p->vertices * sizeof *ok);
    if (!ok) {
        status = sv_fail(error, SV_ENOMEM, path, "%s: no memory for its polygons", path);
        goto out;
    }
    sv_crs_transform_many(t, p->vertices, p->x, p->y, ok);
    for (size_t k = 0; k < p->vertices && status == SV_OK; k++)
        if (!ok[k])
            status = sv_fail(error, SV_EFORMAT, path, "%s: a polygon has a vertex that has no place in %s",
                             path, sv_crs_name(scene_crs));
out:
    sv_crs_transform_destroy(t);
    free(ok);
    return status;
}

/* ---- the index ---- */

static void make_edges(struct sv_polygons *p)
{
    p->box[0] = p->box[1] = INFINITY;
    p->box[2] = p->box[3] = -INFINITY;
    for (size_t r = 0; r < p->ring_count; r++) {
        const struct ring *ring = &p->rings[r];
        for (size_t k = 0; k < ring->count; k++) {
            size_t a = ring->first + k, b = ring->first + (k + 1) % ring->count;
            p->box[0] = fmin(p->box[0], p->x[a]);
            p->box[1] = fmin(p->box[1], p->y[a]);
            p->box[2] = fmax(p->box[2], p->x[a]);
            p->box[3] = fmax(p->box[3], p->y[a]);
            if (p->y[a] == p->y[b])
                continue; /* level edges are crossed by no level ray */
            bool up = p->y[a] < p->y[b];
            size_t lo = up ? a : b, hi = up ? b : a;
            p->edges[p->edge_count++] = (struct edge){p->x[lo], p->y[lo], p->x[hi], p->y[hi], ring->polygon};
        }
    }
}

static uint32_t row_of(const struct sv_polygons *p, double y)
{
    double r = (y - p->box[1]) / p->row_height;
    return r >= p->rows ? p->rows - 1 : r > 0 ? (uint32_t)r : 0;
}

static size_t count_entries(const struct sv_polygons *p)
{
    size_t entries = 0;
    for (size_t k = 0; k < p->edge_count; k++)
        entries += row_of(p, p->edges[k].y1) - row_of(p, p->edges[k].y0) + 1;
    return entries;
}

/* As many rows as edges, fewer while long edges would fill too many of them. */
static bool make_rows(struct sv_polygons *p)
{
    size_t entries = 0;
    p->rows = p->edge_count < ROWS_MAX ? (uint32_t)p->edge_count + 1 : ROWS_MAX;
    for (;; p->rows = (p->rows + 1) / 2) {
        p->row_height = fmax((p->box[3] - p->box[1]) / p->rows, DBL_MIN);
        entries = count_entries(p);
        if (p->rows == 1 || entries <= ROW_ENTRIES * p->edge_count)
            break;
    }
    p->row_first = calloc((size_t)p->rows + 2, sizeof *p->row_first);
    p->row_edges = malloc((entries + 1) * sizeof *p->row_edges);
    if (!p->row_first || !p->row_edges)
        return false;
    /* counting sort: row_first[r + 1] runs from the start of row r to its end, and is then the start of row r
     * + 1 */
    for (size_t k = 0; k < p->edge_count; k++)
        for (uint32_t r = row_of(p, p->edges[k].y0); r <= row_of(p, p->edges[k].y1); r++)
            p->row_first[r + 2]++;
    for (uint32_t r = 2; r < p->rows + 2; r++)
        p->row_first[r] += p->row_first[r - 1];
    for (size_t k = 0; k < p->edge_count; k++)
        for (uint32_t r = row_of(p, p->edges[k].y0); r <= row_of(p, p->edges[k].y1); r++)
            p->row_edges[p->row_first[r + 1]++] = (uint32_t)k;
    return true;
}

static enum sv_status make_index(struct sv_polygons *p, const char *path, struct sv_error *error)
{
    p->edges = malloc((p->vertices + 1) * sizeof *p->edges);
    if (p->edges)
        make_edges(p);
    if (!p->edges || !make_rows(p))
        return sv_fail(error, SV_ENOMEM, path, "%s: no memory for its polygons", path);
    free(p->x);
    free(p->y);
    free(p->rings);
    p->x = p->y = NULL;
    p->rings = NULL;
    return SV_OK;
}

enum sv_status sv_polygons_read(const char *path, const struct sv_crs *scene_crs,
                                struct sv_polygons **polygons, struct sv_error *error)
{
    struct sv_polygons *p = calloc(1, sizeof *p);
    if (!p)
        return sv_fail(error, SV_ENOMEM, path, "%s: no memory for its polygons", path);
    struct sv_gdal_trap trap;
    struct sv_layer layer = {0};
    sv_gdal_trap_begin(&trap);
    enum sv_status status = sv_layer_open(path, false, &trap, &layer, error);
    if (status == SV_OK)
        status = collect(p, &layer, path, error);
    if (status == SV_OK)
        status = place_rings(p, &layer, path, scene_crs, error);
    if (status == SV_OK)
        status = make_index(p, path, error);
    sv_layer_close(&layer);
    sv_gdal_trap_end(&trap);
    if (status == SV_OK)
        *polygons = p;
    else
        sv_polygons_destroy(p);
    return status;
}

enum sv_status sv_polygons_parse(const char *geojson, const struct sv_crs *scene_crs,
                                 struct sv_polygons **polygons, struct sv_error *error)
{
    static const char path[] = "/vsimem/polygon.geojson";
    struct sv_error own;
    VSILFILE *file =
        VSIFileFromMemBuffer(path, (GByte *)(uintptr_t)geojson, (vsi_l_offset)strlen(geojson), FALSE);
    if (!file)
        return sv_fail(error, SV_ENOMEM, "", "no memory for a polygon");
    enum sv_status status = sv_polygons_read(path, scene_crs, polygons, &own);
    VSIFCloseL(file);
    VSIUnlink(path);
    size_t named = sizeof path - 1;
    if (status != SV_OK && strncmp(own.message, path, named) == 0 && own.message[named] == ':')
        return sv_fail(error, status, "", "%s", own.message + named + 2);
    return status == SV_OK ? SV_OK : sv_fail(error, status, "", "%s", own.message);
}

bool sv_polygons_bounds(const struct sv_polygons *polygons, double min[2], double max[2])
{
    if (polygons->polygon_count == 0)
        return false;
    memcpy(min, polygons->box, 2 * sizeof *min);
    memcpy(max, polygons->box + 2, 2 * sizeof *max);
    return true;
}

bool sv_polygons_contain(const struct sv_polygons *p, double x, double y)
{
    if (!(x >= p->box[0] && x <= p->box[2] && y >= p->box[1] && y <= p->box[3]))
        return false;
    uint32_t row = row_of(p, y), polygon = UINT32_MAX;
    bool odd = false;
    for (uint32_t k = p->row_first[row]; k < p->row_first[row + 1]; k++) {
        const struct edge *e = &p->edges[p->row_edges[k]];
        if (e->polygon != polygon) {
            if (odd)
                return true;
            polygon = e->polygon;
        }
        if (y < e->y0 || y >= e->y1)
            continue;
        /* right of the edge: cross product instead of a division, exact for places on its ends */
        if ((x - e->x0) * (e->y1 - e->y0) >= (y - e->y0) * (e->x1 - e->x0))
            odd = !odd;
    }
    return odd;
}
