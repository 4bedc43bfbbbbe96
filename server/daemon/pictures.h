/* pictures.h - encoded pictures: shared by the answers that send them, and a cache of them by entity tag.
 *
 * A picture's bytes lie in the slab that the worker wrote or in memory of their own; they live as long as
 * somebody holds a reference. The cache keeps copies of its own (a slab is worth more to the next worker),
 * least recently used out first, within a budget of bytes. One thread. */
#ifndef SV_SERVER_PICTURES_H
#define SV_SERVER_PICTURES_H

#include <stddef.h>
#include <stdint.h>

#include "core/view/timings.h"
#include "server/slab.h"

struct sv_picture_bytes {
    const void *bytes;
    size_t size;
    unsigned refs;
    struct sv_slab *slab; /* NULL: bytes are heap memory */
    struct sv_cell_use cell; /* what panels it was drawn from */
};

/* With one reference, the caller's. The slab is taken and goes back to its pool with the last reference. NULL
 * when out of memory (the slab is then given back). */
struct sv_picture_bytes *sv_picture_of_slab(struct sv_slab *slab, const void *bytes, size_t size);
struct sv_picture_bytes *sv_picture_copy(const void *bytes, size_t size);
struct sv_picture_bytes *sv_picture_ref(struct sv_picture_bytes *picture);
void sv_picture_unref(void *picture); /* NULL is legal; void so that it serves as a release call */

struct sv_pictures;

/* NULL when out of memory. Budget 0 keeps none. */
struct sv_pictures *sv_pictures_create(uint64_t budget_bytes);
void sv_pictures_destroy(struct sv_pictures *pictures);
/* Keeps a copy, unless it is larger than a quarter of the budget. */
void sv_pictures_keep(struct sv_pictures *pictures, const char *etag, const struct sv_picture_bytes *picture);
/* A new reference, or NULL. */
struct sv_picture_bytes *sv_pictures_find(struct sv_pictures *pictures, const char *etag);
/* Forgets those that were drawn from that cell and not from refined panels alone. */
void sv_pictures_outdate(struct sv_pictures *pictures, uint64_t cell);
size_t sv_pictures_count(const struct sv_pictures *pictures);
uint64_t sv_pictures_bytes(const struct sv_pictures *pictures);

#endif
