/* metrics.h - what the service counts and how it is told to Prometheus (text format 0.0.4; seconds and
 * bytes).
 *
 * Counters and gauges come from one list each; histograms are kept a stage and a request. One thread. */
#ifndef SV_SERVER_METRICS_H
#define SV_SERVER_METRICS_H

#include <stddef.h>
#include <stdint.h>

#include "core/view/timings.h"

#define SV_COUNTER_LIST(X)                                                                                 \
    X(SV_COUNT_DRAWN, "views_drawn_total", "views drawn by a worker")                                      \
    X(SV_COUNT_RESOLVED, "views_resolved_total", "cameras resolved by a worker")                           \
    X(SV_COUNT_RESOLVE_HIT, "resolve_cache_hits_total", "cameras answered from memory")                    \
    X(SV_COUNT_PICTURE_HIT, "picture_cache_hits_total", "pictures answered from memory")                   \
    X(SV_COUNT_PICTURE_MISS, "picture_cache_misses_total", "pictures that memory did not have")            \
    X(SV_COUNT_COLLAPSED, "views_collapsed_total", "requests that joined an identical one in flight")      \
    X(SV_COUNT_NOT_MODIFIED, "views_not_modified_total", "conditional requests answered 304")              \
    X(SV_COUNT_QUEUE_FULL, "queue_refused_total", "requests refused because the queue was full")           \
    X(SV_COUNT_DEADLINE, "deadline_passed_total", "requests whose deadline passed")                        \
    X(SV_COUNT_CLIENT_GONE, "clients_gone_total", "clients that left before their answer")                 \
    X(SV_COUNT_NEVER_STARTED, "jobs_never_started_total",                                                  \
      "jobs dropped from the queue: nobody waited any more")                                               \
    X(SV_COUNT_WORKER_STARTED, "workers_started_total", "workers forked")                                  \
    X(SV_COUNT_WORKER_DIED, "workers_died_total", "workers that died by themselves")                       \
    X(SV_COUNT_WORKER_KILLED, "workers_killed_total", "workers killed for a deadline or a broken message") \
    X(SV_COUNT_WORKER_RETIRED, "workers_retired_total",                                                    \
      "workers replaced after their views or their memory mark")                                           \
    X(SV_COUNT_VIEW_REFUSED, "views_refused_total", "views refused because they had killed two workers")   \
    X(SV_COUNT_SCENE_STARTED, "scene_starts_total", "scene processes started")                             \
    X(SV_COUNT_SCENE_DIED, "scene_deaths_total", "scene processes that died by themselves")                \
    X(SV_COUNT_SCENE_FAILED, "scene_failures_total", "scene files that did not load")                      \
    X(SV_COUNT_CELL_HIT, "cells_hits_total", "relief panels that were there when a view wanted them")      \
    X(SV_COUNT_CELL_MISS, "cells_misses_total", "relief panels that were not")                             \
    X(SV_COUNT_CELL_WAIT, "cells_waits_total", "relief panels that another worker was building then")      \
    X(SV_COUNT_CELL_BUILT, "cells_builds_total", "relief panels built")                                    \
    X(SV_COUNT_CELL_REFINED, "cells_refined_total", "of these, refined ones")                              \
    X(SV_COUNT_CELL_EVICTED, "cells_evictions_total", "relief panels that made room for others")           \
    X(SV_COUNT_CELL_DROPPED, "cells_drops_total", "relief panels dropped by a call or a change")           \
    X(SV_COUNT_CELL_FULL, "cells_full_total", "relief panels that there was no room for")                  \
    X(SV_COUNT_CONNECTION_CUT, "connections_cut_total", "connections closed at a read or send deadline")

#define SV_GAUGE_LIST(X)                                                                                    \
    X(SV_GAUGE_READY, "ready", "1 when a scene serves, the queue has room and the service is not draining") \
    X(SV_GAUGE_QUEUE, "queue_length", "jobs that wait")                                                     \
    X(SV_GAUGE_QUEUE_LIMIT, "queue_limit", "jobs that may wait")                                            \
    X(SV_GAUGE_FLIGHTS, "flights", "distinct views waiting or being drawn")                                 \
    X(SV_GAUGE_WORKERS, "workers", "workers alive")                                                         \
    X(SV_GAUGE_WORKERS_BUSY, "workers_busy", "workers with a job")                                          \
    X(SV_GAUGE_WORKER_BYTES, "workers_own_bytes",                                                           \
      "memory that workers share with nobody, as of their last jobs")                                       \
    X(SV_GAUGE_PICTURES, "picture_cache_pictures", "pictures in memory")                                    \
    X(SV_GAUGE_PICTURE_BYTES, "picture_cache_bytes", "bytes of pictures in memory")                         \
    X(SV_GAUGE_RESOLVES, "resolve_cache_entries", "resolved cameras in memory")                             \
    X(SV_GAUGE_SLAB_BYTES, "slab_bytes", "shared memory reserved for pictures in transit")                  \
    X(SV_GAUGE_SLAB_LENT, "slab_lent_bytes", "of these, in use")                                            \
    X(SV_GAUGE_CELL_PANELS, "cells_panels", "relief panels and pages of refined shadow in memory")          \
    X(SV_GAUGE_CELL_BYTES, "cells_bytes", "bytes of relief panels in memory")                               \
    X(SV_GAUGE_CELL_BUDGET, "cells_budget_bytes", "bytes that relief panels may take")                      \
    X(SV_GAUGE_CELL_AHEAD, "cells_jobs_ahead", "jobs that build relief panels ahead")                       \
    X(SV_GAUGE_CELL_REFINE, "cells_jobs_refine", "views whose relief panels are to be refined")             \
    X(SV_GAUGE_CONNECTIONS, "connections", "open connections")                                              \
    X(SV_GAUGE_RESIDENT, "resident_bytes", "resident memory of the daemon")                                 \
    X(SV_GAUGE_DESCRIPTORS, "open_descriptors", "open descriptors of the daemon")                           \
    X(SV_GAUGE_SCENE_LOAD, "scene_load_seconds", "time that the serving scene took to load")                \
    X(SV_GAUGE_UPTIME, "uptime_seconds", "since the daemon started")                                        \
    X(SV_GAUGE_LOG_DROPPED, "log_lines_dropped", "log lines that nobody took")

enum sv_counter {
#define X(id, name, help) id,
    SV_COUNTER_LIST(X)
#undef X
        SV_COUNTER_COUNT
};
enum sv_gauge {
#define X(id, name, help) id,
    SV_GAUGE_LIST(X)
#undef X
        SV_GAUGE_COUNT
};

enum { SV_METRIC_BUCKETS = 14, SV_METRIC_REQUEST_KINDS = 256 };

struct sv_histogram {
    uint64_t bucket[SV_METRIC_BUCKETS + 1]; /* not cumulative; the last is +Inf */
    double sum_s;
};

struct sv_request_count {
    const char *route; /* a string that stays */
    unsigned status;
    uint64_t count;
};

struct sv_metrics {
    uint64_t counter[SV_COUNTER_COUNT];
    double gauge[SV_GAUGE_COUNT];
    struct sv_histogram stage[SV_STAGE_COUNT], request;
    struct sv_request_count requests[SV_METRIC_REQUEST_KINDS];
    size_t request_kinds;
    uint64_t response_bytes;
};

static inline void sv_metrics_count(struct sv_metrics *m, enum sv_counter counter)
{
    m->counter[counter]++;
}
/* Stages that ran (not negative). */
void sv_metrics_stages(struct sv_metrics *m, const struct sv_timings *timings);
/* route: a string that stays. */
void sv_metrics_request(struct sv_metrics *m, const char *route, unsigned status, double seconds,
                        uint64_t bytes);
/* The whole page; heap, caller frees; NULL when out of memory. build: version text. */
char *sv_metrics_text(const struct sv_metrics *m, const char *build);

#endif
