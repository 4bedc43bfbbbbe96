/* dds_file.c - see dds_file.h. The header is 32 words, little-endian; those not in the table are 0. */
#include "core/image/dds_file.h"

#include <string.h>

#include "core/image/dxt.h"

enum { WORDS = SV_DDS_FILE_HEADER / 4 };
enum { WORD_HEIGHT = 3, WORD_WIDTH = 4, WORD_BYTES = 5 };

/* What every file of ours says; sides and size come from the picture. */
static const struct {
    const char *name;
    uint32_t value;
} FIXED[WORDS] = {
    [0] = {"magic", 0x20534444}, /* "DDS " */
    [1] = {"header size", 124},
    [2] = {"flags", 0x1 | 0x2 | 0x4 | 0x1000 | 0x80000}, /* caps, height, width, pixel format, linear size */
    [7] = {"mip count", 1},
    [19] = {"pixel format size", 32},
    [20] = {"pixel format flags", 0x4}, /* a four-character code */
    [21] = {"code", 0x35545844},        /* "DXT5" */
    [27] = {"caps", 0x1000},            /* a texture */
};

static void put32(uint8_t *p, uint32_t v)
{
    for (int k = 0; k < 4; k++)
        p[k] = (uint8_t)(v >> (8 * k));
}

static uint32_t get32(const uint8_t *p)
{
    return p[0] | (uint32_t)p[1] << 8 | (uint32_t)p[2] << 16 | (uint32_t)p[3] << 24;
}

size_t sv_dds_file_bytes(int width, int height)
{
    if (width < 1 || height < 1 || width > SV_DDS_FILE_SIDE_MAX || height > SV_DDS_FILE_SIDE_MAX)
        return 0;
    return SV_DDS_FILE_HEADER + sv_dxt5_bytes(width, height);
}

static uint32_t word(int k, uint32_t width, uint32_t height)
{
    switch (k) {
    case WORD_HEIGHT:
        return height;
    case WORD_WIDTH:
        return width;
    case WORD_BYTES:
        return (uint32_t)sv_dxt5_bytes((int)width, (int)height);
    }
    return FIXED[k].value;
}

enum sv_status sv_dds_file_write(const uint8_t *blocks, int width, int height, uint8_t *file,
                                 struct sv_error *error)
{
    size_t bytes = sv_dds_file_bytes(width, height);
    if (bytes == 0)
        return sv_fail(error, SV_EINVAL, "dds", "%d x %d: sides of 1 to %d are legal", width, height,
                       SV_DDS_FILE_SIDE_MAX);
    for (int k = 0; k < WORDS; k++)
        put32(file + 4 * k, word(k, (uint32_t)width, (uint32_t)height));
    memcpy(file + SV_DDS_FILE_HEADER, blocks, bytes - SV_DDS_FILE_HEADER);
    return SV_OK;
}

enum sv_status sv_dds_file_read(const void *file, size_t bytes, int *width, int *height,
                                const uint8_t **blocks, struct sv_error *error)
{
    const uint8_t *p = file;
    if (bytes < SV_DDS_FILE_HEADER)
        return sv_fail(error, SV_EFORMAT, "dds", "%zu bytes: a header has %d", bytes, SV_DDS_FILE_HEADER);
    uint32_t w = get32(p + 4 * WORD_WIDTH), h = get32(p + 4 * WORD_HEIGHT);
    if (w < 1 || h < 1 || w > SV_DDS_FILE_SIDE_MAX || h > SV_DDS_FILE_SIDE_MAX)
        return sv_fail(error, SV_EFORMAT, "dds", "%u x %u: sides of 1 to %d are legal", w, h,
                       SV_DDS_FILE_SIDE_MAX);
    for (int k = 0; k < WORDS; k++)
        if (get32(p + 4 * k) != word(k, w, h))
            return sv_fail(error, SV_EFORMAT, "dds", "word %d (%s) is 0x%x where 0x%x is expected", k,
                           FIXED[k].name ? FIXED[k].name : "reserved or size", get32(p + 4 * k),
                           word(k, w, h));
    size_t need = sv_dds_file_bytes((int)w, (int)h);
    if (bytes != need)
        return sv_fail(error, SV_EFORMAT, "dds", "%zu bytes where %u x %u take %zu", bytes, w, h, need);
    *width = (int)w;
    *height = (int)h;
    *blocks = p + SV_DDS_FILE_HEADER;
    return SV_OK;
}
