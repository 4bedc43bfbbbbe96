/* test_shade_cast.c - the shade of trees in windows of the ground and at places, and of very many trees. */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

#include <cmocka.h>

#include "core/base/frames.h"
#include "core/base/rng.h"
#include "shade_fixture.h"

/* ---- windows ---- */

static double window_shade(const struct sv_shadow_window *w)
{
    double sum = 0;
    for (size_t k = 0; k < (size_t)SV_SHADOW_WINDOW_SIDE * SV_SHADOW_WINDOW_SIDE; k++)
        sum += (255 - w->light[k]) / 255.0;
    return sum * w->texel_m * w->texel_m;
}

/* On level ground a body shades as much as the sun sees of it, over the sine of the sun's elevation: at every
 * size of texels, by silhouettes and by stamps. */
static void windows_keep_the_amount_of_shade(void **state)
{
    (void)state;
    static const double texels[] = {0.125, 0.25, 0.5, 1, 2, 4, 8, 16};
    struct sv_error error;
    struct sv_shadow_window w = {0};
    shade_ok(sv_shadow_window_alloc(&w, &error), &error);
    for (int e = 0; e < 3; e++) {
        double elevation = 15 + 30 * e;
        struct sv_tree tree = shade_tree_at(0, 0, 14, e, 5);
        struct shade_forest f;
        shade_forest_init(&f, &tree, 1, shade_table, SHADE_SPECIES);
        shade_forest_update(&f, shade_sun_at(77, elevation));
        const struct sv_shade_outline *o = &f.shade->current->views[e].turn[sv_shade_turn(tree.rotation_rad)];
        double want = (double)o->area * 14 * 14 / sin(sv_radians(elevation));
        printf("  sun at %2.0f degrees, %.1f m2:", elevation, want);
        for (size_t t = 0; t < sizeof texels / sizeof texels[0]; t++) {
            double half = 512 * texels[t];
            sv_shadow_window_fill(
                &w, &shade_ground->terrain.field, NULL,
                (struct sv_shadow_place){shade_middle().x - half, shade_middle().y - half, texels[t]});
            sv_tree_shade_cast(f.shade, &w);
            double got = window_shade(&w);
            printf(" %.3f", got / want);
            /* A shadow of some ten texels or fewer: where their middles fall decides. */
            assert_true(fabs(got / want - 1) < (texels[t] * texels[t] * 10 > want ? 0.15 : 0.03));
        }
        printf(" of it at texels of 1/8 .. 16 m\n");
        shade_forest_finish(&f);
    }
    sv_shadow_window_finish(&w);
}

/* Stamps of trees far below a texel add up to the shade that they are. */
static void shade_of_tiny_trees_adds_up(void **state)
{
    (void)state;
    enum { COUNT = 20000 };
    struct sv_tree *trees = malloc(COUNT * sizeof *trees);
    struct sv_rng rng = sv_rng_seeded(4, 4);
    assert_non_null(trees);
    for (uint32_t k = 0; k < COUNT; k++) {
        trees[k] = shade_tree_at(sv_rng_range(&rng, -100, 100), sv_rng_range(&rng, -100, 100), 0.1, 0, k);
    }
    struct shade_forest f;
    struct sv_error error;
    struct sv_shadow_window w = {0};
    shade_ok(sv_shadow_window_alloc(&w, &error), &error);
    sv_shadow_window_fill(&w, &shade_ground->terrain.field, NULL,
                          (struct sv_shadow_place){shade_middle().x - 1024, shade_middle().y - 1024, 2});
    shade_forest_init(&f, trees, COUNT, shade_table, SHADE_SPECIES);
    shade_forest_update(&f, shade_sun_at(77, 30));
    sv_tree_shade_cast(f.shade, &w);
    double want = 0;
    for (int k = 0; k < SV_SHADE_TURNS; k++)
        want += (double)f.shade->current->views[0].turn[k].area / SV_SHADE_TURNS * COUNT * 0.01 / 0.5;
    printf("  %d trees of 0.1 m shade %.1f m2 of ground, %.1f expected\n", COUNT, window_shade(&w), want);
    assert_true(fabs(window_shade(&w) / want - 1) < 0.1);
    shade_forest_finish(&f);
    sv_shadow_window_finish(&w);
    free(trees);
}

/* The hierarchy leaves nothing out: what it casts is what every tree cast alone gives, texel by texel. */
static void the_caster_finds_every_tree_that_reaches(void **state)
{
    (void)state;
    struct sv_error error;
    struct sv_shadow_window a = {0}, b = {0};
    shade_ok(sv_shadow_window_alloc(&a, &error), &error);
    shade_ok(sv_shadow_window_alloc(&b, &error), &error);
    struct shade_forest f;
    shade_forest_init(&f, shade_stand->forest.trees, shade_stand->forest.count, shade_table, SHADE_SPECIES);
    struct sv_rng rng = sv_rng_seeded(8, 8);
    uint64_t dark = 0;
    for (int round = 0; round < 40; round++) {
        double elevation = round % 4 == 0 ? sv_rng_range(&rng, 0.05, 3) : sv_rng_range(&rng, 3, 90);
        struct sv_vec3 to_sun = shade_sun_at(sv_rng_range(&rng, 0, 360), elevation);
        shade_forest_update(&f, to_sun);
        double texel = round & 1 ? 0.125 : 0.25;
        struct sv_shadow_place place = {shade_middle().x + sv_rng_range(&rng, -160, 60),
                                        shade_middle().y + sv_rng_range(&rng, -160, 60), texel};
        sv_shadow_window_fill(&a, &shade_ground->terrain.field, NULL, place);
        sv_shadow_window_fill(&b, &shade_ground->terrain.field, NULL, place);
        sv_tree_shade_cast(f.shade, &a);
        for (uint32_t k = 0; k < f.forest.count; k++) {
            const struct sv_tree *tree = &f.forest.trees[k];
            const struct sv_shade_outline *o =
                &f.shade->current->views[tree->species].turn[sv_shade_turn(tree->rotation_rad)];
            int n = 0;
            while (n < o->levels - 1 && ldexp((double)o->texel, n) * (double)tree->height_m * 1.4 <= texel)
                n++;
            sv_shadow_window_cast(&b, &o->level[n], sv_vec3(tree->x, tree->y, tree->z),
                                  (double)tree->height_m);
        }
        size_t texels = (size_t)SV_SHADOW_WINDOW_SIDE * SV_SHADOW_WINDOW_SIDE;
        assert_memory_equal(a.light, b.light, texels);
        for (size_t k = 0; k < texels; k++)
            dark += a.light[k] < 128;
    }
    assert_true(dark > 100000); /* there was something to find */
    shade_forest_finish(&f);
    sv_shadow_window_finish(&a);
    sv_shadow_window_finish(&b);
}

/* On the ground every tree that hides the sun is sunward: what arrives there is what a window holds, which is
 * made by a kernel of its own from finer outlines; at night and without trees the answer is known. */
static void light_at_a_place_is_that_of_the_ground(void **state)
{
    (void)state;
    struct sv_error error;
    struct sv_shadow_window w = {0};
    shade_ok(sv_shadow_window_alloc(&w, &error), &error);
    struct shade_forest f, none;
    shade_forest_init(&f, shade_stand->forest.trees, shade_stand->forest.count, shade_table, SHADE_SPECIES);
    shade_forest_init(&none, shade_stand->forest.trees, 0, shade_table, SHADE_SPECIES);
    struct sv_rng rng = sv_rng_seeded(31, 4);
    assert_true(sv_tree_shade_share(f.shade, shade_middle()) == 1); /* no sun is known yet */
    for (int round = 0; round < 6; round++) {
        struct sv_vec3 to_sun = shade_sun_at(sv_rng_range(&rng, 0, 360), 8 + 14 * round);
        shade_forest_update(&f, to_sun);
        shade_forest_update(&none, to_sun);
        sv_shadow_window_fill(&w, &shade_ground->terrain.field, NULL,
                              (struct sv_shadow_place){shade_middle().x - 64, shade_middle().y - 64, 0.125});
        sv_tree_shade_cast(f.shade, &w);
        double sum = 0, truth = 0, off = 0;
        enum { POINTS = 4000 };
        for (int k = 0; k < POINTS; k++) {
            int i = (int)sv_rng_range(&rng, 300, 724), j = (int)sv_rng_range(&rng, 300, 724);
            size_t at = (size_t)j * SV_SHADOW_WINDOW_SIDE + (size_t)i;
            struct sv_vec3 p =
                sv_vec3(w.x0 + (i + 0.5) * 0.125, w.y0 + (j + 0.5) * 0.125, w.z0 + (double)w.ground[at]);
            double share = sv_tree_shade_share(f.shade, p), window = w.light[at] / 255.0;
            assert_true(share >= 0 && share <= 1);
            assert_true(sv_tree_shade_share(none.shade, p) == 1);
            sum += share / POINTS;
            truth += window / POINTS;
            off += fabs(share - window) / POINTS;
        }
        printf("  elevation %2d: mean share %.3f, in the window %.3f, mean |difference| %.3f\n",
               8 + 14 * round, sum, truth, off);
        assert_true(fabs(sum - truth) < 0.02 && off < 0.08);
    }
    shade_forest_update(&f, shade_sun_at(0, -3));
    assert_true(sv_tree_shade_share(f.shade, shade_middle()) == 0);
    shade_forest_finish(&f);
    shade_forest_finish(&none);
    sv_shadow_window_finish(&w);
}

/* ---- many ---- */

static double now_ms(void)
{
    struct timespec t;
    clock_gettime(CLOCK_MONOTONIC, &t);
    return (double)t.tv_sec * 1e3 + (double)t.tv_nsec * 1e-6;
}

static void a_million_trees(void **state)
{
    (void)state;
    static const uint32_t counts[] = {40000, 1000000};
    struct sv_error error;
    for (int n = 0; n < 2; n++) {
        uint32_t count = counts[n];
        double side = 5 * sqrt((double)count);
        struct sv_tree *trees = malloc(count * sizeof *trees);
        struct sv_rng rng = sv_rng_seeded(2, 2);
        assert_non_null(trees);
        for (uint32_t k = 0; k < count; k++)
            trees[k] = shade_tree_at(sv_rng_range(&rng, -side / 2, side / 2),
                                     sv_rng_range(&rng, -side / 2, side / 2), sv_rng_range(&rng, 9, 24),
                                     (int)(k % SHADE_SPECIES), k);
        struct shade_forest f;
        shade_forest_init(&f, trees, count, shade_table, SHADE_SPECIES);
        free(trees);
        double light[3] = {0};
        printf("  %u trees: update", count);
        for (int e = 0; e < 3; e++) {
            double since = now_ms();
            shade_forest_update(&f, shade_sun_at(120, 5 + 25 * e));
            printf(" %.0f", now_ms() - since);
            struct sv_tree_lights lights = sv_tree_shade_lights(f.shade);
            for (uint32_t k = 0; k < count; k++)
                for (int i = 0; i < 8; i++)
                    light[e] += lights.of_tree[k].share[i / 4][i % 4] / (255.0 * 8 * count);
        }
        printf(" ms at 5, 30, 55 degrees (mean light %.2f %.2f %.2f)", light[0], light[1], light[2]);
        assert_true(light[0] > 0.02 && light[0] < light[1] && light[1] < light[2] && light[2] < 0.95);
        struct sv_shadow_window w = {0};
        shade_ok(sv_shadow_window_alloc(&w, &error), &error);
        sv_shadow_window_fill(&w, &shade_ground->terrain.field, NULL,
                              (struct sv_shadow_place){shade_middle().x - 1024, shade_middle().y - 1024, 2});
        double since = now_ms();
        sv_tree_shade_cast(f.shade, &w);
        printf("; a window of 2 m texels %.0f ms", now_ms() - since);
        sv_shadow_window_fill(&w, &shade_ground->terrain.field, NULL,
                              (struct sv_shadow_place){shade_middle().x - 8192, shade_middle().y - 8192, 16});
        since = now_ms();
        sv_tree_shade_cast(f.shade, &w);
        printf(", of 16 m %.0f ms\n", now_ms() - since);
        sv_shadow_window_finish(&w);
        shade_forest_finish(&f);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(windows_keep_the_amount_of_shade),
        cmocka_unit_test(shade_of_tiny_trees_adds_up),
        cmocka_unit_test(the_caster_finds_every_tree_that_reaches),
        cmocka_unit_test(light_at_a_place_is_that_of_the_ground),
        cmocka_unit_test(a_million_trees),
    };
    return cmocka_run_group_tests(tests, shade_setup, shade_teardown);
}
