/* store.c - blobs on disk: KIND-KEY.svb = a header of 88 bytes, then the payload.
 *
 * Writing goes to a temporary name of its own (kind, key, pid, counter) and ends with a rename, so that a
 * reader sees the whole blob or none and writers never mix. Nothing is synced: after a power cut a blob may
 * be torn, and then its checksum says so. Reading sets the file's time, eviction deletes the oldest first; it
 * runs under a lock file so that two processes do not each delete half of the store. Files that are not named
 * like ours are never touched. Open file descriptors are close-on-exec; nothing is kept open between calls
 * but the directory, so a fork is harmless. Numbers in the header are in the machine's own order: a store is
 * not carried from one machine to another. */
#include "core/base/store.h"

#include <dirent.h>
#include <errno.h>
#include <fcntl.h>
#include <stdbool.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/file.h>
#include <sys/mman.h>
#include <sys/stat.h>
#include <time.h>
#include <unistd.h>

#include "core/base/hash.h"

enum {
    FORMAT_VERSION = 1,
    KIND_MAX = 24,
    NAME_MAX_BYTES = 96,
    LOCK_TRIES = 50,         /* of 2 ms each: then whoever holds the lock does the evicting */
    PIECE_BYTES = 256 << 10, /* a multiple of 8, as the checksum needs, and small enough for the cache */
    HUGE_PAGE_BYTES = 2 << 20,
    STALE_TEMPORARY_S = 600 /* a temporary file this old belongs to a writer that died */
};

static const char LOCK_NAME[] = "store.lock", CLAIMS_NAME[] = "claims.lock";

struct header {
    char magic[8];
    uint32_t format, header_bytes;
    uint64_t key, size, payload_sum;
    char kind[KIND_MAX + 8];
    uint64_t reserved;
    uint64_t header_sum; /* of everything above */
};
static const char MAGIC[8] = {'S', 'V', 'B', 'L', 'O', 'B', '\r', '\n'};

struct sv_store {
    int dir_fd;
    uint64_t budget_bytes;
    uint32_t temporaries;
};

static uint64_t sum_of(const void *data, size_t bytes)
{
    return sv_hash_done(sv_hash_bytes(sv_hash_u64(SV_HASH_INIT, bytes), data, bytes));
}

static bool kind_ok(const char *kind)
{
    size_t n = strlen(kind);
    return n >= 1 && n <= KIND_MAX && strspn(kind, "abcdefghijklmnopqrstuvwxyz0123456789_") == n;
}

static void fill_header(struct header *h, const char *kind, uint64_t key, const void *data, size_t bytes)
{
    *h = (struct header){.format = FORMAT_VERSION, .header_bytes = sizeof *h, .key = key, .size = bytes};
    memcpy(h->magic, MAGIC, sizeof h->magic);
    memcpy(h->kind, kind, strlen(kind));
    h->payload_sum = sum_of(data, bytes);
    h->header_sum = sum_of(h, offsetof(struct header, header_sum));
}

static void blob_name(char name[NAME_MAX_BYTES], const char *kind, uint64_t key)
{
    snprintf(name, NAME_MAX_BYTES, "%s-%016llx.svb", kind, (unsigned long long)key);
}

/* Makes the directory and its parents. */
static int make_directory(const char *directory)
{
    char *path = strdup(directory);
    if (!path)
        return ENOMEM;
    int result = 0;
    for (char *p = path + 1; result == 0; p++) {
        char c = *p;
        if (c != '/' && c != '\0')
            continue;
        *p = '\0';
        if (mkdir(path, 0700) != 0 && errno != EEXIST)
            result = errno;
        *p = c;
        if (c == '\0')
            break;
    }
    free(path);
    return result;
}

enum sv_status sv_store_open(const char *directory, uint64_t budget_bytes, struct sv_store **store,
                             struct sv_error *error)
{
    if (!directory || !*directory || budget_bytes == 0)
        return sv_fail(error, SV_EINVAL, "store",
                       "a store needs a directory and a budget of at least 1 byte");
    int failed = make_directory(directory);
    int fd = open(directory, O_RDONLY | O_DIRECTORY | O_CLOEXEC);
    if (fd < 0)
        return sv_fail(error, SV_EIO, directory, "cannot open the store: %s",
                       strerror(failed ? failed : errno));
    struct sv_store *s = calloc(1, sizeof *s);
    if (!s) {
        close(fd);
        return sv_fail(error, SV_ENOMEM, directory, "no memory for a store");
    }
    s->dir_fd = fd;
    s->budget_bytes = budget_bytes;
    *store = s;
    return SV_OK;
}

void sv_store_close(struct sv_store *store)
{
    if (!store)
        return;
    close(store->dir_fd);
    free(store);
}

static bool read_all(int fd, void *data, size_t bytes)
{
    char *p = data;
    while (bytes > 0) {
        ssize_t n = read(fd, p, bytes);
        if (n < 0 && errno == EINTR)
            continue;
        if (n <= 0)
            return false;
        p += n;
        bytes -= (size_t)n;
    }
    return true;
}

static bool write_all(int fd, const void *data, size_t bytes)
{
    const char *p = data;
    while (bytes > 0) {
        ssize_t n = write(fd, p, bytes);
        if (n < 0 && errno == EINTR)
            continue;
        if (n <= 0)
            return false;
        p += n;
        bytes -= (size_t)n;
    }
    return true;
}

/* Reads the payload and sums it up, piece by piece, while it is in the cache; same sum as sum_of. */
static bool read_payload(int fd, void *data, size_t bytes, uint64_t expected_sum)
{
    uint64_t h = sv_hash_u64(SV_HASH_INIT, bytes);
    for (size_t at = 0; at < bytes; at += PIECE_BYTES) {
        size_t piece = bytes - at < PIECE_BYTES ? bytes - at : PIECE_BYTES;
        if (!read_all(fd, (char *)data + at, piece))
            return false;
        h = sv_hash_bytes(h, (char *)data + at, piece);
    }
    return sv_hash_done(h) == expected_sum;
}

/* Memory for a payload, for free(). Large ones take huge pages where the system has some: the page faults of
 * 64 MB in small ones cost three times as much as reading it. */
static void *payload_memory(size_t bytes)
{
    size_t whole = (bytes + HUGE_PAGE_BYTES - 1) / HUGE_PAGE_BYTES * HUGE_PAGE_BYTES;
    if (bytes < 2 * HUGE_PAGE_BYTES || whole < bytes)
        return malloc(bytes ? bytes : 1);
    void *data = aligned_alloc(HUGE_PAGE_BYTES, whole);
    if (data)
        madvise(data, whole, MADV_HUGEPAGE); /* a wish: it may fail */
    return data;
}

static bool header_ok(const struct header *h, const char *kind, uint64_t key, off_t file_bytes)
{
    return memcmp(h->magic, MAGIC, sizeof h->magic) == 0 && h->format == FORMAT_VERSION &&
           h->header_bytes == sizeof *h && h->key == key && h->kind[sizeof h->kind - 1] == '\0' &&
           strcmp(h->kind, kind) == 0 && h->header_sum == sum_of(h, offsetof(struct header, header_sum)) &&
           (uint64_t)file_bytes - sizeof *h == h->size;
}

/* The payload of an open blob, or NULL with *why. */
static void *read_blob(int fd, const char *kind, uint64_t key, size_t *bytes, const char **why)
{
    struct stat st;
    struct header h;
    *why = "it is damaged";
    if (fstat(fd, &st) != 0 || !S_ISREG(st.st_mode) || (uint64_t)st.st_size < sizeof h)
        return NULL;
    if (!read_all(fd, &h, sizeof h) || !header_ok(&h, kind, key, st.st_size))
        return NULL;
    void *data = payload_memory(h.size);
    if (!data) {
        *why = "there is no memory for it";
        return NULL;
    }
    if (!read_payload(fd, data, h.size, h.payload_sum)) {
        free(data);
        return NULL;
    }
    *bytes = h.size;
    return data;
}

enum sv_status sv_store_get(struct sv_store *store, const char *kind, uint64_t key, void **data,
                            size_t *bytes, struct sv_error *error)
{
    if (!store)
        return sv_fail(error, SV_ENOENT, "store", "there is no store");
    if (!kind_ok(kind))
        return sv_fail(error, SV_EINVAL, "store", "kind \"%s\" is not [a-z0-9_]{1,%d}", kind, KIND_MAX);
    char name[NAME_MAX_BYTES];
    blob_name(name, kind, key);
    /* O_NONBLOCK: a FIFO under that name must not hang us. */
    int fd = openat(store->dir_fd, name, O_RDONLY | O_CLOEXEC | O_NOFOLLOW | O_NONBLOCK);
    if (fd < 0)
        return sv_fail(error, SV_ENOENT, name, "not in the store: %s", strerror(errno));
    const char *why;
    void *found = read_blob(fd, kind, key, bytes, &why);
    if (found)
        futimens(fd, (const struct timespec[2]){{0, UTIME_NOW}, {0, UTIME_NOW}}); /* used now; may fail */
    close(fd);
    if (!found)
        return sv_fail(error, SV_ENOENT, name, "not used from the store: %s", why);
    *data = found;
    return SV_OK;
}

/* ---- eviction ---- */

struct blob {
    struct timespec used;
    uint64_t bytes;
    char name[NAME_MAX_BYTES];
};

struct listing {
    struct blob *items;
    size_t count, room;
    uint64_t bytes;
};

static int by_age(const void *a, const void *b)
{
    const struct blob *p = a, *q = b;
    if (p->used.tv_sec != q->used.tv_sec)
        return p->used.tv_sec < q->used.tv_sec ? -1 : 1;
    if (p->used.tv_nsec != q->used.tv_nsec)
        return p->used.tv_nsec < q->used.tv_nsec ? -1 : 1;
    return strcmp(p->name, q->name);
}

/* "kind-0123456789abcdef.svb" (temporary: with ".tmp..." behind it). */
static bool is_ours(const char *name, bool *temporary)
{
    size_t n = strspn(name, "abcdefghijklmnopqrstuvwxyz0123456789_");
    if (n < 1 || n > KIND_MAX || name[n] != '-' || strspn(name + n + 1, "0123456789abcdef") != 16 ||
        strncmp(name + n + 17, ".svb", 4) != 0)
        return false;
    const char *rest = name + n + 21;
    *temporary = strncmp(rest, ".tmp", 4) == 0;
    return (*temporary || *rest == '\0') && strlen(name) < NAME_MAX_BYTES;
}

static bool listing_add(struct listing *list, const char *name, const struct stat *st)
{
    if (list->count == list->room) {
        size_t room = list->room ? 2 * list->room : 64;
        struct blob *items = realloc(list->items, room * sizeof *items);
        if (!items)
            return false;
        list->items = items;
        list->room = room;
    }
    struct blob *b = &list->items[list->count++];
    b->used = st->st_mtim;
    b->bytes = (uint64_t)st->st_size;
    snprintf(b->name, sizeof b->name, "%s", name);
    list->bytes += b->bytes;
    return true;
}

static void list_blobs(const struct sv_store *store, struct listing *list)
{
    int fd = openat(store->dir_fd, ".", O_RDONLY | O_DIRECTORY | O_CLOEXEC);
    DIR *dir = fd >= 0 ? fdopendir(fd) : NULL;
    if (!dir) {
        if (fd >= 0)
            close(fd);
        return;
    }
    time_t now = time(NULL);
    for (const struct dirent *e = readdir(dir); e; e = readdir(dir)) {
        bool temporary;
        struct stat st;
        if (!is_ours(e->d_name, &temporary) ||
            fstatat(store->dir_fd, e->d_name, &st, AT_SYMLINK_NOFOLLOW) != 0 || !S_ISREG(st.st_mode))
            continue;
        if (temporary && now - st.st_mtime > STALE_TEMPORARY_S)
            unlinkat(store->dir_fd, e->d_name, 0);
        else if (!temporary && !listing_add(list, e->d_name, &st))
            break;
    }
    closedir(dir);
}

static int take_lock(const struct sv_store *store)
{
    int fd = openat(store->dir_fd, LOCK_NAME, O_RDWR | O_CREAT | O_CLOEXEC | O_NOFOLLOW | O_NONBLOCK, 0600);
    for (int k = 0; fd >= 0 && k < LOCK_TRIES; k++) {
        if (flock(fd, LOCK_EX | LOCK_NB) == 0)
            return fd;
        nanosleep(&(const struct timespec){0, 2000000}, NULL);
    }
    if (fd >= 0)
        close(fd);
    return -1;
}

/* Deletes the least recently used blobs until the rest fits the budget; the one just written goes last. */
static void evict(const struct sv_store *store, const char *keep)
{
    int lock = take_lock(store);
    if (lock < 0)
        return;
    struct listing list = {0};
    list_blobs(store, &list);
    if (list.bytes > store->budget_bytes) {
        qsort(list.items, list.count, sizeof *list.items, by_age);
        for (size_t k = 0; k < list.count && list.bytes > store->budget_bytes; k++) {
            if (strcmp(list.items[k].name, keep) == 0)
                continue;
            if (unlinkat(store->dir_fd, list.items[k].name, 0) == 0 || errno == ENOENT)
                list.bytes -= list.items[k].bytes;
        }
    }
    free(list.items);
    close(lock); /* and so unlocks */
}

enum sv_status sv_store_put(struct sv_store *store, const char *kind, uint64_t key, const void *data,
                            size_t bytes, struct sv_error *error)
{
    if (!store)
        return sv_fail(error, SV_ENOENT, "store", "there is no store");
    if (!kind_ok(kind))
        return sv_fail(error, SV_EINVAL, "store", "kind \"%s\" is not [a-z0-9_]{1,%d}", kind, KIND_MAX);
    struct header h;
    char name[NAME_MAX_BYTES], temporary[NAME_MAX_BYTES];
    blob_name(name, kind, key);
    if (bytes > store->budget_bytes || store->budget_bytes - bytes < sizeof h)
        return sv_fail(error, SV_ELIMIT, name, "%zu bytes are more than the store's budget of %llu", bytes,
                       (unsigned long long)store->budget_bytes);
    fill_header(&h, kind, key, data, bytes);
    snprintf(temporary, sizeof temporary, "%s-%016llx.svb.tmp.%ld.%u", kind, (unsigned long long)key,
             (long)getpid(), store->temporaries++);
    int fd = openat(store->dir_fd, temporary, O_WRONLY | O_CREAT | O_EXCL | O_CLOEXEC | O_NOFOLLOW, 0600);
    if (fd < 0)
        return sv_fail(error, SV_EIO, name, "cannot write to the store: %s", strerror(errno));
    bool ok = write_all(fd, &h, sizeof h) && write_all(fd, data, bytes);
    int why = errno;
    if (close(fd) != 0 && ok) {
        ok = false;
        why = errno;
    }
    if (ok && renameat(store->dir_fd, temporary, store->dir_fd, name) != 0) {
        ok = false;
        why = errno;
    }
    if (!ok) {
        unlinkat(store->dir_fd, temporary, 0);
        return sv_fail(error, SV_EIO, name, "cannot write to the store: %s", strerror(why));
    }
    evict(store, name);
    return SV_OK;
}

bool sv_store_has(struct sv_store *store, const char *kind, uint64_t key)
{
    char name[NAME_MAX_BYTES];
    struct stat st;
    if (!store || !kind_ok(kind))
        return false;
    blob_name(name, kind, key);
    return fstatat(store->dir_fd, name, &st, AT_SYMLINK_NOFOLLOW) == 0 && S_ISREG(st.st_mode);
}

/* A lock on one byte of a file, the byte's place a hash of kind and key (two that meet wait for each other,
 * which is harmless). It belongs to the open file, not to the process as older locks do: claims of one
 * process exclude each other, too. */
int sv_store_claim(struct sv_store *store, const char *kind, uint64_t key)
{
    if (!store || !kind_ok(kind))
        return SV_STORE_UNCLAIMED;
    uint64_t place = sv_hash_done(sv_hash_bytes(sv_hash_u64(SV_HASH_INIT, key), kind, strlen(kind)));
    struct flock lock = {
        .l_type = F_WRLCK, .l_whence = SEEK_SET, .l_start = (off_t)(place >> 16), .l_len = 1};
    int fd = openat(store->dir_fd, CLAIMS_NAME, O_RDWR | O_CREAT | O_CLOEXEC | O_NOFOLLOW, 0600), held;
    if (fd < 0)
        return SV_STORE_UNCLAIMED;
    while ((held = fcntl(fd, F_OFD_SETLKW, &lock)) != 0 && errno == EINTR)
        ;
    if (held == 0)
        return fd;
    close(fd);
    return SV_STORE_UNCLAIMED;
}

void sv_store_release(int claim)
{
    struct flock lock = {.l_type = F_UNLCK, .l_whence = SEEK_SET}; /* children may have the file open, too */
    if (claim == SV_STORE_UNCLAIMED)
        return;
    (void)fcntl(claim, F_OFD_SETLK, &lock);
    close(claim);
}
