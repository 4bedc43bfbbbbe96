/* headers.c - see headers.h. */
#include "api/headers.h"

#include <stdarg.h>
#include <stdio.h>
#include <strings.h>

void sv_api_headers_init(struct sv_headers *headers)
{
    headers->count = 0;
    headers->used = 0;
    headers->overflow = false;
}

const char *sv_api_headers_value(const struct sv_headers *headers, int index)
{
    return headers->text + headers->items[index].at;
}

static int find(const struct sv_headers *headers, const char *name)
{
    for (int k = 0; k < headers->count; k++)
        if (strcasecmp(headers->items[k].name, name) == 0)
            return k;
    return -1;
}

const char *sv_api_headers_find(const struct sv_headers *headers, const char *name)
{
    int k = find(headers, name);
    return k < 0 ? NULL : sv_api_headers_value(headers, k);
}

void sv_api_headers_set(struct sv_headers *headers, const char *name, const char *format, ...)
{
    int k = find(headers, name);
    size_t left = SV_HEADERS_BYTES - headers->used;
    char *value = headers->text + headers->used;
    va_list args;
    va_start(args, format);
    int n = left > 0 ? vsnprintf(value, left, format, args) : -1;
    va_end(args);
    if (n < 0 || (size_t)n >= left || (k < 0 && headers->count == SV_HEADERS_MAX)) {
        headers->overflow = true;
        return;
    }
    for (int i = 0; i < n; i++)
        if ((unsigned char)value[i] < 0x20 || value[i] == 0x7F)
            value[i] = ' ';
    if (k < 0)
        k = headers->count++;
    headers->items[k].name = name;
    headers->items[k].at = (unsigned short)headers->used;
    headers->used += (size_t)n + 1;
}
