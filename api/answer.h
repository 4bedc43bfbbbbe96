/* answer.h - the headers of every answer: what ran how long, what was decided, who may read it, how long it
 * keeps.
 *
 * The daemon fills plain structs; these functions turn them into header lists (headers.h). No socket, no
 * clock. */
#ifndef SV_API_ANSWER_H
#define SV_API_ANSWER_H

#include <stdbool.h>
#include <stdint.h>

#include "api/headers.h"
#include "api/problem.h"
#include "api/trace.h"
#include "core/view/resolved.h"
#include "core/view/timings.h"

enum { SV_ETAG_BUFFER = 40, SV_ROUTE_BUFFER = 96, SV_CAMERA_JSON_BUFFER = 768 };

/* ---- every answer ---- */

struct sv_answer_common {
    const struct sv_trace *trace;     /* NULL: none */
    const struct sv_timings *timings; /* NULL: none; stages that did not run are left out */
    const char *cors_origin;          /* "*", one origin, or NULL: no CORS headers */
};

/* Server, Server-Timing, X-Request-Id, traceparent, Access-Control-Allow-Origin and -Expose-Headers,
 * Timing-Allow-Origin, X-Content-Type-Options, and Vary: Origin for an origin that is not "*". May be called
 * before or after the others. */
void sv_api_answer_common(const struct sv_answer_common *common, struct sv_headers *headers);

/* What a CORS preflight (OPTIONS) gets beside the common ones; allow: "GET, HEAD, POST, OPTIONS". */
void sv_api_answer_preflight(const char *allow, struct sv_headers *headers);

/* Content-Type, Cache-Control: no-store, Content-Language, and by the problem Retry-After, Allow,
 * WWW-Authenticate. */
void sv_api_answer_problem(const struct sv_problem *problem, struct sv_headers *headers);

/* A JSON document that is neither a problem nor a view: Content-Type, Cache-Control, ETag (NULL: none). */
void sv_api_answer_document(const char *media, const char *etag, struct sv_headers *headers);

/* ---- views ---- */

#define SV_CACHE_RESULT_LIST(X)                  \
    X(SV_CACHE_HIT, "hit")                       \
    X(SV_CACHE_MISS, "fwd=miss")                 \
    X(SV_CACHE_STORED, "fwd=miss; stored")       \
    X(SV_CACHE_COLLAPSED, "fwd=miss; collapsed") \
    X(SV_CACHE_BYPASS, "fwd=bypass")

enum sv_cache_result {
#define X(name, text) name,
    SV_CACHE_RESULT_LIST(X)
#undef X
        SV_CACHE_RESULT_COUNT
};

struct sv_answer_view {
    const struct sv_view_request *request;
    const struct sv_resolved_view *resolved;
    const char *etag;
    bool negotiated;            /* struct sv_api_view: Vary: Accept */
    enum sv_cache_result cache; /* a 304 that cost no drawing is a hit */
    int max_age_s;              /* 0: clients keep it but ask each time (no-cache) */
    double relief_distance_m;   /* the scene's: the size of a cell, for Silvista-Route */
    const struct sv_cell_use *cell; /* of the picture; NULL: none was drawn, or it is not at hand */
};

/* ETag, Cache-Control, Cache-Status, Vary, Silvista-Cell, -Plan, -Camera, -Route: for 200 and 304 alike. The
 * 200 adds its Content-Type: that of request->format, or JSON for f=json. */
void sv_api_answer_view(const struct sv_answer_view *answer, bool not_modified, struct sv_headers *headers);

/* ---- the parts, for whoever needs one ---- */

/* Weak entity tag of a view: W/"32 hex digits" over the request's canonical text, the resolved camera, sun
 * and plan, the scene's version and the build. Known before anything is drawn. */
void sv_api_etag_view(const char *canonical, const struct sv_resolved_view *resolved, uint64_t scene_version,
                      const char *build, char out[SV_ETAG_BUFFER]);
/* Weak entity tag of any text (the scene document, the OpenAPI document). */
void sv_api_etag_text(const char *text, size_t bytes, char out[SV_ETAG_BUFFER]);
/* Does an If-None-Match header (NULL: none) name this tag? Weak comparison (RFC 9110, 13.1.2); "*" names
 * every tag. */
bool sv_api_etag_matches(const char *if_none_match, const char *etag);

/* The cell of the face-centred lattice (spacing distance_m, 100 m when that is not above 0; i + j + k even)
 * that a place is in, as "100/5001,52003,8". Of a view the place is the reference point of its outermost cell
 * (struct sv_resolved_view, cell), so that views of one cell have one route. */
void sv_api_route(struct sv_vec3 place, double distance_m, char out[SV_ROUTE_BUFFER]);

/* The resolved camera as one line of JSON: eye, target, up, vfov (degrees) or ortho_height, heading, pitch,
 * roll, convergence, size, and lon, lat where known. Without a target of the client's own, target is 1 m
 * ahead. Returns its length. */
size_t sv_api_camera_json(const struct sv_resolved_view *resolved, char out[SV_CAMERA_JSON_BUFFER]);

/* "hit; id=0123456789abcdef; panels=drawn", "none". Returns out. */
const char *sv_api_cell_text(const struct sv_cell_use *cell, char *out, size_t size);
/* "trees=raycast; relief=off; samples=16; shadows=on": relief is what was drawn, or as sv_api_plan_relief says where
 * cell is NULL. Returns out. */
const char *sv_api_plan_text(const struct sv_plan *plan, const struct sv_cell_use *cell, char *out, size_t size);
/* off, on or auto: off where panels cannot draw it, auto where that is decided when it is drawn. */
const char *sv_api_plan_relief(const struct sv_plan *plan);
/* The form that trees are drawn in: as trees= names it, or for auto "leaf+coarse". */
const char *sv_api_plan_trees(const struct sv_plan *plan);

#endif
