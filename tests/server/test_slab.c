/* test_slab.c - bytes pass from writer to reader, the pool keeps its budget, and slabs cannot be made to
 * fault. */
#include "server/slab.h"

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <cmocka.h>

#include <string.h>
#include <sys/mman.h>
#include <unistd.h>

static void bytes_pass_and_the_job_must_fit(void **state)
{
    struct sv_slab_pool *pool;
    struct sv_slab *slab;
    const void *bytes;
    size_t size;
    char text[5000];
    (void)state;
    memset(text, 'p', sizeof text);
    assert_int_equal(sv_slab_pool_create(1 << 20, &pool, NULL), SV_OK);
    assert_int_equal(sv_slab_take(pool, sizeof text, &slab, NULL), SV_OK);
    assert_int_equal(sv_slab_read(slab, 42, &bytes, &size, NULL), SV_EFORMAT); /* nothing there yet */
    assert_int_equal(sv_slab_write(sv_slab_fd(slab), 42, text, sizeof text, NULL), SV_OK);
    assert_int_equal(sv_slab_read(slab, 41, &bytes, &size, NULL), SV_EFORMAT); /* another job's */
    assert_int_equal(sv_slab_read(slab, 42, &bytes, &size, NULL), SV_OK);
    assert_int_equal(size, sizeof text);
    assert_memory_equal(bytes, text, size);
    sv_slab_give(slab);
    assert_int_equal(sv_slab_take(pool, sizeof text, &slab, NULL), SV_OK);
    assert_int_equal(sv_slab_read(slab, 42, &bytes, &size, NULL), SV_EFORMAT); /* used again: forgotten */
    sv_slab_discard(slab);
    sv_slab_pool_destroy(pool);
}

static void what_does_not_fit_is_refused(void **state)
{
    struct sv_slab_pool *pool;
    struct sv_slab *slab;
    struct sv_error error;
    static char large[1 << 17];
    (void)state;
    assert_int_equal(sv_slab_pool_create(1 << 20, &pool, NULL), SV_OK);
    assert_int_equal(sv_slab_take(pool, 100, &slab, NULL), SV_OK);
    assert_int_equal(sv_slab_write(sv_slab_fd(slab), 1, large, sizeof large, &error), SV_ELIMIT);
    sv_slab_give(slab);
    assert_int_equal(sv_slab_take(pool, 1 << 20, &slab, &error),
                     SV_ELIMIT); /* with its head: over the budget */
    assert_string_equal(error.field, "slab");
    assert_int_equal(sv_slab_take(pool, SIZE_MAX / 2, &slab, &error), SV_ELIMIT);
    sv_slab_pool_destroy(pool);
}

static void the_budget_holds_for_lent_and_kept(void **state)
{
    struct sv_slab_pool *pool;
    struct sv_slab *slabs[4], *large;
    struct sv_error error;
    (void)state;
    assert_int_equal(sv_slab_pool_create(4 << 16, &pool, NULL), SV_OK);
    for (int i = 0; i < 4; i++)
        assert_int_equal(sv_slab_take(pool, 1000, &slabs[i], NULL), SV_OK);
    assert_int_equal(sv_slab_pool_bytes(pool), 4 << 16);
    assert_int_equal(sv_slab_take(pool, 1000, &large, &error), SV_ELIMIT);
    assert_string_equal(error.field, "slab.busy");
    for (int i = 0; i < 4; i++)
        sv_slab_give(slabs[i]);
    assert_int_equal(sv_slab_pool_lent_bytes(pool), 0);
    assert_int_equal(sv_slab_pool_bytes(pool), 4 << 16);               /* kept */
    assert_int_equal(sv_slab_take(pool, 200000, &large, NULL), SV_OK); /* kept ones make room */
    assert_int_equal(sv_slab_pool_bytes(pool), 4 << 16);
    sv_slab_give(large);
    sv_slab_pool_destroy(pool);
}

static void it_can_neither_shrink_nor_grow(void **state)
{
    struct sv_slab_pool *pool;
    struct sv_slab *slab;
    (void)state;
    assert_int_equal(sv_slab_pool_create(1 << 20, &pool, NULL), SV_OK);
    assert_int_equal(sv_slab_take(pool, 1000, &slab, NULL), SV_OK);
    assert_int_not_equal(ftruncate(sv_slab_fd(slab), 0), 0);
    assert_int_not_equal(ftruncate(sv_slab_fd(slab), 1 << 20), 0);
    sv_slab_give(slab);
    sv_slab_pool_destroy(pool);
}

static void a_writer_takes_slabs_only(void **state)
{
    int plain = memfd_create("plain", MFD_CLOEXEC);
    (void)state;
    assert_int_equal(ftruncate(plain, 4096), 0);
    assert_int_equal(sv_slab_write(plain, 1, "x", 1, NULL), SV_EFORMAT);
    close(plain);
    assert_int_equal(sv_slab_write(-1, 1, "x", 1, NULL), SV_EFORMAT);
}

/* The pages that a large picture touched do not stay with a kept slab. */
static void a_kept_slab_gives_its_pages_back(void **state)
{
    enum { LARGE = 12 << 20 };
    struct sv_slab_pool *pool;
    struct sv_slab *slab;
    static char bytes[LARGE];
    static unsigned char pages[(LARGE >> 12) + 2];
    const void *data;
    size_t size, resident = 0;
    (void)state;
    memset(bytes, 1, sizeof bytes);
    assert_int_equal(sv_slab_pool_create(64 << 20, &pool, NULL), SV_OK);
    assert_int_equal(sv_slab_take(pool, LARGE, &slab, NULL), SV_OK);
    assert_int_equal(sv_slab_write(sv_slab_fd(slab), 1, bytes, LARGE, NULL), SV_OK);
    assert_int_equal(sv_slab_read(slab, 1, &data, &size, NULL), SV_OK);
    sv_slab_give(slab);
    assert_int_equal(sv_slab_take(pool, LARGE, &slab, NULL), SV_OK);
    void *start = (void *)((uintptr_t)data & ~(uintptr_t)4095);
    assert_int_equal(mincore(start, LARGE, pages), 0);
    for (size_t i = 0; i < LARGE >> 12; i++)
        resident += pages[i] & 1;
    assert_true(resident <= (4 << 20) >> 12);
    sv_slab_give(slab);
    sv_slab_pool_destroy(pool);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(bytes_pass_and_the_job_must_fit),
        cmocka_unit_test(what_does_not_fit_is_refused),
        cmocka_unit_test(the_budget_holds_for_lent_and_kept),
        cmocka_unit_test(it_can_neither_shrink_nor_grow),
        cmocka_unit_test(a_writer_takes_slabs_only),
        cmocka_unit_test(a_kept_slab_gives_its_pages_back),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
