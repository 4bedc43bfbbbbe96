/* test_draw_mixed.c - leaves and sprites of one view, nearest first: what is dropped because it is hidden
 * changes no bit; and the picture is the one that trees make that are drawn one by one, farthest first. */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "core/base/color.h"
#include "core/base/rng.h"
#include "core/tree/draw_mixed.h"
#include "core/tree/leaf_pass.h"
#include "tests/core/tree/draw_fixture.h"
#include "tests/core/tree/kept_bakes.h"

enum { SIDE = 200, PIXELS = SIDE * SIDE, TREES = 120 };

static struct sv_tree_mesh mesh;
static struct sv_tree_draw_species species;
static struct sv_leaf_splat *leaves;
static struct sv_sprite_draw *sprites;
static struct sv_tree trees[TREES];
static struct sv_cull_entry entries[TREES], swap[TREES];

static int setup(void **state)
{
    (void)state;
    struct sv_error error;
    sv_color_init();
    fixture_tree(1500, 7, &mesh);
    species = (struct sv_tree_draw_species){&mesh, kept_bakes_key(&mesh), TREES};
    fixture_ok(sv_leaf_splat_create(&species, 1, &leaves, &error), &error);
    fixture_ok(sv_sprite_draw_create(&species, 1, kept_bakes(), &sprites, &error), &error);
    return 0;
}

static int teardown(void **state)
{
    (void)state;
    sv_leaf_splat_destroy(leaves);
    sv_sprite_draw_destroy(sprites);
    sv_tree_mesh_finish(&mesh);
    return 0;
}

/* A dense stand seen from above, as a panel below sees it, or from beside it. */
static struct sv_camera stand(bool above, double side_m, uint64_t seed)
{
    struct sv_rng rng = sv_rng_seeded(seed, 0);
    struct sv_camera c = above ? fixture_camera(sv_vec3(0, 0, 30), 0, -85, SIDE, SIDE)
                               : fixture_camera(sv_vec3(0, -side_m, 8), 0, -6, SIDE, SIDE);
    const struct sv_camera *camera = &c;
    for (uint32_t k = 0; k < TREES; k++) {
        trees[k] = (struct sv_tree){.x = side_m * (sv_rng_unit(&rng) - 0.5),
                                    .y = side_m * (sv_rng_unit(&rng) - 0.5),
                                    .height_m = (float)(6 + 8 * sv_rng_unit(&rng)),
                                    .rotation_rad = (float)(6 * sv_rng_unit(&rng)),
                                    .number = k};
        entries[k] =
            (struct sv_cull_entry){sv_cull_order_code((float)sv_cull_distance_m(camera, &trees[k])), k};
    }
    struct sv_cull_entry *sorted = sv_cull_sort(entries, swap, TREES);
    memmove(entries, sorted, sizeof entries);
    return c;
}

/* Every third tree is a sprite, some are both. */
struct lists {
    struct sv_cull_entry near[TREES], far[TREES];
    float come[TREES], share[TREES];
    uint32_t near_count, far_count;
};

static void split(struct lists *l)
{
    l->near_count = l->far_count = 0;
    for (uint32_t k = 0; k < TREES; k++) {
        float come = k % 3 == 0 ? 0 : k % 7 == 0 ? 0.4f : 1;
        if (come > 0) {
            l->near[l->near_count] = entries[k];
            l->come[l->near_count++] = come;
        }
        if (come < 1) {
            l->far[l->far_count] = entries[k];
            l->share[l->far_count++] = 1 - come;
        }
    }
}

struct paper {
    float depth[PIXELS];
    uint8_t color[4 * PIXELS];
};

/* Nothing; or grey, and a wall across its left half 20 m before the eye. */
static struct sv_canvas begin(struct paper *p, const struct sv_camera *camera, bool surface)
{
    for (int k = 0; k < PIXELS; k++) {
        bool wall = !surface && k % SIDE < SIDE / 2;
        p->depth[k] = wall ? (float)(camera->near_m / 20) : 0;
        memset(p->color + 4 * k, surface ? 0 : 128, 4);
        p->color[4 * k + 3] = surface ? 0 : 255;
    }
    return (struct sv_canvas){.width = SIDE,
                              .height = SIDE,
                              .row_count = SIDE,
                              .depth = p->depth,
                              .color = p->color,
                              .surface = surface};
}

static struct sv_mixed_draw order_of(const struct sv_camera *camera, const struct lists *l,
                                     const struct sv_canvas *canvas, int samples)
{
    return (struct sv_mixed_draw){.leaves = leaves,
                                  .sprites = sprites,
                                  .view = {*camera, fixture_light(120, 40), 0, 0},
                                  .canvas = canvas,
                                  .near = {.trees = trees,
                                           .entries = l->near,
                                           .count = l->near_count,
                                           .weight = l->come,
                                           .samples = samples},
                                  .far = {l->far, l->share, l->far_count, false}};
}

static void draw_at(const struct sv_camera *camera, const struct lists *l, bool surface, int samples,
                    const double shift_px[2], struct paper *p)
{
    struct sv_error error;
    struct sv_canvas canvas = begin(p, camera, surface);
    struct sv_mixed_draw order = order_of(camera, l, &canvas, samples);
    order.view.shift_x_px = shift_px[0];
    order.view.shift_y_px = shift_px[1];
    fixture_ok(sv_mixed_draw(&order, &error), &error);
}

static void draw_mixed(const struct sv_camera *camera, const struct lists *l, bool surface, int samples,
                       struct paper *p)
{
    const double middle[2] = {0, 0};
    draw_at(camera, l, surface, samples, middle, p);
}

/* One by one, each over what is behind it. Not as a surface: that would have leaves hidden by the depth of
 * sprites that cover next to nothing. */
static void draw_singly(const struct sv_camera *camera, const struct lists *l, bool surface, int samples,
                        struct paper *p)
{
    struct sv_error error;
    struct sv_canvas canvas = begin(p, camera, surface);
    canvas.surface = false;
    struct sv_mixed_draw all = order_of(camera, l, &canvas, samples);
    const struct sv_sprite_view view = {&all.view.camera, &all.view.light, 0, 0};
    for (uint32_t i = l->near_count, j = l->far_count; i > 0 || j > 0;) {
        if (j > 0 && (i == 0 || l->far[j - 1].key >= l->near[i - 1].key)) {
            struct sv_sprite_list one = {l->far + --j, l->share + j, 1, false};
            fixture_ok(sv_sprite_draw_trees(sprites, &view, &canvas, trees, &one, all.near.lights, &error),
                       &error);
        } else {
            struct sv_leaf_splat_trees one = all.near;
            one.entries = l->near + --i;
            one.weight = l->come + i;
            one.count = 1;
            fixture_ok(sv_leaf_splat_draw(leaves, &all.view, &canvas, &one, NULL, &error), &error);
        }
    }
}

static void drops_nothing_that_shows(void **state)
{
    (void)state;
    static struct lists l;
    static struct paper dropped, all;
    for (int k = 0; k < 16; k++) {
        bool above = k & 1, surface = k & 2;
        int samples = k & 4 ? 4 : 1;
        struct sv_camera camera = stand(above, k & 8 ? 12 : 40, (uint64_t)k + 1);
        split(&l);
        leaves->exhaustive = false;
        draw_mixed(&camera, &l, surface, samples, &dropped);
        leaves->exhaustive = true;
        draw_mixed(&camera, &l, surface, samples, &all);
        leaves->exhaustive = false;
        assert_memory_equal(dropped.color, all.color, sizeof all.color);
        assert_memory_equal(dropped.depth, all.depth, sizeof all.depth);
    }
}

/* Trees that are drawn singly hide by the depth of their leaves, in one pass by distance where a sprite
 * stands between; sprites stop at 1 / 32 of the light, and each layer rounds its colours: pictures differ by
 * that where crowns grow into each other, on the average by little (most from above, where the tops of what
 * is farther are in the sun: the next test), in coverage by next to nothing. */
static void looks_like_trees_one_by_one(void **state)
{
    (void)state;
    static struct lists l;
    static struct paper mixed, singly;
    for (int k = 0; k < 4; k++) {
        bool above = k & 1, surface = k & 2;
        double sum = 0, covered = 0, bias[3] = {0};
        struct sv_camera camera = stand(above, 40, (uint64_t)k + 31);
        split(&l);
        draw_mixed(&camera, &l, surface, 1, &mixed);
        draw_singly(&camera, &l, surface, 1, &singly);
        for (int p = 0; p < PIXELS; p++) {
            covered += abs(mixed.color[4 * p + 3] - singly.color[4 * p + 3]);
            for (int c = 0; c < 3; c++) {
                sum += abs(mixed.color[4 * p + c] - singly.color[4 * p + c]);
                bias[c] += mixed.color[4 * p + c] - singly.color[4 * p + c];
            }
        }
        printf("%s, %s: mean difference %.3f levels, bias %.3f %.3f %.3f, coverage %.3f\n",
               above ? "above" : "beside", surface ? "surface" : "picture", sum / (3 * PIXELS),
               bias[0] / PIXELS, bias[1] / PIXELS, bias[2] / PIXELS, covered / PIXELS);
        assert_true(sum / (3 * PIXELS) < 2.5);
        assert_true(covered / PIXELS < 0.25);
        for (int c = 0; c < 3; c++)
            assert_true(fabs(bias[c] / PIXELS) < 1.25);
    }
}

/* Why one pass is darker from above: sprites that show next to nothing (a 64th; a 16th moves nothing) stand between leaves, nearest middle
 * first. What they add is not seen; but samples that a nearer tree has won before a sprite are closed, and the top of a
 * tree whose middle is farther, which is before them, does not win them back. Leaves alone are hidden by depth: what rays
 * meet first. So one pass is wrong there, by 0.6 to 1.2 levels for these stands, whose crowns grow into one another all
 * over, and by next to nothing where middles are in the order of crowns, as from beside. To win such samples back, a tile
 * would have to keep what each sample has added to it. */
static void order_of_middles_hides_tops(void **state)
{
    (void)state;
    static struct lists l;
    static struct paper mixed, leaves_alone;
    for (int k = 0; k < 8; k++) {
        bool above = k & 1;
        double bias, off[2];
        struct sv_error error;
        struct sv_camera camera = stand(above, 40, (uint64_t)k + 31);
        l.near_count = TREES;
        for (uint32_t n = 0; n < TREES; n++) {
            l.near[n] = l.far[n] = entries[n];
            l.come[n] = 1;
            l.share[n] = 1.0f / 64;
        }
        struct sv_canvas canvas = begin(&leaves_alone, &camera, false);
        struct sv_mixed_draw order = order_of(&camera, &l, &canvas, 1);
        fixture_ok(sv_leaf_splat_draw(leaves, &order.view, &canvas, &order.near, NULL, &error), &error);
        for (int sprites_between = 0; sprites_between < 2; sprites_between++) {
            l.far_count = sprites_between ? TREES : 0;
            draw_mixed(&camera, &l, false, 1, &mixed);
            bias = 0;
            for (int p = 0; p < PIXELS; p++)
                bias += mixed.color[4 * p + 1] - leaves_alone.color[4 * p + 1];
            off[sprites_between] = bias / PIXELS;
            if (!sprites_between)
                assert_memory_equal(mixed.color, leaves_alone.color, sizeof mixed.color);
        }
        printf("%s, sprites of a 64th between leaves: green off by %.3f\n", above ? "above" : "beside", off[1]);
        assert_true(above ? off[1] > -1.5 && off[1] < 0.1 : fabs(off[1]) < 0.1);
    }
}

/* Four samples cover what four pictures of one sample each do, on the average; sprites of those are seen from
 * places within the pixel, too. */
static void samples_are_a_mean(void **state)
{
    (void)state;
    static struct lists l;
    static struct paper four, one[4];
    for (int k = 0; k < 2; k++) {
        double off = 0, bias = 0;
        struct sv_camera camera = stand(k & 1, 40, (uint64_t)k + 71);
        split(&l);
        draw_mixed(&camera, &l, true, 4, &four);
        for (int n = 0; n < 4; n++) {
            const double shift_px[2] = {n & 1 ? 0.25 : -0.25, n & 2 ? 0.25 : -0.25};
            draw_at(&camera, &l, true, 1, shift_px, &one[n]);
        }
        for (int p = 3; p < 4 * PIXELS; p += 4) {
            double mean = (one[0].color[p] + one[1].color[p] + one[2].color[p] + one[3].color[p]) / 4.0;
            off += fabs(four.color[p] - mean);
            bias += four.color[p] - mean;
        }
        printf("coverage of four samples: off by %.3f levels, bias %.3f\n", off / PIXELS, bias / PIXELS);
        assert_true(off / PIXELS < 8 && fabs(bias / PIXELS) < 0.25);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(drops_nothing_that_shows),
        cmocka_unit_test(looks_like_trees_one_by_one),
        cmocka_unit_test(order_of_middles_hides_tops),
        cmocka_unit_test(samples_are_a_mean),
    };
    return cmocka_run_group_tests(tests, setup, teardown);
}
