/* flight.h - views under way: one flight a distinct view, however many requests wait for it.
 *
 * A flight is keyed by scene version and canonical request. Requests that find a flight of theirs join it
 * (collapsed forwarding): the view is resolved and drawn once. What moves a flight along is in views.h; here
 * is only who waits for what, and until when. One thread. */
#ifndef SV_SERVER_FLIGHT_H
#define SV_SERVER_FLIGHT_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "api/canonical.h"
#include "core/view/request.h"
#include "core/view/resolved.h"
#include "server/bands.h"
#include "server/daemon/loop.h"
#include "server/daemon/queue.h"
#include "server/wire.h"

struct sv_flight;

/* One request that waits; lives in its owner's struct. */
struct sv_waiter {
    struct sv_waiter *next, *previous;
    struct sv_flight *flight; /* NULL: waits for none */
    double deadline_ms;       /* by the loop's clock */
    bool collapsed;           /* the flight was there before it */
};

enum sv_flight_stage { SV_FLIGHT_RESOLVE, SV_FLIGHT_VIEW };

/* What one worker has of a flight in hand: all of it, or a band of its rows. The work that crews know. */
struct sv_flight_part {
    struct sv_flight *flight;
    bool running;
    bool done; /* a band: its rows are in the slab */
    int row_first, row_count;
};

struct sv_flight {
    struct sv_flight *next, *previous; /* of all flights, oldest first */
    struct sv_flight *chain;           /* in its bucket */
    uint64_t hash, scene_version;
    char canonical[SV_API_CANONICAL_MAX];
    struct sv_view_request request;
    struct sv_waiter *first, *last; /* in order of arrival */
    size_t waiters;
    double deadline_ms; /* the latest of all that ever joined: a worker that passes it is killed */
    double started_ms;  /* when the job that runs was handed over */
    double queue_ms;    /* waited in the queue, so far */
    double plan_ms;     /* resolving; negative: from memory */
    enum sv_flight_stage stage;
    int deaths; /* workers that died on it by themselves */
    bool running; /* any part of it */
    struct sv_flight_part parts[SV_BANDS_MAX];
    int part_count;       /* 1: it is not split */
    struct sv_slab *slab; /* of a view that is split; else NULL */
    bool orphaned;        /* a worker was killed with its scene process: it may still write to the slab */
    struct sv_wire_drawn answer; /* of the band that came last and has the picture, or of one that failed; id 0: none yet */
    struct sv_resolved_view resolved; /* from stage VIEW on */
    struct sv_queue_item item;
    struct sv_timer unwanted; /* its owner's: kills the job that nobody waits for any more */
    void *context;            /* its owner's */
};

enum { SV_FLIGHT_BUCKETS = 1024 };

struct sv_flights {
    struct sv_flight *first, *last;
    struct sv_flight *bucket[SV_FLIGHT_BUCKETS];
    size_t count;
};

#define SV_FLIGHT_OF_ITEM(pointer) \
    ((struct sv_flight *)(void *)((char *)(pointer)-offsetof(struct sv_flight, item)))

/* NULL when there is none. */
struct sv_flight *sv_flight_find(const struct sv_flights *flights, uint64_t scene_version,
                                 const char *canonical);
/* A new one, without waiters, stage RESOLVE. NULL when out of memory. */
struct sv_flight *sv_flight_create(struct sv_flights *flights, uint64_t scene_version, const char *canonical,
                                   const struct sv_view_request *request);
/* No waiter and no queue may hold it any more. */
void sv_flight_destroy(struct sv_flights *flights, struct sv_flight *flight);
/* The scene was exchanged: the flight begins again on the new one. */
void sv_flight_rebind(struct sv_flights *flights, struct sv_flight *flight, uint64_t scene_version);

void sv_flight_join(struct sv_flight *flight, struct sv_waiter *waiter, double deadline_ms);
void sv_flight_leave(struct sv_waiter *waiter);

#endif
