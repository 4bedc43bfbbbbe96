/* fuzz_points.c - tree inventories, legal and broken (fuzz_main.h): bytes that start with "{" go to OGR as
 * GeoJSON, points and polygons, all others as CSV. Any bytes are read or refused with a reason, what is read
 * keeps every promise of geo.h, and nothing leaks or prints. */
#include <math.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <cpl_string.h>
#include <cpl_vsi.h>

#include "core/geo/geo.h"
#include "tests/fuzz/fuzz_main.h"

const char *const fuzz_words[] = {"\n",
                                  "\r\n",
                                  ",",
                                  ";",
                                  "\t",
                                  "\"",
                                  "\"\"",
                                  "\xEF\xBB\xBF",
                                  "\xFF\xFE",
                                  "\xC0\x80",
                                  "x,y",
                                  "x",
                                  "WKT",
                                  "species",
                                  "height_m",
                                  "nan",
                                  "inf",
                                  "1e999",
                                  "-0",
                                  "1,5",
                                  "0x10",
                                  "4e-324",
                                  "180.0000001",
                                  "POINT (1 2)",
                                  "\"POINT EMPTY\"",
                                  "\"MULTIPOINT ((1 2),(3 4))\"",
                                  "\"CURVEPOLYGON ((0 0,1 1,2 0,0 0))\"",
                                  "\"POLYGON ((0 0,1 0,1 1,0 0))\"",
                                  "\"GEOMETRYCOLLECTION (GEOMETRYCOLLECTION (POINT (1 2)))\"",
                                  "\"type\":\"Point\"",
                                  "\"type\":\"Polygon\"",
                                  "\"geometry\":null",
                                  "[1,2]",
                                  "[[[",
                                  "]",
                                  "{",
                                  "}",
                                  "1e300",
                                  NULL};

static long seen_points, seen_files, seen_polygons, refused;

static void broken(const char *promise)
{
    fprintf(stderr, "fuzz_points: %s\n", promise);
    abort();
}

static void check_refusal(enum sv_status status, const struct sv_error *error)
{
    refused++;
    if (error->code != status || !error->message[0] || strchr(error->message, '\n'))
        broken("a refusal without its reason on one line");
}

static void check_points(struct sv_points *p)
{
    seen_files++;
    seen_points += (long)p->count;
    for (size_t k = 0; k < p->count; k++) {
        const struct sv_point *t = &p->items[k];
        if (!isfinite(t->x) || !isfinite(t->y) || isinf(t->height_m) || isinf(t->rotation_deg))
            broken("a point with infinite numbers");
        if (t->species != UINT32_MAX && t->species >= p->name_count)
            broken("a species that is not in the list");
    }
    for (size_t k = 0; k < p->name_count; k++) {
        if (!p->names[k][0] || !CPLIsUTF8(p->names[k], -1))
            broken("a name that is empty or no UTF-8");
        for (size_t l = 0; l < k; l++)
            if (!strcmp(p->names[k], p->names[l]))
                broken("a name that is there twice");
    }
    sv_points_finish(p);
}

static void read_both_ways(const char *path, const struct sv_crs *crs)
{
    static const struct sv_points_options ways[] = {
        {.species = "species", .height = "height_m"},
        {.where = "height_m > 5"},
        {.crs = "EPSG:4326", .rotation = "rot"},
    };
    for (size_t k = 0; k < sizeof ways / sizeof ways[0]; k++) {
        struct sv_points_options o = ways[k];
        struct sv_points p = {0};
        struct sv_error error = {0};
        o.path = path;
        enum sv_status status = sv_points_read(&o, crs, &p, &error);
        if (status == SV_OK)
            check_points(&p);
        else
            check_refusal(status, &error);
        if (status != SV_OK && (p.items || p.names))
            broken("a refusal that wrote its result");
    }
}

static void read_polygons(const char *path, const struct sv_crs *crs)
{
    struct sv_polygons *p = NULL;
    struct sv_error error = {0};
    enum sv_status status = sv_polygons_read(path, crs, &p, &error);
    if (status != SV_OK) {
        check_refusal(status, &error);
        return;
    }
    double lo[2], hi[2];
    seen_polygons++;
    if (!sv_polygons_bounds(p, lo, hi) || !(lo[0] <= hi[0]) || !(lo[1] <= hi[1]))
        broken("polygons without bounds");
    for (int k = -1; k <= 9; k++)
        if (sv_polygons_contain(p, lo[0] + 0.125 * k * (hi[0] - lo[0]),
                                lo[1] + 0.125 * k * (hi[1] - lo[1])) &&
            (k < 0 || k > 8))
            broken("a place outside the bounds was inside");
    sv_polygons_destroy(p);
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    static struct sv_crs *systems[2];
    static uint8_t copy[FUZZ_INPUT_MAX];
    if (size > sizeof copy)
        return 0;
    if (!systems[0]) {
        sv_geo_init();
        if (sv_crs_create_local(&systems[0], NULL) != SV_OK ||
            sv_crs_create("EPSG:32633", &systems[1], NULL) != SV_OK)
            broken("no systems");
    }
    bool json = size > 0 && data[0] == '{';
    const char *path = json ? "/vsimem/fuzz.geojson" : "/vsimem/fuzz.csv";
    memcpy(copy, data, size); /* GDAL's memory files want to own or to write */
    VSILFILE *file = VSIFileFromMemBuffer(path, copy, size, FALSE);
    if (!file)
        broken("no memory file");
    VSIFCloseL(file);
    const struct sv_crs *crs = systems[size % 2];
    read_both_ways(path, crs);
    read_polygons(path, crs);
    VSIUnlink(path);
    return 0;
}

/* ---- well-formed files ---- */

struct text {
    char *out;
    size_t used;
};

static void add(struct text *t, const char *format, ...) SV_PRINTF(2, 3);
static void add(struct text *t, const char *format, ...)
{
    va_list args;
    if (t->used + 200 > FUZZ_INPUT_MAX)
        return;
    va_start(args, format);
    t->used += (size_t)vsnprintf(t->out + t->used, FUZZ_INPUT_MAX - t->used, format, args);
    va_end(args);
}

static int roll(struct sv_rng *rng, int sides)
{
    return (int)(sv_rng_next(rng) % (uint64_t)sides);
}

static void add_csv(struct text *t, struct sv_rng *rng)
{
    static const char *const species[] = {"Picea abies", "\"Fagus, red\"", "",
                                          " oak ",       "F\xF6hre",       "\xC5\x91rfa"};
    char comma = ",,;\t"[roll(rng, 4)];
    add(t, "x%cy%cspecies%cheight_m%crot\n", comma, comma, comma, comma);
    for (int k = 0, n = roll(rng, 30); k < n; k++)
        add(t, "%.3f%c%.2f%c%s%c%.1f%c%d\n", sv_rng_range(rng, -1000, 1000), comma,
            sv_rng_range(rng, -90, 90), comma, species[roll(rng, 6)], comma, sv_rng_range(rng, 0, 40), comma,
            roll(rng, 360));
}

static void add_geojson(struct text *t, struct sv_rng *rng)
{
    add(t, "{\"type\":\"FeatureCollection\",\"features\":[");
    for (int k = 0, n = 1 + roll(rng, 8); k < n; k++) {
        double x = sv_rng_range(rng, 0, 20), y = sv_rng_range(rng, -80, 80);
        add(t,
            "%s{\"type\":\"Feature\",\"properties\":{\"height_m\":%d,\"species\":\"s%d\",\"rot\":%d},"
            "\"geometry\":",
            k ? "," : "", roll(rng, 40), roll(rng, 3), roll(rng, 400));
        if (roll(rng, 2))
            add(t, "{\"type\":\"Point\",\"coordinates\":[%.6f,%.6f]}}", x, y);
        else
            add(t, "{\"type\":\"Polygon\",\"coordinates\":[[[%g,%g],[%g,%g],[%g,%g],[%g,%g]]]}}", x, y,
                x + 0.01, y, x, y + 0.01, x, y);
    }
    add(t, "]}");
}

size_t fuzz_seed_input(struct sv_rng *rng, uint8_t out[FUZZ_INPUT_MAX])
{
    struct text t = {(char *)out, 0};
    if (roll(rng, 3))
        add_csv(&t, rng);
    else
        add_geojson(&t, rng);
    return t.used;
}

void fuzz_report(void)
{
    printf("%ld readings with %ld points, %ld with polygons, %ld refused\n", seen_files, seen_points,
           seen_polygons, refused);
}
