/* simd.h - which instruction set a kernel may use, decided once at start.
 *
 * Release builds are portable x86-64 (SSE2); a kernel with an AVX2 version lives in NAME_avx2.c, compiled with -mavx2
 * -mfma, and is chosen at run time. SV_SIMD=scalar|sse2|avx2 in the environment lowers the choice (tests, benchmarks). */
#ifndef SV_BASE_SIMD_H
#define SV_BASE_SIMD_H

enum sv_simd { SV_SIMD_SCALAR, SV_SIMD_SSE2, SV_SIMD_AVX2 };

/* The best level that this CPU and the environment allow; the same answer for the life of the process. */
enum sv_simd sv_simd_level(void);

#endif
