/* ahead.h - panels of relief cells that are built before a view needs them: for views that a client names
 * (POST /v1/cells), and for where clients that move will be.
 *
 * A job is a view's request; a worker that has nothing else to do resolves it and builds one of its panels,
 * and the job goes to the end of the line until none is missing: so a view that comes in waits for one panel
 * at most, and where there are several workers one is always left for it. Who has moved from one view to the
 * next is taken to go on so (same size of picture, an eye near the last one). Jobs that fail are forgotten.
 * One thread. */
#ifndef SV_SERVER_AHEAD_H
#define SV_SERVER_AHEAD_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "core/view/request.h"
#include "core/view/resolved.h"
#include "server/daemon/loop.h"
#include "server/wire.h"

struct sv_service;
struct sv_ahead_job;

enum { SV_AHEAD_JOBS_MAX = 1024, SV_AHEAD_MOVERS = 16 };

/* A client as far as its pictures tell: where it was, and where its next panels are asked for. */
struct sv_ahead_mover {
    int width, height; /* 0: nobody */
    struct sv_vec3 eye;
    double last_ms;
    struct sv_ahead_job *job; /* NULL: none waits or runs */
};

struct sv_ahead {
    struct sv_ahead_job *first, *last;
    size_t count, running;
    uint64_t last_id;
    struct sv_ahead_mover movers[SV_AHEAD_MOVERS];
};

/* A job for that view; its id, 0: there are too many, or no memory. */
uint64_t sv_ahead_add(struct sv_service *service, const struct sv_view_request *request);
/* A view was drawn from panels: what its client will need next is asked for. */
void sv_ahead_seen(struct sv_service *service, const struct sv_view_request *request,
                   const struct sv_resolved_view *view);
/* Hands jobs to workers that no view waits for. */
void sv_ahead_pump(struct sv_service *service);
/* Forgets all jobs; none runs any more, or its worker is killed. */
void sv_ahead_clear(struct sv_service *service);

/* Outcomes (struct sv_crew_events); context is the service. */
void sv_ahead_built(void *context, void *work, const struct sv_wire_built *answer);
void sv_ahead_lost(void *context, void *work);

/* Where a client at `now` that was at `before`, dt_ms earlier, will be when panels that are asked for now are
 * there. False: it does not move, or it jumped. */
bool sv_ahead_guess(struct sv_vec3 before, struct sv_vec3 now, double dt_ms, struct sv_vec3 *next);

#endif
