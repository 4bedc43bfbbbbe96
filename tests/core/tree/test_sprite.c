/* test_sprite.c - far trees on the CPU: closed forms, both kernels, and the odd cases. (Against polygons:
 * test_impostor.c.) */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/mman.h>

#include <cmocka.h>

#include "core/base/color.h"
#include "core/base/frames.h"
#include "core/base/rng.h"
#include "core/base/simd.h"
#include "core/scene/id.h"
#include "core/tree/sprite_private.h"
#include "draw_fixture.h"

static struct sv_gl_context *context;
static struct sv_tree_mesh leafy, bare;
static struct sv_tree_draw_species species[3];
static struct sv_sprite_draw *draw;

static int setup(void **state)
{
    (void)state;
    struct sv_error error;
    sv_color_init();
    fixture_ok(sv_gl_context_create(&context, &error), &error);
    fixture_tree(4000, 7, &leafy);
    fixture_tree(0, 7, &bare);
    species[0] = (struct sv_tree_draw_species){&leafy, 1, 1};
    species[1] = (struct sv_tree_draw_species){&bare, 2, 1};
    species[2] = (struct sv_tree_draw_species){&leafy, 3, 0};
    fixture_ok(sv_sprite_draw_create(species, 3, NULL, &draw, &error), &error);
    return 0;
}

static int teardown(void **state)
{
    (void)state;
    sv_sprite_draw_destroy(draw);
    sv_tree_mesh_finish(&leafy);
    sv_tree_mesh_finish(&bare);
    sv_gl_context_destroy(context);
    return 0;
}

/* ---- a canvas whose planes end at pages that may not be touched ---- */

struct plane {
    unsigned char *block, *data;
    size_t whole;
};

static struct plane plane_make(size_t bytes)
{
    const size_t page = 4096;
    size_t room = (bytes + page - 1) / page * page;
    struct plane p = {.whole = room + page};
    p.block = mmap(NULL, p.whole, PROT_READ | PROT_WRITE, MAP_PRIVATE | MAP_ANONYMOUS, -1, 0);
    assert_true(p.block != MAP_FAILED);
    assert_int_equal(mprotect(p.block + room, page, PROT_NONE), 0);
    p.data = p.block + (room - bytes); /* bytes is a multiple of 4 */
    return p;
}

struct paper {
    struct sv_canvas canvas;
    struct plane depth, color, id, normal;
};

static void paper_make(struct paper *p, int width, int height, int row_first, int row_count, bool hard)
{
    size_t n = (size_t)width * (size_t)row_count;
    p->depth = plane_make(4 * n);
    p->color = plane_make(4 * n);
    p->id = plane_make(4 * n);
    p->normal = plane_make(12 * n);
    p->canvas = (struct sv_canvas){.width = width,
                                   .height = height,
                                   .row_first = row_first,
                                   .row_count = row_count,
                                   .depth = (float *)p->depth.data,
                                   .color = p->color.data,
                                   .id = hard ? (uint32_t *)p->id.data : NULL,
                                   .normal = hard ? (float *)p->normal.data : NULL};
}

static void paper_free(struct paper *p)
{
    struct plane *all[] = {&p->depth, &p->color, &p->id, &p->normal};
    for (int k = 0; k < 4; k++)
        munmap(all[k]->block, all[k]->whole);
}

static bool paper_equal(const struct paper *a, const struct paper *b)
{
    size_t n = (size_t)a->canvas.width * (size_t)a->canvas.row_count;
    return !memcmp(a->depth.data, b->depth.data, 4 * n) && !memcmp(a->color.data, b->color.data, 4 * n) &&
           !memcmp(a->id.data, b->id.data, 4 * n) && !memcmp(a->normal.data, b->normal.data, 12 * n);
}

/* ---- drawing ---- */

static struct sv_cull_entry *sorted(const struct sv_camera *camera, const struct sv_tree *trees,
                                    uint32_t count)
{
    struct sv_cull_entry *both = malloc(2 * ((size_t)count + 1) * sizeof *both), *out;
    assert_non_null(both);
    for (uint32_t k = 0; k < count; k++)
        both[k] = (struct sv_cull_entry){sv_cull_order_code((float)sv_cull_distance_m(camera, &trees[k])), k};
    out = sv_cull_sort(both, both + count, count);
    if (out != both)
        memmove(both, out, count * sizeof *both);
    return both;
}

static void draw_trees(const struct sv_camera *camera, const struct sv_light *light,
                       const struct sv_tree *trees, uint32_t count, const float *shares,
                       struct sv_tree_lights lights, const struct sv_canvas *canvas)
{
    struct sv_error error;
    struct sv_cull_entry *entries = sorted(camera, trees, count);
    struct sv_sprite_view view = {.camera = camera, .light = light};
    struct sv_sprite_list list = {.entries = entries, .shares = shares, .count = count};
    fixture_ok(sv_sprite_draw_trees(draw, &view, canvas, trees, &list, lights, &error), &error);
    free(entries);
}

static const struct sv_tree_lights sunny = {NULL, NULL};
static const struct sv_tree lone = {
    .x = 1000, .y = 2000, .z = 300, .height_m = 15, .rotation_rad = 0.7f, .number = 5};

static void random_trees(struct sv_tree *trees, uint32_t count, double spread, uint64_t seed)
{
    struct sv_rng rng = sv_rng_seeded(seed, 5);
    for (uint32_t k = 0; k < count; k++)
        trees[k] = (struct sv_tree){.x = 1000 + sv_rng_range(&rng, -spread, spread),
                                    .y = 2000 + sv_rng_range(&rng, -spread, spread),
                                    .z = 300 + sv_rng_range(&rng, 0, 5),
                                    .height_m = (float)sv_rng_range(&rng, 1, 20),
                                    .rotation_rad = (float)sv_rng_range(&rng, 0, 6.28),
                                    .species = (uint16_t)(sv_rng_next(&rng) % 4 == 0),
                                    .number = k};
}

/* A picture of coverage: alpha of a tree over nothing. */
static void coverage(const struct sv_camera *camera, const struct sv_tree *trees, uint32_t count,
                     const float *shares, struct paper *p)
{
    struct sv_light light = fixture_light(130, 40);
    paper_make(p, camera->width, camera->height, 0, camera->height, false);
    draw_trees(camera, &light, trees, count, shares, sunny, &p->canvas);
}

static double sum_alpha(const struct paper *p)
{
    double sum = 0;
    size_t n = (size_t)p->canvas.width * (size_t)p->canvas.row_count;
    for (size_t k = 0; k < n; k++)
        sum += p->canvas.color[4 * k + 3] / 255.0;
    return sum;
}

/* ---- the atlas ---- */

static void bytes_come_back(void **state)
{
    (void)state;
    struct sv_sprite_atlas *a = calloc(2, sizeof *a), *b = a + 1;
    struct sv_error error;
    void *data;
    size_t bytes;
    fixture_ok(sv_sprite_atlas_bake(&bare, a, &error), &error);
    fixture_ok(sv_sprite_atlas_save(a, &data, &bytes, &error), &error);
    fixture_ok(sv_sprite_atlas_load(data, bytes, b, &error), &error);
    assert_memory_equal(a->frames, b->frames, sizeof a->frames);
    assert_int_equal(a->texel_count, b->texel_count);
    assert_memory_equal(a->texels, b->texels, a->texel_count * sizeof *a->texels);
    assert_memory_equal(a->smooth, b->smooth, a->smooth_count * sizeof *a->smooth);
    sv_sprite_atlas_finish(b);
    assert_int_equal(sv_sprite_atlas_load(data, bytes - 1, b, &error), SV_EFORMAT);
    assert_int_equal(sv_sprite_atlas_load(data, 0, b, &error), SV_EFORMAT);
    /* A level that leaves its array. */
    unsigned char *p = data;
    size_t at = sizeof(struct sv_sprite_frame) - SV_SPRITE_LEVELS * sizeof(struct sv_sprite_level) + 32;
    memset(p + at, 0xFF, 4);
    assert_int_equal(sv_sprite_atlas_load(data, bytes, b, &error), SV_EFORMAT);
    free(data);
    sv_sprite_atlas_finish(a);
    free(a);
}

static double level_coverage(const struct sv_sprite_atlas *atlas, int frame, int level)
{
    const struct sv_sprite_level *l = &atlas->frames[frame].level[level];
    double sum = 0;
    for (int k = 0; k < (l->width + 2) * (l->height + 2); k++)
        sum += atlas->texels[l->texel_first + (uint32_t)k].coverage / 255.0;
    return sum * exp2(2 * level); /* texels of level 0 */
}

/* Every level covers what level 0 does: 8 bits round off at most half a step a texel that is covered in part,
 * as likely up as down. */
static void levels_keep_coverage(void **state)
{
    (void)state;
    struct sv_sprite_atlas *atlas = calloc(1, sizeof *atlas);
    struct sv_error error;
    fixture_ok(sv_sprite_atlas_bake(&leafy, atlas, &error), &error);
    for (int f = 0; f < SV_IMPOSTOR_FRAMES; f++) {
        double first = level_coverage(atlas, f, 0);
        assert_true(first > 0.02 * SV_SPRITE_CELL * SV_SPRITE_CELL);
        for (int k = 1; k < SV_SPRITE_LEVELS; k++) {
            double half_step =
                0.5 / 255 * exp2(2 * k) *
                sqrt((double)atlas->frames[f].level[k].width * atlas->frames[f].level[k].height);
            assert_true(fabs(level_coverage(atlas, f, k) - first) < 3 * half_step + 0.001 * first);
        }
    }
    sv_sprite_atlas_finish(atlas);
    free(atlas);
}

/* ---- both kernels ---- */

static void fill(struct paper *p, const struct sv_camera *camera, uint64_t seed)
{
    struct sv_rng rng = sv_rng_seeded(seed, 9);
    size_t n = (size_t)p->canvas.width * (size_t)p->canvas.row_count;
    bool ortho = camera->projection == SV_PROJECTION_ORTHOGRAPHIC;
    for (size_t k = 0; k < n; k++) {
        double z = sv_rng_range(&rng, 20, 200);
        uint64_t r = sv_rng_next(&rng);
        p->canvas.depth[k] = r % 3 == 0 ? 0
                             : ortho    ? (float)((camera->far_m - z) / camera->far_m)
                                        : (float)(camera->near_m / z);
        for (int c = 0; c < 4; c++)
            p->canvas.color[4 * k + (size_t)c] = (uint8_t)(r >> (8 + 8 * c));
    }
}

static void twins(const struct sv_camera *camera, const struct sv_tree *trees, uint32_t count, bool air,
                  const struct sv_tree_lights lights)
{
    struct sv_light light = fixture_light(200, 25);
    struct paper a, b;
    light.air = air;
    light.air_length_m = 400;
    paper_make(&a, camera->width, camera->height, 0, camera->height, true);
    paper_make(&b, camera->width, camera->height, 0, camera->height, true);
    fill(&a, camera, 3);
    fill(&b, camera, 3);
    sv_sprite_draw_use(draw, &sv_sprite_scalar);
    draw_trees(camera, &light, trees, count, NULL, lights, &a.canvas);
    sv_sprite_draw_use(draw, &sv_sprite_avx2);
    draw_trees(camera, &light, trees, count, NULL, lights, &b.canvas);
    assert_true(paper_equal(&a, &b));
    paper_free(&a);
    paper_free(&b);
}

static void kernels_are_equal(void **state)
{
    (void)state;
    if (sv_simd_level() < SV_SIMD_AVX2)
        skip();
    enum { N = 120 };
    struct sv_tree trees[N];
    struct sv_tree_light light[N];
    struct sv_rng rng = sv_rng_seeded(4, 4);
    const struct sv_tree_light_axes axes[2] = {{{1.5f, 0.3f, 0.1f, 0.5f}, {0.2f, -0.4f, 3, 0.1f}},
                                               {{-1, 1, 0, 0.5f}, {0, 0, 4, -0.5f}}};
    static const int sizes[][2] = {{1, 1}, {7, 3}, {8, 32}, {33, 31}, {100, 70}, {16, 16}};
    random_trees(trees, N, 60, 1);
    for (int k = 0; k < N; k++)
        for (int c = 0; c < 8; c++)
            light[k].share[c >> 2][c & 3] = (uint8_t)sv_rng_next(&rng);
    for (size_t k = 0; k < sizeof sizes / sizeof sizes[0]; k++) {
        struct sv_camera c =
            fixture_camera(sv_vec3(1000, 1900, 310), 5, -8 - 3.0 * (double)k, sizes[k][0], sizes[k][1]);
        twins(&c, trees, N, k % 2, sunny);
        twins(&c, trees, N, false, (struct sv_tree_lights){light, axes});
        c.eye = sv_vec3(1000, 2000, 306); /* among them */
        twins(&c, trees, N, false, sunny);
        c.eye = sv_vec3(1000, 1900, 350);
        c.projection = SV_PROJECTION_ORTHOGRAPHIC;
        c.ortho_height_m = 80;
        c.far_m = 500;
        twins(&c, trees, N, false, (struct sv_tree_lights){light, axes});
    }
    sv_sprite_draw_use(draw, &sv_sprite_avx2);
}

/* ---- closed forms ---- */

static struct sv_camera toward_lone(double distance, double elevation_deg, double tree_px, int side)
{
    struct sv_vec3 back = sv_direction(sv_radians(200), sv_radians(elevation_deg));
    struct sv_vec3 middle = sv_vec3(lone.x, lone.y, lone.z + 7.5);
    struct sv_camera c = fixture_camera(sv_madd(middle, back, distance), 20, -elevation_deg, side, side);
    c.vfov_rad = 2 * atan(0.5 * side / (distance * tree_px / 15.0));
    return c;
}

/* The share of a picture that a tree covers goes with the square of its size, down to a hundredth of a pixel;
 * over sub-pixel places, which sampling texels of the pixels' own size makes some percent of. */
static void small_trees_keep_their_share(void **state)
{
    (void)state;
    struct paper p;
    struct sv_camera big = toward_lone(300, 20, 200, 320);
    coverage(&big, &lone, 1, NULL, &p);
    double unit = sum_alpha(&p) / (200.0 * 200.0);
    paper_free(&p);
    static const double sizes[] = {40, 12, 5, 3, 2, 1.3, 1};
    for (size_t k = 0; k < sizeof sizes / sizeof sizes[0]; k++) {
        double sum = 0, side = fmax(sizes[k] * 1.6, 24);
        for (int n = 0; n < 64; n++) {
            struct sv_camera c = toward_lone(300, 20, sizes[k], (int)side);
            double dx, dy;
            sv_camera_sample_offset(64, n, &dx, &dy);
            double m = 15.0 / sizes[k];
            c.eye = sv_madd(sv_madd(c.eye, c.right, m * dx), c.up, m * dy);
            coverage(&c, &lone, 1, NULL, &p);
            sum += sum_alpha(&p) / 64;
            paper_free(&p);
        }
        double share = sum / (unit * sizes[k] * sizes[k]);
        printf("tree of %5.2f px: share %.3f\n", sizes[k], share);
        /* 8-bit alpha of a pixel is off by up to half a step; edges of 1.3 px hold few steps. */
        assert_true(fabs(share - 1) < 0.08);
    }
    /* Far below: thousands of trees of a hundredth of a pixel's side, alpha of their sum. */
    enum { N = 20000 };
    struct sv_tree *trees = malloc(N * sizeof *trees);
    struct sv_rng rng = sv_rng_seeded(1, 1);
    struct sv_camera c = toward_lone(3000, 20, 0.05, 32);
    for (int n = 0; n < N; n++) {
        trees[n] = lone;
        struct sv_vec3 at = sv_vec3(lone.x, lone.y, lone.z);
        at = sv_madd(at, c.right, sv_rng_range(&rng, -2000, 2000));
        at = sv_madd(at, c.up, sv_rng_range(&rng, -2000, 2000));
        trees[n].x = at.x;
        trees[n].y = at.y;
        trees[n].z = at.z;
    }
    coverage(&c, trees, N, NULL, &p);
    double want = N * unit * 0.05 * 0.05 / (13.3 * 13.3); /* of each pixel of a square of 13.3 px a side */
    double inside = 0;
    for (int j = 12; j < 20; j++)
        for (int i = 12; i < 20; i++)
            inside += p.canvas.color[4 * (j * 32 + i) + 3] / 255.0 / 64;
    printf("trees of 0.05 px: %.4f of %.4f\n", inside, 1 - exp(-want));
    assert_true(fabs(inside - (1 - exp(-want))) < 0.1 * want + 0.5 / 255);
    paper_free(&p);
    free(trees);
}

/* Of two trees in a line, what both cover together is 1 - (1 - a)(1 - b), whatever the order they are given
 * in. */
static void transmittance_multiplies(void **state)
{
    (void)state;
    struct sv_camera c = toward_lone(120, 10, 90, 128);
    struct sv_tree two[2] = {lone, lone};
    two[1].x += 30 * sin(sv_radians(20)) + 1;
    two[1].y += 30 * cos(sv_radians(20));
    two[1].rotation_rad = 3;
    struct paper a, b, both, other;
    coverage(&c, &two[0], 1, NULL, &a);
    coverage(&c, &two[1], 1, NULL, &b);
    coverage(&c, two, 2, NULL, &both);
    const struct sv_tree turned[2] = {two[1], two[0]};
    coverage(&c, turned, 2, NULL, &other);
    assert_memory_equal(both.canvas.color, other.canvas.color, 4 * 128 * 128);
    int covered = 0;
    for (int k = 3; k < 4 * 128 * 128; k += 4) {
        double pa = a.canvas.color[k] / 255.0, pb = b.canvas.color[k] / 255.0;
        double want = 255 * (1 - (1 - pa) * (1 - pb)), pass = (1 - pa) * (1 - pb);
        covered += pa > 0.1 && pb > 0.1;
        /* Three roundings to 8 bits; below SV_SPRITE_PASS_MIN a pixel is closed. */
        double allowed = pass < 1.1 * (double)SV_SPRITE_PASS_MIN ? 255 * (double)SV_SPRITE_PASS_MIN + 2 : 2;
        assert_true(fabs(both.canvas.color[k] - want) <= allowed);
    }
    assert_true(covered > 500);
    paper_free(&a);
    paper_free(&b);
    paper_free(&both);
    paper_free(&other);
}

/* What passes a share of the tree's leaves is what passes all of them, to that power. */
static void shares_thin_out(void **state)
{
    (void)state;
    struct sv_camera c = toward_lone(120, 10, 90, 128);
    struct paper whole, part, none;
    const float quarter = 0.25f, zero = 0;
    coverage(&c, &lone, 1, NULL, &whole);
    coverage(&c, &lone, 1, &quarter, &part);
    coverage(&c, &lone, 1, &zero, &none);
    assert_true(sum_alpha(&none) == 0);
    int half = 0;
    for (int k = 3; k < 4 * 128 * 128; k += 4) {
        int all = whole.canvas.color[k], some = part.canvas.color[k];
        double least = 255 * (1 - pow(1 - fmax(all - 1, 0) / 255, 0.25));
        double most = 255 * (1 - pow(1 - fmin(all + 1, 255) / 255, 0.25));
        half += all > 100 && all < 200;
        if (all < 240) /* else closed: up to 1/32 more */
            assert_true(some >= least - 1 && some <= most + 1);
        else
            assert_true(some >= 255 * (1 - pow(15.0 / 255, 0.25)) - 1 &&
                        some <= 255 * (1 - pow(0.75 / 16, 0.25)) + 1);
    }
    assert_true(half > 100);
    paper_free(&whole);
    paper_free(&part);
    paper_free(&none);
}

/* Opaque depth hides what lies behind: a wall through the middle of the picture. */
static void depth_hides(void **state)
{
    (void)state;
    struct sv_camera c = toward_lone(120, 10, 90, 128);
    struct sv_light light = fixture_light(130, 40);
    struct paper open, wall;
    coverage(&c, &lone, 1, NULL, &open);
    paper_make(&wall, 128, 128, 0, 128, false);
    for (int k = 0; k < 128 * 128; k++)
        wall.canvas.depth[k] = (float)(c.near_m / (k % 128 < 64 ? 100 : 140));
    draw_trees(&c, &light, &lone, 1, NULL, sunny, &wall.canvas);
    for (int k = 0; k < 128 * 128; k++)
        for (int n = 0; n < 4; n++)
            assert_int_equal(wall.canvas.color[4 * k + n], k % 128 < 64 ? 0 : open.canvas.color[4 * k + n]);
    assert_true(sum_alpha(&wall) > 300);
    paper_free(&open);
    paper_free(&wall);
}

/* Bands of a picture are the picture. */
static void bands_join(void **state)
{
    (void)state;
    enum { N = 60, W = 90, H = 77 };
    struct sv_tree trees[N];
    struct sv_light light = fixture_light(130, 40);
    struct sv_camera c = fixture_camera(sv_vec3(1000, 1930, 312), 2, -10, W, H);
    struct paper whole, band;
    random_trees(trees, N, 50, 2);
    paper_make(&whole, W, H, 0, H, true);
    draw_trees(&c, &light, trees, N, NULL, sunny, &whole.canvas);
    static const int rows[] = {0, 1, 20, 52, 77};
    for (int k = 0; k < 4; k++) {
        int count = rows[k + 1] - rows[k];
        size_t at = (size_t)rows[k] * W;
        paper_make(&band, W, H, rows[k], count, true);
        draw_trees(&c, &light, trees, N, NULL, sunny, &band.canvas);
        assert_memory_equal(band.canvas.color, whole.canvas.color + 4 * at, 4 * (size_t)count * W);
        assert_memory_equal(band.canvas.id, whole.canvas.id + at, 4 * (size_t)count * W);
        assert_memory_equal(band.canvas.depth, whole.canvas.depth + at, 4 * (size_t)count * W);
        paper_free(&band);
    }
    paper_free(&whole);
}

/* Where the crown is thick, id and normal are the tree's, depth is that of the place; elsewhere nothing
 * changes. */
static void hard_layers(void **state)
{
    (void)state;
    struct sv_camera c = toward_lone(120, 10, 90, 128);
    struct sv_light light = fixture_light(130, 40);
    struct paper p;
    paper_make(&p, 128, 128, 0, 128, true);
    draw_trees(&c, &light, &lone, 1, NULL, sunny, &p.canvas);
    int hit = 0;
    for (int k = 0; k < 128 * 128; k++) {
        const float *n = p.canvas.normal + 3 * k;
        bool half = p.canvas.color[4 * k + 3] >= 129, less = p.canvas.color[4 * k + 3] <= 126;
        if (half) {
            double z = c.near_m / (double)p.canvas.depth[k];
            assert_int_equal(p.canvas.id[k], SV_ID_TREE_FIRST + lone.number);
            assert_true(fabsf(n[0] * n[0] + n[1] * n[1] + n[2] * n[2] - 1) < 1e-4f);
            assert_true(z > 108 && z < 132);
            hit++;
        } else if (less) {
            assert_true(p.canvas.id[k] == 0 && p.canvas.depth[k] == 0 && n[0] == 0);
        }
    }
    assert_true(hit > 1000);
    paper_free(&p);
}

/* ---- no popping ---- */

/* A viewer who goes round a tree by steps of half a degree sees no step that is much larger than the others:
 * the change of a frame is spread over several. */
static void frames_change_unseen(void **state)
{
    (void)state;
    enum { STEPS = 80, SIDE = 128 };
    struct paper before, now;
    struct sv_light light = fixture_light(130, 40);
    double change[STEPS], sum = 0, worst = 0;
    for (int k = 0; k <= STEPS; k++) {
        double azimuth = 0.5 * k;
        struct sv_vec3 back = sv_direction(sv_radians(azimuth + 180), sv_radians(12));
        struct sv_camera c = fixture_camera(sv_madd(sv_vec3(lone.x, lone.y, lone.z + 7.5), back, 100),
                                            azimuth, -12, SIDE, SIDE);
        c.vfov_rad = 2 * atan(0.5 * SIDE / (100 * 90 / 15.0));
        paper_make(&now, SIDE, SIDE, 0, SIDE, false);
        draw_trees(&c, &light, &lone, 1, NULL, sunny, &now.canvas);
        if (k > 0) {
            change[k - 1] = 0;
            for (int i = 0; i < 4 * SIDE * SIDE; i++)
                change[k - 1] += fabs((double)now.canvas.color[i] - before.canvas.color[i]);
            sum += change[k - 1];
            worst = fmax(worst, change[k - 1]);
            paper_free(&before);
        }
        before = now;
    }
    paper_free(&before);
    printf("largest change between views: %.2f of the mean\n", worst * STEPS / sum);
    assert_true(sum > 0 && worst * STEPS / sum < 2.5);
}

/* ---- the odd cases ---- */

static void extremes(void **state)
{
    (void)state;
    enum { N = 40 };
    struct sv_tree trees[N];
    struct sv_light light = fixture_light(130, 40);
    static const float heights[] = {0.1f, 120, 15};
    static const double fields[] = {1, 60, 150};
    random_trees(trees, N, 30, 6);
    for (int h = 0; h < 3; h++)
        for (int f = 0; f < 3; f++)
            for (int e = 0; e < 4; e++) {
                static const double eyes[4][3] = {
                    {1000, 2000, 308}, {1000, 1900, 310}, {1000, 2000, 400}, {0, 0, 0}};
                struct sv_camera c = fixture_camera(sv_vec3(eyes[e][0], eyes[e][1], eyes[e][2]),
                                                    10 + 80.0 * e, e == 2 ? -90 : -5, 16, 16);
                c.vfov_rad = sv_radians(fields[f]);
                for (int k = 0; k < N; k++)
                    trees[k].height_m = heights[h];
                trees[0].x = c.eye.x; /* the eye in a crown's middle, and one on the stem */
                trees[0].y = c.eye.y;
                trees[0].z = c.eye.z - 0.5 * (double)heights[h];
                struct paper p;
                paper_make(&p, 16, 16, 0, 16, true);
                draw_trees(&c, &light, trees, N, NULL, sunny, &p.canvas);
                for (int k = 0; k < 256; k++) {
                    assert_true(p.canvas.depth[k] >= 0 && p.canvas.depth[k] < INFINITY);
                    for (int n = 0; n < 3; n++)
                        assert_true(fabsf(p.canvas.normal[3 * k + n]) <= 1.001f);
                }
                paper_free(&p);
            }
}

static void large_pictures(void **state)
{
    (void)state;
    struct sv_camera c = fixture_camera(sv_vec3(1000, 1900, 310), 0, -5, 4096, 4096);
    struct sv_light light = fixture_light(130, 40);
    struct sv_tree trees[30];
    struct paper p;
    random_trees(trees, 30, 40, 8);
    paper_make(&p, 4096, 4096, 0, 4096, false);
    draw_trees(&c, &light, trees, 30, NULL, sunny, &p.canvas);
    double big = sum_alpha(&p);
    paper_free(&p);
    c.width = c.height = 256;
    paper_make(&p, 256, 256, 0, 256, false);
    draw_trees(&c, &light, trees, 30, NULL, sunny, &p.canvas);
    assert_true(fabs(big / (sum_alpha(&p) * 256) - 1) < 0.03);
    paper_free(&p);
}

static void nothing_to_draw(void **state)
{
    (void)state;
    struct sv_camera c = toward_lone(120, 10, 90, 32);
    struct sv_light light = fixture_light(130, 40);
    struct sv_error error;
    struct sv_tree behind = lone, unbuilt = lone, unknown = lone;
    struct paper p;
    behind.x += 2 * (c.eye.x - lone.x);
    behind.y += 2 * (c.eye.y - lone.y);
    unbuilt.species = 2;
    unknown.species = 9;
    const struct sv_tree none[3] = {behind, unbuilt, unknown};
    paper_make(&p, 32, 32, 0, 32, true);
    draw_trees(&c, &light, none, 0, NULL, sunny, &p.canvas);
    draw_trees(&c, &light, none, 3, NULL, sunny, &p.canvas);
    assert_true(sum_alpha(&p) == 0);
    struct sv_sprite_view view = {.camera = &c, .light = &light};
    struct sv_sprite_list list = {.count = 0};
    p.canvas.width = 31;
    assert_int_equal(sv_sprite_draw_trees(draw, &view, &p.canvas, none, &list, sunny, &error), SV_EINVAL);
    paper_free(&p);
    assert_int_equal(sv_sprite_draw_bytes(draw, 2), 0);
    assert_null(sv_sprite_draw_shade_species(draw, 2).frames);
    assert_true(sv_sprite_draw_bytes(draw, 0) < 50u << 20);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(bytes_come_back),
        cmocka_unit_test(levels_keep_coverage),
        cmocka_unit_test(kernels_are_equal),
        cmocka_unit_test(small_trees_keep_their_share),
        cmocka_unit_test(transmittance_multiplies),
        cmocka_unit_test(shares_thin_out),
        cmocka_unit_test(depth_hides),
        cmocka_unit_test(bands_join),
        cmocka_unit_test(hard_layers),
        cmocka_unit_test(frames_change_unseen),
        cmocka_unit_test(extremes),
        cmocka_unit_test(large_pictures),
        cmocka_unit_test(nothing_to_draw),
    };
    return cmocka_run_group_tests(tests, setup, teardown);
}
