#include "api/number.h"

#include <locale.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "core/base/rng.h"
#include "core/base/vec.h"
#include "tests/api/cmocka_all.h"

static void syntax(void **state)
{
    (void)state;
    static const struct {
        const char *text;
        double value; /* NAN: refused */
    } rows[] = {
        {"0", 0},
        {"-0", 0},
        {"1", 1},
        {"010", 10},
        {"-12.5", -12.5},
        {".5", 0.5},
        {"-.5", -0.5},
        {"5.", 5},
        {"1e3", 1000},
        {"1E+3", 1000},
        {"25e-1", 2.5},
        {"1e999", INFINITY},
        {"-1e999", -INFINITY},
        {"1e-999", 0},
        {"0.1", 0.1},
        {"", NAN},
        {".", NAN},
        {"-", NAN},
        {"-.", NAN},
        {"+1", NAN},
        {" 1", NAN},
        {"1 ", NAN},
        {"1,5", NAN},
        {"0x10", NAN},
        {"1e", NAN},
        {"1e+", NAN},
        {"e5", NAN},
        {"inf", NAN},
        {"nan", NAN},
        {"NaN", NAN},
        {"infinity", NAN},
        {"1.2.3", NAN},
        {"--1", NAN},
        {"1-", NAN},
        {"1f", NAN},
        {"1_000", NAN},
        {"\xD9\xA1", NAN},
        {"0x1p3", NAN},
        {"1e5.0", NAN},
        {"000000000000000000000000000000000000000000000000000000000000001", 1},   /* 63 characters */
        {"0000000000000000000000000000000000000000000000000000000000000001", NAN} /* 64 */
    };
    for (size_t k = 0; k < sizeof rows / sizeof rows[0]; k++) {
        double v = 7;
        bool good = sv_api_number_parse(rows[k].text, strlen(rows[k].text), &v);
        if (good != !isnan(rows[k].value) || (good && v != rows[k].value) || (!good && v != 7) ||
            (v == 0 && signbit(v)))
            fail_msg("\"%s\": got %d %g", rows[k].text, good, v);
    }
    double v = 7;
    assert_false(sv_api_number_parse("1\0002", 3, &v));
    assert_true(sv_api_number_parse("12345", 2, &v)); /* n bytes, no more */
    assert_true(v == 12);
}

static double random_double(struct sv_rng *rng)
{
    for (;;) {
        uint64_t bits = sv_rng_next(rng);
        double v;
        memcpy(&v, &bits, sizeof v);
        if (isfinite(v))
            return v;
    }
}

static void format_reads_back(void **state)
{
    (void)state;
    struct sv_rng rng = sv_rng_seeded(11, 0);
    char text[SV_API_NUMBER_BUFFER];
    for (int k = 0; k < 100000; k++) {
        double v = random_double(&rng), back;
        sv_api_number_format(v, text);
        if (!sv_api_number_parse(text, strlen(text), &back) || back != v)
            fail_msg("%a became %s", v, text);
    }
    assert_string_equal(sv_api_number_format(0.1, text), "0.1");
    assert_string_equal(sv_api_number_format(-0.0, text), "0");
    assert_string_equal(sv_api_number_format(500120, text), "500120");
    assert_string_equal(sv_api_number_format(5200340.125, text), "5200340.125");
}

/* Any degrees that a client can write come back from radians as the shortest that mean the same. */
static void degrees_come_back(void **state)
{
    (void)state;
    struct sv_rng rng = sv_rng_seeded(12, 0);
    for (int k = 0; k < 100000; k++) {
        double d = (sv_rng_unit(&rng) - 0.5) * 720, r = sv_radians(d), back = sv_api_degrees(r);
        if (sv_radians(back) != r)
            fail_msg("%.17g deg came back as %.17g", d, back);
        char text[32];
        snprintf(text, sizeof text, "%.4f", d);
        d = strtod(text, NULL);
        if (sv_api_degrees(sv_radians(d)) != d)
            fail_msg("%s deg came back as %.17g", text, sv_api_degrees(sv_radians(d)));
    }
    assert_true(sv_api_degrees(sv_radians(30)) == 30);
    assert_true(sv_api_degrees(0) == 0);
    assert_true(isnan(sv_api_degrees(NAN)));
    assert_true(isinf(sv_api_degrees(INFINITY)));
}

static void any_locale(void **state)
{
    (void)state;
    static const char *const names[] = {"de_DE.UTF-8", "de_DE.utf8", "fr_FR.UTF-8", "fr_FR.utf8"};
    for (size_t k = 0; k < sizeof names / sizeof names[0]; k++)
        if (setlocale(LC_ALL, names[k])) {
            double v;
            char text[SV_API_NUMBER_BUFFER];
            assert_true(sv_api_number_parse("1.5", 3, &v) && v == 1.5);
            assert_false(sv_api_number_parse("1,5", 3, &v));
            assert_string_equal(sv_api_number_format(1.5, text), "1.5");
            setlocale(LC_ALL, "C");
            return;
        }
    print_message("skipped: no locale with a decimal comma is installed\n");
    skip();
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(syntax), cmocka_unit_test(format_reads_back),
                                       cmocka_unit_test(degrees_come_back), cmocka_unit_test(any_locale)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
