#include "api/view_parse.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "core/base/vec.h"
#include "tests/api/cmocka_all.h"

static const struct sv_api_view_limits limits = {.pixels_max = 2000000, .sample_pixels_max = 8000000};

struct result {
    enum sv_problem_kind kind;
    struct sv_api_view view;
    char fields[512]; /* of the errors, in order, blanks between */
    char first[512];  /* message of the first */
};

static void finish(struct result *r, struct sv_errors *errors)
{
    r->fields[0] = r->first[0] = '\0';
    assert_int_equal(r->kind == SV_PROBLEM_NONE, errors->total == 0);
    for (size_t k = 0; k < errors->count; k++)
        snprintf(r->fields + strlen(r->fields), sizeof r->fields - strlen(r->fields), "%s%s", k ? " " : "",
                 errors->items[k].field);
    if (errors->count)
        snprintf(r->first, sizeof r->first, "%s", errors->items[0].message);
    sv_errors_finish(errors);
}

static struct result kvp(const char *query, const char *accept)
{
    struct result r = {0};
    struct sv_errors errors;
    sv_errors_init(&errors);
    r.kind = sv_api_view_parse_kvp(query, strlen(query), accept, &limits, &r.view, &errors);
    finish(&r, &errors);
    return r;
}

static struct result json(const char *body, const char *accept)
{
    struct result r = {0};
    struct sv_errors errors;
    sv_errors_init(&errors);
    r.kind = sv_api_view_parse_json(body, strlen(body), accept, &limits, &r.view, &errors);
    finish(&r, &errors);
    return r;
}

static struct sv_view_request good(const char *query)
{
    struct result r = kvp(query, NULL);
    if (r.kind != SV_PROBLEM_NONE)
        fail_msg("%s: refused: %s: %s", query, r.fields, r.first);
    return r.view.request;
}

/* query, the fields that must be named, in order */
static const struct {
    const char *query, *fields;
} bad_rows[] = {
    {"", "x"},
    {"&", "x"},
    {"x=1", "y"},
    {"y=1", "x"},
    {"lon=1", "lat"},
    {"x=1&y=2&lon=3&lat=4", "x y lon lat"},
    {"x=1&lat=4", "x lat"},
    {"x=1&y=2&z=3&agl=4", "z agl"},
    {"z=3", "x z"},
    {"x=nan&y=inf", "x y"},
    {"x=1&y=2&heading=0x10", "heading"},
    {"x=1&y=2&heading=", "heading"},
    {"x=1&y=2&heading", "heading"},
    {"x=1&y=2&heading=361", "heading"},
    {"x=1&y=2&heading=-360.0000001", "heading"},
    {"x=1&y=2&pitch=90.1&roll=400&vfov=0.5&width=15&height=4097&q=0", "pitch roll vfov width height q"},
    {"x=1&y=2&width=512.5", "width"},
    {"x=1&y=2&x=3", "x"},
    {"x=1&%78=3&y=2", "x"},
    {"x=1&y=2&X=3", "X"},
    {"x=1&y=2&fov=60&colour=1", "fov colour"},
    {"x=1&y=2&heading=%zz", "heading"},
    {"x=1&y=2&heading=%00", "heading"},
    {"x=1&y=2&heading=%FF", "heading"},
    {"x=1&y=2&%FF=1", "%FF"},
    {"x=1&y=2&=1", ""},
    {"x=1&y=2&crs=EPSG:4326&crs=EPSG:4326", "crs"},
    {"lon=1&lat=2&crs=EPSG:4326", "crs"},
    {"x=1&y=2&crs=utm33", "crs"},
    {"x=1&y=2&range=5", "range"},
    {"x=1&y=2&target_z=5", "target_z"},
    {"x=1&y=2&target_agl=5", "target_agl"},
    {"x=1&y=2&target_x=5", "target_y"},
    {"x=1&y=2&target_x=5&target_y=6&heading=1&pitch=2", "heading pitch"},
    {"x=1&y=2&target_x=5&target_y=6&range=1", "range"},
    {"x=1&y=2&target_x=5&target_y=6&target_lon=1&target_lat=1", "target_x target_y target_lon target_lat"},
    {"x=1&y=2&target_x=5&target_y=6&target_z=1&target_agl=1", "target_z target_agl"},
    {"target_x=5&target_y=6", "range"},
    {"target_x=5&target_y=6&range=10&z=5", "z"},
    {"target_x=5&target_y=6&range=10&agl=5", "agl"},
    {"target_x=5&target_y=6&range=0", "range"},
    {"x=1&y=2&projection=orthographic", "ortho_height"},
    {"x=1&y=2&ortho_height=5", "ortho_height"},
    {"x=1&y=2&projection=ortho&ortho_height=5", "projection"},
    {"x=1&y=2&projection=orthographic&ortho_height=0", "ortho_height"},
    {"x=1&y=2&format=jpg", "format"},
    {"x=1&y=2&format=jpeg&sky=off", "format"},
    {"x=1&y=2&format=png&layer=depth", "format"},
    {"x=1&y=2&format=jpeg&layer=normal", "format"},
    {"x=1&y=2&format=webp&layer=normal", "format"},
    {"x=1&y=2&format=webp&layer=id", "format"},
    {"x=1&y=2&format=tiff&layer=color,depth", "format"},
    {"x=1&y=2&layer=", "layer"},
    {"x=1&y=2&layer=color,color", "layer"},
    {"x=1&y=2&layer=colour", "layer"},
    {"x=1&y=2&quality=high&max_error=1", "quality max_error"},
    {"x=1&y=2&quality=high&budget_ms=10", "quality budget_ms"},
    {"x=1&y=2&max_error=1&budget_ms=10", "max_error budget_ms"},
    {"x=1&y=2&quality=high&max_error=1&budget_ms=10", "quality max_error budget_ms"},
    {"x=1&y=2&quality=best", "quality"},
    {"x=1&y=2&max_error=0", "max_error"},
    {"x=1&y=2&budget_ms=-5", "budget_ms"},
    {"x=1&y=2&trees=fake", "trees"},
    {"x=1&y=2&quality=reference&trees=polygon", "trees"},
    {"x=1&y=2&relief=maybe", "relief"},
    {"x=1&y=2&relief=on&trees=coarse", "relief"},
    {"x=1&y=2&relief=on&samples=4", "relief"},
    {"x=1&y=2&relief=on&layer=depth", "relief"},
    {"x=1&y=2&relief=on&quality=reference", "relief"},
    {"x=1&y=2&relief=on&projection=orthographic&ortho_height=9", "relief"},
    {"x=1&y=2&relief=off&relief_distance=50&relief_resolution=512", "relief_distance relief_resolution"},
    {"x=1&y=2&relief_distance=24&relief_resolution=255", "relief_distance relief_resolution"},
    {"x=1&y=2&relief_distance=401&relief_resolution=2049", "relief_distance relief_resolution"},
    {"x=1&y=2&relief_distance=0&relief_resolution=1", "relief_distance relief_resolution"},
    {"x=1&y=2&samples=2", "samples"},
    {"x=1&y=2&samples=0", "samples"},
    {"x=1&y=2&time=2026-06-21T12:00:00Z&sun_azimuth=1", "time sun_azimuth"},
    {"x=1&y=2&time=2026-06-21T12:00:00Z&sun_azimuth=1&sun_elevation=1", "time sun_azimuth sun_elevation"},
    {"x=1&y=2&time=2026-06-21T12:00:00+02:00", "time"}, /* + is a blank */
    {"x=1&y=2&time=yesterday", "time"},
    {"x=1&y=2&sun_elevation=91", "sun_elevation"},
    {"x=1&y=2&shadows=yes&sky=1&air=", "shadows sky air"},
    {"x=1&y=2&f=xml", "f"},
    {"x=1&y=2&north=magnetic", "north"},
    {"x=1e10&y=-1e10", "x y"},
    {"lon=181&lat=-91", "lon lat"},
    {"x=1&y=2&z=1e7", "z"},
    {"x=1&y=2&width=2000&height=2000", "width height"}, /* over the configured pixels */
    {"x=1&y=2&width=4096", "width"},
    {"x=1&y=2&width=1000&height=1000&samples=16", "samples"},        /* over samples x pixels */
    {"x=1&y=2&width=1000&height=1000&quality=reference", "samples"}, /* its 16 count as well */
    {"x=1&y=2&max_error=1&bogus=1", "bogus"},                        /* 400 before 501 */
    {"x=1&y=2&trees=density&heading=900", "heading"},
};

static void bad_requests(void **state)
{
    (void)state;
    for (size_t k = 0; k < sizeof bad_rows / sizeof bad_rows[0]; k++) {
        struct result r = kvp(bad_rows[k].query, NULL);
        if (r.kind != SV_PROBLEM_BAD_REQUEST || strcmp(r.fields, bad_rows[k].fields) != 0)
            fail_msg("%s: expected 400 for [%s] got %d for [%s] (%s)", bad_rows[k].query, bad_rows[k].fields,
                     sv_api_problem_status(r.kind), r.fields, r.first);
    }
}

static void messages_teach(void **state)
{
    (void)state;
    static const struct {
        const char *query, *part;
    } rows[] = {
        {"x=1&y=2&vfov=200", "\"200\" is out of range: expected a number from 1 to 150 deg"},
        {"x=1&y=2&width=10", "expected an integer from 16 to 4096 px"},
        {"x=1&y=2&max_error=0", "expected a number above 0, at most 1000 px"},
        {"x=1&y=2&format=jpg", "did you mean \"jpeg\""},
        {"x=1&y=2&Heading=1", "did you mean \"heading\""},
        {"x=1&y=2&format=png&layer=depth", "png cannot hold layer=depth: use tiff, exr"},
        {"x=1&y=2&format=tiff&layer=color,depth", "use exr"},
        {"x=1&y=2&format=jpeg&sky=off", "use png, webp, tiff, exr"},
        {"x=1", "x needs it"},
        {"x=1&y=2&quality=high&max_error=1&budget_ms=10", "excludes max_error, budget_ms: give one of them"},
        {"x=1&y=2&time=2026-06-21T12:00:00Z&sun_azimuth=1&sun_elevation=1",
         "excludes sun_azimuth, sun_elevation: give the time or the sun's angles"},
        {"x=1&y=2&samples=3", "expected one of 1, 4, 16, 64"},
        {"x=1&y=2&time=2026-06-21T12:00:00+02:00", "%2B"},
        {"x=1&y=2&time=yesterday", "\"yesterday\" is not a date and time: expected a "},
        {"x=1&y=2&time=2026-13-01T00:00:00Z",
         "\"2026-13-01T00:00:00Z\" has month 13, outside 01..12: expected"},
        {"x=1&y=2&width=1000&height=1000&samples=16", "16000000"},
    };
    for (size_t k = 0; k < sizeof rows / sizeof rows[0]; k++) {
        struct result r = kvp(rows[k].query, NULL);
        if (!strstr(r.first, rows[k].part))
            fail_msg("%s: \"%s\" has no \"%s\"", rows[k].query, r.first, rows[k].part);
    }
    struct result moment = kvp("x=1&y=2&time=yesterday", NULL);
    const char *example = strstr(moment.first, "like ");
    assert_true(example && !strstr(example + 1, "like ")); /* once */
}

static void not_built_yet(void **state)
{
    (void)state;
    static const struct {
        const char *query, *fields; /* NULL: legal and built */
    } rows[] = {
        {"x=1&y=2&max_error=1", "max_error"},
        {"x=1&y=2&budget_ms=20", "budget_ms"},
        {"x=1&y=2&relief=on", NULL},
        {"x=1&y=2&relief=paper", NULL},
        {"x=1&y=2&relief=off", NULL},
        {"x=1&y=2&relief=auto", NULL},
        {"x=1&y=2&relief_distance=50&relief_resolution=512", NULL},
        {"x=1&y=2&trees=billboard", NULL},
        {"x=1&y=2&trees=indirect", NULL},
        {"x=1&y=2&trees=density", NULL},
        {"x=1&y=2&trees=density_paper", NULL},
        {"x=1&y=2&trees=coarse", NULL},
        {"x=1&y=2&trees=auto", NULL},
        {"x=1&y=2&trees=polygon", NULL},
        {"x=1&y=2&trees=raycast", NULL},
        {"x=1&y=2&trees=none", NULL},
        {"x=1&y=2&shadows=on", NULL},
        {"x=1&y=2&shadows=on&trees=polygon", NULL},
        {"x=1&y=2&shadows=off", NULL},
        {"x=1&y=2&shadows=on&trees=raycast", NULL},
        {"x=1&y=2&shadows=on&quality=reference", NULL},
        {"x=1&y=2&shadows=on&quality=reference&trees=none", NULL},
        {"x=1&y=2&relief=paper&max_error=2", "max_error"},
    };
    for (size_t k = 0; k < sizeof rows / sizeof rows[0]; k++) {
        struct result r = kvp(rows[k].query, NULL);
        enum sv_problem_kind want = rows[k].fields ? SV_PROBLEM_NOT_BUILT : SV_PROBLEM_NONE;
        if (r.kind != want || (rows[k].fields && strcmp(r.fields, rows[k].fields) != 0))
            fail_msg("%s: got %d [%s]", rows[k].query, sv_api_problem_status(r.kind), r.fields);
    }
    assert_int_equal(sv_api_problem_status(SV_PROBLEM_NOT_BUILT), 501);
}

static void defaults(void **state)
{
    (void)state;
    struct sv_view_request r = good("x=500120&y=5200340");
    assert_int_equal(r.eye.form, SV_PLACE_XY);
    assert_true(r.eye.x == 500120 && r.eye.y == 5200340 && !r.eye.has_z && r.eye.agl == 1.7);
    assert_int_equal(r.target.form, SV_PLACE_NONE);
    assert_true(r.range_m == 0 && r.crs_epsg == 0 && r.heading_rad == 0 && r.pitch_rad == 0 &&
                r.roll_rad == 0);
    assert_true(!r.north_true && r.vfov_rad == sv_radians(60) && r.projection == SV_PROJECTION_PERSPECTIVE);
    assert_true(r.ortho_height_m == 0 && r.width == 512 && r.height == 512 && r.format == SV_FORMAT_JPEG &&
                r.q == 85);
    assert_true(r.layers == 1u << SV_LAYER_COLOR && r.sky && r.quality == SV_QUALITY_BALANCED);
    assert_true(r.max_error_px == 0 && r.budget_ms == 0 && r.trees == SV_TREES_AUTO &&
                r.relief == SV_RELIEF_AUTO);
    assert_true(r.relief_distance_m == 0 && r.relief_resolution == 0 && r.shadows && r.samples == 0);
    assert_true(!r.has_sun_azimuth && !r.has_sun_elevation && !r.has_time && !r.air && !r.describe);
}

static void every_key_arrives(void **state)
{
    (void)state;
    struct sv_view_request r = good("lon=-71.5&lat=42.25&z=120.5&target_lon=-71&target_lat=42&target_z=99&"
                                    "roll=-5&north=true&vfov=45.5&width=640&"
                                    "height=480&format=webp&q=70&quality=fast&trees=raycast&relief=off&"
                                    "shadows=off&samples=4&sun_azimuth=-90&"
                                    "sun_elevation=12.5&air=on&sky=off&f=json");
    assert_int_equal(r.eye.form, SV_PLACE_LONLAT);
    assert_true(r.eye.x == -71.5 && r.eye.y == 42.25 && r.eye.has_z && r.eye.z == 120.5);
    assert_true(r.target.form == SV_PLACE_LONLAT && r.target.x == -71 && r.target.y == 42 &&
                r.target.z == 99);
    assert_true(r.roll_rad == sv_radians(-5) && r.north_true && r.vfov_rad == sv_radians(45.5));
    assert_true(r.width == 640 && r.height == 480 && r.format == SV_FORMAT_WEBP && r.q == 70);
    assert_true(r.quality == SV_QUALITY_FAST && r.trees == SV_TREES_RAYCAST && r.relief == SV_RELIEF_OFF);
    assert_true(!r.shadows && r.samples == 4 && r.air && !r.sky && r.describe);
    assert_true(r.has_sun_azimuth && r.sun_azimuth_rad == sv_radians(-90) && r.has_sun_elevation &&
                r.sun_elevation_rad == sv_radians(12.5));
    r = good("target_x=10&target_y=20&crs=EPSG:32633&range=300&heading=350&pitch=-30&time=2026-06-21T12:00:"
             "00%2B02:00&"
             "projection=orthographic&ortho_height=1000&layer=depth,id,normal,color&format=exr");
    assert_true(r.eye.form == SV_PLACE_NONE && r.target.agl == 1.7 && r.range_m == 300 &&
                r.crs_epsg == 32633);
    assert_true(r.heading_rad == sv_radians(350) && r.pitch_rad == sv_radians(-30));
    assert_true(r.has_time && r.time_unix_s == 1782036000);
    assert_true(r.projection == SV_PROJECTION_ORTHOGRAPHIC && r.ortho_height_m == 1000 && r.layers == 15);
    r = good("x=1&y=2&agl=-5"); /* under the ground: 422 by whoever knows the ground */
    assert_true(r.eye.agl == -5);
    r = good("x=-0&y=.5&heading=010&width=6.4e2");
    assert_true(!signbit(r.eye.x) && r.eye.y == 0.5 && r.width == 640);
}

static void formats(void **state)
{
    (void)state;
    static const struct {
        const char *query, *accept;
        int format; /* -1: 406 */
        bool negotiated;
    } rows[] = {
        {"", NULL, SV_FORMAT_JPEG, true},
        {"", "*/*", SV_FORMAT_JPEG, true},
        {"", "image/webp", SV_FORMAT_WEBP, true},
        {"", "image/x-exr", SV_FORMAT_EXR, true},
        {"", "text/html", -1, true},
        {"&format=png", "text/html", SV_FORMAT_PNG, false}, /* the key goes before the header */
        {"&format=png", "image/webp", SV_FORMAT_PNG, false},
        {"&sky=off", NULL, SV_FORMAT_PNG, true},
        {"&sky=off", "image/jpeg, image/webp;q=0.5", SV_FORMAT_WEBP, true},
        {"&sky=off", "image/jpeg", -1, true},
        {"&layer=depth", NULL, SV_FORMAT_EXR, true},
        {"&layer=depth", "image/tiff", SV_FORMAT_TIFF, true},
        {"&layer=depth", "image/*", SV_FORMAT_EXR, true},
        {"&layer=depth", "image/png", -1, true},
        {"&layer=normal", "image/png", SV_FORMAT_PNG, true},
        {"&layer=normal", NULL, SV_FORMAT_EXR, true},
        {"&layer=normal&sky=off", "image/png", SV_FORMAT_PNG, true},
        {"&layer=id", "image/png, image/tiff;q=0.1", SV_FORMAT_TIFF, true},
        {"&layer=color,depth", NULL, SV_FORMAT_EXR, true},
        {"&layer=color,depth", "image/tiff", -1, true},
        {"&f=json", "application/json", SV_FORMAT_JPEG, false},
        {"&f=json&layer=id", "application/json", SV_FORMAT_EXR, false},
        {"&format=tiff&layer=depth", NULL, SV_FORMAT_TIFF, false},
        {"&format=png&sky=off", NULL, SV_FORMAT_PNG, false},
    };
    for (size_t k = 0; k < sizeof rows / sizeof rows[0]; k++) {
        char query[128];
        snprintf(query, sizeof query, "x=1&y=2%s", rows[k].query);
        struct result r = kvp(query, rows[k].accept);
        if (rows[k].format < 0 ? r.kind != SV_PROBLEM_NOT_ACCEPTABLE
                               : r.kind != SV_PROBLEM_NONE || (int)r.view.request.format != rows[k].format ||
                                     r.view.negotiated != rows[k].negotiated)
            fail_msg("%s with Accept %s: kind %d format %d negotiated %d", query,
                     rows[k].accept ? rows[k].accept : "(none)", (int)r.kind, (int)r.view.request.format,
                     r.view.negotiated);
    }
    assert_string_equal(kvp("x=1&y=2", "text/html").fields, "Accept");
    assert_string_equal(kvp("x=1&y=2&layer=depth", "image/png").first,
                        "takes no format that can hold layer=depth: accept or give one of image/tiff "
                        "(format=tiff), image/x-exr (format=exr)");
    for (int k = 0; k < SV_FORMAT_COUNT; k++) { /* any holds a picture */
        struct result r = kvp("x=1&y=2", "text/html");
        assert_non_null(strstr(r.first, sv_format_media((enum sv_format)k)));
    }
    struct result clear = kvp("x=1&y=2&sky=off", "image/jpeg");
    assert_non_null(strstr(clear.first, "layer=color with sky=off: accept or give one of image/png"));
    assert_null(strstr(clear.first, "jpeg"));
    assert_int_equal(kvp("x=1&y=2&max_error=2", "text/html").kind, SV_PROBLEM_NOT_BUILT); /* 501 before 406 */
    assert_int_equal(kvp("x=1", "text/html").kind, SV_PROBLEM_BAD_REQUEST);
}

static void json_bodies(void **state)
{
    (void)state;
    static const struct {
        const char *body, *fields; /* NULL: legal */
    } rows[] = {
        {"{\"x\":1,\"y\":2}", NULL},
        {"{\"x\":1,\"y\":2,\"sky\":true,\"air\":false,\"shadows\":\"off\"}", NULL},
        {"{\"x\":1,\"y\":2,\"layer\":[\"color\",\"id\"]}", NULL},
        {"{\"x\":1,\"y\":2,\"layer\":\"color,id\"}", NULL},
        {"{\"x\":1,\"y\":2,\"width\":6.4e2,\"samples\":4.0}", NULL},
        {"{\"x\":1,\"y\":2,\"crs\":\"EPSG:32633\",\"time\":\"2026-06-21T12:00:00+02:00\"}", NULL},
        {"{}", "x"},
        {"{\"x\":\"1\",\"y\":2}", "x"},
        {"{\"x\":1,\"y\":null}", "y"},
        {"{\"x\":1,\"y\":[2]}", "y"},
        {"{\"x\":1,\"y\":true}", "y"},
        {"{\"x\":1,\"y\":1e999}", "y"},
        {"{\"x\":1,\"y\":2,\"width\":512.5}", "width"},
        {"{\"x\":1,\"y\":2,\"samples\":3}", "samples"},
        {"{\"x\":1,\"y\":2,\"samples\":\"4\"}", "samples"},
        {"{\"x\":1,\"y\":2,\"format\":1}", "format"},
        {"{\"x\":1,\"y\":2,\"format\":\"\"}", "format"},
        {"{\"x\":1,\"y\":2,\"format\":true}", "format"},
        {"{\"x\":1,\"y\":2,\"layer\":[]}", "layer"},
        {"{\"x\":1,\"y\":2,\"layer\":[1]}", "layer"},
        {"{\"x\":1,\"y\":2,\"layer\":[\"color\",\"color\"]}", "layer"},
        {"{\"x\":1,\"y\":2,\"crs\":32633}", "crs"},
        {"{\"x\":1,\"y\":2,\"Heading\":3}", "Heading"},
        {"{\"x\":1,\"y\":2,\"x\":3}", "x"},
        {"{\"x\":1,\"y\":2,\"\":3}", ""},
        {"{\"x\":1,\"y\":2,\"sky\":1}", "sky"},
        {"{\"x\":1,\"y\":2,\"view\":{\"x\":1}}", "view"},
        {"[]", ""},
        {"1", ""},
        {"", ""},
        {"{\"x\":1,\"y\":2", ""},
        {"{\"x\":1,\"y\":2}}", ""},
        {"x=1&y=2", ""},
        {"{\"vfov\":200,\"heading\":900,\"bogus\":1}", "vfov heading bogus x"},
    };
    for (size_t k = 0; k < sizeof rows / sizeof rows[0]; k++) {
        struct result r = json(rows[k].body, NULL);
        enum sv_problem_kind want = rows[k].fields ? SV_PROBLEM_BAD_REQUEST : SV_PROBLEM_NONE;
        if (r.kind != want || (rows[k].fields && strcmp(r.fields, rows[k].fields) != 0))
            fail_msg("%s: got %d [%s] %s", rows[k].body, sv_api_problem_status(r.kind), r.fields, r.first);
    }
    assert_int_equal(json("{\"x\":1,\"y\":2,\"max_error\":2}", NULL).kind, SV_PROBLEM_NOT_BUILT);
    assert_int_equal(json("{\"x\":1,\"y\":2}", "text/plain").kind, SV_PROBLEM_NOT_ACCEPTABLE);
    assert_true(json("{\"x\":1,\"y\":2,\"sky\":false}", NULL).view.request.format == SV_FORMAT_PNG);
}

/* Memory is bounded however many keys are wrong; what is left out of the list is counted. */
static void many_errors(void **state)
{
    (void)state;
    char query[40000] = "";
    size_t used = 0;
    struct sv_errors errors;
    struct sv_api_view view;
    for (int k = 0; k < 2000; k++)
        used += (size_t)snprintf(query + used, sizeof query - used, "bad%d=1&", k);
    sv_errors_init(&errors);
    assert_int_equal(sv_api_view_parse_kvp(query, used, NULL, &limits, &view, &errors),
                     SV_PROBLEM_BAD_REQUEST);
    assert_int_equal(errors.count, SV_ERRORS_MAX);
    assert_in_range(errors.total, 257, 260); /* 256 keys, the limit, the missing eye */
    sv_errors_finish(&errors);
}

/* width x height must not wrap. */
static void largest_sizes(void **state)
{
    (void)state;
    struct sv_api_view view;
    struct sv_errors errors;
    const struct sv_api_view_limits open = {.pixels_max = UINT64_MAX, .sample_pixels_max = UINT64_MAX};
    const struct sv_api_view_limits none = {0};
    const char *query = "x=1&y=2&width=4096&height=4096&samples=64";
    sv_errors_init(&errors);
    assert_int_equal(sv_api_view_parse_kvp(query, strlen(query), NULL, &open, &view, &errors),
                     SV_PROBLEM_NONE);
    assert_int_equal(sv_api_view_parse_kvp("x=1&y=2", 7, NULL, &none, &view, &errors),
                     SV_PROBLEM_BAD_REQUEST);
    assert_string_equal(errors.items[0].field, "width");
    sv_errors_finish(&errors);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(bad_requests), cmocka_unit_test(messages_teach),    cmocka_unit_test(not_built_yet),
        cmocka_unit_test(defaults),     cmocka_unit_test(every_key_arrives), cmocka_unit_test(formats),
        cmocka_unit_test(json_bodies),  cmocka_unit_test(many_errors),       cmocka_unit_test(largest_sizes),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
