/* test_lod.c - the refined mesh against what it stands for: no cracks, the rectangle covered once, errors
 * under the bound that was asked for (brute force over samples and random points), the finest level equal to
 * heightfield.h. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include <cmocka.h>

#include "core/base/rng.h"
#include "core/terrain/lod.h"

static const int sizes[][2] = {{2, 2},    {3, 2},     {2, 5},    {3, 3},  {17, 33},
                               {100, 57}, {129, 129}, {66, 131}, {5, 300}};
enum { SIZE_COUNT = sizeof sizes / sizeof sizes[0] };

/* ---- fields ---- */

enum shape { NOISE, HILLS, FLAT, CLIFF };

static float height_of(enum shape shape, int i, int j, struct sv_rng *rng)
{
    double x = i * 0.11, y = j * 0.07;
    switch (shape) {
    case NOISE:
        return (float)sv_rng_range(rng, -40, 40);
    case HILLS:
        return (float)(60 * sin(x) * cos(1.3 * y) + 8 * sin(5 * x + 3 * y) + sv_rng_unit(rng) * 0.2);
    case FLAT:
        return 12.5f;
    case CLIFF:
        return i > j ? 300.0f : 0.0f;
    }
    return 0;
}

static struct sv_heightfield make_field(enum shape shape, int width, int height, uint64_t seed)
{
    struct sv_rng rng = sv_rng_seeded(seed, 1);
    float *h = malloc((size_t)width * (size_t)height * sizeof *h);
    struct sv_heightfield f = {.width = width,
                               .height = height,
                               .x0 = 512345.25,
                               .y0 = 7654321.5,
                               .dx = 10,
                               .dy = 7,
                               .z0 = 700,
                               .h_min = INFINITY,
                               .h_max = -INFINITY,
                               .h = h};
    assert_non_null(h);
    for (int j = 0; j < height; j++)
        for (int i = 0; i < width; i++) {
            float v = height_of(shape, i, j, &rng);
            h[j * width + i] = v;
            f.h_min = fminf(f.h_min, v);
            f.h_max = fmaxf(f.h_max, v);
        }
    return f;
}

static struct sv_terrain_lod *make_lod(const struct sv_heightfield *f)
{
    struct sv_terrain_lod *lod = NULL;
    struct sv_error error;
    if (sv_terrain_lod_create(f, NULL, &lod, &error))
        fail_msg("%s", error.message);
    return lod;
}

/* ---- cameras ---- */

static struct sv_camera camera_over(const struct sv_heightfield *f, struct sv_rng *rng)
{
    double x1 = sv_heightfield_x1(f), y1 = sv_heightfield_y1(f), pad = 50;
    struct sv_camera c = {
        .eye = sv_vec3(sv_rng_range(rng, f->x0 - pad, x1 + pad), sv_rng_range(rng, f->y0 - pad, y1 + pad),
                       f->z0 + (double)f->h_max + exp(sv_rng_range(rng, log(1.7), log(900)))),
        .vfov_rad = sv_radians(sv_rng_range(rng, 20, 120)),
        .width = 320,
        .height = 240,
        .near_m = 0.1};
    sv_camera_aim(&c, sv_rng_range(rng, 0, 2 * SV_PI), sv_rng_range(rng, -SV_PI / 2, 0.3),
                  sv_rng_range(rng, -0.4, 0.4));
    return c;
}

/* Sees the whole field from above; perspective, so that errors depend on the view, too. */
static struct sv_camera camera_of_all(const struct sv_heightfield *f, double above_m)
{
    struct sv_camera c = {.eye = sv_vec3(0.5 * (f->x0 + sv_heightfield_x1(f)),
                                         0.5 * (f->y0 + sv_heightfield_y1(f)),
                                         f->z0 + (double)f->h_max + above_m),
                          .vfov_rad = sv_radians(179.9),
                          .width = 512,
                          .height = 512,
                          .near_m = 0.1};
    sv_camera_aim(&c, 0.3, -SV_PI / 2, 0);
    return c;
}

static void refine(const struct sv_terrain_lod *lod, const struct sv_camera *c, double error_px,
                   struct sv_terrain_mesh *mesh)
{
    struct sv_error error;
    if (sv_terrain_lod_refine(lod, c, NULL, error_px, mesh, &error))
        fail_msg("%s", error.message);
    assert_true(mesh->max_error_px <= error_px * (1 + 1e-12));
}

/* ---- topology ---- */

struct edge {
    uint32_t from, to; /* samples, from < to */
    int32_t balance, count;
};

static int by_ends(const void *a, const void *b)
{
    const struct edge *p = a, *q = b;
    if (p->from != q->from)
        return p->from < q->from ? -1 : 1;
    return p->to < q->to ? -1 : p->to > q->to;
}

static struct edge edge_between(uint32_t a, uint32_t b)
{
    return a < b ? (struct edge){a, b, 1, 1} : (struct edge){b, a, -1, 1};
}

static bool on_border(const struct sv_heightfield *f, uint32_t a, uint32_t b)
{
    uint32_t w = (uint32_t)f->width, top = (uint32_t)f->height - 1;
    return (a % w == 0 && b % w == 0) || (a % w == w - 1 && b % w == w - 1) || (a / w == 0 && b / w == 0) ||
           (a / w == top && b / w == top);
}

static bool outside_view(const struct sv_heightfield *f, const struct sv_camera *c, uint32_t a, uint32_t b)
{
    double planes[5][4];
    sv_camera_planes(c, planes);
    for (int k = 0; k < 5; k++) {
        int out = 0;
        for (int e = 0; e < 2; e++) {
            uint32_t s = e ? b : a, w = (uint32_t)f->width;
            struct sv_vec3 p =
                sv_vec3(f->x0 + (s % w) * f->dx - c->eye.x, f->y0 + (double)(s / w) * f->dy - c->eye.y,
                        f->z0 + (double)f->h[s] - c->eye.z);
            out += planes[k][0] * p.x + planes[k][1] * p.y + planes[k][2] * p.z + planes[k][3] < 0;
        }
        if (out == 2)
            return true;
    }
    return false;
}

/* Every edge belongs to two triangles that run along it in opposite directions, or to one when it lies on the
 * field's border or out of sight. That leaves no room for a crack or a T-junction. */
static void check_edges(const struct sv_heightfield *f, const struct sv_camera *c,
                        const struct sv_terrain_mesh *mesh)
{
    size_t n = (size_t)mesh->triangle_count * 3;
    struct edge *edges = malloc((n + 1) * sizeof *edges);
    assert_non_null(edges);
    for (size_t t = 0; t < n; t += 3)
        for (size_t k = 0; k < 3; k++)
            edges[t + k] = edge_between(mesh->samples[mesh->indices[t + k]],
                                        mesh->samples[mesh->indices[t + (k + 1) % 3]]);
    qsort(edges, n, sizeof *edges, by_ends);
    for (size_t k = 0; k < n;) {
        size_t last = k + 1;
        int balance = edges[k].balance;
        for (; last < n && by_ends(&edges[k], &edges[last]) == 0; last++)
            balance += edges[last].balance;
        uint32_t a = edges[k].from, b = edges[k].to;
        if (last - k == 1 ? !on_border(f, a, b) && !outside_view(f, c, a, b) : last - k != 2 || balance != 0)
            fail_msg("field %d x %d: edge %u - %u belongs to %zu triangles (balance %d)", f->width, f->height,
                     a, b, last - k, balance);
        k = last;
    }
    free(edges);
}

/* Twice the signed area in cells, exact. */
static int64_t double_area(const struct sv_heightfield *f, const uint32_t *samples, const uint32_t *index)
{
    int64_t w = f->width, x[3], y[3];
    for (int k = 0; k < 3; k++) {
        x[k] = samples[index[k]] % w;
        y[k] = samples[index[k]] / w;
    }
    return (x[1] - x[0]) * (y[2] - y[0]) - (x[2] - x[0]) * (y[1] - y[0]);
}

static int64_t check_areas(const struct sv_heightfield *f, const struct sv_terrain_mesh *mesh)
{
    int64_t sum = 0;
    for (uint32_t t = 0; t < mesh->triangle_count; t++) {
        int64_t area = double_area(f, mesh->samples, mesh->indices + 3 * (size_t)t);
        assert_true(area > 0);
        sum += area;
    }
    return sum;
}

static void meshes_have_no_cracks(void **state)
{
    (void)state;
    static const double errors_px[] = {0, 0.3, 1, 4, 20};
    struct sv_rng rng = sv_rng_seeded(17, 2);
    struct sv_terrain_mesh mesh = {0};
    for (int s = 0; s < SIZE_COUNT; s++)
        for (int shape = NOISE; shape <= CLIFF; shape++) {
            struct sv_heightfield f = make_field((enum shape)shape, sizes[s][0], sizes[s][1], 5);
            struct sv_terrain_lod *lod = make_lod(&f);
            for (int k = 0; k < 30; k++) {
                struct sv_camera c = camera_over(&f, &rng);
                refine(lod, &c, errors_px[k % 5], &mesh);
                check_edges(&f, &c, &mesh);
                check_areas(&f, &mesh);
            }
            sv_terrain_lod_destroy(lod);
            free((void *)(uintptr_t)f.h);
        }
    sv_terrain_mesh_finish(&mesh);
}

static void meshes_cover_the_rectangle_once(void **state)
{
    (void)state;
    static const double errors_px[] = {0, 0.5, 2, 10, 100};
    struct sv_terrain_mesh mesh = {0};
    for (int s = 0; s < SIZE_COUNT; s++)
        for (int shape = NOISE; shape <= CLIFF; shape++) {
            struct sv_heightfield f = make_field((enum shape)shape, sizes[s][0], sizes[s][1], 9);
            struct sv_terrain_lod *lod = make_lod(&f);
            for (int k = 0; k < 15; k++) {
                struct sv_camera c = camera_of_all(&f, 5 + 100 * (k / 5));
                refine(lod, &c, errors_px[k % 5], &mesh);
                check_edges(&f, &c, &mesh);
                assert_int_equal(check_areas(&f, &mesh), 2 * (int64_t)(f.width - 1) * (f.height - 1));
            }
            sv_terrain_lod_destroy(lod);
            free((void *)(uintptr_t)f.h);
        }
    sv_terrain_mesh_finish(&mesh);
}

/* ---- the finest level ---- */

/* Bit k of a cell: triangle k of heightfield.h is there; vertices as a bit set of the cell's corners (1 = i,
 * j; 2 = i + 1, j; 4 = i, j + 1; 8 = i + 1, j + 1). */
static int cell_triangle(const struct sv_heightfield *f, const uint32_t s[3], uint32_t *cell)
{
    uint32_t w = (uint32_t)f->width, i = UINT32_MAX, j = UINT32_MAX;
    int corners = 0;
    for (int k = 0; k < 3; k++) {
        i = s[k] % w < i ? s[k] % w : i;
        j = s[k] / w < j ? s[k] / w : j;
    }
    for (int k = 0; k < 3; k++)
        corners |= 1 << ((s[k] % w - i) + 2 * (s[k] / w - j));
    *cell = j * w + i;
    int first = (i + j) % 2 == 0 ? 1 + 2 + 8 : 1 + 2 + 4, second = (i + j) % 2 == 0 ? 1 + 4 + 8 : 2 + 4 + 8;
    return corners == first ? 1 : corners == second ? 2 : 0;
}

static void finest_level_is_the_field(void **state)
{
    (void)state;
    struct sv_terrain_mesh mesh = {0};
    for (int s = 0; s < SIZE_COUNT; s++) {
        struct sv_heightfield f = make_field(HILLS, sizes[s][0], sizes[s][1], 3);
        struct sv_terrain_lod *lod = make_lod(&f);
        struct sv_camera c = camera_of_all(&f, 10);
        uint8_t *seen = calloc((size_t)f.width * (size_t)f.height, 1);
        assert_non_null(seen);
        refine(lod, &c, 0, &mesh);
        assert_int_equal(mesh.triangle_count, 2 * (f.width - 1) * (f.height - 1));
        assert_int_equal(mesh.vertex_count, f.width * f.height);
        for (uint32_t t = 0; t < mesh.triangle_count; t++) {
            const uint32_t *index = mesh.indices + 3 * (size_t)t;
            uint32_t corner[3] = {mesh.samples[index[0]], mesh.samples[index[1]], mesh.samples[index[2]]},
                     cell;
            int which = cell_triangle(&f, corner, &cell);
            assert_true(which != 0 && !(seen[cell] & which));
            seen[cell] = (uint8_t)(seen[cell] | which);
        }
        for (uint32_t v = 0; v < mesh.vertex_count; v++) {
            uint32_t i = mesh.samples[v] % (uint32_t)f.width, j = mesh.samples[v] / (uint32_t)f.width;
            assert_true(mesh.vertices[3 * v] == (float)(f.x0 - c.eye.x + i * f.dx));
            assert_true(mesh.vertices[3 * v + 1] == (float)(f.y0 - c.eye.y + j * f.dy));
        }
        free(seen);
        sv_terrain_lod_destroy(lod);
        free((void *)(uintptr_t)f.h);
    }
    sv_terrain_mesh_finish(&mesh);
}

/* ---- errors ---- */

/* Distance in the picture between surface and mesh at (x, y), when either is in the picture; else 0. */
static double gap_px(const struct sv_camera *c, double x, double y, double surface_z, double mesh_z)
{
    double ax, ay, bx, by, depth;
    bool a = sv_camera_project(c, sv_vec3(x, y, surface_z), &ax, &ay, &depth);
    bool b = sv_camera_project(c, sv_vec3(x, y, mesh_z), &bx, &by, &depth);
    if (!a || !b)
        return 0;
    bool a_seen = ax >= 0 && ay >= 0 && ax <= c->width && ay <= c->height;
    bool b_seen = bx >= 0 && by >= 0 && bx <= c->width && by <= c->height;
    return a_seen || b_seen ? hypot(ax - bx, ay - by) : 0;
}

struct triangle {
    double x[3], y[3], z[3]; /* grid units, height */
};

static struct triangle triangle_of(const struct sv_heightfield *f, const struct sv_terrain_mesh *mesh,
                                   uint32_t t)
{
    struct triangle r;
    for (int k = 0; k < 3; k++) {
        uint32_t s = mesh->samples[mesh->indices[3 * (size_t)t + (size_t)k]];
        r.x[k] = s % (uint32_t)f->width;
        r.y[k] = s / (uint32_t)f->width;
        r.z[k] = (double)f->h[s];
    }
    return r;
}

/* Height of the triangle over (x, y), false outside. */
static bool height_on(const struct triangle *t, double x, double y, double *z)
{
    double det = (t->x[1] - t->x[0]) * (t->y[2] - t->y[0]) - (t->x[2] - t->x[0]) * (t->y[1] - t->y[0]);
    double b = ((x - t->x[0]) * (t->y[2] - t->y[0]) - (t->x[2] - t->x[0]) * (y - t->y[0])) / det;
    double c = ((t->x[1] - t->x[0]) * (y - t->y[0]) - (x - t->x[0]) * (t->y[1] - t->y[0])) / det;
    *z = t->z[0] + b * (t->z[1] - t->z[0]) + c * (t->z[2] - t->z[0]);
    return b >= -1e-9 && c >= -1e-9 && b + c <= 1 + 1e-9;
}

/* The surface's height in grid units, from the triangulation as heightfield.h words it. */
static double surface_at(const struct sv_heightfield *f, double x, double y)
{
    int i = (int)fmin(floor(x), f->width - 2), j = (int)fmin(floor(y), f->height - 2);
    double u = x - i, v = y - j;
    const float *p = f->h + (size_t)j * (size_t)f->width + i;
    double a = (double)p[0], b = (double)p[1], c = (double)p[f->width], d = (double)p[f->width + 1];
    if ((i + j) % 2 == 0)
        return u > v ? a + u * (b - a) + v * (d - b) : a + v * (c - a) + u * (d - c);
    return u + v < 1 ? a + u * (b - a) + v * (c - a) : d + (1 - u) * (c - d) + (1 - v) * (b - d);
}

static double largest_gap_px(const struct sv_heightfield *f, const struct sv_camera *c,
                             const struct sv_terrain_mesh *mesh, struct sv_rng *rng)
{
    double worst = 0;
    for (uint32_t n = 0; n < mesh->triangle_count; n++) {
        struct triangle t = triangle_of(f, mesh, n);
        double x0 = fmin(t.x[0], fmin(t.x[1], t.x[2])), x1 = fmax(t.x[0], fmax(t.x[1], t.x[2]));
        double y0 = fmin(t.y[0], fmin(t.y[1], t.y[2])), y1 = fmax(t.y[0], fmax(t.y[1], t.y[2])), z;
        for (int k = 0; k < 6; k++) {
            double x = sv_rng_range(rng, x0, x1), y = sv_rng_range(rng, y0, y1);
            if (height_on(&t, x, y, &z))
                worst = fmax(worst, gap_px(c, f->x0 + x * f->dx, f->y0 + y * f->dy,
                                           f->z0 + surface_at(f, x, y), f->z0 + z));
        }
        for (double y = y0; y <= y1; y++)
            for (double x = x0; x <= x1; x++)
                if (height_on(&t, x, y, &z))
                    worst = fmax(worst, gap_px(c, f->x0 + x * f->dx, f->y0 + y * f->dy,
                                               f->z0 + surface_at(f, x, y), f->z0 + z));
    }
    return worst;
}

/* The bound holds, and it is not idle: over the views some come within a half of it. */
static void errors_stay_under_the_bound(void **state)
{
    (void)state;
    static const double errors_px[] = {0.25, 1, 3, 10};
    struct sv_rng rng = sv_rng_seeded(23, 3);
    struct sv_terrain_mesh mesh = {0};
    double closest = 0;
    for (int s = 3; s < SIZE_COUNT; s++)
        for (int shape = NOISE; shape <= CLIFF; shape++) {
            struct sv_heightfield f = make_field((enum shape)shape, sizes[s][0], sizes[s][1], 31);
            struct sv_terrain_lod *lod = make_lod(&f);
            for (int k = 0; k < 24; k++) {
                struct sv_camera c = camera_over(&f, &rng);
                if (k % 6 == 5) {
                    c.projection = SV_PROJECTION_ORTHOGRAPHIC;
                    c.ortho_height_m = 300;
                    c.far_m = 5000;
                }
                refine(lod, &c, errors_px[k % 4], &mesh);
                double gap = largest_gap_px(&f, &c, &mesh, &rng);
                if (!(gap <= errors_px[k % 4] * (1 + 1e-9)))
                    fail_msg("field %d x %d, shape %d, camera %d: %g px asked for, %g px off", f.width,
                             f.height, shape, k, errors_px[k % 4], gap);
                closest = fmax(closest, gap / errors_px[k % 4]);
            }
            sv_terrain_lod_destroy(lod);
            free((void *)(uintptr_t)f.h);
        }
    assert_true(closest > 0.5);
    sv_terrain_mesh_finish(&mesh);
}

static void flat_ground_is_cheap(void **state)
{
    (void)state;
    struct sv_terrain_mesh mesh = {0};
    static const int wide[][2] = {{129, 129}, {100, 57}, {1000, 700}};
    for (int s = 0; s < 3; s++) {
        struct sv_heightfield f = make_field(FLAT, wide[s][0], wide[s][1], 1);
        struct sv_terrain_lod *lod = make_lod(&f);
        struct sv_camera c = camera_of_all(&f, 1.7);
        refine(lod, &c, 1, &mesh);
        assert_in_range(mesh.triangle_count, 1, 4);
        sv_terrain_lod_destroy(lod);
        free((void *)(uintptr_t)f.h);
    }
    sv_terrain_mesh_finish(&mesh);
}

static void bad_errors_are_refused(void **state)
{
    (void)state;
    struct sv_heightfield f = make_field(HILLS, 9, 9, 1);
    struct sv_terrain_lod *lod = make_lod(&f);
    struct sv_terrain_mesh mesh = {0};
    struct sv_camera c = camera_of_all(&f, 10);
    struct sv_error error;
    assert_int_equal(sv_terrain_lod_refine(lod, &c, NULL, -1, &mesh, &error), SV_EINVAL);
    assert_int_equal(sv_terrain_lod_refine(lod, &c, NULL, (double)NAN, &mesh, &error), SV_EINVAL);
    assert_int_equal(sv_terrain_lod_refine(lod, &c, NULL, (double)INFINITY, &mesh, &error), SV_OK);
    assert_true(mesh.triangle_count >= 2);
    sv_terrain_lod_destroy(lod);
    sv_terrain_lod_destroy(NULL);
    sv_terrain_mesh_finish(&mesh);
    free((void *)(uintptr_t)f.h);
}

/* Errors come back from the store as they were measured: the same mesh. */
static void the_store_gives_the_same_errors(void **state)
{
    (void)state;
    char directory[] = "/tmp/sv_lod_test_XXXXXX", command[64];
    struct sv_heightfield f = make_field(HILLS, 1500, 1450, 1);
    struct sv_store *store = NULL;
    struct sv_error error;
    assert_non_null(mkdtemp(directory));
    assert_int_equal(sv_store_open(directory, 1u << 28, &store, &error), SV_OK);
    struct sv_terrain_lod *first = NULL, *second = NULL;
    struct sv_terrain_mesh a = {0}, b = {0};
    struct sv_camera c = camera_of_all(&f, 300);
    assert_int_equal(sv_terrain_lod_create(&f, store, &first, &error), SV_OK);
    assert_int_equal(sv_terrain_lod_create(&f, store, &second, &error), SV_OK);
    refine(first, &c, 2, &a);
    refine(second, &c, 2, &b);
    assert_true(a.triangle_count > 1000 && a.triangle_count < 2u * 1499 * 1449);
    assert_int_equal(a.triangle_count, b.triangle_count);
    assert_memory_equal(a.indices, b.indices, (size_t)a.triangle_count * 12);
    assert_int_equal(sv_terrain_lod_bytes(first), sv_terrain_lod_bytes(second));
    sv_terrain_lod_destroy(first);
    sv_terrain_lod_destroy(second);
    sv_terrain_mesh_finish(&a);
    sv_terrain_mesh_finish(&b);
    sv_store_close(store);
    snprintf(command, sizeof command, "rm -r %s", directory);
    assert_int_equal(system(command), 0);
    free((void *)(uintptr_t)f.h);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(meshes_have_no_cracks),
        cmocka_unit_test(meshes_cover_the_rectangle_once),
        cmocka_unit_test(finest_level_is_the_field),
        cmocka_unit_test(errors_stay_under_the_bound),
        cmocka_unit_test(flat_ground_is_cheap),
        cmocka_unit_test(bad_errors_are_refused),
        cmocka_unit_test(the_store_gives_the_same_errors),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
