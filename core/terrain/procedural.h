/* procedural.h - a terrain out of a seed: eroded hills and valleys, deterministic. */
#ifndef SV_TERRAIN_PROCEDURAL_H
#define SV_TERRAIN_PROCEDURAL_H

#include <stdint.h>

#include "core/base/arena.h"
#include "core/base/error.h"
#include "core/terrain/heightfield.h"

/* Version of the builder: part of cache keys; raise it whenever the output changes. */
#define SV_PROCEDURAL_VERSION 1

struct sv_procedural_options {
    double size_m;   /* side of the square, 1 .. 1e6 */
    int samples;     /* a side, 2 .. 8192 */
    double relief_m; /* highest minus lowest, 0 .. 9000, met exactly */
    uint64_t seed;
};

/* The square's south-west corner is at world (0, 0). Heights to the arena; lowest ground at z = 0, the
 * highest at exactly (float)relief_m. The same options give the same bits on every machine; a seed is the
 * same land at any size, relief and number of samples. 1025 x 1025 take about 2 s, 30 bytes a sample for the
 * time. SV_EINVAL out of range, SV_ENOMEM. */
SV_MUST_CHECK enum sv_status sv_terrain_procedural(const struct sv_procedural_options *options,
                                                   struct sv_arena *arena, struct sv_heightfield *field,
                                                   struct sv_error *error);

/* The field around heights that sv_terrain_procedural made with these options (borrowed). */
struct sv_heightfield sv_terrain_procedural_field(const struct sv_procedural_options *options,
                                                  const float *heights);

#endif
