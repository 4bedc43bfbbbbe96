/* main.c - silvistad: reads the settings, then serves, or does the one thing that the command line asks for.
 *
 * The daemon touches no GL, GDAL or scene file: that is silvista-scene's. --render hands over to it at once.
 */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <errno.h>
#include <unistd.h>

#include "server/daemon/service.h"
#include "server/log.h"

extern char **environ;

static int report(const struct sv_errors *errors)
{
    for (size_t i = 0; i < errors->count; i++)
        fprintf(stderr, "silvistad: %s: %s\n", errors->items[i].field, errors->items[i].message);
    return 2;
}

static enum sv_log_level level_of(const char *name)
{
    static const char *const names[] = {
#define X(id, text) [id] = text,
        SV_LOG_LEVEL_LIST(X)
#undef X
    };
    for (int i = 0; i < SV_LOG_LEVEL_COUNT; i++)
        if (strcmp(names[i], name) == 0)
            return (enum sv_log_level)i;
    return SV_LOG_INFO;
}

/* Becomes the scene program, which draws one picture and ends. */
static int render(const struct sv_settings *settings, const struct sv_command_line *line)
{
    char program[SV_SETTING_TEXT_MAX], budget[32];
    struct sv_error error;
    if (sv_scenes_find_program(settings, program, &error) != SV_OK) {
        fprintf(stderr, "silvistad: %s: %s\n", error.field, error.message);
        return EXIT_FAILURE;
    }
    snprintf(budget, sizeof budget, "%lld", (long long)settings->cache_budget_mb);
    const char *const argv[] = {program,
                                "--scene",
                                settings->scene,
                                "--cache-dir",
                                settings->cache_dir,
                                "--cache-budget-mb",
                                budget,
                                "--log-level",
                                settings->log_level,
                                "--render",
                                line->render_view,
                                "--output",
                                line->render_out,
                                NULL};
    sv_scenes_child_environment();
    execv(program, (char *const *)(uintptr_t)argv);
    fprintf(stderr, "silvistad: scene_program: %s: %s\n", program, strerror(errno));
    return EXIT_FAILURE;
}

/* The address that reaches the service, with the actual port. */
static void announce(const struct sv_service *service)
{
    const char *listen = service->settings->listen;
    int host_bytes = (int)(strrchr(listen, ':') - listen);
    printf("listening on %s://%.*s:%u\n", service->settings->tls_cert[0] ? "https" : "http",
           host_bytes ? host_bytes : 7, host_bytes ? listen : "0.0.0.0", sv_http_port(service->http));
    fflush(stdout);
}

static int serve(const struct sv_settings *settings)
{
    static struct sv_service service;
    struct sv_error error;
    if (sv_service_start(&service, settings, &error) != SV_OK) {
        fprintf(stderr, "silvistad: %s: %s\n", error.field, error.message);
        return EXIT_FAILURE;
    }
    announce(&service);
    int status = sv_service_run(&service);
    sv_log(SV_LOG_INFO, "end", "status %d", status);
    sv_service_stop(&service);
    return status;
}

static int check(const struct sv_settings *settings, struct sv_errors *errors)
{
    char program[SV_SETTING_TEXT_MAX];
    struct sv_error error;
    if (sv_scenes_find_program(settings, program, &error) != SV_OK)
        sv_errors_add(errors, error.code, error.field, "%s", error.message);
    if (errors->total)
        return report(errors);
    puts("the settings are good");
    return EXIT_SUCCESS;
}

static int run(const struct sv_settings *settings, const struct sv_command_line *line,
               struct sv_errors *errors)
{
    switch (line->command) {
    case SV_COMMAND_HELP:
        sv_settings_print_help(stdout);
        return EXIT_SUCCESS;
    case SV_COMMAND_VERSION:
        puts("silvistad " SV_VERSION);
        return EXIT_SUCCESS;
    case SV_COMMAND_SAMPLE:
        sv_settings_print_sample(stdout);
        return EXIT_SUCCESS;
    case SV_COMMAND_SERVE:
    case SV_COMMAND_CHECK:
    case SV_COMMAND_RENDER:
        break;
    }
    sv_settings_check_run(settings, errors);
    if (line->command == SV_COMMAND_CHECK)
        return check(settings, errors);
    if (errors->total)
        return report(errors);
    return line->command == SV_COMMAND_RENDER ? render(settings, line) : serve(settings);
}

int main(int argc, char **argv)
{
    static struct sv_settings settings;
    static struct sv_command_line line;
    struct sv_errors errors;
    sv_errors_init(&errors);
    int result;
    if (sv_settings_read(argc, argv, environ, &settings, &line, &errors) != SV_OK) {
        result = report(&errors);
    } else {
        sv_log_init("silvistad", level_of(settings.log_level));
        result = run(&settings, &line, &errors);
    }
    sv_errors_finish(&errors);
    return result;
}
