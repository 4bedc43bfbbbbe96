/* density_plain.c - coverage, mean normal and tone: what a species' texels do not have in common (density.h).
 */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "core/tree/density_private.h"

enum { BINS = 512, BLOCK = 4 };
/* Share of covered area whose colours lie beyond each end of the tones, and are held to it. */
static const double CUT = 0.01;

/* Mean colour, and the direction in which colours differ most (power iteration on their covariance). */
struct axis {
    double mean[3], along[3], weight;
};

static struct axis main_axis(const struct sv_density_cell *cells, size_t count)
{
    struct axis a = {{0}, {1, 1, 1}, 0};
    double cov[3][3] = {{0}};
    for (size_t k = 0; k < count; k++) {
        for (int c = 0; c < 3; c++)
            a.mean[c] += (double)(cells[k].coverage * cells[k].rgb[c]);
        a.weight += (double)cells[k].coverage;
    }
    for (int c = 0; c < 3; c++)
        a.mean[c] /= a.weight > 0 ? a.weight : 1;
    for (size_t k = 0; k < count; k++)
        for (int c = 0; c < 3; c++)
            for (int d = 0; d < 3; d++)
                cov[c][d] += (double)cells[k].coverage * ((double)cells[k].rgb[c] - a.mean[c]) *
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

static double place(const struct axis *a, const float rgb[3])
{
    double t = 0;
    for (int c = 0; c < 3; c++)
        t += a->along[c] * ((double)rgb[c] - a->mean[c]);
    return t;
}

/* Places on the axis that CUT of the covered area lies before, and beyond. */
static void ends(const struct axis *a, const struct sv_density_cell *cells, size_t count, double out[2])
{
    double lo = 0, hi = 0, bins[BINS] = {0}, sum = 0;
    for (size_t k = 0; k < count; k++)
        if (cells[k].coverage > 0) {
            lo = fmin(lo, place(a, cells[k].rgb));
            hi = fmax(hi, place(a, cells[k].rgb));
        }
    double step = fmax((hi - lo) / BINS, 1e-9);
    for (size_t k = 0; k < count; k++)
        if (cells[k].coverage > 0) {
            int b = (int)((place(a, cells[k].rgb) - lo) / step);
            bins[b < BINS ? b : BINS - 1] += (double)cells[k].coverage;
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

/* dark, bright; and translucency as a linear function of colour, by least squares over tones. */
static void set_palette(struct sv_density_work *work, const struct axis *a, const double range[2])
{
    struct sv_density *out = work->out;
    double s1 = 0, st = 0, stt = 0, sy = 0, sty = 0, span = range[1] - range[0];
    size_t count = (size_t)out->plane_count * SV_DENSITY_TEXELS;
    for (int c = 0; c < 3; c++) {
        out->dark[c] = (float)fmax(0, a->mean[c] + range[0] * a->along[c]);
        out->bright[c] = (float)fmax(0, a->mean[c] + range[1] * a->along[c]);
    }
    for (size_t k = 0; k < count; k++) {
        double w = (double)work->cells[k].coverage, t = w > 0 ? place(a, work->cells[k].rgb) : 0,
               y = (double)work->cells[k].translucency;
        s1 += w, st += w * t, stt += w * t * t, sy += w * y, sty += w * t * y;
    }
    double mean = s1 > 0 ? sy / s1 : 0, spread = stt - (s1 > 0 ? st * st / s1 : 0);
    double slope = span > 1e-6 && spread > 1e-9 * s1 ? (sty - st * mean) / spread : 0;
    double at0 = mean - slope * (s1 > 0 ? st / s1 : 0);
    for (int c = 0; c < 3; c++) {
        out->translucency[c] = (float)(slope * a->along[c]);
        at0 -= slope * a->along[c] * a->mean[c];
    }
    out->translucency[3] = (float)at0;
}

static void put_texel(const struct sv_density_cell *c, const struct axis *a, const double range[2],
                      uint8_t to[4])
{
    double span = range[1] - range[0], tone = span > 1e-9 ? (place(a, c->rgb) - range[0]) / span : 0.5;
    const float *m = c->normal;
    float length = sqrtf(m[0] * m[0] + m[1] * m[1] + m[2] * m[2]), unit = length > 0 ? 1 / length : 0;
    to[0] = sv_density_unit(0.5f + 0.5f * m[0] * unit);
    to[1] = sv_density_unit(0.5f + 0.5f * m[1] * unit);
    to[2] = sv_density_unit((float)tone);
    to[3] = sv_density_unit(c->coverage);
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

void sv_density_plain_texels(struct sv_density_work *work)
{
    struct sv_density *out = work->out;
    size_t count = (size_t)out->plane_count * SV_DENSITY_TEXELS;
    struct axis axis = main_axis(work->cells, count);
    double range[2];
    ends(&axis, work->cells, count, range);
    set_palette(work, &axis, range);
    for (int plane = 0; plane < out->plane_count; plane++) {
        for (int t = 0; t < SV_DENSITY_TEXELS; t++)
            put_texel(&work->cells[(size_t)plane * SV_DENSITY_TEXELS + (size_t)t], &axis, range,
                      sv_density_texel(work->rgba, plane, t));
        for (int b = 0; b < SV_DENSITY_TEXELS / (BLOCK * BLOCK); b++)
            fill_block(work, plane, b % (SV_DENSITY_TILE / BLOCK), b / (SV_DENSITY_TILE / BLOCK));
    }
}
