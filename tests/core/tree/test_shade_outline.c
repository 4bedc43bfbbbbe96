/* test_shade_outline.c - trees' outlines in sunlight against rays of the ray-cast truth. */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "core/scene/id.h"
#include "shade_fixture.h"

/* Coverage of an outline at (x, y) of the light's plane, in heights; nearest texel. */
static double outline_at(const struct sv_shade_outline *o, int level, double x, double y)
{
    if (o->levels == 0)
        return 0;
    const struct sv_silhouette *l = &o->level[level];
    double texel = ldexp((double)o->texel, level);
    double i = floor((x - (double)o->left) / texel), j = floor(((double)o->top - y) / texel);
    if (!(i >= 0 && j >= 0 && i < l->width && j < l->height))
        return 0;
    return l->coverage[(size_t)j * (size_t)l->width + (size_t)i] / 255.0;
}

struct likeness {
    double area_ratio, overlap, difference; /* difference: mean |a - b| over cells where either is */
};

enum { SIDE = 384, CELLS = 32 };

static struct likeness compare(const double truth[CELLS][CELLS], const double ours[CELLS][CELLS])
{
    double sum_truth = 0, sum_ours = 0, low = 0, high = 0, off = 0, cells = 0;
    for (int j = 0; j < CELLS; j++)
        for (int i = 0; i < CELLS; i++) {
            double a = truth[j][i], b = ours[j][i];
            sum_truth += a;
            sum_ours += b;
            low += fmin(a, b);
            high += fmax(a, b);
            off += fabs(a - b);
            cells += a > 0 || b > 0;
        }
    return (struct likeness){sum_ours / sum_truth, low / high, off / cells};
}

/* Coverage by truth of a tree that nothing hides, on a grid of CELLS over `span`, seen from the sun. */
static void truth_cells(const struct sv_truth *truth, const struct sv_tree *tree, double azimuth,
                        double elevation, double span, double cells[CELLS][CELLS])
{
    struct sv_camera c = shade_sun_camera(azimuth, elevation, sv_vec3(tree->x, tree->y, tree->z), span, SIDE);
    uint32_t *ids = shade_truth_ids(truth, &c);
    memset(cells, 0, CELLS * sizeof *cells);
    for (int j = 0; j < SIDE; j++)
        for (int i = 0; i < SIDE; i++)
            if (ids[(size_t)j * SIDE + (size_t)i] == SV_ID_TREE_FIRST + tree->number)
                cells[j * CELLS / SIDE][i * CELLS / SIDE] += (double)CELLS * CELLS / (SIDE * SIDE);
    free(ids);
}

static void our_cells(const struct sv_shade_outline *o, double height, double span,
                      double cells[CELLS][CELLS])
{
    memset(cells, 0, CELLS * sizeof *cells);
    for (int j = 0; j < SIDE; j++)
        for (int i = 0; i < SIDE; i++) {
            double x = ((i + 0.5) / SIDE - 0.5) * span, y = (0.5 - (j + 0.5) / SIDE) * span;
            cells[j * CELLS / SIDE][i * CELLS / SIDE] +=
                outline_at(o, 0, x / height, y / height) * CELLS * CELLS / (SIDE * SIDE);
        }
}

enum { ROTATIONS = 5 };
/* Area and outline against rays. What is lost is told apart: the same comparison with the tree turned to the
 * turn that its silhouette stands for leaves only what the impostor's frames are off. */
static void silhouettes_are_what_the_sun_sees(void **state)
{
    (void)state;
    static const double elevations[] = {3, 20, 40, 60, 88};
    struct sv_tree trees[2][SHADE_SPECIES * ROTATIONS];
    for (int k = 0; k < 2 * SHADE_SPECIES * ROTATIONS; k++) {
        int s = k / ROTATIONS % SHADE_SPECIES, turned = k / (SHADE_SPECIES * ROTATIONS);
        struct sv_vec3 p = shade_apart(k);
        float rotation = (float)(0.1 + 1.3 * (k % ROTATIONS));
        if (turned)
            rotation = (float)(2 * SV_PI * sv_shade_turn(rotation) / SV_SHADE_TURNS);
        trees[turned][k % (SHADE_SPECIES * ROTATIONS)] = (struct sv_tree){.x = p.x,
                                                                          .y = p.y,
                                                                          .z = p.z,
                                                                          .height_m = 12,
                                                                          .rotation_rad = rotation,
                                                                          .species = (uint16_t)s,
                                                                          .number = (uint32_t)k};
    }
    struct sv_scene scene;
    struct sv_truth *truth = shade_truth_of(&scene, trees[0], 2 * SHADE_SPECIES * ROTATIONS);
    double worst_area = 0, least_overlap = 1, mean_overlap = 0, frames_overlap = 0, mean_area = 0;
    int count = 0;
    printf("  species elevation: area ours/truth, overlap, mean |difference| (overlap in the same turn)\n");
    for (int s = 0; s < SHADE_SPECIES; s++)
        for (size_t e = 0; e < sizeof elevations / sizeof elevations[0]; e++) {
            struct sv_error error;
            struct sv_shade_view view;
            double elevation = elevations[e], row[4] = {0}, span = 30;
            struct sv_shade_axes axes = sv_shade_axes_of(shade_sun_at(SHADE_AZIMUTH_DEG, elevation));
            shade_ok(sv_shade_view_init(&shade_table[s], &axes, &view, &error), &error);
            for (int r = 0; r < ROTATIONS; r++) {
                double cells[CELLS][CELLS], ours[CELLS][CELLS];
                const struct sv_tree *tree = &trees[0][s * ROTATIONS + r];
                our_cells(&view.turn[sv_shade_turn(tree->rotation_rad)], 12, span, ours);
                truth_cells(truth, tree, SHADE_AZIMUTH_DEG, elevation, span, cells);
                struct likeness l = compare(cells, ours);
                truth_cells(truth, &trees[1][s * ROTATIONS + r], SHADE_AZIMUTH_DEG, elevation, span, cells);
                struct likeness same = compare(cells, ours);
                row[0] += l.area_ratio / ROTATIONS;
                row[1] += l.overlap / ROTATIONS;
                row[2] += l.difference / ROTATIONS;
                row[3] += same.overlap / ROTATIONS;
                worst_area = fmax(worst_area, fabs(l.area_ratio - 1));
                least_overlap = fmin(least_overlap, l.overlap);
                mean_area += l.area_ratio;
                mean_overlap += l.overlap;
                frames_overlap += same.overlap;
                count++;
            }
            printf("  %-10s %3.0f: %.3f, %.3f, %.3f (%.3f)\n", shade_stand->species[s].name, elevation,
                   row[0], row[1], row[2], row[3]);
            sv_shade_view_finish(&view);
        }
    sv_truth_destroy(truth);
    printf(
        "  area %.3f in the mean, %.3f off at worst; overlap %.3f in the mean (%.3f in the same turn), %.3f "
        "at worst\n",
        mean_area / count, worst_area, mean_overlap / count, frames_overlap / count, least_overlap);
    assert_true(fabs(mean_area / count - 1) < 0.02);
    assert_true(worst_area < 0.12);
    assert_true(mean_overlap / count > 0.88);
    assert_true(least_overlap > 0.75);
}

static double level_amount(const struct sv_shade_outline *o, int level)
{
    const struct sv_silhouette *l = &o->level[level];
    double sum = 0;
    for (int k = 0; k < l->width * l->height; k++)
        sum += l->coverage[k];
    return sum / 255 * (l->width_m / l->width) * (l->height_m / l->height);
}

/* Rounding to 8 bits is off by up to half a step a texel, either way: 1/510 of a level's area at the very
 * most, and a small part of that in the mean. */
static void levels_keep_the_amount_of_shade(void **state)
{
    (void)state;
    struct sv_error error;
    double worst = 0;
    for (int s = 0; s < SHADE_SPECIES; s++)
        for (int e = 1; e <= 90; e += 11) {
            struct sv_shade_axes axes = sv_shade_axes_of(shade_sun_at(200, e));
            struct sv_shade_view view;
            shade_ok(sv_shade_view_init(&shade_table[s], &axes, &view, &error), &error);
            for (int r = 0; r < SV_SHADE_TURNS; r++) {
                const struct sv_shade_outline *o = &view.turn[r];
                assert_true(o->levels > 4);
                assert_true(o->level[o->levels - 1].width == 1 && o->level[o->levels - 1].height == 1);
                double all = level_amount(o, 0);
                assert_true(fabs(all / (double)o->area - 1) < 1e-5);
                for (int n = 1; n < o->levels; n++) {
                    const struct sv_silhouette *l = &o->level[n];
                    double off = fabs(level_amount(o, n) - all);
                    assert_true(off <= l->width_m * l->height_m / 510);
                    worst = fmax(worst, off / all);
                }
            }
            sv_shade_view_finish(&view);
        }
    printf("  amount of shade over all levels: at most %.4f of it off\n", worst);
    assert_true(worst < 0.02);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(silhouettes_are_what_the_sun_sees),
        cmocka_unit_test(levels_keep_the_amount_of_shade),
    };
    return cmocka_run_group_tests(tests, shade_setup, shade_teardown);
}
