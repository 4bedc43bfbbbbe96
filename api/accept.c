/* accept.c - see accept.h. */
#include "api/accept.h"

#include <stdbool.h>
#include <stddef.h>
#include <string.h>
#include <strings.h>

struct range {
    const char *type; /* "image/png", "image/..." of wildcards: not NUL-terminated */
    size_t bytes;
    int q;           /* in thousandths */
    bool parameters; /* others than q */
};

static bool is_token(char c)
{
    return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9') ||
           (c != '\0' && strchr("!#$%&'*+-.^_`|~", c) != NULL);
}

static const char *token(const char *p)
{
    while (is_token(*p))
        p++;
    return p;
}

static const char *blanks(const char *p)
{
    while (*p == ' ' || *p == '\t')
        p++;
    return p;
}

/* qvalue of RFC 9110 12.4.2: 0[.ddd] or 1[.000]; -1 when it is none. *p ends behind it. */
static int qvalue(const char **p)
{
    const char *s = *p;
    if (*s != '0' && *s != '1')
        return -1;
    int q = (*s++ - '0') * 1000;
    if (*s == '.') {
        s++;
        for (int scale = 100; scale >= 1 && *s >= '0' && *s <= '9'; scale /= 10)
            q += (*s++ - '0') * scale;
    }
    *p = s;
    return q <= 1000 ? q : -1;
}

/* One ";name=value"; false when it is ill-formed. */
static bool parameter(const char **p, struct range *range)
{
    const char *name = blanks(*p + 1), *end = token(name);
    bool is_q = end - name == 1 && (*name == 'q' || *name == 'Q');
    *p = end;
    if (end == name)
        return *end == ';' || *end == ',' || *end == '\0'; /* an empty parameter is legal */
    if (*end != '=')
        return false;
    const char *s = end + 1;
    if (is_q) {
        range->q = qvalue(&s);
        *p = s;
        return range->q >= 0;
    }
    range->parameters = true;
    if (*s == '"') {
        for (s++; *s && *s != '"'; s++)
            if (*s == '\\' && s[1])
                s++;
        if (*s != '"')
            return false;
        *p = s + 1;
        return true;
    }
    *p = token(s);
    return *p > s;
}

/* Reads the element at *p up to the next comma or the end; false when it is ill-formed. */
static bool element(const char **p, struct range *range)
{
    const char *s = blanks(*p), *slash = token(s);
    *range = (struct range){.type = s, .q = 1000};
    bool good = slash > s && *slash == '/';
    if (good) {
        const char *end = token(slash + 1);
        good = end > slash + 1;
        range->bytes = (size_t)(end - s);
        s = blanks(end);
        while (good && *s == ';') {
            good = parameter(&s, range);
            s = blanks(s);
        }
        good = good && (*s == ',' || *s == '\0');
    }
    for (bool quoted = false; *s && (quoted || *s != ','); s++) /* on to the next element */
        if (*s == '"')
            quoted = !quoted;
    *p = *s ? s + 1 : s;
    return good;
}

/* 2: the very type, 1: type/..., 0: any, -1: no match. */
static int specificity(const struct range *range, const char *offer)
{
    if (range->bytes == 3 && memcmp(range->type, "*/*", 3) == 0)
        return 0;
    size_t major = (size_t)(strchr(offer, '/') - offer) + 1;
    if (range->bytes == major + 1 && range->type[major] == '*' && strncasecmp(range->type, offer, major) == 0)
        return 1;
    return range->bytes == strlen(offer) && strncasecmp(range->type, offer, range->bytes) == 0 ? 2 : -1;
}

int sv_api_accept_choose(const char *accept, const char *const *offers, int count)
{
    int best = -1, best_q = 0, best_specificity = -1;
    bool any = false;
    for (int k = 0; k < count; k++) {
        int q = 0, how = -1;
        struct range range;
        for (const char *p = accept ? accept : ""; *p;) {
            if (!element(&p, &range))
                continue;
            any = true;
            int s = range.parameters ? -1 : specificity(&range, offers[k]);
            if (s > how) {
                how = s;
                q = range.q;
            }
        }
        if (q > best_q || (q == best_q && q > 0 && how == 2 && best_specificity < 2)) {
            best = k;
            best_q = q;
            best_specificity = how;
        }
    }
    return any ? best : count > 0 ? 0 : -1;
}
