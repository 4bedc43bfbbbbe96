/* openapi.h - the OpenAPI 3.1 document of the service, derived from the field table and the endpoint table.
 */
#ifndef SV_API_OPENAPI_H
#define SV_API_OPENAPI_H

#include <stddef.h>

#include "api/view_parse.h"

struct sv_openapi_options {
    const char *base_url; /* the configured public URL, NULL or "": relative to where the document is */
    struct sv_api_view_limits limits;
};

/* Heap text (UTF-8 JSON; caller frees), NULL only when memory is out. */
char *sv_api_openapi(const struct sv_openapi_options *options, size_t *bytes);

#endif
