/* test_refine.c - which cell's panels are refined next. Who refines, and who stops, is in
 * tests/e2e/test_cells.py. */
#include "server/daemon/refine.h"

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <string.h>
#include <cmocka.h>

#include "server/daemon/service.h"

static struct sv_settings settings;
static struct sv_service service;

static int setup(void **state)
{
    (void)state;
    memset(&service, 0, sizeof service);
    strcpy(settings.refine_samples, "16");
    service.settings = &settings;
    return 0;
}

static void look(uint64_t id, int times, uint32_t kind, uint32_t refined)
{
    struct sv_view_request request = {.width = (int)id};
    struct sv_cell_use use = {.kind = kind, .hits = 5, .refined = refined, .id = id};
    for (int k = 0; k < times; k++)
        sv_refine_seen(&service, &request, &use);
}

static uint64_t next(void)
{
    const struct sv_refine_cell *cell = sv_refine_next(&service.refine);
    assert_true(!cell || cell->request.width == (int)cell->id);
    return cell ? cell->id : 0;
}

static void what_is_wanted_most_comes_first(void **state)
{
    (void)state;
    assert_int_equal(next(), 0);
    look(1, SV_REFINE_DEMAND - 1, SV_CELL_USE_HIT, 4);
    assert_int_equal(next(), 0);
    look(1, 1, SV_CELL_USE_BUILT, 4);
    assert_int_equal(next(), 1);
    look(2, SV_REFINE_DEMAND + 1, SV_CELL_USE_HIT, 0);
    assert_int_equal(next(), 2);
    assert_int_equal(sv_refine_count(&service.refine), 2);
}

static void what_cannot_be_better_is_not_wanted(void **state)
{
    (void)state;
    look(1, 9, SV_CELL_USE_HIT, 5);
    look(2, 9, SV_CELL_USE_BYPASS, 0);
    look(3, 9, SV_CELL_USE_NONE, 0);
    assert_int_equal(next(), 0);
    strcpy(settings.refine_samples, "0");
    look(4, 9, SV_CELL_USE_HIT, 0);
    assert_int_equal(next(), 0);
}

/* Who moves on sees each cell once: none is in demand. A cell that is looked at all the while stays known,
 * and so does the one that is being refined. */
static void the_latest_are_known(void **state)
{
    (void)state;
    look(1, SV_REFINE_DEMAND, SV_CELL_USE_HIT, 0);
    service.refine.running = sv_refine_next(&service.refine);
    look(2, 1, SV_CELL_USE_HIT, 0);
    for (uint64_t k = 0; k < 4 * SV_REFINE_CELLS; k++) {
        look(100 + k, 1, SV_CELL_USE_HIT, 0);
        if (k % (SV_REFINE_CELLS / 2) == 0)
            look(3, 1, SV_CELL_USE_HIT, 0);
    }
    assert_int_equal(service.refine.running->id, 1);
    assert_int_equal(next(), 3);
    assert_int_equal(sv_refine_count(&service.refine), 2);
    look(2, SV_REFINE_DEMAND - 1, SV_CELL_USE_HIT, 0); /* was forgotten */
    assert_int_equal(sv_refine_count(&service.refine), 2);
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test_setup(what_is_wanted_most_comes_first, setup),
                                       cmocka_unit_test_setup(what_cannot_be_better_is_not_wanted, setup),
                                       cmocka_unit_test_setup(the_latest_are_known, setup)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
