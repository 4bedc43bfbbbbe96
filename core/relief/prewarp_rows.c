/* prewarp_rows.c - pass 1: one row of texels, moved and resampled along the row by u_i, carrying v_i.
 *
 * Between the centres of adjacent texels of one surface the surface is straight; its picture is straight,
 * too, so v_i is linear in u_i between the v_i of the ORIGINAL texels, exactly, while colour and displ go by
 * the share in space (perspective-correct). Of several samples that land in one column the last one is kept
 * and all are counted: what hides another in a row need not do so once columns have moved (the fold that a
 * single intermediate picture loses), so that pass 2 draws such columns cell by cell, as it does where the
 * surface ends. */
#include <string.h>

#include "core/relief/prewarp_private.h"

static const uint8_t *color_of(const struct sv_prewarp_work *w, int i, int j)
{
    return w->color[(size_t)i * w->step_u + (size_t)j * w->step_v];
}

/* The surface from the centre of texel i - 1 to that of texel i. */
static void put_pair(const struct sv_prewarp_work *w, struct sv_prewarp_row *row, int i)
{
    struct sv_prewarp_span span;
    const struct sv_prewarp_vertex *p = &row->texel[i - 1], *q = &row->texel[i];
    const uint8_t *a = color_of(w, i - 1, row->j), *b = color_of(w, i, row->j);
    if (!sv_prewarp_span_init(&span, p->x, q->x, p->tau, q->tau, w->out_width))
        return;
    for (int x = span.first; x < span.last; x++) {
        double r, s = sv_prewarp_span_at(&span, x, &r);
        struct sv_prewarp_sample *sample = &row->samples[x];
        row->count[x]++;
        sample->y = p->y + r * (q->y - p->y);
        sample->displ = (float)((1 - s) * p->displ + s * q->displ);
        sample->u = (float)(i - 0.5 + s);
        sample->texel = s < 0.5 ? i - 1 : i;
        sv_prewarp_mix(a, b, s, sample->color);
    }
}

struct sv_prewarp_vertex sv_prewarp_place(const struct sv_prewarp_work *w, double u, double v, double displ)
{
    double tau = 1 + w->k3 * displ;
    return (struct sv_prewarp_vertex){.x = ((u + w->k1 * displ) / tau - w->u0) * w->scale_u, /* eq. 1, 3 */
                                      .y = ((v + w->k2 * displ) / tau - w->v0) * w->scale_v, /* eq. 1, 3 */
                                      .tau = tau,
                                      .displ = displ};
}

void sv_prewarp_warp_row(const struct sv_prewarp_work *w, int j, struct sv_prewarp_row *row)
{
    row->j = j;
    memset(row->count, 0, (size_t)w->out_width * sizeof *row->count);
    for (int i = 0; i < w->width; i++) {
        size_t t = (size_t)i * w->step_u + (size_t)j * w->step_v;
        row->texel[i] = sv_prewarp_drawn(w, t)
                            ? sv_prewarp_place(w, i + 0.5, j + 0.5, (double)w->relief->displ[t])
                            : (struct sv_prewarp_vertex){0};
    }
    for (int k = 0; k <= w->width; k++) {
        int i = w->order_u[k];
        size_t t = (size_t)i * w->step_u + (size_t)j * w->step_v;
        if (i > 0 && i < w->width && sv_prewarp_same(w, t - w->step_u, t))
            put_pair(w, row, i);
    }
}
