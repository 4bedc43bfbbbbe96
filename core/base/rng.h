/* rng.h - deterministic randomness: the same on every machine and compiler (integers and one exact conversion only).
 *
 * splitmix64 (Steele, Lea, Flood 2014) as generator and as hash. Not for secrets. */
#ifndef SV_BASE_RNG_H
#define SV_BASE_RNG_H

#include <stdint.h>

struct sv_rng {
    uint64_t state;
};

static inline uint64_t sv_mix64(uint64_t z)
{
    z = (z ^ (z >> 30)) * UINT64_C(0xBF58476D1CE4E5B9);
    z = (z ^ (z >> 27)) * UINT64_C(0x94D049BB133111EB);
    return z ^ (z >> 31);
}
static inline uint64_t sv_rng_next(struct sv_rng *rng)
{
    rng->state += UINT64_C(0x9E3779B97F4A7C15);
    return sv_mix64(rng->state);
}
/* Independent streams from one seed: stream is any label. */
static inline struct sv_rng sv_rng_seeded(uint64_t seed, uint64_t stream)
{
    return (struct sv_rng){sv_mix64(seed + UINT64_C(0x9E3779B97F4A7C15)) ^ sv_mix64(~stream)};
}
/* Uniform in [0, 1), 53 bits. */
static inline double sv_rng_unit(struct sv_rng *rng)
{
    return (double)(sv_rng_next(rng) >> 11) * 0x1p-53;
}
static inline double sv_rng_range(struct sv_rng *rng, double lo, double hi)
{
    return lo + (hi - lo) * sv_rng_unit(rng);
}

#endif
