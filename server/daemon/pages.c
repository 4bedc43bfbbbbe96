#include "server/daemon/pages.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <strings.h>
#include <unistd.h>

#include "api/answer.h"
#include "api/openapi.h"
#include "server/daemon/cells.h"
#include "core/scene/id.h"
#include "server/daemon/reply.h"
#include "server/log.h"

static void answer_text(struct sv_exchange *exchange, const char *media, char *text)
{
    sv_reply_document(exchange, media, NULL, text);
}

void sv_page_livez(struct sv_service *service, struct sv_exchange *exchange)
{
    (void)service;
    answer_text(exchange, "text/plain; charset=utf-8", strdup("ok\n"));
}

void sv_page_readyz(struct sv_service *service, struct sv_exchange *exchange)
{
    enum sv_problem_kind kind;
    char why[640];
    if (sv_service_ready(service, &kind, why, sizeof why))
        answer_text(exchange, "text/plain; charset=utf-8", strdup("ready\n"));
    else
        sv_reply_retry(exchange, kind, why, sv_service_scene_retry_s(service));
}

/* Resident bytes and open descriptors of this process, from /proc. */
static void measure_process(struct sv_metrics *metrics)
{
    unsigned long long total, resident;
    FILE *statm = fopen("/proc/self/statm", "re");
    if (statm && fscanf(statm, "%llu %llu", &total, &resident) == 2)
        metrics->gauge[SV_GAUGE_RESIDENT] = (double)resident * (double)sysconf(_SC_PAGESIZE);
    if (statm)
        fclose(statm);
}

static void fill_gauges(struct sv_service *service)
{
    double *g = service->metrics.gauge;
    enum sv_problem_kind kind;
    char why[640];
    const struct sv_scene_process *scene = service->scenes.serving;
    g[SV_GAUGE_READY] = sv_service_ready(service, &kind, why, sizeof why);
    g[SV_GAUGE_QUEUE] = (double)service->queue.count;
    g[SV_GAUGE_QUEUE_LIMIT] = (double)service->queue.limit;
    g[SV_GAUGE_FLIGHTS] = (double)service->flights.count;
    g[SV_GAUGE_WORKERS] = scene ? (double)sv_crew_alive(&scene->crew) : 0;
    g[SV_GAUGE_WORKERS_BUSY] = scene ? (double)sv_crew_busy(&scene->crew) : 0;
    g[SV_GAUGE_WORKER_BYTES] = scene ? (double)sv_crew_own_bytes(&scene->crew) : 0;
    g[SV_GAUGE_PICTURES] = (double)sv_pictures_count(service->pictures);
    g[SV_GAUGE_PICTURE_BYTES] = (double)sv_pictures_bytes(service->pictures);
    g[SV_GAUGE_RESOLVES] = (double)sv_memo_count(service->memo);
    g[SV_GAUGE_SLAB_BYTES] = (double)sv_slab_pool_bytes(service->slabs);
    g[SV_GAUGE_SLAB_LENT] = (double)sv_slab_pool_lent_bytes(service->slabs);
    g[SV_GAUGE_CONNECTIONS] = (double)sv_http_connections(service->http);
    g[SV_GAUGE_DESCRIPTORS] = (double)sv_service_descriptors();
    g[SV_GAUGE_SCENE_LOAD] = scene ? scene->load_ms * 1e-3 : 0;
    g[SV_GAUGE_UPTIME] = (sv_loop_now_ms() - service->started_ms) * 1e-3;
    g[SV_GAUGE_LOG_DROPPED] = (double)sv_log_dropped();
    sv_cells_measure(service);
    measure_process(&service->metrics);
}

void sv_page_metrics(struct sv_service *service, struct sv_exchange *exchange)
{
    fill_gauges(service);
    answer_text(exchange, "text/plain; version=0.0.4; charset=utf-8",
                sv_metrics_text(&service->metrics, SV_VERSION));
}

void sv_page_openapi(struct sv_service *service, struct sv_exchange *exchange)
{
    struct sv_openapi_options options = {.base_url = service->settings->public_url,
                                         .limits = service->limits};
    char etag[SV_ETAG_BUFFER];
    size_t bytes = 0;
    char *text = sv_api_openapi(&options, &bytes);
    sv_api_etag_text(text ? text : "", bytes, etag);
    sv_reply_document(exchange, "application/json", etag, text);
}

void sv_page_scene(struct sv_service *service, struct sv_exchange *exchange)
{
    const struct sv_scene_process *scene = service->scenes.serving;
    char etag[SV_ETAG_BUFFER];
    if (!scene) {
        sv_reply_retry(exchange, SV_PROBLEM_NOT_READY, "no scene is loaded at the moment",
                       sv_service_scene_retry_s(service));
        return;
    }
    sv_api_etag_text(scene->facts, strlen(scene->facts), etag);
    sv_reply_document(exchange, "application/json", etag, strdup(scene->facts));
}

bool sv_page_token_fits(const char *field, const char *token)
{
    enum { ROOM = 512 };
    char given[ROOM] = {0}, wanted[ROOM] = {0};
    if (!field || strncasecmp(field, "Bearer ", 7) != 0)
        return false;
    field += 7 + strspn(field + 7, " ");
    size_t bytes = strlen(field), wanted_bytes = strlen(token);
    memcpy(given, field, bytes < ROOM ? bytes : ROOM);
    memcpy(wanted, token, wanted_bytes < ROOM ? wanted_bytes : ROOM);
    volatile unsigned char differs = bytes != wanted_bytes || bytes > ROOM;
    for (size_t i = 0; i < ROOM; i++)
        differs = (unsigned char)(differs | (given[i] ^ wanted[i]));
    return differs == 0;
}

bool sv_page_is_admin(struct sv_service *service, struct sv_exchange *exchange)
{
    const char *token = service->settings->admin_token;
    if (!token[0])
        sv_reply_problem(exchange, SV_PROBLEM_FORBIDDEN, "no admin_token is set");
    else if (!sv_page_token_fits(sv_exchange_field(exchange, "Authorization"), token))
        sv_reply_problem(exchange, SV_PROBLEM_UNAUTHORIZED, NULL);
    else
        return true;
    return false;
}

static void waiter_gone(struct sv_exchange *exchange)
{
    struct sv_service *service = exchange->owner;
    service->scene_waiter = NULL;
}

/* Is the caller allowed to change the scene, now? Answers if not. */
static bool may_change(struct sv_service *service, struct sv_exchange *exchange)
{
    if (!sv_page_is_admin(service, exchange))
        return false;
    if (service->draining)
        sv_reply_problem(exchange, SV_PROBLEM_DRAINING, NULL);
    return !service->draining;
}

/* Keeps the exchange until the scene that was asked for serves, or does not come. */
static void await_scene(struct sv_service *service, struct sv_exchange *exchange, bool patch)
{
    exchange->owner = service;
    exchange->gone = waiter_gone;
    service->scene_waiter = exchange;
    service->waiter_patches = patch;
}

void sv_page_reload(struct sv_service *service, struct sv_exchange *exchange)
{
    struct sv_error error;
    if (!may_change(service, exchange))
        return;
    if (service->scene_waiter || sv_scenes_load(&service->scenes, &error) != SV_OK)
        sv_reply_retry(exchange, SV_PROBLEM_NOT_READY, "a scene is being loaded already",
                       sv_service_scene_retry_s(service));
    else
        await_scene(service, exchange, false);
}

void sv_page_patch(struct sv_service *service, struct sv_exchange *exchange)
{
    struct sv_error error;
    if (!may_change(service, exchange))
        return;
    enum sv_status status =
        service->scene_waiter
            ? sv_fail(&error, SV_ELIMIT, "", "the scene is being changed already")
            : sv_scenes_patch(&service->scenes, exchange->body, exchange->body_bytes, &error);
    if (status == SV_OK)
        await_scene(service, exchange, true);
    else
        sv_reply_retry(exchange, SV_PROBLEM_NOT_READY, error.message, sv_service_scene_retry_s(service));
}

/* What is to blame for a patch that failed: the service, the body by itself, or what it asks of this scene.
 */
static enum sv_problem_kind blame(const struct sv_errors *reasons)
{
    enum sv_problem_kind kind = SV_PROBLEM_BAD_PATCH;
    for (size_t k = 0; k < reasons->count; k++) {
        enum sv_status code = reasons->items[k].code;
        if (code == SV_EINTERNAL || code == SV_ENOMEM)
            return SV_PROBLEM_INTERNAL;
        if (code == SV_EINVAL || code == SV_ELIMIT)
            kind = SV_PROBLEM_BAD_REQUEST;
    }
    return kind;
}

static char *patched_text(const struct sv_scene_process *scene)
{
    const struct sv_scene_change *c = scene->change;
    char *text = NULL, first_tree[32] = "null", first_object[32] = "null";
    if (!c)
        return NULL;
    if (c->trees_added)
        snprintf(first_tree, sizeof first_tree, "%u", SV_ID_TREE_FIRST + c->first_tree);
    if (c->objects_added)
        snprintf(first_object, sizeof first_object, "%u", SV_ID_OBJECT_FIRST + c->first_object);
    if (asprintf(
            &text,
            "{\"version\": \"%016llx\", \"trees\": {\"added\": %u, \"removed\": %u, \"not_placed\": %u, "
            "\"first_id\": %s}, \"objects\": {\"added\": %u, \"removed\": %u, \"first_id\": %s}, \"sun\": "
            "%s, \"changed_boxes\": %u, \"change_ms\": %.1f, \"total_ms\": %.1f}\n",
            (unsigned long long)scene->version, c->trees_added, c->trees_removed, c->not_placed, first_tree,
            c->objects_added, c->objects_removed, first_object, c->sun ? "true" : "false", c->box_count,
            scene->patch_ms, scene->load_ms) < 0)
        return NULL;
    return text;
}

static char *loaded_text(const struct sv_scene_process *scene)
{
    char *text = NULL;
    return asprintf(&text, "{\"version\": \"%016llx\", \"load_s\": %.3f}\n",
                    (unsigned long long)scene->version, scene->load_ms * 1e-3) < 0
               ? NULL
               : text;
}

void sv_page_scene_done(struct sv_service *service, const struct sv_errors *reasons)
{
    struct sv_exchange *exchange = service->scene_waiter;
    service->scene_waiter = NULL;
    if (!exchange)
        return;
    exchange->owner = NULL;
    exchange->gone = NULL;
    if (reasons) {
        bool of_file = reasons->count && reasons->items[0].code != SV_EINTERNAL;
        struct sv_problem problem = {.kind = service->waiter_patches ? blame(reasons)
                                             : of_file               ? SV_PROBLEM_BAD_SCENE
                                                                     : SV_PROBLEM_INTERNAL,
                                     .detail = "the scene was not exchanged",
                                     .errors = reasons};
        sv_reply(exchange, &problem);
        return;
    }
    const struct sv_scene_process *scene = service->scenes.serving;
    answer_text(exchange, "application/json",
                service->waiter_patches ? patched_text(scene) : loaded_text(scene));
}

/* Shows the scene from above its middle and lets one turn; the viewer proper is a client of its own. */
static const char home_page[] =
    "<!doctype html>\n<html lang=\"en\">\n<meta charset=\"utf-8\">\n<title>Silvista</title>\n"
    "<meta name=\"viewport\" content=\"width=device-width\">\n"
    "<style>body{font:1rem/1.5 sans-serif;margin:2rem auto;max-width:50rem;padding:0 1rem}"
    "img{max-width:100%;min-height:10rem;background:#ddd}code{word-break:break-all}</style>\n"
    "<h1>Silvista</h1>\n<p id=\"what\">Pictures of a landscape over HTTP.</p>\n"
    "<img id=\"view\" width=\"768\" height=\"512\" alt=\"A view of the scene\">\n"
    "<p><label>Heading <input id=\"heading\" type=\"range\" min=\"0\" max=\"350\" step=\"10\" "
    "value=\"0\"></label> "
    "<a id=\"link\" href=\"v1/view\"><code id=\"query\"></code></a></p>\n"
    "<p><a href=\"openapi.json\">The contract</a>, <a href=\"v1/scene\">the scene</a>, "
    "<a href=\"metrics\">metrics</a>, <a href=\"readyz\">readiness</a></p>\n"
    "<script>\n"
    "const el = id => document.getElementById(id);\n"
    "fetch('v1/scene').then(r => r.json()).then(s => {\n"
    "  if (!s.extent) { el('what').textContent = s.detail || s.title; return; }\n"
    "  el('what').textContent = s.name;\n"
    "  const [x0, y0, x1, y1] = s.extent.scene, x = (x0 + x1) / 2, y = (y0 + y1) / 2;\n"
    "  const range = 0.35 * Math.hypot(x1 - x0, y1 - y0);\n"
    "  const show = () => {\n"
    "    const u = `v1/view?target_x=${x}&target_y=${y}&target_agl=0&range=${range.toFixed(1)}` +\n"
    "      `&pitch=-20&heading=${el('heading').value}&width=768&height=512`;\n"
    "    el('view').src = el('link').href = el('query').textContent = u;\n"
    "  };\n"
    "  el('heading').onchange = show; show();\n"
    "});\n</script>\n</html>\n";

void sv_page_home(struct sv_service *service, struct sv_exchange *exchange)
{
    (void)service;
    answer_text(exchange, "text/html; charset=utf-8", strdup(home_page));
}
