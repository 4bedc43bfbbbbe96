/* slab.h - shared memory in which a worker hands encoded bytes to the daemon.
 *
 * A slab is a memfd of fixed capacity, sealed against shrinking and growing, so that neither side can make
 * the other fault. It begins with a head; the worker writes the bytes first and the commit word (the job's
 * id) last. The daemon owns all slabs in a pool, counts their bytes against a budget, and uses them again. A
 * slab that a worker which may still live has in hand is never used again: sv_slab_discard it. Workers that put one picture
 * together (bands.h) have one slab, and words in its head to agree by. One thread in each process. */
#ifndef SV_SERVER_SLAB_H
#define SV_SERVER_SLAB_H

#include <stddef.h>
#include <stdint.h>

#include "core/base/error.h"

/* Words that all who have a slab share, 0 when it is taken from the pool. */
enum { SV_SLAB_WORDS = 6 };

/* Worker's side: the slab mapped. Zero: none. */
struct sv_slab_map {
    void *memory;
    size_t mapped_bytes;
    uint64_t inode;          /* of its memfd: no other in the life of a process has that */
    _Atomic uint32_t *words; /* SV_SLAB_WORDS */
    uint8_t *data;           /* on a cache line */
    size_t capacity;         /* of data, bytes */
};
/* Errors of sv_slab_write; fd stays the caller's. A map that is not zero is taken as it is when it is that slab's, else
 * unmapped first: a page that is touched for the first time costs microseconds, so who is given the same slab again and
 * again keeps it mapped, and leaves it alone meanwhile. */
SV_MUST_CHECK enum sv_status sv_slab_map(int fd, struct sv_slab_map *map, struct sv_error *error);
void sv_slab_unmap(struct sv_slab_map *map);
/* Writes bytes into a mapped slab, from `at` of its data on, and commits them. SV_ELIMIT. */
SV_MUST_CHECK enum sv_status sv_slab_put(struct sv_slab_map *map, uint64_t job, size_t at, const void *bytes,
                                         size_t size, struct sv_error *error);
/* Worker's side: writes bytes into the slab behind fd and commits them for that job. SV_ELIMIT when they do
 * not fit, SV_EFORMAT when fd is no sealed slab. fd stays the caller's. */
SV_MUST_CHECK enum sv_status sv_slab_write(int fd, uint64_t job, const void *bytes, size_t size,
                                           struct sv_error *error);

/* Daemon's side. */
struct sv_slab_pool;
struct sv_slab;

/* budget_bytes: all slabs together, lent or kept. */
SV_MUST_CHECK enum sv_status sv_slab_pool_create(uint64_t budget_bytes, struct sv_slab_pool **pool,
                                                 struct sv_error *error);
/* All slabs must have been given back or discarded. NULL is legal. */
void sv_slab_pool_destroy(struct sv_slab_pool *pool);

/* A slab for at least `bytes` of data. SV_ELIMIT with error->field "slab.busy" when the budget is in use now
 * (try again later), "slab" when it can never hold that much; SV_ENOMEM when the system refuses. */
SV_MUST_CHECK enum sv_status sv_slab_take(struct sv_slab_pool *pool, size_t bytes, struct sv_slab **slab,
                                          struct sv_error *error);
int sv_slab_fd(const struct sv_slab *slab); /* borrowed */
/* What the worker committed for that job: *bytes points into the mapping until the slab goes back. SV_EFORMAT
 * when the commit word or the size is not what it should be. */
SV_MUST_CHECK enum sv_status sv_slab_read(const struct sv_slab *slab, uint64_t job, const void **bytes,
                                          size_t *size, struct sv_error *error);
/* Nobody writes to it any more: the pool may use it again. */
void sv_slab_give(struct sv_slab *slab);
/* Somebody may still write to it: closed and unmapped, its memory goes with the last process that has it
 * mapped. */
void sv_slab_discard(struct sv_slab *slab);

/* Bytes of all slabs now, and of those lent. */
uint64_t sv_slab_pool_bytes(const struct sv_slab_pool *pool);
uint64_t sv_slab_pool_lent_bytes(const struct sv_slab_pool *pool);

#endif
