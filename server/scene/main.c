/* main.c - silvista-scene: loads one version of the scene and forks the workers that draw it; or draws one
 * picture.
 *
 * Started by silvistad, with a control socket on a descriptor (wire.h). It leaves by _exit only: dependencies
 * of OpenImageIO start threads before main, on which exit can hang. Ends when the daemon closes the socket or
 * dies. */
#include <errno.h>
#include <getopt.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "server/log.h"
#include "server/scene/control.h"
#include "server/scene/hooks.h"
#include "server/scene/one_shot.h"

struct arguments {
    struct sv_backend_options options;
    const char *render_view, *render_out;
    int control_fd; /* -1: none */
    enum sv_log_level level;
};

_Noreturn static void leave(int status)
{
    fflush(stdout);
    _exit(status);
}

_Noreturn static void usage(void)
{
    fputs("silvista-scene - loads a scene and draws it for silvistad, which starts it\n"
          "usage: silvista-scene --scene FILE --render VIEW.json --output OUT [--cache-dir DIR] "
          "[--cache-budget-mb N]\n",
          stderr);
    leave(2);
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

static void read_arguments(int argc, char **argv, struct arguments *a)
{
    enum { SCENE = 1, CACHE, BUDGET, WORKERS, CONTROL, LEVEL, HOOKS, PIXELS, SAMPLES, CELLS, RENDER, OUTPUT };
    static const struct option names[] = {{"scene", required_argument, NULL, SCENE},
                                          {"cache-dir", required_argument, NULL, CACHE},
                                          {"cache-budget-mb", required_argument, NULL, BUDGET},
                                          {"workers", required_argument, NULL, WORKERS},
                                          {"control-fd", required_argument, NULL, CONTROL},
                                          {"log-level", required_argument, NULL, LEVEL},
                                          {"test-hooks-dir", required_argument, NULL, HOOKS},
                                          {"max-pixels", required_argument, NULL, PIXELS},
                                          {"max-samples-pixels", required_argument, NULL, SAMPLES},
                                          {"cells-bytes", required_argument, NULL, CELLS},
                                          {"render", required_argument, NULL, RENDER},
                                          {"output", required_argument, NULL, OUTPUT},
                                          {NULL, 0, NULL, 0}};
    *a = (struct arguments){.control_fd = -1, .level = SV_LOG_INFO};
    a->options = (struct sv_backend_options){.cache_budget_bytes = UINT64_C(4096) << 20,
                                             .processes = 1,
                                             .pixels_max = UINT64_C(4096) * 4096,
                                             .sample_pixels_max = UINT64_C(4096) * 4096 * 4};
    for (int which; (which = getopt_long(argc, argv, "", names, NULL)) != -1;) {
        switch (which) {
        case SCENE:
            a->options.scene_path = optarg;
            break;
        case CACHE:
            a->options.cache_dir = optarg;
            break;
        case BUDGET:
            a->options.cache_budget_bytes = strtoull(optarg, NULL, 10) << 20;
            break;
        case WORKERS:
            a->options.processes = atoi(optarg);
            break;
        case CONTROL:
            a->control_fd = atoi(optarg);
            break;
        case LEVEL:
            a->level = level_of(optarg);
            break;
        case HOOKS:
            sv_hooks_init(optarg);
            break;
        case PIXELS:
            a->options.pixels_max = strtoull(optarg, NULL, 10);
            break;
        case SAMPLES:
            a->options.sample_pixels_max = strtoull(optarg, NULL, 10);
            break;
        case CELLS:
            a->options.cells_bytes = strtoull(optarg, NULL, 10);
            break;
        case RENDER:
            a->render_view = optarg;
            break;
        case OUTPUT:
            a->render_out = optarg;
            break;
        default:
            usage();
        }
    }
    if (!a->options.scene_path || (a->control_fd < 0) == !a->render_view ||
        (a->render_view && !a->render_out))
        usage();
}

static int report(const struct sv_errors *errors)
{
    for (size_t i = 0; i < errors->count; i++)
        fprintf(stderr, "silvista-scene: %s%s%s\n", errors->items[i].field,
                errors->items[i].field[0] ? ": " : "", errors->items[i].message);
    return EXIT_FAILURE;
}

static int serve(const struct arguments *a)
{
    struct sv_errors errors;
    struct sv_backend *backend;
    unsigned threads = sv_control_threads();
    /* A terminal or a supervisor may send these to the whole group: the daemon decides when this process
     * ends. */
    signal(SIGINT, SIG_IGN);
    signal(SIGTERM, SIG_IGN);
    signal(SIGHUP, SIG_IGN);
    sv_errors_init(&errors);
    sv_hooks_before_load();
    enum sv_status status = sv_backend_load(&a->options, &backend, &errors);
    if (status != SV_OK) {
        sv_control_failed(a->control_fd, status, &errors);
        return EXIT_FAILURE;
    }
    sv_errors_finish(&errors);
    return sv_control_serve(a->control_fd, backend, threads);
}

int main(int argc, char **argv)
{
    struct arguments arguments;
    struct sv_errors errors;
    read_arguments(argc, argv, &arguments);
    sv_log_init("silvista-scene", arguments.level);
    if (!arguments.render_view)
        leave(serve(&arguments));
    sv_errors_init(&errors);
    enum sv_status status =
        sv_one_shot(&arguments.options, arguments.render_view, arguments.render_out, &errors);
    leave(status == SV_OK ? EXIT_SUCCESS : report(&errors));
}
