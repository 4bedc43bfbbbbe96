/* cache.c - the lock, and a panel's life under it. */
#include "core/cell/cache.h"

#include <assert.h>
#include <errno.h>
#include <math.h>
#include <string.h>

#include "core/base/rng.h"
#include "core/cell/cache_private.h"

static uint64_t aligned(uint64_t bytes, uint64_t step)
{
    return (bytes + step - 1) / step * step;
}

/* Fills in where all parts lie; false when no page is left for data. */
static bool lay_out(struct sv_cell_cache *cache, size_t bytes, uint32_t entries)
{
    cache->entry_count = entries;
    cache->bucket_count = 1;
    while (cache->bucket_count < entries)
        cache->bucket_count *= 2;
    cache->entries_at = aligned(sizeof *cache, 64);
    cache->buckets_at = aligned(cache->entries_at + entries * sizeof(struct sv_cache_entry), 64);
    cache->order_at = cache->buckets_at + cache->bucket_count * sizeof(uint32_t);
    cache->data_at = aligned(cache->order_at + entries * sizeof(uint32_t), SV_CACHE_PAGE);
    if (bytes < cache->data_at + SV_CACHE_PAGE)
        return false;
    cache->total_bytes = bytes;
    cache->data_bytes = (bytes - cache->data_at) / SV_CACHE_PAGE * SV_CACHE_PAGE;
    return true;
}

static bool make_mutex(pthread_mutex_t *mutex)
{
    pthread_mutexattr_t kind;
    if (pthread_mutexattr_init(&kind) != 0)
        return false;
    bool made = pthread_mutexattr_setpshared(&kind, PTHREAD_PROCESS_SHARED) == 0 &&
                pthread_mutexattr_setrobust(&kind, PTHREAD_MUTEX_ROBUST) == 0 &&
                pthread_mutex_init(mutex, &kind) == 0;
    pthread_mutexattr_destroy(&kind);
    return made;
}

enum sv_status sv_cell_cache_make(void *memory, size_t bytes, const struct sv_cell_cache_options *options,
                                  struct sv_cell_cache **cache, struct sv_error *error)
{
    if ((uintptr_t)memory % SV_CACHE_PAGE != 0)
        return sv_fail(error, SV_EINVAL, "memory", "the block is not aligned to %d", SV_CACHE_PAGE);
    if (options->entries < 1 || options->entries > 1u << 20)
        return sv_fail(error, SV_EINVAL, "entries", "%u is outside 1 .. %u", options->entries, 1u << 20);
    if (!(options->half_life_s > 0))
        return sv_fail(error, SV_EINVAL, "half_life_s", "%g is not above 0", options->half_life_s);
    struct sv_cell_cache head = {.half_life_s = options->half_life_s}, *made = memory;
    if (!lay_out(&head, bytes, options->entries))
        return sv_fail(error, SV_ELIMIT, "bytes", "%zu bytes leave no room for panels: %llu go to the index",
                       bytes, (unsigned long long)head.data_at);
    *made = head;
    sv_cell_admit_init(&made->admit, &options->admit);
    if (!make_mutex(&made->mutex))
        return sv_fail(error, SV_EINTERNAL, "mutex", "the system gives no robust mutex between processes");
    memset((char *)memory + head.entries_at, 0, head.buckets_at - head.entries_at);
    for (uint32_t b = 0; b < head.bucket_count; b++)
        sv_cache_buckets(made)[b] = SV_CACHE_NONE;
    atomic_thread_fence(memory_order_seq_cst);
    made->magic = SV_CACHE_MAGIC;
    *cache = made;
    return SV_OK;
}

enum sv_status sv_cell_cache_open(void *memory, size_t bytes, struct sv_cell_cache **cache,
                                  struct sv_error *error)
{
    struct sv_cell_cache *made = memory;
    if ((uintptr_t)memory % SV_CACHE_PAGE != 0 || bytes < sizeof *made || made->magic != SV_CACHE_MAGIC ||
        made->total_bytes != bytes)
        return sv_fail(error, SV_EFORMAT, "memory", "no cache of %zu bytes is in this block", bytes);
    *cache = made;
    return SV_OK;
}

/* The next after an owner that died mends what that one left. */
static bool lock(struct sv_cell_cache *cache)
{
    int code = pthread_mutex_lock(&cache->mutex);
    if (code != EOWNERDEAD)
        return code == 0;
    sv_cache_mend(cache);
    return pthread_mutex_consistent(&cache->mutex) == 0;
}

static void unlock(struct sv_cell_cache *cache)
{
    pthread_mutex_unlock(&cache->mutex);
}

static struct sv_cache_entry *look_up(struct sv_cell_cache *cache, uint64_t key, enum sv_cache_state state)
{
    uint32_t n = sv_cache_buckets(cache)[sv_mix64(key) & (cache->bucket_count - 1)];
    for (; n != SV_CACHE_NONE; n = sv_cache_entry(cache, n)->next) {
        struct sv_cache_entry *e = sv_cache_entry(cache, n);
        if (e->label.key == key && sv_cache_state(e) == state)
            return e;
    }
    return NULL;
}

static uint32_t index_of(struct sv_cell_cache *cache, const struct sv_cache_entry *e)
{
    return (uint32_t)(e - sv_cache_entry(cache, 0));
}

static void hand_out(struct sv_cell_cache *cache, const struct sv_cache_entry *e, uint64_t bytes,
                     struct sv_cell_cache_panel *panel)
{
    *panel = (struct sv_cell_cache_panel){index_of(cache, e), e->serial,
                                          (char *)cache + cache->data_at + e->offset, bytes, e->refined};
}

/* Is the panel that is READY of that generation? */
static bool is_valid(const struct sv_cell_cache *cache, const struct sv_cache_entry *e, uint64_t generation)
{
    return e && e->since <= generation && generation <= cache->generation;
}

static void warm(const struct sv_cell_cache *cache, struct sv_cache_entry *e, double now_s)
{
    e->heat = sv_cache_heat(cache, e, now_s) + 1;
    e->heat_at_s = now_s;
}

uint64_t sv_cell_cache_serial(struct sv_cell_cache *cache, uint64_t key, uint64_t generation, double now_s)
{
    assert(isfinite(now_s));
    if (!lock(cache))
        return 0;
    struct sv_cache_entry *e = look_up(cache, key, SV_CACHE_READY);
    uint64_t serial = is_valid(cache, e, generation) ? e->serial : 0;
    if (serial)
        warm(cache, e, now_s);
    unlock(cache);
    return serial;
}

uint64_t sv_cell_cache_changes(const struct sv_cell_cache *cache)
{
    return atomic_load_explicit(&cache->changes, memory_order_acquire);
}

enum sv_cell_cache_answer sv_cell_cache_find(struct sv_cell_cache *cache, unsigned slot, uint64_t key,
                                             uint64_t generation, double now_s,
                                             struct sv_cell_cache_panel *panel)
{
    assert(slot < SV_CELL_CACHE_SLOTS && isfinite(now_s));
    if (!lock(cache))
        return SV_CELL_CACHE_MISS;
    enum sv_cell_cache_answer answer = SV_CELL_CACHE_MISS;
    struct sv_cache_entry *e = look_up(cache, key, SV_CACHE_READY);
    if (is_valid(cache, e, generation) && e->pins[slot] < UINT16_MAX) {
        answer = SV_CELL_CACHE_HIT;
        e->pins[slot]++;
        warm(cache, e, now_s);
        e->hits++;
        cache->count.hits++;
        hand_out(cache, e, e->used_bytes, panel);
    } else if (!e && look_up(cache, key, SV_CACHE_BUILDING)) {
        answer = SV_CELL_CACHE_BUILDING;
        cache->count.waits++;
    } else {
        cache->count.misses++;
    }
    unlock(cache);
    return answer;
}

/* Why there is nothing to build, or GRANTED. */
static enum sv_cell_cache_answer may_build(struct sv_cell_cache *cache, uint64_t key, bool refined,
                                           uint64_t generation)
{
    const struct sv_cache_entry *e = look_up(cache, key, SV_CACHE_READY);
    if (generation != cache->generation)
        return SV_CELL_CACHE_STALE;
    if (e && (e->refined || !refined))
        return SV_CELL_CACHE_HIT;
    return look_up(cache, key, SV_CACHE_BUILDING) ? SV_CELL_CACHE_BUILDING : SV_CELL_CACHE_GRANTED;
}

/* What a reservation is for. */
struct order {
    unsigned slot;
    const struct sv_cell_cache_label *label;
    bool refined;
    uint64_t since;
};

/* Memory for a panel, reserved; false where there is none. */
static bool take(struct sv_cell_cache *cache, const struct order *order, size_t bytes, double now_s,
                 struct sv_cell_cache_panel *panel)
{
    uint64_t wanted = bytes > cache->data_bytes ? UINT64_MAX : aligned(bytes + !bytes, SV_CACHE_PAGE), offset;
    uint32_t n;
    if (!sv_cache_make_room(cache, wanted, now_s, &n, &offset)) {
        cache->count.full++;
        return false;
    }
    struct sv_cache_entry *e = sv_cache_entry(cache, n);
    e->serial = ++cache->serial;
    e->offset = offset;
    e->bytes = wanted;
    e->used_bytes = 0;
    e->hits = 0;
    e->build_s = e->built_at_s = e->heat = e->heat_at_s = 0;
    memset(e->pins, 0, sizeof e->pins);
    e->doomed = false;
    e->label = *order->label;
    e->builder = (uint8_t)order->slot;
    e->refined = order->refined;
    e->since = order->since;
    sv_cache_set_state(e, SV_CACHE_BUILDING);
    sv_cache_link(cache, n);
    sv_cache_order_add(cache, n);
    hand_out(cache, e, bytes, panel);
    return true;
}

enum sv_cell_cache_answer sv_cell_cache_reserve(struct sv_cell_cache *cache, unsigned slot,
                                                const struct sv_cell_cache_label *label, size_t bytes,
                                                bool refined, uint64_t generation, double now_s,
                                                struct sv_cell_cache_panel *panel)
{
    assert(slot < SV_CELL_CACHE_SLOTS && label->key != 0);
    if (!lock(cache))
        return SV_CELL_CACHE_FULL;
    const struct order order = {slot, label, refined, generation};
    enum sv_cell_cache_answer answer = may_build(cache, label->key, refined, generation);
    if (answer == SV_CELL_CACHE_GRANTED && !take(cache, &order, bytes, now_s, panel))
        answer = SV_CELL_CACHE_FULL;
    unlock(cache);
    return answer;
}

/* The entry, if it still holds what was handed out. */
static struct sv_cache_entry *held(struct sv_cell_cache *cache, const struct sv_cell_cache_panel *panel)
{
    if (panel->entry >= cache->entry_count)
        return NULL;
    struct sv_cache_entry *e = sv_cache_entry(cache, panel->entry);
    return sv_cache_state(e) != SV_CACHE_FREE && e->serial == panel->serial ? e : NULL;
}

/* No longer found; its bytes stay while somebody reads them. */
static void retire(struct sv_cell_cache *cache, struct sv_cache_entry *e)
{
    uint32_t n = index_of(cache, e);
    if (sv_cache_pins(e) == 0) {
        sv_cache_free(cache, n);
        return;
    }
    sv_cache_set_state(e, SV_CACHE_LINGERING);
    sv_cache_unlink(cache, n);
    sv_cache_changed(cache);
}

static bool builds(const struct sv_cache_entry *e, unsigned slot)
{
    return e && sv_cache_state(e) == SV_CACHE_BUILDING && e->builder == slot;
}

/* The old piece goes first: who is killed in between leaves nothing, as one that was killed before. */
bool sv_cell_cache_fit(struct sv_cell_cache *cache, unsigned slot, struct sv_cell_cache_panel *panel,
                       size_t bytes, double now_s)
{
    assert(slot < SV_CELL_CACHE_SLOTS && isfinite(now_s));
    if (!lock(cache))
        return false;
    struct sv_cache_entry *e = held(cache, panel);
    bool fits = false;
    if (builds(e, slot)) {
        const struct sv_cell_cache_label label = e->label;
        const struct order order = {slot, &label, e->refined, e->since};
        sv_cache_free(cache, panel->entry);
        fits = !e->doomed && take(cache, &order, bytes, now_s, panel);
    }
    unlock(cache);
    if (fits)
        sv_cache_enlarge_pages(cache, panel->data, bytes);
    return fits;
}

bool sv_cell_cache_commit(struct sv_cell_cache *cache, unsigned slot, const struct sv_cell_cache_panel *panel,
                          size_t used_bytes, double build_s, double now_s)
{
    assert(slot < SV_CELL_CACHE_SLOTS && used_bytes <= panel->bytes && build_s >= 0 &&
           isfinite(build_s + now_s));
    if (!lock(cache))
        return false;
    struct sv_cache_entry *e = held(cache, panel);
    bool found = builds(e, slot) && !e->doomed;
    if (builds(e, slot)) {
        struct sv_cache_entry *old = found ? look_up(cache, e->label.key, SV_CACHE_READY) : NULL;
        e->used_bytes = used_bytes;
        e->bytes = aligned(used_bytes + !used_bytes, SV_CACHE_PAGE);
        e->build_s = build_s;
        e->built_at_s = e->heat_at_s = now_s;
        e->heat = 1 + (old ? sv_cache_heat(cache, old, now_s) : 0); /* wanted as the one it replaces */
        e->hits = old ? old->hits : 0;
        e->pins[slot] = 1;
        sv_cache_set_state(e, found ? SV_CACHE_READY : SV_CACHE_LINGERING);
        sv_cache_changed(cache);
        if (old)
            retire(cache, old);
        cache->count.builds++;
        cache->count.refined += e->refined;
    }
    unlock(cache);
    return found;
}

bool sv_cell_cache_unpin(struct sv_cell_cache *cache, unsigned slot, const struct sv_cell_cache_panel *panel)
{
    assert(slot < SV_CELL_CACHE_SLOTS);
    if (!lock(cache))
        return false;
    struct sv_cache_entry *e = held(cache, panel);
    bool did = true;
    if (builds(e, slot))
        sv_cache_free(cache, panel->entry);
    else if (e && e->pins[slot] > 0)
        e->pins[slot]--;
    else
        did = false;
    if (did && sv_cache_state(e) == SV_CACHE_LINGERING && sv_cache_pins(e) == 0)
        sv_cache_free(cache, panel->entry);
    unlock(cache);
    return did;
}

size_t sv_cell_cache_release(struct sv_cell_cache *cache, unsigned slot)
{
    assert(slot < SV_CELL_CACHE_SLOTS);
    size_t released = 0;
    if (!lock(cache))
        return 0;
    for (uint32_t n = 0; n < cache->entry_count; n++) {
        struct sv_cache_entry *e = sv_cache_entry(cache, n);
        if (sv_cache_state(e) == SV_CACHE_FREE)
            continue;
        released += e->pins[slot] + (builds(e, slot) ? 1u : 0u);
        e->pins[slot] = 0;
        if (builds(e, slot) || (sv_cache_state(e) == SV_CACHE_LINGERING && sv_cache_pins(e) == 0))
            sv_cache_free(cache, n);
    }
    unlock(cache);
    return released;
}

static struct sv_cell_cache_item item_of(const struct sv_cell_cache *cache, const struct sv_cache_entry *e,
                                         double now_s)
{
    bool building = sv_cache_state(e) == SV_CACHE_BUILDING;
    return (struct sv_cell_cache_item){.label = e->label,
                                       .bytes = e->bytes,
                                       .since = e->since,
                                       .hits = e->hits,
                                       .build_s = e->build_s,
                                       .age_s = building ? 0 : now_s - e->built_at_s,
                                       .worth = e->build_s * sv_cache_heat(cache, e, now_s),
                                       .refined = e->refined,
                                       .building = building,
                                       .pins = sv_cache_pins(e)};
}

static bool listed(const struct sv_cache_entry *e)
{
    return sv_cache_state(e) == SV_CACHE_READY || (sv_cache_state(e) == SV_CACHE_BUILDING && !e->doomed);
}

/* A panel being built goes on being built, for its builder alone. */
static void doom(struct sv_cell_cache *cache, struct sv_cache_entry *e)
{
    cache->count.drops++;
    if (sv_cache_state(e) != SV_CACHE_BUILDING) {
        retire(cache, e);
        return;
    }
    e->doomed = true;
    sv_cache_unlink(cache, index_of(cache, e));
}

static void advance(struct sv_cell_cache *cache, uint64_t generation)
{
    if (generation > cache->generation)
        cache->generation = generation;
    sv_cache_changed(cache);
}

size_t sv_cell_cache_drop(struct sv_cell_cache *cache, uint64_t generation, double now_s,
                          bool (*hit)(void *context, const struct sv_cell_cache_item *item), void *context)
{
    size_t dropped = 0;
    if (!lock(cache))
        return 0;
    advance(cache, generation);
    for (uint32_t n = 0; n < cache->entry_count; n++) {
        struct sv_cache_entry *e = sv_cache_entry(cache, n);
        if (!listed(e) || e->since >= generation)
            continue;
        struct sv_cell_cache_item item = item_of(cache, e, now_s);
        if (!hit(context, &item))
            continue;
        doom(cache, e);
        dropped++;
    }
    unlock(cache);
    return dropped;
}

size_t sv_cell_cache_drop_keys(struct sv_cell_cache *cache, uint64_t generation, const uint64_t *keys,
                               size_t count)
{
    static const enum sv_cache_state found[] = {SV_CACHE_READY, SV_CACHE_BUILDING};
    size_t dropped = 0;
    if (!lock(cache))
        return 0;
    advance(cache, generation);
    for (size_t k = 0; k < 2 * count; k++) {
        struct sv_cache_entry *e = look_up(cache, keys[k / 2], found[k % 2]);
        if (!e || e->since >= generation)
            continue;
        doom(cache, e);
        dropped++;
    }
    unlock(cache);
    return dropped;
}

void sv_cell_cache_turn_back(struct sv_cell_cache *cache, uint64_t generation)
{
    if (!lock(cache))
        return;
    for (uint32_t n = 0; n < cache->entry_count; n++) {
        struct sv_cache_entry *e = sv_cache_entry(cache, n);
        if (listed(e) && e->since > generation)
            doom(cache, e);
    }
    if (generation < cache->generation)
        cache->generation = generation;
    sv_cache_changed(cache);
    unlock(cache);
}

size_t sv_cell_cache_clear(struct sv_cell_cache *cache)
{
    size_t dropped = 0;
    if (!lock(cache))
        return 0;
    for (uint32_t n = 0; n < cache->entry_count; n++) {
        struct sv_cache_entry *e = sv_cache_entry(cache, n);
        if (!listed(e))
            continue;
        doom(cache, e);
        dropped++;
    }
    unlock(cache);
    return dropped;
}

size_t sv_cell_cache_list(struct sv_cell_cache *cache, double now_s, struct sv_cell_cache_item *items,
                          size_t most)
{
    size_t count = 0;
    if (!lock(cache))
        return 0;
    for (uint32_t at = 0; at < cache->order_count; at++) {
        const struct sv_cache_entry *e = sv_cache_entry(cache, sv_cache_order(cache)[at]);
        if (!listed(e))
            continue;
        if (count < most)
            items[count] = item_of(cache, e, now_s);
        count++;
    }
    unlock(cache);
    return count;
}

void sv_cell_cache_stats(struct sv_cell_cache *cache, struct sv_cell_cache_stats *stats)
{
    *stats = (struct sv_cell_cache_stats){0};
    if (!lock(cache))
        return;
    *stats = cache->count;
    stats->generation = cache->generation;
    stats->budget_bytes = cache->data_bytes;
    for (uint32_t at = 0; at < cache->order_count; at++) {
        const struct sv_cache_entry *e = sv_cache_entry(cache, sv_cache_order(cache)[at]);
        bool building = sv_cache_state(e) == SV_CACHE_BUILDING;
        stats->used_bytes += e->bytes;
        stats->pinned_bytes += building || sv_cache_pins(e) > 0 ? e->bytes : 0;
        stats->panels += sv_cache_state(e) == SV_CACHE_READY;
        stats->building += building;
        stats->lingering += sv_cache_state(e) == SV_CACHE_LINGERING;
    }
    unlock(cache);
}

struct sv_cell_admit_answer sv_cell_cache_admit(struct sv_cell_cache *cache,
                                                const struct sv_cell_admit_request *request)
{
    if (!lock(cache))
        return (struct sv_cell_admit_answer){0};
    struct sv_cell_admit_answer answer = sv_cell_admit(&cache->admit, request);
    unlock(cache);
    return answer;
}

void sv_cell_cache_drawn(struct sv_cell_cache *cache, int64_t pixels, int level, double seconds)
{
    if (!lock(cache))
        return;
    sv_cell_admit_drawn(&cache->admit, pixels, level, seconds);
    unlock(cache);
}

void sv_cell_cache_built(struct sv_cell_cache *cache, int k, bool ground, double panels, double seconds)
{
    if (!lock(cache))
        return;
    sv_cell_admit_built(&cache->admit, k, ground, panels, seconds);
    unlock(cache);
}

bool sv_cell_cache_check(struct sv_cell_cache *cache)
{
    if (!lock(cache))
        return false;
    bool sound = sv_cache_sound(cache);
    unlock(cache);
    return sound;
}
