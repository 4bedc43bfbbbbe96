/* test_cells_auto.c - relief=auto: a jump is drawn directly and builds nothing, an eye that stays near has
 * its cells built at the third picture, panels that are there are used at once, what does not pay is never built, and who
 * flies fast has the outer rings alone. The clock stands still while a picture is drawn, so that nothing here depends on
 * how fast the machine is: costs are what the test says they are. */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "core/base/rng.h"
#include "tests/core/tree/kept_bakes.h"
#include "tests/core/view/cells_kit.h"

enum { SIDE = 64, RINGS = 6 /* of crowns, from 200 m inward to 6.25 m */, ITEMS = 512 };
#define BYTES ((size_t)256 << 20)

static struct sv_scene *scene;
static struct sv_renderer *renderer;
static struct sv_cell_cache *cache;
static _Alignas(4096) uint8_t memory[BYTES];
static double time_ms;
static struct sv_picture last; /* that was drawn */

static double clock_ms(void)
{
    return time_ms;
}

static int make_scene(void **state)
{
    (void)state;
    struct kit_options wood = cells_kit_wood(40);
    wood.leaves = 500;
    wood.species = 1;
    scene = kit_scene(&wood);
    scene->relief_distance_m = 50;
    scene->relief_resolution = 64;
    return 0;
}

static int free_scene(void **state)
{
    (void)state;
    kit_free(scene);
    return 0;
}

/* The panels of this size, in ones of 1024 x 1024. */
static const double WORK = 1.0 / 256;
/* Direct drawing takes 0.1 s, and each ring saves 0.01 s of it. */
static const double RING_S = 0.01;

/* A cache of its own for each test, with times as above. */
static int setup(void **state)
{
    (void)state;
    struct sv_error error = {0};
    struct sv_cell_cache_options options = SV_CELL_CACHE_OPTIONS_DEFAULT;
    memset(memory, 0, BYTES / 64);
    if (sv_cell_cache_make(memory, BYTES, &options, &cache, &error))
        fail_msg("%s", error.message);
    for (int n = 0; n < 4; n++)
        for (int k = 0; k <= RINGS; k++)
            sv_cell_cache_drawn(cache, SIDE * SIDE, k, 0.1 - RING_S * k);
    struct sv_renderer_options render = {.store = kept_bakes(), .clock = clock_ms, .cells = cache};
    if (sv_renderer_create(scene, &render, &renderer, &error))
        fail_msg("%s", error.message);
    return 0;
}

/* What a panel costs. */
static void panels_cost(double seconds)
{
    for (int n = 0; n < 4; n++)
        for (int k = 1; k <= RINGS; k++)
            for (int ground = 0; ground < 2; ground++)
                sv_cell_cache_built(cache, k, ground, WORK, seconds);
}

static int teardown(void **state)
{
    (void)state;
    sv_picture_finish(&last);
    sv_renderer_destroy(renderer);
    return 0;
}

/* One picture, a thirtieth of a second after the last. */
static struct sv_cell_use draw(double x, double y, double agl, double heading_rad, enum sv_relief_mode relief)
{
    struct sv_error error = {0};
    struct sv_resolved_view view;
    struct sv_draw_stats stats = {0};
    struct sv_view_request r = kit_request();
    r.eye = (struct sv_place){.form = SV_PLACE_XY, .x = x, .y = y, .agl = agl};
    r.heading_rad = heading_rad;
    r.width = r.height = SIDE;
    r.relief = relief;
    r.shadows = true;
    time_ms += 1000.0 / 30;
    sv_picture_finish(&last);
    enum sv_status status = sv_view_resolve(scene, &r, &view, NULL, &error);
    if (!status)
        status = sv_renderer_draw(renderer, &r, &view, &last, NULL, &stats, &error);
    if (status)
        fail_msg("%s: %s", error.field, error.message);
    return stats.cell;
}

static const double centre_x = 497512.25 + 256, centre_y = 5203410.5 + 375;

static void a_jump_builds_nothing(void **state)
{
    (void)state;
    struct sv_rng rng = sv_rng_seeded(1, 3);
    struct sv_cell_cache_stats stats;
    for (int k = 0; k < 60; k++) {
        double x = centre_x + sv_rng_range(&rng, -200, 200), y = centre_y + sv_rng_range(&rng, -200, 200);
        struct sv_cell_use use =
            draw(x, y, sv_rng_range(&rng, 2, 60), sv_rng_range(&rng, 0, 6.28), SV_RELIEF_AUTO);
        assert_int_equal(use.kind, SV_CELL_USE_BYPASS);
    }
    sv_cell_cache_stats(cache, &stats);
    assert_int_equal(stats.builds, 0);
}

static void an_eye_that_stays_near_is_served(void **state)
{
    (void)state;
    static const enum sv_cell_use_kind expected[] = {SV_CELL_USE_BYPASS, SV_CELL_USE_BYPASS,
                                                     SV_CELL_USE_BUILT, SV_CELL_USE_HIT, SV_CELL_USE_HIT};
    uint32_t panels = draw(centre_x, centre_y, 12, 0, SV_RELIEF_ON).built;
    sv_cell_cache_clear(cache);
    panels_cost(2.5 * RINGS * RING_S / panels); /* 2.5 pictures' savings all together */
    for (int k = 0; k < 5; k++) { /* 4 mm a step: within one cell from any eye that is not at its very border */
        struct sv_cell_use use = draw(centre_x, centre_y + 0.004 * k, 12, 0, SV_RELIEF_AUTO);
        assert_int_equal(use.kind, expected[k]);
        assert_int_equal(use.built + use.hits, k < 2 ? 0 : panels);
    }
}

static double off(const struct sv_image *a, const struct sv_picture *b)
{
    return cells_kit_off(a, &b->layer[SV_LAYER_COLOR]);
}

/* 1.5 m a picture: no cell of the inner rings is seen twice, the outermost stays for some ten pictures. Pictures from outer
 * rings alone are as near to direct drawing as those from all are. */
static void a_fast_flight_has_outer_rings_alone(void **state)
{
    (void)state;
    static struct sv_cell_cache_item items[ITEMS];
    struct sv_picture direct;
    int from_panels = 0, begun = 60;
    double all = 0, some = 0;
    panels_cost(RING_S / 2);
    for (int k = 0; k < begun; k++) {
        double y = centre_y - 100 + 1.5 * k;
        struct sv_cell_use use = draw(centre_x, y, 30, 0, SV_RELIEF_AUTO);
        from_panels += use.kind == SV_CELL_USE_HIT;
        if (use.kind != SV_CELL_USE_HIT || k % 5)
            continue;
        struct sv_picture part = last;
        last = (struct sv_picture){0};
        draw(centre_x, y, 30, 0, SV_RELIEF_OFF);
        direct = last;
        last = (struct sv_picture){0};
        some = fmax(some, off(&direct.layer[SV_LAYER_COLOR], &part));
        sv_picture_finish(&part);
        sv_picture_finish(&direct);
    }
    assert_true(from_panels > begun / 3);
    size_t count = sv_cell_cache_list(cache, 0, items, ITEMS);
    assert_true(count > 0 && count < ITEMS);
    for (size_t k = 0; k < count; k++)
        assert_true(items[k].label.shell.distance_m > 20);
    for (int k = 0; k < begun; k += 10) {
        double y = centre_y - 100 + 1.5 * k;
        draw(centre_x, y, 30, 0, SV_RELIEF_OFF);
        direct = last;
        last = (struct sv_picture){0};
        draw(centre_x, y, 30, 0, SV_RELIEF_ON);
        all = fmax(all, off(&direct.layer[SV_LAYER_COLOR], &last));
        sv_picture_finish(&direct);
    }
    printf("off direct drawing: %.2f from outer rings, %.2f from all\n", some, all);
    assert_true(some > 0 && some <= all);
}

static void panels_that_are_there_are_used_at_once(void **state)
{
    (void)state;
    assert_int_equal(draw(centre_x, centre_y, 12, 0, SV_RELIEF_ON).kind, SV_CELL_USE_BUILT);
    assert_int_equal(draw(centre_x, centre_y, 12, 0, SV_RELIEF_AUTO).kind, SV_CELL_USE_HIT);
    assert_int_equal(draw(centre_x, centre_y, 12, 0, SV_RELIEF_OFF).kind, SV_CELL_USE_NONE);
}

static void what_saves_nothing_is_not_built(void **state)
{
    (void)state;
    for (int n = 0; n < 40; n++)
        for (int k = 1; k <= RINGS; k++)
            sv_cell_cache_drawn(cache, SIDE * SIDE, k, 1);
    for (int n = 0; n < 40; n++)
        sv_cell_cache_drawn(cache, SIDE * SIDE, 0, 0.1);
    for (int k = 0; k < 40; k++)
        assert_int_equal(draw(centre_x, centre_y, 12, 0, SV_RELIEF_AUTO).kind, SV_CELL_USE_BYPASS);
}

static void a_long_pause_is_a_new_start(void **state)
{
    (void)state;
    for (int k = 0; k < 6; k++) {
        assert_int_equal(draw(centre_x, centre_y, 12, 0, SV_RELIEF_AUTO).kind, SV_CELL_USE_BYPASS);
        time_ms += 11000;
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test_setup_teardown(a_jump_builds_nothing, setup, teardown),
        cmocka_unit_test_setup_teardown(an_eye_that_stays_near_is_served, setup, teardown),
        cmocka_unit_test_setup_teardown(a_fast_flight_has_outer_rings_alone, setup, teardown),
        cmocka_unit_test_setup_teardown(panels_that_are_there_are_used_at_once, setup, teardown),
        cmocka_unit_test_setup_teardown(what_saves_nothing_is_not_built, setup, teardown),
        cmocka_unit_test_setup_teardown(a_long_pause_is_a_new_start, setup, teardown)};
    return cmocka_run_group_tests(tests, make_scene, free_scene);
}
