/* test_scene_file.c - every key of the scene file: read, defaulted, refused with its key path, value and
 * range. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>
#include <cmocka.h>

#include "core/scene/forest.h"
#include "core/scene/scene_file.h"

static enum sv_status parse(const char *text, struct sv_scene_spec *spec, struct sv_errors *errors)
{
    sv_errors_init(errors);
    memset(spec, 0x5A, sizeof *spec);
    return sv_scene_spec_parse(text, strlen(text), "/maps/demo.json", spec, errors);
}

/* The wire contract's own example. */
static const char EXAMPLE[] =
    "{\"name\": \"demo\","
    "\"terrain\": {\"dem\": \"dem.tif\", \"imagery\": \"ortho.tif\", \"crs\": \"EPSG:32633\", \"nodata\": "
    "-9999,"
    "  \"height_unit_m\": 0.3048, \"imagery_bands\": [3,2,1]},"
    "\"species\": [{\"name\": \"spruce\", \"model\": \"models/spruce.glb\"},"
    "  {\"name\": \"beech\", \"procedural\": {\"habit\": \"broadleaf\", \"leaves\": 38952, \"seed\": 7}}],"
    "\"forest\": ["
    "  {\"points\": \"/data/trees.csv\", \"x\": \"E\", \"y\": \"N\", \"species\": \"art\", \"height_m\": "
    "\"h\","
    "   \"rotation_deg\": \"rot\", \"crs\": \"EPSG:4326\", \"default_species\": \"beech\", "
    "\"default_height_m\": 12.5,"
    "   \"min_height_m\": 2, \"where\": \"status = 1\", \"species_map\": {\"Picea abies\": \"spruce\", "
    "\"*\": \"beech\"}},"
    "  {\"scatter\": {\"count\": 40000, \"seed\": 9007199254740992, \"mix\": {\"spruce\": 3, \"beech\": 1}, "
    "\"height_m\": [8, 22],"
    "   \"min_spacing_m\": 2.5, \"max_slope_deg\": 40, \"within\": \"stand.geojson\"}}],"
    "\"objects\": [{\"model\": \"hut.glb\", \"x\": 500120, \"y\": 5200340, \"heading_deg\": 30, "
    "\"height_m\": 6,"
    "  \"relief_resolution\": 256}],"
    "\"sun\": {\"azimuth_deg\": 200, \"elevation_deg\": 15}, \"relief\": {\"distance_m\": 50, "
    "\"resolution\": 512}}";

static void check_example_head(const struct sv_scene_spec *s)
{
    const struct sv_terrain_spec *t = &s->terrain;
    assert_string_equal(s->path, "/maps/demo.json");
    assert_string_equal(s->name, "demo");
    assert_string_equal(t->dem, "/maps/dem.tif");
    assert_string_equal(t->imagery, "/maps/ortho.tif");
    assert_string_equal(t->crs, "EPSG:32633");
    assert_true(t->has_nodata && t->nodata == -9999 && t->height_unit_m == 0.3048);
    assert_true(t->imagery_bands[0] == 3 && t->imagery_bands[1] == 2 && t->imagery_bands[2] == 1);
    assert_int_equal(s->species_count, 2);
    assert_string_equal(s->species[0].name, "spruce");
    assert_string_equal(s->species[0].model, "/maps/models/spruce.glb");
    assert_string_equal(s->species[1].name, "beech");
    assert_null(s->species[1].model);
    assert_int_equal(s->species[1].habit, SV_HABIT_BROADLEAF);
    assert_int_equal(s->species[1].leaves, 38952);
    assert_int_equal(s->species[1].seed, 7);
    assert_true(s->sun_azimuth_deg == 200 && s->sun_elevation_deg == 15);
    assert_true(s->has_relief && s->relief_distance_m == 50 && s->relief_resolution == 512);
    assert_int_equal(s->object_count, 1);
    assert_string_equal(s->objects[0].model, "/maps/hut.glb");
    assert_true(s->objects[0].x == 500120 && s->objects[0].y == 5200340 && s->objects[0].heading_deg == 30 &&
                s->objects[0].height_m == 6 && s->objects[0].relief_resolution == 256);
}

static void test_example(void **state)
{
    (void)state;
    struct sv_scene_spec s;
    struct sv_errors errors;
    assert_int_equal(parse(EXAMPLE, &s, &errors), SV_OK);
    assert_int_equal(errors.total, 0);
    check_example_head(&s);
    assert_int_equal(s.forest_count, 2);
    const struct sv_points_spec *p = &s.forest[0].points;
    assert_false(s.forest[0].is_scatter);
    assert_string_equal(p->points, "/data/trees.csv");
    assert_string_equal(p->x, "E");
    assert_string_equal(p->y, "N");
    assert_string_equal(p->species, "art");
    assert_string_equal(p->height, "h");
    assert_string_equal(p->rotation, "rot");
    assert_string_equal(p->crs, "EPSG:4326");
    assert_string_equal(p->where, "status = 1");
    assert_true(p->default_species == 1 && p->default_height_m == 12.5 && p->min_height_m == 2);
    assert_int_equal(p->map_count, 2);
    assert_string_equal(p->map[0].from, "Picea abies");
    assert_int_equal(p->map[0].species, 0);
    assert_string_equal(p->map[1].from, "*");
    assert_int_equal(p->map[1].species, 1);
    const struct sv_scatter_spec *c = &s.forest[1].scatter;
    assert_true(s.forest[1].is_scatter);
    assert_int_equal(c->count, 40000);
    assert_true(c->seed == UINT64_C(9007199254740992));
    assert_true(c->mix[0] == 0.75 && c->mix[1] == 0.25);
    assert_true(c->height_m[0] == 8 && c->height_m[1] == 22 && c->min_spacing_m == 2.5 &&
                c->max_slope_deg == 40);
    assert_string_equal(c->within, "/maps/stand.geojson");
    sv_scene_spec_finish(&s);
    sv_scene_spec_finish(&s);
}

static void test_defaults(void **state)
{
    (void)state;
    struct sv_scene_spec s;
    struct sv_errors errors;
    assert_int_equal(parse("{\"terrain\":{\"procedural\":{}},"
                           "\"species\":[{\"name\":\"a\",\"procedural\":{\"habit\":\"palm\"}},{\"name\":"
                           "\"b\",\"model\":\"b.obj\"}],"
                           "\"forest\":[{\"points\":\"t.csv\"},{\"scatter\":{\"count\":5}},"
                           "{\"scatter\":{\"count\":5,\"height_m\":3}}]}",
                           &s, &errors),
                     SV_OK);
    assert_string_equal(s.name, "scene");
    assert_null(s.terrain.dem);
    assert_true(s.terrain.size_m == 2000 && s.terrain.samples == 1024 && s.terrain.relief_m == 150 &&
                s.terrain.seed == 1);
    assert_true(s.sun_azimuth_deg == 135 && s.sun_elevation_deg == 40);
    assert_true(!s.has_relief && s.relief_distance_m == 100 && s.relief_resolution == 1024);
    assert_true(s.species[0].habit == SV_HABIT_PALM && s.species[0].leaves == 38952 &&
                s.species[0].seed == 1);
    const struct sv_points_spec *p = &s.forest[0].points;
    assert_string_equal(p->x, "x");
    assert_string_equal(p->y, "y");
    assert_true(!p->species && !p->height && !p->rotation && !p->crs && !p->where && !p->map);
    assert_true(p->default_species == -1 && p->default_height_m == 12 && p->min_height_m == 0);
    const struct sv_scatter_spec *c = &s.forest[1].scatter;
    assert_true(c->mix[0] == 0.5 && c->mix[1] == 0.5 && c->seed == 1 && !c->within);
    assert_true(c->height_m[0] == 8 && c->height_m[1] == 22 && c->min_spacing_m == 2 &&
                c->max_slope_deg == 45);
    assert_true(s.forest[2].scatter.height_m[0] == 3 && s.forest[2].scatter.height_m[1] == 3);
    assert_int_equal(s.object_count, 0);
    sv_scene_spec_finish(&s);
}

/* One thing wrong each. Expected: the key path, and a part of the message. */
#define TERRAIN "\"terrain\":{\"procedural\":{}}"
#define SPECIES "\"species\":[{\"name\":\"oak\",\"model\":\"o.obj\"},{\"name\":\"ash\",\"model\":\"a.obj\"}]"
#define GOOD TERRAIN "," SPECIES
static const struct {
    const char *text, *path, *message;
} BAD[] = {
    {"{" GOOD ",\"trees\":[]}", "trees",
     "not a known key here; known: name, terrain, species, forest, objects, sun, relief"},
    {"{" SPECIES "}", "terrain", "is missing; it must be an object"},
    {"[]", "", "must be an object, is an array"},
    {"null", "", "must be an object, is null"},
    {"{" GOOD ",\"name\":\"\"}", "name", "\"\" has 0 bytes, legal is 1 .. 63"},
    {"{" GOOD ",\"name\":3}", "name", "must be a string, is a number"},
    {"{" GOOD ",\"name\":\"a\\nb\"}", "name", "control character"},
    {"{\"terrain\":{}}", "terrain", "needs \"dem\" or \"procedural\""},
    {"{\"terrain\":[]}", "terrain", "must be an object, is an array"},
    {"{\"terrain\":{\"dem\":\"d\",\"procedural\":{}}}", "terrain", "both \"dem\" and \"procedural\""},
    {"{\"terrain\":{\"dem\":\"\"}}", "terrain.dem", "0 bytes"},
    {"{\"terrain\":{\"dem\":\"d\",\"nodata\":\"x\"}}", "terrain.nodata",
     "must be a number, is the string \"x\""},
    {"{\"terrain\":{\"dem\":\"d\",\"nodata\":1e999}}", "terrain.nodata", "too large for a number"},
    {"{\"terrain\":{\"dem\":\"d\",\"height_unit_m\":0}}", "terrain.height_unit_m",
     "0 is outside; legal is 0.001 .. 1000 m"},
    {"{\"terrain\":{\"dem\":\"d\",\"imagery\":\"i\",\"imagery_bands\":[1,2]}}", "terrain.imagery_bands",
     "array of three"},
    {"{\"terrain\":{\"dem\":\"d\",\"imagery\":\"i\",\"imagery_bands\":[1,2,0]}}", "terrain.imagery_bands[2]",
     "0 is outside; legal is 1 .. 65535"},
    {"{\"terrain\":{\"dem\":\"d\",\"imagery_bands\":[1,2,3]}}", "terrain",
     "\"imagery_bands\" needs \"imagery\""},
    {"{\"terrain\":{\"procedural\":{},\"nodata\":0}}", "terrain.nodata",
     "not a known key here; known: procedural"},
    {"{\"terrain\":{\"procedural\":{\"size_m\":0.5}}}", "terrain.procedural.size_m",
     "0.5 is outside; legal is 1 .. 1000000 m"},
    {"{\"terrain\":{\"procedural\":{\"samples\":2.5}}}", "terrain.procedural.samples",
     "2.5 is not an integer; legal is 2 .. 8192"},
    {"{\"terrain\":{\"procedural\":{\"samples\":8193}}}", "terrain.procedural.samples",
     "8193 is outside; legal is 2 .. 8192"},
    {"{\"terrain\":{\"procedural\":{\"relief_m\":-1}}}", "terrain.procedural.relief_m",
     "-1 is outside; legal is 0 .. 9000 m"},
    {"{\"terrain\":{\"procedural\":{\"seed\":-1}}}", "terrain.procedural.seed",
     "-1 is outside; legal is 0 .. 9007199254740992"},
    {"{\"terrain\":{\"procedural\":{\"seed\":1e300}}}", "terrain.procedural.seed", "1e+300 is outside"},
    {"{\"terrain\":{\"procedural\":{\"seed\":true}}}", "terrain.procedural.seed",
     "must be an integer, is a boolean"},
    {"{" TERRAIN ",\"species\":{}}", "species", "must be an array, is an object"},
    {"{" TERRAIN ",\"species\":[4]}", "species[0]", "must be an object, is a number"},
    {"{" TERRAIN ",\"species\":[{\"name\":\"a\"}]}", "species[0]", "needs \"model\" or \"procedural\""},
    {"{" TERRAIN ",\"species\":[{\"model\":\"a\"}]}", "species[0].name",
     "is missing; it must be a string of 1 .. 63 bytes"},
    {"{" TERRAIN ",\"species\":[{\"name\":\"a\",\"procedural\":{\"habit\":\"oak\"}}]}",
     "species[0].procedural.habit", "\"oak\" is none of broadleaf, conifer, poplar, shrub, palm"},
    {"{" TERRAIN ",\"species\":[{\"name\":\"a\",\"procedural\":{}}]}", "species[0].procedural.habit",
     "is missing; it must be a string"},
    {"{" TERRAIN ",\"species\":[{\"name\":\"a\",\"procedural\":{\"habit\":\"palm\",\"leaves\":1000001}}]}",
     "species[0].procedural.leaves", "1000001 is outside; legal is 0 .. 1000000"},
    {"{" TERRAIN ",\"species\":[{\"name\":\"a\",\"model\":\"m\"},{\"name\":\"a\",\"model\":\"n\"}]}",
     "species[1]", "the name \"a\" is that of species[0], too"},
    {"{" TERRAIN ",\"species\":[{\"name\":"
     "\"0123456789012345678901234567890123456789012345678901234567890123\",\"model\":\"m\"}]}",
     "species[0].name", "64 bytes, legal is 1 .. 63"},
    {"{" GOOD ",\"forest\":[{}]}", "forest[0]", "needs \"points\" or \"scatter\""},
    {"{" GOOD ",\"forest\":[{\"points\":\"p\",\"scatter\":{}}]}", "forest[0]", "both"},
    {"{" TERRAIN ",\"forest\":[{\"points\":\"p\"}]}", "forest[0]", "at least one entry in \"species\""},
    {"{" GOOD ",\"forest\":[{\"points\":\"p\",\"default_species\":\"elm\"}]}", "forest[0].default_species",
     "no species is named \"elm\"; there are oak, ash"},
    {"{" GOOD ",\"forest\":[{\"points\":\"p\",\"default_height_m\":0.04}]}", "forest[0].default_height_m",
     "0.04 is outside; legal is 0.05 .. 150 m"},
    {"{" GOOD ",\"forest\":[{\"points\":\"p\",\"min_height_m\":151}]}", "forest[0].min_height_m",
     "151 is outside; legal is 0 .. 150 m"},
    {"{" GOOD ",\"forest\":[{\"points\":\"p\",\"species_map\":{\"Ulmus\":\"elm\"}}]}",
     "forest[0].species_map.Ulmus", "no species is named"},
    {"{" GOOD ",\"forest\":[{\"points\":\"p\",\"species_map\":{\"Q\":\"oak\",\"Q\":\"ash\"}}]}",
     "forest[0].species_map.Q", "twice"},
    {"{" GOOD ",\"forest\":[{\"points\":\"p\",\"species_map\":[]}]}", "forest[0].species_map",
     "must be an object"},
    {"{" GOOD ",\"forest\":[{\"points\":\"p\",\"count\":5}]}", "forest[0].count", "not a known key"},
    {"{" GOOD ",\"forest\":[{\"scatter\":{}}]}", "forest[0].scatter.count",
     "is missing; it must be an integer, 0 .. 4194304"},
    {"{" GOOD ",\"forest\":[{\"scatter\":{\"count\":-1}}]}", "forest[0].scatter.count",
     "-1 is outside; legal is 0 .. 4194304"},
    {"{" GOOD ",\"forest\":[{\"scatter\":{\"count\":4194305}}]}", "forest[0].scatter.count",
     "4194305 is outside"},
    {"{" GOOD ",\"forest\":[{\"scatter\":{\"count\":1,\"mix\":{\"elm\":1}}}]}", "forest[0].scatter.mix.elm",
     "no species is named \"elm\""},
    {"{" GOOD ",\"forest\":[{\"scatter\":{\"count\":1,\"mix\":{\"oak\":-0.1}}}]}",
     "forest[0].scatter.mix.oak", "-0.1 is outside; legal is 0 .."},
    {"{" GOOD ",\"forest\":[{\"scatter\":{\"count\":1,\"mix\":{\"oak\":0}}}]}", "forest[0].scatter.mix",
     "shares sum to 0"},
    {"{" GOOD ",\"forest\":[{\"scatter\":{\"count\":1,\"mix\":{}}}]}", "forest[0].scatter.mix",
     "shares sum to 0"},
    {"{" GOOD ",\"forest\":[{\"scatter\":{\"count\":1,\"mix\":{\"oak\":1,\"oak\":2}}}]}",
     "forest[0].scatter.mix.oak", "twice"},
    {"{" GOOD ",\"forest\":[{\"scatter\":{\"count\":1,\"height_m\":[9,8]}}]}", "forest[0].scatter.height_m",
     "least 9 is more than most 8"},
    {"{" GOOD ",\"forest\":[{\"scatter\":{\"count\":1,\"height_m\":[0,8]}}]}",
     "forest[0].scatter.height_m[0]", "0 is outside; legal is 0.05 .. 150 m"},
    {"{" GOOD ",\"forest\":[{\"scatter\":{\"count\":1,\"height_m\":[1,2,3]}}]}", "forest[0].scatter.height_m",
     "[least, most]"},
    {"{" GOOD ",\"forest\":[{\"scatter\":{\"count\":1,\"max_slope_deg\":91}}]}",
     "forest[0].scatter.max_slope_deg", "91 is outside; legal is 0 .. 90 deg"},
    {"{" GOOD ",\"forest\":[{\"scatter\":{\"count\":1,\"min_spacing_m\":-1}}]}",
     "forest[0].scatter.min_spacing_m", "-1 is outside"},
    {"{" GOOD ",\"forest\":[{\"scatter\":{\"count\":1,\"within\":7}}]}", "forest[0].scatter.within",
     "must be a string, is a number"},
    {"{" GOOD ",\"objects\":[{\"model\":\"m\",\"x\":1,\"height_m\":1}]}", "objects[0].y",
     "is missing; it must be a number of metres, -1000000000 .. 1000000000"},
    {"{" GOOD ",\"objects\":[{\"model\":\"m\",\"x\":1,\"y\":1}]}", "objects[0].height_m",
     "is missing; it must be a number of metres, 0.01 .. 10000"},
    {"{" GOOD ",\"objects\":[{\"x\":1,\"y\":1,\"height_m\":1}]}", "objects[0].model",
     "is missing; it must be a path"},
    {"{" GOOD ",\"objects\":[{\"model\":\"m\",\"x\":1,\"y\":1e10,\"height_m\":1}]}", "objects[0].y",
     "10000000000 is outside"},
    {"{" GOOD ",\"objects\":[{\"model\":\"m\",\"x\":1,\"y\":1,\"height_m\":0}]}", "objects[0].height_m",
     "0 is outside; legal is 0.01 .. 10000 m"},
    {"{" GOOD ",\"sun\":{\"elevation_deg\":90.5}}", "sun.elevation_deg",
     "90.5 is outside; legal is -90 .. 90 deg"},
    {"{" GOOD ",\"sun\":{\"azimuth_deg\":-1e999}}", "sun.azimuth_deg", "too large for a number"},
    {"{" GOOD ",\"sun\":[]}", "sun", "must be an object, is an array"},
    {"{" GOOD ",\"sun\":{},\"sun\":{}}", "sun", "twice"},
    {"{" GOOD ",\"relief\":{\"resolution\":0}}", "relief.resolution",
     "0 is outside; legal is 16 .. 8192 texels"},
    {"{" GOOD ",\"relief\":{\"distance_m\":null}}", "relief.distance_m", "must be a number, is null"},
    {"{" GOOD ",\"Sun\":{}}", "Sun", "not a known key"},
    {"", "", "line 1, column 1: not valid JSON"},
    {"{" GOOD ",\n  \"sun\":{\"azimuth_deg\":NaN}}", "", "line 2, column 24: not valid JSON"},
    {"{" GOOD "} x", "", "not valid JSON"},
    {"{\"a\\u0000b\":1}", "", "line 1, column 4: a NUL character"},
    {"{\"\xFF\":1}", "", "line 1, column 3: not UTF-8"},
    {"{\"\xED\xA0\x80\":1}", "", "not UTF-8"},
    {"{\"\xC0\x80\":1}", "", "not UTF-8"},
};

static void test_bad(void **state)
{
    (void)state;
    for (size_t k = 0; k < sizeof BAD / sizeof BAD[0]; k++) {
        struct sv_scene_spec s, untouched;
        struct sv_errors errors;
        memset(&untouched, 0x5A, sizeof untouched);
        enum sv_status status = parse(BAD[k].text, &s, &errors);
        if (errors.total != 1) {
            for (size_t n = 0; n < errors.count; n++)
                print_error("  %s: %s\n", errors.items[n].field, errors.items[n].message);
            fail_msg("%s\n  gave %zu errors, not 1", BAD[k].text, errors.total);
        }
        assert_memory_equal(&s, &untouched, sizeof s);
        assert_int_equal(status, errors.items[0].code);
        assert_int_not_equal(status, SV_OK);
        if (strcmp(errors.items[0].field, BAD[k].path) != 0 ||
            !strstr(errors.items[0].message, BAD[k].message) ||
            strncmp(errors.items[0].message, "/maps/demo.json: ", 17) != 0)
            fail_msg("%s\n  expected %s: ...%s...\n  got %s: %s", BAD[k].text, BAD[k].path, BAD[k].message,
                     errors.items[0].field, errors.items[0].message);
        sv_errors_finish(&errors);
    }
}

/* Many faults, one run. */
static void test_all_at_once(void **state)
{
    (void)state;
    static const char *const expected[] = {"extra",
                                           "terrain.procedural.samples",
                                           "species[1].procedural.habit",
                                           "forest[0].scatter.mix.elm",
                                           "forest[1].default_height_m",
                                           "sun.elevation_deg",
                                           "relief.distance_m"};
    struct sv_scene_spec s;
    struct sv_errors errors;
    assert_int_equal(
        parse("{\"relief\":{\"distance_m\":\"far\"},\"extra\":0,\"terrain\":{\"procedural\":{\"samples\":1}},"
              "\"species\":[{\"name\":\"a\",\"model\":\"m\"},{\"name\":\"b\",\"procedural\":{\"habit\":5}}],"
              "\"forest\":[{\"scatter\":{\"count\":3,\"mix\":{\"elm\":1}}},"
              "{\"points\":\"p\",\"default_height_m\":500}],\"sun\":{\"elevation_deg\":-91}}",
              &s, &errors),
        SV_EINVAL);
    assert_int_equal(errors.total, sizeof expected / sizeof expected[0]);
    for (size_t k = 0; k < errors.count; k++)
        assert_string_equal(errors.items[k].field, expected[k]);
    sv_errors_finish(&errors);
}

/* A species whose own name is wrong is not among those that are there. */
static void test_species_there(void **state)
{
    (void)state;
    struct sv_scene_spec s;
    struct sv_errors errors;
    static const struct {
        const char *species, *there;
    } rows[] = {
        {"{\"name\":\"a\",\"model\":\"m\"},{\"model\":\"m\"},{\"name\":\"\",\"model\":\"m\"}", "there is a"},
        {"{\"model\":\"m\"},{\"name\":\"a\",\"model\":\"m\"},{\"name\":\"b\",\"model\":\"m\"}",
         "there are a, b"},
        {"{\"model\":\"m\"}", "there are none"}};
    for (size_t k = 0; k < sizeof rows / sizeof rows[0]; k++) {
        char text[600];
        snprintf(text, sizeof text,
                 "{" TERRAIN ",\"species\":[%s],\"forest\":[{\"points\":\"p\",\"default_species\":\"zz\"}]}",
                 rows[k].species);
        assert_int_equal(parse(text, &s, &errors), SV_EINVAL);
        const struct sv_error *last = &errors.items[errors.count - 1];
        assert_string_equal(last->field, "forest[0].default_species");
        const char *there = strstr(last->message, "there ");
        assert_non_null(there);
        assert_string_equal(there, rows[k].there);
        sv_errors_finish(&errors);
    }
}

/* Bytes that are no text, and texts that are no scene: defined answers. */
static void test_odd_bytes(void **state)
{
    (void)state;
    struct sv_scene_spec s;
    struct sv_errors errors;
    sv_errors_init(&errors);
    static const char nul[] = "{\"terrain\":{\"procedural\":{}}}\0{";
    assert_int_equal(sv_scene_spec_parse(nul, sizeof nul - 1, "f", &s, &errors), SV_EFORMAT);
    assert_string_equal(errors.items[0].message, "f: line 1, column 30: a NUL byte");
    size_t n = 2000000;
    char *deep = malloc(n + 1);
    memset(deep, '[', n);
    deep[n] = '\0';
    assert_int_equal(sv_scene_spec_parse(deep, n, "f", &s, &errors), SV_EFORMAT);
    for (size_t k = 0; k + 4 < n; k += 5)
        memcpy(deep + k, "{\"a\":", 5);
    assert_int_equal(sv_scene_spec_parse(deep, n, "f", &s, &errors), SV_EFORMAT);
    free(deep);
    assert_int_equal(errors.count, 3);
    sv_errors_finish(&errors);
}

/* A key of a megabyte, and ten thousand unknown keys: cut, counted, quick. */
static void test_long(void **state)
{
    (void)state;
    struct sv_scene_spec s;
    struct sv_errors errors;
    size_t n = 1 << 20;
    char *text = malloc(n + 20);
    text[0] = '{';
    text[1] = '"';
    for (size_t k = 2; k + 1 < n; k += 2)
        memcpy(text + k, "\xC3\xA4", 2);
    strcpy(text + n, "\":1}");
    assert_int_equal(parse(text, &s, &errors), SV_EINVAL);
    assert_int_equal(errors.total, 2); /* and no terrain */
    assert_true(strlen(errors.items[0].field) < 80);
    sv_errors_finish(&errors);
    size_t used = 1;
    for (int k = 0; k < 10000; k++)
        used += (size_t)snprintf(text + used, 30, "%s\"k%d\":[]", k ? "," : "", k);
    strcpy(text + used, "}");
    assert_int_equal(parse(text, &s, &errors), SV_EINVAL);
    assert_int_equal(errors.total, 10001);
    assert_int_equal(errors.count, SV_ERRORS_MAX);
    assert_string_equal(errors.items[0].field, "k0");
    sv_errors_finish(&errors);
    free(text);
}

static void many_species(char *text, size_t room, int n)
{
    size_t used = (size_t)snprintf(text, room, "{" TERRAIN ",\"species\":[");
    for (int k = 0; k < n; k++)
        used += (size_t)snprintf(text + used, room - used, "%s{\"name\":\"s%d\",\"model\":\"m\"}",
                                 k ? "," : "", k);
    snprintf(text + used, room - used, "]}");
}

static void test_limits_of_lists(void **state)
{
    (void)state;
    struct sv_scene_spec s;
    struct sv_errors errors;
    char *text = malloc(1 << 16);
    for (int n = SV_SCENE_SPECIES_MAX; n <= SV_SCENE_SPECIES_MAX + 1; n++) {
        many_species(text, 1 << 16, n);
        enum sv_status status = parse(text, &s, &errors);
        if (n == SV_SCENE_SPECIES_MAX) {
            assert_int_equal(status, SV_OK);
            assert_int_equal(s.species_count, n);
            sv_scene_spec_finish(&s);
        } else {
            assert_int_equal(status, SV_ELIMIT);
            assert_string_equal(errors.items[0].field, "species");
        }
        sv_errors_finish(&errors);
    }
    free(text);
}

/* ---- from disk ---- */

static void write_text(const char *path, const char *text)
{
    FILE *f = fopen(path, "w");
    assert_non_null(f);
    assert_true(fputs(text, f) >= 0);
    assert_int_equal(fclose(f), 0);
}

static void test_read(void **state)
{
    (void)state;
    char folder[] = "/tmp/sv-scene-XXXXXX", path[100], dem[100];
    assert_non_null(mkdtemp(folder));
    snprintf(path, sizeof path, "%s/s.json", folder);
    snprintf(dem, sizeof dem, "%s/d.tif", folder);
    struct sv_scene_spec s;
    struct sv_errors errors;
    sv_errors_init(&errors);
    assert_int_equal(sv_scene_spec_read(path, &s, &errors), SV_ENOENT);
    assert_int_equal(sv_scene_spec_read(folder, &s, &errors), SV_EIO);
    sv_errors_finish(&errors);
    write_text(path, "{\"terrain\":{\"dem\":\"d.tif\",\"imagery\":\"i.tif\"},\"species\":[{\"name\":\"a\","
                     "\"model\":\"a.obj\"}],"
                     "\"forest\":[{\"points\":\"p.csv\"},{\"scatter\":{\"count\":1,\"within\":\"w.json\"}}],"
                     "\"objects\":[{\"model\":\"o.obj\",\"x\":0,\"y\":0,\"height_m\":1}]}");
    static const char *const missing[] = {"terrain.dem",      "terrain.imagery",          "species[0].model",
                                          "forest[0].points", "forest[1].scatter.within", "objects[0].model"};
    assert_int_equal(sv_scene_spec_read(path, &s, &errors), SV_ENOENT);
    assert_int_equal(errors.total, 6);
    for (size_t k = 0; k < errors.count; k++)
        assert_string_equal(errors.items[k].field, missing[k]);
    assert_non_null(strstr(errors.items[0].message, dem));
    sv_errors_finish(&errors);
    write_text(dem, "x");
    write_text(path, "{\"terrain\":{\"dem\":\"d.tif\"}}");
    assert_int_equal(sv_scene_spec_read(path, &s, &errors), SV_OK);
    assert_string_equal(s.terrain.dem, dem);
    sv_scene_spec_finish(&s);
    assert_int_equal(chdir(folder), 0);
    assert_int_equal(sv_scene_spec_read("s.json", &s, &errors), SV_OK);
    assert_string_equal(s.terrain.dem, "d.tif"); /* relative to the scene file, which is here */
    sv_scene_spec_finish(&s);
    write_text(path,
               "{\"terrain\":{\"dem\":\"/vsizip/a.zip/d.tif\"}}"); /* GDAL will say if it is not there */
    assert_int_equal(sv_scene_spec_read(path, &s, &errors), SV_OK);
    assert_string_equal(s.terrain.dem, "/vsizip/a.zip/d.tif");
    sv_scene_spec_finish(&s);
    unlink(path);
    unlink(dem);
    assert_int_equal(chdir("/"), 0);
    rmdir(folder);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_example),       cmocka_unit_test(test_defaults),
        cmocka_unit_test(test_bad),           cmocka_unit_test(test_all_at_once),
        cmocka_unit_test(test_species_there), cmocka_unit_test(test_odd_bytes),
        cmocka_unit_test(test_long),          cmocka_unit_test(test_limits_of_lists),
        cmocka_unit_test(test_read)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
