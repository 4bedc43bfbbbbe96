#include "server/daemon/memo.h"

#include <stdio.h>
#include <stdlib.h>

#include "api/canonical.h"
#include "server/daemon/lru.h"

struct sv_memo {
    struct sv_lru *lru;
};

struct sv_memo *sv_memo_create(size_t entries)
{
    struct sv_memo *memo = calloc(1, sizeof *memo);
    if (memo)
        memo->lru = sv_lru_create(entries, free);
    if (memo && !memo->lru) {
        free(memo);
        return NULL;
    }
    return memo;
}

void sv_memo_destroy(struct sv_memo *memo)
{
    if (!memo)
        return;
    sv_lru_destroy(memo->lru);
    free(memo);
}

enum { KEY_BYTES = SV_API_CANONICAL_MAX + 20 };

static const char *key_of(char key[KEY_BYTES], uint64_t scene_version, const char *canonical)
{
    snprintf(key, KEY_BYTES, "%016llx %s", (unsigned long long)scene_version, canonical);
    return key;
}

void sv_memo_keep(struct sv_memo *memo, uint64_t scene_version, const char *canonical,
                  const struct sv_memo_answer *answer)
{
    char key[KEY_BYTES];
    enum sv_status s = answer->status;
    if (s == SV_EINTERNAL || s == SV_ENOMEM || s == SV_ETIMEOUT || s == SV_EIO)
        return;
    struct sv_memo_answer *copy = malloc(sizeof *copy);
    if (!copy)
        return;
    *copy = *answer;
    sv_lru_put(memo->lru, key_of(key, scene_version, canonical), copy, 1);
}

const struct sv_memo_answer *sv_memo_find(struct sv_memo *memo, uint64_t scene_version, const char *canonical)
{
    char key[KEY_BYTES];
    return sv_lru_get(memo->lru, key_of(key, scene_version, canonical));
}

size_t sv_memo_count(const struct sv_memo *memo)
{
    return sv_lru_count(memo->lru);
}
