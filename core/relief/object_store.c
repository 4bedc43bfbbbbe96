/* object_store.c - a relief object as one block of bytes, and the store that keeps it.
 *
 * Header (magic, order of bytes, version, box, texels along the longest side, checksum), then face after
 * face: cut, displ, colour, normals, mask. Frames and sizes are not kept: they follow from the box
 * (sv_relief_object_face_layout), so that no bytes can name a frame that the rest of the library would not
 * make. load takes any bytes. */
#include "core/relief/object.h"

#include <stdlib.h>
#include <string.h>

#include "core/base/hash.h"

static const char MAGIC[8] = {'S', 'V', 'R', 'O', 'B', 'J', '\r', '\n'};
enum { BYTE_ORDER_MARK = 0x01020304, FORMAT_VERSION = 1 };

struct file_header {
    char magic[8];
    uint32_t byte_order, version;
    uint32_t resolution, pad;
    double box_min[3], box_max[3];
    float cut[SV_RELIEF_FACES];
    uint64_t checksum; /* of the header, this being 0, and all that follows */
};

/* Bytes of a texel: displ, colour, normal, mask. */
enum { TEXEL_BYTES = 4 + 4 + 8 + 1 };

static size_t texels_of(const struct sv_relief *face)
{
    return (size_t)face->width * (size_t)face->height;
}

static size_t total_bytes(const struct sv_relief_object *object)
{
    size_t bytes = sizeof(struct file_header);
    for (int k = 0; k < SV_RELIEF_FACES; k++)
        bytes += texels_of(&object->face[k]) * TEXEL_BYTES;
    return bytes;
}

static uint64_t checksum(const struct file_header *header, const void *rest, size_t bytes)
{
    struct file_header h = *header;
    h.checksum = 0;
    return sv_hash_done(sv_hash_bytes(sv_hash_bytes(SV_HASH_INIT, &h, sizeof h), rest, bytes));
}

static unsigned char *put(unsigned char *at, const void *from, size_t bytes)
{
    memcpy(at, from, bytes);
    return at + bytes;
}

static const unsigned char *take(const unsigned char *at, void *to, size_t bytes)
{
    memcpy(to, at, bytes);
    return at + bytes;
}

enum sv_status sv_relief_object_save(const struct sv_relief_object *object, void **data, size_t *bytes,
                                     struct sv_error *error)
{
    size_t size = total_bytes(object);
    unsigned char *block = malloc(size);
    if (!block)
        return sv_fail(error, SV_ENOMEM, "object", "no memory for a saved relief object of %zu bytes", size);
    struct file_header h = {.byte_order = BYTE_ORDER_MARK,
                            .version = FORMAT_VERSION,
                            .resolution = (uint32_t)object->resolution,
                            .box_min = {object->box_min.x, object->box_min.y, object->box_min.z},
                            .box_max = {object->box_max.x, object->box_max.y, object->box_max.z}};
    memcpy(h.magic, MAGIC, sizeof h.magic);
    unsigned char *at = block + sizeof h;
    for (int k = 0; k < SV_RELIEF_FACES; k++) {
        const struct sv_relief *r = &object->face[k];
        size_t texels = texels_of(r);
        h.cut[k] = r->cut;
        at = put(at, r->displ, texels * sizeof *r->displ);
        at = put(at, r->color, texels * sizeof *r->color);
        at = put(at, r->normal, texels * sizeof *r->normal);
        at = put(at, object->keep[k], texels);
    }
    h.checksum = checksum(&h, block + sizeof h, size - sizeof h);
    put(block, &h, sizeof h);
    *data = block;
    *bytes = size;
    return SV_OK;
}

static enum sv_status read_header(const void *data, size_t bytes, struct file_header *h,
                                  struct sv_relief_object *object, struct sv_error *error)
{
    if (!data || bytes < sizeof *h)
        return sv_fail(error, SV_EFORMAT, "object", "%zu bytes are no relief object: its header has %zu",
                       bytes, sizeof *h);
    memcpy(h, data, sizeof *h);
    if (memcmp(h->magic, MAGIC, sizeof MAGIC) != 0 || h->byte_order != BYTE_ORDER_MARK)
        return sv_fail(error, SV_EFORMAT, "object",
                       "the bytes are no relief object of this machine's byte order");
    if (h->version != FORMAT_VERSION)
        return sv_fail(error, SV_EFORMAT, "version", "is %u, must be %d", h->version, FORMAT_VERSION);
    if (h->resolution < SV_RELIEF_RESOLUTION_MIN || h->resolution > SV_RELIEF_RESOLUTION_MAX)
        return sv_fail(error, SV_EFORMAT, "resolution", "is %u texels, must be %d to %d", h->resolution,
                       SV_RELIEF_RESOLUTION_MIN, SV_RELIEF_RESOLUTION_MAX);
    for (int k = 0; k < SV_RELIEF_FACES; k++)
        if (!(h->cut[k] > 0))
            return sv_fail(error, SV_EFORMAT, "cut", "is %g on face %d, must be over 0", (double)h->cut[k],
                           k);
    struct sv_vec3 lo = sv_vec3(h->box_min[0], h->box_min[1], h->box_min[2]);
    struct sv_vec3 hi = sv_vec3(h->box_max[0], h->box_max[1], h->box_max[2]);
    return sv_relief_object_set_box(object, lo, hi, (int)h->resolution, SV_EFORMAT, error);
}

/* Numbers of a face that the rest of the library may trust: displ within the box, NaN where nothing is. */
static enum sv_status check_face(struct sv_relief_object *object, int k, struct sv_error *error)
{
    struct sv_relief *r = &object->face[k];
    struct sv_vec3 size = sv_sub(object->box_max, object->box_min);
    double depth = fabs(sv_dot(size, r->frame.f)) + object->texel, front = object->texel;
    for (size_t i = 0; i < texels_of(r); i++) {
        double d = (double)r->displ[i];
        if (!sv_relief_solid(r, i))
            r->displ[i] = NAN;
        else if (!(d >= -depth && d <= front))
            return sv_fail(error, SV_EFORMAT, "displ", "is %g at texel %zu of face %d, must be %g to %g", d,
                           i, k, -depth, front);
    }
    return SV_OK;
}

enum sv_status sv_relief_object_load(const void *data, size_t bytes, struct sv_relief_object *object,
                                     struct sv_error *error)
{
    struct file_header h;
    struct sv_relief_object made = {0};
    enum sv_status status = read_header(data, bytes, &h, &made, error);
    if (status != SV_OK)
        return status; /* nothing is owned yet */
    size_t expected = sizeof h;
    for (int k = 0; k < SV_RELIEF_FACES; k++) {
        struct sv_relief_frame frame;
        int width, height;
        sv_relief_object_face_layout(&made, k, made.texel, &frame, &width, &height);
        expected += (size_t)width * (size_t)height * TEXEL_BYTES;
    }
    const unsigned char *at = (const unsigned char *)data + sizeof h;
    if (bytes != expected)
        return sv_fail(error, SV_EFORMAT, "object", "has %zu bytes where its box and resolution ask for %zu",
                       bytes, expected);
    if (h.checksum != checksum(&h, at, bytes - sizeof h))
        return sv_fail(error, SV_EFORMAT, "checksum", "does not fit the bytes");
    status = sv_relief_object_alloc(&made, error);
    for (int k = 0; status == SV_OK && k < SV_RELIEF_FACES; k++) {
        struct sv_relief *r = &made.face[k];
        size_t texels = texels_of(r);
        r->cut = h.cut[k];
        at = take(at, r->displ, texels * sizeof *r->displ);
        at = take(at, r->color, texels * sizeof *r->color);
        at = take(at, r->normal, texels * sizeof *r->normal);
        at = take(at, made.keep[k], texels);
        sv_relief_measure(r);
        status = check_face(&made, k, error);
    }
    if (status == SV_OK)
        status = sv_relief_object_derive(&made, error);
    if (status == SV_OK)
        *object = made;
    else
        sv_relief_object_finish(&made);
    return status;
}

enum sv_status sv_relief_object_obtain(const struct sv_tree_mesh *mesh, uint64_t key, int resolution,
                                       struct sv_store *store, struct sv_relief_object *object,
                                       struct sv_error *error)
{
    void *data = NULL;
    size_t bytes = 0;
    uint64_t blob = sv_hash_done(sv_hash_u64(sv_hash_u64(SV_HASH_INIT, key), (uint64_t)resolution));
    if (sv_store_get(store, SV_RELIEF_OBJECT_KIND, blob, &data, &bytes, NULL) == SV_OK) {
        enum sv_status status = sv_relief_object_load(data, bytes, object, NULL);
        free(data);
        if (status == SV_OK && object->resolution == resolution)
            return SV_OK;
        if (status == SV_OK)
            sv_relief_object_finish(object);
    }
    enum sv_status status = sv_relief_object_bake(mesh, resolution, object, error);
    if (status != SV_OK)
        return status;
    if (store && sv_relief_object_save(object, &data, &bytes, NULL) == SV_OK) {
        sv_store_put(store, SV_RELIEF_OBJECT_KIND, blob, data, bytes, NULL);
        free(data);
    }
    return SV_OK;
}
