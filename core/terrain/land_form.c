/* land_form.c - slope, curvature, wetness and sea of a height field, each a few passes over the grid. */
#include "core/terrain/land_form.h"

#include <stdint.h>
#include <stdlib.h>
#include <string.h>

enum { SIDE_MAX = 4096, BUCKETS = 65536 };

static size_t count_of(const struct sv_land_form *form)
{
    return (size_t)form->width * (size_t)form->height;
}

static struct sv_land_sample *sample_at(const struct sv_land_form *form, int i, int j)
{
    return form->samples + (size_t)j * (size_t)form->width + (size_t)i;
}

static int clamp_int(int v, int lo, int hi)
{
    return v < lo ? lo : v > hi ? hi : v;
}

/* ---- heights and slopes ---- */

static int reduced_side(int side, int step)
{
    return (side - 2) / step + 2;
}

/* Mean of the field's heights around a place in its sample coordinates, over step x step samples. */
static float mean_height(const struct sv_heightfield *f, double x, double y, int step)
{
    int i0 = (int)(x + 0.5) - step / 2, j0 = (int)(y + 0.5) - step / 2;
    double sum = 0;
    for (int j = j0; j < j0 + step; j++)
        for (int i = i0; i < i0 + step; i++)
            sum += (double)f->h[(size_t)clamp_int(j, 0, f->height - 1) * (size_t)f->width +
                                (size_t)clamp_int(i, 0, f->width - 1)];
    return (float)(sum / ((double)step * step));
}

static void fill_heights(const struct sv_heightfield *f, struct sv_land_form *form, int step)
{
    double fx = (double)(f->width - 1) / (form->width - 1), fy = (double)(f->height - 1) / (form->height - 1);
    form->dx = f->dx * fx;
    form->dy = f->dy * fy;
    for (int j = 0; j < form->height; j++)
        for (int i = 0; i < form->width; i++)
            sample_at(form, i, j)->z = (float)(f->z0 + (double)mean_height(f, i * fx, j * fy, step));
}

static void fill_slopes(struct sv_land_form *form)
{
    int w = form->width, h = form->height;
    for (int j = 0; j < h; j++)
        for (int i = 0; i < w; i++) {
            int a = clamp_int(i - 1, 0, w - 1), b = clamp_int(i + 1, 0, w - 1);
            int c = clamp_int(j - 1, 0, h - 1), d = clamp_int(j + 1, 0, h - 1);
            struct sv_land_sample *s = sample_at(form, i, j);
            s->east = (float)(((double)sample_at(form, b, j)->z - (double)sample_at(form, a, j)->z) /
                              ((b - a) * form->dx));
            s->north = (float)(((double)sample_at(form, i, d)->z - (double)sample_at(form, i, c)->z) /
                               ((d - c) * form->dy));
        }
}

/* ---- curvature: height against a blurred height ---- */

/* Running mean of `count` values `stride` apart over -radius .. radius, ends repeated. */
static void blur_line(const float *in, float *out, int count, size_t stride, int radius)
{
    double sum = 0;
    for (int k = -radius; k <= radius; k++)
        sum += (double)in[(size_t)clamp_int(k, 0, count - 1) * stride];
    for (int k = 0; k < count; k++) {
        out[(size_t)k * stride] = (float)(sum / (2 * radius + 1));
        sum += (double)in[(size_t)clamp_int(k + radius + 1, 0, count - 1) * stride];
        sum -= (double)in[(size_t)clamp_int(k - radius, 0, count - 1) * stride];
    }
}

/* Two box blurs each way: near to a Gauss. work is of the same size. */
static void blur(float *values, float *work, int width, int height, int radius)
{
    for (int pass = 0; pass < 2; pass++) {
        for (int j = 0; j < height; j++)
            blur_line(values + (size_t)j * (size_t)width, work + (size_t)j * (size_t)width, width, 1, radius);
        for (int i = 0; i < width; i++)
            blur_line(work + i, values + i, height, (size_t)width, radius);
    }
}

static void fill_curvature(struct sv_land_form *form, float *a, float *b)
{
    int broad = clamp_int((int)(150 / form->dx), 8, 40);
    double cell = sqrt(form->dx * form->dy);
    for (int scale = 0; scale < 2; scale++) {
        int radius = scale ? broad : 2;
        for (size_t k = 0; k < count_of(form); k++)
            a[k] = form->samples[k].z;
        blur(a, b, form->width, form->height, radius);
        for (size_t k = 0; k < count_of(form); k++) {
            float above = (float)((double)(form->samples[k].z - a[k]) / (radius * cell));
            *(scale ? &form->samples[k].broad : &form->samples[k].fine) = above;
        }
    }
}

/* ---- wetness ---- */

/* Sample numbers from the highest to the lowest, by buckets of height. */
static void order_by_height(const struct sv_land_form *form, uint32_t *order, uint32_t *starts)
{
    float lo = INFINITY, hi = -INFINITY;
    for (size_t k = 0; k < count_of(form); k++) {
        lo = fminf(lo, form->samples[k].z);
        hi = fmaxf(hi, form->samples[k].z);
    }
    double scale = hi > lo ? (BUCKETS - 1) / ((double)hi - (double)lo) : 0;
    memset(starts, 0, (BUCKETS + 1) * sizeof *starts);
    for (size_t k = 0; k < count_of(form); k++)
        starts[(int)(((double)hi - (double)form->samples[k].z) * scale) + 1]++;
    for (int k = 0; k < BUCKETS; k++)
        starts[k + 1] += starts[k];
    for (size_t k = 0; k < count_of(form); k++)
        order[starts[(int)(((double)hi - (double)form->samples[k].z) * scale)]++] = (uint32_t)k;
}

/* Hands a cell's catchment on to its lower neighbours, in proportion to the slope there. */
static void flow_from(const struct sv_land_form *form, float *area, int i, int j)
{
    static const int steps[8][2] = {{1, 0}, {1, 1}, {0, 1}, {-1, 1}, {-1, 0}, {-1, -1}, {0, -1}, {1, -1}};
    double share[8], sum = 0, z = (double)sample_at(form, i, j)->z;
    for (int k = 0; k < 8; k++) {
        int a = i + steps[k][0], b = j + steps[k][1];
        share[k] = 0;
        if (a < 0 || b < 0 || a >= form->width || b >= form->height)
            continue;
        double drop = z - (double)sample_at(form, a, b)->z;
        if (drop > 0)
            share[k] = drop / hypot(steps[k][0] * form->dx, steps[k][1] * form->dy);
        sum += share[k];
    }
    if (!(sum > 0))
        return;
    float own = area[(size_t)j * (size_t)form->width + (size_t)i];
    for (int k = 0; k < 8; k++)
        if (share[k] > 0)
            area[(size_t)(j + steps[k][1]) * (size_t)form->width + (size_t)(i + steps[k][0])] +=
                own * (float)(share[k] / sum);
}

static void fill_wetness(struct sv_land_form *form, float *area, float *work, uint32_t *order,
                         uint32_t *starts)
{
    double cell = sqrt(form->dx * form->dy);
    order_by_height(form, order, starts);
    for (size_t k = 0; k < count_of(form); k++)
        area[k] = 1;
    for (size_t k = 0; k < count_of(form); k++)
        flow_from(form, area, (int)(order[k] % (uint32_t)form->width),
                  (int)(order[k] / (uint32_t)form->width));
    for (size_t k = 0; k < count_of(form); k++) {
        const struct sv_land_sample *s = &form->samples[k];
        double slope = sqrt((double)(s->east * s->east + s->north * s->north));
        area[k] = (float)log((double)area[k] * cell / fmax(slope, 0.02));
    }
    blur(area, work, form->width, form->height, clamp_int((int)(9 / cell), 1, 6));
    for (size_t k = 0; k < count_of(form); k++) { /* 5: a ridge of 10 m cells; 10.5: a brook */
        double t = sv_clamp(((double)area[k] - 5.0) / 5.5, 0, 1);
        form->samples[k].wet = (float)(t * t * (3 - 2 * t));
    }
}

/* ---- sea ---- */

/* At or below sea level, and as flat as a DEM's sea is: within a metre (whole-metre data) or 2 % of a small
 * cell. */
static bool looks_like_sea(const struct sv_land_form *form, int i, int j)
{
    float z = sample_at(form, i, j)->z, lo = z, hi = z;
    float allowed = (float)sv_clamp(0.035 * fmin(form->dx, form->dy), 0.02, 1.01);
    if (z > 0.25f)
        return false;
    for (int b = j - 1; b <= j + 1; b++)
        for (int a = i - 1; a <= i + 1; a++) {
            float n = sample_at(form, clamp_int(a, 0, form->width - 1), clamp_int(b, 0, form->height - 1))->z;
            lo = fminf(lo, n);
            hi = fmaxf(hi, n);
        }
    return z - lo <= allowed && (hi - z <= allowed || z <= 0);
}

/* Marks the connected samples around `seed` that bear seed's mark with `to`, another one; returns how many.
 * stack holds every sample at most once. */
static size_t flood(const struct sv_land_form *form, uint8_t *mark, uint32_t seed, uint8_t to,
                    uint32_t *stack)
{
    size_t height = 0, count = 0;
    uint32_t w = (uint32_t)form->width, n = (uint32_t)count_of(form);
    uint8_t from = mark[seed];
    stack[height++] = seed;
    mark[seed] = to;
    while (height) {
        uint32_t k = stack[--height], x = k % w;
        uint32_t next[4] = {x ? k - 1 : n, x + 1 < w ? k + 1 : n, k >= w ? k - w : n, k + w < n ? k + w : n};
        count++;
        for (int d = 0; d < 4; d++)
            if (next[d] < n && mark[next[d]] == from) {
                mark[next[d]] = to;
                stack[height++] = next[d];
            }
    }
    return count;
}

/* Distance to the sea by two sweeps of a chamfer (Borgefors 1986), in cells' metres. */
static void fill_shore(struct sv_land_form *form)
{
    double dx = form->dx, dy = form->dy, diagonal = hypot(dx, dy);
    for (int pass = 0; pass < 2; pass++)
        for (int q = 0; q < form->height; q++)
            for (int p = 0; p < form->width; p++) {
                int i = pass ? form->width - 1 - p : p, j = pass ? form->height - 1 - q : q,
                    s = pass ? 1 : -1;
                const int around[4][2] = {{s, 0}, {0, s}, {s, s}, {-s, s}};
                const double cost[4] = {dx, dy, diagonal, diagonal};
                struct sv_land_sample *own = sample_at(form, i, j);
                for (int d = 0; d < 4; d++) {
                    int a = i + around[d][0], b = j + around[d][1];
                    if (a >= 0 && b >= 0 && a < form->width && b < form->height)
                        own->shore = fminf(own->shore, sample_at(form, a, b)->shore + (float)cost[d]);
                }
            }
}

/* Level to the centimetre, and low: filled voids of a sea lie at the height of its rim. */
static bool looks_like_filled_sea(const struct sv_land_form *form, int i, int j)
{
    float z = sample_at(form, i, j)->z;
    bool level = z <= 10;
    for (int b = j - 1; b <= j + 1 && level; b++)
        for (int a = i - 1; a <= i + 1; a++)
            level =
                level &&
                fabsf(
                    sample_at(form, clamp_int(a, 0, form->width - 1), clamp_int(b, 0, form->height - 1))->z -
                    z) < 0.01f;
    return level;
}

/* Makes sea (mark 3) of the connected regions of mark 1 that have at least so many samples, nothing (0) of
 * the others. */
static void keep_large(const struct sv_land_form *form, uint8_t *mark, size_t least, uint32_t *stack)
{
    for (size_t k = 0; k < count_of(form); k++)
        if (mark[k] == 1)
            flood(form, mark, (uint32_t)k, flood(form, mark, (uint32_t)k, 2, stack) < least ? 0 : 3, stack);
}

/* Flats near sea level of at least 0.05 km^2 and 300 samples are sea, level ones up to 10 m if ten times as
 * large. A field that is level everywhere tells nothing, and is land. */
static void fill_sea(struct sv_land_form *form, uint8_t *mark, uint32_t *stack, double range_m)
{
    double least = fmax(300, 5e4 / (form->dx * form->dy));
    for (int j = 0; j < form->height; j++)
        for (int i = 0; i < form->width; i++)
            mark[(size_t)j * (size_t)form->width + (size_t)i] = range_m > 0.01 && looks_like_sea(form, i, j);
    keep_large(form, mark, (size_t)least, stack);
    for (int j = 0; j < form->height; j++)
        for (int i = 0; i < form->width; i++) {
            uint8_t *m = &mark[(size_t)j * (size_t)form->width + (size_t)i];
            *m = *m == 0 && range_m > 0.01 && looks_like_filled_sea(form, i, j) ? 1 : *m;
        }
    keep_large(form, mark, (size_t)(10 * least), stack);
    for (size_t k = 0; k < count_of(form); k++) {
        form->samples[k].sea = mark[k] == 3;
        form->samples[k].shore = mark[k] == 3 ? 0 : 1000;
    }
    fill_shore(form);
}

/* ---- life ---- */

enum sv_status sv_land_form_init(const struct sv_heightfield *field, struct sv_land_form *form,
                                 struct sv_error *error)
{
    int longest = field->width > field->height ? field->width : field->height;
    int step = (longest + SIDE_MAX - 1) / SIDE_MAX;
    struct sv_land_form made = {reduced_side(field->width, step), reduced_side(field->height, step), 0, 0,
                                NULL};
    size_t n = count_of(&made);
    made.samples = calloc(n, sizeof *made.samples);
    float *a = malloc(n * sizeof *a), *b = malloc(n * sizeof *b);
    uint32_t *order = malloc(n * sizeof *order), *starts = malloc((BUCKETS + 1) * sizeof *starts);
    uint8_t *mark = malloc(n);
    enum sv_status status = SV_OK;
    if (!made.samples || !a || !b || !order || !starts || !mark) {
        status = sv_fail(error, SV_ENOMEM, "terrain", "no memory to colour %d x %d samples", field->width,
                         field->height);
        sv_land_form_finish(&made);
        goto done;
    }
    fill_heights(field, &made, step);
    fill_slopes(&made);
    fill_curvature(&made, a, b);
    fill_wetness(&made, a, b, order, starts);
    fill_sea(&made, mark, order, (double)field->h_max - (double)field->h_min);
    *form = made;
done:
    free(a);
    free(b);
    free(order);
    free(starts);
    free(mark);
    return status;
}

void sv_land_form_finish(struct sv_land_form *form)
{
    free(form->samples);
    *form = (struct sv_land_form){0};
}

static float mix4(const float v[4], float fx, float fy)
{
    float low = v[0] + (v[1] - v[0]) * fx, high = v[2] + (v[3] - v[2]) * fx;
    return low + (high - low) * fy;
}

struct sv_land_sample sv_land_form_at(const struct sv_land_form *form, double u, double v)
{
    double x = sv_clamp(u, 0, 1) * (form->width - 1), y = sv_clamp(v, 0, 1) * (form->height - 1);
    int i = clamp_int((int)x, 0, form->width - 2), j = clamp_int((int)y, 0, form->height - 2);
    float fx = (float)(x - i), fy = (float)(y - j);
    const struct sv_land_sample *a = sample_at(form, i, j), *b = a + 1, *c = a + form->width, *d = c + 1;
    struct sv_land_sample r;
#define MIX(field) r.field = mix4((const float[4]){a->field, b->field, c->field, d->field}, fx, fy)
    MIX(z);
    MIX(east);
    MIX(north);
    MIX(fine);
    MIX(broad);
    MIX(wet);
    MIX(sea);
    MIX(shore);
#undef MIX
    return r;
}
