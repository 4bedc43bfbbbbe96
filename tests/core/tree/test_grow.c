/* test_grow.c - grown trees: exact counts, shape, attachment, sameness, and the arithmetic they rest on. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "core/base/color.h"
#include "core/base/hash.h"
#include "core/tree/grow.h"
#include "core/tree/grow_math.h"
#include "core/tree/grow_parts.h"

static void grow(enum sv_habit habit, uint32_t leaves, uint64_t seed, struct sv_tree_mesh *mesh)
{
    struct sv_error error;
    if (sv_tree_grow(habit, leaves, seed, mesh, &error) != SV_OK)
        fail_msg("%s %u seed %llu: %s: %s", sv_habit_name(habit), leaves, (unsigned long long)seed,
                 error.field, error.message);
}

struct triangle {
    struct sv_vec3 p[3], n; /* n: area-weighted normal / 2 */
    double area;
};

static struct sv_vec3 place(const struct sv_tree_mesh *mesh, uint32_t vertex)
{
    const float *p = mesh->vertices[vertex].position;
    return sv_vec3((double)p[0], (double)p[1], (double)p[2]);
}

static struct triangle triangle_at(const struct sv_tree_mesh *mesh, uint32_t first)
{
    struct triangle t;
    for (int k = 0; k < 3; k++)
        t.p[k] = place(mesh, mesh->indices[first + (uint32_t)k]);
    t.n = sv_scale(sv_cross(sv_sub(t.p[1], t.p[0]), sv_sub(t.p[2], t.p[0])), 0.5);
    t.area = sv_length(t.n);
    return t;
}

/* What must hold of every grown tree. */
static void assert_sound(const struct sv_tree_mesh *mesh, enum sv_habit habit, uint32_t leaves, uint64_t seed)
{
    struct sv_error error;
    assert_int_equal(sv_tree_mesh_check(mesh, &error), SV_OK);
    assert_int_equal(mesh->leaf_count, leaves);
    assert_int_equal(mesh->material_count, leaves ? 2 : 1);
    assert_false(mesh->materials[0].is_leaf);
    if (leaves) {
        const struct sv_tree_material *leaf = &mesh->materials[1];
        assert_true(leaf->is_leaf && leaf->masked && leaf->two_sided);
        assert_int_equal(leaf->index_count, 6 * leaves);
        assert_non_null(leaf->albedo.data);
    }
    float low = INFINITY, high = -INFINITY;
    for (uint32_t i = 0; i < mesh->vertex_count; i++) {
        low = fminf(low, mesh->vertices[i].position[2]);
        high = fmaxf(high, mesh->vertices[i].position[2]);
    }
    assert_true(low == 0);
    assert_true(fabsf(high - 1) < 1e-6f);
    static const float radius_max[SV_HABIT_COUNT] = {0.55f, 0.30f, 0.22f, 0.85f, 0.65f};
    if (mesh->radius > radius_max[habit] || mesh->radius < 0.05f)
        fail_msg("%s %u seed %llu: radius %g", sv_habit_name(habit), leaves, (unsigned long long)seed,
                 (double)mesh->radius);
    uint32_t flat = 0;
    for (uint32_t i = 0; i < mesh->index_count; i += 3)
        flat += triangle_at(mesh, i).area < 1e-12;
    assert_true(flat <= mesh->index_count / 3 / 1000);
}

static void test_counts_are_exact(void **state)
{
    (void)state;
    static const uint32_t counts[] = {0, 1, 10, 137, 2999, 38952};
    static const uint64_t seeds[] = {7, UINT64_MAX};
    for (int h = 0; h < SV_HABIT_COUNT; h++)
        for (size_t c = 0; c < sizeof counts / sizeof *counts; c++)
            for (size_t s = 0; s < 2; s++) {
                struct sv_tree_mesh mesh;
                grow((enum sv_habit)h, counts[c], seeds[s], &mesh);
                assert_sound(&mesh, (enum sv_habit)h, counts[c], seeds[s]);
                uint32_t wood = mesh.materials[0].index_count / 3;
                assert_true(wood > 500);
                if (counts[c] == 38952) /* a quarter of the leaves' triangles, and half a percent */
                    assert_true(wood <= 0.255 * 2 * counts[c]);
                sv_tree_mesh_finish(&mesh);
            }
}

static void test_a_million_leaves(void **state)
{
    (void)state;
    struct sv_tree_mesh mesh;
    grow(SV_HABIT_BROADLEAF, SV_GROW_LEAVES_MAX, 1, &mesh);
    assert_sound(&mesh, SV_HABIT_BROADLEAF, SV_GROW_LEAVES_MAX, 1);
    sv_tree_mesh_finish(&mesh);
}

static void test_bad_arguments(void **state)
{
    (void)state;
    struct sv_tree_mesh mesh = {.leaf_count = 99};
    struct sv_error error;
    assert_int_equal(sv_tree_grow(SV_HABIT_COUNT, 10, 1, &mesh, &error), SV_EINVAL);
    assert_string_equal(error.field, "habit");
    assert_int_equal(sv_tree_grow(SV_HABIT_PALM, SV_GROW_LEAVES_MAX + 1, 1, &mesh, &error), SV_EINVAL);
    assert_string_equal(error.field, "leaves");
    assert_int_equal(mesh.leaf_count, 99);
    assert_string_equal(sv_habit_name(SV_HABIT_POPLAR), "poplar");
    assert_string_equal(sv_habit_name(SV_HABIT_COUNT), "unknown habit");
}

/* Distance from q to a triangle: the plane's foot if inside, otherwise the nearest edge. */
static double distance_to(const struct triangle *t, struct sv_vec3 q)
{
    double best = INFINITY;
    bool inside = t->area > 0;
    for (int k = 0; k < 3; k++) {
        struct sv_vec3 a = t->p[k], d = sv_sub(t->p[(k + 1) % 3], a), r = sv_sub(q, a);
        double dd = sv_dot(d, d), s = dd > 0 ? sv_clamp(sv_dot(r, d) / dd, 0, 1) : 0;
        best = fmin(best, sv_length(sv_madd(r, d, -s)));
        inside = inside && sv_dot(sv_cross(d, r), t->n) >= 0;
    }
    return inside ? fabs(sv_dot(sv_sub(q, t->p[0]), t->n)) / t->area : best;
}

/* A leaf's base, the middle of its lower edge, sits in or on the wood: brute force over all wood for some 80
 * leaves. */
static void test_leaves_hang_on_wood(void **state)
{
    (void)state;
    static const uint32_t counts[] = {50, 4000, 38952};
    for (int h = 0; h < SV_HABIT_COUNT; h++)
        for (int c = 0; c < 3; c++) {
            struct sv_tree_mesh mesh;
            grow((enum sv_habit)h, counts[c], 5, &mesh);
            const struct sv_tree_material *wood = &mesh.materials[0], *leaf = &mesh.materials[1];
            /* half a twig's thickness, or a frond's midrib's: 4 cm (10 cm) on a tree of 25 m */
            double allowed = h == SV_HABIT_PALM ? 0.004 : 0.0016;
            for (uint32_t i = 0; i < counts[c]; i += 1 + counts[c] / 80) {
                const uint32_t *quad = &mesh.indices[leaf->first_index + 6 * i];
                struct sv_vec3 base = sv_grow_mix(place(&mesh, quad[0]), place(&mesh, quad[1]), 0.5);
                double best = INFINITY;
                for (uint32_t k = 0; k < wood->index_count && best > 1e-4; k += 3) {
                    struct triangle t = triangle_at(&mesh, wood->first_index + k);
                    best = fmin(best, distance_to(&t, base));
                }
                if (best > allowed)
                    fail_msg(
                        "%s of %u leaves: leaf %u at (%.4f %.4f %.4f) is %.5f off the wood, allowed %.5f",
                        sv_habit_name((enum sv_habit)h), counts[c], i, base.x, base.y, base.z, best, allowed);
            }
            sv_tree_mesh_finish(&mesh);
        }
}

/* Normals look where the triangles' winding says: out of the wood, to the front of leaves. */
static void test_normals_follow_winding(void **state)
{
    (void)state;
    for (int h = 0; h < SV_HABIT_COUNT; h++) {
        struct sv_tree_mesh mesh;
        grow((enum sv_habit)h, 3000, 2, &mesh);
        uint32_t against = 0, total = 0;
        for (uint32_t i = 0; i < mesh.index_count; i += 3) {
            struct triangle t = triangle_at(&mesh, i);
            for (int k = 0; k < 3; k++, total++) {
                const int16_t *n = mesh.vertices[mesh.indices[i + (uint32_t)k]].normal;
                against += sv_dot(t.n, sv_vec3(n[0], n[1], n[2])) < 0;
            }
        }
        /* tips and sharp bends of thin wood may fold a face or two */
        if (against > total / 200)
            fail_msg("%s: %u of %u corners look against their triangle", sv_habit_name((enum sv_habit)h),
                     against, total);
        sv_tree_mesh_finish(&mesh);
    }
}

static double leaf_area(const struct sv_tree_mesh *mesh)
{
    const struct sv_tree_material *leaf = &mesh->materials[1];
    double area = 0;
    for (uint32_t i = 0; i < leaf->index_count; i += 3)
        area += triangle_at(mesh, leaf->first_index + i).area;
    long kept = 0, texels = (long)leaf->albedo.width * leaf->albedo.height;
    for (long i = 0; i < texels; i++)
        kept += ((const uint8_t *)leaf->albedo.data)[4 * i + 3] >= 128;
    return area * (double)kept / (double)texels;
}

/* Area of the ground under the crown: cells of 1/40 that hold a leaf. */
static double ground_area(const struct sv_tree_mesh *mesh)
{
    static unsigned char cell[80][80];
    memset(cell, 0, sizeof cell);
    const struct sv_tree_material *leaf = &mesh->materials[1];
    long held = 0;
    for (uint32_t i = 0; i < leaf->index_count; i++) {
        struct sv_vec3 p = place(mesh, mesh->indices[leaf->first_index + i]);
        cell[(int)sv_clamp(40 + 40 * p.x, 0, 79)][(int)sv_clamp(40 + 40 * p.y, 0, 79)] = 1;
    }
    for (int i = 0; i < 80; i++)
        for (int j = 0; j < 80; j++)
            held += cell[i][j];
    return held / 1600.0;
}

static void test_leaf_area_suits_the_crown(void **state)
{
    (void)state;
    static const double low[SV_HABIT_COUNT] = {3, 5, 7, 3, 2.5}, high[SV_HABIT_COUNT] = {6, 11, 16, 6, 5};
    for (int h = 0; h < SV_HABIT_COUNT; h++) {
        struct sv_tree_mesh many, few;
        grow((enum sv_habit)h, 38952, 3, &many);
        grow((enum sv_habit)h, 6000, 3, &few);
        double index = leaf_area(&many) / ground_area(&many);
        if (index < low[h] || index > high[h])
            fail_msg("%s: leaf area index %.2f, expected %g .. %g", sv_habit_name((enum sv_habit)h), index,
                     low[h], high[h]);
        /* few leaves are larger: the same area within a tenth (fewer twigs shift the crown's outline a
         * little) */
        double ratio = leaf_area(&few) / leaf_area(&many);
        if (fabs(ratio - 1) > 0.12)
            fail_msg("%s: 6000 leaves have %.3f times the area of 38952", sv_habit_name((enum sv_habit)h),
                     ratio);
        sv_tree_mesh_finish(&many);
        sv_tree_mesh_finish(&few);
    }
}

/* Green, neither neon nor black, and open outside while dark inside. */
static void test_crown_looks_natural(void **state)
{
    (void)state;
    for (int h = 0; h < SV_HABIT_COUNT; h++) {
        struct sv_tree_mesh mesh;
        grow((enum sv_habit)h, 38952, 4, &mesh);
        const float *c = mesh.crown_color;
        assert_true(c[1] > 0.04f && c[1] < 0.15f && c[1] > 1.2f * c[0] && c[0] > c[2] && c[2] > 0.01f);
        double top = 0, top_n = 0, all = 0, darkest = 1;
        for (uint32_t i = 0; i < mesh.materials[1].index_count; i++) {
            const struct sv_tree_vertex *v = &mesh.vertices[mesh.indices[mesh.materials[1].first_index + i]];
            double open = v->occlusion / 65535.0;
            all += open / mesh.materials[1].index_count;
            darkest = fmin(darkest, open);
            if (v->position[2] > 0.97f)
                top += open, top_n++;
        }
        if (top / top_n < 0.7 || all > 0.75 || all < 0.2 || darkest > 0.4)
            fail_msg("%s: open sky at the top %.2f, on average %.2f, darkest %.2f",
                     sv_habit_name((enum sv_habit)h), top / top_n, all, darkest);
        sv_tree_mesh_finish(&mesh);
    }
}

static void test_textures(void **state)
{
    (void)state;
    for (int h = 0; h < SV_HABIT_COUNT; h++) {
        struct sv_tree_mesh mesh;
        grow((enum sv_habit)h, 1, 4, &mesh);
        const struct sv_image *leaf = &mesh.materials[1].albedo, *bark = &mesh.materials[0].albedo;
        double in[3] = {0}, out[3] = {0};
        long kept = 0, texels = (long)leaf->width * leaf->height;
        for (long i = 0; i < texels; i++) {
            const uint8_t *t = (const uint8_t *)leaf->data + 4 * i;
            kept += t[3] >= 128;
            for (int c = 0; c < 3; c++)
                *(t[3] ? &in[c] : &out[c]) += t[c];
        }
        assert_true(kept >= 0.55 * (double)texels);
        for (int c = 0; c < 3; c++) /* no dark halo: what is cut away looks like leaf */
            assert_true(fabs(out[c] / (double)(texels - kept) / (in[c] / (double)kept) - 1) < 0.4);
        /* bark tiles: across the seam it changes as much as anywhere (mean absolute step of luminance, both
         * directions) */
        double seam[2] = {0, 0}, inner[2] = {0, 0};
        int n = bark->width;
        for (int j = 0; j < n; j++)
            for (int i = 0; i < n; i++)
                for (int d = 0; d < 2; d++) {
                    int i2 = d ? i : (i + 1) % n, j2 = d ? (j + 1) % n : j;
                    const uint8_t *a = (const uint8_t *)bark->data + 4 * (j * n + i);
                    const uint8_t *b = (const uint8_t *)bark->data + 4 * (j2 * n + i2);
                    double step = abs(a[0] + a[1] + a[2] - b[0] - b[1] - b[2]);
                    *((d ? j2 : i2) ? &inner[d] : &seam[d]) += step / ((d ? j2 : i2) ? n * (n - 1.0) : n);
                }
        for (int d = 0; d < 2; d++)
            if (seam[d] > 2.0 * inner[d] + 1)
                fail_msg("%s: bark's seam steps by %.2f, its inside by %.2f", sv_habit_name((enum sv_habit)h),
                         seam[d], inner[d]);
        sv_tree_mesh_finish(&mesh);
    }
}

static uint64_t hash_mesh(const struct sv_tree_mesh *mesh)
{
    uint64_t h = SV_HASH_INIT;
    for (uint32_t i = 0; i < mesh->vertex_count; i++) {
        h = sv_hash_bytes(h, mesh->vertices[i].position, sizeof mesh->vertices[i].position);
        h = sv_hash_bytes(h, mesh->vertices[i].normal, sizeof mesh->vertices[i].normal);
        h = sv_hash_bytes(h, mesh->vertices[i].uv, sizeof mesh->vertices[i].uv);
    }
    h = sv_hash_bytes(h, mesh->indices, mesh->index_count * sizeof *mesh->indices);
    for (int m = 0; m < mesh->material_count; m++)
        h = sv_hash_bytes(h, mesh->materials[m].albedo.data, sv_image_bytes(&mesh->materials[m].albedo));
    return sv_hash_done(h);
}

/* The same bytes from every compiler and C library (grow_math.h says why). A change that is meant raises
 * SV_GROW_VERSION and pins the new hashes, which the failure prints. */
static void test_same_tree_everywhere(void **state)
{
    (void)state;
    static const uint64_t pinned[SV_HABIT_COUNT] = {
        UINT64_C(0x746C9FED264801E3), UINT64_C(0x5CAAB7F2473977BE), UINT64_C(0xEE12A6B4E974256A),
        UINT64_C(0x6BA77F313CE426DB), UINT64_C(0xE172A87687331BA3)};
    bool same = true;
    for (int h = 0; h < SV_HABIT_COUNT; h++) {
        struct sv_tree_mesh mesh, again, other;
        grow((enum sv_habit)h, 1500, 42, &mesh);
        grow((enum sv_habit)h, 1500, 42, &again);
        grow((enum sv_habit)h, 1500, 43, &other);
        uint64_t hash = hash_mesh(&mesh);
        assert_true(hash == hash_mesh(&again));
        assert_true(hash != hash_mesh(&other));
        if (hash != pinned[h])
            print_error("%s: UINT64_C(0x%016llX)\n", sv_habit_name((enum sv_habit)h),
                        (unsigned long long)hash);
        same = same && hash == pinned[h];
        sv_tree_mesh_finish(&mesh);
        sv_tree_mesh_finish(&again);
        sv_tree_mesh_finish(&other);
    }
    assert_true(same);
}

static void test_arithmetic(void **state)
{
    (void)state;
    struct sv_rng rng = {11};
    for (int i = 0; i < 200000; i++) {
        double x = i < 100 ? (i - 50) * SV_PI / 4 : sv_rng_range(&rng, -1e4, 1e4), s, c;
        sv_grow_sincos(x, &s, &c);
        /* series truncation 1e-16, reduction |k| 1e-17 for |x| < 1e4 */
        if (fabs(s - sin(x)) > 2e-12 || fabs(c - cos(x)) > 2e-12)
            fail_msg("x = %.17g: sin %.17g, expected %.17g; cos %.17g, expected %.17g", x, s, sin(x), c,
                     cos(x));
        double b = exp(sv_rng_range(&rng, -40, 40)), e = sv_rng_range(&rng, -8, 8), want = pow(b, e);
        if (!(fabs(sv_grow_pow(b, e) - want) <= 1e-12 * want))
            fail_msg("%.17g ^ %.17g: %.17g, expected %.17g", b, e, sv_grow_pow(b, e), want);
    }
    assert_true(sv_grow_pow(0, 2) == 0 && sv_grow_pow(-1, 2) == 0 && sv_grow_pow(1, 5) == 1);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_arithmetic),
        cmocka_unit_test(test_bad_arguments),
        cmocka_unit_test(test_counts_are_exact),
        cmocka_unit_test(test_leaves_hang_on_wood),
        cmocka_unit_test(test_normals_follow_winding),
        cmocka_unit_test(test_leaf_area_suits_the_crown),
        cmocka_unit_test(test_crown_looks_natural),
        cmocka_unit_test(test_textures),
        cmocka_unit_test(test_same_tree_everywhere),
        cmocka_unit_test(test_a_million_leaves),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
