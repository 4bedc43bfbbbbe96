/* detail.c - makes the tile of ground detail and applies it; the sampling half is the twin of
 * ground_rows.inc.
 *
 * The tile: periodic gradient noise (Perlin 2002) summed over octaves for tufts, hue and grit; blades are a
 * few thousand short strokes painted over each other. Each channel is high-pass filtered by leaving out the
 * lowest octaves, then scaled to a given deviation about 128. Own design. */
#include "core/terrain/detail.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "core/base/rng.h"
#include "core/base/vec.h"

enum { SIDE = SV_TERRAIN_DETAIL_SIDE, LEVELS = SV_TERRAIN_DETAIL_LEVELS, BLADES = 16000 };

static uint8_t *levels[LEVELS];

/* ---- making ---- */

/* Gradients of one octave: a direction of eight at every lattice point of a period. */
struct lattice {
    int period;
    uint8_t direction[SIDE * SIDE];
};

static double dot_gradient(const struct lattice *lattice, int i, int j, double fx, double fy)
{
    static const double directions[8][2] = {{1, 0},  {0.7071, 0.7071},   {0, 1},  {-0.7071, 0.7071},
                                            {-1, 0}, {-0.7071, -0.7071}, {0, -1}, {0.7071, -0.7071}};
    i = i == lattice->period ? 0 : i;
    j = j == lattice->period ? 0 : j;
    const double *d = directions[lattice->direction[j * lattice->period + i]];
    return d[0] * fx + d[1] * fy;
}

static double fade(double t)
{
    return t * t * t * (t * (t * 6 - 15) + 10);
}

/* Gradient noise at (u, v) in the unit square, about -0.7 .. 0.7. */
static double noise(const struct lattice *lattice, double u, double v)
{
    double x = u * lattice->period, y = v * lattice->period;
    int i = (int)x, j = (int)y;
    double fx = x - i, fy = y - j, sx = fade(fx), sy = fade(fy);
    double a = dot_gradient(lattice, i, j, fx, fy), b = dot_gradient(lattice, i + 1, j, fx - 1, fy);
    double c = dot_gradient(lattice, i, j + 1, fx, fy - 1),
           d = dot_gradient(lattice, i + 1, j + 1, fx - 1, fy - 1);
    return a + (b - a) * sx + (c - a) * sy + (a - b - c + d) * sx * sy;
}

struct noise_sum {
    uint64_t seed;
    int first_period, octaves; /* the last period, first << (octaves - 1), is at most SIDE */
    double gain;
};

static void fill_noise(float *out, const struct noise_sum *sum, struct lattice *lattice)
{
    double amplitude = 1;
    memset(out, 0, (size_t)SIDE * SIDE * sizeof *out);
    for (int k = 0; k < sum->octaves; k++, amplitude *= sum->gain) {
        struct sv_rng rng = sv_rng_seeded(sum->seed, (uint64_t)k);
        lattice->period = sum->first_period << k;
        for (int n = 0; n < lattice->period * lattice->period; n++)
            lattice->direction[n] = (uint8_t)(sv_rng_next(&rng) >> 61);
        for (int j = 0; j < SIDE; j++)
            for (int i = 0; i < SIDE; i++)
                out[j * SIDE + i] += (float)(amplitude * noise(lattice, (i + 0.5) / SIDE, (j + 0.5) / SIDE));
    }
}

/* One stroke: from a dark root to a light tip, two texels wide, wrapping at the tile's borders. */
static void paint_blade(float *out, struct sv_rng *rng)
{
    double x = sv_rng_range(rng, 0, SIDE), y = sv_rng_range(rng, 0, SIDE), length = sv_rng_range(rng, 10, 30);
    double angle = sv_rng_range(rng, 0, 2 * SV_PI), bend = sv_rng_range(rng, -0.04, 0.04);
    double tone = sv_rng_range(rng, 0.35, 1.0);
    for (int k = 0; k < (int)(2 * length); k++) {
        double t = k / (2 * length), value = tone * (0.35 + 0.65 * t);
        int i = (int)x & (SIDE - 1), j = (int)y & (SIDE - 1);
        out[j * SIDE + i] = (float)value;
        if (t < 0.6)
            out[j * SIDE + ((i + 1) & (SIDE - 1))] = (float)(value * 0.8);
        x += 0.5 * cos(angle) + SIDE;
        y += 0.5 * sin(angle) + SIDE;
        angle += bend;
    }
}

static void fill_blades(float *out, struct lattice *lattice)
{
    struct sv_rng rng = sv_rng_seeded(20010, 7);
    fill_noise(out, &(struct noise_sum){11, 64, 3, 0.7}, lattice);
    for (int k = 0; k < SIDE * SIDE; k++)
        out[k] = 0.15f + 0.15f * out[k];
    for (int k = 0; k < BLADES; k++)
        paint_blade(out, &rng);
}

/* Writes one channel with mean 128 and the given standard deviation (in units of 128). */
static void quantize(const float *values, double deviation, int channel)
{
    double sum = 0, squares = 0, n = (double)SIDE * SIDE;
    for (int k = 0; k < SIDE * SIDE; k++)
        sum += (double)values[k];
    double mean = sum / n;
    for (int k = 0; k < SIDE * SIDE; k++)
        squares += ((double)values[k] - mean) * ((double)values[k] - mean);
    double scale = 128 * deviation / sqrt(squares / n);
    for (int k = 0; k < SIDE * SIDE; k++) {
        double v = 128 + scale * ((double)values[k] - mean);
        levels[0][4 * k + channel] = (uint8_t)sv_clamp(v + 0.5, 0, 255);
    }
}

/* The next mip level by 2 x 2 averages, rounded to nearest. */
static void halve(const uint8_t *from, uint8_t *to, int side)
{
    for (int j = 0; j < side; j++)
        for (int i = 0; i < side; i++)
            for (int c = 0; c < 4; c++) {
                const uint8_t *p = from + 4 * ((size_t)2 * j * 2 * side + 2 * i) + c;
                to[4 * (j * side + i) + c] = (uint8_t)((p[0] + p[4] + p[8 * side] + p[8 * side + 4] + 2) / 4);
            }
}

enum sv_status sv_terrain_detail_init(struct sv_error *error)
{
    if (levels[0])
        return SV_OK;
    size_t total = 0, offset = 0;
    for (int l = 0; l < LEVELS; l++)
        total += (size_t)4 * (SIDE >> l) * (SIDE >> l);
    float *values = malloc((size_t)SIDE * SIDE * sizeof *values);
    struct lattice *lattice = malloc(sizeof *lattice);
    uint8_t *block = malloc(total);
    if (!values || !lattice || !block) {
        free(values);
        free(lattice);
        free(block);
        return sv_fail(error, SV_ENOMEM, "terrain", "no memory for the ground's detail");
    }
    for (int l = 0; l < LEVELS; l++) {
        levels[l] = block + offset;
        offset += (size_t)4 * (SIDE >> l) * (SIDE >> l);
    }
    fill_blades(values, lattice);
    quantize(values, 0.34, 0);
    fill_noise(values, &(struct noise_sum){23, 10, 6, 0.72}, lattice);
    quantize(values, 0.16, 1);
    fill_noise(values, &(struct noise_sum){37, 12, 4, 0.6}, lattice);
    quantize(values, 0.30, 2);
    fill_noise(values, &(struct noise_sum){51, 24, 5, 0.85}, lattice);
    quantize(values, 0.18, 3);
    free(values);
    free(lattice);
    for (int l = 1; l < LEVELS; l++)
        halve(levels[l - 1], levels[l], SIDE >> l);
    return SV_OK;
}

const uint8_t *sv_terrain_detail_level(int level)
{
    return levels[level];
}

/* ---- sampling: twin of apply_detail in ground_rows.inc ---- */

static double fraction(double v)
{
    return v - floor(v);
}

const double sv_terrain_detail_period_m[SV_DETAIL_COUNT] = {233.0, 29.0, 3.1};

/* How each scale is turned against the world, so that their repetitions do not line up; and between which mip
 * levels it fades: above 5.5 a tile is less than 12 px wide, and repetition would be all one sees. */
static const struct {
    double cosine, sine;
    float fade_from, fade_to;
} turns[SV_DETAIL_COUNT] = {{0.28, 0.96, 3.5f, 5.5f}, {1, 0, 3.5f, 5.5f}, {0.8, 0.6, 4.0f, 5.5f}};

void sv_terrain_detail_place(double x, double y, double uv[SV_DETAIL_COUNT][2])
{
    for (int k = 0; k < SV_DETAIL_COUNT; k++) {
        uv[k][0] = fraction((turns[k].cosine * x - turns[k].sine * y) / sv_terrain_detail_period_m[k]);
        uv[k][1] = fraction((turns[k].sine * x + turns[k].cosine * y) / sv_terrain_detail_period_m[k]);
    }
}

/* GL's bilinear filter with GL_REPEAT at one level, in units where 128 is 1. */
static void sample_level(double u, double v, int level, float out[4])
{
    int side = SIDE >> level, mask = side - 1;
    double x = u * side - 0.5, y = v * side - 0.5;
    int i = (int)floor(x), j = (int)floor(y);
    float fx = (float)(x - i), fy = (float)(y - j);
    const uint8_t *low = levels[level] + 4 * (size_t)(j & mask) * (size_t)side;
    const uint8_t *high = levels[level] + 4 * (size_t)((j + 1) & mask) * (size_t)side;
    const uint8_t *a = low + 4 * (i & mask), *b = low + 4 * ((i + 1) & mask);
    const uint8_t *c = high + 4 * (i & mask), *d = high + 4 * ((i + 1) & mask);
    for (int k = 0; k < 4; k++) {
        float bottom = a[k] + (float)(b[k] - a[k]) * fx, top = c[k] + (float)(d[k] - c[k]) * fx;
        out[k] = (bottom + (top - bottom) * fy) * (1.0f / 128.0f) - 1.0f;
    }
}

/* Mixed from two mip levels half-way between them only, so that half of all pixels read one; values about 0.
 */
static void sample_tile(double u, double v, double lod, float out[4])
{
    float high[4];
    lod = sv_clamp(lod, 0, LEVELS - 1);
    int level = (int)(lod + 0.25) < LEVELS - 1 ? (int)(lod + 0.25) : LEVELS - 1;
    float t = (float)(2 * (lod - level) - 0.5);
    sample_level(u, v, level, out);
    if (!(t > 0))
        return;
    sample_level(u, v, level + 1, high);
    for (int k = 0; k < 4; k++)
        out[k] += (high[k] - out[k]) * t;
}

static float step_between(float lo, float hi, float v)
{
    float t = (float)sv_clamp((double)((v - lo) / (hi - lo)), 0, 1);
    return t * t * (3 - 2 * t);
}

/* Share of a scale that texels of a size cannot show themselves. */
static float share(enum sv_terrain_detail_scale scale, double texel_m)
{
    if (scale == SV_DETAIL_BROAD)
        return step_between(6, 25, (float)texel_m);
    return (float)fmin(1, texel_m * 10 / sv_terrain_detail_period_m[scale]);
}

struct sv_terrain_detail_form sv_terrain_detail_form(enum sv_terrain_detail_scale scale, double texel_m)
{
    return (struct sv_terrain_detail_form){turns[scale].cosine, turns[scale].sine, turns[scale].fade_from,
                                           turns[scale].fade_to, share(scale, texel_m)};
}

double sv_terrain_detail_end_m(enum sv_terrain_detail_scale scale, double texel_m)
{
    if (!(share(scale, texel_m) > 0))
        return 0;
    return fmin(texel_m, exp2((double)turns[scale].fade_to) * sv_terrain_detail_period_m[scale] / SIDE);
}

void sv_terrain_detail_apply(double x, double y, double pixel_m, double n_dot_v, double texel_m,
                             float albedo[3])
{
    double footprint = pixel_m / sqrt(sv_clamp(n_dot_v, 0.04, 1)), uv[SV_DETAIL_COUNT][2];
    float luminance = 0.3f * albedo[0] + 0.6f * albedo[1] + 0.1f * albedo[2];
    float strength = step_between(1, 6, (float)(texel_m / pixel_m)), tile[SV_DETAIL_COUNT][4];
    strength *= 1 - step_between(0, 0.02f, albedo[2] - albedo[1]); /* not on water */
    strength *= 1 - 0.75f * step_between(0.35f, 0.6f, luminance);  /* little on snow */
    if (!(strength > 0) || !isfinite(x) || !isfinite(y) || !isfinite(footprint))
        return;
    sv_terrain_detail_place(x, y, uv);
    for (int k = 0; k < SV_DETAIL_COUNT; k++) {
        double lod = log2(footprint * (SIDE / sv_terrain_detail_period_m[k]));
        float weight = strength * share((enum sv_terrain_detail_scale)k, texel_m);
        weight *= 1 - step_between(turns[k].fade_from, turns[k].fade_to, (float)lod);
        sample_tile(uv[k][0], uv[k][1], lod, tile[k]);
        for (int c = 0; c < 4; c++)
            tile[k][c] *= weight;
    }
    const float *broad = tile[SV_DETAIL_BROAD], *coarse = tile[SV_DETAIL_COARSE],
                *fine = tile[SV_DETAIL_FINE];
    float veg = step_between(0, 0.03f, albedo[1] - albedo[0]); /* blades where it is green, grit elsewhere */
    float level = (1 + broad[1]) * (1 + coarse[1]) * (1 + fine[3] + (fine[0] - fine[3]) * veg);
    float hue = 0.12f * (broad[2] + coarse[2]);
    albedo[0] *= level * (1 + hue);
    albedo[1] *= level;
    albedo[2] *= level * (1 - hue);
}
