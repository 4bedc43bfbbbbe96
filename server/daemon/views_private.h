/* views_private.h - a request for a view between its parsing and its answer, for the files that take requests
 * (views.c), answer them (views_answer.c) and have workers draw them (views_work.c). */
#ifndef SV_DAEMON_VIEWS_PRIVATE_H
#define SV_DAEMON_VIEWS_PRIVATE_H

#include "api/answer.h"
#include "server/daemon/views.h"

/* One request for a view, from parsing to its answer. */
struct sv_view_task {
    struct sv_waiter waiter; /* first: a waiter is its task */
    struct sv_service *service;
    struct sv_exchange *exchange;
    struct sv_timer deadline;
    struct sv_view_request request;
    bool negotiated;
    char canonical[SV_API_CANONICAL_MAX];
    char *if_none_match; /* heap, NULL: none */
    double deadline_ms;
    enum sv_cache_result cache;
    double plan_ms, queue_ms; /* negative: did not run */
};

static inline struct sv_view_task *sv_view_task_of(struct sv_waiter *waiter)
{
    return (struct sv_view_task *)(void *)waiter;
}

/* Takes the task from its flight and its exchange, which somebody answers or has given up. */
void sv_view_task_destroy(struct sv_view_task *task);

/* ---- answers; the task is destroyed ---- */

void sv_view_answer_kind(struct sv_view_task *task, enum sv_problem_kind kind, const char *detail,
                         int retry_after_s);
/* A worker's error, in the client's words. */
void sv_view_answer_error(struct sv_view_task *task, const struct sv_memo_answer *failed);
/* Sends the picture; takes a reference of its own. drawn: NULL where it was kept. */
void sv_view_answer_picture(struct sv_view_task *task, const struct sv_resolved_view *resolved,
                            const char *etag, struct sv_picture_bytes *picture,
                            const struct sv_timings *drawn);
/* Everything that a resolved view can be answered with before drawing. False: it must be drawn. */
bool sv_view_answer_without_drawing(struct sv_view_task *task, uint64_t version,
                                    const struct sv_resolved_view *resolved);

/* ---- flights ---- */

/* A waiter has left: is the flight still worth it? */
void sv_view_flight_was_left(struct sv_service *service, struct sv_flight *flight, bool deadline_passed);
/* The view has lost so many workers to this version of the scene that it is given no other. */
bool sv_view_is_refused(struct sv_service *service, uint64_t version, const char *canonical);

#endif
