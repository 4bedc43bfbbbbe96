#include "server/bands.h"

#include <math.h>
#include <stdatomic.h>
#include <string.h>

enum { LINE = 64, WORD_DONE = 0, WORD_LEVEL = 1 };
enum { HEAD_BYTES = (SV_BANDS_MAX * sizeof(struct sv_bands_part) + LINE - 1) / LINE * LINE };
/* A worker keeps no larger slab mapped when it has drawn: with its memory it would go to another only when
 * the next one comes. */
enum { MAPPED_BYTES_MAX = 32 << 20 };

static size_t on_line(size_t bytes)
{
    return (bytes + LINE - 1) / LINE * LINE;
}

/* Layers of a view one behind the other, from base on (NULL: only counted); their bytes. */
static size_t lay_out(const struct sv_view_request *request, uint8_t *base, struct sv_picture *picture)
{
    size_t bytes = 0;
    for (int k = 0; k < SV_LAYER_COUNT; k++) {
        if (!(request->layers & 1u << k))
            continue;
        picture->layer[k] = sv_picture_layer(k, request->width, request->height);
        picture->layer[k].data = base ? base + bytes : NULL;
        bytes += on_line(sv_image_bytes(&picture->layer[k]));
    }
    return bytes;
}

size_t sv_bands_bytes(const struct sv_view_request *request)
{
    struct sv_picture picture = {0};
    return HEAD_BYTES + lay_out(request, NULL, &picture);
}

enum sv_status sv_bands_map(int fd, const struct sv_view_request *request, struct sv_bands_map *map,
                            struct sv_error *error)
{
    enum sv_status status = sv_slab_map(fd, &map->slab, error);
    if (status != SV_OK)
        return status;
    if (sv_bands_bytes(request) > map->slab.capacity)
        return sv_fail(error, SV_ELIMIT, "slab", "%zu bytes of bands do not fit the %zu of the slab",
                       sv_bands_bytes(request), map->slab.capacity);
    map->parts = (struct sv_bands_part *)(void *)map->slab.data;
    map->picture = (struct sv_picture){0};
    (void)lay_out(request, map->slab.data + HEAD_BYTES, &map->picture);
    return SV_OK;
}

void sv_bands_leave(struct sv_bands_map *map)
{
    if (map->slab.mapped_bytes > MAPPED_BYTES_MAX)
        sv_slab_unmap(&map->slab);
}

enum sv_status sv_bands_end(struct sv_bands_map *map, const struct sv_view_request *request, uint64_t job,
                            const void *bytes, size_t size, struct sv_error *error)
{
    return sv_slab_put(&map->slab, job, sv_bands_bytes(request), bytes, size, error);
}

/* The word holds the level + 1; 0: none yet. */
static int agree(void *context, int level)
{
    _Atomic uint32_t *word = &((struct sv_bands_map *)context)->slab.words[WORD_LEVEL];
    uint32_t held = 0;
    if (level < 0)
        return (int)atomic_load(word) - 1;
    return atomic_compare_exchange_strong(word, &held, (uint32_t)level + 1) ? level : (int)held - 1;
}

struct sv_bands sv_bands_shared(struct sv_bands_map *map)
{
    return (struct sv_bands){.context = map, .agree = agree};
}

bool sv_bands_put(struct sv_bands_map *map, int band, int count, int row_first, const struct sv_picture *rows,
                  const struct sv_bands_part *part)
{
    for (int k = 0; k < SV_LAYER_COUNT; k++) {
        const struct sv_image *from = &rows->layer[k];
        const struct sv_image *to = &map->picture.layer[k];
        if (!from->data || !to->data)
            continue;
        size_t row_bytes = sv_image_bytes(to) / (size_t)to->height;
        memcpy((uint8_t *)to->data + (size_t)row_first * row_bytes, from->data, sv_image_bytes(from));
    }
    map->parts[band] = *part;
    uint32_t all = (1u << count) - 1, bit = 1u << band;
    return (atomic_fetch_or(&map->slab.words[WORD_DONE], bit) | bit) == all;
}

static struct sv_cell_use join_use(const struct sv_cell_use *a, const struct sv_cell_use *b)
{
    return (struct sv_cell_use){.kind = a->kind > b->kind ? a->kind : b->kind,
                                .hits = a->hits + b->hits,
                                .refined = a->refined + b->refined,
                                .built = a->built + b->built,
                                .shadows_left = a->shadows_left | b->shadows_left,
                                .id = a->id ? a->id : b->id};
}

struct sv_bands_part sv_bands_join(const struct sv_bands_part *parts, int count)
{
    struct sv_bands_part all = parts[0];
    for (int n = 1; n < count; n++) {
        const struct sv_bands_part *p = &parts[n];
        for (int k = 0; k < SV_STAGE_COUNT; k++)
            all.timings.ms[k] = fmax(all.timings.ms[k], p->timings.ms[k]);
        all.stats.terrain_triangles += p->stats.terrain_triangles;
        all.stats.near_trees += p->stats.near_trees;
        all.stats.far_trees += p->stats.far_trees;
        all.stats.polygon_objects += p->stats.polygon_objects;
        all.stats.relief_objects += p->stats.relief_objects;
        all.stats.terrain_error_px = fmax(all.stats.terrain_error_px, p->stats.terrain_error_px);
        all.stats.cell = join_use(&all.stats.cell, &p->stats.cell);
        all.took.level = p->took.level < 0 ? -1 : all.took.level;
        all.took.ms += p->took.ms;
    }
    if (all.stats.cell.built > 0)
        all.stats.cell.kind = SV_CELL_USE_BUILT;
    return all;
}
