/* canonical.h - one text for all requests that mean the same: the key of memos, caches and collapsed
 * requests.
 *
 * The text is itself a legal query (angles in degrees, times in UTC): reading it gives an equal request.
 * Defaults are written out, keys stand in the field table's order, numbers in their shortest form, and what
 * has no effect is left out (q of lossless formats, vfov of an orthographic view), so equal requests from KVP
 * and JSON, in any order of keys, have equal texts, and requests that differ in any way that can be seen have
 * different ones. */
#ifndef SV_API_CANONICAL_H
#define SV_API_CANONICAL_H

#include <stddef.h>

#include "core/view/request.h"

enum { SV_API_CANONICAL_MAX = 2048 }; /* bytes that hold any canonical text, NUL included */

/* Everything: the key of an answer. Returns its length. */
size_t sv_api_canonical(const struct sv_view_request *request, char out[SV_API_CANONICAL_MAX]);

/* Without format, q, layer, sky and f, on which a resolved view does not depend: the key of its memo. */
size_t sv_api_canonical_resolve(const struct sv_view_request *request, char out[SV_API_CANONICAL_MAX]);

#endif
