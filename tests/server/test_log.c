/* test_log.c - whatever is logged, a line is one JSON object, and nobody who does not read can stop the
 * writer. */
#include "server/log.h"

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <cmocka.h>

#include <cjson/cJSON.h>
#include <fcntl.h>
#include <math.h>
#include <string.h>
#include <unistd.h>

static int pipe_ends[2], saved_stderr;

static int redirect(void **state)
{
    (void)state;
    saved_stderr = dup(STDERR_FILENO);
    assert_int_equal(pipe2(pipe_ends, O_NONBLOCK), 0);
    dup2(pipe_ends[1], STDERR_FILENO);
    fcntl(STDERR_FILENO, F_SETFL, 0); /* blocking, as standard error is */
    sv_log_init("tester", SV_LOG_INFO);
    return 0;
}

static int restore(void **state)
{
    (void)state;
    dup2(saved_stderr, STDERR_FILENO);
    close(saved_stderr);
    close(pipe_ends[0]);
    close(pipe_ends[1]);
    return 0;
}

static cJSON *read_line(void)
{
    char text[8192];
    ssize_t n = read(pipe_ends[0], text, sizeof text - 1);
    assert_true(n > 0);
    text[n] = '\0';
    assert_ptr_equal(strchr(text, '\n'), text + n - 1);
    const char *end = NULL;
    cJSON *root = cJSON_ParseWithOpts(text, &end, 0);
    assert_non_null(root);
    assert_ptr_equal(end, text + n - 1);
    return root;
}

static const char *value_of(const cJSON *root, const char *key)
{
    return cJSON_GetStringValue(cJSON_GetObjectItem(root, key));
}

static void a_line_has_its_fields(void **state)
{
    struct sv_log_line line;
    (void)state;
    sv_log_begin(&line, SV_LOG_WARNING, "thing");
    sv_log_text(&line, "odd", "a\"b\\c\n\x01\xff\xc3\xa4");
    sv_log_text(&line, "none", NULL);
    sv_log_number(&line, "number", 1.5);
    sv_log_number(&line, "nan", NAN);
    sv_log_whole(&line, "whole", INT64_MIN);
    sv_log_end(&line);
    cJSON *root = read_line();
    assert_string_equal(value_of(root, "level"), "warning");
    assert_string_equal(value_of(root, "process"), "tester");
    assert_string_equal(value_of(root, "event"), "thing");
    assert_string_equal(value_of(root, "odd"), "a\"b\\c\n\x01\xc3\xbf\xc3\xa4"); /* byte ff shown as U+00FF */
    assert_true(cJSON_IsNull(cJSON_GetObjectItem(root, "none")));
    assert_true(cJSON_IsNull(cJSON_GetObjectItem(root, "nan")));
    assert_float_equal(cJSON_GetObjectItem(root, "number")->valuedouble, 1.5, 0);
    cJSON_Delete(root);
}

static void a_line_too_long_is_cut_and_stays_json(void **state)
{
    static char text[10000];
    (void)state;
    memset(text, 1, sizeof text - 1); /* six bytes each when escaped */
    for (size_t n = 1; n < sizeof text; n = n * 2 + 1) {
        struct sv_log_line line;
        text[n] = '\0';
        sv_log_begin(&line, SV_LOG_INFO, "long");
        sv_log_text(&line, "text", text);
        sv_log_text(&line, "after", "x");
        sv_log_end(&line);
        text[n] = 1;
        cJSON *root = read_line();
        assert_int_equal(cJSON_IsTrue(cJSON_GetObjectItem(root, "cut")), n * 6 > SV_LOG_LINE_BYTES - 256);
        assert_string_equal(value_of(root, "after"), "x");
        cJSON_Delete(root);
    }
}

static void below_the_level_is_silent(void **state)
{
    char byte;
    (void)state;
    sv_log(SV_LOG_DEBUG, "quiet", "%s", "x");
    assert_false(sv_log_on(SV_LOG_DEBUG));
    assert_int_equal(read(pipe_ends[0], &byte, 1), -1);
}

static void a_full_pipe_drops_lines_and_does_not_block(void **state)
{
    (void)state;
    uint64_t before = sv_log_dropped();
    for (int i = 0; i < 2000; i++)
        sv_log(SV_LOG_INFO, "flood", "%0200d", i);
    assert_true(sv_log_dropped() > before);
    cJSON *root = NULL;
    char bytes[4096];
    while (read(pipe_ends[0], bytes, sizeof bytes) > 0)
        ;
    sv_log(SV_LOG_INFO, "after", "x");
    root = read_line();
    assert_string_equal(value_of(root, "event"), "after");
    cJSON_Delete(root);
}

int main(void)
{
#define TEST(f) cmocka_unit_test_setup_teardown(f, redirect, restore)
    const struct CMUnitTest tests[] = {
        TEST(a_line_has_its_fields),
        TEST(a_line_too_long_is_cut_and_stays_json),
        TEST(below_the_level_is_silent),
        TEST(a_full_pipe_drops_lines_and_does_not_block),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
