/* shade_again.c - light at the trees that a change of the forest touches, and at no others.
 *
 * A tree darkens the texels of its print and reads no others. So light changes only at trees whose prints
 * share a texel with that of a tree which came or went (they are taken again), and to find it all trees are
 * needed that share a texel with one of those. Both are found by the forest's hierarchy and a map of cells of
 * CELL x CELL texels. What is found is the same as if all trees had been taken. */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "core/tree/shade_canvas.h"

enum {
    TILE_BITS = 3,     /* of a canvas for a change: as small as a kernel bears, as changes are */
    TILE_BITS_MAX = 6, /* where those would be too many */
    CELL_BITS = 1,
    MARGIN = 16,     /* texels: more than a print reaches beyond its tree's bounds */
    LOOK_MAX = 4096, /* cells: a node that is larger is opened without a look */
    STACK = 64,
};

/* Cells of the canvas that hold something. */
struct marks {
    int w, h;
    uint8_t *cell; /* heap */
};

/* Texels [i0, i1) x [j0, j1) of the canvas. */
struct rect {
    int i0, i1, j0, j1;
};

/* What a search needs to know. reach, bottom, top: of any tree, m. */
struct search {
    const struct sv_tree_shade *shade;
    const struct sv_shade_sun *sun;
    const struct sv_shade_canvas *canvas;
    double reach, bottom, top;
};

/* ---- marks ---- */

static enum sv_status marks_init(const struct sv_shade_canvas *c, struct marks *m, struct sv_error *error)
{
    m->w = (int)(c->tiles_x << (c->tile_bits - CELL_BITS));
    m->h = (int)(c->tiles_y << (c->tile_bits - CELL_BITS));
    m->cell = calloc((size_t)m->w * (size_t)m->h + 1, 1);
    return m->cell ? SV_OK : sv_fail(error, SV_ENOMEM, "trees", "no memory for %d x %d marks", m->w, m->h);
}

/* The cells that hold the rectangle, inclusive; false: none of them is on the canvas. */
static bool cells_of(const struct marks *m, const struct rect *r, struct rect *cells)
{
    cells->i0 = r->i0 > 0 ? r->i0 >> CELL_BITS : 0;
    cells->j0 = r->j0 > 0 ? r->j0 >> CELL_BITS : 0;
    cells->i1 = r->i1 > 0 ? (r->i1 - 1) >> CELL_BITS : -1;
    cells->j1 = r->j1 > 0 ? (r->j1 - 1) >> CELL_BITS : -1;
    cells->i1 = cells->i1 < m->w ? cells->i1 : m->w - 1;
    cells->j1 = cells->j1 < m->h ? cells->j1 : m->h - 1;
    return cells->i0 <= cells->i1 && cells->j0 <= cells->j1;
}

static void put(struct marks *m, const struct rect *r)
{
    struct rect c;
    if (!cells_of(m, r, &c))
        return;
    for (int j = c.j0; j <= c.j1; j++)
        memset(m->cell + (size_t)j * (size_t)m->w + c.i0, 1, (size_t)(c.i1 - c.i0 + 1));
}

static bool meets(const struct marks *m, const struct rect *r)
{
    struct rect c;
    if (!cells_of(m, r, &c))
        return false;
    for (int j = c.j0; j <= c.j1; j++)
        if (memchr(m->cell + (size_t)j * (size_t)m->w + c.i0, 1, (size_t)(c.i1 - c.i0 + 1)))
            return true;
    return false;
}

/* ---- trees and nodes on the canvas ---- */

/* False: the tree has no print. */
static bool tree_rect(const struct search *s, const struct sv_tree *tree, struct rect *r)
{
    const struct sv_shade_view *view = &s->sun->views[s->shade->owner[tree->species]];
    struct sv_shade_print p;
    if (!sv_shade_print_init(s->canvas, view, &view->turn[sv_shade_turn(tree->rotation_rad)],
                             sv_shade_spot_of(&s->sun->axes, tree), (double)tree->height_m, &p))
        return false;
    *r = (struct rect){p.i0, p.i1, p.j0, p.j1};
    return true;
}

/* What the node's feet cover along an axis of the light's plane, m. */
static void feet_along(const struct sv_forest *f, const struct sv_forest_node *n, struct sv_vec3 axis,
                       double *low, double *high)
{
    const double a[3] = {axis.x, axis.y, axis.z};
    *low = *high = sv_dot(f->origin, axis);
    for (int k = 0; k < 3; k++) {
        double p = a[k] * (double)n->box_min[k], q = a[k] * (double)n->box_max[k];
        *low += fmin(p, q);
        *high += fmax(p, q);
    }
}

static int held_texel(double v, double texel, int64_t first_tile, int bits, int add)
{
    return (int)sv_clamp(floor(v / texel) - (double)first_tile * (1 << bits) + add, -1e9, 1e9);
}

/* Texels that prints of the node's trees may touch. */
static struct rect node_rect(const struct search *s, const struct sv_forest_node *n)
{
    const struct sv_shade_canvas *c = s->canvas;
    double x0, x1, y0, y1;
    feet_along(s->shade->forest, n, s->sun->axes.right, &x0, &x1);
    feet_along(s->shade->forest, n, s->sun->axes.up, &y0, &y1);
    return (struct rect){held_texel(x0 - s->reach, c->texel, c->tile_x, c->tile_bits, -MARGIN),
                         held_texel(x1 + s->reach, c->texel, c->tile_x, c->tile_bits, MARGIN),
                         held_texel(y0 + s->bottom, c->texel, c->tile_y, c->tile_bits, -MARGIN),
                         held_texel(y1 + s->top, c->texel, c->tile_y, c->tile_bits, MARGIN)};
}

static bool worth_opening(const struct search *s, const struct marks *m, const struct sv_forest_node *n)
{
    struct rect r = node_rect(s, n), c;
    if (n->count == 0 || !cells_of(m, &r, &c))
        return false;
    return (int64_t)(c.i1 - c.i0 + 1) * (c.j1 - c.j0 + 1) > LOOK_MAX || meets(m, &r);
}

/* Trees whose print meets the marks, rising; their count. found: room for all trees. */
static uint32_t find(const struct search *s, const struct marks *m, uint32_t *found)
{
    const struct sv_forest *f = s->shade->forest;
    uint32_t stack[STACK], count = 0;
    int top = 0;
    stack[top++] = 1;
    while (top > 0) {
        uint32_t k = stack[--top];
        const struct sv_forest_node *n = &f->nodes[k];
        if (!worth_opening(s, m, n))
            continue;
        if (k < f->leaf_first) {
            stack[top++] = 2 * k + 1;
            stack[top++] = 2 * k;
            continue;
        }
        for (uint32_t t = n->first; t < n->first + n->count; t++) {
            struct rect r;
            if (tree_rect(s, &f->trees[t], &r) && meets(m, &r))
                found[count++] = t;
        }
    }
    return count;
}

/* ---- the change ---- */

/* What came and what went; came[k]: where `come[k]` stands in the forest. */
struct change {
    const struct sv_tree *gone, *come;
    const uint32_t *came;
    uint32_t gone_count, come_count;
};

static const struct sv_tree *changed(const struct change *change, uint32_t k)
{
    return k < change->gone_count ? &change->gone[k] : &change->come[k - change->gone_count];
}

/* The part of the lattice that a change can reach: that of changed trees, and a tree's width about them. */
static void reach_of_change(struct search *s, const struct change *change, struct sv_shade_canvas *c)
{
    struct sv_shade_bounds all = {INFINITY, INFINITY, -INFINITY, -INFINITY};
    double tall = sv_shade_tallest(s->shade->forest), reach = 0, bottom = 0, top = 0;
    for (uint32_t k = 0; k < change->gone_count + change->come_count; k++) {
        struct sv_shade_bounds b = sv_shade_tree_bounds(s->shade, s->sun, changed(change, k));
        all = (struct sv_shade_bounds){fmin(all.x0, b.x0), fmin(all.y0, b.y0), fmax(all.x1, b.x1),
                                       fmax(all.y1, b.y1)};
    }
    for (int k = 0; k < s->shade->species_count; k++) {
        const struct sv_shade_view *v = &s->sun->views[s->shade->owner[k]];
        reach = fmax(reach, (double)v->reach);
        bottom = fmin(bottom, (double)v->bottom);
        top = fmax(top, (double)v->top);
    }
    s->reach = reach * tall;
    s->bottom = bottom * tall;
    s->top = top * tall;
    double margin = MARGIN * s->sun->texel, across = 2 * s->reach + margin, up = s->top - s->bottom + margin;
    all = (struct sv_shade_bounds){all.x0 - across, all.y0 - up, all.x1 + across, all.y1 + up};
    for (int bits = TILE_BITS; bits <= TILE_BITS_MAX; bits++) {
        sv_shade_lay_out(&all, s->sun->texel, bits, c);
        if ((uint64_t)c->tiles_x * c->tiles_y <= SV_SHADE_GRID_MAX)
            break;
    }
}

/* Tiles under the rectangle, which are on the canvas, hold light. */
static void want_tiles(struct sv_shade_canvas *c, const struct rect *r)
{
    int w = (int)c->tiles_x, h = (int)c->tiles_y;
    for (int y = r->j0 > 0 ? r->j0 >> c->tile_bits : 0; y <= (r->j1 - 1) >> c->tile_bits && y < h; y++)
        for (int x = r->i0 > 0 ? r->i0 >> c->tile_bits : 0; x <= (r->i1 - 1) >> c->tile_bits && x < w; x++) {
            uint32_t *tile = &c->tile[(size_t)y * (size_t)w + (size_t)x];
            *tile = *tile ? *tile : ++c->tiles;
        }
}

/* Trees whose light is found again (wanted), and all that it takes for that (which); their count. */
static uint32_t choose(const struct search *s, const struct change *change, struct sv_shade_canvas *c,
                       struct marks *touched, struct marks *again, uint8_t *wanted, uint32_t *which)
{
    struct rect r;
    for (uint32_t k = 0; k < change->gone_count + change->come_count; k++)
        if (tree_rect(s, changed(change, k), &r))
            put(touched, &r);
    uint32_t count = find(s, touched, which);
    for (uint32_t k = 0; k < count; k++) {
        if (!tree_rect(s, &s->shade->forest->trees[which[k]], &r))
            continue; /* never: it was found by it */
        wanted[which[k]] = 1;
        put(again, &r);
        want_tiles(c, &r);
    }
    count = find(s, again, which);
    for (uint32_t k = 0; k < change->come_count; k++) /* what has no print has its light, too */
        if (!tree_rect(s, &change->come[k], &r)) {
            wanted[change->came[k]] = 1;
            which[count++] = change->came[k];
        }
    return count;
}

static enum sv_status take_again(const struct search *s, struct sv_shade_sun *sun,
                                 const struct sv_shade_terrain *terrain, const struct change *change,
                                 struct sv_shade_canvas *c, uint32_t most, bool *left, struct sv_error *error)
{
    size_t trees = s->shade->forest->count;
    uint8_t *wanted = calloc(trees, 1);
    uint32_t *which = malloc(trees * sizeof *which), count = 0;
    struct marks touched = {0}, again = {0};
    struct sv_cull_entry *entries = NULL, *block = NULL;
    enum sv_status status = sv_shade_alloc_tiles(c, error);
    if (!status)
        status = marks_init(c, &touched, error);
    if (!status)
        status = marks_init(c, &again, error);
    if (!status && (!wanted || !which))
        status = sv_fail(error, SV_ENOMEM, "trees", "no memory to choose among %zu trees", trees);
    if (!status) {
        count = choose(s, change, c, &touched, &again, wanted, which);
        *left = count > most;
    }
    if (!status && !*left)
        status = sv_shade_alloc_light(c, error);
    if (!status && !*left)
        status = sv_shade_order(s->shade, sun, which, count, &entries, &block, error);
    if (!status && !*left)
        sv_shade_pass_halves(s->shade, sun, terrain, c, entries, 2 * count, wanted);
    free(block);
    free(touched.cell);
    free(again.cell);
    free(which);
    free(wanted);
    return status;
}

/* All of them are taken again. */
static enum sv_status stand_anew(const struct sv_tree_shade *shade, struct sv_shade_sun *sun,
                                 const struct sv_shade_terrain *terrain, uint32_t most, bool *left,
                                 struct sv_error *error)
{
    *left = shade->forest->count > most;
    return *left ? SV_OK : sv_shade_stand(shade, sun, terrain, error);
}

/* The trees that came, and where they stand; `came` has room for all. */
static uint32_t list_come(const struct sv_forest *forest, const uint32_t *from, struct sv_tree *come,
                          uint32_t *came)
{
    uint32_t count = 0;
    for (uint32_t k = 0; k < forest->count; k++)
        if (from[k] == SV_FOREST_CAME) {
            if (come) {
                come[count] = forest->trees[k];
                came[count] = k;
            }
            count++;
        }
    return count;
}

enum sv_status sv_shade_stand_again(const struct sv_tree_shade *shade, struct sv_shade_sun *sun,
                                    const struct sv_shade_terrain *terrain, const struct sv_tree *gone,
                                    uint32_t gone_count, const uint32_t *from, uint32_t most, bool *left,
                                    struct sv_error *error)
{
    *left = false;
    if (shade->forest->count == 0 || sun->fitted != sv_shade_fitting_texel(shade))
        return stand_anew(shade, sun, terrain, most, left, error);
    uint32_t come_count = list_come(shade->forest, from, NULL, NULL);
    struct sv_tree *come = malloc((come_count + (size_t)1) * sizeof *come);
    uint32_t *came = malloc((come_count + (size_t)1) * sizeof *came);
    struct sv_shade_canvas canvas = {0};
    enum sv_status status = SV_OK;
    if (!come || !came)
        status = sv_fail(error, SV_ENOMEM, "trees", "no memory for %u trees", come_count);
    if (!status && come_count + gone_count > 0) {
        (void)list_come(shade->forest, from, come, came);
        struct change change = {gone, come, came, gone_count, come_count};
        struct search search = {.shade = shade, .sun = sun, .canvas = &canvas};
        reach_of_change(&search, &change, &canvas);
        status = (uint64_t)canvas.tiles_x * canvas.tiles_y > SV_SHADE_GRID_MAX
                     ? stand_anew(shade, sun, terrain, most, left, error)
                     : take_again(&search, sun, terrain, &change, &canvas, most, left, error);
    }
    sv_shade_canvas_finish(&canvas);
    free(came);
    free(come);
    return status;
}
