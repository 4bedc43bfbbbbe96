/* cache_mend.c - whether the index is sound, and how it is made anew after an owner of the lock died. */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "core/base/rng.h"
#include "core/cell/cache_private.h"

static bool entry_sound(const struct sv_cell_cache *cache, const struct sv_cache_entry *e)
{
    if (sv_cache_state(e) == SV_CACHE_FREE)
        return true;
    return sv_cache_state(e) < SV_CACHE_STATES && e->label.key != 0 && e->serial > 0 &&
           e->serial <= cache->serial && e->bytes > 0 && e->bytes % SV_CACHE_PAGE == 0 &&
           e->offset % SV_CACHE_PAGE == 0 && e->bytes <= cache->data_bytes &&
           e->offset <= cache->data_bytes - e->bytes && e->used_bytes <= e->bytes &&
           e->builder < SV_CELL_CACHE_SLOTS && isfinite(e->build_s) && e->build_s >= 0 && isfinite(e->heat) &&
           e->heat >= 0 && isfinite(e->heat_at_s) && isfinite(e->built_at_s);
}

static int by_offset(const void *a, const void *b, void *context)
{
    uint64_t x = sv_cache_entry(context, *(const uint32_t *)a)->offset;
    uint64_t y = sv_cache_entry(context, *(const uint32_t *)b)->offset;
    return (x > y) - (x < y);
}

static void derive_order(struct sv_cell_cache *cache)
{
    uint32_t *order = sv_cache_order(cache);
    cache->order_count = 0;
    for (uint32_t n = 0; n < cache->entry_count; n++)
        if (sv_cache_state(sv_cache_entry(cache, n)) != SV_CACHE_FREE)
            order[cache->order_count++] = n;
    qsort_r(order, cache->order_count, sizeof *order, by_offset, cache);
}

static bool overlaps(struct sv_cell_cache *cache)
{
    const uint32_t *order = sv_cache_order(cache);
    for (uint32_t at = 1; at < cache->order_count; at++) {
        const struct sv_cache_entry *e = sv_cache_entry(cache, order[at - 1]);
        if (e->offset + e->bytes > sv_cache_entry(cache, order[at])->offset)
            return true;
    }
    return false;
}

static bool findable(const struct sv_cache_entry *e)
{
    return sv_cache_state(e) == SV_CACHE_READY || (sv_cache_state(e) == SV_CACHE_BUILDING && !e->doomed);
}

/* Every entry that is found stands once in the chain of its bucket, and nothing else does. */
static bool chains_sound(struct sv_cell_cache *cache)
{
    uint32_t listed = 0, found = 0;
    for (uint32_t n = 0; n < cache->entry_count; n++)
        found += findable(sv_cache_entry(cache, n));
    for (uint32_t b = 0; b < cache->bucket_count; b++)
        for (uint32_t n = sv_cache_buckets(cache)[b]; n != SV_CACHE_NONE;
             n = sv_cache_entry(cache, n)->next) {
            if (n >= cache->entry_count || ++listed > found)
                return false;
            const struct sv_cache_entry *e = sv_cache_entry(cache, n);
            if (!findable(e) || (sv_mix64(e->label.key) & (cache->bucket_count - 1)) != b)
                return false;
        }
    return listed == found;
}

bool sv_cache_sound(struct sv_cell_cache *cache)
{
    uint32_t live = 0;
    for (uint32_t n = 0; n < cache->entry_count; n++) {
        const struct sv_cache_entry *e = sv_cache_entry(cache, n);
        if (!entry_sound(cache, e) || (sv_cache_state(e) == SV_CACHE_LINGERING && sv_cache_pins(e) == 0))
            return false;
        live += sv_cache_state(e) != SV_CACHE_FREE;
    }
    if (live != cache->order_count)
        return false;
    for (uint32_t at = 0; at < cache->order_count; at++) {
        uint32_t n = sv_cache_order(cache)[at];
        if (n >= cache->entry_count || sv_cache_state(sv_cache_entry(cache, n)) == SV_CACHE_FREE)
            return false;
    }
    return !overlaps(cache) && chains_sound(cache);
}

/* What stays of a cache in which something is written wild: bytes that somebody reads. */
static void empty(struct sv_cell_cache *cache)
{
    for (uint32_t n = 0; n < cache->entry_count; n++) {
        struct sv_cache_entry *e = sv_cache_entry(cache, n);
        bool kept = sv_cache_state(e) != SV_CACHE_FREE && entry_sound(cache, e);
        if (kept && sv_cache_state(e) == SV_CACHE_BUILDING)
            e->doomed = true;
        else
            sv_cache_set_state(e, kept && sv_cache_pins(e) > 0 ? SV_CACHE_LINGERING : SV_CACHE_FREE);
    }
    cache->count.emptied++;
}

/* Of two versions that may both be found (the older one's builder died, or the newer one's between two words)
 * the newer stays. */
static void drop_older(struct sv_cell_cache *cache, struct sv_cache_entry *e)
{
    uint64_t key = e->label.key;
    uint32_t at = sv_cache_buckets(cache)[sv_mix64(key) & (cache->bucket_count - 1)];
    for (; at != SV_CACHE_NONE; at = sv_cache_entry(cache, at)->next) {
        struct sv_cache_entry *other = sv_cache_entry(cache, at),
                              *older = other->serial < e->serial ? other : e;
        if (other == e || other->label.key != key || sv_cache_state(other) != SV_CACHE_READY)
            continue;
        sv_cache_set_state(older, SV_CACHE_LINGERING);
        sv_cache_unlink(cache, (uint32_t)(older - sv_cache_entry(cache, 0)));
        return;
    }
}

static void derive_chains(struct sv_cell_cache *cache)
{
    for (uint32_t b = 0; b < cache->bucket_count; b++)
        sv_cache_buckets(cache)[b] = SV_CACHE_NONE;
    for (uint32_t n = 0; n < cache->entry_count; n++)
        if (findable(sv_cache_entry(cache, n)))
            sv_cache_link(cache, n);
    for (uint32_t n = 0; n < cache->entry_count; n++)
        if (sv_cache_state(sv_cache_entry(cache, n)) == SV_CACHE_READY)
            drop_older(cache, sv_cache_entry(cache, n));
}

void sv_cache_mend(struct sv_cell_cache *cache)
{
    bool sound = true;
    for (uint32_t n = 0; n < cache->entry_count; n++)
        sound = sound && entry_sound(cache, sv_cache_entry(cache, n));
    if (sound) {
        derive_order(cache);
        sound = !overlaps(cache);
    }
    if (!sound)
        empty(cache);
    derive_order(cache);
    derive_chains(cache);
    for (uint32_t n = 0; n < cache->entry_count; n++) {
        struct sv_cache_entry *e = sv_cache_entry(cache, n);
        if (sv_cache_state(e) == SV_CACHE_LINGERING && sv_cache_pins(e) == 0)
            sv_cache_free(cache, n);
    }
    sv_cache_changed(cache);
    cache->count.owners_died++;
}
