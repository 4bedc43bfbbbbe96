/* dxt.c - see dxt.h. */
#include "core/image/dxt.h"

#include <string.h>

#define STB_DXT_IMPLEMENTATION
#define STB_DXT_STATIC
#include <stb/stb_dxt.h>

size_t sv_dxt5_bytes(int width, int height)
{
    if (width < 1 || height < 1)
        return 0;
    return ((size_t)width + 3) / 4 * (((size_t)height + 3) / 4) * SV_DXT5_BYTES;
}

/* The 16 texels of the block whose corner is (x, y). */
static void gather(const uint8_t *rgba, int width, int height, int x, int y, uint8_t texels[64])
{
    for (int i = 0; i < 16; i++) {
        int column = x + i % 4 < width ? x + i % 4 : width - 1,
            row = y + i / 4 < height ? y + i / 4 : height - 1;
        memcpy(texels + 4 * i, rgba + 4 * ((size_t)row * (size_t)width + (size_t)column), 4);
    }
}

void sv_dxt5_encode(const uint8_t *rgba, int width, int height, uint8_t *blocks)
{
    for (int y = 0; y < height; y += 4)
        for (int x = 0; x < width; x += 4, blocks += SV_DXT5_BYTES) {
            uint8_t texels[64];
            gather(rgba, width, height, x, y, texels);
            stb_compress_dxt_block(blocks, texels, 1, STB_DXT_HIGHQUAL);
        }
}

static uint32_t get16(const uint8_t *p)
{
    return p[0] | (uint32_t)p[1] << 8;
}

static void expand565(uint32_t v, int rgb[3])
{
    int r = (int)(v >> 11), g = (int)(v >> 5 & 63), b = (int)(v & 31);
    rgb[0] = r << 3 | r >> 2, rgb[1] = g << 2 | g >> 4, rgb[2] = b << 3 | b >> 2;
}

/* The four colours between the ends; with three (DXT1, first not above second) the last is clear. */
static void palette(const uint8_t *p, bool may_be_three, uint8_t colors[4][4])
{
    int a[3], b[3];
    uint32_t first = get16(p), second = get16(p + 2);
    expand565(first, a);
    expand565(second, b);
    bool three = may_be_three && first <= second;
    for (int k = 0; k < 3; k++) {
        colors[0][k] = (uint8_t)a[k];
        colors[1][k] = (uint8_t)b[k];
        colors[2][k] = (uint8_t)(three ? (a[k] + b[k]) / 2 : (2 * a[k] + b[k]) / 3);
        colors[3][k] = (uint8_t)(three ? 0 : (a[k] + 2 * b[k]) / 3);
    }
    for (int k = 0; k < 4; k++)
        colors[k][3] = three && k == 3 ? 0 : 255;
}

void sv_dxt_block_color(const uint8_t block[8], bool may_be_three, uint8_t texels[16][4])
{
    uint8_t colors[4][4];
    palette(block, may_be_three, colors);
    uint32_t bits = get16(block + 4) | get16(block + 6) << 16;
    for (int i = 0; i < 16; i++, bits >>= 2)
        memcpy(texels[i], colors[bits & 3], 4);
}

void sv_dxt_block_alpha5(const uint8_t block[8], uint8_t alpha[16])
{
    int a[8] = {block[0], block[1]};
    for (int k = 2; k < 8; k++)
        a[k] = block[0] > block[1] ? ((8 - k) * block[0] + (k - 1) * block[1]) / 7
               : k < 6             ? ((6 - k) * block[0] + (k - 1) * block[1]) / 5
                                   : (k == 6 ? 0 : 255);
    uint64_t bits = 0;
    for (int k = 5; k >= 0; k--)
        bits = bits << 8 | block[2 + k];
    for (int i = 0; i < 16; i++, bits >>= 3)
        alpha[i] = (uint8_t)a[bits & 7];
}

void sv_dxt5_decode(const uint8_t *blocks, int width, int height, uint8_t *rgba)
{
    for (int y = 0; y < height; y += 4)
        for (int x = 0; x < width; x += 4, blocks += SV_DXT5_BYTES) {
            uint8_t texels[16][4], alpha[16];
            sv_dxt_block_color(blocks + 8, false, texels);
            sv_dxt_block_alpha5(blocks, alpha);
            for (int i = 0; i < 16; i++) {
                texels[i][3] = alpha[i];
                if (x + i % 4 < width && y + i / 4 < height)
                    memcpy(rgba + 4 * ((size_t)(y + i / 4) * (size_t)width + (size_t)(x + i % 4)), texels[i],
                           4);
            }
        }
}
