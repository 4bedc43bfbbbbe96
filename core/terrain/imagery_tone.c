/* imagery_tone.c - finds out whether imagery is raw and hazy, and the curve that mends it. */
#include "core/terrain/imagery_tone.h"

#include <math.h>
#include <stddef.h>

#include "core/base/color.h"

enum { HAZE_MIN = 20, BRIGHT_MAX = 140 };
#define BRIGHT_ALBEDO 0.4f
/* 1 / (exposure 2.4 x light 0.72 on level ground under a sun at 40 degrees). */
#define PHOTO_ALBEDO 0.58f
#define HAZE_KEPT 0.1f /* dark objects are not quite black */

struct band {
    int dark, bright; /* codes of the 1st and 99th percentile */
};

static size_t count_codes(const struct sv_image *imagery, size_t histogram[3][256])
{
    const uint8_t *p = imagery->data;
    size_t counted = 0;
    for (size_t k = 0; k < (size_t)imagery->width * (size_t)imagery->height; k++, p += 4) {
        if (!p[3])
            continue;
        counted++;
        for (int c = 0; c < 3; c++)
            histogram[c][p[c]]++;
    }
    return counted;
}

static struct band find_band(const size_t histogram[256], size_t counted)
{
    struct band band = {0, 0};
    size_t sum = 0;
    for (int code = 0; code < 256; code++) {
        if (sum * 100 < counted)
            band.dark = code;
        if (sum * 100 < counted * 99)
            band.bright = code;
        sum += histogram[code];
    }
    return band;
}

bool sv_imagery_tone(const struct sv_image *imagery, uint8_t table[3][256])
{
    size_t histogram[3][256] = {{0}}, counted = count_codes(imagery, histogram);
    struct band bands[3];
    float brightest = 0, haze[3];
    bool raw = counted > 0;
    for (int c = 0; c < 3; c++) {
        bands[c] = find_band(histogram[c], counted);
        raw = raw && bands[c].dark >= HAZE_MIN && bands[c].bright <= BRIGHT_MAX;
        haze[c] = (1 - HAZE_KEPT) * sv_linear_from_srgb8[bands[c].dark];
        brightest = fmaxf(brightest, sv_linear_from_srgb8[bands[c].bright] - haze[c]);
    }
    float gain = raw ? fminf(6, fmaxf(1, BRIGHT_ALBEDO / brightest)) : 1;
    for (int c = 0; c < 3; c++)
        for (int code = 0; code < 256; code++)
            table[c][code] = raw ? sv_srgb8_from_linear(fmaxf(0, sv_linear_from_srgb8[code] - haze[c]) * gain)
                                 : sv_srgb8_from_linear(sv_linear_from_srgb8[code] * PHOTO_ALBEDO);
    return raw;
}
