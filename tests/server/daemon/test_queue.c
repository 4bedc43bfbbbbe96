/* test_queue.c - the queue's order, bound and advice; flights and who waits for them. */
#include "server/daemon/queue.h"

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <cmocka.h>

#include <string.h>

#include "server/daemon/flight.h"

static void resolve_goes_before_view_and_the_first_before_the_second(void **state)
{
    struct sv_queue queue;
    struct sv_queue_item v1, v2, r1, r2, back;
    struct sv_queue_item *expected[] = {&r1, &r2, &back, &v1, &v2};
    (void)state;
    sv_queue_init(&queue, 4);
    assert_null(sv_queue_first(&queue));
    assert_true(sv_queue_admit(&queue, &v1, SV_QUEUE_VIEW, 1));
    assert_true(sv_queue_admit(&queue, &r1, SV_QUEUE_RESOLVE, 2));
    assert_true(sv_queue_admit(&queue, &v2, SV_QUEUE_VIEW, 3));
    assert_true(sv_queue_admit(&queue, &r2, SV_QUEUE_RESOLVE, 4));
    assert_true(sv_queue_full(&queue));
    assert_false(sv_queue_admit(&queue, &back, SV_QUEUE_VIEW, 5));
    sv_queue_return(&queue, &back, SV_QUEUE_VIEW, true,
                    6); /* was admitted before: over the limit, ahead of its class */
    for (size_t i = 0; i < 5; i++) {
        assert_ptr_equal(sv_queue_first(&queue), expected[i]);
        sv_queue_remove(&queue, expected[i]);
        sv_queue_remove(&queue, expected[i]); /* once more changes nothing */
    }
    assert_int_equal(queue.count, 0);
}

static void whoever_is_in_the_middle_can_leave(void **state)
{
    struct sv_queue queue;
    struct sv_queue_item items[3];
    (void)state;
    for (int leaver = 0; leaver < 3; leaver++) {
        sv_queue_init(&queue, 3);
        for (int i = 0; i < 3; i++)
            assert_true(sv_queue_admit(&queue, &items[i], SV_QUEUE_VIEW, i));
        sv_queue_remove(&queue, &items[leaver]);
        for (int i = 0; i < 3; i++)
            if (i != leaver) {
                assert_ptr_equal(sv_queue_first(&queue), &items[i]);
                sv_queue_remove(&queue, &items[i]);
            }
        assert_null(sv_queue_first(&queue));
    }
}

static void advice_is_what_the_queue_will_take(void **state)
{
    struct sv_queue queue;
    struct sv_queue_item items[20];
    (void)state;
    sv_queue_init(&queue, 20);
    assert_int_equal(sv_queue_retry_after_s(&queue, 2), 1);
    for (int i = 0; i < 20; i++)
        assert_true(sv_queue_admit(&queue, &items[i], SV_QUEUE_VIEW, 0));
    assert_int_equal(sv_queue_retry_after_s(&queue, 2), 1); /* nothing known of service times yet */
    sv_queue_served(&queue, 1500);
    assert_int_equal(sv_queue_retry_after_s(&queue, 2), 15); /* 20 views of 1.5 s on 2 workers */
    for (int i = 0; i < 200; i++)
        sv_queue_served(&queue, 300);
    assert_int_equal(sv_queue_retry_after_s(&queue, 2), 4); /* 3.0000...1 rounded up */
    sv_queue_served(&queue, 1e12);
    assert_int_equal(sv_queue_retry_after_s(&queue, 0), 3600);
}

static void a_flight_is_found_by_version_and_request(void **state)
{
    static struct sv_flights flights;
    struct sv_view_request request = {.width = 64};
    (void)state;
    struct sv_flight *a = sv_flight_create(&flights, 1, "a", &request),
                     *b = sv_flight_create(&flights, 1, "b", &request);
    assert_ptr_equal(sv_flight_find(&flights, 1, "a"), a);
    assert_ptr_equal(sv_flight_find(&flights, 1, "b"), b);
    assert_null(sv_flight_find(&flights, 2, "a"));
    a->stage = SV_FLIGHT_VIEW;
    sv_flight_rebind(&flights, a, 2);
    assert_null(sv_flight_find(&flights, 1, "a"));
    assert_ptr_equal(sv_flight_find(&flights, 2, "a"), a);
    assert_int_equal(a->stage, SV_FLIGHT_RESOLVE);
    assert_ptr_equal(flights.first, a);
    sv_flight_destroy(&flights, a);
    assert_ptr_equal(flights.first, b);
    sv_flight_destroy(&flights, b);
    assert_null(flights.first);
    assert_int_equal(flights.count, 0);
    static char long_text[SV_API_CANONICAL_MAX + 1];
    memset(long_text, 'x', SV_API_CANONICAL_MAX);
    assert_null(sv_flight_create(&flights, 1, long_text, &request));
}

static void waiters_join_and_leave_in_any_order(void **state)
{
    static struct sv_flights flights;
    struct sv_view_request request = {.width = 64};
    struct sv_waiter w[3];
    (void)state;
    for (int leaver = 0; leaver < 3; leaver++) {
        struct sv_flight *flight = sv_flight_create(&flights, 1, "a", &request);
        double deadlines[] = {10, 30, 20};
        for (int i = 0; i < 3; i++) {
            sv_flight_join(flight, &w[i], deadlines[i]);
            assert_int_equal(w[i].collapsed, i > 0);
        }
        assert_float_equal(flight->deadline_ms, 30, 0);
        sv_flight_leave(&w[leaver]);
        sv_flight_leave(&w[leaver]);
        assert_int_equal(flight->waiters, 2);
        assert_ptr_equal(flight->first, &w[leaver == 0]);
        assert_ptr_equal(flight->last, &w[leaver == 2 ? 1 : 2]);
        assert_ptr_equal(flight->first->next, flight->last);
        assert_float_equal(flight->deadline_ms, 30, 0); /* of all that ever waited */
        while (flight->first)
            sv_flight_leave(flight->first);
        sv_flight_destroy(&flights, flight);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(resolve_goes_before_view_and_the_first_before_the_second),
        cmocka_unit_test(whoever_is_in_the_middle_can_leave),
        cmocka_unit_test(advice_is_what_the_queue_will_take),
        cmocka_unit_test(a_flight_is_found_by_version_and_request),
        cmocka_unit_test(waiters_join_and_leave_in_any_order),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
