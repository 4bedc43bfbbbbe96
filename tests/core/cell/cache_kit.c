/* cache_kit.c - see cache_kit.h. */
#include "tests/core/cell/cache_kit.h"

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <string.h>
#include <sys/mman.h>

#include <cmocka.h>

#include "core/base/rng.h"

struct sv_cell_cache *cache_kit_make(uint32_t entries, unsigned pages, void **memory, size_t *bytes)
{
    struct sv_cell_cache_options options = {entries, CACHE_KIT_HALF_LIFE_S, SV_CELL_ADMIT_OPTIONS_DEFAULT};
    struct sv_cell_cache *cache;
    struct sv_cell_cache_stats stats;
    size_t most = (size_t)(pages + 4096) * CACHE_KIT_PAGE;
    *memory = mmap(NULL, most, PROT_READ | PROT_WRITE, MAP_SHARED | MAP_ANONYMOUS, -1, 0);
    assert_true(*memory != MAP_FAILED);
    assert_int_equal(sv_cell_cache_make(*memory, most, &options, &cache, NULL), SV_OK);
    sv_cell_cache_stats(cache, &stats);
    *bytes = most - (size_t)stats.budget_bytes + (size_t)pages * CACHE_KIT_PAGE;
    assert_int_equal(munmap((char *)*memory + *bytes, most - *bytes), 0);
    assert_int_equal(sv_cell_cache_make(*memory, *bytes, &options, &cache, NULL), SV_OK);
    return cache;
}

void cache_kit_fill(const struct sv_cell_cache_panel *panel, size_t bytes)
{
    struct sv_rng rng = sv_rng_seeded(panel->serial, 1);
    for (size_t n = 0; n < bytes; n++)
        ((uint8_t *)panel->data)[n] = (uint8_t)sv_rng_next(&rng);
}

void cache_kit_assert_filled(const struct sv_cell_cache_panel *panel, size_t bytes)
{
    struct sv_rng rng = sv_rng_seeded(panel->serial, 1);
    for (size_t n = 0; n < bytes; n++)
        assert_int_equal(((const uint8_t *)panel->data)[n], (uint8_t)sv_rng_next(&rng));
}

struct sv_cell_cache_label cache_kit_label(uint64_t key)
{
    struct sv_cell_cache_label label;
    memset(&label, 0, sizeof label);
    label.key = key;
    label.parts.size = (int)key * 3;
    return label;
}
