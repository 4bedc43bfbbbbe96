/* answer.c - see answer.h. */
#include "api/answer.h"

#include <inttypes.h>
#include <math.h>
#include <stdio.h>
#include <string.h>

#include "api/number.h"
#include "core/base/hash.h"

/* Headers that a script in another origin may read. */
static const char exposed[] =
    "Server-Timing, X-Request-Id, traceparent, ETag, Cache-Status, Retry-After, "
    "Content-Disposition, Silvista-Cell, Silvista-Plan, Silvista-Error, Silvista-Camera, "
    "Silvista-Route";

/* The scene file's default of relief.distance_m. */
static const double default_distance_m = 100;

static void server_timing(const struct sv_timings *timings, struct sv_headers *headers)
{
    static const char *const names[] = {
#define X(id, text) [id] = text,
        SV_STAGE_LIST(X)
#undef X
    };
    char text[512] = "";
    size_t used = 0;
    for (int k = 0; k < SV_STAGE_COUNT; k++)
        if (timings->ms[k] >= 0 && timings->ms[k] < 1e9)
            used += (size_t)snprintf(text + used, sizeof text - used, "%s%s;dur=%.3f", used ? ", " : "",
                                     names[k], timings->ms[k]);
    if (used > 0)
        sv_api_headers_set(headers, "Server-Timing", "%s", text);
}

/* Adds a name to Vary, beside what stands there. */
static void vary(const char *name, struct sv_headers *headers)
{
    char old[64];
    const char *now = sv_api_headers_find(headers, "Vary");
    if (now && strstr(now, name))
        return;
    snprintf(old, sizeof old, "%s", now ? now : "");
    sv_api_headers_set(headers, "Vary", "%s%s%s", old, old[0] ? ", " : "", name);
}

void sv_api_answer_common(const struct sv_answer_common *common, struct sv_headers *headers)
{
    sv_api_headers_set(headers, "Server", "silvista/%s", SV_VERSION);
    sv_api_headers_set(headers, "X-Content-Type-Options", "nosniff");
    if (common->timings)
        server_timing(common->timings, headers);
    if (common->trace) {
        sv_api_headers_set(headers, "X-Request-Id", "%s", common->trace->request_id);
        sv_api_headers_set(headers, "traceparent", "%s", common->trace->traceparent);
    }
    if (common->cors_origin && common->cors_origin[0]) {
        sv_api_headers_set(headers, "Access-Control-Allow-Origin", "%s", common->cors_origin);
        sv_api_headers_set(headers, "Access-Control-Expose-Headers", "%s", exposed);
        sv_api_headers_set(headers, "Timing-Allow-Origin", "%s", common->cors_origin);
        if (strcmp(common->cors_origin, "*") != 0)
            vary("Origin", headers);
    }
}

void sv_api_answer_preflight(const char *allow, struct sv_headers *headers)
{
    sv_api_headers_set(headers, "Allow", "%s", allow);
    sv_api_headers_set(headers, "Access-Control-Allow-Methods", "%s", allow);
    sv_api_headers_set(
        headers, "Access-Control-Allow-Headers",
        "Accept, Authorization, Content-Type, If-None-Match, Prefer, X-Request-Id, traceparent, tracestate");
    sv_api_headers_set(headers, "Access-Control-Max-Age", "86400");
}

void sv_api_answer_problem(const struct sv_problem *problem, struct sv_headers *headers)
{
    sv_api_headers_set(headers, "Content-Type", SV_PROBLEM_MEDIA);
    sv_api_headers_set(headers, "Content-Language", "en");
    sv_api_headers_set(headers, "Cache-Control", "no-store");
    if (problem->retry_after_s > 0)
        sv_api_headers_set(headers, "Retry-After", "%d", problem->retry_after_s);
    if (problem->allow)
        sv_api_headers_set(headers, "Allow", "%s", problem->allow);
    if (problem->kind == SV_PROBLEM_UNAUTHORIZED)
        sv_api_headers_set(headers, "WWW-Authenticate", "Bearer realm=\"silvista\"");
}

void sv_api_answer_document(const char *media, const char *etag, struct sv_headers *headers)
{
    sv_api_headers_set(headers, "Content-Type", "%s", media);
    sv_api_headers_set(headers, "Cache-Control", "no-cache");
    if (etag)
        sv_api_headers_set(headers, "ETag", "%s", etag);
}

void sv_api_answer_view(const struct sv_answer_view *answer, bool not_modified, struct sv_headers *headers)
{
    static const char *const results[] = {
#define X(id, text) [id] = text,
        SV_CACHE_RESULT_LIST(X)
#undef X
    };
    char camera[SV_CAMERA_JSON_BUFFER], plan[128], route[SV_ROUTE_BUFFER], cell[96];
    const struct sv_view_request *request = answer->request;
    if (!not_modified)
        sv_api_headers_set(headers, "Content-Type", "%s",
                           request->describe ? "application/json" : sv_format_media(request->format));
    sv_api_headers_set(headers, "ETag", "%s", answer->etag);
    if (answer->max_age_s > 0)
        sv_api_headers_set(headers, "Cache-Control", "public, max-age=%d", answer->max_age_s);
    else
        sv_api_headers_set(headers, "Cache-Control", "public, no-cache");
    sv_api_headers_set(headers, "Cache-Status", "Silvista; %s", results[answer->cache]);
    if (answer->negotiated)
        vary("Accept", headers);
    sv_api_headers_set(headers, "Silvista-Cell", "%s", sv_api_cell_text(answer->cell, cell, sizeof cell));
    sv_api_headers_set(headers, "Silvista-Plan", "%s",
                       sv_api_plan_text(&answer->resolved->plan, answer->cell, plan, sizeof plan));
    sv_api_camera_json(answer->resolved, camera);
    sv_api_headers_set(headers, "Silvista-Camera", "%s", camera);
    sv_api_route(answer->resolved->cell, answer->relief_distance_m, route);
    sv_api_headers_set(headers, "Silvista-Route", "%s", route);
}

static uint64_t hash_vec(uint64_t h, struct sv_vec3 v)
{
    return sv_hash_double(sv_hash_double(sv_hash_double(h, v.x), v.y), v.z);
}

/* Field by field: padding has no meaning, and -0 is 0. */
static uint64_t hash_resolved(uint64_t h, const struct sv_resolved_view *v)
{
    const struct sv_camera *c = &v->camera;
    const double numbers[] = {
        c->vfov_rad,          c->ortho_height_m,        c->near_m,         c->far_m, v->sun.azimuth_rad,
        v->sun.elevation_rad, v->plan.terrain_error_px, v->plan.tree_error_px,
        v->plan.relief_distance_m};
    const uint64_t integers[] = {
        c->projection,   (uint64_t)c->width,     (uint64_t)c->height, v->air,
        v->plan.raycast, v->plan.draw_trees,     v->plan.shadows,     (uint64_t)v->plan.samples,
        v->plan.trees,   (uint64_t)v->plan.leaf_samples,
        v->plan.relief,  (uint64_t)v->plan.relief_resolution};
    h = hash_vec(hash_vec(hash_vec(hash_vec(h, c->eye), c->right), c->up), c->forward);
    for (size_t k = 0; k < sizeof numbers / sizeof numbers[0]; k++)
        h = sv_hash_double(h, numbers[k]);
    for (size_t k = 0; k < sizeof integers / sizeof integers[0]; k++)
        h = sv_hash_u64(h, integers[k]);
    return h;
}

void sv_api_etag_view(const char *canonical, const struct sv_resolved_view *resolved, uint64_t scene_version,
                      const char *build, char out[SV_ETAG_BUFFER])
{
    uint64_t half[2] = {SV_HASH_INIT, sv_mix64(SV_HASH_INIT)};
    for (int k = 0; k < 2; k++) {
        half[k] = sv_hash_string(half[k], canonical);
        half[k] = hash_resolved(half[k], resolved);
        half[k] = sv_hash_u64(half[k], scene_version);
        half[k] = sv_hash_done(sv_hash_string(half[k], build));
    }
    snprintf(out, SV_ETAG_BUFFER, "W/\"%016" PRIx64 "%016" PRIx64 "\"", half[0], half[1]);
}

void sv_api_etag_text(const char *text, size_t bytes, char out[SV_ETAG_BUFFER])
{
    uint64_t a = sv_hash_done(sv_hash_bytes(SV_HASH_INIT, text, bytes));
    uint64_t b = sv_hash_done(sv_hash_bytes(sv_mix64(SV_HASH_INIT), text, bytes));
    snprintf(out, SV_ETAG_BUFFER, "W/\"%016" PRIx64 "%016" PRIx64 "\"", a, b);
}

/* The opaque part of an entity tag at p: its length with the quotes, 0 when there is none. */
static size_t opaque(const char *p)
{
    if (*p != '"')
        return 0;
    const char *end = strchr(p + 1, '"');
    return end ? (size_t)(end - p) + 1 : 0;
}

bool sv_api_etag_matches(const char *if_none_match, const char *etag)
{
    const char *own = strncmp(etag, "W/", 2) == 0 ? etag + 2 : etag;
    size_t own_bytes = strlen(own);
    const char *p = if_none_match ? if_none_match : "";
    for (;;) {
        p += strspn(p, " \t,");
        if (*p == '*')
            return p[1 + strspn(p + 1, " \t")] == '\0';
        if (strncmp(p, "W/", 2) == 0)
            p += 2;
        size_t n = opaque(p);
        if (n == 0)
            return false;
        if (n == own_bytes && memcmp(p, own, n) == 0)
            return true;
        p += n;
    }
}

/* The nearest point of the lattice { (i, j, k) : i + j + k even }: round each; where the sum is odd, the
 * coordinate that rounding moved most goes to its other neighbour (Conway and Sloane 1982, "Fast quantizing
 * and decoding algorithms for lattice quantizers and codes", D_n). */
void sv_api_route(struct sv_vec3 place, double distance_m, char out[SV_ROUTE_BUFFER])
{
    distance_m = distance_m > 0 && isfinite(distance_m) ? distance_m : default_distance_m;
    const double at[3] = {place.x / distance_m, place.y / distance_m, place.z / distance_m};
    double cell[3], worst = -1, sum = 0;
    int which = 0;
    char text[SV_API_NUMBER_BUFFER];
    for (int k = 0; k < 3; k++) {
        cell[k] = floor(at[k] + 0.5);
        sum += cell[k];
        if (fabs(at[k] - cell[k]) > worst) {
            worst = fabs(at[k] - cell[k]);
            which = k;
        }
    }
    if (fmod(sum, 2.0) != 0)
        cell[which] += at[which] >= cell[which] ? 1 : -1;
    for (int k = 0; k < 3; k++)
        cell[k] = cell[k] == 0 ? 0 : cell[k];
    snprintf(out, SV_ROUTE_BUFFER, "%s/%.0f,%.0f,%.0f", sv_api_number_format(distance_m, text), cell[0],
             cell[1], cell[2]);
}

struct line {
    char *out;
    size_t used;
};

static void put(struct line *l, const char *text)
{
    size_t n = strlen(text);
    if (l->used + n + 1 > SV_CAMERA_JSON_BUFFER)
        return;
    memcpy(l->out + l->used, text, n + 1);
    l->used += n;
}

static void put_number(struct line *l, const char *before, double v)
{
    char text[SV_API_NUMBER_BUFFER];
    put(l, before);
    put(l, isfinite(v) ? sv_api_number_format(v, text) : "null");
}

static void put_vec(struct line *l, const char *before, struct sv_vec3 v)
{
    put_number(l, before, v.x);
    put_number(l, ",", v.y);
    put_number(l, ",", v.z);
    put(l, "]");
}

size_t sv_api_camera_json(const struct sv_resolved_view *resolved, char out[SV_CAMERA_JSON_BUFFER])
{
    const struct sv_camera *c = &resolved->camera;
    struct line l = {.out = out};
    struct sv_vec3 ahead = sv_madd(c->eye, c->forward, 1);
    put_vec(&l, "{\"eye\":[", c->eye);
    put_vec(&l, ",\"target\":[", resolved->has_target ? resolved->target : ahead);
    put_vec(&l, ",\"up\":[", c->up);
    if (c->projection == SV_PROJECTION_PERSPECTIVE)
        put_number(&l, ",\"vfov\":", sv_api_degrees(c->vfov_rad));
    else
        put_number(&l, ",\"ortho_height\":", c->ortho_height_m);
    put_number(&l, ",\"width\":", c->width);
    put_number(&l, ",\"height\":", c->height);
    put_number(&l, ",\"heading\":", sv_api_degrees(resolved->heading_rad));
    put_number(&l, ",\"pitch\":", sv_api_degrees(resolved->pitch_rad));
    put_number(&l, ",\"roll\":", sv_api_degrees(resolved->roll_rad));
    put_number(&l, ",\"convergence\":", sv_api_degrees(resolved->convergence_rad));
    if (resolved->has_lonlat) {
        put_number(&l, ",\"lon\":", resolved->lon_deg);
        put_number(&l, ",\"lat\":", resolved->lat_deg);
    }
    put(&l, "}");
    return l.used;
}

const char *sv_api_plan_trees(const struct sv_plan *plan)
{
    if (!plan->draw_trees)
        return "none";
    if (plan->raycast)
        return "raycast";
    return plan->trees == SV_TREES_AUTO ? "leaf+coarse" : sv_trees_name(plan->trees);
}

const char *sv_api_plan_relief(const struct sv_plan *plan)
{
    bool forms = !plan->draw_trees || plan->trees == SV_TREES_AUTO;
    return plan->raycast || plan->samples != 1 || !forms ? "off" : sv_relief_name(plan->relief);
}

const char *sv_api_cell_text(const struct sv_cell_use *cell, char *out, size_t size)
{
    static const char *const kinds[] = {
#define X(id, text) [id] = text,
        SV_CELL_USE_LIST(X)
#undef X
    };
    unsigned kind = cell && cell->kind < SV_CELL_USE_COUNT ? cell->kind : SV_CELL_USE_NONE;
    size_t used = (size_t)snprintf(out, size, "%s", kinds[kind]);
    if (kind == SV_CELL_USE_HIT || kind == SV_CELL_USE_BUILT)
        snprintf(out + used, size - used, "; id=%016" PRIx64 "; panels=%s", cell->id,
                 sv_cell_use_refined(cell) ? "refined" : "drawn");
    return out;
}

const char *sv_api_plan_text(const struct sv_plan *plan, const struct sv_cell_use *cell, char *out, size_t size)
{
    bool drawn = cell && (cell->kind == SV_CELL_USE_HIT || cell->kind == SV_CELL_USE_BUILT);
    snprintf(out, size, "trees=%s; relief=%s; samples=%d; shadows=%s", sv_api_plan_trees(plan),
             cell ? drawn ? "on" : "off" : sv_api_plan_relief(plan), plan->samples, plan->shadows ? "on" : "off");
    return out;
}
