/* dxt.h - S3TC blocks: DXT5 (BC3) written by stb_dxt, and DXT1 to DXT5 blocks read by code of our own.
 *
 * A block is 4 x 4 texels: in DXT5 8 bytes of alpha (two ends, 3 bits a texel between them), then 8 bytes of
 * colour (two 5:6:5 ends, 2 bits a texel between them), so the three colour channels of a block lie on one
 * line of their space. Pictures are rows of blocks, row 0 at the top; one whose sides are no multiples of 4
 * is continued by its last column and row. The only file that knows stb is dxt.c. Any thread. Source:
 * Microsoft, "Block Compression". */
#ifndef SV_IMAGE_DXT_H
#define SV_IMAGE_DXT_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

enum { SV_DXT_SIDE = 4, SV_DXT5_BYTES = 16 };

/* Bytes that a picture takes in DXT5; 0 for sides below 1. */
size_t sv_dxt5_bytes(int width, int height);
/* rgba: width x height x 4, sides >= 1; blocks: sv_dxt5_bytes. Deterministic. */
void sv_dxt5_encode(const uint8_t *rgba, int width, int height, uint8_t *blocks);
/* The other way; any bytes are legal blocks. */
void sv_dxt5_decode(const uint8_t *blocks, int width, int height, uint8_t *rgba);

/* The parts of a block, each of 8 bytes. colour: texels' R, G, B, and alpha 255, or 0 where may_be_three
 * (DXT1 alone has blocks of three colours) finds the clear one. alpha5: the alpha of DXT5. */
void sv_dxt_block_color(const uint8_t block[8], bool may_be_three, uint8_t texels[16][4]);
void sv_dxt_block_alpha5(const uint8_t block[8], uint8_t alpha[16]);

#endif
