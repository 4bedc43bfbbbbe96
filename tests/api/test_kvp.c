#include "api/kvp.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "tests/api/cmocka_all.h"

/* Writes what the walker sees as "key=value;..." with "!n" for fault n. */
static void walk(const char *query, size_t bytes, char *out, size_t size)
{
    struct sv_api_kvp kvp;
    size_t used = 0;
    /* On the heap and without a NUL, so that a byte too far is seen. */
    char *copy = malloc(bytes ? bytes : 1);
    memcpy(copy, query, bytes);
    out[0] = '\0';
    sv_api_kvp_init(&kvp, copy, bytes);
    while (sv_api_kvp_next(&kvp)) {
        if (kvp.fault)
            used += (size_t)snprintf(out + used, size - used, "%s!%d%s;", kvp.key, (int)kvp.fault, kvp.value);
        else
            used += (size_t)snprintf(out + used, size - used, "%s=%s;", kvp.key, kvp.value);
        assert_int_equal(strlen(kvp.value), kvp.value_bytes);
    }
    free(copy);
}

static void pairs(void **state)
{
    (void)state;
    static const struct {
        const char *query;
        size_t bytes; /* 0: strlen */
        const char *want;
    } rows[] = {
        {"", 0, ""},
        {"&&", 0, ""},
        {"x=1", 0, "x=1;"},
        {"x=1&y=2", 0, "x=1;y=2;"},
        {"&x=1&&y=2&", 0, "x=1;y=2;"},
        {"x=", 0, "x=;"},
        {"x=a=b", 0, "x=a=b;"},
        {"t=1+2", 0, "t=1 2;"},
        {"t=1%2B2", 0, "t=1+2;"},
        {"%78=%31", 0, "x=1;"},
        {"n=%C3%A9", 0, "n=\xC3\xA9;"},
        {"a%26b=%3D", 0, "a&b==;"},
        {"x", 0, "x!5;"},
        {"=1", 0, "!6;"},
        {"=", 0, "!6;"},
        {"x=%", 0, "x!1;"},
        {"x=%4", 0, "x!1;"},
        {"x=%4g", 0, "x!1;"},
        {"x=%%30", 0, "x!1;"},
        {"%zz=1", 0, "%zz!1;"},
        {"x=%00", 0, "x!2;"},
        {"x=1\0", 4, "x!2;"},
        {"x=%FF", 0, "x!3;"},
        {"x=%C3", 0, "x!3;"},
        {"x=%C0%80", 0, "x!3;"},
        {"x=%ED%A0%80", 0, "x!3;"},
        {"\xFF=1", 0, "\\xFF!3;"},
    };
    for (size_t k = 0; k < sizeof rows / sizeof rows[0]; k++) {
        char out[512];
        walk(rows[k].query, rows[k].bytes ? rows[k].bytes : strlen(rows[k].query), out, sizeof out);
        if (strcmp(out, rows[k].want) != 0)
            fail_msg("\"%s\": expected %s got %s", rows[k].query, rows[k].want, out);
    }
    walk("", 0, (char[8]){0}, 8);
    struct sv_api_kvp kvp;
    sv_api_kvp_init(&kvp, NULL, 0);
    assert_false(sv_api_kvp_next(&kvp));
}

static void lengths(void **state)
{
    (void)state;
    for (int over = 0; over <= 1; over++) {
        char query[512];
        struct sv_api_kvp kvp;
        int n = snprintf(query, sizeof query, "x=%0*d", SV_API_KVP_VALUE_MAX + over, 1);
        sv_api_kvp_init(&kvp, query, (size_t)n);
        assert_true(sv_api_kvp_next(&kvp));
        assert_int_equal(kvp.fault, over ? SV_API_KVP_LONG : SV_API_KVP_OK);
        n = snprintf(query, sizeof query, "%0*d=1", SV_API_KVP_KEY_MAX + over, 1);
        sv_api_kvp_init(&kvp, query, (size_t)n);
        assert_true(sv_api_kvp_next(&kvp));
        assert_int_equal(kvp.fault, over ? SV_API_KVP_LONG : SV_API_KVP_OK);
        assert_int_equal(kvp.has_key, !over);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(pairs), cmocka_unit_test(lengths)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
