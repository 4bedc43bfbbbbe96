/* loop.h - one epoll descriptor, timers, and what to call when something happens. One thread.
 *
 * Callbacks may watch, unwatch, arm and disarm anything, themselves included: an unwatched descriptor is
 * never called again, even when its event is already in hand. Callbacks must not block. The clock is
 * CLOCK_MONOTONIC in milliseconds. */
#ifndef SV_SERVER_LOOP_H
#define SV_SERVER_LOOP_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "core/base/error.h"

struct sv_loop;
struct sv_watch;

typedef void (*sv_loop_event)(void *context, uint32_t events); /* EPOLLIN, ... */
typedef void (*sv_loop_due)(void *context);
/* Called before each wait; answers how long to wait at most, in ms; negative: as long as nothing happens. */
typedef double (*sv_loop_before_wait)(void *context);

/* A timer lives in its owner's struct; disarm it before that dies. */
struct sv_timer {
    sv_loop_due due;
    void *context;
    double at_ms;
    size_t place; /* 1 + index in the loop's heap; 0: not armed */
};

double sv_loop_now_ms(void);

SV_MUST_CHECK enum sv_status sv_loop_create(struct sv_loop **loop, struct sv_error *error);
void sv_loop_destroy(struct sv_loop *loop);

/* Watches a descriptor, which stays the caller's; events as for epoll_ctl. SV_EIO. */
SV_MUST_CHECK enum sv_status sv_loop_watch(struct sv_loop *loop, int fd, uint32_t events, sv_loop_event call,
                                           void *context, struct sv_watch **watch, struct sv_error *error);
/* Before the descriptor is closed. NULL is legal. */
void sv_loop_unwatch(struct sv_loop *loop, struct sv_watch *watch);

/* Arms (or re-arms) the timer for the moment at_ms; what is past is due at once. SV_ENOMEM. */
SV_MUST_CHECK enum sv_status sv_loop_arm(struct sv_loop *loop, struct sv_timer *timer, double at_ms);
void sv_loop_disarm(struct sv_loop *loop, struct sv_timer *timer);

void sv_loop_set_before_wait(struct sv_loop *loop, sv_loop_before_wait call, void *context);
/* Runs until sv_loop_stop. SV_EIO when epoll fails. */
SV_MUST_CHECK enum sv_status sv_loop_run(struct sv_loop *loop, struct sv_error *error);
void sv_loop_stop(struct sv_loop *loop);

#endif
