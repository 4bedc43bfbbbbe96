#include "server/daemon/workers.h"

#include <errno.h>
#include <fcntl.h>
#include <signal.h>
#include <stdlib.h>
#include <string.h>
#include <sys/epoll.h>
#include <sys/socket.h>
#include <sys/syscall.h>
#include <sys/wait.h>
#include <unistd.h>

#include "server/log.h"

/* Pauses before a dead worker is replaced, while none finishes a job: 50 ms doubling to 5 s. */
static const double pause_first_ms = 50, pause_most_ms = 5000;

static uint64_t next_id = 1; /* of workers and jobs: never used twice in one daemon */

static void refill(void *context);

void sv_crew_init(struct sv_crew *crew, const struct sv_crew_options *options)
{
    *crew = (struct sv_crew){.options = *options, .control_fd = -1};
    crew->refill = (struct sv_timer){.due = refill, .context = crew};
}

static void unlink_worker(struct sv_worker *worker)
{
    struct sv_worker **at = &worker->crew->workers;
    while (*at != worker)
        at = &(*at)->next;
    *at = worker->next;
}

static void close_socket(struct sv_worker *worker)
{
    sv_loop_unwatch(worker->crew->options.loop, worker->fd_watch);
    worker->fd_watch = NULL;
    if (worker->fd >= 0)
        close(worker->fd);
    worker->fd = -1;
}

static void free_worker(struct sv_worker *worker)
{
    close_socket(worker);
    sv_loop_unwatch(worker->crew->options.loop, worker->pid_watch);
    if (worker->pidfd >= 0)
        close(worker->pidfd);
    unlink_worker(worker);
    free(worker);
}

static void kill_process(struct sv_worker *worker)
{
    if (worker->pidfd >= 0)
        syscall(SYS_pidfd_send_signal, worker->pidfd, SIGKILL, NULL, 0);
}

static void schedule_refill(struct sv_crew *crew)
{
    double pause_ms = 0;
    if (crew->early_deaths) {
        unsigned doublings = crew->early_deaths - 1 < 10 ? crew->early_deaths - 1 : 10;
        pause_ms = pause_first_ms * (double)(1u << doublings);
    }
    if (!crew->dismissed && !crew->refill.place &&
        sv_loop_arm(crew->options.loop, &crew->refill,
                    sv_loop_now_ms() + (pause_ms < pause_most_ms ? pause_ms : pause_most_ms)) != SV_OK)
        sv_log(SV_LOG_ERROR, "workers", "out of memory: a dead worker is not replaced");
}

/* The job's slab may still be written by a process that is dying: its memory goes with that process. */
static void drop_slab(struct sv_worker *worker)
{
    sv_slab_discard(worker->slab);
    worker->slab = NULL;
}

/* The worker is dying, or what it says cannot be trusted. Its work stays with it until it is known why: the
 * scene process reaps those who died by themselves and says so (sv_crew_exited); when that one died first,
 * nobody does (sv_crew_abandon). */
static void worker_lost(struct sv_worker *worker, const char *why)
{
    if (worker->state == SV_WORKER_LEAVING)
        return;
    sv_log(SV_LOG_DEBUG, "worker lost", "worker %d: %s", (int)worker->pid, why);
    worker->state = SV_WORKER_LEAVING;
    close_socket(worker);
    kill_process(worker);
    drop_slab(worker);
}

static void on_pid(void *context, uint32_t events)
{
    struct sv_worker *worker = context;
    (void)events;
    sv_loop_unwatch(worker->crew->options.loop, worker->pid_watch);
    worker->pid_watch = NULL;
    worker_lost(worker, "it ended");
}

static void leave(struct sv_worker *worker)
{
    worker->state = SV_WORKER_LEAVING;
    worker->told = true;
    close_socket(worker); /* it reads the end and leaves by itself */
}

static void job_done(struct sv_worker *worker)
{
    struct sv_crew *crew = worker->crew;
    const struct sv_crew_options *o = &crew->options;
    crew->early_deaths = 0;
    worker->state = SV_WORKER_IDLE;
    worker->work = NULL;
    worker->slab = NULL;
    bool worn = (o->views_max && worker->views >= o->views_max) ||
                (o->own_bytes_max && worker->own_bytes >= o->own_bytes_max);
    if (crew->dismissed) {
        leave(worker);
    } else if (worn) {
        sv_log(SV_LOG_INFO, "worker retired", "worker %d: %llu views, %llu bytes of its own",
               (int)worker->pid, (unsigned long long)worker->views, (unsigned long long)worker->own_bytes);
        sv_metrics_count(o->metrics, SV_COUNT_WORKER_RETIRED);
        leave(worker);
        schedule_refill(crew);
    }
}

static void take_answer(struct sv_worker *worker, const union sv_wire_message *message)
{
    const struct sv_crew_events *events = &worker->crew->options.events;
    void *work = worker->work;
    struct sv_slab *slab = worker->slab;
    uint64_t job = worker->job;
    if (worker->state != SV_WORKER_BUSY || message->head.id != job || message->head.type != worker->awaits) {
        worker_lost(worker, "it answered what it was not asked");
        return;
    }
    if (worker->awaits == SV_WIRE_DRAWN) {
        worker->views++;
        worker->own_bytes = message->drawn.own_bytes;
    } else if (worker->awaits == SV_WIRE_BUILT) {
        worker->own_bytes = message->built.own_bytes;
    } else if (worker->awaits == SV_WIRE_REFINED) {
        worker->own_bytes = message->refined.own_bytes;
    }
    job_done(worker);
    if (message->head.type == SV_WIRE_DRAWN)
        events->drawn(events->context, work, &message->drawn, slab, job);
    else if (message->head.type == SV_WIRE_BUILT)
        events->built(events->context, work, &message->built);
    else if (message->head.type == SV_WIRE_REFINED)
        events->refined(events->context, work, &message->refined);
    else
        events->resolved(events->context, work, &message->resolved);
    events->idle(events->context);
}

static void on_socket(void *context, uint32_t events)
{
    struct sv_worker *worker = context;
    union sv_wire_message message;
    struct sv_error error;
    int passed_fd = -1;
    (void)events;
    enum sv_status status = sv_wire_receive(worker->fd, &message, &passed_fd, &error);
    if (passed_fd >= 0)
        close(passed_fd);
    if (status == SV_ETIMEOUT)
        return;
    if (status != SV_OK)
        worker_lost(worker, error.message);
    else
        take_answer(worker, &message);
}

/* Asks the scene process for one more. */
static bool ask(struct sv_crew *crew)
{
    union sv_wire_message message;
    struct sv_error error;
    int pair[2];
    struct sv_worker *worker = calloc(1, sizeof *worker);
    if (!worker || socketpair(AF_UNIX, SOCK_SEQPACKET | SOCK_CLOEXEC, 0, pair)) {
        sv_log(SV_LOG_ERROR, "workers", "a socket for a worker: %s", strerror(errno));
        free(worker);
        return false;
    }
    *worker =
        (struct sv_worker){.next = crew->workers, .crew = crew, .id = next_id++, .fd = pair[0], .pidfd = -1};
    crew->workers = worker;
    fcntl(worker->fd, F_SETFL, O_NONBLOCK);
    sv_wire_init(&message, SV_WIRE_FORK, worker->id);
    enum sv_status status =
        sv_loop_watch(crew->options.loop, worker->fd, EPOLLIN, on_socket, worker, &worker->fd_watch, &error);
    if (status == SV_OK)
        status = sv_wire_send(crew->control_fd, &message, pair[1], &error);
    close(pair[1]);
    if (status != SV_OK) {
        sv_log(SV_LOG_WARNING, "workers", "asking for a worker: %s", error.message);
        free_worker(worker);
        return false;
    }
    return true;
}

static void refill(void *context)
{
    struct sv_crew *crew = context;
    size_t count = 0;
    if (crew->dismissed || crew->control_fd < 0)
        return;
    for (struct sv_worker *w = crew->workers; w; w = w->next)
        count += w->state != SV_WORKER_LEAVING;
    for (; count < crew->options.size; count++)
        if (!ask(crew)) {
            crew->early_deaths++;
            schedule_refill(crew);
            return;
        }
}

void sv_crew_start(struct sv_crew *crew, int control_fd)
{
    crew->control_fd = control_fd;
    refill(crew);
}

struct sv_worker *sv_crew_find(struct sv_crew *crew, uint64_t id)
{
    struct sv_worker *w = crew->workers;
    while (w && w->id != id)
        w = w->next;
    return w;
}

void sv_crew_forked(struct sv_crew *crew, const struct sv_wire_forked *message, int pidfd)
{
    struct sv_error error;
    struct sv_worker *worker = sv_crew_find(crew, message->head.id);
    if (!worker || pidfd < 0) {
        if (pidfd >= 0)
            close(pidfd);
        sv_log(SV_LOG_ERROR, "workers", "the scene process cannot fork: %s", strerror(message->error_number));
        if (worker) {
            crew->early_deaths++;
            free_worker(worker);
            schedule_refill(crew);
        }
        return;
    }
    worker->pid = message->pid;
    worker->pidfd = pidfd;
    sv_metrics_count(crew->options.metrics, SV_COUNT_WORKER_STARTED);
    if (sv_loop_watch(crew->options.loop, pidfd, EPOLLIN, on_pid, worker, &worker->pid_watch, &error) !=
        SV_OK) {
        sv_log(SV_LOG_ERROR, "workers", "%s", error.message);
        worker_lost(worker, error.message);
        return;
    }
    if (worker->state == SV_WORKER_LEAVING) { /* died, or was dismissed, before we heard of it */
        kill_process(worker);
        return;
    }
    worker->state = SV_WORKER_IDLE;
    sv_log(SV_LOG_DEBUG, "worker started", "worker %d", (int)worker->pid);
    crew->options.events.idle(crew->options.events.context);
}

static void work_lost(struct sv_crew *crew, enum sv_wire_type awaited, void *work, bool by_itself)
{
    const struct sv_crew_events *events = &crew->options.events;
    if (work && awaited == SV_WIRE_BUILT)
        events->build_lost(events->context, work);
    else if (work && awaited == SV_WIRE_REFINED)
        events->refine_lost(events->context, work);
    else if (work)
        events->lost(events->context, work, by_itself);
}

void sv_crew_exited(struct sv_crew *crew, const struct sv_wire_exited *message)
{
    struct sv_worker *worker = crew->workers;
    int status = message->wait_status;
    while (worker && worker->pid != message->pid)
        worker = worker->next;
    if (!worker)
        return;
    worker_lost(worker, "it was reaped");
    void *work = worker->work;
    bool told = worker->told;
    enum sv_wire_type awaited = worker->awaits;
    free_worker(worker);
    if (!told) {
        const char *name = WIFSIGNALED(status) ? strsignal(WTERMSIG(status)) : "exit";
        sv_log(SV_LOG_WARNING, "worker died", "worker %d: %s %d%s", (int)message->pid, name,
               WIFSIGNALED(status) ? WTERMSIG(status) : WEXITSTATUS(status),
               work ? ", with a job in hand" : "");
        sv_metrics_count(crew->options.metrics, SV_COUNT_WORKER_DIED);
        crew->early_deaths++;
    }
    schedule_refill(crew);
    work_lost(crew, awaited, work, true);
}

static void stop(struct sv_worker *worker)
{
    union sv_wire_message message;
    struct sv_error error;
    if (worker->state != SV_WORKER_BUSY || worker->awaits != SV_WIRE_REFINED || worker->stopped)
        return;
    sv_wire_init(&message, SV_WIRE_STOP, worker->job);
    worker->stopped = sv_wire_send(worker->fd, &message, -1, &error) == SV_OK;
    if (!worker->stopped)
        worker_lost(worker, error.message);
}

void sv_crew_stop(struct sv_crew *crew, const void *work)
{
    struct sv_worker *w = crew->workers;
    while (w && w->work != work)
        w = w->next;
    if (w)
        stop(w);
}

void sv_crew_dismiss(struct sv_crew *crew)
{
    crew->dismissed = true;
    sv_loop_disarm(crew->options.loop, &crew->refill);
    for (struct sv_worker *w = crew->workers; w; w = w->next)
        if (w->state == SV_WORKER_IDLE || w->state == SV_WORKER_FORKING)
            leave(w);
        else
            stop(w);
}

void sv_crew_abandon(struct sv_crew *crew)
{
    crew->control_fd = -1;
    crew->dismissed = true;
    sv_loop_disarm(crew->options.loop, &crew->refill);
    while (crew->workers) {
        struct sv_worker *worker = crew->workers;
        void *work = worker->work;
        enum sv_wire_type awaited = worker->awaits;
        kill_process(worker);
        drop_slab(worker);
        free_worker(worker);
        work_lost(crew, awaited, work, false);
    }
}

struct sv_worker *sv_crew_idle(struct sv_crew *crew)
{
    struct sv_worker *w = crew->workers;
    while (w && w->state != SV_WORKER_IDLE)
        w = w->next;
    return w;
}

size_t sv_crew_alive(const struct sv_crew *crew)
{
    size_t count = 0;
    for (const struct sv_worker *w = crew->workers; w; w = w->next)
        count += w->state == SV_WORKER_IDLE || w->state == SV_WORKER_BUSY;
    return count;
}

size_t sv_crew_busy(const struct sv_crew *crew)
{
    size_t count = 0;
    for (const struct sv_worker *w = crew->workers; w; w = w->next)
        count += w->state == SV_WORKER_BUSY;
    return count;
}

size_t sv_crew_idle_count(const struct sv_crew *crew)
{
    size_t count = 0;
    for (const struct sv_worker *w = crew->workers; w; w = w->next)
        count += w->state == SV_WORKER_IDLE;
    return count;
}

uint64_t sv_crew_own_bytes(const struct sv_crew *crew)
{
    uint64_t bytes = 0;
    for (const struct sv_worker *w = crew->workers; w; w = w->next)
        bytes += w->own_bytes;
    return bytes;
}

static bool hand_over(struct sv_worker *worker, const union sv_wire_message *message, enum sv_wire_type awaits,
                      int slab_fd, void *work)
{
    struct sv_error error;
    if (sv_wire_send(worker->fd, message, slab_fd, &error) != SV_OK) {
        worker_lost(worker, error.message);
        return false;
    }
    worker->state = SV_WORKER_BUSY;
    worker->job = message->head.id;
    worker->awaits = awaits;
    worker->stopped = false;
    worker->slab = NULL;
    worker->work = work;
    return true;
}

bool sv_worker_resolve(struct sv_worker *worker, const struct sv_view_request *request, void *work)
{
    union sv_wire_message message;
    sv_wire_init(&message, SV_WIRE_RESOLVE, next_id++);
    message.resolve.request = *request;
    return hand_over(worker, &message, SV_WIRE_RESOLVED, -1, work);
}

static bool draw(struct sv_worker *worker, const struct sv_view_request *request,
                 const struct sv_resolved_view *view, int epsg, const struct sv_worker_band *band,
                 const struct sv_slab *slab, void *work)
{
    union sv_wire_message message;
    sv_wire_init(&message, SV_WIRE_VIEW, next_id++);
    message.view.request = *request;
    message.view.view = *view;
    message.view.epsg = epsg;
    message.view.band = band->index;
    message.view.bands = band->count;
    message.view.band_first = band->row_first;
    message.view.band_rows = band->row_count;
    return hand_over(worker, &message, SV_WIRE_DRAWN, sv_slab_fd(slab), work);
}

bool sv_worker_draw(struct sv_worker *worker, const struct sv_view_request *request,
                    const struct sv_resolved_view *view, int epsg, struct sv_slab *slab, void *work)
{
    const struct sv_worker_band whole = {.count = 1, .row_count = request->height};
    bool taken = draw(worker, request, view, epsg, &whole, slab, work);
    worker->slab = taken ? slab : NULL;
    return taken;
}

bool sv_worker_draw_band(struct sv_worker *worker, const struct sv_view_request *request,
                         const struct sv_resolved_view *view, int epsg, const struct sv_worker_band *band,
                         const struct sv_slab *slab, void *work)
{
    return draw(worker, request, view, epsg, band, slab, work);
}

bool sv_worker_build(struct sv_worker *worker, const struct sv_view_request *request, uint32_t most, void *work)
{
    union sv_wire_message message;
    sv_wire_init(&message, SV_WIRE_BUILD, next_id++);
    message.build.request = *request;
    message.build.most = most;
    return hand_over(worker, &message, SV_WIRE_BUILT, -1, work);
}

bool sv_worker_refine(struct sv_worker *worker, const struct sv_view_request *request, int samples, void *work)
{
    union sv_wire_message message;
    sv_wire_init(&message, SV_WIRE_REFINE, next_id++);
    message.refine.request = *request;
    message.refine.samples = samples;
    return hand_over(worker, &message, SV_WIRE_REFINED, -1, work);
}

void sv_crew_kill(struct sv_crew *crew, const void *work, const char *why)
{
    struct sv_worker *w = crew->workers;
    while (w && w->work != work)
        w = w->next;
    if (!w)
        return;
    w->work = NULL;
    if (w->state == SV_WORKER_LEAVING)
        return;
    w->told = true;
    sv_metrics_count(crew->options.metrics, SV_COUNT_WORKER_KILLED);
    sv_log(SV_LOG_WARNING, "worker killed", "worker %d: %s", (int)w->pid, why);
    worker_lost(w, why);
}
