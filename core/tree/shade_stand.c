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
 * more than TILES_MAX tiles it is halved, which blurs outlines but keeps the amount of shade. The terrain's
 * shadow is total below its height at the foot. */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "core/base/simd.h"
#include "core/tree/draw_cull.h"
#include "core/tree/shade_pass.h"
#include "core/tree/shade_private.h"

enum { TILE = 64, TILE_TEXELS = TILE * TILE, TILES_MAX = 2048, GRID_MAX = 1 << 22, COLUMNS_MAX = 1024 };

static const double TEXELS_A_TREE = 12; /* along the mean tree */
static const double TEXELS_MAX = 384;   /* along the tallest */
/* Crowns' (diameter / height) squared, as the order takes them. */
static const double ORDER_RATIO = 0.25;
static const float BARE_WEIGHT =
    0.02f; /* of a texel that the tree itself leaves open: answers for bare parts */

struct canvas {
    double x0, y0,
        texel; /* place of the lower left corner on the light's plane, from the forest's origin, m */
    uint32_t tiles_x, tiles_y, tiles;
    uint32_t *tile;  /* heap: index of the tile's texels + 1; 0: no tree is there */
    uint16_t *light; /* heap: share of light left, * SV_SHADE_FULL */
};

/* A tree on the light's plane: foot, m from the forest's origin. */
struct spot {
    double x, y;
};

static struct spot spot_of(const struct sv_forest *forest, const struct sv_shade_axes *axes,
                           const struct sv_tree *tree)
{
    struct sv_vec3 p = sv_sub(sv_vec3(tree->x, tree->y, tree->z), forest->origin);
    return (struct spot){sv_dot(p, axes->right), sv_dot(p, axes->up)};
}

struct bounds {
    double x0, y0, x1, y1;
};

static struct bounds tree_bounds(const struct sv_tree_shade *shade, const struct sv_shade_sun *sun,
                                 const struct sv_tree *tree)
{
    const struct sv_shade_view *view = &sun->views[shade->owner[tree->species]];
    struct spot at = spot_of(shade->forest, &sun->axes, tree);
    double h = (double)tree->height_m, reach = h * (double)view->reach;
    return (struct bounds){at.x - reach, at.y + h * (double)view->bottom, at.x + reach,
                           at.y + h * (double)view->top};
}

/* ---- the canvas ---- */

static struct bounds forest_bounds(const struct sv_tree_shade *shade, const struct sv_shade_sun *sun)
{
    struct bounds all = {INFINITY, INFINITY, -INFINITY, -INFINITY};
    for (uint32_t k = 0; k < shade->forest->count; k++) {
        struct bounds b = tree_bounds(shade, sun, &shade->forest->trees[k]);
        all.x0 = fmin(all.x0, b.x0);
        all.y0 = fmin(all.y0, b.y0);
        all.x1 = fmax(all.x1, b.x1);
        all.y1 = fmax(all.y1, b.y1);
    }
    return all;
}

static uint32_t tile_at(double v, double v0, double texel, uint32_t count)
{
    double t = (v - v0) / (texel * TILE);
    return t > 0 ? (t < count ? (uint32_t)t : count - 1) : 0;
}

/* Numbers the tiles that trees touch; their count, or TILES_MAX + 1 where there are more. */
static uint32_t number_tiles(const struct sv_tree_shade *shade, const struct sv_shade_sun *sun,
                             struct canvas *c)
{
    memset(c->tile, 0, (size_t)c->tiles_x * c->tiles_y * sizeof *c->tile);
    uint32_t made = 0;
    for (uint32_t k = 0; k < shade->forest->count; k++) {
        struct bounds b = tree_bounds(shade, sun, &shade->forest->trees[k]);
        uint32_t x0 = tile_at(b.x0 - c->texel, c->x0, c->texel, c->tiles_x),
                 x1 = tile_at(b.x1 + c->texel, c->x0, c->texel, c->tiles_x),
                 y0 = tile_at(b.y0 - c->texel, c->y0, c->texel, c->tiles_y),
                 y1 = tile_at(b.y1 + c->texel, c->y0, c->texel, c->tiles_y);
        for (uint32_t y = y0; y <= y1; y++)
            for (uint32_t x = x0; x <= x1; x++) {
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

static double tallest(const struct sv_forest *forest)
{
    double height = 0;
    for (uint32_t k = 0; k < forest->count; k++)
        height = fmax(height, (double)forest->trees[k].height_m);
    return height;
}

static void lay_out(const struct bounds *b, double texel, struct canvas *c)
{
    c->texel = texel;
    c->x0 = b->x0 - 2 * texel;
    c->y0 = b->y0 - 2 * texel;
    c->tiles_x = (uint32_t)fmin((b->x1 - c->x0 + 2 * texel) / (texel * TILE) + 1, 1e9);
    c->tiles_y = (uint32_t)fmin((b->y1 - c->y0 + 2 * texel) / (texel * TILE) + 1, 1e9);
}

static enum sv_status canvas_init(const struct sv_tree_shade *shade, const struct sv_shade_sun *sun,
                                  struct canvas *c, struct sv_error *error)
{
    struct bounds b = forest_bounds(shade, sun);
    double texel = fmax((double)shade->height_mean / TEXELS_A_TREE, tallest(shade->forest) / TEXELS_MAX);
    lay_out(&b, texel, c);
    while ((uint64_t)c->tiles_x * c->tiles_y > GRID_MAX)
        lay_out(&b, c->texel * 2, c);
    c->tile = malloc((size_t)c->tiles_x * c->tiles_y * sizeof *c->tile);
    if (!c->tile)
        return sv_fail(error, SV_ENOMEM, "trees", "no memory for %u x %u tiles of light", c->tiles_x,
                       c->tiles_y);
    while ((c->tiles = number_tiles(shade, sun, c)) > TILES_MAX)
        lay_out(&b, c->texel * 2, c);
    size_t texels = (size_t)c->tiles * TILE_TEXELS;
    c->light = malloc(texels * sizeof *c->light + 1);
    if (!c->light)
        return sv_fail(error, SV_ENOMEM, "trees", "no memory for %zu texels of light", texels);
    memset(c->light, 0xff, texels * sizeof *c->light);
    return SV_OK;
}

static void canvas_finish(struct canvas *c)
{
    free(c->tile);
    free(c->light);
}

/* ---- a tree on the canvas ---- */

struct kernel {
    sv_shade_pass *pass;
    sv_shade_mix *mix;
};

/* A tree's outline on the canvas: texels [i0, i1) x [j0, j1), and for each the place in the silhouette. */
struct print {
    const struct sv_silhouette *level;
    int i0, i1, j0, j1;
    float u0, v0, step; /* silhouette coordinates (texel centres at whole numbers) of texel (i0, j0) */
    float row0, rows;   /* grid coordinate of texel j0, and a texel */
    float thin; /* what coverage is multiplied by: a tree of less than a texel is drawn larger and thinner */
};

static bool print_init(const struct canvas *c, const struct sv_shade_view *view,
                       const struct sv_shade_outline *o, struct spot at, double h, struct print *p)
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
    double left = at.x + h * (double)o->left - c->x0 - 0.5 * (grow - 1) * width;
    double top = at.y + h * (double)o->top - c->y0 + 0.5 * (grow - 1) * height;
    p->thin = (float)(1 / (grow * grow));
    texel *= grow;
    width *= grow;
    height *= grow;
    p->i0 = (int)floor((left - 0.5 * texel) / c->texel);
    p->i1 = (int)ceil((left + width + 0.5 * texel) / c->texel);
    p->j0 = (int)floor((top - height - 0.5 * texel) / c->texel);
    p->j1 = (int)ceil((top + 0.5 * texel) / c->texel);
    p->i0 = p->i0 < 0 ? 0 : p->i0;
    p->j0 = p->j0 < 0 ? 0 : p->j0;
    p->step = (float)(c->texel / texel);
    double x = (p->i0 + 0.5) * c->texel, y = (p->j0 + 0.5) * c->texel;
    p->u0 = (float)((x - left) / texel - 0.5);
    p->v0 = (float)((top - y) / texel - 0.5);
    double tall = fmax(h * ((double)view->top - (double)view->bottom), 1e-9);
    p->row0 = (float)((y + c->y0 - at.y - h * (double)view->bottom) / tall * SV_SHADE_ROWS);
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

static void columns_init(const struct print *p, struct columns *columns)
{
    float last = (float)p->level->width;
    columns->first = p->i0 / SV_SHADE_LANES * SV_SHADE_LANES;
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
static void mix_row(const struct kernel *kernel, const struct print *p, int j,
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

/* Row j, in runs that lie in one tile. */
static void pass_row(const struct kernel *kernel, struct canvas *c, const struct columns *columns, int j,
                     bool far, const float *mixed, struct sv_shade_cell *cell)
{
    const uint32_t *tiles = c->tile + (size_t)(j / TILE) * c->tiles_x;
    for (int i = 0; i < columns->count;) {
        int at = columns->first + i, end = (at / TILE + 1) * TILE - columns->first;
        end = end < columns->count ? end : columns->count;
        uint32_t tile = tiles[at / TILE];
        const struct sv_shade_row row = {columns->left + i, columns->part + i, columns->bare + i, mixed,
                                         end - i};
        if (tile > 0)
            kernel->pass(&row, far,
                         c->light + (size_t)(tile - 1) * TILE_TEXELS + (size_t)(j % TILE) * TILE + at % TILE,
                         cell);
        i = end;
    }
}

static void pass_half(const struct kernel *kernel, struct canvas *c, const struct print *p, bool far,
                      struct sv_shade_cell cells[SV_SHADE_ROWS])
{
    float mixed[SV_OUTLINE_SIDE + 2];
    struct columns across;
    int rows = (int)c->tiles_y * TILE, columns = (int)c->tiles_x * TILE;
    struct print held_in = *p;
    held_in.i1 = p->i1 < columns ? p->i1 : columns;
    held_in.j1 = p->j1 < rows ? p->j1 : rows;
    columns_init(&held_in, &across);
    for (int j = held_in.j0; j < held_in.j1; j++) {
        int row = held(p->row0 + (float)(j - p->j0) * p->rows, SV_SHADE_ROWS);
        mix_row(kernel, &held_in, j, mixed);
        pass_row(kernel, c, &across, j, far, mixed, &cells[row]);
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

/* Halves of all trees, in the order in which light reaches them; entry.tree: 2 * tree, + 1: the far half. */
static enum sv_status order(const struct sv_tree_shade *shade, const struct sv_shade_sun *sun,
                            struct sv_cull_entry **entries, struct sv_cull_entry **block,
                            struct sv_error *error)
{
    uint32_t count = shade->forest->count;
    struct sv_cull_entry *made = malloc(4 * ((size_t)count + 1) * sizeof *made);
    if (!made)
        return sv_fail(error, SV_ENOMEM, "trees", "no memory to sort %u trees", count);
    struct sv_vec3 towards = sv_shade_middle(&sun->axes, ORDER_RATIO);
    towards = sv_scale(towards, 1 / sv_dot(towards, sun->axes.to_sun));
    for (uint32_t k = 0; k < count; k++) {
        const struct sv_tree *tree = &shade->forest->trees[k];
        struct sv_vec3 p = sv_sub(sv_vec3(tree->x, tree->y, tree->z), shade->forest->origin);
        double h = (double)tree->height_m, radius = (double)sun->views[shade->owner[tree->species]].reach;
        p.z += SV_SHADE_MIDDLE * h;
        double at = sv_dot(p, towards), off = h * sv_shade_chord(&sun->axes, radius) * SV_SHADE_HALF;
        made[2 * k] = (struct sv_cull_entry){sv_cull_order_code((float)-(at + off)), 2 * k};
        made[2 * k + 1] = (struct sv_cull_entry){sv_cull_order_code((float)-(at - off)), 2 * k + 1};
    }
    *block = made;
    *entries = sv_cull_sort(made, made + 2 * (size_t)count, 2 * count);
    return SV_OK;
}

enum sv_status sv_shade_stand(const struct sv_tree_shade *shade, struct sv_shade_sun *sun,
                              sv_shade_ground ground, void *ground_context, struct sv_error *error)
{
    struct canvas canvas = {0};
    struct sv_cull_entry *entries = NULL, *block = NULL;
    uint32_t count = shade->forest->count;
    bool wide = sv_simd_level() >= SV_SIMD_AVX2;
    const struct kernel kernel = {wide ? sv_shade_pass_avx2 : sv_shade_pass_scalar,
                                  wide ? sv_shade_mix_avx2 : sv_shade_mix_scalar};
    if (count == 0)
        return SV_OK;
    enum sv_status status = canvas_init(shade, sun, &canvas, error);
    if (!status)
        status = order(shade, sun, &entries, &block, error);
    for (uint32_t k = 0; !status && k < 2 * count; k++) {
        bool far = entries[k].tree & 1;
        uint32_t index = entries[k].tree >> 1;
        const struct sv_tree *tree = &shade->forest->trees[index];
        const struct sv_shade_view *view = &sun->views[shade->owner[tree->species]];
        struct sv_shade_cell cells[SV_SHADE_ROWS] = {{{0}, {0}}};
        struct print print;
        float lit[SV_SHADE_ROWS];
        if (print_init(&canvas, view, &view->turn[sv_shade_turn(tree->rotation_rad)],
                       spot_of(shade->forest, &sun->axes, tree), (double)tree->height_m, &print))
            pass_half(&kernel, &canvas, &print, far, cells);
        terrain_rows(view, &sun->axes, tree, ground, ground_context, lit);
        put_light(cells, lit, sun->lights[index].share[!far]);
    }
    free(block);
    canvas_finish(&canvas);
    return status;
}
