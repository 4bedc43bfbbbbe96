/* test_routes.c - every endpoint of the contract has its way; small readers of headers; listening; metrics'
 * text. */
#include "server/daemon/routes.h"

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <cmocka.h>

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "server/daemon/listen.h"
#include "server/daemon/metrics.h"
#include "server/daemon/pages.h"
#include "server/daemon/views.h"

static void every_built_endpoint_has_a_handler_and_no_other(void **state)
{
    int count;
    const struct sv_endpoint *endpoints = sv_api_endpoints(&count);
    (void)state;
    assert_true(count > 5);
    for (int i = 0; i < count; i++) {
        char path[256];
        struct sv_route_match match;
        size_t n = 0;
        for (const char *p = endpoints[i].path; *p; p++) { /* {z} becomes z */
            if (*p != '{' && *p != '}')
                path[n++] = *p;
        }
        path[n] = '\0';
        sv_routes_match(endpoints[i].method, path, &match);
        assert_true(match.found);
        assert_ptr_equal(match.endpoint, &endpoints[i]);
        assert_int_equal(match.handler != NULL, endpoints[i].built);
    }
}

static void methods_and_paths_are_told_apart(void **state)
{
    struct sv_route_match match;
    (void)state;
    sv_routes_match("PUT", "/v1/view", &match);
    assert_true(match.found && !match.endpoint);
    assert_string_equal(match.allow, "GET, HEAD, POST, OPTIONS");
    sv_routes_match("GET", "/v1/view/", &match);
    assert_false(match.found);
    sv_routes_match("get", "/v1/view", &match);
    assert_true(match.found && !match.endpoint);
    sv_routes_match("GET", "/", &match);
    assert_non_null(match.handler);
}

static void media_types_fit(void **state)
{
    (void)state;
    assert_true(sv_routes_media_fits(NULL, "application/json"));
    assert_true(sv_routes_media_fits("application/json", "application/json"));
    assert_true(sv_routes_media_fits("Application/JSON ; charset=utf-8", "application/json"));
    assert_false(sv_routes_media_fits("application/jsonx", "application/json"));
    assert_false(sv_routes_media_fits("application/json x", "application/json"));
    assert_false(sv_routes_media_fits("", "application/json"));
}

static void prefer_is_read(void **state)
{
    static const struct {
        const char *text;
        double ms;
        bool asked;
    } rows[] = {{NULL, 30000, false},         {"", 30000, false},
                {"wait=2", 2000, true},       {"respond-async, wait=10", 10000, true},
                {"WAIT = \"3\"", 3000, true}, {"wait=1000000", 60000, true},
                {"wait=x", 30000, false},     {"waiting=5", 30000, false},
                {"wait=-5", 30000, false},    {"handling=lenient; wait=4", 4000, true},
                {"wait=1e9", 60000, true},    {"wait=nan", 30000, false}};
    (void)state;
    for (size_t i = 0; i < sizeof rows / sizeof rows[0]; i++) {
        bool asked;
        assert_float_equal(sv_views_wait_ms(rows[i].text, 30000, 60000, &asked), rows[i].ms, 1e-9);
        assert_int_equal(asked, rows[i].asked);
    }
}

static void a_token_must_fit_whole(void **state)
{
    char token[1200];
    (void)state;
    assert_true(sv_page_token_fits("Bearer secret", "secret"));
    assert_true(sv_page_token_fits("bearer  secret", "secret"));
    assert_false(sv_page_token_fits(NULL, "secret"));
    assert_false(sv_page_token_fits("secret", "secret"));
    assert_false(sv_page_token_fits("Basic secret", "secret"));
    assert_false(sv_page_token_fits("Bearer secre", "secret"));
    assert_false(sv_page_token_fits("Bearer secrets", "secret"));
    memset(token, 'x', sizeof token - 1);
    token[sizeof token - 1] = '\0';
    memcpy(token, "Bearer ", 7);
    assert_false(sv_page_token_fits(token, "x"));
}

/* Room for the largest that each container can make of incompressible pixels. */
static void a_slab_has_room_for_raw_pixels(void **state)
{
    struct sv_view_request request = {.width = 16, .height = 16, .layers = 1u << SV_LAYER_COLOR};
    (void)state;
    assert_true(sv_views_picture_bytes_max(&request) > 16 * 16 * 8);
    request = (struct sv_view_request){.width = 4096, .height = 4096, .layers = (1u << SV_LAYER_COUNT) - 1};
    assert_true(sv_views_picture_bytes_max(&request) > (size_t)4096 * 4096 * 28);
}

static void listening_finds_a_port_and_says_what_is_wrong(void **state)
{
    static const char *const bad[] = {
        "",       "127.0.0.1", "127.0.0.1:",       "127.0.0.1:x", "127.0.0.1:65536", "127.0.0.1:-1",
        "::1:80", "[::1:80",   "127.0.0.1:999999", "1.2.3.4:1",   "no such host:1"};
    struct sv_error error;
    unsigned port, again;
    int fd, other;
    (void)state;
    for (size_t i = 0; i < sizeof bad / sizeof bad[0]; i++) {
        assert_int_not_equal(sv_listen(bad[i], &fd, &port, &error), SV_OK);
        assert_string_equal(error.field, "listen");
    }
    assert_int_equal(sv_listen("127.0.0.1:0", &fd, &port, &error), SV_OK);
    assert_true(port > 0);
    char text[32];
    snprintf(text, sizeof text, "127.0.0.1:%u", port);
    assert_int_equal(sv_listen(text, &other, &again, &error), SV_EIO); /* in use */
    close(fd);
    assert_int_equal(sv_listen(text, &other, &again, &error), SV_OK);
    assert_int_equal(port, again);
    close(other);
}

static void histograms_are_cumulative(void **state)
{
    static struct sv_metrics metrics;
    struct sv_timings timings;
    (void)state;
    for (int s = 0; s < SV_STAGE_COUNT; s++)
        timings.ms[s] = -1;
    timings.ms[SV_STAGE_NEAR] = 3;
    sv_metrics_stages(&metrics, &timings);
    timings.ms[SV_STAGE_NEAR] = 1e6;
    sv_metrics_stages(&metrics, &timings);
    sv_metrics_request(&metrics, "getView", 200, 0.5, 1000);
    sv_metrics_request(&metrics, "getView", 200, 0.5, 24);
    char *text = sv_metrics_text(&metrics, "1.2.3");
    static const char *const lines[] = {"silvista_stage_seconds_bucket{stage=\"near\",le=\"0.0025\"} 0\n",
                                        "silvista_stage_seconds_bucket{stage=\"near\",le=\"0.005\"} 1\n",
                                        "silvista_stage_seconds_bucket{stage=\"near\",le=\"60\"} 1\n",
                                        "silvista_stage_seconds_bucket{stage=\"near\",le=\"+Inf\"} 2\n",
                                        "silvista_stage_seconds_count{stage=\"near\"} 2\n",
                                        "silvista_stage_seconds_sum{stage=\"near\"} 1000.003\n",
                                        "silvista_stage_seconds_count{stage=\"warp\"} 0\n",
                                        "silvista_http_requests_total{route=\"getView\",code=\"200\"} 2\n",
                                        "silvista_http_response_bytes_total 1024\n",
                                        "silvista_build_info{version=\"1.2.3\"} 1\n"};
    for (size_t i = 0; i < sizeof lines / sizeof lines[0]; i++)
        if (!strstr(text, lines[i]))
            fail_msg("missing: %s", lines[i]);
    free(text);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(every_built_endpoint_has_a_handler_and_no_other),
        cmocka_unit_test(methods_and_paths_are_told_apart),
        cmocka_unit_test(media_types_fit),
        cmocka_unit_test(prefer_is_read),
        cmocka_unit_test(a_token_must_fit_whole),
        cmocka_unit_test(a_slab_has_room_for_raw_pixels),
        cmocka_unit_test(listening_finds_a_port_and_says_what_is_wrong),
        cmocka_unit_test(histograms_are_cumulative),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
