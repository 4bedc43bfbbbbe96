/* fuzz_scene_file.c - scene files, legal and broken (fuzz_main.h): any bytes are parsed or refused with
 * reasons, what is parsed keeps every promise of scene_file.h, and nothing leaks. */
#include <math.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "core/scene/forest.h"
#include "core/scene/scene_file.h"
#include "tests/fuzz/fuzz_main.h"

const char *const fuzz_words[] = {"{",
                                  "}",
                                  "[",
                                  "]",
                                  ",",
                                  ":",
                                  "\"",
                                  "\\",
                                  "\\u0000",
                                  "\\\\u0000",
                                  "\\uD800",
                                  "null",
                                  "true",
                                  "NaN",
                                  "1e999",
                                  "-1e999",
                                  "-0",
                                  "0.5",
                                  "4294967296",
                                  "9007199254740993",
                                  "\xEF\xBB\xBF",
                                  "\xC0\x80",
                                  "\"terrain\":",
                                  "\"species\":",
                                  "\"forest\":",
                                  "\"procedural\":{}",
                                  "\"scatter\":{\"count\":1}",
                                  "\"points\":\"p\"",
                                  "\"mix\":{}",
                                  "\"oak\"",
                                  "\"*\"",
                                  "\"model\":\"m\"",
                                  "\"sun\":{}",
                                  "\"species_map\":{\"a\":\"oak\"}",
                                  "[[[[[[[[[[[[[[[[[[[[",
                                  "{\"a\":{\"a\":{\"a\":",
                                  "/vsizip/",
                                  "..",
                                  NULL};

static long parsed, refused;

static void broken(const char *promise)
{
    fprintf(stderr, "fuzz_scene_file: %s\n", promise);
    abort();
}

static void check_range(double v, double lo, double hi)
{
    if (!(v >= lo && v <= hi))
        broken("a value out of its range was let pass");
}

static void check_points(const struct sv_scene_spec *s, const struct sv_points_spec *p)
{
    if (!p->points || !p->x || !p->y)
        broken("points without file or columns");
    check_range(p->default_species, -1, s->species_count - 1);
    check_range(p->default_height_m, SV_TREE_HEIGHT_MIN_M, SV_TREE_HEIGHT_MAX_M);
    check_range(p->min_height_m, 0, SV_TREE_HEIGHT_MAX_M);
    for (int k = 0; k < p->map_count; k++) {
        check_range(p->map[k].species, 0, s->species_count - 1);
        if (!p->map[k].from)
            broken("a map entry without a name");
    }
}

static void check_scatter(const struct sv_scene_spec *s, const struct sv_scatter_spec *c)
{
    double sum = 0;
    for (int k = 0; k < s->species_count; k++) {
        check_range(c->mix[k], 0, 1);
        sum += c->mix[k];
    }
    check_range(sum, 1 - 1e-9, 1 + 1e-9);
    check_range(c->count, 0, SV_FOREST_TREES_MAX);
    check_range(c->height_m[0], SV_TREE_HEIGHT_MIN_M, c->height_m[1]);
    check_range(c->height_m[1], c->height_m[0], SV_TREE_HEIGHT_MAX_M);
    check_range(c->min_spacing_m, 0, 10000);
    check_range(c->max_slope_deg, 0, 90);
}

static void check_spec(const struct sv_scene_spec *s)
{
    if (!s->path || !s->name[0] || strlen(s->name) >= SV_SCENE_NAME_MAX)
        broken("no path or name");
    if (!s->terrain.dem) {
        check_range(s->terrain.size_m, 1, 1e6);
        check_range(s->terrain.samples, 2, 8192);
        check_range(s->terrain.relief_m, 0, 9000);
    }
    for (int k = 0; k < s->species_count; k++) {
        if (!s->species[k].name[0])
            broken("a species without a name");
        if (!s->species[k].model)
            check_range(s->species[k].leaves, 0, SV_GROW_LEAVES_MAX);
        check_range((double)s->species[k].habit, 0, SV_HABIT_COUNT - 1);
    }
    for (int k = 0; k < s->forest_count; k++)
        if (s->forest[k].is_scatter)
            check_scatter(s, &s->forest[k].scatter);
        else
            check_points(s, &s->forest[k].points);
    for (int k = 0; k < s->object_count; k++) {
        check_range(s->objects[k].height_m, 0.01, 10000);
        check_range(s->objects[k].x + s->objects[k].y, -2e9, 2e9);
    }
    check_range(s->sun_azimuth_deg, -360, 360);
    check_range(s->sun_elevation_deg, -90, 90);
    check_range(s->relief_distance_m, 1, 100000);
    check_range(s->relief_resolution, 16, 8192);
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    struct sv_scene_spec spec;
    struct sv_errors errors;
    char *text = malloc(size + 1); /* of its own size, so that a byte too far is seen */
    if (!text)
        return 0;
    memcpy(text, data, size);
    text[size] = '\0';
    sv_errors_init(&errors);
    enum sv_status status = sv_scene_spec_parse(text, size, "dir/scene.json", &spec, &errors);
    if ((status == SV_OK) != (errors.total == 0))
        broken("status and errors disagree");
    if (status == SV_OK) {
        parsed++;
        check_spec(&spec);
        sv_scene_spec_finish(&spec);
    } else {
        refused++;
        for (size_t k = 0; k < errors.count; k++)
            if (strncmp(errors.items[k].message, "dir/scene.json: ", 16) != 0)
                broken("an error does not name the file");
        if (errors.items[0].code != status)
            broken("the status is not the first error's");
    }
    sv_errors_finish(&errors);
    free(text);
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
    va_start(args, format);
    t->used += (size_t)vsnprintf(t->out + t->used, FUZZ_INPUT_MAX - t->used, format, args);
    va_end(args);
}

static int roll(struct sv_rng *rng, int sides)
{
    return (int)(sv_rng_next(rng) % (uint64_t)sides);
}

static void add_forest(struct text *t, struct sv_rng *rng)
{
    add(t, ",\"forest\":[");
    for (int k = 0, n = roll(rng, 3); k <= n; k++) {
        add(t, k ? "," : "");
        if (roll(rng, 2))
            add(t,
                "{\"points\":\"p.csv\",\"species\":\"s\",\"default_species\":\"oak\",\"default_height_m\":%d,"
                "\"species_map\":{\"Quercus\":\"oak\",\"*\":\"ash\"},\"min_height_m\":%.2f}",
                1 + roll(rng, 150), sv_rng_unit(rng) * 150);
        else
            add(t,
                "{\"scatter\":{\"count\":%d,\"seed\":%d,\"mix\":{\"oak\":%.3f,\"ash\":1},\"height_m\":[%d,%d]"
                ","
                "\"min_spacing_m\":%.2f,\"max_slope_deg\":%d}}",
                roll(rng, 4194305), roll(rng, 99999), sv_rng_unit(rng), 1 + roll(rng, 20),
                21 + roll(rng, 100), sv_rng_unit(rng) * 10, roll(rng, 91));
    }
    add(t, "]");
}

size_t fuzz_seed_input(struct sv_rng *rng, uint8_t out[FUZZ_INPUT_MAX])
{
    struct text t = {(char *)out, 0};
    add(&t, "{\"name\":\"n%d\",\"terrain\":", roll(rng, 1000));
    if (roll(rng, 2))
        add(&t, "{\"procedural\":{\"size_m\":%d,\"samples\":%d,\"seed\":%d}}", 1 + roll(rng, 10000),
            2 + roll(rng, 8000), roll(rng, 1000));
    else
        add(&t, "{\"dem\":\"d.tif\",\"imagery\":\"i.tif\",\"imagery_bands\":[3,2,%d],\"nodata\":%d}",
            1 + roll(rng, 9), roll(rng, 100) - 50);
    add(&t,
        ",\"species\":[{\"name\":\"oak\",\"model\":\"o.glb\"},{\"name\":\"ash\",\"procedural\":{\"habit\":"
        "\"shrub\",\"leaves\":%d}}]",
        roll(rng, 1000001));
    if (roll(rng, 4))
        add_forest(&t, rng);
    if (roll(rng, 2))
        add(&t, ",\"objects\":[{\"model\":\"h.obj\",\"x\":%d,\"y\":%.3f,\"height_m\":6}]", roll(rng, 1000),
            sv_rng_unit(rng) * 1e6);
    if (roll(rng, 2))
        add(&t, ",\"sun\":{\"azimuth_deg\":%d,\"elevation_deg\":%d}", roll(rng, 721) - 360,
            roll(rng, 181) - 90);
    add(&t, "}");
    return t.used;
}

void fuzz_report(void)
{
    printf("%ld parsed, %ld refused\n", parsed, refused);
}
