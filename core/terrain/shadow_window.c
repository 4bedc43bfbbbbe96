/* shadow_window.c - the ground under a window, and the terrain's shadow on it.
 *
 * Both are piecewise simple along a row: within one cell of the field the surface is two straight lines that
 * meet on the diagonal, within one cell of the shadow map the margins are straight; so a row is a few lines
 * of set-up a cell and two multiply-adds a texel. */
#include "core/terrain/shadow_window.h"

#include <math.h>
#include <stdbool.h>
#include <stdlib.h>
#include <string.h>

enum { SIDE_MAX = SV_SHADOW_WINDOW_SIDE, BLOCK = SV_SHADOW_WINDOW_BLOCK };

enum sv_status sv_shadow_window_alloc(struct sv_shadow_window *window, int side, struct sv_error *error)
{
    struct sv_shadow_window w = {.side = side, .texel_m = 1};
    if (side < BLOCK || side > SIDE_MAX || side % BLOCK != 0)
        return sv_fail(error, SV_EINVAL, "side", "%d texels a side are no window of shadows", side);
    size_t texels = (size_t)side * (size_t)side;
    w.ground = malloc(texels * sizeof *w.ground);
    w.light = malloc(texels);
    w.blocks = malloc(texels / (BLOCK * BLOCK) * sizeof *w.blocks);
    if (!w.ground || !w.light || !w.blocks) {
        sv_shadow_window_finish(&w);
        return sv_fail(error, SV_ENOMEM, NULL, "no memory for a window of shadows");
    }
    *window = w;
    return SV_OK;
}

void sv_shadow_window_finish(struct sv_shadow_window *window)
{
    free(window->ground);
    free(window->light);
    free(window->blocks);
    memset(window, 0, sizeof *window);
}

/* ---- columns ---- */

/* The window's columns cut where they pass from one cell of a grid to the next. */
struct run {
    int first, end; /* columns */
    int cell;
};

struct columns {
    int run_count;
    struct run runs[SIDE_MAX];
    float u[SIDE_MAX]; /* place in the cell, 0 .. 1 */
};

/* Grid coordinate of a texel centre; a grid of one sample has cells of no width. */
static double grid_at(double x0, double texel_m, int texel, double from, double spacing, int samples)
{
    return sv_clamp((x0 + (texel + 0.5) * texel_m - from) / spacing, 0, samples - 1);
}

static int cell_of(double at, int samples)
{
    return at < samples - 1 ? (int)at : samples > 1 ? samples - 2 : 0;
}

static void cut_columns(struct columns *c, const struct sv_shadow_window *w, double from, double spacing,
                        int samples)
{
    c->run_count = 0;
    for (int i = 0; i < w->side; i++) {
        double at = grid_at(w->x0, w->texel_m, i, from, spacing, samples);
        int cell = cell_of(at, samples);
        c->u[i] = (float)(at - cell);
        if (c->run_count == 0 || c->runs[c->run_count - 1].cell != cell)
            c->runs[c->run_count++] = (struct run){i, i, cell};
        c->runs[c->run_count - 1].end = i + 1;
    }
}

/* ---- ground ---- */

static void ground_row(const struct sv_heightfield *f, const struct columns *c, double gj, float *out)
{
    int j = cell_of(gj, f->height);
    float v = (float)(gj - j);
    const float *p = f->h + (size_t)j * (size_t)f->width, *q = p + f->width;
    for (int r = 0; r < c->run_count; r++) {
        const struct run *run = &c->runs[r];
        int i = run->cell;
        bool even = ((i + j) & 1) == 0;
        /* Left and right ends of the cell at this row, and the break on its diagonal. */
        float left = p[i] + (q[i] - p[i]) * v, right = p[i + 1] + (q[i + 1] - p[i + 1]) * v;
        float at = even ? v : 1 - v;
        float middle = even ? p[i] + (q[i + 1] - p[i]) * v : p[i + 1] + (q[i] - p[i + 1]) * v;
        float slope0 = at > 0 ? (middle - left) / at : 0, slope1 = at < 1 ? (right - middle) / (1 - at) : 0;
        float base = at > 0 ? left : middle;
        for (int k = run->first; k < run->end; k++) {
            float u = c->u[k], near = u < at ? u : at;
            out[k] = base + slope0 * near + slope1 * (u - near);
        }
    }
}

static void measure_blocks(struct sv_shadow_window *w)
{
    w->ground_min = INFINITY;
    w->ground_max = -INFINITY;
    int side = w->side, blocks = side / BLOCK;
    for (int bj = 0; bj < blocks; bj++)
        for (int bi = 0; bi < blocks; bi++) {
            float low[8], high[8];
            const float *g = w->ground + (size_t)bj * BLOCK * (size_t)side + (size_t)bi * BLOCK;
            for (int k = 0; k < 8; k++)
                low[k] = high[k] = g[k];
            for (int j = 0; j < BLOCK; j++, g += side)
                for (int i = 0; i < BLOCK; i += 8)
                    for (int k = 0; k < 8; k++) {
                        low[k] = g[i + k] < low[k] ? g[i + k] : low[k];
                        high[k] = g[i + k] > high[k] ? g[i + k] : high[k];
                    }
            for (int k = 1; k < 8; k++) {
                low[0] = low[k] < low[0] ? low[k] : low[0];
                high[0] = high[k] > high[0] ? high[k] : high[0];
            }
            w->blocks[bj * blocks + bi][0] = low[0];
            w->blocks[bj * blocks + bi][1] = high[0];
            w->ground_min = low[0] < w->ground_min ? low[0] : w->ground_min;
            w->ground_max = high[0] > w->ground_max ? high[0] : w->ground_max;
        }
}

/* ---- the terrain's shadow ---- */

/* Margins along one row of the window, at the map's columns first .. last. */
struct margins {
    float *full, *none;
};

static void margin_row(const struct sv_shadow_height *map, double gj, int first, int last,
                       const struct margins *m)
{
    int j = cell_of(gj, map->height), j1 = j + 1 < map->height ? j + 1 : j;
    float v = (float)(gj - j);
    const float *p = map->full + (size_t)j * (size_t)map->width,
                *q = map->full + (size_t)j1 * (size_t)map->width;
    for (int i = first; i <= last; i++)
        m->full[i] = p[i] + (q[i] - p[i]) * v;
    p = map->none + (size_t)j * (size_t)map->width;
    q = map->none + (size_t)j1 * (size_t)map->width;
    for (int i = first; i <= last; i++)
        m->none[i] = p[i] + (q[i] - p[i]) * v;
}

static uint8_t share8(float full, float none, float soft_m)
{
    return (uint8_t)(sv_shadow_height_share(full, none, soft_m) * 255.0f + 0.5f);
}

static void light_row(const struct columns *c, const struct margins *m, float soft_m, uint8_t *out)
{
    for (int r = 0; r < c->run_count; r++) {
        const struct run *run = &c->runs[r];
        int i = run->cell;
        float f0 = m->full[i], f1 = m->full[i + 1], n0 = m->none[i], n1 = m->none[i + 1];
        uint8_t ends[2] = {share8(f0, n0, soft_m), share8(f1, n1, soft_m)};
        size_t count = (size_t)(run->end - run->first);
        /* Both ends lit, or both dark: so is everything between, as margins are straight. */
        if (ends[0] == ends[1] && (ends[0] == 0 || ends[0] == 255)) {
            memset(out + run->first, ends[0], count);
            continue;
        }
        for (int k = run->first; k < run->end; k++)
            out[k] = share8(f0 + (f1 - f0) * c->u[k], n0 + (n1 - n0) * c->u[k], soft_m);
    }
}

static void terrain_light(struct sv_shadow_window *w, const struct sv_shadow_height *map)
{
    memset(w->light, 255, (size_t)w->side * (size_t)w->side);
    /* One column more than the map has, so that a map of one sample has a cell. */
    float *rows = malloc(2 * ((size_t)map->width + 1) * sizeof *rows);
    struct columns *c = malloc(sizeof *c);
    if (rows && c) {
        struct margins m = {rows, rows + map->width + 1};
        float soft_m = (float)sv_shadow_height_soft_m(map, w->texel_m);
        cut_columns(c, w, map->x0, map->dx, map->width);
        int first = c->runs[0].cell, last = c->runs[c->run_count - 1].cell + 1;
        int have = last < map->width ? last : map->width - 1;
        for (int j = 0; j < w->side; j++) {
            double gj = grid_at(w->y0, w->texel_m, j, map->y0, map->dy, map->height);
            margin_row(map, gj, first, have, &m);
            for (int i = have + 1; i <= last; i++) {
                m.full[i] = m.full[have];
                m.none[i] = m.none[have];
            }
            light_row(c, &m, soft_m, w->light + (size_t)j * (size_t)w->side);
        }
    }
    free(rows);
    free(c);
}

void sv_shadow_window_fill(struct sv_shadow_window *w, const struct sv_heightfield *field,
                           const struct sv_shadow_height *terrain, struct sv_shadow_place place)
{
    struct columns c;
    w->x0 = place.x0;
    w->y0 = place.y0;
    w->texel_m = place.texel_m;
    w->z0 = field->z0;
    cut_columns(&c, w, field->x0, field->dx, field->width);
    for (int j = 0; j < w->side; j++)
        ground_row(field, &c, grid_at(w->y0, w->texel_m, j, field->y0, field->dy, field->height),
                   w->ground + (size_t)j * (size_t)w->side);
    measure_blocks(w);
    if (terrain)
        terrain_light(w, terrain);
    else
        memset(w->light, 255, (size_t)w->side * (size_t)w->side);
}
