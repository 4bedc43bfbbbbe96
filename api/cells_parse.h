/* cells_parse.h - the body of POST /v1/cells: views whose panels are to be built ahead.
 *
 * {"views": [view, ...]}, each an object as POST /v1/view takes. Pure function of its arguments, any thread.
 */
#ifndef SV_API_CELLS_PARSE_H
#define SV_API_CELLS_PARSE_H

#include "api/view_parse.h"

enum { SV_API_CELLS_VIEWS_MAX = 256 };

/* Every bad field of every view is reported, as "views[2].x". Writes the requests into views (room for
 * SV_API_CELLS_VIEWS_MAX) and their number when the answer is SV_PROBLEM_NONE; otherwise BAD_REQUEST or
 * NOT_BUILT. A view that panels cannot draw is a bad one. */
SV_MUST_CHECK enum sv_problem_kind sv_api_cells_parse(const char *body, size_t bytes,
                                                      const struct sv_api_view_limits *limits,
                                                      struct sv_view_request *views, size_t *count,
                                                      struct sv_errors *errors);

#endif
