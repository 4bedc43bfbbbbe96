/* import_shape.c - an imported model brought into tree space: Z up, base at 0, height 1, trunk on the axis;
 * normals; each vertex once. Objects have no trunk: see import.h for where they stand.
 *
 * Where the trunk stands: the mean place, weighted by area, of the wood within 3 % of the height above the
 * wood's lowest point, if that wood keeps within 20 % of the height of its mean; that is a trunk's foot,
 * whatever the model's origin. A model without one (a hedge, a house) keeps its own origin, unless that lies
 * outside of its ground plan: then the plan's middle is taken, and said.
 *
 * Normals that the file lacks: of the faces around a place, weighted by their angle there (Thuermer and
 * Wuethrich 1998), those within 60 degrees of the face in hand; on wood a place is a position, on leaves a
 * shared vertex, so that cards that touch stay flat. Wood's winding is turned to agree with given normals, or
 * outward where a closed part encloses a negative volume. */
#include "core/tree/import_parts.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "core/base/hash.h"

#define TRUNK_SLAB 0.03   /* of the height */
#define TRUNK_SPREAD 0.20 /* of the height */
#define CREASE_COSINE 0.5
#define OPEN_SHARE 0.3    /* of the edges have one face only: a sheet, seen from both sides */
#define FLATTEST 1e-3     /* least height over width */
#define ANCHOR_SLACK 1e-3 /* of the plan's width: an origin this little outside of an object counts as in */
#define ANCHOR_FAR 0.35   /* of the plan's width from its middle: worth a word */
#define TRANSLUCENCY 0.3f /* of a leaf whose material is unknown: between the grown habits' 0.12 and 0.35 */
enum { FAN_MAX = 256, SLAB_SAMPLES = 64 };

struct frame {
    double base, height, axis[2]; /* of the tree in the file's units, Z up */
};

/* Work on one material's triangles. */
struct piece {
    const struct raw_triangle **triangles;
    uint32_t count;
    bool is_leaf;
};

/* One corner, where normals are made and vertices merged. */
struct corner {
    uint32_t place, at; /* at = 3 * triangle + corner */
};

static int compare_corners(const void *a, const void *b)
{
    const struct corner *p = a, *q = b;
    if (p->place != q->place)
        return p->place < q->place ? -1 : 1;
    return p->at < q->at ? -1 : p->at > q->at;
}

static void *allocate(size_t count, size_t size)
{
    return calloc(count ? count : 1, size);
}

/* Y up, -Z north -> Z up, Y north (frames.h). */
static void stand_up(struct raw_model *raw)
{
    for (uint32_t i = 0; i < raw->vertex_count; i++) {
        struct raw_vertex *v = &raw->vertices[i];
        double y = v->p[1];
        v->p[1] = -v->p[2], v->p[2] = y;
        float n = v->n[1];
        v->n[1] = -v->n[2], v->n[2] = n;
    }
}

static void grow_bounds(const double p[3], double lo[3], double hi[3])
{
    for (int a = 0; a < 3; a++) {
        lo[a] = fmin(lo[a], p[a]);
        hi[a] = fmax(hi[a], p[a]);
    }
}

/* Where the trunk's foot is, by the wood in the slab [low, low + depth]; false without such wood or where it
 * spreads too far. */
static bool find_trunk(const struct raw_model *raw, double low, double depth, double spread_max,
                       double axis[2])
{
    double weight = 0, sum[2] = {0, 0}, square = 0;
    double origin[2] = {
        NAN, NAN}; /* sums are taken from here: squares of UTM coordinates would drown the spread */
    for (uint32_t i = 0; i < raw->triangle_count; i++) {
        const struct raw_triangle *t = &raw->triangles[i];
        const double *p = raw->vertices[t->v[0]].p, *q = raw->vertices[t->v[1]].p,
                     *r = raw->vertices[t->v[2]].p;
        if (raw->materials[t->material].is_leaf || fmin(p[2], fmin(q[2], r[2])) > low + depth)
            continue;
        if (isnan(origin[0]))
            origin[0] = p[0], origin[1] = p[1];
        struct sv_vec3 a = sv_vec3(q[0] - p[0], q[1] - p[1], q[2] - p[2]),
                       b = sv_vec3(r[0] - p[0], r[1] - p[1], r[2] - p[2]);
        double area = sv_length(sv_cross(a, b)) / SLAB_SAMPLES;
        for (int k = 0; k < SLAB_SAMPLES; k++) {
            double u = fmod(0.5 + 0.7548776662466927 * (k + 1.0), 1),
                   v = fmod(0.5 + 0.5698402909980532 * (k + 1.0), 1);
            if (u + v > 1)
                u = 1 - u, v = 1 - v;
            if (p[2] + a.z * u + b.z * v > low + depth)
                continue;
            double x = p[0] - origin[0] + a.x * u + b.x * v, y = p[1] - origin[1] + a.y * u + b.y * v;
            weight += area, sum[0] += area * x, sum[1] += area * y, square += area * (x * x + y * y);
        }
    }
    if (weight <= 0)
        return false;
    double x = sum[0] / weight, y = sum[1] / weight;
    if (square / weight - x * x - y * y > spread_max * spread_max)
        return false;
    axis[0] = origin[0] + x, axis[1] = origin[1] + y;
    return true;
}

/* An object stands by its own origin where that lies in its ground plan, else by the plan's middle. */
static void anchor_object(const double lo[3], const double hi[3], const char *path, double axis[2],
                          struct sv_errors *notes)
{
    double middle[2] = {0.5 * (lo[0] + hi[0]), 0.5 * (lo[1] + hi[1])};
    double size[2] = {hi[0] - lo[0], hi[1] - lo[1]};
    bool inside = true, far = false;
    for (int a = 0; a < 2; a++) {
        /* rounding of a file's decimals may put a corner that is the origin a hair outside */
        inside = inside && fabs(middle[a]) <= (0.5 + ANCHOR_SLACK) * size[a];
        far = far || fabs(middle[a]) > ANCHOR_FAR * size[a];
    }
    axis[0] = inside ? 0 : middle[0], axis[1] = inside ? 0 : middle[1];
    if (notes && !inside)
        sv_errors_add(notes, SV_EINVAL, path,
                      "the origin lies outside of its ground plan: the plan's middle stands at the place");
    else if (notes && far)
        sv_errors_add(notes, SV_EINVAL, path,
                      "its own origin, which stands at the place, is far from the middle of its ground plan: "
                      "that is %.2f heights to the east and %.2f to the north of it",
                      middle[0] / (hi[2] - lo[2]), middle[1] / (hi[2] - lo[2]));
}

static enum sv_status find_frame(const struct raw_model *raw, const char *path, struct frame *frame,
                                 struct sv_errors *notes, struct sv_error *error)
{
    double lo[3] = {INFINITY, INFINITY, INFINITY}, hi[3] = {-INFINITY, -INFINITY, -INFINITY}, wood = INFINITY;
    for (uint32_t i = 0; i < raw->triangle_count; i++)
        for (int k = 0; k < 3; k++) {
            const double *p = raw->vertices[raw->triangles[i].v[k]].p;
            grow_bounds(p, lo, hi);
            if (!raw->materials[raw->triangles[i].material].is_leaf)
                wood = fmin(wood, p[2]);
        }
    if (raw->triangle_count == 0)
        return sv_fail(error, SV_EFORMAT, path, "holds no triangle that has an area");
    double width = fmax(hi[0] - lo[0], hi[1] - lo[1]);
    frame->base = lo[2], frame->height = hi[2] - lo[2];
    if (!(frame->height > FLATTEST * width) || !isfinite(width) || !isfinite(frame->height))
        return sv_fail(error, SV_EFORMAT, path, "is %g high and %g wide: no %s stands in it (Y is up)",
                       frame->height, width, raw->is_object ? "object" : "tree");
    if (raw->is_object) {
        anchor_object(lo, hi, path, frame->axis, notes);
        return SV_OK;
    }
    if (isfinite(wood) &&
        find_trunk(raw, wood, TRUNK_SLAB * frame->height, TRUNK_SPREAD * frame->height, frame->axis))
        return SV_OK;
    frame->axis[0] = frame->axis[1] = 0;
    if (lo[0] <= 0 && hi[0] >= 0 && lo[1] <= 0 && hi[1] >= 0)
        return SV_OK;
    frame->axis[0] = 0.5 * (lo[0] + hi[0]), frame->axis[1] = 0.5 * (lo[1] + hi[1]);
    if (notes)
        sv_errors_add(notes, SV_EINVAL, path,
                      "no trunk found and the origin lies outside: the middle of its ground plan "
                      "is put there");
    return SV_OK;
}

/* Numbers vertices by position: equal places get equal numbers. */
static enum sv_status weld(const struct raw_model *raw, uint32_t *place, struct sv_error *error)
{
    size_t size = 16;
    while (size < 2 * (size_t)raw->vertex_count)
        size *= 2;
    uint32_t *table = allocate(size, sizeof *table); /* vertex + 1 */
    if (!table)
        return sv_fail(error, SV_ENOMEM, NULL, "no memory for %u vertices", raw->vertex_count);
    for (uint32_t i = 0; i < raw->vertex_count; i++) {
        const double *p = raw->vertices[i].p;
        uint64_t h = SV_HASH_INIT;
        for (int a = 0; a < 3; a++)
            h = sv_hash_double(h, p[a]);
        size_t slot = (size_t)sv_hash_done(h) & (size - 1);
        while (table[slot] != 0) {
            const double *q = raw->vertices[table[slot] - 1].p;
            if (p[0] == q[0] && p[1] == q[1] && p[2] == q[2])
                break;
            slot = (slot + 1) & (size - 1);
        }
        if (table[slot] == 0)
            table[slot] = i + 1;
        place[i] = table[slot] - 1;
    }
    free(table);
    return SV_OK;
}

static struct sv_vec3 position(const struct raw_model *raw, uint32_t v)
{
    const double *p = raw->vertices[v].p;
    return sv_vec3(p[0], p[1], p[2]);
}

static struct sv_vec3 face_normal(const struct raw_model *raw, const struct raw_triangle *t)
{
    struct sv_vec3 p = position(raw, t->v[0]);
    return sv_normalize(sv_cross(sv_sub(position(raw, t->v[1]), p), sv_sub(position(raw, t->v[2]), p)));
}

static double corner_angle(const struct raw_model *raw, const struct raw_triangle *t, int k)
{
    struct sv_vec3 p = position(raw, t->v[k]);
    struct sv_vec3 a = sv_normalize(sv_sub(position(raw, t->v[(k + 1) % 3]), p));
    struct sv_vec3 b = sv_normalize(sv_sub(position(raw, t->v[(k + 2) % 3]), p));
    return acos(sv_clamp(sv_dot(a, b), -1, 1));
}

static bool has_normal(const struct raw_vertex *v)
{
    float n2 = v->n[0] * v->n[0] + v->n[1] * v->n[1] + v->n[2] * v->n[2];
    return n2 > 1e-12f && n2 < 1e12f;
}

static struct sv_vec3 given_normal(const struct raw_vertex *v)
{
    return sv_normalize(sv_vec3((double)v->n[0], (double)v->n[1], (double)v->n[2]));
}

struct edge {
    uint32_t a, b;
};

static int compare_edges(const void *x, const void *y)
{
    const struct edge *p = x, *q = y;
    if (p->a != q->a)
        return p->a < q->a ? -1 : 1;
    return p->b < q->b ? -1 : p->b > q->b;
}

enum sv_status raw_open_share(const struct raw_model *raw, int material, const uint32_t *place, double *share,
                              struct sv_error *error)
{
    size_t count = 0, n = 0;
    for (uint32_t i = 0; i < raw->triangle_count; i++)
        count += raw->triangles[i].material == material ? 3 : 0;
    struct edge *edges = allocate(count, sizeof *edges);
    if (!edges)
        return sv_fail(error, SV_ENOMEM, NULL, "no memory for %zu edges", count);
    for (size_t i = 0; i < 3 * (size_t)raw->triangle_count; i++) {
        const struct raw_triangle *t = &raw->triangles[i / 3];
        if (t->material != material)
            continue;
        uint32_t a = t->v[i % 3], b = t->v[(i + 1) % 3];
        a = place ? place[a] : a, b = place ? place[b] : b;
        edges[n++] = a < b ? (struct edge){a, b} : (struct edge){b, a};
    }
    qsort(edges, count, sizeof *edges, compare_edges);
    size_t all = 0, open = 0;
    for (size_t i = 0; i < count;) {
        size_t end = i + 1;
        while (end < count && compare_edges(&edges[i], &edges[end]) == 0)
            end++;
        all++;
        open += end - i == 1;
        i = end;
    }
    free(edges);
    *share = all ? (double)open / (double)all : 1;
    return SV_OK;
}

static void turn(struct raw_triangle *t)
{
    uint32_t v = t->v[1];
    t->v[1] = t->v[2];
    t->v[2] = v;
}

/* Makes wood's winding say where outside is. */
static void turn_outward(struct raw_model *raw, int material, double open)
{
    double volume = 0;
    struct sv_vec3 origin = {NAN, 0, 0};
    bool given = false;
    for (uint32_t i = 0; i < raw->triangle_count; i++) {
        struct raw_triangle *t = &raw->triangles[i];
        if (t->material != material)
            continue;
        struct sv_vec3 sum = {0, 0, 0};
        for (int k = 0; k < 3; k++)
            if (has_normal(&raw->vertices[t->v[k]]))
                sum = sv_add(sum, given_normal(&raw->vertices[t->v[k]])), given = true;
        if (sv_dot(sum, face_normal(raw, t)) < 0)
            turn(t);
        if (isnan(origin.x))
            origin = position(raw, t->v[0]);
        volume +=
            sv_dot(sv_sub(position(raw, t->v[0]), origin),
                   sv_cross(sv_sub(position(raw, t->v[1]), origin), sv_sub(position(raw, t->v[2]), origin)));
    }
    for (uint32_t i = 0; i < raw->triangle_count && !given && open < OPEN_SHARE && volume < 0; i++)
        if (raw->triangles[i].material == material)
            turn(&raw->triangles[i]);
}

/* Normals of the corners [first, end) that share a place. */
static void blend_place(const struct raw_model *raw, const struct piece *piece, const struct corner *corners,
                        uint32_t first, uint32_t end, struct sv_vec3 *normals)
{
    bool crease = end - first <= FAN_MAX;
    struct sv_vec3 all = {0, 0, 0};
    for (uint32_t i = first; i < end && !crease; i++) {
        const struct raw_triangle *t = piece->triangles[corners[i].at / 3];
        all = sv_madd(all, face_normal(raw, t), corner_angle(raw, t, (int)(corners[i].at % 3)));
    }
    for (uint32_t i = first; i < end; i++) {
        const struct raw_triangle *t = piece->triangles[corners[i].at / 3];
        const struct raw_vertex *v = &raw->vertices[t->v[corners[i].at % 3]];
        struct sv_vec3 own = face_normal(raw, t), sum = all;
        for (uint32_t j = first; j < end && crease && !has_normal(v); j++) {
            const struct raw_triangle *u = piece->triangles[corners[j].at / 3];
            struct sv_vec3 n = face_normal(raw, u);
            if (sv_dot(n, own) >= CREASE_COSINE)
                sum = sv_madd(sum, n, corner_angle(raw, u, (int)(corners[j].at % 3)));
        }
        sum = has_normal(v) ? given_normal(v) : sv_normalize(sum);
        normals[corners[i].at] = sv_length(sum) > 0.5 ? sum : own;
    }
}

static enum sv_status make_normals(const struct raw_model *raw, const struct piece *piece,
                                   const uint32_t *place, struct sv_vec3 *normals, struct sv_error *error)
{
    uint32_t count = 3 * piece->count;
    struct corner *corners = allocate(count, sizeof *corners);
    if (!corners)
        return sv_fail(error, SV_ENOMEM, NULL, "no memory for %u corners", count);
    for (uint32_t i = 0; i < count; i++) {
        uint32_t v = piece->triangles[i / 3]->v[i % 3];
        corners[i] = (struct corner){piece->is_leaf ? v : place[v], i};
    }
    qsort(corners, count, sizeof *corners, compare_corners);
    for (uint32_t i = 0; i < count;) {
        uint32_t end = i + 1;
        while (end < count && corners[end].place == corners[i].place)
            end++;
        blend_place(raw, piece, corners, i, end, normals);
        i = end;
    }
    free(corners);
    return SV_OK;
}

static struct sv_tree_vertex make_vertex(const struct raw_vertex *v, struct sv_vec3 n,
                                         const struct frame *frame)
{
    struct sv_tree_vertex out = {
        .position = {(float)((v->p[0] - frame->axis[0]) / frame->height),
                     (float)((v->p[1] - frame->axis[1]) / frame->height),
                     (float)((v->p[2] - frame->base) / frame->height)},
        .normal = {(int16_t)lrint(n.x * 32767), (int16_t)lrint(n.y * 32767), (int16_t)lrint(n.z * 32767)},
        .occlusion = UINT16_MAX,
        .open = {0, 0, 0, 127},
        .uv = {v->uv[0], v->uv[1]},
    };
    for (int a = 0; a < 3; a++)
        out.position[a] += 0.0f; /* -0 is 0: equal vertices have equal bytes */
    out.uv[0] += 0.0f, out.uv[1] += 0.0f;
    return out;
}

/* Appends a piece's corners to the mesh, equal ones once. table has `size` slots, a power of two, and is
 * cleared here. */
static void append_piece(const struct raw_model *raw, const struct piece *piece,
                         const struct sv_vec3 *normals, const struct frame *frame, struct sv_tree_mesh *mesh,
                         uint32_t *table, size_t size)
{
    memset(table, 0, size * sizeof *table);
    for (uint32_t i = 0; i < 3 * piece->count; i++) {
        struct sv_tree_vertex v =
            make_vertex(&raw->vertices[piece->triangles[i / 3]->v[i % 3]], normals[i], frame);
        size_t slot = (size_t)sv_hash_done(sv_hash_bytes(SV_HASH_INIT, &v, sizeof v)) & (size - 1);
        while (table[slot] != 0 && memcmp(&mesh->vertices[table[slot] - 1], &v, sizeof v) != 0)
            slot = (slot + 1) & (size - 1);
        if (table[slot] == 0) {
            mesh->vertices[mesh->vertex_count++] = v;
            table[slot] = mesh->vertex_count;
        }
        mesh->indices[mesh->index_count++] = table[slot] - 1;
    }
}

static size_t table_size(uint32_t corners)
{
    size_t size = 16;
    while (size < 2 * (size_t)corners)
        size *= 2;
    return size;
}

/* The mesh's material; takes the texture, or a copy when another material has it already. */
static enum sv_status make_material(struct raw_model *raw, int k, struct sv_tree_material *m,
                                    struct sv_error *error)
{
    const struct raw_material *from = &raw->materials[k];
    memcpy(m->name, from->name, sizeof m->name);
    memcpy(m->base_color, from->color, sizeof m->base_color);
    m->is_leaf = from->is_leaf;
    m->masked = from->masked;
    m->two_sided = from->two_sided || from->is_leaf || from->masked;
    m->alpha_cutoff = from->cutoff;
    m->translucency = from->is_leaf ? TRANSLUCENCY : 0;
    if (from->texture == RAW_NO_TEXTURE)
        return SV_OK;
    struct sv_image *image = &raw->textures[from->texture].image;
    enum sv_status status = sv_image_alloc(image->width, image->height, 4, SV_PIXEL_U8, &m->albedo, error);
    if (status != SV_OK)
        return status;
    memcpy(m->albedo.data, image->data, sv_image_bytes(image));
    if (m->masked)
        raw_texture_bleed(&m->albedo);
    return SV_OK;
}

static enum sv_status shape_material(struct raw_model *raw, int k, const uint32_t *place,
                                     const struct frame *frame, struct sv_tree_mesh *mesh,
                                     struct sv_error *error)
{
    struct piece piece = {.is_leaf = raw->materials[k].is_leaf};
    for (uint32_t i = 0; i < raw->triangle_count; i++)
        piece.count += raw->triangles[i].material == k;
    if (piece.count == 0)
        return SV_OK;
    if (mesh->material_count == SV_TREE_MATERIALS_MAX)
        return sv_fail(error, SV_ELIMIT, "mesh.materials", "over %d different materials",
                       SV_TREE_MATERIALS_MAX);
    struct sv_tree_material *m = &mesh->materials[mesh->material_count++];
    size_t size = table_size(3 * piece.count);
    uint32_t *table = allocate(size, sizeof *table);
    struct sv_vec3 *normals = allocate(3 * (size_t)piece.count, sizeof *normals);
    piece.triangles = allocate(piece.count, sizeof *piece.triangles);
    enum sv_status status = SV_OK;
    if (!table || !normals || !piece.triangles)
        status = sv_fail(error, SV_ENOMEM, NULL, "no memory for %u triangles", piece.count);
    for (uint32_t i = 0, n = 0; status == SV_OK && i < raw->triangle_count; i++)
        if (raw->triangles[i].material == k)
            piece.triangles[n++] = &raw->triangles[i];
    if (status == SV_OK)
        status = make_material(raw, k, m, error);
    double open = 1;
    if (status == SV_OK && !piece.is_leaf)
        status = raw_open_share(raw, k, place, &open, error);
    if (status == SV_OK && !piece.is_leaf) {
        turn_outward(raw, k, open);
        bool says = raw->materials[k].alpha != RAW_ALPHA_FROM_TEXTURE; /* glTF does say which sides it has */
        m->two_sided = m->two_sided || (!says && open >= OPEN_SHARE);
    }
    if (status == SV_OK)
        status = make_normals(raw, &piece, place, normals, error);
    if (status == SV_OK) {
        m->first_index = mesh->index_count;
        append_piece(raw, &piece, normals, frame, mesh, table, size);
        m->index_count = mesh->index_count - m->first_index;
    }
    free(table);
    free(normals);
    free(piece.triangles);
    return status;
}

static enum sv_status too_many(const struct sv_tree_mesh *mesh, const char *path, struct sv_error *error)
{
    return mesh->vertex_count > SV_TREE_VERTICES_MAX ? sv_fail(error, SV_ELIMIT, path, "%u vertices, over %d",
                                                               mesh->vertex_count, SV_TREE_VERTICES_MAX)
                                                     : SV_OK;
}

enum sv_status raw_shape(struct raw_model *raw, const char *path, struct sv_tree_mesh *mesh,
                         struct sv_errors *notes, struct sv_error *error)
{
    stand_up(raw);
    struct frame frame = {0};
    enum sv_status status = find_frame(raw, path, &frame, notes, error);
    if (status != SV_OK)
        return status;
    mesh->model_height = (float)frame.height;
    size_t corners = 3 * (size_t)raw->triangle_count;
    uint32_t *place = allocate(raw->vertex_count, sizeof *place);
    mesh->vertices = malloc(corners * sizeof *mesh->vertices);
    mesh->indices = malloc(corners * sizeof *mesh->indices);
    if (!place || !mesh->vertices || !mesh->indices)
        status = sv_fail(error, SV_ENOMEM, path, "no memory for %u triangles", raw->triangle_count);
    if (status == SV_OK)
        status = weld(raw, place, error);
    for (int k = 0; status == SV_OK && k < raw->material_count; k++)
        status = shape_material(raw, k, place, &frame, mesh, error);
    if (status == SV_OK)
        status = too_many(mesh, path, error);
    free(place);
    if (status != SV_OK)
        return status;
    struct sv_tree_vertex *vertices = realloc(mesh->vertices, mesh->vertex_count * sizeof *vertices);
    mesh->vertices = vertices ? vertices : mesh->vertices;
    return SV_OK;
}
