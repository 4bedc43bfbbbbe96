/* prewarp_columns.c - pass 2: what lies between two neighbouring rows, moved and resampled along the columns
 * by the v_i that pass 1 carried.
 *
 * In one column of samples everything lies in one plane through the eye. A sample of the upper row and one of
 * the lower are ends of one piece of surface when the texels that they stand for belong together: each finds
 * the one that is nearest to it along the row, and both must agree. What finds no partner is one side of a
 * fold that closes between the rows, or keeps half a texel of its own displ. The few pieces of one column and
 * one interval are drawn from far to near by their displ: on one ray, nearness and displ are the same order.
 */
#include <string.h>

#include "core/relief/prewarp_private.h"

/* A piece of surface in one column, from `from` at row `above` to `to` at row `below`. */
struct piece {
    struct sv_prewarp_sample from, to;
    double tau0, tau1;
    const struct sv_prewarp_row *row0, *row1; /* rows that the ends' texels are in */
};

/* Colour of a row at u, between texels of the surface that `texel` belongs to, seen from one side. */
static void row_color(const struct sv_prewarp_work *w, const struct sv_prewarp_row *row, int side, int texel,
                      double u, uint8_t color[3])
{
    int i = (int)sv_clamp(floor(u - 0.5), 0, w->width - 1), next = i + 1 < w->width ? i + 1 : i;
    double s = sv_clamp(u - 0.5 - i, 0, 1);
    i = row->run[side][i] == row->run[side][texel] ? i : texel;
    next = row->run[side][next] == row->run[side][texel] ? next : i;
    size_t at = (size_t)row->j * w->step_v;
    sv_prewarp_mix(w->color[at + (size_t)i * w->step_u], w->color[at + (size_t)next * w->step_u], s, color);
}

/* The colour on the way from one end to the other: of the texels that lie between, where the ends are more
 * than a texel apart along the row (the rows have moved against each other). */
static void color_on(const struct sv_prewarp_work *w, const struct piece *p, double s, uint8_t color[3])
{
    if (fabsf(p->to.u - p->from.u) <= 1) {
        sv_prewarp_mix(p->from.color, p->to.color, s, color);
        return;
    }
    uint8_t c0[3], c1[3];
    double u = (1 - s) * p->from.u + s * p->to.u;
    row_color(w, p->row0, 1, p->from.texel, u, c0);
    row_color(w, p->row1, 0, p->to.texel, u, c1);
    sv_prewarp_mix(c0, c1, s, color);
}

static void draw(const struct sv_prewarp_work *w, int x, const struct piece *p)
{
    struct sv_prewarp_span span;
    struct sv_warped *out = w->out;
    if (!sv_prewarp_span_init(&span, p->from.v, p->to.v, p->tau0, p->tau1, w->out_height))
        return;
    size_t t0 = (size_t)p->from.texel * w->step_u + (size_t)p->row0->j * w->step_v;
    size_t t1 = (size_t)p->to.texel * w->step_u + (size_t)p->row1->j * w->step_v;
    for (int y = span.first; y < span.last; y++) {
        double r, s = sv_prewarp_span_at(&span, y, &r);
        size_t at = (size_t)x * w->out_step_x + (size_t)y * w->out_step_y;
        color_on(w, p, s, out->color[at]);
        out->color[at][3] = 255;
        out->displ[at] = (float)((1 - s) * p->from.displ + s * p->to.displ);
        out->texel[at] = (uint32_t)(s < 0.5 ? t0 : t1);
    }
}

/* A sample of the upper row and one of the lower are one surface: one goes along the upper row, over a place
 * where the rows hold together, and along the lower one, no farther than the texels that they lie between. */
static bool joined(const struct sv_prewarp_work *w, const struct sv_prewarp_row *above,
                   const struct sv_prewarp_sample *a, const struct sv_prewarp_row *below,
                   const struct sv_prewarp_sample *b)
{
    int first = (int)floorf(fminf(a->u, b->u) - 0.5f), last = (int)floorf(fmaxf(a->u, b->u) - 0.5f) + 1;
    int32_t upper = above->run[1][a->texel], lower = below->run[0][b->texel];
    last = last < w->width ? last : w->width - 1;
    for (int c = first > 0 ? first : 0; c <= last; c++)
        if (above->run[1][c] == upper && below->run[0][c] == lower &&
            fabsf(above->displ[c] - below->displ[c]) <= w->relief->cut)
            return true;
    return false;
}

/* The samples of a row in column x that count on one side of it (0: above), far to near. */
static int kept(const struct sv_prewarp_work *w, const struct sv_prewarp_row *row, int x, int side,
                struct sv_prewarp_sample out[SV_PREWARP_LAYERS])
{
    uint32_t n = row ? row->count[x] : 0, first = n < SV_PREWARP_LAYERS ? 0 : n - SV_PREWARP_LAYERS;
    int count = 0;
    for (uint32_t k = first; k < n; k++) {
        size_t layer = k % SV_PREWARP_LAYERS;
        const struct sv_prewarp_sample *s = &row->samples[layer * (size_t)w->out_width + (size_t)x];
        if (s->sides >> side & 1)
            out[count++] = *s;
    }
    return count;
}

/* The partner of each sample of `from` among `to`: the nearest along the row; -1: none. */
static void choose(const struct sv_prewarp_work *w, const struct sv_prewarp_row *above, int na,
                   const struct sv_prewarp_sample *a, const struct sv_prewarp_row *below, int nb,
                   const struct sv_prewarp_sample *b, int *of_a, int *of_b)
{
    int best_a[SV_PREWARP_LAYERS], best_b[SV_PREWARP_LAYERS];
    for (int m = 0; m < na; m++)
        best_a[m] = INT32_MAX, of_a[m] = -1;
    for (int n = 0; n < nb; n++)
        best_b[n] = INT32_MAX, of_b[n] = -1;
    for (int m = 0; m < na; m++)
        for (int n = 0; n < nb; n++) {
            int apart = a[m].texel < b[n].texel ? b[n].texel - a[m].texel : a[m].texel - b[n].texel;
            if ((apart >= best_a[m] && apart >= best_b[n]) || !joined(w, above, &a[m], below, &b[n]))
                continue;
            if (apart < best_a[m])
                best_a[m] = apart, of_a[m] = n;
            if (apart < best_b[n])
                best_b[n] = apart, of_b[n] = m;
        }
}

/* Half a texel, from the sample to the border between the rows, at v = edge. */
static struct piece half(const struct sv_prewarp_work *w, const struct sv_prewarp_sample *a,
                         const struct sv_prewarp_row *row, int edge)
{
    struct piece p = {*a, *a, 1, 1, row, row};
    double tau = 1 + w->k3 * a->displ;
    p.to.v = ((edge + w->k2 * a->displ) / tau - w->v0) * w->scale_v; /* eq. 1, 3 */
    return p;
}

static struct piece whole(const struct sv_prewarp_work *w, const struct sv_prewarp_sample *a,
                          const struct sv_prewarp_row *above, const struct sv_prewarp_sample *b,
                          const struct sv_prewarp_row *below)
{
    return (struct piece){*a, *b, 1 + w->k3 * a->displ, 1 + w->k3 * b->displ, above, below};
}

static void insert(struct piece *pieces, int count, const struct piece *p, double toward)
{
    double key = toward * ((double)p->from.displ + p->to.displ);
    while (count > 0 && toward * ((double)pieces[count - 1].from.displ + pieces[count - 1].to.displ) > key) {
        pieces[count] = pieces[count - 1];
        count--;
    }
    pieces[count] = *p;
}

/* Two samples of one row that found no partner are the sides of a fold that closes before the next row, if
 * they are one surface and it goes on towards that row somewhere between them. */
static bool fold(const struct sv_prewarp_work *w, const struct sv_prewarp_row *row, int side,
                 const struct sv_prewarp_row *next, const struct sv_prewarp_sample *s,
                 const struct sv_prewarp_sample *t)
{
    if (!next || row->run[side][s->texel] != row->run[side][t->texel])
        return false;
    int first = s->texel < t->texel ? s->texel : t->texel, last = s->texel + t->texel - first;
    for (int c = first; c <= last; c++)
        if (next->run[!side][c] >= 0 && fabsf(row->displ[c] - next->displ[c]) <= w->relief->cut)
            return true;
    return false;
}

/* Pieces of what found no partner among one row's samples, on the side of the row `next`. */
static int add_rest(const struct sv_prewarp_work *w, const struct sv_prewarp_row *row, int side,
                    const struct sv_prewarp_row *next, const struct sv_prewarp_sample *s, const bool *paired,
                    int n, struct piece *pieces, int count)
{
    for (int m = 0; m < n; m++) {
        int to = m + 1;
        while (to < n && paired[to])
            to++;
        if (paired[m])
            continue;
        bool folds = to < n && fold(w, row, side, next, &s[m], &s[to]);
        struct piece p = folds ? whole(w, &s[m], row, &s[to], row) : half(w, &s[m], row, row->j + side);
        insert(pieces, count++, &p, w->toward);
        m = folds ? to : m;
    }
    return count;
}

static void draw_column(const struct sv_prewarp_work *w, int x, const struct sv_prewarp_row *above, int na,
                        const struct sv_prewarp_sample *a, const struct sv_prewarp_row *below, int nb,
                        const struct sv_prewarp_sample *b)
{
    struct piece pieces[2 * SV_PREWARP_LAYERS];
    int of_a[SV_PREWARP_LAYERS], of_b[SV_PREWARP_LAYERS], count = 0;
    bool paired_a[SV_PREWARP_LAYERS], paired_b[SV_PREWARP_LAYERS];
    choose(w, above, na, a, below, nb, b, of_a, of_b);
    for (int n = 0; n < nb; n++)
        paired_b[n] = of_b[n] >= 0 && of_a[of_b[n]] == n;
    for (int m = 0; m < na; m++) {
        paired_a[m] = of_a[m] >= 0 && of_b[of_a[m]] == m;
        if (paired_a[m]) {
            struct piece p = whole(w, &a[m], above, &b[of_a[m]], below);
            insert(pieces, count++, &p, w->toward);
        }
    }
    count = add_rest(w, above, 1, below, a, paired_a, na, pieces, count);
    count = add_rest(w, below, 0, above, b, paired_b, nb, pieces, count);
    for (int n = 0; n < count; n++)
        draw(w, x, &pieces[n]);
}

/* Where a row is torn as seen from above it and whole from below (or the other way), a step stands on the row
 * itself, inside one texel: it is closed. */
static void draw_steps(const struct sv_prewarp_work *w, int x, const struct sv_prewarp_row *row)
{
    struct sv_prewarp_sample up[SV_PREWARP_LAYERS], down[SV_PREWARP_LAYERS];
    int ups = kept(w, row, x, 0, up), downs = kept(w, row, x, 1, down);
    for (int m = 0; m < ups; m++)
        for (int n = 0; n < downs; n++) {
            if (up[m].sides == 3 || down[n].sides == 3 || up[m].texel != down[n].texel)
                continue;
            struct piece p = whole(w, &up[m], row, &down[n], row);
            draw(w, x, &p);
        }
}

void sv_prewarp_warp_columns(const struct sv_prewarp_work *w, const struct sv_prewarp_row *above,
                             const struct sv_prewarp_row *below)
{
    struct sv_prewarp_sample a[SV_PREWARP_LAYERS], b[SV_PREWARP_LAYERS];
    for (int x = 0; x < w->out_width; x++) {
        if (above && above->one_sided)
            draw_steps(w, x, above);
        int na = kept(w, above, x, 1, a), nb = kept(w, below, x, 0, b);
        if (na == 1 && nb == 1 && joined(w, above, a, below, b)) { /* nearly always */
            struct piece p = whole(w, a, above, b, below);
            draw(w, x, &p);
        } else if (na + nb > 0) {
            draw_column(w, x, above, na, a, below, nb, b);
        }
    }
}
