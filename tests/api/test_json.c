#include "api/json.h"

#include <stdbool.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "tests/api/cmocka_all.h"

/* The text on the heap without a NUL, so that a byte too far is seen. */
static bool reads(const char *text, size_t n, struct sv_error *error)
{
    char *copy = malloc(n ? n : 1);
    cJSON *root = NULL;
    memcpy(copy, text, n);
    bool good = sv_api_json_parse(copy, n, &root, error) == SV_OK;
    assert_int_equal(good, root != NULL);
    cJSON_Delete(root);
    free(copy);
    return good;
}

/* After the JSON Parsing Test Suite (Seriot, "Parsing JSON is a minefield"): y_ must be read, n_ must not. */
static void grammar(void **state)
{
    (void)state;
    static const char *const yes[] = {"[]",
                                      "{}",
                                      " [ ] ",
                                      "[[]]",
                                      "[1]",
                                      "[0]",
                                      "[-0]",
                                      "[-0.0]",
                                      "[1.5e+10]",
                                      "[1E5]",
                                      "[0e1]",
                                      "[\"\"]",
                                      "\"x\"",
                                      "1",
                                      "true",
                                      "null",
                                      "[true,false,null]",
                                      "{\"a\":1}",
                                      "{\"a\":{\"b\":[1,2,{\"c\":null}]}}",
                                      "[\"\\\"\\\\\\/\\b\\f\\n\\r\\t\"]",
                                      "[\"\\u0041\"]",
                                      "[\"\\uD834\\uDD1E\"]",
                                      "[\"\xC3\xA9\"]",
                                      "[\"\xF4\x8F\xBF\xBF\"]",
                                      "[\"\x7F\"]",
                                      "\t\r\n [1]\n",
                                      "{\"\":0}",
                                      "{\"a\":1,\"b\":1}",
                                      "[123.456e-789]",
                                      "[1e400]",
                                      "[[[[[[[[[[[[[[[[]]]]]]]]]]]]]]]]"};
    static const char *const no[] = {"",
                                     " ",
                                     "[",
                                     "]",
                                     "{",
                                     "}",
                                     "[1",
                                     "[1,]",
                                     "[,1]",
                                     "[1,,2]",
                                     "[1]x",
                                     "[1] [2]",
                                     "{\"a\"}",
                                     "{\"a\":}",
                                     "{\"a\":1,}",
                                     "{a:1}",
                                     "{'a':1}",
                                     "{\"a\" 1}",
                                     "{1:1}",
                                     "[01]",
                                     "[-01]",
                                     "[1.]",
                                     "[.5]",
                                     "[+1]",
                                     "[1e]",
                                     "[1e+]",
                                     "[-]",
                                     "[0x1]",
                                     "[NaN]",
                                     "[Infinity]",
                                     "[-Infinity]",
                                     "[True]",
                                     "[nul]",
                                     "[tru]",
                                     "[\"]",
                                     "[\"a]",
                                     "[\"\\x\"]",
                                     "[\"\\u12\"]",
                                     "[\"\\u00G0\"]",
                                     "[\"\\u0000\"]",
                                     "[\"\\uD800\"]",
                                     "[\"\\uDC00\"]",
                                     "[\"\\uD800\\u0041\"]",
                                     "[\"\\uD800x\"]",
                                     "[\"a\nb\"]",
                                     "[\"a\tb\"]",
                                     "[\"\x01\"]",
                                     "[\"\xFF\"]",
                                     "[\"\xC3\"]",
                                     "[\"\xED\xA0\x80\"]",
                                     "[\"\xC0\xAF\"]",
                                     "\xEF\xBB\xBF[]",
                                     "[1]//c",
                                     "/**/[1]",
                                     "[1\f]",
                                     "\xFE\xFF",
                                     "[\"\\",
                                     "[\"\\u",
                                     "{\"a\":1 \"b\":2}",
                                     "[1 2]",
                                     "*",
                                     "[[[[[[[[[[[[[[[[[]]]]]]]]]]]]]]]]]",
                                     "{\"a\":1,\"a\":2}",
                                     "{\"a\":1,\"\\u0061\":2}",
                                     "[{\"b\":{\"a\":1,\"a\":1}}]",
                                     "[1234567890123456789012345678901234567890123456789012345678901234]"};
    for (size_t k = 0; k < sizeof yes / sizeof yes[0]; k++)
        if (!reads(yes[k], strlen(yes[k]), NULL))
            fail_msg("must be read: %s", yes[k]);
    for (size_t k = 0; k < sizeof no / sizeof no[0]; k++) {
        struct sv_error error;
        if (reads(no[k], strlen(no[k]), &error))
            fail_msg("must not be read: %s", no[k]);
        assert_int_equal(error.code, SV_EINVAL);
    }
    assert_false(reads("[1]\0", 4, NULL));
    assert_false(reads("[\0]", 3, NULL));
}

static void places(void **state)
{
    (void)state;
    struct sv_error error;
    assert_false(reads("{\n  \"a\": 1,\n  \"b\": tru\n}", 24, &error));
    assert_non_null(strstr(error.message, "line 3, column 8"));
    assert_false(reads("{\"width\":1,\"width\":2}", 21, &error));
    assert_string_equal(error.field, "width");
}

static void members(void **state)
{
    (void)state;
    for (int over = 0; over <= 1; over++) {
        char text[8192] = "{";
        size_t used = 1;
        for (int k = 0; k < SV_API_JSON_MEMBERS_MAX + over; k++)
            used += (size_t)snprintf(text + used, sizeof text - used, "%s\"k%d\":%d", k ? "," : "", k, k);
        used += (size_t)snprintf(text + used, sizeof text - used, "}");
        assert_int_equal(reads(text, used, NULL), !over);
    }
    char deep[20000];
    memset(deep, '[', sizeof deep);
    assert_false(reads(deep, sizeof deep, NULL));
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(grammar), cmocka_unit_test(places),
                                       cmocka_unit_test(members)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
