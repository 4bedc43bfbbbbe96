#include "server/daemon/loop.h"

#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <sys/epoll.h>
#include <sys/timerfd.h>
#include <time.h>
#include <unistd.h>

enum { EVENTS_A_TURN = 64 };

struct sv_watch {
    struct sv_watch *next_dead;
    sv_loop_event call; /* NULL: unwatched, freed after the turn */
    void *context;
    int fd;
};

struct sv_loop {
    int epoll_fd, timer_fd;
    bool stop;
    struct sv_timer **heap; /* binary heap by at_ms */
    size_t heap_count, heap_room;
    double armed_ms; /* what timer_fd is set to; INFINITY: nothing */
    struct sv_watch *dead;
    sv_loop_before_wait before_wait;
    void *before_wait_context;
};

double sv_loop_now_ms(void)
{
    struct timespec t;
    clock_gettime(CLOCK_MONOTONIC, &t);
    return (double)t.tv_sec * 1e3 + (double)t.tv_nsec * 1e-6;
}

enum sv_status sv_loop_create(struct sv_loop **loop, struct sv_error *error)
{
    struct sv_loop *l = calloc(1, sizeof *l);
    if (!l)
        return sv_fail(error, SV_ENOMEM, "loop", "out of memory");
    l->epoll_fd = epoll_create1(EPOLL_CLOEXEC);
    l->timer_fd = timerfd_create(CLOCK_MONOTONIC, TFD_CLOEXEC | TFD_NONBLOCK);
    l->armed_ms = INFINITY;
    struct epoll_event event = {.events = EPOLLIN, .data.ptr = NULL}; /* NULL: the timer */
    if (l->epoll_fd < 0 || l->timer_fd < 0 || epoll_ctl(l->epoll_fd, EPOLL_CTL_ADD, l->timer_fd, &event)) {
        enum sv_status status = sv_fail(error, SV_EIO, "loop", "%s", strerror(errno));
        sv_loop_destroy(l);
        return status;
    }
    *loop = l;
    return SV_OK;
}

static void bury(struct sv_loop *loop)
{
    while (loop->dead) {
        struct sv_watch *watch = loop->dead;
        loop->dead = watch->next_dead;
        free(watch);
    }
}

void sv_loop_destroy(struct sv_loop *loop)
{
    if (!loop)
        return;
    bury(loop);
    for (size_t i = 0; i < loop->heap_count; i++)
        loop->heap[i]->place = 0;
    free(loop->heap);
    if (loop->timer_fd >= 0)
        close(loop->timer_fd);
    if (loop->epoll_fd >= 0)
        close(loop->epoll_fd);
    free(loop);
}

enum sv_status sv_loop_watch(struct sv_loop *loop, int fd, uint32_t events, sv_loop_event call, void *context,
                             struct sv_watch **watch, struct sv_error *error)
{
    struct sv_watch *w = calloc(1, sizeof *w);
    if (!w)
        return sv_fail(error, SV_ENOMEM, "loop", "out of memory");
    *w = (struct sv_watch){.call = call, .context = context, .fd = fd};
    struct epoll_event event = {.events = events, .data.ptr = w};
    if (epoll_ctl(loop->epoll_fd, EPOLL_CTL_ADD, fd, &event)) {
        free(w);
        return sv_fail(error, SV_EIO, "loop", "watching descriptor %d: %s", fd, strerror(errno));
    }
    *watch = w;
    return SV_OK;
}

void sv_loop_unwatch(struct sv_loop *loop, struct sv_watch *watch)
{
    if (!watch)
        return;
    epoll_ctl(loop->epoll_fd, EPOLL_CTL_DEL, watch->fd, NULL);
    watch->call = NULL;
    watch->next_dead = loop->dead;
    loop->dead = watch;
}

static void heap_put(struct sv_loop *loop, size_t i, struct sv_timer *timer)
{
    loop->heap[i] = timer;
    timer->place = i + 1;
}

/* Moves the timer at i to where it belongs. */
static void heap_settle(struct sv_loop *loop, size_t i)
{
    struct sv_timer *timer = loop->heap[i];
    while (i > 0 && loop->heap[(i - 1) / 2]->at_ms > timer->at_ms) {
        heap_put(loop, i, loop->heap[(i - 1) / 2]);
        i = (i - 1) / 2;
    }
    for (;;) {
        size_t child = 2 * i + 1;
        if (child + 1 < loop->heap_count && loop->heap[child + 1]->at_ms < loop->heap[child]->at_ms)
            child++;
        if (child >= loop->heap_count || loop->heap[child]->at_ms >= timer->at_ms)
            break;
        heap_put(loop, i, loop->heap[child]);
        i = child;
    }
    heap_put(loop, i, timer);
}

enum sv_status sv_loop_arm(struct sv_loop *loop, struct sv_timer *timer, double at_ms)
{
    if (!timer->place) {
        if (loop->heap_count == loop->heap_room) {
            size_t room = loop->heap_room ? 2 * loop->heap_room : 64;
            struct sv_timer **heap = realloc(loop->heap, room * sizeof *heap);
            if (!heap)
                return SV_ENOMEM;
            loop->heap = heap;
            loop->heap_room = room;
        }
        heap_put(loop, loop->heap_count++, timer);
    }
    timer->at_ms = at_ms;
    heap_settle(loop, timer->place - 1);
    return SV_OK;
}

void sv_loop_disarm(struct sv_loop *loop, struct sv_timer *timer)
{
    if (!timer->place)
        return;
    size_t i = timer->place - 1;
    timer->place = 0;
    struct sv_timer *last = loop->heap[--loop->heap_count];
    if (last == timer)
        return;
    heap_put(loop, i, last);
    heap_settle(loop, i);
}

static void run_due(struct sv_loop *loop)
{
    double now = sv_loop_now_ms();
    while (loop->heap_count && loop->heap[0]->at_ms <= now && !loop->stop) {
        struct sv_timer *timer = loop->heap[0];
        sv_loop_disarm(loop, timer);
        timer->due(timer->context);
    }
}

/* Sets timer_fd to the first timer of the heap. A moment that is past becomes one nanosecond: 0 would disarm
 * it. */
static void arm_descriptor(struct sv_loop *loop)
{
    double at = loop->heap_count ? loop->heap[0]->at_ms : INFINITY;
    if (at == loop->armed_ms)
        return;
    struct itimerspec spec = {.it_value = {0, 0}};
    if (isfinite(at)) {
        double whole_s = floor(at * 1e-3);
        spec.it_value.tv_sec = (time_t)whole_s;
        spec.it_value.tv_nsec = (long)((at - whole_s * 1e3) * 1e6) + 1;
        if (spec.it_value.tv_nsec > 999999999)
            spec.it_value.tv_nsec = 999999999;
        if (at <= 0)
            spec.it_value = (struct timespec){0, 1};
    }
    if (timerfd_settime(loop->timer_fd, TFD_TIMER_ABSTIME, &spec, NULL) == 0)
        loop->armed_ms = at;
}

void sv_loop_set_before_wait(struct sv_loop *loop, sv_loop_before_wait call, void *context)
{
    loop->before_wait = call;
    loop->before_wait_context = context;
}

static void dispatch(struct sv_loop *loop, const struct epoll_event *event)
{
    struct sv_watch *watch = event->data.ptr;
    if (watch) {
        if (watch->call)
            watch->call(watch->context, event->events);
        return;
    }
    uint64_t times;
    if (read(loop->timer_fd, &times, sizeof times) == (ssize_t)sizeof times)
        loop->armed_ms = INFINITY; /* it fired: it is set no more */
}

enum sv_status sv_loop_run(struct sv_loop *loop, struct sv_error *error)
{
    struct epoll_event events[EVENTS_A_TURN];
    loop->stop = false;
    while (!loop->stop) {
        run_due(loop);
        double wait_ms = loop->before_wait ? loop->before_wait(loop->before_wait_context) : -1;
        if (loop->stop)
            break;
        arm_descriptor(loop);
        int timeout = wait_ms < 0 ? -1 : wait_ms > 60000 ? 60000 : (int)ceil(wait_ms);
        int count = epoll_wait(loop->epoll_fd, events, EVENTS_A_TURN, timeout);
        if (count < 0 && errno != EINTR)
            return sv_fail(error, SV_EIO, "loop", "epoll_wait: %s", strerror(errno));
        for (int i = 0; i < count && !loop->stop; i++)
            dispatch(loop, &events[i]);
        bury(loop);
    }
    return SV_OK;
}

void sv_loop_stop(struct sv_loop *loop)
{
    loop->stop = true;
}
