/* shadow_cast.c - a silhouette laid along the light onto the ground of a window.
 *
 * A place X is behind silhouette texel (s, t), both linear in X; so along a row of the window they are linear
 * in the column and in the ground's height, and a texel costs six multiply-adds and a bilinear look-up. What
 * has to be looked at is bounded before: the body's rays go down along the light's ground track from their
 * lowest to their highest, and blocks of ground along the track say where the first may land and where all
 * have landed. Own derivation. */
#include "core/terrain/shadow_cast.h"

#include <math.h>
#include <string.h>

#include "core/base/simd.h"
#include "core/terrain/shadow_window.h"

enum { STEPS_MAX = 1000 };
enum { BLOCK = SV_SHADOW_WINDOW_BLOCK };

/* sin of a quarter of a degree: flatter light is next to nothing (light.c), and its shadows are endless. */
static const double FLATTEST = 0.00436;
/* Light steeper than this (cot of 87 degrees) needs no track: bodies' shadows lie under them. */
static const double STEEP_COT = 0.05;

/* ---- one row, scalar ---- */

float sv_shadow_cast_coverage(const struct sv_shadow_cast *c, float s, float t, float d)
{
    if (!(s > -1 && t > -1 && s < (float)c->width && t < (float)c->height))
        return 0;
    float fs = floorf(s), ft = floorf(t), u = s - fs, v = t - ft;
    int i = (int)fs, j = (int)ft;
    if (c->first) {
        int ni = u < 0.5f ? i : i + 1, nj = v < 0.5f ? j : j + 1;
        ni = ni < 0 ? 0 : ni >= c->width ? c->width - 1 : ni;
        nj = nj < 0 ? 0 : nj >= c->height ? c->height - 1 : nj;
        if (!(d >= c->first[(long)nj * c->width + ni]))
            return 0;
    } else if (!(d >= c->first_d)) {
        return 0;
    }
    const uint8_t *p = c->coverage + (long)j * c->width + i;
    float a = i >= 0 && j >= 0 ? p[0] : 0, b = i + 1 < c->width && j >= 0 ? p[1] : 0;
    float e = i >= 0 && j + 1 < c->height ? p[c->width] : 0;
    float f = i + 1 < c->width && j + 1 < c->height ? p[c->width + 1] : 0;
    float low = a + (b - a) * u, high = e + (f - e) * u;
    return low + (high - low) * v;
}

void sv_shadow_cast_spread(struct sv_shadow_cast *c, double spread_s, double spread_t)
{
    for (int k = 0; k < c->samples_s; k++)
        c->offset_s[k] = (float)(((k + 0.5) / c->samples_s - 0.5) * spread_s);
    for (int k = 0; k < c->samples_t; k++)
        c->offset_t[k] = (float)(((k + 0.5) / c->samples_t - 0.5) * spread_t);
    c->share = 1.0f / (float)(c->samples_s * c->samples_t);
}

float sv_shadow_cast_mean(const struct sv_shadow_cast *c, float s, float t, float d)
{
    float sum = 0;
    for (int b = 0; b < c->samples_t; b++)
        for (int a = 0; a < c->samples_s; a++)
            sum += sv_shadow_cast_coverage(c, s + c->offset_s[a], t + c->offset_t[b], d);
    return sum * c->share;
}

void sv_shadow_cast_row_scalar(const struct sv_shadow_cast *c, float s, float t, float d, int count,
                               const float *ground, uint8_t *light)
{
    for (int i = 0; i < count; i++) {
        if (!light[i])
            continue;
        float k = (float)i, g = ground[i];
        float cover =
            sv_shadow_cast_mean(c, (s + k * c->step_s) + g * c->height_s,
                                (t + k * c->step_t) + g * c->height_t, (d + k * c->step_d) + g * c->height_d);
        light[i] = sv_shadow_darken(light[i], (unsigned)(cover + 0.5f));
    }
}

/* ---- which texels ---- */

/* A linear form over world places: value(X) = at + x X.x + y X.y + z X.z, X relative to the window's corner
 * and z0. */
struct form {
    double at, x, y, z;
};

struct job {
    struct sv_shadow_window *window;
    struct sv_shadow_cast cast;
    struct form s, t, d; /* texels less a half, and depth */
    /* The light's ground track: unit direction, drop of a ray a metre of it; rays by their height above z0 at
     * the body's place, and how far the body reaches along and aside of it. */
    double dir_x, dir_y, drop;
    double place_x, place_y; /* relative to the window's corner */
    double along0, along1, aside;
    double top, bottom; /* heights of the highest and lowest ray where along = 0 */
};

static struct form make_form(const struct sv_shadow_window *w, struct sv_vec3 axis, double per_unit,
                             struct sv_vec3 place, double scale, struct sv_vec3 corner)
{
    double k = per_unit / scale;
    struct sv_vec3 from = sv_vec3(w->x0 - place.x, w->y0 - place.y, w->z0 - place.z);
    return (struct form){sv_dot(from, axis) * k - sv_dot(corner, axis) * per_unit, axis.x * k, axis.y * k,
                         axis.z * k};
}

static double form_at(const struct form *f, double x, double y, double z)
{
    return f->at + f->x * x + f->y * y + f->z * z;
}

/* Extent of the body's rays about its place; false when nothing can be cast. */
static bool measure(struct job *job, const struct sv_silhouette *sil, struct sv_vec3 place, double scale)
{
    struct sv_vec3 l = sil->travel;
    if (!(l.z < -FLATTEST) || !(scale > 0) || !(isfinite(place.x) && isfinite(place.y) && isfinite(place.z)))
        return false;
    double level = hypot(l.x, l.y);
    job->drop = -l.z / fmax(level, 1e-9);
    job->dir_x = level > 1e-9 ? l.x / level : 1;
    job->dir_y = level > 1e-9 ? l.y / level : 0;
    job->place_x = place.x - job->window->x0;
    job->place_y = place.y - job->window->y0;
    job->along0 = INFINITY;
    job->along1 = job->top = -INFINITY;
    job->bottom = INFINITY;
    job->aside = 0;
    double edge_s = 0.5 * sil->width_m / sil->width, edge_t = 0.5 * sil->height_m / sil->height;
    for (int k = 0; k < 4; k++) {
        struct sv_vec3 p = sv_madd(sil->corner, sil->right, k & 1 ? sil->width_m + edge_s : -edge_s);
        p = sv_scale(sv_madd(p, sil->down, k & 2 ? sil->height_m + edge_t : -edge_t), scale);
        double along = p.x * job->dir_x + p.y * job->dir_y;
        double height = p.z + along * job->drop;
        job->aside = fmax(job->aside, fabs(p.y * job->dir_x - p.x * job->dir_y));
        job->top = fmax(job->top, height);
        job->bottom = fmin(job->bottom, height);
        job->along0 = fmin(job->along0, along + sil->first_m * scale * level);
    }
    job->top += place.z - job->window->z0;
    job->bottom += place.z - job->window->z0;
    return isfinite(job->top + job->bottom + job->aside + job->along0);
}

/* lo .. hi becomes its part where a + b i is between low and high. */
static void clip_linear(double a, double b, double low, double high, double *lo, double *hi)
{
    if (fabs(b) < 1e-9) {
        if (!(a >= low && a <= high))
            *hi = -INFINITY;
        return;
    }
    double p = (low - a) / b, q = (high - a) / b;
    *lo = fmax(*lo, fmin(p, q));
    *hi = fmin(*hi, fmax(p, q));
}

/* Part of the track (m along it from the place) where rays of heights bottom .. top meet ground that lies
 * between the heights low and high. */
static bool track_of(struct job *job, double low, double high, double *from, double *to)
{
    *from = (job->bottom - high) / job->drop;
    *to = (job->top - low) / job->drop;
    *from = fmax(*from, job->along0);
    double side = job->window->texel_m * job->window->side + job->aside;
    clip_linear(job->place_x, job->dir_x, -job->aside, side, from, to);
    clip_linear(job->place_y, job->dir_y, -job->aside, side, from, to);
    return *to > *from;
}

struct span {
    double x0, y0, x1, y1;
};

/* Rectangle of the track between two places on it. */
static struct span track_box(const struct job *job, double from, double to)
{
    double ax = job->place_x + job->dir_x * from, bx = job->place_x + job->dir_x * to;
    double ay = job->place_y + job->dir_y * from, by = job->place_y + job->dir_y * to;
    double wide_x = job->aside * fabs(job->dir_y), wide_y = job->aside * fabs(job->dir_x);
    return (struct span){fmin(ax, bx) - wide_x, fmin(ay, by) - wide_y, fmax(ax, bx) + wide_x,
                         fmax(ay, by) + wide_y};
}

static int clamp_block(double v, int blocks)
{
    return v > 0 ? v < blocks - 1 ? (int)v : blocks - 1 : 0;
}

static void ground_range(const struct sv_shadow_window *w, struct span box, float range[2])
{
    int blocks = w->side / BLOCK;
    double per_m = 1 / (w->texel_m * BLOCK);
    int i0 = clamp_block(box.x0 * per_m, blocks), i1 = clamp_block(box.x1 * per_m, blocks);
    int j0 = clamp_block(box.y0 * per_m, blocks), j1 = clamp_block(box.y1 * per_m, blocks);
    range[0] = INFINITY;
    range[1] = -INFINITY;
    for (int j = j0; j <= j1; j++)
        for (int i = i0; i <= i1; i++) {
            const float *b = w->blocks[j * blocks + i];
            range[0] = b[0] < range[0] ? b[0] : range[0];
            range[1] = b[1] > range[1] ? b[1] : range[1];
        }
}

static bool outside(const struct sv_shadow_window *w, struct span box)
{
    double side = w->texel_m * w->side;
    return !(box.x0 < side && box.y0 < side && box.x1 > 0 && box.y1 > 0);
}

/* Narrows from .. to by the blocks along the track: skips what no ray has reached, ends where all have
 * landed. */
static bool narrow(const struct job *job, double *from, double *to)
{
    const struct sv_shadow_window *w = job->window;
    double step = w->texel_m * BLOCK, first = INFINITY, last = -INFINITY;
    if (!(*to - *from < STEPS_MAX * step)) /* a body far larger than the window */
        return *to > *from;
    for (double at = *from; at < *to; at += step) {
        double end = fmin(at + step, *to);
        struct span box = track_box(job, at, end);
        if (outside(w, box))
            continue;
        float range[2];
        ground_range(w, box, range);
        if ((double)range[0] > job->top - at * job->drop)
            break;
        if ((double)range[1] < job->bottom - end * job->drop)
            continue;
        first = fmin(first, at);
        last = end;
    }
    *from = first;
    *to = last;
    return last > first;
}

/* ---- rows ---- */

/* Samples that a spread of so many texels wants: each is bilinear, so that it takes in two. */
static int samples_of(double spread)
{
    return spread <= 2 ? 1 : spread <= 4 ? 2 : spread <= 6 ? 3 : 4;
}

/* Columns i of row j where low <= a + i step + j row <= high, as two lines in j. */
struct limits {
    double from, to, per_row;
    bool always; /* step is 0: every column, or none: then `from` is a + j row - low, `to` a + j row - high */
};

static struct limits make_limits(double a, double step, double row, double low, double high)
{
    if (fabs(step) < 1e-9)
        return (struct limits){a - low, a - high, row, true};
    double from = (low - a) / step, to = (high - a) / step;
    return (struct limits){fmin(from, to), fmax(from, to), -row / step, false};
}

static void clip_row(const struct limits *l, int j, double *lo, double *hi)
{
    double from = l->from + l->per_row * j, to = l->to + l->per_row * j;
    if (l->always) {
        *hi = from >= 0 && to <= 0 ? *hi : -INFINITY;
        return;
    }
    *lo = from > *lo ? from : *lo;
    *hi = to < *hi ? to : *hi;
}

static void cast_rows(const struct job *job, double from, double to)
{
    struct sv_shadow_window *w = job->window;
    double m = w->texel_m;
    struct span box = track_box(job, from, to);
    double slack = 0.5 + (double)fabsf(job->cast.offset_s[0]);
    int j0 = (int)fmax(0, floor(box.y0 / m - 0.5)), j1 = (int)fmin(w->side - 1, ceil(box.y1 / m));
    double low_i = fmax(0, floor(box.x0 / m - 0.5)), high_i = fmin(w->side - 1, ceil(box.x1 / m));
    sv_shadow_cast_row *row =
        sv_simd_level() >= SV_SIMD_AVX2 ? sv_shadow_cast_row_avx2 : sv_shadow_cast_row_scalar;
    double tilt0 = fmin(job->s.z * (double)w->ground_min, job->s.z * (double)w->ground_max);
    double tilt1 = fmax(job->s.z * (double)w->ground_min, job->s.z * (double)w->ground_max);
    const struct form *fs = &job->s, *ft = &job->t, *fd = &job->d;
    struct limits across = make_limits(form_at(fs, 0.5 * m, 0.5 * m, 0), fs->x * m, fs->y * m,
                                       -1 - slack - tilt1, job->cast.width + slack - tilt0);
    struct limits along =
        make_limits((0.5 * m - job->place_x) * job->dir_x + (0.5 * m - job->place_y) * job->dir_y,
                    m * job->dir_x, m * job->dir_y, from - m, to + m);
    for (int j = j0; j <= j1; j++) {
        double lo = low_i, hi = high_i;
        clip_row(&across, j, &lo, &hi);
        clip_row(&along, j, &lo, &hi);
        if (!(hi >= lo))
            continue;
        int i0 = (int)lo + ((double)(int)lo < lo), count = (int)hi - i0 + 1;
        if (count <= 0)
            continue;
        /* Whole vectors: what is added lies beside the outline, or a few texels behind where its shadow ends.
         */
        count = (count + 7) / 8 * 8 < w->side - i0 ? (count + 7) / 8 * 8 : w->side - i0;
        double x = (i0 + 0.5) * m, y = (j + 0.5) * m;
        float s = (float)form_at(fs, x, y, 0), t = (float)form_at(ft, x, y, 0),
              d = (float)form_at(fd, x, y, 0);
        size_t at = (size_t)j * (size_t)w->side + (size_t)i0;
        row(&job->cast, s, t, d, count, w->ground + at, w->light + at);
    }
}

void sv_shadow_window_cast(struct sv_shadow_window *window, const struct sv_silhouette *sil,
                           struct sv_vec3 place, double scale)
{
    struct job job;
    double from, to;
    job.window = window;
    if (sil->width < 1 || sil->height < 1 || !(sil->width_m > 0) || !(sil->height_m > 0) ||
        !measure(&job, sil, place, scale))
        return;
    if (!track_of(&job, (double)window->ground_min, (double)window->ground_max, &from, &to) ||
        outside(window, track_box(&job, from, to)))
        return;
    if (window->blocks && job.drop * STEEP_COT < 1 && !narrow(&job, &from, &to))
        return;
    double m = window->texel_m;
    job.s = make_form(window, sil->right, sil->width / sil->width_m, place, scale, sil->corner);
    job.t = make_form(window, sil->down, sil->height / sil->height_m, place, scale, sil->corner);
    job.d = make_form(window, sil->travel, 1, place, scale, sil->corner);
    job.s.at -= 0.5;
    job.t.at -= 0.5;
    double spread_s = hypot(job.s.x, job.s.y) * m, spread_t = hypot(job.t.x, job.t.y) * m;
    job.cast = (struct sv_shadow_cast){.coverage = sil->coverage,
                                       .first = sil->first,
                                       .width = sil->width,
                                       .height = sil->height,
                                       .first_d = (float)sil->first_m,
                                       .step_s = (float)(job.s.x * m),
                                       .step_t = (float)(job.t.x * m),
                                       .step_d = (float)(job.d.x * m),
                                       .height_s = (float)job.s.z,
                                       .height_t = (float)job.t.z,
                                       .height_d = (float)job.d.z,
                                       .samples_s = samples_of(spread_s),
                                       .samples_t = samples_of(spread_t)};
    sv_shadow_cast_spread(&job.cast, spread_s, spread_t);
    cast_rows(&job, from, to);
}
