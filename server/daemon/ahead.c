#include "server/daemon/ahead.h"

#include <math.h>
#include <stdlib.h>

#include "server/daemon/service.h"
#include "server/log.h"

/* A client's next view is within this of its last one, in place and time; less than the least is standing
 * still. */
static const double jump_m = 20, pause_ms = 5000, least_m = 0.02;
/* So far ahead panels are wanted: longer than a few of them take to build. */
static const double horizon_ms = 700;
/* ... and not farther than so many of its steps: a guess, after all. */
static const double steps_max = 8;

struct sv_ahead_job {
    struct sv_ahead_job *next, *previous;
    struct sv_service *service;
    uint64_t id;
    struct sv_view_request request;
    struct sv_ahead_mover *mover; /* NULL: asked for by name */
    struct sv_timer deadline;     /* while it runs */
    bool running;
};

/* ---- the line ---- */

static void enter(struct sv_ahead *ahead, struct sv_ahead_job *job)
{
    job->next = NULL;
    job->previous = ahead->last;
    *(ahead->last ? &ahead->last->next : &ahead->first) = job;
    ahead->last = job;
    ahead->count++;
}

static void leave(struct sv_ahead *ahead, struct sv_ahead_job *job)
{
    *(job->previous ? &job->previous->next : &ahead->first) = job->next;
    *(job->next ? &job->next->previous : &ahead->last) = job->previous;
    ahead->count--;
}

static void forget(struct sv_ahead_job *job)
{
    struct sv_service *service = job->service;
    sv_loop_disarm(service->loop, &job->deadline);
    service->ahead.running -= job->running;
    leave(&service->ahead, job);
    if (job->mover)
        job->mover->job = NULL;
    free(job);
}

static void on_deadline(void *context)
{
    struct sv_ahead_job *job = context;
    sv_scenes_kill_work(&job->service->scenes, job, "building ahead passed the deadline");
    forget(job);
}

static struct sv_ahead_job *add(struct sv_service *service, const struct sv_view_request *request,
                                struct sv_ahead_mover *mover)
{
    struct sv_ahead *ahead = &service->ahead;
    struct sv_ahead_job *job = ahead->count < SV_AHEAD_JOBS_MAX ? calloc(1, sizeof *job) : NULL;
    if (!job)
        return NULL;
    *job = (struct sv_ahead_job){
        .service = service, .id = ++ahead->last_id, .request = *request, .mover = mover};
    job->deadline = (struct sv_timer){.due = on_deadline, .context = job};
    enter(ahead, job);
    return job;
}

uint64_t sv_ahead_add(struct sv_service *service, const struct sv_view_request *request)
{
    struct sv_ahead_job *job = add(service, request, NULL);
    return job ? job->id : 0;
}

/* One worker is left for views, where there is more than one. */
static bool may_run(const struct sv_service *service)
{
    size_t workers = (size_t)service->settings->workers;
    return service->ahead.running < (workers > 1 ? workers - 1 : 1);
}

static void start(struct sv_service *service, struct sv_ahead_job *job, struct sv_worker *worker)
{
    double until_ms = sv_loop_now_ms() + (double)service->settings->deadline_ms;
    if (sv_loop_arm(service->loop, &job->deadline, until_ms) != SV_OK) {
        forget(job);
        return;
    }
    job->running = sv_worker_build(worker, &job->request, 1, job);
    service->ahead.running += job->running;
    if (!job->running)
        sv_loop_disarm(service->loop, &job->deadline);
}

void sv_ahead_pump(struct sv_service *service)
{
    struct sv_scene_process *scene = service->scenes.serving;
    struct sv_worker *worker;
    while (scene && !service->draining && !sv_queue_first(&service->queue) && may_run(service) &&
           (worker = sv_crew_idle(&scene->crew))) {
        struct sv_ahead_job *job = service->ahead.first;
        while (job && job->running)
            job = job->next;
        if (!job)
            return;
        start(service, job, worker);
    }
}

void sv_ahead_clear(struct sv_service *service)
{
    while (service->ahead.first)
        forget(service->ahead.first);
}

void sv_ahead_built(void *context, void *work, const struct sv_wire_built *answer)
{
    struct sv_service *service = context;
    struct sv_ahead_job *job = work;
    enum sv_status status = sv_wire_status(answer->status);
    if (status != SV_OK)
        sv_log(SV_LOG_DEBUG, "ahead", "%s: %s", answer->error.field, answer->error.message);
    if (status != SV_OK || answer->left == 0 || answer->built == 0) {
        forget(job);
        return;
    }
    sv_loop_disarm(service->loop, &job->deadline);
    job->running = false;
    service->ahead.running--;
    leave(&service->ahead, job);
    enter(&service->ahead, job);
}

void sv_ahead_lost(void *context, void *work)
{
    (void)context;
    forget(work);
}

/* ---- who moves ---- */

bool sv_ahead_guess(struct sv_vec3 before, struct sv_vec3 now, double dt_ms, struct sv_vec3 *next)
{
    struct sv_vec3 step = sv_sub(now, before);
    double moved_m = sv_length(step);
    if (!(moved_m >= least_m && moved_m <= jump_m && dt_ms > 0 && dt_ms <= pause_ms))
        return false;
    /* Whole steps: who goes on evenly comes by where panels were built, at every one of them. */
    *next = sv_madd(now, step, fmin(fmax(rint(horizon_ms / dt_ms), 1), steps_max));
    return true;
}

/* Who was near that eye with pictures of that size a moment ago; else the place of who was longest not seen.
 */
static struct sv_ahead_mover *find_mover(struct sv_ahead *ahead, const struct sv_view_request *request,
                                         struct sv_vec3 eye, double now_ms)
{
    struct sv_ahead_mover *oldest = &ahead->movers[0], *nearest = NULL;
    double best_m = jump_m;
    for (int k = 0; k < SV_AHEAD_MOVERS; k++) {
        struct sv_ahead_mover *m = &ahead->movers[k];
        double away_m = sv_length(sv_sub(eye, m->eye));
        if (m->last_ms < oldest->last_ms)
            oldest = m;
        if (m->width != request->width || m->height != request->height || now_ms - m->last_ms > pause_ms ||
            !(away_m <= best_m))
            continue;
        best_m = away_m;
        nearest = m;
    }
    if (nearest)
        return nearest;
    if (oldest->job)
        oldest->job->mover = NULL;
    *oldest = (struct sv_ahead_mover){.width = request->width, .height = request->height, .eye = eye};
    return oldest;
}

/* The same view from another place: heading and pitch as they were resolved, as high over the ground where
 * the client said it so. */
static struct sv_view_request moved(const struct sv_view_request *request,
                                    const struct sv_resolved_view *view, struct sv_vec3 eye)
{
    struct sv_view_request next = *request;
    bool over_ground = request->eye.form != SV_PLACE_NONE && !request->eye.has_z && isfinite(view->ground_z);
    next.eye = (struct sv_place){.form = SV_PLACE_XY,
                                 .x = eye.x,
                                 .y = eye.y,
                                 .has_z = !over_ground,
                                 .z = over_ground ? 0 : eye.z,
                                 .agl = over_ground ? request->eye.agl : 0};
    next.target = (struct sv_place){.form = SV_PLACE_NONE};
    next.range_m = 0;
    next.crs_epsg = 0;
    next.north_true = false;
    next.heading_rad = view->heading_rad;
    next.pitch_rad = view->pitch_rad;
    return next;
}

void sv_ahead_seen(struct sv_service *service, const struct sv_view_request *request,
                   const struct sv_resolved_view *view)
{
    if (service->settings->workers < 2)
        return;
    double now_ms = sv_loop_now_ms();
    struct sv_vec3 eye = view->camera.eye, next;
    struct sv_ahead_mover *mover = find_mover(&service->ahead, request, eye, now_ms);
    bool moves = sv_ahead_guess(mover->eye, eye, now_ms - mover->last_ms, &next);
    mover->eye = eye;
    mover->last_ms = now_ms;
    if (!moves || (mover->job && mover->job->running))
        return;
    struct sv_view_request wanted = moved(request, view, next);
    if (mover->job)
        mover->job->request = wanted;
    else
        mover->job = add(service, &wanted, mover);
}
