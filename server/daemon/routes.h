/* routes.h - which path answers which method, and what follows from that: 404, 405 with Allow, 411, 415, 501,
 * OPTIONS.
 *
 * The paths are those of the contract's table (api/endpoints.h) and the viewer page; here is only who handles
 * which. The match is a pure function of method and path; the dispatcher derives every answer that does not
 * need a handler. HEAD is GET here (http.h). */
#ifndef SV_SERVER_ROUTES_H
#define SV_SERVER_ROUTES_H

#include <stdbool.h>
#include <stddef.h>

#include "api/endpoints.h"
#include "server/daemon/http.h"

struct sv_service;

typedef void (*sv_route_handler)(struct sv_service *service, struct sv_exchange *exchange);

enum { SV_ROUTE_ALLOW_MAX = 64 };

struct sv_route_match {
    bool found;                         /* some endpoint has that path */
    const struct sv_endpoint *endpoint; /* NULL: none for that method */
    sv_route_handler handler;           /* NULL: not built yet */
    char allow[SV_ROUTE_ALLOW_MAX];     /* "GET, HEAD, POST, OPTIONS"; "" when nothing was found */
};

void sv_routes_match(const char *method, const char *path, struct sv_route_match *match);
/* May a body of that Content-Type (NULL: none said) be read as that media type? */
bool sv_routes_media_fits(const char *content_type, const char *media);
/* Answers the exchange or hands it to its handler. */
void sv_routes_dispatch(struct sv_service *service, struct sv_exchange *exchange);

#endif
