#include "api/problem.h"

#include <cjson/cJSON.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "api/json.h"
#include "tests/api/cmocka_all.h"

static cJSON *document(const struct sv_problem *problem)
{
    size_t bytes;
    cJSON *root = NULL;
    char *text = sv_api_problem_document(problem, &bytes);
    assert_non_null(text);
    assert_int_equal(bytes, strlen(text));
    assert_int_equal(sv_api_json_parse(text, bytes, &root, NULL), SV_OK); /* strict JSON, UTF-8 */
    free(text);
    return root;
}

static const char *text_of(const cJSON *root, const char *name)
{
    return cJSON_GetStringValue(cJSON_GetObjectItemCaseSensitive(root, name));
}

static void every_kind(void **state)
{
    (void)state;
    for (int k = SV_PROBLEM_NONE + 1; k < SV_PROBLEM_KIND_COUNT; k++) {
        struct sv_problem problem = {.kind = (enum sv_problem_kind)k};
        cJSON *root = document(&problem);
        int status = sv_api_problem_status(problem.kind);
        assert_in_range(status, 400, 599);
        assert_int_equal(cJSON_GetNumberValue(cJSON_GetObjectItemCaseSensitive(root, "status")), status);
        assert_memory_equal(text_of(root, "type"), "urn:silvista:problem:", 21);
        assert_string_equal(text_of(root, "type") + 21, sv_api_problem_slug(problem.kind));
        assert_string_equal(text_of(root, "title"), sv_api_problem_title(problem.kind));
        assert_non_null(text_of(root, "detail"));
        assert_string_not_equal(text_of(root, "detail"), text_of(root, "title")); /* says what to do */
        const cJSON *errors = cJSON_GetObjectItemCaseSensitive(root, "errors");
        assert_true(cJSON_IsArray(errors) && cJSON_GetArraySize(errors) == 0);
        for (int j = k + 1; j < SV_PROBLEM_KIND_COUNT; j++)
            assert_string_not_equal(sv_api_problem_slug(problem.kind),
                                    sv_api_problem_slug((enum sv_problem_kind)j));
        cJSON_Delete(root);
    }
    assert_int_equal(sv_api_problem_status(SV_PROBLEM_NONE), 200);
    assert_int_equal(sv_api_problem_status((enum sv_problem_kind)999), 500);
}

static void members(void **state)
{
    (void)state;
    struct sv_errors errors;
    sv_errors_init(&errors);
    sv_errors_add(&errors, SV_EINVAL, "vfov", "\"200\" is out of range");
    struct sv_problem problem = {.kind = SV_PROBLEM_UNDER_GROUND,
                                 .errors = &errors,
                                 .request_id = "abc",
                                 .has_ground_z = true,
                                 .ground_z_m = 1234.5,
                                 .retry_after_s = 3,
                                 .allow = "GET, HEAD"};
    cJSON *root = document(&problem);
    assert_string_equal(text_of(root, "detail"), "vfov: \"200\" is out of range");
    assert_string_equal(text_of(root, "request_id"), "abc");
    assert_string_equal(text_of(root, "allow"), "GET, HEAD");
    assert_true(cJSON_GetNumberValue(cJSON_GetObjectItem(root, "ground_z_m")) == 1234.5);
    assert_true(cJSON_GetNumberValue(cJSON_GetObjectItem(root, "retry_after_s")) == 3);
    const cJSON *first = cJSON_GetArrayItem(cJSON_GetObjectItem(root, "errors"), 0);
    assert_string_equal(text_of(first, "field"), "vfov");
    cJSON_Delete(root);
    for (int k = 0; k < 100; k++)
        sv_errors_add(&errors, SV_EINVAL, "heading", "bad \xFF byte");
    problem.ground_z_m = NAN;
    root = document(&problem);
    assert_memory_equal(text_of(root, "detail"), "101 errors: vfov, heading", 25);
    assert_int_equal(cJSON_GetArraySize(cJSON_GetObjectItem(root, "errors")), SV_ERRORS_MAX);
    assert_true(cJSON_GetNumberValue(cJSON_GetObjectItem(root, "errors_total")) == 101);
    assert_true(cJSON_IsNull(cJSON_GetObjectItem(root, "ground_z_m")));
    cJSON_Delete(root);
    problem.detail = "own words";
    root = document(&problem);
    assert_string_equal(text_of(root, "detail"), "own words");
    cJSON_Delete(root);
    sv_errors_finish(&errors);
}

/* As the dispatcher and the server's own refusals fill them in. */
static void details_advise(void **state)
{
    (void)state;
    static const struct {
        enum sv_problem_kind kind;
        const char *detail, *allow, *want;
    } rows[] = {
        {SV_PROBLEM_UNAUTHORIZED, NULL, NULL,
         "send Authorization: Bearer TOKEN, with the service's admin_token"},
        {SV_PROBLEM_NOT_FOUND, "/openapi.json tells what there is", NULL,
         "check the path: /openapi.json tells what there is"},
        {SV_PROBLEM_METHOD, NULL, "GET, HEAD, OPTIONS",
         "send one of the methods that this path answers: GET, HEAD, OPTIONS"},
        {SV_PROBLEM_LENGTH, NULL, NULL, "send Content-Length, or Transfer-Encoding: chunked"},
        {SV_PROBLEM_TOO_LARGE, "the body is longer than max_body_bytes", NULL,
         "the body is longer than max_body_bytes: send a smaller one"},
        {SV_PROBLEM_URI, "the target is longer than max_url_bytes", NULL,
         "the target is longer than max_url_bytes: send a view as the JSON body of POST /v1/view instead"},
        {SV_PROBLEM_MEDIA_TYPE, "application/json", NULL, "send Content-Type: application/json"},
        {SV_PROBLEM_NOT_BUILT, "WMS 1.1.1 and 1.3.0", NULL,
         "this call is not built yet (WMS 1.1.1 and 1.3.0): /openapi.json marks what is"},
        {SV_PROBLEM_OVERLOADED, "the queue is full", NULL, "the queue is full"},
    };
    for (size_t k = 0; k < sizeof rows / sizeof rows[0]; k++) {
        struct sv_problem problem = {.kind = rows[k].kind, .detail = rows[k].detail, .allow = rows[k].allow};
        cJSON *root = document(&problem);
        assert_string_equal(text_of(root, "detail"), rows[k].want);
        cJSON_Delete(root);
    }
}

static void from_status(void **state)
{
    (void)state;
    static const int want[SV_STATUS_COUNT] = {
        [SV_OK] = 200,     [SV_EINVAL] = 400,       [SV_ENOENT] = 500,       [SV_EFORMAT] = 500,
        [SV_ELIMIT] = 400, [SV_EUNSUPPORTED] = 501, [SV_EUNDERGROUND] = 422, [SV_EOUTSIDE] = 422,
        [SV_EIO] = 500,    [SV_ENOMEM] = 500,       [SV_ETIMEOUT] = 504,     [SV_EINTERNAL] = 500};
    for (int k = 0; k < SV_STATUS_COUNT; k++)
        assert_int_equal(sv_api_problem_status(sv_api_problem_of_status((enum sv_status)k)), want[k]);
    assert_int_equal(sv_api_problem_status(sv_api_problem_of_status((enum sv_status)77)), 500);
}

static void keys_of_the_client(void **state)
{
    (void)state;
    static const struct {
        enum sv_place_form eye, target;
        bool has_z;
        const char *field, *want;
    } rows[] = {
        {SV_PLACE_XY, SV_PLACE_NONE, true, "z", "z"},
        {SV_PLACE_XY, SV_PLACE_NONE, false, "z", "agl"},
        {SV_PLACE_NONE, SV_PLACE_XY, false, "z", "range"},
        {SV_PLACE_XY, SV_PLACE_NONE, false, "eye", "x"},
        {SV_PLACE_LONLAT, SV_PLACE_NONE, false, "eye", "lon"},
        {SV_PLACE_NONE, SV_PLACE_XY, false, "eye", "range"},
        {SV_PLACE_XY, SV_PLACE_LONLAT, false, "target", "target_lon"},
        {SV_PLACE_XY, SV_PLACE_XY, false, "target", "target_x"},
        {SV_PLACE_XY, SV_PLACE_XY, false, "crs", "crs"},
    };
    for (size_t k = 0; k < sizeof rows / sizeof rows[0]; k++) {
        struct sv_view_request request = {.eye = {.form = rows[k].eye, .has_z = rows[k].has_z},
                                          .target = {.form = rows[k].target}};
        struct sv_error error;
        (void)sv_fail(&error, SV_EINVAL, rows[k].field, "why");
        sv_api_problem_name_keys(&request, &error);
        assert_string_equal(error.field, rows[k].want);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(every_kind), cmocka_unit_test(members),
                                       cmocka_unit_test(details_advise), cmocka_unit_test(from_status),
                                       cmocka_unit_test(keys_of_the_client)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
