/* view_rules.h - from single fields to one view: what excludes what, what needs what, what a format can hold,
 * what is not built yet. Both readers (KVP, JSON) end here, so both have the same rules. */
#ifndef SV_API_VIEW_RULES_H
#define SV_API_VIEW_RULES_H

#include "api/fields.h"
#include "api/view_parse.h"

/* Forms *view from values (SV_FIELD_COUNT of them, read by fields.h), adding to errors, which may hold faults
 * of single fields already. accept may be NULL. *view is written when the answer is SV_PROBLEM_NONE only. */
enum sv_problem_kind sv_api_view_rules(const struct sv_field_value *values, const char *accept,
                                       const struct sv_api_view_limits *limits, struct sv_api_view *view,
                                       struct sv_errors *errors);

#endif
