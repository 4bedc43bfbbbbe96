#include "server/daemon/views.h"

#include <ctype.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <strings.h>

#include "api/answer.h"
#include "api/canonical.h"
#include "api/describe.h"
#include "api/view_parse.h"
#include "server/daemon/reply.h"
#include "server/daemon/split.h"
#include "server/log.h"

/* A view that lost two workers is not given a third. */
enum { DEATHS_MAX = 2 };
/* When shared memory is short, how soon to look again. */
static const double slab_retry_ms = 20;

/* One request for a view, from parsing to its answer. */
struct view_task {
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

static struct view_task *task_of(struct sv_waiter *waiter)
{
    return (struct view_task *)(void *)waiter;
}

/* Of all of its parts that run. */
static void kill_workers(struct sv_service *service, struct sv_flight *flight, const char *why)
{
    for (int k = 0; k < flight->part_count; k++)
        if (flight->parts[k].running)
            sv_scenes_kill_work(&service->scenes, &flight->parts[k], why);
}

/* None of its workers comes back to it. */
static void drop_flight(struct sv_service *service, struct sv_flight *flight)
{
    sv_loop_disarm(service->loop, &flight->unwanted);
    sv_split_forget(flight, flight->running || flight->orphaned);
    sv_queue_remove(&service->queue, &flight->item);
    sv_flight_destroy(&service->flights, flight);
}

/* A waiter has left: is the flight still worth it? */
static void flight_was_left(struct sv_service *service, struct sv_flight *flight, bool deadline_passed)
{
    if (flight->waiters)
        return;
    if (!flight->running) {
        if (flight->item.queued)
            sv_metrics_count(&service->metrics, SV_COUNT_NEVER_STARTED);
        drop_flight(service, flight);
        return;
    }
    if (deadline_passed) {
        kill_workers(service, flight, "its job passed the deadline");
        drop_flight(service, flight);
        return;
    }
    /* All clients went away: the job may finish, its picture may serve the next one, but not past the
     * deadline. */
    if (sv_loop_arm(service->loop, &flight->unwanted, flight->deadline_ms) != SV_OK)
        sv_log(SV_LOG_WARNING, "views", "out of memory: a job that nobody waits for has no deadline");
}

static void task_destroy(struct view_task *task)
{
    sv_loop_disarm(task->service->loop, &task->deadline);
    sv_flight_leave(&task->waiter);
    task->exchange->owner = NULL;
    task->exchange->gone = NULL;
    free(task->if_none_match);
    free(task);
}

/* ---- answers ---- */

static void set_timings(struct view_task *task, const struct sv_timings *drawn)
{
    struct sv_timings *t = &task->exchange->timings;
    if (drawn)
        *t = *drawn;
    t->ms[SV_STAGE_QUEUE] = task->queue_ms;
    t->ms[SV_STAGE_PLAN] = task->plan_ms;
    sv_metrics_stages(&task->service->metrics, t);
}

static void answer_problem(struct view_task *task, const struct sv_problem *problem)
{
    struct sv_exchange *exchange = task->exchange;
    set_timings(task, NULL);
    task_destroy(task);
    sv_reply(exchange, problem);
}

static void answer_kind(struct view_task *task, enum sv_problem_kind kind, const char *detail,
                        int retry_after_s)
{
    struct sv_problem problem = {.kind = kind, .detail = detail, .retry_after_s = retry_after_s};
    answer_problem(task, &problem);
}

/* A worker's error, in the client's words. */
static void answer_error(struct view_task *task, const struct sv_memo_answer *failed)
{
    struct sv_error named = failed->error;
    struct sv_errors errors;
    sv_errors_init(&errors);
    named.code = failed->status;
    sv_api_problem_name_keys(&task->request, &named);
    sv_errors_add(&errors, named.code, named.field, "%s", named.message);
    struct sv_problem problem = {.kind = sv_api_problem_of_status(failed->status),
                                 .errors = &errors,
                                 .has_ground_z = failed->has_ground,
                                 .ground_z_m = failed->ground_z};
    answer_problem(task, &problem);
    sv_errors_finish(&errors);
}

static double relief_distance(const struct sv_service *service)
{
    return service->scenes.serving ? service->scenes.serving->relief_distance_m : 0;
}

/* cell: of the picture, NULL: there is none. */
static void set_view_headers(struct view_task *task, const struct sv_resolved_view *resolved,
                             const char *etag, const struct sv_cell_use *cell, bool not_modified)
{
    struct sv_answer_view answer = {.request = &task->request,
                                    .resolved = resolved,
                                    .etag = etag,
                                    .negotiated = task->negotiated,
                                    .cache = task->cache,
                                    .relief_distance_m = relief_distance(task->service),
                                    .cell = cell};
    sv_api_answer_view(&answer, not_modified, &task->exchange->headers);
}

/* Sends the picture; takes a reference of its own. */
static void answer_picture(struct view_task *task, const struct sv_resolved_view *resolved, const char *etag,
                           struct sv_picture_bytes *picture, const struct sv_timings *drawn)
{
    struct sv_exchange *exchange = task->exchange;
    struct sv_cell_use cell = picture->cell;
    if (!drawn && cell.kind == SV_CELL_USE_BUILT) /* for whoever asked first */
        cell.kind = SV_CELL_USE_HIT;
    set_timings(task, drawn);
    set_view_headers(task, resolved, etag, &cell, false);
    sv_exchange_set_body(exchange, picture->bytes, picture->size, sv_picture_unref, sv_picture_ref(picture));
    task_destroy(task);
    sv_exchange_answer(exchange, 200);
}

static void answer_not_modified(struct view_task *task, const struct sv_resolved_view *resolved,
                                const char *etag)
{
    struct sv_exchange *exchange = task->exchange;
    sv_metrics_count(&task->service->metrics, SV_COUNT_NOT_MODIFIED);
    task->cache = SV_CACHE_HIT;
    set_timings(task, NULL);
    set_view_headers(task, resolved, etag, NULL, true);
    task_destroy(task);
    sv_exchange_answer(exchange, 304);
}

static void answer_description(struct view_task *task, uint64_t version,
                               const struct sv_resolved_view *resolved, const char *etag)
{
    struct sv_exchange *exchange = task->exchange;
    char canonical[SV_API_CANONICAL_MAX], picture_etag[SV_ETAG_BUFFER];
    struct sv_view_request picture = task->request;
    picture.describe = false;
    sv_api_canonical(&picture, canonical);
    sv_api_etag_view(canonical, resolved, version, SV_VERSION, picture_etag);
    struct sv_api_description description = {.request = &task->request,
                                             .resolved = resolved,
                                             .canonical = canonical,
                                             .etag = picture_etag,
                                             .scene_version = version,
                                             .relief_distance_m = relief_distance(task->service)};
    size_t bytes = 0;
    char *text = sv_api_describe(&description, &bytes);
    if (!text) {
        answer_kind(task, SV_PROBLEM_INTERNAL, "out of memory", 0);
        return;
    }
    task->cache = SV_CACHE_BYPASS;
    set_timings(task, NULL);
    set_view_headers(task, resolved, etag, NULL, false);
    sv_exchange_take_text(exchange, text);
    task_destroy(task);
    sv_exchange_answer(exchange, 200);
}

/* Everything that a resolved view can be answered with before drawing. False: it must be drawn. */
static bool answer_without_drawing(struct view_task *task, uint64_t version,
                                   const struct sv_resolved_view *resolved)
{
    char etag[SV_ETAG_BUFFER];
    sv_api_etag_view(task->canonical, resolved, version, SV_VERSION, etag);
    if (task->if_none_match && sv_api_etag_matches(task->if_none_match, etag)) {
        answer_not_modified(task, resolved, etag);
        return true;
    }
    if (task->request.describe) {
        answer_description(task, version, resolved, etag);
        return true;
    }
    struct sv_picture_bytes *picture = sv_pictures_find(task->service->pictures, etag);
    if (!picture)
        return false;
    sv_metrics_count(&task->service->metrics, SV_COUNT_PICTURE_HIT);
    task->cache = SV_CACHE_HIT;
    sv_refine_seen(task->service, &task->request, &picture->cell);
    sv_views_pump_soon(task->service);
    answer_picture(task, resolved, etag, picture, NULL);
    sv_picture_unref(picture);
    return true;
}

/* ---- flights ---- */

static void refusal_key(const struct sv_flight *flight, char key[SV_API_CANONICAL_MAX + 20])
{
    snprintf(key, SV_API_CANONICAL_MAX + 20, "%016llx %s", (unsigned long long)flight->scene_version,
             flight->canonical);
}

static void end_flight_with_error(struct sv_service *service, struct sv_flight *flight,
                                  const struct sv_memo_answer *failed)
{
    while (flight->first)
        answer_error(task_of(flight->first), failed);
    drop_flight(service, flight);
}

static void end_flight_with_kind(struct sv_service *service, struct sv_flight *flight,
                                 enum sv_problem_kind kind, const char *detail, int retry_after_s)
{
    while (flight->first)
        answer_kind(task_of(flight->first), kind, detail, retry_after_s);
    drop_flight(service, flight);
}

/* The camera is known: answers who needs no drawing; the rest waits for it. False: nobody does, the flight is
 * gone. */
static bool flight_resolved(struct sv_service *service, struct sv_flight *flight,
                            const struct sv_resolved_view *resolved)
{
    struct sv_waiter *next;
    flight->resolved = *resolved;
    flight->stage = SV_FLIGHT_VIEW;
    for (struct sv_waiter *w = flight->first; w; w = next) {
        next = w->next;
        task_of(w)->plan_ms = flight->plan_ms;
        task_of(w)->queue_ms = flight->queue_ms;
        answer_without_drawing(task_of(w), flight->scene_version, resolved);
    }
    if (flight->waiters)
        return true;
    drop_flight(service, flight);
    return false;
}

static void on_deadline(void *context)
{
    struct view_task *task = context;
    struct sv_service *service = task->service;
    struct sv_flight *flight = task->waiter.flight;
    const char *detail = flight && flight->running ? "the deadline passed while the view was being drawn"
                                                   : "the deadline passed while the view waited for a worker";
    sv_metrics_count(&service->metrics, SV_COUNT_DEADLINE);
    answer_kind(task, SV_PROBLEM_DEADLINE, detail,
                sv_queue_retry_after_s(&service->queue, (size_t)service->settings->workers));
    if (flight)
        flight_was_left(service, flight, true);
    sv_views_pump_soon(service);
}

/* Nobody waits for this job any more, but it runs: its deadline is that of the last who waited. */
static void on_unwanted_deadline(void *context)
{
    struct sv_flight *flight = context;
    struct sv_service *service = flight->context;
    if (flight->waiters) /* somebody joined since, and has a timer */
        return;
    flight_was_left(service, flight, true);
}

static void on_gone(struct sv_exchange *exchange)
{
    struct view_task *task = exchange->owner;
    struct sv_service *service = task->service;
    struct sv_flight *flight = task->waiter.flight;
    task_destroy(task);
    if (!flight)
        return;
    flight_was_left(service, flight, false);
}

/* Puts the task into its flight, a new one if there is none. resolved: NULL when that is still to be done. */
static void take_off(struct view_task *task, uint64_t version, const struct sv_resolved_view *resolved)
{
    struct sv_service *service = task->service;
    struct sv_flight *flight = sv_flight_find(&service->flights, version, task->canonical);
    if (!flight) {
        double now = sv_loop_now_ms();
        flight = sv_flight_create(&service->flights, version, task->canonical, &task->request);
        if (!flight) {
            answer_kind(task, SV_PROBLEM_INTERNAL, "out of memory", 0);
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
            answer_kind(task, SV_PROBLEM_OVERLOADED, "the queue is full",
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

static struct view_task *task_create(struct sv_service *service, struct sv_exchange *exchange,
                                     const struct sv_api_view *view)
{
    struct view_task *task = calloc(1, sizeof *task);
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
        task_destroy(task);
        return NULL;
    }
    return task;
}

static bool is_refused(struct sv_service *service, const struct view_task *task, uint64_t version)
{
    char key[SV_API_CANONICAL_MAX + 20];
    snprintf(key, sizeof key, "%016llx %s", (unsigned long long)version, task->canonical);
    return sv_lru_get(service->refused, key) != NULL;
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
    struct view_task *task = task_create(service, exchange, &view);
    if (!task) {
        sv_reply_problem(exchange, SV_PROBLEM_INTERNAL, "out of memory");
        return;
    }
    if (is_refused(service, task, scene->version)) {
        sv_metrics_count(&service->metrics, SV_COUNT_VIEW_REFUSED);
        answer_kind(task, SV_PROBLEM_VIEW_KILLS, "it is not tried again with this version of the scene", 0);
        return;
    }
    char place[SV_API_CANONICAL_MAX];
    sv_api_canonical_resolve(&task->request, place);
    const struct sv_memo_answer *known = sv_memo_find(service->memo, scene->version, place);
    if (known)
        sv_metrics_count(&service->metrics, SV_COUNT_RESOLVE_HIT);
    if (known && known->status != SV_OK) {
        answer_error(task, known);
        return;
    }
    if (known && answer_without_drawing(task, scene->version, &known->view))
        return;
    if (known)
        sv_metrics_count(&service->metrics, SV_COUNT_PICTURE_MISS);
    take_off(task, scene->version, known ? &known->view : NULL);
}

/* ---- workers ---- */

size_t sv_views_picture_bytes_max(const struct sv_view_request *request)
{
    static const size_t layer_bytes[SV_LAYER_COUNT] = {
        [SV_LAYER_COLOR] = 8, [SV_LAYER_DEPTH] = 4, [SV_LAYER_NORMAL] = 12, [SV_LAYER_ID] = 4};
    size_t pixels = (size_t)request->width * (size_t)request->height, bytes = 0;
    for (unsigned layer = 0; layer < SV_LAYER_COUNT; layer++)
        if (request->layers & (1u << layer))
            bytes += pixels * layer_bytes[layer];
    return bytes + bytes / 64 +
           65536; /* containers and incompressible rows add under 1 part in 64, and a head */
}

/* Gives the flight to the worker, and to others if it is split; false: it stays in the queue, and nothing more can be
 * handed over now. */
static bool start_view(struct sv_service *service, struct sv_flight *flight, struct sv_worker *worker)
{
    struct sv_slab *slab;
    struct sv_error error;
    sv_split_flight(service, flight);
    if (flight->slab) {
        sv_split_start(service, flight, worker);
        return true;
    }
    enum sv_status status =
        sv_slab_take(service->slabs, sv_views_picture_bytes_max(&flight->request), &slab, &error);
    if (status == SV_ELIMIT && strcmp(error.field, "slab") == 0) {
        end_flight_with_kind(service, flight, SV_PROBLEM_BAD_REQUEST, error.message, 0);
        return true;
    }
    if (status != SV_OK) {
        if (sv_loop_arm(service->loop, &service->pump, sv_loop_now_ms() + slab_retry_ms) != SV_OK)
            sv_log(SV_LOG_ERROR, "views", "out of memory");
        return false;
    }
    flight->running = sv_worker_draw(worker, &flight->request, &flight->resolved, service->scenes.serving->epsg,
                                     slab, &flight->parts[0]);
    flight->parts[0].running = flight->running;
    if (!flight->running)
        sv_slab_give(slab);
    return true; /* that worker is gone; the next idle one is tried */
}

static bool start_flight(struct sv_service *service, struct sv_flight *flight, struct sv_worker *worker)
{
    char place[SV_API_CANONICAL_MAX];
    if (flight->stage == SV_FLIGHT_RESOLVE) {
        sv_api_canonical_resolve(&flight->request, place);
        const struct sv_memo_answer *known = sv_memo_find(service->memo, flight->scene_version, place);
        if (known && known->status != SV_OK) {
            end_flight_with_error(service, flight, known);
            return true;
        }
        if (known && !flight_resolved(service, flight, &known->view))
            return true;
    }
    if (flight->stage == SV_FLIGHT_VIEW)
        return start_view(service, flight, worker);
    flight->running = sv_worker_resolve(worker, &flight->request, &flight->parts[0]);
    flight->parts[0].running = flight->running;
    return true;
}

void sv_views_pump(void *context)
{
    struct sv_service *service = context;
    struct sv_scene_process *scene = service->scenes.serving;
    struct sv_queue_item *item;
    struct sv_worker *worker;
    while (scene && (item = sv_queue_first(&service->queue)) && (worker = sv_crew_idle(&scene->crew))) {
        struct sv_flight *flight = SV_FLIGHT_OF_ITEM(item);
        enum sv_queue_class rank = item->class_;
        double since = item->since_ms, now = sv_loop_now_ms();
        sv_queue_remove(&service->queue, item);
        flight->started_ms = now;
        flight->queue_ms += now - since;
        size_t flights = service->flights.count;
        bool going = start_flight(service, flight, worker);
        bool ended = service->flights.count < flights;
        if (!ended && !flight->running) {
            flight->queue_ms -= now - since;
            sv_queue_return(&service->queue, item, flight->stage == SV_FLIGHT_VIEW ? SV_QUEUE_VIEW : rank,
                            true, since);
        }
        if (!going)
            return;
    }
    sv_ahead_pump(service);
    sv_refine_pump(service);
}

void sv_views_pump_soon(struct sv_service *service)
{
    if (sv_loop_arm(service->loop, &service->pump, sv_loop_now_ms()) != SV_OK)
        sv_views_pump(service);
}

void sv_views_idle(void *context)
{
    sv_views_pump_soon(context);
}

/* A worker has come back with that part, or is lost: its flight. */
static struct sv_flight *part_back(struct sv_flight_part *part)
{
    struct sv_flight *flight = part->flight;
    part->running = false;
    flight->running = false;
    for (int k = 0; k < flight->part_count; k++)
        flight->running = flight->running || flight->parts[k].running;
    return flight;
}

/* What came back, or was lost, waits for a worker again; another scene may serve meanwhile. */
static void queue_again(struct sv_service *service, struct sv_flight *flight)
{
    sv_loop_disarm(service->loop, &flight->unwanted);
    if (!flight->waiters) {
        drop_flight(service, flight);
        return;
    }
    const struct sv_scene_process *scene = service->scenes.serving;
    bool other = scene && scene->version != flight->scene_version;
    if (other || flight->orphaned)
        sv_split_forget(flight, flight->orphaned);
    flight->orphaned = false;
    if (other)
        sv_flight_rebind(&service->flights, flight, scene->version);
    sv_queue_return(&service->queue, &flight->item,
                    flight->stage == SV_FLIGHT_VIEW ? SV_QUEUE_VIEW : SV_QUEUE_RESOLVE, true,
                    sv_loop_now_ms());
    sv_views_pump_soon(service);
}

void sv_views_resolved(void *context, void *work, const struct sv_wire_resolved *answer)
{
    struct sv_service *service = context;
    struct sv_flight *flight = part_back(work);
    struct sv_memo_answer known = {.status = sv_wire_status(answer->status),
                                   .view = answer->view,
                                   .error = answer->error,
                                   .has_ground = answer->has_ground != 0,
                                   .ground_z = answer->ground_z};
    char place[SV_API_CANONICAL_MAX];
    sv_metrics_count(&service->metrics, SV_COUNT_RESOLVED);
    sv_api_canonical_resolve(&flight->request, place);
    sv_memo_keep(service->memo, flight->scene_version, place, &known);
    flight->plan_ms = answer->plan_ms;
    if (known.status != SV_OK) {
        end_flight_with_error(service, flight, &known);
        return;
    }
    if (!flight_resolved(service, flight, &known.view))
        return;
    sv_metrics_count(&service->metrics, SV_COUNT_PICTURE_MISS);
    sv_queue_return(&service->queue, &flight->item, SV_QUEUE_VIEW, false, sv_loop_now_ms());
}

/* The picture is there: to the cache and to all who wait. */
static void flight_drawn(struct sv_service *service, struct sv_flight *flight,
                         struct sv_picture_bytes *picture, const struct sv_timings *timings)
{
    char etag[SV_ETAG_BUFFER];
    sv_api_etag_view(flight->canonical, &flight->resolved, flight->scene_version, SV_VERSION, etag);
    sv_pictures_keep(service->pictures, etag, picture);
    while (flight->first) {
        struct view_task *task = task_of(flight->first);
        task->cache = task->waiter.collapsed ? SV_CACHE_COLLAPSED : SV_CACHE_STORED;
        task->queue_ms = flight->queue_ms;
        task->plan_ms = flight->plan_ms;
        answer_picture(task, &flight->resolved, etag, picture, timings);
    }
    drop_flight(service, flight);
}

static void view_drawn(struct sv_service *service, struct sv_flight *flight, const struct sv_wire_drawn *answer,
                       struct sv_slab *slab, uint64_t job);

/* No band is under way: the picture is told, or what of it was lost is drawn again. */
static void bands_back(struct sv_service *service, struct sv_flight *flight)
{
    if (flight->running)
        return;
    if (flight->answer.head.id == 0) {
        queue_again(service, flight);
        return;
    }
    struct sv_slab *slab = flight->slab;
    flight->slab = NULL;
    flight->part_count = 1;
    view_drawn(service, flight, &flight->answer, slab, flight->answer.head.id);
}

/* All of the view is drawn, and lies in the slab, which is taken. */
static void view_drawn(struct sv_service *service, struct sv_flight *flight, const struct sv_wire_drawn *answer,
                       struct sv_slab *slab, uint64_t job)
{
    struct sv_memo_answer failed = {.status = sv_wire_status(answer->status), .error = answer->error};
    const void *bytes = NULL;
    size_t size = 0;
    sv_loop_disarm(service->loop, &flight->unwanted);
    sv_queue_served(&service->queue, sv_loop_now_ms() - flight->started_ms);
    if (failed.status == SV_OK)
        failed.status = sv_slab_read(slab, job, &bytes, &size, &failed.error);
    if (failed.status != SV_OK) {
        sv_log(SV_LOG_ERROR, "view failed", "%s: %s (%s)", failed.error.field, failed.error.message,
               flight->canonical);
        sv_slab_give(slab);
        end_flight_with_error(service, flight, &failed);
        return;
    }
    sv_metrics_count(&service->metrics, SV_COUNT_DRAWN);
    struct sv_picture_bytes *picture = sv_picture_of_slab(slab, bytes, size);
    if (!picture) {
        end_flight_with_kind(service, flight, SV_PROBLEM_INTERNAL, "out of memory", 0);
        return;
    }
    picture->cell = answer->stats.cell;
    if (picture->cell.kind == SV_CELL_USE_BUILT || picture->cell.kind == SV_CELL_USE_HIT)
        sv_ahead_seen(service, &flight->request, &flight->resolved);
    sv_refine_seen(service, &flight->request, &picture->cell);
    flight_drawn(service, flight, picture, &answer->timings);
    sv_picture_unref(picture);
}

/* A band is back: what it says of the picture, or of its failure, is kept until all are. */
static void band_drawn(struct sv_service *service, struct sv_flight *flight, struct sv_flight_part *part,
                       const struct sv_wire_drawn *answer, uint64_t job)
{
    enum sv_status status = sv_wire_status(answer->status);
    part->done = status == SV_OK;
    if (flight->answer.head.id == 0 && (status != SV_OK || !answer->part)) {
        flight->answer = *answer;
        flight->answer.head.id = job;
    }
    bands_back(service, flight);
}

void sv_views_drawn(void *context, void *work, const struct sv_wire_drawn *answer, struct sv_slab *slab,
                    uint64_t job)
{
    struct sv_service *service = context;
    struct sv_flight_part *part = work;
    struct sv_flight *flight = part_back(part);
    if (flight->slab)
        band_drawn(service, flight, part, answer, job);
    else
        view_drawn(service, flight, answer, slab, job);
}

void sv_views_lost(void *context, void *work, bool by_itself)
{
    struct sv_service *service = context;
    struct sv_flight *flight = part_back(work);
    flight->deaths += by_itself;
    flight->orphaned = flight->orphaned || !by_itself;
    if (flight->running)
        return;
    if (flight->slab && flight->answer.head.id != 0 && !flight->orphaned) {
        bands_back(service, flight);
        return;
    }
    if (flight->deaths >= DEATHS_MAX) {
        char key[SV_API_CANONICAL_MAX + 20];
        refusal_key(flight, key);
        sv_lru_put(service->refused, key, service, 1); /* any pointer: being there is what counts */
        sv_log(SV_LOG_ERROR, "view refused", "it killed %d workers: %s", flight->deaths, flight->canonical);
        end_flight_with_kind(service, flight, SV_PROBLEM_VIEW_KILLS,
                             "it is not tried again with this version of the scene", 0);
        return;
    }
    queue_again(service, flight);
}

void sv_views_rebind(struct sv_service *service)
{
    uint64_t version = service->scenes.serving->version;
    for (struct sv_flight *f = service->flights.first; f; f = f->next) {
        if (f->running || f->scene_version == version)
            continue;
        double since = f->item.since_ms;
        sv_queue_remove(&service->queue, &f->item);
        sv_split_forget(f, false);
        sv_flight_rebind(&service->flights, f, version);
        sv_queue_return(&service->queue, &f->item, SV_QUEUE_RESOLVE, false, since);
    }
    sv_views_pump_soon(service);
}

void sv_views_give_up(struct sv_service *service, enum sv_problem_kind kind, const char *detail)
{
    while (service->flights.first) {
        struct sv_flight *flight = service->flights.first;
        if (flight->running)
            kill_workers(service, flight, detail);
        end_flight_with_kind(service, flight, kind, detail, 1);
    }
}
