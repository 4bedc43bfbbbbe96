/* mesh_measure.c - what a mesh says about itself: extent, mean leaf colour, and how open the sky is at every
 * vertex.
 *
 * Occlusion, own derivation after the turbid-medium model of canopies (Monsi and Saeki 1953; Nilson 1971):
 * the crown is a grid of cubic voxels, each with an extinction coefficient sigma (per height of path): leaves
 * of any orientation   sigma = A / (2 V)   one-sided area A in volume V, mean projection of a randomly turned
 *                                                   flat card = 1/2 of its area; A counts only what the alpha
 * mask keeps closed wood                 sigma = S / (4 V)   surface S, mean projection of a convex body
 * (Cauchy) The share of a direction's light that arrives is T = exp(-integral of sigma). It is swept through
 * the grid plane by plane against the light, one plane a step, from four neighbours of the plane before (a
 * short-characteristics sweep: 16 directions over 64^3 voxels take milliseconds; its small numerical blur is
 * welcome here). A vertex gets the mean of T over the upper half of the sky, weighted by the overcast sky's
 * brightness (Moon and Spencer 1942: (1 + 2 sin elevation) / 3), for wood also by the cosine with its normal:
 * what a flat world without the crown would give it is 1, so that the renderer's own normal term is not
 * counted twice. The ground is not an occluder.
 *
 * Sunlight inside the crown comes from the same sweeps: T of the sky's directions, fitted by a linear
 * function of direction, says what part of the sun a vertex gets from anywhere (sv_tree_vertex.open). It
 * stands in for the crown's shadow on itself where no shadow is cast.
 *
 * Thread: any, nothing is shared. Sums run in a fixed order and use no libm beyond sqrt and floor: the
 * same occlusion on every machine. */
#include "core/tree/mesh.h"

#include <math.h>
#include <stddef.h>
#include <stdlib.h>
#include <string.h>

#include "core/base/color.h"
#include "core/tree/grow_math.h"

enum { GRID_LONGEST = 64, GRID_PAD = 3, RINGS = 4, COLOR_TRIANGLES = 8192 };

/* Samples that a large triangle is spread over at most: 1/64 of a trunk face is far below a voxel. */
enum { SAMPLES_MAX = 4096 };

struct grid {
    int nx, ny, nz;
    float origin[3]; /* centre of node (0, 0, 0) */
    float step;      /* heights between nodes */
    float *sigma;    /* per height */
    float *light;    /* T of the direction in hand */
};

static size_t grid_at(const struct grid *g, int x, int y, int z)
{
    return ((size_t)z * (size_t)g->ny + (size_t)y) * (size_t)g->nx + (size_t)x;
}

struct bounds {
    float lo[3], hi[3];
};

static struct bounds find_bounds(const struct sv_tree_mesh *mesh)
{
    struct bounds b = {{INFINITY, INFINITY, INFINITY}, {-INFINITY, -INFINITY, -INFINITY}};
    for (uint32_t i = 0; i < mesh->vertex_count; i++)
        for (int a = 0; a < 3; a++) {
            b.lo[a] = fminf(b.lo[a], mesh->vertices[i].position[a]);
            b.hi[a] = fmaxf(b.hi[a], mesh->vertices[i].position[a]);
        }
    return b;
}

static enum sv_status grid_init(struct grid *g, const struct bounds *b, struct sv_error *error)
{
    float longest = 0;
    for (int a = 0; a < 3; a++)
        longest = fmaxf(longest, b->hi[a] - b->lo[a]);
    g->step = longest / GRID_LONGEST;
    int n[3];
    for (int a = 0; a < 3; a++) {
        n[a] = (int)((b->hi[a] - b->lo[a]) / g->step) + 2 + 2 * GRID_PAD;
        g->origin[a] = b->lo[a] - GRID_PAD * g->step;
    }
    g->nx = n[0], g->ny = n[1], g->nz = n[2];
    size_t count = (size_t)n[0] * (size_t)n[1] * (size_t)n[2];
    g->sigma = calloc(count, sizeof *g->sigma);
    g->light = malloc(count * sizeof *g->light);
    if (!g->sigma || !g->light)
        return sv_fail(error, SV_ENOMEM, NULL, "no memory for a light grid of %zu voxels", count);
    return SV_OK;
}

/* Node below p and the three weights of the node above; p inside the grid's nodes (clamped to them). */
static size_t grid_cell(const struct grid *g, const float p[3], float w[3])
{
    int n[3] = {g->nx, g->ny, g->nz}, cell[3];
    for (int a = 0; a < 3; a++) {
        float t = (p[a] - g->origin[a]) / g->step;
        float last = (float)(n[a] - 1) - 1e-3f;
        t = t > 0 ? t : 0;
        t = t < last ? t : last;
        cell[a] = (int)t;
        w[a] = t - (float)cell[a];
    }
    return grid_at(g, cell[0], cell[1], cell[2]);
}

static void grid_add(struct grid *g, const float p[3], float value)
{
    float w[3];
    float *c = g->sigma + grid_cell(g, p, w);
    size_t sy = (size_t)g->nx, sz = sy * (size_t)g->ny;
    for (int k = 0; k < 8; k++)
        c[(k & 1 ? 1 : 0) + (k & 2 ? sy : 0) + (k & 4 ? sz : 0)] +=
            value * (k & 1 ? w[0] : 1 - w[0]) * (k & 2 ? w[1] : 1 - w[1]) * (k & 4 ? w[2] : 1 - w[2]);
}

static float grid_get(const struct grid *g, const float p[3])
{
    float w[3];
    const float *c = g->light + grid_cell(g, p, w);
    size_t sy = (size_t)g->nx, sz = sy * (size_t)g->ny;
    float x00 = c[0] + w[0] * (c[1] - c[0]), x10 = c[sy] + w[0] * (c[sy + 1] - c[sy]);
    float x01 = c[sz] + w[0] * (c[sz + 1] - c[sz]), x11 = c[sz + sy] + w[0] * (c[sz + sy + 1] - c[sz + sy]);
    float y0 = x00 + w[1] * (x10 - x00), y1 = x01 + w[1] * (x11 - x01);
    return y0 + w[2] * (y1 - y0);
}

struct triangle {
    const struct sv_tree_vertex *v[3];
    float area; /* heights squared */
};

static struct triangle get_triangle(const struct sv_tree_mesh *mesh, uint32_t first)
{
    struct triangle t;
    for (int i = 0; i < 3; i++)
        t.v[i] = &mesh->vertices[mesh->indices[first + (uint32_t)i]];
    const float *p = t.v[0]->position, *q = t.v[1]->position, *r = t.v[2]->position;
    float a[3] = {q[0] - p[0], q[1] - p[1], q[2] - p[2]}, b[3] = {r[0] - p[0], r[1] - p[1], r[2] - p[2]};
    float c[3] = {a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]};
    t.area = 0.5f * sqrtf(c[0] * c[0] + c[1] * c[1] + c[2] * c[2]);
    return t;
}

/* The k-th of the additive-recurrence points in a triangle (Roberts 2018, "R2", folded at the diagonal). */
static void barycentric(uint32_t k, float w[3])
{
    double u = 0.5 + 0.7548776662466927 * (k + 1.0), v = 0.5 + 0.5698402909980532 * (k + 1.0);
    u -= floor(u), v -= floor(v);
    if (u + v > 1)
        u = 1 - u, v = 1 - v;
    w[0] = (float)(1 - u - v), w[1] = (float)u, w[2] = (float)v;
}

/* Linear colour and alpha of a material at a point of a triangle (nearest texel, wrapped). */
static void sample_material(const struct sv_tree_material *m, const struct triangle *t, const float w[3],
                            float rgba[4])
{
    memcpy(rgba, m->base_color, 4 * sizeof *rgba);
    if (!m->albedo.data)
        return;
    int at[2], size[2] = {m->albedo.width, m->albedo.height};
    for (int a = 0; a < 2; a++) {
        float c = w[0] * t->v[0]->uv[a] + w[1] * t->v[1]->uv[a] + w[2] * t->v[2]->uv[a];
        at[a] = (int)((c - floorf(c)) * (float)size[a]);
        at[a] = at[a] >= size[a] ? size[a] - 1 : at[a];
    }
    const uint8_t *texel =
        (const uint8_t *)m->albedo.data + 4 * ((size_t)at[1] * (size_t)size[0] + (size_t)at[0]);
    for (int c = 0; c < 3; c++)
        rgba[c] *= sv_linear_from_srgb8[texel[c]];
    rgba[3] *= (float)texel[3] / 255.0f;
}

struct look {
    double rgb[3]; /* area-weighted sum of linear colour where the mask keeps it */
    double kept, area;
};

/* Adds what a material looks like, from at most COLOR_TRIANGLES of its triangles, three points each. */
static struct look look_at(const struct sv_tree_mesh *mesh, const struct sv_tree_material *m)
{
    struct look look = {{0}, 0, 0};
    uint32_t triangles = m->index_count / 3, stride = triangles / COLOR_TRIANGLES + 1;
    for (uint32_t i = 0; i < triangles; i += stride) {
        struct triangle t = get_triangle(mesh, m->first_index + 3 * i);
        for (uint32_t k = 0; k < 3; k++) {
            float w[3], rgba[4];
            barycentric(3 * i + k, w);
            sample_material(m, &t, w, rgba);
            look.area += (double)t.area;
            if (m->masked && rgba[3] < m->alpha_cutoff)
                continue;
            look.kept += (double)t.area;
            for (int c = 0; c < 3; c++)
                look.rgb[c] += (double)t.area * (double)rgba[c];
        }
    }
    /* Back from the sample to all of the material: triangles left out are taken to be like those seen. */
    double scale = triangles ? (double)stride / 3.0 : 0;
    for (int c = 0; c < 3; c++)
        look.rgb[c] *= scale;
    look.kept *= scale;
    look.area *= scale;
    return look;
}

/* Spreads a material's extinction over the grid. */
static void deposit(struct grid *g, const struct sv_tree_mesh *mesh, const struct sv_tree_material *m)
{
    struct look look = look_at(mesh, m);
    float cover = look.area > 0 ? (float)(look.kept / look.area) : 1;
    float share = cover * (m->is_leaf || m->two_sided ? 0.5f : 0.25f) / (g->step * g->step * g->step);
    for (uint32_t i = 0; i < m->index_count; i += 3) {
        struct triangle t = get_triangle(mesh, m->first_index + i);
        float wanted = 4.0f * t.area / (g->step * g->step);
        uint32_t samples = 1 + (uint32_t)fminf(wanted, SAMPLES_MAX);
        for (uint32_t k = 0; k < samples; k++) {
            float w[3] = {1 / 3.0f, 1 / 3.0f, 1 / 3.0f}, p[3];
            if (samples > 1)
                barycentric(k, w);
            for (int a = 0; a < 3; a++)
                p[a] = w[0] * t.v[0]->position[a] + w[1] * t.v[1]->position[a] + w[2] * t.v[2]->position[a];
            grid_add(g, p, share * t.area / (float)samples);
        }
    }
}

/* exp(-x) for x >= 0, relative error 2e-7, taken at 80 beyond: 2^whole times a Taylor polynomial. Its own,
 * because libm's expf has other last bits on other machines (and one call a node is slow). */
static inline float decay(float x)
{
    float y = -1.44269504f * (x < 80 ? x : 80);
    int whole = (int)(y - 0.5f); /* y <= 0: to the nearest */
    float f = (y - (float)whole) * 0.69314718f;
    float p = 1 + f * (1 + f * (1 / 2.0f + f * (1 / 6.0f + f * (1 / 24.0f + f * (1 / 120.0f + f / 720.0f)))));
    uint32_t bits = (uint32_t)(whole + 127) << 23;
    float scale;
    memcpy(&scale, &bits, sizeof scale);
    return p * scale;
}

/* The four nodes of the plane before that the light of a node comes through: offsets and weights. */
struct upwind {
    ptrdiff_t at[4];
    float weight[4], path;
};

/* One row of nodes, `stride` apart, from the plane before at l0 (light) and s0 (extinction): the planes never
 * overlap. */
static inline void sweep_row(const struct upwind *up, const float *restrict l0, const float *restrict s0,
                             const float *restrict sigma, float *restrict light, ptrdiff_t count,
                             ptrdiff_t stride)
{
    const float *l1 = l0 + up->at[1], *l2 = l0 + up->at[2], *l3 = l0 + up->at[3];
    const float *s1 = s0 + up->at[1], *s2 = s0 + up->at[2], *s3 = s0 + up->at[3];
    const float *w = up->weight, path = 0.5f * up->path;
    l0 += up->at[0];
    s0 += up->at[0];
    for (ptrdiff_t i = 0; i < count * stride; i += stride) {
        float l = w[0] * l0[i] + w[1] * l1[i] + w[2] * l2[i] + w[3] * l3[i];
        float s = sigma[i] + w[0] * s0[i] + w[1] * s1[i] + w[2] * s2[i] + w[3] * s3[i];
        l *= decay(path * s);
        light[i] = l > 1e-12f ? l : 0; /* denormal numbers are slow */
    }
}

/* Fills g->light with the share of light that comes from the unit direction d (towards the light, d[2] > 0).
 * The outermost nodes stay at 1: on the light's side that is the truth, on the others nothing reads them. */
static void sweep(struct grid *g, const float d[3])
{
    int n[3] = {g->nx, g->ny, g->nz};
    size_t stride[3] = {1, (size_t)g->nx, (size_t)g->nx * (size_t)g->ny}, count = stride[2] * (size_t)g->nz;
    for (size_t i = 0; i < count; i++)
        g->light[i] = 1;
    int major = 0;
    for (int a = 1; a < 3; a++)
        if (fabsf(d[a]) > fabsf(d[major]))
            major = a;
    int u = major == 0 ? 1 : 0, v = major == 2 ? 1 : 2;
    int forward = d[major] > 0 ? 1 : -1; /* light comes from the plane at +forward */
    float du = d[u] / fabsf(d[major]), dv = d[v] / fabsf(d[major]);
    int cu = (int)floorf(du), cv = (int)floorf(dv);
    float wu = du - (float)cu, wv = dv - (float)cv;
    struct upwind up = {.path = g->step / fabsf(d[major])};
    for (int k = 0; k < 4; k++) {
        up.at[k] = forward * (ptrdiff_t)stride[major] + (cu + (k & 1)) * (ptrdiff_t)stride[u] +
                   (cv + (k >> 1)) * (ptrdiff_t)stride[v];
        up.weight[k] = (k & 1 ? wu : 1 - wu) * (k >> 1 ? wv : 1 - wv);
    }
    for (int s = 1; s < n[major]; s++) {
        size_t plane = (size_t)(forward > 0 ? n[major] - 1 - s : s) * stride[major];
        for (int j = 1; j < n[v] - 1; j++) {
            size_t at = plane + (size_t)j * stride[v] + stride[u];
            const float *l = g->light + at, *s0 = g->sigma + at;
            if (u == 0) /* along x, side by side: the compiler makes vectors of it */
                sweep_row(&up, l, s0, s0, g->light + at, n[u] - 2, 1);
            else
                sweep_row(&up, l, s0, s0, g->light + at, n[u] - 2, (ptrdiff_t)stride[u]);
        }
    }
}

struct sky {
    float d[4 * RINGS][3], weight[4 * RINGS]; /* weight: solid angle x brightness */
};

/* Four rings of equal solid angle, four directions each, turned against one another. */
static struct sky make_sky(void)
{
    struct sky sky;
    for (int r = 0; r < RINGS; r++)
        for (int k = 0; k < 4; k++) {
            double z = (r + 0.5) / RINGS, across = sqrt(1 - z * z),
                   turn = (k + (r * 0.618 + 0.1)) * (SV_PI / 2);
            float *d = sky.d[4 * r + k];
            double s, c;
            sv_grow_sincos(turn, &s, &c);
            d[0] = (float)(across * c);
            d[1] = (float)(across * s);
            d[2] = (float)z;
            sky.weight[4 * r + k] = (float)((1 + 2 * z) / 3);
        }
    return sky;
}

/* One byte a vertex: 1 where a leaf's triangle uses it. */
static void mark_leaves(const struct sv_tree_mesh *mesh, uint8_t *leafy)
{
    for (int m = 0; m < mesh->material_count; m++)
        for (uint32_t i = 0; mesh->materials[m].is_leaf && i < mesh->materials[m].index_count; i++)
            leafy[mesh->indices[mesh->materials[m].first_index + i]] = 1;
}

/* What a vertex has gathered: occlusion's weighted mean, and T times 1, dx, dy, dz. */
struct gathered {
    float sum, total, open[4];
};

static void gather(const struct grid *g, const struct sky *sky, int direction,
                   const struct sv_tree_mesh *mesh, const uint8_t *leafy, struct gathered *gathered)
{
    const float *d = sky->d[direction];
    for (uint32_t i = 0; i < mesh->vertex_count; i++) {
        const struct sv_tree_vertex *v = &mesh->vertices[i];
        float n[3], p[3], weight = sky->weight[direction];
        for (int a = 0; a < 3; a++)
            n[a] = (float)v->normal[a] / 32767.0f;
        /* Wood looks out from a voxel off its surface, so that it does not shade itself. */
        for (int a = 0; a < 3; a++)
            p[a] = v->position[a] + (leafy[i] ? 0 : 1.2f * g->step * n[a]);
        if (!leafy[i]) { /* the floor of 0.05 gives faces that look down a mean of what there is */
            float cosine = n[0] * d[0] + n[1] * d[1] + n[2] * d[2];
            weight *= cosine > 0.05f ? cosine : 0.05f;
        }
        float light = grid_get(g, p);
        gathered[i].sum += weight * light;
        gathered[i].total += weight;
        gathered[i].open[3] += light;
        for (int a = 0; a < 3; a++)
            gathered[i].open[a] += light * d[a];
    }
}

/* Least squares of T by m + s.d over the sky's directions (own derivation). The rings are turned squares, so
 * dx and dy are orthogonal to each other, to dz and to 1; m and s_z share one 2 x 2 system. */
struct fit {
    float xx, yy, n, z, zz, det;
};

static struct fit make_fit(const struct sky *sky)
{
    struct fit f = {.n = 4 * RINGS};
    for (int k = 0; k < 4 * RINGS; k++) {
        const float *d = sky->d[k];
        f.xx += d[0] * d[0];
        f.yy += d[1] * d[1];
        f.z += d[2];
        f.zz += d[2] * d[2];
    }
    f.det = f.n * f.zz - f.z * f.z;
    return f;
}

static int8_t open_code(float v)
{
    return (int8_t)floorf(fminf(fmaxf(v, -1), 1) * 127.0f + 0.5f);
}

static void fit_open(const struct fit *f, const float sums[4], int8_t open[4])
{
    open[0] = open_code(sums[0] / f->xx);
    open[1] = open_code(sums[1] / f->yy);
    open[2] = open_code((f->n * sums[2] - f->z * sums[3]) / f->det);
    open[3] = open_code(fmaxf((f->zz * sums[3] - f->z * sums[2]) / f->det, 0));
}

static enum sv_status measure_occlusion(struct sv_tree_mesh *mesh, const struct bounds *b,
                                        struct sv_error *error)
{
    struct grid g = {0};
    struct sky sky = make_sky();
    uint8_t *leafy = calloc(mesh->vertex_count, 1);
    struct gathered *gathered = calloc(mesh->vertex_count, sizeof *gathered);
    enum sv_status status = SV_OK;
    if (!leafy || !gathered)
        status = sv_fail(error, SV_ENOMEM, NULL, "no memory to measure %u vertices", mesh->vertex_count);
    if (status == SV_OK)
        status = grid_init(&g, b, error);
    if (status != SV_OK)
        goto out;
    mark_leaves(mesh, leafy);
    for (int m = 0; m < mesh->material_count; m++)
        deposit(&g, mesh, &mesh->materials[m]);
    for (int d = 0; d < 4 * RINGS; d++) {
        sweep(&g, sky.d[d]);
        gather(&g, &sky, d, mesh, leafy, gathered);
    }
    struct fit fit = make_fit(&sky);
    for (uint32_t i = 0; i < mesh->vertex_count; i++) {
        mesh->vertices[i].occlusion =
            (uint16_t)(65535.0f * fminf(gathered[i].sum / gathered[i].total, 1) + 0.5f);
        fit_open(&fit, gathered[i].open, mesh->vertices[i].open);
    }
out:
    free(g.sigma);
    free(g.light);
    free(gathered);
    free(leafy);
    return status;
}

static void measure_crown(struct sv_tree_mesh *mesh)
{
    float radius2 = 0, base = INFINITY;
    for (uint32_t i = 0; i < mesh->vertex_count; i++) {
        const float *p = mesh->vertices[i].position;
        radius2 = fmaxf(radius2, p[0] * p[0] + p[1] * p[1]);
    }
    struct look leaf = {{0}, 0, 0}, wood = {{0}, 0, 0};
    for (int k = 0; k < mesh->material_count; k++) {
        const struct sv_tree_material *m = &mesh->materials[k];
        struct look look = look_at(mesh, m), *into = m->is_leaf ? &leaf : &wood;
        into->kept += look.kept;
        for (int c = 0; c < 3; c++)
            into->rgb[c] += look.rgb[c];
        for (uint32_t i = 0; m->is_leaf && i < m->index_count; i++)
            base = fminf(base, mesh->vertices[mesh->indices[m->first_index + i]].position[2]);
    }
    const struct look *look = leaf.kept > 0 ? &leaf : &wood;
    mesh->radius = sqrtf(radius2);
    mesh->crown_base = isfinite(base) ? base : 0;
    for (int c = 0; c < 3; c++)
        mesh->crown_color[c] = look->kept > 0 ? (float)(look->rgb[c] / look->kept) : 0;
}

enum sv_status sv_tree_mesh_measure(struct sv_tree_mesh *mesh, struct sv_error *error)
{
    mesh->radius = mesh->crown_base = 0;
    memset(mesh->crown_color, 0, sizeof mesh->crown_color);
    enum sv_status status = sv_tree_mesh_check(mesh, error);
    if (status != SV_OK)
        return status;
    struct bounds b = find_bounds(mesh);
    if (!(fabsf(b.lo[2]) <= 1e-3f) || !(fabsf(b.hi[2] - 1) <= 1e-3f))
        return sv_fail(error, SV_EFORMAT, "mesh.vertices.position",
                       "the tree reaches from z = %g to %g, not from 0 to 1", (double)b.lo[2],
                       (double)b.hi[2]);
    sv_color_init();
    measure_crown(mesh);
    status = measure_occlusion(mesh, &b, error);
    return status == SV_OK ? sv_tree_mesh_check(mesh, error) : status;
}
