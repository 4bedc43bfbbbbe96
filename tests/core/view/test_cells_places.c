/* test_cells_places.c - views from cells where something is odd: an object in sight, an eye in a pit, far
 * above, at the field's edge, straight up and down, very narrow, very wide, very small, no trees at all. Each
 * is a whole picture (opaque, no holes left) near direct drawing. Depths are not in the picture: a NaN
 * anywhere would leave a pixel black or see-through, which the difference and alpha show. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <math.h>

#include <cmocka.h>

#include "tests/core/view/cells_kit.h"

enum { SIDE = 128 };

/* off_most: as in test_cells_pictures.c, what was measured plus a quarter. */
struct place {
    const char *name;
    struct cells_pose pose;
    double off_most;
};

static void check(const struct cells_kit *kit, const struct place *place)
{
    struct sv_resolved_view view = cells_kit_view(kit, &place->pose);
    struct sv_cells_report report;
    struct sv_image cells = cells_kit_draw(kit, &view, &report), direct = cells_kit_direct(kit, &view);
    char name[64];
    snprintf(name, sizeof name, "places-%s", place->name);
    kit_keep(&cells, name);
    snprintf(name, sizeof name, "places-%s-direct", place->name);
    kit_keep(&direct, name);
    double off = cells_kit_off(&cells, &direct);
    printf("%-10s mean abs %.2f, holes %u, %u panels built, ground %s\n", place->name, off,
           (unsigned)report.hole_pixels, report.built, report.ground_direct ? "directly" : "warped");
    for (int k = 0; k < cells.width * cells.height; k++)
        assert_int_equal(((const uint8_t *)cells.data)[4 * k + 3], 255);
    assert_int_equal(report.holes_left, 0);
    assert_true(off <= place->off_most);
    sv_image_free(&cells);
    sv_image_free(&direct);
}

static void in_a_wood(void **state)
{
    (void)state;
    static const struct place places[] = {
        {"above", {0.5, 0.5, 2500, 0, -80, 60, SIDE}, 0.2}, {"edge", {0, 0.5, 3, 90, 0, 60, SIDE}, 2.0},
        {"corner", {1, 1, 10, 225, -5, 60, SIDE}, 1.3},     {"outward", {0, 0, 10, 225, -5, 60, SIDE}, 0.1},
        {"up", {0.5, 0.5, 1.7, 0, 90, 60, SIDE}, 0.1},      {"down", {0.5, 0.5, 30, 0, -90, 60, SIDE}, 1.0},
        {"wide", {0.5, 0.4, 20, 0, -20, 150, SIDE}, 3.5},   {"small", {0.5, 0.3, 20, 0, -10, 60, 16}, 8.1},
    };
    struct kit_options wood = cells_kit_wood(400);
    struct cells_kit kit;
    cells_kit_open(&wood, CELLS_KIT_PLAIN, &kit);
    for (size_t k = 0; k < sizeof places / sizeof *places; k++)
        check(&kit, &places[k]);
    cells_kit_close(&kit);
}

/* Texels of many pixels would be all that a narrow view shows: it is not for cells. The narrowest that is,
 * is. */
static void narrow_views_are_not_for_cells(void **state)
{
    (void)state;
    struct place narrow = {"narrow", {0.5, 0.25, 30, 0, -8, 1, SIDE}, 0},
                 tele = {"tele", {0.5, 0.25, 30, 0, -8, 14.3, SIDE}, 11.7};
    struct kit_options wood = cells_kit_wood(400);
    struct cells_kit kit;
    cells_kit_open(&wood, CELLS_KIT_PLAIN, &kit);
    struct sv_resolved_view view = cells_kit_view(&kit, &narrow.pose);
    assert_false(sv_cells_can(&view, 1u << SV_LAYER_COLOR));
    view.plan.relief_resolution = 4096; /* 3.6 px each */
    assert_true(sv_cells_can(&view, 1u << SV_LAYER_COLOR));
    view = cells_kit_view(&kit, &tele.pose);
    assert_true(sv_cells_can(&view, 1u << SV_LAYER_COLOR));
    check(&kit, &tele);
    cells_kit_close(&kit);
}

/* The largest cube that touches neither ground nor object is then small. */
static void before_an_object(void **state)
{
    (void)state;
    static const struct place places[] = {
        {"hut", {0.5, 0.46, 4, 0, -3, 60, SIDE}, 2.2},
        {"hut-far", {0.5, 0.35, 25, 0, -12, 60, SIDE}, 1.8},
        {"hut-close", {0.5, 0.488, 1.7, 0, 5, 60, SIDE}, 0.1},
        {"hut-top", {0.5, 0.5, 40, 0, -90, 40, SIDE}, 1.4},
    };
    struct kit_options wood = cells_kit_wood(100);
    struct cells_kit kit;
    cells_kit_open(&wood, CELLS_KIT_HUT, &kit);
    for (size_t k = 0; k < sizeof places / sizeof *places; k++)
        check(&kit, &places[k]);
    cells_kit_close(&kit);
}

static void without_trees(void **state)
{
    (void)state;
    static const struct place places[] = {
        {"bare", {0.5, 0.3, 20, 0, -10, 60, SIDE}, 1.3},
        {"bare-low", {0.5, 0.3, 1.7, 0, 0, 60, SIDE}, 0.1},
        {"bare-sky", {0.5, 0.3, 20, 0, 60, 30, SIDE}, 0.1},
    };
    struct kit_options wood = cells_kit_wood(0);
    struct cells_kit kit;
    cells_kit_open(&wood, CELLS_KIT_PLAIN, &kit);
    for (size_t k = 0; k < sizeof places / sizeof *places; k++)
        check(&kit, &places[k]);
    cells_kit_close(&kit);
}

/* At the bottom of a hole, 40 m deep: ground on all sides, higher than the eye. */
static void in_a_pit(void **state)
{
    (void)state;
    static const struct place places[] = {
        {"pit", {0.5, 0.5, 1.7, 0, 20, 60, SIDE}, 0.1},
        {"pit-up", {0.5, 0.5, 1.7, 0, 80, 90, SIDE}, 0.1},
        {"pit-mid", {0.5, 0.5, 25, 0, -20, 60, SIDE}, 0.7},
    };
    struct kit_options wood = cells_kit_wood(0);
    struct cells_kit kit;
    cells_kit_open(&wood, CELLS_KIT_PIT, &kit);
    for (size_t k = 0; k < sizeof places / sizeof *places; k++)
        check(&kit, &places[k]);
    cells_kit_close(&kit);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(in_a_wood), cmocka_unit_test(narrow_views_are_not_for_cells),
        cmocka_unit_test(before_an_object), cmocka_unit_test(without_trees), cmocka_unit_test(in_a_pit)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
