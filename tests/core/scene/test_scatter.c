/* test_scatter.c - spacing by brute force, slope, polygon, shares, blue noise, and the same trees on every
 * machine. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>
#include <cmocka.h>

#include "core/base/hash.h"
#include "core/scene/scatter.h"

enum { SIDE = 129, MOST = 60000 };

static float heights[SIDE * SIDE];
static struct sv_tree trees[MOST];

/* 1 km square, hills of 60 m: slopes from 0 to about 50 degrees, by + and * alone. */
static struct sv_heightfield hills(void)
{
    for (int j = 0; j < SIDE; j++)
        for (int i = 0; i < SIDE; i++) {
            double u = i / 32.0 - (int)(i / 32.0), v = j / 32.0 - (int)(j / 32.0);
            heights[j * SIDE + i] = (float)(960 * u * (1 - u) * v * (1 - v));
        }
    return (struct sv_heightfield){SIDE, SIDE, 500000, 5000000, 7.8125, 7.8125, 100, 0, 60, heights};
}

static struct sv_scatter_spec spec_of(uint32_t count, double spacing, double slope, double *mix)
{
    return (struct sv_scatter_spec){count, 1, mix, {8, 22}, spacing, slope, NULL};
}

static struct sv_scatter_report run(const struct sv_scatter_spec *s, int species,
                                    const struct sv_polygons *polygons)
{
    struct sv_heightfield f = hills();
    struct sv_scatter_report r;
    struct sv_error e;
    if (sv_scatter(s, species, &f, polygons, trees, &r, &e) != SV_OK)
        fail_msg("%s: %s", e.field, e.message);
    assert_true(r.placed <= s->count);
    return r;
}

static int by_x(const void *a, const void *b)
{
    const struct sv_tree *p = a, *q = b;
    return p->x < q->x ? -1 : p->x > q->x;
}

/* The least distance between any two: every pair that is near in x. */
static double least_distance(uint32_t n)
{
    double best = 1e300;
    qsort(trees, n, sizeof *trees, by_x);
    for (uint32_t a = 0; a < n; a++)
        for (uint32_t b = a + 1; b < n && trees[b].x - trees[a].x < best; b++) {
            double dx = trees[b].x - trees[a].x, dy = trees[b].y - trees[a].y, d = sqrt(dx * dx + dy * dy);
            best = d < best ? d : best;
        }
    return best;
}

static void check_tree(const struct sv_heightfield *f, const struct sv_scatter_spec *s,
                       const struct sv_tree *t, int species)
{
    double z, slope;
    assert_true(sv_heightfield_height(f, t->x, t->y, &z) && z == t->z);
    assert_true(sv_heightfield_slope(f, t->x, t->y, &slope));
    assert_true(sv_degrees(slope) <= s->max_slope_deg + 1e-9);
    assert_true((double)t->height_m >= s->height_m[0] && (double)t->height_m <= s->height_m[1]);
    assert_true(t->rotation_rad >= 0 && (double)t->rotation_rad < 2 * SV_PI);
    assert_true(t->species < species && s->mix[t->species] > 0 && t->number == 0);
}

static void test_rules(void **state)
{
    (void)state;
    static const struct {
        uint32_t count;
        double spacing, slope;
        uint32_t least;
    } rows[] = {{0, 2, 90, 0},         {1, 2, 90, 1},        {2, 500, 90, 2},       {100, 2, 90, 100},
                {20000, 2, 90, 20000}, {20000, 5, 20, 4500}, {60000, 5, 90, 25000}, {5000, 0, 90, 5000},
                {5000, 2, 3, 100},       {100, 100, 90, 60},   {100, 5000, 90, 1}};
    double mix[3] = {0.5, 0.5, 0};
    struct sv_heightfield f = hills();
    for (size_t k = 0; k < sizeof rows / sizeof rows[0]; k++) {
        struct sv_scatter_spec s = spec_of(rows[k].count, rows[k].spacing, rows[k].slope, mix);
        struct sv_scatter_report r = run(&s, 3, NULL);
        if (r.placed < rows[k].least)
            fail_msg("row %zu: %u placed, at least %u expected", k, r.placed, rows[k].least);
        for (uint32_t n = 0; n < r.placed; n++)
            check_tree(&f, &s, &trees[n], 3);
        if (r.placed > 1 && !(least_distance(r.placed) >= rows[k].spacing * (1 - 1e-12)))
            fail_msg("row %zu: %.17g apart", k, least_distance(r.placed));
        if (rows[k].slope < 90 && r.placed > 100)
            assert_true(r.rejected_slope > 0);
        if (r.placed < s.count)
            assert_true(r.rejected_spacing + r.rejected_slope > 0);
        assert_int_equal(r.rejected_polygon, 0);
    }
}

/* No room for one tree more: throw a million darts at a packed terrain. Cells are given up after 40 misses in
 * a row, so a few gaps stay: under half a per cent of the darts may find one. */
static void test_packed(void **state)
{
    (void)state;
    double mix[1] = {1};
    struct sv_scatter_spec s = spec_of(MOST, 10, 90, mix);
    struct sv_scatter_report r = run(&s, 1, NULL);
    struct sv_rng rng = sv_rng_seeded(99, 0);
    int found = 0, darts = 20000;
    for (int k = 0; k < darts; k++) {
        double x = 500000 + 1000 * sv_rng_unit(&rng), y = 5000000 + 1000 * sv_rng_unit(&rng);
        bool room = true;
        for (uint32_t n = 0; n < r.placed && room; n++) {
            double dx = trees[n].x - x, dy = trees[n].y - y;
            room = dx * dx + dy * dy >= 100;
        }
        found += room;
    }
    if (found > darts / 200)
        fail_msg("%d of %d darts found room among %u trees", found, darts, r.placed);
}

/* Far more even than chance: nearest neighbours of a random set are on average half a mean spacing away
 * (Clark and Evans 1954: R = 1), of a hexagonal lattice 2.149 times that; blue noise lies at about 1.4
 * .. 1.6. */
static void test_blue(void **state)
{
    (void)state;
    double mix[1] = {1};
    struct sv_scatter_spec s = spec_of(10000, 1, 90, mix);
    struct sv_scatter_report r = run(&s, 1, NULL);
    double sum = 0;
    int n = 0;
    for (uint32_t a = 0; a < r.placed; a += 7, n++) {
        double best = 1e300;
        for (uint32_t b = 0; b < r.placed; b++) {
            double dx = trees[b].x - trees[a].x, dy = trees[b].y - trees[a].y, d = dx * dx + dy * dy;
            best = b != a && d < best ? d : best;
        }
        sum += sqrt(best);
    }
    double clark_evans = sum / n / (0.5 * sqrt(1e6 / r.placed));
    if (!(clark_evans > 1.3 && clark_evans < 1.8))
        fail_msg("Clark-Evans R = %.3f", clark_evans);
    /* No direction of the grid shows: neighbours within 12 m lie evenly around, by quarter turns and eighths.
     */
    int octants[8] = {0};
    for (uint32_t a = 0; a < r.placed; a++)
        for (uint32_t b = a + 1; b < r.placed && b < a + 400; b++) {
            double dx = trees[b].x - trees[a].x, dy = trees[b].y - trees[a].y;
            if (dx * dx + dy * dy < 144)
                octants[(int)((atan2(dy, dx) + SV_PI) / (SV_PI / 4)) & 3]++;
        }
    double mean = (octants[0] + octants[1] + octants[2] + octants[3]) / 4.0, chi = 0;
    for (int k = 0; k < 4; k++)
        chi += (octants[k] - mean) * (octants[k] - mean) / mean;
    if (!(chi < 30))
        fail_msg("octants %d %d %d %d: chi-square %.1f", octants[0], octants[1], octants[2], octants[3], chi);
}

/* Shares: exact by largest remainders, so a chi-square far below what sampling would give (3 degrees: 5 %
 * at 7.8). */
static void test_mix(void **state)
{
    (void)state;
    double mix[5] = {0.6, 0.25, 0, 0.149, 0.001};
    for (uint32_t count = 1; count < 20000; count = count * 3 + 1) {
        struct sv_scatter_spec s = spec_of(count, 0.5, 90, mix);
        struct sv_scatter_report r = run(&s, 5, NULL);
        double chi = 0;
        int seen[5] = {0};
        for (uint32_t k = 0; k < r.placed; k++)
            seen[trees[k].species]++;
        for (int k = 0; k < 5; k++) {
            double expected = mix[k] * r.placed;
            assert_true(fabs(seen[k] - expected) <= 1);
            chi += expected > 0 ? (seen[k] - expected) * (seen[k] - expected) / expected : 0;
        }
        assert_true(count < 1000 || chi < 1);
        assert_int_equal(seen[2], 0);
    }
}

/* Stands: a tree's neighbour is of its own species more often than the shares say, yet not always. */
static void test_stands(void **state)
{
    (void)state;
    double mix[2] = {0.5, 0.5};
    struct sv_scatter_spec s = spec_of(10000, 1, 90, mix);
    struct sv_scatter_report r = run(&s, 2, NULL);
    int alike = 0, n = 0;
    for (uint32_t a = 0; a < r.placed; a += 11, n++) {
        uint32_t best = a;
        double least = 1e300;
        for (uint32_t b = 0; b < r.placed; b++) {
            double dx = trees[b].x - trees[a].x, dy = trees[b].y - trees[a].y, d = dx * dx + dy * dy;
            if (b != a && d < least) {
                least = d;
                best = b;
            }
        }
        alike += trees[a].species == trees[best].species;
    }
    assert_true(alike > 0.65 * n && alike < 0.98 * n);
}

static uint64_t hash_trees(uint32_t n)
{
    uint64_t h = SV_HASH_INIT;
    for (uint32_t k = 0; k < n; k++) {
        h = sv_hash_double(sv_hash_double(h, trees[k].x), trees[k].y);
        h = sv_hash_double(sv_hash_double(h, trees[k].z), (double)trees[k].height_m);
        h = sv_hash_double(sv_hash_u64(h, trees[k].species), (double)trees[k].rotation_rad);
    }
    return sv_hash_done(h);
}

/* Pinned: these trees on every machine and compiler. A change of the method changes them on purpose, and then
 * SCENE_BUILD_VERSION in core/scene/loading.c goes up. */
static void test_pinned(void **state)
{
    (void)state;
    double mix[3] = {0.5, 0.3, 0.2};
    struct sv_scatter_spec s = spec_of(20000, 2, 35, mix);
    struct sv_scatter_report r = run(&s, 3, NULL);
    uint64_t first = hash_trees(r.placed);
    assert_int_equal(r.placed, 20000);
    assert_int_equal(first, UINT64_C(0xB8EDE8FB1BE9CFC7));
    run(&s, 3, NULL);
    assert_true(hash_trees(r.placed) == first);
    s.seed = 2;
    run(&s, 3, NULL);
    assert_true(hash_trees(r.placed) != first);
}

static void test_refused(void **state)
{
    (void)state;
    double good[2] = {0.5, 0.5}, negative[2] = {1.5, -0.5}, none[2] = {0, 0}, nan[2] = {NAN, 1};
    struct sv_scatter_spec bad[9];
    for (int k = 0; k < 9; k++)
        bad[k] = spec_of(10, 1, 40, good);
    bad[0].mix = negative;
    bad[1].mix = none;
    bad[2].mix = nan;
    bad[3].min_spacing_m = -1;
    bad[4].min_spacing_m = NAN;
    bad[5].max_slope_deg = NAN;
    bad[6].height_m[0] = 30;
    bad[7].height_m[1] = INFINITY;
    bad[8].count = SV_FOREST_TREES_MAX + 1;
    for (int k = 0; k < 9; k++) {
        struct sv_heightfield f = hills();
        struct sv_scatter_report r;
        struct sv_error e;
        assert_int_equal(sv_scatter(&bad[k], 2, &f, NULL, trees, &r, &e), k == 8 ? SV_ELIMIT : SV_EINVAL);
    }
}

/* ---- polygons ---- */

static struct sv_polygons *polygons_of(const char *coordinates, const struct sv_crs *crs)
{
    char path[] = "/tmp/sv-stand-XXXXXX.geojson";
    int fd = mkstemps(path, 8);
    assert_true(fd >= 0);
    FILE *file = fdopen(fd, "w");
    fprintf(file,
            "{\"type\":\"FeatureCollection\",\"crs\":{\"type\":\"name\",\"properties\":{\"name\":\"EPSG:"
            "32633\"}},\"features\":["
            "{\"type\":\"Feature\",\"properties\":{},\"geometry\":{\"type\":\"MultiPolygon\",\"coordinates\":"
            "%s}}]}",
            coordinates);
    fclose(file);
    struct sv_polygons *p = NULL;
    struct sv_error e;
    enum sv_status status = sv_polygons_read(path, crs, &p, &e);
    unlink(path);
    if (status != SV_OK)
        fail_msg("%s", e.message);
    return p;
}

/* A square with a hole, and far off a small triangle. */
static bool inside(double x, double y)
{
    double u = x - 500000, v = y - 5000000;
    bool square = u > 100 && u < 400 && v > 100 && v < 400 && !(u > 200 && u < 300 && v > 200 && v < 300);
    bool triangle = u > 900 && v > 900 && (u - 900) + (v - 900) < 40;
    return square || triangle;
}

static void test_polygon(void **state)
{
    (void)state;
    struct sv_crs *crs = NULL;
    struct sv_error e;
    sv_geo_init();
    assert_int_equal(sv_crs_create("EPSG:32633", &crs, &e), SV_OK);
    struct sv_polygons *p = polygons_of(
        "[[[[500100,5000100],[500400,5000100],[500400,5000400],[500100,5000400],[500100,5000100]],"
        "[[500200,5000200],[500200,5000300],[500300,5000300],[500300,5000200],[500200,5000200]]],"
        "[[[500900,5000900],[500940,5000900],[500900,5000940],[500900,5000900]]]]",
        crs);
    double mix[1] = {1};
    struct sv_scatter_spec s = spec_of(8000, 1, 90, mix);
    struct sv_scatter_report r = run(&s, 1, p);
    assert_int_equal(r.placed, 8000);
    assert_true(r.rejected_polygon > 0);
    int in_triangle = 0;
    for (uint32_t k = 0; k < r.placed; k++) {
        assert_true(inside(trees[k].x, trees[k].y));
        in_triangle += trees[k].x > 500800;
    }
    double share = 800.0 / (80000 + 800) * 8000; /* 79 trees; an even spread is within a third of that */
    assert_true(in_triangle > 0.66 * share && in_triangle < 1.34 * share);
    assert_true(least_distance(r.placed) >= 1);
    sv_polygons_destroy(p);
    p = polygons_of("[[[[600000,5000100],[600400,5000100],[600400,5000400],[600000,5000100]]]]",
                    crs); /* off the terrain */
    r = run(&s, 1, p);
    assert_int_equal(r.placed, 0);
    sv_polygons_destroy(p);
    sv_crs_destroy(crs);
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(test_rules),   cmocka_unit_test(test_packed),
                                       cmocka_unit_test(test_blue),    cmocka_unit_test(test_mix),
                                       cmocka_unit_test(test_stands),  cmocka_unit_test(test_pinned),
                                       cmocka_unit_test(test_refused), cmocka_unit_test(test_polygon)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
