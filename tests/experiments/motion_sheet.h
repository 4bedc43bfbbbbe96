/* motion_sheet.h - contact sheets of a moving eye's pictures: cells in a grid, written as one PNG. Colour
 * pictures (u8, 4 channels) in, straight copies of their values out. Exits with a message when out of memory.
 */
#ifndef SV_TESTS_MOTION_SHEET_H
#define SV_TESTS_MOTION_SHEET_H

#include "core/base/image.h"

struct motion_sheet {
    struct sv_image image;
    int columns, cell_width, cell_height;
    int used; /* cells */
};

void motion_sheet_init(struct motion_sheet *sheet, int columns, int rows, int cell_width, int cell_height);
void motion_sheet_finish(struct motion_sheet *sheet);
/* The picture into the next cell, by the mean of the pixels that fall on each of the cell's. */
void motion_sheet_add(struct motion_sheet *sheet, const struct sv_image *picture);
/* A part of the picture into the next cell, enlarged without filter: the cell's middle shows (x, y). Held to
 * the picture. */
void motion_sheet_add_part(struct motion_sheet *sheet, const struct sv_image *picture, int x, int y,
                           int enlarged);
/* The same of the difference between two pictures of one size: grey for none, gain times the signed
 * difference. */
void motion_sheet_add_change(struct motion_sheet *sheet, const struct sv_image *a, const struct sv_image *b,
                             int x, int y, int enlarged, int gain);

#endif
