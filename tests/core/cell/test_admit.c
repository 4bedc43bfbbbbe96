/* test_admit.c - what is built and what is not, against the rule played out by hand and by brute force. */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <string.h>

#include <cmocka.h>

#include "core/base/rng.h"
#include "core/cell/admit.h"

static struct sv_cell_admit admit;

static void start(double window_s, double patience, double build_s, double saving_s)
{
    struct sv_cell_admit_options options = {window_s, patience, build_s, saving_s};
    sv_cell_admit_init(&admit, &options);
}

static bool want(uint64_t key, double now_s, double frames)
{
    struct sv_cell_admit_request request = {key, 0, now_s, frames};
    return sv_cell_admit(&admit, &request);
}

static void the_second_request_builds_what_pays(void **state)
{
    (void)state;
    start(10, 1, 0.1, 0.06); /* two frames' savings are more than the cost */
    assert_false(want(7, 0, 0));
    assert_false(want(8, 1, 0));
    assert_true(want(7, 9, 0));
    assert_false(want(8, 12, 0)); /* too long ago: as if never */
    assert_true(want(8, 22, 0));  /* just within */
    start(10, 1, 0.1, 0.02);      /* five frames */
    for (int n = 1; n <= 6; n++)
        assert_int_equal(want(7, n, 0), n >= 5);
    start(10, 0, 0.1, 0.02);
    assert_false(want(7, 0, 0));
    assert_true(want(7, 0, 0));
    start(10, 1, 0.001, 0.02); /* cheap as it is, a pose that is never seen again costs nothing */
    assert_false(want(7, 0, 0));
    assert_true(want(7, 0, 0));
}

static void known_frames_build_at_once(void **state)
{
    (void)state;
    start(10, 1, 0.1, 0.02);
    assert_false(want(1, 0, 1));
    assert_false(want(2, 0, 4.9));
    assert_true(want(3, 0, 5.1));
    assert_true(want(4, 0, 1000));
    assert_false(want(5, 0, NAN));
}

static void what_saves_nothing_is_not_built_but_tried_again(void **state)
{
    (void)state;
    start(10, 1, 0.1, 0.02);
    for (int n = 0; n < 50; n++)
        sv_cell_admit_measured(&admit, 0, NAN, -0.02);
    int n = 0;
    while (n < 2000 && !want(7, 0, 1000))
        n++;
    assert_true(n > 50 && n < 1000); /* (1 - 1/256)^n halves 0.04 at n = 177; 1000 frames need little more */
}

static void means_follow_what_is_measured(void **state)
{
    (void)state;
    start(10, 1, 1, 1);
    struct sv_rng rng = sv_rng_seeded(5, 70);
    double sum = 1;
    for (int n = 1; n <= 7; n++) { /* at first the mean of all */
        double sample = sv_rng_unit(&rng);
        sv_cell_admit_measured(&admit, 3, sample, NAN);
        sum += sample;
        assert_true(fabs(admit.mean[3].build_s - sum / (n + 1)) < 1e-12);
    }
    double before = admit.mean[3].build_s;
    sv_cell_admit_measured(&admit, 3, before + 8, NAN);
    assert_true(fabs(admit.mean[3].build_s - before - 1) < 1e-12);
    assert_true(admit.mean[3].saving_s == 1 && admit.mean[2].build_s == 1);
    static const double no_cost[] = {NAN, INFINITY, -1};
    before = admit.mean[3].build_s;
    for (size_t n = 0; n < 3; n++)
        sv_cell_admit_measured(&admit, 3, no_cost[n], n ? INFINITY : NAN);
    assert_true(admit.mean[3].build_s == before && admit.mean[3].saving_s == 1);
}

/* 300 keys in any order are all remembered (128 sets of 4 hold 512: one of five or more, as a tenth of them
 * are, forgets in turn), and of a flood the latest. */
static void the_table_remembers_the_latest(void **state)
{
    (void)state;
    start(1e9, 1, 0.1, 0.06);
    struct sv_rng rng = sv_rng_seeded(5, 71);
    uint64_t keys[300];
    int known = 0;
    for (int n = 0; n < 300; n++)
        assert_false(want(keys[n] = sv_rng_next(&rng) | 1, n, 0));
    for (int n = 0; n < 300; n++)
        known += want(keys[n], 300 + n, 0);
    assert_true(known > 210);
    for (int n = 0; n < 100000; n++)
        want(sv_rng_next(&rng) | 1, 1000 + n, 0);
    assert_false(want(42, 2e5, 0));
    for (int n = 0; n < 30;
         n++) /* a set of four keeps it until four others of its set came: 128 sets, chance small */
        want(sv_rng_next(&rng) | 1, 2e5 + n, 0);
    assert_true(want(42, 2e5 + 40, 0));
}

/* Ski rental: whatever number of requests comes, what is spent is at most twice what knowing it would have
 * cost. */
static void nothing_costs_more_than_twice_the_best(void **state)
{
    (void)state;
    for (int ratio = 2; ratio <= 20; ratio++)
        for (int requests = 1; requests <= 100; requests++) {
            double saving = 1, cost = ratio, spent = 0;
            bool built = false;
            start(10, 1, cost, saving);
            for (int n = 0; n < requests; n++) {
                spent += built ? 0 : saving; /* drawn directly (in the building frame, too) */
                if (!built && want(7, n, 0)) {
                    built = true;
                    spent += cost;
                }
            }
            assert_true(spent <= 2 * fmin(cost, requests * saving) + 1e-9);
        }
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(the_second_request_builds_what_pays),
                                       cmocka_unit_test(known_frames_build_at_once),
                                       cmocka_unit_test(what_saves_nothing_is_not_built_but_tried_again),
                                       cmocka_unit_test(means_follow_what_is_measured),
                                       cmocka_unit_test(the_table_remembers_the_latest),
                                       cmocka_unit_test(nothing_costs_more_than_twice_the_best)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
