#include "core/base/arena.h"

#include <errno.h>
#include <fcntl.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>
#include <sys/mman.h>
#include <unistd.h>

struct sv_arena {
    unsigned char *base;
    size_t reserve, used;
    int fd;
    int sealed;
};

enum { ALIGN = 64, PAGE = 4096, LARGE = 2 << 20 };
#ifndef MADV_POPULATE_WRITE /* Linux 5.14 */
#define MADV_POPULATE_WRITE 23
#endif
#ifndef MADV_COLLAPSE /* Linux 6.1 */
#define MADV_COLLAPSE 25
#endif

/* The descriptor's memory, where large pages may begin. */
static void *map_at_large_page(int fd, size_t bytes)
{
    unsigned char *space =
        mmap(NULL, bytes + LARGE, PROT_NONE, MAP_PRIVATE | MAP_ANONYMOUS | MAP_NORESERVE, -1, 0);
    if (space == MAP_FAILED)
        return MAP_FAILED;
    size_t before = (LARGE - (uintptr_t)space % LARGE) % LARGE;
    void *base =
        mmap(space + before, bytes, PROT_READ | PROT_WRITE, MAP_SHARED | MAP_NORESERVE | MAP_FIXED, fd, 0);
    if (base == MAP_FAILED) {
        munmap(space, bytes + LARGE);
        return MAP_FAILED;
    }
    if (before > 0)
        munmap(space, before);
    munmap(space + before + bytes, LARGE - before);
    return base;
}

/* Large pages under [from, end): each is a fault for a process that reads it, where the small ones are tens,
 * 10 to 25 us each on a virtual machine. Where there are none to be had, small ones serve. */
static void enlarge_pages(struct sv_arena *a, size_t from, size_t end)
{
    size_t first = from / LARGE * LARGE, last = (end + LARGE - 1) / LARGE * LARGE;
    last = last > a->reserve ? a->reserve / LARGE * LARGE : last;
    if (first >= last)
        return;
    for (size_t at = first; at < last; at += LARGE) { /* one that holds nothing yet is not taken */
        volatile unsigned char *byte = a->base + (at < from ? from : at);
        *byte = *byte;
    }
    (void)madvise(a->base + first, last - first, MADV_COLLAPSE);
}

enum sv_status sv_arena_create(size_t reserve_bytes, struct sv_arena **arena, struct sv_error *error)
{
    if (reserve_bytes == 0 || reserve_bytes > (size_t)1 << 40)
        return sv_fail(error, SV_EINVAL, "reserve_bytes", "%zu is outside 1 .. 2^40", reserve_bytes);
    struct sv_arena *a = calloc(1, sizeof *a);
    if (!a)
        return sv_fail(error, SV_ENOMEM, NULL, "no memory for an arena");
    size_t page = reserve_bytes < LARGE ? PAGE : LARGE;
    a->reserve = (reserve_bytes + page - 1) / page * page;
    a->fd = memfd_create("sv-arena", MFD_CLOEXEC | MFD_ALLOW_SEALING);
    if (a->fd < 0 || ftruncate(a->fd, (off_t)a->reserve) != 0)
        goto fail;
    a->base = map_at_large_page(a->fd, a->reserve);
    if (a->base == MAP_FAILED)
        goto fail;
    *arena = a;
    return SV_OK;
fail:
    sv_fail(error, SV_ENOMEM, NULL, "cannot reserve %zu bytes: %s", reserve_bytes, strerror(errno));
    if (a->fd >= 0)
        close(a->fd);
    free(a);
    return SV_ENOMEM;
}

void sv_arena_destroy(struct sv_arena *arena)
{
    if (!arena)
        return;
    munmap(arena->base, arena->reserve);
    close(arena->fd);
    free(arena);
}

void *sv_arena_alloc(struct sv_arena *arena, size_t count, size_t size)
{
    size_t bytes;
    if (arena->sealed || __builtin_mul_overflow(count, size, &bytes))
        return NULL;
    if (bytes > arena->reserve - arena->used)
        return NULL;
    void *p = arena->base + arena->used;
    size_t step = (bytes + ALIGN - 1) / ALIGN * ALIGN;
    arena->used = step > arena->reserve - arena->used ? arena->reserve : arena->used + step;
    return p;
}

void *sv_arena_alloc_pages(struct sv_arena *arena, size_t count, size_t size)
{
    unsigned char *p = sv_arena_alloc(arena, count, size);
    if (!p)
        return NULL;
    size_t before = (uintptr_t)p % PAGE, bytes = count * size;
    if (bytes >= LARGE)
        enlarge_pages(arena, (size_t)(p - arena->base), (size_t)(p - arena->base) + bytes);
    /* Where the system does not know how, they come one by one. */
    (void)madvise(p - before, bytes + before, MADV_POPULATE_WRITE);
    return p;
}

void *sv_arena_copy(struct sv_arena *arena, const void *data, size_t bytes)
{
    void *p = sv_arena_alloc(arena, 1, bytes);
    if (p && bytes)
        memcpy(p, data, bytes);
    return p;
}

size_t sv_arena_used(const struct sv_arena *arena)
{
    return arena->used;
}

enum sv_status sv_arena_seal(struct sv_arena *arena, struct sv_error *error)
{
    enlarge_pages(arena, 0, arena->used / LARGE * LARGE);
    if (mprotect(arena->base, arena->reserve, PROT_READ) != 0)
        return sv_fail(error, SV_EINTERNAL, NULL, "mprotect of the arena: %s", strerror(errno));
    if (fcntl(arena->fd, F_ADD_SEALS, F_SEAL_SHRINK | F_SEAL_GROW | F_SEAL_FUTURE_WRITE | F_SEAL_SEAL) != 0)
        return sv_fail(error, SV_EINTERNAL, NULL, "sealing the arena: %s", strerror(errno));
    arena->sealed = 1;
    return SV_OK;
}
