/* cache_kit.h - small caches of panels (core/cell/cache.h), and panels whose bytes tell which they are. */
#ifndef SV_TESTS_CELL_CACHE_KIT_H
#define SV_TESTS_CELL_CACHE_KIT_H

#include "core/cell/cache.h"

enum { CACHE_KIT_PAGE = 4096 };
#define CACHE_KIT_HALF_LIFE_S 50.0

/* In memory of its own (to be unmapped), the data part of just so many pages: the index's size is found by
 * making. */
struct sv_cell_cache *cache_kit_make(uint32_t entries, unsigned pages, void **memory, size_t *bytes);
/* Random bytes, by the panel's serial number; and whether it still holds them. */
void cache_kit_fill(const struct sv_cell_cache_panel *panel, size_t bytes);
void cache_kit_assert_filled(const struct sv_cell_cache_panel *panel, size_t bytes);
struct sv_cell_cache_label cache_kit_label(uint64_t key);

#endif
