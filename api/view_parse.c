/* view_parse.c - see view_parse.h: the two readers. What they read is judged by fields.c and view_rules.c. */
#include "api/view_parse.h"

#include <string.h>

#include "api/fields.h"
#include "api/json.h"
#include "api/kvp.h"
#include "api/utf8.h"
#include "api/view_rules.h"

static const size_t guesses_max = 16;

static void refuse_key(const char *key, struct sv_errors *errors)
{
    char shown[80];
    /* A guess at what was meant costs time: the first few are enough to learn from. */
    const char *nearest = errors->total < guesses_max ? sv_api_field_nearest(key) : NULL;
    sv_api_utf8_show(key, strlen(key), shown, sizeof shown);
    if (nearest)
        sv_errors_add(errors, SV_EINVAL, shown, "unknown key: did you mean \"%s\"? (keys are case-sensitive)",
                      nearest);
    else
        sv_errors_add(errors, SV_EINVAL, shown, "unknown key: /openapi.json lists the keys of a view");
}

static void read_pair(const struct sv_api_kvp *kvp, struct sv_field_value *values, struct sv_errors *errors)
{
    enum sv_field_id id = kvp->has_key ? sv_api_field_find(kvp->key) : SV_FIELD_COUNT;
    char legal[256];
    if (!kvp->has_key) {
        sv_errors_add(errors, SV_EINVAL, kvp->key, "the key %s", sv_api_kvp_fault_text(kvp->fault));
        return;
    }
    if (id == SV_FIELD_COUNT) {
        refuse_key(kvp->key, errors);
        return;
    }
    if (values[id].present) {
        values[id].good = false;
        sv_errors_add(errors, SV_EINVAL, kvp->key, "is given more than once");
        return;
    }
    if (kvp->fault) {
        values[id].present = true;
        sv_errors_add(errors, SV_EINVAL, kvp->key, "%s: expected %s", sv_api_kvp_fault_text(kvp->fault),
                      sv_api_field_legal(id, legal, sizeof legal));
        return;
    }
    sv_api_field_read(id, kvp->value, kvp->value_bytes, &values[id], errors);
}

enum sv_problem_kind sv_api_view_parse_kvp(const char *query, size_t bytes, const char *accept,
                                           const struct sv_api_view_limits *limits, struct sv_api_view *view,
                                           struct sv_errors *errors)
{
    struct sv_field_value values[SV_FIELD_COUNT] = {{0}};
    struct sv_api_kvp kvp;
    sv_api_kvp_init(&kvp, query, bytes);
    while (sv_api_kvp_next(&kvp)) {
        if (kvp.pairs > SV_API_KVP_PAIRS_MAX) {
            sv_errors_add(errors, SV_ELIMIT, NULL, "more than %d keys", SV_API_KVP_PAIRS_MAX);
            break;
        }
        read_pair(&kvp, values, errors);
    }
    return sv_api_view_rules(values, accept, limits, view, errors);
}

/* A list of names ("layer": ["color", "depth"]) as the text that KVP has for it. */
static bool join(const cJSON *array, char *out, size_t size)
{
    size_t used = 0;
    const cJSON *item;
    cJSON_ArrayForEach(item, array)
    {
        size_t n = cJSON_IsString(item) ? strlen(item->valuestring) : 0;
        if (n == 0 || used + n + 2 > size)
            return false;
        if (used > 0)
            out[used++] = ',';
        memcpy(out + used, item->valuestring, n);
        used += n;
    }
    out[used] = '\0';
    return used > 0;
}

static bool is_numeric(enum sv_field_type type)
{
    return type == SV_FIELD_NUMBER || type == SV_FIELD_INTEGER || type == SV_FIELD_INTEGER_SET;
}

static void read_member(enum sv_field_id id, const cJSON *item, struct sv_field_value *value,
                        struct sv_errors *errors)
{
    enum sv_field_type type = sv_api_field(id)->type;
    char text[256];
    value->present = true;
    if (is_numeric(type) && cJSON_IsNumber(item)) {
        sv_api_field_read_number(id, item->valuedouble, value, errors);
    } else if (type == SV_FIELD_SWITCH && cJSON_IsBool(item)) {
        *value = (struct sv_field_value){.present = true, .good = true, .choice = cJSON_IsTrue(item) ? 1 : 0};
    } else if (type == SV_FIELD_CHOICES && cJSON_IsArray(item) && join(item, text, sizeof text)) {
        sv_api_field_read(id, text, strlen(text), value, errors);
    } else if (!is_numeric(type) && cJSON_IsString(item)) {
        sv_api_field_read(id, item->valuestring, strlen(item->valuestring), value, errors);
    } else {
        const char *want = is_numeric(type) ? "a JSON number" : "a JSON string";
        sv_errors_add(errors, SV_EINVAL, sv_api_field_name(id), "must be %s: expected %s", want,
                      sv_api_field_legal(id, text, sizeof text));
    }
}

enum sv_problem_kind sv_api_view_parse_json(const char *body, size_t bytes, const char *accept,
                                            const struct sv_api_view_limits *limits, struct sv_api_view *view,
                                            struct sv_errors *errors)
{
    struct sv_error why;
    cJSON *root;
    if (sv_api_json_parse(body, bytes, &root, &why)) {
        sv_errors_add(errors, SV_EINVAL, why.field, "%s", why.message);
        return SV_PROBLEM_BAD_REQUEST;
    }
    enum sv_problem_kind kind = sv_api_view_parse_tree(root, accept, limits, view, errors);
    cJSON_Delete(root);
    return kind;
}

enum sv_problem_kind sv_api_view_parse_tree(const cJSON *root, const char *accept,
                                            const struct sv_api_view_limits *limits, struct sv_api_view *view,
                                            struct sv_errors *errors)
{
    struct sv_field_value values[SV_FIELD_COUNT] = {{0}};
    if (!cJSON_IsObject(root)) {
        sv_errors_add(errors, SV_EINVAL, NULL,
                      "a view is a JSON object, like {\"x\": 500120, \"y\": 5200340}");
        return SV_PROBLEM_BAD_REQUEST;
    }
    const cJSON *item;
    cJSON_ArrayForEach(item, root)
    {
        enum sv_field_id id = sv_api_field_find(item->string);
        if (id == SV_FIELD_COUNT)
            refuse_key(item->string, errors);
        else
            read_member(id, item, &values[id], errors);
    }
    return sv_api_view_rules(values, accept, limits, view, errors);
}
