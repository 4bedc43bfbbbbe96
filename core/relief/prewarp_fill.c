/* prewarp_fill.c - disocclusions of the two-pass warp: found, counted, filled from the far side.
 *
 * On a torn edge between two texels stands a wall, from the displ of one to that of the other. Seen so that
 * its two ends come apart (its nearer end has moved away from its farther one), it opens on what the relief
 * does not know: samples inside its picture where no texel landed are holes. Walls whose ends close over each
 * other are hidden by the surface itself. A hole takes colour, displ and texel of the wall's far end, and
 * where several walls are seen through one sample the nearest decides: walls come in McMillan's order, later
 * ones overwrite. A wall is a flat rectangle, so its picture has straight sides, and one loop along the axis
 * that it is torn along fills it.
 *
 * Walls are as long as whole texels while surfaces slope between centres: a sample that is left out between
 * a wall and its surface is closed when three of its four neighbours are there, one of them a hole. */
#include <stdlib.h>
#include <string.h>

#include "core/relief/prewarp_private.h"

/* The picture of a wall: from p0 (r = 0) to p1 (r = 1) along the axis that it is torn along, between lo and
 * hi across. */
struct wall {
    double p0, p1, lo0, lo1, hi0, hi1;
    size_t step_p, step_q;
    int samples_p, samples_q;
    size_t far_texel;
};

struct filler {
    const struct sv_prewarp_work *w;
    uint8_t *hole; /* one byte a sample, as the samples of the result */
    uint32_t holes;
    bool fill;
};

static void copy_texel(const struct filler *f, size_t texel, size_t at)
{
    struct sv_warped *out = f->w->out;
    memcpy(out->color[at], f->w->color[texel], 3);
    out->color[at][3] = 255;
    out->displ[at] = f->w->relief->displ[texel];
    out->texel[at] = (uint32_t)texel;
}

static void draw_wall(struct filler *f, const struct wall *wall)
{
    struct sv_prewarp_span along, across;
    if (!sv_prewarp_span_init(&along, wall->p0, wall->p1, 1, 1, wall->samples_p))
        return;
    for (int p = along.first; p < along.last; p++) {
        double r = sv_prewarp_span_at(&along, p, &r);
        double lo = wall->lo0 + r * (wall->lo1 - wall->lo0), hi = wall->hi0 + r * (wall->hi1 - wall->hi0);
        if (!sv_prewarp_span_init(&across, lo, hi, 1, 1, wall->samples_q))
            continue;
        for (int q = across.first; q < across.last; q++) {
            size_t at = (size_t)p * wall->step_p + (size_t)q * wall->step_q;
            if (f->w->out->color[at][3] && !f->hole[at])
                continue;
            f->holes += !f->hole[at];
            f->hole[at] = 1;
            if (f->fill)
                copy_texel(f, wall->far_texel, at);
        }
    }
}

static bool drawn(const struct sv_prewarp_work *w, size_t texel, double *displ, double *tau)
{
    *displ = w->relief->displ[texel];
    *tau = 1 + w->k3 * *displ;
    return sv_relief_solid(w->relief, texel) && *tau > w->near;
}

/* The wall between texel `t` and the one before it, along the first (second) axis. */
static void try_wall(struct filler *f, int i, int j, bool second)
{
    const struct sv_prewarp_work *w = f->w;
    double d[2], tau[2], pu[2][2], pv[2][2];
    size_t t = (size_t)i * w->step_u + (size_t)j * w->step_v, before = t - (second ? w->step_v : w->step_u);
    if (!drawn(w, before, &d[0], &tau[0]) || !drawn(w, t, &d[1], &tau[1]) ||
        fabsf((float)d[1] - (float)d[0]) <= w->relief->cut)
        return;
    for (int e = 0; e < 2; e++)
        for (int k = 0; k < 2; k++) {
            pu[k][e] = ((i + (second ? k : 0) + w->k1 * d[e]) / tau[e] - w->u0) * w->scale_u; /* eq. 1, 3 */
            pv[k][e] = ((j + (second ? 0 : k) + w->k2 * d[e]) / tau[e] - w->v0) * w->scale_v; /* eq. 1, 3 */
        }
    size_t far_texel = w->toward * (d[1] - d[0]) > 0 ? before : t;
    struct wall along_u = {pu[0][0],      pu[0][1],      pv[0][0],     pv[0][1],      pv[1][0], pv[1][1],
                           w->out_step_x, w->out_step_y, w->out_width, w->out_height, far_texel};
    struct wall along_v = {pv[0][0],      pv[0][1],      pu[0][0],      pu[0][1],     pu[1][0], pu[1][1],
                           w->out_step_y, w->out_step_x, w->out_height, w->out_width, far_texel};
    const struct wall *wall = second ? &along_v : &along_u;
    if (wall->p0 < wall->p1)
        draw_wall(f, wall);
}

static void close_cracks(struct filler *f)
{
    struct sv_warped *out = f->w->out;
    size_t width = (size_t)out->width;
    for (int y = 1; y + 1 < out->height; y++)
        for (size_t x = 1; x + 1 < width; x++) {
            size_t at = (size_t)y * width + x, near[4] = {at - 1, at + 1, at - width, at + width};
            int there = 0, holes = 0;
            size_t far_texel = SV_WARPED_NONE;
            if (out->color[at][3] || f->hole[at])
                continue;
            for (int k = 0; k < 4; k++) {
                bool landed = out->color[near[k]][3] != 0;
                there += landed || f->hole[near[k]];
                holes += f->hole[near[k]] == 1;
                if (landed &&
                    (far_texel == SV_WARPED_NONE ||
                     f->w->toward * ((double)out->displ[near[k]] - f->w->relief->displ[far_texel]) < 0))
                    far_texel = out->texel[near[k]];
            }
            if (there < 3 || holes == 0)
                continue;
            f->hole[at] = 2;
            f->holes++;
            if (f->fill && far_texel != SV_WARPED_NONE)
                copy_texel(f, far_texel, at);
        }
}

enum sv_status sv_prewarp_fill(const struct sv_prewarp_work *work, bool fill, struct sv_error *error)
{
    const struct sv_prewarp_work *w = work;
    if (isinf(w->relief->cut))
        return SV_OK;
    size_t samples = (size_t)w->out->width * (size_t)w->out->height;
    struct filler f = {.w = w, .hole = calloc(samples, 1), .fill = fill};
    int32_t *order_v = malloc((size_t)w->height * sizeof *order_v);
    if (!f.hole || !order_v) {
        free(f.hole);
        free(order_v);
        return sv_fail(error, SV_ENOMEM, "options", "no memory to find holes in %zu samples", samples);
    }
    (void)sv_prewarp_order(w->height, w->epipole_v, order_v);
    for (int n = 0; n < w->height; n++)
        for (int m = 0; m <= w->width; m++) {
            int j = order_v[n], i = w->order_u[m];
            if (i > 0 && i < w->width)
                try_wall(&f, i, j, false);
            if (j > 0 && i < w->width)
                try_wall(&f, i, j, true);
        }
    if (f.holes > 0)
        close_cracks(&f);
    w->out->holes = f.holes;
    w->out->holes_left = fill ? 0 : f.holes;
    free(f.hole);
    free(order_v);
    return SV_OK;
}
