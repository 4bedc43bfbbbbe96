/* headers.h - a list of response headers in memory of fixed size: names are literals, values are formatted
 * into it. */
#ifndef SV_API_HEADERS_H
#define SV_API_HEADERS_H

#include <stdbool.h>
#include <stddef.h>

#include "core/base/status.h"

enum { SV_HEADERS_MAX = 48, SV_HEADERS_BYTES = 8192 };

struct sv_headers {
    int count;
    size_t used;
    bool overflow; /* one did not fit and was left out: a bug of the caller's sizes */
    struct {
        const char *name;  /* static */
        unsigned short at; /* of the value in text */
    } items[SV_HEADERS_MAX];
    char text[SV_HEADERS_BYTES];
};

void sv_api_headers_init(struct sv_headers *headers);
/* Adds one, or replaces the one of that name. name must outlive the list. Bytes that may not stand in a field
 * value (RFC 9110, section 5.5: controls, NUL) become blanks, so that no input can split a response. */
void sv_api_headers_set(struct sv_headers *headers, const char *name, const char *format, ...)
    SV_PRINTF(3, 4);
const char *sv_api_headers_value(const struct sv_headers *headers, int index);
/* NULL when there is none; names without regard to case. */
const char *sv_api_headers_find(const struct sv_headers *headers, const char *name);

#endif
