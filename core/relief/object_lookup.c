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

void sv_relief_lookup_scalar(const struct sv_relief_lookup *lookup, const struct sv_relief_lookup_row *row,
                             int from)
{
    for (int i = from; i < row->n; i++) {
        float n[3] = {row->normal[0][i], row->normal[1][i], row->normal[2][i]}, at[3], share;
        float u = (float)i + 0.5f, v = (float)row->row + 0.5f, h = row->displ[i];
        row->lit[i] = 0;
        if (row->color[i][3] < 128 ||
            !((n[0] * lookup->sun[0] + n[1] * lookup->sun[1]) + n[2] * lookup->sun[2] > 0))
            continue;
        for (int k = 0; k < 3; k++) {
            const float *m = lookup->at[k], *o = lookup->offset[k];
            at[k] = (((m[3] + m[1] * v) + m[0] * u) + m[2] * h) + ((o[0] * n[0] + o[1] * n[1]) + o[2] * n[2]);
        }
        share = passes(lookup, at[0], at[1], at[2]);
        if (row->incoming && row->incoming[i] - h > lookup->low && row->incoming[i] - h < lookup->high)
            share = 0;
        row->lit[i] = (uint8_t)(255 * share + 0.5f);
    }
}
