/* cloud_cut.c - cuts a mesh into the pieces that a billboard cloud lays on its planes.
 *
 * Leaf materials: triangles that share vertices are one component; a small flat one is a leaf and stays whole
 * (tearing it would show). A small one that is not flat (two cards that cross) falls into groups of triangles
 * of one direction; a large one (a leafy shell) is bisected across its longest axis until its pieces are
 * small. Wood: triangles are first halved until no edge is long, components (by place, since faces that are
 * shaded flat share no vertices) are bisected across their longest axis, which cuts tubes into lengths. */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "core/tree/cloud_private.h"

enum { CARD_TRIANGLES_MAX = 8 };

/* In tree heights; by eye on five grown and four imported trees: shorter lengths of wood fray where
 * neighbours lie on different planes, longer ones stand off bent boughs. */
static const double WOOD_LENGTH = 0.10, LEAF_LENGTH = 0.06;
/* |sum of area vectors| / sum of areas above which a piece is flat: leaves bent by up to about 40 degrees. */
static const double FLAT = 0.9;

void sv_cloud_eigen(const double m[6], double values[3], double vectors[3][3])
{
    double a[3][3] = {{m[0], m[3], m[4]}, {m[3], m[1], m[5]}, {m[4], m[5], m[2]}};
    double v[3][3] = {{1, 0, 0}, {0, 1, 0}, {0, 0, 1}};
    for (int sweep = 0; sweep < 12; sweep++)
        for (int p = 0; p < 2; p++)
            for (int q = p + 1; q < 3; q++) {
                if (fabs(a[p][q]) < 1e-300)
                    continue;
                double theta = (a[q][q] - a[p][p]) / (2 * a[p][q]);
                double t = (theta >= 0 ? 1 : -1) / (fabs(theta) + sqrt(theta * theta + 1));
                double c = 1 / sqrt(t * t + 1), s = t * c;
                for (int k = 0; k < 3; k++) {
                    double x = a[k][p], y = a[k][q];
                    a[k][p] = c * x - s * y;
                    a[k][q] = s * x + c * y;
                }
                for (int k = 0; k < 3; k++) {
                    double x = a[p][k], y = a[q][k];
                    a[p][k] = c * x - s * y;
                    a[q][k] = s * x + c * y;
                    x = v[p][k], y = v[q][k];
                    v[p][k] = c * x - s * y;
                    v[q][k] = s * x + c * y;
                }
            }
    int order[3] = {0, 1, 2};
    for (int i = 0; i < 2; i++)
        for (int k = 0; k < 2 - i; k++)
            if (a[order[k]][order[k]] > a[order[k + 1]][order[k + 1]]) {
                int swap = order[k];
                order[k] = order[k + 1];
                order[k + 1] = swap;
            }
    for (int k = 0; k < 3; k++) {
        values[k] = a[order[k]][order[k]];
        memcpy(vectors[k], v[order[k]], sizeof v[0]);
    }
}

/* ---- triangles ---- */

static void corners(const struct sv_tree_mesh *mesh, const struct sv_cloud_triangle *t, double p[3][3])
{
    const uint32_t *index = mesh->indices + t->index;
    for (int k = 0; k < 3; k++) {
        double a = t->at[k][0] / (double)SV_CLOUD_WEIGHT_ONE, b = t->at[k][1] / (double)SV_CLOUD_WEIGHT_ONE;
        for (int c = 0; c < 3; c++)
            p[k][c] = (1 - a - b) * (double)mesh->vertices[index[0]].position[c] +
                      a * (double)mesh->vertices[index[1]].position[c] +
                      b * (double)mesh->vertices[index[2]].position[c];
    }
}

static double dot(const double a[3], const double b[3])
{
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

/* Half the cross product of two edges: its length is the area. */
static void area_vector(const double p[3][3], double out[3])
{
    double a[3], b[3];
    for (int c = 0; c < 3; c++) {
        a[c] = p[1][c] - p[0][c];
        b[c] = p[2][c] - p[0][c];
    }
    out[0] = 0.5 * (a[1] * b[2] - a[2] * b[1]);
    out[1] = 0.5 * (a[2] * b[0] - a[0] * b[2]);
    out[2] = 0.5 * (a[0] * b[1] - a[1] * b[0]);
}

static bool push_triangle(struct cloud_cut *cut, const struct sv_cloud_triangle *t)
{
    if (cut->triangle_count == cut->triangle_room) {
        uint32_t room = cut->triangle_room ? 2 * cut->triangle_room : 4096;
        struct sv_cloud_triangle *grown = realloc(cut->triangles, room * sizeof *grown);
        if (!grown)
            return false;
        cut->triangles = grown;
        cut->triangle_room = room;
    }
    cut->triangles[cut->triangle_count++] = *t;
    return true;
}

/* Halves the longest edge until none is longer than limit; the weights' 15 bits end it at the latest. */
static bool push_halved(const struct sv_tree_mesh *mesh, struct cloud_cut *cut, struct sv_cloud_triangle t,
                        double limit, int depth)
{
    double p[3][3], longest = 0;
    int edge = 0;
    corners(mesh, &t, p);
    for (int k = 0; k < 3; k++) {
        double d[3];
        for (int c = 0; c < 3; c++)
            d[c] = p[(k + 1) % 3][c] - p[k][c];
        double l = dot(d, d);
        if (l > longest) {
            longest = l;
            edge = k;
        }
    }
    int next = (edge + 1) % 3, sum[2] = {t.at[edge][0] + t.at[next][0], t.at[edge][1] + t.at[next][1]};
    if (longest <= limit * limit || depth == 0 || sum[0] % 2 || sum[1] % 2)
        return push_triangle(cut, &t);
    struct sv_cloud_triangle first = t, second = t;
    for (int c = 0; c < 2; c++)
        first.at[next][c] = second.at[edge][c] = (uint16_t)(sum[c] / 2);
    return push_halved(mesh, cut, first, limit, depth - 1) &&
           push_halved(mesh, cut, second, limit, depth - 1);
}

/* ---- parts ---- */

static struct cloud_part *push_part(struct cloud_cut *cut)
{
    if (cut->part_count == cut->part_room) {
        uint32_t room = cut->part_room ? 2 * cut->part_room : 1024;
        struct cloud_part *grown = realloc(cut->parts, room * sizeof *grown);
        if (!grown)
            return NULL;
        cut->parts = grown;
        cut->part_room = room;
    }
    struct cloud_part *part = &cut->parts[cut->part_count++];
    memset(part, 0, sizeof *part);
    return part;
}

struct moments {
    double area, mean[3], cov[6], vector[3]; /* vector: sum of area vectors, turned to one side */
};

static void measure(const struct sv_tree_mesh *mesh, const struct sv_cloud_triangle *t, uint32_t count,
                    struct moments *out)
{
    static const int row[6] = {0, 1, 2, 0, 0, 1}, column[6] = {0, 1, 2, 1, 2, 2};
    double second[6] = {0};
    *out = (struct moments){0};
    for (uint32_t i = 0; i < count; i++) {
        double p[3][3], v[3];
        corners(mesh, &t[i], p);
        area_vector((const double(*)[3])p, v);
        double area = sqrt(dot(v, v)), side = dot(v, out->vector) < 0 ? -1 : 1, mid[3];
        out->area += area;
        for (int c = 0; c < 3; c++) {
            mid[c] = (p[0][c] + p[1][c] + p[2][c]) / 3;
            out->vector[c] += side * v[c];
            out->mean[c] += area * mid[c];
        }
        /* Second moment of a triangle: (9 mid mid' + sum of p p') / 12. */
        for (int c = 0; c < 6; c++) {
            int a = row[c], b = column[c];
            second[c] +=
                area * (9 * mid[a] * mid[b] + p[0][a] * p[0][b] + p[1][a] * p[1][b] + p[2][a] * p[2][b]) / 12;
        }
    }
    double inverse = out->area > 0 ? 1 / out->area : 0;
    for (int c = 0; c < 3; c++)
        out->mean[c] *= inverse;
    for (int c = 0; c < 6; c++)
        out->cov[c] = second[c] * inverse - out->mean[row[c]] * out->mean[column[c]];
}

/* Triangles first .. first + count become a part; without area they are dropped. */
static bool add_part(const struct sv_tree_mesh *mesh, struct cloud_cut *cut, uint32_t first, uint32_t count,
                     int material)
{
    struct moments m;
    measure(mesh, cut->triangles + first, count, &m);
    if (!(m.area > 1e-12)) /* a square of a millionth of the height */
        return true;
    struct cloud_part *part = push_part(cut);
    if (!part)
        return false;
    bool leaf = mesh->materials[material].is_leaf;
    double values[3], vectors[3][3], length = sqrt(dot(m.vector, m.vector));
    sv_cloud_eigen(m.cov, values, vectors);
    part->area = (float)m.area;
    part->first_triangle = first;
    part->triangle_count = count;
    part->material = (uint8_t)material;
    for (int c = 0; c < 3; c++)
        part->centre[c] = (float)m.mean[c];
    if (leaf) {
        part->flags = SV_CLOUD_LEAF;
        cut->leaf_parts++;
        if (length > FLAT * m.area) {
            part->flags |= SV_CLOUD_TURNED;
            for (int c = 0; c < 3; c++)
                part->normal[c] = (float)(m.vector[c] / length);
        }
        part->spread2 = (float)(0.5 * (fmax(values[1], 0) + fmax(values[2], 0)));
    } else {
        part->radius = (float)sqrt(fmax(values[0] + values[1], 0));
        part->spread2 = (float)fmax(values[2] - values[1], 0);
        if (values[2] > 1.5 * values[1])
            for (int c = 0; c < 3; c++)
                part->axis[c] = (float)vectors[2][c];
    }
    return true;
}

static void swap_triangles(struct sv_cloud_triangle *t, uint32_t a, uint32_t b)
{
    struct sv_cloud_triangle swap = t[a];
    t[a] = t[b];
    t[b] = swap;
}

/* Bisects at the middle of the longest axis until the extent is at most limit. */
static bool bisect(const struct sv_tree_mesh *mesh, struct cloud_cut *cut, uint32_t first, uint32_t count,
                   int material, double limit)
{
    struct moments m;
    double values[3], vectors[3][3], lo = INFINITY, hi = -INFINITY;
    struct sv_cloud_triangle *t = cut->triangles + first;
    measure(mesh, t, count, &m);
    sv_cloud_eigen(m.cov, values, vectors);
    for (uint32_t i = 0; i < count; i++) {
        double p[3][3];
        corners(mesh, &t[i], p);
        for (int k = 0; k < 3; k++) {
            double x = dot(p[k], vectors[2]);
            lo = fmin(lo, x);
            hi = fmax(hi, x);
        }
    }
    if (count < 2 || hi - lo <= limit)
        return add_part(mesh, cut, first, count, material);
    uint32_t split = 0;
    for (uint32_t i = 0; i < count; i++) {
        double p[3][3];
        corners(mesh, &t[i], p);
        if ((dot(p[0], vectors[2]) + dot(p[1], vectors[2]) + dot(p[2], vectors[2])) / 3 < 0.5 * (lo + hi))
            swap_triangles(t, i, split++);
    }
    if (split == 0 || split == count)
        split = count / 2;
    return bisect(mesh, cut, first, split, material, limit) &&
           bisect(mesh, cut, first + split, count - split, material, limit);
}

/* Groups of triangles whose planes have one direction. */
static bool add_groups(const struct sv_tree_mesh *mesh, struct cloud_cut *cut, uint32_t first, uint32_t count,
                       int material)
{
    while (count > 0) {
        struct sv_cloud_triangle *t = cut->triangles + first;
        double p[3][3], lead[3], v[3];
        uint32_t same = 1;
        corners(mesh, &t[0], p);
        area_vector((const double(*)[3])p, lead);
        for (uint32_t i = 1; i < count; i++) {
            corners(mesh, &t[i], p);
            area_vector((const double(*)[3])p, v);
            if (fabs(dot(v, lead)) >= FLAT * sqrt(dot(v, v) * dot(lead, lead)))
                swap_triangles(t, i, same++);
        }
        if (!add_part(mesh, cut, first, same, material))
            return false;
        first += same;
        count -= same;
    }
    return true;
}

static bool add_component(const struct sv_tree_mesh *mesh, struct cloud_cut *cut, const uint32_t *index,
                          uint32_t count, int material)
{
    bool leaf = mesh->materials[material].is_leaf, ok = true;
    uint32_t first = cut->triangle_count;
    for (uint32_t i = 0; ok && i < count; i++) {
        struct sv_cloud_triangle t = {.index = index[i]};
        t.at[1][0] = t.at[2][1] = SV_CLOUD_WEIGHT_ONE;
        ok = leaf ? push_triangle(cut, &t) : push_halved(mesh, cut, t, cut->wood_length, 24);
    }
    if (!ok)
        return false;
    if (!leaf || count > CARD_TRIANGLES_MAX)
        return bisect(mesh, cut, first, cut->triangle_count - first, material,
                      leaf ? LEAF_LENGTH : cut->wood_length);
    struct moments m;
    measure(mesh, cut->triangles + first, count, &m);
    if (sqrt(dot(m.vector, m.vector)) > FLAT * m.area)
        return add_part(mesh, cut, first, count, material);
    return add_groups(mesh, cut, first, count, material);
}

/* ---- components ---- */

static uint32_t find_root(uint32_t *parent, uint32_t i)
{
    while (parent[i] != i)
        i = parent[i] = parent[parent[i]];
    return i;
}

static void unite(uint32_t *parent, uint32_t a, uint32_t b)
{
    a = find_root(parent, a);
    b = find_root(parent, b);
    if (a < b)
        parent[b] = a;
    else
        parent[a] = b;
}

static uint32_t hash_place(const float p[3], uint32_t mask)
{
    uint32_t h = 2166136261u;
    for (int c = 0; c < 3; c++) {
        float zeroed = p[c] + 0.0f; /* -0 and 0 are one place */
        uint32_t bits;
        memcpy(&bits, &zeroed, sizeof bits);
        h = (h ^ bits) * 16777619u;
        h ^= h >> 15;
    }
    return h & mask;
}

/* Unites vertices of the material that stand at one place. */
static bool weld(const struct sv_tree_mesh *mesh, const struct sv_tree_material *material, uint32_t *parent)
{
    uint32_t size = 64;
    while (size < 2 * material->index_count)
        size *= 2;
    uint32_t *table = malloc(size * sizeof *table);
    if (!table)
        return false;
    memset(table, 0xff, size * sizeof *table);
    for (uint32_t i = 0; i < material->index_count; i++) {
        uint32_t vertex = mesh->indices[material->first_index + i];
        const float *p = mesh->vertices[vertex].position;
        uint32_t at = hash_place(p, size - 1);
        for (; table[at] != UINT32_MAX; at = (at + 1) & (size - 1)) {
            const float *q = mesh->vertices[table[at]].position;
            if (p[0] == q[0] && p[1] == q[1] && p[2] == q[2])
                break;
        }
        if (table[at] == UINT32_MAX)
            table[at] = vertex;
        else
            unite(parent, vertex, table[at]);
    }
    free(table);
    return true;
}

/* Triangles a component, on the average; start is scratch. */
static double triangles_a_component(const struct sv_tree_mesh *mesh, const struct sv_tree_material *material,
                                    uint32_t *parent, uint32_t *start)
{
    const uint32_t *index = mesh->indices + material->first_index;
    uint32_t components = 0;
    for (uint32_t i = 0; i < material->index_count; i++)
        start[index[i]] = 0;
    for (uint32_t i = 0; i < material->index_count; i += 3)
        components += start[find_root(parent, index[i])]++ == 0;
    return components ? material->index_count / 3.0 / components : 0;
}

/* scratch: two words a vertex, and one a triangle of the material. */
static bool cut_material(const struct sv_tree_mesh *mesh, int material, uint32_t *parent, uint32_t *start,
                         uint32_t *sorted, struct cloud_cut *cut)
{
    const struct sv_tree_material *m = &mesh->materials[material];
    const uint32_t *index = mesh->indices + m->first_index;
    for (uint32_t i = 0; i < m->index_count; i++)
        parent[index[i]] = index[i];
    for (uint32_t i = 0; i < m->index_count; i += 3) {
        unite(parent, index[i], index[i + 1]);
        unite(parent, index[i], index[i + 2]);
    }
    /* Leaves touch at their stalks: they are welded only when hardly any triangle shares a vertex. */
    if ((!m->is_leaf || triangles_a_component(mesh, m, parent, start) < 1.5) && !weld(mesh, m, parent))
        return false;
    for (uint32_t i = 0; i < m->index_count; i++)
        start[index[i]] = 0;
    for (uint32_t i = 0; i < m->index_count; i += 3)
        start[find_root(parent, index[i])]++;
    uint32_t sum = 0;
    for (uint32_t i = 0; i < m->index_count; i += 3) { /* in the order in which components come first */
        uint32_t root = find_root(parent, index[i]), count = start[root];
        if (count & 0x80000000u)
            continue;
        start[root] = sum | 0x80000000u;
        sum += count;
    }
    for (uint32_t i = 0; i < m->index_count; i += 3) {
        uint32_t root = find_root(parent, index[i]);
        sorted[start[root]++ & 0x7fffffffu] = m->first_index + i;
    }
    for (uint32_t i = 0, count; i < sum; i += count) {
        uint32_t root = find_root(parent, mesh->indices[sorted[i]]);
        count = (start[root] & 0x7fffffffu) - i;
        if (!add_component(mesh, cut, sorted + i, count, material))
            return false;
    }
    return true;
}

/* WOOD_LENGTH, or a multiple where that would make too many triangles (a mesh may be 1e4 heights wide). */
static double choose_length(const struct sv_tree_mesh *mesh)
{
    double length = WOOD_LENGTH, allowed = 1e6 + 2.0 * mesh->index_count / 3, made;
    do {
        made = 0;
        for (int m = 0; m < mesh->material_count; m++) {
            const struct sv_tree_material *material = &mesh->materials[m];
            for (uint32_t i = 0; !material->is_leaf && i < material->index_count; i += 3) {
                struct sv_cloud_triangle t = {.index = material->first_index + i};
                double p[3][3], longest2 = 0;
                t.at[1][0] = t.at[2][1] = SV_CLOUD_WEIGHT_ONE;
                corners(mesh, &t, p);
                for (int k = 0; k < 3; k++) {
                    double d[3];
                    for (int c = 0; c < 3; c++)
                        d[c] = p[(k + 1) % 3][c] - p[k][c];
                    longest2 = fmax(longest2, dot(d, d));
                }
                made += fmax(1, 4 * longest2 / (length * length));
            }
        }
        length *= made > allowed ? 2 : 1;
    } while (made > allowed);
    return length;
}

enum sv_status sv_cloud_cut(const struct sv_tree_mesh *mesh, struct cloud_cut *cut, struct sv_error *error)
{
    size_t vertices = (size_t)mesh->vertex_count + 1;
    uint32_t *parent = malloc(vertices * sizeof *parent), *start = malloc(vertices * sizeof *start);
    uint32_t *sorted = malloc(((size_t)mesh->index_count / 3 + 1) * sizeof *sorted);
    bool memory = parent && start && sorted;
    *cut = (struct cloud_cut){.wood_length = choose_length(mesh)};
    for (int m = 0; memory && m < mesh->material_count; m++)
        memory = cut_material(mesh, m, parent, start, sorted, cut);
    free(parent);
    free(start);
    free(sorted);
    if (memory)
        return SV_OK;
    sv_cloud_cut_finish(cut);
    return sv_fail(error, SV_ENOMEM, "cloud", "no memory to cut a mesh of %u triangles",
                   mesh->index_count / 3);
}

void sv_cloud_cut_finish(struct cloud_cut *cut)
{
    free(cut->parts);
    free(cut->triangles);
    *cut = (struct cloud_cut){0};
}
