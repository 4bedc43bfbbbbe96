/* test_cache_rules.c - the cache's rules one by one, by hand: who goes first, what replaces what, what copies
 * and other mappings are told. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>
#include <sys/mman.h>
#include <unistd.h>

#include <cmocka.h>

#include "tests/core/cell/cache_kit.h"

enum { PAGES = 40, ENTRIES = 14 };

static struct sv_cell_cache *cache;

static struct sv_cell_cache_panel put(uint64_t key, size_t bytes, double build_s, double now_s)
{
    struct sv_cell_cache_panel panel = {0};
    struct sv_cell_cache_label label = cache_kit_label(key);
    assert_int_equal(sv_cell_cache_reserve(cache, 0, &label, bytes, false, 0, now_s, &panel),
                     SV_CELL_CACHE_GRANTED);
    cache_kit_fill(&panel, bytes);
    assert_true(sv_cell_cache_commit(cache, 0, &panel, bytes, build_s, now_s));
    assert_true(sv_cell_cache_unpin(cache, 0, &panel));
    return panel;
}

static bool there(uint64_t key)
{
    struct sv_cell_cache_item items[64];
    size_t count = sv_cell_cache_list(cache, 0, items, 64);
    for (size_t n = 0; n < count && n < 64; n++)
        if (items[n].label.key == key)
            return true;
    return false;
}

/* Panels of one size: the least of build cost times recent hits goes first, whatever its place. */
static void the_least_valuable_goes_first(void **state)
{
    (void)state;
    void *memory;
    size_t bytes;
    struct sv_cell_cache_panel panel;
    cache = cache_kit_make(64, 8, &memory, &bytes);
    static const double costs[] = {4, 3, 8, 1};
    for (uint64_t key = 1; key <= 4; key++)
        put(key, 2 * CACHE_KIT_PAGE, costs[key - 1], 0);
    for (int n = 0; n < 9; n++) { /* ten uses of the cheapest */
        assert_int_equal(sv_cell_cache_find(cache, 0, 4, 0, 0, &panel), SV_CELL_CACHE_HIT);
        assert_true(sv_cell_cache_unpin(cache, 0, &panel));
    }
    put(5, 2 * CACHE_KIT_PAGE, 100, 0);
    assert_true(there(1) && !there(2) && there(3) && there(4) && there(5));
    put(6, 2 * CACHE_KIT_PAGE, 100, 0);
    assert_true(!there(1) && there(3) && there(4));
    assert_int_equal(sv_cell_cache_find(cache, 0, 3, 0, 0, &panel),
                     SV_CELL_CACHE_HIT); /* 16 to 10, and pinned */
    put(7, 2 * CACHE_KIT_PAGE, 100, 300);
    assert_true(!there(4) && there(3));
    put(8, 2 * CACHE_KIT_PAGE, 100, 300); /* the least by far is pinned */
    assert_true(there(3));
    assert_true(sv_cell_cache_unpin(cache, 0, &panel));
    put(9, 2 * CACHE_KIT_PAGE, 100, 300);
    assert_false(there(3));
    munmap(memory, bytes);
}

/* A refined version takes the old one's place; who reads the old one reads on, and its bytes go with the last
 * pin. */
static void a_refined_version_replaces_in_place(void **state)
{
    (void)state;
    void *memory;
    size_t bytes;
    struct sv_cell_cache_panel old, better, found;
    struct sv_cell_cache_label label = cache_kit_label(7);
    struct sv_cell_cache_stats stats;
    cache = cache_kit_make(64, 8, &memory, &bytes);
    put(7, 3 * CACHE_KIT_PAGE, 1, 0);
    assert_int_equal(sv_cell_cache_find(cache, 1, 7, 0, 0, &old), SV_CELL_CACHE_HIT);
    assert_int_equal(sv_cell_cache_reserve(cache, 2, &label, 3 * CACHE_KIT_PAGE, false, 0, 0, &better),
                     SV_CELL_CACHE_HIT);
    assert_int_equal(sv_cell_cache_reserve(cache, 2, &label, 3 * CACHE_KIT_PAGE, true, 0, 0, &better),
                     SV_CELL_CACHE_GRANTED);
    assert_int_equal(sv_cell_cache_reserve(cache, 3, &label, 3 * CACHE_KIT_PAGE, true, 0, 0, &found),
                     SV_CELL_CACHE_BUILDING);
    assert_int_equal(sv_cell_cache_find(cache, 3, 7, 0, 0, &found),
                     SV_CELL_CACHE_HIT); /* the old one, meanwhile */
    assert_true(found.serial == old.serial && sv_cell_cache_unpin(cache, 3, &found));
    cache_kit_fill(&better, 3 * CACHE_KIT_PAGE);
    assert_true(sv_cell_cache_commit(cache, 2, &better, 3 * CACHE_KIT_PAGE, 5, 0));
    assert_int_equal(sv_cell_cache_find(cache, 3, 7, 0, 0, &found), SV_CELL_CACHE_HIT);
    assert_true(found.serial == better.serial && found.refined);
    cache_kit_assert_filled(&old, 3 * CACHE_KIT_PAGE);
    sv_cell_cache_stats(cache, &stats);
    assert_true(stats.panels == 1 && stats.lingering == 1 && stats.used_bytes == 6 * CACHE_KIT_PAGE);
    assert_true(sv_cell_cache_unpin(cache, 1, &old) && !sv_cell_cache_unpin(cache, 1, &old));
    sv_cell_cache_stats(cache, &stats);
    assert_true(stats.panels == 1 && stats.lingering == 0 && stats.used_bytes == 3 * CACHE_KIT_PAGE);
    munmap(memory, bytes);
}

/* Generation 2 came to nothing: what it dropped is gone, the rest is found, and 1 may build again. */
/* Who has a copy asks whether it is still the panel that is found: by its serial, and only when anything
 * changed. */
static void copies_are_told_from_what_is_there(void **state)
{
    (void)state;
    void *memory;
    size_t bytes;
    struct sv_cell_cache_panel first, better;
    struct sv_cell_cache_label label = cache_kit_label(7);
    struct sv_cell_cache_stats before, after;
    uint64_t changes;
    cache = cache_kit_make(64, 8, &memory, &bytes);
    assert_int_equal(sv_cell_cache_serial(cache, 7, 0, 0), 0);
    changes = sv_cell_cache_changes(cache);
    assert_int_equal(sv_cell_cache_reserve(cache, 2, &label, CACHE_KIT_PAGE, false, 0, 0, &first),
                     SV_CELL_CACHE_GRANTED);
    assert_int_equal(sv_cell_cache_serial(cache, 7, 0, 0), 0); /* nobody finds it yet */
    assert_true(sv_cell_cache_commit(cache, 2, &first, CACHE_KIT_PAGE, 5, 0));
    assert_int_not_equal(sv_cell_cache_changes(cache), changes);
    changes = sv_cell_cache_changes(cache);
    sv_cell_cache_stats(cache, &before);
    assert_int_equal(sv_cell_cache_serial(cache, 7, 0, 0), first.serial);
    assert_int_equal(sv_cell_cache_serial(cache, 7, 1, 0),
                     0); /* of a generation that the cache does not know */
    assert_int_equal(sv_cell_cache_serial(cache, 8, 0, 0), 0);
    assert_true(sv_cell_cache_unpin(cache, 2, &first));
    sv_cell_cache_stats(cache, &after);
    assert_true(before.hits == after.hits && before.misses == after.misses && after.pinned_bytes == 0);
    assert_int_equal(sv_cell_cache_changes(cache), changes);
    assert_int_equal(sv_cell_cache_reserve(cache, 2, &label, CACHE_KIT_PAGE, true, 0, 0, &better),
                     SV_CELL_CACHE_GRANTED);
    assert_true(sv_cell_cache_commit(cache, 2, &better, CACHE_KIT_PAGE, 5, 0));
    assert_int_equal(sv_cell_cache_serial(cache, 7, 0, 0), better.serial);
    assert_int_not_equal(sv_cell_cache_changes(cache), changes);
    assert_true(sv_cell_cache_unpin(cache, 2, &better));
    changes = sv_cell_cache_changes(cache);
    put(9, 8 * CACHE_KIT_PAGE, 1, 0); /* takes all room */
    assert_int_equal(sv_cell_cache_serial(cache, 7, 0, 0), 0);
    assert_int_not_equal(sv_cell_cache_changes(cache), changes);
    const uint64_t keys[2] = {9, 10};
    for (int k = 0; k < 2; k++) {
        assert_true(sv_cell_cache_serial(cache, keys[k], 0, 0) != 0);
        changes = sv_cell_cache_changes(cache);
        if (k == 0)
            sv_cell_cache_clear(cache);
        else
            sv_cell_cache_drop_keys(cache, 1, keys, 2);
        assert_int_equal(sv_cell_cache_serial(cache, keys[k], (uint64_t)k, 0), 0);
        assert_int_not_equal(sv_cell_cache_changes(cache), changes);
        if (k == 0)
            put(keys[1], CACHE_KIT_PAGE, 1, 0);
    }
    munmap(memory, bytes);
}

static void a_change_that_came_to_nothing_is_turned_back(void **state)
{
    (void)state;
    void *block;
    size_t bytes;
    struct sv_cell_cache *c = cache_kit_make(ENTRIES, PAGES, &block, &bytes);
    struct sv_cell_cache_panel panel;
    uint64_t gone = 2;
    for (uint64_t key = 1; key <= 2; key++) {
        struct sv_cell_cache_label label = {.key = key};
        assert_int_equal(sv_cell_cache_reserve(c, 0, &label, CACHE_KIT_PAGE, false, 0, 0, &panel),
                         SV_CELL_CACHE_GRANTED);
        assert_true(sv_cell_cache_commit(c, 0, &panel, CACHE_KIT_PAGE, 1, 0));
        sv_cell_cache_unpin(c, 0, &panel);
    }
    assert_int_equal(sv_cell_cache_drop_keys(c, 1, NULL, 0), 0);
    assert_int_equal(sv_cell_cache_drop_keys(c, 2, &gone, 1), 1);
    struct sv_cell_cache_label again = {.key = 2}, later = {.key = 3};
    assert_int_equal(sv_cell_cache_reserve(c, 0, &again, CACHE_KIT_PAGE, false, 1, 0, &panel),
                     SV_CELL_CACHE_STALE);
    assert_int_equal(sv_cell_cache_reserve(c, 0, &later, CACHE_KIT_PAGE, false, 2, 0, &panel),
                     SV_CELL_CACHE_GRANTED);
    assert_true(sv_cell_cache_commit(c, 0, &panel, CACHE_KIT_PAGE, 1, 0));
    sv_cell_cache_unpin(c, 0, &panel);
    sv_cell_cache_turn_back(c, 1);
    assert_int_equal(sv_cell_cache_find(c, 0, 1, 1, 0, &panel), SV_CELL_CACHE_HIT);
    sv_cell_cache_unpin(c, 0, &panel);
    assert_int_equal(sv_cell_cache_find(c, 0, 3, 1, 0, &panel), SV_CELL_CACHE_MISS);
    assert_int_equal(sv_cell_cache_reserve(c, 0, &again, CACHE_KIT_PAGE, false, 1, 0, &panel),
                     SV_CELL_CACHE_GRANTED);
    assert_true(sv_cell_cache_commit(c, 0, &panel, CACHE_KIT_PAGE, 1, 0));
    sv_cell_cache_unpin(c, 0, &panel);
    assert_int_equal(sv_cell_cache_drop_keys(c, 2, &gone, 1), 1); /* the change, made again */
    assert_true(sv_cell_cache_check(c));
    munmap(block, bytes);
}

static void blocks_are_made_and_opened(void **state)
{
    (void)state;
    void *memory;
    size_t bytes;
    struct sv_error e;
    struct sv_cell_cache *other = NULL;
    struct sv_cell_cache_options options = SV_CELL_CACHE_OPTIONS_DEFAULT;
    cache = cache_kit_make(64, 8, &memory, &bytes);
    assert_int_equal(sv_cell_cache_open(memory, bytes, &other, &e), SV_OK);
    assert_ptr_equal(other, cache);
    assert_int_equal(sv_cell_cache_open(memory, bytes - CACHE_KIT_PAGE, &other, &e), SV_EFORMAT);
    assert_int_equal(sv_cell_cache_make((char *)memory + 64, bytes - 64, &options, &other, &e), SV_EINVAL);
    assert_string_equal(e.field, "memory");
    assert_int_equal(sv_cell_cache_make(memory, bytes, &options, &other, &e),
                     SV_ELIMIT); /* 4096 entries do not fit */
    options.entries = 0;
    assert_int_equal(sv_cell_cache_make(memory, bytes, &options, &other, &e), SV_EINVAL);
    assert_string_equal(e.field, "entries");
    options.entries = 4;
    options.half_life_s = NAN;
    assert_int_equal(sv_cell_cache_make(memory, bytes, &options, &other, &e), SV_EINVAL);
    assert_string_equal(e.field, "half_life_s");
    memset(memory, 0, bytes);
    assert_int_equal(sv_cell_cache_open(memory, bytes, &other, &e), SV_EFORMAT);
    munmap(memory, bytes);
}

/* A block mapped a second time elsewhere works from both places: there are no pointers in it. */
static void two_mappings_are_one_cache(void **state)
{
    (void)state;
    enum { BYTES = 200 * CACHE_KIT_PAGE };
    int fd = memfd_create("test-cache", MFD_CLOEXEC);
    assert_true(fd >= 0 && ftruncate(fd, BYTES) == 0);
    void *here = mmap(NULL, BYTES, PROT_READ | PROT_WRITE, MAP_SHARED, fd, 0);
    void *elsewhere = mmap(NULL, BYTES, PROT_READ | PROT_WRITE, MAP_SHARED, fd, 0);
    assert_true(here != MAP_FAILED && elsewhere != MAP_FAILED && here != elsewhere);
    struct sv_cell_cache_options options = {64, 60, SV_CELL_ADMIT_OPTIONS_DEFAULT};
    struct sv_cell_cache *other;
    struct sv_cell_cache_panel panel;
    assert_int_equal(sv_cell_cache_make(here, BYTES, &options, &cache, NULL), SV_OK);
    assert_int_equal(sv_cell_cache_open(elsewhere, BYTES, &other, NULL), SV_OK);
    struct sv_cell_cache_panel made = put(3, 5000, 1, 0);
    assert_int_equal(sv_cell_cache_find(other, 5, 3, 0, 0, &panel), SV_CELL_CACHE_HIT);
    assert_true((char *)panel.data - (char *)elsewhere == (char *)made.data - (char *)here);
    cache_kit_assert_filled(&panel, 5000);
    assert_int_equal(sv_cell_cache_release(cache, 5), 1);
    struct sv_cell_admit_request request = {.pixels = 4096, .rings = 1, .ring = {{.key = 3, .crowns = 1}}};
    assert_false(sv_cell_cache_admit(cache, &request).build);
    for (int n = 0; n < 4; n++)
        sv_cell_cache_drawn(other, 4096, 0, 10);
    for (int n = 0; n < 4; n++)
        sv_cell_cache_drawn(other, 4096, 1, 1);
    for (int n = 0; n < 4; n++)
        sv_cell_cache_built(other, 1, false, 1, 1);
    assert_true(sv_cell_cache_admit(cache, &request).build);
    munmap(here, BYTES);
    munmap(elsewhere, BYTES);
    close(fd);
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(the_least_valuable_goes_first),
                                       cmocka_unit_test(a_refined_version_replaces_in_place),
                                       cmocka_unit_test(blocks_are_made_and_opened),
                                       cmocka_unit_test(two_mappings_are_one_cache),
                                       cmocka_unit_test(copies_are_told_from_what_is_there),
                                       cmocka_unit_test(a_change_that_came_to_nothing_is_turned_back)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
