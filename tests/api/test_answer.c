#include "api/answer.h"

#include <cjson/cJSON.h>
#include <math.h>
#include <stdio.h>
#include <string.h>

#include "api/json.h"
#include "core/base/frames.h"
#include "core/base/rng.h"
#include "tests/api/cmocka_all.h"

static struct sv_resolved_view view_of(void)
{
    struct sv_resolved_view v;
    memset(&v, 0, sizeof v);
    v.camera = (struct sv_camera){.eye = {500120.25, 5200340.5, 812.125},
                                  .right = {1, 0, 0},
                                  .up = {0, 0, 1},
                                  .forward = {0, 1, 0},
                                  .projection = SV_PROJECTION_PERSPECTIVE,
                                  .vfov_rad = sv_radians(60),
                                  .width = 640,
                                  .height = 480,
                                  .near_m = 0.1};
    v.cell = v.camera.eye;
    v.heading_rad = sv_radians(30);
    v.convergence_rad = sv_radians(-1.25);
    v.sun = (struct sv_sun){1, 0.5};
    v.plan = (struct sv_plan){.draw_trees = true, .samples = 4, .trees = SV_TREES_AUTO};
    return v;
}

static void etags(void **state)
{
    (void)state;
    struct sv_resolved_view v = view_of();
    char base[SV_ETAG_BUFFER], other[SV_ETAG_BUFFER];
    sv_api_etag_view("x=1", &v, 7, "0.1.0", base);
    assert_int_equal(strlen(base), 36);
    assert_memory_equal(base, "W/\"", 3);
    sv_api_etag_view("x=1", &v, 7, "0.1.0", other);
    assert_string_equal(base, other);
    /* Each part counts. */
    for (int part = 0; part < 15; part++) {
        v = view_of();
        v.camera.eye.x += part == 3 ? 1e-9 : 0;
        v.camera.up.z -= part == 4 ? 1e-15 : 0;
        v.camera.width += part == 5;
        v.sun.azimuth_rad += part == 6 ? 1e-9 : 0;
        v.plan.samples += part == 7;
        v.plan.relief = part == 12 ? SV_RELIEF_ON : v.plan.relief;
        v.plan.relief_distance_m += part == 13;
        v.plan.relief_resolution += part == 14;
        v.plan.shadows = part == 8;
        v.air = part == 9;
        v.camera.projection = part == 10 ? SV_PROJECTION_ORTHOGRAPHIC : SV_PROJECTION_PERSPECTIVE;
        v.plan.trees = part == 11 ? SV_TREES_POLYGON : SV_TREES_AUTO;
        sv_api_etag_view(part == 0 ? "x=2" : "x=1", &v, part == 1 ? 8 : 7, part == 2 ? "0.1.1" : "0.1.0",
                         other);
        assert_string_not_equal(base, other);
    }
    /* -0 is 0, and padding is nothing. */
    memset(&v, 0xFF, sizeof v);
    struct sv_resolved_view clean = view_of();
    v.camera = clean.camera;
    v.camera.right.y = -0.0;
    v.sun = clean.sun;
    v.air = false;
    v.plan = clean.plan;
    sv_api_etag_view("x=1", &v, 7, "0.1.0", other);
    assert_string_equal(base, other);
}

static void if_none_match(void **state)
{
    (void)state;
    static const char tag[] = "W/\"abc\"";
    static const struct {
        const char *header;
        bool want;
    } rows[] = {
        {NULL, false},
        {"", false},
        {"*", true},
        {" * ", true},
        {"W/\"abc\"", true},
        {"\"abc\"", true}, /* weak comparison */
        {"\"ab\"", false},
        {"\"abcd\"", false},
        {"\"x\", W/\"abc\"", true},
        {"\"x\",\"y\" , \"abc\"", true},
        {"abc", false},
        {"\"abc", false},
        {"w/\"abc\"", false},
        {"W/abc", false},
        {"\"x\" \"abc\"", true},
        {",,\"abc\"", true},
        {"*, \"abc\"", false},
        {"\"\"", false},
    };
    for (size_t k = 0; k < sizeof rows / sizeof rows[0]; k++)
        if (sv_api_etag_matches(rows[k].header, tag) != rows[k].want)
            fail_msg("If-None-Match: %s", rows[k].header ? rows[k].header : "(none)");
}

/* Against the definition: no lattice point (i + j + k even) is nearer, and the route does not move within the
 * cell. */
static void routes(void **state)
{
    (void)state;
    struct sv_rng rng = sv_rng_seeded(31, 0);
    for (int n = 0; n < 5000; n++) {
        double d = sv_rng_range(&rng, 10, 500);
        struct sv_vec3 eye = sv_vec3(sv_rng_range(&rng, -1e4, 1e4), sv_rng_range(&rng, -1e4, 1e4),
                                     sv_rng_range(&rng, -500, 3000));
        char text[SV_ROUTE_BUFFER];
        double spacing, i, j, k;
        sv_api_route(eye, d, text);
        assert_int_equal(sscanf(text, "%lf/%lf,%lf,%lf", &spacing, &i, &j, &k), 4);
        assert_true(spacing == d && fmod(i + j + k, 2) == 0);
        double own = sv_length(sv_sub(eye, sv_vec3(i * d, j * d, k * d)));
        for (int step = 0; step < 27; step++) {
            double a = i + step % 3 - 1, b = j + step / 3 % 3 - 1, c = k + step / 9 - 1;
            if (fmod(a + b + c, 2) == 0)
                assert_true(sv_length(sv_sub(eye, sv_vec3(a * d, b * d, c * d))) >= own - 1e-9);
        }
    }
    char text[SV_ROUTE_BUFFER];
    sv_api_route(sv_vec3(0, 0, 0), 100, text);
    assert_string_equal(text, "100/0,0,0");
    sv_api_route(sv_vec3(500120, 5200340, 812), 0, text);
    assert_string_equal(text, "100/5001,52003,8");
    sv_api_route(sv_vec3(-1e-9, 0, 0), 100, text);
    assert_string_equal(text, "100/0,0,0");
}

static void camera_line(void **state)
{
    (void)state;
    struct sv_resolved_view v = view_of();
    char text[SV_CAMERA_JSON_BUFFER];
    size_t n = sv_api_camera_json(&v, text);
    assert_string_equal(
        text,
        "{\"eye\":[500120.25,5200340.5,812.125],\"target\":[500120.25,5200341.5,812.125],\"up\":[0,0,1],"
        "\"vfov\":60,\"width\":640,\"height\":480,\"heading\":30,\"pitch\":0,\"roll\":0,\"convergence\":"
        "-1.25}");
    assert_int_equal(n, strlen(text));
    /* The longest numbers fit, and it stays JSON; a NaN is null. */
    struct sv_vec3 wide =
        sv_vec3(-1.2345678901234567e-101, -1.2345678901234567e-101, -1.2345678901234567e-101);
    v.camera.eye = v.camera.up = v.target = wide;
    v.has_target = v.has_lonlat = true;
    v.camera.projection = SV_PROJECTION_ORTHOGRAPHIC;
    v.camera.ortho_height_m = v.heading_rad = v.pitch_rad = v.roll_rad = v.lon_deg = wide.x;
    v.lat_deg = NAN;
    n = sv_api_camera_json(&v, text);
    cJSON *root = NULL;
    assert_int_equal(sv_api_json_parse(text, n, &root, NULL), SV_OK);
    assert_true(cJSON_IsNull(cJSON_GetObjectItem(root, "lat")));
    assert_true(cJSON_GetNumberValue(cJSON_GetObjectItem(root, "ortho_height")) == wide.x);
    cJSON_Delete(root);
}

static void view_headers(void **state)
{
    (void)state;
    struct sv_resolved_view v = view_of();
    struct sv_view_request request = {.format = SV_FORMAT_WEBP};
    struct sv_headers h;
    struct sv_answer_view answer = {.request = &request,
                                    .resolved = &v,
                                    .etag = "W/\"1\"",
                                    .negotiated = true,
                                    .cache = SV_CACHE_STORED,
                                    .max_age_s = 60,
                                    .relief_distance_m = 100};
    const struct sv_answer_common common = {.cors_origin = "https://example.org"};
    sv_api_headers_init(&h);
    sv_api_answer_view(&answer, false, &h);
    sv_api_answer_common(&common, &h);
    sv_api_answer_common(&common, &h);
    assert_string_equal(sv_api_headers_find(&h, "Content-Type"), "image/webp");
    assert_string_equal(sv_api_headers_find(&h, "ETag"), "W/\"1\"");
    assert_string_equal(sv_api_headers_find(&h, "Cache-Control"), "public, max-age=60");
    assert_string_equal(sv_api_headers_find(&h, "Cache-Status"), "Silvista; fwd=miss; stored");
    assert_string_equal(sv_api_headers_find(&h, "Vary"), "Accept, Origin");
    assert_string_equal(sv_api_headers_find(&h, "Silvista-Cell"), "none");
    assert_string_equal(sv_api_headers_find(&h, "Silvista-Plan"),
                        "trees=leaf+coarse; relief=off; samples=4; shadows=off");
    assert_string_equal(sv_api_headers_find(&h, "Silvista-Route"), "100/5001,52003,8");
    assert_non_null(strstr(sv_api_headers_find(&h, "Silvista-Camera"), "\"vfov\":60"));
    assert_null(sv_api_headers_find(&h, "Silvista-Error")); /* nothing is predicted yet */
    sv_api_headers_init(&h);
    answer.max_age_s = 0;
    answer.negotiated = false;
    answer.cache = SV_CACHE_HIT;
    sv_api_answer_view(&answer, true, &h);
    assert_null(sv_api_headers_find(&h, "Content-Type"));
    assert_null(sv_api_headers_find(&h, "Vary"));
    assert_string_equal(sv_api_headers_find(&h, "Cache-Control"), "public, no-cache");
    assert_string_equal(sv_api_headers_find(&h, "Cache-Status"), "Silvista; hit");
    request.describe = true;
    sv_api_answer_view(&answer, false, &h);
    assert_string_equal(sv_api_headers_find(&h, "Content-Type"), "application/json");
}

/* What panels had to do with a picture; what a view that was not drawn will do is what its plan says. */
static void cells(void **state)
{
    (void)state;
    static const struct {
        struct sv_cell_use cell;
        const char *want, *relief;
    } rows[] = {
        {{.kind = SV_CELL_USE_NONE}, "none", "relief=off;"},
        {{.kind = SV_CELL_USE_BYPASS, .id = 7}, "bypass", "relief=off;"},
        {{.kind = SV_CELL_USE_BUILT, .id = 0xAB, .hits = 2, .refined = 2, .built = 1},
         "built; id=00000000000000ab; panels=drawn", "relief=on;"},
        {{.kind = SV_CELL_USE_HIT, .id = UINT64_MAX, .hits = 3, .refined = 2},
         "hit; id=ffffffffffffffff; panels=drawn", "relief=on;"},
        {{.kind = SV_CELL_USE_HIT, .id = 1, .hits = 3, .refined = 3},
         "hit; id=0000000000000001; panels=refined", "relief=on;"},
        {{.kind = 99, .id = 1}, "none", "relief=off;"},
    };
    struct sv_plan plan = {.draw_trees = true, .samples = 1};
    char text[128];
    for (size_t k = 0; k < sizeof rows / sizeof rows[0]; k++) {
        assert_string_equal(sv_api_cell_text(&rows[k].cell, text, sizeof text), rows[k].want);
        assert_non_null(strstr(sv_api_plan_text(&plan, &rows[k].cell, text, sizeof text), rows[k].relief));
    }
    assert_string_equal(sv_api_cell_text(NULL, text, sizeof text), "none");
    for (int mode = SV_RELIEF_AUTO; mode <= SV_RELIEF_ON; mode++) {
        plan.relief = (enum sv_relief_mode)mode;
        assert_string_equal(sv_api_plan_relief(&plan), sv_relief_name(plan.relief));
    }
    plan.samples = 4;
    assert_string_equal(sv_api_plan_relief(&plan), "off");
    plan.samples = 1;
    plan.trees = SV_TREES_COARSE;
    assert_string_equal(sv_api_plan_relief(&plan), "off");
    plan.draw_trees = false;
    assert_string_equal(sv_api_plan_relief(&plan), "on");
}

static void plans(void **state)
{
    (void)state;
    static const struct {
        struct sv_plan plan;
        const char *want;
    } rows[] = {
        {{.raycast = true, .draw_trees = true, .trees = SV_TREES_RAYCAST, .samples = 16, .shadows = true},
         "trees=raycast; relief=off; samples=16; shadows=on"},
        {{.raycast = true, .draw_trees = false, .trees = SV_TREES_NONE, .samples = 1},
         "trees=none; relief=off; samples=1; shadows=off"},
        {{.draw_trees = true, .trees = SV_TREES_POLYGON, .samples = 64},
         "trees=polygon; relief=off; samples=64; shadows=off"},
    };
    for (size_t k = 0; k < sizeof rows / sizeof rows[0]; k++) {
        char text[128];
        assert_string_equal(sv_api_plan_text(&rows[k].plan, NULL, text, sizeof text), rows[k].want);
    }
}

static void common_headers(void **state)
{
    (void)state;
    struct sv_headers h;
    struct sv_trace trace = {.request_id = "abc", .traceparent = "00-1-2-3"};
    struct sv_timings timings;
    for (int k = 0; k < SV_STAGE_COUNT; k++)
        timings.ms[k] = -1;
    timings.ms[SV_STAGE_QUEUE] = 0;
    timings.ms[SV_STAGE_NEAR] = 12.34567;
    timings.ms[SV_STAGE_TOTAL] = NAN;
    struct sv_answer_common common = {.trace = &trace, .timings = &timings, .cors_origin = "*"};
    sv_api_headers_init(&h);
    sv_api_answer_common(&common, &h);
    assert_string_equal(sv_api_headers_find(&h, "Server-Timing"), "queue;dur=0.000, near;dur=12.346");
    assert_string_equal(sv_api_headers_find(&h, "X-Request-Id"), "abc");
    assert_string_equal(sv_api_headers_find(&h, "traceparent"), "00-1-2-3");
    assert_string_equal(sv_api_headers_find(&h, "Access-Control-Allow-Origin"), "*");
    assert_string_equal(sv_api_headers_find(&h, "Timing-Allow-Origin"), "*");
    assert_non_null(strstr(sv_api_headers_find(&h, "Access-Control-Expose-Headers"), "Silvista-Camera"));
    assert_null(sv_api_headers_find(&h, "Vary"));
    sv_api_headers_init(&h);
    common = (struct sv_answer_common){0};
    sv_api_answer_common(&common, &h);
    assert_null(sv_api_headers_find(&h, "Access-Control-Allow-Origin"));
    assert_null(sv_api_headers_find(&h, "Server-Timing"));
}

static void other_answers(void **state)
{
    (void)state;
    struct sv_headers h;
    struct sv_problem problem = {.kind = SV_PROBLEM_OVERLOADED, .retry_after_s = 7};
    sv_api_headers_init(&h);
    sv_api_answer_problem(&problem, &h);
    assert_string_equal(sv_api_headers_find(&h, "Content-Type"), "application/problem+json");
    assert_string_equal(sv_api_headers_find(&h, "Retry-After"), "7");
    assert_string_equal(sv_api_headers_find(&h, "Cache-Control"), "no-store");
    problem = (struct sv_problem){.kind = SV_PROBLEM_METHOD, .allow = "GET, HEAD"};
    sv_api_answer_problem(&problem, &h);
    assert_string_equal(sv_api_headers_find(&h, "Allow"), "GET, HEAD");
    problem = (struct sv_problem){.kind = SV_PROBLEM_UNAUTHORIZED};
    sv_api_answer_problem(&problem, &h);
    assert_memory_equal(sv_api_headers_find(&h, "WWW-Authenticate"), "Bearer", 6);
    sv_api_answer_preflight("GET, HEAD, POST, OPTIONS", &h);
    assert_string_equal(sv_api_headers_find(&h, "Access-Control-Allow-Methods"), "GET, HEAD, POST, OPTIONS");
    sv_api_answer_document("application/json", "W/\"2\"", &h);
    assert_string_equal(sv_api_headers_find(&h, "Cache-Control"), "no-cache");
    char a[SV_ETAG_BUFFER], b[SV_ETAG_BUFFER];
    sv_api_etag_text("abc", 3, a);
    sv_api_etag_text("abd", 3, b);
    assert_string_not_equal(a, b);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(etags),          cmocka_unit_test(if_none_match), cmocka_unit_test(routes),
        cmocka_unit_test(camera_line),    cmocka_unit_test(view_headers),  cmocka_unit_test(plans),
        cmocka_unit_test(cells),
        cmocka_unit_test(common_headers), cmocka_unit_test(other_answers),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
