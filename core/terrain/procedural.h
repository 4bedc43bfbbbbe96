/* procedural.h - a terrain out of a seed: eroded hills and valleys, deterministic. */
#ifndef SV_TERRAIN_PROCEDURAL_H
#define SV_TERRAIN_PROCEDURAL_H

#include <stdint.h>

#include "core/base/arena.h"
#include "core/base/error.h"
#include "core/terrain/heightfield.h"

struct sv_procedural_options {
    double size_m;   /* side of the square, 1 .. 1e6 */
    int samples;     /* a side, 2 .. 8192 */
    double relief_m; /* highest minus lowest, 0 .. 9000, met exactly */
    uint64_t seed;
};

/* The square's south-west corner is at world (0, 0). Heights to the arena; lowest ground at z = 0. */
SV_MUST_CHECK enum sv_status sv_terrain_procedural(const struct sv_procedural_options *options, struct sv_arena *arena,
                                                   struct sv_heightfield *field, struct sv_error *error);

#endif
