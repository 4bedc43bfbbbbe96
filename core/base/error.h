/* error.h - the details of a failure, and lists of them.
 *
 * A caller passes struct sv_error (may be NULL: details are then dropped). Where input can be wrong in many places at
 * once (a scene file, a request), struct sv_errors collects them all, so that the user mends them in one go.
 * Nothing here prints. */
#ifndef SV_BASE_ERROR_H
#define SV_BASE_ERROR_H

#include <stddef.h>

#include "core/base/status.h"

struct sv_error {
    enum sv_status code;
    char field[160];   /* key path ("forest[1].scatter.count"), parameter or file the error belongs to; "" if none */
    char message[512]; /* one sentence: what is wrong, with value and legal range */
};

/* Fills *error (if not NULL), truncating what is too long at a UTF-8 boundary, and returns code: `return
 * sv_fail(err, SV_EINVAL, "x", "...")`. field may be NULL. */
enum sv_status sv_fail(struct sv_error *error, enum sv_status code, const char *field, const char *format, ...)
    SV_PRINTF(4, 5);

/* A growing list of errors; keeps the first SV_ERRORS_MAX and counts the rest. init/finish life cycle. */
enum { SV_ERRORS_MAX = 64 };

struct sv_errors {
    struct sv_error *items; /* heap, owned */
    size_t count;           /* how many are in items, <= SV_ERRORS_MAX */
    size_t total;           /* how many were added */
};

void sv_errors_init(struct sv_errors *list);
void sv_errors_finish(struct sv_errors *list);
void sv_errors_add(struct sv_errors *list, enum sv_status code, const char *field, const char *format, ...)
    SV_PRINTF(4, 5);

#endif
