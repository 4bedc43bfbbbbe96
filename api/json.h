/* json.h - strict reading of JSON (RFC 8259) that came from outside.
 *
 * cJSON alone is lenient: it takes "01", control characters in strings, a cut string after \u0000, stray
 * UTF-8 bytes and two members of one name. So the text is checked first by a grammar of our own, bounded in
 * depth and in members, and only then given to cJSON to build the tree. Nothing is allocated for a text that
 * fails the check. */
#ifndef SV_API_JSON_H
#define SV_API_JSON_H

#include <cjson/cJSON.h>
#include <stddef.h>

#include "core/base/error.h"

enum { SV_API_JSON_DEPTH_MAX = 16, SV_API_JSON_MEMBERS_MAX = 256 };

/* Parses all `bytes` bytes (any bytes are legal input; no NUL needed) as one JSON value. The caller frees
 * *root with cJSON_Delete. SV_EINVAL with the line and column of the first fault; a name that occurs twice in
 * one object, nesting deeper than SV_API_JSON_DEPTH_MAX and objects of more than SV_API_JSON_MEMBERS_MAX
 * members are faults. SV_ENOMEM. */
SV_MUST_CHECK enum sv_status sv_api_json_parse(const char *text, size_t bytes, cJSON **root,
                                               struct sv_error *error);

#endif
