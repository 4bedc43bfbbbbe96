/* import_sky.c - how much of the sky and of the ground's bounce each vertex of a solid body sees: ambient
 * occlusion.
 *
 * The light model of crowns (mesh_measure.c, a turbid medium) lets light through walls; a house or a rock is
 * opaque. Here the body is drawn into a depth map from DIRECTIONS directions of the whole sphere (a Fibonacci
 * spiral); a point of the surface sees a direction when nothing of the map lies in front of it. What it sees
 * is weighted by the cosine with its normal and by the brightness there: Moon and Spencer's overcast sky
 * (1942), (1 + 2 sin elevation) / 3, above, and BOUNCE of it from the ground below, which is no occluder. A
 * convex body on open ground has 1 everywhere, as the renderer's own normal term expects (light.h).
 *
 * Points lie on the triangles, not at the vertices: a corner under the eaves would otherwise darken a whole
 * wall. A vertex takes the mean of the points of its triangles, weighted by barycentric weight times area:
 * the L2 projection with a lumped mass matrix (own derivation; compare Kavan, Bargteil and Sloan 2011, who
 * solve the whole system). Winding is not trusted: of a surface's two sides the one that gets more light
 * counts, since the inside of a body gets none. Not deposited: alpha masks; a fence casts as a board does, at
 * half strength.
 *
 * Sums run in a fixed order. One thread. */
#include "core/tree/import_parts.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

enum {
    DIRECTIONS = 128,
    MAP_SIDE = 256,
    POINTS_MIN = 1,      /* on a triangle ... */
    POINTS_MAX = 64,     /* ... and at most */
    POINTS_TOTAL = 65536 /* aimed at for a whole mesh */
};
#define BOUNCE 0.25f     /* ground against zenith */
#define MASKED_CAST 0.5f /* share of light that a masked surface keeps away */
#define BIAS_TEXELS                                                                        \
    2.0f /* in front of a point, in texels of the map: below it is the point's own surface \
          */

struct point {
    float p[3], n[3];
    uint32_t triangle;
    float weight[3];        /* barycentric x area */
    float sum[2], total[2]; /* on the normal's side, and behind it */
};

struct map {
    float right[3], down[3], toward[3]; /* unit; toward the light */
    float texel, s0, t0;
    float *solid, *masked; /* largest distance along toward, -INFINITY: nothing */
};

static float dot3(const float a[3], const float b[3])
{
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

static void map_point(const struct map *m, const float p[3], float out[3])
{
    out[0] = (dot3(m->right, p) - m->s0) / m->texel;
    out[1] = (dot3(m->down, p) - m->t0) / m->texel;
    out[2] = dot3(m->toward, p);
}

/* Axes of a picture seen against d. */
static void aim(struct map *m, const double d[3])
{
    struct sv_vec3 z = sv_vec3(d[0], d[1], d[2]);
    struct sv_vec3 pole = fabs(d[2]) < 0.9 ? sv_vec3(0, 0, 1) : sv_vec3(1, 0, 0);
    struct sv_vec3 x = sv_normalize(sv_cross(pole, z)), y = sv_cross(z, x);
    const struct sv_vec3 axes[3] = {x, y, z};
    float *const out[3] = {m->right, m->down, m->toward};
    for (int k = 0; k < 3; k++) {
        out[k][0] = (float)axes[k].x;
        out[k][1] = (float)axes[k].y;
        out[k][2] = (float)axes[k].z;
    }
}

static void fit_map(struct map *m, const struct sv_tree_mesh *mesh)
{
    float lo[2] = {INFINITY, INFINITY}, hi[2] = {-INFINITY, -INFINITY};
    for (uint32_t i = 0; i < mesh->vertex_count; i++) {
        const float *p = mesh->vertices[i].position;
        float at[2] = {dot3(m->right, p), dot3(m->down, p)};
        for (int a = 0; a < 2; a++) {
            lo[a] = fminf(lo[a], at[a]);
            hi[a] = fmaxf(hi[a], at[a]);
        }
    }
    m->texel = fmaxf(hi[0] - lo[0], hi[1] - lo[1]) / (MAP_SIDE - 4);
    m->s0 = lo[0] - 2 * m->texel;
    m->t0 = lo[1] - 2 * m->texel;
    for (int i = 0; i < MAP_SIDE * MAP_SIDE; i++)
        m->solid[i] = m->masked[i] = -INFINITY;
}

/* One triangle into the map: texels whose centres it covers keep the nearest to the light. */
static void draw_triangle(float *target, const float a[3], const float b[3], const float c[3])
{
    float area = (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0]);
    if (!(fabsf(area) > 1e-12f))
        return;
    int x0 = (int)floorf(fminf(a[0], fminf(b[0], c[0]))), x1 = (int)ceilf(fmaxf(a[0], fmaxf(b[0], c[0])));
    int y0 = (int)floorf(fminf(a[1], fminf(b[1], c[1]))), y1 = (int)ceilf(fmaxf(a[1], fmaxf(b[1], c[1])));
    x0 = x0 < 0 ? 0 : x0, y0 = y0 < 0 ? 0 : y0;
    x1 = x1 > MAP_SIDE ? MAP_SIDE : x1, y1 = y1 > MAP_SIDE ? MAP_SIDE : y1;
    for (int y = y0; y < y1; y++)
        for (int x = x0; x < x1; x++) {
            float px = (float)x + 0.5f, py = (float)y + 0.5f;
            float u = ((px - a[0]) * (c[1] - a[1]) - (py - a[1]) * (c[0] - a[0])) / area;
            float v = ((b[0] - a[0]) * (py - a[1]) - (b[1] - a[1]) * (px - a[0])) / area;
            if (u < 0 || v < 0 || u + v > 1)
                continue;
            float z = a[2] + u * (b[2] - a[2]) + v * (c[2] - a[2]), *at = &target[y * MAP_SIDE + x];
            *at = z > *at ? z : *at;
        }
}

static void draw_mesh(const struct map *m, const struct sv_tree_mesh *mesh)
{
    for (int k = 0; k < mesh->material_count; k++) {
        const struct sv_tree_material *material = &mesh->materials[k];
        for (uint32_t i = 0; i < material->index_count; i += 3) {
            float at[3][3];
            for (int c = 0; c < 3; c++)
                map_point(m, mesh->vertices[mesh->indices[material->first_index + i + (uint32_t)c]].position,
                          at[c]);
            draw_triangle(material->masked ? m->masked : m->solid, at[0], at[1], at[2]);
        }
    }
}

/* Share of light along the map's direction that arrives at a point. */
static float seen(const struct map *m, const struct point *q)
{
    float at[3];
    map_point(m, q->p, at);
    int x = (int)at[0], y = (int)at[1];
    if (x < 0 || y < 0 || x >= MAP_SIDE || y >= MAP_SIDE)
        return 1;
    /* A surface at a slant rises by its tangent from texel to texel. */
    float cosine = fmaxf(fabsf(dot3(q->n, m->toward)), 0.2f);
    float slope = sqrtf(1 - fminf(cosine * cosine, 1)) / cosine;
    float front = at[2] + m->texel * BIAS_TEXELS * (1 + slope);
    size_t i = (size_t)y * MAP_SIDE + (size_t)x;
    return m->solid[i] > front ? 0 : m->masked[i] > front ? 1 - MASKED_CAST : 1;
}

static void gather(const struct map *m, struct point *points, uint32_t count)
{
    float brightness = m->toward[2] >= 0 ? (1 + 2 * m->toward[2]) / 3 : BOUNCE;
    for (uint32_t i = 0; i < count; i++) {
        float cosine = dot3(points[i].n, m->toward);
        int side = cosine < 0;
        points[i].total[side] += fabsf(cosine) * brightness;
        points[i].sum[side] += fabsf(cosine) * brightness * seen(m, &points[i]);
    }
}

static float triangle_area(const struct sv_tree_mesh *mesh, uint32_t triangle, float normal[3])
{
    const float *p[3];
    for (int k = 0; k < 3; k++)
        p[k] = mesh->vertices[mesh->indices[3 * (size_t)triangle + (size_t)k]].position;
    for (int i = 0; i < 3; i++) {
        int j = (i + 1) % 3, k = (i + 2) % 3;
        normal[i] = (p[1][j] - p[0][j]) * (p[2][k] - p[0][k]) - (p[1][k] - p[0][k]) * (p[2][j] - p[0][j]);
    }
    return 0.5f * sqrtf(dot3(normal, normal));
}

static uint32_t point_count(float area, float whole)
{
    float wanted = whole > 0 ? POINTS_TOTAL * area / whole : 0;
    return wanted < POINTS_MIN ? POINTS_MIN : wanted > POINTS_MAX ? POINTS_MAX : (uint32_t)wanted;
}

/* Spreads points over a triangle (additive recurrence, Roberts 2018, R2, folded at the diagonal). */
static uint32_t put_points(const struct sv_tree_mesh *mesh, uint32_t triangle, float area, uint32_t count,
                           struct point *out)
{
    const struct sv_tree_vertex *v[3];
    for (int k = 0; k < 3; k++)
        v[k] = &mesh->vertices[mesh->indices[3 * (size_t)triangle + (size_t)k]];
    for (uint32_t i = 0; i < count; i++) {
        double a = fmod(0.5 + 0.7548776662466927 * (i + 1.0), 1),
               b = fmod(0.5 + 0.5698402909980532 * (i + 1.0), 1);
        if (a + b > 1)
            a = 1 - a, b = 1 - b;
        float w[3] = {(float)(1 - a - b), (float)a, (float)b};
        if (count == 1)
            w[0] = w[1] = w[2] = 1 / 3.0f;
        struct point *q = &out[i];
        *q = (struct point){.triangle = triangle};
        for (int c = 0; c < 3; c++) {
            q->p[c] = w[0] * v[0]->position[c] + w[1] * v[1]->position[c] + w[2] * v[2]->position[c];
            q->n[c] = (w[0] * (float)v[0]->normal[c] + w[1] * (float)v[1]->normal[c] +
                       w[2] * (float)v[2]->normal[c]) /
                      32767.0f;
            q->weight[c] = w[c] * area / (float)count;
        }
        float length = sqrtf(dot3(q->n, q->n));
        for (int c = 0; c < 3; c++)
            q->n[c] = length > 0 ? q->n[c] / length : 0;
    }
    return count;
}

static struct point *make_points(const struct sv_tree_mesh *mesh, uint32_t *count)
{
    uint32_t triangles = mesh->index_count / 3;
    float whole = 0, n[3];
    size_t room = 0;
    for (uint32_t i = 0; i < triangles; i++)
        whole += triangle_area(mesh, i, n);
    for (uint32_t i = 0; i < triangles; i++)
        room += point_count(triangle_area(mesh, i, n), whole);
    struct point *points = malloc((room ? room : 1) * sizeof *points);
    *count = 0;
    for (uint32_t i = 0; points && i < triangles; i++) {
        float area = triangle_area(mesh, i, n);
        *count += put_points(mesh, i, area, point_count(area, whole), points + *count);
    }
    return points;
}

/* Vertices from points; one that no point reaches is open. */
static void project(struct sv_tree_mesh *mesh, const struct point *points, uint32_t count, float (*sums)[2])
{
    for (uint32_t i = 0; i < count; i++) {
        int side = points[i].sum[1] > points[i].sum[0];
        float value = points[i].total[side] > 0 ? points[i].sum[side] / points[i].total[side] : 1;
        for (int k = 0; k < 3; k++) {
            float *s = sums[mesh->indices[3 * (size_t)points[i].triangle + (size_t)k]];
            s[0] += points[i].weight[k] * value;
            s[1] += points[i].weight[k];
        }
    }
    for (uint32_t i = 0; i < mesh->vertex_count; i++) {
        float value = sums[i][1] > 0 ? sums[i][0] / sums[i][1] : 1;
        mesh->vertices[i].occlusion = (uint16_t)(65535.0f * fminf(fmaxf(value, 0), 1) + 0.5f);
        memcpy(mesh->vertices[i].open, (const int8_t[4]){0, 0, 0, 127}, 4);
    }
}

enum sv_status raw_measure_sky(struct sv_tree_mesh *mesh, struct sv_error *error)
{
    uint32_t count = 0;
    struct point *points = make_points(mesh, &count);
    float(*sums)[2] = calloc((size_t)mesh->vertex_count + 1, sizeof *sums);
    float *maps = malloc(2 * MAP_SIDE * MAP_SIDE * sizeof *maps);
    enum sv_status status = SV_OK;
    if (!points || !sums || !maps) {
        status = sv_fail(error, SV_ENOMEM, NULL, "no memory to measure %u vertices", mesh->vertex_count);
        goto out;
    }
    struct map m = {.solid = maps, .masked = maps + MAP_SIDE * MAP_SIDE};
    for (int k = 0; k < DIRECTIONS; k++) {
        double z = 1 - (2 * k + 1.0) / DIRECTIONS, across = sqrt(1 - z * z), turn = 2.399963229728653 * k;
        const double d[3] = {across * cos(turn), across * sin(turn), z};
        aim(&m, d);
        fit_map(&m, mesh);
        draw_mesh(&m, mesh);
        gather(&m, points, count);
    }
    project(mesh, points, count, sums);
out:
    free(maps);
    free(sums);
    free(points);
    return status;
}
