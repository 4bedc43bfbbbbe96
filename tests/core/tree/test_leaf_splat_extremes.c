/* test_leaf_splat_extremes.c - leaf splats where pictures end: every SIMD level draws the same bytes; nothing
 * is read or written outside of the canvas; eyes in crowns, views of 1 and 150 degrees, small and large
 * pictures and trees, broken texture coordinates, sheets, wood alone. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <math.h>
#include <sys/mman.h>
#include <unistd.h>
#include <cmocka.h>

#include "core/base/rng.h"
#include "core/scene/id.h"
#include "core/tree/grow.h"
#include "core/tree/leaf_kernel.h"
#include "tests/core/tree/draw_fixture.h"

enum { SPECIES = 4, TREES = 12 };

static struct sv_tree_mesh meshes[SPECIES];
static struct sv_tree_draw_species species[SPECIES];
static struct sv_leaf_splat *splat;
static struct sv_tree_light lights[TREES];
static struct sv_tree_light_axes axes[SPECIES];

/* Broadleaf; palm; a handmade tree with a texture of 32 x 32 and odd coordinates; bare wood. */
static int make(void **state)
{
    (void)state;
    struct sv_error error;
    fixture_ok(sv_tree_grow(SV_HABIT_BROADLEAF, 900, 1, &meshes[0], &error), &error);
    fixture_ok(sv_tree_grow(SV_HABIT_PALM, 700, 2, &meshes[1], &error), &error);
    fixture_tree(300, 3, &meshes[2]);
    fixture_ok(sv_tree_grow(SV_HABIT_CONIFER, 0, 4, &meshes[3], &error), &error);
    struct sv_rng rng = sv_rng_seeded(5, 5);
    for (uint32_t v = 0; v < meshes[2].vertex_count; v++) {
        static const float odd[] = {1e6f, -1e6f, -3.25f, 1e-40f, NAN, INFINITY};
        if (v % 7 == 0)
            meshes[2].vertices[v].uv[v % 2] = odd[v / 7 % 6];
    }
    for (int k = 0; k < SPECIES; k++)
        species[k] = (struct sv_tree_draw_species){&meshes[k], (uint64_t)k, 3};
    for (int k = 0; k < TREES; k++)
        for (int i = 0; i < 8; i++)
            lights[k].share[i / 4][i % 4] = (uint8_t)sv_rng_range(&rng, 0, 256);
    for (int k = 0; k < SPECIES; k++)
        axes[k] = (struct sv_tree_light_axes){{1.2f, 0.7f, 0, 0.5f}, {0.4f, -0.5f, 3.1f, -0.4f}};
    return sv_leaf_splat_create(species, SPECIES, &splat, &error);
}

static int unmake(void **state)
{
    (void)state;
    sv_leaf_splat_destroy(splat);
    for (int k = 0; k < SPECIES; k++)
        sv_tree_mesh_finish(&meshes[k]);
    return 0;
}

/* Pages without access on both sides; the block ends (or begins) at one. */
struct guarded {
    uint8_t *map, *data;
    size_t bytes, mapped;
};

static struct guarded guarded(size_t bytes, bool at_end)
{
    size_t page = (size_t)sysconf(_SC_PAGESIZE), inside = (bytes + page - 1) / page * page;
    struct guarded g = {.bytes = bytes, .mapped = inside + 2 * page};
    g.map = mmap(NULL, g.mapped, PROT_NONE, MAP_PRIVATE | MAP_ANONYMOUS, -1, 0);
    assert_ptr_not_equal(g.map, MAP_FAILED);
    assert_int_equal(mprotect(g.map + page, inside, PROT_READ | PROT_WRITE), 0);
    g.data = g.map + page + (at_end ? inside - bytes : 0);
    return g;
}

struct picture {
    struct guarded depth, color, id, normal;
    struct sv_canvas canvas;
};

static struct picture picture_of(const struct sv_camera *camera, bool at_end)
{
    size_t n = (size_t)camera->width * (size_t)camera->height;
    struct picture p = {
        guarded(4 * n, at_end), guarded(4 * n, at_end), guarded(4 * n, at_end), guarded(12 * n, at_end), {0}};
    p.canvas = (struct sv_canvas){.width = camera->width,
                                  .height = camera->height,
                                  .row_count = camera->height,
                                  .depth = (float *)(void *)p.depth.data,
                                  .color = p.color.data,
                                  .id = (uint32_t *)(void *)p.id.data,
                                  .normal = (float *)(void *)p.normal.data};
    return p;
}

static void picture_finish(struct picture *p)
{
    munmap(p->depth.map, p->depth.mapped);
    munmap(p->color.map, p->color.mapped);
    munmap(p->id.map, p->id.mapped);
    munmap(p->normal.map, p->normal.mapped);
}

struct scene {
    struct sv_tree trees[TREES];
    struct sv_cull_entry entries[TREES];
    float fraction[TREES], weight[TREES];
    struct sv_leaf_splat_trees list;
};

static void scene_init(struct scene *s, uint64_t seed, double height_m, double spread_m)
{
    struct sv_rng rng = sv_rng_seeded(seed, 9);
    for (uint32_t k = 0; k < TREES; k++) {
        s->trees[k] = (struct sv_tree){.x = 300000 + spread_m * sv_rng_range(&rng, -1, 1),
                                       .y = 4e6 + spread_m * sv_rng_range(&rng, -1, 1),
                                       .z = 1000,
                                       .height_m = (float)(height_m * sv_rng_range(&rng, 0.7, 1)),
                                       .rotation_rad = (float)sv_rng_range(&rng, 0, 6.28),
                                       .species = (uint16_t)(k % SPECIES),
                                       .number = k};
        s->entries[k] = (struct sv_cull_entry){k, k};
        s->fraction[k] = (float)sv_rng_range(&rng, 0.1, 1.3);
        s->weight[k] = (float)sv_rng_range(&rng, 0.3, 1.3);
    }
    s->list = (struct sv_leaf_splat_trees){
        .trees = s->trees, .entries = s->entries, .count = TREES, .samples = 1, .id_first = SV_ID_TREE_FIRST};
    if (seed % 3 != 0)
        s->list.fraction = s->fraction;
    if (seed % 4 == 1)
        s->list.weight = s->weight;
    if (seed % 2)
        s->list.lights = (struct sv_tree_lights){lights, axes};
    s->list.level_0 = seed % 5 == 2;
}

static struct sv_leaf_view view_of(double distance, double heading_deg, double fov_deg, int width, int height)
{
    double a = sv_radians(heading_deg);
    struct sv_leaf_view view = {0};
    view.camera = fixture_camera(sv_vec3(300000 - distance * sin(a), 4e6 - distance * cos(a), 1003),
                                 heading_deg, 3, width, height);
    view.camera.vfov_rad = sv_radians(fov_deg);
    view.light = fixture_light(100, 30);
    return view;
}

static void draw(enum sv_simd level, const struct sv_leaf_view *view, const struct sv_leaf_splat_trees *list,
                 struct picture *p, struct sv_leaf_splat_stats *stats)
{
    struct sv_error error;
    struct sv_canvas canvas = p->canvas;
    size_t n = (size_t)canvas.width * (size_t)canvas.height;
    memset(p->depth.data, 0, 4 * n);
    memset(p->color.data, 7, 4 * n);
    memset(p->id.data, 0, 4 * n);
    memset(p->normal.data, 0, 12 * n);
    if (list->samples > 1)
        canvas.id = NULL, canvas.normal = NULL;
    sv_leaf_splat_set_level(splat, level);
    fixture_ok(sv_leaf_splat_draw(splat, view, &canvas, list, stats, &error), &error);
}

/* Depths in 0..1, normals of length 1 where a tree is, nothing written elsewhere. */
static long check(const struct picture *p, int samples)
{
    long shown = 0;
    size_t n = (size_t)p->canvas.width * (size_t)p->canvas.height;
    static const uint8_t bare[4] = {7, 7, 7, 7};
    for (size_t k = 0; k < n; k++) {
        float d = p->canvas.depth[k];
        assert_true(d >= 0 && d <= 1);
        bool tree = samples > 1 ? d > 0 : p->canvas.id[k] != 0;
        shown += tree;
        if (samples > 1)
            continue;
        assert_int_equal(tree, d > 0);
        if (!tree) {
            assert_memory_equal(p->canvas.color + 4 * k, bare, 4);
            continue;
        }
        const float *v = p->canvas.normal + 3 * k;
        assert_true(fabsf(v[0] * v[0] + v[1] * v[1] + v[2] * v[2] - 1) < 1e-4f);
        assert_int_equal(p->canvas.color[4 * k + 3], 255);
        assert_true(p->canvas.id[k] >= SV_ID_TREE_FIRST && p->canvas.id[k] < SV_ID_TREE_FIRST + TREES);
    }
    return shown;
}

static void both_levels(const struct sv_leaf_view *view, struct scene *s, bool at_end, const char *what)
{
    struct picture a = picture_of(&view->camera, at_end), b = picture_of(&view->camera, at_end);
    struct sv_leaf_splat_stats sa, sb;
    for (int samples = 1; samples <= 4; samples *= 4) {
        s->list.samples = samples;
        draw(SV_SIMD_SCALAR, view, &s->list, &a, &sa);
        long shown = check(&a, samples);
        if (sv_simd_level() >= SV_SIMD_AVX2) {
            draw(SV_SIMD_AVX2, view, &s->list, &b, &sb);
            assert_memory_equal(a.depth.data, b.depth.data, a.depth.bytes);
            assert_memory_equal(a.color.data, b.color.data, a.color.bytes);
            assert_memory_equal(a.id.data, b.id.data, a.id.bytes);
            assert_memory_equal(a.normal.data, b.normal.data, a.normal.bytes);
            assert_true(sa.pixels == sb.pixels && sa.trees == sb.trees);
        }
        printf("%-24s %4d x %4d, %d samples: %ld pixels show trees\n", what, view->camera.width,
               view->camera.height, samples, shown);
    }
    picture_finish(&a);
    picture_finish(&b);
}

static void test_levels_agree(void **state)
{
    (void)state;
    for (uint64_t seed = 0; seed < 24; seed++) {
        struct scene s;
        scene_init(&s, seed, 12, 9);
        int width = 40 + (int)(seed * 37 % 150), height = 40 + (int)(seed * 53 % 130);
        static const double distances[] = {1, 4, 12, 30, 120, 600};
        struct sv_leaf_view view = view_of(distances[seed % 6], 15.0 * (double)seed, 60, width, height);
        view.light.air = seed % 3 == 1;
        view.shift_x_px = 0.3 * (double)(seed % 3) - 0.3;
        view.shift_y_px = 0.2 * (double)(seed % 4) - 0.3;
        if (seed % 4 == 3) {
            view.camera.projection = SV_PROJECTION_ORTHOGRAPHIC;
            view.camera.ortho_height_m = 5 + (double)seed;
            view.camera.far_m = 700;
        }
        both_levels(&view, &s, seed % 2, "random");
    }
}

static void test_extremes(void **state)
{
    (void)state;
    struct scene s;
    scene_init(&s, 2, 12, 6);
    struct sv_leaf_view view = view_of(0.5, 40, 60, 97, 61);
    both_levels(&view, &s, true, "eye in a crown");
    for (int k = 0; k < 4; k++) { /* leaves of hundreds of pixels, and long thin wood, at all slants */
        view = view_of(0.3 + 0.4 * k, 80.0 * k, 60, 401, 353);
        both_levels(&view, &s, true, "large pieces");
    }
    view = view_of(0.5, 40, 60, 97, 61);
    view.camera.near_m = 2;
    both_levels(&view, &s, false, "near plane in leaves");
    view = view_of(300, 70, 1, 64, 64);
    sv_camera_aim(&view.camera, sv_radians(70), sv_radians(0.5), 0);
    both_levels(&view, &s, true, "1 degree");
    view = view_of(3, 200, 150, 200, 120);
    both_levels(&view, &s, true, "150 degrees");
    view = view_of(15, 10, 60, 16, 16);
    both_levels(&view, &s, true, "16 x 16");
    view = view_of(15, 10, 60, 1, 1);
    both_levels(&view, &s, true, "one pixel");
    view = view_of(-40, 10, 60, 64, 64);
    both_levels(&view, &s, true, "all behind");
    view = view_of(20, 10, 60, 120, 90);
    view.camera.eye.z = 1030;
    sv_camera_aim(&view.camera, 1, -SV_PI / 2, 0.4);
    both_levels(&view, &s, true, "from above");
    scene_init(&s, 4, 0.1, 0.1);
    view = view_of(0.4, 10, 60, 120, 90);
    view.camera.eye.z = 1000.05;
    both_levels(&view, &s, true, "trees of 0.1 m");
    view = view_of(60, 10, 60, 80, 70);
    both_levels(&view, &s, true, "trees of 0.1 m, far");
    scene_init(&s, 4, 120, 90);
    view = view_of(250, 10, 60, 120, 90);
    both_levels(&view, &s, true, "trees of 120 m");
    view = view_of(50000, 10, 60, 64, 64);
    both_levels(&view, &s, true, "50 km away");
}

/* 64 million bytes of depth: bands of rows, each in its own buffer. */
static void test_large_picture(void **state)
{
    (void)state;
    struct scene s;
    scene_init(&s, 3, 12, 6);
    struct sv_leaf_view view = view_of(9, 30, 60, 4096, 4096);
    struct picture p = picture_of(&view.camera, true);
    struct sv_leaf_splat_stats stats;
    draw(sv_simd_level(), &view, &s.list, &p, &stats);
    long shown = check(&p, 1);
    printf("4096 x 4096: %ld pixels show trees\n", shown);
    assert_true(shown > 1000000);
    picture_finish(&p);
}

/* Pixels that something nearer already holds stay as they are; trees behind a wall are left out. */
static void test_hidden(void **state)
{
    (void)state;
    struct scene s;
    scene_init(&s, 6, 12, 6);
    struct sv_leaf_view view = view_of(30, 0, 60, 128, 128);
    struct picture p = picture_of(&view.camera, true);
    struct sv_error error;
    struct sv_leaf_splat_stats stats;
    for (int k = 0; k < 128 * 128; k++) {
        p.canvas.depth[k] = (float)(view.camera.near_m / 5);
        memset(p.canvas.color + 4 * k, 9, 4);
    }
    fixture_ok(sv_leaf_splat_draw(splat, &view, &p.canvas, &s.list, &stats, &error), &error);
    assert_true(stats.hidden_trees > 0 && stats.trees == 0 && stats.clusters == 0 && stats.pixels == 0);
    for (int k = 0; k < 128 * 128 * 4; k++)
        assert_int_equal(p.canvas.color[k], 9);
    picture_finish(&p);
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(test_levels_agree), cmocka_unit_test(test_extremes),
                                       cmocka_unit_test(test_large_picture), cmocka_unit_test(test_hidden)};
    return cmocka_run_group_tests(tests, make, unmake);
}
