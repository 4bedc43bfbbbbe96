#include "api/trace.h"

#include <string.h>

#include "tests/api/cmocka_all.h"

static uint8_t bytes[SV_TRACE_RANDOM_BYTES];
static const char parent[] = "00-4bf92f3577b34da6a3ce929d0e0e4736-00f067aa0ba902b7-01";

static int setup(void **state)
{
    (void)state;
    for (int k = 0; k < SV_TRACE_RANDOM_BYTES; k++)
        bytes[k] = (uint8_t)(k + 0x10);
    return 0;
}

static void request_ids(void **state)
{
    (void)state;
    static const struct {
        const char *id;
        int kept;
    } rows[] = {
        {"a", 1},
        {"Ab9._-", 1},
        {"0123456789012345678901234567890123456789012345678901234567890123", 1},
        {"01234567890123456789012345678901234567890123456789012345678901234", 0},
        {"", 0},
        {"a b", 0},
        {"a\r\nX: y", 0},
        {"\xC3\xA9", 0},
        {"{}", 0},
        {NULL, 0},
    };
    for (size_t k = 0; k < sizeof rows / sizeof rows[0]; k++) {
        struct sv_trace trace;
        sv_api_trace(rows[k].id, NULL, bytes, &trace);
        assert_string_equal(trace.request_id, rows[k].kept ? rows[k].id : "101112131415161718191a1b1c1d1e1f");
    }
}

static void traceparents(void **state)
{
    (void)state;
    static const struct {
        const char *text;
        int valid;
    } rows[] = {
        {parent, 1},
        {"00-4bf92f3577b34da6a3ce929d0e0e4736-00f067aa0ba902b7-00", 1},
        {"00-4bf92f3577b34da6a3ce929d0e0e4736-00f067aa0ba902b7-ff", 1},
        {"01-4bf92f3577b34da6a3ce929d0e0e4736-00f067aa0ba902b7-01", 1},
        {"cc-4bf92f3577b34da6a3ce929d0e0e4736-00f067aa0ba902b7-01-what-comes", 1},
        {"00-4bf92f3577b34da6a3ce929d0e0e4736-00f067aa0ba902b7-01-", 0},
        {"cc-4bf92f3577b34da6a3ce929d0e0e4736-00f067aa0ba902b7-01.", 0},
        {"ff-4bf92f3577b34da6a3ce929d0e0e4736-00f067aa0ba902b7-01", 0},
        {"00-00000000000000000000000000000000-00f067aa0ba902b7-01", 0},
        {"00-4bf92f3577b34da6a3ce929d0e0e4736-0000000000000000-01", 0},
        {"00-4BF92F3577B34DA6A3CE929D0E0E4736-00f067aa0ba902b7-01", 0},
        {"00-4bf92f3577b34da6a3ce929d0e0e473-00f067aa0ba902b7-01", 0},
        {"00-4bf92f3577b34da6a3ce929d0e0e4736-00f067aa0ba902b7-0", 0},
        {"00-4bf92f3577b34da6a3ce929d0e0e4736-00f067aa0ba902b7-0x", 0},
        {"00_4bf92f3577b34da6a3ce929d0e0e4736-00f067aa0ba902b7-01", 0},
        {"", 0},
        {"00-", 0},
    };
    for (size_t k = 0; k < sizeof rows / sizeof rows[0]; k++)
        if (sv_api_traceparent_valid(rows[k].text) != !!rows[k].valid)
            fail_msg("%s", rows[k].text);
}

static void continued(void **state)
{
    (void)state;
    struct sv_trace trace;
    sv_api_trace(NULL, parent, bytes, &trace);
    assert_true(trace.continued);
    assert_string_equal(trace.traceparent, "00-4bf92f3577b34da6a3ce929d0e0e4736-3031323334353637-01");
    sv_api_trace(NULL, "nonsense", bytes, &trace);
    assert_false(trace.continued);
    assert_string_equal(trace.traceparent, "00-202122232425262728292a2b2c2d2e2f-3031323334353637-00");
    assert_true(sv_api_traceparent_valid(trace.traceparent));
    memset(bytes, 0, sizeof bytes);
    sv_api_trace(NULL, NULL, bytes, &trace);
    assert_true(sv_api_traceparent_valid(trace.traceparent));
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(request_ids), cmocka_unit_test(traceparents),
                                       cmocka_unit_test(continued)};
    return cmocka_run_group_tests(tests, setup, NULL);
}
