/* crown_kit.c - see crown_kit.h. */
#include "tests/core/cell/crown_kit.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

void crown_panel_pack(struct crown_panel *p)
{
    struct sv_panel_about about = {
        .distance_m = 20, .face = SV_CELL_NORTH, .size = p->room.size, .layers = SV_PANEL_CROWNS};
    size_t bytes = sv_panel_measure(&p->room);
    free(p->block);
    p->block = aligned_alloc(SV_PANEL_ALIGN, bytes);
    if (!p->block || sv_panel_write(&p->room, &about, p->block, bytes, NULL) != SV_OK ||
        sv_panel_open(p->block, bytes, &p->panel, NULL) != SV_OK)
        abort();
}

void crown_panel_make(int size, struct crown_panel *p)
{
    p->block = NULL;
    if (sv_panel_room_create(size, SV_PANEL_CROWNS, &p->room, NULL) != SV_OK)
        abort();
    memset(p->room.color, 0, (size_t)size * (size_t)size * 4);
    memset(p->room.q, 0, (size_t)size * (size_t)size * 2);
    crown_panel_pack(p);
}

void crown_panel_free(struct crown_panel *p)
{
    sv_panel_room_finish(&p->room);
    free(p->block);
}

static void blob(struct crown_panel *p, struct sv_rng *rng, double radius, double q)
{
    int size = p->room.size, rgb[3];
    double x = sv_rng_range(rng, 0, size), y = sv_rng_range(rng, 0, size);
    for (int c = 0; c < 3; c++)
        rgb[c] = (int)sv_rng_range(rng, 20, 235);
    for (int j = (int)fmax(y - radius, 0); j < (int)fmin(y + radius + 1, size); j++)
        for (int i = (int)fmax(x - radius, 0); i < (int)fmin(x + radius + 1, size); i++) {
            double r = hypot(i + 0.5 - x, j + 0.5 - y) / radius, hole = sv_rng_unit(rng);
            size_t k = (size_t)j * (size_t)size + (size_t)i;
            double depth = q * (1 + 0.05 * sqrt(fmax(1 - r * r, 0)));
            if (r > 1 || hole < 0.15 + 0.5 * r * r || depth * SV_PANEL_Q_ONE < p->room.q[k])
                continue;
            double a = sv_rng_unit(rng) < 0.7 ? 1 : sv_rng_range(rng, 0.1, 1);
            for (int c = 0; c < 3; c++)
                p->room.color[k][c] = (uint8_t)(rgb[c] * sqrt(a) * sv_rng_range(rng, 0.8, 1));
            p->room.color[k][3] = (uint8_t)(255 * a);
            p->room.q[k] = (uint16_t)fmin(fmax(depth * SV_PANEL_Q_ONE, 1), 65535);
        }
}

void crown_panel_blobs(struct crown_panel *p, struct sv_rng *rng, double cover, double q_lo, double q_hi)
{
    double area = (double)p->room.size * p->room.size, left = 1.6 * cover * area;
    while (left > 0) {
        double radius = fmin(0.1, 2.0 / sqrt(area) + 0.05 * sv_rng_unit(rng)) * sqrt(area);
        blob(p, rng, radius, sv_rng_range(rng, q_lo, q_hi));
        left -= 0.7 * SV_PI * radius * radius;
    }
    crown_panel_pack(p);
}

void crown_panel_flat(struct crown_panel *p, const uint8_t color[4], double q)
{
    for (size_t k = 0; k < (size_t)p->room.size * (size_t)p->room.size; k++) {
        memcpy(p->room.color[k], color, 4);
        p->room.q[k] = (uint16_t)lrint(q * SV_PANEL_Q_ONE);
    }
    crown_panel_pack(p);
}

struct sv_camera crown_camera(enum sv_cell_face face, struct sv_vec3 v, double distance_m,
                              struct sv_vec3 offset, const double turn[3], double vfov_rad, int width,
                              int height)
{
    static const double heading[SV_CELL_FACES] = {90, 0, 270, 180, 0, 0};
    static const double pitch[SV_CELL_FACES] = {0, 0, 0, 0, -90, 90};
    struct sv_camera c = {.eye = sv_madd(v, offset, distance_m),
                          .vfov_rad = vfov_rad,
                          .width = width,
                          .height = height,
                          .near_m = 0.1 * distance_m,
                          .projection = SV_PROJECTION_PERSPECTIVE};
    sv_camera_aim(&c, sv_radians(heading[face]) + turn[0], sv_radians(pitch[face]) + turn[1], turn[2]);
    return c;
}

/* ---- brute force ---- */

/* What rounding to float may move a position by: px. */
static const double SURE_PX = 1e-3;

struct shot {
    double x, y, d, half_x, half_y;
};

/* Numerators of dx / dxs and dx / dys (row 0; y: 1) over w^2, each the largest at the corners of the texel's
 * tile. */
static double spread(const struct sv_crown_source *s, int row, int i, int j)
{
    int size = s->layer->size, tx = i / SV_PANEL_TILE, ty = j / SV_PANEL_TILE;
    const struct sv_panel_tile *tile = &s->layer->tiles[ty * sv_panel_tiles(size) + tx];
    double most[2] = {0, 0};
    for (int k = 0; k < 8; k++) {
        double x = 2 * (tx * SV_PANEL_TILE + (k & 1 ? SV_PANEL_TILE - 1 : 0) + 0.5) / size - 1;
        double y = 1 - 2 * (ty * SV_PANEL_TILE + (k & 2 ? SV_PANEL_TILE - 1 : 0) + 0.5) / size;
        double q = (k & 4 ? tile->q_max : tile->q_min) / (double)SV_PANEL_Q_ONE;
        double xw = s->m[row][0] * x + s->m[row][1] * y + s->m[row][2] * q + s->m[row][3];
        double w = s->m[3][0] * x + s->m[3][1] * y + s->m[3][2] * q + s->m[3][3];
        for (int c = 0; c < 2; c++)
            most[c] = fmax(most[c], fabs(s->m[row][c] * w - s->m[3][c] * xw));
    }
    return most[0] + most[1];
}

/* False also where the texel is too far from (x, y) to cover it. */
static bool project(const struct sv_crown_source *s, int i, int j, double x, double y, struct shot *shot)
{
    int size = s->layer->size;
    double xs = 2 * (i + 0.5) / size - 1, ys = 1 - 2 * (j + 0.5) / size, h = 1.0 / size, p[4];
    double q = sv_panel_code(s->layer, i, j) / (double)SV_PANEL_Q_ONE;
    for (int k = 0; k < 4; k++)
        p[k] = s->m[k][0] * xs + s->m[k][1] * ys + s->m[k][2] * q + s->m[k][3];
    if (!(q > 0 && p[3] > 0))
        return false;
    shot->x = p[0] / p[3];
    shot->y = p[1] / p[3];
    shot->d = p[2] / p[3];
    if (fmax(fabs(x - shot->x), fabs(y - shot->y)) > SV_CROWN_HALF_MAX + 1)
        return false;
    shot->half_x = fmin(h * spread(s, 0, i, j) / (p[3] * p[3]) + SV_CROWN_GROW, SV_CROWN_HALF_MAX);
    shot->half_y = fmin(h * spread(s, 1, i, j) / (p[3] * p[3]) + SV_CROWN_GROW, SV_CROWN_HALF_MAX);
    return shot->d >= 0 && shot->d <= 1;
}

/* Where a texel stands in the order of texels: tile by tile, row by row in each. */
static int rank_of(const struct sv_panel_layer *layer, int texel)
{
    int i = texel % layer->size, j = texel / layer->size;
    return (j / SV_PANEL_TILE * sv_panel_tiles(layer->size) + i / SV_PANEL_TILE) * SV_PANEL_SLOT_CODES +
           j % SV_PANEL_TILE * SV_PANEL_TILE + i % SV_PANEL_TILE;
}

/* The nearest texel whose box holds the centre of pixel (i, row). */
static void nearest(const struct sv_crown_source *sources, unsigned count, int i, int row,
                    struct crown_truth *t)
{
    double second = -1;
    *t = (struct crown_truth){.d = -1};
    double unsure_d = -1;
    for (unsigned k = 0; k < count; k++) {
        int size = sources[k].layer->size;
        for (int texel = 0; texel < size * size; texel++) {
            struct shot s;
            if (sv_panel_code(sources[k].layer, texel % size, texel / size) == 0 ||
                !project(&sources[k], texel % size, texel / size, i + 0.5, row + 0.5, &s))
                continue;
            double out = fmax(fabs(i + 0.5 - s.x) - s.half_x, fabs(row + 0.5 - s.y) - s.half_y);
            if (fabs(out) < SURE_PX)
                unsure_d = fmax(unsure_d, s.d);
            if (out > 0)
                continue;
            bool first = s.d == t->d && k == t->source &&
                         rank_of(sources[k].layer, texel) < rank_of(sources[k].layer, t->texel);
            if (s.d > t->d || first) {
                second = t->d;
                *t = (struct crown_truth){.any = true, .source = k, .texel = texel, .d = s.d};
            } else {
                second = fmax(second, s.d);
            }
        }
    }
    /* Depth in float: some units in the last place; equal depths are decided by the texel's number, as here.
     */
    t->unsure = unsure_d > t->d * (1 - 1e-5) || (second < t->d && second > t->d * (1 - 1e-5));
}

static double steepen(double steep, double weight)
{
    return fmin(fmax(steep * (weight - 0.5) + 0.5, 0), 1);
}

static void mean_of(const struct sv_panel_layer *layer, double steep, double u, double v, double color[4])
{
    int last = layer->size - 1;
    u = fmin(fmax(u, 0), last);
    v = fmin(fmax(v, 0), last);
    int i = (int)fmin(u, last - 1), j = (int)fmin(v, last - 1);
    memset(color, 0, 4 * sizeof *color);
    for (int k = 0; k < 4; k++) {
        int x = i + (k & 1), y = j + (k >> 1);
        double w = steepen(steep, 1 - fabs(u - x)) * steepen(steep, 1 - fabs(v - y));
        const uint8_t *c = sv_panel_color(layer, x, y);
        for (int n = 0; n < 3; n++)
            color[n] += w * (c[n] / 255.0) * (c[n] / 255.0);
        color[3] += w * c[3] / 255.0;
    }
}

/* Where the centre of the pixel lies on the plane of the texel's q: xs and ys by Cramer's rule from m (xs,
 * ys, q, 1) ~ (x, y, ., 1). */
static void place_of(const struct sv_crown_source *s, double x, double y, struct crown_truth *t)
{
    double q = sv_panel_code(s->layer, t->texel % s->layer->size, t->texel / s->layer->size) /
               (double)SV_PANEL_Q_ONE;
    double a[2][3];
    for (int r = 0; r < 2; r++) {
        double p = r == 0 ? x : y;
        a[r][0] = s->m[r][0] - p * s->m[3][0];
        a[r][1] = s->m[r][1] - p * s->m[3][1];
        a[r][2] = -(s->m[r][2] - p * s->m[3][2]) * q - (s->m[r][3] - p * s->m[3][3]);
    }
    double det = a[0][0] * a[1][1] - a[0][1] * a[1][0];
    double xs = (a[0][2] * a[1][1] - a[0][1] * a[1][2]) / det;
    double ys = (a[0][0] * a[1][2] - a[0][2] * a[1][0]) / det;
    t->u = (xs + 1) * s->layer->size / 2 - 0.5;
    t->v = (1 - ys) * s->layer->size / 2 - 0.5;
    mean_of(s->layer, (double)s->steep, t->u, t->v, t->color);
}

/* Whether the texel nearest to (u, v) is of another body than the code's. */
static bool is_other(const struct sv_panel_layer *layer, double code, double u, double v)
{
    int last = layer->size - 1;
    int i = (int)floor(fmin(fmax(u, 0), last) + 0.5), j = (int)floor(fmin(fmax(v, 0), last) + 0.5);
    double there = sv_panel_code(layer, i, j);
    return there != 0 && fabs(there - code) > (double)SV_CROWN_SAME * code;
}

/* A pixel that nothing covers shows no other body, unless pixels are covered on all sides of it
 * (crown_warp.h). */
static void judge_fill(const struct sv_crown_source *sources, unsigned count, int i, int row,
                       struct crown_truth *truth)
{
    const struct sv_panel_layer *layer = sources[truth->source].layer;
    double code = sv_panel_code(layer, truth->texel % layer->size, truth->texel / layer->size);
    bool other = is_other(layer, code, truth->u, truth->v), above = false, below = false, left = false,
         right = false;
    for (int k = 0; k < 4; k++)
        truth->unsure |= is_other(layer, code, truth->u + (k & 1 ? 0.02 : -0.02),
                                  truth->v + (k & 2 ? 0.02 : -0.02)) != other;
    if (!other)
        return;
    for (int y = -SV_CROWN_REACH; y <= SV_CROWN_REACH; y++)
        for (int x = -SV_CROWN_REACH; x <= SV_CROWN_REACH; x++) {
            struct crown_truth t;
            nearest(sources, count, i + x, row + y, &t);
            truth->unsure |= t.unsure;
            above |= t.any && y < 0;
            below |= t.any && y > 0;
            left |= t.any && x < 0;
            right |= t.any && x > 0;
        }
    if (!(above && below && left && right))
        truth->any = false;
}

void crown_truth_of(const struct sv_crown_source *sources, unsigned count, int i, int row,
                    struct crown_truth *truth)
{
    nearest(sources, count, i, row, truth);
    bool filled = !truth->any;
    for (int reach = 1; reach <= SV_CROWN_REACH && !truth->any; reach++) {
        struct crown_truth near = {.d = -1};
        bool unsure = truth->unsure;
        for (int k = 0; k < (2 * reach + 1) * (2 * reach + 1); k++) {
            struct crown_truth t;
            nearest(sources, count, i + k % (2 * reach + 1) - reach, row + k / (2 * reach + 1) - reach, &t);
            unsure |= t.unsure || (t.any && t.d != near.d && fabs(t.d - near.d) < 1e-5 * t.d);
            if (t.any && (t.d > near.d ||
                          (t.d == near.d &&
                           (t.source < near.source ||
                            (t.source == near.source && rank_of(sources[t.source].layer, t.texel) <
                                                            rank_of(sources[t.source].layer, near.texel))))))
                near = t;
        }
        *truth = near;
        truth->unsure = unsure;
    }
    if (truth->any)
        place_of(&sources[truth->source], i + 0.5, row + 0.5, truth);
    if (truth->any && filled && !truth->unsure)
        judge_fill(sources, count, i, row, truth);
}
