/* problem.c - see problem.h. */
#include "api/problem.h"

#include <stdio.h>
#include <string.h>

#include "api/json_write.h"

static const struct {
    const char *slug, *type, *title;
    int status;
} kinds[] = {[SV_PROBLEM_NONE] = {"none", "about:blank", "OK", 200},
#define X(kind, slug, status, title) [kind] = {slug, "urn:silvista:problem:" slug, title, status},
             SV_PROBLEM_LIST(X)
#undef X
};

static enum sv_problem_kind legal(enum sv_problem_kind kind)
{
    return (unsigned)kind < SV_PROBLEM_KIND_COUNT ? kind : SV_PROBLEM_INTERNAL;
}

int sv_api_problem_status(enum sv_problem_kind kind)
{
    return kinds[legal(kind)].status;
}

const char *sv_api_problem_title(enum sv_problem_kind kind)
{
    return kinds[legal(kind)].title;
}

const char *sv_api_problem_slug(enum sv_problem_kind kind)
{
    return kinds[legal(kind)].slug;
}

static void add_errors(cJSON *root, const struct sv_errors *errors, bool *good)
{
    cJSON *list = cJSON_CreateArray();
    for (size_t k = 0; k < errors->count; k++) {
        cJSON *item = cJSON_CreateObject();
        sv_api_json_add_text(item, "field", errors->items[k].field, good);
        sv_api_json_add_text(item, "detail", errors->items[k].message, good);
        sv_api_json_append(list, item, good);
    }
    sv_api_json_add(root, "errors", list, good);
    if (errors->total > errors->count)
        sv_api_json_add_number(root, "errors_total", (double)errors->total, good);
}

/* One error speaks for itself; several are counted and their fields named. */
static void add_detail(cJSON *root, const struct sv_problem *problem, bool *good)
{
    const struct sv_errors *errors = problem->errors;
    char text[1024];
    if (problem->detail) {
        sv_api_json_add_text(root, "detail", problem->detail, good);
        return;
    }
    if (!errors || errors->count == 0)
        return;
    const struct sv_error *first = &errors->items[0];
    int used = errors->total == 1 ? snprintf(text, sizeof text, "%s%s%s", first->field,
                                             first->field[0] ? ": " : "", first->message)
                                  : snprintf(text, sizeof text, "%zu errors:", errors->total);
    for (size_t k = 0; errors->total > 1 && k < errors->count && used < 800; k++)
        used += snprintf(text + used, sizeof text - (size_t)used, "%s %.64s", k ? "," : "",
                         errors->items[k].field[0] ? errors->items[k].field : "(request)");
    sv_api_json_add_text(root, "detail", text, good);
}

char *sv_api_problem_document(const struct sv_problem *problem, size_t *bytes)
{
    enum sv_problem_kind kind = legal(problem->kind);
    bool good = true;
    cJSON *root = cJSON_CreateObject();
    sv_api_json_add_text(root, "type", kinds[kind].type, &good);
    sv_api_json_add_text(root, "title", kinds[kind].title, &good);
    sv_api_json_add_number(root, "status", kinds[kind].status, &good);
    add_detail(root, problem, &good);
    if (problem->errors && problem->errors->count > 0)
        add_errors(root, problem->errors, &good);
    if (problem->has_ground_z)
        sv_api_json_add_number(root, "ground_z_m", problem->ground_z_m, &good);
    if (problem->retry_after_s > 0)
        sv_api_json_add_number(root, "retry_after_s", problem->retry_after_s, &good);
    if (problem->allow)
        sv_api_json_add_text(root, "allow", problem->allow, &good);
    if (problem->request_id)
        sv_api_json_add_text(root, "request_id", problem->request_id, &good);
    return sv_api_json_print(root, good, bytes);
}

enum sv_problem_kind sv_api_problem_of_status(enum sv_status status)
{
    static const enum sv_problem_kind of[SV_STATUS_COUNT] = {
        [SV_OK] = SV_PROBLEM_NONE,
        [SV_EINVAL] = SV_PROBLEM_BAD_REQUEST,
        [SV_ENOENT] = SV_PROBLEM_INTERNAL,  /* a file that the scene had when it was loaded */
        [SV_EFORMAT] = SV_PROBLEM_INTERNAL, /* likewise: a view names no file */
        [SV_ELIMIT] = SV_PROBLEM_BAD_REQUEST,
        [SV_EUNSUPPORTED] = SV_PROBLEM_NOT_BUILT,
        [SV_EUNDERGROUND] = SV_PROBLEM_UNDER_GROUND,
        [SV_EOUTSIDE] = SV_PROBLEM_OUTSIDE,
        [SV_EIO] = SV_PROBLEM_INTERNAL,
        [SV_ENOMEM] = SV_PROBLEM_INTERNAL,
        [SV_ETIMEOUT] = SV_PROBLEM_DEADLINE,
        [SV_EINTERNAL] = SV_PROBLEM_INTERNAL,
    };
    return (unsigned)status < SV_STATUS_COUNT ? of[status] : SV_PROBLEM_INTERNAL;
}

void sv_api_problem_name_keys(const struct sv_view_request *request, struct sv_error *error)
{
    bool eye = request->eye.form != SV_PLACE_NONE;
    const char *key = NULL;
    if (strcmp(error->field, "eye") == 0)
        key = request->eye.form == SV_PLACE_LONLAT ? "lon" : eye ? "x" : "range";
    else if (strcmp(error->field, "target") == 0)
        key = request->target.form == SV_PLACE_LONLAT ? "target_lon" : "target_x";
    else if (strcmp(error->field, "z") == 0)
        key = !eye ? "range" : request->eye.has_z ? "z" : "agl";
    if (key)
        snprintf(error->field, sizeof error->field, "%s", key);
}
