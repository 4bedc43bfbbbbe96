#include "core/base/simd.h"

#include <stdlib.h>
#include <string.h>

static enum sv_simd detect(void)
{
    enum sv_simd best = SV_SIMD_SCALAR;
#if defined(__x86_64__)
    __builtin_cpu_init();
    best = __builtin_cpu_supports("avx2") && __builtin_cpu_supports("fma") ? SV_SIMD_AVX2 : SV_SIMD_SSE2;
#endif
    const char *wish = getenv("SV_SIMD");
    if (wish && strcmp(wish, "scalar") == 0)
        best = SV_SIMD_SCALAR;
    if (wish && strcmp(wish, "sse2") == 0 && best > SV_SIMD_SSE2)
        best = SV_SIMD_SSE2;
    return best;
}

enum sv_simd sv_simd_level(void)
{
    static int known = -1;
    if (known < 0)
        known = (int)detect();
    return (enum sv_simd)known;
}
