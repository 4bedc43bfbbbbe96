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

/* What a client can do about a kind. The caller's own detail stands between before and after; alone is said
 * when there is none, and no error to speak for itself. */
static const struct {
    const char *before, *after, *alone;
} advice[SV_PROBLEM_KIND_COUNT] = {
    [SV_PROBLEM_BAD_REQUEST] = {.alone = "see /openapi.json for what is legal"},
    [SV_PROBLEM_UNAUTHORIZED] = {.alone = "send Authorization: Bearer TOKEN, with the service's admin_token"},
    [SV_PROBLEM_FORBIDDEN] = {.after = ": start the service with one to allow administrative calls",
                              .alone = "start the service with an admin_token to allow administrative calls"},
    [SV_PROBLEM_NOT_FOUND] = {.before = "check the path: ",
                              .alone = "check the path: /openapi.json tells what there is"},
    [SV_PROBLEM_METHOD] = {.alone = "see the Allow header for the methods of this path"},
    [SV_PROBLEM_NOT_ACCEPTABLE] = {.alone = "send an Accept header that takes what the path offers, or none"},
    [SV_PROBLEM_TIMEOUT] = {.alone = "send the whole request without pauses"},
    [SV_PROBLEM_LENGTH] = {.alone = "send Content-Length, or Transfer-Encoding: chunked"},
    [SV_PROBLEM_TOO_LARGE] = {.after = ": send a smaller one", .alone = "send a smaller body"},
    [SV_PROBLEM_URI] = {.after = ": send a view as the JSON body of POST /v1/view instead",
                        .alone = "send a view as the JSON body of POST /v1/view instead"},
    [SV_PROBLEM_MEDIA_TYPE] = {.before = "send Content-Type: ",
                               .alone = "send the Content-Type that /openapi.json tells for this call"},
    [SV_PROBLEM_UNDER_GROUND] = {.alone = "raise the eye over the ground there"},
    [SV_PROBLEM_OUTSIDE] = {.alone = "stay within the extent that /v1/scene tells"},
    [SV_PROBLEM_BAD_SCENE] = {.alone = "mend the scene file and reload it"},
    [SV_PROBLEM_BAD_PATCH] = {.alone = "stay within the extent and the ids that /v1/scene tells"},
    [SV_PROBLEM_HEADERS] = {.after = ": send fewer or shorter ones",
                            .alone = "send fewer or shorter header fields"},
    [SV_PROBLEM_INTERNAL] = {.alone = "the service's log tells more under this request_id"},
    [SV_PROBLEM_VIEW_KILLS] = {.alone = "ask for another view: this one is not tried again"},
    [SV_PROBLEM_NOT_BUILT] = {.before = "this call is not built yet (",
                              .after = "): /openapi.json marks what is",
                              .alone = "/openapi.json marks what is built"},
    [SV_PROBLEM_NOT_READY] = {.alone = "try again later: /readyz tells when a scene is ready"},
    [SV_PROBLEM_OVERLOADED] = {.alone = "try again later"},
    [SV_PROBLEM_DRAINING] = {.alone =
                                 "send the request again once the service, or another of its kind, is up"},
    [SV_PROBLEM_DEADLINE] = {.alone =
                                 "ask for a smaller or simpler picture, or for more time by Prefer: wait=N"},
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
    for (size_t k = 0; errors && k < errors->count; k++) {
        cJSON *item = cJSON_CreateObject();
        sv_api_json_add_text(item, "field", errors->items[k].field, good);
        sv_api_json_add_text(item, "detail", errors->items[k].message, good);
        sv_api_json_append(list, item, good);
    }
    sv_api_json_add(root, "errors", list, good);
    if (errors && errors->total > errors->count)
        sv_api_json_add_number(root, "errors_total", (double)errors->total, good);
}

/* One error speaks for itself; several are counted and their fields named. */
static void errors_text(const struct sv_errors *errors, char *text, size_t size)
{
    const struct sv_error *first = &errors->items[0];
    int used = errors->total == 1
                   ? snprintf(text, size, "%s%s%s", first->field, first->field[0] ? ": " : "", first->message)
                   : snprintf(text, size, "%zu errors:", errors->total);
    for (size_t k = 0; errors->total > 1 && k < errors->count && used < 800; k++)
        used += snprintf(text + used, size - (size_t)used, "%s %.64s", k ? "," : "",
                         errors->items[k].field[0] ? errors->items[k].field : "(request)");
}

static void add_detail(cJSON *root, const struct sv_problem *problem, bool *good)
{
    enum sv_problem_kind kind = legal(problem->kind);
    const char *before = advice[kind].before, *after = advice[kind].after;
    char text[1024];
    if (problem->detail)
        snprintf(text, sizeof text, "%s%.800s%s", before ? before : "", problem->detail, after ? after : "");
    else if (problem->errors && problem->errors->count > 0)
        errors_text(problem->errors, text, sizeof text);
    else if (kind == SV_PROBLEM_METHOD && problem->allow)
        snprintf(text, sizeof text, "send one of the methods that this path answers: %.800s", problem->allow);
    else
        snprintf(text, sizeof text, "%s", advice[kind].alone ? advice[kind].alone : kinds[kind].title);
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
