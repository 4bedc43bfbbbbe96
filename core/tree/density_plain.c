/* density_plain.c - coverage, mean normal and tone: what a species' texels do not have in common (density.h).
 */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "core/base/vec.h"
#include "core/tree/density_private.h"
#include "core/tree/least_squares.h"

enum { BINS = 512, BLOCK = 4 };
/* Share of covered area whose colours lie beyond each end of the tones, and are held to it. */
static const double CUT = 0.01;

/* Which texels a palette is made from: where leaves are (nearly) all that is seen, or nearly none. */
static float leaf_weight(const struct sv_density_cell *c)
{
    return c->leaf >= 0.9f * c->coverage ? c->coverage : 0;
}

static float wood_weight(const struct sv_density_cell *c)
{
    return c->leaf <= 0.1f * c->coverage ? c->coverage : 0;
}

typedef float (*cell_weight)(const struct sv_density_cell *);

/* Mean colour, and the direction in which colours differ most (power iteration on their covariance). */
struct axis {
    double mean[3], along[3], weight;
    cell_weight of;
};

static struct axis main_axis(const struct sv_density_cell *cells, size_t count, cell_weight of)
{
    struct axis a = {{0}, {1, 1, 1}, 0, of};
    double cov[3][3] = {{0}};
    for (size_t k = 0; k < count; k++) {
        for (int c = 0; c < 3; c++)
            a.mean[c] += (double)(of(&cells[k]) * cells[k].rgb[c]);
        a.weight += (double)of(&cells[k]);
    }
    for (int c = 0; c < 3; c++)
        a.mean[c] /= a.weight > 0 ? a.weight : 1;
    for (size_t k = 0; k < count; k++)
        for (int c = 0; c < 3; c++)
            for (int d = 0; d < 3; d++)
                cov[c][d] += (double)of(&cells[k]) * ((double)cells[k].rgb[c] - a.mean[c]) *
                             ((double)cells[k].rgb[d] - a.mean[d]);
    for (int n = 0; n < 64; n++) {
        double next[3], length = 0;
        for (int c = 0; c < 3; c++) {
            next[c] = cov[c][0] * a.along[0] + cov[c][1] * a.along[1] + cov[c][2] * a.along[2];
            length += next[c] * next[c];
        }
        if (!(length > 1e-30))
            break;
        for (int c = 0; c < 3; c++)
            a.along[c] = next[c] / sqrt(length);
    }
    return a;
}

static double place(const struct axis *a, const double rgb[3])
{
    double t = 0;
    for (int c = 0; c < 3; c++)
        t += a->along[c] * (rgb[c] - a->mean[c]);
    return t;
}

static double cell_place(const struct axis *a, const struct sv_density_cell *c)
{
    return place(a, (const double[3]){(double)c->rgb[0], (double)c->rgb[1], (double)c->rgb[2]});
}

/* Places on the axis that CUT of the area lies before, and beyond. */
static void ends(const struct axis *a, const struct sv_density_cell *cells, size_t count, double out[2])
{
    double lo = 0, hi = 0, bins[BINS] = {0}, sum = 0;
    for (size_t k = 0; k < count; k++)
        if (a->of(&cells[k]) > 0) {
            lo = fmin(lo, cell_place(a, &cells[k]));
            hi = fmax(hi, cell_place(a, &cells[k]));
        }
    double step = fmax((hi - lo) / BINS, 1e-9);
    for (size_t k = 0; k < count; k++)
        if (a->of(&cells[k]) > 0) {
            int b = (int)((cell_place(a, &cells[k]) - lo) / step);
            bins[b < BINS ? b : BINS - 1] += (double)a->of(&cells[k]);
        }
    out[0] = lo, out[1] = hi;
    for (int b = 0; b < BINS && sum + bins[b] <= CUT * a->weight; b++) {
        sum += bins[b];
        out[0] = lo + (b + 1) * step;
    }
    sum = 0;
    for (int b = BINS; b-- > 0 && sum + bins[b] <= CUT * a->weight;) {
        sum += bins[b];
        out[1] = lo + b * step;
    }
}

/* What colours become tones by. */
struct palette {
    struct axis axis; /* of leaves; of wood where there are none */
    double range[2], wood[3];
    bool bare; /* no leaves: tones are of wood alone */
};

static struct palette make_palette(struct sv_density_work *work)
{
    struct sv_density *out = work->out;
    size_t count = (size_t)out->plane_count * SV_DENSITY_TEXELS;
    struct axis wood = main_axis(work->cells, count, wood_weight);
    struct palette p = {.axis = main_axis(work->cells, count, leaf_weight)};
    p.bare = !(p.axis.weight > 0);
    if (p.bare)
        p.axis = wood;
    if (p.axis.along[0] + p.axis.along[1] + p.axis.along[2] < 0) /* from dark to bright */
        for (int c = 0; c < 3; c++)
            p.axis.along[c] = -p.axis.along[c];
    ends(&p.axis, work->cells, count, p.range);
    for (int c = 0; c < 3; c++) {
        out->dark[c] = (float)fmax(0, p.axis.mean[c] + p.range[0] * p.axis.along[c]);
        out->bright[c] = (float)fmax(0, p.axis.mean[c] + p.range[1] * p.axis.along[c]);
        p.wood[c] = wood.weight > 0 ? wood.mean[c] : (double)out->dark[c];
        out->wood[c] = (float)p.wood[c];
    }
    return p;
}

static void put_texel(const struct sv_density_cell *c, const struct palette *p, uint8_t to[4])
{
    double share = p->bare ? 1 : c->coverage > 0 ? (double)(c->leaf / c->coverage) : 1;
    double span = p->range[1] - p->range[0], rgb[3], tone = 0.5;
    for (int k = 0; k < 3; k++) /* the leaves' part of the colour; of few leaves among wood, their mean */
        rgb[k] = share > 0.3 ? ((double)c->rgb[k] - (1 - share) * p->wood[k]) / share : p->axis.mean[k];
    if (span > 1e-9)
        tone = sv_clamp((place(&p->axis, rgb) - p->range[0]) / span, 0, 1);
    const float *m = c->normal;
    float length = sqrtf(m[0] * m[0] + m[1] * m[1] + m[2] * m[2]), unit = length > 0 ? 1 / length : 0;
    to[0] = sv_density_unit(0.5f + 0.5f * m[0] * unit);
    to[1] = sv_density_unit(0.5f + 0.5f * m[1] * unit);
    to[2] = sv_density_unit((float)(share * (SV_DENSITY_TONE_DARK + (1 - SV_DENSITY_TONE_DARK) * tone)));
    to[3] = sv_density_unit(c->coverage);
}

void sv_density_color(const struct sv_density *density, float tone, float rgb[3])
{
    float low = tone / SV_DENSITY_TONE_DARK,
          high = (tone - SV_DENSITY_TONE_DARK) / (1 - SV_DENSITY_TONE_DARK);
    for (int c = 0; c < 3; c++)
        rgb[c] = low < 1 ? density->wood[c] + (density->dark[c] - density->wood[c]) * low
                         : density->dark[c] + (density->bright[c] - density->dark[c]) * high;
}

/* Texels that show nothing get the mean of those of their block that do. */
static void fill_block(struct sv_density_work *work, int plane, int bx, int by)
{
    float sum[3] = {0}, weight = 0;
    for (int n = 0; n < BLOCK * BLOCK; n++) {
        const uint8_t *p = sv_density_texel(
            work->rgba, plane, (by * BLOCK + n / BLOCK) * SV_DENSITY_TILE + bx * BLOCK + n % BLOCK);
        for (int c = 0; c < 3; c++)
            sum[c] += (float)p[3] * (float)p[c];
        weight += (float)p[3];
    }
    for (int n = 0; n < BLOCK * BLOCK; n++) {
        uint8_t *p = sv_density_texel(work->rgba, plane,
                                      (by * BLOCK + n / BLOCK) * SV_DENSITY_TILE + bx * BLOCK + n % BLOCK);
        for (int c = 0; c < 3 && p[3] == 0; c++)
            p[c] = weight > 0 ? (uint8_t)(sum[c] / weight + 0.5f) : 128;
    }
}

/* Translucency by the colours that texels will have. */
static void set_translucency(struct sv_density_work *work)
{
    struct sv_density *out = work->out;
    double m[SV_UNKNOWNS_MAX][SV_UNKNOWNS_MAX + 1] = {{0}};
    for (int k = 0; k < out->plane_count * SV_DENSITY_TEXELS; k++) {
        const struct sv_density_cell *c = &work->cells[k];
        float rgb[3];
        if (!(c->coverage > 0))
            continue;
        sv_density_color(
            out,
            (float)sv_density_texel(work->rgba, k / SV_DENSITY_TEXELS, k % SV_DENSITY_TEXELS)[2] *
                (1.0f / 255.0f),
            rgb);
        const double row[4] = {(double)rgb[0], (double)rgb[1], (double)rgb[2], 1};
        sv_least_squares_add(m, 4, row, (double)c->translucency, (double)c->coverage);
    }
    sv_translucency_rule(m, out->translucency);
}

void sv_density_plain_texels(struct sv_density_work *work)
{
    struct sv_density *out = work->out;
    struct palette palette = make_palette(work);
    for (int plane = 0; plane < out->plane_count; plane++) {
        for (int t = 0; t < SV_DENSITY_TEXELS; t++)
            put_texel(&work->cells[(size_t)plane * SV_DENSITY_TEXELS + (size_t)t], &palette,
                      sv_density_texel(work->rgba, plane, t));
        for (int b = 0; b < SV_DENSITY_TEXELS / (BLOCK * BLOCK); b++)
            fill_block(work, plane, b % (SV_DENSITY_TILE / BLOCK), b / (SV_DENSITY_TILE / BLOCK));
    }
    set_translucency(work);
}
