/* test_object_sun.c - a mesh as the sun sees it, against rays: each answer of the shadow map is compared with
 * a search of all triangles in double, and areas of outlines with closed forms. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <string.h>
#include <math.h>
#include <cmocka.h>

#include "core/base/frames.h"
#include "core/base/rng.h"
#include "core/relief/object_sun.h"
#include "tests/core/relief/object_fixture.h"

static struct sv_vec3 corner(const struct sv_tree_mesh *mesh, uint32_t index, double heading)
{
    const float *p = mesh->vertices[mesh->indices[index]].position;
    return sv_rotate_clockwise(sv_vec3((double)p[0], (double)p[1], (double)p[2]), heading);
}

/* Whether a ray meets a triangle at more than t_min (Moeller and Trumbore 1997). */
static bool meets(struct sv_vec3 o, struct sv_vec3 d, struct sv_vec3 a, struct sv_vec3 b, struct sv_vec3 c,
                  double t_min)
{
    struct sv_vec3 e = sv_sub(b, a), f = sv_sub(c, a), p = sv_cross(d, f), s = sv_sub(o, a);
    double det = sv_dot(e, p);
    if (fabs(det) < 1e-14)
        return false;
    double u = sv_dot(s, p) / det;
    struct sv_vec3 q = sv_cross(s, e);
    double v = sv_dot(d, q) / det;
    return u >= 0 && v >= 0 && u + v <= 1 && sv_dot(f, q) / det > t_min;
}

static bool hidden(const struct sv_tree_mesh *mesh, double heading, struct sv_vec3 p, struct sv_vec3 to_sun)
{
    for (uint32_t i = 0; i < mesh->index_count; i += 3)
        if (meets(p, to_sun, corner(mesh, i, heading), corner(mesh, i + 1, heading),
                  corner(mesh, i + 2, heading), 1e-6))
            return true;
    return false;
}

static struct sv_vec3 random_sun(struct sv_rng *rng)
{
    return sv_direction(sv_rng_range(rng, 0, 2 * SV_PI), sv_radians(sv_rng_range(rng, 4, 88)));
}

/* On the surface itself. Where map and ray differ, the point lies within two texels of the shadow's edge or
 * the sun grazes it: with 512 texels that is a few of a hundred points. */
static void surface_against_rays(void **state)
{
    (void)state;
    struct sv_tree_mesh mesh;
    struct sv_rng rng = sv_rng_seeded(11, 1);
    object_hut(&mesh);
    int asked = 0, wrong = 0, dark = 0;
    for (int k = 0; k < 40; k++) {
        struct sv_vec3 to_sun = random_sun(&rng);
        double heading = sv_rng_range(&rng, 0, 2 * SV_PI);
        struct sv_object_sun sun;
        assert_int_equal(sv_object_sun_create(&mesh, heading, sv_scale(to_sun, -1), 512, &sun, NULL), SV_OK);
        for (int i = 0; i < 500; i++) {
            uint32_t t = 3 * (uint32_t)sv_rng_range(&rng, 0, mesh.index_count / 3.0 - 1e-9);
            double u = sv_rng_unit(&rng), v = sv_rng_unit(&rng);
            if (u + v > 1)
                u = 1 - u, v = 1 - v;
            struct sv_vec3 a = corner(&mesh, t, heading), b = corner(&mesh, t + 1, heading),
                           c = corner(&mesh, t + 2, heading);
            struct sv_vec3 n = sv_normalize(sv_cross(sv_sub(b, a), sv_sub(c, a)));
            double cosine = fabs(sv_dot(n, to_sun));
            if (cosine < 0.05)
                continue;
            struct sv_vec3 p = sv_madd(sv_madd(a, sv_sub(b, a), u), sv_sub(c, a), v);
            double slope = sqrt(1 - cosine * cosine) / cosine;
            float seen = sv_object_sun_seen(&sun, p, 0.75 * sun.texel * (1 + 1.5 * fmin(slope, 8)));
            bool truth =
                hidden(&mesh, heading, sv_madd(p, sv_dot(n, to_sun) > 0 ? n : sv_scale(n, -1), 1e-6), to_sun);
            asked++;
            dark += truth;
            wrong += (seen < 0.5f) != truth;
        }
        sv_object_sun_finish(&sun);
    }
    printf("%d points of 40 suns, %d dark, %d judged otherwise (%.2f %%)\n", asked, dark, wrong,
           100.0 * wrong / asked);
    assert_true(asked > 15000 && dark > asked / 10);
    assert_true(wrong < 0.03 * asked);
    sv_tree_mesh_finish(&mesh);
}

/* In the air around: the shadow volume. */
static void space_against_rays(void **state)
{
    (void)state;
    struct sv_tree_mesh mesh;
    struct sv_rng rng = sv_rng_seeded(12, 1);
    object_hut(&mesh);
    int asked = 0, wrong = 0, dark = 0;
    for (int k = 0; k < 20; k++) {
        struct sv_vec3 to_sun = random_sun(&rng);
        struct sv_object_sun sun;
        assert_int_equal(sv_object_sun_create(&mesh, 1, sv_scale(to_sun, -1), 512, &sun, NULL), SV_OK);
        for (int i = 0; i < 500; i++) {
            struct sv_vec3 p = sv_vec3(sv_rng_range(&rng, -1.5, 1.5), sv_rng_range(&rng, -1.5, 1.5),
                                       sv_rng_range(&rng, 0, 1.2));
            bool truth = hidden(&mesh, 1, p, to_sun);
            asked++;
            dark += truth;
            wrong += (sv_object_sun_seen(&sun, p, 0) < 0.5f) != truth;
        }
        sv_object_sun_finish(&sun);
    }
    printf("%d places, %d dark, %d judged otherwise (%.2f %%)\n", asked, dark, wrong, 100.0 * wrong / asked);
    assert_true(dark > asked / 20);
    assert_true(wrong < 0.02 * asked);
    sv_tree_mesh_finish(&mesh);
}

/* The hut's walls alone are a box: a box of sides a, b, c shows a light of direction l the area a b |l.z| +
 * ... */
static void area_of_a_box(void **state)
{
    (void)state;
    static const float half = 0.5f;
    struct sv_tree_vertex vertices[8];
    static uint32_t indices[36] = {0, 2, 3, 0, 3, 1, 4, 5, 7, 4, 7, 6, 0, 1, 5, 0, 5, 4,
                                   2, 6, 7, 2, 7, 3, 0, 4, 6, 0, 6, 2, 1, 3, 7, 1, 7, 5};
    memset(vertices, 0, sizeof vertices);
    for (int k = 0; k < 8; k++) {
        vertices[k].position[0] = k & 1 ? 2 * half : -half;
        vertices[k].position[1] = k & 2 ? half : -half;
        vertices[k].position[2] = k & 4 ? 1 : 0;
    }
    struct sv_tree_mesh mesh = {
        .vertices = vertices, .vertex_count = 8, .indices = indices, .index_count = 36, .material_count = 1};
    mesh.materials[0].index_count = 36;
    struct sv_rng rng = sv_rng_seeded(13, 1);
    double worst = 0;
    for (int k = 0; k < 50; k++) {
        struct sv_vec3 to_sun = k == 0 ? sv_vec3(0, 0, 1) : k == 1 ? sv_vec3(0, 1, 0) : random_sun(&rng);
        double heading = k < 2 ? 0 : sv_rng_range(&rng, 0, 6.28);
        struct sv_object_sun sun;
        assert_int_equal(sv_object_sun_create(&mesh, heading, sv_scale(to_sun, -7), 400, &sun, NULL), SV_OK);
        const struct sv_silhouette *s = &sun.silhouette;
        long covered = 0;
        for (long i = 0; i < (long)s->width * s->height; i++) {
            covered += s->coverage[i] == 255;
            assert_true((s->coverage[i] == 255) == (s->first[i] < INFINITY));
            long x = i % s->width, y = i / s->width;
            if (x == 0 || y == 0 || x == s->width - 1 || y == s->height - 1)
                assert_int_equal(s->coverage[i], 0);
        }
        struct sv_vec3 l = sv_rotate_clockwise(to_sun, -heading);
        double expected = 1.5 * fabs(l.z) + 1.5 * fabs(l.y) + 1.0 * fabs(l.x);
        double got = (double)covered * sun.texel * sun.texel;
        worst = fmax(worst, fabs(got / expected - 1));
        assert_true(fabs(sv_dot(s->right, s->down)) < 1e-12 && fabs(sv_dot(s->right, s->travel)) < 1e-12);
        assert_true(fabs(s->right.z) < 1e-12 && s->down.z <= 1e-12); /* row 0 is nearest to the zenith */
        sv_object_sun_finish(&sun);
    }
    printf("area of 50 outlines: worst %.2f %% off\n", 100 * worst);
    assert_true(worst < 0.01);
}

/* A level sheet of 12 x 12 squares, each two triangles, under a sun straight above: at headings like these,
 * whole rows of texel centres lie on the triangles' edges. Every texel whose centre is on the sheet is
 * covered; what is farther than half a texel from it is not. */
static void no_texel_within_is_lit(void **state)
{
    (void)state;
    enum { CELLS = 12, SIDE = CELLS + 1 };
    static struct sv_tree_vertex vertices[SIDE * SIDE];
    static uint32_t indices[CELLS * CELLS * 6];
    for (int k = 0; k < SIDE * SIDE; k++) {
        vertices[k].position[0] = (float)(k % SIDE) / CELLS - 0.5f;
        vertices[k].position[1] = (float)(k / SIDE) / CELLS - 0.5f;
        vertices[k].position[2] = 1;
    }
    for (uint32_t k = 0; k < CELLS * CELLS; k++) {
        uint32_t at = k / CELLS * SIDE + k % CELLS, corner_of[6] = {0, 1, SIDE, 1, SIDE + 1, SIDE};
        for (int c = 0; c < 6; c++)
            indices[6 * k + (uint32_t)c] = at + corner_of[c];
    }
    struct sv_tree_mesh mesh = {.vertices = vertices,
                                .vertex_count = SIDE * SIDE,
                                .indices = indices,
                                .index_count = CELLS * CELLS * 6,
                                .material_count = 1};
    mesh.materials[0].index_count = mesh.index_count;
    long within = 0, lit = 0, beyond = 0;
    for (int k = 0; k < 24 * 8; k++) {
        double heading = sv_radians(15.0 * (k % 24));
        struct sv_object_sun sun;
        struct sv_vec3 to_sun = k & 1 ? sv_vec3(0, 0, 1) : sv_direction(heading, SV_PI / 2);
        assert_int_equal(
            sv_object_sun_create(&mesh, heading, sv_scale(to_sun, -1), 64 + 53 * (k / 24), &sun, NULL),
            SV_OK);
        const struct sv_silhouette *s = &sun.silhouette;
        for (int i = 0; i < s->width * s->height; i++) {
            struct sv_vec3 p = sv_madd(sv_madd(s->corner, s->right, (i % s->width + 0.5) * sun.texel),
                                       s->down, (i / s->width + 0.5) * sun.texel);
            p = sv_rotate_clockwise(p, -heading);
            double out = fmax(fabs(p.x), fabs(p.y)) - 0.5;
            within += out < 0;
            lit += out < 0 && !s->coverage[i];
            beyond += out > 0.5 * sun.texel && s->coverage[i];
        }
        sv_object_sun_finish(&sun);
    }
    printf("sun at 90 degrees: %ld texels within the outline, %ld lit; %ld dark beyond it\n", within, lit,
           beyond);
    assert_true(within > 1000000 && lit == 0 && beyond == 0);
}

static void refusals(void **state)
{
    (void)state;
    struct sv_tree_mesh mesh, none = {0};
    struct sv_object_sun sun = {0};
    struct sv_error error;
    object_hut(&mesh);
    assert_int_equal(sv_object_sun_create(&mesh, 0, sv_vec3(0, 0, 0), 64, &sun, &error), SV_EINVAL);
    assert_int_equal(sv_object_sun_create(&mesh, 0, sv_vec3(NAN, 0, 1), 64, &sun, &error), SV_EINVAL);
    assert_int_equal(sv_object_sun_create(&mesh, INFINITY, sv_vec3(0, 0, -1), 64, &sun, &error), SV_EINVAL);
    assert_int_equal(sv_object_sun_create(&mesh, 0, sv_vec3(0, 0, -1), 15, &sun, &error), SV_EINVAL);
    assert_int_equal(sv_object_sun_create(&mesh, 0, sv_vec3(0, 0, -1), 1025, &sun, &error), SV_EINVAL);
    assert_string_equal(error.field, "side");
    assert_int_equal(sv_object_sun_create(&none, 0, sv_vec3(0, 0, -1), 64, &sun, &error), SV_EINVAL);
    assert_null(sun.block); /* nothing was written */
    sv_object_sun_finish(&sun);
    sv_tree_mesh_finish(&mesh);
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(surface_against_rays),
                                       cmocka_unit_test(space_against_rays), cmocka_unit_test(area_of_a_box),
                                       cmocka_unit_test(no_texel_within_is_lit), cmocka_unit_test(refusals)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
