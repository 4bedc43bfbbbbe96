/* density_paper.c - periods of the UV texture (paper 2, 3.2) and the texels made of them (3.3).
 *
 * Read from the text: "the surrounding 16 pixels" is a window of 16 x 16 about the texel; all its rows have
 * the same period and phases of their own (sawtooth.h). ROWS of them are looked at. A texel is a leaf where
 * both periods are found; the range of codes is fitted to the species' periods, as the paper quantises real
 * numbers to 0..255 without saying how. Wood, which the paper does not speak of, has a code of its own. */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "core/tree/density_private.h"
#include "core/tree/sawtooth.h"

enum { ROWS = 4, NONE = 0, FIRST = 1, LAST = 254, WOOD = 255 };

static const float PERIOD_MIN = 3, PERIOD_MAX = 255;
/* "The range that a leaf can have": a leaf askew to the row has a longer period than its size, without bound.
 * What lies within this many sizes is 80 % of all directions (1 / |cos|). */
static const float ASKEW = 3;
/* Share of a window that must show leaves: own choice, the paper says "not enough density". */
static const float COVERAGE = 0.4f;

void sv_density_paper_range(struct sv_density_work *work)
{
    const struct sv_density_leaf *leaf = &work->out->leaf;
    float most = 0;
    for (int k = 0; k < work->cloud->plane_count; k++) {
        const float *half = work->cloud->planes[k].half;
        float per = 0.5f * SV_DENSITY_UV_SIDE / fminf(half[0], half[1]);
        most = fmaxf(most, leaf->material < 0 ? 0 : per * fmaxf(leaf->size[0], leaf->size[1]));
    }
    work->out->period_min = PERIOD_MIN;
    work->out->period_max = fminf(fmaxf(ASKEW * most, SV_SAWTOOTH_WINDOW), PERIOD_MAX);
}

void sv_density_paper_analyse(const struct sv_density_work *work, struct sv_density_periods *periods,
                              int plane)
{
    const struct sv_sawtooth_options options = {work->out->period_min, work->out->period_max, COVERAGE,
                                                1e-4f};
    const ptrdiff_t stride = SV_DENSITY_UV_STRIDE, gap = SV_SAWTOOTH_WINDOW / ROWS;
    for (int t = 0; t < SV_DENSITY_TEXELS; t++) {
        int i = t % SV_DENSITY_TILE, j = t / SV_DENSITY_TILE;
        size_t to = (size_t)plane * SV_DENSITY_TEXELS + (size_t)t;
        periods->x[to] = periods->y[to] = 0;
        if (!(work->cells[to].leaf > 0))
            continue; /* of a window whose middle is bare at most 3/4 show a leaf: the paper's no leaf */
        /* the window's corner, half a texel before the texel's own, in the bordered picture */
        ptrdiff_t row = j * SV_DENSITY_STEP - 4 + SV_DENSITY_BORDER,
                  column = i * SV_DENSITY_STEP - 4 + SV_DENSITY_BORDER;
        ptrdiff_t across = (row + gap / 2) * stride + column, down = row * stride + column + gap / 2;
        struct sv_sawtooth_window x = {work->uv.u + across, work->uv.leaf + across, 1, gap * stride, ROWS};
        struct sv_sawtooth_window y = {work->uv.v + down, work->uv.leaf + down, stride, gap, ROWS};
        struct sv_sawtooth found = sv_sawtooth_fit(&x, &options);
        if (found.period > 0) {
            periods->x[to] = found.period;
            periods->y[to] = sv_sawtooth_fit(&y, &options).period;
        }
        if (!(periods->y[to] > 0))
            periods->x[to] = periods->y[to] = 0;
    }
}

void sv_density_paper_texels(struct sv_density_work *work, const struct sv_density_periods *periods)
{
    struct sv_density *out = work->out;
    for (int plane = 0; plane < out->plane_count; plane++)
        for (int t = 0; t < SV_DENSITY_TEXELS; t++) {
            size_t from = (size_t)plane * SV_DENSITY_TEXELS + (size_t)t;
            const struct sv_density_cell *c = &work->cells[from];
            uint8_t *to = sv_density_texel(work->rgba, plane, t);
            bool wood = c->coverage > 0.5f && c->leaf < 0.5f * c->coverage;
            to[0] = wood ? WOOD : sv_density_code(periods->x[from], out->period_min, out->period_max);
            to[1] = wood ? WOOD : sv_density_code(periods->y[from], out->period_min, out->period_max);
            const float *m = c->normal;
            float length = sqrtf(m[0] * m[0] + m[1] * m[1] + m[2] * m[2]), unit = length > 0 ? 1 / length : 0;
            to[2] = sv_density_unit(0.5f + 0.5f * m[0] * unit);
            to[3] = sv_density_unit(0.5f + 0.5f * m[1] * unit);
        }
}

uint8_t sv_density_code(float period, float least, float most)
{
    if (!(period > 0) || !(most > least))
        return NONE;
    float t = (period - least) / (most - least);
    t = t > 0 ? t < 1 ? t : 1 : 0;
    return (uint8_t)(FIRST + (int)(t * (LAST - FIRST) + 0.5f));
}

float sv_density_period(uint8_t code, float least, float most)
{
    if (code == NONE || !(most > least))
        return 0;
    float t = (float)(code - FIRST) / (LAST - FIRST);
    return least + (most - least) * (t < 1 ? t : 1);
}

uint8_t sv_density_log_code(float period, float least, float most)
{
    return period > 0 && least > 0 ? sv_density_code(1 + logf(period / least), 1, 1 + logf(most / least))
                                   : NONE;
}

float sv_density_log_period(uint8_t code, float least, float most)
{
    if (code == NONE || !(least > 0))
        return 0;
    return least * expf(sv_density_period(code, 1, 1 + logf(most / least)) - 1);
}
