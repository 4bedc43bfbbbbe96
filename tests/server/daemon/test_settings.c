/* test_settings.c - sources in their order, every fault named, samples that read back as the defaults. */
#include "server/daemon/settings.h"

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <cmocka.h>

#include <stdlib.h>
#include <string.h>
#include <unistd.h>

static struct sv_settings settings;
static struct sv_command_line line;
static struct sv_errors errors;

static enum sv_status read_them(char *const *environment, const char *first, ...)
{
    char *argv[32] = {(char *)(uintptr_t) "silvistad"};
    int argc = 1;
    va_list args;
    va_start(args, first);
    for (const char *a = first; a; a = va_arg(args, const char *))
        argv[argc++] = (char *)(uintptr_t)a;
    va_end(args);
    sv_errors_finish(&errors);
    sv_errors_init(&errors);
    return sv_settings_read(argc, argv, environment, &settings, &line, &errors);
}

static bool has_error(const char *key)
{
    for (size_t i = 0; i < errors.count; i++)
        if (strcmp(errors.items[i].field, key) == 0)
            return true;
    return false;
}

static const char *write_file(const char *text)
{
    static char path[] = "/tmp/silvista-settings-XXXXXX";
    strcpy(path + strlen(path) - 6, "XXXXXX");
    int fd = mkstemp(path);
    assert_int_equal(write(fd, text, strlen(text)), strlen(text));
    close(fd);
    return path;
}

static void a_later_source_wins(void **state)
{
    char *environment[] = {(char *)(uintptr_t) "SILVISTA_QUEUE_LIMIT=3",
                           (char *)(uintptr_t) "SILVISTA_DRAIN_MS=33", (char *)(uintptr_t) "PATH=/bin", NULL};
    const char *path = write_file(
        "# comment\n\n queue_limit = 2 \ndrain_ms=22\ndeadline_ms = 22\ncors_origin = http://x#y\n");
    (void)state;
    assert_int_equal(read_them(environment, "--queue-limit", "4", "--config", path, NULL), SV_OK);
    assert_int_equal(settings.queue_limit, 4);    /* flag */
    assert_int_equal(settings.drain_ms, 33);      /* environment */
    assert_int_equal(settings.deadline_ms, 22);   /* file */
    assert_int_equal(settings.connections, 1024); /* default */
    assert_string_equal(settings.cors_origin, "http://x#y");
    assert_int_equal(read_them(NULL, "--queue_limit=5", NULL), SV_OK);
    assert_int_equal(settings.queue_limit, 5);
    unlink(path);
}

static void empty_values_are_filled_in(void **state)
{
    (void)state;
    setenv("XDG_CACHE_HOME", "/some/where", 1);
    assert_int_equal(read_them(NULL, NULL), SV_OK);
    assert_string_equal(settings.cache_dir, "/some/where/silvista");
    assert_true(settings.workers >= 1);
    setenv("XDG_CACHE_HOME", "relative", 1);
    assert_int_equal(read_them(NULL, "--workers=7", "--deadline-ms=900000", NULL), SV_OK);
    assert_string_equal(settings.cache_dir, "/var/cache/silvista");
    assert_int_equal(settings.workers, 7);
    assert_int_equal(settings.deadline_max_ms, 900000);
    unsetenv("XDG_CACHE_HOME");
}

static void all_faults_are_named_at_once(void **state)
{
    char *environment[] = {(char *)(uintptr_t) "SILVISTA_BOGUS=1",
                           (char *)(uintptr_t) "SILVISTA_SERVICE_HOST=10.0.0.1",
                           (char *)(uintptr_t) "SILVISTA_PORT=tcp://10.0.0.1:80", NULL};
    const char *path = write_file("nonsense\nqueue_limit = 0\nno_such = 1\n");
    static char long_text[4000];
    (void)state;
    memset(long_text, 'x', sizeof long_text - 1);
    assert_int_not_equal(read_them(environment, "--config", path, "--workers", "1e3", "--access-log", "yes",
                                   "--log-level", "loud", "--admin-token", long_text, "--drain-ms= 5",
                                   "stray", "--public-url", "a\tb", "--deadline-ms", NULL),
                         SV_OK);
    static const char *const keys[] = {"config",   "queue_limit", "no_such",    "bogus",
                                       "workers",  "access_log",  "log_level",  "admin_token",
                                       "drain_ms", "stray",       "public_url", "deadline_ms"};
    for (size_t i = 0; i < sizeof keys / sizeof keys[0]; i++)
        assert_true(has_error(keys[i]));
    assert_int_equal(errors.total, sizeof keys / sizeof keys[0]);
    unlink(path);
    assert_int_not_equal(read_them(NULL, "--config", "/no/such/file", NULL), SV_OK);
    assert_true(has_error("config"));
}

static const char *message_of(const char *key)
{
    for (size_t i = 0; i < errors.count; i++)
        if (strcmp(errors.items[i].field, key) == 0)
            return errors.items[i].message;
    return "";
}

/* A wrong name is told as such, whether or not a value follows; a wrong flag takes no other flag with it. */
static void an_unknown_key_is_no_missing_value(void **state)
{
    char *environment[] = {(char *)(uintptr_t) "SILVISTA_WORKER=1", NULL};
    (void)state;
    assert_int_not_equal(read_them(NULL, "--bogus", NULL), SV_OK);
    assert_string_equal(message_of("bogus"), "flag --bogus: no such setting: --help lists them");
    assert_int_not_equal(read_them(NULL, "--queue-limt", NULL), SV_OK);
    assert_string_equal(message_of("queue_limt"),
                        "flag --queue_limt: no such setting: did you mean \"queue_limit\"?");
    assert_int_not_equal(
        read_them(environment, "--bogus", "--drain-ms", "5", "--worke", "7", "--stray=3", NULL), SV_OK);
    assert_int_equal(errors.total, 4);
    assert_int_equal(settings.drain_ms, 5);
    assert_non_null(strstr(message_of("worker"), "did you mean \"workers\"?"));
    assert_non_null(strstr(message_of("stray"), "no such setting"));
    assert_int_not_equal(read_them(NULL, "--test-hooks-dif", "x", NULL), SV_OK); /* hidden: not proposed */
    assert_null(strstr(message_of("test_hooks_dif"), "test_hooks_dir"));
    assert_int_not_equal(read_them(NULL, "--workers", NULL), SV_OK);
    assert_string_equal(message_of("workers"), "--workers needs a value");
}

static void commands_are_read(void **state)
{
    (void)state;
    assert_int_equal(read_them(NULL, "--help", NULL), SV_OK);
    assert_int_equal(line.command, SV_COMMAND_HELP);
    assert_int_equal(read_them(NULL, "--render", "v.json", "-o", "x.png", NULL), SV_OK);
    assert_int_equal(line.command, SV_COMMAND_RENDER);
    assert_string_equal(line.render_out, "x.png");
    assert_int_not_equal(read_them(NULL, "--render", "v.json", NULL), SV_OK);
    assert_true(has_error("output"));
}

/* The sample with every comment of a value taken off must read as the defaults. */
static void the_sample_reads_back_as_the_defaults(void **state)
{
    struct sv_settings standard;
    char *text = NULL;
    size_t bytes = 0;
    (void)state;
    assert_int_equal(read_them(NULL, NULL), SV_OK);
    standard = settings;
    FILE *out = open_memstream(&text, &bytes);
    sv_settings_print_sample(out);
    fclose(out);
    for (char *p = text; (p = strstr(p, "\n#")) != NULL; p++)
        if (p[2] != ' ')
            p[1] = ' ';
    const char *path = write_file(text);
    assert_int_equal(read_them(NULL, "--config", path, NULL), SV_OK);
    assert_memory_equal(&settings, &standard, sizeof settings);
    assert_null(strstr(text, "test_hooks"));
    unlink(path);
    free(text);
}

/* A reference picture of the largest size must be drawn within the deadline, by the slowest rate seen. */
static void the_largest_reference_picture_fits_the_deadline(void **state)
{
    static const double slowest_per_s = 0.6e6;
    (void)state;
    assert_int_equal(read_them(NULL, NULL), SV_OK);
    assert_true(settings.max_samples_pixels >= 1024 * 1024 * 16);
    assert_true(settings.max_samples_pixels >= settings.max_pixels); /* one sample of any legal size */
    assert_true((double)settings.max_samples_pixels / slowest_per_s * 1e3 < (double)settings.deadline_ms);
    assert_true(settings.deadline_max_ms >= settings.deadline_ms);
}

static void a_run_needs_a_scene_and_both_tls_files(void **state)
{
    (void)state;
    assert_int_equal(read_them(NULL, "--tls-cert", "x", NULL), SV_OK);
    sv_settings_check_run(&settings, &errors);
    assert_true(has_error("scene"));
    assert_true(has_error("tls_key"));
}

static int finish(void **state)
{
    (void)state;
    sv_errors_finish(&errors);
    return 0;
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_later_source_wins),
        cmocka_unit_test(empty_values_are_filled_in),
        cmocka_unit_test(all_faults_are_named_at_once),
        cmocka_unit_test(an_unknown_key_is_no_missing_value),
        cmocka_unit_test(commands_are_read),
        cmocka_unit_test(the_sample_reads_back_as_the_defaults),
        cmocka_unit_test(the_largest_reference_picture_fits_the_deadline),
        cmocka_unit_test(a_run_needs_a_scene_and_both_tls_files),
    };
    return cmocka_run_group_tests(tests, NULL, finish);
}
