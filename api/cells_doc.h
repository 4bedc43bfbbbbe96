/* cells_doc.h - the document of GET /v1/cells: relief cells in memory, and what is being built ahead.
 *
 * Facts come as plain values (core/cell/listing.h). No socket, no clock. */
#ifndef SV_API_CELLS_DOC_H
#define SV_API_CELLS_DOC_H

#include <stddef.h>
#include <stdint.h>

#include "core/cell/listing.h"

struct sv_cells_facts {
    const struct sv_cell_listed *cells;
    size_t cell_count;
    const struct sv_cell_cache_item *items; /* that the cells' first and count speak of */
    struct sv_cell_cache_stats stats;
    size_t shadows; /* of the panels that stats counts: pages of shadow, which belong to no cell */
    size_t ahead; /* jobs that build ahead, waiting or running */
    size_t refine; /* views whose panels are to be refined */
};

/* Heap text of *bytes bytes; NULL when out of memory. */
char *sv_api_cells_doc(const struct sv_cells_facts *facts, size_t *bytes);

/* What POST /v1/cells answers: the ids of its jobs. */
char *sv_api_cells_jobs(const uint64_t *ids, size_t count, size_t *bytes);

#endif
