/* mesh.c - life, checks, copies and bytes of a tree mesh.
 *
 * The saved block: header, material records, vertices, indices, then each texture's RGBA bytes, every part a
 * multiple of four bytes, in this machine's byte order (a mark in the header refuses the other one: a cache
 * is rebuilt, not swapped). Loading trusts nothing: counts first, then the exact size that they imply, then
 * every value by sv_tree_mesh_check. There is no checksum here; whoever keeps the block on a disk keeps one
 * (core/base/store.h). */
#include "core/tree/mesh.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

static const char MAGIC[8] = {'S', 'V', 'T', 'R', 'E', 'E', '\n', 1};
enum { FORMAT_VERSION = 1, BYTE_ORDER_MARK = 0x01020304 };
enum { FLAG_LEAF = 1, FLAG_MASKED = 2, FLAG_TWO_SIDED = 4, FLAG_ALL = 7 };

/* Bounds of what a value may be, not of what is usual: they keep later arithmetic finite. */
#define COORDINATE_MAX 1e4f /* heights */
#define UV_MAX 1e6f

struct file_header {
    char magic[8];
    uint32_t byte_order, version;
    uint32_t vertex_count, index_count, material_count, leaf_count;
    float radius, crown_base, crown_color[3], model_height;
};

struct file_material {
    char name[64];
    float base_color[4];
    float alpha_cutoff, translucency;
    uint32_t flags, first_index, index_count;
    uint32_t width, height;
};

_Static_assert(sizeof(struct file_header) == 56 && sizeof(struct file_material) == 108 &&
                   sizeof(struct sv_tree_vertex) == 32,
               "the saved block has no padding");

void sv_tree_mesh_finish(struct sv_tree_mesh *mesh)
{
    free(mesh->vertices);
    free(mesh->indices);
    for (int i = 0; i < mesh->material_count; i++)
        sv_image_free(&mesh->materials[i].albedo);
    memset(mesh, 0, sizeof *mesh);
}

/* True when lo <= v <= hi; false for NaN. */
static bool within(float v, float lo, float hi)
{
    return v >= lo && v <= hi;
}

static enum sv_status check_counts(const struct sv_tree_mesh *mesh, struct sv_error *error)
{
    if (mesh->vertex_count < 3 || mesh->vertex_count > SV_TREE_VERTICES_MAX)
        return sv_fail(error, SV_EFORMAT, "mesh.vertex_count", "%u vertices are outside 3 .. %d",
                       mesh->vertex_count, SV_TREE_VERTICES_MAX);
    if (mesh->index_count < 3 || mesh->index_count % 3 || mesh->index_count / 3 > SV_TREE_TRIANGLES_MAX)
        return sv_fail(error, SV_EFORMAT, "mesh.index_count",
                       "%u indices are not three each of 1 .. %d triangles", mesh->index_count,
                       SV_TREE_TRIANGLES_MAX);
    if (mesh->material_count < 1 || mesh->material_count > SV_TREE_MATERIALS_MAX)
        return sv_fail(error, SV_EFORMAT, "mesh.material_count", "%d materials are outside 1 .. %d",
                       mesh->material_count, SV_TREE_MATERIALS_MAX);
    if (mesh->leaf_count > mesh->index_count / 3)
        return sv_fail(error, SV_EFORMAT, "mesh.leaf_count", "%u leaves are more than the %u triangles",
                       mesh->leaf_count, mesh->index_count / 3);
    return SV_OK;
}

static enum sv_status check_albedo(const struct sv_image *albedo, int material, struct sv_error *error)
{
    bool empty = albedo->width == 0 && albedo->height == 0;
    bool sized = albedo->width >= 1 && albedo->height >= 1 && albedo->width <= SV_TREE_TEXTURE_SIDE_MAX &&
                 albedo->height <= SV_TREE_TEXTURE_SIDE_MAX && albedo->channels == 4 &&
                 albedo->type == SV_PIXEL_U8 && albedo->data;
    if (!empty && !sized)
        return sv_fail(error, SV_EFORMAT, "mesh.materials.albedo",
                       "texture of material %d is %d x %d with %d channels, not 8-bit RGBA of 1 .. %d a side",
                       material, albedo->width, albedo->height, albedo->channels, SV_TREE_TEXTURE_SIDE_MAX);
    return SV_OK;
}

static enum sv_status check_materials(const struct sv_tree_mesh *mesh, struct sv_error *error)
{
    uint32_t next = 0;
    for (int i = 0; i < mesh->material_count; i++) {
        const struct sv_tree_material *m = &mesh->materials[i];
        if (!memchr(m->name, 0, sizeof m->name))
            return sv_fail(error, SV_EFORMAT, "mesh.materials.name", "name of material %d has no end", i);
        if (m->first_index != next || m->index_count % 3 || m->index_count > mesh->index_count - next)
            return sv_fail(error, SV_EFORMAT, "mesh.materials.first_index",
                           "material %d claims indices %u + %u where %u of %u are next", i, m->first_index,
                           m->index_count, next, mesh->index_count);
        next += m->index_count;
        for (int c = 0; c < 4; c++)
            if (!within(m->base_color[c], 0, 1000))
                return sv_fail(error, SV_EFORMAT, "mesh.materials.base_color",
                               "channel %d of material %d is %g, outside 0 .. 1000", c, i,
                               (double)m->base_color[c]);
        if (!within(m->alpha_cutoff, 0, 1) || !within(m->translucency, 0, 1))
            return sv_fail(error, SV_EFORMAT, "mesh.materials.alpha_cutoff",
                           "alpha_cutoff %g or translucency %g of material %d is outside 0 .. 1",
                           (double)m->alpha_cutoff, (double)m->translucency, i);
        enum sv_status status = check_albedo(&m->albedo, i, error);
        if (status != SV_OK)
            return status;
    }
    if (next != mesh->index_count)
        return sv_fail(error, SV_EFORMAT, "mesh.materials", "materials claim %u of %u indices", next,
                       mesh->index_count);
    return SV_OK;
}

static enum sv_status check_vertices(const struct sv_tree_mesh *mesh, struct sv_error *error)
{
    for (uint32_t i = 0; i < mesh->vertex_count; i++) {
        const struct sv_tree_vertex *v = &mesh->vertices[i];
        const float *p = v->position;
        if (!within(p[0], -COORDINATE_MAX, COORDINATE_MAX) ||
            !within(p[1], -COORDINATE_MAX, COORDINATE_MAX) || !within(p[2], -COORDINATE_MAX, COORDINATE_MAX))
            return sv_fail(error, SV_EFORMAT, "mesh.vertices.position",
                           "vertex %u is at (%g, %g, %g), outside -%g .. %g heights", i, (double)p[0],
                           (double)p[1], (double)p[2], (double)COORDINATE_MAX, (double)COORDINATE_MAX);
        float nx = v->normal[0], ny = v->normal[1], nz = v->normal[2];
        float length = sqrtf(nx * nx + ny * ny + nz * nz) / 32767.0f;
        if (!within(length, 0.98f, 1.02f))
            return sv_fail(error, SV_EFORMAT, "mesh.vertices.normal",
                           "normal of vertex %u has length %g, not 1", i, (double)length);
        if (!within(v->uv[0], -UV_MAX, UV_MAX) || !within(v->uv[1], -UV_MAX, UV_MAX))
            return sv_fail(error, SV_EFORMAT, "mesh.vertices.uv",
                           "vertex %u has uv (%g, %g), outside -%g .. %g", i, (double)v->uv[0],
                           (double)v->uv[1], (double)UV_MAX, (double)UV_MAX);
        if (v->open[3] < 0)
            return sv_fail(error, SV_EFORMAT, "mesh.vertices.open",
                           "mean openness of vertex %u is %d, outside 0 .. 127", i, v->open[3]);
    }
    for (uint32_t i = 0; i < mesh->index_count; i++)
        if (mesh->indices[i] >= mesh->vertex_count)
            return sv_fail(error, SV_EFORMAT, "mesh.indices", "index %u is %u, of %u vertices", i,
                           mesh->indices[i], mesh->vertex_count);
    return SV_OK;
}

static enum sv_status check_measures(const struct sv_tree_mesh *mesh, struct sv_error *error)
{
    if (!within(mesh->radius, 0, 2 * COORDINATE_MAX) ||
        !within(mesh->crown_base, -COORDINATE_MAX, COORDINATE_MAX) ||
        !within(mesh->model_height, 0, INFINITY) || isinf(mesh->model_height))
        return sv_fail(error, SV_EFORMAT, "mesh.radius",
                       "radius %g, crown_base %g or model_height %g is out of range", (double)mesh->radius,
                       (double)mesh->crown_base, (double)mesh->model_height);
    for (int c = 0; c < 3; c++)
        if (!within(mesh->crown_color[c], 0, 1000))
            return sv_fail(error, SV_EFORMAT, "mesh.crown_color", "channel %d is %g, outside 0 .. 1000", c,
                           (double)mesh->crown_color[c]);
    return SV_OK;
}

enum sv_status sv_tree_mesh_check(const struct sv_tree_mesh *mesh, struct sv_error *error)
{
    enum sv_status status = check_counts(mesh, error);
    if (status == SV_OK)
        status = check_materials(mesh, error);
    if (status == SV_OK)
        status = check_vertices(mesh, error);
    if (status == SV_OK)
        status = check_measures(mesh, error);
    return status;
}

enum sv_status sv_tree_mesh_to_arena(const struct sv_tree_mesh *mesh, struct sv_arena *arena,
                                     struct sv_tree_mesh *out, struct sv_error *error)
{
    struct sv_tree_mesh copy = *mesh;
    copy.vertices = sv_arena_copy(arena, mesh->vertices, (size_t)mesh->vertex_count * sizeof *mesh->vertices);
    copy.indices = sv_arena_copy(arena, mesh->indices, (size_t)mesh->index_count * sizeof *mesh->indices);
    bool ok = copy.vertices && copy.indices;
    for (int i = 0; ok && i < mesh->material_count; i++) {
        const struct sv_image *from = &mesh->materials[i].albedo;
        if (from->data)
            ok = (copy.materials[i].albedo.data = sv_arena_copy(arena, from->data, sv_image_bytes(from))) !=
                 NULL;
    }
    if (!ok)
        return sv_fail(error, SV_ENOMEM, NULL,
                       "the arena has no room for a tree mesh of %u vertices and %u triangles",
                       mesh->vertex_count, mesh->index_count / 3);
    *out = copy;
    return SV_OK;
}

static size_t texture_bytes(const struct sv_tree_material *m)
{
    return (size_t)m->albedo.width * (size_t)m->albedo.height * 4;
}

static struct file_material pack_material(const struct sv_tree_material *m)
{
    struct file_material f = {.alpha_cutoff = m->alpha_cutoff,
                              .translucency = m->translucency,
                              .flags = (m->is_leaf ? FLAG_LEAF : 0u) | (m->masked ? FLAG_MASKED : 0u) |
                                       (m->two_sided ? FLAG_TWO_SIDED : 0u),
                              .first_index = m->first_index,
                              .index_count = m->index_count,
                              .width = (uint32_t)m->albedo.width,
                              .height = (uint32_t)m->albedo.height};
    strncpy(f.name, m->name, sizeof f.name - 1);
    memcpy(f.base_color, m->base_color, sizeof f.base_color);
    return f;
}

/* Appends and returns the place after. */
static unsigned char *put(unsigned char *at, const void *data, size_t bytes)
{
    if (bytes)
        memcpy(at, data, bytes);
    return at + bytes;
}

enum sv_status sv_tree_mesh_save(const struct sv_tree_mesh *mesh, void **data, size_t *bytes,
                                 struct sv_error *error)
{
    enum sv_status status = sv_tree_mesh_check(mesh, error);
    if (status != SV_OK)
        return status;
    size_t vertex_bytes = (size_t)mesh->vertex_count * sizeof *mesh->vertices;
    size_t index_bytes = (size_t)mesh->index_count * sizeof *mesh->indices;
    size_t size = sizeof(struct file_header) + (size_t)mesh->material_count * sizeof(struct file_material) +
                  vertex_bytes + index_bytes;
    for (int i = 0; i < mesh->material_count; i++)
        size += texture_bytes(&mesh->materials[i]);
    unsigned char *block = malloc(size);
    if (!block)
        return sv_fail(error, SV_ENOMEM, NULL, "no memory for a saved tree mesh of %zu bytes", size);

    struct file_header h = {.byte_order = BYTE_ORDER_MARK,
                            .version = FORMAT_VERSION,
                            .vertex_count = mesh->vertex_count,
                            .index_count = mesh->index_count,
                            .material_count = (uint32_t)mesh->material_count,
                            .leaf_count = mesh->leaf_count,
                            .radius = mesh->radius,
                            .crown_base = mesh->crown_base,
                            .model_height = mesh->model_height};
    memcpy(h.magic, MAGIC, sizeof h.magic);
    memcpy(h.crown_color, mesh->crown_color, sizeof h.crown_color);
    unsigned char *at = put(block, &h, sizeof h);
    for (int i = 0; i < mesh->material_count; i++) {
        struct file_material m = pack_material(&mesh->materials[i]);
        at = put(at, &m, sizeof m);
    }
    at = put(at, mesh->vertices, vertex_bytes);
    at = put(at, mesh->indices, index_bytes);
    for (int i = 0; i < mesh->material_count; i++)
        at = put(at, mesh->materials[i].albedo.data, texture_bytes(&mesh->materials[i]));
    *data = block;
    *bytes = size;
    return SV_OK;
}

static enum sv_status read_header(const unsigned char *data, size_t bytes, struct sv_tree_mesh *mesh,
                                  struct sv_error *error)
{
    struct file_header h;
    if (!data || bytes < sizeof h)
        return sv_fail(error, SV_EFORMAT, "mesh", "%zu bytes are too few for a saved tree mesh", bytes);
    memcpy(&h, data, sizeof h);
    if (memcmp(h.magic, MAGIC, sizeof h.magic) != 0)
        return sv_fail(error, SV_EFORMAT, "mesh", "the bytes are not a saved tree mesh");
    if (h.byte_order != BYTE_ORDER_MARK || h.version != FORMAT_VERSION)
        return sv_fail(
            error, SV_EFORMAT, "mesh.version",
            "saved tree mesh of version %u and byte order %08x; this program reads version %d, %08x",
            h.version, h.byte_order, FORMAT_VERSION, BYTE_ORDER_MARK);
    if (h.material_count > SV_TREE_MATERIALS_MAX)
        return sv_fail(error, SV_EFORMAT, "mesh.material_count", "%u materials are outside 1 .. %d",
                       h.material_count, SV_TREE_MATERIALS_MAX);
    mesh->vertex_count = h.vertex_count;
    mesh->index_count = h.index_count;
    mesh->material_count = (int)h.material_count;
    mesh->leaf_count = h.leaf_count;
    mesh->radius = h.radius;
    mesh->crown_base = h.crown_base;
    mesh->model_height = h.model_height;
    memcpy(mesh->crown_color, h.crown_color, sizeof h.crown_color);
    return check_counts(mesh, error);
}

/* Material records, which follow the header; textures get their sizes only. *texture_total is their bytes. */
static enum sv_status read_materials(const unsigned char *data, size_t bytes, struct sv_tree_mesh *mesh,
                                     size_t *texture_total, struct sv_error *error)
{
    if ((bytes - sizeof(struct file_header)) / sizeof(struct file_material) < (size_t)mesh->material_count)
        return sv_fail(error, SV_EFORMAT, "mesh.materials", "the saved tree mesh ends within its materials");
    size_t total = 0;
    for (int i = 0; i < mesh->material_count; i++) {
        struct file_material f;
        memcpy(&f, data + sizeof(struct file_header) + (size_t)i * sizeof f, sizeof f);
        struct sv_tree_material *m = &mesh->materials[i];
        if (f.flags & ~(uint32_t)FLAG_ALL)
            return sv_fail(error, SV_EFORMAT, "mesh.materials.flags", "flags %x of material %d are unknown",
                           f.flags, i);
        if (f.width > SV_TREE_TEXTURE_SIDE_MAX || f.height > SV_TREE_TEXTURE_SIDE_MAX ||
            !f.width != !f.height)
            return sv_fail(error, SV_EFORMAT, "mesh.materials.albedo",
                           "texture of material %d is %u x %u, not 1 .. %d a side", i, f.width, f.height,
                           SV_TREE_TEXTURE_SIDE_MAX);
        memcpy(m->name, f.name, sizeof m->name);
        memcpy(m->base_color, f.base_color, sizeof m->base_color);
        m->is_leaf = f.flags & FLAG_LEAF;
        m->masked = f.flags & FLAG_MASKED;
        m->two_sided = f.flags & FLAG_TWO_SIDED;
        m->alpha_cutoff = f.alpha_cutoff;
        m->translucency = f.translucency;
        m->first_index = f.first_index;
        m->index_count = f.index_count;
        if (f.width)
            m->albedo = (struct sv_image){(int)f.width, (int)f.height, 4, SV_PIXEL_U8, NULL};
        total += texture_bytes(m);
    }
    *texture_total = total;
    return SV_OK;
}

/* Takes n bytes at *at into a heap copy, NULL without memory. */
static void *take(const unsigned char **at, size_t n)
{
    void *copy = malloc(n ? n : 1);
    if (copy)
        memcpy(copy, *at, n);
    *at += n;
    return copy;
}

enum sv_status sv_tree_mesh_load(const void *data, size_t bytes, struct sv_tree_mesh *mesh,
                                 struct sv_error *error)
{
    struct sv_tree_mesh m = {0};
    size_t texture_total = 0;
    enum sv_status status = read_header(data, bytes, &m, error);
    if (status == SV_OK)
        status = read_materials(data, bytes, &m, &texture_total, error);
    if (status != SV_OK)
        return status; /* nothing is owned yet */
    size_t vertex_bytes = (size_t)m.vertex_count * sizeof *m.vertices;
    size_t index_bytes = (size_t)m.index_count * sizeof *m.indices;
    size_t head = sizeof(struct file_header) + (size_t)m.material_count * sizeof(struct file_material);
    if (bytes != head + vertex_bytes + index_bytes + texture_total)
        return sv_fail(error, SV_EFORMAT, "mesh",
                       "the saved tree mesh has %zu bytes where its counts ask for %zu", bytes,
                       head + vertex_bytes + index_bytes + texture_total);

    const unsigned char *at = (const unsigned char *)data + head;
    m.vertices = take(&at, vertex_bytes);
    m.indices = take(&at, index_bytes);
    bool memory = m.vertices && m.indices;
    for (int i = 0; i < m.material_count; i++)
        if (m.materials[i].albedo.width)
            memory &= (m.materials[i].albedo.data = take(&at, texture_bytes(&m.materials[i]))) != NULL;
    if (!memory)
        status = sv_fail(error, SV_ENOMEM, NULL, "no memory for a tree mesh of %zu bytes", bytes);
    else
        status = sv_tree_mesh_check(&m, error);
    if (status != SV_OK)
        sv_tree_mesh_finish(&m);
    else
        *mesh = m;
    return status;
}
