/* problem.h - errors as RFC 9457 problem documents (application/problem+json), and the table of their kinds.
 *
 * A kind fixes type (a stable URN), status and title. The detail and the errors[] are in every document and
 * say what went wrong this time and what to do about it; errors[] is empty when no field is to blame.
 *
 * The caller's detail goes out as it is, but for the kinds that complete it to an advice: NOT_FOUND (where to
 * look), MEDIA_TYPE (the media type), NOT_BUILT (the call's summary), FORBIDDEN, TOO_LARGE, URI and HEADERS
 * (what is missing or too large). */
#ifndef SV_API_PROBLEM_H
#define SV_API_PROBLEM_H

#include <stdbool.h>
#include <stddef.h>

#include "core/base/error.h"
#include "core/view/request.h"

#define SV_PROBLEM_MEDIA "application/problem+json"

/* kind, last part of the type, HTTP status, title */
#define SV_PROBLEM_LIST(X)                                                                              \
    X(SV_PROBLEM_BAD_REQUEST, "bad-request", 400, "The request is not legal")                           \
    X(SV_PROBLEM_UNAUTHORIZED, "unauthorized", 401, "The admin token is missing or wrong")              \
    X(SV_PROBLEM_FORBIDDEN, "forbidden", 403, "Admin calls are not configured")                         \
    X(SV_PROBLEM_NOT_FOUND, "not-found", 404, "There is nothing at this path")                          \
    X(SV_PROBLEM_METHOD, "method-not-allowed", 405, "The path does not answer this method")             \
    X(SV_PROBLEM_NOT_ACCEPTABLE, "not-acceptable", 406, "Nothing on offer is acceptable to the client") \
    X(SV_PROBLEM_TIMEOUT, "request-timeout", 408, "The request took too long to arrive")                \
    X(SV_PROBLEM_LENGTH, "length-required", 411, "The request needs a Content-Length")                  \
    X(SV_PROBLEM_TOO_LARGE, "content-too-large", 413, "The request's body is too large")                \
    X(SV_PROBLEM_URI, "uri-too-long", 414, "The request's URL is too long")                             \
    X(SV_PROBLEM_MEDIA_TYPE, "unsupported-media-type", 415, "The body's media type is not supported")   \
    X(SV_PROBLEM_UNDER_GROUND, "eye-under-ground", 422, "The eye is under the ground")                  \
    X(SV_PROBLEM_OUTSIDE, "outside-scene", 422, "The place is outside the scene")                       \
    X(SV_PROBLEM_BAD_SCENE, "bad-scene", 422, "The scene cannot be loaded")                             \
    X(SV_PROBLEM_BAD_PATCH, "bad-patch", 422, "The scene cannot be changed like that")                  \
    X(SV_PROBLEM_HEADERS, "headers-too-large", 431, "The request's headers are too large")              \
    X(SV_PROBLEM_INTERNAL, "internal", 500, "The service failed")                                       \
    X(SV_PROBLEM_VIEW_KILLS, "view-kills-workers", 500, "This view has made the renderer fail")         \
    X(SV_PROBLEM_NOT_BUILT, "not-built-yet", 501, "A later version of the service does this")           \
    X(SV_PROBLEM_NOT_READY, "not-ready", 503, "The service has no scene ready")                         \
    X(SV_PROBLEM_OVERLOADED, "overloaded", 503, "The service is overloaded")                            \
    X(SV_PROBLEM_DRAINING, "draining", 503, "The service is shutting down")                             \
    X(SV_PROBLEM_DEADLINE, "deadline-passed", 504, "The answer was not ready in time")

enum sv_problem_kind {
    SV_PROBLEM_NONE,
#define X(kind, slug, status, title) kind,
    SV_PROBLEM_LIST(X)
#undef X
        SV_PROBLEM_KIND_COUNT
};

struct sv_problem {
    enum sv_problem_kind kind;      /* not NONE */
    const char *detail;             /* borrowed; NULL: made from errors, else what the kind advises */
    const struct sv_errors *errors; /* borrowed; NULL: none */
    const char *request_id;         /* borrowed; NULL: none. Goes out as "request_id" */
    bool has_ground_z;
    double ground_z_m;
    int retry_after_s; /* 0: none */
    const char *allow; /* borrowed; NULL: none. Goes out as "allow" beside the Allow header of a 405 */
};

int sv_api_problem_status(enum sv_problem_kind kind);        /* 200 for NONE */
const char *sv_api_problem_title(enum sv_problem_kind kind); /* "OK" for NONE */
const char *sv_api_problem_slug(enum sv_problem_kind kind);  /* "none" for NONE: also a label for metrics */

/* The document, UTF-8, heap, caller frees; NULL only when memory is out (then send the status without a
 * body). Strings may hold any bytes: what is not UTF-8 is shown escaped. NaN or infinite ground heights
 * become null. */
char *sv_api_problem_document(const struct sv_problem *problem, size_t *bytes);

/* What a failed resolve or draw of a view means to its client. */
enum sv_problem_kind sv_api_problem_of_status(enum sv_status status);

/* A worker's error speaks of "eye" and "target"; this names the keys that the client used ("x", "lon", "agl",
 * ...). */
void sv_api_problem_name_keys(const struct sv_view_request *request, struct sv_error *error);

#endif
