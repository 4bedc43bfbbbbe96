/* test_cache_crash.c - processes die in the cache: after any number of instructions (single steps, so that it
 * is the same every time), at random while several hammer it, and with the index overwritten. No test waits
 * for a time. */
#include <setjmp.h>
#include <signal.h>
#include <stdarg.h>
#include <stdatomic.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>
#include <sched.h>
#include <sys/mman.h>
#include <sys/ptrace.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cmocka.h>

#include "core/base/rng.h"
#include "core/cell/cache_private.h"

enum { PAGE = 4096, ENTRIES = 12, FILLED = 64, WORKERS = 4 };

static struct sv_cell_cache *cache;
static void *memory;
static size_t memory_bytes;

static void make(unsigned pages)
{
    struct sv_cell_cache_options options = {ENTRIES, 50, SV_CELL_ADMIT_OPTIONS_DEFAULT};
    memory_bytes = (pages + 8 + sizeof(struct sv_cell_cache) / PAGE) * PAGE;
    memory = mmap(NULL, memory_bytes, PROT_READ | PROT_WRITE, MAP_SHARED | MAP_ANONYMOUS, -1, 0);
    assert_true(memory != MAP_FAILED);
    assert_int_equal(sv_cell_cache_make(memory, memory_bytes, &options, &cache, NULL), SV_OK);
}

static uint64_t word_of(const struct sv_cell_cache_panel *panel, size_t n)
{
    return sv_mix64(panel->serial * 1000 + n);
}

static void fill(const struct sv_cell_cache_panel *panel)
{
    for (size_t n = 0; n < FILLED; n++)
        ((uint64_t *)panel->data)[n] = word_of(panel, n);
}

static bool filled(const struct sv_cell_cache_panel *panel)
{
    for (size_t n = 0; n < FILLED; n++)
        if (((volatile uint64_t *)panel->data)[n] != word_of(panel, n))
            return false;
    return true;
}

/* Reserves, fits, fills and commits, and stays pinned; what reserve said, FULL where it did not fit. */
static enum sv_cell_cache_answer build(unsigned slot, uint64_t key, size_t bytes, bool refined,
                                       uint64_t generation, struct sv_cell_cache_panel *panel)
{
    struct sv_cell_cache_label label;
    memset(&label, 0, sizeof label);
    label.key = key;
    enum sv_cell_cache_answer answer =
        sv_cell_cache_reserve(cache, slot, &label, 1, refined, generation, 1, panel);
    if (answer == SV_CELL_CACHE_GRANTED) {
        if (!sv_cell_cache_fit(cache, slot, panel, bytes, 1))
            return SV_CELL_CACHE_FULL;
        fill(panel);
        sv_cell_cache_commit(cache, slot, panel, bytes > PAGE ? bytes - PAGE : bytes, 1, 1);
    }
    return answer;
}

/* --- after any instruction --- */

/* What the victim does, with slot 1, part by part: every operation, evicting, replacing and dropping as it
 * goes. */
enum { PARTS = 9 };
static void live(int part, struct sv_cell_cache_panel *panel)
{
    struct sv_cell_cache_label label;
    const uint64_t keys[] = {1, 3};
    memset(&label, 0, sizeof label);
    label.key = 10 + (uint64_t)part;
    switch (part) {
    case 0:
        sv_cell_cache_find(cache, 1, 2, 0, 1, panel);
        break;
    case 1:
    case 3:
        sv_cell_cache_unpin(cache, 1, panel);
        break;
    case 2:
        sv_cell_cache_reserve(cache, 1, &label, 5 * PAGE, false, 0, 1, panel); /* evicts */
        break;
    case 4:
        label.key = 1; /* the old one is pinned by slot 0 */
        sv_cell_cache_reserve(cache, 1, &label, 2 * PAGE, true, 0, 1, panel);
        fill(panel);
        break;
    case 5:
        sv_cell_cache_fit(cache, 1, panel, 6 * PAGE, 1); /* evicts */
        fill(panel);
        break;
    case 6:
        sv_cell_cache_commit(cache, 1, panel, PAGE, 1, 1);
        break;
    case 7:
        sv_cell_cache_drop_keys(cache, 1, keys, 2);
        break;
    case 8:
        sv_cell_cache_release(cache, 1);
        break;
    }
}

/* Does all parts before that one, stops, does it, and stops again. */
static pid_t start_victim(int part)
{
    pid_t pid = fork();
    if (pid != 0)
        return pid;
    struct sv_cell_cache_panel panel = {0};
    if (ptrace(PTRACE_TRACEME, 0, NULL, NULL) != 0)
        _exit(77);
    for (int before = 0; before < part; before++)
        live(before, &panel);
    raise(SIGSTOP);
    live(part, &panel);
    raise(SIGSTOP);
    _exit(0);
}

/* Lets the victim take that many instructions, then kills it; how many it took. */
static long step_and_kill(pid_t pid, long steps)
{
    int status;
    long taken = 0;
    assert_int_equal(waitpid(pid, &status, 0), pid);
    if (!WIFSTOPPED(status))
        return -1;
    while (taken < steps) {
        assert_int_equal(ptrace(PTRACE_SINGLESTEP, pid, NULL, NULL), 0);
        assert_int_equal(waitpid(pid, &status, 0), pid);
        if (!WIFSTOPPED(status) || WSTOPSIG(status) != SIGTRAP)
            break;
        taken++;
    }
    kill(pid, SIGKILL);
    assert_int_equal(waitpid(pid, &status, 0), pid);
    return WIFSIGNALED(status) ? taken : -1;
}

static uint64_t generation_now(void)
{
    struct sv_cell_cache_stats stats;
    sv_cell_cache_stats(cache, &stats);
    return stats.generation;
}

/* Every panel that can be found is whole; returns their number. */
static size_t look_at_all(unsigned slot)
{
    struct sv_cell_cache_item items[ENTRIES];
    size_t count = sv_cell_cache_list(cache, 1, items, ENTRIES);
    assert_true(count <= ENTRIES);
    for (size_t n = 0; n < count; n++) {
        struct sv_cell_cache_panel panel;
        for (size_t m = 0; m < n; m++)
            assert_true(items[m].label.key != items[n].label.key);
        assert_int_equal(sv_cell_cache_find(cache, slot, items[n].label.key, generation_now(), 1, &panel),
                         SV_CELL_CACHE_HIT);
        assert_true(filled(&panel) && sv_cell_cache_unpin(cache, slot, &panel));
    }
    return count;
}

static bool one_death(int part, long steps, long *taken)
{
    struct sv_cell_cache_panel pinned, lingering, panel;
    struct sv_cell_cache_stats stats;
    uint64_t gone = 4;
    make(14);
    assert_int_equal(build(0, 4, 2 * PAGE, false, 0, &lingering), SV_CELL_CACHE_GRANTED);
    assert_int_equal(sv_cell_cache_drop_keys(cache, 0, &gone, 1), 0); /* of this generation: it stays */
    assert_int_equal(build(0, 1, 3 * PAGE, false, 0, &pinned), SV_CELL_CACHE_GRANTED);
    for (uint64_t key = 2; key <= 3; key++) {
        assert_int_equal(build(0, key, 4 * PAGE, false, 0, &panel), SV_CELL_CACHE_GRANTED);
        assert_true(sv_cell_cache_unpin(cache, 0, &panel));
    }
    *taken = step_and_kill(start_victim(part), steps);
    if (*taken < 0)
        return false;
    sv_cell_cache_release(cache, 1);
    assert_true(sv_cell_cache_check(cache));
    sv_cell_cache_stats(cache, &stats);
    assert_int_equal(stats.building, 0);
    assert_true(stats.emptied == 0 && stats.lingering <= 1);
    assert_true(filled(&pinned) && filled(&lingering));
    assert_true(look_at_all(2) >= 1);
    for (uint64_t key = 20; key < 24; key++) { /* it goes on */
        assert_int_equal(build(2, key, 3 * PAGE, false, generation_now(), &panel), SV_CELL_CACHE_GRANTED);
        assert_true(sv_cell_cache_unpin(cache, 2, &panel) && filled(&pinned) && filled(&lingering));
    }
    assert_true(sv_cell_cache_unpin(cache, 0, &pinned) && sv_cell_cache_unpin(cache, 0, &lingering));
    bool died_inside = stats.owners_died > 0;
    sv_cell_cache_stats(cache, &stats);
    assert_true(stats.pinned_bytes == 0 && stats.lingering == 0 && sv_cell_cache_check(cache));
    munmap(memory, memory_bytes);
    return died_inside;
}

static void a_death_after_any_instruction_does_no_harm(void **state)
{
    (void)state;
    int inside = 0, deaths = 0, most = getenv("SV_TEST_FULL") ? 400 : 7;
    for (int part = 0; part < PARTS; part++) {
        long total, taken;
        one_death(part, 1000000, &total);
        if (total < 0)
            skip(); /* nobody may trace here */
        assert_true(total > 100 && total < 1000000);
        for (long steps = 0; steps < total; steps += 1 + total / most) {
            inside += one_death(part, steps, &taken);
            deaths++;
        }
    }
    assert_true(inside * 4 > deaths); /* the lock was held when it mattered */
}

/* --- a crowd --- */

struct board { /* shared by all */
    atomic_uint done[WORKERS];
    atomic_uint over;
};

/* One operation of a worker that holds at most two panels. False: something was read that should not have
 * been there. */
static bool act(unsigned slot, struct sv_rng *rng, struct sv_cell_cache_panel held[2], unsigned *count)
{
    uint64_t key = 1 + sv_rng_next(rng) % 20, what = sv_rng_next(rng) % 16;
    size_t bytes = (1 + sv_rng_next(rng) % 4) * PAGE;
    struct sv_cell_cache_panel *next = &held[*count];
    if (*count < 2 && what < 6) {
        *count += sv_cell_cache_find(cache, slot, key, generation_now(), 1, next) == SV_CELL_CACHE_HIT;
    } else if (*count < 2 && what < 12) {
        *count += build(slot, key, bytes, what < 8, generation_now(), next) == SV_CELL_CACHE_GRANTED;
    } else if (what == 15) {
        sv_cell_cache_drop_keys(cache, generation_now() + 1, &key, 1);
    } else if (*count > 0) {
        bool whole = filled(&held[--*count]);
        return sv_cell_cache_unpin(cache, slot, &held[*count]) && whole;
    }
    for (unsigned n = 0; n < *count; n++)
        if (!filled(&held[n]))
            return false;
    return true;
}

static pid_t start_worker(unsigned slot, uint64_t seed, struct board *board)
{
    pid_t pid = fork();
    if (pid != 0)
        return pid;
    struct sv_rng rng = sv_rng_seeded(seed, slot);
    struct sv_cell_cache_panel held[2];
    unsigned count = 0;
    while (!atomic_load(&board->over)) {
        if (!act(slot, &rng, held, &count))
            _exit(1);
        atomic_fetch_add(&board->done[slot], 1);
    }
    while (count > 0)
        sv_cell_cache_unpin(cache, slot, &held[--count]);
    _exit(0);
}

/* Until the worker has done that much; false when it ended by itself. */
static bool wait_for(pid_t pid, const atomic_uint *done, unsigned least, int *status)
{
    while (atomic_load(done) < least) {
        if (waitpid(pid, status, WNOHANG) == pid)
            return false;
        sched_yield();
    }
    return true;
}

static void a_crowd_of_which_some_are_killed(void **state)
{
    (void)state;
    make(16);
    struct board *board = mmap(NULL, PAGE, PROT_READ | PROT_WRITE, MAP_SHARED | MAP_ANONYMOUS, -1, 0);
    assert_true(board != MAP_FAILED);
    struct sv_rng rng = sv_rng_seeded(5, 90);
    pid_t pids[WORKERS];
    int status, kills = getenv("SV_TEST_FULL") ? 600 : 40;
    for (unsigned slot = 0; slot < WORKERS; slot++)
        pids[slot] = start_worker(slot, slot, board);
    for (int n = 0; n < kills; n++) {
        unsigned slot = (unsigned)(sv_rng_next(&rng) % WORKERS),
                 more = 1 + (unsigned)(sv_rng_next(&rng) % 200);
        assert_true(
            wait_for(pids[slot], &board->done[slot], atomic_load(&board->done[slot]) + more, &status));
        assert_int_equal(kill(pids[slot], SIGKILL), 0);
        assert_int_equal(waitpid(pids[slot], &status, 0), pids[slot]);
        assert_true(WIFSIGNALED(status));
        sv_cell_cache_release(cache, slot);
        assert_true(sv_cell_cache_check(cache));
        pids[slot] = start_worker(slot, 100 + (uint64_t)n, board);
    }
    for (unsigned slot = 0; slot < WORKERS; slot++)
        assert_true(wait_for(pids[slot], &board->done[slot], 1000, &status));
    atomic_store(&board->over, 1);
    for (unsigned slot = 0; slot < WORKERS; slot++) {
        assert_int_equal(waitpid(pids[slot], &status, 0), pids[slot]);
        assert_true(WIFEXITED(status) && WEXITSTATUS(status) == 0);
    }
    struct sv_cell_cache_stats stats;
    sv_cell_cache_stats(cache, &stats);
    assert_true(stats.pinned_bytes == 0 && stats.building == 0 && stats.lingering == 0 && stats.emptied == 0);
    assert_true(stats.builds > 100 && stats.evictions > 10 && stats.hits > 100 && sv_cell_cache_check(cache));
    look_at_all(0);
    munmap(board, PAGE);
    munmap(memory, memory_bytes);
}

/* --- wild writes --- */

static void overwrite(struct sv_cache_entry *e, int kind)
{
    switch (kind) {
    case 0:
        e->offset += 100 * PAGE; /* beyond the data */
        break;
    case 1:
        e->offset = 0; /* over another piece */
        break;
    case 2:
        atomic_store(&e->state, 77);
        break;
    case 3:
        memset(e, 0xee, sizeof *e);
        break;
    }
}

/* A worker overwrites an entry and dies with the lock: the cache starts anew, but what is pinned keeps its
 * bytes. */
static void a_broken_index_is_emptied(void **state)
{
    (void)state;
    for (int kind = 0; kind < 4; kind++) {
        struct sv_cell_cache_panel first, pinned, victim, panel;
        struct sv_cell_cache_stats stats;
        make(14);
        assert_int_equal(build(0, 1, 2 * PAGE, false, 0, &first), SV_CELL_CACHE_GRANTED);
        assert_int_equal(build(0, 2, 2 * PAGE, false, 0, &victim), SV_CELL_CACHE_GRANTED);
        assert_int_equal(build(0, 3, 2 * PAGE, false, 0, &pinned), SV_CELL_CACHE_GRANTED);
        assert_true(sv_cell_cache_unpin(cache, 0, &victim) && sv_cell_cache_unpin(cache, 0, &first));
        pid_t pid = fork();
        if (pid == 0) {
            pthread_mutex_lock(&cache->mutex);
            overwrite(sv_cache_entry(cache, victim.entry), kind);
            _exit(0);
        }
        int status;
        assert_true(waitpid(pid, &status, 0) == pid && WIFEXITED(status) && WEXITSTATUS(status) == 0);
        assert_int_equal(sv_cell_cache_find(cache, 0, 1, 0, 1, &panel), SV_CELL_CACHE_MISS);
        assert_int_equal(sv_cell_cache_find(cache, 0, 3, 0, 1, &panel), SV_CELL_CACHE_MISS);
        sv_cell_cache_stats(cache, &stats);
        assert_true(stats.owners_died == 1 && stats.emptied == 1 && stats.panels == 0 &&
                    stats.lingering == 1);
        for (uint64_t key = 20; key < 40; key++) {
            assert_int_equal(build(1, key, 3 * PAGE, false, 0, &panel), SV_CELL_CACHE_GRANTED);
            assert_true(sv_cell_cache_unpin(cache, 1, &panel) && filled(&pinned));
        }
        assert_true(sv_cell_cache_check(cache) && sv_cell_cache_unpin(cache, 0, &pinned));
        munmap(memory, memory_bytes);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(a_death_after_any_instruction_does_no_harm),
                                       cmocka_unit_test(a_crowd_of_which_some_are_killed),
                                       cmocka_unit_test(a_broken_index_is_emptied)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
