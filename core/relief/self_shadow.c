/* self_shadow.c - see self_shadow.h.
 *
 * All lines advance abreast, a row (or a column) of texels at a time: G of line i - shift(row) is an array
 * that slides by whole texels, so that texels are read in the order in which they lie in memory
 * and the inner loop has no branch. Light along u: BLOCK columns are gathered at a time.
 *
 *     paper 1, 3.3.1      here
 *     l_T                 (l.x, l.y)
 *     S (its far end)     G = front[]
 *     (u_i, v_i)          g = s sin(theta) + displ cos(theta) */
#include "core/relief/self_shadow.h"

#include <stdlib.h>

enum { BLOCK = 16 }; /* floats a line of cache */

struct sweep {
    const struct sv_relief *relief;
    const uint8_t *initial;
    uint8_t *lit;
    int rows, count;             /* steps along the light, texels in one */
    size_t row_stride, stride;   /* from texel to texel, along the light and across */
    bool forward;                /* rows are met in the order of their indices */
    double shift;                /* texels across a step, -1 .. 1 */
    double s_row, s_texel, rise; /* s sin(theta) a step and a texel across; cos(theta) */
    double bias;
    bool texels_alone;
    float *displ;  /* BLOCK rows of count + 2: NaN: empty, and beside each row */
    uint8_t *seen; /* BLOCK rows of count */
    double *front; /* G of line 0 */
};

static enum sv_status check(const struct sv_relief *relief, const struct sv_self_shadow_options *options,
                            struct sv_error *error)
{
    double length = sv_length(options->travel);
    if (!(fabs(length - 1.0) <= 1e-6))
        return sv_fail(error, SV_EINVAL, "travel",
                       "light vector (%g, %g, %g) of length %g; must be a unit vector", options->travel.x,
                       options->travel.y, options->travel.z, length);
    if (!(options->bias_m >= 0 && isfinite(options->bias_m)))
        return sv_fail(error, SV_EINVAL, "bias_m", "bias %g m; must be finite and at least 0",
                       (double)options->bias_m);
    if (relief->width < 1 || relief->height < 1)
        return sv_fail(error, SV_EINVAL, "width", "relief of %d x %d texels; each side must be at least 1",
                       relief->width, relief->height);
    return SV_OK;
}

/* Every texel the same but for the shadow texture and empty ones. */
static void answer_alone(const struct sv_relief *r, const uint8_t *initial, bool dark, uint8_t *lit)
{
    size_t n = (size_t)r->width * (size_t)r->height;
    for (size_t t = 0; t < n; t++)
        lit[t] = sv_relief_solid(r, t) && (dark || (initial && !initial[t])) ? 0 : 255;
}

static size_t texel_at(const struct sweep *w, int step, int i)
{
    int row = w->forward ? step : w->rows - 1 - step;
    return (size_t)row * w->row_stride + (size_t)i * w->stride;
}

/* displ of `steps` rows from `first` on; NaN where a texel is empty. */
static void gather(const struct sweep *w, int first, int steps)
{
    size_t wide = (size_t)w->count + 2;
    for (int k = 0; k < steps; k++)
        w->displ[(size_t)k * wide] = w->displ[(size_t)k * wide + wide - 1] = NAN;
    for (int i = 0; i < w->count; i++)
        for (int k = 0; k < steps; k++) {
            size_t t = texel_at(w, first + k, i);
            w->displ[(size_t)k * wide + 1 + (size_t)i] =
                sv_relief_solid(w->relief, t) ? w->relief->displ[t] : NAN;
        }
}

/* One row: d[-1 .. count] is its displ. A NaN compares false: an empty texel is lit and leaves G alone. */
static void sweep_row(const struct sweep *w, int step, const float *d, uint8_t *seen)
{
    double at = w->shift * step, line = floor(at + 0.5),
           beside = at - line; /* the line stands at i + beside */
    double *front = w->front - (int64_t)line;
    double s = w->s_row * step + (beside * w->s_texel), bias = w->bias, rise = w->rise, across = w->s_texel;
    double share = w->texels_alone ? 0 : fabs(beside), cut = (double)w->relief->cut;
    const float *next = beside < 0 ? d - 1 : d + 1;
    if (w->texels_alone)
        s = w->s_row * step;
    for (int i = 0; i < w->count; i++) {
        double own = (double)d[i], step_up = (double)next[i] - own;
        double displ = fabs(step_up) <= cut ? own + step_up * share : own;
        double g = s + i * across + displ * rise, far = front[i];
        seen[i] = g < far - bias ? 0 : 255; /* rule (ii) */
        front[i] = g > far ? g : far;       /* rule (iii), as corrected */
    }
}

static void scatter(const struct sweep *w, int first, int steps)
{
    for (int i = 0; i < w->count; i++)
        for (int k = 0; k < steps; k++) {
            size_t t = texel_at(w, first + k, i), at = (size_t)k * (size_t)w->count + (size_t)i;
            bool masked = w->initial && !w->initial[t] && sv_relief_solid(w->relief, t);
            w->lit[t] = masked ? 0 : w->seen[at];
        }
}

static void sweep_all(const struct sweep *w)
{
    for (int first = 0; first < w->rows; first += BLOCK) {
        int steps = w->rows - first < BLOCK ? w->rows - first : BLOCK;
        gather(w, first, steps);
        for (int k = 0; k < steps; k++)
            sweep_row(w, first + k, w->displ + (size_t)k * ((size_t)w->count + 2) + 1,
                      w->seen + (size_t)k * (size_t)w->count);
        scatter(w, first, steps);
    }
}

/* Axes, strides and the terms of g for light l; |l_T| > 0 but where nothing depends on the direction. */
static void sweep_aim(struct sweep *w, struct sv_vec3 l)
{
    const struct sv_relief *r = w->relief;
    double a = sv_length(r->frame.a), b = sv_length(r->frame.b), cosine = hypot(l.x, l.y);
    double tu = cosine > 0 ? l.x / cosine : 1, tv = cosine > 0 ? l.y / cosine : 0; /* l_T^ */
    double along_u = tu / a, along_v = tv / b;                                     /* texels a metre */
    bool rows = fabs(along_v) >= fabs(along_u);
    w->rows = rows ? r->height : r->width;
    w->count = rows ? r->width : r->height;
    w->row_stride = rows ? (size_t)r->width : 1;
    w->stride = rows ? 1 : (size_t)r->width;
    w->forward = (rows ? tv : tu) > 0;
    w->shift = rows ? along_u / fabs(along_v) : along_v / fabs(along_u);
    w->s_row = fabs(rows ? tv * b : tu * a) * -l.z;
    w->s_texel = (rows ? tu * a : tv * b) * -l.z;
    w->rise = cosine;
}

enum sv_status sv_self_shadow(const struct sv_relief *relief, const struct sv_self_shadow_options *options,
                              uint8_t *lit, struct sv_error *error)
{
    enum sv_status status = check(relief, options, error);
    if (status != SV_OK)
        return status;
    struct sv_vec3 l = options->travel;
    if (l.z > 0 || (options->special_cases && l.x == 0 && l.y == 0)) {
        answer_alone(relief, options->initial, l.z > 0, lit); /* the first special case: no shadow */
        return SV_OK;
    }
    struct sweep w = {.relief = relief,
                      .initial = options->initial,
                      .lit = lit,
                      .bias = (double)options->bias_m,
                      .texels_alone = options->texels_alone};
    sweep_aim(&w, l);
    if (options->special_cases && l.z == 0) { /* the second one: displ itself (figure 4) */
        w.s_row = w.s_texel = 0;
        w.rise = 1;
    }
    size_t lines = (size_t)w.rows + (size_t)w.count + 2, count = (size_t)w.count;
    double *front = malloc(lines * sizeof *front + BLOCK * ((count + 2) * sizeof(float) + count));
    if (!front)
        return sv_fail(error, SV_ENOMEM, "width", "no memory for %zu lines of light", lines);
    for (size_t i = 0; i < lines; i++)
        front[i] = -INFINITY;
    w.front = front + (w.shift > 0 ? w.rows : 0);
    w.displ = (float *)(front + lines);
    w.seen = (uint8_t *)(w.displ + BLOCK * (count + 2));
    sweep_all(&w);
    free(front);
    return SV_OK;
}
