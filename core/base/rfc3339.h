/* rfc3339.h - moments in time as text ("2026-06-21T12:00:00+02:00"). */
#ifndef SV_BASE_RFC3339_H
#define SV_BASE_RFC3339_H

#include "core/base/error.h"

/* Seconds since 1970-01-01T00:00:00Z (no leap seconds; fractions kept). Years 1..9999; second 60 counts
 * as 59.999... SV_EINVAL says what is wrong, as a phrase to stand after the text ("has month 13, outside
 * 01..12"). */
SV_MUST_CHECK enum sv_status sv_rfc3339_parse(const char *text, double *unix_s, struct sv_error *error);

#endif
