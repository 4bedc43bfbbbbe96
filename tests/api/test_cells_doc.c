#include "api/cells_doc.h"

#include <cjson/cJSON.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "api/json.h"
#include "tests/api/cmocka_all.h"

static cJSON *parsed(char *text, size_t bytes)
{
    cJSON *root = NULL;
    assert_non_null(text);
    assert_int_equal(bytes, strlen(text));
    assert_int_equal(sv_api_json_parse(text, bytes, &root, NULL), SV_OK);
    free(text);
    return root;
}

static const cJSON *at(const cJSON *object, const char *name)
{
    const cJSON *item = cJSON_GetObjectItemCaseSensitive(object, name);
    if (!item)
        fail_msg("no %s", name);
    return item;
}

static double number(const cJSON *object, const char *name)
{
    return cJSON_GetNumberValue(at(object, name));
}

static const char *text(const cJSON *object, const char *name)
{
    return cJSON_GetStringValue(at(object, name));
}

static void document(void **state)
{
    (void)state;
    const struct sv_cell_cache_item items[2] = {
        {.label = {.key = 0xABC, .parts = {.face = SV_CELL_NORTH, .layer = 1}},
         .bytes = 4096,
         .hits = 5,
         .age_s = 2.5,
         .build_s = 0.25,
         .refined = true},
        {.label = {.key = 1, .parts = {.face = SV_CELL_DOWN, .layer = 2}}, .bytes = 8192, .building = true},
    };
    const struct sv_cell_listed cell = {.id = 0x10,
                                        .centre = {1, 2, 3},
                                        .place = {.ring = 4, .v = {1, 2, 4}},
                                        .distance_m = 50,
                                        .outer_m = INFINITY,
                                        .half_axis_m = 2.5,
                                        .size = 512,
                                        .bytes = 12288,
                                        .hits = 5,
                                        .age_s = 2.5,
                                        .first = 0,
                                        .count = 2};
    const struct sv_cells_facts facts = {
        .cells = &cell,
        .cell_count = 1,
        .items = items,
        .stats = {.budget_bytes = 1 << 20, .used_bytes = 12288, .panels = 8, .building = 1, .evictions = 9},
        .shadows = 7,
        .ahead = 3,
        .refine = 2};
    size_t bytes;
    char *printed = sv_api_cells_doc(&facts, &bytes);
    cJSON *root = parsed(printed, bytes);
    assert_true(number(root, "budget_bytes") == 1 << 20 && number(root, "used_bytes") == 12288);
    assert_true(number(root, "panels") == 1 && number(root, "shadow_pages") == 7);
    assert_true(number(root, "building") == 1 && number(root, "evictions") == 9);
    assert_true(number(root, "jobs_ahead") == 3 && number(root, "jobs_refine") == 2);
    const cJSON *c = cJSON_GetArrayItem(at(root, "cells"), 0);
    assert_string_equal(text(c, "id"), "0000000000000010");
    assert_true(cJSON_GetNumberValue(cJSON_GetArrayItem(at(c, "centre"), 2)) == 3);
    assert_true(cJSON_GetNumberValue(cJSON_GetArrayItem(at(c, "reference"), 2)) == 4);
    assert_true(number(at(c, "region"), "half_axis_m") == 2.5);
    assert_true(cJSON_IsNull(at(c, "outer_m"))); /* no end */
    assert_true(number(c, "ring") == 4 && number(c, "resolution") == 512 && number(c, "hits") == 5);
    const cJSON *panels = at(c, "panels"), *first = cJSON_GetArrayItem(panels, 0), *second = first->next;
    assert_int_equal(cJSON_GetArraySize(panels), 2);
    assert_string_equal(text(first, "face"), "north");
    assert_string_equal(text(first, "layer"), "crowns");
    assert_string_equal(text(first, "state"), "refined");
    assert_true(number(first, "build_ms") == 250 && number(first, "age_s") == 2.5);
    assert_string_equal(text(second, "face"), "down");
    assert_string_equal(text(second, "layer"), "ground");
    assert_string_equal(text(second, "state"), "building");
    cJSON_Delete(root);
}

/* A service without cells, and numbers that somebody wrote wild into the shared memory. */
static void empty_and_wild(void **state)
{
    (void)state;
    const struct sv_cells_facts none = {.ahead = 0};
    size_t bytes;
    char *printed = sv_api_cells_doc(&none, &bytes);
    cJSON *root = parsed(printed, bytes);
    assert_int_equal(cJSON_GetArraySize(at(root, "cells")), 0);
    cJSON_Delete(root);
    struct sv_cell_cache_item item;
    memset(&item, 0xFF, sizeof item);
    item.refined = item.building = false;
    const struct sv_cell_listed cell = {.age_s = NAN, .count = 1};
    const struct sv_cells_facts wild = {.cells = &cell, .cell_count = 1, .items = &item};
    printed = sv_api_cells_doc(&wild, &bytes);
    root = parsed(printed, bytes);
    const cJSON *panel = at(cJSON_GetArrayItem(at(root, "cells"), 0), "panels")->child;
    assert_string_equal(text(panel, "face"), "other");
    assert_string_equal(text(panel, "layer"), "other");
    cJSON_Delete(root);
}

static void jobs(void **state)
{
    (void)state;
    const uint64_t ids[2] = {1, UINT64_MAX};
    size_t bytes;
    char *printed = sv_api_cells_jobs(ids, 2, &bytes);
    cJSON *root = parsed(printed, bytes);
    assert_string_equal(text(at(root, "jobs")->child, "id"), "0000000000000001");
    assert_string_equal(text(at(root, "jobs")->child->next, "id"), "ffffffffffffffff");
    cJSON_Delete(root);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(document),
        cmocka_unit_test(empty_and_wild),
        cmocka_unit_test(jobs),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
