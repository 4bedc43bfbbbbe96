#include "server/daemon/routes.h"

#include <stdio.h>
#include <string.h>
#include <strings.h>

#include "api/answer.h"
#include "server/daemon/cells.h"
#include "server/daemon/pages.h"
#include "server/daemon/reply.h"
#include "server/daemon/views.h"

/* By operationId. */
static const struct {
    const char *id;
    sv_route_handler handler;
} handlers[] = {
    {"getView", sv_views_handle},        {"postView", sv_views_handle},
    {"getScene", sv_page_scene},         {"patchScene", sv_page_patch},
    {"reloadScene", sv_page_reload},     {"getCells", sv_cells_page_list},
    {"postCells", sv_cells_page_build},  {"deleteCells", sv_cells_page_drop},
    {"getLivez", sv_page_livez},         {"getReadyz", sv_page_readyz},
    {"getMetrics", sv_page_metrics},     {"getOpenapi", sv_page_openapi},
    {"getPage", sv_page_home},
};

/* For people, not part of the contract's documents. */
static const struct sv_endpoint home = {.method = "GET", .path = "/", .id = "getPage", .built = true};

static sv_route_handler handler_of(const struct sv_endpoint *endpoint)
{
    for (size_t i = 0; i < sizeof handlers / sizeof handlers[0]; i++)
        if (strcmp(handlers[i].id, endpoint->id) == 0)
            return handlers[i].handler;
    return NULL;
}

static void consider(const struct sv_endpoint *endpoint, const char *method, const char *path,
                     struct sv_route_match *match, size_t *used)
{
    if (!sv_api_endpoint_fits(endpoint, path))
        return;
    match->found = true;
    *used += (size_t)snprintf(match->allow + *used, sizeof match->allow - *used, "%s%s, ", endpoint->method,
                              strcmp(endpoint->method, "GET") == 0 ? ", HEAD" : "");
    if (strcmp(endpoint->method, method) != 0)
        return;
    match->endpoint = endpoint;
    match->handler = endpoint->built ? handler_of(endpoint) : NULL;
}

void sv_routes_match(const char *method, const char *path, struct sv_route_match *match)
{
    int count;
    size_t used = 0;
    const struct sv_endpoint *endpoints = sv_api_endpoints(&count);
    memset(match, 0, sizeof *match);
    consider(&home, method, path, match, &used);
    for (int i = 0; i < count; i++)
        consider(&endpoints[i], method, path, match, &used);
    if (match->found)
        snprintf(match->allow + used, sizeof match->allow - used, "OPTIONS");
}

bool sv_routes_media_fits(const char *content_type, const char *media)
{
    if (!content_type)
        return true;
    size_t bytes = strcspn(content_type, "; \t");
    const char *rest = content_type + bytes + strspn(content_type + bytes, " \t");
    return bytes == strlen(media) && strncasecmp(content_type, media, bytes) == 0 &&
           (*rest == '\0' || *rest == ';');
}

static void answer_options(struct sv_exchange *exchange, const char *allow)
{
    sv_api_answer_preflight(allow, &exchange->headers);
    sv_api_headers_set(&exchange->headers, "Allow", "%s", allow);
    sv_exchange_answer(exchange, 204);
}

void sv_routes_dispatch(struct sv_service *service, struct sv_exchange *exchange)
{
    struct sv_route_match match;
    sv_routes_match(exchange->method, exchange->path, &match);
    bool is_options = strcmp(exchange->method, "OPTIONS") == 0;
    exchange->route = match.endpoint ? match.endpoint->id : "none";
    if (is_options && strcmp(exchange->path, "*") == 0) {
        answer_options(exchange, "GET, HEAD, POST, OPTIONS");
    } else if (!match.found) {
        sv_reply_problem(exchange, SV_PROBLEM_NOT_FOUND, "/openapi.json tells what there is");
    } else if (is_options) {
        answer_options(exchange, match.allow);
    } else if (!match.endpoint) {
        struct sv_problem problem = {.kind = SV_PROBLEM_METHOD, .allow = match.allow};
        sv_reply(exchange, &problem);
    } else if (!match.handler) {
        sv_reply_problem(exchange, SV_PROBLEM_NOT_BUILT, match.endpoint->summary);
    } else if (match.endpoint->body && !exchange->has_length) {
        sv_reply_problem(exchange, SV_PROBLEM_LENGTH, NULL);
    } else if (match.endpoint->body &&
               !sv_routes_media_fits(sv_exchange_field(exchange, "Content-Type"), match.endpoint->body)) {
        sv_reply_problem(exchange, SV_PROBLEM_MEDIA_TYPE, match.endpoint->body);
    } else {
        match.handler(service, exchange);
    }
}
