/* endpoints.h - the table of all that the service answers, now and in later versions: what the OpenAPI
 * document lists, and how a request for a later endpoint is told from one for nothing (501 instead of 404).
 */
#ifndef SV_API_ENDPOINTS_H
#define SV_API_ENDPOINTS_H

#include <stdbool.h>

#include "api/problem.h"

enum { SV_ENDPOINT_MEDIA_MAX = 6, SV_ENDPOINT_PROBLEMS_MAX = 14 };

/* Header sets that answers carry, as bits. */
enum {
    SV_ANSWERS_CACHED = 1, /* ETag and 304 */
    SV_ANSWERS_VIEW = 2,   /* Cache-Status and the Silvista-... headers */
};

struct sv_endpoint {
    const char *method, *path; /* path: {name} stands for one segment, or a part of it */
    const char *id;            /* operationId */
    const char *tag, *summary;
    bool built;                               /* false: answers 501 until a later version builds it */
    bool admin;                               /* needs the admin token */
    bool view_query;                          /* takes the fields of a view as query keys */
    const char *body;                         /* media type of the request's body, NULL: none */
    const char *success;                      /* "200", "204", ... */
    const char *media[SV_ENDPOINT_MEDIA_MAX]; /* of the answer */
    unsigned answers;                         /* SV_ANSWERS_... */
    enum sv_problem_kind problems[SV_ENDPOINT_PROBLEMS_MAX]; /* beside those that any call can get */
};

const struct sv_endpoint *sv_api_endpoints(int *count);

/* Does a path ("/tiles/3/4/5.png", still encoded) fit an endpoint's path? Each {name} takes at least one
 * character, none of them a slash. */
bool sv_api_endpoint_fits(const struct sv_endpoint *endpoint, const char *path);

/* The endpoint for a method and a path that is not built yet; NULL when there is none. HEAD counts as GET. */
const struct sv_endpoint *sv_api_endpoint_later(const char *method, const char *path);

#endif
