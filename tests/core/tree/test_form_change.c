/* test_form_change.c - a tree passes from its sprite to its leaves and wood without a pop: an eye walks
 * towards it in small steps across the sizes where both are drawn, and every step's change is explained by
 * what either form by itself changes there (which is the truth's own change as that form has it) and by the
 * even share of the fade. */
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
#include "core/tree/draw_cull.h"
#include "core/tree/grow.h"
#include "tests/core/tree/draw_fixture.h"
#include "tests/core/tree/kept_bakes.h"

enum { SIDE = 192, STEPS = 48 };
/* draw.c: trees fade from this share of the size where leaves begin on. */
static const double FADE_FROM = 0.8;
static const uint8_t SKY[4] = {200, 220, 250, 255};
static const struct sv_tree TREE = {.height_m = 10, .rotation_rad = 1};

static struct sv_gl_context *context;
static struct sv_tree_mesh leafy, bare;

static int setup(void **state)
{
    (void)state;
    struct sv_error error;
    sv_color_init();
    fixture_ok(sv_gl_context_create(&context, &error), &error);
    fixture_tree(1500, 7, &leafy);
    fixture_ok(sv_tree_grow(SV_HABIT_BROADLEAF, 0, 3, &bare, &error), &error);
    return 0;
}

static int teardown(void **state)
{
    (void)state;
    sv_tree_mesh_finish(&leafy);
    sv_tree_mesh_finish(&bare);
    sv_gl_context_destroy(context);
    return 0;
}

/* The forest over a flat sky, colour and depth alone, as pictures for the eye are drawn: four samples a
 * pixel. */
static void draw_over_sky(struct sv_tree_draw *draw, const struct sv_camera *camera, enum sv_tree_form form,
                          double error_px, uint8_t *color, struct sv_tree_draw_stats *stats)
{
    static float depth[SIDE * SIDE];
    struct sv_error error;
    struct sv_gl_target *target;
    struct sv_gl_frame frame = {.camera = *camera, .light = fixture_light(120, 40)};
    fixture_ok(sv_gl_target_create(SIDE, SIDE, 1u << SV_LAYER_COLOR, &target, &error), &error);
    sv_gl_target_begin(target);
    fixture_ok(sv_gl_frame_begin(&frame, &error), &error);
    for (int p = 0; p < SIDE * SIDE; p++) {
        depth[p] = 0; /* infinitely far */
        memcpy(color + 4 * p, SKY, 4);
    }
    struct sv_canvas canvas = {
        .width = SIDE, .height = SIDE, .row_count = SIDE, .depth = depth, .color = color};
    struct sv_tree_draw_options options = SV_TREE_DRAW_OPTIONS_DEFAULT;
    options.form = form;
    options.error_px = error_px;
    options.color_only = true;
    options.canvas = &canvas;
    fixture_ok(sv_tree_draw_forest(draw, &frame, &options, stats, &error), &error);
    sv_gl_target_destroy(target);
}

/* The least error for which leaves of the first species begin at near_px or above: the more may be off, the
 * larger sprites may be. */
static double error_for(const struct sv_tree_draw *draw, double near_px)
{
    double lo = 1e-4, hi = 1e4;
    for (int k = 0; k < 200; k++) {
        double middle = sqrt(lo * hi);
        if (sv_tree_draw_near_px(draw, 0, middle) < near_px)
            lo = middle;
        else
            hi = middle;
    }
    return hi;
}

/* Mean over the picture of what pixels differ by, levels of 255. */
static double difference(const uint8_t *a, const uint8_t *b)
{
    double sum = 0;
    for (int i = 0; i < 4 * SIDE * SIDE; i++)
        sum += abs(a[i] - b[i]);
    return sum / (3 * SIDE * SIDE);
}

/* One place of the eye: the picture as the ladder has it, and in either form alone. */
struct place {
    uint8_t faded[4 * SIDE * SIDE], leaves[4 * SIDE * SIDE], sprite[4 * SIDE * SIDE];
};

static void draw_place(struct sv_tree_draw *draw, double error_px, double height_px, struct place *place)
{
    struct sv_tree_draw_stats stats;
    struct sv_camera camera = fixture_camera(sv_vec3(0, -1, 5), 0, 0, SIDE, SIDE);
    const struct sv_tree *tree = &TREE;
    double near_px = sv_tree_draw_near_px(draw, 0, error_px);
    camera.eye.y = -sv_cull_height_px(&camera, tree) / height_px; /* which is that of 1 m */
    draw_over_sky(draw, &camera, SV_TREE_FORM_LEAF, error_px, place->leaves, &stats);
    draw_over_sky(draw, &camera, SV_TREE_FORM_COARSE, error_px, place->sprite, &stats);
    draw_over_sky(draw, &camera, SV_TREE_FORM_AUTO, error_px, place->faded, &stats);
    assert_int_equal(stats.trees[SV_TREE_FORM_LEAF], height_px > FADE_FROM * near_px);
    assert_int_equal(stats.trees[SV_TREE_FORM_COARSE], height_px < near_px);
}

/* Leaves and wood come, the sprite goes, both in even shares of what is left to change
 * (sv_leaf_splat_trees.weight, sv_sprite_list.shares): a step changes the 1 / STEPS-th part of what the forms
 * differ by. Six of those, as pieces differ in size and come a few at a time, and hide others. What pops
 * takes all parts at once. */
static void check_walk(const struct sv_tree_mesh *mesh, const char *name)
{
    static struct place places[2];
    struct fixture_single s;
    double worst = 0, most_share = 0;
    fixture_single_init(&s, mesh, &TREE, kept_bakes());
    double error_px = error_for(s.draw, 120), near_px = sv_tree_draw_near_px(s.draw, 0, error_px);
    assert_true(near_px >= 120 && near_px < 160);
    for (int k = -1; k <= STEPS + 1; k++) {
        struct place *now = &places[k & 1], *last = &places[~k & 1];
        draw_place(s.draw, error_px, near_px * (FADE_FROM + (1 - FADE_FROM) * (k + 1e-3) / STEPS), now);
        if (k < 0)
            continue;
        double change = difference(now->faded, last->faded);
        double own = fmax(difference(now->leaves, last->leaves), difference(now->sprite, last->sprite));
        double forms = difference(now->leaves, now->sprite), share = 6 * forms / STEPS;
        worst = fmax(worst, change / (own + share));
        most_share = fmax(most_share, (change - own) / forms);
        assert_true(forms > 0 && share < forms / 4);
    }
    printf("%s, leaves from %.0f px on: largest step %.2f of what is allowed, beyond its motion %.3f of what "
           "the forms "
           "differ by\n",
           name, near_px, worst, most_share);
    assert_true(worst <= 1);
    fixture_single_finish(&s);
}

static void a_tree_comes_piece_by_piece(void **state)
{
    (void)state;
    check_walk(&bare, "bare tree");
    check_walk(&leafy, "leafy tree");
}

/* A tree in leaf, a sprite close behind it, and aside of both a tall tree far behind, which comes into leaf:
 * where the first two stand nothing may change, for nothing there does. */
static void what_comes_far_away_changes_nothing_near(void **state)
{
    (void)state;
    static uint8_t before[4 * SIDE * SIDE], after[4 * SIDE * SIDE];
    static const struct sv_tree trees[] = {{.x = -1.5, .y = 0, .height_m = 6, .number = 0},
                                           {.x = -2, .y = 3, .height_m = 5, .rotation_rad = 2, .number = 1},
                                           {.x = 16, .y = 28, .z = -8, .height_m = 20, .number = 2}};
    struct sv_camera camera = fixture_camera(sv_vec3(0, -9, 3), 0, 0, SIDE, SIDE);
    struct sv_tree_draw_species species = {&leafy, kept_bakes_key(&leafy), 3};
    struct fixture_forest f;
    struct sv_tree_draw *draw;
    struct sv_tree_draw_stats stats;
    struct sv_error error;
    double h[3];
    for (int k = 0; k < 3; k++)
        h[k] = sv_cull_height_px(&camera, &trees[k]);
    fixture_forest_init(&f, trees, 3, leafy.radius);
    fixture_ok(sv_tree_draw_create(&species, 1, &f.forest, kept_bakes(), &draw, &error), &error);
    assert_true(h[0] > 1.3 * h[2] && h[2] > 1.02 * h[1] && h[1] > 0);
    draw_over_sky(draw, &camera, SV_TREE_FORM_AUTO, error_for(draw, 1.01 * h[2] / FADE_FROM), before, &stats);
    assert_int_equal(stats.trees[SV_TREE_FORM_LEAF], 1);
    /* sizes come in 16ths of an octave (ladder.c): at most 4.5 % above what is asked for */
    draw_over_sky(draw, &camera, SV_TREE_FORM_AUTO, error_for(draw, 0.94 * h[2] / FADE_FROM), after, &stats);
    assert_int_equal(stats.trees[SV_TREE_FORM_LEAF], 2);
    assert_int_equal(stats.trees[SV_TREE_FORM_COARSE], 2);
    int left = 0, right = 0, drawn = 0;
    for (int p = 0; p < SIDE * SIDE; p++) {
        bool changed = memcmp(before + 4 * p, after + 4 * p, 4) != 0, near = p % SIDE < SIDE / 2;
        left += near && changed;
        right += !near && changed;
        drawn += near && memcmp(before + 4 * p, SKY, 4) != 0;
    }
    printf("%.0f, %.0f, %.0f px: %d of %d pixels change near, %d far\n", h[0], h[1], h[2], left, drawn,
           right);
    assert_true(drawn > 1000);
    assert_int_equal(left, 0);
    sv_tree_draw_destroy(draw);
    fixture_forest_finish(&f);
}

/* How much of the sky a picture of place hides: mean over pixels of what is not the sky's blue. */
static double hidden(const uint8_t *color)
{
    double sum = 0;
    for (int p = 0; p < SIDE * SIDE; p++)
        sum += 1 -
               fmin((double)sv_linear_from_srgb8[color[4 * p + 2]] / (double)sv_linear_from_srgb8[SKY[2]], 1);
    return sum / (SIDE * SIDE);
}

/* Amid the fade a crown hides as much of the sky as its forms do: neither denser nor thinner. Against a sky
 * that is much brighter than leaves, what hides it is what covers. */
static void check_cover(const struct sv_tree_mesh *mesh, const char *name, double allowed)
{
    static struct place place;
    struct fixture_single s;
    double worst = 0;
    fixture_single_init(&s, mesh, &TREE, kept_bakes());
    double error_px = error_for(s.draw, 120), near_px = sv_tree_draw_near_px(s.draw, 0, error_px);
    for (int k = 1; k < 8; k++) {
        double come = k / 8.0;
        draw_place(s.draw, error_px, near_px * (FADE_FROM + (1 - FADE_FROM) * come), &place);
        double leaves = hidden(place.leaves), sprite = hidden(place.sprite), faded = hidden(place.faded);
        double off = faded / (leaves * come + sprite * (1 - come)) - 1;
        printf("%s, %.3f come: leaves hide %.4f, the sprite %.4f, both %.4f: %+.1f %%\n", name, come, leaves,
               sprite, faded, 100 * off);
        assert_true(leaves > 0.01);
        worst = fmax(worst, fabs(off));
    }
    assert_true(worst <= allowed);
    fixture_single_finish(&s);
}

static void a_tree_in_both_forms_covers_as_in_either(void **state)
{
    (void)state;
    check_cover(&leafy, "leafy tree", 0.04);
    check_cover(&bare, "bare tree", 0.08); /* thin twigs, that the sprite has wider */
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(a_tree_comes_piece_by_piece),
                                       cmocka_unit_test(a_tree_in_both_forms_covers_as_in_either),
                                       cmocka_unit_test(what_comes_far_away_changes_nothing_near)};
    return cmocka_run_group_tests(tests, setup, teardown);
}
