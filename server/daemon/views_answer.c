/* views_answer.c - what a request for a view is answered with: problems, pictures, descriptions, "not
 * modified". */
#include <stdlib.h>

#include "api/canonical.h"
#include "api/describe.h"
#include "server/daemon/reply.h"
#include "server/daemon/views_private.h"

void sv_view_task_destroy(struct sv_view_task *task)
{
    sv_loop_disarm(task->service->loop, &task->deadline);
    sv_flight_leave(&task->waiter);
    task->exchange->owner = NULL;
    task->exchange->gone = NULL;
    free(task->if_none_match);
    free(task);
}

static void set_timings(struct sv_view_task *task, const struct sv_timings *drawn)
{
    struct sv_timings *t = &task->exchange->timings;
    if (drawn)
        *t = *drawn;
    t->ms[SV_STAGE_QUEUE] = task->queue_ms;
    t->ms[SV_STAGE_PLAN] = task->plan_ms;
    sv_metrics_stages(&task->service->metrics, t);
}

static void answer_problem(struct sv_view_task *task, const struct sv_problem *problem)
{
    struct sv_exchange *exchange = task->exchange;
    set_timings(task, NULL);
    sv_view_task_destroy(task);
    sv_reply(exchange, problem);
}

void sv_view_answer_kind(struct sv_view_task *task, enum sv_problem_kind kind, const char *detail,
                         int retry_after_s)
{
    struct sv_problem problem = {.kind = kind, .detail = detail, .retry_after_s = retry_after_s};
    answer_problem(task, &problem);
}

void sv_view_answer_error(struct sv_view_task *task, const struct sv_memo_answer *failed)
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
static void set_view_headers(struct sv_view_task *task, const struct sv_resolved_view *resolved,
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

void sv_view_answer_picture(struct sv_view_task *task, const struct sv_resolved_view *resolved,
                            const char *etag, struct sv_picture_bytes *picture,
                            const struct sv_timings *drawn)
{
    struct sv_exchange *exchange = task->exchange;
    struct sv_cell_use cell = picture->cell;
    if (!drawn && cell.kind == SV_CELL_USE_BUILT) /* for whoever asked first */
        cell.kind = SV_CELL_USE_HIT;
    set_timings(task, drawn);
    set_view_headers(task, resolved, etag, &cell, false);
    sv_exchange_set_body(exchange, picture->bytes, picture->size, sv_picture_unref, sv_picture_ref(picture));
    sv_view_task_destroy(task);
    sv_exchange_answer(exchange, 200);
}

static void answer_not_modified(struct sv_view_task *task, const struct sv_resolved_view *resolved,
                                const char *etag)
{
    struct sv_exchange *exchange = task->exchange;
    sv_metrics_count(&task->service->metrics, SV_COUNT_NOT_MODIFIED);
    task->cache = SV_CACHE_HIT;
    set_timings(task, NULL);
    set_view_headers(task, resolved, etag, NULL, true);
    sv_view_task_destroy(task);
    sv_exchange_answer(exchange, 304);
}

static void answer_description(struct sv_view_task *task, uint64_t version,
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
        sv_view_answer_kind(task, SV_PROBLEM_INTERNAL, "out of memory", 0);
        return;
    }
    task->cache = SV_CACHE_BYPASS;
    set_timings(task, NULL);
    set_view_headers(task, resolved, etag, NULL, false);
    sv_exchange_take_text(exchange, text);
    sv_view_task_destroy(task);
    sv_exchange_answer(exchange, 200);
}

bool sv_view_answer_without_drawing(struct sv_view_task *task, uint64_t version,
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
    sv_view_answer_picture(task, resolved, etag, picture, NULL);
    sv_picture_unref(picture);
    return true;
}
