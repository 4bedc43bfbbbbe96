#include "core/base/error.h"

#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

const char *sv_status_text(enum sv_status status)
{
    static const char *const texts[] = {
#define X(name, text) [name] = text,
        SV_STATUS_LIST(X)
#undef X
    };
    if ((unsigned)status >= SV_STATUS_COUNT)
        return "unknown status";
    return texts[status];
}

/* Cuts a string that vsnprintf truncated so that it does not end inside a UTF-8 sequence. */
static void trim_utf8(char *text, size_t size)
{
    size_t n = strlen(text);
    if (n + 1 < size)
        return;
    size_t i = n;
    while (i > 0 && ((unsigned char)text[i - 1] & 0xC0) == 0x80)
        i--;
    if (i == 0)
        return;
    unsigned char lead = (unsigned char)text[i - 1];
    size_t need = lead >= 0xF0 ? 4 : lead >= 0xE0 ? 3 : lead >= 0xC0 ? 2 : 1;
    if (n - (i - 1) < need)
        text[i - 1] = '\0';
}

static void fill(struct sv_error *error, enum sv_status code, const char *field, const char *format, va_list args)
{
    error->code = code;
    snprintf(error->field, sizeof error->field, "%s", field ? field : "");
    trim_utf8(error->field, sizeof error->field);
    vsnprintf(error->message, sizeof error->message, format, args);
    trim_utf8(error->message, sizeof error->message);
}

enum sv_status sv_fail(struct sv_error *error, enum sv_status code, const char *field, const char *format, ...)
{
    if (error) {
        va_list args;
        va_start(args, format);
        fill(error, code, field, format, args);
        va_end(args);
    }
    return code;
}

void sv_errors_init(struct sv_errors *list)
{
    *list = (struct sv_errors){0};
}

void sv_errors_finish(struct sv_errors *list)
{
    free(list->items);
    *list = (struct sv_errors){0};
}

void sv_errors_add(struct sv_errors *list, enum sv_status code, const char *field, const char *format, ...)
{
    list->total++;
    if (list->count == SV_ERRORS_MAX)
        return;
    if (!list->items)
        list->items = calloc(SV_ERRORS_MAX, sizeof *list->items);
    if (!list->items)
        return;
    va_list args;
    va_start(args, format);
    fill(&list->items[list->count++], code, field, format, args);
    va_end(args);
}
