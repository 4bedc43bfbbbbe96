/* kvp.c - see kvp.h. */
#include "api/kvp.h"

#include <string.h>

#include "api/utf8.h"

const char *sv_api_kvp_fault_text(enum sv_api_kvp_fault fault)
{
    static const char *const texts[] = {
#define X(name, text) [name] = text,
        SV_API_KVP_FAULT_LIST(X)
#undef X
    };
    return (unsigned)fault < SV_API_KVP_FAULT_COUNT ? texts[fault] : "";
}

void sv_api_kvp_init(struct sv_api_kvp *kvp, const char *query, size_t bytes)
{
    memset(kvp, 0, sizeof *kvp);
    kvp->at = query ? query : "";
    kvp->end = kvp->at + bytes;
}

static int hex(char c)
{
    if (c >= '0' && c <= '9')
        return c - '0';
    if (c >= 'a' && c <= 'f')
        return c - 'a' + 10;
    return c >= 'A' && c <= 'F' ? c - 'A' + 10 : -1;
}

/* Decodes [p, end) into out, at most max bytes and a NUL. */
static enum sv_api_kvp_fault decode(const char *p, const char *end, char *out, size_t max, size_t *bytes)
{
    size_t n = 0;
    while (p < end) {
        char c = *p++;
        if (c == '+') {
            c = ' ';
        } else if (c == '%') {
            int high = end - p >= 2 ? hex(p[0]) : -1, low = high >= 0 ? hex(p[1]) : -1;
            if (low < 0)
                return SV_API_KVP_ESCAPE;
            c = (char)(high * 16 + low);
            p += 2;
        }
        if (c == '\0')
            return SV_API_KVP_NUL;
        if (n == max)
            return SV_API_KVP_LONG;
        out[n++] = c;
    }
    out[n] = '\0';
    *bytes = n;
    return sv_api_utf8_valid(out, n) ? SV_API_KVP_OK : SV_API_KVP_UTF8;
}

static void split(struct sv_api_kvp *kvp, const char *first, const char *last)
{
    size_t key_bytes = 0;
    const char *equals = memchr(first, '=', (size_t)(last - first));
    const char *key_end = equals ? equals : last;
    kvp->value[0] = '\0';
    kvp->value_bytes = 0;
    kvp->fault = decode(first, key_end, kvp->key, SV_API_KVP_KEY_MAX, &key_bytes);
    kvp->has_key = kvp->fault == SV_API_KVP_OK && key_bytes > 0;
    if (kvp->fault) {
        sv_api_utf8_show(first, (size_t)(key_end - first), kvp->key, sizeof kvp->key);
        return;
    }
    if (key_bytes == 0)
        kvp->fault = SV_API_KVP_NO_KEY;
    else if (!equals)
        kvp->fault = SV_API_KVP_NO_VALUE;
    else
        kvp->fault = decode(equals + 1, last, kvp->value, SV_API_KVP_VALUE_MAX, &kvp->value_bytes);
    if (kvp->fault) {
        kvp->value[0] = '\0';
        kvp->value_bytes = 0;
    }
    char raw[SV_API_KVP_KEY_MAX + 1];
    memcpy(raw, kvp->key, key_bytes + 1);
    sv_api_utf8_show(raw, key_bytes, kvp->key, sizeof kvp->key);
}

bool sv_api_kvp_next(struct sv_api_kvp *kvp)
{
    while (kvp->at < kvp->end) {
        const char *first = kvp->at;
        const char *amp = memchr(first, '&', (size_t)(kvp->end - first));
        const char *last = amp ? amp : kvp->end;
        kvp->at = amp ? amp + 1 : kvp->end;
        if (last == first)
            continue;
        kvp->pairs++;
        split(kvp, first, last);
        return true;
    }
    return false;
}
