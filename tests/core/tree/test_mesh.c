/* test_mesh.c - checks, copies, saved bytes and measures of tree meshes, against closed forms. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "core/base/color.h"
#include "core/base/rng.h"
#include "core/tree/mesh.h"

/* A heap mesh of `cards` triangles' room, with one material; vertices and indices are added by add_triangle.
 */
static void start_mesh(struct sv_tree_mesh *mesh, uint32_t triangles, bool is_leaf)
{
    memset(mesh, 0, sizeof *mesh);
    mesh->vertices = calloc(3 * (size_t)triangles, sizeof *mesh->vertices);
    mesh->indices = calloc(3 * (size_t)triangles, sizeof *mesh->indices);
    assert_non_null(mesh->vertices);
    assert_non_null(mesh->indices);
    mesh->material_count = 1;
    struct sv_tree_material *m = &mesh->materials[0];
    strcpy(m->name, "test");
    for (int c = 0; c < 4; c++)
        m->base_color[c] = 1;
    m->is_leaf = m->two_sided = is_leaf;
    mesh->model_height = 1;
}

static void add_triangle(struct sv_tree_mesh *mesh, const double p[3][3], const double n[3])
{
    static const float uv[3][2] = {{0, 1}, {1, 1}, {0, 0}};
    for (int i = 0; i < 3; i++) {
        struct sv_tree_vertex *v = &mesh->vertices[mesh->vertex_count];
        for (int a = 0; a < 3; a++) {
            v->position[a] = (float)p[i][a];
            v->normal[a] = (int16_t)lrint(32767 * n[a]);
        }
        memcpy(v->uv, uv[i], sizeof v->uv);
        mesh->indices[mesh->index_count++] = mesh->vertex_count++;
    }
    mesh->materials[0].index_count = mesh->index_count;
    mesh->leaf_count += mesh->materials[0].is_leaf;
}

/* A small equilateral triangle of the area, at c, with unit normal n. */
static void add_card(struct sv_tree_mesh *mesh, const double c[3], const double n[3], double area)
{
    double a[3] = {fabs(n[2]) < 0.9 ? -n[1] : 0, fabs(n[2]) < 0.9 ? n[0] : -n[2],
                   fabs(n[2]) < 0.9 ? 0 : n[1]};
    double l = sqrt(a[0] * a[0] + a[1] * a[1] + a[2] * a[2]);
    for (int i = 0; i < 3; i++)
        a[i] /= l;
    double b[3] = {n[1] * a[2] - n[2] * a[1], n[2] * a[0] - n[0] * a[2], n[0] * a[1] - n[1] * a[0]};
    double r = sqrt(area / (0.75 * sqrt(3.0))), p[3][3]; /* circumradius */
    for (int k = 0; k < 3; k++)
        for (int i = 0; i < 3; i++)
            p[k][i] = c[i] + r * (cos(2.0943951 * k) * a[i] + sin(2.0943951 * k) * b[i]);
    add_triangle(mesh, (const double(*)[3])p, n);
}

static void random_unit(struct sv_rng *rng, double d[3])
{
    double z = sv_rng_range(rng, -1, 1), t = sv_rng_range(rng, 0, 6.283185307), r = sqrt(1 - z * z);
    d[0] = r * cos(t), d[1] = r * sin(t), d[2] = z;
}

/* Two tiny cards that fix the height to 0 .. 1 */
static void add_ends(struct sv_tree_mesh *mesh)
{
    const double low[3][3] = {{0, 0, 0}, {1e-4, 0, 0}, {0, 1e-4, 0}};
    const double high[3][3] = {{0, 0, 1}, {1e-4, 0, 1}, {0, 1e-4, 1}}, up[3] = {0, 0, 1};
    add_triangle(mesh, low, up);
    add_triangle(mesh, high, up);
}

/* A sound mesh with two materials, one textured: what the tests of bytes start from. */
static void make_sample(struct sv_tree_mesh *mesh)
{
    start_mesh(mesh, 8, false);
    struct sv_error error;
    struct sv_rng rng = {5};
    add_ends(mesh);
    for (int i = 0; i < 4; i++) {
        double c[3] = {sv_rng_range(&rng, -0.3, 0.3), sv_rng_range(&rng, -0.3, 0.3), 0.5}, n[3];
        random_unit(&rng, n);
        add_card(mesh, c, n, 0.01);
    }
    mesh->materials[0].index_count = 6;
    mesh->materials[1] = mesh->materials[0];
    struct sv_tree_material *leaf = &mesh->materials[1];
    leaf->first_index = 6;
    leaf->index_count = 12;
    leaf->is_leaf = leaf->masked = leaf->two_sided = true;
    leaf->alpha_cutoff = 0.5f;
    leaf->translucency = 0.25f;
    mesh->material_count = 2;
    mesh->leaf_count = 4;
    assert_int_equal(sv_image_alloc(3, 2, 4, SV_PIXEL_U8, &leaf->albedo, NULL), SV_OK);
    for (int i = 0; i < 24; i++)
        ((uint8_t *)leaf->albedo.data)[i] = (uint8_t)(10 * i + 7);
    enum sv_status status = sv_tree_mesh_measure(mesh, &error);
    if (status != SV_OK)
        print_error("%s: %s\n", error.field, error.message);
    assert_int_equal(status, SV_OK);
}

static void assert_same(const struct sv_tree_mesh *a, const struct sv_tree_mesh *b)
{
    assert_int_equal(a->vertex_count, b->vertex_count);
    assert_int_equal(a->index_count, b->index_count);
    assert_int_equal(a->material_count, b->material_count);
    assert_int_equal(a->leaf_count, b->leaf_count);
    assert_memory_equal(a->vertices, b->vertices, a->vertex_count * sizeof *a->vertices);
    assert_memory_equal(a->indices, b->indices, a->index_count * sizeof *a->indices);
    assert_memory_equal(&a->radius, &b->radius, sizeof a->radius);
    assert_memory_equal(&a->crown_base, &b->crown_base, sizeof a->crown_base);
    assert_memory_equal(a->crown_color, b->crown_color, sizeof a->crown_color);
    assert_memory_equal(&a->model_height, &b->model_height, sizeof a->model_height);
    for (int i = 0; i < a->material_count; i++) {
        struct sv_tree_material x = a->materials[i], y = b->materials[i];
        assert_string_equal(x.name, y.name);
        assert_memory_equal(x.base_color, y.base_color, sizeof x.base_color);
        assert_int_equal(x.is_leaf, y.is_leaf);
        assert_int_equal(x.masked, y.masked);
        assert_int_equal(x.two_sided, y.two_sided);
        assert_true(x.alpha_cutoff == y.alpha_cutoff && x.translucency == y.translucency);
        assert_int_equal(x.first_index, y.first_index);
        assert_int_equal(x.index_count, y.index_count);
        assert_int_equal(x.albedo.width, y.albedo.width);
        assert_int_equal(x.albedo.height, y.albedo.height);
        if (x.albedo.data)
            assert_memory_equal(x.albedo.data, y.albedo.data, sv_image_bytes(&x.albedo));
        else
            assert_null(y.albedo.data);
    }
}

static void test_finish_is_safe(void **state)
{
    (void)state;
    struct sv_tree_mesh mesh = {0};
    sv_tree_mesh_finish(&mesh);
    make_sample(&mesh);
    sv_tree_mesh_finish(&mesh);
    assert_null(mesh.vertices);
    sv_tree_mesh_finish(&mesh);
}

static void test_arena_copy_is_deep(void **state)
{
    (void)state;
    struct sv_tree_mesh mesh, copy;
    struct sv_arena *arena;
    struct sv_error error;
    make_sample(&mesh);
    assert_int_equal(sv_arena_create(1 << 20, &arena, &error), SV_OK);
    assert_int_equal(sv_tree_mesh_to_arena(&mesh, arena, &copy, &error), SV_OK);
    assert_ptr_not_equal(mesh.vertices, copy.vertices);
    assert_ptr_not_equal(mesh.indices, copy.indices);
    assert_ptr_not_equal(mesh.materials[1].albedo.data, copy.materials[1].albedo.data);
    assert_same(&mesh, &copy);
    sv_arena_destroy(arena);
    /* A reserve of one page has no room for 24 vertices and more than a page of pixels. */
    sv_image_free(&mesh.materials[1].albedo);
    assert_int_equal(sv_image_alloc(64, 64, 4, SV_PIXEL_U8, &mesh.materials[1].albedo, NULL), SV_OK);
    assert_int_equal(sv_arena_create(4096, &arena, &error), SV_OK);
    copy.vertex_count = 77;
    assert_int_equal(sv_tree_mesh_to_arena(&mesh, arena, &copy, &error), SV_ENOMEM);
    assert_int_equal(copy.vertex_count, 77); /* untouched on failure */
    sv_arena_destroy(arena);
    sv_tree_mesh_finish(&mesh);
}

static void test_saved_bytes_come_back(void **state)
{
    (void)state;
    struct sv_tree_mesh mesh, back;
    struct sv_error error;
    void *data, *again;
    size_t bytes, bytes_again;
    make_sample(&mesh);
    assert_int_equal(sv_tree_mesh_save(&mesh, &data, &bytes, &error), SV_OK);
    assert_int_equal(sv_tree_mesh_load(data, bytes, &back, &error), SV_OK);
    assert_same(&mesh, &back);
    assert_int_equal(sv_tree_mesh_save(&back, &again, &bytes_again, &error), SV_OK);
    assert_int_equal(bytes, bytes_again);
    assert_memory_equal(data, again, bytes);
    free(again);
    sv_tree_mesh_finish(&back);

    /* Every shorter block, and a longer one, is refused; out stays as it was. */
    unsigned char *longer = malloc(bytes + 1);
    assert_non_null(longer);
    memcpy(longer, data, bytes);
    longer[bytes] = 0;
    back.leaf_count = 12345;
    for (size_t n = 0; n <= bytes + 1; n++)
        if (n != bytes) {
            unsigned char *exact = malloc(n ? n : 1); /* so that ASan sees a read past the end */
            assert_non_null(exact);
            memcpy(exact, longer, n);
            assert_int_equal(sv_tree_mesh_load(exact, n, &back, &error), SV_EFORMAT);
            free(exact);
        }
    assert_int_equal(sv_tree_mesh_load(NULL, 0, &back, &error), SV_EFORMAT);
    assert_int_equal(back.leaf_count, 12345);
    free(longer);
    free(data);
    sv_tree_mesh_finish(&mesh);
}

/* Each breach of the header's contract is found and named. */
static void test_breaches_are_named(void **state)
{
    (void)state;
    struct sv_tree_mesh mesh;
    struct sv_error error;
    make_sample(&mesh);
    struct sv_tree_vertex *v = &mesh.vertices[4];
    struct sv_tree_material *m = &mesh.materials[1];
#define BREACH(lvalue, bad, name)                                        \
    do {                                                                 \
        __typeof__(lvalue) keep = (lvalue);                              \
        (lvalue) = (bad);                                                \
        assert_int_equal(sv_tree_mesh_check(&mesh, &error), SV_EFORMAT); \
        assert_string_equal(error.field, name);                          \
        (lvalue) = keep;                                                 \
        assert_int_equal(sv_tree_mesh_check(&mesh, &error), SV_OK);      \
    } while (0)
    BREACH(mesh.vertex_count, 0, "mesh.vertex_count");
    BREACH(mesh.vertex_count, SV_TREE_VERTICES_MAX + 1, "mesh.vertex_count");
    BREACH(mesh.vertex_count, mesh.vertex_count - 1, "mesh.indices");
    BREACH(mesh.index_count, 0, "mesh.index_count");
    BREACH(mesh.index_count, 17, "mesh.index_count");
    BREACH(mesh.index_count, 3u * SV_TREE_TRIANGLES_MAX + 3u, "mesh.index_count");
    BREACH(mesh.index_count, 15, "mesh.materials.first_index");
    BREACH(mesh.material_count, 0, "mesh.material_count");
    BREACH(mesh.material_count, 1, "mesh.materials");
    BREACH(mesh.material_count, SV_TREE_MATERIALS_MAX + 1, "mesh.material_count");
    BREACH(mesh.leaf_count, 7, "mesh.leaf_count");
    BREACH(mesh.indices[17], 18, "mesh.indices");
    BREACH(m->first_index, 3, "mesh.materials.first_index");
    BREACH(m->index_count, 0xFFFFFFFDu, "mesh.materials.first_index");
    BREACH(m->base_color[1], NAN, "mesh.materials.base_color");
    BREACH(m->base_color[3], -1, "mesh.materials.base_color");
    BREACH(m->alpha_cutoff, 1.5f, "mesh.materials.alpha_cutoff");
    BREACH(m->translucency, NAN, "mesh.materials.alpha_cutoff");
    BREACH(m->albedo.channels, 3, "mesh.materials.albedo");
    BREACH(m->albedo.width, 4097, "mesh.materials.albedo");
    BREACH(m->albedo.data, NULL, "mesh.materials.albedo");
    BREACH(v->position[2], NAN, "mesh.vertices.position");
    BREACH(v->position[0], INFINITY, "mesh.vertices.position");
    BREACH(v->normal[0], 32767, "mesh.vertices.normal");
    BREACH(v->uv[0], NAN, "mesh.vertices.uv");
    BREACH(v->open[3], -1, "mesh.vertices.open");
    BREACH(mesh.radius, -1, "mesh.radius");
    BREACH(mesh.model_height, INFINITY, "mesh.radius");
    BREACH(mesh.crown_color[2], NAN, "mesh.crown_color");
#undef BREACH
    memset(m->name, 'x', sizeof m->name);
    assert_int_equal(sv_tree_mesh_check(&mesh, &error), SV_EFORMAT);
    void *data = NULL;
    size_t bytes = 0;
    assert_int_equal(sv_tree_mesh_save(&mesh, &data, &bytes, &error), SV_EFORMAT);
    assert_null(data);
    sv_tree_mesh_finish(&mesh);
}

static double open_at(const struct sv_tree_mesh *mesh, uint32_t vertex)
{
    return mesh->vertices[vertex].occlusion / 65535.0;
}

static const double BALL = 0.48; /* radius; the cards reach a little farther */
static const double BALL_VOLUME = 4.0 / 3.0 * SV_PI * 0.48 * 0.48 * 0.48;

/* n leaves of the area, uniform in the ball around (0, 0, 1/2), any orientation; then probes at its centre,
 * foot, top and eastern side. Returns the first probe's vertex. */
static uint32_t make_ball(struct sv_tree_mesh *mesh, uint32_t n, double area, uint64_t seed)
{
    struct sv_rng rng = sv_rng_seeded(seed, 1);
    start_mesh(mesh, n + 8, true);
    for (uint32_t i = 0; i < n;) {
        double c[3], d[3];
        for (int a = 0; a < 3; a++)
            c[a] = sv_rng_range(&rng, -BALL, BALL);
        if (c[0] * c[0] + c[1] * c[1] + c[2] * c[2] > BALL * BALL)
            continue;
        c[2] += 0.5;
        random_unit(&rng, d);
        add_card(mesh, c, d, area);
        i++;
    }
    uint32_t probe = mesh->vertex_count;
    const double up[3] = {0, 0, 1},
                 at[4][3] = {{0, 0, 0.5}, {0, 0, 0.5 - BALL}, {0, 0, 0.5 + BALL}, {BALL, 0, 0.5}};
    for (int k = 0; k < 4; k++)
        add_card(mesh, at[k], up, 1e-9);
    add_ends(mesh);
    return probe;
}

/* Beer's law in a uniform ball: extinction s = n a / (2 V). Centre: every way out is R long. Foot: the way
 * towards elevation e has length 2 R sin e; the overcast sky weighs it by (1 + 2 sin e) / 3. Top: nothing
 * above. The sum over 16 directions differs from the integral by under 1.5 % here; the grid blurs the ball's
 * edge by two thirds of a voxel (1/64), which is a path of 0.7/64 of leaves that are not there. */
static void test_occlusion_of_a_uniform_ball(void **state)
{
    (void)state;
    static const double densities[] = {1, 3, 6};
    for (int k = 0; k < 3; k++) {
        struct sv_tree_mesh mesh;
        struct sv_error error;
        uint32_t n = 40000;
        double s = densities[k], area = 2 * BALL_VOLUME * s / n;
        uint32_t probe = make_ball(&mesh, n, area, 3);
        assert_int_equal(sv_tree_mesh_measure(&mesh, &error), SV_OK);
        double foot = 0, steps = 2000;
        for (int i = 0; i < steps; i++) {
            double z = (i + 0.5) / steps;
            foot += (1 + 2 * z) * exp(-s * 2 * BALL * z) / (2 * steps);
        }
        double got[3] = {open_at(&mesh, probe), open_at(&mesh, probe + 3), open_at(&mesh, probe + 6)};
        double want[3] = {exp(-BALL * s), foot, 1};
        for (int i = 0; i < 3; i++)
            if (fabs(got[i] - want[i]) > 0.015 + 0.7 * s / 64)
                fail_msg("extinction %g, probe %d: expected %.4f +- %.3f, got %.4f", s, i, want[i],
                         0.015 + 0.7 * s / 64, got[i]);
        assert_true(fabs((double)mesh.radius - BALL) < 0.02);
        sv_tree_mesh_finish(&mesh);
    }
}

/* Openness to the sun in the ball, against Beer's law along the true way out. Centre: R long whatever the
 * direction. Eastern side: nothing in the way of an eastern sun, 2 R cos of the angle to the west for a
 * western one; there the stored linear function can only be the best fit, which is computed here anew over
 * 4,000 directions of the upper sky. */
static void test_open_in_a_uniform_ball(void **state)
{
    (void)state;
    enum { DIRECTIONS = 4000 };
    struct sv_tree_mesh mesh;
    struct sv_error error;
    const double s = 3;
    uint32_t probe = make_ball(&mesh, 40000, 2 * BALL_VOLUME * s / 40000, 3);
    assert_int_equal(sv_tree_mesh_measure(&mesh, &error), SV_OK);
    double xx = 0, n = 0, z1 = 0, zz = 0, tx = 0, t1 = 0, tz = 0;
    for (int k = 0; k < DIRECTIONS; k++) {
        double z = (k + 0.5) / DIRECTIONS, a = k * 2.39996322972865332, x = sqrt(1 - z * z) * cos(a);
        double t = exp(-s * 2 * BALL * fmax(0, -x));
        xx += x * x, n += 1, z1 += z, zz += z * z, tx += t * x, t1 += t, tz += t * z;
    }
    double det = n * zz - z1 * z1, mean = (zz * t1 - z1 * tz) / det, slope_z = (n * tz - z1 * t1) / det;
    for (int k = 0; k < 200; k++) {
        double z = (k + 0.5) / 200, a = k * 2.39996322972865332, across = sqrt(1 - z * z);
        const float d[3] = {(float)(across * cos(a)), (float)(across * sin(a)), (float)z};
        double centre = (double)sv_tree_vertex_open(&mesh.vertices[probe], d);
        double side = (double)sv_tree_vertex_open(&mesh.vertices[probe + 9], d);
        double want = sv_clamp(tx / xx * (double)d[0] + slope_z * z + mean, 0, 1);
        /* 16 directions for all of the sky, 7 bits a coefficient, the grid's blurred edge: see above. */
        if (fabs(centre - exp(-BALL * s)) > 0.05 || fabs(side - want) > 0.09)
            fail_msg("towards (%.2f %.2f %.2f): centre %.3f, expected %.3f; side %.3f, expected %.3f",
                     (double)d[0], (double)d[1], z, centre, exp(-BALL * s), side, want);
    }
    const float east[3] = {0.8f, 0, 0.6f}, west[3] = {-0.8f, 0, 0.6f};
    assert_true(sv_tree_vertex_open(&mesh.vertices[probe + 9], east) >
                3 * sv_tree_vertex_open(&mesh.vertices[probe + 9], west));
    sv_tree_mesh_finish(&mesh);
}

/* A mask that keeps half of every card halves the extinction. */
static void test_mask_thins_the_crown(void **state)
{
    (void)state;
    struct sv_tree_mesh mesh;
    struct sv_error error;
    uint32_t n = 20000, probe = make_ball(&mesh, n, 2 * BALL_VOLUME * 6.0 / n, 4);
    struct sv_tree_material *m = &mesh.materials[0];
    assert_int_equal(sv_image_alloc(2, 2, 4, SV_PIXEL_U8, &m->albedo, NULL), SV_OK);
    /* The cards' uv triangle (0,1) (1,1) (0,0) holds texels (0,0) half, (0,1) whole, (1,1) half: keep the
     * whole one. */
    static const uint8_t texels[16] = {255, 0, 0, 0, 255, 0, 0, 0, 0, 188, 0, 255, 255, 0, 0, 0};
    memcpy(m->albedo.data, texels, sizeof texels);
    m->masked = true;
    m->alpha_cutoff = 0.5f;
    assert_int_equal(sv_tree_mesh_measure(&mesh, &error), SV_OK);
    assert_true(fabs(open_at(&mesh, probe) - exp(-BALL * 3.0)) < 0.05);
    /* and only what it keeps has a colour: sRGB 188 is linear 0.503 */
    assert_true(mesh.crown_color[0] < 1e-6f && fabsf(mesh.crown_color[1] - 0.503f) < 0.01f);
    sv_tree_mesh_finish(&mesh);
}

/* Wood: a free-standing column's faces look at an open sky; a wall's foot in a corner does not. */
static void test_lone_column_is_open(void **state)
{
    (void)state;
    struct sv_tree_mesh mesh;
    struct sv_error error;
    start_mesh(&mesh, 24, false);
    for (int k = 0; k < 12; k++) {
        double a0 = SV_PI / 6 * k, a1 = a0 + SV_PI / 6, am = 0.5 * (a0 + a1), r = 0.015;
        double n[3] = {cos(am), sin(am), 0};
        const double low[3][3] = {
            {r * cos(a0), r * sin(a0), 0}, {r * cos(a1), r * sin(a1), 0}, {r * cos(a1), r * sin(a1), 1}};
        const double high[3][3] = {
            {r * cos(a0), r * sin(a0), 0}, {r * cos(a1), r * sin(a1), 1}, {r * cos(a0), r * sin(a0), 1}};
        add_triangle(&mesh, low, n);
        add_triangle(&mesh, high, n);
    }
    assert_int_equal(sv_tree_mesh_measure(&mesh, &error), SV_OK);
    for (uint32_t i = 0; i < mesh.vertex_count; i++)
        assert_true(open_at(&mesh, i) > 0.75);
    assert_true(mesh.crown_base == 0);
    assert_true(fabsf(mesh.crown_color[0] - 1) < 1e-6f); /* leafless: the wood's */
    sv_tree_mesh_finish(&mesh);
}

static void test_measure_refuses_other_heights(void **state)
{
    (void)state;
    struct sv_tree_mesh mesh;
    struct sv_error error;
    make_sample(&mesh);
    mesh.vertices[3].position[2] = 1.01f;
    assert_int_equal(sv_tree_mesh_measure(&mesh, &error), SV_EFORMAT);
    assert_string_equal(error.field, "mesh.vertices.position");
    mesh.vertices[3].position[2] = NAN;
    assert_int_equal(sv_tree_mesh_measure(&mesh, &error), SV_EFORMAT);
    sv_tree_mesh_finish(&mesh);
}

/* Far wider than high, and a single speck: no division by nothing, no runaway grid. */
static void test_measure_of_odd_extents(void **state)
{
    (void)state;
    struct sv_tree_mesh mesh;
    struct sv_error error;
    start_mesh(&mesh, 4, true);
    const double wide[3][3] = {{-9000, 0, 0.5}, {9000, 0, 0.5}, {0, 9000, 0.5}}, up[3] = {0, 0, 1};
    add_triangle(&mesh, wide, up);
    add_ends(&mesh);
    assert_int_equal(sv_tree_mesh_measure(&mesh, &error), SV_OK);
    assert_true(fabsf(mesh.radius - 9000) < 1);
    sv_tree_mesh_finish(&mesh);
    start_mesh(&mesh, 4, true); /* a line of no area */
    const double line[3][3] = {{0, 0, 0}, {0, 0, 1}, {0, 0, 0.5}}, side[3] = {1, 0, 0};
    add_triangle(&mesh, line, side);
    assert_int_equal(sv_tree_mesh_measure(&mesh, &error), SV_OK);
    assert_true(mesh.radius == 0);
    sv_tree_mesh_finish(&mesh);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_finish_is_safe),
        cmocka_unit_test(test_arena_copy_is_deep),
        cmocka_unit_test(test_saved_bytes_come_back),
        cmocka_unit_test(test_breaches_are_named),
        cmocka_unit_test(test_occlusion_of_a_uniform_ball),
        cmocka_unit_test(test_open_in_a_uniform_ball),
        cmocka_unit_test(test_mask_thins_the_crown),
        cmocka_unit_test(test_lone_column_is_open),
        cmocka_unit_test(test_measure_refuses_other_heights),
        cmocka_unit_test(test_measure_of_odd_extents),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
