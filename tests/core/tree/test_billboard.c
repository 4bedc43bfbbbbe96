/* test_billboard.c - what is drawn on the planes of a billboard cloud (cloud_bake, billboard, indirect),
 * against brute force over all polygons in double. No GL. */
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
#include "core/base/rng.h"
#include "core/base/vec.h"
#include "core/image/dxt.h"
#include "core/tree/billboard.h"
#include "core/tree/cloud_bake.h"
#include "core/tree/cloud_light.h"
#include "core/tree/cloud_order.h"
#include "core/tree/grow.h"
#include "core/tree/indirect.h"

struct tree {
    struct sv_tree_mesh mesh;
    struct sv_tree_cloud cloud;
};

static void must(enum sv_status status, const struct sv_error *error)
{
    if (status != SV_OK)
        fail_msg("%s: %s", error->field, error->message);
}

static void tree_init(struct tree *t, enum sv_habit habit, uint32_t leaves, int planes)
{
    struct sv_error error;
    struct sv_cloud_options options = SV_CLOUD_OPTIONS_DEFAULT;
    options.planes = planes;
    must(sv_tree_grow(habit, leaves, 5, &t->mesh, &error), &error);
    must(sv_tree_cloud_create(&t->mesh, &options, &t->cloud, &error), &error);
}

static void tree_finish(struct tree *t)
{
    sv_tree_cloud_finish(&t->cloud);
    sv_tree_mesh_finish(&t->mesh);
}

/* The nearest texel's alpha test, as mesh.h has it but for bilinear filtering: -1 unclear (near the cutoff).
 */
static int kept(const struct sv_tree_material *m, double u, double v)
{
    const struct sv_image *image = &m->albedo;
    if (!m->masked || !image->data)
        return 1;
    double x = (u - floor(u)) * image->width - 0.5, y = (v - floor(v)) * image->height - 0.5, low = 1,
           high = 0;
    for (int k = 0; k < 16; k++) {
        int i = ((int)floor(x) - 1 + k % 4 + image->width) % image->width;
        int j = ((int)floor(y) - 1 + k / 4 + image->height) % image->height;
        double a =
            ((const uint8_t *)image->data)[4 * (j * image->width + i) + 3] / 255.0 * (double)m->base_color[3];
        low = fmin(low, a);
        high = fmax(high, a);
    }
    return low >= (double)m->alpha_cutoff ? 1 : high < (double)m->alpha_cutoff ? 0 : -1;
}

struct hit {
    uint32_t piece;
    double uv[2], depth;
    bool clear; /* no edge, cutoff or rival near */
};

/* The front-most polygon at (x, y) of a plane, over all of them. */
static struct hit brute_force(const struct tree *t, int plane, double x, double y)
{
    struct hit best = {UINT32_MAX, {0, 0}, -INFINITY, true};
    const struct sv_cloud_plane *p = &t->cloud.planes[plane];
    for (uint32_t i = p->first_piece; i < p->first_piece + p->piece_count; i++) {
        const struct sv_cloud_piece *piece = &t->cloud.pieces[i];
        struct sv_cloud_placement q;
        sv_cloud_place(&t->cloud, piece, &q);
        for (uint32_t n = 0; n < piece->triangle_count; n++) {
            struct sv_tree_vertex v[3];
            float at[3][3];
            for (int k = 0; k < 3; k++) {
                v[k] = sv_cloud_corner(&t->mesh, &t->cloud.triangles[piece->first_triangle + n], k);
                sv_cloud_placed(&q, v[k].position, at[k]);
            }
            double x1 = (double)(at[1][0] - at[0][0]), y1 = (double)(at[1][1] - at[0][1]),
                   x2 = (double)(at[2][0] - at[0][0]), y2 = (double)(at[2][1] - at[0][1]),
                   det = x1 * y2 - x2 * y1;
            double dx = x - (double)at[0][0], dy = y - (double)at[0][1];
            double b = (dx * y2 - x2 * dy) / det, c = (x1 * dy - dx * y1) / det, a = 1 - b - c;
            if (!(fabs(det) > 1e-12) || a < -0.02 || b < -0.02 || c < -0.02)
                continue;
            double u = a * (double)v[0].uv[0] + b * (double)v[1].uv[0] + c * (double)v[2].uv[0];
            double w = a * (double)v[0].uv[1] + b * (double)v[1].uv[1] + c * (double)v[2].uv[1];
            double depth = a * (double)at[0][2] + b * (double)at[1][2] + c * (double)at[2][2];
            int keep = kept(&t->mesh.materials[piece->material], u, w);
            if (keep == 0)
                continue;
            bool clear = keep == 1 && a > 0.02 && b > 0.02 && c > 0.02;
            if (!clear || fabs(depth - best.depth) < 1e-5)
                best.clear = false;
            if (clear && depth > best.depth) {
                best.depth = depth;
                best.piece = i;
                best.uv[0] = u;
                best.uv[1] = w;
            }
        }
    }
    return best;
}

static void samples_show_what_is_in_front(void **state)
{
    (void)state;
    enum { SIDE = 300 };
    struct tree t;
    struct sv_cloud_bake bake;
    struct sv_error error;
    struct sv_rng rng = sv_rng_seeded(3, 3);
    int told = 0, seen = 0;
    tree_init(&t, SV_HABIT_BROADLEAF, 800, 6);
    must(sv_cloud_bake_init(&t.mesh, &t.cloud, SIDE, SIDE, &bake, &error), &error);
    for (int plane = 0; plane < 6; plane++) {
        const struct sv_cloud_plane *p = &t.cloud.planes[plane];
        must(sv_cloud_bake_draw(&bake, plane, SIDE, SIDE, &error), &error);
        for (int k = 0; k < 120; k++) {
            int i = (int)(SIDE * sv_rng_unit(&rng)), j = (int)(SIDE * sv_rng_unit(&rng));
            double x = (double)p->half[0] * (2 * (i + 0.5) / SIDE - 1),
                   y = (double)p->half[1] * (1 - 2 * (j + 0.5) / SIDE);
            struct hit hit = brute_force(&t, plane, x, y);
            struct sv_cloud_sample s;
            bool shown = sv_cloud_bake_sample(&bake, i, j, &s);
            assert_int_equal(shown, sv_cloud_bake_covered(&bake, i, j));
            if (!hit.clear)
                continue;
            told++;
            assert_int_equal(shown, hit.piece != UINT32_MAX);
            if (!shown)
                continue;
            seen++;
            assert_int_equal(s.piece, hit.piece);
            assert_int_equal(s.leaf, (t.cloud.pieces[s.piece].flags & SV_CLOUD_LEAF) != 0);
            assert_true(fabs((double)s.uv[0] - hit.uv[0]) < 2e-3 && fabs((double)s.uv[1] - hit.uv[1]) < 2e-3);
            assert_true(fabs((double)s.depth - hit.depth) < 1e-4);
            double n =
                (double)(s.normal[0] * s.normal[0] + s.normal[1] * s.normal[1] + s.normal[2] * s.normal[2]);
            assert_true(fabs(n - 1) < 1e-3 && s.normal[2] >= 0);
        }
    }
    assert_true(told > 360 && seen > 80);
    /* A texel is the mean of its samples. */
    struct sv_cloud_texel texel;
    struct sv_cloud_sample s;
    for (int k = 0; k < 100; k++) {
        float rgb = 0, count = 0;
        for (int n = 0; n < 9; n++)
            if (sv_cloud_bake_sample(&bake, 3 * k + n % 3, 150 + n / 3, &s)) {
                rgb += s.rgb[1];
                count++;
            }
        sv_cloud_bake_texel(&bake, k, 50, 3, &texel);
        assert_true(fabsf(texel.coverage - count / 9) < 1e-6f);
        assert_true(count == 0 || fabsf(texel.rgb[1] - rgb / count) < 1e-4f);
    }
    sv_cloud_bake_finish(&bake);
    tree_finish(&t);
}

/* ---- bars ---- */

static void bars_keep_coverage(void **state)
{
    (void)state;
    enum { SIDE = 64 };
    static float coverage[SIDE * SIDE];
    struct sv_rng rng = sv_rng_seeded(9, 1);
    for (int round = 0; round < 6; round++) {
        double power = sv_rng_range(&rng, 0.3, 4), sum = 0;
        for (int k = 0; k < SIDE * SIDE; k++) {
            coverage[k] = (float)pow(sv_rng_unit(&rng), power);
            sum += (double)coverage[k] / (SIDE * SIDE);
        }
        float bar = sv_coverage_bar(coverage, SIDE, sum);
        /* Brute force: 16 x 16 bilinear samples a texel pair. */
        double passed = 0, all = 0;
        for (int j = 0; j + 1 < SIDE; j++)
            for (int i = 0; i + 1 < SIDE; i++)
                for (int n = 0; n < 64; n++) {
                    float x = ((float)(n % 8) + 0.5f) / 8, y = ((float)(n / 8) + 0.5f) / 8;
                    const float *p = coverage + j * SIDE + i;
                    float v =
                        (1 - y) * ((1 - x) * p[0] + x * p[1]) + y * ((1 - x) * p[SIDE] + x * p[SIDE + 1]);
                    passed += v >= bar;
                    all++;
                }
        /* The bar is found on centres, edges and corners alone, which spread more than what lies between. */
        assert_true(fabs(passed / all - sum) < 0.06);
    }
    memset(coverage, 0, sizeof coverage);
    float bar = sv_coverage_bar(coverage, SIDE, 0);
    assert_true(bar > 0 && bar <= 1);
}

/* ---- billboards ---- */

static void levels_keep_coverage_and_colour(void **state)
{
    (void)state;
    struct tree t;
    struct sv_billboards b;
    struct sv_error error;
    struct sv_billboard_options o = {256, 64, 16, 2};
    tree_init(&t, SV_HABIT_SHRUB, 2000, 8);
    must(sv_billboards_bake(&t.mesh, &t.cloud, &o, &b, &error), &error);
    uint8_t *rgba = malloc(4 * 256 * 256);
    assert_non_null(rgba);
    struct sv_cloud_bake bake;
    must(sv_cloud_bake_init(&t.mesh, &t.cloud, 512, 512, &bake, &error), &error);
    for (int plane = 0; plane < 8; plane++) {
        double covered = 0;
        must(sv_cloud_bake_draw(&bake, plane, 512, 512, &error), &error);
        for (int j = 0; j < 512; j++)
            for (int i = 0; i < 512; i++)
                covered += sv_cloud_bake_covered(&bake, i, j) / (512.0 * 512.0);
        for (int k = 0; k < 9; k++) {
            size_t bytes;
            int side = 256 >> k;
            double mean = 0;
            const uint8_t *level = sv_billboards_level(&b, SV_BILLBOARD_COLOR, k, &bytes);
            assert_int_equal(bytes, sv_dxt5_bytes(side, side));
            sv_dxt5_decode(level + (size_t)plane * bytes, side, side, rgba);
            for (int i = 0; i < side * side; i++)
                mean += rgba[4 * i + 3] / 255.0 / (side * side);
            /* Alpha of a block is 8 steps between two ends: off by 1/14 of their distance at most, both ways.
             */
            assert_true(fabs(mean - covered) < 0.02);
        }
    }
    for (int k = 0; k < 9; k++)
        assert_true(b.bar[k] > 0.02f && b.bar[k] < 0.98f);
    sv_cloud_bake_finish(&bake);
    free(rgba);
    sv_billboards_finish(&b);
    tree_finish(&t);
}

static void outlines_hold_all(void **state)
{
    (void)state;
    struct tree t;
    struct sv_billboards b;
    struct sv_error error;
    struct sv_billboard_options o = {128, 32, 16, 1};
    struct sv_cloud_bake bake;
    tree_init(&t, SV_HABIT_POPLAR, 600, 8);
    must(sv_billboards_bake(&t.mesh, &t.cloud, &o, &b, &error), &error);
    must(sv_cloud_bake_init(&t.mesh, &t.cloud, 128, 128, &bake, &error), &error);
    double inside = 0;
    for (int plane = 0; plane < 8; plane++) {
        must(sv_cloud_bake_draw(&bake, plane, 128, 128, &error), &error);
        for (int j = 0; j < 128; j++)
            for (int i = 0; i < 128; i++) {
                double s = (i + 0.5) / 128, r = (j + 0.5) / 128;
                bool in = true;
                for (int k = 0; k < SV_BILLBOARD_OUTLINE; k++)
                    in = in && cos(k * SV_PI / 4) * s + sin(k * SV_PI / 4) * r <=
                                   (double)b.outline[plane][k] + 1e-6;
                assert_true(in || !sv_cloud_bake_covered(&bake, i, j));
                inside += in;
            }
    }
    assert_true(inside < 0.95 * 8 * 128 * 128); /* and leave something out */
    sv_cloud_bake_finish(&bake);
    sv_billboards_finish(&b);
    tree_finish(&t);
}

static void flip_bytes(const uint8_t *data, size_t bytes, enum sv_status (*load)(const void *, size_t))
{
    struct sv_rng rng = sv_rng_seeded(4, 4);
    uint8_t *copy = malloc(bytes);
    assert_non_null(copy);
    for (int k = 0; k < 200; k++) {
        memcpy(copy, data, bytes);
        copy[(size_t)(sv_rng_unit(&rng) * (double)(k % 2 ? 256 : bytes))] ^=
            (uint8_t)(1 + sv_rng_unit(&rng) * 254);
        size_t length = k % 3 ? bytes : (size_t)(sv_rng_unit(&rng) * (double)bytes);
        enum sv_status status = load(copy, length);
        assert_true(status == SV_EFORMAT || (status == SV_OK && length == bytes));
    }
    free(copy);
}

static enum sv_status load_billboards(const void *data, size_t bytes)
{
    struct sv_billboards b = {0};
    struct sv_error error;
    enum sv_status status = sv_billboards_load(data, bytes, &b, &error);
    sv_billboards_finish(&b);
    return status;
}

static enum sv_status load_indirect(const void *data, size_t bytes)
{
    struct sv_indirect t = {0};
    struct sv_error error;
    enum sv_status status = sv_indirect_load(data, bytes, &t, &error);
    sv_indirect_finish(&t);
    return status;
}

static void bytes_come_back(void **state)
{
    (void)state;
    struct tree t;
    struct sv_billboards b, again;
    struct sv_error error;
    void *data;
    size_t bytes;
    tree_init(&t, SV_HABIT_CONIFER, 300, 4);
    must(sv_billboards_bake(&t.mesh, &t.cloud, &(struct sv_billboard_options){64, 32, 16, 1}, &b, &error),
         &error);
    must(sv_billboards_save(&b, &data, &bytes, &error), &error);
    must(sv_billboards_load(data, bytes, &again, &error), &error);
    assert_int_equal(again.bytes, b.bytes);
    assert_memory_equal(again.data, b.data, b.bytes);
    assert_memory_equal(again.bar, b.bar, sizeof b.bar);
    assert_memory_equal(again.outline, b.outline, 4 * sizeof b.outline[0]);
    flip_bytes(data, bytes, load_billboards);
    sv_billboards_finish(&again);
    sv_billboards_finish(&b);
    free(data);
    struct sv_indirect i;
    must(sv_indirect_bake(&t.mesh, &t.cloud, &(struct sv_indirect_options){32, {32, 16, 8, 1}}, &i, &error),
         &error);
    must(sv_indirect_save(&i, &data, &bytes, &error), &error);
    assert_int_equal(load_indirect(data, bytes), SV_OK);
    flip_bytes(data, bytes, load_indirect);
    sv_indirect_finish(&i);
    free(data);
    tree_finish(&t);
}

static void sides_out_of_range_are_refused(void **state)
{
    (void)state;
    static const struct sv_billboard_options bad[] = {{0, 4, 4, 1},     {1000, 64, 64, 1}, {64, 128, 16, 1},
                                                      {64, 32, 128, 1}, {64, 32, 16, 0},   {8192, 32, 16, 1}};
    struct tree t;
    struct sv_billboards b;
    struct sv_indirect i;
    struct sv_error error;
    tree_init(&t, SV_HABIT_SHRUB, 10, 2);
    for (size_t k = 0; k < sizeof bad / sizeof bad[0]; k++)
        assert_int_equal(sv_billboards_bake(&t.mesh, &t.cloud, &bad[k], &b, &error), SV_EINVAL);
    struct sv_indirect_options o = SV_INDIRECT_OPTIONS_DEFAULT;
    o.side = 100;
    assert_int_equal(sv_indirect_bake(&t.mesh, &t.cloud, &o, &i, &error), SV_EINVAL);
    tree_finish(&t);
}

/* ---- indirect ---- */

/* Where the indirect texture names the leaf that is in front, its texture coordinates are the mesh's own. */
static void indirect_leaves_lie_where_leaves_do(void **state)
{
    (void)state;
    enum { SIDE = 768 };
    struct tree t;
    struct sv_indirect i;
    struct sv_error error;
    struct sv_cloud_bake bake;
    tree_init(&t, SV_HABIT_BROADLEAF, 3000, 8);
    struct sv_indirect_options o = {256, {32, 16, 8, 1}};
    must(sv_indirect_bake(&t.mesh, &t.cloud, &o, &i, &error), &error);
    must(sv_cloud_bake_init(&t.mesh, &t.cloud, SIDE, SIDE, &bake, &error), &error);
    int leaves = 0, same = 0, lost = 0;
    for (int plane = 0; plane < 8; plane++) {
        const struct sv_cloud_plane *p = &t.cloud.planes[plane];
        must(sv_cloud_bake_draw(&bake, plane, SIDE, SIDE, &error), &error);
        for (int k = 0; k < SIDE * SIDE; k += 17) {
            struct sv_cloud_sample s;
            float uv[2];
            int column = k % SIDE, row = k / SIDE;
            if (!sv_cloud_bake_sample(&bake, column, row, &s) || !s.leaf)
                continue;
            leaves++;
            int kind =
                sv_indirect_leaf_at(&i, plane, p->half, p->half[0] * (2 * ((float)column + 0.5f) / SIDE - 1),
                                    p->half[1] * (1 - 2 * ((float)row + 0.5f) / SIDE), uv);
            lost += kind == 0;
            /* 1/20 of a leaf's box (a quarter of the texture): sizes are rounded to 9 %, offsets to 1/127. */
            same += kind && fabsf(uv[0] - s.uv[0]) < 0.05f && fabsf(uv[1] - s.uv[1]) < 0.05f;
        }
    }
    print_message("indirect: %d leaf samples, %.1f %% by their own leaf, %.1f %% by none\n", leaves,
                  100.0 * same / leaves, 100.0 * lost / leaves);
    assert_true(leaves > 5000 && same > 0.85 * leaves && lost < 0.08 * leaves);
    sv_cloud_bake_finish(&bake);
    sv_indirect_finish(&i);
    tree_finish(&t);
}

/* Corners left of the triangle p, cut by the box lo .. hi (Sutherland and Hodgman 1974). */
static int clipped(const double p[3][2], const double lo[2], const double hi[2])
{
    double a[16][2], b[16][2];
    int count = 3;
    memcpy(a, p, 3 * sizeof a[0]);
    for (int side = 0; side < 4; side++) {
        int made = 0, c = side / 2;
        for (int k = 0; k < count; k++) {
            const double *from = a[k], *to = a[(k + 1) % count];
            double f = side % 2 ? hi[c] - from[c] : from[c] - lo[c],
                   t = side % 2 ? hi[c] - to[c] : to[c] - lo[c];
            if (f >= 0)
                memcpy(b[made++], from, sizeof b[0]);
            if ((f >= 0) != (t >= 0)) {
                for (int d = 0; d < 2; d++)
                    b[made][d] = from[d] + f / (f - t) * (to[d] - from[d]);
                made++;
            }
        }
        count = made;
        memcpy(a, b, sizeof a);
    }
    return count;
}

/* Texels that a piece touches; sets one[] of them. */
static void touch_texels(const struct tree *t, const struct sv_cloud_piece *piece, int side, uint8_t *one)
{
    const struct sv_cloud_plane *p = &t->cloud.planes[piece->plane];
    struct sv_cloud_placement q;
    sv_cloud_place(&t->cloud, piece, &q);
    for (uint32_t n = 0; n < piece->triangle_count; n++) {
        double at[3][2];
        for (int k = 0; k < 3; k++) {
            struct sv_tree_vertex v =
                sv_cloud_corner(&t->mesh, &t->cloud.triangles[piece->first_triangle + n], k);
            float placed[3];
            sv_cloud_placed(&q, v.position, placed);
            for (int c = 0; c < 2; c++)
                at[k][c] = 0.5 * side * ((double)placed[c] / (double)p->half[c] + 1);
        }
        for (int k = 0; k < side * side; k++) {
            double lo[2] = {k % side, k / side}, hi[2] = {lo[0] + 1, lo[1] + 1};
            if (!one[k])
                one[k] = clipped((const double(*)[2])at, lo, hi) > 0;
        }
    }
}

static void layers_are_counted(void **state)
{
    (void)state;
    enum { SIDE = 24 };
    struct tree t;
    struct sv_indirect_layers layers;
    struct sv_error error;
    uint64_t entries = 0, texels = 0;
    tree_init(&t, SV_HABIT_SHRUB, 40, 3);
    must(sv_indirect_count_layers(&t.mesh, &t.cloud, SIDE, &layers, &error), &error);
    for (int plane = 0; plane < 3; plane++) {
        const struct sv_cloud_plane *p = &t.cloud.planes[plane];
        uint8_t any[SIDE * SIDE] = {0}, one[SIDE * SIDE];
        for (uint32_t i = p->first_piece; i < p->first_piece + p->piece_count; i++) {
            memset(one, 0, sizeof one);
            touch_texels(&t, &t.cloud.pieces[i], SIDE, one);
            for (int k = 0; k < SIDE * SIDE; k++) {
                entries += one[k];
                any[k] |= one[k];
            }
        }
        for (int k = 0; k < SIDE * SIDE; k++)
            texels += any[k];
    }
    /* Floats and doubles part where a corner lies on a border. */
    assert_true(fabs((double)layers.entries / (double)entries - 1) < 2e-3);
    assert_true(fabs((double)layers.texels / (double)texels - 1) < 2e-3);
    assert_int_equal(layers.bytes, 4 * (3 * SIDE * SIDE + layers.entries));
    tree_finish(&t);
}

/* ---- order and light ---- */

/* Along any ray the part that is nearer to the viewer is painted later; the parts of a plane are all of it.
 */
static void parts_are_painted_in_order(void **state)
{
    (void)state;
    struct tree t;
    struct sv_error error;
    struct sv_cloud_part outlines[24];
    struct sv_cloud_order order;
    struct sv_rng rng = sv_rng_seeded(8, 8);
    double whole = 0, cut = 0;
    tree_init(&t, SV_HABIT_BROADLEAF, 500, 24);
    for (int k = 0; k < 24; k++) {
        const float *h = t.cloud.planes[k].half;
        outlines[k] =
            (struct sv_cloud_part){k, 4, {{-h[0], -h[1]}, {h[0], -h[1]}, {h[0], h[1]}, {-h[0], h[1]}}};
        whole += 4 * (double)h[0] * (double)h[1];
    }
    must(sv_cloud_order_build(&t.cloud, outlines, 24, SV_CLOUD_ORDER_REACH, &order, &error), &error);
    assert_in_range(order.part_count, 24, SV_CLOUD_PARTS_MAX);
    for (int k = 0; k < order.part_count; k++) {
        const struct sv_cloud_part *p = &order.parts[k];
        for (int i = 0; i < p->count; i++) {
            const float *a = p->at[i], *b = p->at[(i + 1) % p->count];
            cut += 0.5 * (double)(a[0] * b[1] - a[1] * b[0]);
        }
    }
    assert_true(fabs(cut / whole - 1) < 1e-3);
    uint16_t *rank = malloc(2 * (size_t)order.part_count * sizeof *rank), *list = rank + order.part_count;
    assert_non_null(rank);
    int pairs = 0, wrong = 0;
    for (int n = 0; n < 400; n++) {
        double z = sv_rng_range(&rng, -1, 1), a = sv_rng_range(&rng, 0, 7), c = sqrt(1 - z * z);
        float d[3] = {(float)(c * cos(a)), (float)(c * sin(a)), (float)z};
        struct sv_vec3 dir = sv_vec3((double)d[0], (double)d[1], (double)d[2]);
        struct sv_vec3 from = sv_vec3(sv_rng_range(&rng, -0.3, 0.3), sv_rng_range(&rng, -0.3, 0.3),
                                      sv_rng_range(&rng, 0.2, 0.9));
        double along[64];
        uint16_t hit[64];
        int hits = 0;
        sv_cloud_order_sort(&order, &t.cloud, d, list);
        memset(rank, 0xff, (size_t)order.part_count * sizeof *rank);
        for (int k = 0; k < order.part_count; k++)
            rank[list[k]] = (uint16_t)k;
        for (int k = 0; k < order.part_count && hits < 64; k++) {
            const struct sv_cloud_part *p = &order.parts[k];
            const struct sv_cloud_plane *q = &t.cloud.planes[p->plane];
            assert_true(rank[k] != UINT16_MAX); /* every part is listed */
            struct sv_vec3 normal = sv_vec3((double)q->normal[0], (double)q->normal[1], (double)q->normal[2]);
            struct sv_vec3 off =
                sv_sub(sv_vec3((double)q->centre[0], (double)q->centre[1], (double)q->centre[2]), from);
            double facing = sv_dot(normal, dir), s = sv_dot(normal, off) / facing;
            struct sv_vec3 at = sv_sub(sv_scale(dir, s), off);
            double x = sv_dot(at, sv_vec3((double)q->u[0], (double)q->u[1], (double)q->u[2]));
            double y = sv_dot(at, sv_vec3((double)q->v[0], (double)q->v[1], (double)q->v[2]));
            bool inside = fabs(facing) > 0.05;
            for (int i = 0; i < p->count; i++) {
                const float *e = p->at[i], *f = p->at[(i + 1) % p->count];
                inside = inside && ((double)f[0] - (double)e[0]) * (y - (double)e[1]) -
                                           ((double)f[1] - (double)e[1]) * (x - (double)e[0]) >
                                       1e-5;
            }
            if (inside) {
                along[hits] = s;
                hit[hits++] = (uint16_t)k;
            }
        }
        for (int i = 0; i < hits; i++)
            for (int k = 0; k < hits; k++)
                if (along[i] > along[k] + 0.05) { /* parts may overlap by what is too thin to be cut */
                    pairs++;
                    wrong += rank[hit[i]] < rank[hit[k]];
                }
    }
    print_message("order: %d parts, %d of %d pairs along rays wrong\n", order.part_count, wrong, pairs);
    assert_true(pairs > 10000 && wrong < 0.05 * pairs);
    free(rank);
    sv_cloud_order_finish(&order);
    tree_finish(&t);
}

/* Factors of a mesh against itself are 1 but for what its own cloud hides; they change by little from one
 * direction to the next, and any number is legal. */
static void light_is_shifted_smoothly(void **state)
{
    (void)state;
    struct tree t;
    struct sv_cloud_light light;
    struct sv_error error;
    static const float odd[] = {0, -0.0f, 1, -1, 1e-30f, 1e15f, NAN};
    tree_init(&t, SV_HABIT_BROADLEAF, 3000, 24);
    must(sv_cloud_light_measure(&t.mesh, &t.cloud, &light, &error), &error);
    assert_true(sv_cloud_light_sound(&light));
    struct sv_cloud_shift last = {0, 0, 0};
    for (int k = 0; k <= 3600; k++) {
        double a = k * SV_PI / 1800, e = 0.4 * SV_PI * sin(3 * a);
        float v[3] = {(float)(cos(a) * cos(e)), (float)(sin(a) * cos(e)), (float)sin(e)},
              l[3] = {0.5f, 0.3f, 0.6f};
        struct sv_cloud_shift s = sv_cloud_light_shift(&light, v, l);
        assert_true(s.sun > 0.7f && s.sun < 1.6f && s.sky > 0.7f && s.sky < 1.5f && fabsf(s.lift) < 0.3f);
        assert_true(k == 0 || (fabsf(s.sun - last.sun) < 0.02f && fabsf(s.sky - last.sky) < 0.02f));
        last = s;
    }
    for (int k = 0; k < 7 * 7 * 7; k++) {
        float d[3] = {odd[k % 7], odd[k / 7 % 7], odd[k / 49]}, up[3] = {0.1f, 0, 1};
        struct sv_cloud_shift a = sv_cloud_light_shift(&light, d, up),
                              b = sv_cloud_light_shift(&light, up, d);
        assert_true(isfinite(a.sun) && isfinite(a.sky) && isfinite(a.lift) && isfinite(b.sun) &&
                    isfinite(b.lift));
    }
    light.sky[1] = NAN;
    assert_false(sv_cloud_light_sound(&light));
    tree_finish(&t);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(samples_show_what_is_in_front),
        cmocka_unit_test(bars_keep_coverage),
        cmocka_unit_test(levels_keep_coverage_and_colour),
        cmocka_unit_test(outlines_hold_all),
        cmocka_unit_test(bytes_come_back),
        cmocka_unit_test(sides_out_of_range_are_refused),
        cmocka_unit_test(indirect_leaves_lie_where_leaves_do),
        cmocka_unit_test(layers_are_counted),
        cmocka_unit_test(parts_are_painted_in_order),
        cmocka_unit_test(light_is_shifted_smoothly),
    };
    sv_color_init();
    return cmocka_run_group_tests(tests, NULL, NULL);
}
