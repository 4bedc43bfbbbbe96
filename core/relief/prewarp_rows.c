/* prewarp_rows.c - pass 1: one row of texels, moved and resampled along the row by u_i, carrying v_i.
 *
 * Between the centres of adjacent texels of one surface the surface is straight; its picture is straight,
 * too, so v_i is linear in u_i between the v_i of the ORIGINAL texels, exactly, while colour and displ go by
 * the share in space (perspective-correct). A torn end keeps half a texel of its own displ: isolated texels
 * are squares. Texels that are torn from each other in their row may be one surface by way of the row above
 * or below; then they are, for what lies on that side of the row. Intervals between centres come in
 * McMillan's order (prewarp.h), so that later samples of a column are nearer; all of them are kept, since
 * what hides another in a row need not do so once columns have moved (the fold that a single intermediate
 * picture loses). */
#include <string.h>

#include "core/relief/prewarp_private.h"

static void put(struct sv_prewarp_row *row, size_t width, int x, const struct sv_prewarp_sample *sample)
{
    uint32_t n = row->count[x]++;
    row->samples[(size_t)(n % SV_PREWARP_LAYERS) * width + (size_t)x] = *sample;
}

static const uint8_t *color_of(const struct sv_prewarp_work *w, int i, int j)
{
    return w->color[(size_t)i * w->step_u + (size_t)j * w->step_v];
}

/* Texel i from its centre to its border at u = edge. */
static void put_half(const struct sv_prewarp_work *w, struct sv_prewarp_row *row, int i, int edge,
                     unsigned sides)
{
    struct sv_prewarp_span span;
    double border = ((edge + w->k1 * row->displ[i]) / row->tau[i] - w->u0) * w->scale_u; /* eq. 1, 3 */
    if (!sv_prewarp_span_init(&span, row->u[i], border, 1, 1, w->out_width))
        return;
    struct sv_prewarp_sample sample = {row->v[i], row->displ[i], i + 0.5f, i, {0}, (uint8_t)sides};
    memcpy(sample.color, color_of(w, i, row->j), 3);
    for (int x = span.first; x < span.last; x++)
        put(row, (size_t)w->out_width, x, &sample);
}

/* The surface from the centre of texel i - 1 to that of texel i. */
static void put_pair(const struct sv_prewarp_work *w, struct sv_prewarp_row *row, int i, unsigned sides)
{
    struct sv_prewarp_span span;
    const uint8_t *a = color_of(w, i - 1, row->j), *b = color_of(w, i, row->j);
    if (!sv_prewarp_span_init(&span, row->u[i - 1], row->u[i], row->tau[i - 1], row->tau[i], w->out_width))
        return;
    for (int x = span.first; x < span.last; x++) {
        struct sv_prewarp_sample sample = {.sides = (uint8_t)sides};
        double r, s = sv_prewarp_span_at(&span, x, &r);
        sample.v = row->v[i - 1] + r * (row->v[i] - row->v[i - 1]);
        sample.displ = (float)((1 - s) * row->displ[i - 1] + s * row->displ[i]);
        sample.u = (float)(i - 0.5 + s);
        sample.texel = s < 0.5 ? i - 1 : i;
        sv_prewarp_mix(a, b, s, sample.color);
        put(row, (size_t)w->out_width, x, &sample);
    }
}

/* Texels i - 1 and i of row j are one surface by way of the row `by`. */
static bool joined_by(const struct sv_prewarp_work *w, int i, int j, int by)
{
    size_t t = (size_t)i * w->step_u + (size_t)j * w->step_v;
    size_t s = (size_t)i * w->step_u + (size_t)by * w->step_v, pair[2] = {t - w->step_u, t};
    return sv_prewarp_joined_by(w, pair, by >= 0 && by < w->height, s - w->step_u, s);
}

static void place_texels(const struct sv_prewarp_work *w, struct sv_prewarp_row *row)
{
    double vs = row->j + 0.5;
    for (int i = 0; i < w->width; i++) {
        size_t t = (size_t)i * w->step_u + (size_t)row->j * w->step_v;
        double d = w->relief->displ[t], tau = 1 + w->k3 * d;
        row->run[0][i] = row->run[1][i] = -1;
        if (!sv_prewarp_drawn(w, t))
            continue;
        row->u[i] = ((i + 0.5 + w->k1 * d) / tau - w->u0) * w->scale_u; /* eq. 1, 3 */
        row->v[i] = ((vs + w->k2 * d) / tau - w->v0) * w->scale_v;      /* eq. 1, 3 */
        row->tau[i] = tau;
        row->displ[i] = (float)d;
        bool next = i > 0 && row->run[0][i - 1] >= 0;
        bool direct = next && fabsf(row->displ[i] - row->displ[i - 1]) <= w->relief->cut;
        for (int side = 0; side < 2; side++)
            row->run[side][i] = direct || (next && joined_by(w, i, row->j, row->j + 2 * side - 1))
                                    ? row->run[side][i - 1]
                                    : i;
    }
}

void sv_prewarp_warp_row(const struct sv_prewarp_work *w, int j, struct sv_prewarp_row *row)
{
    row->j = j;
    row->one_sided = false;
    memset(row->count, 0, (size_t)w->out_width * sizeof *row->count);
    place_texels(w, row);
    for (int k = 0; k <= w->width; k++) {
        int i = w->order_u[k];
        bool left = i > 0 && row->run[0][i - 1] >= 0, right = i < w->width && row->run[0][i] >= 0;
        unsigned whole = 0;
        for (int side = 0; side < 2 && left && right; side++)
            whole |= row->run[side][i] == row->run[side][i - 1] ? 1u << side : 0;
        row->one_sided |= whole == 1 || whole == 2;
        if (whole)
            put_pair(w, row, i, whole);
        if (whole == 3)
            continue;
        /* the half that does not hold the epipole is the farther one */
        bool right_first = w->epipole_u < i;
        if (right && right_first)
            put_half(w, row, i, i, 3 & ~whole);
        if (left)
            put_half(w, row, i - 1, i, 3 & ~whole);
        if (right && !right_first)
            put_half(w, row, i, i, 3 & ~whole);
    }
}
