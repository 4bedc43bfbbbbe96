/* fuzz_view_check.h - the promises that every answer of the view readers keeps; a broken one prints the input
 * and aborts. */
#ifndef SV_TESTS_FUZZ_FUZZ_VIEW_CHECK_H
#define SV_TESTS_FUZZ_FUZZ_VIEW_CHECK_H

#include "api/view_parse.h"

/* The limits that fuzzed views are read with, and the Accept header for an input of that size (may be NULL).
 */
extern const struct sv_api_view_limits fuzz_limits;
const char *fuzz_accept(size_t size);

/* Either a request whose every number is finite and in range, or at least one error that can be shown. */
void fuzz_view_check(enum sv_problem_kind kind, const struct sv_api_view *view,
                     const struct sv_errors *errors, const uint8_t *data, size_t size);
/* Prints how many inputs were legal. */
void fuzz_view_report(void);

#endif
