/* arena.h - memory that is filled once, then only read, and shared by every worker.
 *
 * An arena reserves address space backed by a memfd; pages cost memory only when touched. The scene process
 * allocates into it while it loads, seals it, and forks: the pages are shared by all workers and cannot be
 * written by mistake. Nothing is freed one by one. From 2 MiB on they are large pages where the system has
 * some to give. One process, one thread while it fills. */
#ifndef SV_BASE_ARENA_H
#define SV_BASE_ARENA_H

#include <stddef.h>

#include "core/base/error.h"

struct sv_arena;

/* Reserves reserve_bytes (rounded up to pages, from 2 MiB on to large ones; 1 .. 2^40). SV_ENOMEM when
 * address space or memfd is refused.
 */
SV_MUST_CHECK enum sv_status sv_arena_create(size_t reserve_bytes, struct sv_arena **arena,
                                             struct sv_error *error);
void sv_arena_destroy(struct sv_arena *arena); /* NULL is legal; every pointer into it dies */

/* Zeroed bytes aligned to 64; NULL when the reserve is used up, the arena is sealed, or count * size
 * overflows. Zero bytes give a valid pointer. */
void *sv_arena_alloc(struct sv_arena *arena, size_t count, size_t size);
/* The same of memory that is filled right away: its pages come at once, not by a fault each. */
void *sv_arena_alloc_pages(struct sv_arena *arena, size_t count, size_t size);
/* A copy of the bytes, or NULL as above. */
void *sv_arena_copy(struct sv_arena *arena, const void *data, size_t bytes);

size_t sv_arena_used(const struct sv_arena *arena); /* bytes */

/* Makes the arena read-only for this process and its future children. */
SV_MUST_CHECK enum sv_status sv_arena_seal(struct sv_arena *arena, struct sv_error *error);

#endif
