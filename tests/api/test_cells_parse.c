/* test_cells_parse.c - lists of views: every bad field under its place, and nothing taken from a list with a
 * bad one. */
#include "api/cells_parse.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "tests/api/cmocka_all.h"

static struct sv_view_request views[SV_API_CELLS_VIEWS_MAX];

/* The bad fields with blanks between, in *fields. */
static enum sv_problem_kind parse(const char *body, size_t *count, char fields[512])
{
    const struct sv_api_view_limits limits = SV_API_VIEW_LIMITS_DEFAULT;
    struct sv_errors errors;
    sv_errors_init(&errors);
    enum sv_problem_kind kind = sv_api_cells_parse(body, strlen(body), &limits, views, count, &errors);
    fields[0] = '\0';
    for (size_t k = 0; k < errors.count; k++)
        snprintf(fields + strlen(fields), 512 - strlen(fields), "%s%s", k ? " " : "", errors.items[k].field);
    sv_errors_finish(&errors);
    return kind;
}

static void good_lists(void **state)
{
    (void)state;
    size_t count = 0;
    char fields[512];
    assert_int_equal(
        parse("{\"views\":[{\"x\":1,\"y\":2},{\"x\":3,\"y\":4,\"relief\":\"on\",\"trees\":\"none\"}]}",
              &count, fields),
        SV_PROBLEM_NONE);
    assert_int_equal(count, 2);
    assert_true(views[0].eye.x == 1 && views[0].relief == SV_RELIEF_AUTO);
    assert_true(views[1].eye.y == 4 && views[1].relief == SV_RELIEF_ON);
}

static void bad_lists(void **state)
{
    (void)state;
    static const struct {
        const char *body, *fields;
        enum sv_problem_kind kind;
    } rows[] = {
        {"", "", SV_PROBLEM_BAD_REQUEST},
        {"[]", "views", SV_PROBLEM_BAD_REQUEST},
        {"{}", "views", SV_PROBLEM_BAD_REQUEST},
        {"{\"views\":[]}", "views", SV_PROBLEM_BAD_REQUEST},
        {"{\"views\":{\"x\":1,\"y\":2}}", "views", SV_PROBLEM_BAD_REQUEST},
        {"{\"views\":[{\"x\":1,\"y\":2}],\"path\":1}", "path", SV_PROBLEM_BAD_REQUEST},
        {"{\"views\":[1]}", "views[0]", SV_PROBLEM_BAD_REQUEST},
        {"{\"views\":[{\"x\":1,\"y\":2},{\"x\":1,\"y\":2,\"q\":0,\"bogus\":1}]}", "views[1].q views[1].bogus",
         SV_PROBLEM_BAD_REQUEST},
        {"{\"views\":[{\"x\":1,\"y\":2,\"samples\":4},{\"x\":1,\"y\":2,\"relief\":\"off\"}]}",
         "views[0].samples views[1].relief", SV_PROBLEM_BAD_REQUEST},
        {"{\"views\":[{\"x\":1,\"y\":2,\"layer\":\"depth\"},{\"x\":1,\"y\":2,\"trees\":\"coarse\"},"
         "{\"x\":1,\"y\":2,\"quality\":\"reference\"}]}",
         "views[0].layer views[1].trees views[2].quality", SV_PROBLEM_BAD_REQUEST},
        {"{\"views\":[{\"x\":1,\"y\":2,\"relief\":\"paper\"}]}", "views[0].relief", SV_PROBLEM_BAD_REQUEST},
        {"{\"views\":[{\"x\":1,\"y\":2,\"relief\":\"paper\"},{\"x\":1}]}", "views[0].relief views[1].y",
         SV_PROBLEM_BAD_REQUEST},
        {"{\"views\":[{\"x\":1},{\"x\":1,\"y\":2,\"relief\":\"paper\"}]}", "views[0].y views[1].relief",
         SV_PROBLEM_BAD_REQUEST},
    };
    for (size_t k = 0; k < sizeof rows / sizeof rows[0]; k++) {
        size_t count = 77;
        char fields[512];
        enum sv_problem_kind kind = parse(rows[k].body, &count, fields);
        if (kind != rows[k].kind || strcmp(fields, rows[k].fields) != 0)
            fail_msg("%s: got %d [%s]", rows[k].body, sv_api_problem_status(kind), fields);
    }
}

/* As many as may be, and one more. */
static void counted(void **state)
{
    (void)state;
    for (int more = 0; more < 2; more++) {
        size_t views_in = SV_API_CELLS_VIEWS_MAX + (size_t)more, count = 0, used = 0;
        char *body = malloc(views_in * 16 + 32), fields[512];
        assert_non_null(body);
        used += (size_t)snprintf(body, 32, "{\"views\":[");
        for (size_t k = 0; k < views_in; k++)
            used += (size_t)snprintf(body + used, 17, "%s{\"x\":1,\"y\":2}", k ? "," : "");
        snprintf(body + used, 3, "]}");
        assert_int_equal(parse(body, &count, fields), more ? SV_PROBLEM_BAD_REQUEST : SV_PROBLEM_NONE);
        assert_string_equal(fields, more ? "views" : "");
        assert_int_equal(count, more ? 0 : SV_API_CELLS_VIEWS_MAX);
        free(body);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(good_lists),
        cmocka_unit_test(bad_lists),
        cmocka_unit_test(counted),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
