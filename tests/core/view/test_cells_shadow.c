/* test_cells_shadow.c - shadows on near ground refined in the cache of panels: what is cast is the truth's
 * own light, what is stopped goes on, pictures come nearer to the truth while those that are drawn directly
 * stay as they are, and all goes with the cache. */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "core/cell/panel.h"
#include "core/truth/sunlight.h"
#include "core/view/cells_shadow.h"
#include "tests/core/view/refine_kit.h"

enum { SIDE = 128, ITEMS = 4096, PAGE = SV_SHADOW_PAGE_SIDE, STEP = SV_SHADOW_PAGE_STEP };

/* An eye of a walker, among trees. */
static int open_stage(void **state)
{
    static struct refine_stage s;
    refine_kit_open(SIDE, 1.7, &s);
    s.request.has_sun_azimuth = s.request.has_sun_elevation = true;
    s.request.sun_azimuth_rad = 2;
    s.request.sun_elevation_rad = 0.6;
    *state = &s;
    return 0;
}

static int close_stage(void **state)
{
    refine_kit_close(*state);
    return 0;
}

static struct sv_cells_refine_report refine(struct refine_stage *s, int rows, uint32_t most)
{
    return refine_kit_refine(
        s, (struct sv_cells_refine_options){.samples = 16, .shadows_alone = true, .most = most}, rows);
}

static double off(const struct sv_image *a, const struct sv_image *truth)
{
    return refine_kit_compare(a, truth).mean_abs;
}

/* Items of the cache that are pages of shadow come first. */
static size_t pages_of(const struct refine_stage *s, struct sv_cell_cache_item items[ITEMS])
{
    size_t count = sv_cell_cache_list(s->cache, 0, items, ITEMS), kept = 0;
    assert_true(count <= ITEMS);
    for (size_t k = 0; k < count; k++)
        if (items[k].label.parts.layer == SV_PANEL_SHADOW)
            items[kept++] = items[k];
    return kept;
}

static void test_goes_on(void **state)
{
    struct refine_stage *s = *state;
    static struct sv_cell_cache_item items[ITEMS];
    struct sv_cell_cache_stats stats;
    struct sv_image built = refine_kit_draw(s),
                    direct = refine_kit_draw_as(s, SV_RELIEF_OFF, SV_TREES_AUTO, 1), again;
    assert_true(s->stats.cell.built > 0 && s->stats.cell.shadows_left);
    struct sv_cells_refine_report report = refine(s, 10, UINT32_MAX);
    assert_int_equal(report.refined, 0);
    uint32_t first_left = report.left;
    assert_true(first_left > 20);
    again = refine_kit_draw(s); /* while a page is begun */
    assert_memory_equal(built.data, again.data, sv_image_bytes(&built));
    sv_image_free(&again);
    /* A page has 128 rows, ten of them were cast: 117 more do not make it whole, one more does. */
    assert_int_equal(refine(s, PAGE - 11, UINT32_MAX).refined, 0);
    report = refine(s, 1, UINT32_MAX);
    assert_int_equal(report.refined, 1);
    assert_int_equal(report.shadows, 1);
    assert_int_equal(report.left, first_left - 1);
    assert_int_equal(refine(s, 100000, 12).refined, 12);
    sv_cell_cache_stats(s->cache, &stats);
    assert_int_equal(stats.building, 0);
    assert_int_equal(pages_of(s, items), 13);
    int coarsest = -99, coarser = 0;
    for (int k = 0; k < 13; k++)
        coarsest = items[k].label.parts.place.k > coarsest ? items[k].label.parts.place.k : coarsest;
    struct sv_image begun = refine_kit_draw(s);
    assert_true(s->stats.cell.shadows_left);
    assert_true(memcmp(begun.data, built.data, sv_image_bytes(&built)) != 0);
    report = refine(s, 1000000, UINT32_MAX);
    assert_int_equal(report.refined, first_left - 13);
    assert_int_equal(report.left, 0);
    assert_int_equal(refine(s, 1000000, UINT32_MAX).refined, 0);
    assert_int_equal(pages_of(s, items), first_left);
    for (uint32_t k = 0; k < first_left; k++)
        coarser += items[k].label.parts.place.k >= coarsest;
    assert_true(coarser >= (int)first_left - 12); /* the finest came first */
    struct sv_image truth = refine_kit_draw_as(s, SV_RELIEF_OFF, SV_TREES_RAYCAST, 64),
                    refined = refine_kit_draw(s);
    assert_int_equal(s->stats.cell.shadows_left, 0);
    print_message("%u pages; off the truth by %.3f as built, %.3f refined\n", first_left, off(&built, &truth),
                  off(&refined, &truth));
    assert_true(off(&refined, &truth) < 0.9 * off(&built, &truth));
    again = refine_kit_draw_as(s, SV_RELIEF_OFF, SV_TREES_AUTO, 1);
    assert_memory_equal(direct.data, again.data, sv_image_bytes(&direct));
    sv_image_free(&again);
    kit_keep(&built, "shadows-built");
    kit_keep(&refined, "shadows-refined");
    kit_keep(&truth, "shadows-truth");
    kit_keep(&begun, "shadows-begun");
    sv_image_free(&begun);
    /* Dropped, they are gone for who has read them, too. */
    sv_cell_cache_clear(s->cache);
    again = refine_kit_draw(s);
    assert_memory_equal(built.data, again.data, sv_image_bytes(&built));
    assert_true(s->stats.cell.shadows_left);
    sv_cell_cache_stats(s->cache, &stats);
    assert_int_equal(stats.pinned_bytes, 0);
    sv_image_free(&again);
    sv_image_free(&built);
    sv_image_free(&direct);
    sv_image_free(&truth);
    sv_image_free(&refined);
}

/* Each page is the light of the truth at its texels, one by one; neighbours hold the same in the texels that
 * both have. */
static void test_pages_are_the_truths(void **state)
{
    struct refine_stage *s = *state;
    static struct sv_cell_cache_item items[ITEMS];
    struct sv_error error = {0};
    struct sv_truth *truth;
    struct sv_image picture = refine_kit_draw(s);
    sv_image_free(&picture);
    (void)refine(s, 1000000, UINT32_MAX);
    assert_int_equal(sv_truth_create(s->scene, &truth, &error), SV_OK);
    struct sv_light light;
    sv_light_from_sun(&s->view.sun, &light);
    size_t count = pages_of(s, items), lit = 0, dark = 0;
    assert_true(count > 5);
    for (size_t k = 0; k < count; k++) {
        const struct sv_cell_place *at = &items[k].label.parts.place;
        struct sv_cell_cache_panel pin;
        assert_true(items[k].refined && items[k].label.light.texel_m > 0);
        assert_int_equal(sv_cell_cache_find(s->cache, 1, items[k].label.key, s->scene->generation, 0, &pin),
                         SV_CELL_CACHE_HIT);
        assert_int_equal(pin.bytes, PAGE * PAGE);
        const uint8_t *page = pin.data;
        for (int n = 0; n < 40; n++) {
            int a = n * 37 % PAGE, b = n * 59 % PAGE;
            uint8_t one;
            struct sv_truth_lattice texel = {.x0 = s->scene->terrain.field.x0,
                                             .y0 = s->scene->terrain.field.y0,
                                             .texel_m = ldexp(SV_SHADOW_PAGE_TEXEL_M, at->k),
                                             .first = at->i * STEP - 1 + a,
                                             .count = 1,
                                             .samples = 16,
                                             .trees = true};
            sv_truth_sunlight_row(truth, &light, &texel, at->j * STEP - 1 + b, &one);
            assert_int_equal(page[b * PAGE + a], one);
            lit += one > 200;
            dark += one < 50;
        }
        for (size_t m = 0; m < count; m++) {
            const struct sv_cell_place *east = &items[m].label.parts.place;
            struct sv_cell_cache_panel other;
            if (east->k != at->k || east->i != at->i + 1 || east->j != at->j)
                continue;
            assert_int_equal(
                sv_cell_cache_find(s->cache, 1, items[m].label.key, s->scene->generation, 0, &other),
                SV_CELL_CACHE_HIT);
            for (int b = 0; b < PAGE; b++)
                assert_memory_equal(page + b * PAGE + STEP, (const uint8_t *)other.data + b * PAGE, 2);
            sv_cell_cache_unpin(s->cache, 1, &other);
        }
        sv_cell_cache_unpin(s->cache, 1, &pin);
    }
    assert_true(lit > 50 && dark > 50);
    sv_truth_destroy(truth);
}

/* Eyes that come by find the pages; whole pictures are their bands; another sun finds none. */
static void test_found_again(void **state)
{
    struct refine_stage *s = *state;
    static struct sv_cell_cache_item items[ITEMS];
    struct refine_stage near = *s;
    size_t before = pages_of(s, items);
    near.request.heading_rad += 0.3;
    struct sv_image picture = refine_kit_draw(&near);
    uint32_t more = refine(&near, 1000000, UINT32_MAX).shadows;
    print_message("%zu pages, %u more for a turn of 17 degrees\n", before, more);
    assert_true(more > 0 && more < before / 2);
    sv_image_free(&picture);
    picture = refine_kit_draw(&near);
    for (int first = 0; first < SIDE; first += 40) {
        struct sv_error error = {0};
        struct sv_renderer_band band = {.row_first = first,
                                        .row_count = first + 40 < SIDE ? 40 : SIDE - first};
        struct sv_picture part;
        struct sv_draw_took took;
        assert_int_equal(sv_renderer_draw_band(s->renderer, &near.request, &near.view, &band, &part, NULL,
                                               NULL, &took, &error),
                         SV_OK);
        assert_memory_equal((uint8_t *)picture.data + 4 * SIDE * first, part.layer[SV_LAYER_COLOR].data,
                            (size_t)(4 * SIDE * band.row_count));
        sv_picture_finish(&part);
    }
    sv_image_free(&picture);
    near.request.sun_azimuth_rad += 0.5;
    picture = refine_kit_draw(&near);
    assert_true(near.stats.cell.shadows_left);
    sv_image_free(&picture);
    near.request.shadows = false;
    picture = refine_kit_draw(&near);
    assert_int_equal(near.stats.cell.shadows_left, 0);
    assert_int_equal(refine(&near, 1000000, UINT32_MAX).shadows, 0);
    sv_image_free(&picture);
}

/* A changed scene, another view, or the end of the process: what is begun goes, and nothing stays reserved.
 */
static void test_lets_go(void **state)
{
    struct refine_stage *s = *state;
    struct sv_cell_cache_stats stats;
    sv_cell_cache_clear(s->cache);
    struct sv_image picture = refine_kit_draw(s);
    sv_image_free(&picture);
    assert_true(refine(s, 10, UINT32_MAX).left > 0);
    sv_cell_cache_stats(s->cache, &stats);
    assert_int_equal(stats.building, 1);
    struct refine_stage away = *s;
    away.request.pitch_rad = 1.2; /* into the sky */
    picture = refine_kit_draw(&away);
    sv_image_free(&picture);
    assert_int_equal(refine(&away, 1000000, UINT32_MAX).shadows, 0);
    sv_cell_cache_stats(s->cache, &stats);
    assert_int_equal(stats.building, 0);
    picture = refine_kit_draw(s);
    sv_image_free(&picture);
    assert_true(refine(s, 10, UINT32_MAX).left > 0);
    sv_renderer_destroy(s->renderer);
    s->renderer = NULL;
    sv_cell_cache_stats(s->cache, &stats);
    assert_int_equal(stats.building, 0);
    assert_int_equal(stats.pinned_bytes, 0);
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(test_goes_on),
                                       cmocka_unit_test(test_pages_are_the_truths),
                                       cmocka_unit_test(test_found_again), cmocka_unit_test(test_lets_go)};
    return cmocka_run_group_tests(tests, open_stage, close_stage);
}
