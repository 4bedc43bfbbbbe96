/* memo.h - resolved views remembered by canonical request and scene version, so that a conditional request
 * costs no job.
 *
 * Refusals that only the terrain can decide (an eye under the ground) are remembered alike. One thread. */
#ifndef SV_SERVER_MEMO_H
#define SV_SERVER_MEMO_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "core/base/error.h"
#include "core/view/resolved.h"

struct sv_memo;

struct sv_memo_answer {
    enum sv_status status; /* SV_OK: view holds; else error, and ground_z if has_ground */
    struct sv_resolved_view view;
    struct sv_error error;
    bool has_ground;
    double ground_z; /* m */
};

/* Keeps that many; 0 keeps none. NULL when out of memory. */
struct sv_memo *sv_memo_create(size_t entries);
void sv_memo_destroy(struct sv_memo *memo);
/* canonical: text of api/canonical.h. Answers that may be otherwise next time (SV_EINTERNAL, SV_ENOMEM,
 * SV_ETIMEOUT, SV_EIO) are not kept. */
void sv_memo_keep(struct sv_memo *memo, uint64_t scene_version, const char *canonical,
                  const struct sv_memo_answer *answer);
/* NULL when it is not known; borrowed until the next keep. */
const struct sv_memo_answer *sv_memo_find(struct sv_memo *memo, uint64_t scene_version,
                                          const char *canonical);
size_t sv_memo_count(const struct sv_memo *memo);

#endif
