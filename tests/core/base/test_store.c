/* test_store.c - what comes back is what was kept, or nothing; whatever happens to the folder, calls return.
 */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <dirent.h>
#include <fcntl.h>
#include <signal.h>
#include <stdbool.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/resource.h>
#include <sys/stat.h>
#include <sys/wait.h>
#include <time.h>
#include <unistd.h>
#include <cmocka.h>

#include "core/base/rng.h"
#include "core/base/store.h"

enum { HEADER = 88, BIG = 1 << 30 };

struct folder {
    char path[64];
    struct sv_store *store;
};

static void open_store(struct folder *f, uint64_t budget)
{
    struct sv_error e;
    char inner[100];
    snprintf(inner, sizeof inner, "%s/a/b", f->path);
    f->store = NULL;
    if (sv_store_open(inner, budget, &f->store, &e) != SV_OK)
        fail_msg("%s", e.message);
}

static int set_up(void **state)
{
    struct folder *f = calloc(1, sizeof *f);
    strcpy(f->path, "/tmp/sv-store-XXXXXX");
    if (!mkdtemp(f->path))
        return -1;
    open_store(f, BIG);
    *state = f;
    return 0;
}

static int tear_down(void **state)
{
    struct folder *f = *state;
    char command[256];
    sv_store_close(f->store);
    snprintf(command, sizeof command, "chmod -R u+w %s; rm -rf %s", f->path, f->path);
    int failed = system(command);
    free(f);
    return failed;
}

static void name_of(const struct folder *f, const char *kind, uint64_t key, char path[200])
{
    snprintf(path, 200, "%s/a/b/%s-%016llx.svb", f->path, kind, (unsigned long long)key);
}

static void put(const struct folder *f, const char *kind, uint64_t key, const void *data, size_t n)
{
    struct sv_error e;
    if (sv_store_put(f->store, kind, key, data, n, &e) != SV_OK)
        fail_msg("%s: %s", e.field, e.message);
}

static bool has(const struct folder *f, const char *kind, uint64_t key, const void *data, size_t n)
{
    void *got = NULL;
    size_t bytes = 0;
    if (sv_store_get(f->store, kind, key, &got, &bytes, NULL) != SV_OK) {
        assert_null(got);
        return false;
    }
    assert_int_equal(bytes, n);
    if (n)
        assert_memory_equal(got, data, n);
    free(got);
    return true;
}

static void fill(unsigned char *block, size_t n, uint64_t seed)
{
    struct sv_rng rng = sv_rng_seeded(seed, 0);
    for (size_t k = 0; k < n; k++)
        block[k] = (unsigned char)sv_rng_next(&rng);
}

static void test_round_trip(void **state)
{
    const struct folder *f = *state;
    static unsigned char block[100000];
    static const size_t sizes[] = {0, 1, 7, 8, 9, 4096, sizeof block};
    for (size_t k = 0; k < sizeof sizes / sizeof sizes[0]; k++) {
        fill(block, sizes[k], k);
        assert_false(has(f, "mesh1", k, block, sizes[k]));
        put(f, "mesh1", k, block, sizes[k]);
        assert_true(has(f, "mesh1", k, block, sizes[k]));
        assert_false(has(f, "mesh2", k, block, sizes[k]));
    }
    put(f, "mesh1", 0, "new", 4);
    assert_true(has(f, "mesh1", 0, "new", 4));
    put(f, "mesh1", UINT64_MAX, "x", 1);
    assert_true(has(f, "mesh1", UINT64_MAX, "x", 1));
    struct stat st;
    char inner[100];
    snprintf(inner, sizeof inner, "%s/a/b", f->path);
    assert_int_equal(stat(inner, &st), 0);
    assert_int_equal(st.st_mode & 0777, 0700);
}

/* Blobs that are read in several pieces into memory of their own kind; a bit flipped in any piece is seen. */
static void test_large(void **state)
{
    const struct folder *f = *state;
    enum { PIECE = 256 << 10, HUGE = 2 << 20 };
    static unsigned char block[2 * HUGE + 13];
    static const size_t sizes[] = {PIECE - 1,    PIECE,    PIECE + 1,    3 * PIECE + 5,
                                   2 * HUGE - 1, 2 * HUGE, 2 * HUGE + 1, sizeof block};
    for (size_t k = 0; k < sizeof sizes / sizeof sizes[0]; k++) {
        fill(block, sizes[k], k);
        put(f, "big", k, block, sizes[k]);
        assert_true(has(f, "big", k, block, sizes[k]));
    }
    char path[160];
    snprintf(path, sizeof path, "%s/a/b/big-%016x.svb", f->path, 7);
    for (size_t at = 100; at < sizeof block; at += PIECE) {
        int fd = open(path, O_RDWR);
        unsigned char c;
        assert_true(fd >= 0);
        assert_int_equal(pread(fd, &c, 1, (off_t)(HEADER + at)), 1);
        c ^= 16;
        assert_int_equal(pwrite(fd, &c, 1, (off_t)(HEADER + at)), 1);
        assert_false(has(f, "big", 7, block, sizeof block));
        c ^= 16;
        assert_int_equal(pwrite(fd, &c, 1, (off_t)(HEADER + at)), 1);
        close(fd);
        assert_true(has(f, "big", 7, block, sizeof block));
    }
}

static void write_file(const char *path, const void *data, size_t n)
{
    int fd = open(path, O_WRONLY | O_CREAT | O_TRUNC, 0600);
    assert_true(fd >= 0);
    assert_int_equal(write(fd, data, n), n);
    close(fd);
}

static size_t read_file(const char *path, unsigned char *data, size_t room)
{
    int fd = open(path, O_RDONLY);
    assert_true(fd >= 0);
    ssize_t n = read(fd, data, room);
    assert_true(n >= 0);
    close(fd);
    return (size_t)n;
}

/* Each length shorter than the file, each length longer, each flipped bit: absent. */
static void test_damage(void **state)
{
    const struct folder *f = *state;
    unsigned char block[150], file[400];
    char path[200];
    fill(block, sizeof block, 5);
    put(f, "k", 1, block, sizeof block);
    name_of(f, "k", 1, path);
    size_t n = read_file(path, file, sizeof file);
    assert_int_equal(n, HEADER + sizeof block);
    for (size_t cut = 0; cut < n; cut++) {
        write_file(path, file, cut);
        assert_false(has(f, "k", 1, block, sizeof block));
    }
    memset(file + n, 0, 3);
    write_file(path, file, n + 3);
    assert_false(has(f, "k", 1, block, sizeof block));
    for (size_t bit = 0; bit < 8 * n; bit++) {
        file[bit / 8] ^= (unsigned char)(1u << bit % 8);
        write_file(path, file, n);
        if (has(f, "k", 1, block, sizeof block))
            fail_msg("bit %zu flipped and not seen", bit);
        file[bit / 8] ^= (unsigned char)(1u << bit % 8);
    }
    write_file(path, file, n);
    assert_true(has(f, "k", 1, block, sizeof block));
    put(f, "k", 1, "mended", 7); /* a damaged blob is simply written again */
    assert_true(has(f, "k", 1, "mended", 7));
}

/* A blob under another's name, a folder, a FIFO, a dangling link: absent, at once. */
static void test_foreign(void **state)
{
    const struct folder *f = *state;
    char a[200], b[200];
    put(f, "k", 1, "one", 4);
    name_of(f, "k", 1, a);
    name_of(f, "k", 2, b);
    assert_int_equal(rename(a, b), 0);
    assert_false(has(f, "k", 2, "one", 4));
    unlink(b);
    assert_int_equal(mkdir(b, 0700), 0);
    assert_false(has(f, "k", 2, "", 0));
    assert_int_not_equal(sv_store_put(f->store, "k", 2, "x", 1, NULL),
                         SV_OK); /* cannot take a folder's place */
    rmdir(b);
    assert_int_equal(mkfifo(b, 0600), 0);
    assert_false(has(f, "k", 2, "", 0));
    unlink(b);
    assert_int_equal(symlink("/etc/passwd", b), 0);
    assert_false(has(f, "k", 2, "", 0));
    put(f, "k", 2, "mine", 5);
    assert_true(has(f, "k", 2, "mine", 5));
}

static int count_files(const struct folder *f, const char *end)
{
    char inner[100];
    int count = 0;
    snprintf(inner, sizeof inner, "%s/a/b", f->path);
    DIR *dir = opendir(inner);
    assert_non_null(dir);
    for (struct dirent *e = readdir(dir); e; e = readdir(dir)) {
        size_t n = strlen(e->d_name), m = strlen(end);
        count += n >= m && strcmp(e->d_name + n - m, end) == 0;
    }
    closedir(dir);
    return count;
}

static void set_age(const struct folder *f, uint64_t key, time_t age_s)
{
    char path[200];
    name_of(f, "k", key, path);
    struct timespec t[2] = {{time(NULL) - age_s, 0}, {time(NULL) - age_s, 0}};
    assert_int_equal(utimensat(AT_FDCWD, path, t, 0), 0);
}

/* Least recently used goes first; reading counts as use; what is not ours stays. */
static void test_budget(void **state)
{
    struct folder *f = *state;
    unsigned char block[1000];
    char foreign[200];
    fill(block, sizeof block, 9);
    sv_store_close(f->store);
    open_store(f, 4 * (sizeof block + HEADER));
    snprintf(foreign, sizeof foreign, "%s/a/b/notes.txt", f->path);
    write_file(foreign, block, sizeof block);
    for (uint64_t k = 0; k < 4; k++) {
        put(f, "k", k, block, sizeof block);
        set_age(f, k, 1000 - (time_t)k);
    }
    assert_true(has(f, "k", 0, block, sizeof block)); /* used now: 1 is the oldest */
    put(f, "k", 4, block, sizeof block);
    assert_int_equal(count_files(f, ".svb"), 4);
    assert_false(has(f, "k", 1, block, sizeof block));
    for (uint64_t k = 0; k < 5; k++)
        assert_true(k == 1 || has(f, "k", k, block, sizeof block));
    for (uint64_t k = 10; k < 60; k++)
        put(f, "k", k, block, sizeof block);
    assert_int_equal(count_files(f, ".svb"), 4);
    assert_int_equal(access(foreign, F_OK), 0);
    static unsigned char big[8 * 1088];
    assert_int_equal(sv_store_put(f->store, "k", 99, big, sizeof big, NULL), SV_ELIMIT);
    assert_true(has(f, "k", 59, block, sizeof block));
}

static void test_stale_temporaries(void **state)
{
    const struct folder *f = *state;
    char old[200], young[200];
    snprintf(old, sizeof old, "%s/a/b/k-0000000000000001.svb.tmp.1.0", f->path);
    snprintf(young, sizeof young, "%s/a/b/k-0000000000000001.svb.tmp.2.0", f->path);
    write_file(old, "x", 1);
    write_file(young, "x", 1);
    struct timespec t[2] = {{time(NULL) - 100000, 0}, {time(NULL) - 100000, 0}};
    assert_int_equal(utimensat(AT_FDCWD, old, t, 0), 0);
    put(f, "k", 5, "y", 1);
    assert_int_not_equal(access(old, F_OK), 0);
    assert_int_equal(access(young, F_OK), 0);
}

/* As nobody: root may write anywhere. */
static void test_read_only(void **state)
{
    struct folder *f = *state;
    char command[512], inner[100];
    put(f, "k", 1, "kept", 5);
    snprintf(inner, sizeof inner, "%s/a/b", f->path);
    snprintf(command, sizeof command, "chmod 755 %s %s/a && chmod a+r %s/* && chmod 555 %s", f->path, f->path,
             inner, inner);
    assert_int_equal(system(command), 0);
    pid_t child = fork();
    if (child == 0) {
        if (geteuid() == 0 && (setgid(65534) != 0 || setuid(65534) != 0))
            _exit(9);
        struct sv_store *s = NULL;
        void *got = NULL;
        size_t n = 0;
        bool ok = sv_store_open(inner, BIG, &s, NULL) == SV_OK &&
                  sv_store_put(s, "k", 2, "x", 1, NULL) == SV_EIO &&
                  sv_store_get(s, "k", 2, &got, &n, NULL) == SV_ENOENT &&
                  sv_store_get(s, "k", 1, &got, &n, NULL) == SV_OK && n == 5 && memcmp(got, "kept", 5) == 0;
        free(got);
        sv_store_close(s);
        _exit(ok ? 0 : 1);
    }
    int status;
    assert_int_equal(waitpid(child, &status, 0), child);
    assert_true(WIFEXITED(status) && WEXITSTATUS(status) == 0);
}

/* A disk that is full: the write fails, nothing of it stays. */
static void test_full(void **state)
{
    const struct folder *f = *state;
    pid_t child = fork();
    if (child == 0) {
        static unsigned char block[100000];
        struct rlimit limit = {20000, 20000};
        signal(SIGXFSZ, SIG_IGN);
        if (setrlimit(RLIMIT_FSIZE, &limit) != 0)
            _exit(9);
        _exit(sv_store_put(f->store, "k", 3, block, sizeof block, NULL) == SV_EIO ? 0 : 1);
    }
    int status;
    assert_int_equal(waitpid(child, &status, 0), child);
    assert_true(WIFEXITED(status) && WEXITSTATUS(status) == 0);
    assert_false(has(f, "k", 3, "", 0));
    assert_int_equal(count_files(f, "svb"), 0);
    assert_int_equal(count_files(f, ".0"), 0);
}

static void test_absent(void **state)
{
    (void)state;
    struct sv_store *s = NULL;
    struct sv_error e;
    void *got = NULL;
    size_t n;
    assert_int_equal(sv_store_open("/proc/nowhere/x", BIG, &s, &e), SV_EIO);
    assert_int_equal(sv_store_open("/dev/null", BIG, &s, &e), SV_EIO);
    assert_int_equal(sv_store_open("", BIG, &s, &e), SV_EINVAL);
    assert_int_equal(sv_store_open("/tmp", 0, &s, &e), SV_EINVAL);
    assert_null(s);
    assert_int_equal(sv_store_get(NULL, "k", 1, &got, &n, &e), SV_ENOENT);
    assert_int_equal(sv_store_put(NULL, "k", 1, "x", 1, &e), SV_ENOENT);
    sv_store_close(NULL);
}

static void test_kinds(void **state)
{
    const struct folder *f = *state;
    static const char *const bad[] = {"", "A", "a-b", "../x", "a/b", "a.b", "abcdefghijklmnopqrstuvwxy"};
    void *got = NULL;
    size_t n;
    for (size_t k = 0; k < sizeof bad / sizeof bad[0]; k++) {
        assert_int_equal(sv_store_put(f->store, bad[k], 1, "x", 1, NULL), SV_EINVAL);
        assert_int_equal(sv_store_get(f->store, bad[k], 1, &got, &n, NULL), SV_EINVAL);
    }
    put(f, "abcdefghijklmnopqrstuvwx", 1, "x", 1);
    assert_true(has(f, "abcdefghijklmnopqrstuvwx", 1, "x", 1));
}

/* What writer w keeps under key k, round r: as long as it is long, and told by its first byte. */
static size_t block_of(unsigned char *block, int w, uint64_t k, int r)
{
    size_t n = 500 + (size_t)((uint64_t)w * 97 + k * 131 + (uint64_t)r * 53) % 1500;
    memset(block, w * 16 + r, n);
    return n;
}

/* Six processes write and read the same eight keys under a budget that evicts all the while: whatever is read
 * is whole. */
static void test_concurrent(void **state)
{
    struct folder *f = *state;
    sv_store_close(f->store);
    open_store(f, 6000);
    pid_t children[6];
    for (int w = 0; w < 6; w++) {
        children[w] = fork();
        if (children[w] != 0)
            continue;
        unsigned char block[2100];
        bool ok = true;
        for (int n = 0; n < 300 && ok; n++) {
            uint64_t key = (uint64_t)(n * 5 + w) % 8;
            size_t bytes = block_of(block, w, key, n % 16);
            ok = sv_store_put(f->store, "k", key, block, bytes, NULL) == SV_OK;
            unsigned char *got = NULL;
            if (sv_store_get(f->store, "k", (key + 3) % 8, (void **)&got, &bytes, NULL) == SV_OK) {
                ok = ok && bytes == block_of(block, got[0] / 16, (key + 3) % 8, got[0] % 16) &&
                     memcmp(block, got, bytes) == 0;
                free(got);
            }
        }
        _exit(ok ? 0 : 1);
    }
    for (int w = 0; w < 6; w++) {
        int status;
        assert_int_equal(waitpid(children[w], &status, 0), children[w]);
        assert_true(WIFEXITED(status) && WEXITSTATUS(status) == 0);
    }
    put(f, "k", 1, "x", 1); /* evicts what the last writers left over the budget */
    assert_true(has(f, "k", 1, "x", 1));
    assert_true(count_files(f, ".svb") <= 10);
    assert_int_equal(count_files(f, ".svb") + 3, /* and the lock, "." and ".." */
                     count_files(f, ""));
}

/* Children look, claim, look again and build: whoever is second finds what the first has built. A claim of one that
 * died is free. */
static void test_claims(void **state)
{
    struct folder *f = *state;
    enum { CHILDREN = 4, KEYS = 20 };
    pid_t children[CHILDREN];
    assert_false(sv_store_has(f->store, "k", 1));
    int held = sv_store_claim(f->store, "k", 1), other = sv_store_claim(f->store, "k", 2);
    assert_true(held != SV_STORE_UNCLAIMED && other != SV_STORE_UNCLAIMED);
    pid_t dies = fork();
    if (dies == 0) {
        int claim = sv_store_claim(f->store, "k", 3);
        _exit(claim == SV_STORE_UNCLAIMED ? 1 : 0);
    }
    int status;
    assert_int_equal(waitpid(dies, &status, 0), dies);
    assert_int_equal(status, 0);
    for (int w = 0; w < CHILDREN; w++) {
        children[w] = fork();
        if (children[w] != 0)
            continue;
        int built = 0;
        for (uint64_t key = 1; key <= KEYS; key++) {
            int claim = sv_store_claim(f->store, "k", key);
            if (!sv_store_has(f->store, "k", key)) {
                nanosleep(&(struct timespec){0, 2000000}, NULL); /* room for another to do the same */
                built += sv_store_put(f->store, "k", key, &w, sizeof w, NULL) == SV_OK;
            }
            sv_store_release(claim);
        }
        _exit(built);
    }
    put(f, "k", 1, "x", 1); /* all children wait for this one, or have not come to it yet */
    sv_store_release(other);
    sv_store_release(held);
    int built = 1;
    for (int w = 0; w < CHILDREN; w++) {
        assert_int_equal(waitpid(children[w], &status, 0), children[w]);
        assert_true(WIFEXITED(status));
        built += WEXITSTATUS(status);
    }
    assert_int_equal(built, KEYS);
    assert_true(has(f, "k", 1, "x", 1));
    assert_int_equal(sv_store_claim(NULL, "k", 1), SV_STORE_UNCLAIMED);
    assert_false(sv_store_has(NULL, "k", 1));
    sv_store_release(SV_STORE_UNCLAIMED);
}

int main(void)
{
#define T(name) cmocka_unit_test_setup_teardown(name, set_up, tear_down)
    const struct CMUnitTest tests[] = {T(test_round_trip), T(test_large),     T(test_damage),
                                       T(test_foreign),    T(test_budget),    T(test_stale_temporaries),
                                       T(test_read_only),  T(test_full),      T(test_absent),
                                       T(test_kinds),      T(test_concurrent), T(test_claims)};
#undef T
    return cmocka_run_group_tests(tests, NULL, NULL);
}
