/* bands.h - the slab in which workers put together one picture, of which each draws a band of rows.
 *
 * It holds what each band tells of its drawing, the picture's layers, row by row, as struct sv_picture has
 * them, and room for the encoded bytes. A worker puts its rows there and sets its band's bit in a word of the
 * slab's head; whoever sets the last one has all of the picture, encodes it, and writes the bytes as for any
 * other view. A band that is drawn again (its worker died) finds its own bit set or not: it has the last one
 * whenever the others are there. Another word holds what they agreed on (core/view/bands.h). Who dies leaves
 * nothing locked. */
#ifndef SV_SERVER_BANDS_H
#define SV_SERVER_BANDS_H

#include <stdbool.h>

#include "core/view/bands.h"
#include "core/view/picture.h"
#include "core/view/request.h"
#include "core/view/timings.h"
#include "server/slab.h"

enum { SV_BANDS_MAX = 2 };

/* Bytes of data of a slab in which bands of that view are put together, before its encoded bytes. */
size_t sv_bands_bytes(const struct sv_view_request *request);

/* What a band tells. */
struct sv_bands_part {
    struct sv_timings timings;
    struct sv_draw_stats stats;
    struct sv_draw_took took;
};

/* Worker's side. */
struct sv_bands_map {
    struct sv_slab_map slab;   /* zero at first; stays mapped from view to view */
    struct sv_picture picture; /* of all rows, in the slab */
    struct sv_bands_part *parts;
};
/* SV_EFORMAT, SV_ENOMEM as sv_slab_map, SV_ELIMIT: the slab is too small. */
SV_MUST_CHECK enum sv_status sv_bands_map(int fd, const struct sv_view_request *request,
                                          struct sv_bands_map *map, struct sv_error *error);
/* Unmaps what is too large to be kept. */
void sv_bands_leave(struct sv_bands_map *map);
/* Commits the encoded picture. */
SV_MUST_CHECK enum sv_status sv_bands_end(struct sv_bands_map *map, const struct sv_view_request *request,
                                          uint64_t job, const void *bytes, size_t size,
                                          struct sv_error *error);
/* What is to be agreed on by those who draw; borrows the map. */
struct sv_bands sv_bands_shared(struct sv_bands_map *map);
/* Copies the band's rows from row_first on, and what it tells; true: all of count bands are there. */
bool sv_bands_put(struct sv_bands_map *map, int band, int count, int row_first, const struct sv_picture *rows,
                  const struct sv_bands_part *part);
/* What all bands tell together: of times the longest of each stage, what a client waits for; took: the sum.
 * Panels that several bands show count in each. */
struct sv_bands_part sv_bands_join(const struct sv_bands_part *parts, int count);

#endif
