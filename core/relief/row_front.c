/* row_front.c - see row_front.h: the march, the strips in which light along x is turned, scalar kernels. */
#include "core/relief/row_front.h"

#include <math.h>
#include <stdbool.h>
#include <stdlib.h>
#include <string.h>

#include "core/relief/row_front_kernel.h"

enum {
    REBASE = 32, /* rows after which rays are counted from a new row: bounds the lift */
    STRIP = 64, /* columns turned at once: whole lines of cache; 16 takes 1.5 times as long, 32 and 128 1.1 */
    PAD = 16    /* floats beside each buffer, void: windows may read one beyond either end */
};

/* ---- scalar kernels ---- */

static inline float larger(float a, float b)
{
    return a > b ? a : b;
}

static int take_scalar(int count, const float *height, const float *initial, float *own, float *shadow,
                       float *caster)
{
    float least = INFINITY;
    for (int i = 0; i < count; i++)
        own[i] = fabsf(height[i]) < -SV_ROW_FRONT_NONE ? height[i] : SV_FRONT_VOID;
    for (int i = 0; initial && i < count; i++) {
        float p = initial[i] < -SV_ROW_FRONT_NONE ? initial[i] : -SV_ROW_FRONT_NONE;
        shadow[i] = initial[i] > SV_ROW_FRONT_NONE ? p : SV_FRONT_VOID;
        caster[i] = larger(own[i], shadow[i]);
    }
    for (int i = 0; i < count; i++)
        least = caster[i] < least ? caster[i] : least;
    return least > SV_FRONT_REAL;
}

/* Half-way rule of row_front.h: both real: linear; else the nearer one, real or not. */
static inline float between(float a, float b, float weight, float nearer)
{
    float mixed = a + (b - a) * weight;
    return (a < b ? a : b) > SV_FRONT_REAL ? mixed : nearer;
}

static void cross_scalar(int count, const float *before, const float *after, float t, float lift, float *ray)
{
    const float *nearer = t < 0.5f ? before : after;
    for (int i = 0; i < count; i++)
        ray[i] = larger(between(before[i], after[i], t, nearer[i]) + lift, ray[i]);
}

/* What the two rays beside sample i bring: their mean at the sample, but no more than own height + the mean
 * of how deep the rays' own surface lies in shadow. The first alone would darken the foot of a wall that runs
 * along the light (its kink lifts the mean), the second alone would follow kinks that the shadow does not
 * have. */
static inline float arrive(const struct sv_front_row *row, int i, float f, float left, float right)
{
    const float *c = row->caster;
    float in = between(row->ray[i], row->ray[i - 1], f, f < 0.5f ? row->ray[i] : row->ray[i - 1]) - row->lift;
    float surface = right + (left - right) * f, relative = in + (c[i] - surface);
    bool known = (left < right ? left : right) > SV_FRONT_REAL && c[i] > SV_FRONT_REAL;
    return known && relative < in ? relative : in;
}

/* The sample's own ray through the row before and half way to it, exactly. */
static inline float arrive_near(const struct sv_front_row *row, int i)
{
    const float *c = row->caster, *b = row->before;
    int n = i + row->side;
    float slant = row->slant, half = 0.5f * slant;
    float far = between(b[i], b[n], slant, slant < 0.5f ? b[i] : b[n]);
    float middle = between(between(c[i], c[n], half, c[i]), between(b[i], b[n], half, b[i]), 0.5f, far);
    return larger(far - row->drop, middle - 0.5f * row->drop);
}

static void row_scalar(const struct sv_front_row *row)
{
    const float f = row->fraction, lift = row->lift;
    const float *ray = row->ray, *c = row->caster;
    for (int i = 0; i < row->count; i++) {
        float left = between(c[i - 1], c[i], f, f < 0.5f ? c[i - 1] : c[i]);
        float right = between(c[i], c[i + 1], f, f < 0.5f ? c[i] : c[i + 1]);
        float in = larger(arrive(row, i, f, left, right), arrive_near(row, i));
        row->ray_next[i] = larger(right + lift, ray[i]);
        if (row->initial)
            in = larger(in, row->initial[i]);
        in = larger(in, SV_ROW_FRONT_NONE);
        if (row->incoming)
            row->incoming[i] = in;
        if (row->height)
            row->height[i] = larger(row->own[i], in);
        if (row->lit)
            row->lit[i] = row->own[i] > SV_FRONT_REAL && row->own[i] < in - row->bias ? 0 : 255;
    }
}

/* The longer side is the outer loop: the large array of the two has rows a multiple of some power of two
 * apart, which share few sets of the cache, so that each of its lines must be done with before the next. */
static void turn_scalar(int columns, int rows, const float *in, int64_t in_stride, float *out,
                        int64_t out_stride)
{
    if (rows >= columns)
        for (int j = 0; j < rows; j++)
            for (int i = 0; i < columns; i++)
                out[i * out_stride + j] = in[j * in_stride + i];
    else
        for (int i = 0; i < columns; i++)
            for (int j = 0; j < rows; j++)
                out[i * out_stride + j] = in[j * in_stride + i];
}

static void turn_bytes_scalar(int columns, int rows, const uint8_t *in, int64_t in_stride, uint8_t *out,
                              int64_t out_stride)
{
    for (int i = 0; i < columns; i++)
        for (int j = 0; j < rows; j++)
            out[i * out_stride + j] = in[j * in_stride + i];
}

const struct sv_front_kernels sv_front_scalar = {take_scalar, cross_scalar, row_scalar, turn_scalar,
                                                 turn_bytes_scalar};

/* ---- the march ---- */

struct march {
    const struct sv_front_kernels *kernels;
    int count, rows; /* samples a row, rows along the light */
    double shift;    /* m: samples to the side a row, -1 .. 1 */
    double drop;     /* m a row, >= 0 */
    float bias;
    int64_t row;      /* next row, counted along the light */
    int64_t origin;   /* index in ray[] of ray 0 */
    float *ray[2];    /* count + rows + pads */
    int now;          /* which of ray[] is current */
    float *own[2];    /* heights of this row and the one before, with pads */
    float *caster[2]; /* the same as own without initial */
    bool whole;       /* the row before had no hole */
    float *shadow;
    float *block;
};

static float *padded(float **next, size_t count)
{
    float *p = *next + PAD;
    *next += count + 2 * PAD;
    for (int i = 1; i <= PAD; i++)
        p[-i] = SV_FRONT_VOID;
    for (size_t i = 0; i < count + PAD; i++)
        p[i] = SV_FRONT_VOID;
    return p;
}

static bool march_init(struct march *m, bool initial)
{
    size_t n = (size_t)m->count, rays = n + (size_t)m->rows;
    size_t rows = initial ? 5 : 2;
    m->block = malloc(sizeof(float) * (2 * (rays + 2 * PAD) + rows * (n + 2 * PAD)));
    if (!m->block)
        return false;
    float *next = m->block;
    for (int k = 0; k < 2; k++)
        m->ray[k] = padded(&next, rays);
    for (int k = 0; k < 2; k++) {
        m->own[k] = padded(&next, n);
        m->caster[k] = initial ? padded(&next, n) : m->own[k];
    }
    m->shadow = initial ? padded(&next, n) : NULL;
    m->origin = m->shift > 0 ? m->rows : 0;
    m->row = 0;
    m->now = 0;
    return true;
}

/* Rays between the row before and this one: where they cross a column of samples. */
static void march_cross(struct march *m, const float *before, const float *after, int64_t whole, double lift)
{
    double last = m->shift * (double)(m->row - 1), last_whole = floor(last);
    if ((int64_t)last_whole == whole)
        return;
    double f = last - last_whole;
    double t = m->shift > 0 ? (1.0 - f) / m->shift : f / -m->shift;
    if (!(t > 1e-9 && t < 1.0 - 1e-9))
        return; /* on the row itself, which is sampled anyway */
    float *ray = m->ray[m->now] + m->origin - whole - (m->shift < 0 ? 1 : 0);
    m->kernels->cross(m->count, before, after, (float)t, (float)(lift - (1.0 - t) * m->drop), ray);
}

/* The whole window is counted from this row from now on. */
static void march_rebase(struct march *m, int64_t whole)
{
    float *ray = m->ray[m->now] + m->origin - whole, by = (float)(REBASE * m->drop);
    for (int i = -2; i <= m->count; i++)
        ray[i] -= by;
}

static void march_step(struct march *m, const float *height, const float *initial, float *out,
                       float *incoming, uint8_t *lit)
{
    int odd = (int)(m->row & 1);
    float *own = m->own[odd], *caster = m->caster[odd], *before = m->caster[!odd];
    bool whole = m->kernels->take(m->count, height, initial, own, m->shadow, caster);
    double at = m->shift * (double)m->row, floor_at = floor(at);
    int64_t s = (int64_t)floor_at, phase = m->row % REBASE;
    if (m->row > 0) {
        if (phase == 0)
            march_rebase(m, s);
        march_cross(m, before, caster, s, (double)phase * m->drop);
    }
    float f = (float)(at - floor_at), lift = (float)((double)phase * m->drop);
    float *ray = m->ray[m->now] + m->origin - s, *next = m->ray[!m->now] + m->origin - s;
    struct sv_front_row row = {.count = m->count,
                               .whole = whole && m->whole,
                               .own = own,
                               .caster = caster,
                               .before = before,
                               .initial = initial ? m->shadow : NULL,
                               .ray = ray,
                               .ray_next = next,
                               .side = m->shift > 0 ? -1 : 1,
                               .slant = (float)fabs(m->shift),
                               .fraction = f,
                               .lift = lift,
                               .drop = (float)m->drop,
                               .bias = m->bias,
                               .height = out,
                               .incoming = incoming,
                               .lit = lit};
    m->kernels->row(&row);
    /* the ray before the first sample: only that sample is beside it */
    next[-1] =
        larger(between(SV_FRONT_VOID, caster[0], f, f < 0.5f ? SV_FRONT_VOID : caster[0]) + lift, ray[-1]);
    m->now = !m->now;
    m->whole = whole;
    m->row++;
}

/* Light along y: rows as they lie. */
static void march_rows(struct march *m, const struct sv_row_front *field, float *shadow_height,
                       float *incoming, uint8_t *lit)
{
    size_t w = (size_t)field->width;
    for (int r = 0; r < field->height; r++) {
        size_t at = w * (size_t)(field->travel.y > 0 ? r : field->height - 1 - r);
        march_step(m, field->height_m + at, field->initial ? field->initial + at : NULL,
                   shadow_height ? shadow_height + at : NULL, incoming ? incoming + at : NULL,
                   lit ? lit + at : NULL);
    }
}

/* Columns of the next strip when `done` are done, counted along the light: strips end where lines of cache
 * do, so that none is fetched twice. */
static int strip_columns(int width, int done, int edge, bool forward)
{
    int left = width - done, at = forward ? done : left;
    int past = ((at - edge) % STRIP + STRIP) % STRIP;
    int columns = forward || past == 0 ? STRIP - (forward ? past : 0) : past;
    return columns < left ? columns : left;
}

/* Light along x: STRIP columns at a time are turned into rows, marched, and turned back while they are in
 * cache: the field is read once and written once, as for light along y. */
static enum sv_status march_columns(struct march *m, const struct sv_row_front *field, float *shadow_height,
                                    float *incoming, uint8_t *lit, struct sv_error *error)
{
    size_t w = (size_t)field->width, h = (size_t)field->height, n = h + PAD;
    float *strip = malloc(STRIP * n * (4 * sizeof(float) + 1));
    if (!strip)
        return sv_fail(error, SV_ENOMEM, "height", "no memory for a strip of %d x %zu samples", (int)STRIP,
                       h);
    float *in_h = strip, *in_i = strip + STRIP * n, *out_p = strip + 2 * STRIP * n,
          *out_in = strip + 3 * STRIP * n;
    uint8_t *out_lit = (uint8_t *)(strip + 4 * STRIP * n);
    bool forward = field->travel.x > 0;
    int edge =
        (int)((64 - (uintptr_t)field->height_m % 64) / sizeof(float)) % 16; /* a line of cache begins */
    for (int done = 0, columns; done < field->width; done += columns) {
        columns = strip_columns(field->width, done, edge, forward);
        size_t x = (size_t)(forward ? done : field->width - done - columns);
        m->kernels->turn(columns, (int)h, field->height_m + x, (int64_t)w, in_h, (int64_t)n);
        if (field->initial)
            m->kernels->turn(columns, (int)h, field->initial + x, (int64_t)w, in_i, (int64_t)n);
        for (int c = 0; c < columns; c++) {
            size_t at = n * (size_t)(forward ? c : columns - 1 - c);
            march_step(m, in_h + at, field->initial ? in_i + at : NULL, shadow_height ? out_p + at : NULL,
                       incoming ? out_in + at : NULL, lit ? out_lit + at : NULL);
        }
        if (shadow_height)
            m->kernels->turn((int)h, columns, out_p, (int64_t)n, shadow_height + x, (int64_t)w);
        if (incoming)
            m->kernels->turn((int)h, columns, out_in, (int64_t)n, incoming + x, (int64_t)w);
        if (lit)
            m->kernels->turn_bytes((int)h, columns, out_lit, (int64_t)n, lit + x, (int64_t)w);
    }
    free(strip);
    return SV_OK;
}

/* ---- answers that need no march ---- */

/* Light from below, or straight down: no sample shades another. */
static void answer_alone(const struct sv_row_front *field, float *shadow_height, float *incoming,
                         uint8_t *lit)
{
    const float top = -SV_ROW_FRONT_NONE;
    bool below = field->travel.z > 0;
    size_t n = (size_t)field->width * (size_t)field->height;
    for (size_t i = 0; i < n; i++) {
        float own, shadow = SV_FRONT_VOID, caster;
        (void)take_scalar(1, field->height_m + i, field->initial ? field->initial + i : NULL, &own, &shadow,
                          field->initial ? &caster : &own);
        float in = below ? top : larger(shadow, SV_ROW_FRONT_NONE);
        if (incoming)
            incoming[i] = in;
        if (shadow_height)
            shadow_height[i] = larger(own, in);
        if (lit)
            lit[i] = own > SV_FRONT_REAL && (below || own < in - field->bias_m) ? 0 : 255;
    }
}

static enum sv_status check(const struct sv_row_front *field, struct sv_error *error)
{
    if (field->width < 1 || field->height < 1)
        return sv_fail(error, SV_EINVAL, "width", "field of %d x %d samples; each side must be at least 1",
                       field->width, field->height);
    if (!(field->dx >= 1e-9 && field->dx <= 1e9 && field->dy >= 1e-9 && field->dy <= 1e9))
        return sv_fail(error, SV_EINVAL, "dx", "sample distances %g, %g m; each must be 1e-9 .. 1e9 m",
                       field->dx, field->dy);
    double length = sv_length(field->travel);
    if (!(fabs(length - 1.0) <= 1e-6))
        return sv_fail(error, SV_EINVAL, "travel",
                       "light vector (%g, %g, %g) of length %g; must be a unit vector", field->travel.x,
                       field->travel.y, field->travel.z, length);
    if (!(field->bias_m >= 0 && field->bias_m <= -SV_ROW_FRONT_NONE))
        return sv_fail(error, SV_EINVAL, "bias_m", "bias %g m; must be 0 .. 1e6 m", (double)field->bias_m);
    if (!field->height_m)
        return sv_fail(error, SV_EINVAL, "height_m", "no heights given");
    return SV_OK;
}

enum sv_status sv_row_front_at(enum sv_simd level, const struct sv_row_front *field, float *shadow_height,
                               float *incoming, uint8_t *lit, struct sv_error *error)
{
    enum sv_status status = check(field, error);
    if (status != SV_OK)
        return status;
    /* samples a second along either axis; the larger one is marched along */
    double along_x = field->travel.x / field->dx, along_y = field->travel.y / field->dy;
    bool rows = fabs(along_y) >= fabs(along_x);
    double major = fabs(rows ? along_y : along_x), drop = -field->travel.z / major;
    if (field->travel.z > 0 || !(drop < -2.0 * SV_ROW_FRONT_NONE)) {
        answer_alone(field, shadow_height, incoming, lit);
        return SV_OK;
    }
    struct march m = {.kernels = level >= SV_SIMD_AVX2 ? &sv_front_avx2 : &sv_front_scalar,
                      .count = rows ? field->width : field->height,
                      .rows = rows ? field->height : field->width,
                      .shift = (rows ? along_x : along_y) / major,
                      .drop = drop,
                      .bias = field->bias_m};
    if (!march_init(&m, field->initial != NULL))
        return sv_fail(error, SV_ENOMEM, "width", "no memory for a front over %d x %d samples", field->width,
                       field->height);
    if (rows)
        march_rows(&m, field, shadow_height, incoming, lit);
    else
        status = march_columns(&m, field, shadow_height, incoming, lit, error);
    free(m.block);
    return status;
}

enum sv_status sv_row_front(const struct sv_row_front *field, float *shadow_height, float *incoming,
                            uint8_t *lit, struct sv_error *error)
{
    return sv_row_front_at(sv_simd_level(), field, shadow_height, incoming, lit, error);
}
