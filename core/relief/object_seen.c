/* object_seen.c - which groups of texels a picture shows (object_splat.h).
 *
 * buffer -> the names of its pixels that differ from those to the left and above -> a byte for each cell that
 * is named -> a byte for each group of eight texels beside such a cell. A pixel of a full cell mixes its four
 * texels; one that is torn or filled (warp_resolve.c) may mix its own texel with any of the eight around it,
 * which are those of the four cells around it. */
#include <string.h>

#include "core/relief/object_splat_kernel.h"

enum { STRIP = 512 }; /* columns that are looked at together */

int sv_relief_names_scalar(const uint32_t *texel, const uint16_t *place, int count, uint32_t *above,
                           uint32_t *names)
{
    uint32_t before = SV_RELIEF_NO_NAME;
    int n = 0;
    for (int i = 0; i < count; i++) {
        uint32_t name = texel[i] == SV_WARP_EMPTY ? SV_RELIEF_NO_NAME : texel[i] << 1 | (place[i] & 1u);
        names[n] = name;
        n += name != SV_RELIEF_NO_NAME && name != before && name != above[i];
        above[i] = before = name;
    }
    return n;
}

/* Marks the cells that are named: one of a pixel in a full cell, else the four around the texel. */
static void mark_cells(const struct sv_relief_seen *seen, const uint32_t *names, int count)
{
    for (int i = 0; i < count; i++) {
        uint32_t texel = names[i] >> 1;
        unsigned k = texel >> SV_WARP_TEXEL_BITS;
        uint8_t *cell = seen->cell[k] + (texel & SV_WARP_TEXEL_MASK);
        *cell = 1;
        if (names[i] & 1)
            continue;
        ptrdiff_t width = seen->width[k];
        cell[-1] = cell[-width] = cell[-width - 1] = 1;
    }
}

static inline uint64_t eight(const uint8_t *at)
{
    uint64_t v;
    memcpy(&v, at, 8);
    return v;
}

/* cell: of the row's first texel. Bytes that are read past a row's end are cells of the next. */
static void mark_groups(const uint8_t *cell, int width, bool wide, uint8_t *group)
{
    const uint8_t *upper = cell - width;
    for (int i = wide ? sv_relief_beside_avx2(cell, width, group) : 0; i < width; i += 8)
        group[i / 8] = (eight(cell + i) | eight(cell + i - 1) | eight(upper + i) | eight(upper + i - 1)) != 0;
}

/* Marks what columns x0 .. x1 of a picture name, at most STRIP. */
static void mark_strip(const struct sv_warp_buffer *buffer, int x0, int x1, bool wide,
                       const struct sv_relief_seen *seen)
{
    uint32_t above[STRIP], names[STRIP + SV_RELIEF_NAMES_SLACK];
    memset(above, 255, sizeof above);
    for (int j = buffer->y0; j < buffer->y1; j++) {
        size_t p = (size_t)j * (size_t)buffer->width + (size_t)x0;
        int n = wide ? sv_relief_names_avx2(buffer->texel + p, buffer->place + p, x1 - x0, above, names)
                     : sv_relief_names_scalar(buffer->texel + p, buffer->place + p, x1 - x0, above, names);
        mark_cells(seen, names, n);
    }
}

uint32_t sv_relief_find_seen_at(enum sv_simd level, const struct sv_warp_buffer *buffer,
                                const struct sv_relief_seen *seen, unsigned count)
{
    const bool wide = level >= SV_SIMD_AVX2;
    uint32_t shown = 0;
    for (unsigned k = 0; k < count; k++)
        memset(seen->cell[k] - seen->width[k] - 1, 0, SV_RELIEF_SEEN_ROOM(seen->width[k], seen->height[k]));
    for (int x = buffer->x0; x < buffer->x1; x += STRIP)
        mark_strip(buffer, x, x + STRIP < buffer->x1 ? x + STRIP : buffer->x1, wide, seen);
    for (unsigned k = 0; k < count; k++) {
        size_t width = (size_t)seen->width[k], stride = (width + 7) / 8;
        for (int j = 0; j < seen->height[k]; j++)
            mark_groups(seen->cell[k] + (size_t)j * width, (int)width, wide,
                        seen->group[k] + (size_t)j * stride);
        bool any = memchr(seen->group[k], 1, stride * (size_t)seen->height[k]) != NULL;
        shown |= (uint32_t)any << k;
    }
    return shown;
}

uint32_t sv_relief_find_seen(const struct sv_warp_buffer *buffer, const struct sv_relief_seen *seen,
                             unsigned count)
{
    return sv_relief_find_seen_at(sv_simd_level(), buffer, seen, count);
}
