/* random_view.h - random legal requests as lists of keys and values, and their spellings as KVP and JSON.
 * Seeded. */
#ifndef SV_TESTS_API_RANDOM_VIEW_H
#define SV_TESTS_API_RANDOM_VIEW_H

#include <stddef.h>

#include "api/fields.h"
#include "core/base/rng.h"

struct random_pair {
    enum sv_field_id id;
    char value[64];
};

struct random_view {
    struct random_pair pairs[SV_FIELD_COUNT];
    int count;
};

/* A request that is legal, and built in this version. */
void random_view(struct sv_rng *rng, struct random_view *view);
void random_view_shuffle(struct sv_rng *rng, struct random_view *view);
/* A legal value of a field: from its row of the table. */
void random_value(struct sv_rng *rng, enum sv_field_id id, char out[64]);
/* Query and JSON text of it, in the list's order; return their lengths. */
size_t random_view_kvp(const struct random_view *view, char *out, size_t size);
size_t random_view_json(struct sv_rng *rng, const struct random_view *view, char *out, size_t size);

#endif
