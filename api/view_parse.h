/* view_parse.h - a view request from the wire: GET's query string or POST's JSON object, checked in full.
 *
 * Every bad field is reported at once, with its legal range and unit. A request that is legal but asks for
 * what is not built yet is 501, one that nothing on offer can satisfy by its Accept header 406; 400 goes
 * before 501 before 406. Pure functions of their arguments: no socket, no clock, any thread. */
#ifndef SV_API_VIEW_PARSE_H
#define SV_API_VIEW_PARSE_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "api/fields.h"
#include "api/problem.h"
#include "core/base/error.h"
#include "core/view/request.h"

/* The configured limits; the field table has those that never change. */
struct sv_api_view_limits {
    uint64_t pixels_max;        /* width x height */
    uint64_t sample_pixels_max; /* samples x width x height */
};
#define SV_API_VIEW_LIMITS_DEFAULT                                                      \
    {                                                                                   \
        .pixels_max = UINT64_C(4096) * 4096, .sample_pixels_max = UINT64_C(4096) * 4096 \
    }

struct sv_api_view {
    struct sv_view_request request;
    bool negotiated; /* the Accept header had a say in the format: answer with Vary: Accept */
};

/* query: the bytes after '?', still encoded (NULL with 0 bytes is legal: what must be given is then
 * reported). accept: the Accept header, NULL when there is none. errors: initialised by the caller, who
 * finishes it. *view is written when the answer is SV_PROBLEM_NONE; otherwise the answer is BAD_REQUEST,
 * NOT_BUILT or NOT_ACCEPTABLE, and errors is not empty (unless memory is out). */
SV_MUST_CHECK enum sv_problem_kind sv_api_view_parse_kvp(const char *query, size_t bytes, const char *accept,
                                                         const struct sv_api_view_limits *limits,
                                                         struct sv_api_view *view, struct sv_errors *errors);

/* body: one JSON object with the same names. Numbers are JSON numbers, on/off may be true/false, layer may be
 * an array of names. */
SV_MUST_CHECK enum sv_problem_kind sv_api_view_parse_json(const char *body, size_t bytes, const char *accept,
                                                          const struct sv_api_view_limits *limits,
                                                          struct sv_api_view *view, struct sv_errors *errors);

/* The same of one value of a JSON tree (<cJSON.h>) that was parsed before. */
struct cJSON;
SV_MUST_CHECK enum sv_problem_kind sv_api_view_parse_tree(const struct cJSON *root, const char *accept,
                                                          const struct sv_api_view_limits *limits,
                                                          struct sv_api_view *view, struct sv_errors *errors);

/* The first field that keeps a view from being drawn from relief panels, which hold the colour of what is seen in
 * perspective, one sample a pixel, trees in the form of auto; SV_FIELD_COUNT: none does. */
enum sv_field_id sv_api_view_cell_bar(const struct sv_view_request *request);
/* The samples a pixel that a request comes to when it names none: 16 for quality=reference, else 1. */
int sv_api_view_samples(const struct sv_view_request *request);
/* Is it ray cast (quality=reference, trees=raycast)? */
bool sv_api_view_is_raycast(const struct sv_view_request *request);

#endif
