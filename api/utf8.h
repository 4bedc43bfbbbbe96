/* utf8.h - is it UTF-8, and how to show bytes that came from outside in an error text. */
#ifndef SV_API_UTF8_H
#define SV_API_UTF8_H

#include <stdbool.h>
#include <stddef.h>

/* Bytes of the well-formed sequence at p (1..4), 0 when there is none: overlong forms, surrogates and what
 * lies beyond U+10FFFF are not well-formed (Unicode 15, table 3-7). n >= 1 bytes are readable. */
size_t sv_api_utf8_length(const unsigned char *p, size_t n);

bool sv_api_utf8_valid(const void *bytes, size_t n);

/* Writes the bytes so that they can stand in a JSON text and on a terminal: well-formed UTF-8 stays, control
 * characters and stray bytes become \xNN, and what does not fit into size (>= 8, NUL included) is cut at a
 * character and ends in "...". */
void sv_api_utf8_show(const void *bytes, size_t n, char *out, size_t size);

#endif
