/* self_shadow.c - see self_shadow.h.
 *
 * All lines advance abreast, a row (or a column) of texels at a time: G of line i - shift(row) is an array
 * that slides by whole texels, so that texels are read in the order in which they lie in memory.
 *
 *     paper 1, 3.3.1      here
 *     l_T                 (l.x, l.y)
 *     S (its far end)     G = front[]
 *     (u_i, v_i)          g = s sin(theta) + displ cos(theta) */
#include "core/relief/self_shadow.h"

#include <stdlib.h>

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

/* The row of texels that is met as number `step`. */
static void sweep_row(const struct sweep *w, int step)
{
    const struct sv_relief *r = w->relief;
    int row = w->forward ? step : w->rows - 1 - step;
    double *front = w->front - (int64_t)floor(w->shift * step + 0.5);
    double s = w->s_row * step, bias = w->bias;
    for (int i = 0; i < w->count; i++) {
        size_t t = (size_t)row * w->row_stride + (size_t)i * w->stride;
        uint8_t seen = 255;
        if (sv_relief_solid(r, t)) {
            double g = s + i * w->s_texel + (double)r->displ[t] * w->rise;
            if (g < front[i] - bias || (w->initial && !w->initial[t]))
                seen = 0; /* rule (ii) */
            if (g > front[i])
                front[i] = g; /* rule (iii), as corrected */
        }
        w->lit[t] = seen;
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
    struct sweep w = {
        .relief = relief, .initial = options->initial, .lit = lit, .bias = (double)options->bias_m};
    sweep_aim(&w, l);
    if (options->special_cases && l.z == 0) { /* the second one: displ itself (figure 4) */
        w.s_row = w.s_texel = 0;
        w.rise = 1;
    }
    size_t lines = (size_t)w.rows + (size_t)w.count + 2;
    double *front = malloc(lines * sizeof *front);
    if (!front)
        return sv_fail(error, SV_ENOMEM, "width", "no memory for %zu lines of light", lines);
    for (size_t i = 0; i < lines; i++)
        front[i] = -INFINITY;
    w.front = front + (w.shift > 0 ? w.rows : 0);
    for (int step = 0; step < w.rows; step++)
        sweep_row(&w, step);
    free(front);
    return SV_OK;
}
