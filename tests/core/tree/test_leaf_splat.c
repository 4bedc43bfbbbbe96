/* test_leaf_splat.c - leaf splats against two other drawings of the same scenes: rays (Embree) and OSMesa's
 * polygons, and what thinning out, weights, bands and several samples promise. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <math.h>
#include <cmocka.h>

#include "core/base/color.h"
#include "core/base/rng.h"
#include "core/scene/id.h"
#include "core/tree/grow.h"
#include "core/tree/leaf_form.h"
#include "tests/core/tree/draw_fixture.h"
#include "tests/core/tree/kept_bakes.h"
#include "tests/core/tree/leaf_fixture.h"

enum { SPECIES = 5, SIDE = 128 };

static struct sv_tree_mesh meshes[SPECIES];

static int grow_meshes(void **state)
{
    (void)state;
    struct sv_error error;
    for (int k = 0; k < SPECIES; k++)
        fixture_ok(sv_tree_grow((enum sv_habit)k, 1500, (uint64_t)k + 1, &meshes[k], &error), &error);
    return 0;
}

static int free_meshes(void **state)
{
    (void)state;
    for (int k = 0; k < SPECIES; k++)
        sv_tree_mesh_finish(&meshes[k]);
    return 0;
}

static struct sv_leaf_view look(double distance, double heading_deg, double up_m, int side, bool orthographic)
{
    double a = sv_radians(heading_deg);
    struct sv_leaf_view view = {0};
    view.camera =
        fixture_camera(sv_add(leaf_fixture_middle(), sv_vec3(-distance * sin(a), -distance * cos(a), up_m)),
                       heading_deg, -sv_degrees(atan2(up_m - 5, distance)), side, side);
    view.light = fixture_light(heading_deg + 70, 35);
    if (orthographic) {
        view.camera.projection = SV_PROJECTION_ORTHOGRAPHIC;
        view.camera.ortho_height_m = 30;
        view.camera.far_m = 500;
    }
    return view;
}

static void make_forest(struct leaf_fixture *f, uint64_t seed, uint32_t count, double spread)
{
    struct sv_rng rng = sv_rng_seeded(seed, 3);
    struct sv_tree trees[64];
    struct sv_vec3 at = leaf_fixture_middle();
    for (uint32_t k = 0; k < count; k++)
        trees[k] = (struct sv_tree){.x = at.x + sv_rng_range(&rng, -spread, spread),
                                    .y = at.y + sv_rng_range(&rng, -spread, spread),
                                    .z = at.z,
                                    .height_m = (float)sv_rng_range(&rng, 5, 14),
                                    .rotation_rad = (float)sv_rng_range(&rng, 0, 6.28),
                                    .species = (uint16_t)(k % SPECIES)};
    leaf_fixture_init(f, meshes, SPECIES, trees, count);
}

static const float whole[64] = {
    1, 1, 1, 1, 1, 1, 1, 1, 1, 1, 1, 1, 1, 1, 1, 1, 1, 1, 1, 1, 1, 1, 1, 1, 1, 1, 1, 1, 1, 1, 1, 1,
    1, 1, 1, 1, 1, 1, 1, 1, 1, 1, 1, 1, 1, 1, 1, 1, 1, 1, 1, 1, 1, 1, 1, 1, 1, 1, 1, 1, 1, 1, 1, 1,
};

static struct sv_leaf_splat_trees all_of(const struct leaf_fixture *f)
{
    return (struct sv_leaf_splat_trees){.trees = f->scene->forest.trees,
                                        .entries = f->entries,
                                        .count = f->scene->forest.count,
                                        .fraction = whole,
                                        .samples = 1,
                                        .level_0 = true,
                                        .id_first = SV_ID_TREE_FIRST};
}

static void draw(const struct leaf_fixture *f, const struct sv_leaf_view *view,
                 const struct sv_leaf_splat_trees *trees, const struct sv_canvas *canvas)
{
    struct sv_error error;
    fixture_ok(sv_leaf_splat_draw(f->splat, view, canvas, trees, NULL, &error), &error);
}

/* ---- the same picture as others draw ---- */

/* Rays and splats take one sample at the same place. Rounding decides on pixels whose centre lies on an edge
 * (some 1e-4 px of an edge's width: under 0.1 %); a pixel of a card's mask likewise. Colour: normals of 10
 * bits an axis and places of 16 bits are off by half a level each. */
static void test_agrees_with_rays(void **state)
{
    (void)state;
    for (int n = 0; n < 10; n++) {
        struct leaf_fixture f;
        make_forest(&f, (uint64_t)n, n == 0 ? 1 : 20, n == 0 ? 0.1 : 12);
        struct sv_leaf_view view = look(n % 3 == 2 ? 4 : 22, 36 * n, n % 3 == 1 ? 14 : 2, SIDE, n % 5 == 4);
        view.light.air = n % 2;
        leaf_fixture_sort(&f, &view.camera);
        struct sv_truth_picture ground, truth;
        leaf_fixture_truth(&f, &view, 1, false, false, &ground);
        leaf_fixture_truth(&f, &view, 1, true, false, &truth);
        struct sv_canvas canvas = leaf_canvas(&ground, &view.camera);
        struct sv_leaf_splat_trees trees = all_of(&f);
        draw(&f, &view, &trees, &canvas);
        const uint32_t *id = truth.id.data;
        const float *z = truth.depth.data, *normal = truth.normal.data;
        const uint8_t *rgba = truth.color.data;
        long either = 0, equal = 0, close = 0, sum = 0, along = 0;
        for (int k = 0; k < SIDE * SIDE; k++) {
            if (id[k] < SV_ID_TREE_FIRST && canvas.id[k] < SV_ID_TREE_FIRST) {
                assert_memory_equal(&rgba[4 * k], &canvas.color[4 * k], 4);
                continue;
            }
            either++;
            double mine = leaf_depth_m(&view.camera, canvas.depth[k]);
            bool same = id[k] == canvas.id[k] && fabs(mine / (double)z[k] - 1) < 1e-4;
            equal += id[k] == canvas.id[k];
            close += same;
            if (!same)
                continue;
            float dot = 0;
            for (int c = 0; c < 3; c++) {
                sum += labs((long)rgba[4 * k + c] - (long)canvas.color[4 * k + c]);
                dot += normal[3 * k + c] * canvas.normal[3 * k + c];
            }
            along += dot > 0.999f;
        }
        double e = (double)either;
        printf("scene %d: trees fill %4.1f %%, ids equal %.3f %%, depths %.3f %%, normals %.3f %%, colour "
               "off by %.3f\n",
               n, 100 * e / (SIDE * SIDE), 100 * (double)equal / e, 100 * (double)close / e,
               100 * (double)along / (double)close, (double)sum / (3 * (double)close));
        assert_true(e > 0.05 * SIDE * SIDE);
        assert_true((double)equal >= 0.998 * e);
        assert_true((double)close >= 0.997 * e);
        assert_true((double)along >= 0.99 * (double)close);
        assert_true((double)sum / (3 * (double)close) < 1.0);
        leaf_canvas_finish(&canvas);
        leaf_picture_finish(&ground);
        leaf_picture_finish(&truth);
        leaf_fixture_finish(&f);
    }
}

/* OSMesa takes alpha and colour by filters of its own rounding, so masks' edges differ; with shadows the
 * light on the tree's grid is interpolated between vertices there, and taken per pixel here. */
static void test_agrees_with_polygons(void **state)
{
    (void)state;
    for (int n = 0; n < 4; n++) {
        struct leaf_fixture f;
        struct sv_error error;
        make_forest(&f, (uint64_t)n + 50, 20, 12);
        struct sv_leaf_view view = look(20, 80 * n + 10, 9, SIDE, n == 3);
        leaf_fixture_sort(&f, &view.camera);
        struct sv_tree_draw_species species[SPECIES];
        for (int k = 0; k < SPECIES; k++)
            species[k] = (struct sv_tree_draw_species){&meshes[k], kept_bakes_key(&meshes[k]), 4};
        struct sv_tree_draw *polygons;
        fixture_ok(sv_tree_draw_create(species, SPECIES, &f.scene->forest, kept_bakes(), &polygons, &error),
                   &error);
        struct sv_tree_shade *shade;
        fixture_ok(sv_tree_draw_shade_create(polygons, &shade, &error), &error);
        fixture_ok(sv_tree_shade_update(shade, view.light.to_sun, NULL, NULL, &error), &error);
        struct sv_tree_draw_options options = SV_TREE_DRAW_OPTIONS_DEFAULT;
        options.form = SV_TREE_FORM_POLYGON;
        options.shade = n % 2 ? shade : NULL;
        struct fixture_view gl;
        fixture_draw(polygons, &view.camera, &view.light, &options, &gl);
        struct sv_truth_picture bare;
        leaf_fixture_truth(&f, &view, 1, false, false, &bare);
        struct sv_canvas canvas = leaf_canvas(&bare, &view.camera);
        memset(canvas.depth, 0, SIDE * SIDE * sizeof(float));
        memset(canvas.color, 0, SIDE * SIDE * 4);
        memset(canvas.id, 0, SIDE * SIDE * 4);
        struct sv_leaf_splat_trees trees = all_of(&f);
        if (n % 2)
            trees.lights = sv_tree_shade_lights(shade);
        draw(&f, &view, &trees, &canvas);
        long either = 0, equal = 0, sum = 0, light = 0;
        for (int k = 0; k < SIDE * SIDE; k++) {
            if (!gl.id[k] && !canvas.id[k])
                continue;
            either++;
            if (gl.id[k] != canvas.id[k] || fabsf(gl.depth[k] / canvas.depth[k] - 1) > 1e-4f)
                continue;
            equal++;
            assert_int_equal(canvas.color[4 * k + 3], 255);
            for (int c = 0; c < 3; c++) {
                sum += labs((long)gl.color[4 * k + c] - (long)canvas.color[4 * k + c]);
                light += (long)canvas.color[4 * k + c] - (long)gl.color[4 * k + c];
            }
        }
        printf("polygons %d: same tree and depth in %.2f %%, colour off by %.3f, brighter by %.3f\n", n,
               100.0 * (double)equal / (double)either, (double)sum / (3.0 * (double)equal),
               (double)light / (3.0 * (double)equal));
        assert_true(either > SIDE * SIDE / 20);
        assert_true((double)equal >= 0.97 * (double)either);
        assert_true((double)sum < 2.0 * 3 * (double)equal);
        assert_true(labs(light) < 0.3 * 3 * (double)equal);
        leaf_canvas_finish(&canvas);
        leaf_picture_finish(&bare);
        fixture_view_finish(&gl);
        sv_tree_shade_destroy(shade);
        sv_tree_draw_destroy(polygons);
        leaf_fixture_finish(&f);
    }
}

/* ---- thinning out, weights, bands, samples ---- */

struct blank {
    struct leaf_fixture f;
    struct sv_leaf_view view;
    struct sv_truth_picture ground;
    bool level_0;
};

static void blank_init(struct blank *b, uint32_t count)
{
    b->level_0 = false;
    make_forest(&b->f, 7, count, count > 1 ? 10 : 0.1);
    b->view = look(26, 20, 6, SIDE, false);
    leaf_fixture_sort(&b->f, &b->view.camera);
    leaf_fixture_truth(&b->f, &b->view, 1, false, false, &b->ground);
}

static void blank_finish(struct blank *b)
{
    leaf_picture_finish(&b->ground);
    leaf_fixture_finish(&b->f);
}

static struct sv_canvas drawn(const struct blank *b, float fraction, float weight, int samples)
{
    float fractions[64], weights[64];
    for (int k = 0; k < 64; k++)
        fractions[k] = fraction, weights[k] = weight;
    struct sv_canvas canvas = leaf_canvas(&b->ground, &b->view.camera), shown = canvas;
    struct sv_leaf_splat_trees trees = all_of(&b->f);
    trees.fraction = fractions;
    trees.weight = weights;
    trees.samples = samples;
    trees.level_0 = b->level_0;
    if (samples > 1)
        shown.id = NULL, shown.normal = NULL;
    draw(&b->f, &b->view, &trees, &shown);
    return canvas;
}

static long pixels_of(const struct sv_canvas *canvas)
{
    long n = 0;
    for (int k = 0; k < SIDE * SIDE; k++)
        n += canvas->id[k] >= SV_ID_TREE_FIRST;
    return n;
}

static void test_thinning_keeps_area(void **state)
{
    (void)state;
    struct blank b;
    blank_init(&b, 12);
    struct sv_canvas canvas = drawn(&b, 1, 1, 1);
    long all = pixels_of(&canvas);
    leaf_canvas_finish(&canvas);
    static const float fractions[] = {0.9f, 0.6f, 0.4f, 0.2f};
    for (int k = 0; k < 4; k++) {
        canvas = drawn(&b, fractions[k], 1, 1);
        long n = pixels_of(&canvas);
        printf("fraction %.2f: %ld pixels of %ld\n", (double)fractions[k], n, all);
        /* Larger leaves in the same crown: what they cover differs by how they overlap. */
        assert_true(labs(n - all) < 0.12 * (double)all);
        leaf_canvas_finish(&canvas);
    }
    blank_finish(&b);
}

static void test_thinning_is_continuous(void **state)
{
    (void)state;
    struct blank b;
    blank_init(&b, 12);
    for (float f = 0.1f; f < 1; f += 0.15f) {
        struct sv_canvas a = drawn(&b, f, 1, 1), c = drawn(&b, f * 1.002f, 1, 1);
        long changed = 0, all = pixels_of(&a);
        for (int k = 0; k < SIDE * SIDE; k++)
            changed += memcmp(a.color + 4 * k, c.color + 4 * k, 4) != 0;
        printf("fraction %.2f to %.4f: %ld of %ld pixels change\n", (double)f, (double)(f * 1.002f), changed,
               all);
        assert_true((double)changed < 0.04 * (double)all);
        leaf_canvas_finish(&a);
        leaf_canvas_finish(&c);
    }
    struct sv_canvas a = drawn(&b, 0.9999f, 1, 1), c = drawn(&b, 1, 1, 1);
    long changed = 0;
    for (int k = 0; k < SIDE * SIDE; k++)
        changed += memcmp(a.color + 4 * k, c.color + 4 * k, 4) != 0;
    assert_true((double)changed < 0.02 * (double)pixels_of(&c));
    leaf_canvas_finish(&a);
    leaf_canvas_finish(&c);
    blank_finish(&b);
}

/* Weights take leaves away in the stored order: what shows at a smaller weight shows at a larger one, too, or
 * something nearer does; but for holes and rims of the few leaves that are growing. */
static void test_weights(void **state)
{
    (void)state;
    struct blank b;
    blank_init(&b, 12);
    struct sv_canvas last = drawn(&b, 1, 0, 1);
    assert_memory_equal(last.color, b.ground.color.data, SIDE * SIDE * 4);
    for (int w = 1; w <= 8; w++) {
        struct sv_canvas now = drawn(&b, 1, (float)w / 8, 1);
        long lost = 0;
        for (int k = 0; k < SIDE * SIDE; k++)
            lost += now.depth[k] < last.depth[k] * (1 - 1e-5f); /* a grown piece lies in the same plane */
        printf("weight %d / 8: %ld of %ld pixels lost\n", w, lost, pixels_of(&now));
        assert_true((double)lost < 0.04 * (double)pixels_of(&now));
        assert_true(w == 1 || pixels_of(&now) > pixels_of(&last));
        leaf_canvas_finish(&last);
        last = now;
    }
    struct sv_canvas whole_ones = drawn(&b, 1, 1, 1);
    assert_memory_equal(last.color, whole_ones.color, SIDE * SIDE * 4);
    blank_finish(&b);
    leaf_canvas_finish(&last);
    leaf_canvas_finish(&whole_ones);
}

/* Levels of the textures: the light of the picture stays, but for what chance does to one texel a pixel
 * (4,400 of them, each off by a third of itself: 0.5 %, times 3). */
static void test_texture_levels_keep_light(void **state)
{
    (void)state;
    struct blank b;
    blank_init(&b, 12);
    struct sv_canvas smooth = drawn(&b, 1, 1, 1);
    b.level_0 = true;
    struct sv_canvas exact = drawn(&b, 1, 1, 1);
    assert_memory_equal(exact.depth, smooth.depth, SIDE * SIDE * 4);
    double off[3] = {0}, light[3] = {0};
    for (int k = 0; k < SIDE * SIDE; k++)
        for (int c = 0; c < 3 && exact.id[k] >= SV_ID_TREE_FIRST; c++) {
            float a = sv_linear_from_srgb8[exact.color[4 * k + c]];
            off[c] += (double)(sv_linear_from_srgb8[smooth.color[4 * k + c]] - a);
            light[c] += (double)a;
        }
    for (int c = 0; c < 3; c++) {
        printf("channel %d: light off by %.2f %%\n", c, 100 * off[c] / light[c]);
        assert_true(fabs(off[c]) < 0.025 * light[c]);
    }
    leaf_canvas_finish(&exact);
    leaf_canvas_finish(&smooth);
    blank_finish(&b);
}

static void test_bands_make_the_picture(void **state)
{
    (void)state;
    struct blank b;
    blank_init(&b, 12);
    for (int samples = 1; samples <= 4; samples *= 4) {
        struct sv_canvas canvas = drawn(&b, 0.7f, 1, samples), bands = leaf_canvas(&b.ground, &b.view.camera);
        float fractions[64];
        for (int k = 0; k < 64; k++)
            fractions[k] = 0.7f;
        struct sv_leaf_splat_trees trees = all_of(&b.f);
        trees.fraction = fractions;
        trees.samples = samples;
        trees.level_0 = false;
        static const int cut[] = {0, 1, 50, 51, SIDE};
        for (int k = 0; k + 1 < 5; k++) {
            struct sv_canvas band = bands;
            size_t skip = (size_t)(cut[k] * SIDE);
            band.row_first = cut[k];
            band.row_count = cut[k + 1] - cut[k];
            band.depth += skip;
            band.color += 4 * skip;
            band.id = samples > 1 ? NULL : band.id + skip;
            band.normal = samples > 1 ? NULL : band.normal + 3 * skip;
            draw(&b.f, &b.view, &trees, &band);
        }
        assert_memory_equal(canvas.color, bands.color, 4 * SIDE * SIDE);
        assert_memory_equal(canvas.depth, bands.depth, SIDE * SIDE * sizeof *canvas.depth);
        leaf_canvas_finish(&canvas);
        leaf_canvas_finish(&bands);
    }
    blank_finish(&b);
}

/* Several samples: the mean of pictures with the lattice's shifts. */
static void test_samples_are_a_mean(void **state)
{
    (void)state;
    struct blank b;
    blank_init(&b, 12);
    static float sum[SIDE * SIDE][3];
    memset(sum, 0, sizeof sum);
    for (int k = 0; k < 4; k++) {
        struct blank shifted = b;
        shifted.view.shift_x_px = 0.5 * (k & 1) - 0.25;
        shifted.view.shift_y_px = 0.5 * (k >> 1) - 0.25;
        struct sv_canvas canvas = drawn(&shifted, 1, 1, 1);
        for (int p = 0; p < SIDE * SIDE; p++)
            for (int c = 0; c < 3; c++)
                sum[p][c] += 0.25f * sv_linear_from_srgb8[canvas.color[4 * p + c]];
        leaf_canvas_finish(&canvas);
    }
    struct sv_canvas canvas = drawn(&b, 1, 1, 4);
    long off = 0;
    for (int p = 0; p < SIDE * SIDE; p++)
        for (int c = 0; c < 3; c++)
            off += abs((int)sv_srgb8_from_linear(sum[p][c]) - (int)canvas.color[4 * p + c]) > 2;
    printf("%ld of %d channels off by more than 2\n", off, SIDE * SIDE * 3);
    assert_true(off <= SIDE * SIDE * 3 / 200);
    leaf_canvas_finish(&canvas);
    blank_finish(&b);
}

/* ---- forms ---- */

static void test_forms(void **state)
{
    (void)state;
    struct sv_error error;
    for (int k = 0; k < SPECIES; k++) {
        struct sv_leaf_form form;
        fixture_ok(sv_leaf_form_init(&meshes[k], &form, &error), &error);
        assert_int_equal(form.leaf_count, 1500);
        uint32_t cards = 0, triangles = 0;
        double area = 0;
        for (uint32_t c = 0; c < form.cluster_count; c++)
            for (uint32_t b = 0; b < form.clusters[c].block_count; b++) {
                const struct sv_leaf_block *block = &form.blocks[form.clusters[c].block + b];
                for (int lane = 0; lane < SV_LEAF_LANES; lane++) {
                    if (!(block->p0[0][lane] == block->p0[0][lane]))
                        continue;
                    struct sv_vec3 e1 = sv_vec3((double)block->e1[0][lane], (double)block->e1[1][lane],
                                                (double)block->e1[2][lane]);
                    struct sv_vec3 e2 = sv_vec3((double)block->e2[0][lane], (double)block->e2[1][lane],
                                                (double)block->e2[2][lane]);
                    cards += form.clusters[c].card && form.clusters[c].thins;
                    triangles += form.clusters[c].card ? 2 : 1;
                    area += form.clusters[c].thins ? sv_length(sv_cross(e1, e2)) : 0;
                }
            }
        /* A card that was cut at the ground is no parallelogram and stays two triangles. */
        assert_true(cards <= 1500 && cards >= 1400);
        assert_int_equal(triangles, meshes[k].index_count / 3);
        if (cards == 1500)
            assert_true(fabs(area / 1500 / (double)form.leaf_area - 1) < 1e-3);
        sv_leaf_form_finish(&form);
    }
}

static void test_refusals(void **state)
{
    (void)state;
    struct blank b;
    blank_init(&b, 1);
    struct sv_error error;
    struct sv_canvas canvas = leaf_canvas(&b.ground, &b.view.camera), other = canvas;
    struct sv_leaf_splat_trees trees = all_of(&b.f);
    other.width = SIDE - 1;
    assert_int_equal(sv_leaf_splat_draw(b.f.splat, &b.view, &other, &trees, NULL, &error), SV_EINVAL);
    trees.samples = 3;
    assert_int_equal(sv_leaf_splat_draw(b.f.splat, &b.view, &canvas, &trees, NULL, &error), SV_EINVAL);
    trees.samples = 4;
    assert_int_equal(sv_leaf_splat_draw(b.f.splat, &b.view, &canvas, &trees, NULL, &error), SV_EINVAL);
    trees.samples = 1;
    struct sv_tree stranger = b.f.scene->forest.trees[0];
    stranger.species = SPECIES - 1; /* the one tree is of species 0 */
    trees.trees = &stranger;
    assert_int_equal(sv_leaf_splat_draw(b.f.splat, &b.view, &canvas, &trees, NULL, &error), SV_EINVAL);
    trees.count = 0;
    fixture_ok(sv_leaf_splat_draw(b.f.splat, &b.view, &canvas, &trees, NULL, &error), &error);
    assert_memory_equal(canvas.color, b.ground.color.data, SIDE * SIDE * 4);
    assert_true(sv_leaf_splat_bytes(b.f.splat, 0) > 0);
    assert_int_equal(sv_leaf_splat_bytes(b.f.splat, 1), 0);
    assert_int_equal(sv_leaf_splat_bytes(b.f.splat, 99), 0);
    leaf_canvas_finish(&canvas);
    blank_finish(&b);
}

int main(void)
{
    struct sv_gl_context *gl;
    struct sv_error error;
    if (sv_gl_context_create(&gl, &error))
        return 1;
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_agrees_with_rays),
        cmocka_unit_test(test_agrees_with_polygons),
        cmocka_unit_test(test_thinning_keeps_area),
        cmocka_unit_test(test_thinning_is_continuous),
        cmocka_unit_test(test_weights),
        cmocka_unit_test(test_bands_make_the_picture),
        cmocka_unit_test(test_samples_are_a_mean),
        cmocka_unit_test(test_forms),
        cmocka_unit_test(test_refusals),
        cmocka_unit_test(test_texture_levels_keep_light),
    };
    int failed = cmocka_run_group_tests(tests, grow_meshes, free_meshes);
    sv_gl_context_destroy(gl);
    return failed;
}
