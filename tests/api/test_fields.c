/* The table's rows hold together, and each field accepts its bounds and refuses what lies just beyond them.
 */
#include "api/fields.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "api/number.h"
#include "tests/api/cmocka_all.h"

static bool is_numeric(const struct sv_field *f)
{
    return f->type == SV_FIELD_NUMBER || f->type == SV_FIELD_INTEGER;
}

static bool reads(enum sv_field_id id, const char *text, struct sv_field_value *value)
{
    struct sv_errors errors;
    sv_errors_init(&errors);
    memset(value, 0xAA, sizeof *value);
    sv_api_field_read(id, text, strlen(text), value, &errors);
    assert_true(value->present);
    assert_int_equal(errors.total, value->good ? 0 : 1);
    if (!value->good) {
        assert_string_equal(errors.items[0].field, sv_api_field_name(id));
        assert_non_null(strstr(errors.items[0].message, "expected"));
        /* Range and unit are named. */
        if (is_numeric(sv_api_field(id))) {
            char high[SV_API_NUMBER_BUFFER];
            assert_non_null(
                strstr(errors.items[0].message, sv_api_number_format(sv_api_field(id)->max, high)));
            assert_non_null(strstr(errors.items[0].message, sv_api_field(id)->unit));
        }
    }
    sv_errors_finish(&errors);
    return value->good;
}

static void rows_hold_together(void **state)
{
    (void)state;
    for (int k = 0; k < SV_FIELD_COUNT; k++) {
        enum sv_field_id id = (enum sv_field_id)k;
        const struct sv_field *f = sv_api_field(id);
        struct sv_field_value value;
        char legal[256];
        assert_int_equal(sv_api_field_find(sv_api_field_name(id)), id);
        assert_non_null(f->help);
        assert_non_null(f->unit);
        if (!f->choices)
            assert_true(f->min < f->max);
        if (f->preset) {
            assert_true(reads(id, f->preset, &value));
            assert_true(sv_api_field_preset(id).good);
            assert_false(sv_api_field_preset(id).present);
        }
        assert_true(strlen(sv_api_field_legal(id, legal, sizeof legal)) < sizeof legal - 1);
        for (int n = 0; f->choices && f->choices[n]; n++) {
            assert_true(reads(id, f->choices[n], &value));
            assert_int_equal(value.choice, f->type == SV_FIELD_CHOICES ? 1u << n : (unsigned)n);
        }
    }
    assert_int_equal(sv_api_field_find("X"), SV_FIELD_COUNT);
    assert_int_equal(sv_api_field_find(""), SV_FIELD_COUNT);
}

static void bounds(void **state)
{
    (void)state;
    for (int k = 0; k < SV_FIELD_COUNT; k++) {
        enum sv_field_id id = (enum sv_field_id)k;
        const struct sv_field *f = sv_api_field(id);
        struct sv_field_value value;
        char text[SV_API_NUMBER_BUFFER];
        if (!is_numeric(f))
            continue;
        assert_int_equal(reads(id, sv_api_number_format(f->min, text), &value), !f->above_min);
        assert_true(reads(id, sv_api_number_format(f->max, text), &value));
        assert_true(value.number == f->max);
        assert_false(reads(id, sv_api_number_format(nextafter(f->min, -INFINITY), text), &value));
        assert_false(reads(id, sv_api_number_format(nextafter(f->max, INFINITY), text), &value));
        static const char *const never[] = {"",       "nan", "inf", "-inf", "0x1", "1e999",
                                            "-1e999", "a",   " 1",  "1 ",   "+1"};
        for (size_t n = 0; n < sizeof never / sizeof never[0]; n++)
            assert_false(reads(id, never[n], &value));
        assert_int_equal(reads(id, "30.5", &value), f->type == SV_FIELD_NUMBER);
        struct sv_errors errors;
        sv_errors_init(&errors);
        static const double not_finite[] = {NAN, INFINITY, -INFINITY};
        for (int n = 0; n < 3; n++) {
            sv_api_field_read_number(id, not_finite[n], &value, &errors);
            assert_false(value.good);
        }
        sv_errors_finish(&errors);
    }
}

static void special_types(void **state)
{
    (void)state;
    struct sv_field_value v;
    assert_true(reads(SV_FIELD_CRS, "EPSG:32633", &v) && v.number == 32633);
    static const char *const bad_crs[] = {"epsg:32633", "EPSG:",     "EPSG:0",      "EPSG:1000000",
                                          "EPSG:-1",    "EPSG:1e3",  "EPSG:4326.0", "32633",
                                          "EPSG: 1",    "EPSG:4326 "};
    for (size_t k = 0; k < sizeof bad_crs / sizeof bad_crs[0]; k++)
        assert_false(reads(SV_FIELD_CRS, bad_crs[k], &v));
    assert_true(reads(SV_FIELD_LAYER, "id,color", &v) && v.choice == (1u | 1u << 3));
    static const char *const bad_layers[] = {"color,",       ",color", "color,color", "colour", "color;depth",
                                             "color, depth", ","};
    for (size_t k = 0; k < sizeof bad_layers / sizeof bad_layers[0]; k++)
        assert_false(reads(SV_FIELD_LAYER, bad_layers[k], &v));
    assert_true(reads(SV_FIELD_SAMPLES, "16", &v) && v.number == 16);
    assert_false(reads(SV_FIELD_SAMPLES, "2", &v));
    assert_false(reads(SV_FIELD_SAMPLES, "16.5", &v));
    assert_true(reads(SV_FIELD_TIME, "2026-06-21T12:00:00+02:00", &v) && v.number == 1782036000);
    static const char *const bad_times[] = {"2026-06-21T12:00:00 02:00", "2026-06-21",
                                            "1899-12-31T23:59:59Z",      "2101-01-01T00:00:00Z",
                                            "2026-13-01T00:00:00Z",      "noon"};
    for (size_t k = 0; k < sizeof bad_times / sizeof bad_times[0]; k++)
        assert_false(reads(SV_FIELD_TIME, bad_times[k], &v));
    assert_false(reads(SV_FIELD_SKY, "true", &v));
    assert_false(reads(SV_FIELD_SKY, "ON", &v));
}

static void nearest_names(void **state)
{
    (void)state;
    static const char *const rows[][2] = {{"X", "x"},
                                          {"fov", "vfov"},
                                          {"headin", "heading"},
                                          {"HEADING", "heading"},
                                          {"sun_elevaton", "sun_elevation"},
                                          {"layers", "layer"},
                                          {"budget", NULL},
                                          {"banana", NULL},
                                          {"target", "target_x"},
                                          {"qualty", "quality"},
                                          {"targetx", "target_x"},
                                          {"a_very_long_key_that_is_nothing_like_any_of_them", NULL},
                                          {"", NULL}};
    for (size_t k = 0; k < sizeof rows / sizeof rows[0]; k++) {
        const char *got = sv_api_field_nearest(rows[k][0]);
        if ((got == NULL) != (rows[k][1] == NULL) || (got && strcmp(got, rows[k][1]) != 0))
            fail_msg("%s: expected %s got %s", rows[k][0], rows[k][1] ? rows[k][1] : "none",
                     got ? got : "none");
    }
    struct sv_errors errors;
    struct sv_field_value v;
    sv_errors_init(&errors);
    sv_api_field_read(SV_FIELD_FORMAT, "jpg", 3, &v, &errors);
    assert_non_null(strstr(errors.items[0].message, "did you mean \"jpeg\""));
    sv_api_field_read(SV_FIELD_TIME, "2026-06-21T12:00:00 02:00", 25, &v, &errors);
    assert_non_null(strstr(errors.items[1].message, "%2B"));
    sv_errors_finish(&errors);
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(rows_hold_together), cmocka_unit_test(bounds),
                                       cmocka_unit_test(special_types), cmocka_unit_test(nearest_names)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
