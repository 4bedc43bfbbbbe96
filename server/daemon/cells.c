#include "server/daemon/cells.h"

#include <stdlib.h>

#include "api/cells_doc.h"
#include "api/cells_parse.h"
#include "server/daemon/ahead.h"
#include "server/daemon/pages.h"
#include "server/daemon/reply.h"
#include "server/daemon/views.h"

/* Panels are listed in room for as many as there are, and some that come meanwhile. */
enum { SPARE = 64 };

/* False, with the answer given: no scene serves. */
static bool has_scene(struct sv_service *service, struct sv_exchange *exchange)
{
    if (service->scenes.serving)
        return true;
    sv_reply_retry(exchange, SV_PROBLEM_NOT_READY, "no scene is loaded at the moment",
                   sv_service_scene_retry_s(service));
    return false;
}

static struct sv_cell_cache *cache_of(const struct sv_service *service)
{
    return service->scenes.serving ? service->scenes.serving->cells.cache : NULL;
}

static char *list(const struct sv_service *service, size_t *bytes)
{
    struct sv_cell_cache *cache = cache_of(service);
    struct sv_cells_facts facts = {.ahead = service->ahead.count, .refine = sv_refine_count(&service->refine)};
    struct sv_cell_cache_item *items = NULL;
    struct sv_cell_listed *cells = NULL;
    size_t room = 0, count = 0;
    if (cache) {
        sv_cell_cache_stats(cache, &facts.stats);
        room = (size_t)facts.stats.panels + facts.stats.building + SPARE;
        items = calloc(room, sizeof *items);
        cells = calloc(room, sizeof *cells);
        count = items && cells ? sv_cell_cache_list(cache, sv_loop_now_ms() * 1e-3, items, room) : 0;
        count = count < room ? count : room;
    }
    facts.cell_count = count > 0 ? sv_cell_listing(items, count, cells) : 0;
    facts.shadows = sv_cell_listing_shadows(items, items ? count : 0);
    facts.cells = cells;
    facts.items = items;
    char *text = cache && (!items || !cells) ? NULL : sv_api_cells_doc(&facts, bytes);
    free(items);
    free(cells);
    return text;
}

void sv_cells_page_list(struct sv_service *service, struct sv_exchange *exchange)
{
    size_t bytes;
    if (has_scene(service, exchange))
        sv_reply_document(exchange, "application/json", NULL, list(service, &bytes));
}

void sv_cells_page_drop(struct sv_service *service, struct sv_exchange *exchange)
{
    if (!sv_page_is_admin(service, exchange) || !has_scene(service, exchange))
        return;
    if (cache_of(service))
        sv_cell_cache_clear(cache_of(service));
    sv_exchange_answer(exchange, 204);
}

/* All of them or, where there is no room for so many, none. */
static void add_jobs(struct sv_service *service, struct sv_exchange *exchange,
                     const struct sv_view_request *views, size_t count)
{
    uint64_t ids[SV_API_CELLS_VIEWS_MAX];
    size_t bytes, added = 0;
    if (service->ahead.count + count <= SV_AHEAD_JOBS_MAX)
        while (added < count && (ids[added] = sv_ahead_add(service, &views[added])) != 0)
            added++;
    sv_views_pump_soon(service);
    if (added < count) {
        sv_reply_retry(exchange, SV_PROBLEM_OVERLOADED, "too many jobs wait to build cells ahead",
                       sv_queue_retry_after_s(&service->queue, (size_t)service->settings->workers));
        return;
    }
    char *text = sv_api_cells_jobs(ids, count, &bytes);
    if (!text) {
        sv_reply_problem(exchange, SV_PROBLEM_INTERNAL, "out of memory");
        return;
    }
    sv_api_answer_document("application/json", NULL, &exchange->headers);
    sv_exchange_take_text(exchange, text);
    sv_exchange_answer(exchange, 202);
}

void sv_cells_page_build(struct sv_service *service, struct sv_exchange *exchange)
{
    struct sv_errors errors;
    size_t count = 0;
    if (!sv_page_is_admin(service, exchange) || !has_scene(service, exchange))
        return;
    if (service->draining) {
        sv_reply_problem(exchange, SV_PROBLEM_DRAINING, NULL);
        return;
    }
    struct sv_view_request *views = calloc(SV_API_CELLS_VIEWS_MAX, sizeof *views);
    if (!views) {
        sv_reply_problem(exchange, SV_PROBLEM_INTERNAL, "out of memory");
        return;
    }
    sv_errors_init(&errors);
    struct sv_problem problem = {.errors = &errors};
    problem.kind = sv_api_cells_parse(exchange->body ? exchange->body : "", exchange->body_bytes,
                                      &service->limits, views, &count, &errors);
    if (problem.kind != SV_PROBLEM_NONE)
        sv_reply(exchange, &problem);
    else
        add_jobs(service, exchange, views, count);
    sv_errors_finish(&errors);
    free(views);
}

void sv_cells_measure(struct sv_service *service)
{
    struct sv_cell_cache_stats s = {0};
    struct sv_metrics *m = &service->metrics;
    if (cache_of(service))
        sv_cell_cache_stats(cache_of(service), &s);
    m->counter[SV_COUNT_CELL_HIT] = s.hits;
    m->counter[SV_COUNT_CELL_MISS] = s.misses;
    m->counter[SV_COUNT_CELL_WAIT] = s.waits;
    m->counter[SV_COUNT_CELL_BUILT] = s.builds;
    m->counter[SV_COUNT_CELL_REFINED] = s.refined;
    m->counter[SV_COUNT_CELL_EVICTED] = s.evictions;
    m->counter[SV_COUNT_CELL_DROPPED] = s.drops;
    m->counter[SV_COUNT_CELL_FULL] = s.full;
    m->gauge[SV_GAUGE_CELL_PANELS] = s.panels;
    m->gauge[SV_GAUGE_CELL_BYTES] = (double)s.used_bytes;
    m->gauge[SV_GAUGE_CELL_BUDGET] = (double)s.budget_bytes;
    m->gauge[SV_GAUGE_CELL_AHEAD] = (double)service->ahead.count;
    m->gauge[SV_GAUGE_CELL_REFINE] = (double)sv_refine_count(&service->refine);
}
