/* lod_private.h - what lod_build.c fills and lod.c walks: the packed error and radius of every vertex's
 * diamond. */
#ifndef SV_TERRAIN_LOD_PRIVATE_H
#define SV_TERRAIN_LOD_PRIVATE_H

#include <stdint.h>
#include <string.h>

#include "core/terrain/lod.h"

/* Vertices of the padded grid beyond the field: a hash table with open addressing. key: j * (side + 1) + i,
 * plus 1; 0 is empty. */
struct sv_lod_outside {
    uint32_t *keys, *values;
    uint32_t capacity, count; /* capacity: a power of two, or 0 */
};

struct sv_terrain_lod {
    const struct sv_heightfield *field;
    int side;                           /* 2^k: cells of the padded grid a side */
    double error_unit_m, radius_unit_m; /* powers of two */
    uint32_t *packed;                   /* a sample: error << 16 | radius */
    struct sv_lod_outside outside;
};

/* A 16-bit float without sign: 5 bits of exponent, 11 of mantissa, 2^-15 .. 2^17; 0 stands for 2^-15 and
 * below. */
static inline double sv_lod_unpack(uint32_t bits16)
{
    uint32_t bits = (bits16 << 12) + (UINT32_C(112) << 23);
    float value;
    memcpy(&value, &bits, sizeof value);
    return (double)value;
}

static inline double sv_lod_error_m(const struct sv_terrain_lod *lod, uint32_t packed)
{
    return sv_lod_unpack(packed >> 16) * lod->error_unit_m;
}
static inline double sv_lod_radius_m(const struct sv_terrain_lod *lod, uint32_t packed)
{
    return sv_lod_unpack(packed & 0xFFFF) * lod->radius_unit_m;
}

/* Slot of a padded vertex in the table: where it is, or the empty one where it would be. capacity > 0. */
static inline uint32_t sv_lod_slot(const struct sv_lod_outside *table, uint32_t key)
{
    uint32_t slot = (key * UINT32_C(0x9E3779B1)) & (table->capacity - 1);
    while (table->keys[slot] && table->keys[slot] != key)
        slot = (slot + 1) & (table->capacity - 1);
    return slot;
}

/* The packed pair of a padded vertex that exists. */
static inline uint32_t sv_lod_packed(const struct sv_terrain_lod *lod, int i, int j)
{
    if (i < lod->field->width && j < lod->field->height)
        return lod->packed[(size_t)j * (size_t)lod->field->width + (size_t)i];
    uint32_t key = (uint32_t)j * (uint32_t)(lod->side + 1) + (uint32_t)i + 1;
    return lod->outside.values[sv_lod_slot(&lod->outside, key)];
}

/* Allocates and measures. */
SV_MUST_CHECK enum sv_status sv_lod_measure(struct sv_terrain_lod *lod, struct sv_error *error);

#endif
