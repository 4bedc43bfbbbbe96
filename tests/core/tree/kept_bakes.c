#include "tests/core/tree/kept_bakes.h"

#include <stdio.h>
#include <stdlib.h>
#include <unistd.h>

#include "core/base/hash.h"

static struct sv_store *store;
static char own[] = "/tmp/silvista-bakes-XXXXXX";
static pid_t owner;

static void remove_own(void)
{
    char command[64];
    if (getpid() != owner) /* a child that a test forked */
        return;
    sv_store_close(store);
    snprintf(command, sizeof command, "rm -rf %s", own);
    if (system(command) != 0)
        fprintf(stderr, "%s stays\n", own);
}

static void close_shared(void)
{
    sv_store_close(store);
}

struct sv_store *kept_bakes(void)
{
    const char *shared = getenv("SILVISTA_CACHE_DIR");
    if (store)
        return store;
    if (!shared && !mkdtemp(own))
        return NULL;
    if (sv_store_open(shared ? shared : own, (uint64_t)1 << 31, &store, NULL) != SV_OK)
        return NULL;
    owner = getpid();
    atexit(shared ? close_shared : remove_own);
    return store;
}

uint64_t kept_bakes_key(const struct sv_tree_mesh *mesh)
{
    void *data;
    size_t bytes;
    struct sv_error error;
    if (sv_tree_mesh_save(mesh, &data, &bytes, &error) != SV_OK) {
        fprintf(stderr, "%s: %s\n", error.field, error.message);
        abort();
    }
    uint64_t key = sv_hash_done(sv_hash_bytes(SV_HASH_INIT, data, bytes));
    free(data);
    return key;
}
