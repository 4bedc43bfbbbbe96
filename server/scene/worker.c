#include "server/scene/worker.h"

#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
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

/* Anonymous resident memory in bytes. Pages that are still shared with the scene process count, too: the
 * caller takes the value at the fork off. */
static uint64_t anonymous_bytes(void)
{
    unsigned long long total, resident = 0, shared = 0;
    FILE *statm = fopen("/proc/self/statm", "re");
    if (!statm)
        return 0;
    if (fscanf(statm, "%llu %llu %llu", &total, &resident, &shared) != 3)
        resident = shared = 0;
    fclose(statm);
    return (resident - shared) * (uint64_t)sysconf(_SC_PAGESIZE);
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

static void do_view(struct sv_backend *backend, const struct sv_wire_view *job, int slab_fd,
                    uint64_t bytes_at_start, union sv_wire_message *answer)
{
    struct sv_wire_drawn *out = &answer->drawn;
    void *bytes = NULL;
    size_t size = 0;
    sv_wire_init(answer, SV_WIRE_DRAWN, job->head.id);
    for (int s = 0; s < SV_STAGE_COUNT; s++)
        out->timings.ms[s] = -1;
    sv_hooks_before_draw(job->request.width);
    enum sv_status status = sv_backend_draw(backend, &job->request, &job->view, job->epsg, &bytes, &size,
                                            &out->timings, &out->stats, &out->error);
    if (status == SV_OK)
        status = sv_slab_write(slab_fd, job->head.id, bytes, size, &out->error);
    free(bytes);
    uint64_t now = anonymous_bytes();
    out->own_bytes = now > bytes_at_start ? now - bytes_at_start : 0;
    out->status = (uint32_t)status;
}

/* One job; false when the socket is closed or broken. */
static bool serve_one(struct sv_backend *backend, int fd, uint64_t bytes_at_start)
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
        do_view(backend, &job.view, slab_fd, bytes_at_start, &answer);
    else
        status = SV_EFORMAT;
    if (slab_fd >= 0)
        close(slab_fd);
    return status == SV_OK && sv_wire_send(fd, &answer, -1, &error) == SV_OK;
}

_Noreturn void sv_worker_live(struct sv_backend *backend, int fd, pid_t parent)
{
    sigset_t none;
    /* The parent may have died before prctl: then nobody will ever send the signal. */
    if (prctl(PR_SET_PDEATHSIG, SIGKILL) || getppid() != parent)
        _exit(1);
    prctl(PR_SET_NAME, "silvista-worker");
    sigemptyset(&none);
    sigprocmask(SIG_SETMASK, &none, NULL);
    uint64_t bytes_at_start = anonymous_bytes();
    while (serve_one(backend, fd, bytes_at_start))
        ;
    _exit(0);
}
