/* endpoints.c - see endpoints.h. */
#include "api/endpoints.h"

#include <stddef.h>
#include <string.h>

#define IMAGES                                                                                   \
    {                                                                                            \
        "image/jpeg", "image/png", "image/webp", "image/tiff", "image/x-exr", "application/json" \
    }
#define VIEW_PROBLEMS                                                                                   \
    {                                                                                                   \
        SV_PROBLEM_BAD_REQUEST, SV_PROBLEM_NOT_ACCEPTABLE, SV_PROBLEM_UNDER_GROUND, SV_PROBLEM_OUTSIDE, \
            SV_PROBLEM_INTERNAL, SV_PROBLEM_VIEW_KILLS, SV_PROBLEM_NOT_BUILT, SV_PROBLEM_NOT_READY,     \
            SV_PROBLEM_OVERLOADED, SV_PROBLEM_DEADLINE                                                  \
    }
#define BODY_PROBLEMS SV_PROBLEM_BAD_REQUEST, SV_PROBLEM_LENGTH, SV_PROBLEM_TOO_LARGE, SV_PROBLEM_MEDIA_TYPE
#define ADMIN_PROBLEMS SV_PROBLEM_UNAUTHORIZED, SV_PROBLEM_FORBIDDEN
#define LATER .built = false

static const struct sv_endpoint table[] = {
    {"GET", "/v1/view", "getView", "views", "Draw one view, asked for by query keys", .built = true,
     .view_query = true, .success = "200", .media = IMAGES, .answers = SV_ANSWERS_CACHED | SV_ANSWERS_VIEW,
     .problems = VIEW_PROBLEMS},
    {"POST", "/v1/view", "postView", "views", "Draw one view, asked for by a JSON object of the same keys",
     .built = true, .body = "application/json", .success = "200", .media = IMAGES,
     .answers = SV_ANSWERS_CACHED | SV_ANSWERS_VIEW,
     .problems = {BODY_PROBLEMS, SV_PROBLEM_NOT_ACCEPTABLE, SV_PROBLEM_UNDER_GROUND, SV_PROBLEM_OUTSIDE,
                  SV_PROBLEM_INTERNAL, SV_PROBLEM_VIEW_KILLS, SV_PROBLEM_NOT_BUILT, SV_PROBLEM_NOT_READY,
                  SV_PROBLEM_OVERLOADED, SV_PROBLEM_DEADLINE}},
    {"POST", "/v1/batch", "postBatch", "views",
     "Draw many views, one a line; the answers stream as they finish", LATER, .body = "application/x-ndjson",
     .success = "200", .media = {"application/x-tar", "application/x-ndjson"}, .problems = {BODY_PROBLEMS}},
    {"POST", "/v1/path", "postPath", "views", "Draw the frames of a smooth camera path through key poses",
     LATER, .body = "application/json", .success = "200",
     .media = {"application/x-tar", "application/x-ndjson"}, .problems = {BODY_PROBLEMS}},
    {"POST", "/v1/compare", "postCompare", "trade",
     "Draw a view as asked and as reference, and tell the difference", LATER, .body = "application/json",
     .success = "200", .media = {"application/json", "image/png"}, .problems = {BODY_PROBLEMS}},
    {"GET", "/v1/tradeoff", "getTradeoff", "trade",
     "The measured table of time and error that the planner uses", LATER, .success = "200",
     .media = {"application/json"}},
    {"GET", "/v1/scene", "getScene", "scene",
     "What the scene holds: extent, terrain, species, trees, sun, limits", .built = true, .success = "200",
     .media = {"application/json"}, .answers = SV_ANSWERS_CACHED, .problems = {SV_PROBLEM_NOT_READY}},
    {"PATCH", "/v1/scene", "patchScene", "scene",
     "Change the sun, trees or objects; the old scene serves until the new one is ready", .built = true,
     .admin = true, .body = "application/json", .success = "200", .media = {"application/json"},
     .problems = {BODY_PROBLEMS, ADMIN_PROBLEMS, SV_PROBLEM_BAD_PATCH, SV_PROBLEM_NOT_READY, SV_PROBLEM_DRAINING}},
    {"POST", "/v1/scene/reload", "reloadScene", "scene",
     "Read the scene file again; the old scene serves until the new one is ready, and for good if that is "
     "bad",
     .built = true, .admin = true, .success = "200", .media = {"application/json"},
     .problems = {ADMIN_PROBLEMS, SV_PROBLEM_BAD_SCENE, SV_PROBLEM_NOT_READY, SV_PROBLEM_DRAINING}},
    {"GET", "/v1/cells", "getCells", "cells", "The relief cells in memory, and their panels", .built = true,
     .success = "200", .media = {"application/json"}, .problems = {SV_PROBLEM_NOT_READY}},
    {"POST", "/v1/cells", "postCells", "cells", "Build the panels of views ahead, on workers that have nothing else to do",
     .built = true, .admin = true, .body = "application/json", .success = "202", .media = {"application/json"},
     .problems = {BODY_PROBLEMS, ADMIN_PROBLEMS, SV_PROBLEM_NOT_BUILT, SV_PROBLEM_NOT_READY, SV_PROBLEM_OVERLOADED,
                  SV_PROBLEM_DRAINING}},
    {"DELETE", "/v1/cells", "deleteCells", "cells", "Drop all panels of cells", .built = true, .admin = true, .success = "204",
     .problems = {ADMIN_PROBLEMS, SV_PROBLEM_NOT_READY}},
    {"GET", "/tiles/{z}/{x}/{y}.{format}", "getTile", "map", "A map tile, straight down (Web Mercator)",
     LATER, .success = "200", .media = {"image/png", "image/jpeg", "image/webp"}},
    {"GET", "/tiles.json", "getTileJson", "map", "TileJSON of the tiles", LATER, .success = "200",
     .media = {"application/json"}},
    {"GET", "/wms", "getWms", "map", "WMS 1.1.1 and 1.3.0", LATER, .success = "200",
     .media = {"text/xml", "image/png", "image/jpeg", "image/webp"}},
    {"GET", "/static/{place}/{size}.{format}", "getStatic", "map", "The spelling of static-map services",
     LATER, .success = "200", .media = {"image/png", "image/jpeg", "image/webp"}},
    {"GET", "/livez", "getLivez", "service", "The event loop answers", .built = true, .success = "200",
     .media = {"text/plain"}},
    {"GET", "/readyz", "getReadyz", "service", "A scene is loaded, the queue has room, nothing is draining",
     .built = true, .success = "200", .media = {"text/plain"},
     .problems = {SV_PROBLEM_NOT_READY, SV_PROBLEM_OVERLOADED, SV_PROBLEM_DRAINING}},
    {"GET", "/metrics", "getMetrics", "service", "Prometheus metrics", .built = true, .success = "200",
     .media = {"text/plain"}},
    {"GET", "/openapi.json", "getOpenapi", "service", "This document", .built = true, .success = "200",
     .media = {"application/json"}, .answers = SV_ANSWERS_CACHED},
};

const struct sv_endpoint *sv_api_endpoints(int *count)
{
    *count = (int)(sizeof table / sizeof table[0]);
    return table;
}

bool sv_api_endpoint_fits(const struct sv_endpoint *endpoint, const char *path)
{
    const char *p = endpoint->path;
    while (*p) {
        if (*p != '{') {
            if (*p++ != *path++)
                return false;
            continue;
        }
        p = strchr(p, '}') +
            1; /* the table's braces are paired; what follows one is a separator or the end */
        const char *last = NULL;
        size_t segment = strcspn(path, "/");
        for (size_t k = 1; k <= segment; k++)
            if (path[k] == *p)
                last = path + k;
        if (!last)
            return false;
        path = last;
    }
    return *path == '\0';
}

const struct sv_endpoint *sv_api_endpoint_later(const char *method, const char *path)
{
    const char *as = strcmp(method, "HEAD") == 0 ? "GET" : method;
    for (size_t k = 0; k < sizeof table / sizeof table[0]; k++)
        if (!table[k].built && strcmp(table[k].method, as) == 0 && sv_api_endpoint_fits(&table[k], path))
            return &table[k];
    return NULL;
}
