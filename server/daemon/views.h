/* views.h - the way of a view through the daemon: parsed, resolved, found or drawn, answered.
 *
 * parse -> memo or RESOLVE job -> entity tag: 304, f=json, picture cache -> flight in the queue (joined when
 * it is there)
 * -> VIEW job -> answer to all who wait. Deadlines count from arrival; who has gone is forgotten, and work
 * that nobody waits for is never started. A job whose worker died is tried once more; a view that killed two
 * is refused from then on. */
#ifndef SV_SERVER_VIEWS_H
#define SV_SERVER_VIEWS_H

#include "server/daemon/service.h"

/* GET and POST /v1/view. */
void sv_views_handle(struct sv_service *service, struct sv_exchange *exchange);

/* Hands waiting work to idle workers as soon as the event at hand is done. */
void sv_views_pump_soon(struct sv_service *service);
void sv_views_pump(void *service);

/* Outcomes (struct sv_crew_events); context is the service, work a part of a flight. */
void sv_views_idle(void *context);
void sv_views_resolved(void *context, void *work, const struct sv_wire_resolved *answer);
void sv_views_drawn(void *context, void *work, const struct sv_wire_drawn *answer, struct sv_slab *slab,
                    uint64_t job);
void sv_views_lost(void *context, void *work, bool by_itself);

/* A scene serves: what waits begins again on it. */
void sv_views_rebind(struct sv_service *service);
/* Answers everything that waits with the problem; running workers are killed. */
void sv_views_give_up(struct sv_service *service, enum sv_problem_kind kind, const char *detail);

/* Milliseconds that the client will wait, from its Prefer field (NULL: none): "wait=N" in seconds, at most
 * max_ms; standard_ms without one. *asked tells whether it said so. */
double sv_views_wait_ms(const char *prefer, double standard_ms, double max_ms, bool *asked);
/* Bytes that an encoded picture can have at most: its raw layers and what a container adds. */
size_t sv_views_picture_bytes_max(const struct sv_view_request *request);

#endif
