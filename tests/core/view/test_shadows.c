/* test_shadows.c - raster shadows as a picture shows them, against the ray-cast truth: terrain alone, then
 * with trees; pictures do not depend on what was drawn before; shadows=off and night are what they are
 * without any of this. SV_TEST_PICTURES=folder keeps the pictures. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <cmocka.h>

#include "core/scene/id.h"
#include "tests/core/tree/kept_bakes.h"
#include "tests/core/view/scene_kit.h"

enum { SIDE = 320 };

static struct sv_scene *bare, *wooded;
static struct sv_renderer *draws;
static const struct sv_scene *drawn_scene; /* of draws: one renderer, one context at a time */

static int setup(void **state)
{
    (void)state;
    struct kit_options o = {.width = 257,
                            .height = 301,
                            .x0 = 497512.25,
                            .y0 = 5203410.5,
                            .z0 = 812.5,
                            .dx = 2,
                            .dy = 2.5,
                            .relief_m = 170,
                            .seed = 7};
    bare = kit_scene(&o);
    o.relief_m = 40;
    o.species = 2;
    o.leaves = 6000;
    o.trees = 400;
    o.spread_m = 150;
    o.height_min_m = 6;
    o.height_max_m = 16;
    wooded = kit_scene(&o);
    return 0;
}

static int teardown(void **state)
{
    (void)state;
    sv_renderer_destroy(draws);
    kit_free(bare);
    kit_free(wooded);
    return 0;
}

static void use(const struct sv_scene *scene, bool afresh)
{
    struct sv_error error = {0};
    if (drawn_scene == scene && !afresh)
        return;
    sv_renderer_destroy(draws);
    if (sv_renderer_create(scene, &(struct sv_renderer_options){.store = kept_bakes()}, &draws, &error))
        fail_msg("%s: %s", error.field, error.message);
    drawn_scene = scene;
}

struct pose {
    double x, y, agl, heading_deg, pitch_deg; /* x, y: shares of the field; heading 999: the map from above */
    double azimuth_deg, elevation_deg;
};

enum how { OFF, ON, TRUTH, TRUTH_OFF };

static void draw(const struct sv_scene *scene, const struct pose *p, enum how how, bool trees,
                 struct sv_picture *picture)
{
    struct sv_error error = {0};
    const struct sv_heightfield *f = &scene->terrain.field;
    struct sv_view_request r = kit_request();
    struct sv_resolved_view view;
    r.width = r.height = SIDE;
    r.eye.x = f->x0 + p->x * (f->width - 1) * f->dx;
    r.eye.y = f->y0 + p->y * (f->height - 1) * f->dy;
    r.eye.agl = p->agl;
    r.heading_rad = sv_radians(p->heading_deg);
    r.pitch_rad = sv_radians(p->pitch_deg);
    if (p->heading_deg > 900) {
        r.projection = SV_PROJECTION_ORTHOGRAPHIC;
        r.ortho_height_m = 320;
        r.heading_rad = 0;
    }
    r.has_sun_azimuth = r.has_sun_elevation = true;
    r.sun_azimuth_rad = sv_radians(p->azimuth_deg);
    r.sun_elevation_rad = sv_radians(p->elevation_deg);
    r.shadows = how == ON || how == TRUTH;
    r.layers = 1u << SV_LAYER_COLOR | 1u << SV_LAYER_ID;
    r.trees = how >= TRUTH ? SV_TREES_RAYCAST : SV_TREES_AUTO;
    if (!trees) {
        r.trees = SV_TREES_NONE;
        if (how >= TRUTH)
            r.quality = SV_QUALITY_REFERENCE;
        r.samples = how >= TRUTH ? 4 : 0;
    }
    enum sv_status status = sv_view_resolve(scene, &r, &view, NULL, &error);
    if (!status)
        status = sv_renderer_draw(draws, &r, &view, picture, NULL, NULL, &error);
    if (status)
        fail_msg("%s: %s", error.field, error.message);
}

struct difference {
    double mean;   /* of 255, over pixels that both call ground */
    double off;    /* share of them that differ by more than 24 in some channel */
    double shaded; /* share of them that the truth darkens by more than 24 */
    long pixels;
};

static struct difference compare(const struct sv_picture *a, const struct sv_picture *truth,
                                 const struct sv_picture *without)
{
    struct difference d = {0};
    const uint8_t *p = a->layer[SV_LAYER_COLOR].data, *q = truth->layer[SV_LAYER_COLOR].data,
                  *u = without->layer[SV_LAYER_COLOR].data;
    const uint32_t *i = a->layer[SV_LAYER_ID].data, *j = truth->layer[SV_LAYER_ID].data;
    for (size_t k = 0; k < (size_t)SIDE * SIDE; k++) {
        if (i[k] != SV_ID_TERRAIN || j[k] != SV_ID_TERRAIN)
            continue;
        int worst = 0, drop = 0;
        for (size_t c = 4 * k; c < 4 * k + 3; c++) {
            int e = abs((int)p[c] - (int)q[c]);
            d.mean += e / 3.0;
            worst = e > worst ? e : worst;
            drop = u[c] - q[c] > drop ? u[c] - q[c] : drop;
        }
        d.off += worst > 24;
        d.shaded += drop > 24;
        d.pixels++;
    }
    d.mean /= (double)d.pixels;
    d.off /= (double)d.pixels;
    d.shaded /= (double)d.pixels;
    return d;
}

/* Ground in raster with shadows against the truth with them, beside raster without. */
static void check_pose(const struct sv_scene *scene, const char *name, int number, const struct pose *pose,
                       bool trees, double mean_most, double off_most)
{
    struct sv_picture on, off, truth;
    char file[64];
    use(scene, false);
    draw(scene, pose, ON, trees, &on);
    draw(scene, pose, OFF, trees, &off);
    draw(scene, pose, TRUTH, trees, &truth);
    struct difference with = compare(&on, &truth, &off), without = compare(&off, &truth, &off);
    printf("%-7s %d, sun %5.1f / %4.1f: %5.1f %% of the ground shaded; with shadows mean %5.2f, off %5.2f "
           "%%; without "
           "mean %5.2f, off %5.2f %%\n",
           name, number, pose->azimuth_deg, pose->elevation_deg, 100 * with.shaded, with.mean, 100 * with.off,
           without.mean, 100 * without.off);
    snprintf(file, sizeof file, "shadows-%s-%d", name, number);
    kit_keep(&on.layer[SV_LAYER_COLOR], file);
    snprintf(file, sizeof file, "shadows-%s-%d-truth", name, number);
    kit_keep(&truth.layer[SV_LAYER_COLOR], file);
    assert_true(with.pixels > SIDE * SIDE / 20);
    assert_true(with.mean <= mean_most && with.off <= off_most);
    assert_true(with.shaded < 0.02 || with.mean < 0.7 * without.mean);
    sv_picture_finish(&on);
    sv_picture_finish(&off);
    sv_picture_finish(&truth);
}

static void terrain_against_truth(void **state)
{
    (void)state;
    static const struct pose poses[] = {
        {0.5, 0.1, 120, 0, -15, 120, 20}, {0.5, 0.4, 1.7, 0, 0, 100, 10},  {0.5, 0.5, 400, 999, -90, 135, 12},
        {0.1, 0.6, 60, 90, -12, 300, 5},  {0.7, 0.8, 30, 200, -8, 45, 35}, {0.5, 0.5, 400, 999, -90, 250, 60},
    };
    for (size_t k = 0; k < sizeof poses / sizeof poses[0]; k++)
        check_pose(bare, "terrain", (int)k, &poses[k], false, 3.0, 0.02);
}

static void trees_against_truth(void **state)
{
    (void)state;
    static const struct pose poses[] = {
        {0.5, 0.5, 400, 999, -90, 135, 30},
        {0.5, 0.5, 400, 999, -90, 20, 60},
        {0.5, 0.25, 40, 0, -20, 100, 25},
        {0.45, 0.3, 12, 20, -12, 240, 45},
    };
    for (size_t k = 0; k < sizeof poses / sizeof poses[0]; k++)
        check_pose(wooded, "trees", (int)k, &poses[k], true, 6.0, 0.12);
}

static bool same_picture(const struct sv_picture *a, const struct sv_picture *b)
{
    return memcmp(a->layer[SV_LAYER_COLOR].data, b->layer[SV_LAYER_COLOR].data, (size_t)SIDE * SIDE * 4) ==
               0 &&
           memcmp(a->layer[SV_LAYER_ID].data, b->layer[SV_LAYER_ID].data, (size_t)SIDE * SIDE * 4) == 0;
}

/* A view after a walk (windows kept and moved, other suns in between) and the same view by a new renderer. */
static void walks_do_not_show(void **state)
{
    (void)state;
    struct sv_picture walked[6], fresh;
    struct pose p = {0.35, 0.3, 1.8, 30, -4, 110, 25};
    use(wooded, true);
    for (int k = 0; k < 6; k++) {
        struct pose other = p;
        p.x += 0.03;
        p.y += 0.04;
        p.heading_deg += 9;
        draw(wooded, &p, ON, true, &walked[k]);
        other.elevation_deg = 40 + k;
        draw(wooded, &other, ON, true, &fresh);
        sv_picture_finish(&fresh);
    }
    draw(wooded, &p, ON, true, &fresh); /* all windows of this pose are there */
    assert_true(same_picture(&fresh, &walked[5]));
    sv_picture_finish(&fresh);
    use(wooded, true);
    draw(wooded, &p, ON, true, &fresh);
    assert_true(same_picture(&fresh, &walked[5]));
    sv_picture_finish(&fresh);
    for (int k = 0; k < 6; k++)
        sv_picture_finish(&walked[k]);
}

/* Steps of a metre: the ground changes with the view, not by jumps where windows move. What differs
 * between two neighbouring pictures is held against the same two without shadows. */
static void no_popping(void **state)
{
    (void)state;
    use(bare, false);
    struct pose p = {0.5, 0.35, 25, 10, -20, 100, 12};
    struct sv_picture last[2] = {0}, next[2];
    double most = 0, usual = 0;
    for (int k = 0; k < 24; k++) {
        p.x = 0.5 + 0.002 * k; /* 1.02 m; a window moves after 16 m */
        draw(bare, &p, OFF, false, &next[0]);
        draw(bare, &p, ON, false, &next[1]);
        for (int s = 0; s < 2 && k; s++) {
            const uint8_t *a = last[s].layer[SV_LAYER_COLOR].data, *b = next[s].layer[SV_LAYER_COLOR].data;
            double sum = 0;
            for (size_t i = 0; i < (size_t)SIDE * SIDE * 4; i++)
                sum += abs((int)a[i] - (int)b[i]);
            sum /= SIDE * SIDE * 3.0;
            if (s) {
                most = fmax(most, sum);
                usual += sum / 23;
            }
        }
        for (int s = 0; s < 2; s++) {
            sv_picture_finish(&last[s]);
            last[s] = next[s];
        }
    }
    for (int s = 0; s < 2; s++)
        sv_picture_finish(&last[s]);
    printf("from step to step %.3f of 255 on the mean, %.3f at most\n", usual, most);
    assert_true(most < 1.3 * usual);
}

/* off is the same before and after windows were made, and night has no sunlight to keep off. */
static void off_and_night(void **state)
{
    (void)state;
    struct pose p = {0.5, 0.2, 20, 20, -8, 110, 25};
    struct sv_picture before, on, after;
    use(wooded, true);
    draw(wooded, &p, OFF, true, &before);
    draw(wooded, &p, ON, true, &on);
    draw(wooded, &p, OFF, true, &after);
    assert_true(same_picture(&before, &after));
    assert_false(same_picture(&before, &on));
    sv_picture_finish(&before);
    sv_picture_finish(&on);
    sv_picture_finish(&after);
    p.elevation_deg = -1;
    draw(wooded, &p, OFF, true, &before);
    draw(wooded, &p, ON, true, &on);
    assert_true(same_picture(&before, &on));
    sv_picture_finish(&before);
    sv_picture_finish(&on);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(terrain_against_truth), cmocka_unit_test(trees_against_truth),
        cmocka_unit_test(walks_do_not_show),     cmocka_unit_test(no_popping),
        cmocka_unit_test(off_and_night),
    };
    return cmocka_run_group_tests(tests, setup, teardown);
}
