/* dds.c - DirectDraw surfaces (.dds): the top level of DXT1, DXT3, DXT5 (BC1 to BC3) and of plain 16 to 32
 * bit colour.
 *
 * After Microsoft's "DDS_HEADER" and "Block Compression" pages. Games' trees bring such textures;
 * OpenImageIO 2.4.7 hangs and crashes on broken ones (found by fuzzing). Cube maps give their first face;
 * volumes, floats and one- or two-channel blocks are refused. */
#include "core/image/private.h"

#include <stdlib.h>
#include <string.h>

#include "core/image/dxt.h"

enum {
    HEADER_BYTES = 128,
    DX10_BYTES = 20,
    FLAG_ALPHA = 1,
    FLAG_FOUR_CC = 4,
    FLAG_GREY = 0x20000,
    EXPANSION = 8, /* DXT1: half a byte a texel of 4 */
};

struct dds {
    const unsigned char *pixels;
    size_t size;
    int width, height;
    int block_bytes;   /* 8 or 16; 0: plain */
    bool dxt3, dxt5;   /* how the alpha of a block of 16 bytes is coded */
    int pixel_bytes;   /* plain */
    uint32_t masks[4]; /* plain: R, G, B, A */
};

static uint32_t get16(const unsigned char *p)
{
    return p[0] | (uint32_t)p[1] << 8;
}
static uint32_t get32(const unsigned char *p)
{
    return get16(p) | get16(p + 2) << 16;
}

static void decode_block(const struct dds *d, const unsigned char *p, unsigned char texels[16][4])
{
    unsigned char alpha[16];
    sv_dxt_block_color(p + d->block_bytes - 8, d->block_bytes == 8, texels);
    if (d->dxt5)
        sv_dxt_block_alpha5(p, alpha);
    for (int i = 0; i < 16; i++) {
        if (d->dxt3)
            texels[i][3] = (unsigned char)((p[i / 2] >> (i % 2 * 4) & 15) * 17);
        if (d->dxt5)
            texels[i][3] = alpha[i];
    }
}

static void read_blocks(const struct dds *d, struct sv_image *image)
{
    int columns = (d->width + 3) / 4;
    for (int y = 0; y < d->height; y += 4)
        for (int x = 0; x < d->width; x += 4) {
            unsigned char texels[16][4];
            decode_block(
                d, d->pixels + ((size_t)(y / 4) * (size_t)columns + (size_t)(x / 4)) * (size_t)d->block_bytes,
                texels);
            for (int i = 0; i < 16; i++)
                if (x + i % 4 < d->width && y + i / 4 < d->height)
                    memcpy((unsigned char *)image->data +
                               4 * ((size_t)(y + i / 4) * (size_t)d->width + (size_t)(x + i % 4)),
                           texels[i], 4);
        }
}

/* The bits of a mask, stretched to 0..255; 255 for no mask. */
static unsigned char masked(uint32_t v, uint32_t mask)
{
    if (mask == 0)
        return 255;
    int shift = 0;
    while (!(mask >> shift & 1))
        shift++;
    uint64_t top = mask >> shift;
    return (unsigned char)(((v & mask) >> shift) * UINT64_C(255) / top);
}

static void read_plain(const struct dds *d, struct sv_image *image)
{
    size_t count = (size_t)d->width * (size_t)d->height;
    unsigned char *to = image->data;
    for (size_t i = 0; i < count; i++, to += 4) {
        uint32_t v = 0;
        for (int k = d->pixel_bytes - 1; k >= 0; k--)
            v = v << 8 | d->pixels[i * (size_t)d->pixel_bytes + (size_t)k];
        for (int k = 0; k < 4; k++)
            to[k] = masked(v, d->masks[k]);
    }
}

/* The code of a block format: "DXT1" ... or DXGI's number; false when it is none of ours. */
static bool set_blocks(struct dds *d, uint32_t code)
{
    static const struct {
        uint32_t code;
        int bytes;
        bool dxt3, dxt5;
    } kinds[] = {
        {0x31545844, 8, false, false}, {71, 8, false, false},         {72, 8, false, false},
        {0x33545844, 16, true, false}, {74, 16, true, false},         {75, 16, true, false},
        {0x32545844, 16, true, false}, {0x35545844, 16, false, true}, {0x34545844, 16, false, true},
        {77, 16, false, true},         {78, 16, false, true},
    };
    for (size_t i = 0; i < sizeof kinds / sizeof *kinds; i++)
        if (kinds[i].code == code) {
            d->block_bytes = kinds[i].bytes;
            d->dxt3 = kinds[i].dxt3;
            d->dxt5 = kinds[i].dxt5;
            return true;
        }
    return false;
}

static void set_plain(struct dds *d, int bytes, uint32_t r, uint32_t g, uint32_t b, uint32_t a)
{
    d->pixel_bytes = bytes;
    d->masks[0] = r, d->masks[1] = g, d->masks[2] = b, d->masks[3] = a;
}

static bool set_dx10(struct dds *d, uint32_t format)
{
    if (format == 28 || format == 29)
        set_plain(d, 4, 0xFF, 0xFF00, 0xFF0000, 0xFF000000);
    else if (format == 87 || format == 91)
        set_plain(d, 4, 0xFF0000, 0xFF00, 0xFF, 0xFF000000);
    else
        return set_blocks(d, format);
    return true;
}

static bool read_header(const unsigned char *h, size_t size, struct dds *d)
{
    if (size < HEADER_BYTES || memcmp(h, "DDS ", 4) != 0 || get32(h + 4) != 124 || get32(h + 76) != 32)
        return false;
    uint32_t width = get32(h + 16), height = get32(h + 12), flags = get32(h + 80), code = get32(h + 84);
    *d = (struct dds){.pixels = h + HEADER_BYTES, .size = size - HEADER_BYTES};
    if (width < 1 || height < 1 || width > INT32_MAX || height > INT32_MAX)
        return false;
    d->width = (int)width, d->height = (int)height;
    if (flags & FLAG_FOUR_CC && code == 0x30315844) { /* "DX10" */
        if (d->size < DX10_BYTES || !set_dx10(d, get32(h + HEADER_BYTES)))
            return false;
        d->pixels += DX10_BYTES, d->size -= DX10_BYTES;
        return true;
    }
    if (flags & FLAG_FOUR_CC)
        return set_blocks(d, code);
    uint32_t bits = get32(h + 88);
    if (bits != 8 && bits != 16 && bits != 24 && bits != 32)
        return false;
    uint32_t red = get32(h + 92), alpha = flags & FLAG_ALPHA ? get32(h + 104) : 0;
    bool grey = flags & FLAG_GREY;
    set_plain(d, (int)bits / 8, red, grey ? red : get32(h + 96), grey ? red : get32(h + 100), alpha);
    return true;
}

enum sv_status sv_dds_decode(const void *bytes, size_t size, struct sv_image *image, struct sv_error *error)
{
    struct dds d;
    if (!read_header(bytes, size, &d))
        return sv_fail(error, SV_EFORMAT, "image", "dds: not 16 to 32 bit colour, nor DXT1 to DXT5");
    enum sv_status status = sv_image_check_claim(d.width, d.height, 4, 1, size, EXPANSION, error);
    if (status != SV_OK)
        return status;
    size_t need = d.block_bytes
                      ? (size_t)((d.width + 3) / 4) * (size_t)((d.height + 3) / 4) * (size_t)d.block_bytes
                      : (size_t)d.width * (size_t)d.height * (size_t)d.pixel_bytes;
    if (d.size < need)
        return sv_fail(error, SV_EFORMAT, "image", "dds: %zu bytes of pixels where %d x %d need %zu", d.size,
                       d.width, d.height, need);
    struct sv_image out;
    status = sv_image_alloc(d.width, d.height, 4, SV_PIXEL_U8, &out, error);
    if (status != SV_OK)
        return status;
    if (d.block_bytes)
        read_blocks(&d, &out);
    else
        read_plain(&d, &out);
    *image = out;
    return SV_OK;
}
