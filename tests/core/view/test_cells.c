/* test_cells.c - panels that processes share, as the renderer uses them: whoever builds them, and wherever
 * they lie, the picture is the same; and it is the scene, as direct drawing shows it. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>
#include <sys/mman.h>

#include <cmocka.h>

#include "core/cell/cache.h"
#include "tests/core/tree/kept_bakes.h"
#include "tests/core/view/scene_kit.h"

/* NARROW: some 200 KB more than the index takes, less than the largest panel here. */
enum { ROOMY = 96 << 20, NARROW = 1900 << 10 };

static struct sv_scene *scene;
static struct sv_renderer *renderer;
static struct sv_cell_cache *cache;
static void *memory;
static double clock_now;

static double clock_ms(void)
{
    return clock_now += 1;
}

/* An empty cache in the same memory: the renderer has it from now on. */
static void make_cache(size_t bytes)
{
    struct sv_cell_cache_options options = SV_CELL_CACHE_OPTIONS_DEFAULT;
    assert_int_equal(sv_cell_cache_make(memory, bytes, &options, &cache, NULL), SV_OK);
}

static int set_up(void **state)
{
    (void)state;
    struct kit_options options = {.width = 65,
                                  .height = 65,
                                  .x0 = 500000,
                                  .y0 = 4000000,
                                  .z0 = 100,
                                  .dx = 5,
                                  .dy = 5,
                                  .relief_m = 10,
                                  .seed = 3,
                                  .species = 1,
                                  .leaves = 400,
                                  .trees = 60,
                                  .spread_m = 120,
                                  .height_min_m = 5,
                                  .height_max_m = 9};
    struct sv_error error;
    scene = kit_scene(&options);
    scene->relief_distance_m = 50;
    scene->relief_resolution = 256;
    memory = mmap(NULL, ROOMY, PROT_READ | PROT_WRITE, MAP_SHARED | MAP_ANONYMOUS | MAP_NORESERVE, -1, 0);
    assert_true(memory != MAP_FAILED);
    make_cache(ROOMY);
    struct sv_renderer_options made = {
        .store = kept_bakes(), .clock = clock_ms, .cells = cache, .cells_slot = 1};
    if (sv_renderer_create(scene, &made, &renderer, &error) != SV_OK)
        fail_msg("%s", error.message);
    return 0;
}

static int tear_down(void **state)
{
    (void)state;
    sv_renderer_destroy(renderer);
    kit_free(scene);
    munmap(memory, ROOMY);
    return 0;
}

static struct sv_view_request over_the_trees(enum sv_relief_mode relief)
{
    struct sv_view_request request = kit_request();
    request.eye = (struct sv_place){.form = SV_PLACE_XY, .x = 500160, .y = 4000120, .agl = 14};
    request.width = request.height = 96;
    request.relief = relief;
    request.shadows = true;
    return request;
}

static struct sv_resolved_view resolve(const struct sv_view_request *request)
{
    struct sv_resolved_view view;
    struct sv_error error;
    if (sv_view_resolve(scene, request, &view, NULL, &error) != SV_OK)
        fail_msg("%s: %s", error.field, error.message);
    return view;
}

static uint64_t held_by_others;

/* Draws the view; pixels into rgba (96 * 96 * 4). */
static struct sv_cell_use draw(enum sv_relief_mode relief, uint8_t *rgba)
{
    struct sv_view_request request = over_the_trees(relief);
    struct sv_resolved_view view = resolve(&request);
    struct sv_picture picture = {0};
    struct sv_draw_stats stats;
    struct sv_error error;
    if (sv_renderer_draw(renderer, &request, &view, &picture, NULL, &stats, &error) != SV_OK)
        fail_msg("%s: %s", error.field, error.message);
    memcpy(rgba, picture.layer[SV_LAYER_COLOR].data, 96 * 96 * 4);
    sv_picture_finish(&picture);
    struct sv_cell_cache_stats now;
    sv_cell_cache_stats(cache, &now);
    assert_int_equal(now.pinned_bytes, held_by_others); /* whatever was held is given back */
    return stats.cell;
}

static double mean_difference(const uint8_t *a, const uint8_t *b)
{
    double sum = 0;
    for (int i = 0; i < 96 * 96; i++)
        for (int c = 0; c < 3; c++)
            sum += abs(a[4 * i + c] - b[4 * i + c]);
    return sum / (96 * 96 * 3);
}

static uint8_t direct[96 * 96 * 4], cells[96 * 96 * 4], other[96 * 96 * 4];

static void built_then_hit(void **state)
{
    (void)state;
    make_cache(ROOMY);
    assert_int_equal(draw(SV_RELIEF_OFF, direct).kind, SV_CELL_USE_NONE);
    struct sv_cell_use first = draw(SV_RELIEF_ON, cells);
    assert_int_equal(first.kind, SV_CELL_USE_BUILT);
    assert_true(first.built > 0 && first.hits == 0 && first.id != 0);
    struct sv_cell_use second = draw(SV_RELIEF_ON, other);
    assert_int_equal(second.kind, SV_CELL_USE_HIT);
    assert_true(second.hits == first.built && second.built == 0 && second.id == first.id);
    assert_memory_equal(cells, other, sizeof cells);
    /* Another picture of a scene without trees would be off by its crowns: some 12 of 255. Panels of 256
     * texels over 90 degrees are coarser than the picture's pixels (1.3 of them), which blurs and does no
     * more. */
    assert_true(mean_difference(direct, cells) < 6);
    assert_int_equal(sv_cell_cache_clear(cache), first.built);
    assert_int_equal(draw(SV_RELIEF_ON, other).built, first.built);
    assert_memory_equal(cells, other, sizeof cells);
}

/* Where the cache has no room, and where another process is building all that it holds. */
static void in_memory_of_its_own(void **state)
{
    (void)state;
    make_cache(ROOMY);
    struct sv_cell_use want = draw(SV_RELIEF_ON, cells);
    struct sv_cell_cache_item items[64];
    size_t count = sv_cell_cache_list(cache, 0, items, 64);
    assert_int_equal(count, want.built);
    sv_cell_cache_clear(cache);
    held_by_others = 0;
    for (size_t k = 0; k < count; k++) {
        struct sv_cell_cache_panel panel;
        assert_int_equal(
            sv_cell_cache_reserve(cache, 2, &items[k].label, items[k].bytes, false, 0, 0, &panel),
            SV_CELL_CACHE_GRANTED);
        held_by_others += items[k].bytes;
    }
    struct sv_view_request request = over_the_trees(SV_RELIEF_ON);
    struct sv_resolved_view view = resolve(&request);
    uint32_t built = 9, left = 9;
    assert_int_equal(sv_renderer_build_cells(renderer, &request, &view, 99, &built, &left, NULL), SV_OK);
    assert_true(built == 0 && left == 0); /* others are at it */
    assert_int_equal(draw(SV_RELIEF_ON, other).built, want.built);
    assert_memory_equal(cells, other, sizeof cells);
    assert_int_equal(sv_cell_cache_release(cache, 2), count);
    held_by_others = 0;
    make_cache(NARROW);
    for (int calls = 0; built > 0 || calls == 0; calls++) { /* ahead, what has no room ends it */
        assert_true(calls < 64);
        assert_int_equal(sv_renderer_build_cells(renderer, &request, &view, 1, &built, &left, NULL), SV_OK);
    }
    assert_int_equal(left, 0);
    struct sv_cell_use use = draw(SV_RELIEF_ON, other);
    assert_true(use.built > 0 && use.built + use.hits == want.built);
    assert_memory_equal(cells, other, sizeof cells);
}

static void built_ahead_one_by_one(void **state)
{
    (void)state;
    make_cache(ROOMY);
    struct sv_view_request request = over_the_trees(SV_RELIEF_AUTO);
    struct sv_resolved_view view = resolve(&request);
    uint32_t built = 1, left = 1, total = 0, before = UINT32_MAX;
    for (; left > 0; total += built) {
        assert_int_equal(sv_renderer_build_cells(renderer, &request, &view, 1, &built, &left, NULL), SV_OK);
        assert_int_equal(built, 1);
        assert_true(left < before);
        before = left;
    }
    struct sv_cell_use use = draw(SV_RELIEF_AUTO, other);
    assert_int_equal(use.kind, SV_CELL_USE_HIT);
    assert_int_equal(use.hits, total);
    /* What panels cannot draw is not built for. */
    request.layers = 1u << SV_LAYER_DEPTH;
    sv_cell_cache_clear(cache);
    assert_int_equal(sv_renderer_build_cells(renderer, &request, &view, 1, &built, &left, NULL), SV_OK);
    assert_true(built == 0 && left == 0);
}

/* auto draws a pose that comes once directly; one that comes again and again is built for in the end, as long
 * as nothing was measured that speaks against it. */
static void admitted_when_it_pays(void **state)
{
    (void)state;
    make_cache(ROOMY);
    draw(SV_RELIEF_OFF, direct);
    struct sv_cell_use use = draw(SV_RELIEF_AUTO, other);
    assert_int_equal(use.kind, SV_CELL_USE_BYPASS);
    assert_memory_equal(direct, other, sizeof direct);
    int times = 1;
    for (; use.kind == SV_CELL_USE_BYPASS && times < 100; times++)
        use = draw(SV_RELIEF_AUTO, other);
    assert_int_equal(use.kind, SV_CELL_USE_BUILT);
    assert_true(times > 2);
}

static void without_a_slot(void **state)
{
    (void)state;
    make_cache(ROOMY);
    sv_renderer_use_cells_slot(renderer, 5);
    assert_int_equal(draw(SV_RELIEF_ON, cells).kind, SV_CELL_USE_BUILT);
    draw(SV_RELIEF_OFF, direct);
    sv_renderer_use_cells_slot(renderer, -1);
    assert_int_equal(draw(SV_RELIEF_ON, other).kind, SV_CELL_USE_BYPASS);
    assert_memory_equal(direct, other, sizeof direct);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        /* First, before anything is drawn: what is built ahead is what the whole picture needs. */
        cmocka_unit_test(built_ahead_one_by_one), cmocka_unit_test(built_then_hit),
        cmocka_unit_test(in_memory_of_its_own),   cmocka_unit_test(admitted_when_it_pays),
        cmocka_unit_test(without_a_slot),
    };
    return cmocka_run_group_tests(tests, set_up, tear_down);
}
