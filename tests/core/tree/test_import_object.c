/* test_import_object.c - model files as objects: where they stand, what their names may not do, normals, and
 * the sky that their vertices see, against brute force. */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <unistd.h>

#include <cmocka.h>

#include "core/tree/import.h"

static char path[128];

struct imported {
    struct sv_tree_mesh mesh;
    struct sv_errors notes;
};

static void import_text(const char *text, struct imported *in)
{
    struct sv_error error;
    FILE *f = fopen(path, "w");
    assert_non_null(f);
    assert_int_equal(fwrite(text, 1, strlen(text), f), strlen(text));
    assert_int_equal(fclose(f), 0);
    memset(in, 0, sizeof *in);
    sv_errors_init(&in->notes);
    if (sv_object_import(path, &in->mesh, &in->notes, &error))
        fail_msg("%s: %s", error.field, error.message);
}

static void finish(struct imported *in)
{
    sv_tree_mesh_finish(&in->mesh);
    sv_errors_finish(&in->notes);
}

/* A box of (lo .. hi), Y up, as six quads with outward corners in order. */
static void box_text(char *text, size_t size, const double lo[3], const double hi[3])
{
    size_t n = 0;
    for (int k = 0; k < 8; k++)
        n += (size_t)snprintf(text + n, size - n, "v %.9g %.9g %.9g\n", k & 1 ? hi[0] : lo[0],
                              k & 2 ? hi[1] : lo[1], k & 4 ? hi[2] : lo[2]);
    snprintf(text + n, size - n,
             "o leaf_bark\nf 1 3 4 2\nf 5 6 8 7\nf 1 2 6 5\nf 3 7 8 4\nf 1 5 7 3\nf 2 4 8 6\n");
}

static void bounds(const struct sv_tree_mesh *mesh, float lo[3], float hi[3])
{
    for (int a = 0; a < 3; a++)
        lo[a] = INFINITY, hi[a] = -INFINITY;
    for (uint32_t i = 0; i < mesh->vertex_count; i++)
        for (int a = 0; a < 3; a++) {
            lo[a] = fminf(lo[a], mesh->vertices[i].position[a]);
            hi[a] = fmaxf(hi[a], mesh->vertices[i].position[a]);
        }
}

/* Its own origin inside of the plan, and on its corner; the middle when the origin lies outside. A 2 x 4 x 6
 * box: east, up, south. */
static void test_anchor(void **state)
{
    (void)state;
    static const struct {
        double lo[3];
        float x, y; /* lowest corner to the east and to the north, heights */
        const char *note;
    } cases[] = {
        {{-0.5, 7, -3}, -0.125f, -0.75f, NULL},
        {{0, -9, 0},
         0,
         -1.5f,
         "far from the middle of its ground plan: that is 0.25 heights to the east and -0.75"},
        {{1e6, 0, -3}, -0.25f, -0.75f, "origin lies outside"},
    };
    for (size_t k = 0; k < sizeof cases / sizeof cases[0]; k++) {
        char text[1024];
        const double *lo = cases[k].lo, hi[3] = {lo[0] + 2, lo[1] + 4, lo[2] + 6};
        struct imported in;
        float low[3], high[3];
        box_text(text, sizeof text, lo, hi);
        import_text(text, &in);
        bounds(&in.mesh, low, high);
        assert_true(fabsf(low[0] - cases[k].x) < 1e-5f && fabsf(low[1] - cases[k].y) < 1e-5f && low[2] == 0);
        assert_true(fabsf(high[0] - low[0] - 0.5f) < 1e-5f && fabsf(high[1] - low[1] - 1.5f) < 1e-5f &&
                    high[2] == 1);
        assert_true(fabsf(in.mesh.model_height - 4) < 1e-5f);
        assert_int_equal(in.notes.count, cases[k].note != NULL);
        if (cases[k].note)
            assert_non_null(strstr(in.notes.items[0].message, cases[k].note));
        finish(&in);
    }
}

/* A convex body on open ground hides nothing from itself; its edges of 90 degrees stay sharp; "leaf" in its
 * name says nothing.
 */
static void test_box(void **state)
{
    (void)state;
    char text[1024];
    struct imported in;
    box_text(text, sizeof text, (double[]){-1, 0, -1}, (double[]){1, 3, 1});
    import_text(text, &in);
    assert_int_equal(in.mesh.index_count, 36);
    assert_int_equal(in.mesh.vertex_count, 24);
    assert_int_equal(in.mesh.leaf_count, 0);
    for (int k = 0; k < in.mesh.material_count; k++)
        assert_false(in.mesh.materials[k].is_leaf || in.mesh.materials[k].masked);
    for (uint32_t i = 0; i < in.mesh.vertex_count; i++) {
        const struct sv_tree_vertex *v = &in.mesh.vertices[i];
        int axes = 0;
        for (int a = 0; a < 3; a++)
            axes += abs(v->normal[a]) > 32700;
        assert_int_equal(axes, 1);
        if (v->occlusion < 63000) /* 4 %: points within the map's bias of a rim see past it from inside */
            fail_msg("sky %u at normal (%d, %d, %d)", v->occlusion, v->normal[0], v->normal[1], v->normal[2]);
        assert_memory_equal(v->open, ((const int8_t[]){0, 0, 0, 127}), 4); /* lit from everywhere */
    }
    finish(&in);
}

/* A prism of 12 sides: 30 degrees from side to side are smooth, the lids are not. */
static void test_creases(void **state)
{
    (void)state;
    char text[4096];
    size_t n = 0;
    for (int k = 0; k < 12; k++)
        for (int top = 0; top < 2; top++)
            n += (size_t)snprintf(text + n, sizeof text - n, "v %.9g %d %.9g\n", cos(k * 0.5235987755982988),
                                  3 * top, sin(k * 0.5235987755982988));
    for (int k = 0; k < 12; k++) {
        int a = 2 * k + 1, b = 2 * ((k + 1) % 12) + 1;
        n += (size_t)snprintf(text + n, sizeof text - n, "f %d %d %d %d\n", a, a + 1, b + 1, b);
    }
    n += (size_t)snprintf(text + n, sizeof text - n, "f 24 22 20 18 16 14 12 10 8 6 4 2\n");
    struct imported in;
    import_text(text, &in);
    int side = 0, lid = 0;
    for (uint32_t i = 0; i < in.mesh.vertex_count; i++) {
        const struct sv_tree_vertex *v = &in.mesh.vertices[i];
        const float *p = v->position;
        float radial =
            (p[0] * v->normal[0] + p[1] * v->normal[1]) / 32767.0f / sqrtf(p[0] * p[0] + p[1] * p[1]);
        if (abs(v->normal[2]) > 32000) {
            lid++;
        } else {
            assert_true(radial > 0.9999f); /* the mean of both neighbours: straight out */
            side++;
        }
    }
    assert_true(side >= 24 && side <= 48 && lid == 12);
    finish(&in);
}

/* A floor of N x N squares with a wall along x = 0 on it, 1 high. What the floor sees, summed over a fine
 * grid of directions whose rays are cut with the wall's rectangle, weighted as import_sky.c's head says. */
enum { N = 24 };
static double floor_sky(double x, double y)
{
    enum { RINGS = 400, STEPS = 800 };
    double sum = 0, total = 0;
    for (int r = 0; r < RINGS; r++)
        for (int s = 0; s < STEPS; s++) {
            double z = (r + 0.5) / RINGS, across = sqrt(1 - z * z),
                   a = 2 * 3.14159265358979 * (s + 0.5) / STEPS;
            double dx = across * cos(a), dy = across * sin(a), weight = z * (1 + 2 * z) / 3;
            double t = -x / dx; /* to the wall's plane */
            bool hidden = t > 0 && t * z < 1 && fabs(y + t * dy) < 1;
            total += weight;
            sum += hidden ? 0 : weight;
        }
    return sum / total;
}

static void test_sky_against_rays(void **state)
{
    (void)state;
    static char text[1 << 17];
    size_t n = 0;
    for (int j = 0; j <= N; j++)
        for (int i = 0; i <= N; i++)
            n += (size_t)snprintf(text + n, sizeof text - n, "v %.9g 0 %.9g\n", 2.0 * i / N - 1,
                                  2.0 * j / N - 1);
    for (int j = 0; j < N; j++)
        for (int i = 0; i < N; i++) {
            int a = j * (N + 1) + i + 1;
            n += (size_t)snprintf(text + n, sizeof text - n, "f %d %d %d %d\n", a, a + N + 1, a + N + 2,
                                  a + 1);
        }
    int first = (N + 1) * (N + 1) + 1;
    snprintf(text + n, sizeof text - n, "v 0 0 -1\nv 0 0 1\nv 0 1 1\nv 0 1 -1\nf %d %d %d %d\n", first,
             first + 1, first + 2, first + 3);
    struct imported in;
    import_text(text, &in);
    double worst = 0, darkest = 1;
    int count = 0;
    for (uint32_t i = 0; i < in.mesh.vertex_count; i++) {
        const struct sv_tree_vertex *v = &in.mesh.vertices[i];
        double x = (double)v->position[0], y = (double)v->position[1];
        if (abs(v->normal[2]) < 32000 || fabs(x) > 0.9 || fabs(y) > 0.9 || fabs(x) < 0.12 || count % 3) {
            count += abs(v->normal[2]) >= 32000;
            continue;
        }
        count++;
        double got = v->occlusion / 65535.0, off = got - floor_sky(x, y);
        worst = fmax(worst, fabs(off));
        darkest = fmin(darkest, got);
    }
    printf("floor beside a wall: darkest %.2f, worst %.3f off the rays\n", darkest, worst);
    /* 128 directions: a step of the wall's edge across one of them is 1/64 of the half sphere's light, the
     * mean over a vertex's triangles (1/12 wide) bends by as much */
    assert_true(darkest < 0.75 && worst < 0.05);
    finish(&in);
}

static void test_refused(void **state)
{
    (void)state;
    struct sv_tree_mesh mesh = {0};
    struct sv_error error;
    assert_int_equal(sv_object_import("/nowhere/at.obj", &mesh, NULL, &error), SV_ENOENT);
    FILE *f = fopen(path, "w");
    fputs("v 0 0 0\nv 1 0 0\nv 0 0 1\nf 1 2 3\n", f);
    fclose(f);
    assert_int_equal(sv_object_import(path, &mesh, NULL, &error), SV_EFORMAT);
    assert_non_null(strstr(error.message, "no object stands in it"));
    assert_null(mesh.vertices);
}

/* Counts as the sources state them; none black. */
static void test_real(void **state)
{
    (void)state;
    static const struct {
        const char *file;
        uint32_t triangles;
        double height;
    } models[] = {{"german_house/germanvillagehouse1.ac", 14, 7.6},
                  {"church/big-church.ac", 25, 30.8},
                  {"rock1/rock1.obj", 332, 50},
                  {"spot/spot_textured.obj", 5856, 1.69},
                  {"bunny/bunny.ply", 16301, 0.153}};
    const char *data = getenv("SV_DATA");
    int seen = 0;
    for (size_t k = 0; k < sizeof models / sizeof models[0]; k++) {
        char name[512];
        struct sv_tree_mesh mesh = {0};
        struct sv_error error;
        snprintf(name, sizeof name, "%s/objects/%s", data ? data : "../shared/data", models[k].file);
        if (access(name, R_OK) != 0)
            continue;
        if (sv_object_import(name, &mesh, NULL, &error))
            fail_msg("%s: %s", error.field, error.message);
        double sum = 0;
        for (uint32_t i = 0; i < mesh.vertex_count; i++)
            sum += mesh.vertices[i].occlusion / 65535.0 / mesh.vertex_count;
        printf("%s: %u triangles, %g high, mean sky %.2f\n", models[k].file, mesh.index_count / 3,
               (double)mesh.model_height, sum);
        assert_int_equal(mesh.index_count / 3, models[k].triangles);
        assert_true(fabs((double)mesh.model_height / models[k].height - 1) < 0.02);
        assert_true(sum > 0.6);
        assert_int_equal(mesh.leaf_count, 0);
        sv_tree_mesh_finish(&mesh);
        seen++;
    }
    if (!seen) {
        printf("skipped: no real models here\n");
        skip();
    }
}

int main(void)
{
    char folder[] = "/tmp/silvista-object-XXXXXX";
    if (!mkdtemp(folder))
        return 1;
    snprintf(path, sizeof path, "%s/object.obj", folder);
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_anchor),  cmocka_unit_test(test_box),
        cmocka_unit_test(test_creases), cmocka_unit_test(test_sky_against_rays),
        cmocka_unit_test(test_refused), cmocka_unit_test(test_real)};
    int failed = cmocka_run_group_tests(tests, NULL, NULL);
    unlink(path);
    rmdir(folder);
    return failed;
}
