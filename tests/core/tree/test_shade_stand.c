/* test_shade_stand.c - what sunlight arrives at the trees of a stand, against rays and closed forms. */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "core/base/frames.h"
#include "core/base/rng.h"
#include "core/scene/id.h"
#include "shade_fixture.h"

/* ---- light in a stand ---- */

struct truth_light {
    double lit[SV_SHADE_COLUMNS][SV_SHADE_ROWS], all[SV_SHADE_COLUMNS][SV_SHADE_ROWS];
    double ours; /* sum of our light over the same points */
};

/* By rays: of what the sun would see of a tree alone, cell by cell of its grid, how much it sees in the
 * stand. Both pictures have their middle at the foot, so that a pixel is the same ray of light in both. */
static void truth_light_of(const struct sv_truth *alone, const struct sv_truth *together,
                           const struct sv_tree *tree, struct sv_vec3 lone, double elevation,
                           const struct sv_tree_light *light, const struct sv_tree_light_axes *axes,
                           struct truth_light *out)
{
    enum { PICTURE = 128 };
    double span = 2.6 * (double)tree->height_m;
    uint32_t own = SV_ID_TREE_FIRST + tree->number;
    struct sv_camera c = shade_sun_camera(SHADE_AZIMUTH_DEG, elevation, lone, span, PICTURE);
    uint32_t *one = shade_truth_ids(alone, &c);
    float *depth = shade_truth_depths(alone, &c);
    struct sv_vec3 eye = c.eye;
    c = shade_sun_camera(SHADE_AZIMUTH_DEG, elevation, sv_vec3(tree->x, tree->y, tree->z), span, PICTURE);
    uint32_t *all = shade_truth_ids(together, &c);
    memset(out, 0, sizeof *out);
    for (int j = 0; j < PICTURE; j++)
        for (int i = 0; i < PICTURE; i++) {
            size_t at = (size_t)j * PICTURE + (size_t)i;
            if (one[at] != own)
                continue;
            struct sv_vec3 origin, direction;
            sv_camera_ray(&c, i + 0.5, j + 0.5, &origin, &direction);
            origin = sv_madd(sv_add(sv_sub(eye, lone), origin), direction, (double)depth[at]);
            struct sv_vec3 p = sv_scale(origin, 1 / (double)tree->height_m);
            const float *x = axes->across, *y = axes->along;
            double u = p.x * (double)x[0] + p.y * (double)x[1] + p.z * (double)x[2] + (double)x[3];
            double v = p.x * (double)y[0] + p.y * (double)y[1] + p.z * (double)y[2] + (double)y[3];
            int a = (int)sv_clamp(floor(u + 0.5), 0, SV_SHADE_COLUMNS - 1),
                b = (int)sv_clamp(floor(v + 0.5), 0, SV_SHADE_ROWS - 1);
            out->all[a][b]++;
            out->lit[a][b] += all[at] == own;
            out->ours +=
                (double)sv_tree_light_at(light, axes, (const float[3]){(float)p.x, (float)p.y, (float)p.z});
        }
    free(depth);
    free(one);
    free(all);
}

static void light_in_a_stand_is_what_rays_say(void **state)
{
    (void)state;
    static const double elevations[] = {5, 20, 40, 60, 85};
    struct sv_error error;
    const struct sv_forest *forest = &shade_stand->forest;
    struct sv_tree lone[64];
    assert_true(forest->count <= 64);
    for (uint32_t k = 0; k < forest->count; k++) {
        struct sv_vec3 p = shade_apart((int)k);
        lone[k] = forest->trees[k];
        lone[k].x = p.x;
        lone[k].y = p.y;
        lone[k].z = p.z;
    }
    struct sv_scene scenes[2];
    struct sv_truth *together = shade_truth_of(&scenes[0], forest->trees, forest->count);
    struct sv_truth *alone = shade_truth_of(&scenes[1], lone, forest->count);
    struct sv_tree_shade *shade;
    shade_ok(sv_tree_shade_create(shade_table, SHADE_SPECIES, forest, &shade, &error), &error);
    printf("  elevation: mean light by row from below, truth | ours; mean |difference| of cells, of trees\n");
    for (size_t e = 0; e < sizeof elevations / sizeof elevations[0]; e++) {
        double elevation = elevations[e];
        shade_ok(sv_tree_shade_update(shade, shade_sun_at(SHADE_AZIMUTH_DEG, elevation), NULL, NULL, &error),
                 &error);
        struct sv_tree_lights lights = sv_tree_shade_lights(shade);
        double truth_rows[SV_SHADE_ROWS] = {0}, our_rows[SV_SHADE_ROWS] = {0}, weights[SV_SHADE_ROWS] = {0};
        double off_cells = 0, off_trees = 0, cells = 0, truth_mean = 0, our_mean = 0;
        for (uint32_t k = 0; k < forest->count; k++) {
            const struct sv_tree *tree = &forest->trees[k];
            struct truth_light t;
            truth_light_of(alone, together, tree, sv_vec3(lone[k].x, lone[k].y, lone[k].z), elevation,
                           &lights.of_tree[k], &lights.of_species[tree->species], &t);
            double truth_sum = 0, all = 0;
            for (int a = 0; a < SV_SHADE_COLUMNS; a++)
                for (int r = 0; r < SV_SHADE_ROWS; r++) {
                    double ours = lights.of_tree[k].share[a][r] / 255.0, n = t.all[a][r];
                    truth_rows[r] += t.lit[a][r];
                    our_rows[r] += ours * n;
                    weights[r] += n;
                    truth_sum += t.lit[a][r];
                    all += n;
                    if (n < 30)
                        continue;
                    off_cells += fabs(ours - t.lit[a][r] / n);
                    cells++;
                }
            off_trees += fabs(truth_sum - t.ours) / all;
            truth_mean += truth_sum / all;
            our_mean += t.ours / all;
        }
        printf("  %3.0f:", elevation);
        for (int r = 0; r < SV_SHADE_ROWS; r++)
            printf(" %.2f", truth_rows[r] / fmax(weights[r], 1));
        printf(" |");
        for (int r = 0; r < SV_SHADE_ROWS; r++)
            printf(" %.2f", our_rows[r] / fmax(weights[r], 1));
        printf("; %.3f, %.3f; mean %.3f | %.3f\n", off_cells / cells, off_trees / forest->count,
               truth_mean / forest->count, our_mean / forest->count);
        /* These crowns reach into each other (random places): light passes them in no order of trees, only of
         * their halves. */
        assert_true(off_cells / cells < 0.13);
        assert_true(off_trees / forest->count < (elevation > 45 ? 0.11 : 0.07));
        assert_true(fabs(truth_mean - our_mean) / forest->count < 0.02);
    }
    sv_tree_shade_destroy(shade);
    sv_truth_destroy(together);
    sv_truth_destroy(alone);
}

/* ---- one tree, and what is the same whatever came before ---- */

static void a_lone_tree_gets_all_light(void **state)
{
    (void)state;
    static const double heights[] = {0.05, 0.1, 12, 120, 150}, elevations[] = {1e-9, 0.01, 3, 45, 89.999, 90};
    for (size_t h = 0; h < sizeof heights / sizeof heights[0]; h++) {
        struct sv_tree tree = shade_tree_at(3, 4, heights[h], (int)h % SHADE_SPECIES, 9);
        struct shade_forest f;
        shade_forest_init(&f, &tree, 1, shade_table, SHADE_SPECIES);
        assert_null(sv_tree_shade_lights(f.shade).of_tree);
        for (size_t e = 0; e < sizeof elevations / sizeof elevations[0]; e++) {
            shade_forest_update(&f, shade_sun_at(33, elevations[e]));
            struct sv_tree_lights lights = sv_tree_shade_lights(f.shade);
            for (int k = 0; k < SV_SHADE_COLUMNS * SV_SHADE_ROWS; k++)
                assert_int_equal(lights.of_tree[0].share[k / SV_SHADE_ROWS][k % SV_SHADE_ROWS], 255);
            const struct sv_tree_light_axes *axes = &lights.of_species[tree.species];
            for (int k = 0; k < 4; k++)
                assert_true(isfinite(axes->across[k]) && isfinite(axes->along[k]));
        }
        shade_forest_finish(&f);
    }
}

static void night_and_no_direction(void **state)
{
    (void)state;
    struct sv_tree tree = shade_tree_at(0, 0, 10, 0, 1);
    struct shade_forest f;
    struct sv_error error;
    struct sv_shadow_window window = {0};
    shade_ok(sv_shadow_window_alloc(&window, SV_SHADOW_WINDOW_SIDE, &error), &error);
    sv_shadow_window_fill(&window, &shade_ground->terrain.field, NULL,
                          (struct sv_shadow_place){shade_middle().x - 64, shade_middle().y - 64, 0.125});
    shade_forest_init(&f, &tree, 1, shade_table, SHADE_SPECIES);
    sv_tree_shade_cast(f.shade, &window); /* before the first update */
    static const double below[] = {0, -1e-12, -30, -90};
    for (int k = 0; k < 4; k++) {
        shade_forest_update(&f, shade_sun_at(10, below[k]));
        struct sv_tree_lights lights = sv_tree_shade_lights(f.shade);
        for (int i = 0; i < 8; i++)
            assert_int_equal(lights.of_tree[0].share[i / 4][i % 4], 0);
        sv_tree_shade_cast(f.shade, &window);
    }
    for (size_t k = 0; k < (size_t)SV_SHADOW_WINDOW_SIDE * SV_SHADOW_WINDOW_SIDE; k++)
        assert_int_equal(window.light[k], 255);
    const struct sv_vec3 bad[] = {{0, 0, 0}, {NAN, 0, 1}, {0, INFINITY, 1}};
    for (int k = 0; k < 3; k++) {
        assert_int_equal(sv_tree_shade_update(f.shade, bad[k], NULL, NULL, &error), SV_EINVAL);
        assert_string_equal(error.field, "to_sun");
    }
    struct sv_shade_species none[SHADE_SPECIES] = {{NULL, NULL, 0}};
    struct sv_tree_shade *shade;
    assert_int_equal(sv_tree_shade_create(none, SHADE_SPECIES, &f.forest, &shade, &error), SV_EINVAL);
    shade_forest_finish(&f);
    shade_forest_init(&f, &tree, 0, shade_table, SHADE_SPECIES); /* no trees */
    shade_forest_update(&f, shade_sun_at(10, 30));
    sv_tree_shade_cast(f.shade, &window);
    shade_forest_finish(&f);
    sv_shadow_window_finish(&window);
}

static double flat_shadow(void *context, double x, double y)
{
    (void)x, (void)y;
    return *(const double *)context;
}

/* A level sun sees a tree's height as it is: of a tree in the terrain's shadow up to d, the rows below d are
 * dark, those above lit, whatever the species. */
static void the_terrain_shades_from_below(void **state)
{
    (void)state;
    struct sv_error error;
    struct sv_tree tree = shade_tree_at(0, 0, 20, 0, 3);
    for (int d = -5; d <= 25; d++) {
        struct shade_forest f;
        shade_forest_init(&f, &tree, 1, shade_table, SHADE_SPECIES);
        double height = tree.z + d, sum = 0;
        shade_ok(sv_tree_shade_update(f.shade, shade_sun_at(100, 2), flat_shadow, &height, &error), &error);
        struct sv_tree_lights lights = sv_tree_shade_lights(f.shade);
        const struct sv_tree_light_axes *axes = &lights.of_species[0];
        enum { STEPS = 100 };
        for (int k = 0; k < STEPS; k++) {
            const float p[3] = {0, 0, (k + 0.5f) / STEPS};
            float light = sv_tree_light_at(&lights.of_tree[0], axes, p);
            sum += (double)light / STEPS;
            /* A row is 5 m: the edge is that wide. The least shadow that is heeded is 0.1 m and 1/20 of 20 m.
             */
            if (d <= 1 || p[2] * 20 > d + 7.6f)
                assert_true(light > 0.99f);
            if (d > 1 && p[2] * 20 < d - 7.6f)
                assert_true(light < 0.01f);
        }
        /* Within half a row where the edge passes the grid's ends. */
        assert_true(fabs(sum - sv_clamp(1 - d / 20.0, 0, 1)) < 0.07);
        shade_forest_finish(&f);
    }
}

static void updates_do_not_depend_on_what_came_before(void **state)
{
    (void)state;
    struct shade_forest a, b;
    const struct sv_forest *forest = &shade_stand->forest;
    shade_forest_init(&a, forest->trees, forest->count, shade_table, SHADE_SPECIES);
    shade_forest_init(&b, forest->trees, forest->count, shade_table, SHADE_SPECIES);
    for (int round = 0; round < 12; round++) {
        struct sv_vec3 to_sun = shade_sun_at(20 * (round % 5), 5 + 13 * (round % 5));
        shade_forest_update(&a, to_sun);
        if (round % 5 == 2) {
            shade_forest_update(&b, shade_sun_at(1, 2));
            shade_forest_update(&b, to_sun);
            assert_memory_equal(sv_tree_shade_lights(a.shade).of_tree, sv_tree_shade_lights(b.shade).of_tree,
                                forest->count * sizeof(struct sv_tree_light));
        }
    }
    /* The same again is the same object, not only the same bytes: it was kept. */
    const struct sv_tree_light *kept = sv_tree_shade_lights(a.shade).of_tree;
    shade_forest_update(&a, shade_sun_at(0, 5));
    shade_forest_update(&a, shade_sun_at(20, 18));
    assert_ptr_equal(sv_tree_shade_lights(a.shade).of_tree, kept);
    shade_forest_finish(&a);
    shade_forest_finish(&b);
}

static void species_of_one_mesh_share_silhouettes(void **state)
{
    (void)state;
    struct sv_shade_species twins[2] = {shade_table[0], shade_table[0]};
    struct sv_tree one[4], two[4];
    for (int k = 0; k < 4; k++) {
        one[k] = shade_tree_at(4 * k, k, 9 + k, 0, (uint32_t)k);
        two[k] = one[k];
        two[k].species = (uint16_t)(k & 1);
    }
    struct shade_forest a, b;
    shade_forest_init(&a, one, 4, shade_table, 1);
    shade_forest_init(&b, two, 4, twins, 2);
    shade_forest_update(&a, shade_sun_at(250, 20));
    shade_forest_update(&b, shade_sun_at(250, 20));
    assert_non_null(b.shade->current->views[0].texels);
    assert_null(b.shade->current->views[1].texels);
    struct sv_tree_lights la = sv_tree_shade_lights(a.shade), lb = sv_tree_shade_lights(b.shade);
    assert_memory_equal(la.of_tree, lb.of_tree, 4 * sizeof *la.of_tree);
    assert_memory_equal(&lb.of_species[0], &lb.of_species[1], sizeof *lb.of_species);
    shade_forest_finish(&a);
    shade_forest_finish(&b);
}

/* Trees go and come in a wood that is much wider than what a tree shades: the light that is carried over and
 * found again near the change is that of a shade that was made of the new wood alone, byte for byte. For that a
 * quarter of the wood is enough, though the changes are all over it; where more trees than are allowed for
 * would be taken again, it is left to the next update. */
static void a_change_gives_what_starting_anew_gives(void **state)
{
    (void)state;
    enum { COUNT = 4000, COME = 4, EVERY = 1000 };
    static struct sv_tree trees[COUNT + COME], now[COUNT + COME];
    static uint8_t gone[COUNT];
    static uint32_t from[COUNT + COME];
    struct sv_tree went[COUNT / EVERY + 1], come[COME];
    struct sv_rng rng = sv_rng_seeded(21, 0);
    struct shade_forest old, anew;
    struct sv_crown_bound bounds[SHADE_SPECIES];
    struct sv_error error;
    for (uint32_t k = 0; k < COUNT + COME; k++)
        trees[k] = shade_tree_at(sv_rng_range(&rng, -400, 400), sv_rng_range(&rng, -400, 400),
                                 sv_rng_range(&rng, 5, 20), (int)(k % SHADE_SPECIES), k);
    for (int k = 0; k < SHADE_SPECIES; k++)
        bounds[k] = (struct sv_crown_bound){shade_table[k].radius, 1, 0};
    for (int round = 0, elevation = 8; elevation <= 88; elevation += 20, round++) {
        bool leave = round & 1;
        struct sv_vec3 to_sun = shade_sun_at(SHADE_AZIMUTH_DEG, elevation);
        uint32_t went_count = 0, now_count = 0;
        shade_forest_init(&old, trees, COUNT, shade_table, SHADE_SPECIES);
        shade_forest_update(&old, to_sun);
        for (uint32_t k = 0; k < COUNT + COME; k++)
            if (k < COUNT && k % EVERY == 7)
                went[went_count++] = trees[k];
            else
                now[now_count++] = trees[k];
        for (uint32_t k = 0; k < COUNT; k++)
            gone[k] = old.forest.trees[k].number % EVERY == 7;
        memcpy(come, trees + COUNT, sizeof come);
        struct sv_forest next, before = old.forest;
        const struct sv_forest_turnover turnover = {&before, gone, come, COME};
        shade_ok(sv_forest_turn_over(&turnover, bounds, old.arena, &next, from, &error), &error);
        old.forest = next;
        const struct sv_tree_shade_change change = {.species = shade_table,
                                                    .gone = went,
                                                    .gone_count = went_count,
                                                    .from = from,
                                                    .to_sun = to_sun,
                                                    .most = leave ? COME : COUNT / 4};
        shade_ok(sv_tree_shade_change(old.shade, &change, &error), &error);
        assert_int_equal(sv_tree_shade_keeps(old.shade, to_sun), !leave);
        if (leave) {
            assert_null(sv_tree_shade_lights(old.shade).of_tree);
            shade_forest_update(&old, to_sun);
        }
        shade_forest_init(&anew, now, now_count, shade_table, SHADE_SPECIES);
        shade_forest_update(&anew, to_sun);
        assert_int_equal(old.forest.count, now_count);
        assert_memory_equal(old.forest.trees, anew.forest.trees, now_count * sizeof *now);
        assert_memory_equal(sv_tree_shade_lights(old.shade).of_tree, sv_tree_shade_lights(anew.shade).of_tree,
                            now_count * sizeof(struct sv_tree_light));
        shade_forest_finish(&old);
        shade_forest_finish(&anew);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(light_in_a_stand_is_what_rays_say),
        cmocka_unit_test(a_lone_tree_gets_all_light),
        cmocka_unit_test(night_and_no_direction),
        cmocka_unit_test(the_terrain_shades_from_below),
        cmocka_unit_test(updates_do_not_depend_on_what_came_before),
        cmocka_unit_test(species_of_one_mesh_share_silhouettes),
        cmocka_unit_test(a_change_gives_what_starting_anew_gives),
    };
    return cmocka_run_group_tests(tests, shade_setup, shade_teardown);
}
