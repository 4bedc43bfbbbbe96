/* indirect_save.c - bytes of indirect textures, and what the layered form would take. */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "core/tree/indirect.h"

static const char MAGIC[8] = {'S', 'V', 'I', 'N', 'D', 'I', 'R', 1};
enum { BYTE_ORDER_MARK = 0x01020304 };

struct file_header {
    char magic[8];
    uint32_t byte_order, plane_count, side, kind_count, layer_count, reserved;
    uint64_t base_bytes;
};

static size_t leaf_bytes(const struct sv_indirect *t)
{
    size_t bytes = 0;
    for (size_t side = SV_INDIRECT_LEAF_SIDE; side > 0; side /= 2)
        bytes += 4 * side * side * (size_t)t->layer_count;
    return bytes;
}

static size_t texel_bytes(const struct sv_indirect *t)
{
    return 4 * (size_t)t->plane_count * (size_t)t->side * (size_t)t->side;
}

static unsigned char *put(unsigned char *at, const void *data, size_t bytes)
{
    if (bytes)
        memcpy(at, data, bytes);
    return at + bytes;
}

enum sv_status sv_indirect_save(const struct sv_indirect *t, void **data, size_t *bytes,
                                struct sv_error *error)
{
    struct file_header h = {.byte_order = BYTE_ORDER_MARK,
                            .plane_count = (uint32_t)t->plane_count,
                            .side = (uint32_t)t->side,
                            .kind_count = (uint32_t)t->kind_count,
                            .layer_count = (uint32_t)t->layer_count};
    void *base = NULL;
    size_t base_bytes = 0;
    enum sv_status status = sv_billboards_save(&t->base, &base, &base_bytes, error);
    if (status)
        return status;
    size_t size = sizeof h + sizeof t->kinds + texel_bytes(t) + leaf_bytes(t) + base_bytes;
    unsigned char *block = malloc(size);
    if (!block) {
        free(base);
        return sv_fail(error, SV_ENOMEM, "indirect", "no memory for %zu saved bytes", size);
    }
    memcpy(h.magic, MAGIC, sizeof h.magic);
    h.base_bytes = base_bytes;
    unsigned char *at = put(block, &h, sizeof h);
    at = put(at, t->kinds, sizeof t->kinds);
    at = put(at, t->texels, texel_bytes(t));
    at = put(at, t->leaves, leaf_bytes(t));
    put(at, base, base_bytes);
    free(base);
    *data = block;
    *bytes = size;
    return SV_OK;
}

static bool header_sound(const struct file_header *h)
{
    return memcmp(h->magic, MAGIC, sizeof h->magic) == 0 && h->byte_order == BYTE_ORDER_MARK &&
           h->plane_count >= 1 && h->plane_count <= SV_CLOUD_PLANES_MAX && h->side >= 16 && h->side <= 1024 &&
           (h->side & (h->side - 1)) == 0 && h->kind_count >= 1 && h->kind_count <= SV_INDIRECT_KINDS &&
           h->layer_count <= SV_INDIRECT_LAYERS_MAX;
}

static bool kinds_sound(const struct sv_indirect *t)
{
    bool sound = true;
    for (int k = 0; k < t->kind_count; k++) {
        const struct sv_indirect_kind *kind = &t->kinds[k];
        sound = sound && kind->half[0] > 0 && kind->half[0] <= 1e5f && kind->half[1] > 0 &&
                kind->half[1] <= 1e5f && kind->reach >= 0 && kind->reach <= 1e6f && kind->layer >= 0 &&
                (k == 0 || kind->layer < (float)t->layer_count);
        for (int c = 0; c < 2; c++)
            sound = sound && fabsf(kind->uv_lo[c]) <= 1e7f && fabsf(kind->uv_hi[c]) <= 1e7f;
    }
    for (size_t k = 0; sound && k < texel_bytes(t); k += 4)
        sound = t->texels[k + 3] < t->kind_count;
    return sound;
}

enum sv_status sv_indirect_load(const void *data, size_t bytes, struct sv_indirect *out,
                                struct sv_error *error)
{
    struct file_header h;
    struct sv_indirect t = {0};
    bool sound = data && bytes >= sizeof h;
    if (sound) {
        memcpy(&h, data, sizeof h);
        sound = header_sound(&h);
    }
    if (!sound)
        return sv_fail(error, SV_EFORMAT, "indirect", "the bytes are not saved indirect textures");
    t.plane_count = (int)h.plane_count;
    t.side = (int)h.side;
    t.kind_count = (int)h.kind_count;
    t.layer_count = (int)h.layer_count;
    size_t fixed = sizeof h + sizeof t.kinds + texel_bytes(&t) + leaf_bytes(&t);
    if (bytes < fixed || bytes - fixed != h.base_bytes)
        return sv_fail(error, SV_EFORMAT, "indirect", "%zu bytes where the sizes ask for more than %zu",
                       bytes, fixed);
    const unsigned char *at = (const unsigned char *)data + sizeof h;
    memcpy(t.kinds, at, sizeof t.kinds);
    at += sizeof t.kinds;
    t.texels = malloc(texel_bytes(&t));
    t.leaves = malloc(leaf_bytes(&t) + 1);
    enum sv_status status = SV_OK;
    if (!t.texels || !t.leaves) {
        status = sv_fail(error, SV_ENOMEM, "indirect", "no memory for %zu bytes", bytes);
    } else {
        memcpy(t.texels, at, texel_bytes(&t));
        at += texel_bytes(&t);
        memcpy(t.leaves, at, leaf_bytes(&t));
        at += leaf_bytes(&t);
        if (!kinds_sound(&t))
            status = sv_fail(error, SV_EFORMAT, "indirect", "a kind of leaf, or a texel's, is out of range");
    }
    if (!status)
        status = sv_billboards_load(at, h.base_bytes, &t.base, error);
    if (!status && t.base.plane_count != t.plane_count)
        status = sv_fail(error, SV_EFORMAT, "indirect", "%d planes, and %d in the base", t.plane_count,
                         t.base.plane_count);
    if (status)
        sv_indirect_finish(&t);
    else
        *out = t;
    return status;
}

/* ---- layers ---- */

/* True where the triangle meets the box of half size h about c: separating axes (its edges, the box's sides).
 */
static bool touches(float p[3][2], const float c[2], const float h[2])
{
    float q[3][2], turn = 0;
    for (int k = 0; k < 3; k++)
        for (int a = 0; a < 2; a++)
            q[k][a] = (p[k][a] - c[a]) / h[a];
    for (int a = 0; a < 2; a++)
        if (fminf(q[0][a], fminf(q[1][a], q[2][a])) > 1 || fmaxf(q[0][a], fmaxf(q[1][a], q[2][a])) < -1)
            return false;
    turn = (q[1][0] - q[0][0]) * (q[2][1] - q[0][1]) - (q[2][0] - q[0][0]) * (q[1][1] - q[0][1]);
    for (int k = 0; k < 3; k++) {
        const float *a = q[k], *b = q[(k + 1) % 3];
        float n[2] = {a[1] - b[1], b[0] - a[0]}; /* inwards when turn > 0 */
        float most = fabsf(n[0]) + fabsf(n[1]) - (turn < 0 ? -1.0f : 1.0f) * (n[0] * a[0] + n[1] * a[1]);
        if (most < 0)
            return false;
    }
    return true;
}

/* Marks every texel that the piece touches: stamp[texel] = mark, count[texel]++, once a piece. */
static void stamp_piece(const struct sv_tree_mesh *mesh, const struct sv_tree_cloud *cloud,
                        const struct sv_cloud_piece *piece, int side, uint32_t mark, uint32_t *stamp,
                        uint16_t *count)
{
    const struct sv_cloud_plane *plane = &cloud->planes[piece->plane];
    struct sv_cloud_placement q;
    float step[2] = {2 * plane->half[0] / (float)side, 2 * plane->half[1] / (float)side};
    sv_cloud_place(cloud, piece, &q);
    for (uint32_t t = 0; t < piece->triangle_count; t++) {
        float p[3][2], lo[2] = {INFINITY, INFINITY}, hi[2] = {-INFINITY, -INFINITY};
        for (int k = 0; k < 3; k++) {
            struct sv_tree_vertex v = sv_cloud_corner(mesh, &cloud->triangles[piece->first_triangle + t], k);
            float at[3];
            sv_cloud_placed(&q, v.position, at);
            for (int a = 0; a < 2; a++) {
                p[k][a] = (at[a] + plane->half[a]) / step[a]; /* in texels; rows from the bottom do as well */
                lo[a] = fminf(lo[a], p[k][a]);
                hi[a] = fmaxf(hi[a], p[k][a]);
            }
        }
        int i0 = lo[0] > 0 ? (int)lo[0] : 0, j0 = lo[1] > 0 ? (int)lo[1] : 0;
        int i1 = hi[0] < (float)side ? (int)hi[0] : side - 1,
            j1 = hi[1] < (float)side ? (int)hi[1] : side - 1;
        for (int j = j0; j <= j1; j++)
            for (int i = i0; i <= i1; i++) {
                size_t at = (size_t)j * (size_t)side + (size_t)i;
                const float c[2] = {(float)i + 0.5f, (float)j + 0.5f}, h[2] = {0.5f, 0.5f};
                if (stamp[at] == mark || !touches(p, c, h))
                    continue;
                stamp[at] = mark;
                count[at] += count[at] < UINT16_MAX;
            }
    }
}

enum sv_status sv_indirect_count_layers(const struct sv_tree_mesh *mesh, const struct sv_tree_cloud *cloud,
                                        int side, struct sv_indirect_layers *layers, struct sv_error *error)
{
    if (side < 1 || side > 4096)
        return sv_fail(error, SV_EINVAL, "indirect", "side %d is outside 1 .. 4096", side);
    size_t texels = (size_t)side * (size_t)side;
    uint32_t *stamp = malloc(texels * sizeof *stamp);
    uint16_t *count = malloc(texels * sizeof *count);
    struct sv_indirect_layers made = {0};
    for (int k = 0; stamp && count && k < cloud->plane_count; k++) {
        memset(stamp, 0xff, texels * sizeof *stamp);
        memset(count, 0, texels * sizeof *count);
        for (uint32_t i = 0; i < cloud->planes[k].piece_count; i++)
            stamp_piece(mesh, cloud, &cloud->pieces[cloud->planes[k].first_piece + i], side, i, stamp, count);
        for (size_t i = 0; i < texels; i++) {
            made.texels += count[i] > 0;
            made.entries += count[i];
            made.deepest = count[i] > made.deepest ? count[i] : made.deepest;
        }
    }
    bool memory = stamp && count;
    free(stamp);
    free(count);
    if (!memory)
        return sv_fail(error, SV_ENOMEM, "indirect", "no memory to count layers of %d x %d texels", side,
                       side);
    made.bytes = 4 * ((size_t)cloud->plane_count * texels + made.entries);
    *layers = made;
    return SV_OK;
}
