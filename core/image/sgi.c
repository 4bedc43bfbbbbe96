/* sgi.c - SGI image files (.rgb, .rgba, .bw, .sgi), after Haeberli, "The SGI Image File Format",
 * version 1.00.
 *
 * FlightGear's models bring such textures. OpenImageIO 2.4.7 reads them from paths only, and takes the
 * lengths of run-length coded rows on trust (found by fuzzing); this reader works in memory and checks every
 * offset. A colour map, a thing of the 1980s, is refused. */
#include "core/image/private.h"

#include <stdlib.h>
#include <string.h>

enum { HEADER_BYTES = 512, EXPANSION = 64 /* 2 bytes make a run of 127 */ };

struct sgi {
    const unsigned char *bytes;
    size_t size;
    int width, height, channels, sample_bytes; /* bytes a sample: 1 or 2 */
    bool packed;                               /* run-length coded */
};

static uint32_t get16(const unsigned char *p)
{
    return (uint32_t)p[0] << 8 | p[1];
}
static uint32_t get32(const unsigned char *p)
{
    return get16(p) << 16 | get16(p + 2);
}

static void store(struct sv_image *image, size_t at, uint32_t v)
{
    if (image->type == SV_PIXEL_U8)
        ((unsigned char *)image->data)[at] = (unsigned char)v;
    else
        ((uint16_t *)image->data)[at] = (uint16_t)v;
}

/* Unpacks the run-length code of one row of one channel; every stride-th sample from `at`. False when it does
 * not fill the row or runs past its end. */
static bool unpack(const struct sgi *s, const unsigned char *p, size_t size, struct sv_image *image,
                   size_t at)
{
    const unsigned char *end = p + size;
    int left = s->width, b = s->sample_bytes;
    while (left > 0) {
        if (end - p < b)
            return false;
        uint32_t code = b == 1 ? p[0] : get16(p);
        int count = (int)(code & 0x7F), literal = (code & 0x80) != 0;
        p += b;
        if (count == 0 || count > left || end - p < (literal ? (long)count * b : b))
            return false;
        for (int i = 0; i < count; i++, at += (size_t)s->channels)
            store(image, at, b == 1 ? p[literal ? i : 0] : get16(p + (literal ? 2 * i : 0)));
        p += literal ? count * b : b;
        left -= count;
    }
    return true;
}

static bool read_row(const struct sgi *s, int channel, int row, struct sv_image *image)
{
    size_t index = (size_t)channel * (size_t)s->height + (size_t)row,
           rows = (size_t)s->channels * (size_t)s->height;
    size_t at = (size_t)(s->height - 1 - row) * (size_t)s->width * (size_t)s->channels +
                (size_t)channel; /* row 0 is the lowest */
    if (s->packed) {
        if (s->size < HEADER_BYTES + 8 * rows)
            return false;
        size_t offset = get32(s->bytes + HEADER_BYTES + 4 * index),
               size = get32(s->bytes + HEADER_BYTES + 4 * (rows + index));
        return offset <= s->size && size <= s->size - offset && unpack(s, s->bytes + offset, size, image, at);
    }
    size_t bytes = (size_t)s->width * (size_t)s->sample_bytes, offset = HEADER_BYTES + index * bytes;
    if (offset > s->size || bytes > s->size - offset)
        return false;
    for (int x = 0; x < s->width; x++, at += (size_t)s->channels) {
        const unsigned char *p = s->bytes + offset + (size_t)x * (size_t)s->sample_bytes;
        store(image, at, s->sample_bytes == 1 ? p[0] : get16(p));
    }
    return true;
}

enum sv_status sv_sgi_decode(const void *bytes, size_t size, struct sv_image *image, struct sv_error *error)
{
    const unsigned char *h = bytes;
    if (size < HEADER_BYTES || get16(h) != 0x01DA)
        return sv_fail(error, SV_EFORMAT, "image", "sgi: no header");
    uint32_t dimension = get16(h + 4);
    struct sgi s = {
        .bytes = h, .size = size, .packed = h[2] == 1, .sample_bytes = h[3], .width = (int)get16(h + 6)};
    s.height = dimension >= 2 ? (int)get16(h + 8) : 1;
    s.channels = dimension >= 3 ? (int)get16(h + 10) : 1;
    if (h[2] > 1 || s.sample_bytes < 1 || s.sample_bytes > 2 || dimension < 1 || dimension > 3 ||
        s.channels < 1 || s.channels > 4 || s.width < 1 || s.height < 1 || get32(h + 104) != 0)
        return sv_fail(error, SV_EFORMAT, "image",
                       "sgi: %d x %d with %d channels of %d bytes, storage %d, colour map %u", s.width,
                       s.height, s.channels, s.sample_bytes, h[2], get32(h + 104));
    if (size - HEADER_BYTES <
        (s.packed ? 8u : (size_t)s.width * (size_t)s.sample_bytes) * (size_t)s.height * (size_t)s.channels)
        return sv_fail(error, SV_EFORMAT, "image", "sgi: %zu bytes are too few for %d x %d", size, s.width,
                       s.height);
    struct sv_image out;
    enum sv_status status =
        sv_image_check_claim(s.width, s.height, s.channels, (size_t)s.sample_bytes, size, EXPANSION, error);
    if (status == SV_OK)
        status = sv_image_alloc(s.width, s.height, s.channels,
                                s.sample_bytes == 1 ? SV_PIXEL_U8 : SV_PIXEL_U16, &out, error);
    if (status != SV_OK)
        return status;
    for (int c = 0; c < s.channels; c++)
        for (int row = 0; row < s.height; row++)
            if (!read_row(&s, c, row, &out)) {
                sv_image_free(&out);
                return sv_fail(error, SV_EFORMAT, "image", "sgi: row %d of channel %d is damaged", row, c);
            }
    *image = out;
    return SV_OK;
}
