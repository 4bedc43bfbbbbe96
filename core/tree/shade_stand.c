/* shade_stand.c - how much sunlight arrives at each tree of a forest.
 *
 * In the plane square to the light every tree covers a part of a picture of what light is left. A crown is
 * taken for an upright ellipsoid that lets light through evenly; the middles of its chords along the light
 * lie in a plane, which parts it into a near and a far half, each of transmittance sqrt(1 - coverage). Halves
 * are taken in the order in which light passes them; each reads the picture under the tree's outline
 * (weighted by its own coverage), the far one with the near one's part given back, then multiplies its
 * transmittance into it. The order is that of the halves' middles, taken along the light to a plane through
 * the origin that is such a plane of middles for the forest's mean crown (ORDER_RATIO): of slender trees
 * those that stand nearer to the sun on the ground come first, of flat crowns those that are higher.
 *
 * The picture is kept in tiles, only where trees are, at a resolution that fits trees; where that would take
 * more than TILES_MAX tiles it is halved, which blurs outlines but keeps the amount of shade. Its lattice is
 * that of the world's origin, its texel one of a few a doubling: trees that come and go leave both as they
 * are, and a change is taken up where it falls alone (shade_again.c). The
 * terrain's shadow is total below its height at the foot. */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "core/base/simd.h"
#include "core/tree/draw_cull.h"
#include "core/tree/shade_canvas.h"
#include "core/tree/shade_pass.h"

enum { TILE_BITS = 6, TILES_MAX = 2048, COLUMNS_MAX = 1024 };

static const double TEXELS_A_TREE = 12; /* along the mean tree, up to a step of sizes */
static const double TEXELS_MAX = 384;   /* along the tallest, the same */
static const double TEXEL_STEPS = 4;    /* sizes a doubling */
/* Crowns' (diameter / height) squared, as the order takes them. */
static const double ORDER_RATIO = 0.25;
static const float BARE_WEIGHT =
    0.02f; /* of a texel that the tree itself leaves open: answers for bare parts */

struct sv_shade_spot sv_shade_spot_of(const struct sv_shade_axes *axes, const struct sv_tree *tree)
{
    struct sv_vec3 p = sv_vec3(tree->x, tree->y, tree->z);
    return (struct sv_shade_spot){sv_dot(p, axes->right), sv_dot(p, axes->up)};
}

struct sv_shade_bounds sv_shade_tree_bounds(const struct sv_tree_shade *shade, const struct sv_shade_sun *sun,
                                            const struct sv_tree *tree)
{
    const struct sv_shade_view *view = &sun->views[shade->owner[tree->species]];
    struct sv_shade_spot at = sv_shade_spot_of(&sun->axes, tree);
    double h = (double)tree->height_m, reach = h * (double)view->reach;
    return (struct sv_shade_bounds){at.x - reach, at.y + h * (double)view->bottom, at.x + reach,
                                    at.y + h * (double)view->top};
}

/* ---- the canvas ---- */

static struct sv_shade_bounds forest_bounds(const struct sv_tree_shade *shade, const struct sv_shade_sun *sun)
{
    struct sv_shade_bounds all = {INFINITY, INFINITY, -INFINITY, -INFINITY};
    for (uint32_t k = 0; k < shade->forest->count; k++) {
        struct sv_shade_bounds b = sv_shade_tree_bounds(shade, sun, &shade->forest->trees[k]);
        all.x0 = fmin(all.x0, b.x0);
        all.y0 = fmin(all.y0, b.y0);
        all.x1 = fmax(all.x1, b.x1);
        all.y1 = fmax(all.y1, b.y1);
    }
    return all;
}

/* Tiles [x0, x1] x [y0, y1] of the canvas that a tree may touch. */
struct span {
    uint32_t x0, x1, y0, y1;
};

static uint32_t held_tile(double v, int64_t first, uint32_t count)
{
    double t = v - (double)first;
    return t > 0 ? (t < count ? (uint32_t)t : count - 1) : 0;
}

/* False: none of them is on the canvas. */
static bool span_of(const struct sv_shade_canvas *c, const struct sv_shade_bounds *b, struct span *span)
{
    double tile = c->texel * (1 << c->tile_bits), x0 = (b->x0 - c->texel) / tile,
           x1 = (b->x1 + c->texel) / tile, y0 = (b->y0 - c->texel) / tile, y1 = (b->y1 + c->texel) / tile;
    if (!(x1 >= (double)c->tile_x && x0 < (double)c->tile_x + c->tiles_x && y1 >= (double)c->tile_y &&
          y0 < (double)c->tile_y + c->tiles_y))
        return false;
    *span = (struct span){held_tile(x0, c->tile_x, c->tiles_x), held_tile(x1, c->tile_x, c->tiles_x),
                          held_tile(y0, c->tile_y, c->tiles_y), held_tile(y1, c->tile_y, c->tiles_y)};
    return true;
}

/* Numbers the tiles that trees touch; their count, or TILES_MAX + 1 where there are more. */
static uint32_t number_tiles(const struct sv_tree_shade *shade, const struct sv_shade_sun *sun,
                             struct sv_shade_canvas *c)
{
    memset(c->tile, 0, (size_t)c->tiles_x * c->tiles_y * sizeof *c->tile);
    uint32_t made = 0;
    for (uint32_t k = 0; k < shade->forest->count; k++) {
        struct sv_shade_bounds b = sv_shade_tree_bounds(shade, sun, &shade->forest->trees[k]);
        struct span s;
        if (!span_of(c, &b, &s))
            continue;
        for (uint32_t y = s.y0; y <= s.y1; y++)
            for (uint32_t x = s.x0; x <= s.x1; x++) {
                uint32_t *tile = &c->tile[(size_t)y * c->tiles_x + x];
                if (*tile)
                    continue;
                if (made == TILES_MAX)
                    return TILES_MAX + 1;
                *tile = ++made;
            }
    }
    return made;
}

double sv_shade_tallest(const struct sv_forest *forest)
{
    float height = 0;
    for (uint32_t k = 0; k < forest->count; k++)
        height = fmaxf(height, forest->trees[k].height_m);
    return (double)height;
}

/* The texel that fits the forest: of a few sizes, so that single trees do not change it. */
double sv_shade_fitting_texel(const struct sv_tree_shade *shade)
{
    double texel =
        fmax((double)shade->height_mean / TEXELS_A_TREE, sv_shade_tallest(shade->forest) / TEXELS_MAX);
    return exp2(round(log2(texel) * TEXEL_STEPS) / TEXEL_STEPS);
}

void sv_shade_lay_out(const struct sv_shade_bounds *b, double texel, int tile_bits, struct sv_shade_canvas *c)
{
    double tile = texel * (1 << tile_bits), x0 = floor((b->x0 - 2 * texel) / tile),
           y0 = floor((b->y0 - 2 * texel) / tile);
    c->texel = texel;
    c->tile_bits = tile_bits;
    c->tile_x = (int64_t)x0;
    c->tile_y = (int64_t)y0;
    c->tiles_x = (uint32_t)fmin((b->x1 + 2 * texel) / tile - x0 + 1, 1e9);
    c->tiles_y = (uint32_t)fmin((b->y1 + 2 * texel) / tile - y0 + 1, 1e9);
}

enum sv_status sv_shade_alloc_tiles(struct sv_shade_canvas *c, struct sv_error *error)
{
    c->tile = calloc((size_t)c->tiles_x * c->tiles_y, sizeof *c->tile);
    return c->tile ? SV_OK
                   : sv_fail(error, SV_ENOMEM, "trees", "no memory for %u x %u tiles of light", c->tiles_x,
                             c->tiles_y);
}

enum sv_status sv_shade_alloc_light(struct sv_shade_canvas *c, struct sv_error *error)
{
    size_t texels = (size_t)c->tiles << 2 * c->tile_bits;
    c->light = malloc(texels * sizeof *c->light + 1);
    if (!c->light)
        return sv_fail(error, SV_ENOMEM, "trees", "no memory for %zu texels of light", texels);
    memset(c->light, 0xff, texels * sizeof *c->light);
    return SV_OK;
}

static enum sv_status canvas_init(const struct sv_tree_shade *shade, const struct sv_shade_sun *sun,
                                  double texel, struct sv_shade_canvas *c, struct sv_error *error)
{
    struct sv_shade_bounds b = forest_bounds(shade, sun);
    sv_shade_lay_out(&b, texel, TILE_BITS, c);
    while ((uint64_t)c->tiles_x * c->tiles_y > SV_SHADE_GRID_MAX)
        sv_shade_lay_out(&b, c->texel * 2, TILE_BITS, c);
    enum sv_status status = sv_shade_alloc_tiles(c, error);
    if (status)
        return status;
    while ((c->tiles = number_tiles(shade, sun, c)) > TILES_MAX)
        sv_shade_lay_out(&b, c->texel * 2, TILE_BITS, c);
    return sv_shade_alloc_light(c, error);
}

void sv_shade_canvas_finish(struct sv_shade_canvas *c)
{
    free(c->tile);
    free(c->light);
}

/* ---- a tree on the canvas ---- */

struct kernel {
    sv_shade_pass *pass;
    sv_shade_mix *mix;
};

bool sv_shade_print_init(const struct sv_shade_canvas *c, const struct sv_shade_view *view,
                         const struct sv_shade_outline *o, struct sv_shade_spot at, double h,
                         struct sv_shade_print *p)
{
    if (o->levels == 0)
        return false;
    double texel = (double)o->texel * h;
    int n = 0;
    while (n < o->levels - 1 && texel * 2 <= c->texel) {
        texel *= 2;
        n++;
    }
    p->level = &o->level[n];
    /* Texels of the last level may still be smaller than the canvas': they are grown to its size. */
    double grow = fmax(1, c->texel / (2 * texel));
    double width = p->level->width * texel, height = p->level->height * texel;
    double left = at.x + h * (double)o->left - 0.5 * (grow - 1) * width;
    double top = at.y + h * (double)o->top + 0.5 * (grow - 1) * height;
    p->thin = (float)(1 / (grow * grow));
    texel *= grow;
    width *= grow;
    height *= grow;
    double i0 = floor((left - 0.5 * texel) / c->texel), j0 = floor((top - height - 0.5 * texel) / c->texel);
    double side = 1 << c->tile_bits, first_x = (double)c->tile_x * side, first_y = (double)c->tile_y * side;
    p->i0 = (int)(i0 - first_x);
    p->i1 = (int)(ceil((left + width + 0.5 * texel) / c->texel) - first_x);
    p->j0 = (int)(j0 - first_y);
    p->j1 = (int)(ceil((top + 0.5 * texel) / c->texel) - first_y);
    p->step = (float)(c->texel / texel);
    double x = (i0 + 0.5) * c->texel, y = (j0 + 0.5) * c->texel;
    p->u0 = (float)((x - left) / texel - 0.5);
    p->v0 = (float)((top - y) / texel - 0.5);
    double tall = fmax(h * ((double)view->top - (double)view->bottom), 1e-9);
    p->row0 = (float)((y - at.y - h * (double)view->bottom) / tall * SV_SHADE_ROWS);
    p->rows = (float)(c->texel / tall * SV_SHADE_ROWS);
    return p->i1 > p->i0 && p->j1 > p->j0 && p->i1 - p->i0 <= COLUMNS_MAX - 2 * SV_SHADE_LANES;
}

static int held(float v, int count)
{
    return v > 0 ? (v < (float)count ? (int)v : count - 1) : 0;
}

/* What is the same for all rows of a print, in groups of lanes that begin where the tiles' do: for each texel
 * the silhouette's column left of it (+ 1: there is an empty one on each side), how far it lies towards the
 * next, and what it weighs where nothing covers it. */
struct columns {
    int first, count; /* of texels: whole groups */
    int left[COLUMNS_MAX];
    float part[COLUMNS_MAX], bare[COLUMNS_MAX];
};

static void columns_init(const struct sv_shade_print *p, struct columns *columns)
{
    float last = (float)p->level->width;
    columns->first = p->i0 & ~(SV_SHADE_LANES - 1); /* rounded down, left of the canvas too */
    columns->count = (p->i1 - columns->first + SV_SHADE_LANES - 1) / SV_SHADE_LANES * SV_SHADE_LANES;
    for (int i = 0; i < columns->count; i++) {
        int at = columns->first + i;
        float u = p->u0 + (float)(at - p->i0) * p->step + 1;
        u = u > 0 && at >= p->i0 && at < p->i1 ? (u < last ? u : last) : 0;
        columns->left[i] = (int)u;
        columns->part[i] = u - (float)columns->left[i];
        columns->bare[i] = at >= p->i0 && at < p->i1 ? BARE_WEIGHT : 0;
    }
}

/* Row j of the print: the silhouette's two rows mixed, nothing around it. */
static void mix_row(const struct kernel *kernel, const struct sv_shade_print *p, int j,
                    float mixed[SV_OUTLINE_SIDE + 2])
{
    static const uint8_t nothing[SV_OUTLINE_SIDE];
    const struct sv_silhouette *l = p->level;
    float v = p->v0 - (float)(j - p->j0) * p->step, base = floorf(v), fv = v - base;
    int v0 = (int)base, width = l->width;
    const uint8_t *a = v0 >= 0 && v0 < l->height ? l->coverage + (size_t)v0 * (size_t)width : nothing;
    const uint8_t *b =
        v0 + 1 >= 0 && v0 + 1 < l->height ? l->coverage + (size_t)(v0 + 1) * (size_t)width : nothing;
    mixed[0] = mixed[width + 1] = 0;
    kernel->mix(a, b, (1 - fv) * p->thin / 255.0f, fv * p->thin / 255.0f, width, mixed + 1);
}

/* Row j, in runs that lie in one tile, from column begin to last - 1 of the columns, which are on the canvas.
 */
static void pass_row(const struct kernel *kernel, struct sv_shade_canvas *c, const struct columns *columns,
                     int begin, int last, int j, bool far, const float *mixed, struct sv_shade_cell *cell)
{
    const int bits = c->tile_bits, inside = (1 << bits) - 1;
    const uint32_t *tiles = c->tile + (size_t)(j >> bits) * c->tiles_x;
    for (int i = begin; i < last;) {
        int at = columns->first + i, end = (at | inside) + 1 - columns->first;
        end = end < last ? end : last;
        uint32_t tile = tiles[at >> bits];
        const struct sv_shade_row row = {columns->left + i, columns->part + i, columns->bare + i, mixed,
                                         end - i};
        if (tile > 0)
            kernel->pass(&row, far,
                         c->light + ((size_t)(tile - 1) << 2 * bits) + ((size_t)(j & inside) << bits) +
                             (at & inside),
                         cell);
        i = end;
    }
}

/* Whether light is kept in the row's texels first .. last - 1. */
static bool keeps_row(const struct sv_shade_canvas *c, int first, int last, int j)
{
    const uint32_t *tiles = c->tile + (size_t)(j >> c->tile_bits) * c->tiles_x;
    for (int x = first >> c->tile_bits; x <= (last - 1) >> c->tile_bits; x++)
        if (tiles[x] > 0)
            return true;
    return false;
}

static void pass_half(const struct kernel *kernel, struct sv_shade_canvas *c, const struct sv_shade_print *p,
                      bool far, struct sv_shade_cell cells[SV_SHADE_ROWS])
{
    float mixed[SV_OUTLINE_SIDE + 2];
    struct columns across;
    int rows = (int)c->tiles_y << c->tile_bits, columns = (int)c->tiles_x << c->tile_bits;
    int j0 = p->j0 > 0 ? p->j0 : 0, j1 = p->j1 < rows ? p->j1 : rows;
    columns_init(p, &across);
    int begin = across.first > 0 ? 0 : -across.first, end = columns - across.first;
    end = end < across.count ? end : across.count;
    for (int j = j0; j < j1; j++) {
        if (!keeps_row(c, across.first + begin, across.first + end, j))
            continue;
        int row = held(p->row0 + (float)(j - p->j0) * p->rows, SV_SHADE_ROWS);
        mix_row(kernel, p, j, mixed);
        pass_row(kernel, c, &across, begin, end, j, far, mixed, &cells[row]);
    }
}

/* Share of the terrain's light at the grid's rows: dark below the height of its shadow at the foot. */
static void terrain_rows(const struct sv_shade_view *view, const struct sv_shade_axes *axes,
                         const struct sv_tree *tree, sv_shade_ground ground, void *context,
                         float lit[SV_SHADE_ROWS])
{
    for (int r = 0; r < SV_SHADE_ROWS; r++)
        lit[r] = 1;
    double h = (double)tree->height_m;
    double dark_m = ground ? ground(context, tree->x, tree->y) - tree->z : 0;
    /* A ground that is lit has its own height for a shadow's, up to rounding and the grid's cells. */
    if (!(dark_m > 0.1 + 0.05 * h))
        return;
    /* The shadow's surface holds the light's direction: on the light's plane it is a height along up. */
    double edge = dark_m * axes->up.z, row_m = h * (double)(view->top - view->bottom) / SV_SHADE_ROWS;
    for (int r = 0; r < SV_SHADE_ROWS; r++) {
        double at = h * (double)view->bottom + (r + 0.5) * row_m;
        lit[r] = (float)sv_clamp(0.5 + (at - edge) / fmax(row_m, 1e-9), 0, 1);
    }
}

static void put_light(const struct sv_shade_cell cells[SV_SHADE_ROWS], const float lit[SV_SHADE_ROWS],
                      uint8_t share[SV_SHADE_ROWS])
{
    float light[SV_SHADE_ROWS] = {0}, weight[SV_SHADE_ROWS] = {0}, all = 0, weights = 0;
    for (int r = 0; r < SV_SHADE_ROWS; r++) {
        for (int k = 0; k < SV_SHADE_LANES; k++) {
            light[r] += cells[r].light[k];
            weight[r] += cells[r].weight[k];
        }
        all += light[r];
        weights += weight[r];
    }
    float mean = weights > 0 ? all / weights : SV_SHADE_FULL;
    for (int r = 0; r < SV_SHADE_ROWS; r++) {
        float of = weight[r] > 0 ? light[r] / weight[r] : mean;
        share[r] = (uint8_t)(of / SV_SHADE_FULL * 255.0f * lit[r] + 0.5f);
    }
}

/* Halves of `count` trees (which[k], or k where which is NULL), in the order in which light reaches them;
 * entry.tree: 2 * tree, + 1: the far half. */
enum sv_status sv_shade_order(const struct sv_tree_shade *shade, const struct sv_shade_sun *sun,
                              const uint32_t *which, uint32_t count, struct sv_cull_entry **entries,
                              struct sv_cull_entry **block, struct sv_error *error)
{
    struct sv_cull_entry *made = malloc(4 * ((size_t)count + 1) * sizeof *made);
    if (!made)
        return sv_fail(error, SV_ENOMEM, "trees", "no memory to sort %u trees", count);
    struct sv_vec3 towards = sv_shade_middle(&sun->axes, ORDER_RATIO);
    towards = sv_scale(towards, 1 / sv_dot(towards, sun->axes.to_sun));
    for (uint32_t k = 0; k < count; k++) {
        uint32_t index = which ? which[k] : k;
        const struct sv_tree *tree = &shade->forest->trees[index];
        struct sv_vec3 p = sv_sub(sv_vec3(tree->x, tree->y, tree->z), shade->forest->origin);
        double h = (double)tree->height_m, radius = (double)sun->views[shade->owner[tree->species]].reach;
        p.z += SV_SHADE_MIDDLE * h;
        double at = sv_dot(p, towards), off = h * sv_shade_chord(&sun->axes, radius) * SV_SHADE_HALF;
        made[2 * k] = (struct sv_cull_entry){sv_cull_order_code((float)-(at + off)), 2 * index};
        made[2 * k + 1] = (struct sv_cull_entry){sv_cull_order_code((float)-(at - off)), 2 * index + 1};
    }
    *block = made;
    *entries = sv_cull_sort(made, made + 2 * (size_t)count, 2 * count);
    return SV_OK;
}

/* Light passes the halves one after the other; wanted (NULL: all): whose light is written down. */
void sv_shade_pass_halves(const struct sv_tree_shade *shade, struct sv_shade_sun *sun,
                          const struct sv_shade_terrain *terrain, struct sv_shade_canvas *canvas,
                          const struct sv_cull_entry *entries, uint32_t count, const uint8_t *wanted)
{
    bool wide = sv_simd_level() >= SV_SIMD_AVX2;
    const struct kernel kernel = {wide ? sv_shade_pass_avx2 : sv_shade_pass_scalar,
                                  wide ? sv_shade_mix_avx2 : sv_shade_mix_scalar};
    for (uint32_t k = 0; k < count; k++) {
        bool far = entries[k].tree & 1;
        uint32_t index = entries[k].tree >> 1;
        const struct sv_tree *tree = &shade->forest->trees[index];
        const struct sv_shade_view *view = &sun->views[shade->owner[tree->species]];
        struct sv_shade_cell cells[SV_SHADE_ROWS] = {{{0}, {0}}};
        struct sv_shade_print print;
        float lit[SV_SHADE_ROWS];
        if (sv_shade_print_init(canvas, view, &view->turn[sv_shade_turn(tree->rotation_rad)],
                                sv_shade_spot_of(&sun->axes, tree), (double)tree->height_m, &print))
            pass_half(&kernel, canvas, &print, far, cells);
        if (wanted && !wanted[index])
            continue;
        terrain_rows(view, &sun->axes, tree, terrain->ground, terrain->context, lit);
        put_light(cells, lit, sun->lights[index].share[!far]);
    }
}

enum sv_status sv_shade_stand(const struct sv_tree_shade *shade, struct sv_shade_sun *sun,
                              const struct sv_shade_terrain *terrain, struct sv_error *error)
{
    struct sv_shade_canvas canvas = {0};
    struct sv_cull_entry *entries = NULL, *block = NULL;
    uint32_t count = shade->forest->count;
    sun->texel = sun->fitted = 0;
    if (count == 0)
        return SV_OK;
    double fitted = sv_shade_fitting_texel(shade);
    enum sv_status status = canvas_init(shade, sun, fitted, &canvas, error);
    if (!status)
        status = sv_shade_order(shade, sun, NULL, count, &entries, &block, error);
    if (!status) {
        sv_shade_pass_halves(shade, sun, terrain, &canvas, entries, 2 * count, NULL);
        sun->texel = canvas.texel;
        sun->fitted = fitted;
    }
    free(block);
    sv_shade_canvas_finish(&canvas);
    return status;
}
