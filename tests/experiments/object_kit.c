/* object_kit.c - see object_kit.h. Surfaces are grids of points given by a function of two parameters;
 * normals by differences of that function, so that carving is seen in them. */
#include "tests/experiments/object_kit.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "core/base/color.h"
#include "core/base/noise.h"

const char *const object_kit_names[OBJECT_KIT_COUNT] = {"sphere", "box", "torus", "courtyard", "knot", "urn"};

enum { VERTICES_MAX = 400000, INDICES_MAX = 2400000, STONE_SIDE = 512 };

typedef struct sv_vec3 (*surface)(double u, double v);

static void *must(void *memory)
{
    if (!memory)
        abort();
    return memory;
}

static void put_vertex(struct sv_tree_mesh *m, struct sv_vec3 p, struct sv_vec3 n, double u, double v)
{
    struct sv_tree_vertex *x = &m->vertices[m->vertex_count++];
    n = sv_normalize(n);
    *x = (struct sv_tree_vertex){
        .position = {(float)p.x, (float)p.y, (float)p.z},
        .normal = {(int16_t)lrint(n.x * 32767), (int16_t)lrint(n.y * 32767), (int16_t)lrint(n.z * 32767)},
        .occlusion = 65535,
        .uv = {(float)u, (float)v},
        .open = {0, 0, 0, 127}};
}

static void put_triangle(struct sv_tree_mesh *m, uint32_t a, uint32_t b, uint32_t c)
{
    m->indices[m->index_count++] = a;
    m->indices[m->index_count++] = b;
    m->indices[m->index_count++] = c;
}

/* Four corners, counter-clockwise from outside; flat. */
static void put_quad(struct sv_tree_mesh *m, struct sv_vec3 a, struct sv_vec3 b, struct sv_vec3 c,
                     struct sv_vec3 d)
{
    struct sv_vec3 n = sv_cross(sv_sub(b, a), sv_sub(c, a));
    double width = sv_length(sv_sub(b, a)), height = sv_length(sv_sub(d, a));
    uint32_t k = m->vertex_count;
    put_vertex(m, a, n, 0, height);
    put_vertex(m, b, n, width, height);
    put_vertex(m, c, n, width, 0);
    put_vertex(m, d, n, 0, 0);
    put_triangle(m, k, k + 1, k + 2);
    put_triangle(m, k, k + 2, k + 3);
}

static void put_box(struct sv_tree_mesh *m, struct sv_vec3 lo, struct sv_vec3 hi)
{
    struct sv_vec3 p[8];
    for (int k = 0; k < 8; k++)
        p[k] = sv_vec3(k & 1 ? hi.x : lo.x, k & 2 ? hi.y : lo.y, k & 4 ? hi.z : lo.z);
    static const int SIDES[6][4] = {{1, 3, 7, 5}, {2, 0, 4, 6}, {3, 2, 6, 7},
                                    {0, 1, 5, 4}, {4, 5, 7, 6}, {2, 3, 1, 0}};
    for (int k = 0; k < 6; k++)
        put_quad(m, p[SIDES[k][0]], p[SIDES[k][1]], p[SIDES[k][2]], p[SIDES[k][3]]);
}

/* A surface over the unit square, nu x nv cells; d/du x d/dv points outward. */
static void put_surface(struct sv_tree_mesh *m, surface at, int nu, int nv, double repeat_u, double repeat_v)
{
    uint32_t first = m->vertex_count;
    const double h = 1e-4;
    for (int j = 0; j <= nv; j++)
        for (int i = 0; i <= nu; i++) {
            double u = (double)i / nu, v = (double)j / nv;
            struct sv_vec3 du = sv_sub(at(u + h, v), at(u - h, v)), dv = sv_sub(at(u, v + h), at(u, v - h));
            struct sv_vec3 n = sv_cross(du, dv);
            if (!(sv_length(n) > 1e-12)) /* a pole */
                n = sv_sub(at(u, v), at(u + 0.5, v < 0.5 ? v + 0.02 : v - 0.02));
            put_vertex(m, at(u, v), n, repeat_u * u, repeat_v * v);
        }
    for (int j = 0; j < nv; j++)
        for (int i = 0; i < nu; i++) {
            uint32_t k = first + (uint32_t)(j * (nu + 1) + i), below = k + (uint32_t)nu + 1;
            put_triangle(m, k, k + 1, below + 1);
            put_triangle(m, k, below + 1, below);
        }
}

static struct sv_vec3 sphere(double u, double v)
{
    double a = 2 * SV_PI * u, e = SV_PI * (v - 0.5);
    return sv_vec3(0.5 * cos(e) * cos(a), 0.5 * cos(e) * sin(a), 0.5 + 0.5 * sin(e));
}

static struct sv_vec3 torus(double u, double v)
{
    double a = 2 * SV_PI * u, b = 2 * SV_PI * v, r = 0.14, R = 0.36;
    double x = (R + r * cos(b)) * cos(a), z = (R + r * cos(b)) * sin(a);
    return sv_vec3(x, -r * sin(b), 0.5 + z);
}

static struct sv_vec3 knot_curve(double t)
{
    return sv_vec3(0.118 * (sin(t) + 2 * sin(2 * t)), 0.118 * (cos(t) - 2 * cos(2 * t)), -0.17 * sin(3 * t));
}

/* Tube about the trefoil, with a carved spiral groove and a row of bosses; stands on the pedestal. */
static struct sv_vec3 knot(double u, double v)
{
    double t = 2 * SV_PI * u, b = 2 * SV_PI * v;
    struct sv_vec3 at = knot_curve(t),
                   along = sv_normalize(sv_sub(knot_curve(t + 1e-3), knot_curve(t - 1e-3)));
    struct sv_vec3 side = sv_normalize(sv_cross(along, sv_sub(at, sv_vec3(0, 0, -3))));
    struct sv_vec3 up = sv_cross(side, along);
    double groove = cos(3 * b + 14 * t), boss = cos(42 * t) * cos(2 * b);
    double r = 0.092 - 0.009 * pow(0.5 + 0.5 * groove, 6) + 0.005 * pow(fmax(0, boss), 2);
    struct sv_vec3 p = sv_madd(sv_madd(at, side, r * cos(b)), up, r * sin(b));
    /* Upright: the knot's plane is turned to stand. */
    return sv_vec3(p.x, p.z * 1.1, 0.525 - p.y * 0.95);
}

/* Profile of the urn: (height, radius), read with a smooth step between; equal heights are edges. */
static const double URN[][2] = {
    {0, 0},        {0, 0.30},     {0.035, 0.31}, {0.07, 0.29},  {0.075, 0.24}, {0.10, 0.235},  {0.115, 0.15},
    {0.16, 0.085}, {0.19, 0.08},  {0.20, 0.115}, {0.225, 0.12}, {0.235, 0.09}, {0.26, 0.10},   {0.34, 0.24},
    {0.44, 0.335}, {0.54, 0.36},  {0.61, 0.33},  {0.635, 0.30}, {0.645, 0.34}, {0.68, 0.355},  {0.69, 0.33},
    {0.70, 0.30},  {0.76, 0.25},  {0.82, 0.16},  {0.85, 0.085}, {0.865, 0.06}, {0.875, 0.055}, {0.895, 0.09},
    {0.94, 0.115}, {0.98, 0.085}, {1, 0}};
enum { URN_POINTS = sizeof URN / sizeof *URN };

static struct sv_vec3 urn(double u, double v)
{
    double at = sv_clamp(v, 0, 1) * (URN_POINTS - 1), angle = 2 * SV_PI * u;
    int k = (int)fmin(at, URN_POINTS - 2);
    double f = at - k, s = f * f * (3 - 2 * f);
    double z = URN[k][0] + (URN[k + 1][0] - URN[k][0]) * f, r = URN[k][1] + (URN[k + 1][1] - URN[k][1]) * s;
    /* Flutes on the bowl, petals on the lid, a wreath of bosses at the shoulder. */
    double bowl = sv_clamp((z - 0.27) / 0.04, 0, 1) * sv_clamp((0.53 - z) / 0.03, 0, 1);
    double lid = sv_clamp((z - 0.70) / 0.02, 0, 1) * sv_clamp((0.82 - z) / 0.03, 0, 1);
    double wreath = sv_clamp((z - 0.545) / 0.01, 0, 1) * sv_clamp((0.605 - z) / 0.01, 0, 1);
    r *= 1 + 0.05 * bowl * fabs(cos(10 * angle)) + 0.06 * lid * fabs(cos(6 * angle));
    r += 0.014 * wreath * fmax(0, cos(18 * angle));
    return sv_vec3(r * cos(angle), r * sin(angle), z);
}

static void put_pedestal(struct sv_tree_mesh *m)
{
    static const double STEPS[][3] = {/* z from, z to, half width */
                                      {0, 0.07, 0.30},
                                      {0.07, 0.10, 0.27},
                                      {0.10, 0.20, 0.22},
                                      {0.20, 0.23, 0.25}};
    for (size_t k = 0; k < sizeof STEPS / sizeof *STEPS; k++)
        put_box(m, sv_vec3(-STEPS[k][2], -STEPS[k][2], STEPS[k][0]),
                sv_vec3(STEPS[k][2], STEPS[k][2], STEPS[k][1]));
}

static void put_courtyard(struct sv_tree_mesh *m)
{
    const double w = 0.8, t = 0.2; /* half width, thickness of a wall */
    put_box(m, sv_vec3(-w, -w, 0), sv_vec3(w, w, 0.2));
    put_box(m, sv_vec3(-w, -w, 0.2), sv_vec3(-w + t, w, 0.8));
    put_box(m, sv_vec3(w - t, -w, 0.2), sv_vec3(w, w, 0.8));
    put_box(m, sv_vec3(-w + t, w - t, 0.2), sv_vec3(w - t, w, 1));
    put_box(m, sv_vec3(-w + t, -w, 0.2), sv_vec3(-0.25, -w + t, 0.8));
    put_box(m, sv_vec3(0.25, -w, 0.2), sv_vec3(w - t, -w + t, 0.8));
    put_box(m, sv_vec3(-0.15, 0, 0.2), sv_vec3(0.15, 0.3, 0.6));
}

/* Weathered stone, seen as albedo: grain, veins, stains. Wraps to a quarter of its contrast at its border. */
static struct sv_image stone(uint64_t seed)
{
    struct sv_image image;
    if (sv_image_alloc(STONE_SIDE, STONE_SIDE, 4, SV_PIXEL_U8, &image, NULL) != SV_OK)
        abort();
    uint8_t *p = image.data;
    for (int j = 0; j < STONE_SIDE; j++)
        for (int i = 0; i < STONE_SIDE; i++, p += 4) {
            double x = 8.0 * i / STONE_SIDE, y = 8.0 * j / STONE_SIDE;
            double large = sv_noise_sum(seed, x, y, 5), fine = sv_noise_sum(seed + 9, 9 * x, 9 * y, 3);
            double vein = pow(1 - fmin(1, fabs(sv_noise_sum(seed + 5, 1.3 * x, 1.3 * y, 4)) * 3), 6);
            double v = 0.42 + 0.12 * large + 0.06 * fine - 0.16 * vein;
            const double tint[3] = {1.0, 0.93, 0.82};
            for (int c = 0; c < 3; c++)
                p[c] = sv_srgb8_from_linear((float)(v * tint[c]));
            p[3] = 255;
        }
    return image;
}

/* Base at 0, height 1, middle on the axis. */
static void set_upright(struct sv_tree_mesh *m)
{
    float lo[3] = {INFINITY, INFINITY, INFINITY}, hi[3] = {-INFINITY, -INFINITY, -INFINITY};
    for (uint32_t i = 0; i < m->vertex_count; i++)
        for (int a = 0; a < 3; a++) {
            lo[a] = fminf(lo[a], m->vertices[i].position[a]);
            hi[a] = fmaxf(hi[a], m->vertices[i].position[a]);
        }
    float scale = 1 / (hi[2] - lo[2]);
    for (uint32_t i = 0; i < m->vertex_count; i++)
        for (int a = 0; a < 3; a++) {
            float *x = &m->vertices[i].position[a];
            *x = (*x - (a == 2 ? lo[2] : 0.5f * (lo[a] + hi[a]))) * scale;
        }
}

struct sv_tree_mesh object_kit_make(enum object_kit_body body)
{
    sv_color_init();
    struct sv_tree_mesh m = {.vertices = must(malloc(VERTICES_MAX * sizeof *m.vertices)),
                             .indices = must(malloc(INDICES_MAX * sizeof *m.indices)),
                             .material_count = 1,
                             .model_height = 1};
    switch (body) {
    case OBJECT_KIT_SPHERE:
        put_surface(&m, sphere, 128, 64, 3, 1.5);
        break;
    case OBJECT_KIT_BOX:
        put_box(&m, sv_vec3(-0.4, -0.3, 0), sv_vec3(0.4, 0.3, 1));
        break;
    case OBJECT_KIT_TORUS:
        put_surface(&m, torus, 128, 64, 3, 1);
        break;
    case OBJECT_KIT_COURTYARD:
        put_courtyard(&m);
        break;
    case OBJECT_KIT_KNOT:
        put_surface(&m, knot, 720, 120, 6, 1);
        put_pedestal(&m);
        break;
    case OBJECT_KIT_URN:
        put_surface(&m, urn, 480, 360, 4, 2);
        break;
    case OBJECT_KIT_COUNT:
        abort();
    }
    set_upright(&m);
    m.radius = 2;
    m.materials[0] = (struct sv_tree_material){
        .name = "stone", .base_color = {1, 1, 1, 1}, .albedo = stone(7), .index_count = m.index_count};
    struct sv_error error;
    if (sv_tree_mesh_check(&m, &error) != SV_OK)
        abort();
    return m;
}
