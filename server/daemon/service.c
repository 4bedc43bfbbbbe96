#include "server/daemon/service.h"

#include <dirent.h>
#include <errno.h>
#include <math.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/epoll.h>
#include <sys/resource.h>
#include <sys/signalfd.h>
#include <unistd.h>

#include "server/daemon/pages.h"
#include "server/daemon/reply.h"
#include "server/daemon/routes.h"
#include "server/daemon/views.h"
#include "server/log.h"

enum { REFUSED_VIEWS_MAX = 1024, TEXT_FILE_MAX = 1 << 20, DESCRIPTORS_SPARE = 256 };
static const double drain_look_ms = 10, drain_last_words_ms = 250;

size_t sv_service_descriptors(void)
{
    size_t count = 0;
    DIR *folder = opendir("/proc/self/fd");
    while (folder && readdir(folder))
        count++;
    if (folder)
        closedir(folder);
    return count > 3 ? count - 3 : 0; /* ".", ".." and the folder itself */
}

int sv_service_scene_retry_s(const struct sv_service *service)
{
    const struct sv_scenes *scenes = &service->scenes;
    double now = sv_loop_now_ms(), wait_ms = 1000;
    if (scenes->restart.place)
        wait_ms += scenes->restart.at_ms - now;
    double s = ceil(wait_ms * 1e-3);
    return s < 1 ? 1 : s > 60 ? 60 : (int)s;
}

bool sv_service_ready(const struct sv_service *service, enum sv_problem_kind *kind, char *why, size_t size)
{
    const struct sv_scenes *scenes = &service->scenes;
    if (service->draining) {
        *kind = SV_PROBLEM_DRAINING;
        snprintf(why, size, "the service is shutting down");
        return false;
    }
    if (!scenes->serving) {
        *kind = SV_PROBLEM_NOT_READY;
        snprintf(why, size, "%s%s%s", scenes->loading ? "the scene is being loaded" : "no scene is loaded",
                 scenes->last_failure[0] ? "; before that: " : "", scenes->last_failure);
        return false;
    }
    if (sv_queue_full(&service->queue)) {
        *kind = SV_PROBLEM_OVERLOADED;
        snprintf(why, size, "%zu jobs wait, the limit is %zu", service->queue.count, service->queue.limit);
        return false;
    }
    return true;
}

/* ---- the scene's fate ---- */

static void load_again(struct sv_service *service)
{
    struct sv_error error;
    if (!service->reload_again)
        return;
    service->reload_again = false;
    if (sv_scenes_load(&service->scenes, &error) != SV_OK)
        sv_log(SV_LOG_ERROR, "reload", "%s", error.message);
}

static void on_serving(void *context)
{
    struct sv_service *service = context;
    sv_views_rebind(service);
    sv_page_scene_done(service, NULL);
    load_again(service);
}

static void on_failed(void *context, const struct sv_errors *reasons, bool first)
{
    struct sv_service *service = context;
    for (size_t i = 0; i < reasons->count; i++) {
        struct sv_log_line line;
        sv_log_begin(&line, SV_LOG_ERROR, "scene reason");
        sv_log_text(&line, "field", reasons->items[i].field);
        sv_log_text(&line, "message", reasons->items[i].message);
        sv_log_end(&line);
    }
    sv_page_scene_done(service, reasons);
    if (first) {
        service->exit_status = EXIT_FAILURE;
        sv_loop_stop(service->loop);
        return;
    }
    load_again(service);
}

static void on_lost(void *context)
{
    (void)context; /* what waited goes on waiting: the next scene process takes it over */
}

/* ---- requests ---- */

static void handle(void *context, struct sv_exchange *exchange)
{
    sv_routes_dispatch(context, exchange);
}

static void refuse(void *context, struct sv_exchange *exchange, enum sv_problem_kind kind, const char *detail)
{
    (void)context;
    sv_reply_problem(exchange, kind, detail);
}

/* ---- signals and the end ---- */

static void give_up_one(void *context, struct sv_exchange *exchange)
{
    (void)context;
    exchange->gone = NULL;
    sv_reply_problem(exchange, SV_PROBLEM_DRAINING, NULL);
}

static void give_up_all(struct sv_service *service)
{
    sv_views_give_up(service, SV_PROBLEM_DRAINING, "the service is shutting down");
    service->scene_waiter = NULL;
    sv_http_each_kept(service->http, give_up_one, NULL);
}

static void look_at_drain(void *context)
{
    struct sv_service *service = context;
    double now = sv_loop_now_ms(), end = service->drain_until_ms;
    if (sv_http_active(service->http) == 0 || now >= end + drain_last_words_ms) {
        sv_loop_stop(service->loop);
        return;
    }
    if (now >= end)
        give_up_all(service);
    if (sv_loop_arm(service->loop, &service->drain_look, now + drain_look_ms) != SV_OK)
        sv_loop_stop(service->loop);
}

static void drain(struct sv_service *service)
{
    if (service->draining) { /* asked twice: at once */
        sv_loop_stop(service->loop);
        return;
    }
    sv_log(SV_LOG_INFO, "drain", "no new connections; %zu requests are under way",
           sv_http_active(service->http));
    service->draining = true;
    service->drain_until_ms = sv_loop_now_ms() + (double)service->settings->drain_ms;
    sv_http_drain(service->http);
    look_at_drain(service);
}

static void reload(struct sv_service *service)
{
    struct sv_error error;
    if (service->scenes.loading)
        service->reload_again = true;
    else if (!service->draining && sv_scenes_load(&service->scenes, &error) != SV_OK)
        sv_log(SV_LOG_ERROR, "reload", "%s", error.message);
}

static void on_signal(void *context, uint32_t events)
{
    struct sv_service *service = context;
    struct signalfd_siginfo info;
    (void)events;
    while (read(service->signal_fd, &info, sizeof info) == (ssize_t)sizeof info) {
        if (info.ssi_signo == SIGCHLD)
            sv_scenes_reap(&service->scenes);
        else if (info.ssi_signo == SIGHUP)
            reload(service);
        else
            drain(service);
    }
}

static enum sv_status watch_signals(struct sv_service *service, struct sv_error *error)
{
    sigset_t set;
    sigemptyset(&set);
    sigaddset(&set, SIGCHLD);
    sigaddset(&set, SIGHUP);
    sigaddset(&set, SIGTERM);
    sigaddset(&set, SIGINT);
    signal(SIGPIPE, SIG_IGN);
    sigprocmask(SIG_BLOCK, &set, NULL);
    service->signal_fd = signalfd(-1, &set, SFD_CLOEXEC | SFD_NONBLOCK);
    if (service->signal_fd < 0)
        return sv_fail(error, SV_EIO, "signals", "%s", strerror(errno));
    return sv_loop_watch(service->loop, service->signal_fd, EPOLLIN, on_signal, service,
                         &service->signal_watch, error);
}

/* ---- start and stop ---- */

static void raise_descriptor_limit(const struct sv_settings *settings)
{
    struct rlimit limit;
    rlim_t wanted = (rlim_t)settings->connections + (rlim_t)settings->queue_limit + DESCRIPTORS_SPARE;
    if (getrlimit(RLIMIT_NOFILE, &limit) || limit.rlim_cur >= wanted)
        return;
    limit.rlim_cur = wanted < limit.rlim_max ? wanted : limit.rlim_max;
    if (setrlimit(RLIMIT_NOFILE, &limit) || limit.rlim_cur < wanted)
        sv_log(SV_LOG_WARNING, "descriptors",
               "%llu are allowed, %llu may be needed for that many connections",
               (unsigned long long)limit.rlim_cur, (unsigned long long)wanted);
}

static enum sv_status read_text(const char *path, const char *key, char **text, struct sv_error *error)
{
    FILE *file = fopen(path, "re");
    char *bytes = file ? calloc(1, TEXT_FILE_MAX) : NULL;
    size_t got = bytes ? fread(bytes, 1, TEXT_FILE_MAX - 1, file) : 0;
    int saved = errno;
    if (file)
        fclose(file);
    if (!got) {
        free(bytes);
        return sv_fail(error, SV_ENOENT, key, "%s: %s", path, file ? "empty or unreadable" : strerror(saved));
    }
    *text = bytes;
    return SV_OK;
}

static enum sv_status start_http(struct sv_service *service, struct sv_error *error)
{
    const struct sv_settings *s = service->settings;
    char *cert = NULL, *key = NULL;
    enum sv_status status = s->tls_cert[0] ? read_text(s->tls_cert, "tls_cert", &cert, error) : SV_OK;
    if (status == SV_OK && s->tls_key[0])
        status = read_text(s->tls_key, "tls_key", &key, error);
    if (status == SV_OK) {
        struct sv_http_options options = {.loop = service->loop,
                                          .metrics = &service->metrics,
                                          .settings = s,
                                          .tls_cert = cert,
                                          .tls_key = key,
                                          .handler = handle,
                                          .refuse = refuse,
                                          .context = service};
        status = sv_http_create(&options, &service->http, error);
    }
    if (key)
        explicit_bzero(key, strlen(key));
    free(cert);
    free(key);
    return status;
}

static enum sv_status start_stores(struct sv_service *service, struct sv_error *error)
{
    const struct sv_settings *s = service->settings;
    sv_queue_init(&service->queue, (size_t)s->queue_limit);
    service->memo = sv_memo_create((size_t)s->resolve_cache_entries);
    service->pictures = sv_pictures_create((uint64_t)s->picture_cache_mb << 20);
    service->refused = sv_lru_create(REFUSED_VIEWS_MAX, NULL);
    if (!service->memo || !service->pictures || !service->refused)
        return sv_fail(error, SV_ENOMEM, "", "out of memory");
    return sv_slab_pool_create((uint64_t)s->slab_budget_mb << 20, &service->slabs, error);
}

enum sv_status sv_service_start(struct sv_service *service, const struct sv_settings *settings,
                                struct sv_error *error)
{
    static const struct sv_scenes_events scenes_events = {on_serving, on_failed, on_lost};
    static const struct sv_crew_events crew_events = {
        .idle = sv_views_idle, .resolved = sv_views_resolved, .drawn = sv_views_drawn, .lost = sv_views_lost,
        .built = sv_ahead_built, .build_lost = sv_ahead_lost, .refined = sv_refine_done, .refine_lost = sv_refine_lost};
    service->settings = settings;
    service->started_ms = sv_loop_now_ms();
    service->signal_fd = -1;
    service->limits =
        (struct sv_api_view_limits){.pixels_max = (uint64_t)settings->max_pixels,
                                    .sample_pixels_max = (uint64_t)settings->max_samples_pixels};
    service->pump = (struct sv_timer){.due = sv_views_pump, .context = service};
    sv_refine_init(service);
    service->drain_look = (struct sv_timer){.due = look_at_drain, .context = service};
    raise_descriptor_limit(settings);
    enum sv_status status = sv_loop_create(&service->loop, error);
    if (status == SV_OK)
        status = start_stores(service, error);
    if (status == SV_OK)
        status = watch_signals(service, error);
    if (status == SV_OK)
        status = sv_scenes_init(&service->scenes, service->loop, &service->metrics, settings, &scenes_events,
                                &crew_events, service, error);
    if (status == SV_OK)
        status = start_http(service, error);
    if (status == SV_OK)
        status = sv_scenes_load(&service->scenes, error);
    if (status != SV_OK)
        sv_service_stop(service);
    return status;
}

int sv_service_run(struct sv_service *service)
{
    struct sv_error error;
    if (sv_loop_run(service->loop, &error) != SV_OK) {
        sv_log(SV_LOG_ERROR, "loop", "%s", error.message);
        service->exit_status = EXIT_FAILURE;
    }
    return service->exit_status;
}

void sv_service_stop(struct sv_service *service)
{
    if (service->http)
        give_up_all(service);
    sv_http_destroy(service->http);
    sv_scenes_finish(&service->scenes);
    sv_ahead_clear(service);
    sv_refine_clear(service);
    if (service->loop) {
        sv_loop_unwatch(service->loop, service->signal_watch);
        sv_loop_disarm(service->loop, &service->pump);
        sv_loop_disarm(service->loop, &service->drain_look);
    }
    if (service->signal_fd >= 0)
        close(service->signal_fd);
    sv_pictures_destroy(service->pictures);
    sv_memo_destroy(service->memo);
    sv_lru_destroy(service->refused);
    sv_slab_pool_destroy(service->slabs);
    sv_loop_destroy(service->loop);
}
