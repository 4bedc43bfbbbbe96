/* scene_values.c - see scene_values.h. */
#include "core/scene/scene_values.h"

#include <errno.h>
#include <math.h>
#include <stdarg.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

/* ---- errors and key paths ---- */

void sv_value_complain(struct sv_value_reader *r, enum sv_status code, const char *format, ...)
{
    char text[400];
    va_list args;
    va_start(args, format);
    vsnprintf(text, sizeof text, format, args);
    va_end(args);
    sv_errors_add(r->errors, code, r->path, "%s%s%s", r->file ? r->file : "", r->file ? ": " : "", text);
}

size_t sv_value_enter(struct sv_value_reader *r, const char *format, ...)
{
    size_t length = strlen(r->path);
    va_list args;
    va_start(args, format);
    vsnprintf(r->path + length, sizeof r->path - length, format, args);
    va_end(args);
    return length;
}

size_t sv_value_enter_key(struct sv_value_reader *r, const char *key)
{
    return sv_value_enter(r, "%s%s", r->path[0] ? "." : "", key);
}

void sv_value_leave(struct sv_value_reader *r, size_t length)
{
    r->path[length] = '\0';
}

struct sv_value_shown sv_value_show(const char *s)
{
    struct sv_value_shown out = {{0}};
    size_t n = strlen(s), end = n < 64 ? n : 60;
    while (end < n && end > 0 && ((unsigned char)s[end] & 0xC0) == 0x80)
        end--;
    for (size_t k = 0; k < end; k++)
        out.text[k] = (unsigned char)s[k] < 0x20 || s[k] == 0x7F ? '?' : s[k];
    if (end < n)
        strcpy(out.text + end, "...");
    return out;
}

static const char *type_of(const cJSON *json)
{
    return cJSON_IsNumber(json)   ? "a number"
           : cJSON_IsString(json) ? "a string"
           : cJSON_IsBool(json)   ? "a boolean"
           : cJSON_IsArray(json)  ? "an array"
           : cJSON_IsObject(json) ? "an object"
                                  : "null";
}

void sv_value_complain_type(struct sv_value_reader *r, const cJSON *json, const char *wanted)
{
    if (cJSON_IsString(json))
        sv_value_complain(r, SV_EINVAL, "must be %s, is the string \"%s\"", wanted,
                          sv_value_show(json->valuestring).text);
    else
        sv_value_complain(r, SV_EINVAL, "must be %s, is %s", wanted, type_of(json));
}

/* ---- scalars ---- */

/* A number as short as still says it exactly. */
struct digits {
    char text[32];
};
static struct digits digits(double v)
{
    struct digits d;
    snprintf(d.text, sizeof d.text, "%.15g", v);
    if (strtod(d.text, NULL) != v)
        snprintf(d.text, sizeof d.text, "%.17g", v);
    return d;
}

bool sv_value_number_in(struct sv_value_reader *r, const cJSON *json, const struct sv_value_field *f,
                        bool integer, double *value)
{
    if (!cJSON_IsNumber(json)) {
        sv_value_complain_type(r, json, integer ? "an integer" : "a number");
        return false;
    }
    double v = json->valuedouble;
    const char *fault = !isfinite(v)                    ? "is too large for a number"
                        : !(v >= f->min && v <= f->max) ? "is outside"
                        : integer && v != floor(v)      ? "is not an integer"
                                                        : NULL;
    if (!fault) {
        *value = v;
        return true;
    }
    sv_value_complain(r, SV_EINVAL, "%s %s; legal is %s .. %s%s%s", digits(v).text, fault,
                      digits(f->min).text, digits(f->max).text, *f->unit ? " " : "", f->unit);
    return false;
}

void sv_value_number(struct sv_value_reader *r, const cJSON *json, const struct sv_value_field *f, void *base)
{
    double v = f->fallback;
    if (!json || sv_value_number_in(r, json, f, false, &v))
        *(double *)((char *)base + f->offset) = v;
}

void sv_value_int(struct sv_value_reader *r, const cJSON *json, const struct sv_value_field *f, void *base)
{
    double v = f->fallback;
    if (!json || sv_value_number_in(r, json, f, true, &v))
        *(int *)((char *)base + f->offset) = (int)v;
}

void sv_value_u32(struct sv_value_reader *r, const cJSON *json, const struct sv_value_field *f, void *base)
{
    double v = f->fallback;
    if (!json || sv_value_number_in(r, json, f, true, &v))
        *(uint32_t *)((char *)base + f->offset) = (uint32_t)v;
}

void sv_value_u64(struct sv_value_reader *r, const cJSON *json, const struct sv_value_field *f, void *base)
{
    double v = f->fallback;
    if (!json || sv_value_number_in(r, json, f, true, &v))
        *(uint64_t *)((char *)base + f->offset) = (uint64_t)v;
}

/* A string of min .. max bytes without control characters. */
const char *sv_value_string_in(struct sv_value_reader *r, const cJSON *json, const struct sv_value_field *f)
{
    if (!cJSON_IsString(json)) {
        sv_value_complain_type(r, json, "a string");
        return NULL;
    }
    const char *s = json->valuestring;
    size_t n = strlen(s);
    if ((double)n < f->min || (double)n > f->max) {
        sv_value_complain(r, SV_EINVAL, "\"%s\" has %zu bytes, legal is %.15g .. %.15g",
                          sv_value_show(s).text, n, f->min, f->max);
        return NULL;
    }
    for (const char *p = s; *p; p++)
        if ((unsigned char)*p < 0x20 || *p == 0x7F) {
            sv_value_complain(r, SV_EINVAL, "\"%s\" holds a control character", sv_value_show(s).text);
            return NULL;
        }
    return s;
}

char *sv_value_copy(struct sv_value_reader *r, const char *a, const char *b)
{
    size_t n = strlen(a) + strlen(b) + 1;
    char *s = malloc(n);
    if (!s)
        sv_value_complain(r, SV_ENOMEM, "no memory for it");
    else
        snprintf(s, n, "%s%s", a, b);
    return s;
}

void sv_value_string(struct sv_value_reader *r, const cJSON *json, const struct sv_value_field *f, void *base)
{
    const char *s = json ? sv_value_string_in(r, json, f) : NULL;
    if (s)
        *(char **)((char *)base + f->offset) = sv_value_copy(r, s, "");
}

/* Names of GDAL's virtual file systems ("/vsizip/...") are handed on as they are. */
static bool is_virtual(const char *path)
{
    return strncmp(path, "/vsi", 4) == 0;
}

static void look_for(struct sv_value_reader *r, const char *path)
{
    struct stat st;
    if (is_virtual(path))
        return;
    if (stat(path, &st) != 0)
        sv_value_complain(r, errno == ENOENT || errno == ENOTDIR ? SV_ENOENT : SV_EIO, "cannot find %s: %s",
                          path, strerror(errno));
    else if (!S_ISREG(st.st_mode) && !S_ISDIR(st.st_mode)) /* some GIS formats are folders */
        sv_value_complain(r, SV_EFORMAT, "%s is not a file", path);
    else if (access(path, R_OK) != 0)
        sv_value_complain(r, SV_EIO, "cannot read %s: %s", path, strerror(errno));
}

void sv_value_path(struct sv_value_reader *r, const cJSON *json, const struct sv_value_field *f, void *base)
{
    const char *s = json ? sv_value_string_in(r, json, f) : NULL;
    if (!s)
        return;
    char *path = sv_value_copy(r, *s == '/' ? "" : r->folder, s);
    *(char **)((char *)base + f->offset) = path;
    if (path && r->look_for_files)
        look_for(r, path);
}

/* [least, most], or one number for both. */
void sv_value_range(struct sv_value_reader *r, const cJSON *json, const struct sv_value_field *f, void *base)
{
    double *range = (double *)(void *)((char *)base + f->offset);
    if (!json)
        return;
    if (cJSON_IsNumber(json)) {
        if (sv_value_number_in(r, json, f, false, &range[0]))
            range[1] = range[0];
        return;
    }
    if (!cJSON_IsArray(json) || cJSON_GetArraySize(json) != 2) {
        sv_value_complain(r, SV_EINVAL, "must be a number or an array [least, most], each %g .. %g %s",
                          f->min, f->max, f->unit);
        return;
    }
    bool ok = true;
    const cJSON *item = json->child;
    for (int k = 0; k < 2; k++, item = item->next) {
        size_t at = sv_value_enter(r, "[%d]", k);
        ok = sv_value_number_in(r, item, f, false, &range[k]) && ok;
        sv_value_leave(r, at);
    }
    if (ok && range[0] > range[1])
        sv_value_complain(r, SV_EINVAL, "least %.15g is more than most %.15g", range[0], range[1]);
}

/* ---- objects and lists of them ---- */

static void complain_unknown(struct sv_value_reader *r, const struct sv_value_section *s, const char *key)
{
    char known[256] = "";
    size_t used = 0;
    for (int k = 0; k < s->count && used < 240; k++)
        used += (size_t)snprintf(known + used, sizeof known - used, "%s%s", k ? ", " : "", s->fields[k].key);
    size_t at = sv_value_enter_key(r, sv_value_show(key).text);
    sv_value_complain(r, SV_EINVAL, "is not a known key here; known: %s", known);
    sv_value_leave(r, at);
}

/* What a key wants, as its row says it: "a number of metres, 0.01 .. 10000". */
static void complain_missing(struct sv_value_reader *r, const struct sv_value_field *f)
{
    static const char *const units[][2] = {{"m", "metres"}, {"deg", "degrees"}};
    const char *unit = f->unit, *article = strchr("aeiou", f->type[0]) ? "an" : "a";
    for (size_t k = 0; k < sizeof units / sizeof units[0]; k++)
        unit = strcmp(f->unit, units[k][0]) == 0 ? units[k][1] : unit;
    if (strcmp(f->type, "number") == 0 || strcmp(f->type, "integer") == 0)
        sv_value_complain(r, SV_EINVAL, "is missing; it must be %s %s%s%s, %s .. %s", article, f->type,
                          *unit ? " of " : "", unit, digits(f->min).text, digits(f->max).text);
    else if (strcmp(f->type, "string") == 0 && f->max > 0)
        sv_value_complain(r, SV_EINVAL, "is missing; it must be a string of %.15g .. %.15g bytes", f->min,
                          f->max);
    else
        sv_value_complain(r, SV_EINVAL, "is missing; it must be %s %s", article, f->type);
}

void sv_value_section(struct sv_value_reader *r, const cJSON *json, const struct sv_value_section *s,
                      void *base)
{
    const cJSON *found[SV_VALUE_FIELDS_MAX] = {NULL};
    if (json && !cJSON_IsObject(json)) {
        sv_value_complain_type(r, json, "an object");
        return;
    }
    for (const cJSON *item = json ? json->child : NULL; item; item = item->next) {
        int k = 0;
        while (k < s->count && strcmp(s->fields[k].key, item->string) != 0)
            k++;
        if (k == s->count) {
            complain_unknown(r, s, item->string);
        } else if (found[k]) {
            size_t at = sv_value_enter_key(r, item->string);
            sv_value_complain(r, SV_EINVAL, "the key is there twice");
            sv_value_leave(r, at);
        } else {
            found[k] = item;
        }
    }
    for (int k = 0; k < s->count; k++) {
        const struct sv_value_field *f = &s->fields[k];
        size_t at = sv_value_enter_key(r, f->key);
        if (!found[k] && f->required)
            complain_missing(r, f);
        f->read(r, found[k], f, base);
        sv_value_leave(r, at);
    }
}

void sv_value_object(struct sv_value_reader *r, const cJSON *json, const struct sv_value_field *f, void *base)
{
    sv_value_section(r, json, f->section, (char *)base + f->offset);
}

/* Room for the items of an array, zeroed; NULL when there is nothing to read. */
void *sv_value_list(struct sv_value_reader *r, const cJSON *json, const struct sv_value_field *f, size_t size,
                    int *count)
{
    if (!json)
        return NULL;
    if (!cJSON_IsArray(json)) {
        sv_value_complain_type(r, json, "an array");
        return NULL;
    }
    int n = cJSON_GetArraySize(json);
    if (n > f->max) {
        sv_value_complain(r, SV_ELIMIT, "%d items are more than %.15g", n, f->max);
        return NULL;
    }
    void *items = n > 0 ? calloc((size_t)n, size) : NULL;
    if (n > 0 && !items)
        sv_value_complain(r, SV_ENOMEM, "no memory for it");
    *count = items ? n : 0;
    return items;
}

bool sv_value_one_of(struct sv_value_reader *r, const cJSON *json, const char *a, const char *b)
{
    if (!cJSON_IsObject(json))
        return false; /* its type is complained about elsewhere */
    bool has_a = cJSON_GetObjectItemCaseSensitive(json, a), has_b = cJSON_GetObjectItemCaseSensitive(json, b);
    if (has_a == has_b)
        sv_value_complain(r, SV_EINVAL,
                          has_a ? "has both \"%s\" and \"%s\"; give one" : "needs \"%s\" or \"%s\"", a, b);
    return has_a != has_b;
}
