/* object_seen.c - which groups of texels a picture shows (object_splat.h).
 *
 * buffer -> a byte for each cell that a pixel names -> a byte for each group of eight texels beside such a
 * cell. A pixel of a full cell mixes its four texels; one that is torn or filled (warp_resolve.c) may mix its
 * own texel with any of the eight around it, which are those of the four cells around it. */
#include <emmintrin.h>
#include <string.h>

#include "core/relief/object_splat.h"

static inline uint8_t *cell_of(const struct sv_relief_seen *seen, uint32_t texel)
{
    return seen->cell[texel >> SV_WARP_TEXEL_BITS & (SV_WARP_SOURCES_MAX - 1)] + (texel & SV_WARP_TEXEL_MASK);
}

/* Names the cells around a texel that a torn or filled pixel shows. */
static void name_around(const struct sv_relief_seen *seen, uint32_t texel)
{
    ptrdiff_t width = seen->width[texel >> SV_WARP_TEXEL_BITS & (SV_WARP_SOURCES_MAX - 1)];
    uint8_t *cell = cell_of(seen, texel);
    cell[0] = cell[-1] = cell[-width] = cell[-width - 1] = 1;
}

static void name_one(const struct sv_relief_seen *seen, uint32_t texel, unsigned place)
{
    if (texel == SV_WARP_EMPTY)
        return;
    if (place & 1)
        *cell_of(seen, texel) = 1;
    else
        name_around(seen, texel);
}

/* Names the cells of a row of pixels. */
static void name_cells(const struct sv_warp_buffer *buffer, size_t p, size_t end,
                       const struct sv_relief_seen *seen)
{
    const __m128i none = _mm_set1_epi32(-1);
    for (; p + 8 <= end; p += 8) {
        const uint32_t *texel = buffer->texel + p;
        const __m128i *from = (const __m128i *)(const void *)texel;
        __m128i empty = _mm_packs_epi32(_mm_cmpeq_epi32(_mm_loadu_si128(from), none),
                                        _mm_cmpeq_epi32(_mm_loadu_si128(from + 1), none));
        __m128i full =
            _mm_slli_epi16(_mm_loadu_si128((const __m128i *)(const void *)(buffer->place + p)), 15);
        unsigned held = ~(unsigned)_mm_movemask_epi8(_mm_packs_epi16(empty, empty)) & 255;
        unsigned whole = (unsigned)_mm_movemask_epi8(_mm_packs_epi16(full, full)) & held;
        if (whole == 255) {
            for (int k = 0; k < 8; k++)
                *cell_of(seen, texel[k]) = 1;
            continue;
        }
        for (unsigned k = 0; held >> k; k++)
            if (held >> k & 1)
                name_one(seen, texel[k], whole >> k & 1);
    }
    for (; p < end; p++)
        name_one(seen, buffer->texel[p], buffer->place[p]);
}

static inline uint64_t eight(const uint8_t *at)
{
    uint64_t v;
    memcpy(&v, at, 8);
    return v;
}

/* cell: of the row's first texel. Bytes that are read past a row's end are cells of the next. */
static bool any_of_row(const uint8_t *cell, int width, uint8_t *group)
{
    unsigned any = 0;
    const uint8_t *above = cell - width;
    for (int i = 0; i < width; i += 8) {
        uint64_t beside = eight(cell + i) | eight(cell + i - 1) | eight(above + i) | eight(above + i - 1);
        any |= *group++ = beside != 0;
    }
    return any != 0;
}

uint32_t sv_relief_find_seen(const struct sv_warp_buffer *buffer, const struct sv_relief_seen *seen,
                             unsigned count)
{
    uint32_t shown = 0;
    for (unsigned k = 0; k < count; k++)
        memset(seen->cell[k] - seen->width[k] - 1, 0, SV_RELIEF_SEEN_ROOM(seen->width[k], seen->height[k]));
    for (int j = buffer->y0; j < buffer->y1; j++) {
        size_t row = (size_t)j * (size_t)buffer->width;
        name_cells(buffer, row + (size_t)buffer->x0, row + (size_t)buffer->x1, seen);
    }
    for (unsigned k = 0; k < count; k++) {
        size_t stride = ((size_t)seen->width[k] + 7) / 8;
        bool any = false;
        for (int j = 0; j < seen->height[k]; j++)
            any |= any_of_row(seen->cell[k] + (size_t)j * (size_t)seen->width[k], seen->width[k],
                              seen->group[k] + (size_t)j * stride);
        shown |= (uint32_t)any << k;
    }
    return shown;
}
