/* http_private.h - what http.c (connections, libmicrohttpd) and exchange.c (the answer) share. */
#ifndef SV_SERVER_HTTP_PRIVATE_H
#define SV_SERVER_HTTP_PRIVATE_H

#include <microhttpd.h>

#include "server/daemon/http.h"

struct sv_connection {
    struct sv_http *http;
    struct MHD_Connection *mhd;
    int fd;                         /* libmicrohttpd's */
    struct sv_timer deadline, look; /* look: at a half-closed connection, soon */
    struct sv_watch *watch;         /* of the peer's closing */
    bool half_closed;               /* the peer will send nothing more */
    struct sv_exchange *exchange;   /* the current one; NULL between requests */
};

struct sv_exchange_private {
    struct sv_connection *connection;
    struct sv_exchange *next, *previous; /* of all exchanges */
    char *target;
    size_t body_room;
    bool begun;      /* header fields are there */
    bool dispatched; /* the handler has it or had it */
    bool suspended, answered, gone;
    bool body_too_large;
};

struct sv_http {
    struct sv_http_options options;
    struct MHD_Daemon *daemon;
    struct sv_watch *watch;
    int listen_fd;
    unsigned port;
    bool run_now, draining;
    size_t connections, active;
    struct sv_exchange *exchanges;
    uint8_t random[4000];
    size_t random_left;
};

/* The answer as libmicrohttpd wants it, with the fields that every answer carries; NULL when out of memory.
 */
struct MHD_Response *sv_exchange_response(struct sv_exchange *exchange);
/* X-Request-Id and traceparent, once the request's fields are there. */
void sv_exchange_identify(struct sv_exchange *exchange);
/* Frees what an exchange owns, not the exchange. */
void sv_exchange_finish(struct sv_exchange *exchange);

#endif
