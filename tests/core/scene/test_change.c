/* test_change.c - boxes of a change: each of those given is in one that is told, however many they are; no
 * more than the bound; those far apart stay apart. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>
#include <cmocka.h>

#include "core/base/rng.h"
#include "core/scene/change.h"

static struct sv_change_box box_at(double x, double y, double side)
{
    return (struct sv_change_box){{x, y, 10}, {x + side, y + side, 30}};
}

static int is_in(const struct sv_change_box *b, const struct sv_change_box *of)
{
    for (int a = 0; a < 3; a++)
        if (b->min[a] < of->min[a] || b->max[a] > of->max[a])
            return 0;
    return 1;
}

static void test_bounds(void **state)
{
    (void)state;
    static const size_t counts[] = {0, 1, 2, 255, 256, 257, 5000};
    struct sv_rng rng = sv_rng_seeded(3, 0);
    for (size_t row = 0; row < sizeof counts / sizeof counts[0]; row++)
        for (int spread = 1; spread <= 100000; spread *= 100) {
            size_t n = counts[row];
            struct sv_change_box *given = malloc((n + 1) * sizeof *given),
                                 *work = malloc((n + 1) * sizeof *work);
            struct sv_scene_change change = {0};
            for (size_t k = 0; k < n; k++)
                given[k] = box_at(sv_rng_range(&rng, -spread, spread),
                                  5e6 + sv_rng_range(&rng, -spread, spread), sv_rng_range(&rng, 0, 9));
            memcpy(work, given, n * sizeof *given);
            sv_scene_change_put(&change, work, n);
            assert_true(change.box_count <= SV_CHANGE_BOXES_MAX && (change.box_count > 0) == (n > 0));
            for (size_t k = 0; k < n; k++) {
                uint32_t b = 0;
                while (b < change.box_count && !is_in(&given[k], &change.boxes[b]))
                    b++;
                assert_true(b < change.box_count);
            }
            free(given);
            free(work);
        }
}

static void test_apart(void **state)
{
    (void)state;
    struct sv_change_box boxes[3] = {box_at(0.5, 0.5, 2), box_at(900, 0, 2), box_at(2, 2, 2)};
    struct sv_scene_change change = {0};
    sv_scene_change_put(&change, boxes, 3);
    assert_int_equal(change.box_count, 2);
    assert_true(change.boxes[0].min[0] == 0.5 && change.boxes[0].max[0] == 4);
    assert_true(change.boxes[1].min[0] == 900 && change.boxes[1].max[1] == 2);
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(test_bounds), cmocka_unit_test(test_apart)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
