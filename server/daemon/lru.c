#include "server/daemon/lru.h"

#include <stdlib.h>
#include <string.h>

#include "core/base/hash.h"

struct entry {
    struct entry *next;          /* in its bucket */
    struct entry *newer, *older; /* in order of use */
    void *value;
    uint64_t cost, hash;
    char key[];
};

struct sv_lru {
    struct entry **buckets;
    size_t bucket_count, count; /* bucket_count is a power of two */
    struct entry *newest, *oldest;
    uint64_t budget, cost;
    uint64_t seed; /* keys come from clients: they must not choose their bucket */
    sv_lru_free free_value;
};

struct sv_lru *sv_lru_create(uint64_t budget, sv_lru_free free_value)
{
    struct sv_lru *lru = calloc(1, sizeof *lru);
    if (!lru)
        return NULL;
    lru->bucket_count = 64;
    lru->buckets = calloc(lru->bucket_count, sizeof *lru->buckets);
    if (!lru->buckets) {
        free(lru);
        return NULL;
    }
    lru->budget = budget;
    lru->free_value = free_value;
    lru->seed = sv_mix64((uint64_t)(uintptr_t)lru->buckets ^ (uint64_t)(uintptr_t)lru << 17);
    return lru;
}

static struct entry **find(const struct sv_lru *lru, const char *key, uint64_t hash)
{
    struct entry **at = &lru->buckets[hash & (lru->bucket_count - 1)];
    while (*at && ((*at)->hash != hash || strcmp((*at)->key, key) != 0))
        at = &(*at)->next;
    return at;
}

static uint64_t hash_of(const struct sv_lru *lru, const char *key)
{
    return sv_hash_done(sv_hash_string(SV_HASH_INIT ^ lru->seed, key));
}

static void unlink_use(struct sv_lru *lru, struct entry *e)
{
    *(e->newer ? &e->newer->older : &lru->newest) = e->older;
    *(e->older ? &e->older->newer : &lru->oldest) = e->newer;
    e->newer = e->older = NULL;
}

static void link_newest(struct sv_lru *lru, struct entry *e)
{
    e->older = lru->newest;
    e->newer = NULL;
    *(lru->newest ? &lru->newest->newer : &lru->oldest) = e;
    lru->newest = e;
}

static void drop(struct sv_lru *lru, struct entry **at)
{
    struct entry *e = *at;
    *at = e->next;
    unlink_use(lru, e);
    lru->cost -= e->cost;
    lru->count--;
    if (lru->free_value)
        lru->free_value(e->value);
    free(e);
}

static void grow(struct sv_lru *lru)
{
    size_t wider = 2 * lru->bucket_count;
    struct entry **buckets = calloc(wider, sizeof *buckets);
    if (!buckets)
        return; /* longer chains, same answers */
    for (size_t i = 0; i < lru->bucket_count; i++)
        while (lru->buckets[i]) {
            struct entry *e = lru->buckets[i];
            lru->buckets[i] = e->next;
            e->next = buckets[e->hash & (wider - 1)];
            buckets[e->hash & (wider - 1)] = e;
        }
    free(lru->buckets);
    lru->buckets = buckets;
    lru->bucket_count = wider;
}

bool sv_lru_put(struct sv_lru *lru, const char *key, void *value, uint64_t cost)
{
    sv_lru_remove(lru, key);
    size_t bytes = strlen(key) + 1;
    struct entry *e = cost <= lru->budget ? malloc(sizeof *e + bytes) : NULL;
    if (!e) {
        if (lru->free_value)
            lru->free_value(value);
        return false;
    }
    while (lru->cost + cost > lru->budget)
        drop(lru, find(lru, lru->oldest->key, lru->oldest->hash));
    if (lru->count >= lru->bucket_count)
        grow(lru);
    *e = (struct entry){.value = value, .cost = cost, .hash = hash_of(lru, key)};
    memcpy(e->key, key, bytes);
    struct entry **bucket = &lru->buckets[e->hash & (lru->bucket_count - 1)];
    e->next = *bucket;
    *bucket = e;
    link_newest(lru, e);
    lru->cost += cost;
    lru->count++;
    return true;
}

void *sv_lru_get(struct sv_lru *lru, const char *key)
{
    struct entry *e = *find(lru, key, hash_of(lru, key));
    if (!e)
        return NULL;
    unlink_use(lru, e);
    link_newest(lru, e);
    return e->value;
}

void sv_lru_remove(struct sv_lru *lru, const char *key)
{
    struct entry **at = find(lru, key, hash_of(lru, key));
    if (*at)
        drop(lru, at);
}

void sv_lru_remove_all(struct sv_lru *lru, bool (*goes)(const void *value, const void *context), const void *context)
{
    for (size_t k = 0; k < lru->bucket_count; k++)
        for (struct entry **at = &lru->buckets[k]; *at;)
            if (goes((*at)->value, context))
                drop(lru, at);
            else
                at = &(*at)->next;
}

void sv_lru_clear(struct sv_lru *lru)
{
    while (lru->oldest)
        drop(lru, find(lru, lru->oldest->key, lru->oldest->hash));
}

void sv_lru_destroy(struct sv_lru *lru)
{
    if (!lru)
        return;
    sv_lru_clear(lru);
    free(lru->buckets);
    free(lru);
}

size_t sv_lru_count(const struct sv_lru *lru)
{
    return lru->count;
}

uint64_t sv_lru_cost(const struct sv_lru *lru)
{
    return lru->cost;
}
