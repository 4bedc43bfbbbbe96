/* Reliefs from meshes: boxes, a sphere and a cone by closed form; triangles anyhow by brute force over every
 * sample; masks, ranges, tiles, both hands, wrong input. */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "core/base/color.h"
#include "core/base/rng.h"
#include "core/gl/context.h"
#include "core/relief/build.h"

static struct sv_gl_context *context;

static int setup(void **state)
{
    (void)state;
    sv_color_init();
    return sv_gl_context_create(&context, NULL);
}

static int teardown(void **state)
{
    (void)state;
    sv_gl_context_destroy(context);
    return 0;
}

/* ---- meshes ---- */

enum { VERTICES = 40000, INDICES = 200000 };

static void mesh_init(struct sv_tree_mesh *m)
{
    *m = (struct sv_tree_mesh){0};
    m->vertices = calloc(VERTICES, sizeof *m->vertices);
    m->indices = calloc(INDICES, sizeof *m->indices);
    assert_true(m->vertices && m->indices);
}

static void add_material(struct sv_tree_mesh *m, float r, float g, float b)
{
    struct sv_tree_material *k = &m->materials[m->material_count++];
    *k = (struct sv_tree_material){
        .base_color = {r, g, b, 1}, .alpha_cutoff = 0.5f, .first_index = m->index_count};
}

static uint32_t add_vertex(struct sv_tree_mesh *m, struct sv_vec3 p, struct sv_vec3 n, float u, float v)
{
    struct sv_tree_vertex *x = &m->vertices[m->vertex_count];
    n = sv_normalize(n);
    *x = (struct sv_tree_vertex){
        .position = {(float)p.x, (float)p.y, (float)p.z},
        .normal = {(int16_t)lrint(n.x * 32767), (int16_t)lrint(n.y * 32767), (int16_t)lrint(n.z * 32767)},
        .occlusion = 0x8000,
        .uv = {u, v}};
    return m->vertex_count++;
}

static void add_triangle(struct sv_tree_mesh *m, uint32_t a, uint32_t b, uint32_t c)
{
    const uint32_t corner[3] = {a, b, c};
    assert_true(m->vertex_count <= VERTICES && m->index_count + 3 <= INDICES);
    memcpy(m->indices + m->index_count, corner, sizeof corner);
    m->index_count += 3;
    m->materials[m->material_count - 1].index_count += 3;
}

/* A parallelogram with corner p and sides s, t; normal s x t. uv from (0, 0) to (1, 1). */
static void add_quad(struct sv_tree_mesh *m, struct sv_vec3 p, struct sv_vec3 s, struct sv_vec3 t)
{
    struct sv_vec3 n = sv_cross(s, t);
    uint32_t a = add_vertex(m, p, n, 0, 0), b = add_vertex(m, sv_add(p, s), n, 1, 0);
    uint32_t c = add_vertex(m, sv_add(sv_add(p, s), t), n, 1, 1), d = add_vertex(m, sv_add(p, t), n, 0, 1);
    add_triangle(m, a, b, c);
    add_triangle(m, a, c, d);
}

/* Six faces, each its own colour: x +, -, y +, -, z +, -. */
static void add_box(struct sv_tree_mesh *m, struct sv_vec3 lo, struct sv_vec3 hi)
{
    struct sv_vec3 d = sv_sub(hi, lo), x = sv_vec3(d.x, 0, 0), y = sv_vec3(0, d.y, 0), z = sv_vec3(0, 0, d.z);
    add_material(m, 1, 0, 0);
    add_quad(m, sv_vec3(hi.x, lo.y, lo.z), y, z);
    add_material(m, 0, 1, 0);
    add_quad(m, lo, z, y);
    add_material(m, 0, 0, 1);
    add_quad(m, sv_vec3(lo.x, hi.y, lo.z), z, x);
    add_material(m, 1, 1, 0);
    add_quad(m, lo, x, z);
    add_material(m, 0, 1, 1);
    add_quad(m, sv_vec3(lo.x, lo.y, hi.z), x, y);
    add_material(m, 1, 0, 1);
    add_quad(m, lo, y, x);
}

/* Rings of a body of revolution about z through `middle`; its own normals. */
static void add_turned(struct sv_tree_mesh *m, struct sv_vec3 middle, int rings, int sides,
                       void (*profile)(double t, double *radius, double *z, double *nr, double *nz))
{
    uint32_t first = m->vertex_count;
    for (int i = 0; i <= rings; i++)
        for (int j = 0; j <= sides; j++) {
            double r, z, nr, nz, a = 2 * SV_PI * j / sides;
            profile((double)i / rings, &r, &z, &nr, &nz);
            add_vertex(m, sv_add(middle, sv_vec3(r * cos(a), r * sin(a), z)),
                       sv_vec3(nr * cos(a), nr * sin(a), nz), 0, 0);
        }
    for (int i = 0; i < rings; i++)
        for (int j = 0; j < sides; j++) {
            uint32_t k = first + (uint32_t)(i * (sides + 1) + j), below = k + (uint32_t)sides + 1;
            add_triangle(m, k, below, below + 1);
            add_triangle(m, k, below + 1, k + 1);
        }
}

static void sphere(double t, double *radius, double *z, double *nr, double *nz)
{
    *nr = sin(SV_PI * t), *nz = cos(SV_PI * t);
    *radius = 0.4 * *nr, *z = 0.4 * *nz;
}
static void cone(double t, double *radius, double *z, double *nr, double *nz)
{
    *radius = 0.4 * t, *z = 0.8 * (1 - t);
    *nr = 0.8, *nz = 0.4;
}

static void mesh_finish(struct sv_tree_mesh *m)
{
    free(m->vertices);
    free(m->indices);
}

static struct sv_relief bake(const struct sv_tree_mesh *m, const struct sv_relief_frame *f, int width,
                             int height, int samples, double front, double depth, float cut)
{
    const struct sv_relief_bake_options o = {width, height, samples, front, depth, cut};
    struct sv_relief r;
    struct sv_error e = {0};
    if (sv_relief_from_mesh(m, f, &o, &r, &e) != SV_OK)
        fail_msg("%s: %s", e.field, e.message);
    return r;
}

/* The frame over [-0.5, 0.5]^2 seen along -f, through `at`, n texels a metre. */
static struct sv_relief_frame frame_of(struct sv_vec3 f, struct sv_vec3 a, struct sv_vec3 middle, double n,
                                       bool left)
{
    struct sv_vec3 b = sv_scale(sv_cross(f, a), left ? -1 : 1);
    struct sv_vec3 corner = sv_madd(sv_madd(middle, a, -0.5), b, -0.5);
    return (struct sv_relief_frame){corner, sv_scale(a, 1 / n), sv_scale(b, 1 / n), f};
}

/* ---- closed forms ---- */

static void boxes_from_six_sides(void **state)
{
    (void)state;
    struct sv_tree_mesh m;
    mesh_init(&m);
    add_box(&m, sv_vec3(-0.3, -0.2, -0.45), sv_vec3(0.35, 0.25, 0.4));
    static const uint8_t colors[6][3] = {{255, 0, 0},   {0, 255, 0},   {0, 0, 255},
                                         {255, 255, 0}, {0, 255, 255}, {255, 0, 255}};
    const double ends[6] = {0.35, 0.3, 0.25, 0.2, 0.4, 0.45};
    const double lo[3] = {-0.3, -0.2, -0.45}, hi[3] = {0.35, 0.25, 0.4};
    for (int k = 0; k < 12; k++) {
        int face = k % 6, axis = face / 2, across = (axis + 1) % 3;
        double sign = face & 1 ? -1 : 1, fv[3] = {0}, av[3] = {0};
        fv[axis] = sign, av[across] = 1;
        struct sv_relief_frame f = frame_of(sv_vec3(fv[0], fv[1], fv[2]), sv_vec3(av[0], av[1], av[2]),
                                            sv_vec3(0.5 * fv[0], 0.5 * fv[1], 0.5 * fv[2]), 20, k >= 6);
        struct sv_relief r = bake(&m, &f, 20, 20, 4, 0, 1, 0.1f);
        int down = (axis + 2) % 3;
        for (int j = 0; j < 20; j++)
            for (int i = 0; i < 20; i++) {
                size_t t = (size_t)(j * 20 + i);
                struct sv_vec3 p = sv_relief_point(&f, i + 0.5, j + 0.5, 0);
                const double at[3] = {p.x, p.y, p.z};
                bool in = at[across] > lo[across] && at[across] < hi[across] && at[down] > lo[down] &&
                          at[down] < hi[down];
                assert_int_equal(r.color[t][3], in ? 255 : 0); /* the box's edges lie between texels */
                if (!in)
                    continue;
                assert_true(fabs((double)r.displ[t] - (ends[face] - 0.5)) < 1e-6);
                assert_memory_equal(r.color[t], colors[face], 3);
                assert_true(r.normal[t][2] >= 32760 && abs(r.normal[t][0]) < 8 && abs(r.normal[t][1]) < 8);
                assert_true(abs(r.normal[t][3] - 16384) < 70); /* 0x8000 of 0xffff, kept in 8 bits */
            }
        sv_relief_finish(&r);
    }
    mesh_finish(&m);
}

/* Sphere and cone, seen square and aslant: displ, normal and covered area against the formula. A texel of
 * side h whose surface slopes by g is right to h g / (2 samples) (its samples are a grid), to the curvature
 * over a texel (h^2 / (8 r cos^3)), and to the chord of the tessellation. */
static void a_sphere_by_its_formula(void **state)
{
    (void)state;
    struct sv_tree_mesh m;
    mesh_init(&m);
    add_material(&m, 0.5f, 0.25f, 0.125f);
    add_turned(&m, sv_vec3(0, 0, 0), 100, 200, sphere);
    const double r0 = 0.4, n = 64, h = 1 / n, chord = r0 * 0.5 * pow(SV_PI / 100, 2) / 4;
    struct sv_rng rng = sv_rng_seeded(6, 1);
    for (int k = 0; k < 8; k++) {
        double z = sv_rng_range(&rng, -1, 1), s = sqrt(1 - z * z), az = sv_rng_range(&rng, 0, 6);
        struct sv_vec3 f = sv_vec3(s * cos(az), s * sin(az), z),
                       a = sv_normalize(sv_cross(f, sv_vec3(0.3, 0.8, -0.2)));
        struct sv_relief_frame frame = frame_of(f, a, sv_scale(f, 0.5), n, k & 1);
        struct sv_relief r = bake(&m, &frame, 64, 64, 4, 0, 1, INFINITY);
        double worst_displ = 0, worst_normal = 0, area = 0;
        for (int j = 0; j < 64; j++)
            for (int i = 0; i < 64; i++) {
                size_t t = (size_t)(j * 64 + i);
                double x = (i + 0.5) * h - 0.5, y = (j + 0.5) * h - 0.5, rho = hypot(x, y);
                area += r.color[t][3] / 255.0 * h * h;
                if (rho > r0 - h)
                    continue;
                double c = sqrt(r0 * r0 - rho * rho), slope = rho / c;
                double allowed =
                    h * slope / 4 + h * h * r0 * r0 / (c * c * c) / 8 + 4 * chord * r0 / c + 1e-5;
                worst_displ = fmax(worst_displ, fabs((double)r.displ[t] - (c - 0.5)) / allowed);
                const double truth[3] = {x / r0, y / r0, c / r0};
                double dot = 0;
                for (int e = 0; e < 3; e++)
                    dot += truth[e] * r.normal[t][e] / 32767.0;
                /* The mean over a texel leans by its curvature; half floats and chords the rest. */
                worst_normal = fmax(worst_normal, acos(fmin(dot, 1)) / (0.5 * h / c + 0.02));
            }
        print_message("sphere %d: displ %.2f, normal %.2f of what a texel allows; area off by %.4f %%\n", k,
                      worst_displ, worst_normal, 100 * (area / (SV_PI * r0 * r0) - 1));
        assert_true(worst_displ <= 1 && worst_normal <= 1);
        assert_true(fabs(area / (SV_PI * r0 * r0) - 1) < 0.003);
        sv_relief_finish(&r);
    }
    mesh_finish(&m);
}

static void a_cone_from_above_and_beside(void **state)
{
    (void)state;
    struct sv_tree_mesh m;
    mesh_init(&m);
    add_material(&m, 1, 1, 1);
    add_turned(&m, sv_vec3(0, 0, 0), 40, 360, cone);
    const double n = 50, h = 1 / n;
    struct sv_relief_frame top = frame_of(sv_vec3(0, 0, 1), sv_vec3(1, 0, 0), sv_vec3(0, 0, 0.8), n, false);
    struct sv_relief r = bake(&m, &top, 50, 50, 4, 0, 0.8, INFINITY);
    double area = 0, worst = 0;
    for (int t = 0; t < 2500; t++) {
        double rho = hypot((t % 50 + 0.5) * h - 0.5, (t / 50 + 0.5) * h - 0.5);
        area += r.color[t][3] / 255.0 * h * h;
        if (rho < 0.4 - h && rho > 2 * h)
            worst = fmax(worst, fabs((double)r.displ[t] + 2 * rho));
    }
    print_message("cone from above: displ off by %.4f (a texel is %.3f, slope 2); area off by %.3f %%\n",
                  worst, h, 100 * (area / (SV_PI * 0.16) - 1));
    assert_true(worst < h * 2 / 4 && fabs(area / (SV_PI * 0.16) - 1) < 0.005);
    sv_relief_finish(&r);
    struct sv_relief_frame side =
        frame_of(sv_vec3(0, -1, 0), sv_vec3(1, 0, 0), sv_vec3(0, -0.5, 0.4), n, false);
    r = bake(&m, &side, 50, 50, 8, 0, 1, INFINITY);
    area = 0;
    for (int t = 0; t < 2500; t++) {
        area += r.color[t][3] / 255.0 * h * h;
        struct sv_vec3 p = sv_relief_point(&side, t % 50 + 0.5, t / 50 + 0.5, 0);
        double radius = 0.4 * (1 - p.z / 0.8), depth = sqrt(radius * radius - p.x * p.x);
        if (p.z > h && fabs(p.x) < radius - 2 * h)
            assert_true(fabs((double)r.displ[t] - (depth - 0.5)) <
                        h * (fabs(p.x) / depth + 0.5) / 4 + h * h / depth);
    }
    print_message("cone from the side: area off by %.3f %%\n", 100 * (area / 0.32 - 1));
    assert_true(fabs(area / 0.32 - 1) < 0.005);
    sv_relief_finish(&r);
    mesh_finish(&m);
}

/* ---- brute force ---- */

struct flat_triangle {
    double u[3], v[3], d[3];
    struct sv_vec3 normal; /* in (a^, b^, f), to the front */
    float rgb[3];
};

/* Does (u, v) lie in the triangle; -1 out, 0 too near to an edge to tell, 1 in. */
static int inside(const struct flat_triangle *t, double u, double v, double slack, double *displ)
{
    double w[3], total = 0;
    int verdict = 1;
    for (int k = 0; k < 3; k++) {
        int a = (k + 1) % 3, b = (k + 2) % 3;
        w[k] = (t->u[a] - u) * (t->v[b] - v) - (t->u[b] - u) * (t->v[a] - v);
        total += w[k];
    }
    for (int k = 0; k < 3; k++) {
        int a = (k + 1) % 3, b = (k + 2) % 3;
        double away = copysign(1, total) * w[k] / hypot(t->u[b] - t->u[a], t->v[b] - t->v[a]);
        verdict = away < -slack ? -1 : away < slack && verdict > 0 ? 0 : verdict;
        if (verdict < 0)
            return -1;
    }
    *displ = (w[0] * t->d[0] + w[1] * t->d[1] + w[2] * t->d[2]) / total;
    return verdict;
}

static void make_soup(struct sv_tree_mesh *m, struct sv_rng *rng, int count)
{
    mesh_init(m);
    for (int k = 0; k < count; k++) {
        struct sv_vec3 p[3];
        for (int c = 0; c < 3; c++)
            p[c] = sv_vec3(sv_rng_range(rng, -0.5, 0.5), sv_rng_range(rng, -0.5, 0.5),
                           sv_rng_range(rng, -0.3, 0.3));
        struct sv_vec3 n = sv_cross(sv_sub(p[1], p[0]), sv_sub(p[2], p[0]));
        add_material(m, (float)sv_rng_unit(rng), (float)sv_rng_unit(rng), (float)sv_rng_unit(rng));
        add_triangle(m, add_vertex(m, p[0], n, 0, 0), add_vertex(m, p[1], n, 0, 0),
                     add_vertex(m, p[2], n, 0, 0));
    }
}

static void flatten(const struct sv_tree_mesh *m, const struct sv_relief_frame *f, struct flat_triangle *out)
{
    for (uint32_t k = 0; k < m->index_count; k++) {
        const struct sv_tree_vertex *x = &m->vertices[m->indices[k]];
        struct flat_triangle *t = &out[k / 3];
        sv_relief_locate(f, sv_vec3((double)x->position[0], (double)x->position[1], (double)x->position[2]),
                         &t->u[k % 3], &t->v[k % 3], &t->d[k % 3]);
        struct sv_vec3 n = sv_vec3(x->normal[0], x->normal[1], x->normal[2]);
        n = sv_normalize(
            sv_vec3(sv_dot(n, sv_normalize(f->a)), sv_dot(n, sv_normalize(f->b)), sv_dot(n, f->f)));
        t->normal = n.z < 0 ? sv_scale(n, -1) : n;
        memcpy(t->rgb, m->materials[k / 3].base_color, sizeof t->rgb);
    }
}

struct sample {
    double displ;
    int triangle;
};

static int nearer_last(const void *a, const void *b)
{
    double x = ((const struct sample *)a)->displ, y = ((const struct sample *)b)->displ;
    return (x > y) - (x < y);
}

/* What texel (i, j) must hold; false when rounding may decide (a sample next to an edge, two surfaces alike).
 */
static bool truth_of_texel(const struct flat_triangle *soup, int count, int i, int j, int samples,
                           double same, struct sample *hits, int *hit_count)
{
    *hit_count = 0;
    for (int k = 0; k < samples * samples; k++) {
        double u = i + (k % samples + 0.5) / samples, v = j + (k / samples + 0.5) / samples;
        struct sample best = {-1e9, -1};
        double second = -1e9, displ;
        for (int t = 0; t < count; t++) {
            int verdict = inside(&soup[t], u, v, 0.02 / samples, &displ);
            if (verdict == 0)
                return false;
            if (verdict < 0)
                continue;
            if (displ > best.displ)
                second = best.displ, best = (struct sample){displ, t};
            else
                second = fmax(second, displ);
        }
        if (best.triangle >= 0 && best.displ - second < 1e-3)
            return false;
        if (best.triangle >= 0)
            hits[(*hit_count)++] = best;
    }
    qsort(hits, (size_t)*hit_count, sizeof *hits, nearer_last);
    for (int k = 1; k < *hit_count; k++) /* whether two samples are one surface must not be a close call */
        for (int l = 0; l < k; l++)
            if (fabs(hits[k].displ - hits[l].displ - same) < 0.02 * same)
                return false;
    return true;
}

static double judge_texel(const struct sv_relief *r, size_t t, const struct flat_triangle *soup,
                          const struct sample *hits, int count, int samples, double same)
{
    assert_int_equal(r->color[t][3], (int)(255.0 * count / (samples * samples) + 0.5));
    if (count == 0)
        return 0;
    double hi = hits[count / 2].displ, lo = hits[(count - 1) / 2].displ,
           middle = hi - lo <= same ? 0.5 * (hi + lo) : hi;
    double rgb[3] = {0}, n[3] = {0}, off = fabs((double)r->displ[t] - middle);
    int own = 0;
    for (int k = 0; k < count; k++) {
        if (fabs(hits[k].displ - middle) > same)
            continue;
        const struct flat_triangle *s = &soup[hits[k].triangle];
        for (int e = 0; e < 3; e++)
            rgb[e] += (double)s->rgb[e];
        n[0] += s->normal.x, n[1] += s->normal.y, n[2] += s->normal.z;
        own++;
    }
    double size = sqrt(n[0] * n[0] + n[1] * n[1] + n[2] * n[2]);
    for (int e = 0; e < 3; e++) {
        assert_true(abs(r->color[t][e] - sv_srgb8_from_linear((float)(rgb[e] / own))) <= 2);
        assert_true(fabs(r->normal[t][e] / 32767.0 - n[e] / size) < 2e-3);
    }
    return off;
}

static void triangles_anyhow_by_brute_force(void **state)
{
    (void)state;
    enum { COUNT = 30, SIDE = 40 };
    struct flat_triangle soup[COUNT];
    struct sample hits[64];
    for (int k = 0; k < 12; k++) {
        struct sv_rng rng = sv_rng_seeded(9, (uint64_t)k);
        struct sv_tree_mesh m;
        int samples = 1 + k % 8, judged = 0, covered = 0, hit_count;
        make_soup(&m, &rng, COUNT);
        double z = sv_rng_range(&rng, -1, 1), s = sqrt(1 - z * z), az = sv_rng_range(&rng, 0, 6);
        struct sv_vec3 f = sv_vec3(s * cos(az), s * sin(az), z),
                       a = sv_normalize(sv_cross(f, sv_vec3(0.3, 0.8, -0.2)));
        struct sv_relief_frame frame = frame_of(f, a, sv_vec3(0.1, 0, -0.1), SIDE, k & 1);
        frame.b = sv_scale(frame.b, 0.75);
        float cut = k % 3 == 0 ? INFINITY : 0.02f;
        struct sv_relief r = bake(&m, &frame, SIDE, SIDE, samples, 1, 1, cut);
        flatten(&m, &frame, soup);
        double same = fmin((double)cut, 1.0 / SIDE), worst = 0;
        for (int t = 0; t < SIDE * SIDE; t++) {
            if (!truth_of_texel(soup, COUNT, t % SIDE, t / SIDE, samples, same, hits, &hit_count))
                continue;
            judged++;
            covered += hit_count > 0;
            worst = fmax(worst, judge_texel(&r, (size_t)t, soup, hits, hit_count, samples, same));
        }
        print_message(
            "soup %2d, %d x %d samples: %d of %d texels judged, %d covered; displ off by at most %.1e\n", k,
            samples, samples, judged, SIDE * SIDE, covered, worst);
        /* GL places corners to 1/256 of a sample: steep triangles show that in displ. */
        assert_true(judged > SIDE * SIDE / 2 && covered > 100 && worst < 1e-4);
        sv_relief_finish(&r);
        mesh_finish(&m);
    }
}

/* ---- the rest of the contract ---- */

static void a_mask_cuts_texels_out(void **state)
{
    (void)state;
    struct sv_tree_mesh m;
    mesh_init(&m);
    uint8_t rgba[4][4] = {{200, 100, 50, 255}, {10, 20, 30, 0}, {10, 20, 30, 0}, {200, 100, 50, 255}};
    add_material(&m, 1, 1, 1);
    m.materials[0].albedo = (struct sv_image){2, 2, 4, SV_PIXEL_U8, rgba};
    m.materials[0].masked = true;
    add_quad(&m, sv_vec3(-0.5, -0.5, -0.1), sv_vec3(1, 0, 0), sv_vec3(0, 1, 0));
    add_material(&m, 0, 0, 1);
    add_quad(&m, sv_vec3(-0.5, -0.5, -0.3), sv_vec3(1, 0, 0), sv_vec3(0, 1, 0));
    struct sv_relief_frame f = frame_of(sv_vec3(0, 0, 1), sv_vec3(1, 0, 0), sv_vec3(0, 0, 0), 8, false);
    struct sv_relief r = bake(&m, &f, 8, 8, 4, 0, 1, 0.05f);
    for (int t = 0; t < 64; t++) {
        int i = t % 8, j = t / 8;
        /* Bilinear alpha of a 2 x 2 checker that repeats: >= 1/2 where (i, j) is nearer to a full corner. */
        bool edge = i == 0 || i == 3 || i == 4 || i == 7 || j == 0 || j == 3 || j == 4 || j == 7;
        bool card = (i < 4) == (j < 4);
        assert_int_equal(r.color[t][3], 255);
        if (edge)
            continue;
        assert_true(fabs((double)r.displ[t] + (card ? 0.1 : 0.3)) < 1e-6);
        if (!card)
            assert_true(r.color[t][2] == 255 && r.color[t][0] == 0);
        else /* between texels colour is mixed with the see-through ones', as GL filters */
            assert_true(r.color[t][0] > 100 && r.color[t][0] <= 201 && r.color[t][2] < 60);
    }
    sv_relief_finish(&r);
    mesh_finish(&m);
}

static void only_the_range_is_seen(void **state)
{
    (void)state;
    struct sv_tree_mesh m;
    mesh_init(&m);
    static const double z[5] = {0.4, 0.2, 0, -0.2, -0.4};
    for (int k = 0; k < 5; k++) {
        add_material(&m, k == 1, k == 2, k == 3);
        add_quad(&m, sv_vec3(-0.5 + 0.1 * k, -0.5, z[k]), sv_vec3(0.5, 0, 0), sv_vec3(0, 1, 0));
    }
    struct sv_relief_frame f = frame_of(sv_vec3(0, 0, 1), sv_vec3(1, 0, 0), sv_vec3(0, 0, 0), 10, false);
    /* What lies on an end is in: 0.2 and -0.2; 0.4 does not hide it, -0.4 is not there. */
    struct sv_relief r = bake(&m, &f, 10, 10, 2, 0.2, 0.2, 0.01f);
    assert_true(fabsf(r.displ_max - 0.2f) < 1e-6f && fabsf(r.displ_min + 0.2f) < 1e-6f);
    for (size_t t = 0; t < 10; t++) {
        assert_int_equal(r.color[t][3], t >= 1 && t < 8 ? 255 : 0);
        if (t >= 1 && t < 6)
            assert_true(r.color[t][0] == 255 && fabsf(r.displ[t] - 0.2f) < 1e-6f);
    }
    assert_true(r.color[6][1] == 255 && r.color[7][2] == 255);
    sv_relief_finish(&r);
    mesh_finish(&m);
}

/* More samples than a tile holds: the same texels as drawn piece by piece with frames of their own. */
static void tiles_join(void **state)
{
    (void)state;
    struct sv_tree_mesh m;
    mesh_init(&m);
    add_material(&m, 0.7f, 0.4f, 0.2f);
    add_turned(&m, sv_vec3(0, 0, 0), 60, 90, sphere);
    struct sv_relief_frame f = frame_of(sv_vec3(0, 0, 1), sv_vec3(1, 0, 0), sv_vec3(0, 0, 0.5), 400, false);
    struct sv_relief whole = bake(&m, &f, 400, 301, 4, 0, 1, INFINITY);
    assert_true(whole.solid_count > 400 * 301 / 3);
    for (int k = 0; k < 4; k++) {
        int x = k & 1 ? 200 : 0, y = k & 2 ? 150 : 0;
        struct sv_relief_frame part = f;
        part.origin = sv_relief_point(&f, x, y, 0);
        struct sv_relief r = bake(&m, &part, 200, 150, 4, 0, 1, INFINITY);
        int differ = 0;
        for (int j = 0; j < 150; j++)
            for (int i = 0; i < 200; i++) {
                size_t a = (size_t)(j * 200 + i), b = (size_t)((y + j) * 400 + x + i);
                differ += fabsf(r.displ[a] - whole.displ[b]) > 1e-5f || r.color[a][3] != whole.color[b][3];
            }
        /* Corners are rounded to 1/256 of a sample from each window's own edge: the outline may differ. */
        print_message("tile %d: %d of 30000 texels differ\n", k, differ);
        assert_true(differ < 60);
        sv_relief_finish(&r);
    }
    sv_relief_finish(&whole);
    mesh_finish(&m);
}

static void nothing_and_wrong_input(void **state)
{
    (void)state;
    struct sv_tree_mesh m;
    mesh_init(&m);
    struct sv_relief_frame f = frame_of(sv_vec3(0, 0, 1), sv_vec3(1, 0, 0), sv_vec3(0, 0, 0), 8, false);
    struct sv_relief r = bake(&m, &f, 8, 1, 1, 1, 0, 1);
    assert_true(r.solid_count == 0 && r.displ_min == 0 && r.color[7][3] == 0);
    sv_relief_finish(&r);
    const struct {
        struct sv_relief_bake_options o;
        const char *field;
    } wrong[] = {
        {{0, 8, 1, 1, 1, 1}, "width"},          {{8, 9000, 1, 1, 1, 1}, "height"},
        {{8, 8, 0, 1, 1, 1}, "samples"},        {{8, 8, 9, 1, 1, 1}, "samples"},
        {{8, 8, 1, 1, -1, 1}, "depth_m"},       {{8, 8, 1, NAN, 1, 1}, "depth_m"},
        {{8, 8, 1, 1, INFINITY, 1}, "depth_m"}, {{8, 8, 1, 1, 1, 0}, "cut"},
        {{8, 8, 1, 1, 1, NAN}, "cut"},
    };
    for (size_t k = 0; k < sizeof wrong / sizeof *wrong; k++) {
        struct sv_error e;
        assert_int_equal(sv_relief_from_mesh(&m, &f, &wrong[k].o, &r, &e), SV_EINVAL);
        assert_string_equal(e.field, wrong[k].field);
    }
    mesh_finish(&m);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(boxes_from_six_sides),
        cmocka_unit_test(a_sphere_by_its_formula),
        cmocka_unit_test(a_cone_from_above_and_beside),
        cmocka_unit_test(triangles_anyhow_by_brute_force),
        cmocka_unit_test(a_mask_cuts_texels_out),
        cmocka_unit_test(only_the_range_is_seen),
        cmocka_unit_test(tiles_join),
        cmocka_unit_test(nothing_and_wrong_input),
    };
    return cmocka_run_group_tests(tests, setup, teardown);
}
