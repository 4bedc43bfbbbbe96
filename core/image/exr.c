/* exr.c - whether the headers of an OpenEXR file fit into it, after "OpenEXR File Layout" (openexr.com).
 *
 * OpenEXR 3.1 makes room for an attribute's value on the word of its size before it reads it: a thousand
 * broken bytes took 2 GiB (found by fuzzing). Only sizes are looked at here; what they hold is OpenEXR's. */
#include "core/image/private.h"

#include <string.h>

enum { MAGIC_BYTES = 4, MULTI_PART = 0x1000 };

static uint32_t get32(const unsigned char *p)
{
    return (uint32_t)p[0] | (uint32_t)p[1] << 8 | (uint32_t)p[2] << 16 | (uint32_t)p[3] << 24;
}

/* Past a name's ending zero; NULL where it does not end. */
static const unsigned char *skip_name(const unsigned char *p, const unsigned char *end)
{
    const unsigned char *zero = memchr(p, 0, (size_t)(end - p));
    return zero ? zero + 1 : NULL;
}

/* *at is past the attribute (a name, a type, a size and a value) on success. */
static enum sv_status skip_attribute(const unsigned char **at, const unsigned char *end,
                                     struct sv_error *error)
{
    const char *name = (const char *)*at;
    const unsigned char *p = skip_name(*at, end);
    p = p ? skip_name(p, end) : NULL;
    if (!p || end - p < 4)
        return sv_fail(error, SV_EFORMAT, "image", "openexr: the header does not end");
    uint32_t value = get32(p);
    p += 4;
    if (value > (size_t)(end - p))
        return sv_fail(error, SV_EFORMAT, "image", "openexr: attribute %.40s of %u bytes, and %td are left",
                       name, value, end - p);
    *at = p + value;
    return SV_OK;
}

enum sv_status sv_exr_check(const void *bytes, size_t size, struct sv_error *error)
{
    const unsigned char *p = bytes, *end = p + size;
    if (size < MAGIC_BYTES + 4)
        return sv_fail(error, SV_EFORMAT, "image", "openexr: %zu bytes are too few", size);
    bool parts = get32(p + MAGIC_BYTES) & MULTI_PART, empty = false;
    p += MAGIC_BYTES + 4;
    do { /* a zero ends a header's attributes, an empty header the headers of several parts */
        empty = p < end && *p == 0;
        while (p < end && *p != 0) {
            enum sv_status status = skip_attribute(&p, end, error);
            if (status != SV_OK)
                return status;
        }
        if (p == end)
            return sv_fail(error, SV_EFORMAT, "image", "openexr: the header does not end");
        p++;
    } while (parts && !empty);
    return SV_OK;
}
