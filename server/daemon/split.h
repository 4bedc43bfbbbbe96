/* split.h - a view drawn by two workers, each of them a band of its rows (server/bands.h), when one would be
 * idle.
 *
 * Views that wait go first: a view is split only when none does. A band whose worker dies is drawn again when
 * the others are done, by whoever is idle then; what else may happen to the flight happens to all of its
 * parts. One thread. */
#ifndef SV_DAEMON_SPLIT_H
#define SV_DAEMON_SPLIT_H

#include "server/daemon/flight.h"

struct sv_service;
struct sv_worker;

/* Whether the view is worth two workers, if they are idle. */
bool sv_split_pays(const struct sv_view_request *request, const struct sv_resolved_view *view);
/* Splits a flight that has a view to draw, if it pays and more than one worker is idle and no other view
 * waits. It stays whole where there is no memory. */
void sv_split_flight(struct sv_service *service, struct sv_flight *flight);
/* Hands the bands that are missing to the worker and to those that are idle beside it. False: nobody took
 * one. */
bool sv_split_start(struct sv_service *service, struct sv_flight *flight, struct sv_worker *worker);
/* Makes it whole again, nothing of it drawn. Its slab goes back, or with whom has it mapped where somebody
 * may still write to it. */
void sv_split_forget(struct sv_flight *flight, bool written);

#endif
