/* cache_private.h - how the block is laid out: head, entries, hash buckets, order of pieces, then the data.
 *
 * The truth is in the entries: a piece of data belongs to an entry whose state is not FREE. Buckets, their
 * chains and `order` are derived (cache_mend.c builds them). For the cache's own files and its tests. */
#ifndef SV_CELL_CACHE_PRIVATE_H
#define SV_CELL_CACHE_PRIVATE_H

#include <pthread.h>
#include <stdatomic.h>

#include "core/cell/cache.h"

enum { SV_CACHE_PAGE = 4096 };
#define SV_CACHE_NONE UINT32_MAX
#define SV_CACHE_MAGIC UINT64_C(0x6c6c65635f76736f) /* changes with the layout */

enum sv_cache_state {
    SV_CACHE_FREE,
    SV_CACHE_BUILDING,  /* in its bucket unless doomed; the slot `builder` holds it */
    SV_CACHE_READY,     /* in its bucket */
    SV_CACHE_LINGERING, /* in no bucket; goes with its last pin */
    SV_CACHE_STATES
};

struct sv_cache_entry {
    _Atomic uint32_t state; /* enum sv_cache_state; sv_cache_set_state alone writes it */
    uint32_t next;          /* in its bucket */
    uint64_t serial;
    uint64_t offset, bytes; /* of the data; whole pages, bytes > 0 */
    uint64_t used_bytes;
    uint64_t since;
    uint64_t hits;
    double build_s, built_at_s;
    double heat, heat_at_s; /* hits, decayed until then */
    uint16_t pins[SV_CELL_CACHE_SLOTS];
    uint8_t builder;
    bool refined;
    bool doomed; /* dropped while it was being built */
    struct sv_cell_cache_label label;
};

struct sv_cell_cache {
    uint64_t magic, total_bytes; /* magic is the last word that make writes */
    pthread_mutex_t mutex;
    uint32_t entry_count, bucket_count;                             /* buckets: a power of two */
    uint64_t entries_at, buckets_at, order_at, data_at, data_bytes; /* from the block's begin */
    double half_life_s;
    uint64_t serial, generation;
    _Atomic uint64_t changes; /* sv_cell_cache_changes: read without the lock */
    uint32_t order_count;
    struct sv_cell_cache_stats count; /* only what counts up */
    struct sv_cell_admit admit;
};

static inline struct sv_cache_entry *sv_cache_entry(struct sv_cell_cache *cache, uint32_t n)
{
    return (struct sv_cache_entry *)((char *)cache + cache->entries_at) + n;
}
static inline uint32_t *sv_cache_buckets(struct sv_cell_cache *cache)
{
    return (uint32_t *)((char *)cache + cache->buckets_at);
}
/* Entries that have a piece, by its offset. */
static inline uint32_t *sv_cache_order(struct sv_cell_cache *cache)
{
    return (uint32_t *)((char *)cache + cache->order_at);
}
static inline enum sv_cache_state sv_cache_state(const struct sv_cache_entry *e)
{
    return (enum sv_cache_state)atomic_load_explicit(&e->state, memory_order_relaxed);
}
/* Stores before it stay before it, stores after it after, for whoever finds the memory of a killed process.
 */
static inline void sv_cache_set_state(struct sv_cache_entry *e, enum sv_cache_state state)
{
    atomic_thread_fence(memory_order_seq_cst);
    atomic_store_explicit(&e->state, state, memory_order_relaxed);
    atomic_thread_fence(memory_order_seq_cst);
}
/* Something may be found that was not, or no longer. After it is so. */
static inline void sv_cache_changed(struct sv_cell_cache *cache)
{
    atomic_fetch_add_explicit(&cache->changes, 1, memory_order_release);
}
unsigned sv_cache_pins(const struct sv_cache_entry *e);
double sv_cache_heat(const struct sv_cell_cache *cache, const struct sv_cache_entry *e, double now_s);

/* cache_room.c. Into and out of bucket and order; free_entry: the piece goes, state FREE first. */
void sv_cache_link(struct sv_cell_cache *cache, uint32_t n);
void sv_cache_unlink(struct sv_cell_cache *cache, uint32_t n);
void sv_cache_free(struct sv_cell_cache *cache, uint32_t n);
/* Room for that many bytes (whole pages) and a FREE entry for it; evicts what must go. Puts neither into use.
 * False, with nothing evicted for want of a stretch, where pins or size forbid. */
bool sv_cache_make_room(struct sv_cell_cache *cache, uint64_t bytes, double now_s, uint32_t *entry,
                        uint64_t *offset);
/* Takes the piece into `order`; the entry's offset and bytes are set. */
void sv_cache_order_add(struct sv_cell_cache *cache, uint32_t n);

/* cache_pages.c. Asks the system for large pages under a piece that its builder alone holds and has not written; some
 * of its bytes become 0. Those pages reach over others' pieces, which keep what is in them. Takes milliseconds: not
 * under the lock. */
void sv_cache_enlarge_pages(struct sv_cell_cache *cache, void *data, size_t bytes);

/* cache_mend.c. Whether each entry alone is sound and no two pieces overlap; then whether what is derived
 * agrees. */
bool sv_cache_sound(struct sv_cell_cache *cache);
/* Derives all anew; empties what is not pinned, where entries are not sound. The lock is held. */
void sv_cache_mend(struct sv_cell_cache *cache);

#endif
