/* test_patch_parse.c - bodies of PATCH /v1/scene: what a legal one says, and every fault of the others, each
 * by its key path; the schema has every key with its range. */
#include "api/patch_parse.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "core/scene/forest.h"
#include "core/scene/id.h"
#include "tests/api/cmocka_all.h"

static struct sv_species_spec species[2] = {{.name = "oak"}, {.name = "fir"}};
static const struct sv_scene_spec scene = {.path = "scene.json", .species = species, .species_count = 2};

static void test_legal(void **state)
{
    (void)state;
    static const char text[] =
        "{\"sun\":{\"azimuth_deg\":200,\"elevation_deg\":-3.5},\"trees\":{\"remove\":{\"ids\":[2147483648,"
        "4294967295],\"within\":{\"type\":\"Polygon\",\"coordinates\":[[[0,0],[1,0],[1,1],[0,0]]]},\"near\":{"
        "\"lon\":8,\"lat\":47,\"radius_m\":30}},\"add\":[{\"x\":1,\"y\":2,\"species\":\"fir\",\"height_m\":9}"
        ",{"
        "\"scatter\":{\"count\":5,\"mix\":{\"fir\":3,\"oak\":1},\"height_m\":[3,4],\"within\":{\"type\":"
        "\"MultiPolygon\",\"coordinates\":[[[[0,0],[1,0],[1,1],[0,0]]]]}}}]},\"objects\":{\"remove\":{"
        "\"ids\":["
        "1073741824]}}}";
    struct sv_scene_patch p;
    struct sv_errors errors;
    sv_errors_init(&errors);
    assert_int_equal(sv_api_patch_parse(text, strlen(text), &scene, &p, &errors), SV_OK);
    assert_true(p.sun_azimuth_deg == 200 && p.sun_elevation_deg == -3.5 && isnan(p.sun_time_s));
    assert_int_equal(p.tree_id_count, 2);
    assert_true(p.tree_ids[0] == SV_ID_TREE_FIRST && p.tree_ids[1] == UINT32_MAX);
    assert_string_equal(p.within, "{\"type\":\"Polygon\",\"coordinates\":[[[0,0],[1,0],[1,1],[0,0]]]}");
    assert_true(p.has_near && isnan(p.near.x) && p.near.lon == 8 && p.near.lat == 47 &&
                p.near.radius_m == 30);
    assert_int_equal(p.add_count, 2);
    assert_true(!p.add[0].is_scatter && p.add[0].tree.species == 1 && p.add[0].tree.height_m == 9);
    assert_true(p.add[0].tree.x == 1 && isnan(p.add[0].tree.lon) && isnan(p.add[0].tree.rotation_deg));
    const struct sv_scatter_spec *s = &p.add[1].scatter;
    assert_true(p.add[1].is_scatter && s->count == 5 && s->mix[0] == 0.25 && s->mix[1] == 0.75);
    assert_true(s->height_m[0] == 3 && s->height_m[1] == 4 && s->min_spacing_m == 2 && s->seed == 1 &&
                s->within);
    assert_true(p.object_id_count == 1 && p.object_ids[0] == SV_ID_OBJECT_FIRST && p.object_count == 0);
    sv_scene_patch_finish(&p);
    sv_errors_finish(&errors);
}

static const struct {
    const char *text, *fields; /* separated by blanks, in the order in which they are told */
} faults[] = {
    {"", ""},
    {"{}", ""},
    {"[]", ""},
    {"{\"sun\":{}}", "sun"},
    {"{\"sun\":{\"time\":\"2026-06-21T10:00:00Z\",\"azimuth_deg\":1}}", "sun"},
    {"{\"sun\":{\"time\":\"noon\"}}", "sun.time"},
    {"{\"sun\":{\"time\":\"1850-01-01T00:00:00Z\"}}", "sun.time"},
    {"{\"sun\":{\"azimuth_deg\":361,\"elevation_deg\":\"x\"},\"moon\":1}",
     "moon sun.azimuth_deg sun.elevation_deg"},
    {"{\"trees\":{}}", "trees"},
    {"{\"trees\":{\"remove\":{}}}", "trees.remove"},
    {"{\"trees\":{\"remove\":{\"ids\":[1,2147483648.5,\"a\"]}}}",
     "trees.remove.ids[0] trees.remove.ids[1] trees.remove.ids[2]"},
    {"{\"trees\":{\"remove\":{\"near\":{\"x\":1,\"lat\":2}}}}",
     "trees.remove.near.radius_m trees.remove.near"},
    {"{\"trees\":{\"add\":[{\"species\":\"elm\",\"height_m\":151},{\"x\":1,\"y\":1,\"lon\":1,\"lat\":1,"
     "\"species\":\"oak\",\"height_m\":3}]}}",
     "trees.add[0].species trees.add[0].height_m trees.add[0] trees.add[1]"},
    {"{\"trees\":{\"add\":[{\"scatter\":{\"count\":-1,\"within\":\"a.geojson\"},\"x\":1}]}}",
     "trees.add[0].x trees.add[0].scatter.count trees.add[0].scatter.within"},
    {"{\"trees\":{\"remove\":{\"within\":{\"type\":\"Point\",\"coordinates\":[1,2],\"crs\":1}}}}",
     "trees.remove.within.crs trees.remove.within trees.remove.within.coordinates[0] "
     "trees.remove.within.coordinates[1]"},
    {"{\"trees\":{\"remove\":{\"within\":{\"type\":\"Polygon\",\"coordinates\":[[[0,0],[1,0],[1,1],[0,1]],"
     "[[0,0],[1,0],[0,0]],[[0,0],[1,0],[\"a\",0],[0,0]]]}}}}",
     "trees.remove.within.coordinates[0] trees.remove.within.coordinates[1] "
     "trees.remove.within.coordinates[2]"},
    {"{\"objects\":{\"remove\":{\"ids\":[7]},\"add\":[{\"x\":1,\"y\":1,\"height_m\":0}]}}",
     "objects.remove.ids[0] objects.add[0].model objects.add[0].height_m"},
};

static void test_faults(void **state)
{
    (void)state;
    for (size_t k = 0; k < sizeof faults / sizeof faults[0]; k++) {
        struct sv_scene_patch p;
        struct sv_errors errors;
        char told[1024] = "";
        sv_errors_init(&errors);
        enum sv_status status =
            sv_api_patch_parse(faults[k].text, strlen(faults[k].text), &scene, &p, &errors);
        for (size_t e = 0; e < errors.count; e++) {
            strcat(told, e ? " " : "");
            strcat(told, errors.items[e].field);
        }
        assert_int_not_equal(status, SV_OK);
        if (strcmp(told, faults[k].fields) != 0)
            fail_msg("%s: told \"%s\", expected \"%s\"", faults[k].text, told, faults[k].fields);
        sv_errors_finish(&errors);
    }
}

static const cJSON *down(const cJSON *at, const char *const *names)
{
    for (; *names; names++)
        at = cJSON_GetObjectItemCaseSensitive(at, *names);
    return at;
}

static void test_schema(void **state)
{
    (void)state;
    bool good = true;
    cJSON *root = sv_api_patch_schema(&good);
    assert_true(good);
    const cJSON *azimuth =
        down(root, (const char *const[]){"properties", "sun", "properties", "azimuth_deg", "maximum", NULL});
    assert_true(azimuth && azimuth->valuedouble == 360);
    const cJSON *add =
        down(root, (const char *const[]){"properties", "trees", "properties", "add", "items", "oneOf", NULL});
    assert_int_equal(cJSON_GetArraySize(add), 2);
    const cJSON *height =
        down(cJSON_GetArrayItem(add, 0), (const char *const[]){"properties", "height_m", "minimum", NULL});
    assert_true(height && height->valuedouble == SV_TREE_HEIGHT_MIN_M);
    const cJSON *within =
        down(cJSON_GetArrayItem(add, 1),
             (const char *const[]){"properties", "scatter", "properties", "within", "properties", NULL});
    assert_non_null(cJSON_GetObjectItemCaseSensitive(within, "coordinates"));
    const cJSON *model = down(root, (const char *const[]){"properties", "objects", "properties", "add",
                                                          "items", "properties", "model", "type", NULL});
    assert_string_equal(cJSON_GetStringValue(model), "string");
    cJSON_Delete(root);
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(test_legal), cmocka_unit_test(test_faults),
                                       cmocka_unit_test(test_schema)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
