#include "api/scene_doc.h"

#include <cjson/cJSON.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "api/json.h"
#include "core/base/vec.h"
#include "tests/api/cmocka_all.h"

static cJSON *document(const struct sv_scene_facts *facts)
{
    size_t bytes;
    cJSON *root = NULL;
    char *text = sv_api_scene_doc(facts, &bytes);
    assert_non_null(text);
    assert_int_equal(bytes, strlen(text));
    assert_int_equal(sv_api_json_parse(text, bytes, &root, NULL), SV_OK);
    free(text);
    return root;
}

static const cJSON *at(const cJSON *root, const char *a, const char *b)
{
    return cJSON_GetObjectItemCaseSensitive(cJSON_GetObjectItemCaseSensitive(root, a), b);
}

static void full(void **state)
{
    (void)state;
    const struct sv_species_facts species[2] = {
        {"spruce", 24000, 39000, 80000, 160000, {{"billboard", 42336864, false}, {"coarse", 262144, true}}, 2},
        {.name = "b\xC3\xBC"
                 "che\xFF",
         .tree_count = 16000}};
    const struct sv_object_facts object = {
        5, "/home/someone/hut.glb", 1, 2, 99, sv_radians(30), 6, 128, 400, 1234567};
    struct sv_scene_facts f = {.name = "demo",
                               .version = 0x1234,
                               .crs_name = "EPSG:32633",
                               .epsg = 32633,
                               .x_min = 500000,
                               .y_min = 5200000,
                               .x_max = 502000,
                               .y_max = 5202000,
                               .has_lonlat = true,
                               .lon_min = 15,
                               .lat_min = 46.9,
                               .lon_max = 15.1,
                               .lat_max = 47,
                               .terrain_width = 1024,
                               .terrain_height = 1024,
                               .spacing_x_m = 2,
                               .spacing_y_m = 2,
                               .z_min = 100,
                               .z_max = 250,
                               .voids_filled = 9,
                               .species = species,
                               .species_count = 2,
                               .tree_count = 40000,
                               .outside_terrain = 3,
                               .objects = &object,
                               .object_count = 1,
                               .sun_azimuth_rad = sv_radians(135),
                               .sun_elevation_rad = sv_radians(40),
                               .relief_distance_m = 100,
                               .relief_resolution = 1024,
                               .pixels_max = 16777216,
                               .shared_bytes = 1000,
                               .load_s = 1.5};
    cJSON *root = document(&f);
    assert_string_equal(cJSON_GetStringValue(cJSON_GetObjectItem(root, "version")), "0000000000001234");
    assert_true(cJSON_GetNumberValue(at(root, "crs", "epsg")) == 32633);
    assert_true(cJSON_GetNumberValue(cJSON_GetArrayItem(at(root, "extent", "scene"), 3)) == 5202000);
    assert_true(cJSON_GetNumberValue(cJSON_GetArrayItem(at(root, "extent", "lonlat"), 1)) == 46.9);
    assert_true(cJSON_GetNumberValue(at(root, "terrain", "voids_filled")) == 9);
    assert_non_null(strstr(cJSON_GetStringValue(at(root, "terrain", "diagonal")), "alternating"));
    const cJSON *list = cJSON_GetObjectItem(root, "species");
    assert_int_equal(cJSON_GetArraySize(list), 2);
    const cJSON *first = cJSON_GetArrayItem(list, 0), *built = cJSON_GetObjectItem(first, "built");
    assert_true(cJSON_GetNumberValue(at(first, "bytes", "coarse")) == 262144);
    assert_true(cJSON_GetNumberValue(at(first, "bytes", "billboard")) == 42336864);
    assert_int_equal(cJSON_GetArraySize(built), 1);
    assert_string_equal(cJSON_GetStringValue(cJSON_GetArrayItem(built, 0)), "coarse");
    assert_string_equal(cJSON_GetStringValue(cJSON_GetObjectItem(cJSON_GetArrayItem(list, 1), "name")),
                        "b\xC3\xBC"
                        "che\\xFF");
    assert_true(cJSON_GetNumberValue(at(root, "trees", "count")) == 40000);
    assert_true(cJSON_GetNumberValue(at(root, "sun", "azimuth")) == 135);
    assert_true(cJSON_GetNumberValue(at(root, "limits", "pixels_max")) == 16777216);
    assert_null(at(root, "limits", "sample_pixels_max"));
    assert_true(cJSON_GetNumberValue(at(root, "id", "tree_first")) == 2147483648.0);
    const cJSON *hut = cJSON_GetArrayItem(cJSON_GetObjectItem(root, "objects"), 0);
    assert_string_equal(cJSON_GetStringValue(cJSON_GetObjectItem(hut, "model")), "hut.glb"); /* no folder */
    assert_true(cJSON_GetNumberValue(cJSON_GetObjectItem(hut, "heading")) == 30);
    assert_true(cJSON_GetNumberValue(cJSON_GetObjectItem(hut, "index")) == 0);
    assert_true(cJSON_GetNumberValue(cJSON_GetObjectItem(hut, "id")) == 1073741829.0);
    assert_true(cJSON_GetNumberValue(cJSON_GetObjectItem(hut, "z")) == 99);
    assert_true(cJSON_GetNumberValue(cJSON_GetObjectItem(hut, "relief_resolution")) == 128);
    assert_true(cJSON_GetNumberValue(cJSON_GetObjectItem(hut, "triangles")) == 400);
    assert_true(cJSON_GetNumberValue(cJSON_GetObjectItem(hut, "relief_bytes")) == 1234567);
    cJSON_Delete(root);
}

static void empty_and_local(void **state)
{
    (void)state;
    struct sv_scene_facts f = {.crs_name = "local", .z_min = NAN, .load_s = -1};
    cJSON *root = document(&f);
    assert_true(cJSON_IsNull(at(root, "extent", "lonlat")));
    assert_true(cJSON_IsNull(at(root, "crs", "epsg")));
    assert_true(cJSON_IsNull(at(root, "terrain", "z_min")));
    assert_int_equal(cJSON_GetArraySize(cJSON_GetObjectItem(root, "species")), 0);
    assert_null(cJSON_GetObjectItem(root, "load_s"));
    cJSON_Delete(root);
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(full), cmocka_unit_test(empty_and_local)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
