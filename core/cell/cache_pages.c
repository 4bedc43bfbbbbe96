/* cache_pages.c - large pages under a panel.
 *
 * A panel is up to 1,700 small pages, and each process that reads it maps each of them at a fault of its own,
 * 7 us where the machine is virtual and its host shadows the page tables; who writes one first waits twice
 * that for it to be cleared. Two or three large pages are as many faults, and may be had of shared memory
 * whatever the system does by itself (MADV_COLLAPSE, Linux 6.1). */
#include <stdint.h>
#include <sys/mman.h>

#include "core/cell/cache_private.h"

#ifndef MADV_COLLAPSE
#define MADV_COLLAPSE 25
#endif
enum { LARGE = 2 << 20 };

/* Reads every small page of [first, last) once as a process does that has not written it. A host that shadows
 * page tables backs a large page by small ones, which it maps one after the other (0.6 ms in all) for the
 * first such reader, and keeps for all others: that is better done by who builds. */
static void read_ahead(char *first, char *last)
{
    size_t bytes = (size_t)(last - first);
    char *space = mmap(NULL, bytes + LARGE, PROT_NONE, MAP_PRIVATE | MAP_ANONYMOUS | MAP_NORESERVE, -1, 0);
    if (space == MAP_FAILED)
        return;
    char *at = space + (LARGE - (uintptr_t)space % LARGE) % LARGE;
    /* From no bytes on: the same memory once more. */
    const volatile char *twin = mremap(first, 0, bytes, MREMAP_MAYMOVE | MREMAP_FIXED, at);
    for (size_t k = 0; twin != MAP_FAILED && k < bytes; k += SV_CACHE_PAGE)
        (void)twin[k];
    munmap(space, bytes + LARGE);
}

void sv_cache_enlarge_pages(struct sv_cell_cache *cache, void *data, size_t bytes)
{
    char *begin = data, *end = begin + bytes, *block = (char *)cache;
    char *first = begin - (uintptr_t)begin % LARGE, *last = end + (LARGE - (uintptr_t)end % LARGE) % LARGE;
    if (first < block)
        first += LARGE;
    if (last > block + cache->total_bytes)
        last -= LARGE;
    if (first >= last)
        return;
    for (char *page = first; page < last; page += LARGE) /* one that holds nothing yet is not taken */
        *(volatile char *)(page < begin ? begin : page) = 0;
    if (madvise(first, (size_t)(last - first), MADV_COLLAPSE) == 0) /* else small ones serve */
        read_ahead(first, last);
}
