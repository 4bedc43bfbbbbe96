/* shadow_fields.c - see shadow_fields.h. */
#include "shadow_fields.h"

#include <math.h>
#include <stdbool.h>
#include <stdlib.h>

#include "core/base/noise.h"

static double hills(double x, double y)
{
    return 9 * sin(x * 9 + 1) * cos(y * 7) + 4 * sin(x * 17 + y * 13);
}
static double ridges(double x, double y)
{
    /* steepest 56 degrees: no light of the list is parallel to a whole slope, where rounding alone would
     * decide */
    return 5 * sin(30 * (x * 0.8 + y * 0.6)) + 3 * x;
}
static double bowl(double x, double y)
{
    return 60 * ((x - 0.5) * (x - 0.5) + (y - 0.45) * (y - 0.45));
}
static double peaks(double x, double y)
{
    double h = 0;
    for (int k = 0; k < 7; k++) {
        double cx = fmod(0.37 + 0.618 * k, 1), cy = fmod(0.21 + 0.414 * k, 1), w = 0.04 + 0.012 * k;
        h += (8 + 3 * k) * exp(-((x - cx) * (x - cx) + (y - cy) * (y - cy)) / (w * w));
    }
    return h;
}
static double terrain(double x, double y)
{
    double h = 0, amplitude = 14, frequency = 3;
    for (int k = 0; k < 4; k++, amplitude *= 0.45, frequency *= 2)
        h += amplitude * sv_noise_at(sv_mix64(77u + (uint64_t)k), x * frequency, y * frequency).v;
    return h;
}
static double waves(double x, double y)
{
    double r = hypot(x - 0.3, y - 0.6);
    return 5 * cos(40 * r) * exp(-2 * r);
}
static double terraces(double x, double y)
{
    return 4 * floor(4 * x + 3 * y);
}
static double stairs(double x, double y)
{
    (void)y;
    return 3 * floor(8 * x);
}
static double blocks(double x, double y)
{
    return (((int)floor(x * 6) + (int)floor(y * 6)) & 1) * 8.0;
}
static double plateau(double x, double y)
{
    return fabs(x - 0.5) < 0.2 && fabs(y - 0.4) < 0.15 ? 12 : 0;
}
static double wall(double x, double y)
{
    return fabs(0.8 * x + 0.6 * y - 0.7) < 0.04 ? 15 : 0;
}
static double city(double x, double y)
{
    double u = x * 7 - floor(x * 7), v = y * 7 - floor(y * 7);
    uint64_t cell = (uint64_t)floor(x * 7) * 16 + (uint64_t)floor(y * 7);
    return u > 0.25 && u < 0.85 && v > 0.2 && v < 0.75 ? 3 + (double)(sv_mix64(cell) % 16) : 0;
}
static double domes(double x, double y)
{
    double u = x * 3 - floor(x * 3) - 0.5, v = y * 3 - floor(y * 3) - 0.5, r = 0.16 - u * u - v * v;
    return r > 0 ? 33 * sqrt(r) : 0;
}
static double columns(double x, double y)
{
    double u = x * 4 - floor(x * 4) - 0.5, v = y * 4 - floor(y * 4) - 0.5;
    return u * u + v * v < 0.05 ? 14 : 3 * exp(-4 * (u * u + v * v));
}
static double noise(double x, double y)
{
    uint64_t at = (uint64_t)(x * 4096) * 8192 + (uint64_t)(y * 4096);
    return (double)(sv_mix64(at) >> 11) * 0x1p-53 * 10;
}

const struct shadow_field shadow_fields[SHADOW_FIELDS] = {
    {"hills", FIELD_SMOOTH, 128, 128, 1, 1, hills},
    {"hills 256", FIELD_SMOOTH, 256, 256, 1, 1, hills},
    {"hills 3:1", FIELD_SMOOTH, 90, 150, 3, 1, hills},
    {"ridges", FIELD_SMOOTH, 128, 128, 1, 1, ridges},
    {"bowl", FIELD_SMOOTH, 128, 96, 1, 1, bowl},
    {"peaks", FIELD_SMOOTH, 128, 128, 1, 1, peaks},
    {"terrain", FIELD_SMOOTH, 192, 160, 30, 30, terrain},
    {"waves 1:2", FIELD_SMOOTH, 160, 96, 0.5, 1, waves},
    {"terraces", FIELD_STEPPED, 128, 128, 1, 1, terraces},
    {"stairs", FIELD_STEPPED, 128, 128, 1, 1, stairs},
    {"blocks", FIELD_STEPPED, 128, 128, 1, 1, blocks},
    {"plateau", FIELD_STEPPED, 128, 128, 1, 1, plateau},
    {"wall", FIELD_STEPPED, 128, 128, 1, 1, wall},
    {"domes", FIELD_OBJECTS, 128, 128, 1, 1, domes},
    {"city 1:2", FIELD_OBJECTS, 192, 128, 1, 2, city},
    {"columns", FIELD_OBJECTS, 96, 96, 1, 1, columns},
    {"white noise", FIELD_NOISE, 128, 128, 1, 1, noise},
};

float *shadow_field_heights(const struct shadow_field *f)
{
    float *h = malloc(sizeof(float) * (size_t)f->width * (size_t)f->height);
    double unit = f->width * f->dx / 100;
    for (int j = 0; h && j < f->height; j++)
        for (int i = 0; i < f->width; i++)
            h[j * f->width + i] = (float)(unit * f->at((i + 0.5) / f->width, (j + 0.5) / f->height));
    return h;
}

struct sv_vec3 shadow_light(int k)
{
    static const double elevation[] = {1, 2, 3, 5, 7, 10, 14, 19, 25, 32, 40, 50, 60, 72, 85};
    double azimuth, up;
    if (k < 16) { /* exactly along axes and diagonals, low and high */
        static const int step[8][2] = {{1, 0}, {1, 1}, {0, 1}, {-1, 1}, {-1, 0}, {-1, -1}, {0, -1}, {1, -1}};
        double e = sv_radians(k < 8 ? 12 : 35);
        struct sv_vec3 flat = sv_normalize(sv_vec3(step[k & 7][0], step[k & 7][1], 0));
        return sv_vec3(flat.x * cos(e), flat.y * cos(e), -sin(e));
    }
    if (k == 45)
        return sv_vec3(0, 0, -1);
    azimuth = 2 * SV_PI * fmod(0.6180339887498949 * k, 1.0);
    up = k < 45 ? elevation[(k - 16) % 15] : -(double)(k - 45) * 20;
    return sv_normalize(sv_vec3(cos(azimuth) * cos(sv_radians(up)), sin(azimuth) * cos(sv_radians(up)),
                                -sin(sv_radians(up))));
}

static double sample(const struct shadow_field *f, const float *h, int i, int j)
{
    return i >= 0 && j >= 0 && i < f->width && j < f->height ? (double)h[j * f->width + i] : NAN;
}

double shadow_surface(const struct shadow_field *f, const float *h, double x, double y)
{
    int i = (int)floor(x), j = (int)floor(y);
    double p = x - i, q = y - j;
    double a = sample(f, h, i, j), b = sample(f, h, i + 1, j), c = sample(f, h, i, j + 1),
           d = sample(f, h, i + 1, j + 1);
    if (q == 0 && !isnan(a) && !isnan(b))
        return a + (b - a) * p; /* on a row: what is beside it does not matter */
    if (p == 0 && !isnan(a) && !isnan(c))
        return a + (c - a) * q;
    if (isnan(a) || isnan(b) || isnan(c) || isnan(d))
        return p < 0.5 ? (q < 0.5 ? a : c) : (q < 0.5 ? b : d);
    return (a * (1 - p) + b * p) * (1 - q) + (c * (1 - p) + d * p) * q;
}

/* As shadow_surface, where all four corners exist. */
static inline double inside(const struct shadow_field *f, const float *h, double x, double y)
{
    int i = (int)x, j = (int)y;
    i -= i == f->width - 1;
    j -= j == f->height - 1;
    const float *c = h + j * f->width + i;
    double p = x - i, q = y - j;
    return ((double)c[0] * (1 - p) + (double)c[1] * p) * (1 - q) +
           ((double)c[f->width] * (1 - p) + (double)c[f->width + 1] * p) * q;
}

struct ray {
    const struct shadow_field *field;
    const float *heights;
    double x, y, z;      /* start: samples, samples, m */
    double dx, dy, rise; /* towards the light: one sample along the larger axis a unit of t */
};

/* How far the surface stands above the ray at t. */
static double above(const struct ray *r, double t)
{
    double x = r->x + r->dx * t, y = r->y + r->dy * t;
    x = x < 0 ? 0 : x > r->field->width - 1 ? r->field->width - 1 : x;
    y = y < 0 ? 0 : y > r->field->height - 1 ? r->field->height - 1 : y;
    return inside(r->field, r->heights, x, y) - (r->z + r->rise * t);
}

/* t at which the ray has crossed its n-th line of samples along one axis. */
static double crossing(double by, int n)
{
    return by == 0 ? INFINITY : n / fabs(by); /* it starts on a line of samples */
}

/* Cell by cell: along the ray a bilinear cell is a parabola, known from its ends and its middle. */
static bool hidden_exactly(const struct ray *r, double top)
{
    double leave = INFINITY, t = 0, d = -INFINITY;
    if (r->dx != 0)
        leave = fmin(leave, (r->dx > 0 ? r->field->width - 1 - r->x : -r->x) / r->dx);
    if (r->dy != 0)
        leave = fmin(leave, (r->dy > 0 ? r->field->height - 1 - r->y : -r->y) / r->dy);
    for (int nx = 1, ny = 1; t < leave && r->z + r->rise * t <= top;) {
        double tx = crossing(r->dx, nx), ty = crossing(r->dy, ny), end = fmin(leave, fmin(tx, ty));
        nx += tx <= end;
        ny += ty <= end;
        if (end - t < 1e-12) {
            t = end;
            continue;
        }
        double first = t == 0 ? above(r, 1e-12) : d, middle = above(r, 0.5 * (t + end)), last = above(r, end);
        double bend = first - 2 * middle + last, slope = last - first, best = fmax(middle, last);
        if (bend < 0 && fabs(slope) < -2 * bend)
            best = fmax(best, middle - slope * slope / (8 * bend));
        if (best > 0)
            return true;
        t = end;
        d = last;
    }
    return false;
}

/* In small steps, over a surface with holes. */
static bool hidden_by_steps(const struct ray *r, double top, double step)
{
    for (double t = step;; t += step) {
        double x = r->x + r->dx * t, y = r->y + r->dy * t, z = r->z + r->rise * t;
        if (x < 0 || y < 0 || x > r->field->width - 1 || y > r->field->height - 1 || z > top)
            return false;
        if (shadow_surface(r->field, r->heights, x, y) > z)
            return true;
    }
}

void shadow_truth(const struct shadow_field *f, const float *h, struct sv_vec3 l, double bias, uint8_t *lit)
{
    double top = -INFINITY;
    bool whole = f->width > 1 && f->height > 1;
    for (int k = 0; k < f->width * f->height; k++) {
        top = fmax(top, (double)h[k]);
        whole = whole && !isnan(h[k]);
    }
    double flat = fmax(fabs(l.x) / f->dx, fabs(l.y) / f->dy);
    for (int j = 0; j < f->height; j++)
        for (int i = 0; i < f->width; i++) {
            double z = (double)h[j * f->width + i];
            struct ray ray = {f, h, i, j, z + bias, -l.x / f->dx / flat, -l.y / f->dy / flat, -l.z / flat};
            bool dark = l.z > 0;
            if (!dark && flat > 0)
                dark = whole ? hidden_exactly(&ray, top) : hidden_by_steps(&ray, top, 0.05);
            lit[j * f->width + i] = dark && !isnan(z) ? 0 : 255;
        }
}
