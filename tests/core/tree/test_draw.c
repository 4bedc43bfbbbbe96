/* Drawing of forests: culling against brute force, places, turns, ids, order, and the odd cases. */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "core/base/color.h"
#include "core/base/frames.h"
#include "core/base/rng.h"
#include "core/scene/id.h"
#include "core/tree/draw_cull.h"
#include "draw_fixture.h"
#include "tests/core/tree/kept_bakes.h"

static struct sv_gl_context *context;
static struct sv_tree_mesh leafy, bare;

static int setup(void **state)
{
    (void)state;
    struct sv_error error;
    sv_color_init();
    fixture_ok(sv_gl_context_create(&context, &error), &error);
    fixture_tree(1500, 7, &leafy);
    fixture_tree(0, 7, &bare);
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

/* Exact, prefiltered, and what chooses between them. */
static const enum sv_tree_form forms[] = {SV_TREE_FORM_POLYGON, SV_TREE_FORM_LEAF, SV_TREE_FORM_COARSE,
                                          SV_TREE_FORM_AUTO};
enum { FORMS = sizeof forms / sizeof forms[0], LIGHT_FORMS = 3 };

static bool is_exact(enum sv_tree_form f)
{
    return f == SV_TREE_FORM_POLYGON || f == SV_TREE_FORM_LEAF;
}

static struct sv_tree_draw_options form(enum sv_tree_form f)
{
    struct sv_tree_draw_options options = SV_TREE_DRAW_OPTIONS_DEFAULT;
    options.form = f;
    return options;
}

/* ---- culling ---- */

static void random_trees(struct sv_tree *trees, uint32_t count, uint64_t seed)
{
    struct sv_rng rng = sv_rng_seeded(seed, 5);
    for (uint32_t k = 0; k < count; k++)
        trees[k] = (struct sv_tree){.x = 400000 + sv_rng_range(&rng, -300, 300),
                                    .y = 9000000 + sv_rng_range(&rng, -300, 300),
                                    .z = sv_rng_range(&rng, 0, 60),
                                    .height_m = (float)sv_rng_range(&rng, 0.1, 40),
                                    .rotation_rad = (float)sv_rng_range(&rng, 0, 6.28),
                                    .species = (uint16_t)(sv_rng_next(&rng) % 2),
                                    .number = k};
}

/* The tree's box, corner by corner, against each plane: the plain form of what draw_cull.c does. */
static bool outside(const struct sv_tree *tree, double radius, struct sv_vec3 eye, const double planes[5][4])
{
    double h = (double)tree->height_m, r = radius * h;
    for (int p = 0; p < 5; p++) {
        int in = 0;
        for (int k = 0; k < 8; k++) {
            double x = tree->x - eye.x + (k & 1 ? r : -r), y = tree->y - eye.y + (k & 2 ? r : -r),
                   z = tree->z - eye.z + (k & 4 ? h : 0);
            in += planes[p][0] * x + planes[p][1] * y + planes[p][2] * z + planes[p][3] >= 0;
        }
        if (in == 0)
            return true;
    }
    return false;
}

/* reach_m: of the crown, for which the cube is larger (core/base/shell.h). */
static bool in_cube(const struct sv_tree *tree, double reach_m, struct sv_vec3 middle, double half_m)
{
    if (reach_m > half_m / 2)
        half_m = half_m + (reach_m < half_m ? reach_m - half_m / 2 : half_m / 2);
    return half_m >= 0 && fabs(tree->x - middle.x) <= half_m && fabs(tree->y - middle.y) <= half_m &&
           tree->z <= middle.z + half_m && tree->z + (double)tree->height_m >= middle.z - half_m;
}

static void culling_matches_brute_force(void **state)
{
    (void)state;
    enum { TREES = 3000 };
    static struct sv_tree trees[TREES];
    static const struct sv_cull_species species[2] = {{0.6f}, {0.3f}};
    struct sv_rng rng = sv_rng_seeded(11, 1);
    struct fixture_forest f;
    struct sv_cull_list list = {0};
    random_trees(trees, TREES, 3);
    fixture_forest_init(&f, trees, TREES, 0.6f);
    for (int round = 0; round < 60; round++) {
        struct sv_error error;
        struct sv_vec3 eye = sv_vec3(400000 + sv_rng_range(&rng, -400, 400),
                                     9000000 + sv_rng_range(&rng, -400, 400), sv_rng_range(&rng, 0, 150));
        struct sv_camera c =
            fixture_camera(eye, sv_rng_range(&rng, 0, 360), sv_rng_range(&rng, -90, 60), 320, 240);
        if (round % 3 == 0) {
            c.projection = SV_PROJECTION_ORTHOGRAPHIC;
            c.ortho_height_m = sv_rng_range(&rng, 5, 500);
            c.far_m = 2000;
        }
        struct sv_tree_shell between = {eye, sv_madd(eye, sv_vec3(0.6, -0.2, 0.3), 20),
                                        sv_rng_range(&rng, -10, 60), sv_rng_range(&rng, 60, 400)};
        const struct sv_tree_shell *shell = round % 2 ? &between : NULL;
        double planes[5][4];
        sv_camera_planes(&c, planes);
        fixture_ok(sv_cull_forest(&f.forest, species, &c, planes, shell, &list, &error), &error);
        uint8_t drawn[TREES] = {0};
        uint32_t seen = 0;
        for (uint32_t k = 0; k < list.count; k++)
            drawn[list.entries[k].tree]++;
        for (uint32_t k = 0; k < TREES; k++) {
            double radius = (double)species[f.trees[k].species].radius,
                   reach = (double)f.trees[k].height_m * radius;
            bool want = !outside(&f.trees[k], radius, eye, planes) &&
                        (!shell || (!in_cube(&f.trees[k], reach, shell->inner, shell->inner_m) &&
                                    in_cube(&f.trees[k], reach, shell->outer, shell->outer_m)));
            /* A tree's box that touches a plane may fall on either side by rounding: none does with these
             * seeds. */
            assert_int_equal(drawn[k], want);
            seen += want;
        }
        assert_int_equal(list.culled, TREES - seen);
        for (uint32_t k = 1; k < list.count; k++) /* nearest first */
            assert_true(list.entries[k].key >= list.entries[k - 1].key);
    }
    sv_cull_list_finish(&list);
    fixture_forest_finish(&f);
}

/* ---- places ---- */

struct box {
    double left, right, top, bottom;
};

static struct box projected(const struct sv_tree_mesh *mesh, const struct sv_tree *tree,
                            const struct sv_camera *c)
{
    struct box b = {1e9, -1e9, 1e9, -1e9};
    for (uint32_t k = 0; k < mesh->vertex_count; k++) {
        const float *p = mesh->vertices[k].position;
        struct sv_vec3 m = sv_rotate_clockwise(sv_vec3((double)p[0], (double)p[1], (double)p[2]),
                                               (double)tree->rotation_rad);
        double x, y, depth;
        assert_true(sv_camera_project(
            c, sv_madd(sv_vec3(tree->x, tree->y, tree->z), m, (double)tree->height_m), &x, &y, &depth));
        b.left = fmin(b.left, x);
        b.right = fmax(b.right, x);
        b.top = fmin(b.top, y);
        b.bottom = fmax(b.bottom, y);
    }
    return b;
}

static struct sv_camera look_at(struct sv_vec3 target, double heading_deg, double elevation_deg,
                                double distance, int side)
{
    struct sv_vec3 back = sv_direction(sv_radians(heading_deg + 180), sv_radians(elevation_deg));
    return fixture_camera(sv_madd(target, back, distance), heading_deg, -elevation_deg, side, side);
}

static const struct sv_tree lone = {
    .x = 712345.6, .y = 8765432.1, .z = 321.5, .height_m = 12, .rotation_rad = 0.9f, .number = 41};

static void polygons_stand_where_the_mesh_projects(void **state)
{
    (void)state;
    struct fixture_single s;
    struct sv_light light = fixture_light(120, 40);
    struct sv_tree_draw_options options = form(SV_TREE_FORM_POLYGON);
    fixture_single_init(&s, &leafy, &lone, kept_bakes());
    for (int k = 0; k < 12; k++) {
        struct sv_camera c = look_at(sv_vec3(lone.x, lone.y, lone.z + 6), 37.0 * k, -10 + 9.0 * k, 25, 300);
        struct fixture_view view;
        fixture_draw(s.draw, &c, &light, &options, &view);
        struct fixture_look look = fixture_look_at(&view);
        struct box want = projected(&leafy, &lone, &c);
        /* The mesh's outermost corners belong to leaf cards whose corners the mask cuts off: up to a card
         * (1.5 % of the height, 4 px). */
        assert_true(look.left >= floor(want.left) && look.left <= want.left + 5);
        assert_true(look.right <= ceil(want.right) && look.right >= want.right - 6);
        assert_true(look.top >= floor(want.top) && look.top <= want.top + 5);
        assert_true(look.bottom <= ceil(want.bottom) && look.bottom >= want.bottom - 6);
        for (int i = 0; i < view.width * view.height; i++) {
            bool tree = view.id[i] == SV_ID_TREE_FIRST + lone.number;
            assert_true(tree || view.id[i] == SV_ID_SKY);
            assert_int_equal(view.color[4 * i + 3], tree ? 255 : 0);
            assert_true(tree ? view.depth[i] > 0 : view.depth[i] == 0);
        }
        assert_int_equal(view.stats.trees[SV_TREE_FORM_POLYGON], 1);
        fixture_view_finish(&view);
    }
    fixture_single_finish(&s);
}

/* The foot of a bare pole, in both forms, from the ground and from above: it neither floats nor sinks. */
static void the_foot_is_in_its_place(void **state)
{
    (void)state;
    struct fixture_single s;
    struct sv_light light = fixture_light(120, 40);
    fixture_single_init(&s, &bare, &lone, kept_bakes());
    for (int f = 0; f < LIGHT_FORMS; f++)
        for (int k = 0; k < 10; k++) {
            struct sv_tree_draw_options options = form(forms[f]);
            struct sv_camera c = look_at(sv_vec3(lone.x, lone.y, lone.z), 31.0 * k, -5 + 7.0 * k, 100, 512);
            struct fixture_view view;
            fixture_draw(s.draw, &c, &light, &options, &view);
            struct fixture_look look = fixture_look_at(&view);
            double x, y, depth, radius_px = sv_camera_focal_px(&c) * 0.03 * 12 / 100;
            assert_true(sv_camera_project(&c, sv_vec3(lone.x, lone.y, lone.z), &x, &y, &depth));
            double foot = y + radius_px * sin(sv_radians(fmax(0, -5 + 7.0 * k)));
            assert_true(fabs(look.bottom + 1 - foot) <= (is_exact(forms[f]) ? 1 : 2));
            assert_true(fabs(0.5 * (look.left + look.right + 1) - x) <= (is_exact(forms[f]) ? 1 : 2));
            fixture_view_finish(&view);
        }
    fixture_single_finish(&s);
}

/* Seen straight down with north up: the bough that reaches east at rotation 0 goes south, west, north as it
 * is turned clockwise. */
static void rotation_is_clockwise_from_above(void **state)
{
    (void)state;
    static const int want[4][2] = {{1, 0}, {0, 1}, {-1, 0}, {0, -1}}; /* right, down */
    struct sv_light light = fixture_light(120, 40);
    for (int f = 0; f < LIGHT_FORMS; f++)
        for (int k = 0; k < 4; k++) {
            struct sv_tree tree = lone;
            tree.rotation_rad = (float)(k * SV_PI / 2);
            struct fixture_single s;
            fixture_single_init(&s, &leafy, &tree, kept_bakes());
            struct sv_camera c = fixture_camera(sv_vec3(tree.x, tree.y, tree.z + 50), 0, -90, 201, 201);
            c.projection = SV_PROJECTION_ORTHOGRAPHIC;
            c.ortho_height_m = 20.1;
            c.far_m = 100;
            struct sv_tree_draw_options options = form(forms[f]);
            struct fixture_view view;
            fixture_draw(s.draw, &c, &light, &options, &view);
            struct fixture_look look = fixture_look_at(&view);
            int reach[4] = {look.right - 100, 100 - look.left, look.bottom - 100, 100 - look.top};
            for (int side = 0; side < 4; side++) {
                int x = side == 0 ? 1 : side == 1 ? -1 : 0, y = side == 2 ? 1 : side == 3 ? -1 : 0;
                bool bough = x == want[k][0] && y == want[k][1];
                /* 0.5 and 0.26 of 12 m, 10 px a metre, cards included */
                assert_in_range(reach[side], bough ? 54 : 24, bough ? 64 : 36);
            }
            fixture_view_finish(&view);
            fixture_single_finish(&s);
        }
}

/* ---- odd cases ---- */

static void no_tree_and_no_species(void **state)
{
    (void)state;
    struct sv_error error;
    struct sv_forest empty = {0};
    struct sv_tree_draw *draw;
    struct sv_light light = fixture_light(120, 40);
    struct sv_camera c = fixture_camera(sv_vec3(0, 0, 2), 0, 0, 64, 64);
    struct sv_tree_draw_options options = SV_TREE_DRAW_OPTIONS_DEFAULT;
    struct sv_tree_draw_species unused = {&leafy, 1, 0};
    fixture_ok(sv_tree_draw_create(&unused, 1, &empty, NULL, &draw, &error), &error);
    struct fixture_view view;
    fixture_draw(draw, &c, &light, &options, &view);
    for (int k = 0; k < SV_TREE_FORM_COUNT; k++)
        assert_int_equal(view.stats.trees[k], 0);
    assert_int_equal(view.stats.culled_trees, 0);
    assert_true(fixture_look_at(&view).coverage == 0);
    fixture_view_finish(&view);
    assert_int_equal(sv_tree_draw_bytes(draw, 0, SV_TREE_FORM_POLYGON), 0);
    assert_int_equal(sv_tree_draw_bytes(draw, 0, SV_TREE_FORM_COARSE), 0);
    assert_int_equal(sv_tree_draw_bytes(draw, 1, SV_TREE_FORM_COARSE), 0);
    sv_tree_draw_destroy(draw);
    fixture_ok(sv_tree_draw_create(NULL, 0, &empty, NULL, &draw, &error), &error);
    sv_tree_draw_destroy(draw);
    sv_tree_draw_destroy(NULL);
}

static void a_tree_of_no_species_is_refused(void **state)
{
    (void)state;
    struct sv_error error;
    struct sv_tree_draw *draw;
    struct fixture_forest f;
    struct sv_tree tree = lone;
    struct sv_tree_draw_species species = {&leafy, 1, 1};
    tree.species = 3;
    fixture_forest_init(&f, &tree, 1, 0.6f);
    assert_int_equal(sv_tree_draw_create(&species, 1, &f.forest, NULL, &draw, &error), SV_EINVAL);
    assert_non_null(strstr(error.message, "species 3"));
    fixture_forest_finish(&f);
}

static void trees_behind_are_not_drawn(void **state)
{
    (void)state;
    struct fixture_single s;
    struct sv_light light = fixture_light(120, 40);
    fixture_single_init(&s, &leafy, &lone, kept_bakes());
    for (int f = 0; f < FORMS; f++) {
        struct sv_tree_draw_options options = form(forms[f]);
        struct sv_camera c = fixture_camera(sv_vec3(lone.x, lone.y + 30, lone.z + 6), 0, 0, 100, 100);
        struct fixture_view view;
        fixture_draw(s.draw, &c, &light, &options, &view);
        assert_int_equal(view.stats.culled_trees, 1);
        assert_true(fixture_look_at(&view).coverage == 0);
        fixture_view_finish(&view);
    }
    fixture_single_finish(&s);
}

/* The eye in the middle of the crown, and at the very foot: pictures without a number that is none. */
static void eye_inside_a_crown(void **state)
{
    (void)state;
    struct fixture_single s;
    struct sv_light light = fixture_light(120, 40);
    fixture_single_init(&s, &leafy, &lone, kept_bakes());
    for (int f = 0; f < FORMS; f++)
        for (int k = 0; k < 6; k++) {
            struct sv_tree_draw_options options = form(forms[f]);
            struct sv_camera c =
                fixture_camera(sv_vec3(lone.x, lone.y, lone.z + (k < 3 ? 6.0 : 0.0)), 70 * k, 20, 100, 100);
            struct fixture_view view;
            fixture_draw(s.draw, &c, &light, &options, &view);
            for (int i = 0; i < 3 * view.width * view.height; i++)
                assert_true(isfinite(view.normal[i]));
            for (int i = 0; i < view.width * view.height; i++)
                if (!(view.depth[i] >= 0 && view.depth[i] <= 1))
                    fail_msg("form %s, view %d: depth %g", sv_tree_form_name(forms[f]), k,
                             (double)view.depth[i]);
            if (forms[f] != SV_TREE_FORM_COARSE && k < 3)
                assert_true(fixture_look_at(&view).coverage > 500);
            fixture_view_finish(&view);
        }
    fixture_single_finish(&s);
}

static void drawing_is_deterministic_and_leaves_no_state(void **state)
{
    (void)state;
    enum { TREES = 400 };
    static struct sv_tree trees[TREES];
    struct sv_error error;
    struct fixture_forest f;
    struct sv_tree_draw *draw;
    random_trees(trees, TREES, 9);
    fixture_forest_init(&f, trees, TREES, 0.6f);
    struct sv_tree_draw_species species[2] = {{&leafy, kept_bakes_key(&leafy), 1},
                                              {&bare, kept_bakes_key(&bare), 1}};
    fixture_ok(sv_tree_draw_create(species, 2, &f.forest, kept_bakes(), &draw, &error), &error);
    struct sv_camera c = fixture_camera(sv_vec3(400000, 9000000 - 300, 60), 0, -8, 200, 150);
    struct sv_light light = fixture_light(200, 30);
    struct sv_tree_draw_options options = SV_TREE_DRAW_OPTIONS_DEFAULT;
    options.error_px = 0.5;
    struct fixture_view a, b;
    fixture_draw(draw, &c, &light, &options, &a);
    fixture_draw(draw, &c, &light, &options, &b);
    assert_true(a.stats.trees[SV_TREE_FORM_LEAF] > 3 && a.stats.trees[SV_TREE_FORM_COARSE] > 50);
    assert_memory_equal(a.color, b.color, 4 * 200 * 150);
    assert_memory_equal(a.id, b.id, 4 * 200 * 150);
    assert_memory_equal(a.depth, b.depth, 4 * 200 * 150);
    for (int i = 0; i < 200 * 150; i++) { /* id, depth and normal agree on where something stands */
        assert_int_equal(a.id[i] != 0, a.depth[i] > 0);
        float *n = a.normal + 3 * i, length = n[0] * n[0] + n[1] * n[1] + n[2] * n[2];
        assert_true(a.id[i] ? fabsf(length - 1) < 0.01f : length == 0);
        assert_true(a.id[i] == 0 || a.id[i] - SV_ID_TREE_FIRST < TREES);
    }
    fixture_view_finish(&b);
    /* color_only changes no colour; nothing else of it is promised. */
    options.color_only = true;
    fixture_draw(draw, &c, &light, &options, &b);
    assert_memory_equal(a.color, b.color, 4 * 200 * 150);
    fixture_view_finish(&a);
    fixture_view_finish(&b);
    sv_tree_draw_destroy(draw);
    fixture_forest_finish(&f);
}

/* ---- light that arrives ---- */

static double shaded_up_to(void *height, double x, double y)
{
    (void)x, (void)y;
    return *(const double *)height;
}

static int largest_difference(const struct fixture_view *a, const struct fixture_view *b, int row0, int row1)
{
    int most = 0;
    for (int i = 4 * a->width * row0; i < 4 * a->width * row1; i++)
        most = abs(a->color[i] - b->color[i]) > most ? abs(a->color[i] - b->color[i]) : most;
    return most;
}

/* Sum of linear light. */
static double light_sum(const struct fixture_view *view)
{
    double sum = 0;
    for (int i = 0; i < 4 * view->width * view->height; i++)
        sum += i % 4 < 3 ? (double)sv_linear_from_srgb8[view->color[i]] : 0;
    return sum;
}

/* A lone tree that stands in the terrain's shadow is drawn as if the sun sent no light; in full sun, as
 * without shadows but for the crown's own factor (shade.h); in shadow up to its middle, it is the one below
 * and the other above. In both forms; and without shadows nothing has changed afterwards. */
static void light_that_arrives_is_light_that_is_seen(void **state)
{
    (void)state;
    enum { SIDE = 240 };
    static const double up_to[] = {-1, 2, 0.6}; /* heights that the shadow reaches */
    struct sv_error error;
    struct sv_tree_shade *shade;
    struct fixture_single s;
    struct sv_light light = fixture_light(100, 2), none = light; /* a level sun: rows of light are heights */
    none.sun_rgb[0] = none.sun_rgb[1] = none.sun_rgb[2] = 0;
    fixture_single_init(&s, &leafy, &lone, kept_bakes());
    fixture_ok(sv_tree_draw_shade_create(s.draw, &shade, &error), &error);
    double h = (double)lone.height_m;
    struct sv_camera c = fixture_camera(sv_vec3(lone.x, lone.y - 3 * h, lone.z + h / 2), 0, 0, SIDE, SIDE);
    double crown = (double)sv_tree_crown_light((float)light.to_sun.z, (float)-light.to_sun.y);
    int edge = (int)(0.4 * sv_camera_focal_px(&c) / 3); /* 0.4 heights from the middle, in rows */
    for (int f = 0; f < LIGHT_FORMS; f++) {
        struct sv_tree_draw_options options = form(forms[f]);
        struct fixture_view plain, unlit, seen[3], again;
        fixture_draw(s.draw, &c, &light, &options, &plain);
        fixture_draw(s.draw, &c, &none, &options, &unlit);
        for (int k = 0; k < 3; k++) {
            double height = lone.z + up_to[k] * h;
            struct sv_vec3 to_sun = light.to_sun;
            to_sun.x += 1e-7 * (k + 1 + 3 * f); /* another sun: the terrain is the same for the same one */
            fixture_ok(sv_tree_shade_update(shade, to_sun, shaded_up_to, &height, &error), &error);
            options.shade = shade;
            fixture_draw(s.draw, &c, &light, &options, &seen[k]);
        }
        double dark = light_sum(&unlit), share = (light_sum(&seen[0]) - dark) / (light_sum(&plain) - dark);
        int off = largest_difference(&unlit, &seen[1], 0, SIDE),
            above = largest_difference(&seen[0], &seen[2], 0, SIDE / 2 - edge),
            below = largest_difference(&seen[1], &seen[2], SIDE / 2 + edge, SIDE);
        printf("  form %s: sunlight %.3f (%.3f wanted); all in shadow %d levels off; half: %d, %d\n",
               sv_tree_form_name(forms[f]), share, crown, off, above, below);
        assert_true(fabs(share - crown) < 0.02);
        /* Light is worked out at polygons' corners: the stem's reach to the middle, into the edge. */
        assert_true(off <= 1 && above <= 1 && below <= (is_exact(forms[f]) ? 6 : 1));
        assert_true(largest_difference(&seen[0], &seen[1], SIDE / 2 + edge, SIDE) > 10);
        options.shade = NULL;
        fixture_draw(s.draw, &c, &light, &options, &again);
        assert_int_equal(largest_difference(&plain, &again, 0, SIDE), 0);
        fixture_view_finish(&again);
        fixture_view_finish(&plain);
        fixture_view_finish(&unlit);
        for (int k = 0; k < 3; k++)
            fixture_view_finish(&seen[k]);
    }
    sv_tree_shade_destroy(shade);
    fixture_single_finish(&s);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(culling_matches_brute_force),
        cmocka_unit_test(polygons_stand_where_the_mesh_projects),
        cmocka_unit_test(the_foot_is_in_its_place),
        cmocka_unit_test(rotation_is_clockwise_from_above),
        cmocka_unit_test(no_tree_and_no_species),
        cmocka_unit_test(a_tree_of_no_species_is_refused),
        cmocka_unit_test(trees_behind_are_not_drawn),
        cmocka_unit_test(eye_inside_a_crown),
        cmocka_unit_test(drawing_is_deterministic_and_leaves_no_state),
        cmocka_unit_test(light_that_arrives_is_light_that_is_seen),
    };
    return cmocka_run_group_tests(tests, setup, teardown);
}
