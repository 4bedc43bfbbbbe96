/* test_simd.c - SV_SIMD lowers the level and never raises it; the answer stays. One process a wish, for the
 * level is decided once. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>

#include <cmocka.h>
#include <sys/wait.h>
#include <unistd.h>

#include "core/base/simd.h"

/* The level of a fresh process with that wish; NULL: none. */
static int level_with(const char *wish)
{
    pid_t pid = fork();
    if (pid == 0) {
        if (wish ? setenv("SV_SIMD", wish, 1) : unsetenv("SV_SIMD"))
            _exit(100);
        int first = (int)sv_simd_level();
        setenv("SV_SIMD", "scalar", 1);
        _exit((int)sv_simd_level() == first ? first : 101);
    }
    assert_true(pid > 0);
    int status;
    assert_int_equal(waitpid(pid, &status, 0), pid);
    assert_true(WIFEXITED(status));
    return WEXITSTATUS(status);
}

static void wishes_lower_the_level(void **state)
{
    (void)state;
    int best = level_with(NULL);
    assert_in_range(best, SV_SIMD_SCALAR, SV_SIMD_AVX2);
    assert_int_equal(level_with("scalar"), SV_SIMD_SCALAR);
    assert_int_equal(level_with("sse2"), best < SV_SIMD_SSE2 ? best : SV_SIMD_SSE2);
    assert_int_equal(level_with("avx2"), best);
    assert_int_equal(level_with("nonsense"), best);
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(wishes_lower_the_level)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
