/* workers.h - the crew of one scene process: workers are asked for, given one job at a time, killed,
 * replaced.
 *
 * A worker is forked by the scene process on a FORK message that carries the worker's end of a socketpair;
 * its pidfd comes back with FORKED. Who dies without being told is replaced, quickly at first and then with
 * growing pauses while none of them finishes a job. Nothing here knows what a view is: `work` is an opaque
 * pointer that comes back with the outcome. One thread. */
#ifndef SV_SERVER_WORKERS_H
#define SV_SERVER_WORKERS_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#include <sys/types.h>

#include "server/daemon/loop.h"
#include "server/daemon/metrics.h"
#include "server/slab.h"
#include "server/wire.h"

struct sv_crew;

enum sv_worker_state {
    SV_WORKER_FORKING, /* asked for */
    SV_WORKER_IDLE,
    SV_WORKER_BUSY,
    SV_WORKER_LEAVING /* killed, dead or told to go; forgotten when the scene process has reaped it */
};

struct sv_worker {
    struct sv_worker *next;
    struct sv_crew *crew;
    enum sv_worker_state state;
    uint64_t id;
    pid_t pid; /* 0 while FORKING */
    bool told; /* LEAVING because we said so */
    int fd, pidfd;
    struct sv_watch *fd_watch, *pid_watch;
    uint64_t job; /* BUSY: its id, and the type of message that answers it */
    enum sv_wire_type awaits;
    bool stopped; /* BUSY: it was told to */
    void *work;
    struct sv_slab *slab; /* BUSY with a view */
    uint64_t views, own_bytes;
};

struct sv_crew_events {
    void *context;
    void (*idle)(void *context); /* a worker waits for work */
    void (*resolved)(void *context, void *work, const struct sv_wire_resolved *answer);
    /* slab: taken over by the callee; NULL: it has it (sv_worker_draw_band). */
    void (*drawn)(void *context, void *work, const struct sv_wire_drawn *answer, struct sv_slab *slab,
                  uint64_t job);
    /* Of sv_worker_build; the work that it is about is another one than that of the others. */
    void (*built)(void *context, void *work, const struct sv_wire_built *answer);
    void (*build_lost)(void *context, void *work);
    /* Of sv_worker_refine, likewise. */
    void (*refined)(void *context, void *work, const struct sv_wire_refined *answer);
    void (*refine_lost)(void *context, void *work);
    /* The worker died; by_itself: not because its scene process did. */
    void (*lost)(void *context, void *work, bool by_itself);
};

struct sv_crew_options {
    struct sv_loop *loop;
    struct sv_metrics *metrics;
    size_t size;                       /* workers to keep alive */
    uint64_t views_max, own_bytes_max; /* a worker is replaced after that; 0: never */
    struct sv_crew_events events;
};

struct sv_crew {
    struct sv_crew_options options;
    int control_fd; /* of the scene process, borrowed; -1: not started */
    struct sv_worker *workers;
    bool dismissed;        /* nobody is replaced any more */
    unsigned early_deaths; /* in a row, without a finished job between */
    struct sv_timer refill;
};

void sv_crew_init(struct sv_crew *crew, const struct sv_crew_options *options);
/* The scene process is ready to fork: asks for the whole crew. */
void sv_crew_start(struct sv_crew *crew, int control_fd);
/* What the scene process said about one of them. pidfd is taken (-1: none). */
void sv_crew_forked(struct sv_crew *crew, const struct sv_wire_forked *message, int pidfd);
void sv_crew_exited(struct sv_crew *crew, const struct sv_wire_exited *message);
/* No new work is coming: idle workers leave now, busy ones after their job; who refines is told to stop. */
void sv_crew_dismiss(struct sv_crew *crew);
/* The scene process is gone: kills and forgets all; `lost` is called for what they were doing (not by
 * itself). */
void sv_crew_abandon(struct sv_crew *crew);

/* An idle one, or NULL. */
struct sv_worker *sv_crew_idle(struct sv_crew *crew);
struct sv_worker *sv_crew_find(struct sv_crew *crew, uint64_t id); /* NULL: gone */
size_t sv_crew_alive(const struct sv_crew *crew); /* forked and not leaving */
size_t sv_crew_busy(const struct sv_crew *crew);
size_t sv_crew_idle_count(const struct sv_crew *crew);
uint64_t sv_crew_own_bytes(const struct sv_crew *crew);

/* Hands an idle worker a job; false: it did not take it (it is dying; `work` stays the caller's). */
bool sv_worker_resolve(struct sv_worker *worker, const struct sv_view_request *request, void *work);
/* The slab is lent for the job and comes back with `drawn`; it is discarded when the worker dies. False: the
 * slab stays the caller's. */
bool sv_worker_draw(struct sv_worker *worker, const struct sv_view_request *request,
                    const struct sv_resolved_view *view, int epsg, struct sv_slab *slab, void *work);
/* One of several bands of a view, put together in the slab (bands.h), which stays the caller's: `drawn` comes without. */
struct sv_worker_band {
    int index, count;
    int row_first, row_count;
};
bool sv_worker_draw_band(struct sv_worker *worker, const struct sv_view_request *request,
                         const struct sv_resolved_view *view, int epsg, const struct sv_worker_band *band,
                         const struct sv_slab *slab, void *work);
/* Builds at most `most` of the panels that the view would be drawn from. */
bool sv_worker_build(struct sv_worker *worker, const struct sv_view_request *request, uint32_t most, void *work);
/* Refines one of the panels that the view is drawn from, or goes on with one that was stopped. */
bool sv_worker_refine(struct sv_worker *worker, const struct sv_view_request *request, int samples, void *work);
/* Tells the worker that refines to stop: it answers within a row of texels. */
void sv_crew_stop(struct sv_crew *crew, const void *work);
/* Kills the worker that has this work, which is forgotten: no event follows. */
void sv_crew_kill(struct sv_crew *crew, const void *work, const char *why);

#endif
