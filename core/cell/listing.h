/* listing.h - panels of a cache as the cells that they belong to.
 *
 * Pure logic over what sv_cell_cache_list copied; any thread. */
#ifndef SV_CELL_LISTING_H
#define SV_CELL_LISTING_H

#include "core/cell/cache.h"

/* A cell: panels drawn from one reference point, of one size, light and scene. */
struct sv_cell_listed {
    uint64_t id;           /* as Silvista-Cell tells it for a view's innermost ring of crowns */
    struct sv_vec3 centre; /* of the cell; its reference point is place.v */
    struct sv_cell_place place;
    double distance_m;  /* of the panels: they show what is beyond that cube */
    double outer_m;     /* and within this one; INFINITY: no end */
    double half_axis_m; /* of the region of eyes that share it: the rhombic dodecahedron about the centre */
    int size;           /* texels a side */
    uint64_t bytes, hits;
    double age_s;        /* since the youngest panel was built */
    size_t first, count; /* panels: items[first .. first + count - 1] */
};

/* Sorts items so that those of one cell are neighbours, inner rings first, and writes one cell for each such
 * run into cells (room for count); returns how many cells there are. Pages of shadow (SV_PANEL_SHADOW) belong
 * to none: they come last. */
size_t sv_cell_listing(struct sv_cell_cache_item *items, size_t count, struct sv_cell_listed *cells);
/* How many pages of shadow there are, without those that are being cast. */
size_t sv_cell_listing_shadows(const struct sv_cell_cache_item *items, size_t count);

#endif
