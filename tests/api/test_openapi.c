/* The document's structure: every field with its range in the query and in the body, every endpoint, no
 * dangling reference. */
#include "api/openapi.h"

#include <cjson/cJSON.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "api/endpoints.h"
#include "api/fields.h"
#include "tests/api/cmocka_all.h"

static cJSON *root;

static int setup(void **state)
{
    (void)state;
    const struct sv_openapi_options options = {.base_url = "https://example.org/",
                                               .limits = SV_API_VIEW_LIMITS_DEFAULT};
    size_t bytes;
    char *text = sv_api_openapi(&options, &bytes);
    root = text ? cJSON_ParseWithLength(text, bytes) : NULL;
    free(text);
    return root ? 0 : -1;
}

static int teardown(void **state)
{
    (void)state;
    cJSON_Delete(root);
    return 0;
}

static const cJSON *get(const cJSON *object, const char *name)
{
    return cJSON_GetObjectItemCaseSensitive(object, name);
}

static const cJSON *component(const char *group, const char *name)
{
    return get(get(get(root, "components"), group), name);
}

/* A field's schema says what its row says. */
static void check_schema(enum sv_field_id id, const cJSON *schema)
{
    const struct sv_field *f = sv_api_field(id);
    const cJSON *oneof = get(schema, "oneOf");
    schema = oneof ? cJSON_GetArrayItem(oneof, 0) : schema;
    assert_non_null(get(schema, "type"));
    if (f->type == SV_FIELD_NUMBER || f->type == SV_FIELD_INTEGER) {
        assert_true(cJSON_GetNumberValue(get(schema, f->above_min ? "exclusiveMinimum" : "minimum")) ==
                    f->min);
        assert_true(cJSON_GetNumberValue(get(schema, "maximum")) == f->max);
    }
    if (f->choices) {
        const cJSON *list = get(f->type == SV_FIELD_CHOICES ? get(schema, "items") : schema, "enum");
        int n = 0;
        for (; f->choices[n]; n++) {
            const cJSON *item = cJSON_GetArrayItem(list, n);
            assert_true(f->type == SV_FIELD_INTEGER_SET
                            ? cJSON_GetNumberValue(item) == atoi(f->choices[n])
                            : strcmp(cJSON_GetStringValue(item), f->choices[n]) == 0);
        }
        assert_int_equal(cJSON_GetArraySize(list), n);
    }
    assert_int_equal(get(schema, "default") != NULL, f->preset != NULL);
    if (f->preset && !f->choices)
        assert_true(cJSON_GetNumberValue(get(schema, "default")) == atof(f->preset));
    assert_int_equal(get(schema, "x-unit") != NULL, f->unit[0] != '\0');
    assert_int_equal(cJSON_IsTrue(get(schema, "x-not-built-yet")), f->unbuilt);
    assert_int_equal(get(schema, "x-values-not-built-yet") != NULL, f->unbuilt_choices != 0);
}

static void every_field(void **state)
{
    (void)state;
    const cJSON *view = component("schemas", "View"), *properties = get(view, "properties");
    assert_true(cJSON_IsFalse(get(view, "additionalProperties")));
    assert_int_equal(cJSON_GetArraySize(properties), SV_FIELD_COUNT);
    for (int k = 0; k < SV_FIELD_COUNT; k++) {
        const char *name = sv_api_field_name((enum sv_field_id)k);
        const cJSON *parameter = component("parameters", name);
        assert_string_equal(cJSON_GetStringValue(get(parameter, "name")), name);
        assert_string_equal(cJSON_GetStringValue(get(parameter, "in")), "query");
        const char *description = cJSON_GetStringValue(get(parameter, "description"));
        const struct sv_field *field = sv_api_field((enum sv_field_id)k);
        assert_non_null(description);
        assert_int_equal(strstr(description, "501") != NULL,
                         field->unbuilt || field->unbuilt_choices);
        check_schema((enum sv_field_id)k, get(parameter, "schema"));
        check_schema((enum sv_field_id)k, get(properties, name));
    }
    /* What is legal beside other keys and then changes nothing. */
    static const char *const ignored[][2] = {{"vfov", "ignored with projection=orthographic"},
                                             {"q", "ignored with png, tiff and exr"}};
    for (size_t k = 0; k < sizeof ignored / sizeof ignored[0]; k++)
        for (int body = 0; body < 2; body++) {
            const cJSON *row = body ? get(properties, ignored[k][0]) : component("parameters", ignored[k][0]);
            const char *says = cJSON_GetStringValue(get(row, "description"));
            assert_true(says && strstr(says, ignored[k][1]));
        }
    /* GET /v1/view names all of them. */
    const cJSON *list = get(get(get(get(root, "paths"), "/v1/view"), "get"), "parameters");
    assert_int_equal(cJSON_GetArraySize(list), SV_FIELD_COUNT);
}

static void every_endpoint(void **state)
{
    (void)state;
    int count;
    const struct sv_endpoint *e = sv_api_endpoints(&count);
    for (int k = 0; k < count; k++) {
        char method[8] = "";
        for (size_t i = 0; e[k].method[i]; i++)
            method[i] = (char)(e[k].method[i] + 32);
        const cJSON *operation = get(get(get(root, "paths"), e[k].path), method);
        const cJSON *responses = get(operation, "responses");
        assert_string_equal(cJSON_GetStringValue(get(operation, "operationId")), e[k].id);
        assert_int_equal(get(responses, "501") != NULL && !get(responses, e[k].success), !e[k].built);
        assert_int_equal(cJSON_IsTrue(get(operation, "x-not-built-yet")), !e[k].built);
        assert_int_equal(get(operation, "security") != NULL, e[k].admin);
        assert_int_equal(get(operation, "requestBody") != NULL, e[k].body != NULL);
        const cJSON *answer;
        cJSON_ArrayForEach(answer, responses)
        {
            assert_non_null(get(answer, "description"));
            assert_non_null(get(get(answer, "headers"), "Server-Timing"));
        }
        for (int p = 0; e[k].built && e[k].problems[p] != SV_PROBLEM_NONE; p++) {
            char status[8];
            snprintf(status, sizeof status, "%d", sv_api_problem_status(e[k].problems[p]));
            assert_non_null(strstr(cJSON_GetStringValue(get(get(responses, status), "description")),
                                   sv_api_problem_slug(e[k].problems[p])));
        }
    }
    const cJSON *view = get(get(get(get(root, "paths"), "/v1/view"), "get"), "responses");
    static const char *const headers[] = {"ETag", "Cache-Status", "Silvista-Plan", "Silvista-Camera",
                                          "Silvista-Route"};
    for (int k = 0; k < 5; k++) {
        assert_non_null(get(get(get(view, "200"), "headers"), headers[k]));
        assert_non_null(get(get(get(view, "304"), "headers"), headers[k]));
    }
}

static int references;

/* Every $ref leads somewhere. */
static void follow(const cJSON *node)
{
    for (const cJSON *child = node->child; child; child = child->next) {
        if (child->string && strcmp(child->string, "$ref") == 0) {
            char group[32], name[64];
            assert_int_equal(sscanf(child->valuestring, "#/components/%31[^/]/%63s", group, name), 2);
            assert_non_null(component(group, name));
            references++;
        }
        follow(child);
    }
}

static void references_lead_somewhere(void **state)
{
    (void)state;
    follow(root);
    assert_true(references > 100);
    assert_string_equal(cJSON_GetStringValue(get(root, "openapi")), "3.1.0");
    assert_string_equal(cJSON_GetStringValue(get(cJSON_GetArrayItem(get(root, "servers"), 0), "url")),
                        "https://example.org/");
    const struct sv_openapi_options bare = {0};
    size_t bytes;
    char *text = sv_api_openapi(&bare, &bytes);
    assert_non_null(strstr(text, "\"servers\":[{\"url\":\"/\"}]"));
    free(text);
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(every_field), cmocka_unit_test(every_endpoint),
                                       cmocka_unit_test(references_lead_somewhere)};
    return cmocka_run_group_tests(tests, setup, teardown);
}
