/* test_forest.c - the hierarchy holds every tree once and bounds every crown, by brute force. */
#include <setjmp.h>
#include <stdarg.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>
#include <cmocka.h>

#include "core/base/rng.h"
#include "core/scene/forest.h"

static const struct sv_crown_bound BOUNDS[3] = {{0.25f, 1, 0}, {0.9f, 1, -0.1f}, {0, 1.5f, -0.5f}};

static struct sv_arena *arena;

static struct sv_tree *random_trees(uint32_t count, double x0, double y0, double side, uint64_t seed)
{
    struct sv_rng rng = sv_rng_seeded(seed, 0);
    struct sv_tree *trees = sv_arena_alloc(arena, count ? count : 1, sizeof *trees);
    assert_non_null(trees);
    for (uint32_t k = 0; k < count; k++)
        trees[k] = (struct sv_tree){.x = sv_rng_range(&rng, x0, x0 + side),
                                    .y = sv_rng_range(&rng, y0, y0 + 0.3 * side),
                                    .z = sv_rng_range(&rng, -10, 800),
                                    .height_m = (float)sv_rng_range(&rng, 0.05, 150),
                                    .species = (uint16_t)(sv_rng_next(&rng) % 3),
                                    .number = k};
    return trees;
}

/* Does the box of a node hold the crown? Compared in long double: boxes are narrowed outward, so there is no
 * slack. */
static void check_crown(const struct sv_forest *f, const struct sv_forest_node *n, const struct sv_tree *t)
{
    const struct sv_crown_bound *b = &BOUNDS[t->species];
    long double h = (long double)t->height_m;
    const long double place[3] = {(long double)t->x - f->origin.x, (long double)t->y - f->origin.y,
                                  (long double)t->z - f->origin.z};
    const long double below[3] = {h * b->radius, h * b->radius, -h * b->bottom};
    const long double above[3] = {h * b->radius, h * b->radius, h * b->top};
    for (int a = 0; a < 3;
         a++) /* origin, place and h are doubles: their sums were rounded once, by 2^-52 of 1e7 m */
        if (!((long double)n->box_min[a] <= place[a] - below[a] + 1e-8L &&
              (long double)n->box_max[a] >= place[a] + above[a] - 1e-8L))
            fail_msg("axis %d: %.9Lg .. %.9Lg is not in %.9g .. %.9g", a, place[a] - below[a],
                     place[a] + above[a], (double)n->box_min[a], (double)n->box_max[a]);
}

static void check(const struct sv_forest *f, uint32_t count)
{
    unsigned char *seen = calloc(count + 1, 1);
    assert_int_equal(f->count, count);
    assert_int_equal(f->node_count, 2 * f->leaf_first);
    assert_int_equal(f->leaf_first & (f->leaf_first - 1), 0);
    assert_int_equal(f->nodes[1].first, 0);
    assert_int_equal(f->nodes[1].count, count);
    for (uint32_t k = 1; k < f->node_count; k++) {
        const struct sv_forest_node *n = &f->nodes[k];
        assert_true(n->first + n->count <= count);
        for (uint32_t t = n->first; t < n->first + n->count; t++)
            check_crown(f, n, &f->trees[t]);
        if (k >= f->leaf_first) {
            assert_true(n->count <= SV_FOREST_LEAF);
            for (uint32_t t = n->first; t < n->first + n->count; t++)
                seen[f->trees[t].number]++;
        } else {
            const struct sv_forest_node *a = &f->nodes[2 * k], *b = &f->nodes[2 * k + 1];
            assert_int_equal(a->first, n->first);
            assert_int_equal(b->first, a->first + a->count);
            assert_int_equal(a->count + b->count, n->count);
        }
        if (n->count == 0)
            assert_true(n->box_min[0] > n->box_max[0]);
    }
    for (uint32_t k = 0; k < count; k++)
        assert_int_equal(seen[k], 1);
    free(seen);
}

static void test_random(void **state)
{
    (void)state;
    static const uint32_t counts[] = {1, 2, 31, 32, 33, 63, 64, 65, 1000, 4096, 4097, 20000};
    for (size_t k = 0; k < sizeof counts / sizeof counts[0]; k++) {
        struct sv_forest f;
        struct sv_error e;
        struct sv_tree *trees = random_trees(counts[k], 500000, 9100000, 5000, k);
        assert_int_equal(sv_forest_build(trees, counts[k], BOUNDS, arena, &f, &e), SV_OK);
        assert_ptr_equal(f.trees, trees);
        check(&f, counts[k]);
    }
}

static void test_none(void **state)
{
    (void)state;
    struct sv_forest f = {.count = 5};
    assert_int_equal(sv_forest_build(NULL, 0, BOUNDS, arena, &f, NULL), SV_OK);
    assert_true(f.count == 0 && f.node_count == 0 && !f.nodes);
}

/* All in one place, all on a line, two far apart: no division by nothing, all still there. */
static void test_degenerate(void **state)
{
    (void)state;
    for (int shape = 0; shape < 3; shape++) {
        uint32_t count = 500;
        struct sv_tree *trees = random_trees(count, 0, 0, 100, 3);
        for (uint32_t k = 0; k < count; k++) {
            trees[k].x = shape == 0 ? 4e6 : shape == 1 ? (double)k : k % 2 ? -1e7 : 1e7;
            trees[k].y = 9e6;
        }
        struct sv_forest f;
        struct sv_error e;
        assert_int_equal(sv_forest_build(trees, count, BOUNDS, arena, &f, &e), SV_OK);
        check(&f, count);
        if (shape == 0) /* ties keep the order of the scene file */
            for (uint32_t k = 0; k < count; k++)
                assert_int_equal(f.trees[k].number, k);
    }
}

static void test_refused(void **state)
{
    (void)state;
    static const double bad[] = {NAN, INFINITY, -INFINITY};
    for (int k = 0; k < 12; k++) {
        struct sv_tree *trees = random_trees(40, 0, 0, 100, 1);
        struct sv_forest f = {.count = 77};
        struct sv_error e;
        double v = bad[k % 3];
        if (k / 3 == 0)
            trees[39].x = v;
        else if (k / 3 == 1)
            trees[39].y = v;
        else if (k / 3 == 2)
            trees[39].z = v;
        else
            trees[39].height_m = (float)v;
        assert_int_equal(sv_forest_build(trees, 40, BOUNDS, arena, &f, &e), SV_EINVAL);
        assert_int_equal(f.count, 77);
    }
    struct sv_forest f;
    struct sv_error e;
    assert_int_equal(sv_forest_build(NULL, SV_FOREST_TREES_MAX + 1, BOUNDS, arena, &f, &e), SV_ELIMIT);
}

/* Neighbours in the order are neighbours on the ground: leaves are small. 20,000 trees on 1 km^2 in 1,024
 * leaves: a leaf's square would be 31 m; Morton leaves are at worst a few times that, random ones would be 1
 * km. */
static void test_local(void **state)
{
    (void)state;
    struct sv_tree *trees = random_trees(20000, 0, 0, 1825, 9);
    struct sv_crown_bound none[3] = {{0, 0, 0}, {0, 0, 0}, {0, 0, 0}};
    struct sv_forest f;
    struct sv_error e;
    assert_int_equal(sv_forest_build(trees, 20000, none, arena, &f, &e), SV_OK);
    double sum = 0;
    for (uint32_t k = f.leaf_first; k < f.node_count; k++)
        sum += (double)(f.nodes[k].box_max[0] - f.nodes[k].box_min[0] + f.nodes[k].box_max[1] -
                        f.nodes[k].box_min[1]) /
               2;
    double mean = sum / f.leaf_first;
    if (!(mean < 60))
        fail_msg("mean leaf side %.1f m", mean);
}

/* A forest of which trees go and to which others come is the one that is built of what is there then, byte
 * for byte: nothing gone, all gone, nothing come, and both, in sizes about those of leaves; at a million
 * (SV_TEST_FULL=1) too. */
static void test_turn_over(void **state)
{
    (void)state;
    static const uint32_t sizes[][3] = {{0, 5, 9},  {40, 0, 0},   {40, 40, 0},    {33, 2, 1},
                                        {1, 1, 64}, {64, 20, 21}, {3000, 7, 400}, {1000000, 300, 200}};
    const char *wish = getenv("SV_TEST_FULL");
    bool full = wish && strcmp(wish, "1") == 0;
    size_t rows = sizeof sizes / sizeof sizes[0] - !full;
    for (size_t row = 0; row < rows; row++) {
        uint32_t count = sizes[row][0], gone = sizes[row][1] < count ? sizes[row][1] : count,
                 come = sizes[row][2];
        uint32_t now = count - gone + come;
        struct sv_tree *all =
            random_trees(count + come + 1, 500000, 9100000, 900, 50 + row); /* one to spare */
        struct sv_tree *old_trees = sv_arena_copy(arena, all, (count + 1) * sizeof *all);
        struct sv_tree *come_trees = sv_arena_copy(arena, all + count, (come + 1) * sizeof *all);
        struct sv_tree *want_trees = sv_arena_copy(arena, all + gone, (now + 1) * sizeof *all);
        uint8_t *is_gone = calloc(count + 1, 1);
        uint32_t *from = malloc((now + 1) * sizeof *from);
        struct sv_forest old, want, got;
        struct sv_error e;
        assert_int_equal(sv_forest_build(old_trees, count, BOUNDS, arena, &old, &e), SV_OK);
        assert_int_equal(sv_forest_build(want_trees, now, BOUNDS, arena, &want, &e), SV_OK);
        for (uint32_t k = 0; k < count; k++)
            is_gone[k] = old.trees[k].number < gone;
        const struct sv_forest_turnover t = {&old, is_gone, come_trees, come};
        assert_int_equal(sv_forest_turn_over(&t, BOUNDS, arena, &got, from, &e), SV_OK);
        assert_int_equal(got.count, now);
        assert_int_equal(got.node_count, want.node_count);
        assert_memory_equal(&got.origin, &want.origin, sizeof got.origin);
        if (now) {
            assert_memory_equal(got.trees, want.trees, now * sizeof *got.trees);
            assert_memory_equal(got.nodes, want.nodes, got.node_count * sizeof *got.nodes);
        }
        for (uint32_t k = 0; k < now; k++)
            if (from[k] == SV_FOREST_CAME)
                assert_true(got.trees[k].number >= count);
            else
                assert_int_equal(old.trees[from[k]].number, got.trees[k].number);
        assert_true(sv_forest_bytes(now) >= now * sizeof *got.trees + got.node_count * sizeof *got.nodes);
        free(is_gone);
        free(from);
    }
}

static int set_up(void **state)
{
    (void)state;
    return sv_arena_create((size_t)1 << 30, &arena, NULL) == SV_OK ? 0 : -1;
}

static int tear_down(void **state)
{
    (void)state;
    sv_arena_destroy(arena);
    return 0;
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(test_random),     cmocka_unit_test(test_none),
                                       cmocka_unit_test(test_degenerate), cmocka_unit_test(test_refused),
                                       cmocka_unit_test(test_local),      cmocka_unit_test(test_turn_over)};
    return cmocka_run_group_tests(tests, set_up, tear_down);
}
