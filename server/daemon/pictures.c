#include "server/daemon/pictures.h"

#include <stdlib.h>
#include <string.h>

#include "server/daemon/lru.h"

/* What a picture costs beside its bytes: entry, key, struct. */
enum { OVERHEAD_BYTES = 256 };

struct sv_pictures {
    struct sv_lru *lru;
    uint64_t budget;
};

struct sv_picture_bytes *sv_picture_of_slab(struct sv_slab *slab, const void *bytes, size_t size)
{
    struct sv_picture_bytes *picture = malloc(sizeof *picture);
    if (!picture) {
        sv_slab_give(slab);
        return NULL;
    }
    *picture = (struct sv_picture_bytes){.bytes = bytes, .size = size, .refs = 1, .slab = slab};
    return picture;
}

struct sv_picture_bytes *sv_picture_copy(const void *bytes, size_t size)
{
    struct sv_picture_bytes *picture = malloc(sizeof *picture + size);
    if (!picture)
        return NULL;
    *picture = (struct sv_picture_bytes){.bytes = picture + 1, .size = size, .refs = 1};
    if (size)
        memcpy(picture + 1, bytes, size);
    return picture;
}

struct sv_picture_bytes *sv_picture_ref(struct sv_picture_bytes *picture)
{
    picture->refs++;
    return picture;
}

void sv_picture_unref(void *pointer)
{
    struct sv_picture_bytes *picture = pointer;
    if (!picture || --picture->refs)
        return;
    sv_slab_give(picture->slab);
    free(picture);
}

struct sv_pictures *sv_pictures_create(uint64_t budget_bytes)
{
    struct sv_pictures *pictures = calloc(1, sizeof *pictures);
    if (pictures)
        pictures->lru = sv_lru_create(budget_bytes, sv_picture_unref);
    if (pictures && !pictures->lru) {
        free(pictures);
        return NULL;
    }
    if (pictures)
        pictures->budget = budget_bytes;
    return pictures;
}

void sv_pictures_destroy(struct sv_pictures *pictures)
{
    if (!pictures)
        return;
    sv_lru_destroy(pictures->lru);
    free(pictures);
}

void sv_pictures_keep(struct sv_pictures *pictures, const char *etag, const struct sv_picture_bytes *picture)
{
    size_t cost = picture->size + OVERHEAD_BYTES;
    if (cost > pictures->budget / 4)
        return;
    struct sv_picture_bytes *copy = sv_picture_copy(picture->bytes, picture->size);
    if (!copy)
        return;
    copy->cell = picture->cell;
    sv_lru_put(pictures->lru, etag, copy, cost);
}

struct sv_picture_bytes *sv_pictures_find(struct sv_pictures *pictures, const char *etag)
{
    struct sv_picture_bytes *picture = sv_lru_get(pictures->lru, etag);
    return picture ? sv_picture_ref(picture) : NULL;
}

static bool is_coarse(const void *value, const void *context)
{
    const struct sv_cell_use *cell = &((const struct sv_picture_bytes *)value)->cell;
    return cell->id == *(const uint64_t *)context && !sv_cell_use_refined(cell);
}

void sv_pictures_outdate(struct sv_pictures *pictures, uint64_t cell)
{
    sv_lru_remove_all(pictures->lru, is_coarse, &cell);
}

size_t sv_pictures_count(const struct sv_pictures *pictures)
{
    return sv_lru_count(pictures->lru);
}

uint64_t sv_pictures_bytes(const struct sv_pictures *pictures)
{
    return sv_lru_cost(pictures->lru);
}
