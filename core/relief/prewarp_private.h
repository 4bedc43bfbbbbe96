/* prewarp_private.h - what the files of the two-pass warp share. Private to core/relief/prewarp_*.c.
 *
 * "First axis" is the one that pass 1 runs along, "second" the other; u and v below mean these two. Which of
 * them is the relief's u is told by the steps alone. */
#ifndef SV_RELIEF_PREWARP_PRIVATE_H
#define SV_RELIEF_PREWARP_PRIVATE_H

#include "core/relief/prewarp.h"

/* What lies between two rows, cell by cell. */
enum sv_prewarp_cells { SV_PREWARP_EMPTY, SV_PREWARP_PLAIN, SV_PREWARP_TORN };

struct sv_prewarp_work {
    const struct sv_relief *relief;
    const uint8_t (*color)[4];
    int width, height;     /* texels along the first and the second axis */
    size_t step_u, step_v; /* texel (i, j) is element i step_u + j step_v of the relief */
    double k1, k2, k3;     /* k4, k5 and 0 for parallel projection */
    double near;           /* smallest tau */
    double toward;         /* +1: larger displ is nearer to the eye, -1: smaller */
    bool outward;          /* what is farther from the epipole is nearer to the eye */
    int32_t *order_u;      /* sv_prewarp_order of the width + 1 intervals between texel centres */
    int split_v;           /* the interval between rows that holds the epipole, 0 .. height */
    double epipole_u, epipole_v;
    int out_width, out_height; /* samples along the first and the second axis */
    size_t out_step_x, out_step_y;
    double u0, v0, scale_u, scale_v; /* sample position of u: (u - u0) scale_u; centres at + 0.5 */
    uint8_t *cells;                  /* width + 1: enum sv_prewarp_cells (of one interval) */
    uint8_t *apart;                  /* out_width: column that pass 2 draws cell by cell (of one interval) */
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
 * comes last; outward: the other way round. Returns the one that holds e. */
int sv_prewarp_order(int n, double e, bool outward, int32_t *order);

/* A point of the surface as it is seen. */
struct sv_prewarp_vertex {
    double x, y; /* sample positions along the first and the second axis */
    double tau;  /* > 0 */
    double displ;
    float color[3];
};
struct sv_prewarp_vertex sv_prewarp_place(const struct sv_prewarp_work *work, double u, double v,
                                          double displ);

/* What one row has in one column of samples after pass 1. */
struct sv_prewarp_sample {
    double y; /* vi, as a sample position along the second axis */
    float displ;
    float u;       /* where it stands along the first axis, texels */
    int32_t texel; /* along the first axis: the nearer one of the two that it lies between */
    uint8_t color[3];
};

/* One row of the relief after pass 1. Arrays are views into the owner's block. */
struct sv_prewarp_row {
    int j;
    struct sv_prewarp_vertex *texel;   /* width: of each texel's centre; tau 0: not drawn */
    uint32_t *count;                   /* out_width: samples landed */
    struct sv_prewarp_sample *samples; /* out_width: the last one, where count is not 0 */
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

/* Four texels about a corner, (i - 1, j - 1), (i, j - 1), (i - 1, j), (i, j), and the surfaces between their
 * centres: corners are one surface when a chain of neighbours that are one surface joins them. */
struct sv_prewarp_cell {
    int i, j;
    size_t texel[4];
    int8_t part[4]; /* the first corner of its surface; -1: not drawn, or outside */
    bool plain;     /* all four drawn, every two neighbours one surface */
    float displ[4];
};
void sv_prewarp_cell_init(const struct sv_prewarp_work *work, int i, int j, struct sv_prewarp_cell *cell);

/* A point of corner o's quarter of a torn cell: its centre, its border towards o ^ 1 and towards o ^ 2, and
 * the cell's middle. Corners of other surfaces count as what lies next to them (both neighbours' mean, or the
 * one that is there, else o itself): the last half texel is carried on. */
enum sv_prewarp_spot { SV_PREWARP_CENTRE, SV_PREWARP_ALONG, SV_PREWARP_ACROSS, SV_PREWARP_MIDDLE };
struct sv_prewarp_vertex sv_prewarp_quarter(const struct sv_prewarp_work *work,
                                            const struct sv_prewarp_cell *cell, int o,
                                            enum sv_prewarp_spot spot);

/* A bilinear piece of surface: vertex k at (k & 1, k >> 1). texel[k]: nearest to the vertex. */
struct sv_prewarp_patch {
    struct sv_prewarp_vertex v[4];
    size_t texel[4];
};
enum { SV_PREWARP_PATCHES = 12 };
/* Far to near: at most four quarters and, where quarters of one texel do not meet, the steps between them on
 * the cell's farther sides. A plain cell is one patch. */
int sv_prewarp_cell_patches(const struct sv_prewarp_work *work, const struct sv_prewarp_cell *cell,
                            struct sv_prewarp_patch patches[SV_PREWARP_PATCHES]);

/* Pass 1 of row j. */
void sv_prewarp_warp_row(const struct sv_prewarp_work *work, int j, struct sv_prewarp_row *row);
/* Pass 2 of interval j, between rows j - 1 and j; above or below is NULL at the border. */
void sv_prewarp_warp_columns(const struct sv_prewarp_work *work, int j, const struct sv_prewarp_row *above,
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
