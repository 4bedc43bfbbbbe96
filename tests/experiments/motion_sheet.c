#include "tests/experiments/motion_sheet.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum { GAP_PX = 4 };

void motion_sheet_init(struct motion_sheet *sheet, int columns, int rows, int cell_width, int cell_height)
{
    struct sv_error error = {0};
    *sheet = (struct motion_sheet){.columns = columns, .cell_width = cell_width, .cell_height = cell_height};
    if (sv_image_alloc(columns * (cell_width + GAP_PX), rows * (cell_height + GAP_PX), 4, SV_PIXEL_U8,
                       &sheet->image, &error)) {
        fprintf(stderr, "sheet: %s\n", error.message);
        exit(1);
    }
    memset(sheet->image.data, 255, (size_t)sheet->image.width * (size_t)sheet->image.height * 4);
}

void motion_sheet_finish(struct motion_sheet *sheet)
{
    sv_image_free(&sheet->image);
}

static const uint8_t *pixel(const struct sv_image *image, int x, int y)
{
    return (const uint8_t *)image->data + 4 * ((size_t)y * (size_t)image->width + (size_t)x);
}

/* The next cell's first pixel; NULL when the sheet is full. */
static uint8_t *next_cell(struct motion_sheet *sheet)
{
    int x = sheet->used % sheet->columns * (sheet->cell_width + GAP_PX);
    int y = sheet->used / sheet->columns * (sheet->cell_height + GAP_PX);
    if (y >= sheet->image.height)
        return NULL;
    sheet->used++;
    return (uint8_t *)sheet->image.data + 4 * ((size_t)y * (size_t)sheet->image.width + (size_t)x);
}

static int clamp(int v, int lo, int hi)
{
    return v < lo ? lo : v > hi ? hi : v;
}

void motion_sheet_add(struct motion_sheet *sheet, const struct sv_image *picture)
{
    uint8_t *cell = next_cell(sheet);
    for (int j = 0; cell && j < sheet->cell_height; j++)
        for (int i = 0; i < sheet->cell_width; i++) {
            int x0 = i * picture->width / sheet->cell_width, y0 = j * picture->height / sheet->cell_height;
            int x1 = clamp((i + 1) * picture->width / sheet->cell_width, x0 + 1, picture->width);
            int y1 = clamp((j + 1) * picture->height / sheet->cell_height, y0 + 1, picture->height);
            int sum[3] = {0}, count = (x1 - x0) * (y1 - y0);
            for (int y = y0; y < y1; y++)
                for (int x = x0; x < x1; x++)
                    for (int c = 0; c < 3; c++)
                        sum[c] += pixel(picture, x, y)[c];
            for (int c = 0; c < 3; c++)
                cell[4 * ((size_t)j * (size_t)sheet->image.width + (size_t)i) + (size_t)c] =
                    (uint8_t)(sum[c] / count);
        }
}

void motion_sheet_add_part(struct motion_sheet *sheet, const struct sv_image *picture, int x, int y,
                           int enlarged)
{
    motion_sheet_add_change(sheet, NULL, picture, x, y, enlarged, 1);
}

void motion_sheet_add_change(struct motion_sheet *sheet, const struct sv_image *a, const struct sv_image *b,
                             int x, int y, int enlarged, int gain)
{
    uint8_t *cell = next_cell(sheet);
    int width = sheet->cell_width / enlarged, height = sheet->cell_height / enlarged;
    int x0 = clamp(x - width / 2, 0, clamp(b->width - width, 0, b->width));
    int y0 = clamp(y - height / 2, 0, clamp(b->height - height, 0, b->height));
    for (int j = 0; cell && j < sheet->cell_height; j++)
        for (int i = 0; i < sheet->cell_width; i++) {
            int px = x0 + i / enlarged, py = y0 + j / enlarged;
            if (px >= b->width || py >= b->height)
                continue;
            uint8_t *out = cell + 4 * ((size_t)j * (size_t)sheet->image.width + (size_t)i);
            const uint8_t *q = pixel(b, px, py), *p = a ? pixel(a, px, py) : NULL;
            for (int c = 0; c < 3; c++)
                out[c] = p ? (uint8_t)clamp(128 + gain * (q[c] - p[c]), 0, 255) : q[c];
        }
}
