/* test_shade.c - trees in sunlight against rays of the ray-cast truth, and against closed forms.
 *
 * Truth without shadow rays: an orthographic picture of the scene from the sun shows exactly what sunlight
 * reaches first. A tree alone gives its silhouette; a stand gives, by the ids in it, which part of each
 * tree's own outline the sun still reaches. */
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

#include "core/base/color.h"
#include "core/base/frames.h"
#include "core/base/rng.h"
#include "core/scene/id.h"
#include "core/tree/shade_private.h"
#include "core/truth/truth.h"
#include "tests/core/view/scene_kit.h"

enum { SPECIES = 3, LEAVES = 4000 };

static struct sv_scene *ground; /* flat, without trees */
static struct sv_scene *stand;  /* grown trees, close together */
static struct sv_impostor impostors[SPECIES];
static struct sv_shade_species table[SPECIES]; /* of the stand's species */
static uint8_t *coverage[SPECIES];

static void ok(enum sv_status status, const struct sv_error *error)
{
    if (status != SV_OK)
        fail_msg("%s: %s: %s", sv_status_text(status), error->field, error->message);
}

static double now_ms(void)
{
    struct timespec t;
    clock_gettime(CLOCK_MONOTONIC, &t);
    return (double)t.tv_sec * 1e3 + (double)t.tv_nsec * 1e-6;
}

static struct kit_options stand_options(void)
{
    return (struct kit_options){.width = 33,
                                .height = 33,
                                .x0 = 600000,
                                .y0 = 9000000,
                                .z0 = 500,
                                .dx = 8,
                                .dy = 8,
                                .seed = 5,
                                .species = SPECIES,
                                .leaves = LEAVES,
                                .trees = 60,
                                .spread_m = 22,
                                .height_min_m = 8,
                                .height_max_m = 20};
}

static int setup(void **state)
{
    (void)state;
    struct sv_error error;
    sv_color_init();
    struct kit_options options = stand_options();
    stand = kit_scene(&options);
    options.trees = 0;
    options.species = 0;
    ground = kit_scene(&options);
    for (int k = 0; k < SPECIES; k++) {
        ok(sv_impostor_bake(&stand->species[k].mesh, &impostors[k], &error), &error);
        size_t texels = (size_t)SV_IMPOSTOR_SIDE * SV_IMPOSTOR_SIDE;
        coverage[k] = malloc(texels);
        assert_non_null(coverage[k]);
        for (size_t i = 0; i < texels; i++)
            coverage[k][i] = impostors[k].albedo[4 * i + 3];
        table[k] = (struct sv_shade_species){impostors[k].frames, coverage[k], stand->species[k].mesh.radius};
    }
    return 0;
}

static int teardown(void **state)
{
    (void)state;
    for (int k = 0; k < SPECIES; k++) {
        sv_impostor_finish(&impostors[k]);
        free(coverage[k]);
    }
    kit_free(stand);
    kit_free(ground);
    return 0;
}

static struct sv_vec3 sun_at(double azimuth_deg, double elevation_deg)
{
    return sv_direction(sv_radians(azimuth_deg), sv_radians(elevation_deg));
}

/* The scene as the sun sees it: side x side px over span metres, its middle at `target`. */
static struct sv_camera sun_camera(double azimuth_deg, double elevation_deg, struct sv_vec3 target,
                                   double span, int side)
{
    struct sv_camera c = {.projection = SV_PROJECTION_ORTHOGRAPHIC,
                          .ortho_height_m = span,
                          .width = side,
                          .height = side,
                          .far_m = 4000};
    c.eye = sv_madd(target, sun_at(azimuth_deg, elevation_deg), 300);
    sv_camera_aim(&c, sv_radians(azimuth_deg + 180), sv_radians(-elevation_deg), 0);
    return c;
}

/* The ray-cast truth of the flat ground with these trees (borrowed for life). The scene outlives it. */
static struct sv_truth *truth_of(struct sv_scene *scene, const struct sv_tree *trees, uint32_t count)
{
    struct sv_error error;
    struct sv_truth *truth;
    *scene = *ground;
    scene->species = stand->species;
    scene->species_count = SPECIES;
    scene->forest = (struct sv_forest){.trees = trees, .count = count};
    ok(sv_truth_create(scene, &truth, &error), &error);
    return truth;
}

/* Ids as camera sees them: heap, side * side. */
static uint32_t *truth_ids(const struct sv_truth *truth, const struct sv_camera *camera)
{
    struct sv_error error;
    struct sv_light light;
    sv_light_from_sun(&(struct sv_sun){0, 1}, &light);
    struct sv_truth_options options = {
        .layers = 1u << SV_LAYER_ID, .samples = 1, .trees = true, .row_count = camera->height};
    struct sv_truth_picture picture;
    memset(&picture, 0, sizeof picture);
    ok(sv_image_alloc(camera->width, camera->height, 1, SV_PIXEL_U32, &picture.id, &error), &error);
    ok(sv_truth_render(truth, camera, &light, &options, &picture, &error), &error);
    return picture.id.data;
}

static struct sv_vec3 middle(void)
{
    const struct sv_heightfield *f = &ground->terrain.field;
    return sv_vec3(f->x0 + 128, f->y0 + 128, f->z0);
}

/* ---- silhouettes ---- */

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
    struct sv_camera c = sun_camera(azimuth, elevation, sv_vec3(tree->x, tree->y, tree->z), span, SIDE);
    uint32_t *ids = truth_ids(truth, &c);
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
static const double AZIMUTH = 137; /* of the sun in all comparisons with rays */
static const double APART_M = 200;

/* Trees side by side, square to the light's azimuth: no sun of that azimuth casts one's shade on another. */
static struct sv_vec3 apart(int k)
{
    return sv_madd(middle(), sv_shade_axes_of(sun_at(AZIMUTH, 45)).right, APART_M * k);
}

/* Area and outline against rays. What is lost is told apart: the same comparison with the tree turned to the
 * turn that its silhouette stands for leaves only what the impostor's frames are off. */
static void silhouettes_are_what_the_sun_sees(void **state)
{
    (void)state;
    static const double elevations[] = {3, 20, 40, 60, 88};
    struct sv_tree trees[2][SPECIES * ROTATIONS];
    for (int k = 0; k < 2 * SPECIES * ROTATIONS; k++) {
        int s = k / ROTATIONS % SPECIES, turned = k / (SPECIES * ROTATIONS);
        struct sv_vec3 p = apart(k);
        float rotation = (float)(0.1 + 1.3 * (k % ROTATIONS));
        if (turned)
            rotation = (float)(2 * SV_PI * sv_shade_turn(rotation) / SV_SHADE_TURNS);
        trees[turned][k % (SPECIES * ROTATIONS)] = (struct sv_tree){.x = p.x,
                                                                    .y = p.y,
                                                                    .z = p.z,
                                                                    .height_m = 12,
                                                                    .rotation_rad = rotation,
                                                                    .species = (uint16_t)s,
                                                                    .number = (uint32_t)k};
    }
    struct sv_scene scene;
    struct sv_truth *truth = truth_of(&scene, trees[0], 2 * SPECIES * ROTATIONS);
    double worst_area = 0, least_overlap = 1, mean_overlap = 0, frames_overlap = 0, mean_area = 0;
    int count = 0;
    printf("  species elevation: area ours/truth, overlap, mean |difference| (overlap in the same turn)\n");
    for (int s = 0; s < SPECIES; s++)
        for (size_t e = 0; e < sizeof elevations / sizeof elevations[0]; e++) {
            struct sv_error error;
            struct sv_shade_view view;
            double elevation = elevations[e], row[4] = {0}, span = 30;
            struct sv_shade_axes axes = sv_shade_axes_of(sun_at(AZIMUTH, elevation));
            ok(sv_shade_view_init(&table[s], &axes, &view, &error), &error);
            for (int r = 0; r < ROTATIONS; r++) {
                double cells[CELLS][CELLS], ours[CELLS][CELLS];
                const struct sv_tree *tree = &trees[0][s * ROTATIONS + r];
                our_cells(&view.turn[sv_shade_turn(tree->rotation_rad)], 12, span, ours);
                truth_cells(truth, tree, AZIMUTH, elevation, span, cells);
                struct likeness l = compare(cells, ours);
                truth_cells(truth, &trees[1][s * ROTATIONS + r], AZIMUTH, elevation, span, cells);
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
            printf("  %-10s %3.0f: %.3f, %.3f, %.3f (%.3f)\n", stand->species[s].name, elevation, row[0],
                   row[1], row[2], row[3]);
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
    for (int s = 0; s < SPECIES; s++)
        for (int e = 1; e <= 90; e += 11) {
            struct sv_shade_axes axes = sv_shade_axes_of(sun_at(200, e));
            struct sv_shade_view view;
            ok(sv_shade_view_init(&table[s], &axes, &view, &error), &error);
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

/* ---- light in a stand ---- */

struct truth_light {
    double lit[SV_SHADE_COLUMNS][SV_SHADE_ROWS], all[SV_SHADE_COLUMNS][SV_SHADE_ROWS];
};

/* By rays: of what the sun would see of a tree alone, cell by cell of its grid, how much it sees in the
 * stand. Both pictures have their middle at the foot, so that a pixel is the same ray of light in both. */
static void truth_light_of(const struct sv_truth *alone, const struct sv_truth *together,
                           const struct sv_tree *tree, struct sv_vec3 lone, double elevation,
                           const struct sv_tree_light_axes *axes, struct truth_light *out)
{
    enum { PICTURE = 128 };
    double span = 2.6 * (double)tree->height_m;
    uint32_t own = SV_ID_TREE_FIRST + tree->number;
    struct sv_camera c = sun_camera(AZIMUTH, elevation, lone, span, PICTURE);
    uint32_t *one = truth_ids(alone, &c);
    struct sv_vec3 eye = c.eye;
    c = sun_camera(AZIMUTH, elevation, sv_vec3(tree->x, tree->y, tree->z), span, PICTURE);
    uint32_t *all = truth_ids(together, &c);
    memset(out, 0, sizeof *out);
    for (int j = 0; j < PICTURE; j++)
        for (int i = 0; i < PICTURE; i++) {
            size_t at = (size_t)j * PICTURE + (size_t)i;
            if (one[at] != own)
                continue;
            struct sv_vec3 origin, direction;
            sv_camera_ray(&c, i + 0.5, j + 0.5, &origin, &direction);
            /* Any point of the ray will do: the axes are square to the light. */
            struct sv_vec3 p = sv_scale(sv_add(sv_sub(eye, lone), origin), 1 / (double)tree->height_m);
            const float *x = axes->across, *y = axes->along;
            double u = p.x * (double)x[0] + p.y * (double)x[1] + p.z * (double)x[2] + (double)x[3];
            double v = p.x * (double)y[0] + p.y * (double)y[1] + p.z * (double)y[2] + (double)y[3];
            int a = (int)sv_clamp(floor(u + 0.5), 0, SV_SHADE_COLUMNS - 1),
                b = (int)sv_clamp(floor(v + 0.5), 0, SV_SHADE_ROWS - 1);
            out->all[a][b]++;
            out->lit[a][b] += all[at] == own;
        }
    free(one);
    free(all);
}

static void light_in_a_stand_is_what_rays_say(void **state)
{
    (void)state;
    static const double elevations[] = {5, 20, 40, 60, 85};
    struct sv_error error;
    const struct sv_forest *forest = &stand->forest;
    struct sv_tree lone[64];
    assert_true(forest->count <= 64);
    for (uint32_t k = 0; k < forest->count; k++) {
        struct sv_vec3 p = apart((int)k);
        lone[k] = forest->trees[k];
        lone[k].x = p.x;
        lone[k].y = p.y;
        lone[k].z = p.z;
    }
    struct sv_scene scenes[2];
    struct sv_truth *together = truth_of(&scenes[0], forest->trees, forest->count);
    struct sv_truth *alone = truth_of(&scenes[1], lone, forest->count);
    struct sv_tree_shade *shade;
    ok(sv_tree_shade_create(table, SPECIES, forest, &shade, &error), &error);
    printf("  elevation: mean light by row from below, truth | ours; mean |difference| of cells, of trees\n");
    for (size_t e = 0; e < sizeof elevations / sizeof elevations[0]; e++) {
        double elevation = elevations[e];
        ok(sv_tree_shade_update(shade, sun_at(AZIMUTH, elevation), NULL, NULL, &error), &error);
        struct sv_tree_lights lights = sv_tree_shade_lights(shade);
        double truth_rows[SV_SHADE_ROWS] = {0}, our_rows[SV_SHADE_ROWS] = {0}, weights[SV_SHADE_ROWS] = {0};
        double off_cells = 0, off_trees = 0, cells = 0, truth_mean = 0, our_mean = 0;
        for (uint32_t k = 0; k < forest->count; k++) {
            const struct sv_tree *tree = &forest->trees[k];
            struct truth_light t;
            truth_light_of(alone, together, tree, sv_vec3(lone[k].x, lone[k].y, lone[k].z), elevation,
                           &lights.of_species[tree->species], &t);
            double truth_sum = 0, our_sum = 0, all = 0;
            for (int a = 0; a < SV_SHADE_COLUMNS; a++)
                for (int r = 0; r < SV_SHADE_ROWS; r++) {
                    double ours = lights.of_tree[k].share[a][r] / 255.0, n = t.all[a][r];
                    truth_rows[r] += t.lit[a][r];
                    our_rows[r] += ours * n;
                    weights[r] += n;
                    truth_sum += t.lit[a][r];
                    our_sum += ours * n;
                    all += n;
                    if (n < 30)
                        continue;
                    off_cells += fabs(ours - t.lit[a][r] / n);
                    cells++;
                }
            off_trees += fabs(truth_sum - our_sum) / all;
            truth_mean += truth_sum / all;
            our_mean += our_sum / all;
        }
        printf("  %3.0f:", elevation);
        for (int r = 0; r < SV_SHADE_ROWS; r++)
            printf(" %.2f", truth_rows[r] / fmax(weights[r], 1));
        printf(" |");
        for (int r = 0; r < SV_SHADE_ROWS; r++)
            printf(" %.2f", our_rows[r] / fmax(weights[r], 1));
        printf("; %.3f, %.3f; mean %.3f | %.3f\n", off_cells / cells, off_trees / forest->count,
               truth_mean / forest->count, our_mean / forest->count);
        /* These crowns reach into each other (random places): light that passes them has no one order, which
         * tells under a high sun. */
        assert_true(off_cells / cells < (elevation > 45 ? 0.18 : 0.12));
        assert_true(off_trees / forest->count < (elevation > 45 ? 0.18 : 0.1));
        assert_true(fabs(truth_mean - our_mean) / forest->count < 0.05);
    }
    sv_tree_shade_destroy(shade);
    sv_truth_destroy(together);
    sv_truth_destroy(alone);
}

/* ---- one tree, and what is the same whatever came before ---- */

static struct sv_tree tree_at(double x, double y, double height, int species, uint32_t number)
{
    return (struct sv_tree){.x = middle().x + x,
                            .y = middle().y + y,
                            .z = middle().z,
                            .height_m = (float)height,
                            .rotation_rad = (float)(number % 6),
                            .species = (uint16_t)species,
                            .number = number};
}

struct forest {
    struct sv_arena *arena;
    struct sv_forest forest;
    struct sv_tree_shade *shade;
};

static void forest_init(struct forest *f, const struct sv_tree *trees, uint32_t count,
                        const struct sv_shade_species *species, int species_count)
{
    struct sv_error error;
    struct sv_crown_bound bounds[8];
    for (int k = 0; k < 8; k++)
        bounds[k] = (struct sv_crown_bound){k < species_count ? species[k].radius : 1, 1, 0};
    ok(sv_arena_create((size_t)1 << 30, &f->arena, &error), &error);
    struct sv_tree *copy = sv_arena_alloc(f->arena, (size_t)count + 1, sizeof *copy);
    assert_non_null(copy);
    memcpy(copy, trees, count * sizeof *copy);
    ok(sv_forest_build(copy, count, bounds, f->arena, &f->forest, &error), &error);
    ok(sv_tree_shade_create(species, species_count, &f->forest, &f->shade, &error), &error);
}

static void forest_finish(struct forest *f)
{
    sv_tree_shade_destroy(f->shade);
    sv_arena_destroy(f->arena);
}

static void update(struct forest *f, struct sv_vec3 to_sun)
{
    struct sv_error error;
    ok(sv_tree_shade_update(f->shade, to_sun, NULL, NULL, &error), &error);
}

static void a_lone_tree_gets_all_light(void **state)
{
    (void)state;
    static const double heights[] = {0.05, 0.1, 12, 120, 150}, elevations[] = {1e-9, 0.01, 3, 45, 89.999, 90};
    for (size_t h = 0; h < sizeof heights / sizeof heights[0]; h++) {
        struct sv_tree tree = tree_at(3, 4, heights[h], (int)h % SPECIES, 9);
        struct forest f;
        forest_init(&f, &tree, 1, table, SPECIES);
        assert_null(sv_tree_shade_lights(f.shade).of_tree);
        for (size_t e = 0; e < sizeof elevations / sizeof elevations[0]; e++) {
            update(&f, sun_at(33, elevations[e]));
            struct sv_tree_lights lights = sv_tree_shade_lights(f.shade);
            for (int k = 0; k < SV_SHADE_COLUMNS * SV_SHADE_ROWS; k++)
                assert_int_equal(lights.of_tree[0].share[k / SV_SHADE_ROWS][k % SV_SHADE_ROWS], 255);
            const struct sv_tree_light_axes *axes = &lights.of_species[tree.species];
            for (int k = 0; k < 4; k++)
                assert_true(isfinite(axes->across[k]) && isfinite(axes->along[k]));
        }
        forest_finish(&f);
    }
}

static void night_and_no_direction(void **state)
{
    (void)state;
    struct sv_tree tree = tree_at(0, 0, 10, 0, 1);
    struct forest f;
    struct sv_error error;
    struct sv_shadow_window window = {0};
    ok(sv_shadow_window_alloc(&window, SV_SHADOW_WINDOW_SIDE, &error), &error);
    sv_shadow_window_fill(&window, &ground->terrain.field, NULL,
                          (struct sv_shadow_place){middle().x - 64, middle().y - 64, 0.125});
    forest_init(&f, &tree, 1, table, SPECIES);
    sv_tree_shade_cast(f.shade, &window); /* before the first update */
    static const double below[] = {0, -1e-12, -30, -90};
    for (int k = 0; k < 4; k++) {
        update(&f, sun_at(10, below[k]));
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
    struct sv_shade_species none[SPECIES] = {{NULL, NULL, 0}};
    struct sv_tree_shade *shade;
    assert_int_equal(sv_tree_shade_create(none, SPECIES, &f.forest, &shade, &error), SV_EINVAL);
    forest_finish(&f);
    forest_init(&f, &tree, 0, table, SPECIES); /* no trees */
    update(&f, sun_at(10, 30));
    sv_tree_shade_cast(f.shade, &window);
    forest_finish(&f);
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
    struct sv_tree tree = tree_at(0, 0, 20, 0, 3);
    for (int d = -5; d <= 25; d++) {
        struct forest f;
        forest_init(&f, &tree, 1, table, SPECIES);
        double height = tree.z + d, sum = 0;
        ok(sv_tree_shade_update(f.shade, sun_at(100, 2), flat_shadow, &height, &error), &error);
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
        forest_finish(&f);
    }
}

static void updates_do_not_depend_on_what_came_before(void **state)
{
    (void)state;
    struct forest a, b;
    const struct sv_forest *forest = &stand->forest;
    forest_init(&a, forest->trees, forest->count, table, SPECIES);
    forest_init(&b, forest->trees, forest->count, table, SPECIES);
    for (int round = 0; round < 12; round++) {
        struct sv_vec3 to_sun = sun_at(20 * (round % 5), 5 + 13 * (round % 5));
        update(&a, to_sun);
        if (round % 5 == 2) {
            update(&b, sun_at(1, 2));
            update(&b, to_sun);
            assert_memory_equal(sv_tree_shade_lights(a.shade).of_tree, sv_tree_shade_lights(b.shade).of_tree,
                                forest->count * sizeof(struct sv_tree_light));
        }
    }
    /* The same again is the same object, not only the same bytes: it was kept. */
    const struct sv_tree_light *kept = sv_tree_shade_lights(a.shade).of_tree;
    update(&a, sun_at(0, 5));
    update(&a, sun_at(20, 18));
    assert_ptr_equal(sv_tree_shade_lights(a.shade).of_tree, kept);
    forest_finish(&a);
    forest_finish(&b);
}

static void species_of_one_mesh_share_silhouettes(void **state)
{
    (void)state;
    struct sv_shade_species twins[2] = {table[0], table[0]};
    struct sv_tree one[4], two[4];
    for (int k = 0; k < 4; k++) {
        one[k] = tree_at(4 * k, k, 9 + k, 0, (uint32_t)k);
        two[k] = one[k];
        two[k].species = (uint16_t)(k & 1);
    }
    struct forest a, b;
    forest_init(&a, one, 4, table, 1);
    forest_init(&b, two, 4, twins, 2);
    update(&a, sun_at(250, 20));
    update(&b, sun_at(250, 20));
    assert_non_null(b.shade->current->views[0].texels);
    assert_null(b.shade->current->views[1].texels);
    struct sv_tree_lights la = sv_tree_shade_lights(a.shade), lb = sv_tree_shade_lights(b.shade);
    assert_memory_equal(la.of_tree, lb.of_tree, 4 * sizeof *la.of_tree);
    assert_memory_equal(&lb.of_species[0], &lb.of_species[1], sizeof *lb.of_species);
    forest_finish(&a);
    forest_finish(&b);
}

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
    ok(sv_shadow_window_alloc(&w, SV_SHADOW_WINDOW_SIDE, &error), &error);
    for (int e = 0; e < 3; e++) {
        double elevation = 15 + 30 * e;
        struct sv_tree tree = tree_at(0, 0, 14, e, 5);
        struct forest f;
        forest_init(&f, &tree, 1, table, SPECIES);
        update(&f, sun_at(77, elevation));
        const struct sv_shade_outline *o = &f.shade->current->views[e].turn[sv_shade_turn(tree.rotation_rad)];
        double want = (double)o->area * 14 * 14 / sin(sv_radians(elevation));
        printf("  sun at %2.0f degrees, %.1f m2:", elevation, want);
        for (size_t t = 0; t < sizeof texels / sizeof texels[0]; t++) {
            double half = 512 * texels[t];
            sv_shadow_window_fill(&w, &ground->terrain.field, NULL,
                                  (struct sv_shadow_place){middle().x - half, middle().y - half, texels[t]});
            sv_tree_shade_cast(f.shade, &w);
            double got = window_shade(&w);
            printf(" %.3f", got / want);
            /* A shadow of some ten texels or fewer: where their middles fall decides. */
            assert_true(fabs(got / want - 1) < (texels[t] * texels[t] * 10 > want ? 0.15 : 0.03));
        }
        printf(" of it at texels of 1/8 .. 16 m\n");
        forest_finish(&f);
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
        trees[k] = tree_at(sv_rng_range(&rng, -100, 100), sv_rng_range(&rng, -100, 100), 0.1, 0, k);
    }
    struct forest f;
    struct sv_error error;
    struct sv_shadow_window w = {0};
    ok(sv_shadow_window_alloc(&w, SV_SHADOW_WINDOW_SIDE, &error), &error);
    sv_shadow_window_fill(&w, &ground->terrain.field, NULL,
                          (struct sv_shadow_place){middle().x - 1024, middle().y - 1024, 2});
    forest_init(&f, trees, COUNT, table, SPECIES);
    update(&f, sun_at(77, 30));
    sv_tree_shade_cast(f.shade, &w);
    double want = 0;
    for (int k = 0; k < SV_SHADE_TURNS; k++)
        want += (double)f.shade->current->views[0].turn[k].area / SV_SHADE_TURNS * COUNT * 0.01 / 0.5;
    printf("  %d trees of 0.1 m shade %.1f m2 of ground, %.1f expected\n", COUNT, window_shade(&w), want);
    assert_true(fabs(window_shade(&w) / want - 1) < 0.1);
    forest_finish(&f);
    sv_shadow_window_finish(&w);
    free(trees);
}

/* The hierarchy leaves nothing out: what it casts is what every tree cast alone gives, texel by texel. */
static void the_caster_finds_every_tree_that_reaches(void **state)
{
    (void)state;
    struct sv_error error;
    struct sv_shadow_window a = {0}, b = {0};
    ok(sv_shadow_window_alloc(&a, SV_SHADOW_WINDOW_SIDE, &error), &error);
    ok(sv_shadow_window_alloc(&b, SV_SHADOW_WINDOW_SIDE, &error), &error);
    struct forest f;
    forest_init(&f, stand->forest.trees, stand->forest.count, table, SPECIES);
    struct sv_rng rng = sv_rng_seeded(8, 8);
    uint64_t dark = 0;
    for (int round = 0; round < 40; round++) {
        double elevation = round % 4 == 0 ? sv_rng_range(&rng, 0.05, 3) : sv_rng_range(&rng, 3, 90);
        struct sv_vec3 to_sun = sun_at(sv_rng_range(&rng, 0, 360), elevation);
        update(&f, to_sun);
        double texel = round & 1 ? 0.125 : 0.25;
        struct sv_shadow_place place = {middle().x + sv_rng_range(&rng, -160, 60),
                                        middle().y + sv_rng_range(&rng, -160, 60), texel};
        sv_shadow_window_fill(&a, &ground->terrain.field, NULL, place);
        sv_shadow_window_fill(&b, &ground->terrain.field, NULL, place);
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
    forest_finish(&f);
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
    ok(sv_shadow_window_alloc(&w, SV_SHADOW_WINDOW_SIDE, &error), &error);
    struct forest f, none;
    forest_init(&f, stand->forest.trees, stand->forest.count, table, SPECIES);
    forest_init(&none, stand->forest.trees, 0, table, SPECIES);
    struct sv_rng rng = sv_rng_seeded(31, 4);
    assert_true(sv_tree_shade_share(f.shade, middle()) == 1); /* no sun is known yet */
    for (int round = 0; round < 6; round++) {
        struct sv_vec3 to_sun = sun_at(sv_rng_range(&rng, 0, 360), 8 + 14 * round);
        update(&f, to_sun);
        update(&none, to_sun);
        sv_shadow_window_fill(&w, &ground->terrain.field, NULL,
                              (struct sv_shadow_place){middle().x - 64, middle().y - 64, 0.125});
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
    update(&f, sun_at(0, -3));
    assert_true(sv_tree_shade_share(f.shade, middle()) == 0);
    forest_finish(&f);
    forest_finish(&none);
    sv_shadow_window_finish(&w);
}

/* ---- many ---- */

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
            trees[k] =
                tree_at(sv_rng_range(&rng, -side / 2, side / 2), sv_rng_range(&rng, -side / 2, side / 2),
                        sv_rng_range(&rng, 9, 24), (int)(k % SPECIES), k);
        struct forest f;
        forest_init(&f, trees, count, table, SPECIES);
        free(trees);
        double light[3] = {0};
        printf("  %u trees: update", count);
        for (int e = 0; e < 3; e++) {
            double since = now_ms();
            update(&f, sun_at(120, 5 + 25 * e));
            printf(" %.0f", now_ms() - since);
            struct sv_tree_lights lights = sv_tree_shade_lights(f.shade);
            for (uint32_t k = 0; k < count; k++)
                for (int i = 0; i < 8; i++)
                    light[e] += lights.of_tree[k].share[i / 4][i % 4] / (255.0 * 8 * count);
        }
        printf(" ms at 5, 30, 55 degrees (mean light %.2f %.2f %.2f)", light[0], light[1], light[2]);
        assert_true(light[0] > 0.02 && light[0] < light[1] && light[1] < light[2] && light[2] < 0.95);
        struct sv_shadow_window w = {0};
        ok(sv_shadow_window_alloc(&w, SV_SHADOW_WINDOW_SIDE, &error), &error);
        sv_shadow_window_fill(&w, &ground->terrain.field, NULL,
                              (struct sv_shadow_place){middle().x - 1024, middle().y - 1024, 2});
        double since = now_ms();
        sv_tree_shade_cast(f.shade, &w);
        printf("; a window of 2 m texels %.0f ms", now_ms() - since);
        sv_shadow_window_fill(&w, &ground->terrain.field, NULL,
                              (struct sv_shadow_place){middle().x - 8192, middle().y - 8192, 16});
        since = now_ms();
        sv_tree_shade_cast(f.shade, &w);
        printf(", of 16 m %.0f ms\n", now_ms() - since);
        sv_shadow_window_finish(&w);
        forest_finish(&f);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(silhouettes_are_what_the_sun_sees),
        cmocka_unit_test(levels_keep_the_amount_of_shade),
        cmocka_unit_test(light_in_a_stand_is_what_rays_say),
        cmocka_unit_test(a_lone_tree_gets_all_light),
        cmocka_unit_test(night_and_no_direction),
        cmocka_unit_test(the_terrain_shades_from_below),
        cmocka_unit_test(updates_do_not_depend_on_what_came_before),
        cmocka_unit_test(species_of_one_mesh_share_silhouettes),
        cmocka_unit_test(windows_keep_the_amount_of_shade),
        cmocka_unit_test(shade_of_tiny_trees_adds_up),
        cmocka_unit_test(the_caster_finds_every_tree_that_reaches),
        cmocka_unit_test(light_at_a_place_is_that_of_the_ground),
        cmocka_unit_test(a_million_trees),
    };
    return cmocka_run_group_tests(tests, setup, teardown);
}
