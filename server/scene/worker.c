#include "server/scene/worker.h"

#include <ctype.h>
#include <poll.h>
#include <signal.h>
#include <stdbool.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/prctl.h>
#include <time.h>
#include <unistd.h>

#include "server/log.h"
#include "server/scene/hooks.h"
#include "server/slab.h"
#include "server/wire.h"

static double now_ms(void)
{
    struct timespec t;
    clock_gettime(CLOCK_MONOTONIC, &t);
    return (double)t.tv_sec * 1e3 + (double)t.tv_nsec * 1e-6;
}

/* Memory of this process that it shares with nobody: pages it has written since the fork, and new ones; not those of
 * memory files (panels, pictures), of which it may be the only one to have touched a page so far. The kernel walks all
 * pages for it (1 ms for 300 MB), so it is looked up at the first job and at every 16th. */
static uint64_t own_bytes(void)
{
    static uint64_t known;
    static unsigned calls;
    char line[512];
    unsigned long long kb, sum = 0;
    bool shared = false;
    if (calls++ % 16 != 0)
        return known;
    FILE *smaps = fopen("/proc/self/smaps", "re");
    while (smaps && fgets(line, sizeof line, smaps))
        if (!isupper((unsigned char)line[0])) /* a mapping's own line begins with its address */
            shared = strstr(line, "/memfd:") != NULL;
        else if (!shared && (sscanf(line, "Private_Dirty: %llu kB", &kb) == 1 ||
                             sscanf(line, "Private_Clean: %llu kB", &kb) == 1))
            sum += kb;
    if (smaps)
        fclose(smaps);
    known = (uint64_t)sum << 10;
    return known;
}

static void do_resolve(struct sv_backend *backend, const struct sv_wire_resolve *job,
                       union sv_wire_message *answer)
{
    struct sv_wire_resolved *out = &answer->resolved;
    double start = now_ms();
    bool has_ground = false;
    sv_wire_init(answer, SV_WIRE_RESOLVED, job->head.id);
    out->status = (uint32_t)sv_backend_resolve(backend, &job->request, &out->view, &has_ground,
                                               &out->ground_z, &out->error);
    out->has_ground = has_ground;
    out->plan_ms = now_ms() - start;
}

/* Asks for help with a form that is to be built: what others build is only loaded here. */
static void tell_lack(const struct sv_backend *backend, const struct sv_resolved_view *view, int lacks_fd)
{
    uint8_t form = (uint8_t)sv_backend_lacks(backend, view);
    if (form && write(lacks_fd, &form, 1) != 1)
        sv_log(SV_LOG_DEBUG, "worker", "nobody is asked to build form %d", form);
}

static void forget_times(struct sv_timings *timings)
{
    for (int s = 0; s < SV_STAGE_COUNT; s++)
        timings->ms[s] = -1;
}

/* All bands are there: the picture's bytes. */
static enum sv_status end_bands(struct sv_backend *backend, const struct sv_wire_view *job,
                                struct sv_bands_map *map, struct sv_wire_drawn *out)
{
    struct sv_bands_part all = sv_bands_join(map->parts, job->bands);
    void *bytes = NULL;
    size_t size = 0;
    sv_hooks_before_encode(job->request.width, job->band);
    enum sv_status status = sv_backend_encode(backend, &job->request, &job->view, &map->picture, job->epsg, &all,
                                              &bytes, &size, &out->error);
    if (status == SV_OK)
        status = sv_bands_end(map, &job->request, job->head.id, bytes, size, &out->error);
    free(bytes);
    out->timings = all.timings;
    out->stats = all.stats;
    return status;
}

/* A band of a picture, and what is to be done when it is the last. */
static enum sv_status draw_band(struct sv_backend *backend, const struct sv_wire_view *job, int slab_fd,
                                struct sv_wire_drawn *out)
{
    static struct sv_bands_map map;
    struct sv_bands_part part = {0};
    struct sv_picture rows = {0};
    enum sv_status status = sv_bands_map(slab_fd, &job->request, &map, &out->error);
    if (status != SV_OK)
        return status;
    struct sv_backend_band band = {
        .row_first = job->band_first, .row_count = job->band_rows, .shared = sv_bands_shared(&map)};
    forget_times(&part.timings);
    status = sv_backend_draw_band(backend, &job->request, &job->view, &band, &rows, &part, &out->error);
    if (status == SV_OK) {
        out->part = !sv_bands_put(&map, job->band, job->bands, job->band_first, &rows, &part);
        for (int k = 0; k < SV_LAYER_COUNT; k++)
            sv_image_free(&rows.layer[k]);
    }
    if (status == SV_OK && !out->part)
        status = end_bands(backend, job, &map, out);
    sv_bands_leave(&map);
    return status;
}

static enum sv_status draw_whole(struct sv_backend *backend, const struct sv_wire_view *job, int slab_fd,
                                 struct sv_wire_drawn *out)
{
    void *bytes = NULL;
    size_t size = 0;
    enum sv_status status = sv_backend_draw(backend, &job->request, &job->view, job->epsg, &bytes, &size,
                                            &out->timings, &out->stats, &out->error);
    if (status == SV_OK)
        status = sv_slab_write(slab_fd, job->head.id, bytes, size, &out->error);
    free(bytes);
    return status;
}

static void do_view(struct sv_backend *backend, const struct sv_wire_view *job, int slab_fd, int lacks_fd,
                    union sv_wire_message *answer)
{
    struct sv_wire_drawn *out = &answer->drawn;
    sv_wire_init(answer, SV_WIRE_DRAWN, job->head.id);
    forget_times(&out->timings);
    tell_lack(backend, &job->view, lacks_fd);
    sv_hooks_before_draw(job->request.width, job->band);
    enum sv_status status =
        job->bands > 1 ? draw_band(backend, job, slab_fd, out) : draw_whole(backend, job, slab_fd, out);
    out->own_bytes = own_bytes();
    out->status = (uint32_t)status;
}

static void do_build(struct sv_backend *backend, const struct sv_wire_build *job, union sv_wire_message *answer)
{
    struct sv_wire_built *out = &answer->built;
    sv_wire_init(answer, SV_WIRE_BUILT, job->head.id);
    sv_hooks_before_draw(job->request.width, 0);
    out->status =
        (uint32_t)sv_backend_ahead(backend, &job->request, job->most, &out->built, &out->left, &out->error);
    out->own_bytes = own_bytes();
}

/* Whether anything is said to this worker, a stop or the end. */
static bool is_called(void *context)
{
    struct pollfd polled = {.fd = *(const int *)context, .events = POLLIN};
    bool called;
    while (!(called = poll(&polled, 1, 0) != 0) && sv_hooks_refining_held())
        ;
    return called;
}

static void do_refine(struct sv_backend *backend, const struct sv_wire_refine *job, int fd, union sv_wire_message *answer)
{
    struct sv_wire_refined *out = &answer->refined;
    struct sv_backend_refine_options options = {.samples = job->samples, .stop = is_called, .context = &fd};
    sv_wire_init(answer, SV_WIRE_REFINED, job->head.id);
    out->status =
        (uint32_t)sv_backend_refine(backend, &job->request, &options, &out->refined, &out->left, &out->error);
    out->own_bytes = own_bytes();
}

/* One job; false when the socket is closed or broken. */
static bool serve_one(struct sv_backend *backend, int fd, int lacks_fd)
{
    static union sv_wire_message job, answer;
    struct sv_error error;
    int slab_fd = -1;
    enum sv_status status = sv_wire_receive(fd, &job, &slab_fd, &error);
    if (status != SV_OK)
        return false;
    if (job.head.type == SV_WIRE_RESOLVE)
        do_resolve(backend, &job.resolve, &answer);
    else if (job.head.type == SV_WIRE_VIEW && slab_fd >= 0)
        do_view(backend, &job.view, slab_fd, lacks_fd, &answer);
    else if (job.head.type == SV_WIRE_BUILD)
        do_build(backend, &job.build, &answer);
    else if (job.head.type == SV_WIRE_REFINE)
        do_refine(backend, &job.refine, fd, &answer);
    else if (job.head.type != SV_WIRE_STOP)
        status = SV_EFORMAT;
    if (slab_fd >= 0)
        close(slab_fd);
    if (job.head.type == SV_WIRE_STOP) /* what it is about is done */
        return true;
    return status == SV_OK && sv_wire_send(fd, &answer, -1, &error) == SV_OK;
}

_Noreturn void sv_worker_live(struct sv_backend *backend, int fd, int lacks_fd, pid_t parent)
{
    sigset_t none;
    /* The parent may have died before prctl: then nobody will ever send the signal. */
    if (prctl(PR_SET_PDEATHSIG, SIGKILL) || getppid() != parent)
        _exit(1);
    prctl(PR_SET_NAME, "silvista-worker");
    sigemptyset(&none);
    sigprocmask(SIG_SETMASK, &none, NULL);
    while (serve_one(backend, fd, lacks_fd))
        ;
    _exit(0);
}
