/* test_density.c - density textures: codes by closed form; a hedge whose periods are known; coverage counted
 * pixel by pixel; a tree without leaves; bytes and their breaches. */
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
#include "core/image/dds_file.h"
#include "core/tree/cloud_bake.h"
#include "core/tree/density.h"
#include "tests/core/tree/draw_fixture.h"

enum { TEXELS = SV_DENSITY_WIDTH * SV_DENSITY_HEIGHT };

/* Every period comes back within half a step, evenly spaced and by its logarithm; codes 0 and 255 are kept
 * free. */
static void test_codes(void **state)
{
    (void)state;
    double worst = 0, worst_at_4 = 0, worst_log = 0;
    for (int k = 0; k <= 100000; k++) {
        float w = 3 + 61 * (float)k / 100000;
        uint8_t code = sv_density_code(w, 3, 64), log_code = sv_density_log_code(w, 3, 64);
        assert_true(code >= 1 && code <= 254 && log_code >= 1 && log_code <= 254);
        double off = fabs((double)sv_density_period(code, 3, 64) - (double)w);
        double log_off = fabs(log((double)sv_density_log_period(log_code, 3, 64) / (double)w));
        worst = fmax(worst, off);
        worst_log = fmax(worst_log, log_off);
        if (w >= 4)
            worst_at_4 = fmax(worst_at_4, off / (double)w);
    }
    printf("8 bits over 3 .. 64 px: off by %.3f px, %.2f %% from 4 px on; by logarithm %.2f %%\n", worst,
           100 * worst_at_4, 100 * worst_log);
    assert_true(worst <= 61.0 / 506 * 1.001 && worst_log <= log(64.0 / 3) / 506 * 1.01);
    assert_int_equal(sv_density_code(0, 3, 64), 0);
    assert_int_equal(sv_density_code(NAN, 3, 64), 0);
    assert_int_equal(sv_density_code(-5, 3, 64), 0);
    assert_int_equal(sv_density_code(1, 3, 64), 1);
    assert_int_equal(sv_density_code(255, 3, 64), 254);
    assert_int_equal(sv_density_code(INFINITY, 3, 64), 254);
    assert_int_equal(sv_density_log_code(NAN, 3, 64), 0);
    assert_int_equal(sv_density_log_code(INFINITY, 3, 64), 254);
    assert_true(sv_density_period(0, 3, 64) == 0 && sv_density_log_period(0, 3, 64) == 0);
    assert_true(sv_density_period(9, 64, 3) == 0 && sv_density_log_period(9, NAN, 3) == 0);
    assert_true(sv_density_period(255, 3, 64) == 64); /* as the last */
}

/* A flat hedge: columns x rows opaque square leaves side by side, in the plane y = 0, width : height 4 : 5.
 */
static void make_hedge(int columns, int rows, bool mirrored, struct sv_tree_mesh *mesh)
{
    uint32_t quads = (uint32_t)(columns * rows);
    *mesh = (struct sv_tree_mesh){.vertices = calloc(4 * quads, sizeof *mesh->vertices),
                                  .indices = calloc(6 * quads, sizeof *mesh->indices),
                                  .material_count = 1,
                                  .leaf_count = quads,
                                  .model_height = 1};
    for (int k = 0; k < columns * rows; k++) {
        for (int c = 0; c < 4; c++) {
            int right = c == 1 || c == 2, up = c >= 2;
            mesh->vertices[mesh->vertex_count++] = (struct sv_tree_vertex){
                .position = {0.8f * ((float)(k % columns + right) / (float)columns - 0.5f), 0,
                             (float)(k / columns + up) / (float)rows},
                .normal = {0, -32767, 0},
                .occlusion = 65535,
                .open = {0, 0, 0, 127},
                .uv = {(float)(right != mirrored), (float)!up}};
        }
        static const uint32_t order[6] = {0, 1, 2, 0, 2, 3};
        for (int c = 0; c < 6; c++)
            mesh->indices[mesh->index_count++] = 4 * (uint32_t)k + order[c];
    }
    mesh->materials[0] = (struct sv_tree_material){.name = "leaf",
                                                   .base_color = {0.1f, 0.2f, 0.05f, 1},
                                                   .is_leaf = true,
                                                   .two_sided = true,
                                                   .translucency = 0.4f,
                                                   .index_count = mesh->index_count};
    struct sv_error error;
    fixture_ok(sv_tree_mesh_measure(mesh, &error), &error);
}

/* The hedge as it stands on one plane, y = 0: laid out by hand, so that its periods are exact. */
static void make_hedge_cloud(const struct sv_tree_mesh *mesh, struct sv_tree_cloud *cloud)
{
    uint32_t leaves = mesh->leaf_count;
    *cloud = (struct sv_tree_cloud){.plane_count = 1,
                                    .pieces = calloc(leaves, sizeof *cloud->pieces),
                                    .triangles = calloc(2 * leaves, sizeof *cloud->triangles),
                                    .piece_count = leaves,
                                    .triangle_count = 2 * leaves};
    cloud->planes[0] = (struct sv_cloud_plane){.normal = {0, -1, 0},
                                               .centre = {0, 0, 0.5f},
                                               .u = {1, 0, 0},
                                               .v = {0, 0, 1},
                                               .half = {0.4f, 0.5f},
                                               .piece_count = leaves};
    for (uint32_t k = 0; k < leaves; k++) {
        const struct sv_tree_vertex *lo = &mesh->vertices[4 * k], *hi = lo + 2;
        struct sv_cloud_piece *p = &cloud->pieces[k];
        *p = (struct sv_cloud_piece){
            .normal = {0, -1, 0},
            .uv_hi = {1, 1},
            .size = {hi->position[0] - lo->position[0], hi->position[2] - lo->position[2]},
            .first_triangle = 2 * k,
            .triangle_count = 2,
            .flags = SV_CLOUD_LEAF | SV_CLOUD_TURNED | SV_CLOUD_PLACED};
        for (int a = 0; a < 3; a++)
            p->centre[a] = 0.5f * (lo->position[a] + hi->position[a]);
        p->at[0] = p->centre[0];
        p->at[1] = p->centre[2] - 0.5f;
        p->area = p->size[0] * p->size[1];
        for (uint32_t t = 0; t < 2; t++)
            cloud->triangles[2 * k + t] = (struct sv_cloud_triangle){
                6 * k + 3 * t, {{0, 0}, {SV_CLOUD_WEIGHT_ONE, 0}, {0, SV_CLOUD_WEIGHT_ONE}}};
    }
    struct sv_error error;
    fixture_ok(sv_tree_cloud_check(cloud, mesh, &error), &error);
}

static void make_cloud(const struct sv_tree_mesh *mesh, int planes, struct sv_tree_cloud *cloud)
{
    struct sv_cloud_options options = SV_CLOUD_OPTIONS_DEFAULT;
    struct sv_error error;
    options.planes = planes;
    options.stem_planes = options.stem_planes > planes / 2 ? planes / 2 : options.stem_planes;
    fixture_ok(sv_tree_cloud_create(mesh, &options, cloud, &error), &error);
}

static void build(const struct sv_tree_mesh *mesh, const struct sv_tree_cloud *cloud,
                  enum sv_density_kind kind, struct sv_density *density, uint8_t *rgba)
{
    struct sv_error error;
    fixture_ok(sv_density_build(mesh, cloud, kind, density, &error), &error);
    sv_density_texels(density, rgba);
}

/* The hedge's leaves are 1024 / columns by 1024 / rows pixels of the UV texture (the plane's rectangle is the
 * hedge, whichever way round its axes lie). What 5:6:5 leaves of a code: 4 of 253 steps over the species'
 * range. */
static void test_hedge(void **state)
{
    (void)state;
    static const int sizes[][2] = {{80, 64}, {128, 100}, {60, 180}, {43, 43}};
    uint8_t *rgba = malloc(4 * (size_t)TEXELS);
    assert_non_null(rgba);
    for (size_t n = 0; n < sizeof sizes / sizeof *sizes; n++) {
        const int *size = sizes[n];
        struct sv_tree_mesh mesh;
        struct sv_tree_cloud cloud;
        struct sv_density density;
        make_hedge(size[0], size[1], n & 1, &mesh);
        make_hedge_cloud(&mesh, &cloud);
        build(&mesh, &cloud, SV_DENSITY_PAPER, &density, rgba);
        double want[2] = {1024.0 / size[0], 1024.0 / size[1]};
        double allowed =
            4.0 / 253 * (double)(density.period_max - density.period_min) + 0.02 * fmax(want[0], want[1]);
        int right = 0;
        for (int j = 2; j < SV_DENSITY_TILE - 2; j++)
            for (int i = 2; i < SV_DENSITY_TILE - 2; i++) {
                const uint8_t *p = rgba + 4 * (j * SV_DENSITY_WIDTH + i);
                double x = (double)sv_density_period(p[0], density.period_min, density.period_max);
                double y = (double)sv_density_period(p[1], density.period_min, density.period_max);
                right += fabs(x - want[0]) <= allowed && fabs(y - want[1]) <= allowed;
            }
        if (right < 124 * 124 * 98 / 100)
            fail_msg("%d x %d leaves: %d of %d texels have periods %.2f, %.2f within %.2f", size[0], size[1],
                     right, 124 * 124, want[0], want[1], allowed);
        for (int k = SV_DENSITY_TILE; k < SV_DENSITY_WIDTH; k++) /* tiles of planes that are not there */
            assert_true(rgba[4 * k] == 0 && rgba[4 * k + 1] == 0);
        assert_int_equal(density.leaf.material, 0);
        assert_true(fabs((double)density.leaf.size[0] * (double)density.leaf.size[1] * size[0] * size[1] -
                         0.8) < 0.01);
        sv_density_finish(&density);
        sv_tree_cloud_finish(&cloud);
        sv_tree_mesh_finish(&mesh);
    }
    free(rgba);
}

/* Coverage against the samples themselves; levels keep it; colour and normal of what is covered are near the
 * means. */
static void test_plain(void **state)
{
    (void)state;
    uint8_t *rgba = malloc(4 * (size_t)TEXELS);
    struct sv_tree_mesh mesh;
    struct sv_tree_cloud cloud;
    struct sv_density density;
    struct sv_density_levels levels;
    struct sv_cloud_bake bake;
    struct sv_error error;
    assert_non_null(rgba);
    fixture_tree(600, 5, &mesh);
    make_cloud(&mesh, 24, &cloud);
    build(&mesh, &cloud, SV_DENSITY_PLAIN, &density, rgba);
    fixture_ok(sv_density_levels_init(&density, &levels, &error), &error);
    fixture_ok(sv_cloud_bake_init(&mesh, &cloud, SV_DENSITY_UV_SIDE, SV_DENSITY_UV_SIDE, &bake, &error),
               &error);
    double off = 0, texels = 0;
    for (int plane = 0; plane < 24; plane++) {
        fixture_ok(sv_cloud_bake_draw(&bake, plane, SV_DENSITY_UV_SIDE, SV_DENSITY_UV_SIDE, &error), &error);
        double sum = 0, by_level[SV_DENSITY_LEVELS] = {0};
        for (int j = 0; j < SV_DENSITY_TILE; j++)
            for (int i = 0; i < SV_DENSITY_TILE; i++) {
                struct sv_cloud_texel t;
                sv_cloud_bake_texel(&bake, i, j, SV_DENSITY_STEP, &t);
                int x = plane % 6 * SV_DENSITY_TILE + i, y = plane / 6 * SV_DENSITY_TILE + j;
                double got = rgba[4 * (y * SV_DENSITY_WIDTH + x) + 3] / 255.0;
                /* eight levels between a block's ends: a fourteenth, and roundings */
                assert_true(fabs(got - (double)t.coverage) <= 1.0 / 14 + 0.01);
                off += fabs(got - (double)t.coverage);
                texels += t.coverage > 0;
                sum += (double)t.coverage;
            }
        for (int k = 0; k < SV_DENSITY_LEVELS; k++) {
            int side = SV_DENSITY_TILE >> k;
            for (int n = 0; n < side * side; n++) {
                int x = plane % 6 * side + n % side, y = plane / 6 * side + n / side;
                by_level[k] += levels.albedo[k][4 * (y * (SV_DENSITY_WIDTH >> k) + x) + 3] / 255.0 /
                               (side * side) * SV_DENSITY_TILE * SV_DENSITY_TILE;
            }
            /* each level rounds by up to half a code where it holds something, and once more when it is
             * widened */
            assert_true(fabs(by_level[k] - by_level[0]) <= (k > 0) * (k + 1) * 0.5 / 255 * 128 * 128 + 1e-6);
        }
        assert_true(fabs(by_level[0] - sum) <= 0.01 * sum + 1);
    }
    printf("coverage off by %.4f a covered texel\n", off / texels);
    assert_true(off / texels < 0.02);
    sv_cloud_bake_finish(&bake);
    sv_density_levels_finish(&levels);
    sv_density_finish(&density);
    sv_tree_cloud_finish(&cloud);
    sv_tree_mesh_finish(&mesh);
    free(rgba);
}

/* What is added to levels of detail: straight lines between the scales, held beyond them. */
static void test_scales(void **state)
{
    (void)state;
    struct sv_density density = {.finer = {-1, 0.5f, -0.25f, 0, -2, 1}};
    for (int k = 0; k < SV_DENSITY_SCALES; k++) {
        float next = density.finer[k + 1 < SV_DENSITY_SCALES ? k + 1 : k];
        for (int n = 0; n < 8; n++) { /* eighths are exact */
            float lod = (float)(SV_DENSITY_SCALE_FIRST + k) + (float)n / 8;
            assert_true(sv_density_finer(&density, lod) ==
                        density.finer[k] + (next - density.finer[k]) * (float)n / 8);
        }
    }
    assert_true(sv_density_finer(&density, -40) == -1 && sv_density_finer(&density, -INFINITY) == -1);
    assert_true(sv_density_finer(&density, 40) == 1 && sv_density_finer(&density, INFINITY) == 1);
}

/* Levels of a slender plane: those of a square one, spread over three texels by hand where its sides are 1
 * : 9.
 */
static void check_slender(const struct sv_density_levels *square, const struct sv_density_levels *slender,
                          bool tall)
{
    for (int level = 0; level < SV_DENSITY_LEVELS; level++) {
        int side = SV_DENSITY_TILE >> level, row = SV_DENSITY_WIDTH >> level, most = 0;
        for (int t = 0; t < side * side && side > 2; t++) {
            int i = t % side, j = t / side, got = slender->albedo[level][4 * (j * row + i) + 3];
            double sum = 0;
            for (int d = -1; d <= 1; d++) {
                int x = tall ? i + d : i, y = tall ? j : j + d;
                x = x < 0 ? 0 : x >= side ? side - 1 : x; /* one beyond the edge mirrors to the edge */
                y = y < 0 ? 0 : y >= side ? side - 1 : y;
                sum += square->albedo[level][4 * (y * row + x) + 3] / 3.0;
            }
            double want = level == 0 ? square->albedo[0][4 * (j * row + i) + 3] : sum;
            assert_true(fabs(got - want) <= 0.5 + 1e-3);
            most = abs(got - square->albedo[level][4 * (j * row + i) + 3]) > most
                       ? abs(got - square->albedo[level][4 * (j * row + i) + 3])
                       : most;
        }
        assert_true(level == 0 || side <= 2 || most > 0); /* there was something to spread */
    }
}

static void test_slender(void **state)
{
    (void)state;
    uint8_t *rgba = malloc(4 * (size_t)TEXELS);
    struct sv_tree_mesh mesh;
    struct sv_tree_cloud cloud;
    struct sv_density density;
    struct sv_density_levels square, slender;
    struct sv_error error;
    assert_non_null(rgba);
    fixture_tree(600, 5, &mesh);
    make_cloud(&mesh, 24, &cloud);
    build(&mesh, &cloud, SV_DENSITY_PLAIN, &density, rgba);
    float ratio = cloud.planes[0].half[0] / cloud.planes[0].half[1];
    assert_true(fabsf(density.planes[0].slender / ratio - 1) < 1e-6f);
    for (int tall = 0; tall < 2; tall++) {
        density.planes[0].slender = 1;
        fixture_ok(sv_density_levels_init(&density, &square, &error), &error);
        density.planes[0].slender = tall ? 1.0f / 9 : 9;
        fixture_ok(sv_density_levels_init(&density, &slender, &error), &error);
        check_slender(&square, &slender, tall);
        sv_density_levels_finish(&square);
        sv_density_levels_finish(&slender);
    }
    sv_density_finish(&density);
    sv_tree_cloud_finish(&cloud);
    sv_tree_mesh_finish(&mesh);
    free(rgba);
}

/* A dead tree has no leaf to repeat, and its wood is there in both kinds; no planes are no pictures; too many
 * are refused. */
static void test_bare(void **state)
{
    (void)state;
    uint8_t *rgba = malloc(4 * (size_t)TEXELS);
    struct sv_tree_mesh mesh;
    struct sv_tree_cloud cloud;
    struct sv_density density;
    struct sv_error error;
    assert_non_null(rgba);
    fixture_tree(0, 5, &mesh);
    make_cloud(&mesh, 24, &cloud);
    for (int kind = 0; kind < SV_DENSITY_KIND_COUNT; kind++) {
        long wood = 0;
        build(&mesh, &cloud, (enum sv_density_kind)kind, &density, rgba);
        assert_int_equal(density.leaf.material, -1);
        for (int k = 0; k < TEXELS; k++)
            wood +=
                kind == SV_DENSITY_PAPER ? rgba[4 * k] > 250 && rgba[4 * k + 1] > 250 : rgba[4 * k + 3] > 200;
        assert_true(wood > 2000);
        /* no leaf anywhere: codes between come from blocks at the edge of wood, and from there alone */
        long between = 0;
        for (int k = 0; k < TEXELS && kind == SV_DENSITY_PAPER; k++)
            between += rgba[4 * k] > 8 && rgba[4 * k] < 247;
        assert_true(between < wood / 4);
        sv_density_finish(&density);
    }
    sv_tree_cloud_finish(&cloud);
    make_cloud(&mesh, 25, &cloud);
    assert_int_equal(sv_density_build(&mesh, &cloud, SV_DENSITY_PLAIN, &density, &error), SV_ELIMIT);
    sv_tree_cloud_finish(&cloud);
    sv_tree_mesh_finish(&mesh);
    free(rgba);
}

/* A quadratic that light follows exactly is found again. */
static void test_light(void **state)
{
    (void)state;
    struct sv_density density;
    struct sv_tree_mesh mesh;
    struct sv_tree_cloud cloud;
    uint8_t *rgba = malloc(4 * (size_t)TEXELS);
    assert_non_null(rgba);
    make_hedge(40, 40, false, &mesh);
    for (uint32_t k = 0; k < mesh.vertex_count; k++) {
        struct sv_tree_vertex *v = &mesh.vertices[k];
        float x = v->position[0] / 0.4f, z = 2 * v->position[2] - 1;
        v->occlusion = (uint16_t)(65535 * (0.5f + 0.1f * x - 0.2f * z + 0.1f * x * z - 0.05f * z * z));
        v->open[0] = (int8_t)(100 * x);
        v->open[3] = (int8_t)(60 + 30 * z);
    }
    make_hedge_cloud(&mesh, &cloud);
    build(&mesh, &cloud, SV_DENSITY_PLAIN, &density, rgba);
    const struct sv_density_plane *p = &density.planes[0];
    const struct sv_cloud_plane *c = &cloud.planes[0];
    for (int k = 0; k < 81; k++) {
        float px = -0.8f + 0.2f * (float)(k % 9), py = -0.8f + 0.2f * (float)(k / 9), at[3];
        for (int a = 0; a < 3; a++)
            at[a] = c->centre[a] + c->u[a] * c->half[0] * px + c->v[a] * c->half[1] * py;
        float x = at[0] / 0.4f, z = 2 * at[2] - 1;
        /* between a leaf's corners the mesh is linear: off by a quarter of a leaf's square; open is in codes
         * of 1/127 */
        assert_true(fabsf(sv_density_quadratic_at(&p->occlusion, px, py) -
                          (0.5f + 0.1f * x - 0.2f * z + 0.1f * x * z - 0.05f * z * z)) < 4e-3f);
        assert_true(fabsf(sv_density_quadratic_at(&p->open[0], px, py) - 100 * x / 127) < 0.012f);
        assert_true(fabsf(sv_density_quadratic_at(&p->open[3], px, py) - (60 + 30 * z) / 127) < 0.012f);
    }
    sv_density_finish(&density);
    sv_tree_cloud_finish(&cloud);
    sv_tree_mesh_finish(&mesh);
    free(rgba);
}

/* To bytes and back; the same build twice; every word of the head broken. */
static void test_bytes(void **state)
{
    (void)state;
    struct sv_tree_mesh mesh;
    struct sv_tree_cloud cloud;
    struct sv_density one, two, back;
    struct sv_error error;
    void *data, *again;
    size_t bytes, size;
    fixture_tree(200, 8, &mesh);
    make_cloud(&mesh, 24, &cloud);
    fixture_ok(sv_density_build(&mesh, &cloud, SV_DENSITY_PLAIN, &one, &error), &error);
    fixture_ok(sv_density_build(&mesh, &cloud, SV_DENSITY_PLAIN, &two, &error), &error);
    assert_int_equal(SV_DENSITY_FILE_BYTES, 393344);
    assert_memory_equal(one.file, two.file, SV_DENSITY_FILE_BYTES);
    assert_memory_equal(one.planes, two.planes, sizeof one.planes);
    fixture_ok(sv_density_save(&one, &data, &bytes, &error), &error);
    fixture_ok(sv_density_load(data, bytes, &back, &error), &error);
    fixture_ok(sv_density_save(&back, &again, &size, &error), &error);
    assert_int_equal(bytes, size);
    assert_memory_equal(data, again, bytes);
    sv_density_finish(&back);
    size_t head = bytes - SV_DENSITY_FILE_BYTES + SV_DDS_FILE_HEADER;
    for (size_t at = 0; at + 4 <= head; at += 4) {
        static const uint32_t bad[] = {0x7FC00000, 0xFF800000, 0xFFFFFFF0};
        uint32_t kept;
        memcpy(&kept, (uint8_t *)data + at, 4);
        for (int k = 0; k < 3; k++) {
            memcpy((uint8_t *)data + at, &bad[k], 4);
            enum sv_status status = sv_density_load(data, bytes, &back, &error);
            if (status == SV_OK) /* the reserved word */
                sv_density_finish(&back);
            assert_true(status == SV_EFORMAT || at == 20);
        }
        memcpy((uint8_t *)data + at, &kept, 4);
    }
    assert_int_equal(sv_density_load(data, bytes - 1, &back, &error), SV_EFORMAT);
    assert_int_equal(sv_density_load(data, 0, &back, &error), SV_EFORMAT);
    free(data);
    free(again);
    sv_density_finish(&one);
    sv_density_finish(&two);
    sv_tree_cloud_finish(&cloud);
    sv_tree_mesh_finish(&mesh);
}

int main(void)
{
    sv_color_init();
    const struct CMUnitTest tests[] = {cmocka_unit_test(test_codes),   cmocka_unit_test(test_hedge),
                                       cmocka_unit_test(test_plain),   cmocka_unit_test(test_scales),
                                       cmocka_unit_test(test_slender), cmocka_unit_test(test_bare),
                                       cmocka_unit_test(test_light),   cmocka_unit_test(test_bytes)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
