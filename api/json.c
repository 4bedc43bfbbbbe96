/* json.c - see json.h. A recursive descent over RFC 8259's grammar, then cJSON. */
#include "api/json.h"

#include <stdbool.h>
#include <string.h>

#include "api/number.h"
#include "api/utf8.h"

struct check {
    const char *text, *at, *end;
    const char *fault; /* NULL: none yet */
};

static bool value(struct check *c, int depth);

static bool fail(struct check *c, const char *fault)
{
    if (!c->fault)
        c->fault = fault;
    return false;
}

static void blanks(struct check *c)
{
    while (c->at < c->end && (*c->at == ' ' || *c->at == '\t' || *c->at == '\n' || *c->at == '\r'))
        c->at++;
}

static bool take(struct check *c, char want)
{
    if (c->at >= c->end || *c->at != want)
        return false;
    c->at++;
    return true;
}

static bool word(struct check *c, const char *text)
{
    size_t n = strlen(text);
    if ((size_t)(c->end - c->at) < n || memcmp(c->at, text, n) != 0)
        return fail(c, "a value is expected");
    c->at += n;
    return true;
}

static size_t digits(struct check *c)
{
    size_t n = 0;
    for (; c->at < c->end && *c->at >= '0' && *c->at <= '9'; c->at++)
        n++;
    return n;
}

static bool number(struct check *c)
{
    const char *first = c->at;
    take(c, '-');
    if (!take(c, '0') && digits(c) == 0)
        return fail(c, "a number needs digits");
    if (take(c, '.') && digits(c) == 0)
        return fail(c, "a number needs digits after its point");
    if (take(c, 'e') || take(c, 'E')) {
        if (!take(c, '+'))
            take(c, '-');
        if (digits(c) == 0)
            return fail(c, "a number needs digits in its exponent");
    }
    if (c->at - first > SV_API_NUMBER_TEXT_MAX)
        return fail(c, "a number of more than 63 characters");
    return true;
}

/* The four digits of \uXXXX, -1 when they are not there. */
static int hex4(struct check *c)
{
    int v = 0;
    if (c->end - c->at < 4)
        return -1;
    for (int k = 0; k < 4; k++, c->at++) {
        const char *found = memchr("0123456789abcdefABCDEF", *c->at, 22);
        if (!found)
            return -1;
        int d = (int)(found - "0123456789abcdefABCDEF");
        v = v * 16 + (*c->at >= 'A' && *c->at <= 'F' ? *c->at - 'A' + 10 : d);
    }
    return v;
}

static bool escape(struct check *c)
{
    if (c->at >= c->end)
        return fail(c, "a string does not end");
    char kind = *c->at++;
    if (kind != 'u')
        return memchr("\"\\/bfnrt", kind, 8) ? true : fail(c, "an unknown escape in a string");
    int unit = hex4(c);
    if (unit < 0)
        return fail(c, "\\u needs four hexadecimal digits");
    if (unit == 0)
        return fail(c, "a NUL character (\\u0000) in a string");
    if (unit >= 0xDC00 && unit <= 0xDFFF)
        return fail(c, "half a surrogate pair in a string");
    if (unit < 0xD800 || unit > 0xDBFF)
        return true;
    int low = take(c, '\\') && take(c, 'u') ? hex4(c) : -1;
    return low >= 0xDC00 && low <= 0xDFFF ? true : fail(c, "half a surrogate pair in a string");
}

static bool string(struct check *c)
{
    if (!take(c, '"'))
        return fail(c, "a name in quotes is expected");
    while (c->at < c->end) {
        unsigned char b = (unsigned char)*c->at;
        if (b == '"') {
            c->at++;
            return true;
        }
        if (b < 0x20)
            return fail(c, "a control character in a string");
        size_t step = sv_api_utf8_length((const unsigned char *)c->at, (size_t)(c->end - c->at));
        if (step == 0)
            return fail(c, "the text is not UTF-8");
        c->at += step;
        if (b == '\\' && !escape(c))
            return false;
    }
    return fail(c, "a string does not end");
}

static bool object(struct check *c, int depth)
{
    blanks(c);
    if (take(c, '}'))
        return true;
    for (int members = 1;; members++) {
        if (members > SV_API_JSON_MEMBERS_MAX)
            return fail(c, "an object of more than 256 members");
        blanks(c);
        if (!string(c))
            return false;
        blanks(c);
        if (!take(c, ':'))
            return fail(c, "a ':' is expected after a name");
        if (!value(c, depth))
            return false;
        if (take(c, '}'))
            return true;
        if (!take(c, ','))
            return fail(c, "a ',' or '}' is expected");
    }
}

static bool array(struct check *c, int depth)
{
    blanks(c);
    if (take(c, ']'))
        return true;
    for (;;) {
        if (!value(c, depth))
            return false;
        if (take(c, ']'))
            return true;
        if (!take(c, ','))
            return fail(c, "a ',' or ']' is expected");
    }
}

/* One value with the blanks around it. */
static bool value(struct check *c, int depth)
{
    bool good;
    blanks(c);
    if (c->at >= c->end)
        return fail(c, "the text ends too early");
    switch (*c->at) {
    case '{':
    case '[':
        if (depth >= SV_API_JSON_DEPTH_MAX)
            return fail(c, "nested deeper than 16");
        good = *c->at++ == '{' ? object(c, depth + 1) : array(c, depth + 1);
        break;
    case '"':
        good = string(c);
        break;
    case 't':
        good = word(c, "true");
        break;
    case 'f':
        good = word(c, "false");
        break;
    case 'n':
        good = word(c, "null");
        break;
    default:
        good = *c->at == '-' || (*c->at >= '0' && *c->at <= '9') ? number(c) : fail(c, "a value is expected");
        break;
    }
    blanks(c);
    return good;
}

/* The name that some object of the tree has twice, or NULL. Objects are bounded, so the square is, too. */
static const char *twice(const cJSON *node)
{
    for (const cJSON *a = node->child; a; a = a->next) {
        if (cJSON_IsObject(node))
            for (const cJSON *b = a->next; b; b = b->next)
                if (strcmp(a->string, b->string) == 0)
                    return a->string;
        const char *inner = a->child ? twice(a) : NULL;
        if (inner)
            return inner;
    }
    return NULL;
}

enum sv_status sv_api_json_parse(const char *text, size_t bytes, cJSON **root, struct sv_error *error)
{
    struct check c = {.text = text ? text : "", .at = text ? text : "", .end = (text ? text : "") + bytes};
    if (value(&c, 0) && c.at < c.end)
        fail(&c, "something follows the end of the value");
    if (c.fault) {
        size_t line = 1, column = 1;
        for (const char *p = c.text; p < c.at && p < c.end; p++, column++)
            if (*p == '\n') {
                line++;
                column = 0;
            }
        return sv_fail(error, SV_EINVAL, NULL, "not JSON: %s (line %zu, column %zu)", c.fault, line, column);
    }
    cJSON *tree = cJSON_ParseWithLength(c.text, bytes);
    if (!tree)
        return sv_fail(error, SV_ENOMEM, NULL, "out of memory for a JSON text of %zu bytes", bytes);
    const char *name = twice(tree);
    if (name) {
        char shown[64];
        sv_api_utf8_show(name, strlen(name), shown, sizeof shown);
        enum sv_status status =
            sv_fail(error, SV_EINVAL, shown, "the name is given more than once in one object");
        cJSON_Delete(tree);
        return status;
    }
    *root = tree;
    return SV_OK;
}
