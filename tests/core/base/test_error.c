/* test_error.c - texts are cut at characters, lists keep the first and count all. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <string.h>
#include <cmocka.h>

#include "core/base/error.h"

static void test_fail(void **state)
{
    (void)state;
    struct sv_error e;
    assert_int_equal(sv_fail(&e, SV_EINVAL, "x", "%d is outside %d .. %d", 7, 0, 5), SV_EINVAL);
    assert_int_equal(e.code, SV_EINVAL);
    assert_string_equal(e.field, "x");
    assert_string_equal(e.message, "7 is outside 0 .. 5");
    assert_int_equal(sv_fail(NULL, SV_EIO, NULL, "dropped"), SV_EIO);
    assert_int_equal(sv_fail(&e, SV_EIO, NULL, "no field"), SV_EIO);
    assert_string_equal(e.field, "");
}

/* Any text of 2-, 3- and 4-byte characters, shifted by 0 .. 3 bytes, ends on a whole character. */
static void test_cut(void **state)
{
    (void)state;
    static const char *const letters[] = {"\xC3\xA4", "\xE2\x82\xAC", "\xF0\x9F\x8C\xB2"};
    for (size_t l = 0; l < 3; l++)
        for (size_t shift = 0; shift < 4; shift++) {
            char text[2000] = "";
            size_t n = strlen(letters[l]), used = shift;
            memset(text, 'a', shift);
            for (; used + n < sizeof text; used += n)
                memcpy(text + used, letters[l], n);
            text[used] = '\0';
            struct sv_error e;
            sv_fail(&e, SV_EINVAL, text, "%s", text);
            const char *const got[] = {e.field, e.message};
            const size_t room[] = {sizeof e.field, sizeof e.message};
            for (size_t k = 0; k < 2; k++) {
                assert_int_equal((strlen(got[k]) - shift) % n, 0);
                assert_true(strlen(got[k]) < room[k] && strlen(got[k]) + n >= room[k]);
                assert_memory_equal(got[k], text, strlen(got[k]));
            }
        }
}

/* A text that just fits, whole characters and all, is not cut. */
static void test_just_fits(void **state)
{
    (void)state;
    char text[160];
    struct sv_error e;
    memset(text, 'b', sizeof text);
    memcpy(text + 157, "\xC3\xA4", 3);
    sv_fail(&e, SV_EINVAL, text, "m");
    assert_string_equal(e.field, text);
}

static void test_list(void **state)
{
    (void)state;
    struct sv_errors list;
    sv_errors_init(&list);
    for (int k = 0; k < SV_ERRORS_MAX + 9; k++)
        sv_errors_add(&list, SV_EFORMAT, "f", "number %d", k);
    assert_int_equal(list.count, SV_ERRORS_MAX);
    assert_int_equal(list.total, SV_ERRORS_MAX + 9);
    assert_string_equal(list.items[0].message, "number 0");
    assert_string_equal(list.items[SV_ERRORS_MAX - 1].message, "number 63");
    sv_errors_finish(&list);
    sv_errors_finish(&list); /* legal twice */
    assert_int_equal(list.total, 0);
}

static void test_status_text(void **state)
{
    (void)state;
    for (int k = 0; k < SV_STATUS_COUNT; k++)
        for (int other = 0; other < k; other++)
            assert_string_not_equal(sv_status_text((enum sv_status)k), sv_status_text((enum sv_status)other));
    assert_string_equal(sv_status_text(SV_STATUS_COUNT), "unknown status");
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(test_fail), cmocka_unit_test(test_cut),
                                       cmocka_unit_test(test_just_fits), cmocka_unit_test(test_list),
                                       cmocka_unit_test(test_status_text)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
