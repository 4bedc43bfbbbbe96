/* prewarp_private.h - what the files of the two-pass warp share. Private to core/relief/prewarp_*.c.
 *
 * "First axis" is the one that pass 1 runs along, "second" the other; u and v below mean these two. Which of
 * them is the relief's u is told by the steps alone. */
#ifndef SV_RELIEF_PREWARP_PRIVATE_H
#define SV_RELIEF_PREWARP_PRIVATE_H

#include "core/relief/prewarp.h"

struct sv_prewarp_work {
    const struct sv_relief *relief;
    const uint8_t (*color)[4];
    int width, height;     /* texels along the first and the second axis */
    size_t step_u, step_v; /* texel (i, j) is element i step_u + j step_v of the relief */
    double k1, k2, k3;     /* k4, k5 and 0 for parallel projection */
    double near;           /* smallest tau */
    double toward;         /* +1: larger displ is nearer to the eye, -1: smaller */
    int32_t *order_u;      /* sv_prewarp_order of the width + 1 intervals between texel centres */
    int split_v;           /* the interval between rows that holds the epipole, 0 .. height */
    double epipole_u, epipole_v;
    int out_width, out_height; /* samples along the first and the second axis */
    size_t out_step_x, out_step_y;
    double u0, v0, scale_u, scale_v; /* sample position of u: (u - u0) scale_u; centres at + 0.5 */
    struct sv_warped *out;
};

/* The rectangle of whole texels that is drawn, and how much is lost when pass 1 runs along either axis (a
 * sum over texels; prewarp_window.c, loss). Axes are the relief's. */
struct sv_prewarp_extent {
    double u0, v0, u1, v1;
    double lost_u, lost_v;
};
SV_MUST_CHECK enum sv_status sv_prewarp_extent(const struct sv_relief *relief,
                                               const struct sv_prewarp *prewarp,
                                               struct sv_prewarp_extent *extent, struct sv_error *error);

/* McMillan's order of n cells [i, i + 1] along an axis: from both ends towards the one that holds e, which
 * comes last. Returns that one. */
int sv_prewarp_order(int n, double e, int32_t *order);

/* How many samples of one row may lie over one another in a column; the farthest ones of more are lost. */
enum { SV_PREWARP_LAYERS = 16 };

struct sv_prewarp_sample {
    double v; /* vi, as a sample position along the second axis */
    float displ;
    float u;       /* where it stands along the first axis, texels */
    int32_t texel; /* along the first axis: the nearer one of the two that it lies between */
    uint8_t color[3];
    uint8_t sides; /* bit 0: seen from the interval above the row, bit 1: from below it */
};

/* One row of the relief after pass 1. Arrays are views into the owner's block. */
struct sv_prewarp_row {
    int j;
    bool one_sided;      /* some samples count on one side only */
    double *u, *v, *tau; /* of each texel's centre, sample positions */
    float *displ;
    int32_t *run[2]; /* first texel of the surface along the row, seen from above and below; -1: not drawn */
    uint32_t *count; /* out_width: samples landed; the last SV_PREWARP_LAYERS are kept ... */
    struct sv_prewarp_sample *samples; /* ... at [n % LAYERS * out_width + x], far to near */
};

static inline bool sv_prewarp_drawn(const struct sv_prewarp_work *w, size_t texel)
{
    return sv_relief_solid(w->relief, texel) && 1 + w->k3 * w->relief->displ[texel] > w->near;
}

/* Two texels that are drawn are one surface. */
static inline bool sv_prewarp_same(const struct sv_prewarp_work *w, size_t s, size_t t)
{
    return sv_prewarp_drawn(w, s) && sv_prewarp_drawn(w, t) &&
           fabsf(w->relief->displ[s] - w->relief->displ[t]) <= w->relief->cut;
}

/* The torn pair t is one surface by way of the pair (s0, s1) beside it, when that exists. */
static inline bool sv_prewarp_joined_by(const struct sv_prewarp_work *w, const size_t t[2], bool exists,
                                        size_t s0, size_t s1)
{
    return exists && sv_prewarp_same(w, s0, s1) && sv_prewarp_same(w, s0, t[0]) &&
           sv_prewarp_same(w, s1, t[1]);
}

/* Pass 1 of row j. */
void sv_prewarp_warp_row(const struct sv_prewarp_work *work, int j, struct sv_prewarp_row *row);
/* Pass 2 of what lies between two neighbouring rows; above or below is NULL at the border. */
void sv_prewarp_warp_columns(const struct sv_prewarp_work *work, const struct sv_prewarp_row *above,
                             const struct sv_prewarp_row *below);
/* Finds, counts and fills holes. */
SV_MUST_CHECK enum sv_status sv_prewarp_fill(const struct sv_prewarp_work *work, bool fill,
                                             struct sv_error *error);

/* A straight piece of surface seen along one axis of samples: positions p, and tau at its ends. */
struct sv_prewarp_span {
    double p0, p1, tau0, tau1;
    int first, last; /* samples whose centres lie in [min(p0, p1), max(p0, p1)): first <= x < last */
};

/* False when no sample lies in it. Spans that share an end share no sample and leave none out. */
static inline bool sv_prewarp_span_init(struct sv_prewarp_span *s, double p0, double p1, double tau0,
                                        double tau1, int samples)
{
    double lo = fmax(fmin(p0, p1) - 0.5, 0), hi = fmin(fmax(p0, p1) - 0.5, samples);
    if (!(lo < hi))
        return false;
    *s = (struct sv_prewarp_span){p0, p1, tau0, tau1, (int)ceil(lo), (int)ceil(hi)};
    return s->first < s->last;
}

/* How far along the span the centre of sample x lies: r as seen (0 .. 1), returns the share in space. The
 * ends' rays are tau0, tau1 long, so (1 - s) tau0 + s tau1 weighs what is seen: r = s tau1 / that. */
static inline double sv_prewarp_span_at(const struct sv_prewarp_span *s, int x, double *r)
{
    *r = sv_clamp((x + 0.5 - s->p0) / (s->p1 - s->p0), 0, 1);
    return *r * s->tau0 / (s->tau1 * (1 - *r) + s->tau0 * *r);
}

static inline void sv_prewarp_mix(const uint8_t a[3], const uint8_t b[3], double s, uint8_t out[3])
{
    int w = (int)(s * 256 + 0.5);
    for (int c = 0; c < 3; c++)
        out[c] = (uint8_t)((a[c] * (256 - w) + b[c] * w + 128) >> 8);
}

#endif
