/* Properties over random legal requests: one text for one meaning, another for another, and the text means
 * itself. */
#include "api/canonical.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "api/view_parse.h"
#include "tests/api/cmocka_all.h"
#include "tests/api/random_view.h"

static const struct sv_api_view_limits open_limits = {.pixels_max = UINT64_MAX,
                                                      .sample_pixels_max = UINT64_MAX};

static bool parse_kvp(const char *query, struct sv_view_request *request)
{
    struct sv_api_view view;
    struct sv_errors errors;
    sv_errors_init(&errors);
    enum sv_problem_kind kind =
        sv_api_view_parse_kvp(query, strlen(query), NULL, &open_limits, &view, &errors);
    if (kind == SV_PROBLEM_NONE)
        *request = view.request;
    sv_errors_finish(&errors);
    return kind == SV_PROBLEM_NONE;
}

static void must_kvp(const char *query, struct sv_view_request *request)
{
    if (!parse_kvp(query, request))
        fail_msg("refused: %s", query);
}

static void must_json(const char *body, struct sv_view_request *request)
{
    struct sv_api_view view;
    struct sv_errors errors;
    sv_errors_init(&errors);
    if (sv_api_view_parse_json(body, strlen(body), NULL, &open_limits, &view, &errors) != SV_PROBLEM_NONE)
        fail_msg("refused: %s: %s", body, errors.items[0].message);
    *request = view.request;
    sv_errors_finish(&errors);
}

/* What the header says has no effect, set alike: then equal meaning is equal bytes. */
static struct sv_view_request meaning(const struct sv_view_request *request)
{
    struct sv_view_request r = *request;
    r.samples = sv_api_view_samples(&r);
    if (r.format != SV_FORMAT_JPEG && r.format != SV_FORMAT_WEBP)
        r.q = 0;
    if (r.projection == SV_PROJECTION_ORTHOGRAPHIC)
        r.vfov_rad = 0;
    return r;
}

static bool same(const struct sv_view_request *a, const struct sv_view_request *b)
{
    struct sv_view_request x = meaning(a), y = meaning(b);
    return memcmp(&x, &y, sizeof x) == 0;
}

static void fixed_text(void **state)
{
    (void)state;
    struct sv_view_request r;
    char text[SV_API_CANONICAL_MAX];
    must_kvp("y=5200340&x=500120", &r);
    size_t n = sv_api_canonical(&r, text);
    assert_string_equal(
        text, "x=500120&y=5200340&agl=1.7&heading=0&pitch=0&roll=0&north=grid&vfov=60&projection="
              "perspective&width=512&height=512&format=jpeg&q=85&layer=color&sky=on&quality=balanced&trees="
              "auto&relief=auto&shadows=on&samples=1&air=off&f=image");
    assert_int_equal(n, strlen(text));
    n = sv_api_canonical_resolve(&r, text);
    assert_string_equal(
        text, "x=500120&y=5200340&agl=1.7&heading=0&pitch=0&roll=0&north=grid&vfov=60&projection="
              "perspective&width=512&height=512&quality=balanced&trees=auto&relief=auto&shadows=on&samples="
              "1&air=off");
    assert_int_equal(n, strlen(text));
    must_kvp("target_lon=-71.1&target_lat=42&range=300&heading=350.5&time=2026-06-21T12:00:00.250%2B02:00&"
             "layer=id,depth&"
             "projection=orthographic&ortho_height=1e3&quality=reference",
             &r);
    sv_api_canonical(&r, text);
    assert_string_equal(
        text, "heading=350.5&pitch=0&roll=0&north=grid&target_lon=-71.1&target_lat=42&target_agl=1.7&range="
              "300&projection=orthographic&ortho_height=1000&width=512&height=512&format=exr&layer=depth,id&"
              "sky=on&quality=reference&trees=auto&relief=auto&shadows=on&samples=16&time=2026-06-21T10:00:"
              "00.25Z&air=off&f=image");
}

static void spellings_of_one_request(void **state)
{
    (void)state;
    struct sv_rng rng = sv_rng_seeded(21, 0);
    for (int k = 0; k < 6000; k++) {
        struct random_view view;
        struct sv_view_request a, b, c;
        char query[4096], shuffled[4096], body[4096], ta[SV_API_CANONICAL_MAX], tb[SV_API_CANONICAL_MAX],
            tc[SV_API_CANONICAL_MAX];
        random_view(&rng, &view);
        random_view_kvp(&view, query, sizeof query);
        if (!parse_kvp(query, &a)) /* the generator may pair a format with layers that it cannot hold */
            continue;
        random_view_shuffle(&rng, &view);
        random_view_kvp(&view, shuffled, sizeof shuffled);
        random_view_json(&rng, &view, body, sizeof body);
        must_kvp(shuffled, &b);
        must_json(body, &c);
        sv_api_canonical(&a, ta);
        sv_api_canonical(&b, tb);
        sv_api_canonical(&c, tc);
        if (strcmp(ta, tb) != 0 || strcmp(ta, tc) != 0)
            fail_msg("%s\n%s\n%s\n%s\n%s", query, body, ta, tb, tc);
        /* The text means itself. */
        must_kvp(ta, &b);
        sv_api_canonical(&b, tb);
        if (strcmp(ta, tb) != 0 || !same(&a, &b))
            fail_msg("not a fixed point: %s\n%s\n%s", query, ta, tb);
    }
}

/* Two requests of which one differs from the other in one value: texts are equal iff meanings are. */
static void different_requests(void **state)
{
    (void)state;
    struct sv_rng rng = sv_rng_seeded(22, 0);
    int differing = 0, compared = 0;
    for (int k = 0; k < 15000; k++) {
        struct random_view view;
        struct sv_view_request a, b;
        char query[4096], ta[SV_API_CANONICAL_MAX], tb[SV_API_CANONICAL_MAX];
        random_view(&rng, &view);
        random_view_kvp(&view, query, sizeof query);
        struct random_pair *pair = &view.pairs[sv_rng_next(&rng) % (uint64_t)view.count];
        random_value(&rng, pair->id, pair->value);
        char changed[4096];
        random_view_kvp(&view, changed, sizeof changed);
        if (!parse_kvp(query, &a) || !parse_kvp(changed, &b))
            continue;
        sv_api_canonical(&a, ta);
        sv_api_canonical(&b, tb);
        compared++;
        differing += !same(&a, &b);
        if ((strcmp(ta, tb) == 0) != same(&a, &b))
            fail_msg("%s\n%s\n%s\n%s", query, changed, ta, tb);
    }
    assert_true(compared > 7000 && differing > compared / 2);
}

/* The longest text fits. */
static void longest(void **state)
{
    (void)state;
    struct sv_view_request r;
    char text[SV_API_CANONICAL_MAX];
    must_kvp(
        "x=-123456789.12345678&y=-123456789.12345678&crs=EPSG:999999&z=-1234.5678901234567&target_x=-"
        "123456789.12345678&"
        "target_y=-123456789.12345678&target_z=-1234.5678901234567&roll=-123.45678901234567&north=true&vfov="
        "123.45678901234567&width=4096&height=4096&format=exr&layer=color,depth,normal,id&sky=off&quality="
        "reference&trees="
        "raycast&relief=auto&shadows=off&samples=64&time=2026-06-21T12:00:00.123456Z&air=off&f=image",
        &r);
    size_t n = sv_api_canonical(&r, text);
    assert_int_equal(n, strlen(text));
    assert_true(n < SV_API_CANONICAL_MAX / 2);
    assert_non_null(strstr(text, "&f=image"));
}

static void resolve_text(void **state)
{
    (void)state;
    struct sv_view_request a, b;
    char ta[SV_API_CANONICAL_MAX], tb[SV_API_CANONICAL_MAX];
    must_kvp("x=1&y=2&format=png&layer=normal&f=json&sky=off", &a);
    must_kvp("x=1&y=2&format=jpeg&q=5", &b);
    sv_api_canonical_resolve(&a, ta);
    sv_api_canonical_resolve(&b, tb);
    assert_string_equal(ta, tb);
    must_kvp("x=1&y=2&width=513", &b);
    sv_api_canonical_resolve(&b, tb);
    assert_string_not_equal(ta, tb);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(fixed_text), cmocka_unit_test(spellings_of_one_request),
        cmocka_unit_test(different_requests), cmocka_unit_test(longest), cmocka_unit_test(resolve_text)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
