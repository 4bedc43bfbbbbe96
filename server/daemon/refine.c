#include "server/daemon/refine.h"

#include <stdlib.h>

#include "server/daemon/service.h"
#include "server/log.h"

/* ---- what is in demand ---- */

static struct sv_refine_cell *find(struct sv_refine *refine, uint64_t id)
{
    for (int k = 0; k < SV_REFINE_CELLS; k++)
        if (refine->cells[k].id == id)
            return &refine->cells[k];
    return NULL;
}

/* The place of the cell that was longest not looked at. */
static struct sv_refine_cell *make_place(struct sv_refine *refine, uint64_t id)
{
    struct sv_refine_cell *oldest = NULL;
    for (int k = 0; k < SV_REFINE_CELLS; k++) {
        struct sv_refine_cell *c = &refine->cells[k];
        if (c != refine->running && (!oldest || c->last < oldest->last))
            oldest = c;
    }
    *oldest = (struct sv_refine_cell){.id = id};
    return oldest;
}

void sv_refine_seen(struct sv_service *service, const struct sv_view_request *request,
                    const struct sv_cell_use *use)
{
    struct sv_refine *refine = &service->refine;
    bool from_panels = use->kind == SV_CELL_USE_BUILT || use->kind == SV_CELL_USE_HIT;
    if (!from_panels || sv_cell_use_refined(use) || atoi(service->settings->refine_samples) == 0)
        return;
    struct sv_refine_cell *cell = find(refine, use->id);
    if (!cell)
        cell = make_place(refine, use->id);
    cell->request = *request;
    cell->wanted++;
    cell->last = ++refine->views;
}

struct sv_refine_cell *sv_refine_next(struct sv_refine *refine)
{
    struct sv_refine_cell *best = NULL;
    for (int k = 0; k < SV_REFINE_CELLS; k++) {
        struct sv_refine_cell *c = &refine->cells[k];
        if (c->wanted >= SV_REFINE_DEMAND && (!best || c->wanted > best->wanted))
            best = c;
    }
    return best;
}

size_t sv_refine_count(const struct sv_refine *refine)
{
    size_t count = 0;
    for (int k = 0; k < SV_REFINE_CELLS; k++)
        count += refine->cells[k].wanted >= SV_REFINE_DEMAND;
    return count;
}

/* ---- who refines ---- */

/* A worker that does not stop is hung. */
static void on_deadline(void *context)
{
    struct sv_service *service = context;
    struct sv_refine *refine = &service->refine;
    sv_scenes_kill_work(&service->scenes, refine, "it refines on after it was told to stop");
    refine->running->wanted = 0;
    refine->running = NULL;
    sv_refine_pump(service);
}

void sv_refine_init(struct sv_service *service)
{
    service->refine.deadline = (struct sv_timer){.due = on_deadline, .context = service};
}

void sv_refine_clear(struct sv_service *service)
{
    sv_loop_disarm(service->loop, &service->refine.deadline);
    service->refine.running = NULL;
    for (int k = 0; k < SV_REFINE_CELLS; k++)
        service->refine.cells[k] = (struct sv_refine_cell){0};
}

static void stop(struct sv_service *service)
{
    struct sv_refine *refine = &service->refine;
    double until_ms = sv_loop_now_ms() + (double)service->settings->deadline_ms;
    for (struct sv_scene_process *p = service->scenes.processes; p; p = p->next)
        sv_crew_stop(&p->crew, refine);
    if (!refine->deadline.place && sv_loop_arm(service->loop, &refine->deadline, until_ms) != SV_OK)
        sv_log(SV_LOG_WARNING, "refine", "out of memory: a worker that is told to stop has no deadline");
}

/* Who may have a panel begun, if it is idle; else anybody, the last of the idle: views take the first. */
static struct sv_worker *choose(struct sv_refine *refine, struct sv_crew *crew)
{
    struct sv_worker *worker = sv_crew_find(crew, refine->worker);
    if (worker)
        return worker->state == SV_WORKER_IDLE ? worker : NULL;
    for (struct sv_worker *w = crew->workers; w; w = w->next)
        if (w->state == SV_WORKER_IDLE)
            worker = w;
    return worker;
}

void sv_refine_pump(struct sv_service *service)
{
    struct sv_refine *refine = &service->refine;
    struct sv_scene_process *scene = service->scenes.serving;
    size_t left_idle = service->settings->workers > 1 ? 1 : 0;
    bool wanted = sv_queue_first(&service->queue) || service->ahead.count > service->ahead.running;
    if (refine->running) {
        if (wanted && scene && !sv_crew_idle(&scene->crew))
            stop(service);
        return;
    }
    struct sv_refine_cell *next = sv_refine_next(refine);
    if (!next || wanted || !scene || service->draining ||
        sv_crew_busy(&scene->crew) + left_idle >= sv_crew_alive(&scene->crew))
        return;
    struct sv_worker *worker = choose(refine, &scene->crew);
    if (!worker || !sv_worker_refine(worker, &next->request, atoi(service->settings->refine_samples), refine))
        return;
    refine->running = next;
    refine->worker = worker->id;
}

static void ended(struct sv_service *service)
{
    sv_loop_disarm(service->loop, &service->refine.deadline);
    service->refine.running = NULL;
}

void sv_refine_done(void *context, void *work, const struct sv_wire_refined *answer)
{
    struct sv_service *service = context;
    struct sv_refine_cell *cell = service->refine.running;
    enum sv_status status = sv_wire_status(answer->status);
    (void)work;
    ended(service);
    if (status != SV_OK)
        sv_log(SV_LOG_DEBUG, "refine", "%s: %s", answer->error.field, answer->error.message);
    cell->refined += status == SV_OK ? answer->refined : 0;
    if (status == SV_OK && answer->left > 0)
        return;
    if (cell->refined > 0)
        sv_pictures_outdate(service->pictures, cell->id);
    cell->wanted = cell->refined = 0;
}

void sv_refine_lost(void *context, void *work)
{
    struct sv_service *service = context;
    (void)work;
    service->refine.running->wanted = 0;
    ended(service);
}
