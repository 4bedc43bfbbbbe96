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

/* Spans of a sheet that hold all of it that may face an eye (a place of model space, or a unit direction):
 * blocks of tiles. Returns how many, at most spans_max of the object. */
int sv_relief_object_spans_max(const struct sv_relief_object *object);
int sv_relief_object_spans(const struct sv_relief_object *object, int sheet, struct sv_vec3 eye,
                           bool is_place, struct sv_relief_span *spans);

/* rims: what a cell is that must be drawn. */
enum { SV_RELIEF_CELL_SPARE, SV_RELIEF_CELL_FULL, SV_RELIEF_CELL_RIM };
/* Bytes that kernels may read past the last of them. */
enum { SV_RELIEF_RIMS_SLACK = 8 };

/* An eye in the axes of a sheet, and the sheet's normals. */
struct sv_relief_facing {
    const int16_t *normal[3]; /* by u, v, f; width * height */
    float eye[3];             /* from the sheet's origin, model space; or the direction to it */
    float pitch, near;        /* side of a texel, 1; 0, 0 for a direction */
};
struct sv_relief_facing sv_relief_object_facing(const struct sv_relief_object *object, int sheet,
                                                struct sv_vec3 eye, bool is_place);

/* As sv_warp_splat, within the spans, of what faces the eye. rims: (width + 1) * (height + 1) bytes, of the
 * cells whose upper left texel is (i - 1, j - 1): CELL_SPARE where it need not be drawn (it may be), and
 * SV_RELIEF_RIMS_SLACK bytes that are anything. */
void sv_relief_splat(const struct sv_warp_source *source, unsigned k, const uint8_t *rims,
                     const struct sv_relief_facing *facing, const struct sv_relief_span *spans,
                     int span_count, struct sv_warp_buffer *buffer, struct sv_warp_stats *stats);

/* Which groups of texels (lighting.h, sv_relief_list_eights) of `count` sources a picture shows. Of source k:
 * size, its groups (written), and room for a byte a texel within SV_RELIEF_SEEN_ROOM bytes: cell points
 * width + 1 bytes behind their beginning. Returns a bit a source of which anything is seen. */
struct sv_relief_seen {
    int width[SV_WARP_SOURCES_MAX], height[SV_WARP_SOURCES_MAX];
    uint8_t *cell[SV_WARP_SOURCES_MAX], *group[SV_WARP_SOURCES_MAX];
};
#define SV_RELIEF_SEEN_ROOM(width, height) (((size_t)(height) + 1) * (size_t)(width) + 1 + 8)
uint32_t sv_relief_find_seen(const struct sv_warp_buffer *buffer, const struct sv_relief_seen *seen,
                             unsigned count);

/* Closes gaps of one or two pixels along a row or a column: the farther of what is beside them goes on into
 * them. Returns how many pixels. */
uint32_t sv_relief_close_gaps(struct sv_warp_buffer *buffer);

#endif
