/* prewarp_columns.c - pass 2: what lies between two neighbouring rows, moved and resampled along the columns
 * by the v_i that pass 1 carried.
 *
 * In one column of samples everything lies in one plane through the eye. Where the column has one sample in
 * the upper row and one in the lower, both within a texel of each other along the row, and no torn cell
 * between, the two are ends of one piece of surface: nearly everywhere. All other columns - folds, surfaces
 * that end between the rows or on them, rows that have moved against each other - are drawn cell by cell:
 * the column enters and leaves each piece of a cell through its sides, and what lies between the two is drawn
 * like a piece between rows. Cells come in McMillan's order.
 */
#include <string.h>

#include "core/relief/prewarp_private.h"

/* An end of a piece in one column. */
struct end {
    double y, tau, displ;
    float color[3];
    float a, b; /* place in the patch, 0 .. 1 */
};

/* ---- between two rows ---- */

static void draw_between(const struct sv_prewarp_work *w, int x, const struct sv_prewarp_row *above,
                         const struct sv_prewarp_row *below)
{
    const struct sv_prewarp_sample *a = &above->samples[x], *b = &below->samples[x];
    struct sv_prewarp_span span;
    struct sv_warped *out = w->out;
    if (!sv_prewarp_span_init(&span, a->y, b->y, 1 + w->k3 * (double)a->displ, 1 + w->k3 * (double)b->displ,
                              w->out_height))
        return;
    size_t t0 = (size_t)a->texel * w->step_u + (size_t)above->j * w->step_v;
    size_t t1 = (size_t)b->texel * w->step_u + (size_t)below->j * w->step_v;
    for (int y = span.first; y < span.last; y++) {
        double r, s = sv_prewarp_span_at(&span, y, &r);
        size_t at = (size_t)x * w->out_step_x + (size_t)y * w->out_step_y;
        sv_prewarp_mix(a->color, b->color, s, out->color[at]);
        out->color[at][3] = 255;
        out->displ[at] = (float)((1 - s) * (double)a->displ + s * (double)b->displ);
        out->texel[at] = (uint32_t)(s < 0.5 ? t0 : t1);
    }
}

/* ---- cell by cell ---- */

/* Where the side from p to q of a patch, between its corners k and l, meets the column at x. Sides of two
 * patches are the same p and q: both are cut at the very same place. */
static bool meet(const struct sv_prewarp_vertex *p, const struct sv_prewarp_vertex *q, int k, int l, double x,
                 struct end *e)
{
    if ((p->x <= x) == (q->x <= x))
        return false;
    double r = sv_clamp((x - p->x) / (q->x - p->x), 0, 1);
    double s = r * p->tau / (q->tau * (1 - r) + p->tau * r);
    float t = (float)s;
    *e = (struct end){.y = p->y + r * (q->y - p->y),
                      .displ = (1 - s) * p->displ + s * q->displ,
                      .tau = (1 - s) * p->tau + s * q->tau,
                      .a = (float)(k & 1) + t * (float)((l & 1) - (k & 1)),
                      .b = (float)(k >> 1) + t * (float)((l >> 1) - (k >> 1))};
    for (int c = 0; c < 3; c++)
        e->color[c] = p->color[c] + t * (q->color[c] - p->color[c]);
    return true;
}

static void draw_piece(const struct sv_prewarp_work *w, int x, const struct sv_prewarp_patch *patch,
                       const struct end *p, const struct end *q)
{
    struct sv_prewarp_span span;
    struct sv_warped *out = w->out;
    if (!sv_prewarp_span_init(&span, p->y, q->y, p->tau, q->tau, w->out_height))
        return;
    for (int y = span.first; y < span.last; y++) {
        double r, share = sv_prewarp_span_at(&span, y, &r);
        float s = (float)share;
        size_t at = (size_t)x * w->out_step_x + (size_t)y * w->out_step_y;
        for (int c = 0; c < 3; c++)
            out->color[at][c] = (uint8_t)(p->color[c] + s * (q->color[c] - p->color[c]) + 0.5f);
        out->color[at][3] = 255;
        out->displ[at] = (float)((1 - share) * p->displ + share * q->displ);
        int right = p->a + s * (q->a - p->a) >= 0.5f, low = p->b + s * (q->b - p->b) >= 0.5f;
        out->texel[at] = (uint32_t)patch->texel[right + 2 * low];
    }
}

/* Columns whose centres the patch may cover; false: none. */
static bool columns_of(const struct sv_prewarp_work *w, const struct sv_prewarp_patch *p, int *first,
                       int *last)
{
    struct sv_prewarp_span span;
    double lo = fmin(fmin(p->v[0].x, p->v[1].x), fmin(p->v[2].x, p->v[3].x));
    double hi = fmax(fmax(p->v[0].x, p->v[1].x), fmax(p->v[2].x, p->v[3].x));
    if (!sv_prewarp_span_init(&span, lo, hi, 1, 1, w->out_width))
        return false;
    *first = span.first;
    *last = span.last;
    return true;
}

static void draw_patch(const struct sv_prewarp_work *w, const struct sv_prewarp_patch *patch)
{
    static const int8_t sides[4][2] = {{0, 1}, {1, 3}, {2, 3}, {0, 2}}; /* once around */
    int first, last;
    if (!columns_of(w, patch, &first, &last))
        return;
    for (int x = first; x < last; x++) {
        struct end ends[4];
        int count = 0;
        for (int k = 0; w->apart[x] && k < 4; k++) {
            int a = sides[k][0], b = sides[k][1];
            count += meet(&patch->v[a], &patch->v[b], a, b, x + 0.5, &ends[count]);
        }
        for (int k = 0; k + 1 < count; k += 2)
            draw_piece(w, x, patch, &ends[k], &ends[k + 1]);
    }
}

/* Two texels next to each other, both drawn, are one surface. */
static bool joined(const struct sv_prewarp_work *w, const struct sv_prewarp_vertex *a,
                   const struct sv_prewarp_vertex *b)
{
    return fabsf((float)a->displ - (float)b->displ) <= w->relief->cut; /* floats: as cells have it */
}

/* Cell i of the interval: the rows say it in fewer steps than sv_prewarp_cell_init does. */
static enum sv_prewarp_cells kind_of(const struct sv_prewarp_work *w, const struct sv_prewarp_row *above,
                                     const struct sv_prewarp_row *below, int i)
{
    const struct sv_prewarp_vertex *a = above ? above->texel + i : NULL, *b = below ? below->texel + i : NULL;
    bool before = i > 0, after = i < w->width;
    int drawn = (a && before && a[-1].tau > 0) + (a && after && a[0].tau > 0) +
                (b && before && b[-1].tau > 0) + (b && after && b[0].tau > 0);
    if (drawn < 4)
        return drawn ? SV_PREWARP_TORN : SV_PREWARP_EMPTY;
    return joined(w, a - 1, a) && joined(w, b - 1, b) && joined(w, a - 1, b - 1) && joined(w, a, b)
               ? SV_PREWARP_PLAIN
               : SV_PREWARP_TORN;
}

/* Marks the columns that the torn cells of interval j are seen in. Returns whether there are any. */
static bool mark_torn(const struct sv_prewarp_work *w, int j, const struct sv_prewarp_row *above,
                      const struct sv_prewarp_row *below)
{
    bool any = false;
    for (int i = 0; i <= w->width; i++) {
        struct sv_prewarp_cell cell;
        struct sv_prewarp_patch patches[SV_PREWARP_PATCHES];
        int first, last;
        w->cells[i] = (uint8_t)kind_of(w, above, below, i);
        if (w->cells[i] != SV_PREWARP_TORN)
            continue;
        sv_prewarp_cell_init(w, i, j, &cell);
        int count = sv_prewarp_cell_patches(w, &cell, patches);
        for (int k = 0; k < count; k++)
            if (columns_of(w, &patches[k], &first, &last)) {
                memset(w->apart + first, 1, (size_t)(last - first));
                any = true;
            }
    }
    return any;
}

/* Whether one of the marked columns may see the cell. */
static bool seen_apart(const struct sv_prewarp_work *w, const struct sv_prewarp_row *above,
                       const struct sv_prewarp_row *below, int i)
{
    int first, last;
    struct sv_prewarp_patch patch = {
        .v = {above->texel[i - 1], above->texel[i], below->texel[i - 1], below->texel[i]}};
    return columns_of(w, &patch, &first, &last) && memchr(w->apart + first, 1, (size_t)(last - first));
}

static void draw_cells(const struct sv_prewarp_work *w, int j, const struct sv_prewarp_row *above,
                       const struct sv_prewarp_row *below)
{
    for (int n = 0; n <= w->width; n++) {
        struct sv_prewarp_cell cell;
        struct sv_prewarp_patch patches[SV_PREWARP_PATCHES];
        int i = w->order_u[n];
        if (w->cells[i] == SV_PREWARP_EMPTY ||
            (w->cells[i] == SV_PREWARP_PLAIN && !seen_apart(w, above, below, i)))
            continue;
        sv_prewarp_cell_init(w, i, j, &cell);
        int count = sv_prewarp_cell_patches(w, &cell, patches);
        for (int k = 0; k < count; k++)
            draw_patch(w, &patches[k]);
    }
}

void sv_prewarp_warp_columns(const struct sv_prewarp_work *w, int j, const struct sv_prewarp_row *above,
                             const struct sv_prewarp_row *below)
{
    memset(w->apart, 0, (size_t)w->out_width);
    bool any = mark_torn(w, j, above, below);
    for (int x = 0; above && below && x < w->out_width; x++) {
        uint32_t a = above->count[x], b = below->count[x];
        if (w->apart[x] || (a == 0 && b == 0))
            continue;
        if (a == 1 && b == 1 && fabsf(above->samples[x].u - below->samples[x].u) <= 1)
            draw_between(w, x, above, below);
        else
            w->apart[x] = any = true;
    }
    if (any)
        draw_cells(w, j, above, below);
}
