/* object_lookup.c - see object_lookup.h: the scalar kernel. */
#include "core/relief/object_lookup.h"

#include <stddef.h>

/* Share of the light that passes at (x, y): four comparisons of depth, bilinear. Outside of the map all of
 * it. */
static float passes(const struct sv_relief_lookup *map, float x, float y, float d)
{
    if (!(x >= 0 && y >= 0 && x < (float)(map->width - 1) && y < (float)(map->height - 1)))
        return 1;
    int i = (int)x, j = (int)y;
    float fx = x - (float)i, fy = y - (float)j;
    const float *p = map->depth + (size_t)j * (size_t)map->width + (size_t)i, *q = p + map->width;
    float upper = (d >= p[0] ? 1 - fx : 0) + (d >= p[1] ? fx : 0);
    float lower = (d >= q[0] ? 1 - fx : 0) + (d >= q[1] ? fx : 0);
    return upper + (lower - upper) * fy;
}

static uint8_t look_up(const struct sv_relief_lookup *lookup, const struct sv_relief_lookup_sheet *sheet,
                       size_t texel, int column, int row)
{
    float n[3] = {sheet->normal[0][texel], sheet->normal[1][texel], sheet->normal[2][texel]}, at[3], share;
    float u = (float)column + 0.5f, v = (float)row + 0.5f, h = sheet->displ[texel];
    if (sheet->color[texel][3] < 128 ||
        !((n[0] * lookup->sun[0] + n[1] * lookup->sun[1]) + n[2] * lookup->sun[2] > 0))
        return 0;
    for (int k = 0; k < 3; k++) {
        const float *m = lookup->at[k], *o = lookup->offset[k];
        at[k] = (((m[3] + m[1] * v) + m[0] * u) + m[2] * h) + ((o[0] * n[0] + o[1] * n[1]) + o[2] * n[2]);
    }
    share = passes(lookup, at[0], at[1], at[2]);
    if (sheet->incoming && sheet->incoming[texel] - h > lookup->low &&
        sheet->incoming[texel] - h < lookup->high)
        share = 0;
    return (uint8_t)(255 * share + 0.5f);
}

void sv_relief_lookup_scalar(const struct sv_relief_lookup *lookup,
                             const struct sv_relief_lookup_sheet *sheet, const struct sv_relief_eight *list,
                             int count)
{
    for (int k = 0; k < count; k++) {
        int end = list[k].column + 8 < sheet->width ? list[k].column + 8 : sheet->width;
        for (int i = list[k].column; i < end; i++) {
            size_t texel = (size_t)list[k].row * (size_t)sheet->width + (size_t)i;
            sheet->lit[texel] = look_up(lookup, sheet, texel, i, list[k].row);
        }
    }
}
