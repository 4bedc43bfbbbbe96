/* prewarp_window.c - what of the plane the warped texture needs, which axis is better warped first, and the
 * order in which cells are drawn. */
#include <stdlib.h>

#include "core/relief/prewarp_private.h"

int sv_prewarp_order(int n, double e, bool outward, int32_t *order)
{
    int at = !(e >= 0) ? 0 : e >= n ? n - 1 : (int)e, k = 0;
    for (int i = 0; i < at; i++, k++)
        order[outward ? n - 1 - k : k] = i;
    for (int i = n - 1; i >= at; i--, k++)
        order[outward ? n - 1 - k : k] = i;
    return at;
}

/* Where texels' centres of one row land; u NaN: not drawn. */
static void warp_centres(const struct sv_relief *relief, const struct sv_prewarp *prewarp, int j,
                         double (*place)[2])
{
    for (int i = 0; i < relief->width; i++) {
        size_t t = (size_t)j * (size_t)relief->width + (size_t)i;
        place[i][0] = place[i][1] = NAN;
        if (sv_relief_solid(relief, t) &&
            !sv_prewarp_point(prewarp, i + 0.5, j + 0.5, relief->displ[t], &place[i][0], &place[i][1]))
            place[i][0] = NAN;
    }
}

/* Takes a whole texel in: half a texel to each side of its centre, magnified by 1 / tau. */
static void grow(const struct sv_prewarp *prewarp, const double place[2], double displ, double box[4])
{
    double half = 0.5 / (1 + prewarp->k[2] * displ);
    box[0] = fmin(box[0], place[0] - half);
    box[1] = fmin(box[1], place[1] - half);
    box[2] = fmax(box[2], place[0] + half);
    box[3] = fmax(box[3], place[1] + half);
}

/* How far along the first axis (in texels) the surface that one sample sees moves from one row to the next:
 * what crosses the axis, over how much the axis is stretched (a compressed one moves much). Within a texel
 * pass 2 draws a straight line between the two; beyond, it goes cell by cell. */
static double loss(const double here[2], const double along[2], const double across[2], int axis)
{
    if (isnan(here[0]) || isnan(along[0]) || isnan(across[0]))
        return 0;
    double shift = fabs(across[axis] - here[axis]), stretch = fabs(here[axis] - along[axis]);
    return shift < 4 * stretch ? shift / stretch : shift > 0 ? 4 : 0;
}

enum sv_status sv_prewarp_extent(const struct sv_relief *relief, const struct sv_prewarp *prewarp,
                                 struct sv_prewarp_extent *extent, struct sv_error *error)
{
    int w = relief->width, h = relief->height;
    double box[4] = {INFINITY, INFINITY, -INFINITY, -INFINITY}, lost[2] = {0, 0};
    double(*place)[2] = malloc(2 * (size_t)w * sizeof *place);
    if (!place)
        return sv_fail(error, SV_ENOMEM, "relief", "no memory for two rows of %d texels", w);
    for (int j = 0; j < h; j++) {
        double(*row)[2] = place + (j & 1) * (size_t)w, (*above)[2] = place + (~j & 1) * (size_t)w;
        warp_centres(relief, prewarp, j, row);
        for (int i = 0; i < w; i++) {
            if (isnan(row[i][0]))
                continue;
            grow(prewarp, row[i], relief->displ[(size_t)j * (size_t)w + (size_t)i], box);
            if (i == 0 || j == 0)
                continue;
            lost[0] += loss(row[i], row[i - 1], above[i], 0);
            lost[1] += loss(row[i], above[i], row[i - 1], 1);
        }
    }
    free(place);
    double lo_u = -1.5 * w, hi_u = 2.5 * w, lo_v = -1.5 * h, hi_v = 2.5 * h;
    *extent = (struct sv_prewarp_extent){floor(sv_clamp(box[0], lo_u, hi_u)),
                                         floor(sv_clamp(box[1], lo_v, hi_v)),
                                         ceil(sv_clamp(box[2], lo_u, hi_u)),
                                         ceil(sv_clamp(box[3], lo_v, hi_v)),
                                         lost[0],
                                         lost[1]};
    if (!(extent->u0 < extent->u1) || !(extent->v0 < extent->v1)) {
        extent->u0 = extent->v0 = 0;
        extent->u1 = w;
        extent->v1 = h;
    }
    return SV_OK;
}
