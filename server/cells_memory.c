#include "server/cells_memory.h"

#include <errno.h>
#include <fcntl.h>
#include <string.h>
#include <sys/mman.h>
#include <sys/stat.h>
#include <unistd.h>

enum { LARGE = 2 << 20 }; /* bytes of a large page */
static const int seals = F_SEAL_SHRINK | F_SEAL_GROW | F_SEAL_SEAL;

/* The whole file at a multiple of LARGE, where a large page of it can be mapped; MAP_FAILED. */
static void *map_aligned(int fd, size_t bytes)
{
    size_t room = bytes + LARGE;
    char *space = mmap(NULL, room, PROT_NONE, MAP_PRIVATE | MAP_ANONYMOUS | MAP_NORESERVE, -1, 0);
    if (space == MAP_FAILED)
        return MAP_FAILED;
    size_t skip = (LARGE - (uintptr_t)space % LARGE) % LARGE, used = skip + (bytes + 4095) / 4096 * 4096;
    void *memory = mmap(space + skip, bytes, PROT_READ | PROT_WRITE, MAP_SHARED | MAP_NORESERVE | MAP_FIXED, fd, 0);
    if (memory == MAP_FAILED)
        used = skip = 0;
    if (skip > 0)
        munmap(space, skip);
    if (used < room)
        munmap(space + used, room - used);
    return memory;
}

static enum sv_status map(int fd, struct sv_cells_memory *m, struct sv_error *error)
{
    void *memory = map_aligned(fd, m->bytes);
    if (memory == MAP_FAILED)
        return sv_fail(error, SV_EIO, "cells", "mapping %zu bytes: %s", m->bytes, strerror(errno));
    /* A panel is 1,500 small pages, each mapped at a fault of its own in each worker; a few large ones where the system
     * lets shared memory have them (shmem_enabled), or gives them when it is asked again (core/cell/cache_pages.c). */
    (void)madvise(memory, m->bytes, MADV_HUGEPAGE);
    m->memory = memory;
    return SV_OK;
}

enum sv_status sv_cells_memory_make(uint64_t bytes, struct sv_cells_memory *memory, struct sv_error *error)
{
    struct sv_cells_memory m = {.bytes = (size_t)bytes,
                                .fd = memfd_create("silvista-cells", MFD_CLOEXEC | MFD_ALLOW_SEALING)};
    struct sv_cell_cache_options options = SV_CELL_CACHE_OPTIONS_DEFAULT;
    enum sv_status status;
    if (m.fd < 0 || ftruncate(m.fd, (off_t)bytes) || fcntl(m.fd, F_ADD_SEALS, seals))
        status = sv_fail(error, SV_EIO, "cells", "memory of %llu bytes: %s", (unsigned long long)bytes,
                         strerror(errno));
    else
        status = map(m.fd, &m, error);
    if (!status)
        status = sv_cell_cache_make(m.memory, m.bytes, &options, &m.cache, error);
    if (status) {
        sv_cells_memory_close(&m);
        return status;
    }
    *memory = m;
    return SV_OK;
}

enum sv_status sv_cells_memory_open(int fd, uint64_t bytes, struct sv_cells_memory *memory,
                                    struct sv_error *error)
{
    struct stat st;
    struct sv_cells_memory m = {.bytes = (size_t)bytes, .fd = -1};
    int have = fcntl(fd, F_GET_SEALS);
    if (have < 0 || (have & F_SEAL_SHRINK) == 0 || fstat(fd, &st) || st.st_size != (off_t)bytes || bytes == 0)
        return sv_fail(error, SV_EFORMAT, "cells", "the descriptor is no sealed block of %llu bytes",
                       (unsigned long long)bytes);
    enum sv_status status = map(fd, &m, error);
    if (!status)
        status = sv_cell_cache_open(m.memory, m.bytes, &m.cache, error);
    if (status) {
        sv_cells_memory_close(&m);
        return status;
    }
    *memory = m;
    return SV_OK;
}

void sv_cells_memory_close(struct sv_cells_memory *memory)
{
    if (memory->memory)
        munmap(memory->memory, memory->bytes);
    if (memory->bytes && memory->fd >= 0)
        close(memory->fd);
    *memory = (struct sv_cells_memory){.fd = -1};
}
