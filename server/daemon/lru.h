/* lru.h - a table from text keys to values with a cost; least recently used out first. What memo.h and
 * pictures.h are made of. One thread. */
#ifndef SV_SERVER_LRU_H
#define SV_SERVER_LRU_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

struct sv_lru;

typedef void (*sv_lru_free)(void *value);

/* Keeps the sum of costs at or under `budget`; free_value (may be NULL) is called for each value that leaves.
 * NULL when out of memory. */
struct sv_lru *sv_lru_create(uint64_t budget, sv_lru_free free_value);
void sv_lru_destroy(struct sv_lru *lru);

/* Takes the value; replaces what was there. False (the value is freed) when cost alone exceeds the budget, or
 * memory is short. */
bool sv_lru_put(struct sv_lru *lru, const char *key, void *value, uint64_t cost);
/* The value, now the most recently used; NULL when absent. Borrowed until the next put or remove. */
void *sv_lru_get(struct sv_lru *lru, const char *key);
void sv_lru_remove(struct sv_lru *lru, const char *key);
/* Removes every value for which `goes` is true. */
void sv_lru_remove_all(struct sv_lru *lru, bool (*goes)(const void *value, const void *context), const void *context);
void sv_lru_clear(struct sv_lru *lru);

size_t sv_lru_count(const struct sv_lru *lru);
uint64_t sv_lru_cost(const struct sv_lru *lru);

#endif
