#include "server/daemon/split.h"

#include "server/daemon/service.h"
#include "server/daemon/views.h"

/* Smaller pictures are not worth a second worker: processor ms of the whole and of the longer half
 * (forest_bands, 45,000 trees, from cells) are 0.9 and 0.8 of 64 x 64, 0.9 and 0.7 (flight), 8.8 and 7.0
 * (walk) of 128 x 128, 14 and 10, 36 and 24 of 512 x 512. One client of the demo on two cores, medians of
 * whole answers: the flight at 512 x 512 from cells takes as long split as whole (21 ms), the walk 0.78 times
 * as long, directly drawn pictures 0.57 and 0.49 times; with four clients as many pictures come. */
enum { PIXELS_MIN = 128 * 128 };

bool sv_split_pays(const struct sv_view_request *request, const struct sv_resolved_view *view)
{
    return request->width * request->height >= PIXELS_MIN && sv_bands_can(view);
}

void sv_split_flight(struct sv_service *service, struct sv_flight *flight)
{
    struct sv_error error;
    if (flight->slab || !sv_split_pays(&flight->request, &flight->resolved) ||
        sv_queue_first(&service->queue) || sv_crew_idle_count(&service->scenes.serving->crew) < SV_BANDS_MAX)
        return;
    size_t bytes = sv_bands_bytes(&flight->request) + sv_views_picture_bytes_max(&flight->request);
    if (sv_slab_take(service->slabs, bytes, &flight->slab, &error) != SV_OK) {
        flight->slab = NULL;
        return;
    }
    int height = flight->request.height;
    flight->part_count = SV_BANDS_MAX;
    flight->answer.head.id = 0;
    for (int k = 0; k < SV_BANDS_MAX; k++) {
        struct sv_flight_part *p = &flight->parts[k];
        p->done = false;
        p->row_first = height * k / SV_BANDS_MAX;
        p->row_count = height * (k + 1) / SV_BANDS_MAX - p->row_first;
    }
}

bool sv_split_start(struct sv_service *service, struct sv_flight *flight, struct sv_worker *worker)
{
    struct sv_scene_process *scene = service->scenes.serving;
    for (int k = 0; k < flight->part_count; k++) {
        struct sv_flight_part *p = &flight->parts[k];
        struct sv_worker_band band = {
            .index = k, .count = flight->part_count, .row_first = p->row_first, .row_count = p->row_count};
        for (; worker && !p->done && !p->running; worker = sv_crew_idle(&scene->crew))
            p->running = sv_worker_draw_band(worker, &flight->request, &flight->resolved, scene->epsg, &band,
                                             flight->slab, p);
        flight->running = flight->running || p->running;
    }
    return flight->running;
}

void sv_split_forget(struct sv_flight *flight, bool written)
{
    if (!flight->slab)
        return;
    (written ? sv_slab_discard : sv_slab_give)(flight->slab);
    flight->slab = NULL;
    flight->part_count = 1;
    for (int k = 0; k < SV_BANDS_MAX; k++)
        flight->parts[k].done = false;
}
