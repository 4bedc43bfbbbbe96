/* views_work.c - flights and the workers that draw them: handing over, whole or in bands, what comes back,
 * what is lost. */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "api/canonical.h"
#include "server/daemon/split.h"
#include "server/daemon/views_private.h"
#include "server/log.h"

/* A view that lost two workers is not given a third. */
enum { DEATHS_MAX = 2 };
enum { REFUSAL_KEY = SV_API_CANONICAL_MAX + 20 };
/* When shared memory is short, how soon to look again. */
static const double slab_retry_ms = 20;

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

void sv_view_flight_was_left(struct sv_service *service, struct sv_flight *flight, bool deadline_passed)
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

/* ---- the end of a flight ---- */

static void refusal_key(uint64_t version, const char *canonical, char key[REFUSAL_KEY])
{
    snprintf(key, REFUSAL_KEY, "%016llx %s", (unsigned long long)version, canonical);
}

bool sv_view_is_refused(struct sv_service *service, uint64_t version, const char *canonical)
{
    char key[REFUSAL_KEY];
    refusal_key(version, canonical, key);
    return sv_lru_get(service->refused, key) != NULL;
}

static void end_flight_with_error(struct sv_service *service, struct sv_flight *flight,
                                  const struct sv_memo_answer *failed)
{
    while (flight->first)
        sv_view_answer_error(sv_view_task_of(flight->first), failed);
    drop_flight(service, flight);
}

static void end_flight_with_kind(struct sv_service *service, struct sv_flight *flight,
                                 enum sv_problem_kind kind, const char *detail, int retry_after_s)
{
    while (flight->first)
        sv_view_answer_kind(sv_view_task_of(flight->first), kind, detail, retry_after_s);
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
        sv_view_task_of(w)->plan_ms = flight->plan_ms;
        sv_view_task_of(w)->queue_ms = flight->queue_ms;
        sv_view_answer_without_drawing(sv_view_task_of(w), flight->scene_version, resolved);
    }
    if (flight->waiters)
        return true;
    drop_flight(service, flight);
    return false;
}

/* ---- handing over ---- */

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

/* Gives the flight to the worker, and to others if it is split; false: it stays in the queue, and nothing
 * more can be handed over now. */
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
    flight->running = sv_worker_draw(worker, &flight->request, &flight->resolved,
                                     service->scenes.serving->epsg, slab, &flight->parts[0]);
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

/* ---- coming back ---- */

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
        struct sv_view_task *task = sv_view_task_of(flight->first);
        task->cache = task->waiter.collapsed ? SV_CACHE_COLLAPSED : SV_CACHE_STORED;
        task->queue_ms = flight->queue_ms;
        task->plan_ms = flight->plan_ms;
        sv_view_answer_picture(task, &flight->resolved, etag, picture, timings);
    }
    drop_flight(service, flight);
}

/* All of the view is drawn, and lies in the slab, which is taken. */
static void view_drawn(struct sv_service *service, struct sv_flight *flight,
                       const struct sv_wire_drawn *answer, struct sv_slab *slab, uint64_t job)
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
        char key[REFUSAL_KEY];
        refusal_key(flight->scene_version, flight->canonical, key);
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
