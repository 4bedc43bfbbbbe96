/* density_save.c - bytes of a density texture in the store: a head of fixed size, in this machine's byte
 * order, then the DDS file. Loading trusts nothing. */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "core/image/dds_file.h"
#include "core/tree/density_private.h"

static const char MAGIC[8] = {'S', 'V', 'D', 'E', 'N', 'S', 'I', 1};
enum { BYTE_ORDER_MARK = 0x01020304 };
/* What any number of it stays under in what is built: slopes of quadratics and of translucency go far. */
#define NUMBER_MAX 1e6f

struct head {
    char magic[8];
    uint32_t byte_order, kind, plane_count, reserved;
    float period_min, period_max, wood[3], dark[3], bright[3], translucency[4], finer[SV_DENSITY_SCALES];
    struct sv_density_leaf leaf;
    struct sv_density_plane planes[SV_DENSITY_PLANES_MAX];
};

_Static_assert(sizeof(struct sv_density_plane) == 38 * 4 && sizeof(struct sv_density_leaf) == 8 * 4 &&
                   sizeof(struct head) == 24 + 21 * 4 + 8 * 4 + SV_DENSITY_PLANES_MAX * 38 * 4,
               "the saved block has no padding");

enum sv_status sv_density_save(const struct sv_density *density, void **data, size_t *bytes,
                               struct sv_error *error)
{
    struct head *h = malloc(sizeof *h + SV_DENSITY_FILE_BYTES);
    if (!h)
        return sv_fail(error, SV_ENOMEM, "density", "no memory to save a density texture");
    *h = (struct head){.byte_order = BYTE_ORDER_MARK,
                       .kind = (uint32_t)density->kind,
                       .plane_count = (uint32_t)density->plane_count,
                       .period_min = density->period_min,
                       .period_max = density->period_max,
                       .leaf = density->leaf};
    memcpy(h->magic, MAGIC, sizeof MAGIC);
    memcpy(h->wood, density->wood, sizeof h->wood);
    memcpy(h->dark, density->dark, sizeof h->dark);
    memcpy(h->bright, density->bright, sizeof h->bright);
    memcpy(h->translucency, density->translucency, sizeof h->translucency);
    memcpy(h->finer, density->finer, sizeof h->finer);
    memcpy(h->planes, density->planes, sizeof h->planes);
    memcpy(h + 1, density->file, SV_DENSITY_FILE_BYTES);
    *data = h;
    *bytes = sizeof *h + SV_DENSITY_FILE_BYTES;
    return SV_OK;
}

static bool sound(const float *v, size_t bytes, float lo, float hi)
{
    for (size_t k = 0; k < bytes / sizeof *v; k++)
        if (!(v[k] >= lo && v[k] <= hi))
            return false;
    return true;
}

static enum sv_status check(const struct head *h, struct sv_error *error)
{
    const struct sv_density_leaf *leaf = &h->leaf;
    if (memcmp(h->magic, MAGIC, sizeof MAGIC) != 0 || h->byte_order != BYTE_ORDER_MARK)
        return sv_fail(error, SV_EFORMAT, "density", "not a density texture of this version and machine");
    if (h->kind >= SV_DENSITY_KIND_COUNT || h->plane_count > SV_DENSITY_PLANES_MAX)
        return sv_fail(error, SV_EFORMAT, "density", "kind %u, %u planes", h->kind, h->plane_count);
    if (!sound(h->finer, sizeof h->finer, -8, 8))
        return sv_fail(error, SV_EFORMAT, "density.finer", "a scale is out of range");
    if (!sound(&h->period_min, 2 * sizeof(float), 0.5f, 1e4f) || h->period_min > h->period_max)
        return sv_fail(error, SV_EFORMAT, "density.period", "%g to %g", (double)h->period_min,
                       (double)h->period_max);
    if (!sound(h->wood, sizeof h->wood, 0, 64) || !sound(h->dark, sizeof h->dark, 0, 64) ||
        !sound(h->bright, sizeof h->bright, 0, 64) ||
        !sound(h->translucency, sizeof h->translucency, -NUMBER_MAX, NUMBER_MAX))
        return sv_fail(error, SV_EFORMAT, "density.colors", "a colour is out of range");
    if (leaf->material < -1 || leaf->material >= SV_TREE_MATERIALS_MAX ||
        !sound(leaf->uv_lo, sizeof *leaf - sizeof leaf->material, -NUMBER_MAX * 4, NUMBER_MAX * 4) ||
        (leaf->material >= 0 &&
         !(leaf->size[0] > 0 && leaf->size[1] > 0 && leaf->cover >= 0 && leaf->cover <= 1)))
        return sv_fail(error, SV_EFORMAT, "density.leaf", "the leaf is out of range");
    for (int k = 0; k < SV_DENSITY_PLANES_MAX; k++)
        if (!sound(h->planes[k].occlusion.c, sizeof h->planes[k], -NUMBER_MAX, NUMBER_MAX))
            return sv_fail(error, SV_EFORMAT, "density.planes", "light of plane %d is out of range", k);
    return SV_OK;
}

enum sv_status sv_density_load(const void *data, size_t bytes, struct sv_density *density,
                               struct sv_error *error)
{
    struct head h;
    int width, height;
    const uint8_t *file = (const uint8_t *)data + sizeof h, *blocks;
    if (bytes != sizeof h + SV_DENSITY_FILE_BYTES)
        return sv_fail(error, SV_EFORMAT, "density", "%zu bytes where %zu are expected", bytes,
                       sizeof h + SV_DENSITY_FILE_BYTES);
    memcpy(&h, data, sizeof h);
    enum sv_status status = check(&h, error);
    if (!status)
        status = sv_dds_file_read(file, SV_DENSITY_FILE_BYTES, &width, &height, &blocks, error);
    if (!status && (width != SV_DENSITY_WIDTH || height != SV_DENSITY_HEIGHT))
        status = sv_fail(error, SV_EFORMAT, "density", "a picture of %d x %d", width, height);
    if (status)
        return status;
    struct sv_density made = {.kind = (enum sv_density_kind)h.kind,
                              .plane_count = (int)h.plane_count,
                              .period_min = h.period_min,
                              .period_max = h.period_max,
                              .leaf = h.leaf,
                              .file = malloc(SV_DENSITY_FILE_BYTES)};
    if (!made.file)
        return sv_fail(error, SV_ENOMEM, "density", "no memory to load a density texture");
    memcpy(made.wood, h.wood, sizeof h.wood);
    memcpy(made.dark, h.dark, sizeof h.dark);
    memcpy(made.bright, h.bright, sizeof h.bright);
    memcpy(made.translucency, h.translucency, sizeof h.translucency);
    memcpy(made.finer, h.finer, sizeof h.finer);
    memcpy(made.planes, h.planes, sizeof h.planes);
    memcpy(made.file, file, SV_DENSITY_FILE_BYTES);
    *density = made;
    return SV_OK;
}
