/* test_cache.c - the cache against a model in plain C: lists of panels and pins, room looked for page by
 * page. */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>
#include <sys/mman.h>
#include <unistd.h>

#include <cmocka.h>

#include "core/base/rng.h"
#include "tests/core/cell/cache_kit.h"

enum { PAGES = 40, ENTRIES = 14, SLOTS = 3, KEYS = 24, HANDLES = 12 };
/* --- the model --- */

enum life { GONE, BUILDING, READY, LINGERING };

struct model_panel {
    enum life life;
    uint64_t key, serial, since;
    bool refined, doomed;
    unsigned builder, pins[SLOTS];
    size_t page, pages, used;
    double build_s, *used_at; /* whenever it was found, and its commit */
    unsigned uses, hits;
};
static struct model_panel panels[60000];
static unsigned panel_count;
static double uses_at[400000];
static unsigned uses_at_count;
static uint64_t generation;

struct handle {
    struct sv_cell_cache_panel panel;
    struct model_panel *of;
    unsigned slot;
    bool builds;
};
static struct handle handles[HANDLES];
static unsigned handle_count;

static struct model_panel *model_find(uint64_t key, enum life life)
{
    for (unsigned n = 0; n < panel_count; n++)
        if (panels[n].life == life && panels[n].key == key && !panels[n].doomed)
            return &panels[n];
    return NULL;
}

static unsigned model_pins(const struct model_panel *p)
{
    return p->pins[0] + p->pins[1] + p->pins[2];
}

static double model_worth(const struct model_panel *p, double now_s)
{
    double heat = 0;
    for (unsigned n = 0; n < p->uses; n++)
        heat += pow(2, (p->used_at[n] - now_s) / CACHE_KIT_HALF_LIFE_S);
    return p->build_s * heat;
}

static void model_use(struct model_panel *p, double now_s)
{
    double *moved = uses_at + uses_at_count; /* a list is copied when it grows: simple, and large enough */
    for (unsigned n = p->uses > 60 ? p->uses - 60 : 0; n < p->uses; n++)
        uses_at[uses_at_count++] = p->used_at[n];
    uses_at[uses_at_count++] = now_s;
    p->used_at = moved;
    p->uses = (unsigned)(uses_at + uses_at_count - moved);
    assert_true(uses_at_count < sizeof uses_at / sizeof *uses_at - 100);
}

static void compact_uses(void)
{
    static double kept[sizeof uses_at / sizeof *uses_at];
    unsigned count = 0;
    for (unsigned n = 0; n < panel_count; n++) {
        if (panels[n].life == GONE || panels[n].uses == 0)
            continue;
        memcpy(kept + count, panels[n].used_at, panels[n].uses * sizeof *kept);
        panels[n].used_at = uses_at + count;
        count += panels[n].uses;
    }
    memcpy(uses_at, kept, count * sizeof *kept);
    uses_at_count = count;
}

static unsigned live(void)
{
    unsigned count = 0;
    for (unsigned n = 0; n < panel_count; n++)
        count += panels[n].life != GONE;
    return count;
}

/* The least worth that must go for so many pages; INFINITY: there is no room. free: nothing at all must. */
static double least_loss(size_t pages, double now_s)
{
    double best = INFINITY, least = INFINITY;
    for (unsigned n = 0; n < panel_count; n++)
        if (panels[n].life == READY && model_pins(&panels[n]) == 0)
            least = fmin(least, model_worth(&panels[n], now_s));
    for (size_t at = 0; at + pages <= PAGES; at++) {
        double loss = 0;
        unsigned met = 0;
        for (unsigned n = 0; n < panel_count; n++) {
            const struct model_panel *p = &panels[n];
            if (p->life == GONE || p->page >= at + pages || p->page + p->pages <= at)
                continue;
            met++;
            loss += p->life == READY && model_pins(p) == 0 ? model_worth(p, now_s) : INFINITY;
        }
        if (met == 0)
            return live() < ENTRIES ? 0 : least;
        best = fmin(best, loss);
    }
    return best;
}

/* --- one operation each --- */

static struct sv_cell_cache *cache;
static char *data_begin;

static void hold(const struct sv_cell_cache_panel *panel, struct model_panel *of, unsigned slot,
                 bool is_building)
{
    assert_true(handle_count < HANDLES);
    handles[handle_count++] = (struct handle){*panel, of, slot, is_building};
}

static void do_find(uint64_t key, unsigned slot, uint64_t at, double now_s)
{
    struct sv_cell_cache_panel panel;
    struct model_panel *ready = model_find(key, READY);
    enum sv_cell_cache_answer expected = ready && ready->since <= at && at <= generation ? SV_CELL_CACHE_HIT
                                         : !ready && model_find(key, BUILDING) ? SV_CELL_CACHE_BUILDING
                                                                               : SV_CELL_CACHE_MISS;
    assert_int_equal(sv_cell_cache_find(cache, slot, key, at, now_s, &panel), expected);
    if (expected != SV_CELL_CACHE_HIT)
        return;
    assert_true(panel.serial == ready->serial && panel.bytes == ready->used &&
                panel.refined == ready->refined);
    assert_ptr_equal(panel.data, data_begin + ready->page * CACHE_KIT_PAGE);
    ready->pins[slot]++;
    ready->hits++;
    model_use(ready, now_s);
    hold(&panel, ready, slot, false);
}

/* Which panels went for it is read from the cache; that they were the right ones is reckoned. */
static double evicted_worth(double now_s)
{
    struct sv_cell_cache_item items[ENTRIES];
    size_t count = sv_cell_cache_list(cache, now_s, items, ENTRIES);
    double lost = 0;
    for (unsigned n = 0; n < panel_count; n++) {
        struct model_panel *p = &panels[n];
        bool there = false;
        for (size_t i = 0; i < count; i++)
            there |= items[i].label.key == p->key && !items[i].building;
        if (p->life != READY || there)
            continue;
        assert_int_equal(model_pins(p), 0);
        lost += model_worth(p, now_s);
        p->life = GONE;
    }
    return lost;
}

/* The piece that was handed out is one that nobody else has. */
static size_t page_of(const struct sv_cell_cache_panel *panel, size_t pages)
{
    size_t page = (size_t)((char *)panel->data - data_begin) / CACHE_KIT_PAGE;
    assert_true(((char *)panel->data - data_begin) % CACHE_KIT_PAGE == 0 && page + pages <= PAGES);
    for (unsigned n = 0; n < panel_count; n++)
        assert_true(panels[n].life == GONE || panels[n].page >= page + pages ||
                    panels[n].page + panels[n].pages <= page);
    return page;
}

static void do_reserve(uint64_t key, size_t bytes, bool refined, unsigned slot, uint64_t at, double now_s)
{
    struct sv_cell_cache_panel panel;
    struct sv_cell_cache_label label = cache_kit_label(key);
    struct model_panel *ready = model_find(key, READY);
    size_t pages = bytes ? (bytes + CACHE_KIT_PAGE - 1) / CACHE_KIT_PAGE : 1;
    double loss = least_loss(pages, now_s);
    enum sv_cell_cache_answer expected = at != generation                        ? SV_CELL_CACHE_STALE
                                         : ready && (ready->refined || !refined) ? SV_CELL_CACHE_HIT
                                         : model_find(key, BUILDING)             ? SV_CELL_CACHE_BUILDING
                                         : isinf(loss)                           ? SV_CELL_CACHE_FULL
                                                                                 : SV_CELL_CACHE_GRANTED;
    assert_int_equal(sv_cell_cache_reserve(cache, slot, &label, bytes, refined, at, now_s, &panel), expected);
    if (expected != SV_CELL_CACHE_GRANTED)
        return;
    double lost = evicted_worth(now_s);
    assert_true(fabs(lost - loss) <= 1e-9 * loss + 1e-12); /* sums of a few dozen terms in another order */
    size_t page = page_of(&panel, pages);
    assert_int_equal(panel.bytes, bytes);
    struct model_panel *made = &panels[panel_count++];
    *made = (struct model_panel){.life = BUILDING,
                                 .key = key,
                                 .serial = panel.serial,
                                 .since = at,
                                 .refined = refined,
                                 .builder = slot,
                                 .page = page,
                                 .pages = pages};
    hold(&panel, made, slot, true);
}

/* The builder's own piece is free before it gets another. */
static void do_fit(unsigned at, size_t bytes, double now_s)
{
    struct handle *h = &handles[at];
    struct model_panel *p = h->of;
    size_t pages = bytes ? (bytes + CACHE_KIT_PAGE - 1) / CACHE_KIT_PAGE : 1;
    p->life = GONE;
    double loss = p->doomed ? INFINITY : least_loss(pages, now_s);
    assert_int_equal(sv_cell_cache_fit(cache, h->slot, &h->panel, bytes, now_s), !isinf(loss));
    if (isinf(loss)) {
        assert_false(sv_cell_cache_fit(cache, h->slot, &h->panel, 1, now_s));
        *h = handles[--handle_count];
        return;
    }
    double lost = evicted_worth(now_s);
    assert_true(fabs(lost - loss) <= 1e-9 * loss + 1e-12);
    p->page = page_of(&h->panel, pages);
    p->pages = pages;
    p->serial = h->panel.serial;
    p->life = BUILDING;
    assert_int_equal(h->panel.bytes, bytes);
}

static void model_retire(struct model_panel *p)
{
    p->life = model_pins(p) ? LINGERING : GONE;
}

static void do_commit(struct handle *h, size_t used, double build_s, double now_s)
{
    struct model_panel *p = h->of, *old = p->doomed ? NULL : model_find(p->key, READY);
    cache_kit_fill(&h->panel, used);
    assert_int_equal(sv_cell_cache_commit(cache, h->slot, &h->panel, used, build_s, now_s), !p->doomed);
    if (old) {
        p->used_at = old->used_at;
        p->uses = old->uses;
        p->hits = old->hits;
        model_retire(old);
    }
    p->life = p->doomed ? LINGERING : READY;
    p->doomed = false;
    p->used = used;
    p->pages = used ? (used + CACHE_KIT_PAGE - 1) / CACHE_KIT_PAGE : 1;
    p->build_s = build_s;
    p->pins[h->slot] = 1;
    model_use(p, now_s);
    h->builds = false;
}

static void do_unpin(unsigned at)
{
    struct handle *h = &handles[at];
    if (!h->builds)
        cache_kit_assert_filled(&h->panel, h->of->used);
    assert_true(sv_cell_cache_unpin(cache, h->slot, &h->panel));
    if (h->builds)
        h->of->life = GONE;
    else if (--h->of->pins[h->slot] == 0 && h->of->life == LINGERING)
        model_retire(h->of);
    *h = handles[--handle_count];
}

static void do_release(unsigned slot)
{
    size_t expected = 0;
    struct sv_cell_cache_panel stale = {0};
    for (unsigned n = handle_count; n-- > 0;)
        if (handles[n].slot == slot) {
            expected++;
            struct model_panel *p = handles[n].of;
            if (handles[n].builds)
                p->life = GONE;
            else if (--p->pins[slot] == 0 && p->life == LINGERING)
                model_retire(p);
            stale = handles[n].panel;
            handles[n] = handles[--handle_count];
        }
    assert_int_equal(sv_cell_cache_release(cache, slot), expected);
    assert_false(sv_cell_cache_unpin(cache, slot, &stale));
}

static bool third(void *context, const struct sv_cell_cache_item *item)
{
    assert_int_equal(item->label.parts.size, (int)item->label.key * 3);
    return item->label.key % 3 == *(unsigned *)context;
}

/* again: as one does who takes over from a process that died in it; what is of this generation stays. */
static void do_drop(unsigned rest, bool again, bool by_key, double now_s)
{
    size_t expected = 0, count = 0, got;
    uint64_t keys[KEYS];
    generation += !again;
    for (uint64_t key = 1; key <= KEYS; key++)
        if (key % 3 == rest)
            keys[count++] = key;
    for (unsigned n = 0; n < panel_count; n++) {
        struct model_panel *p = &panels[n];
        if (p->key % 3 != rest || p->since >= generation || p->doomed ||
            (p->life != READY && p->life != BUILDING))
            continue;
        expected++;
        p->doomed = p->life == BUILDING;
        if (p->life == READY)
            model_retire(p);
    }
    got = by_key ? sv_cell_cache_drop_keys(cache, generation, keys, count)
                 : sv_cell_cache_drop(cache, generation, now_s, third, &rest);
    assert_int_equal(got, expected);
}

static void compare(double now_s)
{
    struct sv_cell_cache_item items[ENTRIES];
    struct sv_cell_cache_stats stats;
    size_t count = sv_cell_cache_list(cache, now_s, items, ENTRIES), listed = 0, used = 0, pinned = 0;
    unsigned lives[4] = {0};
    for (unsigned n = 0; n < panel_count; n++) {
        const struct model_panel *p = &panels[n];
        lives[p->life]++;
        used += p->life != GONE ? p->pages * CACHE_KIT_PAGE : 0;
        pinned += p->life == BUILDING || (p->life != GONE && model_pins(p)) ? p->pages * CACHE_KIT_PAGE : 0;
        if (p->doomed || (p->life != READY && p->life != BUILDING))
            continue;
        listed++;
        size_t at = 0;
        while (at < count && !(items[at].label.key == p->key && items[at].building == (p->life == BUILDING)))
            at++;
        assert_true(at < count);
        assert_true(items[at].bytes == p->pages * CACHE_KIT_PAGE && items[at].refined == p->refined);
        assert_true(items[at].since == p->since && items[at].pins == model_pins(p) &&
                    items[at].hits == p->hits);
        assert_true(fabs(items[at].worth - model_worth(p, now_s)) <= 1e-9 * items[at].worth);
    }
    assert_int_equal(count, listed);
    sv_cell_cache_stats(cache, &stats);
    assert_true(stats.budget_bytes == PAGES * CACHE_KIT_PAGE && stats.used_bytes == used &&
                stats.pinned_bytes == pinned);
    assert_true(stats.panels == lives[READY] && stats.building == lives[BUILDING] &&
                stats.lingering == lives[LINGERING]);
    assert_true(stats.generation == generation && stats.owners_died == 0 && stats.emptied == 0);
    assert_true(sv_cell_cache_check(cache));
}

static void forget_the_gone(void)
{
    unsigned kept = 0;
    for (unsigned n = 0; n < panel_count; n++) {
        if (panels[n].life == GONE)
            continue;
        for (unsigned h = 0; h < handle_count; h++)
            handles[h].of = handles[h].of == &panels[n] ? &panels[kept] : handles[h].of;
        panels[kept++] = panels[n];
    }
    panel_count = kept;
    compact_uses();
}

static void one_step(struct sv_rng *rng, double now_s)
{
    unsigned what = (unsigned)(sv_rng_next(rng) % 100), slot = (unsigned)(sv_rng_next(rng) % SLOTS);
    uint64_t key = 1 + sv_rng_next(rng) % KEYS;
    uint64_t at = generation + (sv_rng_next(rng) % 20 == 0) - (generation > 0 && sv_rng_next(rng) % 10 == 0);
    bool room = handle_count < HANDLES - 1;
    unsigned n = handle_count ? (unsigned)(sv_rng_next(rng) % handle_count) : 0;
    size_t bytes = (size_t)(sv_rng_next(rng) % (what % 7 ? 6 * CACHE_KIT_PAGE : 20 * CACHE_KIT_PAGE));
    if (what < 30 && room)
        do_find(key, slot, at, now_s);
    else if (what < 65 && room)
        do_reserve(key, what == 60 ? (PAGES + 1) * CACHE_KIT_PAGE : bytes, what % 4 == 0, slot, at, now_s);
    else if (what < 75 && handle_count && handles[n].builds)
        do_fit(n, what == 74 ? (PAGES + 1) * CACHE_KIT_PAGE : bytes, now_s);
    else if (what < 97 && handle_count && handles[n].builds && what % 5)
        do_commit(&handles[n], sv_rng_next(rng) % (handles[n].panel.bytes + 1), sv_rng_unit(rng), now_s);
    else if (what < 97 && handle_count)
        do_unpin(n);
    else if (what == 97)
        do_release(slot);
    else if (what >= 98)
        do_drop((unsigned)(key % 3), what == 99, slot == 0, now_s);
}

static void random_operations_as_the_model(void **state)
{
    (void)state;
    void *memory;
    size_t bytes;
    struct sv_cell_cache_stats stats;
    cache = cache_kit_make(ENTRIES, PAGES, &memory, &bytes);
    data_begin = (char *)memory + bytes - PAGES * CACHE_KIT_PAGE;
    struct sv_rng rng = sv_rng_seeded(5, 80);
    double now_s = 1e5;
    for (int step = 0; step < 20000; step++) {
        now_s += sv_rng_unit(&rng) * 4;
        one_step(&rng, now_s);
        if (step % 4 == 0)
            compare(now_s);
        if (step % 50 == 0)
            forget_the_gone();
    }
    sv_cell_cache_stats(cache, &stats);
    assert_true(stats.hits > 300 && stats.waits > 100 && stats.misses > 300 && stats.builds > 1000);
    assert_true(stats.refined > 100 && stats.evictions > 300 && stats.drops > 100 && stats.full > 100);
    munmap(memory, bytes);
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(random_operations_as_the_model)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
