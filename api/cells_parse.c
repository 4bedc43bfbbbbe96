/* cells_parse.c - see cells_parse.h. */
#include "api/cells_parse.h"

#include <stdio.h>
#include <string.h>

#include "api/fields.h"
#include "api/json.h"

/* What was wrong in one view, under its place in the list. */
static void take_errors(size_t index, const struct sv_errors *of_view, struct sv_errors *errors)
{
    for (size_t k = 0; k < of_view->count; k++) {
        const struct sv_error *e = &of_view->items[k];
        char field[sizeof e->field];
        snprintf(field, sizeof field, "views[%zu]%s%.100s", index, e->field[0] ? "." : "", e->field);
        sv_errors_add(errors, e->code, field, "%s", e->message);
    }
}

static enum sv_problem_kind parse_one(const cJSON *item, size_t index,
                                      const struct sv_api_view_limits *limits,
                                      struct sv_view_request *request, struct sv_errors *errors)
{
    struct sv_errors own;
    struct sv_api_view view;
    sv_errors_init(&own);
    enum sv_problem_kind kind = sv_api_view_parse_tree(item, NULL, limits, &view, &own);
    if (kind == SV_PROBLEM_NONE) {
        bool none = view.request.relief == SV_RELIEF_OFF || view.request.relief == SV_RELIEF_PAPER;
        enum sv_field_id bar = none ? SV_FIELD_RELIEF : sv_api_view_cell_bar(&view.request);
        *request = view.request;
        if (bar != SV_FIELD_COUNT) {
            sv_errors_add(&own, SV_EINVAL, sv_api_field_name(bar),
                          "such a view is not drawn from relief panels");
            kind = SV_PROBLEM_BAD_REQUEST;
        }
    }
    take_errors(index, &own, errors);
    sv_errors_finish(&own);
    return kind;
}

static enum sv_problem_kind parse_list(const cJSON *list, const struct sv_api_view_limits *limits,
                                       struct sv_view_request *views, size_t *count, struct sv_errors *errors)
{
    enum sv_problem_kind worst = SV_PROBLEM_NONE;
    size_t index = 0;
    const cJSON *item;
    cJSON_ArrayForEach(item, list)
    {
        enum sv_problem_kind kind = parse_one(item, index, limits, &views[index], errors);
        if (kind == SV_PROBLEM_BAD_REQUEST || worst == SV_PROBLEM_NONE)
            worst = kind;
        index++;
    }
    *count = index;
    return worst;
}

enum sv_problem_kind sv_api_cells_parse(const char *body, size_t bytes,
                                        const struct sv_api_view_limits *limits,
                                        struct sv_view_request *views, size_t *count,
                                        struct sv_errors *errors)
{
    struct sv_error why;
    cJSON *root;
    if (sv_api_json_parse(body, bytes, &root, &why)) {
        sv_errors_add(errors, SV_EINVAL, why.field, "%s", why.message);
        return SV_PROBLEM_BAD_REQUEST;
    }
    enum sv_problem_kind kind = SV_PROBLEM_BAD_REQUEST;
    const cJSON *list = cJSON_GetObjectItemCaseSensitive(root, "views");
    int size = cJSON_GetArraySize(list);
    for (const cJSON *item = cJSON_IsObject(root) ? root->child : NULL; item; item = item->next)
        if (strcmp(item->string, "views") != 0)
            sv_errors_add(errors, SV_EINVAL, item->string, "unknown key: expected views");
    if (!cJSON_IsArray(list) || size < 1)
        sv_errors_add(errors, SV_EINVAL, "views", "must be an array of views, at least one");
    else if (size > SV_API_CELLS_VIEWS_MAX)
        sv_errors_add(errors, SV_ELIMIT, "views", "%d views: at most %d at a time", size,
                      SV_API_CELLS_VIEWS_MAX);
    else if (errors->total == 0)
        kind = parse_list(list, limits, views, count, errors);
    cJSON_Delete(root);
    return kind;
}
