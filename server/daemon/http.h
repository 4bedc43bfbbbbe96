/* http.h - libmicrohttpd behind exchanges: one request and the one answer that it will get, now or later.
 *
 * libmicrohttpd is polled from outside by the loop. An exchange is handed to the handler when its request is
 * whole; the handler answers at once or keeps the exchange and answers later: meanwhile the connection is
 * suspended and its descriptor watched, so that a client that goes (or half-closes) is noticed. Framing that
 * is not clean (Transfer- Encoding beside Content-Length, no Host, two of them, a blank in a field name) is
 * refused before the handler sees it, and the connection closed. Slow senders and slow takers are cut by
 * deadlines of their own, since libmicrohttpd's time-out does not stop one byte a second. What libmicrohttpd
 * answers by itself (414, 431, 400, 413, 505 for what it cannot parse) has its own plain form.
 *
 * Every answer carries what api/answer.h gives to all: X-Request-Id, traceparent, Server-Timing, CORS. */
#ifndef SV_SERVER_HTTP_H
#define SV_SERVER_HTTP_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "api/answer.h"
#include "api/problem.h"
#include "core/base/error.h"
#include "core/view/timings.h"
#include "server/daemon/loop.h"
#include "server/daemon/metrics.h"
#include "server/daemon/settings.h"

struct sv_http;
struct sv_exchange;

typedef void (*sv_exchange_call)(void *context, struct sv_exchange *exchange);
/* Answers a request that is refused before any handler sees it. */
typedef void (*sv_exchange_refusal)(void *context, struct sv_exchange *exchange, enum sv_problem_kind kind,
                                    const char *detail);

struct sv_exchange {
    /* The request. */
    char *method;
    bool head;         /* asked by HEAD; method is then GET */
    char *path;        /* as sent: percent-encoded, without query */
    const char *query; /* what follows the first '?'; NULL without one */
    size_t query_bytes;
    char *body; /* NUL-terminated for convenience; may hold NUL bytes */
    size_t body_bytes;
    bool has_length; /* the client announced a body (Content-Length or chunked) */
    double arrival_ms;
    struct sv_trace trace; /* X-Request-Id and traceparent */
    const char *route;     /* set by the handler, for metrics and logs; a string that stays */

    /* Whoever keeps the exchange sets these; gone is called at most once, and never after the answer. */
    void *owner;
    void (*gone)(struct sv_exchange *exchange);

    /* The answer, as far as it is built. */
    unsigned status; /* 0: none yet */
    struct sv_headers headers;
    const void *answer;
    size_t answer_bytes;
    void (*release)(void *context); /* of the answer's bytes; called once, may be NULL */
    void *release_context;
    struct sv_timings timings; /* stages that ran; total is filled in at the answer */
    bool close;                /* close the connection after it */

    struct sv_exchange_private *private_;
};

struct sv_http_options {
    struct sv_loop *loop;
    struct sv_metrics *metrics;
    const struct sv_settings *settings;
    const char *tls_cert, *tls_key; /* PEM texts, NULL: no TLS */
    sv_exchange_call handler;
    sv_exchange_refusal refuse;
    void *context;
};

/* Opens the listening socket (SO_REUSEADDR, so that a restart gets the port at once) and starts to accept.
 * Errors name `listen`. */
SV_MUST_CHECK enum sv_status sv_http_create(const struct sv_http_options *options, struct sv_http **http,
                                            struct sv_error *error);
/* Every exchange that is still kept must have been answered. */
void sv_http_destroy(struct sv_http *http);
unsigned sv_http_port(const struct sv_http *http);
size_t sv_http_connections(const struct sv_http *http);
/* Exchanges whose request has begun and whose answer is not out. */
size_t sv_http_active(const struct sv_http *http);
/* No new connections; connections close after their current answer. */
void sv_http_drain(struct sv_http *http);
/* Calls `call` for every exchange that is kept by the handler and not answered. */
void sv_http_each_kept(struct sv_http *http, sv_exchange_call call, void *context);

/* A field of the request, NULL when absent; the first one when there are several. Borrowed. */
const char *sv_exchange_field(struct sv_exchange *exchange, const char *name);
/* All fields of that name, joined with ", ". Heap; NULL when absent. */
char *sv_exchange_fields(struct sv_exchange *exchange, const char *name);
/* Sets the body: borrowed until release(context) is called. */
void sv_exchange_set_body(struct sv_exchange *exchange, const void *bytes, size_t size,
                          void (*release)(void *), void *context);
/* Sets a heap text as the body and takes it; NULL text is an empty body. */
void sv_exchange_take_text(struct sv_exchange *exchange, char *text);
/* Sends what was built. Once. */
void sv_exchange_answer(struct sv_exchange *exchange, unsigned status);

#endif
