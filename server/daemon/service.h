/* service.h - the daemon as a whole: what its parts share, how it starts, reloads, drains and ends. One
 * thread. */
#ifndef SV_SERVER_SERVICE_H
#define SV_SERVER_SERVICE_H

#include <stdbool.h>

#include "api/view_parse.h"
#include "server/daemon/ahead.h"
#include "server/daemon/flight.h"
#include "server/daemon/http.h"
#include "server/daemon/loop.h"
#include "server/daemon/lru.h"
#include "server/daemon/memo.h"
#include "server/daemon/metrics.h"
#include "server/daemon/pictures.h"
#include "server/daemon/queue.h"
#include "server/daemon/refine.h"
#include "server/daemon/scenes.h"
#include "server/daemon/settings.h"
#include "server/slab.h"

struct sv_service {
    const struct sv_settings *settings;
    struct sv_loop *loop;
    struct sv_http *http;
    struct sv_metrics metrics;
    struct sv_scenes scenes;
    struct sv_queue queue;
    struct sv_flights flights;
    struct sv_ahead ahead;
    struct sv_refine refine;
    struct sv_memo *memo;
    struct sv_pictures *pictures;
    struct sv_slab_pool *slabs;
    struct sv_lru *refused; /* views that killed two workers */
    struct sv_api_view_limits limits;
    struct sv_timer pump; /* hands waiting work to idle workers, once the event at hand is done */
    struct sv_timer drain_look;
    double drain_until_ms;
    struct sv_watch *signal_watch;
    int signal_fd;
    struct sv_exchange *scene_waiter; /* POST /v1/scene/reload or PATCH /v1/scene that waits; NULL */
    bool waiter_patches;
    bool reload_again; /* SIGHUP while loading: load once more */
    double started_ms;
    bool draining;
    int exit_status;
};

/* Starts everything; service is the caller's zeroed memory. On failure what was started is stopped. */
SV_MUST_CHECK enum sv_status sv_service_start(struct sv_service *service, const struct sv_settings *settings,
                                              struct sv_error *error);
/* Serves until it is told to end; the process's exit status. */
int sv_service_run(struct sv_service *service);
void sv_service_stop(struct sv_service *service);

/* Does the service answer views now? Writes why not. */
bool sv_service_ready(const struct sv_service *service, enum sv_problem_kind *kind, char *why, size_t size);
/* Seconds after which a scene can be expected, when none serves. */
int sv_service_scene_retry_s(const struct sv_service *service);

/* Open descriptors of this process. */
size_t sv_service_descriptors(void);

#endif
