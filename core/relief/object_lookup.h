/* object_lookup.h - rows of a sheet against the shadow map of object_shadow.c: what its scalar and its AVX2
 * kernel share. Private to them and their test. */
#ifndef SV_RELIEF_OBJECT_LOOKUP_H
#define SV_RELIEF_OBJECT_LOOKUP_H

#include <stdint.h>

#include "core/relief/lighting.h"

struct sv_relief_lookup {
    float at[3][4];     /* column, row (less half a pixel) and depth in the map by u, v, displ, 1 */
    float offset[3][3]; /* what is added to them by the normal's parts (* 32767) */
    float sun[3];       /* n . l > 0: texels that turn to the sun; others do not see it */
    const float *depth; /* of the map, width * height, each at least 2 */
    int width, height;
    float low, high; /* incoming - displ between these: a crevice */
};

/* A sheet; pointers to texel 0. incoming: row front, or NULL. lit: share of sunlight * 255; 0 for empty
 * texels. */
struct sv_relief_lookup_sheet {
    int width;
    const int16_t *normal[3];
    const float *displ, *incoming;
    const uint8_t (*color)[4];
    uint8_t *lit;
};

void sv_relief_lookup_scalar(const struct sv_relief_lookup *lookup,
                             const struct sv_relief_lookup_sheet *sheet, const struct sv_relief_eight *list,
                             int count);
/* The same bits, of a sheet at least eight texels wide. */
void sv_relief_lookup_avx2(const struct sv_relief_lookup *lookup, const struct sv_relief_lookup_sheet *sheet,
                           const struct sv_relief_eight *list, int count);

#endif
