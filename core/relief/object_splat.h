/* object_splat.h - the splat of one sheet of a relief object, and which of its cells need be drawn. Private
 * to core/relief/object*.c. */
#ifndef SV_RELIEF_OBJECT_SPLAT_H
#define SV_RELIEF_OBJECT_SPLAT_H

#include "core/relief/object.h"

/* A block of texels: row0 <= row < row1, column0 <= column < column1. Cells that touch one of them are drawn.
 */
struct sv_relief_span {
    int row0, row1, column0, column1;
};

/* Spans of a sheet that hold all of it that may face an eye (a place of model space, or a unit direction): at
 * most (height + 7) / 8 of them, by rows. Returns how many. */
int sv_relief_object_spans(const struct sv_relief_object *object, int sheet, struct sv_vec3 eye,
                           bool is_place, struct sv_relief_span *spans);

/* As sv_warp_splat, within the spans. rims: (width + 1) * (height + 1) bytes, of the cells whose upper left
 * texel is (i - 1, j - 1): 0 where a cell need not be drawn (it may be). */
void sv_relief_splat(const struct sv_warp_source *source, unsigned k, const uint8_t *rims,
                     const struct sv_relief_span *spans, int span_count, struct sv_warp_buffer *buffer,
                     struct sv_warp_stats *stats);

#endif
