/* test_ahead.c - where a client that moves is expected. */
#include "server/daemon/ahead.h"

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <cmocka.h>

#include <math.h>

static void guesses(void **state)
{
    (void)state;
    static const struct {
        struct sv_vec3 before, now;
        double dt_ms;
        bool moves;
        double x; /* of the guess */
    } rows[] = {
        {{0, 0, 0}, {1, 0, 0}, 700, true, 2},    /* a step in the horizon: one step on */
        {{0, 0, 0}, {1, 0, 0}, 2000, true, 2},   /* slower: one step, all the same */
        {{0, 0, 0}, {1, 0, 0}, 350, true, 3},    /* twice as fast */
        {{0, 0, 0}, {1, 0, 0}, 400, true, 3},    /* whole steps */
        {{0, 0, 0}, {0.1, 0, 0}, 10, true, 0.9}, /* 70 steps are too many: 8 */
        {{5e5, 0, 0}, {5e5 - 2, 0, 0}, 700, true, 5e5 - 4},
        {{0, 0, 0}, {0, 0, 0}, 100, false, 0},    /* stands */
        {{0, 0, 0}, {0.01, 0, 0}, 100, false, 0}, /* as good as stands */
        {{0, 0, 0}, {30, 0, 0}, 100, false, 0},   /* jumped */
        {{0, 0, 0}, {1, 0, 0}, 6000, false, 0},   /* somebody else, most likely */
        {{0, 0, 0}, {1, 0, 0}, 0, false, 0},
        {{0, 0, 0}, {1, 0, 0}, NAN, false, 0},
        {{NAN, 0, 0}, {1, 0, 0}, 100, false, 0},
    };
    for (size_t k = 0; k < sizeof rows / sizeof rows[0]; k++) {
        struct sv_vec3 next = {-1, -1, -1};
        assert_int_equal(sv_ahead_guess(rows[k].before, rows[k].now, rows[k].dt_ms, &next), rows[k].moves);
        if (rows[k].moves)
            assert_true(fabs(next.x - rows[k].x) < 1e-9 && next.y == 0);
        else
            assert_true(next.x == -1);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(guesses)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
