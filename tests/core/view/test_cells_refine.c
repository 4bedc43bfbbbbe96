/* test_cells_refine.c - panels of a view refined in their cache: what is stopped goes on, a view finds the
 * built ones meanwhile and the refined ones after, nearer to the truth than a ray cast of four samples and as
 * sharp, and a changed scene lets go of what is begun. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "core/scene/id.h"
#include "core/view/rings.h"
#include "tests/core/view/refine_kit.h"

static int open_stage(void **state)
{
    static struct refine_stage s;
    refine_kit_open(64, 30, &s);
    *state = &s;
    return 0;
}

static int close_stage(void **state)
{
    refine_kit_close(*state);
    return 0;
}

static struct sv_cells_refine_report refine_by(struct refine_stage *s, int samples, int rows)
{
    return refine_kit_refine(s, (struct sv_cells_refine_options){.samples = samples, .most = UINT32_MAX},
                             rows);
}

static struct sv_cells_refine_report refine(struct refine_stage *s, int rows)
{
    return refine_by(s, 4, rows);
}

static void test_goes_on(void **state)
{
    struct refine_stage *s = *state;
    struct sv_cell_cache_stats stats;
    struct sv_image built = refine_kit_draw(s), again, refined;
    assert_true(s->stats.cell.built > 0);
    uint32_t panels = s->stats.cell.built, whole = 0;
    struct sv_cells_refine_report report = refine(s, 10);
    assert_int_equal(report.refined, 0);
    assert_true(report.left > 1 && report.left <= panels);
    uint32_t first_left = report.left;
    sv_cell_cache_stats(s->cache, &stats);
    assert_int_equal(stats.building, 1);
    again = refine_kit_draw(s); /* from what is built, while a panel is begun */
    assert_int_equal(s->stats.cell.hits, panels);
    assert_int_equal(s->stats.cell.refined, panels - first_left); /* those that show nothing */
    assert_memory_equal(built.data, again.data, sv_image_bytes(&built));
    /* 64 rows a panel, ten of them were drawn: 53 more do not make it whole, 54 do. */
    report = refine(s, 53);
    assert_int_equal(report.refined, 0);
    report = refine(s, 1);
    assert_int_equal(report.refined, 1);
    assert_int_equal(report.left, first_left - 1);
    for (int calls = 0; report.left > 0 && calls < 1000; calls++) {
        whole += report.refined;
        report = refine(s, 40);
    }
    whole += report.refined;
    assert_int_equal(whole, first_left);
    refined = refine_kit_draw(s);
    assert_true(sv_cell_use_refined(&s->stats.cell));
    assert_true(memcmp(built.data, refined.data, sv_image_bytes(&built)) != 0);
    report = refine(s, 1000);
    assert_int_equal(report.refined + report.left, 0);
    sv_cell_cache_stats(s->cache, &stats);
    assert_int_equal(stats.building, 0);
    assert_int_equal(stats.pinned_bytes, 0);
    kit_keep(&built, "cells-built");
    kit_keep(&refined, "cells-refined");
    sv_image_free(&built);
    sv_image_free(&again);
    sv_image_free(&refined);
}

/* The view ray cast by so many samples a pixel. */
static struct sv_image cast(const struct refine_stage *s, int samples)
{
    return refine_kit_draw_as(s, SV_RELIEF_OFF, SV_TREES_RAYCAST, samples);
}

static struct sv_compare_result compare(struct sv_image picture, const struct sv_image *truth)
{
    struct sv_compare_result r = refine_kit_compare(&picture, truth);
    sv_image_free(&picture);
    return r;
}

/* Texels of about a pixel, each the mean of 16 samples. */
static void test_nearer_to_the_truth(void **state)
{
    struct refine_stage *s = *state;
    struct refine_stage kept = *s;
    s->request.width = s->request.height = 110;
    s->request.relief_resolution = 220;
    struct sv_image truth = cast(s, 64);
    struct sv_compare_result built = compare(refine_kit_draw(s), &truth), four = compare(cast(s, 4), &truth);
    for (int calls = 0; refine_by(s, 16, 100).left > 0 && calls < 1000; calls++)
        ;
    struct sv_compare_result refined = compare(refine_kit_draw(s), &truth);
    printf(
        "mean, SSIM, gradient: built %.3f %.4f %.3f, refined %.3f %.4f %.3f, four samples %.3f %.4f %.3f\n",
        built.mean_abs, built.ssim, built.gradient_ratio, refined.mean_abs, refined.ssim,
        refined.gradient_ratio, four.mean_abs, four.ssim, four.gradient_ratio);
    assert_true(sv_cell_use_refined(&s->stats.cell));
    assert_true(refined.mean_abs < four.mean_abs && refined.mean_abs < built.mean_abs);
    assert_true(refined.ssim > four.ssim && refined.ssim > built.ssim);
    assert_true(refined.gradient_ratio > 0.8 && refined.gradient_ratio < 1.2);
    s->request = kept.request;
    sv_image_free(&truth);
}

/* Whether the pixel shows a tree that is drawn before panels. */
static bool is_near(const struct sv_scene *scene, const struct sv_view_rings *at, uint32_t id)
{
    for (uint32_t k = 0; k < scene->forest.count; k++) {
        const struct sv_tree *t = &scene->forest.trees[k];
        double height = (double)t->height_m, reach = height * (double)scene->species[t->species].mesh.radius;
        if (t->number + SV_ID_TREE_FIRST == id)
            return sv_cell_ring_of(&at->rings, at->chain, sv_vec3(t->x, t->y, t->z), height, reach) <
                   at->crowns_first;
    }
    return false;
}

/* What is near is drawn leaf by leaf before panels: one softened sample a pixel, or, of quality=high, as many
 * as in a picture that is drawn directly. Of pixels amid such trees, the mean difference from one, of 255. */
static double off_direct(struct refine_stage *s, enum sv_quality quality, long *pixels)
{
    enum { AROUND = 2 };
    struct sv_view_rings at;
    struct refine_stage direct = *s;
    s->request.quality = direct.request.quality = quality;
    direct.request.relief = SV_RELIEF_OFF;
    struct sv_image cells = refine_kit_draw(s), other = refine_kit_draw(&direct);
    struct sv_image id = refine_kit_draw_layer(&direct, SV_LAYER_ID);
    assert_true(sv_view_rings(&s->view, &at));
    int side = cells.width;
    double sum = 0;
    for (int k = 0; k < side * side; k++) {
        int x = k % side, y = k / side, near = 0;
        if (x < AROUND || y < AROUND || x >= side - AROUND || y >= side - AROUND)
            continue;
        for (int j = -AROUND; j <= AROUND; j++)
            for (int i = -AROUND; i <= AROUND; i++)
                near += is_near(s->scene, &at, ((const uint32_t *)id.data)[k + j * side + i]);
        if (near < (2 * AROUND + 1) * (2 * AROUND + 1))
            continue;
        ++*pixels;
        for (int c = 0; c < 3; c++)
            sum += abs(((const uint8_t *)cells.data)[4 * k + c] - ((const uint8_t *)other.data)[4 * k + c]) /
                   3.0;
    }
    sv_image_free(&cells);
    sv_image_free(&other);
    sv_image_free(&id);
    return sum;
}

static void test_near_trees_by_quality(void **state)
{
    struct refine_stage near = *(struct refine_stage *)*state;
    double off[2] = {0, 0};
    long pixels[2] = {0, 0};
    near.request.width = near.request.height = 128;
    near.request.relief_resolution = 128;
    near.request.shadows = false;
    for (int k = 0; k < 4; k++) { /* at four trees, from the south */
        const struct sv_tree *tree = &near.scene->forest.trees[k * 30];
        near.request.eye.x = tree->x;
        near.request.eye.y = tree->y - 5;
        near.request.eye.agl = 3;
        near.request.heading_rad = near.request.pitch_rad = 0;
        off[0] += off_direct(&near, SV_QUALITY_BALANCED, &pixels[0]);
        off[1] += off_direct(&near, SV_QUALITY_HIGH, &pixels[1]);
    }
    printf("amid near trees off from direct drawing by %.3f of %ld pixels, high %.3f of %ld\n",
           off[0] / (double)pixels[0], pixels[0], off[1] / (double)pixels[1], pixels[1]);
    assert_true(pixels[0] > 2000 && pixels[1] > 2000);
    assert_true(off[1] / (double)pixels[1] < 0.5 && off[0] / (double)pixels[0] > 1);
}

/* Another scene, or a view that does not use the panel: what is begun goes, and nothing stays reserved. */
static void test_lets_go(void **state)
{
    struct refine_stage *s = *state;
    struct sv_cell_cache_stats stats;
    sv_cell_cache_clear(s->cache);
    struct sv_image picture = refine_kit_draw(s);
    sv_image_free(&picture);
    assert_true(refine(s, 10).left > 0);
    s->scene->version++;
    assert_int_equal(refine(s, 1000).refined, 0); /* nothing is built of this version */
    sv_cell_cache_stats(s->cache, &stats);
    assert_int_equal(stats.building, 0);
    assert_int_equal(stats.pinned_bytes, 0);
    s->scene->version--;
    assert_true(refine(s, 10).left > 0);
    sv_renderer_destroy(s->renderer);
    s->renderer = NULL;
    sv_cell_cache_stats(s->cache, &stats);
    assert_int_equal(stats.building, 0);
    assert_int_equal(stats.pinned_bytes, 0);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_goes_on), cmocka_unit_test(test_nearer_to_the_truth),
        cmocka_unit_test(test_near_trees_by_quality), cmocka_unit_test(test_lets_go)};
    return cmocka_run_group_tests(tests, open_stage, close_stage);
}
