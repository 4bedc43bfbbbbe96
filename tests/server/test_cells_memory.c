/* test_cells_memory.c - the block of panels in two mappings, and descriptors that are none. */
#include "server/cells_memory.h"

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <cmocka.h>

#include <string.h>
#include <sys/mman.h>
#include <unistd.h>

enum { BYTES = 8 << 20 };

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
        cmocka_unit_test(it_cannot_shrink),
        cmocka_unit_test(what_is_none),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
