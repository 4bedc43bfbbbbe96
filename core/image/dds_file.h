/* dds_file.h - a DirectDraw surface with one level of DXT5: header of 128 bytes, then the blocks.
 *
 * What density textures are kept in (paper 2, 4.2: 768 x 512 = 393,216 bytes, and 128 of header: 393,344).
 * Reading takes exactly what writing gives; pictures of all kinds that models bring are read by dds.c.
 * Source: Microsoft, "DDS_HEADER". Any thread. */
#ifndef SV_IMAGE_DDS_FILE_H
#define SV_IMAGE_DDS_FILE_H

#include <stddef.h>
#include <stdint.h>

#include "core/base/error.h"

enum { SV_DDS_FILE_HEADER = 128, SV_DDS_FILE_SIDE_MAX = 16384 };

/* Bytes of a file; 0 for sides outside 1 .. SV_DDS_FILE_SIDE_MAX. */
size_t sv_dds_file_bytes(int width, int height);
/* Writes header and blocks (dxt.h) into file, of sv_dds_file_bytes. SV_EINVAL for sides out of range. */
SV_MUST_CHECK enum sv_status sv_dds_file_write(const uint8_t *blocks, int width, int height, uint8_t *file,
                                               struct sv_error *error);
/* Finds the blocks in a file that write gave: every field of the header and the size are checked, so any
 * bytes are legal input. *blocks points into file. SV_EFORMAT names what is off. */
SV_MUST_CHECK enum sv_status sv_dds_file_read(const void *file, size_t bytes, int *width, int *height,
                                              const uint8_t **blocks, struct sv_error *error);

#endif
