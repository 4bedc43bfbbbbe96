/* cloud_save.c - checks and bytes of a billboard cloud: header, planes, pieces, triangles, in this machine's
 * byte order. Loading trusts nothing: counts first, then the exact size that they imply, then every value. */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "core/tree/cloud.h"

static const char MAGIC[8] = {'S', 'V', 'C', 'L', 'O', 'U', 'D', 1};
enum { BYTE_ORDER_MARK = 0x01020304 };

/* What later arithmetic must stay finite for: mesh.c's bound, and what turning adds to it. */
#define COORDINATE_MAX 4e4f
#define UV_MAX 2e6f

struct file_header {
    char magic[8];
    uint32_t byte_order, plane_count, piece_count, triangle_count;
    float rms, view_rms;
};

_Static_assert(sizeof(struct file_header) == 32 && sizeof(struct sv_cloud_plane) == 64 &&
                   sizeof(struct sv_cloud_piece) == 80 && sizeof(struct sv_cloud_triangle) == 16,
               "the saved block has no padding");

static bool within(float v, float lo, float hi)
{
    return v >= lo && v <= hi;
}

static bool all_within(const float *v, int count, float bound)
{
    bool in = true;
    for (int k = 0; k < count; k++)
        in = in && within(v[k], -bound, bound);
    return in;
}

static float dot3(const float a[3], const float b[3])
{
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

static bool is_unit(const float v[3])
{
    return all_within(v, 3, 2) && fabsf(dot3(v, v) - 1) < 1e-3f;
}

static enum sv_status check_plane(const struct sv_tree_cloud *cloud, int k, uint32_t next,
                                  struct sv_error *error)
{
    const struct sv_cloud_plane *p = &cloud->planes[k];
    if (!is_unit(p->normal) || !is_unit(p->u) || !is_unit(p->v) || fabsf(dot3(p->u, p->v)) > 1e-3f ||
        fabsf(dot3(p->u, p->normal)) > 1e-3f || fabsf(dot3(p->v, p->normal)) > 1e-3f)
        return sv_fail(error, SV_EFORMAT, "cloud.planes", "axes of plane %d are not at right angles", k);
    if (!all_within(p->centre, 3, COORDINATE_MAX) || !within(p->half[0], 1e-6f, COORDINATE_MAX) ||
        !within(p->half[1], 1e-6f, COORDINATE_MAX))
        return sv_fail(error, SV_EFORMAT, "cloud.planes", "rectangle of plane %d is out of range", k);
    if (p->first_piece != next || p->piece_count > cloud->piece_count - next)
        return sv_fail(error, SV_EFORMAT, "cloud.planes.first_piece",
                       "plane %d claims pieces %u + %u where %u of %u are next", k, p->first_piece,
                       p->piece_count, next, cloud->piece_count);
    return SV_OK;
}

static enum sv_status check_piece(const struct sv_tree_cloud *cloud, uint32_t i, int plane,
                                  struct sv_error *error)
{
    const struct sv_cloud_piece *p = &cloud->pieces[i];
    bool turned = p->flags & SV_CLOUD_TURNED;
    if (p->plane != plane || p->material >= SV_TREE_MATERIALS_MAX || p->flags & ~SV_CLOUD_FLAGS)
        return sv_fail(error, SV_EFORMAT, "cloud.pieces", "piece %u is of plane %u, material %u, flags %u", i,
                       p->plane, p->material, p->flags);
    if (p->first_triangle > cloud->triangle_count ||
        p->triangle_count > cloud->triangle_count - p->first_triangle)
        return sv_fail(error, SV_EFORMAT, "cloud.pieces.first_triangle",
                       "piece %u claims triangles %u + %u of %u", i, p->first_triangle, p->triangle_count,
                       cloud->triangle_count);
    if (!all_within(p->centre, 3, COORDINATE_MAX) || !all_within(p->at, 3, COORDINATE_MAX) ||
        (turned ? !is_unit(p->normal) : !all_within(p->normal, 3, 2)))
        return sv_fail(error, SV_EFORMAT, "cloud.pieces.at", "place of piece %u is out of range", i);
    if (!all_within(p->uv_lo, 2, UV_MAX) || !all_within(p->uv_hi, 2, UV_MAX) || p->uv_lo[0] > p->uv_hi[0] ||
        p->uv_lo[1] > p->uv_hi[1] || !within(p->rotation, -3.15f, 3.15f) || !within(p->size[0], 0, 1e30f) ||
        !within(p->size[1], 0, 1e30f) || !within(p->area, 0, 1e12f))
        return sv_fail(error, SV_EFORMAT, "cloud.pieces.size", "texture or area of piece %u is out of range",
                       i);
    return SV_OK;
}

static enum sv_status check_all(const struct sv_tree_cloud *cloud, struct sv_error *error)
{
    uint32_t next = 0;
    if (!within(cloud->rms, 0, COORDINATE_MAX) || !within(cloud->view_rms, 0, COORDINATE_MAX))
        return sv_fail(error, SV_EFORMAT, "cloud.rms", "rms %g or %g is out of range", (double)cloud->rms,
                       (double)cloud->view_rms);
    for (int k = 0; k < cloud->plane_count; k++) {
        enum sv_status status = check_plane(cloud, k, next, error);
        for (uint32_t i = 0; !status && i < cloud->planes[k].piece_count; i++)
            status = check_piece(cloud, next + i, k, error);
        if (status)
            return status;
        next += cloud->planes[k].piece_count;
    }
    if (next != cloud->piece_count)
        return sv_fail(error, SV_EFORMAT, "cloud.planes", "planes claim %u of %u pieces", next,
                       cloud->piece_count);
    for (uint32_t i = 0; i < cloud->triangle_count; i++)
        for (int k = 0; k < 3; k++)
            if (cloud->triangles[i].at[k][0] + cloud->triangles[i].at[k][1] > SV_CLOUD_WEIGHT_ONE)
                return sv_fail(error, SV_EFORMAT, "cloud.triangles", "corner %d of triangle %u lies outside",
                               k, i);
    return SV_OK;
}

enum sv_status sv_tree_cloud_check(const struct sv_tree_cloud *cloud, const struct sv_tree_mesh *mesh,
                                   struct sv_error *error)
{
    for (uint32_t i = 0; i < cloud->piece_count; i++) {
        const struct sv_cloud_piece *p = &cloud->pieces[i];
        const struct sv_tree_material *m = &mesh->materials[p->material];
        bool sound = p->material < mesh->material_count && m->is_leaf == ((p->flags & SV_CLOUD_LEAF) != 0);
        for (uint32_t t = 0; sound && t < p->triangle_count; t++) {
            uint32_t index = cloud->triangles[p->first_triangle + t].index;
            sound = index >= m->first_index && index % 3 == 0 && index < m->first_index + m->index_count;
        }
        if (!sound)
            return sv_fail(error, SV_EFORMAT, "cloud.pieces", "piece %u is not of this mesh", i);
    }
    return SV_OK;
}

enum sv_status sv_tree_cloud_save(const struct sv_tree_cloud *cloud, void **data, size_t *bytes,
                                  struct sv_error *error)
{
    struct file_header h = {.byte_order = BYTE_ORDER_MARK,
                            .plane_count = (uint32_t)cloud->plane_count,
                            .piece_count = cloud->piece_count,
                            .triangle_count = cloud->triangle_count,
                            .rms = cloud->rms,
                            .view_rms = cloud->view_rms};
    size_t planes = (size_t)cloud->plane_count * sizeof *cloud->planes;
    size_t pieces = (size_t)cloud->piece_count * sizeof *cloud->pieces;
    size_t triangles = (size_t)cloud->triangle_count * sizeof *cloud->triangles;
    unsigned char *block = malloc(sizeof h + planes + pieces + triangles);
    if (!block)
        return sv_fail(error, SV_ENOMEM, "cloud", "no memory for a saved billboard cloud of %u pieces",
                       cloud->piece_count);
    memcpy(h.magic, MAGIC, sizeof h.magic);
    memcpy(block, &h, sizeof h);
    memcpy(block + sizeof h, cloud->planes, planes);
    if (pieces)
        memcpy(block + sizeof h + planes, cloud->pieces, pieces);
    if (triangles)
        memcpy(block + sizeof h + planes + pieces, cloud->triangles, triangles);
    *data = block;
    *bytes = sizeof h + planes + pieces + triangles;
    return SV_OK;
}

static enum sv_status read_header(const void *data, size_t bytes, struct file_header *h,
                                  struct sv_error *error)
{
    if (!data || bytes < sizeof *h)
        return sv_fail(error, SV_EFORMAT, "cloud", "%zu bytes are too few for a saved billboard cloud",
                       bytes);
    memcpy(h, data, sizeof *h);
    if (memcmp(h->magic, MAGIC, sizeof h->magic) != 0 || h->byte_order != BYTE_ORDER_MARK)
        return sv_fail(error, SV_EFORMAT, "cloud",
                       "the bytes are not a saved billboard cloud of this machine");
    if (h->plane_count < 1 || h->plane_count > SV_CLOUD_PLANES_MAX || h->piece_count > SV_CLOUD_PIECES_MAX ||
        h->triangle_count > SV_CLOUD_TRIANGLES_MAX)
        return sv_fail(error, SV_EFORMAT, "cloud.plane_count",
                       "%u planes, %u pieces, %u triangles are out of range", h->plane_count, h->piece_count,
                       h->triangle_count);
    size_t expected = sizeof *h + h->plane_count * sizeof(struct sv_cloud_plane) +
                      (size_t)h->piece_count * sizeof(struct sv_cloud_piece) +
                      (size_t)h->triangle_count * sizeof(struct sv_cloud_triangle);
    if (bytes != expected)
        return sv_fail(error, SV_EFORMAT, "cloud",
                       "the saved billboard cloud has %zu bytes where its counts ask for %zu", bytes,
                       expected);
    return SV_OK;
}

enum sv_status sv_tree_cloud_load(const void *data, size_t bytes, struct sv_tree_cloud *cloud,
                                  struct sv_error *error)
{
    struct file_header h;
    enum sv_status status = read_header(data, bytes, &h, error);
    if (status)
        return status;
    struct sv_tree_cloud made = {.plane_count = (int)h.plane_count,
                                 .piece_count = h.piece_count,
                                 .triangle_count = h.triangle_count,
                                 .rms = h.rms,
                                 .view_rms = h.view_rms};
    size_t planes = h.plane_count * sizeof *made.planes, pieces = h.piece_count * sizeof *made.pieces,
           triangles = h.triangle_count * sizeof *made.triangles;
    const unsigned char *at = (const unsigned char *)data + sizeof h;
    memcpy(made.planes, at, planes);
    made.pieces = malloc(pieces ? pieces : 1);
    made.triangles = malloc(triangles ? triangles : 1);
    if (made.pieces && made.triangles) {
        memcpy(made.pieces, at + planes, pieces);
        memcpy(made.triangles, at + planes + pieces, triangles);
        status = check_all(&made, error);
    } else {
        status = sv_fail(error, SV_ENOMEM, "cloud", "no memory for a billboard cloud of %zu bytes", bytes);
    }
    if (status)
        sv_tree_cloud_finish(&made);
    else
        *cloud = made;
    return status;
}
