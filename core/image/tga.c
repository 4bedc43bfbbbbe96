/* tga.c - Targa files (.tga), after "Truevision TGA File Format Specification", version 2.0 (1991).
 *
 * A common texture of older models. OpenImageIO 2.4.7 crashes on palette indices past the palette's end
 * (found by fuzzing); this reader takes true colour, palette and grey, plain or run-length coded, 8 to 32
 * bits a pixel, from any corner. The alpha channel is believed when the descriptor gives it bits, unless all
 * of it is 0, which many writers mean as "none". */
#include "core/image/private.h"

#include <stdlib.h>
#include <string.h>

enum { HEADER_BYTES = 18, EXPANSION = 512 /* 2 bytes: a run of 128 pixels of 4 */ };
enum { KIND_PALETTE = 1, KIND_COLOR = 2, KIND_GREY = 3, PACKED = 8 };

struct tga {
    const unsigned char *at, *end; /* what is left to read */
    int kind, width, height;
    bool packed, from_top, from_right;
    int pixel_bytes, alpha_bits;
    const unsigned char *palette;
    uint32_t palette_first, palette_count;
    int palette_bits;
};

static uint32_t get16(const unsigned char *p)
{
    return p[0] | (uint32_t)p[1] << 8;
}

/* A colour of 15, 16, 24 or 32 bits (blue first), or 8 of grey, as RGBA. */
static void expand(const unsigned char *p, int bits, int alpha_bits, unsigned char rgba[4])
{
    rgba[3] = 255;
    if (bits == 8) {
        rgba[0] = rgba[1] = rgba[2] = p[0];
    } else if (bits <= 16) {
        uint32_t v = get16(p);
        for (int k = 0; k < 3; k++) {
            uint32_t five = v >> (10 - 5 * k) & 31;
            rgba[k] = (unsigned char)(five << 3 | five >> 2);
        }
        if (alpha_bits == 1)
            rgba[3] = v & 0x8000 ? 255 : 0;
    } else {
        rgba[0] = p[2], rgba[1] = p[1], rgba[2] = p[0];
        if (bits == 32 && alpha_bits == 8)
            rgba[3] = p[3];
    }
}

/* The next pixel of the file at p. False: an index outside of the palette. */
static bool decode_pixel(const struct tga *t, const unsigned char *p, unsigned char rgba[4])
{
    if (t->kind != KIND_PALETTE) {
        expand(p, t->kind == KIND_GREY ? 8 : 8 * t->pixel_bytes, t->alpha_bits, rgba);
        return true;
    }
    uint32_t index = t->pixel_bytes == 1 ? p[0] : get16(p);
    if (index < t->palette_first || index - t->palette_first >= t->palette_count)
        return false;
    size_t bytes = (size_t)(t->palette_bits + 7) / 8;
    expand(t->palette + (index - t->palette_first) * bytes, t->palette_bits,
           t->palette_bits == 32 ? 8 : t->alpha_bits, rgba);
    return true;
}

static unsigned char *place(const struct tga *t, struct sv_image *image, size_t i)
{
    size_t x = i % (size_t)t->width, y = i / (size_t)t->width;
    if (t->from_right)
        x = (size_t)t->width - 1 - x;
    if (!t->from_top)
        y = (size_t)t->height - 1 - y;
    return (unsigned char *)image->data + 4 * (y * (size_t)t->width + x);
}

static bool read_pixels(struct tga *t, struct sv_image *image)
{
    size_t count = (size_t)t->width * (size_t)t->height, done = 0;
    while (done < count) {
        size_t n = count - done;
        bool run = false;
        if (t->packed) {
            if (t->at == t->end)
                return false;
            run = (*t->at & 0x80) != 0;
            size_t said = (size_t)(*t->at++ & 0x7F) + 1;
            n = said < n ? said : n;
        }
        if ((size_t)(t->end - t->at) < (run ? 1 : n) * (size_t)t->pixel_bytes)
            return false;
        for (size_t i = 0; i < n; i++) {
            if (!decode_pixel(t, t->at + (run ? 0 : i * (size_t)t->pixel_bytes), place(t, image, done + i)))
                return false;
        }
        t->at += (run ? 1 : n) * (size_t)t->pixel_bytes;
        done += n;
    }
    return true;
}

static bool read_header(const unsigned char *h, size_t size, struct tga *t)
{
    if (size < HEADER_BYTES)
        return false;
    *t = (struct tga){.kind = h[2] & ~PACKED,
                      .packed = h[2] & PACKED,
                      .width = (int)get16(h + 12),
                      .height = (int)get16(h + 14),
                      .pixel_bytes = (h[16] + 7) / 8,
                      .alpha_bits = h[17] & 15,
                      .from_right = h[17] & 0x10,
                      .from_top = h[17] & 0x20,
                      .palette_first = get16(h + 3),
                      .palette_count = get16(h + 5),
                      .palette_bits = h[7]};
    bool depth = t->kind == KIND_COLOR     ? h[16] == 15 || h[16] == 16 || h[16] == 24 || h[16] == 32
                 : t->kind == KIND_GREY    ? h[16] == 8
                 : t->kind == KIND_PALETTE ? h[16] == 8 || h[16] == 15 || h[16] == 16
                                           : false;
    bool map = h[1] == 1;
    if (!depth || h[1] > 1 || t->width < 1 || t->height < 1 || (t->kind == KIND_PALETTE && !map) ||
        (map && t->palette_bits != 15 && t->palette_bits != 16 && t->palette_bits != 24 &&
         t->palette_bits != 32))
        return false;
    size_t palette_bytes = map ? t->palette_count * ((size_t)(t->palette_bits + 7) / 8) : 0,
           skip = HEADER_BYTES + h[0];
    if (size < skip || size - skip < palette_bytes)
        return false;
    t->palette = h + skip;
    t->at = h + skip + palette_bytes;
    t->end = h + size;
    return true;
}

/* Alpha that is 0 everywhere was never meant. */
static void mend_alpha(struct sv_image *image)
{
    unsigned char *p = image->data, any = 0;
    size_t count = (size_t)image->width * (size_t)image->height;
    for (size_t i = 0; i < count; i++)
        any |= p[4 * i + 3];
    for (size_t i = 0; i < count && !any; i++)
        p[4 * i + 3] = 255;
}

static void drop_alpha(struct sv_image *image)
{
    unsigned char *p = image->data;
    size_t count = (size_t)image->width * (size_t)image->height;
    for (size_t i = 1; i < count; i++)
        memmove(p + 3 * i, p + 4 * i, 3);
    image->channels = 3;
}

enum sv_status sv_tga_decode(const void *bytes, size_t size, struct sv_image *image, struct sv_error *error)
{
    struct tga t;
    if (!read_header(bytes, size, &t))
        return sv_fail(error, SV_EFORMAT, "image", "tga: no header that makes sense");
    struct sv_image out;
    enum sv_status status = sv_image_check_claim(t.width, t.height, 4, 1, size, EXPANSION, error);
    if (status == SV_OK)
        status = sv_image_alloc(t.width, t.height, 4, SV_PIXEL_U8, &out, error);
    if (status != SV_OK)
        return status;
    if (!read_pixels(&t, &out)) {
        sv_image_free(&out);
        return sv_fail(error, SV_EFORMAT, "image", "tga: pixels are missing or outside of the palette");
    }
    bool alpha = t.kind == KIND_PALETTE
                     ? t.palette_bits == 32 || (t.palette_bits == 16 && t.alpha_bits == 1)
                     : t.kind == KIND_COLOR && ((t.pixel_bytes == 4 && t.alpha_bits == 8) ||
                                                (t.pixel_bytes == 2 && t.alpha_bits == 1));
    if (alpha)
        mend_alpha(&out);
    else
        drop_alpha(&out);
    *image = out;
    return SV_OK;
}
