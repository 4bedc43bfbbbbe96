/* cache.h - panels in one block of memory that processes share.
 *
 * The caller maps the block (MAP_SHARED; several GiB are legal), makes the cache in it and forks; whoever has
 * the block mapped uses it, wherever it lies: nothing in it is a pointer. A panel is a piece of bytes of any
 * size, found by its 64-bit key (lattice.h). Life of a panel: reserve (its memory is the builder's alone,
 * others are told that it is being built) -> fit (more memory, or less) -> commit (found by all from then on; its state is the last word
 * written) -> replaced by a refined one, dropped by a change of the scene, or evicted. Readers pin; what is
 * pinned keeps its bytes, though nobody may find it any more.
 *
 * Who goes when room is wanted: the worth of a panel is its build cost times its recent hits (each counts
 * half as much after half_life_s); of all stretches of memory that would hold the new one and have nothing
 * pinned in them, the one goes that loses least worth: for panels of one size that is the least valuable
 * (worth / bytes) first.
 *
 * Generations: a number that the scene has, growing with every change (PATCH), 0 at first. A panel is valid
 * from generation `since` on until it is dropped. The cache knows the latest from sv_cell_cache_drop. A
 * worker that still draws an older scene finds no newer panel and may not build any; one that is ahead of the
 * cache finds nothing until it is told.
 *
 * Crashes. A process may be killed at any instruction. One robust process-shared mutex guards the index:
 * everything under it takes microseconds, while lock-free allocation of pieces of any size would need a
 * proof. What matters of a panel is written before its state, so that after any prefix of the stores of an
 * operation the panels themselves are sound; hash chains and the order of pieces are derived, and built anew
 * by the next to lock after an owner died. A panel that is not sound then (a wild write) empties the cache,
 * but for what is pinned. Pins and reservations are counted per worker slot: who reaps a worker (never before
 * it is dead) calls sv_cell_cache_release for its slot.
 *
 * Any process, any thread. now_s: one monotonic clock for all, s. A slot is used by one process at a time.
 * When the lock is lost (another program broke the mutex) nothing is found and nothing granted. */
#ifndef SV_CELL_CACHE_H
#define SV_CELL_CACHE_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "core/base/error.h"
#include "core/cell/admit.h"
#include "core/cell/lattice.h"

enum { SV_CELL_CACHE_SLOTS = 64 };

struct sv_cell_cache; /* the block itself */

struct sv_cell_cache_options {
    uint32_t entries;   /* most panels at a time, 1 .. 2^20; each takes some 500 bytes of the block */
    double half_life_s; /* > 0 */
    struct sv_cell_admit_options admit;
};
#define SV_CELL_CACHE_OPTIONS_DEFAULT \
    ((struct sv_cell_cache_options){4096, 120, SV_CELL_ADMIT_OPTIONS_DEFAULT})

/* Makes an empty cache in `bytes` of memory aligned to 4096, which the caller keeps and unmaps; what the
 * index does not take is the budget of panels. SV_EINVAL: options or alignment; SV_ELIMIT: too small to hold
 * a page of panels; SV_EINTERNAL: the system has no robust mutex. */
SV_MUST_CHECK enum sv_status sv_cell_cache_make(void *memory, size_t bytes,
                                                const struct sv_cell_cache_options *options,
                                                struct sv_cell_cache **cache, struct sv_error *error);
/* The cache that another process made in this memory, mapped here. SV_EFORMAT: there is none, or of another
 * size. */
SV_MUST_CHECK enum sv_status sv_cell_cache_open(void *memory, size_t bytes, struct sv_cell_cache **cache,
                                                struct sv_error *error);

/* Light that casts shadows on a panel. */
struct sv_cell_light {
    struct sv_vec3 to_sun; /* unit; 0: there are no shadows */
    double texel_m;        /* of what trees' light is taken from (core/tree/shade.h); 0: of no trees */
};

/* What a panel is: its key is sv_cell_key of the parts; shell and light are what it can see, for those who drop. */
struct sv_cell_cache_label {
    uint64_t key; /* not 0 */
    struct sv_cell_key_parts parts;
    struct sv_cell_shell shell;
    struct sv_cell_light light;
    double pitch; /* of the lattice that the place is on (lattice.h) */
};

/* A panel as its reader or builder holds it. */
struct sv_cell_cache_panel {
    uint32_t entry;
    uint64_t serial; /* tells what the entry holds from what it held before */
    void *data;      /* aligned to 4096, in this process's mapping; readers only read */
    size_t bytes;
    bool refined;
};

enum sv_cell_cache_answer {
    SV_CELL_CACHE_HIT, /* there, and pinned (find); there already (reserve: nothing is granted or pinned) */
    SV_CELL_CACHE_GRANTED,  /* reserve: build into panel->data, then commit or unpin */
    SV_CELL_CACHE_BUILDING, /* somebody else builds it */
    SV_CELL_CACHE_MISS,     /* find: not there */
    SV_CELL_CACHE_STALE,    /* reserve: not of the generation that the cache knows */
    SV_CELL_CACHE_FULL,     /* reserve: larger than the budget, or pins leave no room now */
};

/* Finds and pins. HIT, BUILDING or MISS; *panel is written on HIT only. */
enum sv_cell_cache_answer sv_cell_cache_find(struct sv_cell_cache *cache, unsigned slot, uint64_t key,
                                             uint64_t generation, double now_s,
                                             struct sv_cell_cache_panel *panel);
/* The serial of the panel that would be found; 0: none would. Renews its worth as finding does, but pins and
 * counts nothing: for who has a copy of it. */
uint64_t sv_cell_cache_serial(struct sv_cell_cache *cache, uint64_t key, uint64_t generation, double now_s);
/* A number that is another one whenever what is found in the cache may be other than before. */
uint64_t sv_cell_cache_changes(const struct sv_cell_cache *cache);
/* Memory for a panel of that many bytes, whatever is in it. refined: a better version of a panel that may be
 * there; it is found until the new one is committed. HIT (refined: only when a refined one is there),
 * GRANTED, BUILDING, STALE or FULL; *panel is written on GRANTED only. */
enum sv_cell_cache_answer sv_cell_cache_reserve(struct sv_cell_cache *cache, unsigned slot,
                                                const struct sv_cell_cache_label *label, size_t bytes,
                                                bool refined, uint64_t generation, double now_s,
                                                struct sv_cell_cache_panel *panel);
/* Exchanges a reservation for one of that many bytes, whatever is in them: how many a panel takes is known when it is
 * drawn. Its bytes lie in large pages then, where the system has some and the block is mapped at a multiple of 2 MiB.
 * False, and nothing is held any more, where there is no room for it, it was dropped meanwhile, or the slot does not
 * hold it. */
bool sv_cell_cache_fit(struct sv_cell_cache *cache, unsigned slot, struct sv_cell_cache_panel *panel, size_t bytes,
                       double now_s);
/* The panel is complete: used_bytes (<= panel->bytes) of it are kept, the rest is free again. build_s: what
 * it cost, >= 0. The builder holds a pin on it from now on. False where nobody else will find it: it was
 * dropped while it was built. */
bool sv_cell_cache_commit(struct sv_cell_cache *cache, unsigned slot, const struct sv_cell_cache_panel *panel,
                          size_t used_bytes, double build_s, double now_s);
/* Gives back a pin, or a reservation that comes to nothing. False for what the slot does not hold (it was
 * released). */
bool sv_cell_cache_unpin(struct sv_cell_cache *cache, unsigned slot, const struct sv_cell_cache_panel *panel);
/* All pins and reservations of a slot whose process is dead; how many there were. */
size_t sv_cell_cache_release(struct sv_cell_cache *cache, unsigned slot);

/* A panel as it is listed. */
struct sv_cell_cache_item {
    struct sv_cell_cache_label label;
    uint64_t bytes; /* that it takes, whole pages */
    uint64_t since; /* generation */
    uint64_t hits;
    double build_s, age_s; /* age: since commit; being built: 0 */
    double worth;          /* s; build cost times recent hits */
    bool refined, building;
    unsigned pins;
};

/* The scene has a new generation: drops every panel, built or being built, of an older one for which `hit` is
 * true. `hit` runs under the lock: it may not call the cache. Returns how many were dropped. Who dies in it
 * leaves panels that should have gone: whoever takes over does it again. */
size_t sv_cell_cache_drop(struct sv_cell_cache *cache, uint64_t generation, double now_s,
                          bool (*hit)(void *context, const struct sv_cell_cache_item *item), void *context);
/* The same for a list of keys. */
size_t sv_cell_cache_drop_keys(struct sv_cell_cache *cache, uint64_t generation, const uint64_t *keys,
                               size_t count);

/* A change came to nothing: whoever made it died after dropping. The scene has that generation again; panels of later
 * ones, if any, are dropped. */
void sv_cell_cache_turn_back(struct sv_cell_cache *cache, uint64_t generation);

/* Drops all that are there or being built, whatever their generation, which stays; returns how many. */
size_t sv_cell_cache_clear(struct sv_cell_cache *cache);

/* Copies up to `most` items that can be found or are being built, in no order; returns how many there are. */
size_t sv_cell_cache_list(struct sv_cell_cache *cache, double now_s, struct sv_cell_cache_item *items,
                          size_t most);

struct sv_cell_cache_stats {
    uint64_t hits, misses, waits;  /* finds: waits met a panel being built */
    uint64_t builds, refined;      /* commits; of these, refined */
    uint64_t evictions, drops;     /* panels */
    uint64_t full;                 /* reservations refused for want of room */
    uint64_t owners_died, emptied; /* times the index was built anew; of these, with nothing kept */
    uint64_t generation;
    uint64_t budget_bytes, used_bytes, pinned_bytes;
    uint32_t panels, building, lingering; /* found; being built; found no more, but pinned */
};
void sv_cell_cache_stats(struct sv_cell_cache *cache, struct sv_cell_cache_stats *stats);

/* admit.h's decision and measurements, shared by all who use this cache. */
struct sv_cell_admit_answer sv_cell_cache_admit(struct sv_cell_cache *cache,
                                                const struct sv_cell_admit_request *request);
void sv_cell_cache_drawn(struct sv_cell_cache *cache, int64_t pixels, int level, double seconds);
void sv_cell_cache_built(struct sv_cell_cache *cache, int k, bool ground, double panels, double seconds);

/* Whether the index is what it should be; for tests and for who suspects. Changes nothing. */
bool sv_cell_cache_check(struct sv_cell_cache *cache);

#endif
