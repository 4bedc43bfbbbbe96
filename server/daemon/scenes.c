#include "server/daemon/scenes.h"

#include <errno.h>
#include <fcntl.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/epoll.h>
#include <sys/prctl.h>
#include <sys/socket.h>
#include <sys/wait.h>
#include <unistd.h>

#include "server/log.h"

/* Pauses before a dead scene process is started again: none, then 0.5 s doubling to 30 s while none gets
 * ready. */
static const double pause_first_ms = 500, pause_most_ms = 30000;
enum { CONTROL_FD = 3, FACTS_BYTES_MAX = 16 << 20 };

enum sv_status sv_scenes_find_program(const struct sv_settings *settings, char program[SV_SETTING_TEXT_MAX],
                                      struct sv_error *error)
{
    if (settings->scene_program[0]) {
        snprintf(program, SV_SETTING_TEXT_MAX, "%s", settings->scene_program);
    } else {
        ssize_t bytes = readlink("/proc/self/exe", program, SV_SETTING_TEXT_MAX - 32);
        if (bytes < 0)
            return sv_fail(error, SV_ENOENT, "scene_program", "/proc/self/exe: %s", strerror(errno));
        program[bytes] = '\0';
        char *slash = strrchr(program, '/');
        strcpy(slash ? slash + 1 : program, "silvista-scene");
    }
    if (access(program, X_OK))
        return sv_fail(error, SV_ENOENT, "scene_program", "%s: %s", program, strerror(errno));
    return SV_OK;
}

static void restart(void *context)
{
    struct sv_scenes *scenes = context;
    struct sv_error error;
    if (!scenes->loading && sv_scenes_load(scenes, &error) != SV_OK)
        sv_log(SV_LOG_ERROR, "scene", "%s", error.message);
}

enum sv_status sv_scenes_init(struct sv_scenes *scenes, struct sv_loop *loop, struct sv_metrics *metrics,
                              const struct sv_settings *settings, const struct sv_scenes_events *events,
                              const struct sv_crew_events *crew_events, void *context, struct sv_error *error)
{
    *scenes = (struct sv_scenes){.loop = loop, .metrics = metrics, .settings = settings, .events = *events};
    scenes->crew = (struct sv_crew_options){.loop = loop,
                                            .metrics = metrics,
                                            .size = (size_t)settings->workers,
                                            .views_max = (uint64_t)settings->worker_max_views,
                                            .own_bytes_max = (uint64_t)settings->worker_max_mb << 20,
                                            .events = *crew_events};
    scenes->crew.events.context = context;
    scenes->restart = (struct sv_timer){.due = restart, .context = scenes};
    if (prctl(PR_SET_CHILD_SUBREAPER, 1))
        return sv_fail(error, SV_EIO, "subreaper", "%s", strerror(errno));
    return sv_scenes_find_program(settings, scenes->program, error);
}

void sv_scenes_child_environment(void)
{
    static const char *const single_threaded[][2] = {
        {"LP_NUM_THREADS", "0"},  {"MESA_SHADER_CACHE_DISABLE", "true"}, {"GDAL_NUM_THREADS", "1"},
        {"OMP_NUM_THREADS", "1"}, {"OPENBLAS_NUM_THREADS", "1"},         {"OPENIMAGEIO_THREADS", "1"},
        {"GOTO_NUM_THREADS", "1"}};
    for (size_t i = 0; i < sizeof single_threaded / sizeof single_threaded[0]; i++)
        setenv(single_threaded[i][0], single_threaded[i][1], 1);
    /* Memory in large pages, where the system gives some to who asks: a scene process of 600 MB forks in 10
     * ms instead of 30. Whoever runs the daemon may have settings of his own. */
    setenv("GLIBC_TUNABLES", "glibc.malloc.hugetlb=1", 0);
}

/* In the child: never returns. parent: the daemon, which may have died meanwhile. */
static void become_scene(const struct sv_scenes *scenes, int control, pid_t parent)
{
    const struct sv_settings *s = scenes->settings;
    char budget[32], workers[32], pixels[32], samples[32], cells[32];
    sigset_t none;
    snprintf(budget, sizeof budget, "%lld", (long long)s->cache_budget_mb);
    snprintf(workers, sizeof workers, "%lld", (long long)s->workers);
    snprintf(pixels, sizeof pixels, "%lld", (long long)s->max_pixels);
    snprintf(samples, sizeof samples, "%lld", (long long)s->max_samples_pixels);
    snprintf(cells, sizeof cells, "%lld", (long long)s->cells_bytes);
    const char *const argv[] = {scenes->program,
                                "--cells-bytes",
                                cells,
                                "--max-pixels",
                                pixels,
                                "--max-samples-pixels",
                                samples,
                                "--scene",
                                s->scene,
                                "--cache-dir",
                                s->cache_dir,
                                "--cache-budget-mb",
                                budget,
                                "--workers",
                                workers,
                                "--log-level",
                                s->log_level,
                                "--control-fd",
                                "3",
                                "--test-hooks-dir",
                                s->test_hooks_dir,
                                NULL};
    if (prctl(PR_SET_PDEATHSIG, SIGKILL) || getppid() != parent)
        _exit(126);
    sigemptyset(&none);
    sigprocmask(SIG_SETMASK, &none, NULL);
    signal(SIGPIPE, SIG_DFL);
    sv_scenes_child_environment();
    int null = open("/dev/null", O_RDONLY);
    if (null < 0 || dup2(null, STDIN_FILENO) < 0 || dup2(STDERR_FILENO, STDOUT_FILENO) < 0)
        _exit(126);
    /* dup2 onto itself would leave close-on-exec set. */
    if (control == CONTROL_FD ? fcntl(control, F_SETFD, 0) < 0 : dup2(control, CONTROL_FD) < 0)
        _exit(126);
    execv(scenes->program, (char *const *)(uintptr_t)argv);
    _exit(127);
}

static void on_control(void *context, uint32_t events);

/* A process in the list that is on its way to serve, on our end of its control socket. */
static enum sv_status add_process(struct sv_scenes *scenes, int control_fd, struct sv_scene_process **out,
                                  struct sv_error *error)
{
    struct sv_scene_process *process = calloc(1, sizeof *process);
    if (!process)
        return sv_fail(error, SV_ENOMEM, "scene", "out of memory");
    process->all = scenes;
    process->control_fd = control_fd;
    fcntl(control_fd, F_SETFL, O_NONBLOCK);
    process->started_ms = sv_loop_now_ms();
    sv_errors_init(&process->reasons);
    sv_crew_init(&process->crew, &scenes->crew);
    enum sv_status status =
        sv_loop_watch(scenes->loop, control_fd, EPOLLIN, on_control, process, &process->watch, error);
    if (status != SV_OK) {
        free(process);
        return status;
    }
    sv_loop_disarm(scenes->loop, &scenes->restart);
    process->next = scenes->processes;
    scenes->processes = process;
    scenes->loading = process;
    *out = process;
    return SV_OK;
}

static enum sv_status control_pair(struct sv_scenes *scenes, int pair[2], struct sv_error *error)
{
    if (scenes->loading)
        return sv_fail(error, SV_ELIMIT, "scene", "a load or a patch is under way");
    return socketpair(AF_UNIX, SOCK_SEQPACKET | SOCK_CLOEXEC, 0, pair)
               ? sv_fail(error, SV_EIO, "scene", "a socket for a scene process: %s", strerror(errno))
               : SV_OK;
}

enum sv_status sv_scenes_load(struct sv_scenes *scenes, struct sv_error *error)
{
    int pair[2];
    struct sv_scene_process *process;
    enum sv_status status = control_pair(scenes, pair, error);
    if (status != SV_OK)
        return status;
    pid_t daemon = getpid(), pid = fork();
    if (pid == 0)
        become_scene(scenes, pair[1], daemon);
    int fork_error = errno;
    close(pair[1]);
    status = pid < 0 ? sv_fail(error, SV_EIO, "scene", "fork: %s", strerror(fork_error))
                     : add_process(scenes, pair[0], &process, error);
    if (status != SV_OK) {
        if (pid > 0)
            kill(pid, SIGKILL); /* sv_scenes_reap collects it */
        close(pair[0]);
        return status;
    }
    process->pid = pid;
    sv_metrics_count(scenes->metrics, SV_COUNT_SCENE_STARTED);
    sv_log(SV_LOG_INFO, "scene process", "started %s as %d for %s", scenes->program, (int)process->pid,
           scenes->settings->scene);
    return SV_OK;
}

/* Orders the successor and hands it the patch; what it needs is in the sockets when this returns. */
static enum sv_status order_successor(struct sv_scenes *scenes, const int pair[2], const char *body,
                                      size_t bytes, struct sv_error *error)
{
    union sv_wire_message message;
    int text = sv_wire_text_descriptor(body, bytes);
    if (text < 0)
        return sv_fail(error, SV_EIO, "scene", "memory for a patch: %s", strerror(errno));
    sv_wire_init(&message, SV_WIRE_PATCH_TEXT, scenes->patches);
    message.text.bytes = bytes;
    enum sv_status status = sv_wire_send(pair[0], &message, text, error);
    close(text);
    sv_wire_init(&message, SV_WIRE_PATCH, scenes->patches);
    return status == SV_OK ? sv_wire_send(scenes->serving->control_fd, &message, pair[1], error) : status;
}

enum sv_status sv_scenes_patch(struct sv_scenes *scenes, const char *body, size_t bytes,
                               struct sv_error *error)
{
    int pair[2];
    struct sv_scene_process *process;
    if (!scenes->serving || scenes->serving->control_fd < 0)
        return sv_fail(error, SV_ENOENT, "scene", "no scene is loaded at the moment");
    enum sv_status status = control_pair(scenes, pair, error);
    if (status != SV_OK)
        return status;
    scenes->patches++;
    status = order_successor(scenes, pair, body, bytes, error);
    close(pair[1]);
    if (status == SV_OK)
        status = add_process(scenes, pair[0], &process, error);
    if (status != SV_OK) {
        close(pair[0]); /* a successor that was forked finds nobody there, and ends */
        return status;
    }
    process->patch = scenes->patches;
    return SV_OK;
}

static void close_control(struct sv_scene_process *process)
{
    sv_loop_unwatch(process->all->loop, process->watch);
    process->watch = NULL;
    if (process->control_fd >= 0)
        close(process->control_fd);
    process->control_fd = -1;
}

/* One whose pid is not known ends when it finds its socket closed. */
static void end_process(struct sv_scene_process *process)
{
    if (process->pid > 0)
        kill(process->pid, SIGKILL);
    else
        close_control(process);
}

/* The last worker of an old scene is gone, and what it held of the panels is free: the scene has nothing to
 * save. */
static void leave_if_alone(struct sv_scene_process *process)
{
    if (process->leaving && !process->crew.workers)
        end_process(process);
}

static uint64_t generation_of(const struct sv_scene_process *process)
{
    struct sv_cell_cache_stats stats = {0};
    if (process->cells.cache)
        sv_cell_cache_stats(process->cells.cache, &stats);
    return stats.generation;
}

/* A successor that died may have dropped what its patch shows on: the serving scene may build it again. */
static void give_back_cells(struct sv_scene_process *serving)
{
    if (serving && serving->cells.cache)
        sv_cell_cache_turn_back(serving->cells.cache, serving->cells_generation);
}

static void becomes_serving(struct sv_scene_process *process, const struct sv_wire_ready *ready)
{
    struct sv_scenes *scenes = process->all;
    struct sv_scene_process *old = scenes->serving;
    process->ready = true;
    process->version = ready->scene_version;
    process->epsg = ready->epsg;
    process->relief_distance_m = ready->relief_distance_m;
    process->load_ms = sv_loop_now_ms() - process->started_ms;
    process->cells_generation = generation_of(process);
    scenes->serving = process;
    scenes->loading = NULL;
    scenes->has_served = true;
    scenes->early_deaths = 0;
    scenes->last_failure[0] = '\0';
    sv_log(SV_LOG_INFO, "scene ready", "process %d, version %016llx, loaded in %.0f ms", (int)process->pid,
           (unsigned long long)process->version, process->load_ms);
    if (ready->new_threads)
        sv_log(SV_LOG_WARNING, "scene threads", "loading left %u threads running: workers may hang",
               ready->new_threads);
    sv_crew_start(&process->crew, process->control_fd);
    scenes->events.serving(scenes->crew.events.context);
    if (old) {
        old->leaving = true;
        sv_crew_dismiss(&old->crew);
        leave_if_alone(old);
    }
}

static void on_ready(struct sv_scene_process *process, const struct sv_wire_ready *ready, int fd)
{
    process->facts = fd >= 0 ? sv_wire_read_text(fd, ready->facts_bytes, FACTS_BYTES_MAX) : NULL;
    if (fd >= 0)
        close(fd);
    if (process != process->all->loading || !process->facts) {
        sv_log(SV_LOG_ERROR, "scene process", "process %d said ready at the wrong time or without facts",
               (int)process->pid);
        end_process(process);
        return;
    }
    becomes_serving(process, ready);
}

/* The serving process has forked its successor, or could not: then our end of the socket tells that it is
 * closed. */
static void on_followed(struct sv_scenes *scenes, const struct sv_wire_followed *followed)
{
    struct sv_scene_process *p = scenes->processes;
    while (p && (p->patch == 0 || p->patch != followed->head.id))
        p = p->next;
    if (p && followed->pid > 0)
        p->pid = followed->pid;
    else if (p)
        sv_errors_add(&p->reasons, SV_EINTERNAL, "", "no process for the patched scene: %s",
                      strerror(followed->error_number));
}

static void on_facts(struct sv_scene_process *process, const struct sv_wire_facts *message, int fd)
{
    char *facts = fd >= 0 ? sv_wire_read_text(fd, message->facts_bytes, FACTS_BYTES_MAX) : NULL;
    if (facts) {
        free(process->facts);
        process->facts = facts;
    }
}

/* The daemon lists and drops panels; without the memory it has none to tell of. */
static void on_cells(struct sv_scene_process *process, const struct sv_wire_cells *message, int fd)
{
    struct sv_error error;
    if (fd < 0 || process->cells.cache)
        return;
    if (sv_cells_memory_open(fd, message->bytes, &process->cells, &error) != SV_OK)
        sv_log(SV_LOG_WARNING, "cells", "process %d: %s", (int)process->pid, error.message);
}

/* A descriptor that came with a message that has no use for it is closed. */
static void take_message(struct sv_scene_process *process, const union sv_wire_message *message, int fd)
{
    switch ((enum sv_wire_type)message->head.type) {
    case SV_WIRE_READY:
        on_ready(process, &message->ready, fd);
        return;
    case SV_WIRE_FACTS:
        on_facts(process, &message->facts, fd);
        break;
    case SV_WIRE_CELLS:
        on_cells(process, &message->cells, fd);
        break;
    case SV_WIRE_FORKED:
        sv_crew_forked(&process->crew, &message->forked, fd);
        return;
    case SV_WIRE_REASON:
        sv_errors_add(&process->reasons, sv_wire_status((uint32_t)message->reason.error.code),
                      message->reason.error.field, "%s", message->reason.error.message);
        break;
    case SV_WIRE_FAILED:
        process->failed = true;
        process->reasons.total = message->failed.total;
        break;
    case SV_WIRE_EXITED:
        sv_crew_exited(&process->crew, &message->exited);
        leave_if_alone(process);
        break;
    case SV_WIRE_FOLLOWED:
        on_followed(process->all, &message->followed);
        break;
    case SV_WIRE_PATCHED:
        free(process->change);
        process->change = malloc(sizeof *process->change);
        if (process->change)
            *process->change = message->patched.change;
        process->patch_ms = message->patched.ms;
        break;
    case SV_WIRE_FORK:
    case SV_WIRE_PATCH:
    case SV_WIRE_PATCH_TEXT:
    case SV_WIRE_RESOLVE:
    case SV_WIRE_RESOLVED:
    case SV_WIRE_VIEW:
    case SV_WIRE_DRAWN:
    case SV_WIRE_BUILD:
    case SV_WIRE_BUILT:
    case SV_WIRE_REFINE:
    case SV_WIRE_REFINED:
    case SV_WIRE_STOP:
    case SV_WIRE_TYPE_COUNT:
        sv_log(SV_LOG_ERROR, "scene process", "process %d said what only others say", (int)process->pid);
        end_process(process);
        break;
    }
    if (fd >= 0)
        close(fd);
}

/* False when there is nothing (more) to take. */
static bool receive_one(struct sv_scene_process *process)
{
    union sv_wire_message message;
    struct sv_error error;
    int fd = -1;
    if (process->control_fd < 0)
        return false;
    enum sv_status status = sv_wire_receive(process->control_fd, &message, &fd, &error);
    if (status == SV_OK)
        take_message(process, &message, fd);
    if (status == SV_OK || status == SV_ETIMEOUT)
        return status == SV_OK;
    if (status != SV_ENOENT)
        sv_log(SV_LOG_ERROR, "scene process", "process %d: %s", (int)process->pid, error.message);
    close_control(process); /* it is ending: what follows is done when it is reaped */
    return false;
}

static void describe_death(int status, char *text, size_t size)
{
    if (WIFSIGNALED(status))
        snprintf(text, size, "the scene process ended by signal %d (%s)", WTERMSIG(status),
                 strsignal(WTERMSIG(status)));
    else if (WEXITSTATUS(status) == 127)
        snprintf(text, size, "the scene program could not be started");
    else
        snprintf(text, size, "the scene process ended with status %d", WEXITSTATUS(status));
}

static void schedule_restart(struct sv_scenes *scenes)
{
    unsigned n = scenes->early_deaths++;
    double pause_ms = n ? pause_first_ms * (double)(1u << (n < 10 ? n - 1 : 9)) : 0;
    pause_ms = pause_ms < pause_most_ms ? pause_ms : pause_most_ms;
    if (sv_loop_arm(scenes->loop, &scenes->restart, sv_loop_now_ms() + pause_ms) != SV_OK)
        sv_log(SV_LOG_ERROR, "scene", "out of memory: the scene process is not started again");
}

static void process_ended(struct sv_scene_process *process, int status)
{
    struct sv_scenes *scenes = process->all;
    char why[256];
    bool was_loading = scenes->loading == process;
    while (receive_one(process)) /* its last words may still be in the socket */
        ;
    describe_death(status, why, sizeof why);
    bool was_serving = scenes->serving == process;
    scenes->serving = was_serving ? NULL : scenes->serving;
    scenes->loading = was_loading ? NULL : scenes->loading;
    close_control(process);
    sv_crew_abandon(&process->crew);
    if (scenes->stopping)
        return;
    bool has_reasons = process->reasons.count > 0;
    if (was_loading && process->patch && !process->ready) {
        give_back_cells(scenes->serving);
        if (!has_reasons)
            sv_errors_add(&process->reasons, SV_EINTERNAL, "", "%s", why);
        sv_log(SV_LOG_INFO, "patch refused", "%zu reasons, the first: %s: %s", process->reasons.total,
               process->reasons.items[0].field, process->reasons.items[0].message);
        scenes->events.failed(scenes->crew.events.context, &process->reasons, false);
    } else if (was_loading && !process->ready) {
        if (!has_reasons)
            sv_errors_add(&process->reasons, SV_EINTERNAL, "", "%s", why);
        snprintf(scenes->last_failure, sizeof scenes->last_failure, "%s%s%s", process->reasons.items[0].field,
                 process->reasons.items[0].field[0] ? ": " : "", process->reasons.items[0].message);
        sv_metrics_count(scenes->metrics, SV_COUNT_SCENE_FAILED);
        sv_log(SV_LOG_ERROR, "scene failed", "%s; %zu reasons, the first: %s", why, process->reasons.total,
               scenes->last_failure);
        scenes->events.failed(scenes->crew.events.context, &process->reasons,
                              !scenes->has_served && has_reasons);
    } else if (was_serving) {
        snprintf(scenes->last_failure, sizeof scenes->last_failure, "%s", why);
        sv_metrics_count(scenes->metrics, SV_COUNT_SCENE_DIED);
        sv_log(SV_LOG_ERROR, "scene lost", "process %d: %s%s", (int)process->pid, why,
               process->patch ? "; its patches are lost" : "");
        scenes->events.lost(scenes->crew.events.context);
    }
    if (!scenes->serving && !scenes->loading && !scenes->restart.place)
        schedule_restart(scenes);
}

static void forget(struct sv_scene_process *process)
{
    struct sv_scene_process **at = &process->all->processes;
    while (*at != process)
        at = &(*at)->next;
    *at = process->next;
    sv_errors_finish(&process->reasons);
    free(process->facts);
    sv_cells_memory_close(&process->cells);
    free(process->change);
    free(process);
}

/* A process whose socket is closed is made to end, and its end is told when it is reaped: at once, when it is
 * gone already or was never there. */
static void on_control(void *context, uint32_t events)
{
    struct sv_scene_process *process = context;
    (void)events;
    if (receive_one(process) || process->control_fd >= 0)
        return;
    if (process->pid > 0 && kill(process->pid, SIGKILL) == 0)
        return;
    process_ended(process, 0);
    forget(process);
}

void sv_scenes_reap(struct sv_scenes *scenes)
{
    int status;
    pid_t pid;
    while ((pid = waitpid(-1, &status, WNOHANG)) > 0) {
        struct sv_scene_process *process = scenes->processes;
        while (process && process->pid != pid)
            process = process->next;
        if (!process)
            continue; /* a worker whose scene process is gone */
        process_ended(process, status);
        forget(process);
    }
}

void sv_scenes_kill_work(struct sv_scenes *scenes, const void *work, const char *why)
{
    for (struct sv_scene_process *p = scenes->processes; p; p = p->next)
        sv_crew_kill(&p->crew, work, why);
}

void sv_scenes_finish(struct sv_scenes *scenes)
{
    int status;
    scenes->stopping = true;
    if (!scenes->loop)
        return;
    sv_loop_disarm(scenes->loop, &scenes->restart);
    for (struct sv_scene_process *p = scenes->processes; p; p = p->next)
        end_process(p);
    while (scenes->processes) {
        struct sv_scene_process *process = scenes->processes;
        status = 0;
        if (process->pid > 0)
            waitpid(process->pid, &status, 0);
        process_ended(process, status);
        forget(process);
    }
    while (waitpid(-1, &status, 0) > 0 || errno == EINTR) /* workers, which die with their scene process */
        ;
}
