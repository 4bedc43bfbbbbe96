#include "server/daemon/views.h"

#include <ctype.h>
#include <stdlib.h>
#include <string.h>
#include <strings.h>

#include "api/canonical.h"
#include "api/view_parse.h"
#include "server/daemon/reply.h"
#include "server/daemon/views_private.h"

/* ---- who waits, and leaves ---- */

static void on_deadline(void *context)
{
    struct sv_view_task *task = context;
    struct sv_service *service = task->service;
    struct sv_flight *flight = task->waiter.flight;
    const char *detail = flight && flight->running ? "the deadline passed while the view was being drawn"
                                                   : "the deadline passed while the view waited for a worker";
    sv_metrics_count(&service->metrics, SV_COUNT_DEADLINE);
    sv_view_answer_kind(task, SV_PROBLEM_DEADLINE, detail,
                        sv_queue_retry_after_s(&service->queue, (size_t)service->settings->workers));
    if (flight)
        sv_view_flight_was_left(service, flight, true);
    sv_views_pump_soon(service);
}

/* Nobody waits for this job any more, but it runs: its deadline is that of the last who waited. */
static void on_unwanted_deadline(void *context)
{
    struct sv_flight *flight = context;
    struct sv_service *service = flight->context;
    if (flight->waiters) /* somebody joined since, and has a timer */
        return;
    sv_view_flight_was_left(service, flight, true);
}

static void on_gone(struct sv_exchange *exchange)
{
    struct sv_view_task *task = exchange->owner;
    struct sv_service *service = task->service;
    struct sv_flight *flight = task->waiter.flight;
    sv_view_task_destroy(task);
    if (!flight)
        return;
    sv_view_flight_was_left(service, flight, false);
}

/* Puts the task into its flight, a new one if there is none. resolved: NULL when that is still to be done. */
static void take_off(struct sv_view_task *task, uint64_t version, const struct sv_resolved_view *resolved)
{
    struct sv_service *service = task->service;
    struct sv_flight *flight = sv_flight_find(&service->flights, version, task->canonical);
    if (!flight) {
        double now = sv_loop_now_ms();
        flight = sv_flight_create(&service->flights, version, task->canonical, &task->request);
        if (!flight) {
            sv_view_answer_kind(task, SV_PROBLEM_INTERNAL, "out of memory", 0);
            return;
        }
        flight->context = service;
        flight->unwanted = (struct sv_timer){.due = on_unwanted_deadline, .context = flight};
        if (resolved) {
            flight->resolved = *resolved;
            flight->stage = SV_FLIGHT_VIEW;
        }
        enum sv_queue_class rank = resolved ? SV_QUEUE_VIEW : SV_QUEUE_RESOLVE;
        if (!sv_queue_admit(&service->queue, &flight->item, rank, now)) {
            sv_flight_destroy(&service->flights, flight);
            sv_metrics_count(&service->metrics, SV_COUNT_QUEUE_FULL);
            sv_view_answer_kind(task, SV_PROBLEM_OVERLOADED, "the queue is full",
                                sv_queue_retry_after_s(&service->queue, (size_t)service->settings->workers));
            return;
        }
    } else {
        sv_metrics_count(&service->metrics, SV_COUNT_COLLAPSED);
    }
    sv_flight_join(flight, &task->waiter, task->deadline_ms);
    sv_views_pump_soon(service);
}

/* ---- a request comes in ---- */

static bool parse(struct sv_service *service, struct sv_exchange *exchange, struct sv_api_view *view)
{
    struct sv_errors errors;
    sv_errors_init(&errors);
    const char *accept = sv_exchange_field(exchange, "Accept");
    char *accepts = accept ? sv_exchange_fields(exchange, "Accept") : NULL;
    bool is_post = strcmp(exchange->method, "POST") == 0;
    struct sv_problem problem = {.errors = &errors};
    if (is_post && exchange->query_bytes) {
        sv_errors_add(&errors, SV_EINVAL, "",
                      "a POST takes its fields from the body; the query must be empty");
        problem.kind = SV_PROBLEM_BAD_REQUEST;
    } else if (is_post) {
        problem.kind = sv_api_view_parse_json(exchange->body ? exchange->body : "", exchange->body_bytes,
                                              accepts, &service->limits, view, &errors);
    } else {
        problem.kind = sv_api_view_parse_kvp(exchange->query ? exchange->query : "", exchange->query_bytes,
                                             accepts, &service->limits, view, &errors);
    }
    if (problem.kind != SV_PROBLEM_NONE)
        sv_reply(exchange, &problem);
    sv_errors_finish(&errors);
    free(accepts);
    return problem.kind == SV_PROBLEM_NONE;
}

double sv_views_wait_ms(const char *prefer, double standard_ms, double max_ms, bool *asked)
{
    *asked = false;
    for (const char *p = prefer; p && *p; p += strcspn(p, ",;"), p += *p != '\0') {
        p += strspn(p, " \t");
        if (strncasecmp(p, "wait", 4) != 0)
            continue;
        p += 4;
        p += strspn(p, " \t");
        if (*p != '=')
            continue;
        p++;
        p += strspn(p, " \t\"");
        if (!isdigit((unsigned char)*p))
            continue;
        double ms = strtod(p, NULL) * 1e3;
        *asked = true;
        return ms < max_ms ? ms : max_ms;
    }
    return standard_ms;
}

static struct sv_view_task *task_create(struct sv_service *service, struct sv_exchange *exchange,
                                        const struct sv_api_view *view)
{
    struct sv_view_task *task = calloc(1, sizeof *task);
    if (!task)
        return NULL;
    const struct sv_settings *s = service->settings;
    bool asked;
    char *prefer = sv_exchange_fields(exchange, "Prefer");
    double wait_ms = sv_views_wait_ms(prefer, (double)s->deadline_ms, (double)s->deadline_max_ms, &asked);
    free(prefer);
    if (asked)
        sv_api_headers_set(&exchange->headers, "Preference-Applied", "wait=%.0f", wait_ms * 1e-3);
    task->service = service;
    task->exchange = exchange;
    task->request = view->request;
    task->negotiated = view->negotiated;
    task->if_none_match = sv_exchange_fields(exchange, "If-None-Match");
    task->deadline_ms = exchange->arrival_ms + wait_ms;
    task->plan_ms = task->queue_ms = -1;
    sv_api_canonical(&task->request, task->canonical);
    task->deadline = (struct sv_timer){.due = on_deadline, .context = task};
    exchange->owner = task;
    exchange->gone = on_gone;
    if (sv_loop_arm(service->loop, &task->deadline, task->deadline_ms) != SV_OK) {
        sv_view_task_destroy(task);
        return NULL;
    }
    return task;
}

void sv_views_handle(struct sv_service *service, struct sv_exchange *exchange)
{
    struct sv_api_view view;
    if (!parse(service, exchange, &view))
        return;
    const struct sv_scene_process *scene = service->scenes.serving;
    if (service->draining || !scene) {
        sv_reply_retry(exchange, service->draining ? SV_PROBLEM_DRAINING : SV_PROBLEM_NOT_READY,
                       service->draining ? NULL : "no scene is loaded at the moment",
                       sv_service_scene_retry_s(service));
        return;
    }
    struct sv_view_task *task = task_create(service, exchange, &view);
    if (!task) {
        sv_reply_problem(exchange, SV_PROBLEM_INTERNAL, "out of memory");
        return;
    }
    if (sv_view_is_refused(service, scene->version, task->canonical)) {
        sv_metrics_count(&service->metrics, SV_COUNT_VIEW_REFUSED);
        sv_view_answer_kind(task, SV_PROBLEM_VIEW_KILLS,
                            "it is not tried again with this version of the scene", 0);
        return;
    }
    char place[SV_API_CANONICAL_MAX];
    sv_api_canonical_resolve(&task->request, place);
    const struct sv_memo_answer *known = sv_memo_find(service->memo, scene->version, place);
    if (known)
        sv_metrics_count(&service->metrics, SV_COUNT_RESOLVE_HIT);
    if (known && known->status != SV_OK) {
        sv_view_answer_error(task, known);
        return;
    }
    if (known && sv_view_answer_without_drawing(task, scene->version, &known->view))
        return;
    if (known)
        sv_metrics_count(&service->metrics, SV_COUNT_PICTURE_MISS);
    take_off(task, scene->version, known ? &known->view : NULL);
}
