#include "api/headers.h"

#include <string.h>

#include "tests/api/cmocka_all.h"

static void set_find_replace(void **state)
{
    (void)state;
    struct sv_headers h;
    sv_api_headers_init(&h);
    sv_api_headers_set(&h, "ETag", "%s", "one");
    sv_api_headers_set(&h, "Vary", "Accept");
    sv_api_headers_set(&h, "ETag", "two-%d", 2);
    assert_int_equal(h.count, 2);
    assert_string_equal(sv_api_headers_find(&h, "etag"), "two-2");
    assert_string_equal(sv_api_headers_value(&h, 1), "Accept");
    assert_null(sv_api_headers_find(&h, "E"));
    assert_false(h.overflow);
}

static void nothing_splits(void **state)
{
    (void)state;
    struct sv_headers h;
    sv_api_headers_init(&h);
    sv_api_headers_set(&h, "X", "%s", "a\r\nSet-Cookie: b\x7F\t");
    assert_string_equal(sv_api_headers_find(&h, "X"), "a  Set-Cookie: b  ");
}

static void full(void **state)
{
    (void)state;
    struct sv_headers h;
    char long_value[SV_HEADERS_BYTES];
    memset(long_value, 'a', sizeof long_value - 1);
    long_value[sizeof long_value - 1] = '\0';
    sv_api_headers_init(&h);
    sv_api_headers_set(&h, "A", "1");
    sv_api_headers_set(&h, "B", "%s", long_value);
    assert_true(h.overflow);
    assert_int_equal(h.count, 1);
    sv_api_headers_set(&h, "C", "3");
    assert_string_equal(sv_api_headers_find(&h, "C"), "3");
    assert_string_equal(sv_api_headers_find(&h, "A"), "1");
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(set_find_replace), cmocka_unit_test(nothing_splits),
                                       cmocka_unit_test(full)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
