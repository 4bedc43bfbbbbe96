/* voids.c - see voids.h.
 *
 * The membrane is solved by cascadic multigrid (Bornemann and Deuflhard 1996): average the known samples to
 * ever coarser grids until all is known, then interpolate down and relax the unknown on each level.
 * O(samples) in time; the first guess on each level is so near that a dozen sweeps leave under 1 % of the
 * rim's range. */
#include "core/geo/voids.h"

#include <math.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdlib.h>
#include <string.h>

enum {
    FLAT_CELLS_MIN = 256, /* smaller border voids are scratches of the survey, not water */
    SWEEPS =
        16, /* on the finest level; twice as many on each coarser one, which has a quarter of the cells, */
    SWEEPS_DOUBLED = 5 /* up to this level */
};
static const double FLAT_SPREAD_CELLS =
    0.1; /* rim counts as level: median - 10th percentile under a tenth of a cell ... */
static const double FLAT_SPREAD_M =
    2; /* ... plus this: shores of SRTM's 90 m Cape Town spread by 4 m, its cliffs included;
          ridges at a survey's edge by half a cell and more */

static int by_value(const void *a, const void *b)
{
    float x = *(const float *)a, y = *(const float *)b;
    return (x > y) - (x < y);
}

/* ---- regions ---- */

struct region {
    uint32_t *cells; /* queue of the flood, room for all voids */
    size_t count;
    float *rim; /* known heights around it, each once for each void beside it */
    size_t rim_count, rim_room;
    bool border;
};

static bool rim_add(struct region *r, float z)
{
    if (r->rim_count == r->rim_room) {
        size_t room = r->rim_room ? 2 * r->rim_room : 1024;
        float *rim = realloc(r->rim, room * sizeof *rim);
        if (!rim)
            return false;
        r->rim = rim;
        r->rim_room = room;
    }
    r->rim[r->rim_count++] = z;
    return true;
}

/* Floods the void region around `seed`; seen has a bit for each cell. */
static bool flood(const float *h, int width, int height, uint8_t *seen, uint32_t seed, struct region *r)
{
    r->count = r->rim_count = 0;
    r->border = false;
    r->cells[r->count++] = seed;
    seen[seed >> 3] |= (uint8_t)(1u << (seed & 7));
    for (size_t next = 0; next < r->count; next++) {
        uint32_t at = r->cells[next];
        uint32_t i = at % (uint32_t)width, j = at / (uint32_t)width;
        const bool inside[4] = {i > 0, i + 1 < (uint32_t)width, j > 0, j + 1 < (uint32_t)height};
        const uint32_t beside[4] = {at - 1, at + 1, at - (uint32_t)width, at + (uint32_t)width};
        for (int k = 0; k < 4; k++) {
            if (!inside[k]) {
                r->border = true;
                continue;
            }
            uint32_t b = beside[k];
            if (!isnan(h[b])) {
                if (!rim_add(r, h[b]))
                    return false;
            } else if (!(seen[b >> 3] >> (b & 7) & 1)) {
                seen[b >> 3] |= (uint8_t)(1u << (b & 7));
                r->cells[r->count++] = b;
            }
        }
    }
    return true;
}

static bool is_level(struct region *r, double cell_m, float *level)
{
    if (!r->border || r->count < FLAT_CELLS_MIN || r->rim_count == 0)
        return false;
    qsort(r->rim, r->rim_count, sizeof *r->rim, by_value);
    float low = r->rim[r->rim_count / 10], median = r->rim[r->rim_count / 2];
    *level = low;
    return (double)median - (double)low <= FLAT_SPREAD_M + FLAT_SPREAD_CELLS * cell_m;
}

/* Finds the regions and lays the level ones flat; false when memory ran out. */
static bool lay_flat(float *h, int width, int height, double cell_m, size_t voids,
                     struct sv_voids_report *report)
{
    size_t n = (size_t)width * (size_t)height;
    struct region r = {.cells = malloc(voids * sizeof *r.cells)};
    uint8_t *seen = calloc(n / 8 + 1, 1);
    bool ok = r.cells && seen;
    size_t largest = 0;
    for (size_t k = 0; ok && k < n; k++) {
        if (!isnan(h[k]) || (seen[k >> 3] >> (k & 7) & 1))
            continue;
        ok = flood(h, width, height, seen, (uint32_t)k, &r);
        float level = 0;
        report->regions++;
        if (!ok || !is_level(&r, cell_m, &level))
            continue;
        for (size_t c = 0; c < r.count; c++)
            h[r.cells[c]] = level;
        report->flat_regions++;
        report->flat_cells += r.count;
        if (r.count > largest) {
            largest = r.count;
            report->flat_level = level;
        }
    }
    free(r.cells);
    free(r.rim);
    free(seen);
    return ok;
}

/* ---- membrane ---- */

struct level {
    float *h;
    uint8_t *known;
    int width, height;
};

static bool coarsen(const struct level *fine, struct level *coarse)
{
    coarse->width = (fine->width + 1) / 2;
    coarse->height = (fine->height + 1) / 2;
    size_t n = (size_t)coarse->width * (size_t)coarse->height;
    coarse->h = malloc(n * sizeof *coarse->h);
    coarse->known = malloc(n);
    if (!coarse->h || !coarse->known)
        return false;
    for (int j = 0; j < coarse->height; j++)
        for (int i = 0; i < coarse->width; i++) {
            double sum = 0;
            int count = 0;
            for (int k = 0; k < 4; k++) {
                int x = 2 * i + (k & 1), y = 2 * j + (k >> 1);
                size_t at = (size_t)y * (size_t)fine->width + (size_t)x;
                if (x < fine->width && y < fine->height && fine->known[at]) {
                    sum += (double)fine->h[at];
                    count++;
                }
            }
            size_t at = (size_t)j * (size_t)coarse->width + (size_t)i;
            coarse->known[at] = count > 0;
            coarse->h[at] = count ? (float)(sum / count) : 0;
        }
    return true;
}

/* Cell-centred bilinear value of a coarse level at fine cell (i, j). */
static float prolong(const struct level *c, int i, int j)
{
    double u = fmin(fmax(0.5 * i - 0.25, 0), c->width - 1), v = fmin(fmax(0.5 * j - 0.25, 0), c->height - 1);
    int i0 = (int)u, j0 = (int)v;
    int i1 = i0 + 1 < c->width ? i0 + 1 : i0, j1 = j0 + 1 < c->height ? j0 + 1 : j0;
    double s = u - i0, t = v - j0;
    const float *a = c->h + (size_t)j0 * (size_t)c->width, *b = c->h + (size_t)j1 * (size_t)c->width;
    return (float)((1 - t) * ((1 - s) * (double)a[i0] + s * (double)a[i1]) +
                   t * ((1 - s) * (double)b[i0] + s * (double)b[i1]));
}

/* A cell of the border carries this bit in a list of cells: samples are at most 2^26, and the others need no
 * look at where they are. */
#define BORDER_CELL ((uint32_t)1 << 31)

static float border_mean(const struct level *l, uint32_t at)
{
    uint32_t width = (uint32_t)l->width, height = (uint32_t)l->height, i = at % width, j = at / width;
    float here = l->h[at]; /* beyond the border stands the cell's own height: nothing flows across */
    float west = i > 0 ? l->h[at - 1] : here, east = i + 1 < width ? l->h[at + 1] : here;
    float north = j > 0 ? l->h[at - width] : here, south = j + 1 < height ? l->h[at + width] : here;
    return 0.25f * ((west + east) + (north + south));
}

/* Gauss and Seidel, to and fro. No over-relaxation: every value stays a mean of its neighbours, so within the
 * rim's range. */
static void relax(struct level *l, const uint32_t *cells, size_t count, int sweeps)
{
    size_t width = (size_t)l->width;
    for (int sweep = 0; sweep < sweeps; sweep++)
        for (size_t k = 0; k < count; k++) {
            uint32_t cell = cells[sweep & 1 ? count - 1 - k : k];
            if (cell & BORDER_CELL) {
                l->h[cell & ~BORDER_CELL] = border_mean(l, cell & ~BORDER_CELL);
            } else {
                float *h = l->h + cell;
                *h = 0.25f * ((h[-1] + h[1]) + (h[-(ptrdiff_t)width] + h[width]));
            }
        }
}

/* Fills one level, given the next coarser one in full. */
static bool refine(struct level *fine, const struct level *coarse, int sweeps)
{
    size_t n = (size_t)fine->width * (size_t)fine->height, count = 0, k = 0;
    for (size_t at = 0; at < n; at++)
        count += !fine->known[at];
    uint32_t *cells = malloc((count ? count : 1) * sizeof *cells);
    if (!cells)
        return false;
    for (int j = 0; j < fine->height; j++)
        for (int i = 0; i < fine->width; i++) {
            size_t at = (size_t)j * (size_t)fine->width + (size_t)i;
            if (fine->known[at])
                continue;
            fine->h[at] = prolong(coarse, i, j);
            bool border = i == 0 || j == 0 || i + 1 == fine->width || j + 1 == fine->height;
            cells[k++] = (uint32_t)at | (border ? BORDER_CELL : 0);
        }
    relax(fine, cells, count, sweeps);
    free(cells);
    return true;
}

static bool has_unknown(const struct level *l)
{
    return memchr(l->known, 0, (size_t)l->width * (size_t)l->height) != NULL;
}

static bool solve_membrane(float *h, int width, int height)
{
    enum { LEVELS = 32 };
    struct level levels[LEVELS] = {{.h = h, .width = width, .height = height}};
    size_t n = (size_t)width * (size_t)height;
    int last = 0;
    bool ok = (levels[0].known = malloc(n)) != NULL;
    for (size_t k = 0; ok && k < n; k++)
        levels[0].known[k] = !isnan(h[k]);
    while (ok && has_unknown(&levels[last]) && last + 1 < LEVELS) {
        ok = coarsen(&levels[last], &levels[last + 1]);
        last++;
    }
    for (int l = last - 1; ok && l >= 0; l--)
        ok = refine(&levels[l], &levels[l + 1], SWEEPS << (l < SWEEPS_DOUBLED ? l : SWEEPS_DOUBLED));
    for (int l = 0; l <= last; l++) {
        free(levels[l].known);
        if (l > 0)
            free(levels[l].h);
    }
    return ok;
}

enum sv_status sv_voids_fill(float *h, int width, int height, double cell_m, struct sv_voids_report *report,
                             struct sv_error *error)
{
    struct sv_voids_report r = {0};
    size_t n = (size_t)width * (size_t)height;
    for (size_t k = 0; k < n; k++)
        r.cells += isnan(h[k]) != 0;
    if (r.cells > 0) {
        bool ok = lay_flat(h, width, height, cell_m, r.cells, &r);
        if (ok && r.cells > r.flat_cells)
            ok = solve_membrane(h, width, height);
        if (!ok)
            return sv_fail(error, SV_ENOMEM, "", "out of memory while filling %llu voids",
                           (unsigned long long)r.cells);
    }
    *report = r;
    return SV_OK;
}
