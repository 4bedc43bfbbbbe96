/* procedural.c - a landscape out of a seed.
 *
 * Broad hills of warped noise say where the ground lies high and rises; then rivers and creep (erosion.c)
 * shape it on grids of 129, 257, ... samples a side, each begun from the one before with finer noise added,
 * so that large valleys are found cheaply and small ones in place. The last grid is resampled (Catmull-Rom)
 * to the samples asked for, with noise finer than its cells, and scaled so that the relief is met exactly.
 * The shape depends on the seed alone, not on size or relief; more samples show the same land in more detail.
 * Only + - * / sqrt floor: the same bits on every machine. Water is not drawn, only its valleys. */
#include "core/terrain/procedural.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "core/base/noise.h"
#include "core/base/rng.h"
#include "core/terrain/erosion.h"

enum { FIRST_SIDE = 129, LAST_SIDE = 1025 };
enum {
    STREAM_WARP = 1,
    STREAM_HILLS,
    STREAM_RIDGES,
    STREAM_ROUGH,
    STREAM_DETAIL,
    STREAM_FLOW,
    STREAM_FINE,
    STREAM_BEND
};

/* Incision K of stream power. */
static const double STRENGTH = 4.0;

/* Share of the land's side that is cut off on each side. */
static const double MARGIN = 0.06;

struct grid {
    int side;
    float *h, *uplift, *area;
    uint8_t *outlet;
};

static void grid_finish(struct grid *g)
{
    free(g->h);
    free(g->uplift);
    free(g->area);
    free(g->outlet);
    *g = (struct grid){0};
}

static bool grid_init(struct grid *g, int side)
{
    size_t n = (size_t)side * (size_t)side;
    *g = (struct grid){side, malloc(n * sizeof *g->h), malloc(n * sizeof *g->uplift),
                       malloc(n * sizeof *g->area), calloc(n, 1)};
    if (g->h && g->uplift && g->area && g->outlet)
        return true;
    grid_finish(g);
    return false;
}

static uint64_t stream(uint64_t seed, uint64_t which)
{
    return sv_mix64(sv_mix64(seed) + which * UINT64_C(0x9E3779B97F4A7C15));
}

/* Where land lies high, 0 .. about 1, at (x, y) of the unit square: warped hills and a few broken ridges. */
static double relief_at(uint64_t seed, double x, double y)
{
    uint64_t warp = stream(seed, STREAM_WARP);
    double wx = x + 0.10 * sv_noise_sum(warp, 2.1 * x, 2.1 * y, 3);
    double wy = y + 0.10 * sv_noise_sum(sv_mix64(warp), 2.1 * x, 2.1 * y, 3);
    double hills = 0.5 + 0.6 * sv_noise_sum(stream(seed, STREAM_HILLS), 1.9 * wx, 1.9 * wy, 3);
    double ridge = sv_noise_sum(stream(seed, STREAM_RIDGES), 2.3 * wx, 2.3 * wy, 2);
    ridge = 1 - sqrt(ridge * ridge + 0.004) * 2.2; /* a rounded crest where the noise is 0 */
    double rough = sv_noise_sum(stream(seed, STREAM_ROUGH), 7 * wx, 7 * wy, 5);
    return 0.62 * hills + 0.38 * sv_clamp(ridge, -0.5, 1) * sv_clamp(hills * 1.6, 0, 1) + 0.16 * rough;
}

/* Index of step k along the rim, counter-clockwise from (0, 0). */
static size_t rim(int side, int k)
{
    int last = side - 1, edge = k / last, t = k % last;
    int x = edge == 0 ? t : edge == 1 ? last : edge == 2 ? last - t : 0;
    int y = edge == 0 ? 0 : edge == 1 ? t : edge == 2 ? last : last - t;
    return (size_t)y * (size_t)side + (size_t)x;
}

/* Water leaves at the rim where it is lowest within an eighth of the way round on either side. */
static void place_outlets(struct grid *g)
{
    int n = 4 * (g->side - 1), reach = n / 8;
    for (int k = 0; k < n; k++) {
        bool lowest = true;
        for (int d = 1; d <= reach && lowest; d++)
            lowest = g->h[rim(g->side, k)] < g->h[rim(g->side, (k + d) % n)] &&
                     g->h[rim(g->side, k)] <= g->h[rim(g->side, (k + n - d) % n)];
        g->outlet[rim(g->side, k)] = lowest;
    }
}

static void first_grid(struct grid *g, uint64_t seed)
{
    for (int j = 0; j < g->side; j++)
        for (int i = 0; i < g->side; i++) {
            size_t k = (size_t)j * (size_t)g->side + (size_t)i;
            double v = relief_at(seed, (double)i / (g->side - 1), (double)j / (g->side - 1));
            g->h[k] = (float)v;
            g->uplift[k] = (float)(0.25 + sv_clamp(v, 0, 1.5));
        }
    place_outlets(g);
}

/* Catmull-Rom weights at t between the middle two of four samples. */
static void cubic(double t, double w[4])
{
    w[0] = 0.5 * t * (t * (2 - t) - 1);
    w[1] = 0.5 * (t * t * (3 * t - 5) + 2);
    w[2] = 0.5 * t * (t * (4 - 3 * t) + 1);
    w[3] = 0.5 * t * t * (t - 1);
}

/* Value of a field at (x, y) in cells; beyond the rim it goes on in a straight line. */
static double resample(const float *field, int side, double x, double y)
{
    int i = (int)sv_clamp(floor(x), 0, side - 2), j = (int)sv_clamp(floor(y), 0, side - 2);
    double wx[4], wy[4], sum = 0;
    cubic(x - i, wx);
    cubic(y - j, wy);
    if (i == 0 || i == side - 2) { /* the missing neighbour, extrapolated: 2 a - b */
        int miss = i == 0 ? 0 : 3, a = i == 0 ? 1 : 2, b = i == 0 ? 2 : 1;
        wx[a] += 2 * wx[miss];
        wx[b] -= wx[miss];
        wx[miss] = 0;
    }
    if (j == 0 || j == side - 2) {
        int miss = j == 0 ? 0 : 3, a = j == 0 ? 1 : 2, b = j == 0 ? 2 : 1;
        wy[a] += 2 * wy[miss];
        wy[b] -= wy[miss];
        wy[miss] = 0;
    }
    for (int v = 0; v < 4; v++) {
        if (wy[v] == 0)
            continue;
        const float *row = field + (size_t)(j + v - 1) * (size_t)side;
        for (int u = 0; u < 4; u++)
            if (wx[u] != 0)
                sum += wy[v] * wx[u] * (double)row[i + u - 1];
    }
    return sum;
}

/* The next grid: the land of the one before, with noise of its own cell size where slopes are steep enough to
 * bear it. */
static void refine(const struct grid *from, struct grid *to, uint64_t seed)
{
    uint64_t fine = stream(seed, STREAM_DETAIL + ((uint64_t)to->side << 8));
    double amount = 0.5 / to->side;
    for (int j = 0; j < to->side; j++)
        for (int i = 0; i < to->side; i++) {
            size_t k = (size_t)j * (size_t)to->side + (size_t)i;
            double noise = sv_noise_at(fine, i * 0.31 + 0.5, j * 0.31 + 0.5).v;
            to->h[k] = (float)(resample(from->h, from->side, 0.5 * i, 0.5 * j) + amount * noise);
            to->uplift[k] = (float)resample(from->uplift, from->side, 0.5 * i, 0.5 * j);
        }
    for (int j = 0; j < from->side; j++)
        for (int i = 0; i < from->side; i++)
            if (from->outlet[(size_t)j * (size_t)from->side + (size_t)i]) {
                size_t k = (size_t)(2 * j) * (size_t)to->side + (size_t)(2 * i);
                to->outlet[k] = 1;
                to->h[k] = from->h[(size_t)j * (size_t)from->side + (size_t)i];
            }
}

/* What each grid does. K and the creep D (side^2 a unit of time) set how far apart valleys lie, about 10
 * sqrt(D / K) of the side; a step creeps 4 D dt / cell^2 of the way, so finer grids take shorter steps and
 * only add what they alone can show. */
static struct sv_erosion_options plan(int side, uint64_t seed)
{
    static const struct {
        int side, steps;
        double dt, creep;
    } rows[] = {{129, 48, 0.0125, 2.0e-4},
                {257, 16, 0.006, 1.2e-4},
                {513, 6, 0.0027, 0.8e-4},
                {1025, 2, 0.0012, 0.5e-4}};
    int k = 0;
    while (rows[k].side < side)
        k++;
    double cells = side - 1;
    double share = 4 * rows[k].creep * rows[k].dt * cells * cells;
    return (struct sv_erosion_options){rows[k].steps, rows[k].dt, STRENGTH, share,
                                       stream(seed, STREAM_FLOW + ((uint64_t)side << 8))};
}

static enum sv_status erode(struct grid *g, uint64_t seed, struct sv_error *error)
{
    struct sv_erosion e = {g->side, g->h, g->outlet, g->uplift, g->area};
    struct sv_erosion_options options = plan(g->side, seed);
    return sv_erosion_run(&e, &options, error);
}

/* The land of a seed on the finest grid that `samples` can show. */
static enum sv_status make_land(uint64_t seed, int samples, struct grid *land, struct sv_error *error)
{
    struct grid g;
    if (!grid_init(&g, FIRST_SIDE))
        return sv_fail(error, SV_ENOMEM, "terrain.procedural", "no memory for the terrain");
    first_grid(&g, seed);
    enum sv_status status = erode(&g, seed, error);
    while (status == SV_OK && g.side < LAST_SIDE && g.side < samples) {
        struct grid next;
        if (!grid_init(&next, 2 * g.side - 1)) {
            status = sv_fail(error, SV_ENOMEM, "terrain.procedural", "no memory for the terrain");
            break;
        }
        refine(&g, &next, seed);
        grid_finish(&g);
        g = next;
        status = erode(&g, seed, error);
    }
    if (status == SV_OK)
        *land = g;
    else
        grid_finish(&g);
    return status;
}

/* Noise finer than the land's cells: as many octaves as the samples can show, weaker by half each. */
static double fine_noise(uint64_t seed, double x, double y, double samples_a_cell)
{
    double sum = 0, weight = 1, scale = 0.7;
    for (int k = 0; k < 6 && scale * 2.5 < samples_a_cell; k++) {
        sum += weight * sv_noise_at(stream(seed, STREAM_FINE + ((uint64_t)k << 8)), scale * x, scale * y).v;
        weight *= 0.5;
        scale *= 2;
    }
    return sum;
}

/* Where on the land, in parts of its side, a place of the terrain lies: its inner part, so that the rim with
 * its outlets stays outside, bent by noise, so that no valley keeps a direction of the grid. */
static void bend(uint64_t seed, double *x, double *y)
{
    static const double scale[] = {3.7, 11, 31, 83}, amount[] = {0.030, 0.011, 0.0034, 0.0010};
    double u = MARGIN + (1 - 2 * MARGIN) * *x, v = MARGIN + (1 - 2 * MARGIN) * *y, du = 0, dv = 0;
    for (int k = 0; k < 4; k++) {
        uint64_t which = stream(seed, STREAM_BEND + ((uint64_t)k << 8));
        du += amount[k] * sv_noise_at(which, scale[k] * u, scale[k] * v).v;
        dv += amount[k] * sv_noise_at(sv_mix64(which), scale[k] * u, scale[k] * v).v;
    }
    *x = sv_clamp(u + du, 0, 1);
    *y = sv_clamp(v + dv, 0, 1);
}

static void sample_land(const struct grid *land, const struct sv_procedural_options *o, float *h)
{
    double cells = land->side - 1, step = 1.0 / (o->samples - 1), amount = 0.35 / land->side;
    for (int j = 0; j < o->samples; j++)
        for (int i = 0; i < o->samples; i++) {
            double x = i * step, y = j * step;
            bend(o->seed, &x, &y);
            double v = resample(land->h, land->side, x * cells, y * cells);
            v += amount * fine_noise(o->seed, i * step * cells, j * step * cells, 1 / (step * cells));
            h[(size_t)j * (size_t)o->samples + (size_t)i] = (float)v;
        }
}

/* Scales heights so that the lowest is 0 and the highest relief_m, to the bit; land without any relief
 * becomes a plane. */
static void scale_to_relief(float *h, size_t n, double relief_m)
{
    float lo = h[0], hi = h[0];
    for (size_t k = 1; k < n; k++) {
        lo = h[k] < lo ? h[k] : lo;
        hi = h[k] > hi ? h[k] : hi;
    }
    float top = (float)relief_m;
    double scale = hi > lo ? relief_m / ((double)hi - (double)lo) : 0;
    for (size_t k = 0; k < n; k++) {
        float v = (float)(((double)h[k] - (double)lo) * scale);
        h[k] = h[k] == hi && hi > lo ? top : v < top ? v : top;
    }
}

enum sv_status sv_terrain_procedural(const struct sv_procedural_options *options, struct sv_arena *arena,
                                     struct sv_heightfield *field, struct sv_error *error)
{
    const struct sv_procedural_options *o = options;
    if (!(o->size_m >= 1 && o->size_m <= 1e6))
        return sv_fail(error, SV_EINVAL, "terrain.procedural.size_m", "%g is outside 1 .. 1e6 m", o->size_m);
    if (o->samples < 2 || o->samples > 8192)
        return sv_fail(error, SV_EINVAL, "terrain.procedural.samples", "%d is outside 2 .. 8192", o->samples);
    if (!(o->relief_m >= 0 && o->relief_m <= 9000))
        return sv_fail(error, SV_EINVAL, "terrain.procedural.relief_m", "%g is outside 0 .. 9000 m",
                       o->relief_m);
    size_t n = (size_t)o->samples * (size_t)o->samples;
    float *h = sv_arena_alloc(arena, n, sizeof *h);
    if (!h)
        return sv_fail(error, SV_ENOMEM, "terrain.procedural", "no room for %zu samples", n);
    struct grid land = {0};
    enum sv_status status = make_land(o->seed, o->samples, &land, error);
    if (status != SV_OK)
        return status;
    sample_land(&land, o, h);
    grid_finish(&land);
    scale_to_relief(h, n, o->relief_m);
    *field = sv_terrain_procedural_field(o, h);
    return SV_OK;
}

struct sv_heightfield sv_terrain_procedural_field(const struct sv_procedural_options *options,
                                                  const float *heights)
{
    double step = options->size_m / (options->samples - 1);
    return (struct sv_heightfield){.width = options->samples,
                                   .height = options->samples,
                                   .dx = step,
                                   .dy = step,
                                   .h_max = (float)options->relief_m,
                                   .h = heights};
}
