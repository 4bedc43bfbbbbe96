/* hash.h - 64-bit FNV-1a with a splitmix finish: keys of caches, scene versions, ETags. Not for secrets or adversaries.
 *
 * Feed fields one by one; strings with their length, so that ("a","bc") and ("ab","c") differ. */
#ifndef SV_BASE_HASH_H
#define SV_BASE_HASH_H

#include <stddef.h>
#include <stdint.h>
#include <string.h>

#include "core/base/rng.h"

#define SV_HASH_INIT UINT64_C(0xCBF29CE484222325)

static inline uint64_t sv_hash_bytes(uint64_t h, const void *data, size_t size)
{
    const unsigned char *p = data;
    for (; size >= 8; size -= 8, p += 8) { /* eight bytes a step: models and DEMs are large */
        uint64_t v;
        memcpy(&v, p, 8);
        h = (h ^ v) * UINT64_C(0x100000001B3);
        h ^= h >> 29;
    }
    for (size_t i = 0; i < size; i++)
        h = (h ^ p[i]) * UINT64_C(0x100000001B3);
    return h;
}
static inline uint64_t sv_hash_u64(uint64_t h, uint64_t v)
{
    return sv_hash_bytes(h, &v, sizeof v);
}
/* -0 and 0 hash alike; every NaN hashes alike. */
static inline uint64_t sv_hash_double(uint64_t h, double v)
{
    uint64_t bits;
    v = v == 0 ? 0 : v;
    memcpy(&bits, &v, sizeof bits);
    return sv_hash_u64(h, v != v ? UINT64_C(0x7FF8000000000000) : bits);
}
static inline uint64_t sv_hash_string(uint64_t h, const char *s)
{
    size_t n = strlen(s);
    return sv_hash_bytes(sv_hash_u64(h, n), s, n);
}
static inline uint64_t sv_hash_done(uint64_t h)
{
    return sv_mix64(h);
}

#endif
