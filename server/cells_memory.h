/* cells_memory.h - the block of shared memory that relief panels are in (core/cell/cache.h): made by a scene
 * process, whose workers have it by fork, and mapped by the daemon from its descriptor.
 *
 * It is sealed against shrinking, so that nobody's reading of it can fail, and takes memory only as panels
 * are written. */
#ifndef SV_SERVER_CELLS_MEMORY_H
#define SV_SERVER_CELLS_MEMORY_H

#include <stddef.h>
#include <stdint.h>

#include "core/cell/cache.h"

struct sv_cells_memory {
    struct sv_cell_cache *cache; /* NULL: there is none, and nothing else is set */
    void *memory;
    size_t bytes; /* 0: nothing is held */
    int fd;       /* owned; -1: none */
};

/* Makes a block with an empty cache. SV_EIO, and errors of sv_cell_cache_make. */
SV_MUST_CHECK enum sv_status sv_cells_memory_make(uint64_t bytes, struct sv_cells_memory *memory,
                                                  struct sv_error *error);
/* Maps a block of that many bytes that another process made. fd is borrowed. SV_EFORMAT: it is none; SV_EIO.
 */
SV_MUST_CHECK enum sv_status sv_cells_memory_open(int fd, uint64_t bytes, struct sv_cells_memory *memory,
                                                  struct sv_error *error);
void sv_cells_memory_close(struct sv_cells_memory *memory); /* zeroed or closed before: legal */

#endif
