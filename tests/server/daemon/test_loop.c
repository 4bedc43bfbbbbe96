/* test_loop.c - timers fire in order and on time, watches can be dropped by anybody, also in mid-turn. */
#include "server/daemon/loop.h"

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <cmocka.h>

#include <stdlib.h>
#include <sys/epoll.h>
#include <sys/eventfd.h>
#include <unistd.h>

#include "core/base/rng.h"

static struct sv_loop *loop;
static double order[1000];
static size_t fired;

static void note(void *context)
{
    struct sv_timer *timer = context;
    assert_true(sv_loop_now_ms() >= timer->at_ms);
    order[fired++] = timer->at_ms;
}

static void stop(void *context)
{
    (void)context;
    sv_loop_stop(loop);
}

static void run_for(double ms)
{
    struct sv_timer end = {.due = stop};
    assert_int_equal(sv_loop_arm(loop, &end, sv_loop_now_ms() + ms), SV_OK);
    assert_int_equal(sv_loop_run(loop, NULL), SV_OK);
}

static int create(void **state)
{
    (void)state;
    fired = 0;
    return sv_loop_create(&loop, NULL) != SV_OK;
}

static int destroy(void **state)
{
    (void)state;
    sv_loop_destroy(loop);
    return 0;
}

/* Random arming, re-arming and disarming against a plain list of what must fire. */
static void timers_fire_in_order_those_that_are_armed(void **state)
{
    enum { COUNT = 200 };
    static struct sv_timer timers[COUNT];
    struct sv_rng rng = sv_rng_seeded(3, 0);
    bool armed[COUNT] = {false};
    size_t expected = 0;
    double now = sv_loop_now_ms();
    (void)state;
    for (int i = 0; i < COUNT; i++)
        timers[i] = (struct sv_timer){.due = note, .context = &timers[i]};
    for (int step = 0; step < 2000; step++) {
        size_t i = sv_rng_next(&rng) % COUNT;
        armed[i] = sv_rng_next(&rng) % 3 != 0;
        if (armed[i])
            assert_int_equal(sv_loop_arm(loop, &timers[i], now + sv_rng_range(&rng, -5, 30)), SV_OK);
        else
            sv_loop_disarm(loop, &timers[i]);
    }
    for (int i = 0; i < COUNT; i++)
        expected += armed[i];
    run_for(50);
    assert_int_equal(fired, expected);
    for (size_t i = 1; i < fired; i++)
        assert_true(order[i - 1] <= order[i]);
}

static struct sv_watch *watches[2];
static int calls;

/* Whoever is called first drops both. */
static void drop_both(void *context, uint32_t events)
{
    (void)context;
    assert_true(events & EPOLLIN);
    calls++;
    sv_loop_unwatch(loop, watches[0]);
    sv_loop_unwatch(loop, watches[1]);
    sv_loop_stop(loop);
}

static void an_unwatched_descriptor_is_not_called_even_in_hand(void **state)
{
    int fds[2] = {eventfd(1, EFD_CLOEXEC), eventfd(1, EFD_CLOEXEC)};
    (void)state;
    calls = 0;
    for (int i = 0; i < 2; i++)
        assert_int_equal(sv_loop_watch(loop, fds[i], EPOLLIN, drop_both, NULL, &watches[i], NULL), SV_OK);
    assert_int_equal(sv_loop_run(loop, NULL), SV_OK);
    run_for(5);
    assert_int_equal(calls, 1);
    close(fds[0]);
    close(fds[1]);
}

static int waits;

static double poll_again(void *context)
{
    (void)context;
    if (++waits == 100)
        sv_loop_stop(loop);
    return 0;
}

static void the_hook_before_waiting_can_ask_not_to_wait(void **state)
{
    (void)state;
    waits = 0;
    sv_loop_set_before_wait(loop, poll_again, NULL);
    assert_int_equal(sv_loop_run(loop, NULL), SV_OK);
    assert_int_equal(waits, 100);
}

static void a_descriptor_that_cannot_be_watched_is_an_error(void **state)
{
    struct sv_watch *watch;
    struct sv_error error;
    (void)state;
    assert_int_equal(sv_loop_watch(loop, 9999, EPOLLIN, drop_both, NULL, &watch, &error), SV_EIO);
}

int main(void)
{
#define TEST(f) cmocka_unit_test_setup_teardown(f, create, destroy)
    const struct CMUnitTest tests[] = {
        TEST(timers_fire_in_order_those_that_are_armed),
        TEST(an_unwatched_descriptor_is_not_called_even_in_hand),
        TEST(the_hook_before_waiting_can_ask_not_to_wait),
        TEST(a_descriptor_that_cannot_be_watched_is_an_error),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
