/* bench_leaf_splat.c - what near trees cost as leaf splats, and how far they are from the truth: a line for
 * each species and size, beside the ray cast of one sample in the same run. Asserts no time.
 *
 * bench_leaf_splat [LEAVES [MODEL ...]]; SV_TEST_PICTURES names a folder for sheets: thinned out, whole, one
 * ray a pixel, 64 rays a pixel. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

#include "core/base/rng.h"
#include "core/gl/context.h"
#include "core/gl/frame.h"
#include "core/gl/target.h"
#include "core/scene/id.h"
#include "core/tree/draw_mesh.h"
#include "core/tree/grow.h"
#include "core/tree/import.h"
#include "core/tree/leaf_kernel.h"
#include "core/view/compare.h"
#include "tests/core/tree/leaf_fixture.h"
#include "tests/core/view/scene_kit.h"

enum { ROUNDS = 5 };

static double now_ms(void)
{
    struct timespec t;
    clock_gettime(CLOCK_THREAD_CPUTIME_ID, &t);
    return (double)t.tv_sec * 1e3 + (double)t.tv_nsec * 1e-6;
}

static int by_value(const void *a, const void *b)
{
    double x = *(const double *)a, y = *(const double *)b;
    return (x > y) - (x < y);
}

static void must(enum sv_status status, const struct sv_error *error)
{
    if (status == SV_OK)
        return;
    fprintf(stderr, "%s: %s: %s\n", sv_status_text(status), error->field, error->message);
    exit(1);
}

/* A tree of 20 m at the distance that makes it px tall, seen from a little above its foot. */
static struct sv_leaf_view view_of(double px)
{
    struct sv_leaf_view view = {0};
    int side = px > 500 ? 1152 : px > 250 ? 576 : 320;
    struct sv_camera *c = &view.camera;
    c->width = c->height = side;
    c->vfov_rad = sv_radians(px > 500 ? 60 : px > 250 ? 40 : 22);
    c->near_m = 0.1;
    double focal = 0.5 * side / tan(0.5 * c->vfov_rad), distance = focal * 20 / px;
    c->eye = sv_add(leaf_fixture_middle(), sv_vec3(0, -distance, 8));
    sv_camera_aim(c, 0, atan2(2, distance), 0);
    sv_light_from_sun(&(struct sv_sun){sv_radians(135), sv_radians(40)}, &view.light);
    return view;
}

struct errors {
    double mae, ssim, gradient;
};

/* Pixels that the tree changes, and their neighbours. */
static void tree_mask(const struct sv_image *with, const struct sv_image *without, struct sv_image *mask)
{
    struct sv_error error;
    must(sv_image_alloc(with->width, with->height, 1, SV_PIXEL_U8, mask, &error), &error);
    uint8_t *m = mask->data;
    const uint8_t *a = with->data, *b = without->data;
    for (int j = 1; j < with->height - 1; j++)
        for (int i = 1; i < with->width - 1; i++) {
            size_t p = (size_t)j * (size_t)with->width + (size_t)i;
            if (memcmp(a + 4 * p, b + 4 * p, 3) == 0)
                continue;
            for (int k = 0; k < 9; k++)
                m[p + (size_t)(k % 3 - 1) + (size_t)((k / 3 - 1) * with->width)] = 1;
        }
}

static struct errors errors_of(const uint8_t *color, const struct sv_image *truth,
                               const struct sv_image *mask)
{
    struct sv_error error;
    struct sv_image picture = *truth;
    picture.data = (void *)(uintptr_t)color;
    struct sv_compare_options options = {mask, 8};
    struct sv_compare_result r;
    must(sv_compare(&picture, truth, &options, &r, &error), &error);
    return (struct errors){r.mean_abs, r.ssim, r.gradient_ratio};
}

struct timing {
    double ms;
    struct sv_leaf_splat_stats stats;
};

static struct timing draw(struct leaf_fixture *f, const struct sv_leaf_view *view,
                          const struct sv_truth_picture *ground, const float *fraction, int samples,
                          struct sv_canvas *keep)
{
    double ms[ROUNDS];
    struct timing t = {0};
    struct sv_error error;
    for (int k = 0; k < ROUNDS; k++) {
        struct sv_canvas canvas = leaf_canvas(ground, &view->camera);
        uint32_t *id = canvas.id;
        float *normal = canvas.normal;
        canvas.id = samples > 1 ? NULL : id;
        canvas.normal = samples > 1 ? NULL : normal;
        struct sv_leaf_splat_trees trees = {.trees = f->scene->forest.trees,
                                            .entries = f->entries,
                                            .count = f->scene->forest.count,
                                            .fraction = fraction,
                                            .samples = samples,
                                            .id_first = SV_ID_TREE_FIRST};
        double start = now_ms();
        must(sv_leaf_splat_draw(f->splat, view, &canvas, &trees, &t.stats, &error), &error);
        ms[k] = now_ms() - start;
        canvas.id = id;
        canvas.normal = normal;
        if (k + 1 < ROUNDS)
            leaf_canvas_finish(&canvas);
        else
            *keep = canvas;
    }
    qsort(ms, ROUNDS, sizeof *ms, by_value);
    t.ms = ms[ROUNDS / 2];
    return t;
}

static void keep_sheet(const char *name, double px, const struct sv_image *model,
                       const uint8_t *const colors[4])
{
    int w = model->width, h = model->height, side = (int)fmin(w, px * 1.3);
    struct sv_error error;
    struct sv_image sheet;
    must(sv_image_alloc(4 * side, side, 4, SV_PIXEL_U8, &sheet, &error), &error);
    for (int k = 0; k < 4; k++)
        for (int j = 0; j < side; j++)
            memcpy((uint8_t *)sheet.data + ((size_t)j * 4 + (size_t)k) * (size_t)side * 4,
                   colors[k] + ((size_t)(j + (h - side) / 2) * (size_t)w + (size_t)((w - side) / 2)) * 4,
                   (size_t)side * 4);
    char file[128];
    snprintf(file, sizeof file, "%s-%04.0f", name, px);
    kit_keep(&sheet, file);
    sv_image_free(&sheet);
}

/* ---- beside OSMesa ---- */

static double polygons_ms(struct leaf_fixture *f, int species, const struct sv_leaf_view *view)
{
    struct sv_error error;
    struct sv_tree_draw_species draw[LEAF_FIXTURE_SPECIES];
    for (int k = 0; k < species; k++)
        draw[k] = (struct sv_tree_draw_species){&f->scene->species[k].mesh, (uint64_t)k,
                                                f->scene->species[k].tree_count};
    struct sv_mesh_draw *polygons;
    must(sv_mesh_draw_create(draw, species, SV_ID_TREE_FIRST, &polygons, &error), &error);
    struct sv_gl_target *target;
    must(sv_gl_target_create(view->camera.width, view->camera.height, 1, &target, &error), &error);
    struct sv_image color;
    must(sv_image_alloc(view->camera.width, view->camera.height, 4, SV_PIXEL_U8, &color, &error), &error);
    double least = INFINITY;
    for (int k = 0; k < ROUNDS; k++) {
        struct sv_gl_frame frame = {.camera = view->camera, .light = view->light};
        sv_gl_target_begin(target);
        must(sv_gl_frame_begin(&frame, &error), &error);
        must(sv_gl_target_read(target, SV_LAYER_COLOR, &color, &error), &error);
        double start = now_ms();
        must(sv_mesh_draw_trees(polygons, &frame, f->scene->forest.trees, f->entries, f->scene->forest.count,
                                (struct sv_tree_lights){NULL, NULL}, &error),
             &error);
        must(sv_gl_target_read(target, SV_LAYER_COLOR, &color, &error), &error);
        least = fmin(least, now_ms() - start);
    }
    sv_image_free(&color);
    sv_gl_target_destroy(target);
    sv_mesh_draw_destroy(polygons);
    return least;
}

static void measure(struct leaf_fixture *f, const char *name, double px)
{
    struct sv_leaf_view view = view_of(px);
    struct sv_truth_picture ground, one, truth, bare;
    leaf_fixture_truth(f, &view, 1, false, false, &ground);
    double start = now_ms();
    leaf_fixture_truth(f, &view, 1, false, false, &bare);
    double ground_ms = now_ms() - start;
    start = now_ms();
    leaf_fixture_truth(f, &view, 1, true, false, &one);
    double ray_ms = now_ms() - start - ground_ms;
    leaf_picture_finish(&bare);
    leaf_fixture_truth(f, &view, 64, false, false, &bare);
    leaf_fixture_truth(f, &view, 64, true, false, &truth);
    struct sv_image mask;
    tree_mask(&truth.color, &bare.color, &mask);
    struct errors e0 = errors_of(one.color.data, &truth.color, &mask);
    double gl_ms = polygons_ms(f, 1, &view);
    printf("%-10s %5.0f px  polygons        %8.2f ms\n", name, px, gl_ms);
    printf("%-10s %5.0f px  rays 1 x        +%7.2f ms  MAE %5.2f  SSIM %.3f  gradient %.2f\n", name, px,
           ray_ms, e0.mae, e0.ssim, e0.gradient);
    static const struct {
        int samples;
        float fraction; /* 0: as it is chosen */
    } ways[] = {{1, 1}, {2, 1},    {4, 1},     {8, 1},     {1, 0},
                {4, 0}, {4, 0.5f}, {4, 0.25f}, {4, 0.12f}, {4, 0.06f}};
    for (size_t k = 0; k < sizeof ways / sizeof *ways; k++) {
        if (ways[k].fraction > 0 && ways[k].fraction < 1 && px > 120)
            continue;
        struct sv_canvas canvas;
        float chosen = sv_leaf_splat_fraction(f->splat, 0, px), wish = ways[k].fraction;
        struct timing t = draw(f, &view, &ground, wish > 0 ? &wish : NULL, ways[k].samples, &canvas);
        struct errors e = errors_of(canvas.color, &truth.color, &mask);
        printf("%-10s %5.0f px  leaves %d x %4.2f%s %7.2f ms  MAE %5.2f  SSIM %.3f  gradient %.2f\n", name,
               px, ways[k].samples, (double)(wish > 0 ? wish : chosen), wish > 0 ? " " : "*", t.ms, e.mae,
               e.ssim, e.gradient);
        if (k == 5)
            keep_sheet(
                name, px, &truth.color,
                (const uint8_t *const[4]){canvas.color, one.color.data, one.color.data, truth.color.data});
        leaf_canvas_finish(&canvas);
    }
    sv_image_free(&mask);
    leaf_picture_finish(&ground);
    leaf_picture_finish(&one);
    leaf_picture_finish(&truth);
    leaf_picture_finish(&bare);
}

/* Time alone, over the bare ground: least of many rounds. */
static void time_it(struct leaf_fixture *f, const char *name, double px, const float *fraction, int samples)
{
    struct sv_leaf_view view = view_of(px);
    struct sv_truth_picture ground;
    struct sv_error error;
    leaf_fixture_truth(f, &view, 1, false, false, &ground);
    struct sv_canvas canvas = leaf_canvas(&ground, &view.camera);
    size_t n = (size_t)canvas.width * (size_t)canvas.height;
    float *depth = malloc(n * sizeof *depth);
    memcpy(depth, canvas.depth, n * sizeof *depth);
    canvas.id = NULL;
    free(canvas.normal);
    canvas.normal = NULL;
    double least = INFINITY, sum = 0;
    int rounds = 0;
    double budget = getenv("BENCH_MS") ? atof(getenv("BENCH_MS")) : 300;
    struct sv_leaf_splat_stats stats;
    for (; rounds < 20 || (sum < budget && rounds < 20000); rounds++) {
        memcpy(canvas.depth, depth, n * sizeof *depth);
        struct sv_leaf_splat_trees trees = {.trees = f->scene->forest.trees,
                                            .entries = f->entries,
                                            .count = f->scene->forest.count,
                                            .fraction = fraction,
                                            .samples = samples,
                                            .id_first = SV_ID_TREE_FIRST};
        double start = now_ms();
        must(sv_leaf_splat_draw(f->splat, &view, &canvas, &trees, &stats, &error), &error);
        double ms = now_ms() - start;
        sum += ms;
        least = fmin(least, ms);
    }
    printf("%-10s %5.0f px  %s %6.3f ms least, %6.3f mean  (%u of %u clusters hidden, %llu px)\n", name, px,
           fraction ? "whole" : "4 thin", least, sum / rounds, stats.hidden_clusters, stats.clusters,
           (unsigned long long)stats.pixels);
    free(depth);
    leaf_canvas_finish(&canvas);
    leaf_picture_finish(&ground);
}

static void bench(const char *name, struct sv_tree_mesh *mesh)
{
    struct sv_vec3 at = leaf_fixture_middle();
    struct sv_tree tree = {.x = at.x, .y = at.y, .z = at.z, .height_m = 20, .rotation_rad = 0.7f};
    struct leaf_fixture f;
    double start = now_ms();
    struct sv_leaf_form form;
    struct sv_error error;
    must(sv_leaf_form_init(mesh, &form, &error), &error);
    double ms = now_ms() - start;
    printf("%-10s %u triangles, %u leaves in %u clusters, %.1f MB, made in %.1f ms, area %.2e\n", name,
           mesh->index_count / 3, form.leaf_count, form.cluster_count, (double)form.bytes / 1e6, ms,
           (double)form.leaf_area);
    sv_leaf_form_finish(&form);
    leaf_fixture_init(&f, mesh, 1, &tree, 1);
    const char *wish = getenv("BENCH_PX");
    static const double sizes[] = {30, 60, 120, 200, 250, 500, 1000};
    for (size_t k = 0; k < sizeof sizes / sizeof *sizes; k++)
        if (!wish || atof(wish) == sizes[k]) {
            const float all = 1;
            time_it(&f, name, sizes[k], &all, 1);
            time_it(&f, name, sizes[k], NULL, 4);
            if (!getenv("BENCH_TIME"))
                measure(&f, name, sizes[k]);
        }
    leaf_fixture_finish(&f);
    sv_tree_mesh_finish(mesh);
}

/* 20 trees of five species side by side, `px` tall in a picture of 512 x 512: leaf splats, polygons, rays. */
static void edge(uint32_t leaves, double px)
{
    struct sv_error error;
    struct sv_tree_mesh meshes[SV_HABIT_COUNT];
    struct sv_tree trees[20];
    struct sv_rng rng = sv_rng_seeded(3, 3);
    struct sv_vec3 at = leaf_fixture_middle();
    struct sv_leaf_view view = view_of(px);
    view.camera.width = view.camera.height = 512;
    view.camera.vfov_rad = sv_radians(60);
    double distance = 0.5 * 512 / tan(sv_radians(30)) * 20 / px;
    view.camera.eye = sv_add(at, sv_vec3(0, -distance, 8));
    for (int k = 0; k < SV_HABIT_COUNT; k++)
        must(sv_tree_grow((enum sv_habit)k, leaves, (uint64_t)k + 1, &meshes[k], &error), &error);
    for (int k = 0; k < 20; k++)
        trees[k] = (struct sv_tree){.x = at.x + (k - 9.5) * distance / 20 + sv_rng_range(&rng, -1, 1),
                                    .y = at.y + sv_rng_range(&rng, -4, 4),
                                    .z = at.z,
                                    .height_m = (float)sv_rng_range(&rng, 17, 21),
                                    .rotation_rad = (float)sv_rng_range(&rng, 0, 6.28),
                                    .species = (uint16_t)(k % SV_HABIT_COUNT)};
    struct leaf_fixture f;
    leaf_fixture_init(&f, meshes, SV_HABIT_COUNT, trees, 20);
    leaf_fixture_sort(&f, &view.camera);
    struct sv_truth_picture ground, one;
    double start = now_ms();
    leaf_fixture_truth(&f, &view, 1, false, false, &ground);
    double bare_ms = now_ms() - start;
    start = now_ms();
    leaf_fixture_truth(&f, &view, 1, true, false, &one);
    double rays_ms = now_ms() - start - bare_ms;
    printf("20 trees   %5.0f px  rays + %.1f ms  polygons %.1f ms", px, rays_ms,
           polygons_ms(&f, SV_HABIT_COUNT, &view));
    for (int samples = 1; samples <= 8; samples *= 2) {
        double least = INFINITY;
        for (int k = 0; k < ROUNDS; k++) {
            struct sv_canvas canvas = leaf_canvas(&ground, &view.camera), shown = canvas;
            shown.id = NULL;
            shown.normal = NULL;
            struct sv_leaf_splat_trees list = {.trees = f.scene->forest.trees,
                                               .entries = f.entries,
                                               .count = 20,
                                               .samples = samples,
                                               .id_first = SV_ID_TREE_FIRST};
            start = now_ms();
            must(sv_leaf_splat_draw(f.splat, &view, &shown, &list, NULL, &error), &error);
            least = fmin(least, now_ms() - start);
            if (k == 0 && samples == 4) {
                struct sv_image image = {512, 512, 4, SV_PIXEL_U8, canvas.color};
                char name[64];
                snprintf(name, sizeof name, "edge-%04.0f", px);
                kit_keep(&image, name);
            }
            leaf_canvas_finish(&canvas);
        }
        printf("  leaves %d x %.2f ms", samples, least);
    }
    printf("\n");
    leaf_picture_finish(&ground);
    leaf_picture_finish(&one);
    leaf_fixture_finish(&f);
    for (int k = 0; k < SV_HABIT_COUNT; k++)
        sv_tree_mesh_finish(&meshes[k]);
}

int main(int argc, char **argv)
{
    struct sv_gl_context *gl;
    uint32_t leaves = argc > 1 ? (uint32_t)atoi(argv[1]) : 38952;
    struct sv_error error = {0};
    struct sv_tree_mesh mesh;
    must(sv_gl_context_create(&gl, &error), &error);
    for (int px = 50; px <= 400 && leaves && !getenv("BENCH_PX"); px *= 2)
        edge(leaves, px);
    for (int k = 0; k < SV_HABIT_COUNT && leaves; k++) {
        if (getenv("BENCH_HABIT") && atoi(getenv("BENCH_HABIT")) != k)
            continue;
        must(sv_tree_grow((enum sv_habit)k, leaves, (uint64_t)k + 1, &mesh, &error), &error);
        bench(sv_habit_name((enum sv_habit)k), &mesh);
    }
    for (int k = 2; k < argc; k++) {
        struct sv_errors notes = {0};
        must(sv_tree_import(argv[k], &mesh, &notes, &error), &error);
        const char *name = strrchr(argv[k], '/') ? strrchr(argv[k], '/') + 1 : argv[k];
        char shown[32];
        snprintf(shown, sizeof shown, "%.10s", name);
        bench(shown, &mesh);
    }
    sv_gl_context_destroy(gl);
    return 0;
}
