/* warp_cell.c - cells that are torn, bordered by nothing, large, or far from a parallelogram: drawn exactly.
 *
 * A full cell is two triangles. In any other cell each texel that is there covers its own quarter: to the
 * middle of the edge to each neighbour, at the mean of both where they are one surface, else at its own t
 * (the surface goes on flat for half a texel), and to the middle of the cell, at the mean of all texels that
 * hang together there. So pieces of one surface meet exactly, and what is torn is open by a wall between two
 * known segments: that wall is noted for warp_fill.c. Shared edges are computed from the same numbers on both
 * sides, and triangles are closed, so that no pixel centre falls between two. */
#include <math.h>

#include "core/relief/warp_kernel.h"

/* An edge's place where it crosses a row of pixel centres may be off by this (px): middles of edges are
 * rounded apart from the straight edge of the neighbour. */
#define RUN_SLACK (1.0 / 128)
/* SV_WARP_TWIST of a small patch: finer, for footprints are what silhouettes are made of. */
#define PATCH_TWIST (1.0 / 64)

/* Affine functions over the picture, from their values at a triangle's corners. */
struct basis {
    double x1, y1, x2, y2; /* edges from the first corner, over the determinant; 0 for a line */
};

struct plane {
    double value, by_x, by_y;
};

static struct basis basis_of(const struct sv_warp_corner c[3])
{
    double x1 = c[1].x - c[0].x, y1 = c[1].y - c[0].y, x2 = c[2].x - c[0].x, y2 = c[2].y - c[0].y;
    double det = x1 * y2 - x2 * y1;
    if (fabs(det) <= 1e-9 * (x1 * x1 + y1 * y1 + x2 * x2 + y2 * y2))
        return (struct basis){0, 0, 0, 0}; /* what holds at the first corner must do */
    double inverse = 1 / det;
    return (struct basis){x1 * inverse, y1 * inverse, x2 * inverse, y2 * inverse};
}

static struct plane plane_of(const struct basis *b, double f0, double f1, double f2)
{
    f1 -= f0;
    f2 -= f0;
    return (struct plane){f0, f1 * b->y2 - f2 * b->y1, f2 * b->x1 - f1 * b->x2};
}

static inline double least(double a, double b)
{
    return a < b ? a : b;
}

static inline double most(double a, double b)
{
    return a > b ? a : b;
}

/* An edge from its upper to its lower end: the same numbers whichever way it is given. */
struct edge {
    double y0, y1, x0, slope, x_min, x_max;
};

static struct edge edge_of(const struct sv_warp_corner *a, const struct sv_warp_corner *b)
{
    bool swap = b->y < a->y || (b->y == a->y && b->x < a->x);
    const struct sv_warp_corner *top = swap ? b : a, *end = swap ? a : b;
    double rise = end->y - top->y;
    return (struct edge){.y0 = top->y,
                         .y1 = end->y,
                         .x0 = top->x,
                         .slope = rise > 0 ? (end->x - top->x) / rise : 0,
                         .x_min = least(top->x, end->x),
                         .x_max = most(top->x, end->x)};
}

/* Widens [lo, hi] by where the edge meets the line y; a level edge is met all along. */
static inline void edge_meet(const struct edge *e, double y, double *lo, double *hi)
{
    if (y < e->y0 || y > e->y1)
        return;
    double x = e->x0 + (y - e->y0) * e->slope;
    bool level = e->y0 == e->y1;
    *lo = least(*lo, level ? e->x_min : x);
    *hi = most(*hi, level ? e->x_max : x);
}

static inline double min3(double a, double b, double c)
{
    return least(a, least(b, c));
}

static inline double max3(double a, double b, double c)
{
    return most(a, most(b, c));
}

int64_t sv_warp_triangle(const struct sv_warp_buffer *buffer, const struct sv_warp_corner c[3],
                         sv_warp_run_sink sink, void *context)
{
    double y_min = min3(c[0].y, c[1].y, c[2].y), y_max = max3(c[0].y, c[1].y, c[2].y);
    double x_min = min3(c[0].x, c[1].x, c[2].x), x_max = max3(c[0].x, c[1].x, c[2].x);
    double j0 = most(ceil(y_min - 0.5), buffer->first), j1 = least(floor(y_max - 0.5), buffer->end - 1);
    if (!(j0 <= j1) || !(most(x_min, 0) <= least(x_max, buffer->width)))
        return 0;
    struct edge edges[3] = {edge_of(&c[0], &c[1]), edge_of(&c[1], &c[2]), edge_of(&c[2], &c[0])};
    struct basis basis = basis_of(c);
    double w = 1 / c[0].inverse_w, q1 = c[1].inverse_w * w, q2 = c[2].inverse_w * w;
    struct plane d = plane_of(&basis, c[0].d, c[1].d, c[2].d), q = plane_of(&basis, 1, q1, q2);
    struct plane s = plane_of(&basis, c[0].s, c[1].s * q1, c[2].s * q2);
    struct plane r = plane_of(&basis, c[0].r, c[1].r * q1, c[2].r * q2);
    struct sv_warp_run run = {.d_min = (float)min3(c[0].d, c[1].d, c[2].d),
                              .d_max = (float)max3(c[0].d, c[1].d, c[2].d)};
    int64_t tested = 0;
    for (run.j = (int)j0; run.j <= (int)j1; run.j++) {
        double y = run.j + 0.5, lo = INFINITY, hi = -INFINITY;
        for (int k = 0; k < 3; k++)
            edge_meet(&edges[k], y, &lo, &hi);
        double i0 = most(ceil(lo - 0.5 - RUN_SLACK), 0);
        double i1 = least(floor(hi - 0.5 + RUN_SLACK), buffer->width - 1);
        tested += 1;
        if (!(i0 <= i1))
            continue;
        double dx = i0 + 0.5 - c[0].x, dy = y - c[0].y;
        run.i0 = (int)i0;
        run.i1 = (int)i1;
        run.d = (float)(d.value + dx * d.by_x + dy * d.by_y);
        run.q = (float)(q.value + dx * q.by_x + dy * q.by_y);
        run.sq = (float)(s.value + dx * s.by_x + dy * s.by_y);
        run.rq = (float)(r.value + dx * r.by_x + dy * r.by_y);
        run.d_step = (float)d.by_x;
        run.q_step = (float)q.by_x;
        run.sq_step = (float)s.by_x;
        run.rq_step = (float)r.by_x;
        tested += run.i1 - run.i0;
        sink(context, &run);
    }
    return tested;
}

/* Where fragments of one texel (or of a full cell, held by its first texel) go. */
struct piece {
    struct sv_warp_buffer *buffer;
    uint32_t texel, full, pixels;
    float s0, r0; /* place[] counts from here */
};

static void draw_run(void *context, const struct sv_warp_run *run)
{
    struct piece *piece = context;
    struct sv_warp_pixels to = sv_warp_pixels_of(piece->buffer);
    size_t p = (size_t)run->j * (size_t)piece->buffer->width + (size_t)run->i0;
    for (int k = 0; k <= run->i1 - run->i0; k++, p++) {
        float s, r, d = run->d + (float)k * run->d_step;
        d = d > run->d_min ? d : run->d_min;
        d = d < run->d_max ? d : run->d_max;
        if (d < to.depth[p])
            continue;
        sv_warp_run_place(run, k, &s, &r);
        piece->pixels +=
            sv_warp_put(to, p, d, piece->texel, sv_warp_place(s - piece->s0, r - piece->r0, piece->full));
    }
}

/* The four texels of a cell: 0, 1 above, 2, 3 below; texel k is at s = k & 1, r = k >> 1. */
struct cell {
    struct sv_warp_job *job;
    int column, row;
    double t[4], x[4], y[4], d[4];
    bool there[4],
        joined[4][2]; /* [k][0]: to the neighbour in its row, k ^ 1; [k][1]: in its column, k ^ 2 */
    unsigned set[4];  /* texels that k hangs together with, itself included */
    struct sv_warp_corner centre[4], edge[4][2], middle[4]; /* of texel k's surface */
    bool in_front[4];                                       /* all of texel k's corners are */
};

static void cell_load(struct sv_warp_job *job, const struct sv_warp_row *up, const struct sv_warp_row *lo,
                      int c, struct cell *cell)
{
    cell->job = job;
    cell->column = job->column + c;
    cell->row = job->row;
    for (int k = 0; k < 4; k++) {
        const struct sv_warp_row *row = k < 2 ? up : lo;
        int e = c + (k & 1);
        cell->t[k] = row->t[e];
        cell->x[k] = row->x[e];
        cell->y[k] = row->y[e];
        cell->d[k] = row->d[e];
        cell->there[k] = row->t[e] == row->t[e];
    }
    for (int k = 0; k < 4; k++)
        for (int way = 0; way < 2; way++) {
            float other = (float)cell->t[k ^ (1 << way)];
            cell->joined[k][way] = fabsf((float)cell->t[k] - other) <= job->source->cut;
        }
}

/* The corner at (s, r) of the cell at t; false when it is not in front of the eye. */
static bool corner_at(const struct cell *cell, double s, double r, double t, struct sv_warp_corner *corner)
{
    double h[4];
    for (int k = 0; k < 4; k++) {
        const double *m = cell->job->source->map.m[k];
        h[k] = m[0] * (cell->column + 0.5 + s) + m[1] * (cell->job->source->row0 + cell->row + 0.5 + r) +
               m[2] * t + m[3];
    }
    double inverse = 1 / h[3];
    *corner = (struct sv_warp_corner){
        h[0] * inverse, h[1] * inverse, least(most(h[2] * inverse, 0), 1), inverse, s, r};
    return h[3] > 0 && isfinite(inverse) && fabs(corner->x) <= SV_WARP_FAR_PX &&
           fabs(corner->y) <= SV_WARP_FAR_PX && isfinite(h[2] * inverse);
}

/* Texel k's centre: where the row has it, so that fast and exact cells meet. */
static bool corner_of_texel(struct cell *cell, int k)
{
    struct sv_warp_corner *corner = &cell->centre[k];
    bool in_front = corner_at(cell, k & 1, k >> 1, cell->t[k], corner);
    corner->x = cell->x[k];
    corner->y = cell->y[k];
    corner->d = cell->d[k];
    return in_front;
}

/* Middle of texel k's edge to its neighbour `way`, as texel k's surface has it: shared when joined. */
static bool corner_of_edge(struct cell *cell, int k, int way)
{
    int other = k ^ (1 << way);
    if (cell->joined[k][way] && other < k) {
        cell->edge[k][way] = cell->edge[other][way];
        return cell->in_front[other];
    }
    double t = cell->joined[k][way] ? 0.5 * (cell->t[k] + cell->t[other]) : cell->t[k];
    return corner_at(cell, way == 0 ? 0.5 : k & 1, way == 0 ? k >> 1 : 0.5, t, &cell->edge[k][way]);
}

/* The cell's middle is at the mean of the texels that k hangs together with, one place for them all. */
static bool corner_of_middle(struct cell *cell, int k)
{
    int first = __builtin_ctz(cell->set[k]);
    if (first < k) {
        cell->middle[k] = cell->middle[first];
        return cell->in_front[first];
    }
    double sum = 0;
    for (int i = 0; i < 4; i++)
        sum += cell->set[k] >> i & 1 ? cell->t[i] : 0;
    return corner_at(cell, 0.5, 0.5, sum / __builtin_popcount(cell->set[k]), &cell->middle[k]);
}

static void cell_corners(struct cell *cell)
{
    for (int k = 0; k < 4; k++)
        cell->set[k] = 1u << k;
    for (int pass = 0; pass < 3; pass++)
        for (int k = 0; k < 4; k++)
            for (int way = 0; way < 2; way++)
                cell->set[k] |= cell->joined[k][way] ? cell->set[k ^ (1 << way)] : 0;
    for (int k = 0; k < 4; k++)
        cell->in_front[k] = cell->there[k] && corner_of_texel(cell, k) && corner_of_edge(cell, k, 0) &&
                            corner_of_edge(cell, k, 1) && corner_of_middle(cell, k);
}

/* Whether the box of four corners holds a pixel centre that is drawn. */
static bool box_shows(const struct sv_warp_buffer *buffer, const struct sv_warp_corner c[4], int box[4])
{
    double x0 = least(min3(c[0].x, c[1].x, c[2].x), c[3].x), x1 = most(max3(c[0].x, c[1].x, c[2].x), c[3].x);
    double y0 = least(min3(c[0].y, c[1].y, c[2].y), c[3].y), y1 = most(max3(c[0].y, c[1].y, c[2].y), c[3].y);
    double i0 = most(ceil(x0 - 0.5 - RUN_SLACK), 0);
    double i1 = least(floor(x1 - 0.5 + RUN_SLACK), buffer->width - 1);
    double j0 = most(ceil(y0 - 0.5), 0), j1 = least(floor(y1 - 0.5), buffer->height - 1);
    if (!(i0 <= i1 && j0 <= j1))
        return false;
    box[0] = (int)i0;
    box[1] = (int)j0;
    box[2] = (int)i1 + 1;
    box[3] = (int)j1 + 1;
    return box[1] < buffer->end && box[3] > buffer->first;
}

/* The patch as a parallelogram, when it is small and nearly one: as the kernels draw fast cells, with an edge
 * that allows for middles of edges being rounded apart. False, with nothing drawn, when it is not. */
static bool patch_small(const struct sv_warp_corner c[4], const int box[4], struct piece *piece)
{
    double e1x = c[1].x - c[0].x, e1y = c[1].y - c[0].y, e2x = c[3].x - c[0].x, e2y = c[3].y - c[0].y;
    double e3x = c[2].x - c[0].x, e3y = c[2].y - c[0].y, det = e1x * e2y - e1y * e2x;
    double size = (fabs(e1x) + fabs(e2x)) * (fabs(e1y) + fabs(e2y)), scale = 1 / det;
    double ax = e2y * scale, ay = -e2x * scale, bx = -e1y * scale, by = e1x * scale;
    double a3 = e3x * ax + e3y * ay, b3 = e3x * bx + e3y * by;
    if (box[2] - box[0] > SV_WARP_SMALL || box[3] - box[1] > SV_WARP_SMALL ||
        !(fabs(det) >= size * SV_WARP_SLIVER) || !(fabs(a3 - 1) <= PATCH_TWIST) ||
        !(fabs(b3 - 1) <= PATCH_TWIST))
        return false;
    double a_edge = RUN_SLACK * (fabs(ax) + fabs(ay)), b_edge = RUN_SLACK * (fabs(bx) + fabs(by));
    double a_max = most(a3, 1) + a_edge, b_max = most(b3, 1) + b_edge;
    double d_min = least(min3(c[0].d, c[1].d, c[2].d), c[3].d);
    double d_max = most(max3(c[0].d, c[1].d, c[2].d), c[3].d), d1 = c[1].d - c[0].d, d2 = c[3].d - c[0].d;
    struct sv_warp_pixels to = sv_warp_pixels_of(piece->buffer);
    int first = box[1] > piece->buffer->first ? box[1] : piece->buffer->first;
    for (int j = first; j < box[3] && j < piece->buffer->end; j++)
        for (int i = box[0]; i < box[2]; i++) {
            double x = i + 0.5 - c[0].x, y = j + 0.5 - c[0].y, a = x * ax + y * ay, b = x * bx + y * by;
            if (!(a >= -a_edge && a <= a_max && b >= -b_edge && b <= b_max))
                continue;
            size_t p = (size_t)j * (size_t)piece->buffer->width + (size_t)i;
            float d = (float)least(most(c[0].d + a * d1 + b * d2, d_min), d_max);
            float s = (float)(c[0].s + a * (c[1].s - c[0].s) + b * (c[3].s - c[0].s));
            float r = (float)(c[0].r + a * (c[1].r - c[0].r) + b * (c[3].r - c[0].r));
            uint32_t at = sv_warp_place(s - piece->s0, r - piece->r0, piece->full);
            piece->pixels += sv_warp_put(to, p, d, piece->texel, at);
        }
    return true;
}

/* Draws the patch with corners in order around it. */
static void patch_draw(struct cell *cell, const struct sv_warp_corner c[4], struct piece *piece)
{
    struct sv_warp_job *job = cell->job;
    int box[4];
    if (job->budget <= 0 || !box_shows(job->buffer, c, box))
        return;
    sv_warp_touch(job->buffer, box[0], box[1], box[2], box[3]);
    if (!patch_small(c, box, piece)) {
        struct sv_warp_corner other[3] = {c[0], c[2], c[3]};
        job->budget -= sv_warp_triangle(job->buffer, c, draw_run, piece);
        job->budget -= sv_warp_triangle(job->buffer, other, draw_run, piece);
    }
    job->pixels += piece->pixels;
}

static uint32_t texel_of(const struct cell *cell, int k)
{
    const struct sv_warp_job *job = cell->job;
    return job->tag0 + (uint32_t)(cell->column - job->column + (k & 1)) +
           (uint32_t)(k >> 1) * (uint32_t)job->source->width;
}

static void draw_full(struct cell *cell)
{
    static const int around[4] = {0, 1, 3, 2};
    struct sv_warp_corner c[4];
    struct piece piece = {.buffer = cell->job->buffer, .texel = texel_of(cell, 0), .full = 1};
    for (int k = 0; k < 4; k++) {
        if (!corner_of_texel(cell, around[k]))
            return;
        c[k] = cell->centre[around[k]];
    }
    patch_draw(cell, c, &piece);
}

static void draw_quarter(struct cell *cell, int k)
{
    struct sv_warp_corner c[4] = {cell->centre[k], cell->edge[k][0], cell->middle[k], cell->edge[k][1]};
    struct piece piece = {.buffer = cell->job->buffer,
                          .texel = texel_of(cell, k),
                          .s0 = (float)(k & 1) - 0.5f,
                          .r0 = (float)(k >> 1) - 0.5f};
    patch_draw(cell, c, &piece);
}

/* Notes the wall that opens between texel k and its neighbour `way` inside of this cell. */
static void note_tear(struct cell *cell, int k, int way)
{
    int other = k ^ (1 << way), far = cell->d[other] < cell->d[k] ? other : k, near = far ^ (1 << way);
    struct sv_warp_corner c[4] = {cell->edge[far][way], cell->middle[far], cell->middle[near],
                                  cell->edge[near][way]};
    int box[4];
    if (!box_shows(cell->job->buffer, c, box))
        return;
    struct sv_warp_tear tear = {.texel = texel_of(cell, far)};
    for (int i = 0; i < 4; i++) {
        tear.x[i] = (float)c[i].x;
        tear.y[i] = (float)c[i].y;
    }
    for (int i = 0; i < 2; i++) {
        tear.s[i] = (float)(c[i].s - (far & 1) + 0.5);
        tear.r[i] = (float)(c[i].r - (far >> 1) + 0.5);
    }
    sv_warp_tear_add(cell->job->buffer, &tear);
}

void sv_warp_cell(struct sv_warp_job *job, const struct sv_warp_row *upper, const struct sv_warp_row *lower,
                  int c)
{
    struct cell cell;
    cell_load(job, upper, lower, c, &cell);
    if (cell.joined[0][0] && cell.joined[0][1] && cell.joined[3][0] && cell.joined[3][1]) {
        draw_full(&cell);
        return;
    }
    cell_corners(&cell);
    for (int k = 0; k < 4; k++)
        if (cell.in_front[k])
            draw_quarter(&cell, k);
    for (int k = 0; k < 4; k += 3)
        for (int way = 0; way < 2; way++) {
            int other = k ^ (1 << way);
            if (cell.in_front[k] && cell.in_front[other] && !cell.joined[k][way])
                note_tear(&cell, k, way);
        }
}
