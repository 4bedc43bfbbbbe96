/* test_rfc3339.c - moments against timegm, and what is refused. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <math.h>
#include <stdio.h>
#include <string.h>
#include <stdlib.h>
#include <time.h>
#include <cmocka.h>

#include "core/base/rfc3339.h"
#include "core/base/rng.h"

static void test_cited(void **state)
{
    (void)state;
    static const struct {
        const char *text;
        double unix_s;
    } rows[] = {
        {"1970-01-01T00:00:00Z", 0},
        {"1985-04-12T23:20:50.52Z", 482196050.52},   /* RFC 3339 section 5.8 */
        {"1996-12-19T16:39:57-08:00", 851042397},    /* the same */
        {"1990-12-31T23:59:60Z", 662687999.9999999}, /* leap second: just before 1991 */
        {"1990-12-31T15:59:60-08:00", 662687999.9999999},
        {"1937-01-01T12:00:27.87+00:20", -1041337172.13},
        {"2026-06-21t12:00:00z", 1782043200},
        {"2026-06-21 12:00:00+02:00", 1782036000},
        {"2000-02-29T00:00:00-00:00", 951782400},
        {"0001-01-01T00:00:00Z", -62135596800},
        {"9999-12-31T23:59:59Z", 253402300799},
        {"2026-06-21T12:00:00.000000000000000000000000000000001Z", 1782043200},
    };
    for (size_t k = 0; k < sizeof rows / sizeof rows[0]; k++) {
        double got = NAN;
        struct sv_error e;
        if (sv_rfc3339_parse(rows[k].text, &got, &e) != SV_OK)
            fail_msg("%s: %s", rows[k].text, e.message);
        if (!(fabs(got - rows[k].unix_s) < 3e-7)) /* half a double's step at 1.8e9 is 1.2e-7 */
            fail_msg("%s: expected %.9f, got %.9f", rows[k].text, rows[k].unix_s, got);
    }
}

static void test_leap_is_before_midnight(void **state)
{
    (void)state;
    double leap, next;
    assert_int_equal(sv_rfc3339_parse("2016-12-31T23:59:60Z", &leap, NULL), SV_OK);
    assert_int_equal(sv_rfc3339_parse("2017-01-01T00:00:00Z", &next, NULL), SV_OK);
    assert_true(leap < next && next - leap < 1e-6);
    assert_int_equal(sv_rfc3339_parse("2017-01-01T08:59:60+09:00", &leap, NULL), SV_OK);
    assert_true(leap < next && next - leap < 1e-6);
}

static void test_refused(void **state)
{
    (void)state;
    static const char *const bad[] = {"",
                                      "2026",
                                      "2026-06-21",
                                      "2026-06-21T12:00:00",
                                      "2026-06-21T12:00Z",
                                      "2026-06-21T12:00:00+0200",
                                      "2026-06-21T12:00:00+24:00",
                                      "2026-06-21T12:00:00+02:60",
                                      "2026-6-21T12:00:00Z",
                                      "2026-13-01T00:00:00Z",
                                      "2026-00-01T00:00:00Z",
                                      "2026-01-00T00:00:00Z",
                                      "2026-02-29T00:00:00Z",
                                      "1900-02-29T00:00:00Z",
                                      "2026-04-31T00:00:00Z",
                                      "2026-01-01T24:00:00Z",
                                      "2026-01-01T00:60:00Z",
                                      "2026-01-01T00:00:61Z",
                                      "2026-01-01T00:00:60Z",
                                      "2026-06-30T12:59:60Z",
                                      "2026-06-29T23:59:60Z",
                                      "0000-01-01T00:00:00Z",
                                      "2026-06-21T12:00:00.Z",
                                      "2026-06-21T12:00:00,5Z",
                                      " 2026-06-21T12:00:00Z",
                                      "2026-06-21T12:00:00Z ",
                                      "-026-06-21T12:00:00Z",
                                      "+2026-06-21T12:00:00Z",
                                      "2026-06-21X12:00:00Z",
                                      "2026-06-21T12:00:00.5",
                                      "NaN",
                                      "1e999"};
    for (size_t k = 0; k < sizeof bad / sizeof bad[0]; k++) {
        double got = 77;
        struct sv_error e = {0};
        if (sv_rfc3339_parse(bad[k], &got, &e) != SV_EINVAL || got != 77 ||
            (strncmp(e.message, "is not a ", 9) != 0 && strncmp(e.message, "has ", 4) != 0))
            fail_msg("\"%s\" was not refused", bad[k]);
    }
    double got;
    assert_int_equal(sv_rfc3339_parse(NULL, &got, NULL), SV_EINVAL);
}

/* Random moments against the C library. */
static void test_timegm(void **state)
{
    (void)state;
    struct sv_rng rng = sv_rng_seeded(4, 4);
    for (int n = 0; n < 20000; n++) {
        time_t t = (time_t)sv_rng_range(&rng, -60e9, 250e9);
        int offset = (int)sv_rng_range(&rng, -1439, 1440);
        time_t local = t + (time_t)offset * 60;
        struct tm tm;
        gmtime_r(&local, &tm);
        char text[80];
        snprintf(text, sizeof text, "%04d-%02d-%02dT%02d:%02d:%02d%c%02d:%02d", tm.tm_year + 1900,
                 tm.tm_mon + 1, tm.tm_mday, tm.tm_hour, tm.tm_min, tm.tm_sec, offset < 0 ? '-' : '+',
                 abs(offset) / 60, abs(offset) % 60);
        double got = NAN;
        if (sv_rfc3339_parse(text, &got, NULL) != SV_OK || got != (double)t)
            fail_msg("%s: expected %lld, got %.3f", text, (long long)t, got);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(test_cited),
                                       cmocka_unit_test(test_leap_is_before_midnight),
                                       cmocka_unit_test(test_refused), cmocka_unit_test(test_timegm)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
