/* prewarp_fill.c - disocclusions of the two-pass warp: found, counted, filled from the far side.
 *
 * On a torn edge between two texels stands a wall, from the displ of one to that of the other; its rims are
 * where the quarters on either side end (prewarp_cells.c). Seen so that its two rims come apart (the nearer
 * one has moved away from the farther one), it opens on what the relief does not know: samples inside its
 * picture where no texel landed are holes. Walls whose rims close over each other are hidden by the surface
 * itself. A hole takes colour, displ and texel of the wall's far rim, and where several walls are seen
 * through one sample the nearest decides: walls come in McMillan's order, later ones overwrite.
 *
 * Rounding may leave a sample out between a wall and its surface: it is closed when three of its four
 * neighbours are there, one of them a hole. */
#include <stdlib.h>
#include <string.h>

#include "core/relief/prewarp_private.h"

/* A wall's picture: p along the axis that it is torn along, q across; rim 0 belongs to the texel before. */
struct wall {
    double p[2][2], q[2][2];
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

static void mark(struct filler *f, size_t at, size_t far_texel)
{
    if (f->w->out->color[at][3] && !f->hole[at])
        return;
    f->holes += !f->hole[at];
    f->hole[at] = 1;
    if (f->fill)
        copy_texel(f, far_texel, at);
}

/* Where the line through two corners is at q. */
static double edge_at(const double a[2], const double b[2], double q)
{
    return a[0] + sv_clamp((q - a[1]) / (b[1] - a[1]), 0, 1) * (b[0] - a[0]);
}

/* A triangle of corners (p, q), row by row; corners need no order. */
static void draw_triangle(struct filler *f, const struct wall *wall, const double *a, const double *b,
                          const double *c)
{
    const double *low = a[1] < b[1] ? a : b, *high = a[1] < b[1] ? b : a, *middle = c;
    if (c[1] < low[1])
        middle = low, low = c;
    else if (c[1] > high[1])
        middle = high, high = c;
    struct sv_prewarp_span rows, row;
    if (!sv_prewarp_span_init(&rows, low[1], high[1], 1, 1, wall->samples_q))
        return;
    for (int y = rows.first; y < rows.last; y++) {
        double q = y + 0.5, p0 = edge_at(low, high, q);
        double p1 = q < middle[1] ? edge_at(low, middle, q) : edge_at(middle, high, q);
        if (!sv_prewarp_span_init(&row, p0, p1, 1, 1, wall->samples_p))
            continue;
        for (int x = row.first; x < row.last; x++)
            mark(f, (size_t)x * wall->step_p + (size_t)y * wall->step_q, wall->far_texel);
    }
}

/* Twice the area; positive where rim 1 lies behind rim 0 along p. */
static double opening(const double *a, const double *b, const double *c)
{
    return (b[1] - a[1]) * (c[0] - a[0]) - (b[0] - a[0]) * (c[1] - a[1]);
}

static void draw_wall(struct filler *f, const struct wall *w)
{
    double corner[4][2];
    for (int m = 0; m < 4; m++) {
        corner[m][0] = w->p[m >> 1][m & 1];
        corner[m][1] = w->q[m >> 1][m & 1];
    }
    if (opening(corner[0], corner[1], corner[3]) > 0)
        draw_triangle(f, w, corner[0], corner[1], corner[3]);
    if (opening(corner[0], corner[3], corner[2]) > 0)
        draw_triangle(f, w, corner[0], corner[3], corner[2]);
}

/* The wall in a cell between the quarters of corners o and o ^ way (1: next to each other along the first
 * axis, 2: along the second), when they are two surfaces: from the cell's side to its middle. */
static void try_wall(struct filler *f, const struct sv_prewarp_cell *cell, int o, int way)
{
    const struct sv_prewarp_work *w = f->w;
    int corner[2] = {o, o ^ way};
    if (cell->part[o] < 0 || cell->part[o ^ way] < 0 || cell->part[o] == cell->part[o ^ way])
        return;
    bool second = way == 2;
    struct wall wall = {.step_p = second ? w->out_step_y : w->out_step_x,
                        .step_q = second ? w->out_step_x : w->out_step_y,
                        .samples_p = second ? w->out_height : w->out_width,
                        .samples_q = second ? w->out_width : w->out_height};
    double displ[2];
    for (int rim = 0; rim < 2; rim++) {
        struct sv_prewarp_vertex at[2] = {sv_prewarp_quarter(w, cell, corner[rim], (enum sv_prewarp_spot)way),
                                          sv_prewarp_quarter(w, cell, corner[rim], SV_PREWARP_MIDDLE)};
        displ[rim] = at[0].displ + at[1].displ;
        for (int k = 0; k < 2; k++) {
            /* across, the wall runs from low to high: its middle is the end of the halves before it */
            int to = o & (3 ^ way) ? 1 - k : k;
            wall.p[rim][to] = second ? at[k].y : at[k].x;
            wall.q[rim][to] = second ? at[k].x : at[k].y;
        }
    }
    wall.far_texel = cell->texel[corner[w->toward * (displ[1] - displ[0]) > 0 ? 0 : 1]];
    draw_wall(f, &wall);
}

/* No wall stands in a cell whose neighbours differ by less than cut, drawn or not: most cells. */
static bool level_enough(const struct sv_prewarp_work *w, int i, int j)
{
    if (i < 1 || j < 1 || i >= w->width || j >= w->height)
        return false;
    const float *d = w->relief->displ + (size_t)i * w->step_u + (size_t)j * w->step_v, *up = d - w->step_v;
    const float cut = w->relief->cut, *left = d - w->step_u, *corner = up - w->step_u;
    return fabsf(*d - *up) <= cut && fabsf(*d - *left) <= cut && fabsf(*corner - *up) <= cut &&
           fabsf(*corner - *left) <= cut;
}

static void try_walls(struct filler *f, int i, int j)
{
    struct sv_prewarp_cell cell;
    if (level_enough(f->w, i, j))
        return;
    sv_prewarp_cell_init(f->w, i, j, &cell);
    for (int k = 0; k < 2 && !cell.plain; k++) {
        try_wall(f, &cell, 2 * k, 1);
        try_wall(f, &cell, k, 2);
    }
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
    int32_t *order_v = malloc(((size_t)w->height + 1) * sizeof *order_v);
    if (!f.hole || !order_v) {
        free(f.hole);
        free(order_v);
        return sv_fail(error, SV_ENOMEM, "options", "no memory to find holes in %zu samples", samples);
    }
    (void)sv_prewarp_order(w->height + 1, w->epipole_v + 0.5, w->outward, order_v);
    for (int n = 0; n <= w->height; n++)
        for (int m = 0; m <= w->width; m++)
            try_walls(&f, w->order_u[m], order_v[n]);
    if (f.holes > 0)
        close_cracks(&f);
    w->out->holes = f.holes;
    w->out->holes_left = fill ? 0 : f.holes;
    free(f.hole);
    free(order_v);
    return SV_OK;
}
