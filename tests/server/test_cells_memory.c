/* test_cells_memory.c - the block of panels in two mappings, and descriptors that are none. */
#include "server/cells_memory.h"

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <cmocka.h>

#include <stdio.h>
#include <string.h>
#include <sys/mman.h>
#include <unistd.h>

#ifndef MADV_COLLAPSE
#define MADV_COLLAPSE 25
#endif
enum { BYTES = 8 << 20, LARGE = 2 << 20 };

static void one_block_in_two_mappings(void **state)
{
    (void)state;
    struct sv_cells_memory made, opened;
    struct sv_cell_cache_panel panel, found;
    struct sv_cell_cache_label label = {.key = 7};
    assert_int_equal(sv_cells_memory_make(BYTES, &made, NULL), SV_OK);
    assert_int_equal(sv_cells_memory_open(made.fd, BYTES, &opened, NULL), SV_OK);
    assert_ptr_not_equal(made.memory, opened.memory);
    assert_int_equal(sv_cell_cache_reserve(made.cache, 0, &label, 5000, false, 0, 1, &panel),
                     SV_CELL_CACHE_GRANTED);
    memset(panel.data, 0x5A, 5000);
    assert_true(sv_cell_cache_commit(made.cache, 0, &panel, 5000, 0.1, 1));
    assert_int_equal(sv_cell_cache_find(opened.cache, 1, 7, 0, 1, &found), SV_CELL_CACHE_HIT);
    assert_memory_equal(panel.data, found.data, 5000);
    assert_ptr_not_equal(panel.data, found.data);
    sv_cells_memory_close(&made);
    assert_int_equal(((const unsigned char *)found.data)[4999],
                     0x5A); /* it lives as long as somebody has it */
    sv_cells_memory_close(&opened);
    sv_cells_memory_close(&opened);
}

/* Of the mapping that begins at memory, what is mapped in large pages, kB. */
static long large_kb(const void *memory)
{
    char line[512];
    unsigned long long begin, end;
    bool ours = false;
    long kb = -1;
    FILE *smaps = fopen("/proc/self/smaps", "re");
    assert_non_null(smaps);
    while (kb < 0 && fgets(line, sizeof line, smaps)) {
        if (sscanf(line, "%llx-%llx ", &begin, &end) == 2)
            ours = begin == (uintptr_t)memory;
        else if (ours)
            (void)sscanf(line, "ShmemPmdMapped: %ld kB", &kb);
    }
    fclose(smaps);
    return kb;
}

/* Whether the system gives memory of a file in large pages to who asks: Linux 6.1 and later do, where some are free. */
static bool has_large_pages(void)
{
    int fd = memfd_create("probe", MFD_CLOEXEC);
    assert_int_equal(ftruncate(fd, LARGE), 0);
    char *room = mmap(NULL, 2 * LARGE, PROT_NONE, MAP_PRIVATE | MAP_ANONYMOUS, -1, 0);
    assert_ptr_not_equal(room, MAP_FAILED);
    char *at = room + (LARGE - (uintptr_t)room % LARGE) % LARGE;
    assert_ptr_equal(mmap(at, LARGE, PROT_READ | PROT_WRITE, MAP_SHARED | MAP_FIXED, fd, 0), at);
    at[0] = 1;
    bool has = madvise(at, LARGE, MADV_COLLAPSE) == 0;
    munmap(room, 2 * LARGE);
    close(fd);
    return has;
}

/* The second panel's pages reach over the first's, which is there already. */
static void panels_are_in_large_pages(void **state)
{
    (void)state;
    enum { FIRST = 300000, SECOND = 4 << 20 };
    struct sv_cells_memory made, opened;
    struct sv_cell_cache_panel first, second, found;
    const struct sv_cell_cache_label labels[] = {{.key = 7}, {.key = 8}};
    assert_int_equal(sv_cells_memory_make(2 * BYTES, &made, NULL), SV_OK);
    assert_int_equal(sv_cells_memory_open(made.fd, 2 * BYTES, &opened, NULL), SV_OK);
    assert_int_equal((uintptr_t)made.memory % LARGE, 0);
    assert_int_equal((uintptr_t)opened.memory % LARGE, 0);
    assert_int_equal(sv_cell_cache_reserve(made.cache, 0, &labels[0], FIRST, false, 0, 1, &first), SV_CELL_CACHE_GRANTED);
    for (size_t k = 0; k < FIRST; k++)
        ((unsigned char *)first.data)[k] = (unsigned char)(k * 31 >> 3);
    assert_true(sv_cell_cache_commit(made.cache, 0, &first, FIRST, 0.1, 1));
    assert_int_equal(sv_cell_cache_reserve(made.cache, 0, &labels[1], 1, false, 0, 1, &second), SV_CELL_CACHE_GRANTED);
    assert_true(sv_cell_cache_fit(made.cache, 0, &second, SECOND, 1));
    memset(second.data, 0xA5, SECOND);
    assert_true(sv_cell_cache_commit(made.cache, 0, &second, SECOND, 0.1, 1));
    assert_int_equal(sv_cell_cache_find(opened.cache, 1, 8, 0, 1, &found), SV_CELL_CACHE_HIT);
    for (size_t k = 0; k < SECOND; k++)
        assert_int_equal(((unsigned char *)found.data)[k], 0xA5);
    assert_int_equal(sv_cell_cache_find(opened.cache, 1, 7, 0, 1, &found), SV_CELL_CACHE_HIT);
    for (size_t k = 0; k < FIRST; k++)
        assert_int_equal(((unsigned char *)found.data)[k], (unsigned char)(k * 31 >> 3));
    if (has_large_pages()) /* the second panel lies in three, of which it fills one */
        assert_in_range(large_kb(opened.memory), 2 * LARGE >> 10, 2 * BYTES >> 10);
    else
        print_message("the system has no large pages for shared memory now: not looked at\n");
    assert_true(sv_cell_cache_check(made.cache));
    sv_cells_memory_close(&made);
    sv_cells_memory_close(&opened);
}

static void it_cannot_shrink(void **state)
{
    (void)state;
    struct sv_cells_memory made;
    assert_int_equal(sv_cells_memory_make(BYTES, &made, NULL), SV_OK);
    assert_int_equal(ftruncate(made.fd, 4096), -1);
    sv_cells_memory_close(&made);
}

static void what_is_none(void **state)
{
    (void)state;
    struct sv_cells_memory made, opened = {0};
    struct sv_error error;
    assert_int_equal(sv_cells_memory_make(4096, &made, &error), SV_ELIMIT); /* no room for an index */
    assert_int_equal(sv_cells_memory_open(STDIN_FILENO, BYTES, &opened, &error), SV_EFORMAT);
    int loose = memfd_create("loose", MFD_CLOEXEC);
    assert_int_equal(ftruncate(loose, BYTES), 0);
    assert_int_equal(sv_cells_memory_open(loose, BYTES, &opened, &error), SV_EFORMAT); /* not sealed */
    close(loose);
    assert_int_equal(sv_cells_memory_make(BYTES, &made, &error), SV_OK);
    assert_int_equal(sv_cells_memory_open(made.fd, BYTES / 2, &opened, &error), SV_EFORMAT);
    memset(made.memory, 0, 4096);
    assert_int_equal(sv_cells_memory_open(made.fd, BYTES, &opened, &error), SV_EFORMAT); /* no cache in it */
    assert_null(opened.cache);
    sv_cells_memory_close(&made);
    sv_cells_memory_close(&opened);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(one_block_in_two_mappings),
        cmocka_unit_test(panels_are_in_large_pages),
        cmocka_unit_test(it_cannot_shrink),
        cmocka_unit_test(what_is_none),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
