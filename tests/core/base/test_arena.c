/* test_arena.c - alignment, limits, sealing, and pages shared with a child. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <string.h>
#include <signal.h>
#include <sys/wait.h>
#include <unistd.h>
#include <cmocka.h>

#include "core/base/arena.h"

static struct sv_arena *make(size_t bytes)
{
    struct sv_arena *a = NULL;
    struct sv_error e;
    assert_int_equal(sv_arena_create(bytes, &a, &e), SV_OK);
    return a;
}

static void test_alloc(void **state)
{
    (void)state;
    struct sv_arena *a = make(1 << 20);
    unsigned char *last = NULL;
    for (size_t n = 0; n < 100; n++) {
        unsigned char *p = sv_arena_alloc(a, n, 3);
        assert_non_null(p);
        assert_int_equal((uintptr_t)p % 64, 0);
        for (size_t k = 0; k < 3 * n; k++)
            assert_int_equal(p[k], 0);
        memset(p, 0xAA, 3 * n);
        assert_true(p >= last);
        last = p + 3 * n;
    }
    assert_memory_equal(sv_arena_copy(a, "abc", 4), "abc", 4);
    assert_true(sv_arena_used(a) >= 3 * 99 * 100 / 2);
    sv_arena_destroy(a);
    sv_arena_destroy(NULL);
}

static void test_limits(void **state)
{
    (void)state;
    struct sv_arena *a = NULL;
    struct sv_error e;
    assert_int_equal(sv_arena_create(0, &a, &e), SV_EINVAL);
    assert_int_equal(sv_arena_create(((size_t)1 << 40) + 1, &a, &e), SV_EINVAL);
    assert_null(a);
    a = make(10000); /* 3 pages: 12288 */
    assert_null(sv_arena_alloc(a, 12289, 1));
    assert_null(sv_arena_alloc(a, SIZE_MAX / 2, 3));
    assert_non_null(sv_arena_alloc(a, 12288, 1));
    assert_null(sv_arena_alloc(a, 1, 1));
    assert_non_null(sv_arena_alloc(a, 0, 1));
    sv_arena_destroy(a);
}

static void test_huge_costs_nothing(void **state)
{
    (void)state;
    struct sv_arena *a = make((size_t)64 << 30);
    unsigned char *p = sv_arena_alloc(a, (size_t)32 << 30, 1);
    assert_non_null(p);
    p[(size_t)31 << 30] = 1;
    sv_arena_destroy(a);
}

/* A child sees what was written, and dies when it writes to a sealed arena. */
static void test_seal(void **state)
{
    (void)state;
    struct sv_arena *a = make(1 << 16);
    struct sv_error e;
    volatile int *p = sv_arena_alloc(a, 16, sizeof(int));
    p[3] = 42;
    assert_int_equal(sv_arena_seal(a, &e), SV_OK);
    assert_null(sv_arena_alloc(a, 1, 1));
    for (int write = 0; write < 2; write++) {
        pid_t child = fork();
        assert_true(child >= 0);
        if (child == 0) {
            if (p[3] != 42)
                _exit(3);
            if (write) { /* lift what could be lifted: the seal is in the kernel's mapping, not only in ours
                          */
                signal(SIGSEGV, SIG_DFL);
                p[3] = 43;
            }
            _exit(0);
        }
        int status;
        assert_int_equal(waitpid(child, &status, 0), child);
        if (write)
            assert_false(WIFEXITED(status) && WEXITSTATUS(status) == 0);
        else
            assert_true(WIFEXITED(status) && WEXITSTATUS(status) == 0);
    }
    assert_int_equal(p[3], 42);
    sv_arena_destroy(a);
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(test_alloc), cmocka_unit_test(test_limits),
                                       cmocka_unit_test(test_huge_costs_nothing),
                                       cmocka_unit_test(test_seal)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
