/* store.h - blobs kept on disk under a key: what was costly to build and can be built again.
 *
 * One directory, one file a blob, named KIND-KEY.svb: a header (magic, format version, key, size, checksum), then the
 * bytes. Written to a temporary name, then renamed; read whole, checked, and treated as absent when anything is off. A
 * byte budget is kept by deleting the files least recently used. A store that is broken, full, read-only or absent
 * costs time, never an answer: no call here fails the caller's work. Several processes may use one directory at once. */
#ifndef SV_BASE_STORE_H
#define SV_BASE_STORE_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "core/base/error.h"

struct sv_store;

/* Opens (makes) the directory; mode 0700. budget_bytes > 0. On failure *store is not written and the caller may go on
 * with NULL, which every call below takes and treats as an empty, unwritable store. */
SV_MUST_CHECK enum sv_status sv_store_open(const char *directory, uint64_t budget_bytes, struct sv_store **store,
                                           struct sv_error *error);
void sv_store_close(struct sv_store *store);

/* Reads the blob into fresh heap memory (caller frees). SV_ENOENT when it is absent or damaged. kind: [a-z0-9_]{1,24},
 * with a version of the builder in it ("grow1"), so that new code never reads old blobs. */
SV_MUST_CHECK enum sv_status sv_store_get(struct sv_store *store, const char *kind, uint64_t key, void **data,
                                          size_t *bytes, struct sv_error *error);
/* Keeps the blob. The status only informs (log it); work goes on. */
enum sv_status sv_store_put(struct sv_store *store, const char *kind, uint64_t key, const void *data, size_t bytes,
                            struct sv_error *error);
/* Whether there is a blob of that kind and key; it may yet be found damaged, or be evicted. */
bool sv_store_has(struct sv_store *store, const char *kind, uint64_t key);

/* Waits until no other claim on that kind and key is held, in whatever process, and holds one: whoever finds a blob
 * missing claims it, looks again, and only then builds it, so that it is built once. A claim ends with its process.
 * SV_STORE_UNCLAIMED when claims cannot be had (no store, a read-only one): the caller goes on without. */
enum { SV_STORE_UNCLAIMED = -1 };
SV_MUST_CHECK int sv_store_claim(struct sv_store *store, const char *kind, uint64_t key);
void sv_store_release(int claim); /* SV_STORE_UNCLAIMED is legal */

#endif
