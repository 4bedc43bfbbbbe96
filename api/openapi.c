/* openapi.c - see openapi.h. The view's fields are written twice from the same rows: as query parameters and
 * as the properties of the JSON body. */
#include "api/openapi.h"

#include <inttypes.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "api/endpoints.h"
#include "api/fields.h"
#include "api/json_write.h"
#include "api/number.h"
#include "api/patch_parse.h"

static cJSON *reference(const char *group, const char *name, bool *good)
{
    char path[128];
    cJSON *object = cJSON_CreateObject();
    snprintf(path, sizeof path, "#/components/%s/%s", group, name);
    sv_api_json_add_text(object, "$ref", path, good);
    return object;
}

/* ---- fields ---- */

static cJSON *choice_list(const struct sv_field *field, bool *good)
{
    cJSON *list = cJSON_CreateArray();
    for (int k = 0; field->choices[k]; k++)
        sv_api_json_append(list,
                           field->type == SV_FIELD_INTEGER_SET ? cJSON_CreateNumber(atoi(field->choices[k]))
                                                               : cJSON_CreateString(field->choices[k]),
                           good);
    return list;
}

static void number_schema(cJSON *schema, const struct sv_field *field, bool *good)
{
    sv_api_json_add_text(schema, "type", field->type == SV_FIELD_NUMBER ? "number" : "integer", good);
    if (field->choices) {
        sv_api_json_add(schema, "enum", choice_list(field, good), good);
        return;
    }
    sv_api_json_add_number(schema, field->above_min ? "exclusiveMinimum" : "minimum", field->min, good);
    sv_api_json_add_number(schema, "maximum", field->max, good);
}

static void choices_schema(cJSON *schema, const struct sv_field *field, bool *good)
{
    cJSON *items = cJSON_CreateObject();
    sv_api_json_add_text(schema, "type", "array", good);
    sv_api_json_add_text(items, "type", "string", good);
    sv_api_json_add(items, "enum", choice_list(field, good), good);
    sv_api_json_add(schema, "items", items, good);
    sv_api_json_add_number(schema, "minItems", 1, good);
    sv_api_json_add_bool(schema, "uniqueItems", true, good);
}

static void add_preset(cJSON *schema, enum sv_field_id id, bool *good)
{
    const struct sv_field *field = sv_api_field(id);
    struct sv_field_value preset = sv_api_field_preset(id);
    if (!field->preset)
        return;
    if (!field->choices) {
        sv_api_json_add_number(schema, "default", preset.number, good);
    } else if (field->type == SV_FIELD_CHOICES) {
        cJSON *list = cJSON_CreateArray();
        sv_api_json_append(list, cJSON_CreateString(field->preset), good);
        sv_api_json_add(schema, "default", list, good);
    } else {
        sv_api_json_add_text(schema, "default", field->preset, good);
    }
}

/* What waits for a later version: the whole field, or some of its values. */
static void add_unbuilt(cJSON *object, const struct sv_field *field, bool *good)
{
    if (field->unbuilt)
        sv_api_json_add_bool(object, "x-not-built-yet", true, good);
    if (!field->unbuilt_choices)
        return;
    cJSON *list = cJSON_CreateArray();
    for (int k = 0; field->choices[k]; k++)
        if (field->unbuilt_choices & 1u << k)
            sv_api_json_append(list, cJSON_CreateString(field->choices[k]), good);
    sv_api_json_add(object, "x-values-not-built-yet", list, good);
}

static cJSON *field_schema(enum sv_field_id id, bool *good)
{
    const struct sv_field *field = sv_api_field(id);
    cJSON *schema = cJSON_CreateObject();
    switch (field->type) {
    case SV_FIELD_NUMBER:
    case SV_FIELD_INTEGER:
    case SV_FIELD_INTEGER_SET:
        number_schema(schema, field, good);
        break;
    case SV_FIELD_CHOICE:
    case SV_FIELD_SWITCH:
        sv_api_json_add_text(schema, "type", "string", good);
        sv_api_json_add(schema, "enum", choice_list(field, good), good);
        break;
    case SV_FIELD_CHOICES:
        choices_schema(schema, field, good);
        break;
    case SV_FIELD_EPSG:
        sv_api_json_add_text(schema, "type", "string", good);
        sv_api_json_add_text(schema, "pattern", "^EPSG:[0-9]{1,6}$", good);
        break;
    case SV_FIELD_MOMENT:
        sv_api_json_add_text(schema, "type", "string", good);
        sv_api_json_add_text(schema, "format", "date-time", good);
        break;
    case SV_FIELD_TYPE_COUNT:
        break;
    }
    add_preset(schema, id, good);
    if (field->unit[0])
        sv_api_json_add_text(schema, "x-unit", field->unit, good);
    add_unbuilt(schema, field, good);
    return schema;
}

static void describe_field(cJSON *object, enum sv_field_id id, bool *good)
{
    const struct sv_field *field = sv_api_field(id);
    char legal[256], text[768];
    int used = snprintf(text, sizeof text, "%s Legal: %s.%s", field->help,
                        sv_api_field_legal(id, legal, sizeof legal),
                        field->unbuilt           ? " Not built yet: answers 501."
                        : field->unbuilt_choices ? " Not built yet, answered 501:"
                                                 : "");
    for (int k = 0; field->unbuilt_choices >> k; k++)
        if (field->unbuilt_choices & 1u << k)
            used += snprintf(text + used, sizeof text - (size_t)used, " %s", field->choices[k]);
    if (field->unbuilt_choices)
        snprintf(text + used, sizeof text - (size_t)used, ".");
    sv_api_json_add_text(object, "description", text, good);
}

static cJSON *parameters(bool *good)
{
    cJSON *all = cJSON_CreateObject();
    for (int k = 0; k < SV_FIELD_COUNT; k++) {
        enum sv_field_id id = (enum sv_field_id)k;
        cJSON *object = cJSON_CreateObject();
        sv_api_json_add_text(object, "name", sv_api_field_name(id), good);
        sv_api_json_add_text(object, "in", "query", good);
        describe_field(object, id, good);
        if (sv_api_field(id)->type == SV_FIELD_CHOICES) {
            sv_api_json_add_text(object, "style", "form", good);
            sv_api_json_add_bool(object, "explode", false, good);
        }
        sv_api_json_add(object, "schema", field_schema(id, good), good);
        sv_api_json_add(all, sv_api_field_name(id), object, good);
    }
    return all;
}

/* In a JSON body a switch may be a boolean, too, and names with commas between them one string. */
static cJSON *property(enum sv_field_id id, bool *good)
{
    enum sv_field_type type = sv_api_field(id)->type;
    cJSON *schema = field_schema(id, good);
    if (type == SV_FIELD_SWITCH || type == SV_FIELD_CHOICES) {
        cJSON *either = cJSON_CreateArray(), *other = cJSON_CreateObject(), *both = cJSON_CreateObject();
        sv_api_json_add_text(other, "type", type == SV_FIELD_SWITCH ? "boolean" : "string", good);
        sv_api_json_append(either, schema, good);
        sv_api_json_append(either, other, good);
        sv_api_json_add(both, "oneOf", either, good);
        schema = both;
    }
    describe_field(schema, id, good);
    return schema;
}

static cJSON *view_schema(bool *good)
{
    cJSON *schema = cJSON_CreateObject(), *properties = cJSON_CreateObject();
    sv_api_json_add_text(schema, "type", "object", good);
    sv_api_json_add_text(
        schema, "description",
        "One view: an eye (x, y or lon, lat) with heading and pitch or with a target, or a target with "
        "range (orbit form). Every key is optional but these; unknown keys are refused.",
        good);
    for (int k = 0; k < SV_FIELD_COUNT; k++)
        sv_api_json_add(properties, sv_api_field_name((enum sv_field_id)k),
                        property((enum sv_field_id)k, good), good);
    sv_api_json_add(schema, "properties", properties, good);
    sv_api_json_add_bool(schema, "additionalProperties", false, good);
    return schema;
}

/* ---- answers ---- */

static const struct {
    const char *name, *description;
    unsigned answers; /* 0: on every answer */
} header_rows[] = {
    {"Server-Timing",
     "dur in ms of the stages that ran: queue, plan, cell, warp, near, composite, encode, total", 0},
    {"X-Request-Id", "the client's own when it is 1 to 64 of [A-Za-z0-9._-], else a fresh one", 0},
    {"traceparent", "W3C trace context: the client's trace, a span of the service's", 0},
    {"ETag", "weak; known before anything is drawn, so If-None-Match costs no drawing", SV_ANSWERS_CACHED},
    {"Cache-Control", "how long the answer keeps", SV_ANSWERS_CACHED},
    {"Cache-Status", "RFC 9211: Silvista; hit | fwd=miss; stored | fwd=miss; collapsed", SV_ANSWERS_VIEW},
    {"Silvista-Cell",
     "which relief panels served it: hit, built (for this request), bypass (it was drawn directly) or none; id of the "
     "eye's cell; panels=drawn or refined",
     SV_ANSWERS_VIEW},
    {"Silvista-Plan", "trees=...; relief=...; samples=...; shadows=...: how it was drawn", SV_ANSWERS_VIEW},
    {"Silvista-Camera",
     "the resolved camera as JSON: eye, target, up, vfov or ortho_height, heading, pitch, roll, "
     "convergence, lon, lat",
     SV_ANSWERS_VIEW},
    {"Silvista-Route", "the key that a load balancer may hash on: views of one cell share it",
     SV_ANSWERS_VIEW},
};

static cJSON *headers_of(unsigned answers, bool *good)
{
    cJSON *object = cJSON_CreateObject();
    for (size_t k = 0; k < sizeof header_rows / sizeof header_rows[0]; k++)
        if (header_rows[k].answers == 0 || (header_rows[k].answers & answers))
            sv_api_json_add(object, header_rows[k].name, reference("headers", header_rows[k].name, good),
                            good);
    return object;
}

static cJSON *header_components(bool *good)
{
    cJSON *all = cJSON_CreateObject();
    for (size_t k = 0; k < sizeof header_rows / sizeof header_rows[0]; k++) {
        cJSON *object = cJSON_CreateObject(), *schema = cJSON_CreateObject();
        sv_api_json_add_text(object, "description", header_rows[k].description, good);
        sv_api_json_add_text(schema, "type", "string", good);
        sv_api_json_add(object, "schema", schema, good);
        sv_api_json_add(all, header_rows[k].name, object, good);
    }
    return all;
}

static cJSON *problem_schema(bool *good)
{
    static const struct {
        const char *name, *type;
    } members[] = {{"type", "string"},   {"title", "string"},      {"status", "integer"},
                   {"detail", "string"}, {"ground_z_m", "number"}, {"retry_after_s", "integer"},
                   {"allow", "string"},  {"request_id", "string"}, {"errors_total", "integer"}};
    cJSON *schema = cJSON_CreateObject(), *properties = cJSON_CreateObject();
    sv_api_json_add_text(schema, "type", "object", good);
    for (size_t k = 0; k < sizeof members / sizeof members[0]; k++) {
        cJSON *one = cJSON_CreateObject();
        sv_api_json_add_text(one, "type", members[k].type, good);
        sv_api_json_add(properties, members[k].name, one, good);
    }
    sv_api_json_add(
        properties, "errors",
        cJSON_Parse("{\"type\":\"array\",\"items\":{\"type\":\"object\",\"properties\":{\"field\":{\"type\":"
                    "\"string\"},\"detail\":{\"type\":\"string\"}},\"required\":[\"field\",\"detail\"]}}"),
        good);
    sv_api_json_add(schema, "properties", properties, good);
    sv_api_json_add(schema, "required", cJSON_Parse("[\"type\",\"title\",\"status\",\"detail\",\"errors\"]"),
                    good);
    return schema;
}

static cJSON *content(const char *media, cJSON *schema, bool *good)
{
    cJSON *object = cJSON_CreateObject(), *type = cJSON_CreateObject();
    if (schema)
        sv_api_json_add(type, "schema", schema, good);
    sv_api_json_add(object, media, type, good);
    return object;
}

static cJSON *success(const struct sv_endpoint *endpoint, bool *good)
{
    cJSON *answer = cJSON_CreateObject(), *media = cJSON_CreateObject();
    sv_api_json_add_text(answer, "description", endpoint->summary, good);
    sv_api_json_add(answer, "headers", headers_of(endpoint->answers, good), good);
    for (int k = 0; k < SV_ENDPOINT_MEDIA_MAX && endpoint->media[k]; k++)
        sv_api_json_add(media, endpoint->media[k], cJSON_CreateObject(), good);
    if (endpoint->media[0])
        sv_api_json_add(answer, "content", media, good);
    else
        cJSON_Delete(media);
    return answer;
}

/* Kinds that share a status share an answer; its description names them all. */
static void add_problem(cJSON *responses, enum sv_problem_kind kind, bool *good)
{
    char status[16], text[512];
    snprintf(status, sizeof status, "%d", sv_api_problem_status(kind));
    cJSON *old = cJSON_GetObjectItemCaseSensitive(responses, status);
    const char *before =
        old ? cJSON_GetStringValue(cJSON_GetObjectItemCaseSensitive(old, "description")) : NULL;
    snprintf(text, sizeof text, "%s%surn:silvista:problem:%s (%s)", before ? before : "", before ? "; " : "",
             sv_api_problem_slug(kind), sv_api_problem_title(kind));
    cJSON *answer = cJSON_CreateObject();
    sv_api_json_add_text(answer, "description", text, good);
    sv_api_json_add(answer, "headers", headers_of(0, good), good);
    sv_api_json_add(answer, "content", content(SV_PROBLEM_MEDIA, reference("schemas", "Problem", good), good),
                    good);
    cJSON_DeleteItemFromObjectCaseSensitive(responses, status);
    sv_api_json_add(responses, status, answer, good);
}

static cJSON *responses_of(const struct sv_endpoint *endpoint, bool *good)
{
    cJSON *responses = cJSON_CreateObject();
    if (!endpoint->built) {
        add_problem(responses, SV_PROBLEM_NOT_BUILT, good);
        return responses;
    }
    sv_api_json_add(responses, endpoint->success, success(endpoint, good), good);
    if (endpoint->answers & SV_ANSWERS_CACHED) {
        cJSON *answer = cJSON_CreateObject();
        sv_api_json_add_text(answer, "description", "If-None-Match names the answer: it has not changed",
                             good);
        sv_api_json_add(answer, "headers", headers_of(endpoint->answers, good), good);
        sv_api_json_add(responses, "304", answer, good);
    }
    for (int k = 0; k < SV_ENDPOINT_PROBLEMS_MAX && endpoint->problems[k] != SV_PROBLEM_NONE; k++)
        add_problem(responses, endpoint->problems[k], good);
    return responses;
}

/* ---- paths ---- */

static void add_path_parameters(cJSON *list, const char *path, bool *good)
{
    for (const char *open = strchr(path, '{'); open; open = strchr(open + 1, '{')) {
        char name[32];
        cJSON *object = cJSON_CreateObject(), *schema = cJSON_CreateObject();
        snprintf(name, sizeof name, "%.*s", (int)strcspn(open + 1, "}"), open + 1);
        sv_api_json_add_text(object, "name", name, good);
        sv_api_json_add_text(object, "in", "path", good);
        sv_api_json_add_bool(object, "required", true, good);
        sv_api_json_add_text(schema, "type", "string", good);
        sv_api_json_add(object, "schema", schema, good);
        sv_api_json_append(list, object, good);
    }
}

static cJSON *operation(const struct sv_endpoint *endpoint, bool *good)
{
    cJSON *object = cJSON_CreateObject(), *list = cJSON_CreateArray(), *tags = cJSON_CreateArray();
    sv_api_json_add_text(object, "operationId", endpoint->id, good);
    sv_api_json_add_text(object, "summary", endpoint->summary, good);
    sv_api_json_append(tags, cJSON_CreateString(endpoint->tag), good);
    sv_api_json_add(object, "tags", tags, good);
    if (!endpoint->built)
        sv_api_json_add_bool(object, "x-not-built-yet", true, good);
    if (endpoint->admin)
        sv_api_json_add(object, "security", cJSON_Parse("[{\"admin\":[]}]"), good);
    add_path_parameters(list, endpoint->path, good);
    for (int k = 0; endpoint->view_query && k < SV_FIELD_COUNT; k++)
        sv_api_json_append(list, reference("parameters", sv_api_field_name((enum sv_field_id)k), good), good);
    sv_api_json_add(object, "parameters", list, good);
    if (endpoint->body) {
        cJSON *body = cJSON_CreateObject();
        static const char *const schemas[][2] = {{"postView", "View"}, {"postCells", "Views"}, {"patchScene", "Patch"}};
        const char *schema = NULL;
        for (size_t k = 0; k < sizeof schemas / sizeof *schemas; k++)
            if (strcmp(endpoint->id, schemas[k][0]) == 0)
                schema = schemas[k][1];
        sv_api_json_add_bool(body, "required", true, good);
        sv_api_json_add(body, "content",
                        content(endpoint->body, schema ? reference("schemas", schema, good) : NULL, good),
                        good);
        sv_api_json_add(object, "requestBody", body, good);
    }
    sv_api_json_add(object, "responses", responses_of(endpoint, good), good);
    return object;
}

static cJSON *paths(bool *good)
{
    cJSON *all = cJSON_CreateObject();
    int count;
    const struct sv_endpoint *endpoints = sv_api_endpoints(&count);
    for (int k = 0; k < count; k++) {
        char method[8];
        size_t n = strlen(endpoints[k].method);
        for (size_t i = 0; i <= n && i < sizeof method; i++)
            method[i] = (char)(endpoints[k].method[i] | (i < n ? 0x20 : 0)); /* lower case */
        cJSON *path = cJSON_GetObjectItemCaseSensitive(all, endpoints[k].path);
        if (!path) {
            path = cJSON_CreateObject();
            sv_api_json_add(all, endpoints[k].path, path, good);
        }
        if (*good)
            sv_api_json_add(path, method, operation(&endpoints[k], good), good);
    }
    return all;
}

static cJSON *info(const struct sv_openapi_options *options, bool *good)
{
    char text[768];
    cJSON *object = cJSON_CreateObject();
    sv_api_json_add_text(object, "title", "Silvista", good);
    sv_api_json_add_text(object, "version", SV_VERSION, good);
    sv_api_json_add_text(object, "summary", "Pictures of a landscape from any eye point", good);
    snprintf(text, sizeof text,
             "Keys are case-sensitive, unknown ones are refused, and every error names all bad fields at "
             "once. This service "
             "draws at most %" PRIu64 " pixels, and %" PRIu64
             " samples, a picture. HEAD is answered wherever GET is. "
             "Any call can also get 400, 404, 405, 408, 411, 413, 414, 415, 431, 500 and 503 as problem "
             "documents.",
             options->limits.pixels_max, options->limits.sample_pixels_max);
    sv_api_json_add_text(object, "description", text, good);
    sv_api_json_add(object, "license", cJSON_Parse("{\"name\":\"Apache-2.0\",\"identifier\":\"Apache-2.0\"}"),
                    good);
    return object;
}

static cJSON *components(bool *good)
{
    cJSON *object = cJSON_CreateObject(), *schemas = cJSON_CreateObject();
    sv_api_json_add(schemas, "View", view_schema(good), good);
    sv_api_json_add(schemas, "Views",
                    cJSON_Parse("{\"type\":\"object\",\"properties\":{\"views\":{\"type\":\"array\","
                                "\"items\":{\"$ref\":\"#/components/schemas/View\"},\"minItems\":1,"
                                "\"maxItems\":256}},\"required\":[\"views\"],\"additionalProperties\":false}"),
                    good);
    sv_api_json_add(schemas, "Patch", sv_api_patch_schema(good), good);
    sv_api_json_add(schemas, "Problem", problem_schema(good), good);
    sv_api_json_add(object, "schemas", schemas, good);
    sv_api_json_add(object, "parameters", parameters(good), good);
    sv_api_json_add(object, "headers", header_components(good), good);
    sv_api_json_add(object, "securitySchemes",
                    cJSON_Parse("{\"admin\":{\"type\":\"http\",\"scheme\":\"bearer\"}}"), good);
    return object;
}

char *sv_api_openapi(const struct sv_openapi_options *options, size_t *bytes)
{
    bool good = true;
    cJSON *root = cJSON_CreateObject(), *servers = cJSON_CreateArray(), *server = cJSON_CreateObject();
    sv_api_json_add_text(root, "openapi", "3.1.0", &good);
    sv_api_json_add(root, "info", info(options, &good), &good);
    sv_api_json_add_text(server, "url", options->base_url && options->base_url[0] ? options->base_url : "/",
                         &good);
    sv_api_json_append(servers, server, &good);
    sv_api_json_add(root, "servers", servers, &good);
    sv_api_json_add(root, "paths", paths(&good), &good);
    sv_api_json_add(root, "components", components(&good), &good);
    return sv_api_json_print(root, good, bytes);
}
