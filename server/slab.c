#include "server/slab.h"

#include <errno.h>
#include <fcntl.h>
#include <stdatomic.h>
#include <stdbool.h>
#include <stdlib.h>
#include <string.h>
#include <sys/mman.h>
#include <sys/stat.h>
#include <unistd.h>

#define SLAB_MAGIC UINT64_C(0x3142414C53565331)
/* Classes are powers of two from 64 KiB: a 512 x 512 JPEG fits the least, and a slab is found again by its
 * size_class. */
enum { CLASS_MIN_BITS = 16, CLASS_COUNT = 24, KEPT_A_CLASS = 8 };
/* Pages beyond this that a picture touched go back to the system with the slab. 1024 x 768 pixels of bands fit. */
enum { KEPT_RESIDENT_BYTES = 4 << 20 };

struct slab_head {
    uint64_t magic;
    uint64_t capacity;       /* bytes of data behind the head */
    uint64_t at, size;       /* of what was written: where in the data, and its bytes */
    _Atomic uint64_t commit; /* the job's id, written last; 0: nothing there */
    _Atomic uint32_t words[SV_SLAB_WORDS]; /* data starts on a cache line behind them */
};

struct sv_slab {
    struct sv_slab_pool *pool;
    struct sv_slab *next;
    struct slab_head *head;
    size_t mapped_bytes;
    unsigned size_class;
    int fd;
};

struct sv_slab_pool {
    uint64_t budget_bytes, bytes, lent_bytes;
    struct sv_slab *kept[CLASS_COUNT];
    unsigned kept_count[CLASS_COUNT];
};

static const int slab_seals = F_SEAL_SHRINK | F_SEAL_GROW | F_SEAL_SEAL;

enum sv_status sv_slab_map(int fd, struct sv_slab_map *map, struct sv_error *error)
{
    struct stat st;
    if (map->memory && fstat(fd, &st) == 0 && (uint64_t)st.st_ino == map->inode)
        return SV_OK;
    sv_slab_unmap(map);
    int seals = fcntl(fd, F_GET_SEALS);
    if (seals < 0 || (seals & (F_SEAL_SHRINK | F_SEAL_GROW)) != (F_SEAL_SHRINK | F_SEAL_GROW) ||
        fstat(fd, &st) || st.st_size < (off_t)sizeof(struct slab_head))
        return sv_fail(error, SV_EFORMAT, "slab", "the descriptor is no sealed slab");
    size_t mapped = (size_t)st.st_size;
    struct slab_head *head = mmap(NULL, mapped, PROT_READ | PROT_WRITE, MAP_SHARED, fd, 0);
    if (head == MAP_FAILED)
        return sv_fail(error, SV_ENOMEM, "slab", "mapping %zu bytes: %s", mapped, strerror(errno));
    if (head->magic != SLAB_MAGIC) {
        munmap(head, mapped);
        return sv_fail(error, SV_EFORMAT, "slab", "the descriptor is no slab");
    }
    *map = (struct sv_slab_map){.memory = head,
                                .mapped_bytes = mapped,
                                .inode = (uint64_t)st.st_ino,
                                .words = head->words,
                                .data = (uint8_t *)(head + 1),
                                .capacity = mapped - sizeof *head};
    return SV_OK;
}

void sv_slab_unmap(struct sv_slab_map *map)
{
    if (map->memory)
        munmap(map->memory, map->mapped_bytes);
    *map = (struct sv_slab_map){0};
}

enum sv_status sv_slab_put(struct sv_slab_map *map, uint64_t job, size_t at, const void *bytes, size_t size,
                           struct sv_error *error)
{
    struct slab_head *head = map->memory;
    if (at > map->capacity || size > map->capacity - at)
        return sv_fail(error, SV_ELIMIT, "slab", "%zu bytes do not fit the %zu of the slab from %zu on", size,
                       map->capacity, at);
    if (size)
        memcpy(map->data + at, bytes, size);
    head->at = at;
    head->size = size;
    atomic_store_explicit(&head->commit, job, memory_order_release);
    return SV_OK;
}

enum sv_status sv_slab_write(int fd, uint64_t job, const void *bytes, size_t size, struct sv_error *error)
{
    struct sv_slab_map map = {0};
    enum sv_status status = sv_slab_map(fd, &map, error);
    if (status == SV_OK)
        status = sv_slab_put(&map, job, 0, bytes, size, error);
    sv_slab_unmap(&map);
    return status;
}

enum sv_status sv_slab_pool_create(uint64_t budget_bytes, struct sv_slab_pool **pool, struct sv_error *error)
{
    struct sv_slab_pool *p = calloc(1, sizeof *p);
    if (!p)
        return sv_fail(error, SV_ENOMEM, "slab", "out of memory");
    p->budget_bytes = budget_bytes;
    *pool = p;
    return SV_OK;
}

void sv_slab_discard(struct sv_slab *slab)
{
    if (!slab)
        return;
    slab->pool->bytes -= slab->mapped_bytes;
    slab->pool->lent_bytes -= slab->mapped_bytes;
    munmap(slab->head, slab->mapped_bytes);
    close(slab->fd);
    free(slab);
}

/* Frees one kept slab of that size_class. */
static void drop_kept(struct sv_slab_pool *pool, unsigned size_class)
{
    struct sv_slab *slab = pool->kept[size_class];
    pool->kept[size_class] = slab->next;
    pool->kept_count[size_class]--;
    pool->lent_bytes += slab->mapped_bytes; /* sv_slab_discard takes it off again */
    sv_slab_discard(slab);
}

void sv_slab_pool_destroy(struct sv_slab_pool *pool)
{
    if (!pool)
        return;
    for (unsigned c = 0; c < CLASS_COUNT; c++)
        while (pool->kept[c])
            drop_kept(pool, c);
    free(pool);
}

static enum sv_status slab_make(struct sv_slab_pool *pool, unsigned size_class, struct sv_slab **out,
                                struct sv_error *error)
{
    size_t mapped = (size_t)1 << (CLASS_MIN_BITS + size_class);
    struct sv_slab *slab = calloc(1, sizeof *slab);
    int fd = memfd_create("silvista-slab", MFD_CLOEXEC | MFD_ALLOW_SEALING);
    void *memory = MAP_FAILED;
    if (slab && fd >= 0 && ftruncate(fd, (off_t)mapped) == 0 && fcntl(fd, F_ADD_SEALS, slab_seals) == 0)
        memory = mmap(NULL, mapped, PROT_READ | PROT_WRITE, MAP_SHARED, fd, 0);
    if (memory == MAP_FAILED) {
        int saved = errno;
        if (fd >= 0)
            close(fd);
        free(slab);
        return sv_fail(error, SV_ENOMEM, "slab", "a slab of %zu bytes: %s", mapped, strerror(saved));
    }
    *slab = (struct sv_slab){
        .pool = pool, .head = memory, .mapped_bytes = mapped, .size_class = size_class, .fd = fd};
    slab->head->magic = SLAB_MAGIC;
    slab->head->capacity = mapped - sizeof *slab->head;
    pool->bytes += mapped;
    *out = slab;
    return SV_OK;
}

/* Frees kept slabs, largest first, until `more` bytes fit the budget. */
static bool make_room(struct sv_slab_pool *pool, uint64_t more)
{
    for (unsigned c = CLASS_COUNT; c-- > 0;)
        while (pool->bytes + more > pool->budget_bytes && pool->kept[c])
            drop_kept(pool, c);
    return pool->bytes + more <= pool->budget_bytes;
}

enum sv_status sv_slab_take(struct sv_slab_pool *pool, size_t bytes, struct sv_slab **slab,
                            struct sv_error *error)
{
    unsigned size_class = 0;
    while (size_class < CLASS_COUNT &&
           ((size_t)1 << (CLASS_MIN_BITS + size_class)) - sizeof(struct slab_head) < bytes)
        size_class++;
    uint64_t mapped = UINT64_C(1) << (CLASS_MIN_BITS + size_class);
    if (size_class == CLASS_COUNT || mapped > pool->budget_bytes)
        return sv_fail(error, SV_ELIMIT, "slab", "a picture of up to %zu bytes is over the budget of %llu",
                       bytes, (unsigned long long)pool->budget_bytes);
    struct sv_slab *s = pool->kept[size_class];
    if (s) {
        pool->kept[size_class] = s->next;
        pool->kept_count[size_class]--;
        s->next = NULL;
    } else {
        if (!make_room(pool, mapped))
            return sv_fail(error, SV_ELIMIT, "slab.busy", "%llu of %llu bytes are in use",
                           (unsigned long long)pool->bytes, (unsigned long long)pool->budget_bytes);
        enum sv_status status = slab_make(pool, size_class, &s, error);
        if (status != SV_OK)
            return status;
    }
    s->head->at = s->head->size = 0;
    atomic_store_explicit(&s->head->commit, 0, memory_order_relaxed);
    for (int k = 0; k < SV_SLAB_WORDS; k++)
        atomic_store_explicit(&s->head->words[k], 0, memory_order_relaxed);
    pool->lent_bytes += s->mapped_bytes;
    *slab = s;
    return SV_OK;
}

int sv_slab_fd(const struct sv_slab *slab)
{
    return slab->fd;
}

enum sv_status sv_slab_read(const struct sv_slab *slab, uint64_t job, const void **bytes, size_t *size,
                            struct sv_error *error)
{
    uint64_t commit = atomic_load_explicit(&slab->head->commit, memory_order_acquire);
    uint64_t n = slab->head->size, at = slab->head->at; /* read once: the other side could write them again */
    if (commit != job)
        return sv_fail(error, SV_EFORMAT, "slab", "commit word %llu, expected %llu",
                       (unsigned long long)commit, (unsigned long long)job);
    size_t capacity = slab->mapped_bytes - sizeof *slab->head;
    if (at > capacity || n > capacity - at)
        return sv_fail(error, SV_EFORMAT, "slab", "%llu bytes from %llu on in a slab of %zu", (unsigned long long)n,
                       (unsigned long long)at, slab->mapped_bytes);
    *bytes = (const uint8_t *)(slab->head + 1) + at;
    *size = (size_t)n;
    return SV_OK;
}

void sv_slab_give(struct sv_slab *slab)
{
    if (!slab)
        return;
    struct sv_slab_pool *pool = slab->pool;
    if (pool->kept_count[slab->size_class] >= KEPT_A_CLASS) {
        sv_slab_discard(slab);
        return;
    }
    if (slab->mapped_bytes > KEPT_RESIDENT_BYTES &&
        fallocate(slab->fd, FALLOC_FL_PUNCH_HOLE | FALLOC_FL_KEEP_SIZE, KEPT_RESIDENT_BYTES,
                  (off_t)(slab->mapped_bytes - KEPT_RESIDENT_BYTES))) {
        sv_slab_discard(slab);
        return;
    }
    pool->lent_bytes -= slab->mapped_bytes;
    slab->next = pool->kept[slab->size_class];
    pool->kept[slab->size_class] = slab;
    pool->kept_count[slab->size_class]++;
}

uint64_t sv_slab_pool_bytes(const struct sv_slab_pool *pool)
{
    return pool->bytes;
}

uint64_t sv_slab_pool_lent_bytes(const struct sv_slab_pool *pool)
{
    return pool->lent_bytes;
}
