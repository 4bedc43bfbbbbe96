/* cache_room.c - where a new panel goes, and who goes for it. */
#include <assert.h>
#include <math.h>
#include <string.h>

#include "core/base/rng.h"
#include "core/cell/cache_private.h"

unsigned sv_cache_pins(const struct sv_cache_entry *e)
{
    unsigned pins = 0;
    for (int slot = 0; slot < SV_CELL_CACHE_SLOTS; slot++)
        pins += e->pins[slot];
    return pins;
}

double sv_cache_heat(const struct sv_cell_cache *cache, const struct sv_cache_entry *e, double now_s)
{
    return e->heat * exp2(fmin(0, (e->heat_at_s - now_s) / cache->half_life_s));
}

static uint32_t *bucket_of(struct sv_cell_cache *cache, uint64_t key)
{
    return &sv_cache_buckets(cache)[sv_mix64(key) & (cache->bucket_count - 1)];
}

void sv_cache_link(struct sv_cell_cache *cache, uint32_t n)
{
    struct sv_cache_entry *e = sv_cache_entry(cache, n);
    uint32_t *head = bucket_of(cache, e->label.key);
    e->next = *head;
    *head = n;
}

void sv_cache_unlink(struct sv_cell_cache *cache, uint32_t n)
{
    struct sv_cache_entry *e = sv_cache_entry(cache, n);
    for (uint32_t *at = bucket_of(cache, e->label.key); *at != SV_CACHE_NONE;
         at = &sv_cache_entry(cache, *at)->next)
        if (*at == n) {
            *at = e->next;
            return;
        }
}

/* The first in order whose piece begins at or after offset. */
static uint32_t order_find(struct sv_cell_cache *cache, uint64_t offset)
{
    const uint32_t *order = sv_cache_order(cache);
    uint32_t low = 0, high = cache->order_count;
    while (low < high) {
        uint32_t middle = low + (high - low) / 2;
        if (sv_cache_entry(cache, order[middle])->offset < offset)
            low = middle + 1;
        else
            high = middle;
    }
    return low;
}

void sv_cache_order_add(struct sv_cell_cache *cache, uint32_t n)
{
    uint32_t *order = sv_cache_order(cache), at = order_find(cache, sv_cache_entry(cache, n)->offset);
    memmove(order + at + 1, order + at, (cache->order_count - at) * sizeof *order);
    order[at] = n;
    cache->order_count++;
}

void sv_cache_free(struct sv_cell_cache *cache, uint32_t n)
{
    struct sv_cache_entry *e = sv_cache_entry(cache, n);
    sv_cache_set_state(e, SV_CACHE_FREE);
    sv_cache_unlink(cache, n);
    sv_cache_changed(cache);
    memset(e->pins, 0, sizeof e->pins);
    uint32_t *order = sv_cache_order(cache), at = order_find(cache, e->offset);
    while (at < cache->order_count && order[at] != n) /* pieces that a wild write laid over each other */
        at++;
    if (at == cache->order_count)
        return;
    cache->order_count--;
    memmove(order + at, order + at + 1, (cache->order_count - at) * sizeof *order);
}

static bool evictable(const struct sv_cache_entry *e)
{
    return sv_cache_state(e) == SV_CACHE_READY && sv_cache_pins(e) == 0;
}

static double worth(const struct sv_cell_cache *cache, const struct sv_cache_entry *e, double now_s)
{
    return e->build_s * sv_cache_heat(cache, e, now_s);
}

/* A stretch of memory between two pieces that stay, or the ends: the pieces first .. end - 1 of the order go.
 */
struct stretch {
    uint32_t first, end;
    uint64_t offset, bytes;
    double worth; /* that is lost */
};

static uint64_t end_of(struct sv_cell_cache *cache, uint32_t at)
{
    const struct sv_cache_entry *e = sv_cache_entry(cache, sv_cache_order(cache)[at]);
    return e->offset + e->bytes;
}

static uint64_t begin_of(struct sv_cell_cache *cache, uint32_t at)
{
    return at < cache->order_count ? sv_cache_entry(cache, sv_cache_order(cache)[at])->offset
                                   : cache->data_bytes;
}

static bool better(const struct stretch *a, const struct stretch *b)
{
    if (a->worth != b->worth)
        return a->worth < b->worth;
    if (a->end - a->first != b->end - b->first)
        return a->end - a->first < b->end - b->first;
    return a->bytes < b->bytes; /* the tightest */
}

/* For each first piece that could go, the fewest after it that make enough room. Sums are taken anew for
 * each: no rounding is carried along, and stretches are a few pieces long. */
static bool best_stretch(struct sv_cell_cache *cache, uint64_t bytes, double now_s, struct stretch *best)
{
    bool found = false;
    uint64_t reach = 0; /* where all pieces before `first` end */
    for (uint32_t first = 0; first <= cache->order_count; first++) {
        if (first > 0 && end_of(cache, first - 1) > reach)
            reach = end_of(cache, first - 1);
        struct stretch s = {.first = first, .end = first, .offset = reach};
        for (;; s.end++) {
            uint64_t end = begin_of(cache, s.end);
            s.bytes = end > s.offset ? end - s.offset : 0;
            if (s.bytes >= bytes || s.end == cache->order_count || (found && s.worth > best->worth))
                break;
            const struct sv_cache_entry *e = sv_cache_entry(cache, sv_cache_order(cache)[s.end]);
            if (!evictable(e))
                break;
            s.worth += worth(cache, e, now_s);
        }
        if (s.bytes >= bytes && (!found || better(&s, best))) {
            *best = s;
            found = true;
        }
    }
    return found;
}

static uint32_t free_entry(struct sv_cell_cache *cache)
{
    uint32_t n = 0;
    while (n < cache->entry_count && sv_cache_state(sv_cache_entry(cache, n)) != SV_CACHE_FREE)
        n++;
    return n < cache->entry_count ? n : SV_CACHE_NONE;
}

static void evict(struct sv_cell_cache *cache, uint32_t n)
{
    sv_cache_free(cache, n);
    cache->count.evictions++;
}

/* The least worth, for an entry alone. */
static bool evict_one(struct sv_cell_cache *cache, double now_s)
{
    uint32_t least = SV_CACHE_NONE;
    double least_worth = INFINITY;
    for (uint32_t n = 0; n < cache->entry_count; n++) {
        const struct sv_cache_entry *e = sv_cache_entry(cache, n);
        double w = evictable(e) ? worth(cache, e, now_s) : INFINITY;
        if (w < least_worth) {
            least_worth = w;
            least = n;
        }
    }
    if (least != SV_CACHE_NONE)
        evict(cache, least);
    return least != SV_CACHE_NONE;
}

bool sv_cache_make_room(struct sv_cell_cache *cache, uint64_t bytes, double now_s, uint32_t *entry,
                        uint64_t *offset)
{
    struct stretch s;
    if (!best_stretch(cache, bytes, now_s, &s))
        return false;
    if (s.first == s.end && free_entry(cache) == SV_CACHE_NONE) {
        if (!evict_one(cache, now_s) || !best_stretch(cache, bytes, now_s, &s))
            return false;
    }
    for (uint32_t n = s.end; n > s.first; n--)
        evict(cache, sv_cache_order(cache)[n - 1]);
    *entry = free_entry(cache);
    *offset = s.offset;
    assert(*entry != SV_CACHE_NONE);
    return true;
}
