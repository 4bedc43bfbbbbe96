/* test_panels_refine.c - panels drawn again from the ray-cast truth against the truth's own picture of the
 * camera that stands at their reference point: rings together show what it shows, trees, colours, shadows and
 * depth; many samples over the ground of as many; and the order of rows is kept. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "core/base/color.h"
#include "core/truth/texels.h"
#include "core/view/panels_refine.h"
#include "tests/core/view/scene_kit.h"

enum { SIZE = 96, TEXELS = SIZE * SIZE, RINGS = 3 };
#define INNER_M 8.0

struct stage {
    struct sv_scene *scene;
    struct sv_truth *truth;
    struct sv_resolved_view view;
    struct sv_light light;
    struct sv_cell_rings rings;
    struct sv_cell_place chain[SV_CELL_RINGS_MAX];
};

/* Flat ground 6 m below the world's origin, which is a lattice point of every ring: all panels of a chain are
 * from there. Trees with their axes at least INNER_M away along x or y; crowns narrower than half of that are
 * not cut by a panel's near plane. */
static void open_stage(struct stage *s, double inner_m, double outer_m)
{
    struct kit_options options = {.width = 65,
                                  .height = 65,
                                  .x0 = -128,
                                  .y0 = -128,
                                  .z0 = -6,
                                  .dx = 4,
                                  .dy = 4,
                                  .seed = 5,
                                  .species = 2,
                                  .leaves = 600,
                                  .trees = 90,
                                  .spread_m = 45,
                                  .height_min_m = 6,
                                  .height_max_m = 8};
    struct sv_error error = {0};
    *s = (struct stage){.scene = kit_scene(&options)};
    struct sv_tree *trees = (struct sv_tree *)s->scene->forest.trees;
    for (uint32_t k = 0; k < s->scene->forest.count; k++) {
        assert_true(s->scene->species[trees[k].species].mesh.radius * trees[k].height_m < INNER_M / 2);
        if (fmax(fabs(trees[k].x), fabs(trees[k].y)) <= INNER_M)
            trees[k].x += 2.2 * INNER_M;
    }
    struct sv_view_request request = kit_request();
    request.eye.agl = 6;
    request.shadows = true;
    request.has_sun_azimuth = request.has_sun_elevation = true; /* low: trees shade those of other rings */
    request.sun_azimuth_rad = 2.4;
    request.sun_elevation_rad = 0.3;
    if (sv_view_resolve(s->scene, &request, &s->view, NULL, &error) ||
        sv_truth_create(s->scene, &s->truth, &error))
        fail_msg("%s: %s", error.field, error.message);
    sv_light_from_sun(&s->view.sun, &s->light);
    s->light.air = s->view.air;
    sv_cell_rings_make(outer_m, inner_m, 0.05, &s->rings);
    assert_true(sv_cell_chain(&s->rings, sv_vec3(0, 0, 0), false, s->chain));
    for (int k = 0; k < s->rings.count; k++)
        assert_true(sv_length(s->chain[k].v) == 0);
}

static void close_stage(struct stage *s)
{
    sv_truth_destroy(s->truth);
    kit_free(s->scene);
}

static struct sv_panels_order order_of(const struct stage *s, int ring, enum sv_cell_face face,
                                       unsigned layer)
{
    return (struct sv_panels_order){.about = {.place = s->chain[ring],
                                              .distance_m = s->rings.distance_m[ring],
                                              .face = face,
                                              .size = SIZE,
                                              .layers = layer},
                                    .shell = sv_cell_shell(&s->rings, &s->chain[ring], false),
                                    .view = &s->view};
}

/* The block is the caller's, to free. */
static void *refine(const struct stage *s, const struct sv_panels_order *order, int samples,
                    struct sv_panel *panel)
{
    struct sv_error error = {0};
    struct sv_panels_refinement *r;
    int rows = 1;
    if (sv_panels_refine_begin(s->scene, s->truth, order, samples, &r, &error))
        fail_msg("%s: %s", error.field, error.message);
    while (sv_panels_refine_row(r))
        rows++;
    assert_int_equal(rows, SIZE);
    assert_false(sv_panels_refine_row(r)); /* nor does it write beyond the end */
    size_t bytes = sv_panels_refine_measure(r);
    void *block = aligned_alloc(SV_PANEL_ALIGN, bytes);
    assert_int_equal(sv_panels_refine_write(r, block, bytes, &error), SV_OK);
    sv_panels_refine_destroy(r);
    assert_int_equal(sv_panel_open(block, bytes, panel, &error), SV_OK);
    return block;
}

/* What the truth sees from there through the face; sky is transparent. */
static void see(const struct stage *s, enum sv_cell_face face, int samples, uint8_t (*color)[4], float *depth)
{
    struct sv_error error = {0};
    struct sv_panels_order order = order_of(s, 0, face, SV_PANEL_CROWNS);
    struct sv_camera camera = sv_panels_camera(&order);
    struct sv_truth_options options = {.layers = 1u << SV_LAYER_COLOR | 1u << SV_LAYER_DEPTH,
                                       .samples = samples,
                                       .trees = true,
                                       .shadows = true,
                                       .row_count = SIZE};
    struct sv_truth_picture picture = {.color = {SIZE, SIZE, 4, SV_PIXEL_U8, color},
                                       .depth = {SIZE, SIZE, 1, SV_PIXEL_F32, depth}};
    if (sv_truth_render(s->truth, &camera, &s->light, &options, &picture, &error))
        fail_msg("%s", error.message);
}

static void see_ground(const struct stage *s, enum sv_cell_face face, int samples, float (*light)[4],
                       float *inverse_m)
{
    struct sv_panels_order order = order_of(s, 0, face, SV_PANEL_CROWNS);
    struct sv_camera camera = sv_panels_camera(&order);
    struct sv_truth_texels_options options = {samples, true, true};
    for (int j = 0; j < SIZE; j++)
        sv_truth_ground_row(s->truth, &camera, &s->light, &options, INFINITY, j, light + j * SIZE,
                            inverse_m + j * SIZE);
}

static float linear_of(uint8_t code)
{
    return (float)(code * code) / (255.0f * 255.0f);
}

/* Of one sample a texel, rings part the picture: the nearest thing of any panel is what the truth sees, its
 * colour within a rounding of each code (255 sqrt(v): half a code is 0.6 of an sRGB code at most, and the
 * truth's own half: together less than 2), q within a rounding of its code. A shadow that a ring's trees did
 * not get from those of others would show. */
static void test_rings_part_the_picture(void **state)
{
    (void)state;
    static const enum sv_cell_face faces[] = {SV_CELL_EAST, SV_CELL_SOUTH, SV_CELL_WEST};
    static uint8_t truth[TEXELS][4];
    static float depth[TEXELS], ground[TEXELS][4], ground_inverse[TEXELS];
    struct stage s;
    open_stage(&s, INNER_M, INNER_M * (1 << (RINGS - 1)));
    assert_int_equal(s.rings.count, RINGS);
    for (size_t f = 0; f < sizeof faces / sizeof *faces; f++) {
        struct sv_panel panel[RINGS];
        void *block[RINGS];
        long wrong = 0, far = 0, trees[RINGS] = {0};
        see(&s, faces[f], 1, truth, depth);
        see_ground(&s, faces[f], 1, ground, ground_inverse);
        for (int ring = 0; ring < RINGS; ring++) {
            struct sv_panels_order order = order_of(&s, ring, faces[f], SV_PANEL_CROWNS);
            block[ring] = refine(&s, &order, 1, &panel[ring]);
        }
        for (int k = 0; k < TEXELS; k++) {
            float inverse = ground_inverse[k], rgb[3];
            int from = -1;
            memcpy(rgb, ground[k], sizeof rgb);
            for (int ring = 0; ring < RINGS; ring++) {
                float q = sv_panel_code(&panel[ring].crowns, k % SIZE, k / SIZE) / (float)SV_PANEL_Q_ONE;
                if (q / (float)s.rings.distance_m[ring] <= inverse)
                    continue;
                assert_int_equal(sv_panel_color(&panel[ring].crowns, k % SIZE, k / SIZE)[3], 255);
                inverse = q / (float)s.rings.distance_m[ring];
                from = ring;
                for (int c = 0; c < 3; c++)
                    rgb[c] = linear_of(sv_panel_color(&panel[ring].crowns, k % SIZE, k / SIZE)[c]);
            }
            int off = 0;
            for (int c = 0; c < 3; c++) {
                int d = abs(sv_srgb8_from_linear(rgb[c]) - truth[k][c]);
                off = d > off ? d : off;
            }
            wrong += off > 2 || (inverse > 0) != (truth[k][3] > 0);
            double step = from >= 0 ? 0.51 / SV_PANEL_Q_ONE / s.rings.distance_m[from] : 0;
            far += fabs((double)inverse - 1 / (double)depth[k]) > step + 1e-5 * (double)inverse;
            if (from >= 0)
                trees[from]++;
        }
        printf("face %d: texels of trees %ld %ld %ld, %ld of another colour, %ld at another depth\n",
               faces[f], trees[0], trees[1], trees[2], wrong, far);
        assert_true(trees[0] + trees[1] + trees[2] > TEXELS / 50);
        /* Two things that are equally far, to a code of q: none here, one or two in other scenes. */
        assert_true(wrong <= 2 && far <= 2);
        for (int ring = 0; ring < RINGS; ring++)
            free(block[ring]);
    }
    close_stage(&s);
}

/* Codes between the darkest and the brightest ground around a texel. */
static int unevenness(float (*ground)[4], int k)
{
    int low = 255, high = 0, x = k % SIZE, y = k / SIZE;
    for (int j = y - 1; j <= y + 1; j++)
        for (int i = x - 1; i <= x + 1; i++) {
            if (i < 0 || j < 0 || i >= SIZE || j >= SIZE)
                continue;
            int code = sv_srgb8_from_linear(ground[j * SIZE + i][1]);
            low = code < low ? code : low;
            high = code > high ? code : high;
        }
    return high - low;
}

/* Sixteen samples. Where only sky is behind, the panel alone is the truth's picture, to a rounding of each.
 * Over ground, the panel lets through the mean of all its samples where the truth has the mean of those that
 * no tree hides: the same where the ground is even. Where it is uneven by u codes around (edges of shadows),
 * most are off by no more than that, though not all: what is dark in a texel may be just what is hidden. Two
 * of a hundred may be, and none of it to one side. */
static void test_many_samples(void **state)
{
    (void)state;
    enum { SAMPLES = 16 };
    static uint8_t truth[TEXELS][4];
    static float depth[TEXELS], ground[TEXELS][4], ground_inverse[TEXELS];
    struct stage s;
    struct sv_panel panel;
    open_stage(&s, INNER_M, INNER_M);
    assert_int_equal(s.rings.count, 1);
    struct sv_panels_order order = order_of(&s, 0, SV_CELL_NORTH, SV_PANEL_CROWNS);
    void *block = refine(&s, &order, SAMPLES, &panel);
    see(&s, SV_CELL_NORTH, SAMPLES, truth, depth);
    see_ground(&s, SV_CELL_NORTH, SAMPLES, ground, ground_inverse);
    double sum = 0, bias = 0;
    long off = 0, over_ground = 0, over_sky = 0, partial = 0;
    for (int k = 0; k < TEXELS; k++) {
        const uint8_t *c = sv_panel_color(&panel.crowns, k % SIZE, k / SIZE);
        float through = 1 - (float)c[3] / 255;
        bool horizon = k / SIZE >= SIZE / 2 - 1 && k / SIZE <= SIZE / 2;
        if (c[3] == 0 || horizon) /* sky and ground in one texel */
            continue;
        partial += c[3] < 255;
        for (int i = 0; i < 3; i++) {
            float want = sv_linear_from_srgb8[truth[k][i]] * (float)truth[k][3] / 255;
            float got = linear_of(c[i]) + through * ground[k][i] * (ground_inverse[k] > 0);
            int d = sv_srgb8_from_linear(got) - sv_srgb8_from_linear(want);
            if (ground_inverse[k] == 0) {
                over_sky++;
                assert_in_range(abs(d), 0, 2);
                assert_in_range(abs(c[3] - truth[k][3]), 0, 1);
            } else {
                int uneven = unevenness(ground, k);
                off += abs(d) > 3 + uneven;
                over_ground++;
                sum += abs(d);
                bias += d;
            }
        }
    }
    printf("16 samples: %ld channels over sky, %ld over ground: %.3f codes at the mean, bias %.3f, %ld off\n",
           over_sky, over_ground, sum / (double)over_ground, bias / (double)over_ground, off);
    assert_true(partial > 200 && over_sky > 300 && over_ground > 500);
    assert_true(sum / (double)over_ground < 2);
    assert_true(off <= over_ground / 50);
    assert_true(fabs(bias) / (double)over_ground < 0.5);
    free(block);
    close_stage(&s);
}

/* Ground panels: trees are not seen, but their shadows are; opaque or nothing; q of the middle. */
static void test_ground(void **state)
{
    (void)state;
    static uint8_t truth[TEXELS][4];
    static float depth[TEXELS];
    struct stage s;
    struct sv_panel panel, bright;
    open_stage(&s, INNER_M / 2, INNER_M / 2); /* the ground is 6 m below, outside of the cube */
    struct sv_panels_order order = order_of(&s, 0, SV_CELL_DOWN, SV_PANEL_GROUND);
    void *block = refine(&s, &order, 4, &panel);
    struct sv_resolved_view plain = s.view;
    plain.plan.draw_trees = false;
    order.view = &plain;
    void *bare = refine(&s, &order, 4, &bright);
    see(&s, SV_CELL_DOWN, 4, truth, depth);
    long shaded = 0;
    for (int k = 0; k < TEXELS; k++) {
        /* D / Z of a plane 6 m below a camera that looks down: the same everywhere. */
        assert_true(fabs((double)panel.ground.q[k] - INNER_M / 2 / 6) < 1e-5);
        assert_int_equal(panel.ground.color[k][3], 255);
        shaded += bright.ground.color[k][1] > panel.ground.color[k][1] + 10;
        assert_true(bright.ground.color[k][1] + 1 >= panel.ground.color[k][1]);
    }
    printf("ground: %ld of %d texels in the shadow of trees\n", shaded, TEXELS);
    assert_true(shaded > TEXELS / 100 && shaded < TEXELS / 2);
    free(block);
    free(bare);
    close_stage(&s);
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(test_rings_part_the_picture),
                                       cmocka_unit_test(test_many_samples), cmocka_unit_test(test_ground)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
