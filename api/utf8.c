/* utf8.c - see utf8.h. */
#include "api/utf8.h"

#include <stdio.h>
#include <string.h>

size_t sv_api_utf8_length(const unsigned char *p, size_t n)
{
    /* Legal second bytes by lead byte (Unicode 15, table 3-7); third and fourth are always 80..BF. */
    static const struct {
        unsigned char lead_min, lead_max, length, second_min, second_max;
    } rows[] = {
        {0x00, 0x7F, 1, 0x00, 0x00}, {0xC2, 0xDF, 2, 0x80, 0xBF}, {0xE0, 0xE0, 3, 0xA0, 0xBF},
        {0xE1, 0xEC, 3, 0x80, 0xBF}, {0xED, 0xED, 3, 0x80, 0x9F}, {0xEE, 0xEF, 3, 0x80, 0xBF},
        {0xF0, 0xF0, 4, 0x90, 0xBF}, {0xF1, 0xF3, 4, 0x80, 0xBF}, {0xF4, 0xF4, 4, 0x80, 0x8F},
    };
    for (size_t r = 0; r < sizeof rows / sizeof rows[0]; r++) {
        if (p[0] < rows[r].lead_min || p[0] > rows[r].lead_max)
            continue;
        if (rows[r].length > n)
            return 0;
        if (rows[r].length > 1 && (p[1] < rows[r].second_min || p[1] > rows[r].second_max))
            return 0;
        for (size_t k = 2; k < rows[r].length; k++)
            if ((p[k] & 0xC0) != 0x80)
                return 0;
        return rows[r].length;
    }
    return 0;
}

bool sv_api_utf8_valid(const void *bytes, size_t n)
{
    const unsigned char *p = bytes;
    for (size_t i = 0; i < n;) {
        size_t step = sv_api_utf8_length(p + i, n - i);
        if (step == 0)
            return false;
        i += step;
    }
    return true;
}

/* One character as it is shown, into piece; returns how many bytes of the input it took. */
static size_t show_one(const unsigned char *p, size_t n, char piece[8], size_t *width)
{
    size_t step = sv_api_utf8_length(p, n);
    if (step == 0 || (step == 1 && (p[0] < 0x20 || p[0] == 0x7F))) {
        *width = (size_t)snprintf(piece, 8, "\\x%02X", p[0]);
        return 1;
    }
    memcpy(piece, p, step);
    *width = step;
    return step;
}

void sv_api_utf8_show(const void *bytes, size_t n, char *out, size_t size)
{
    const unsigned char *p = bytes;
    size_t used = 0, keep = 0, width; /* keep: what fits with "..." behind it */
    char piece[8];
    for (size_t i = 0; i < n; used += width) {
        i += show_one(p + i, n - i, piece, &width);
        if (used + width + 1 > size) {
            memcpy(out + keep, "...", 3);
            used = keep + 3;
            break;
        }
        memcpy(out + used, piece, width);
        if (used + width + 4 <= size)
            keep = used + width;
    }
    out[used] = '\0';
}
