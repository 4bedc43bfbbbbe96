/* trace.h - the identity of one request: X-Request-Id, and W3C Trace Context's traceparent (level 1, 2021).
 *
 * Random bytes are given from above: nothing here reads a clock or a device. */
#ifndef SV_API_TRACE_H
#define SV_API_TRACE_H

#include <stdbool.h>
#include <stdint.h>

enum { SV_REQUEST_ID_BUFFER = 65, SV_TRACEPARENT_BUFFER = 56, SV_TRACE_RANDOM_BYTES = 40 };

struct sv_trace {
    char request_id[SV_REQUEST_ID_BUFFER];
    char traceparent[SV_TRACEPARENT_BUFFER]; /* same trace as the client's, a span of our own */
    bool continued;                          /* the client's traceparent was legal and is continued */
};

/* The client's id is kept when it is 1 to 64 of [A-Za-z0-9._-], else one is made (32 hex digits). The
 * client's traceparent is continued when it is legal, else a new trace is begun (not sampled). Both may be
 * NULL. */
void sv_api_trace(const char *request_id, const char *traceparent,
                  const uint8_t random[SV_TRACE_RANDOM_BYTES], struct sv_trace *trace);

/* Is it a legal traceparent (version 00, or a later one that begins like it)? */
bool sv_api_traceparent_valid(const char *traceparent);

#endif
