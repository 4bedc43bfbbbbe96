/* fuzz_patch.c - bodies of PATCH /v1/scene, legal and broken (fuzz_main.h): any bytes are parsed or refused
 * with reasons, what is parsed keeps every promise of core/scene/patch.h, and nothing leaks. */
#include <math.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "api/patch_parse.h"
#include "core/scene/forest.h"
#include "core/scene/id.h"
#include "tests/fuzz/fuzz_main.h"

const char *const fuzz_words[] = {"{",
                                  "}",
                                  "[",
                                  "]",
                                  ",",
                                  ":",
                                  "\"",
                                  "\\u0000",
                                  "null",
                                  "true",
                                  "1e999",
                                  "-0",
                                  "0.5",
                                  "4294967296",
                                  "2147483648",
                                  "\xC0\x80",
                                  ",\"lon\":8",
                                  ",\"lat\":47",
                                  ",\"x\":1",
                                  "\"sun\":{}",
                                  "\"trees\":{}",
                                  "\"objects\":{}",
                                  "\"remove\":{}",
                                  "\"add\":[]",
                                  "\"within\":null",
                                  "[[0,0],[1,0],[1,1],[0,0]]",
                                  "\"Polygon\"",
                                  "\"MultiPolygon\"",
                                  "\"oak\"",
                                  "\"scatter\":{\"count\":1}",
                                  "\"time\":\"2026-01-01T00:00:00Z\"",
                                  "[[[[[[[[[[[[[[[[[[[[",
                                  NULL};

static struct sv_species_spec species[2] = {{.name = "oak"}, {.name = "fir"}};
static const struct sv_scene_spec scene = {.path = "dir/scene.json", .species = species, .species_count = 2};
static long parsed, refused;

static void broken(const char *promise)
{
    fprintf(stderr, "fuzz_patch: %s\n", promise);
    abort();
}

static void check_range(double v, double lo, double hi)
{
    if (!(v >= lo && v <= hi))
        broken("a value out of its range was let pass");
}

static void check_place(double x, double y, double lon, double lat)
{
    if (isnan(x) != isnan(y) || isnan(lon) != isnan(lat) || isnan(x) == isnan(lon))
        broken("a place that is none, or two");
    if (!isnan(lat))
        check_range(lat, -90, 90);
}

static void check_add(const struct sv_patch_add *a)
{
    if (a->is_scatter) {
        check_range(a->scatter.mix[0] + a->scatter.mix[1], 1 - 1e-9, 1 + 1e-9);
        check_range(a->scatter.height_m[0], SV_TREE_HEIGHT_MIN_M, a->scatter.height_m[1]);
        check_range(a->scatter.count, 0, SV_FOREST_TREES_MAX);
        return;
    }
    check_place(a->tree.x, a->tree.y, a->tree.lon, a->tree.lat);
    check_range(a->tree.species, 0, 1);
    check_range(a->tree.height_m, SV_TREE_HEIGHT_MIN_M, SV_TREE_HEIGHT_MAX_M);
}

static void check_patch(const struct sv_scene_patch *p)
{
    for (int k = 0; k < p->add_count; k++)
        check_add(&p->add[k]);
    for (int k = 0; k < p->tree_id_count; k++)
        check_range(p->tree_ids[k], SV_ID_TREE_FIRST, UINT32_MAX);
    for (int k = 0; k < p->object_id_count; k++)
        check_range(p->object_ids[k], SV_ID_OBJECT_FIRST, SV_ID_TREE_FIRST - 1);
    if (p->has_near) {
        check_place(p->near.x, p->near.y, p->near.lon, p->near.lat);
        check_range(p->near.radius_m, 0, 1e6);
    }
    if (!isnan(p->sun_time_s) && (!isnan(p->sun_azimuth_deg) || !isnan(p->sun_elevation_deg)))
        broken("a moment and angles");
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    struct sv_scene_patch patch;
    struct sv_errors errors;
    char *text = malloc(size ? size : 1); /* of its own size, so that a byte too far is seen */
    if (!text)
        return 0;
    memcpy(text, data, size);
    sv_errors_init(&errors);
    enum sv_status status = sv_api_patch_parse(text, size, &scene, &patch, &errors);
    if ((status == SV_OK) != (errors.total == 0))
        broken("status and errors disagree");
    if (status == SV_OK) {
        parsed++;
        check_patch(&patch);
        sv_scene_patch_finish(&patch);
    } else {
        refused++;
        if (errors.items[0].code != status)
            broken("the status is not the first error's");
    }
    sv_errors_finish(&errors);
    free(text);
    return 0;
}

/* ---- well-formed bodies ---- */

struct text {
    char *out;
    size_t used;
};

static void add(struct text *t, const char *format, ...) SV_PRINTF(2, 3);
static void add(struct text *t, const char *format, ...)
{
    va_list args;
    va_start(args, format);
    t->used += (size_t)vsnprintf(t->out + t->used, FUZZ_INPUT_MAX - t->used, format, args);
    va_end(args);
}

static int roll(struct sv_rng *rng, int sides)
{
    return (int)(sv_rng_next(rng) % (uint64_t)sides);
}

static void add_area(struct text *t, struct sv_rng *rng)
{
    bool multi = roll(rng, 2);
    int side = 1 + roll(rng, 90);
    add(t, "\"within\":{\"type\":\"%sPolygon\",\"coordinates\":%s[[[0,0],[%d,0],[%d,%d,5],[0,0]]]%s}",
        multi ? "Multi" : "", multi ? "[" : "", side, side, side, multi ? "]" : "");
}

static void add_trees(struct text *t, struct sv_rng *rng)
{
    add(t, ",\"trees\":{\"add\":[");
    for (int k = 0, n = roll(rng, 3); k <= n; k++) {
        add(t, k ? "," : "");
        if (roll(rng, 3)) {
            add(t, "{\"%s\":%d,\"%s\":%d,\"species\":\"fir\",\"height_m\":%.2f}", k ? "x" : "lon",
                roll(rng, 90), k ? "y" : "lat", roll(rng, 90), 1 + sv_rng_unit(rng) * 140);
        } else {
            add(t, "{\"scatter\":{\"count\":%d,\"mix\":{\"oak\":%.3f,\"fir\":1},", roll(rng, 5000),
                sv_rng_unit(rng));
            add_area(t, rng);
            add(t, "}}");
        }
    }
    add(t, "],\"remove\":{\"ids\":[%u,%u],", SV_ID_TREE_FIRST + (uint32_t)roll(rng, 900), UINT32_MAX);
    add_area(t, rng);
    add(t, ",\"near\":{\"x\":%d,\"y\":1,\"radius_m\":%d}}}", roll(rng, 1000), roll(rng, 100));
}

size_t fuzz_seed_input(struct sv_rng *rng, uint8_t out[FUZZ_INPUT_MAX])
{
    struct text t = {(char *)out, 0};
    if (roll(rng, 2))
        add(&t, "{\"sun\":{\"azimuth_deg\":%d,\"elevation_deg\":%d}", roll(rng, 721) - 360,
            roll(rng, 181) - 90);
    else
        add(&t, "{\"sun\":{\"time\":\"20%02d-06-21T12:00:00+02:00\"}", roll(rng, 100));
    if (roll(rng, 4))
        add_trees(&t, rng);
    if (roll(rng, 2))
        add(&t, ",\"objects\":{\"remove\":{\"ids\":[%u]}}", SV_ID_OBJECT_FIRST + (uint32_t)roll(rng, 9));
    add(&t, "}");
    return t.used;
}

void fuzz_report(void)
{
    printf("%ld parsed, %ld refused\n", parsed, refused);
}
