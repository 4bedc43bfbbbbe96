/* soften.c - see soften.h: rows are decoded as they come; the last three, along the columns, then along the
 * row. Lanes are those of pixels, {r, g, b, a} each, so that compilers make vectors of the loops. */
#include "core/view/soften.h"

#include <stdbool.h>
#include <stdlib.h>
#include <string.h>

#include "core/base/color.h"

/* Linear light and coverage of a row, and whether it shows anything. */
static bool decode(int width, const uint8_t (*from)[4], float *to)
{
    unsigned any = 0;
    for (int i = 0; i < width; i++) {
        const uint8_t *p = from[i];
        any |= p[3];
        for (int c = 0; c < 3; c++)
            to[4 * i + c] = sv_linear_from_srgb8[p[c]];
        to[4 * i + 3] = (float)p[3] * (1.0f / 255);
    }
    return any;
}

/* Means of a column's three rows, with a pixel more on either side. */
static void along_columns(int width, float side, const float *above, const float *row, const float *below, float *out)
{
    for (int k = 0; k < 4 * width; k++)
        out[4 + k] = (1 - 2 * side) * row[k] + side * (above[k] + below[k]);
    memcpy(out, out + 4, 4 * sizeof *out);
    memcpy(out + 4 * (width + 1), out + 4 * width, 4 * sizeof *out);
}

static void along_row(int width, float side, const float *in, float (*light)[4])
{
    float *out = light[0];
    for (int k = 0; k < 4 * width; k++)
        out[k] = (1 - 2 * side) * in[4 + k] + side * (in[k] + in[8 + k]);
    for (int i = 0; i < width; i++)
        light[i][3] = 1 - light[i][3];
}

static void clear(int width, float (*light)[4])
{
    for (int i = 0; i < width; i++) {
        light[i][0] = light[i][1] = light[i][2] = 0;
        light[i][3] = 1;
    }
}

enum sv_status sv_soften(int width, int rows, float side, const uint8_t (*layer)[4], float (*light)[4],
                         struct sv_error *error)
{
    size_t columns = 4 * (size_t)width;
    float *room = malloc((3 * columns + columns + 8) * sizeof *room), *mean = room + 3 * columns;
    if (!room)
        return sv_fail(error, SV_ENOMEM, NULL, "no memory for rows of %d pixels", width);
    bool shows[3] = {false, false, false}; /* row j is in slot j % 3 */
    for (int j = 0; j <= rows; j++) {
        if (j < rows)
            shows[j % 3] = decode(width, layer + (size_t)j * (size_t)width, room + j % 3 * columns);
        if (j == 0)
            continue;
        int row = j - 1, above = row > 0 ? row - 1 : row, below = j < rows ? j : row;
        float(*out)[4] = light + (size_t)row * (size_t)width;
        if (shows[above % 3] || shows[row % 3] || shows[below % 3]) {
            along_columns(width, side, room + above % 3 * columns, room + row % 3 * columns,
                          room + below % 3 * columns, mean);
            along_row(width, side, mean, out);
        } else {
            clear(width, out);
        }
    }
    free(room);
    return SV_OK;
}
