/* shade_cast.c - the forest's shadow on a window of ground.
 *
 * The hierarchy's boxes, swept along the light over the heights that the ground has, are held against the
 * window; trees of what is left are cast by sv_shadow_window_cast with a silhouette whose texels are about
 * the window's. A tree that is narrower than the window's texels is put down row by row as points of shade:
 * the same amount, some tens of nanoseconds. */
#include <math.h>

#include "core/base/rng.h"
#include "core/tree/shade_private.h"

enum { STACK = 64 };

static const double STAMP_TEXELS = 1.25; /* trees narrower than that are stamped */
/* Silhouette texels are 1 / sqrt(2) to sqrt(2) of the window's: one sample of them is enough
 * (sv_shadow_window_cast). */
static const double FINEST = 1.4;
static const double SHARE_TEXEL_M = 0.5; /* of outlines, where a place asks for its light */
static const double LEVEL_SUN_Z = 1e-6;  /* suns lower than that are taken to stand there */

/* What is the same for all trees. Places are relative to the window's corner and to its z0. */
struct casting {
    const struct sv_tree_shade *shade;
    const struct sv_shade_sun *sun;
    struct sv_shadow_window *window;
    double side_m;           /* of the window */
    double slope_x, slope_y; /* by how much shade moves for a metre of height */
};

struct box {
    double lo[3], hi[3];
};

/* Narrows [*from, *to] to the heights u for which [lo, hi] + slope u meets [0, side]. */
static bool meet(double lo, double hi, double slope, double side, double *from, double *to)
{
    if (fabs(slope) < 1e-12)
        return lo <= side && hi >= 0;
    double a = -hi / slope, b = (side - lo) / slope;
    *from = fmax(*from, fmin(a, b));
    *to = fmin(*to, fmax(a, b));
    return *from <= *to;
}

static bool reaches(const struct casting *c, const struct box *box)
{
    double from = fmax(0, box->lo[2] - (double)c->window->ground_max),
           to = box->hi[2] - (double)c->window->ground_min;
    return from <= to && meet(box->lo[0], box->hi[0], c->slope_x, c->side_m, &from, &to) &&
           meet(box->lo[1], box->hi[1], c->slope_y, c->side_m, &from, &to);
}

static struct box node_box(const struct casting *c, const struct sv_forest_node *node)
{
    const struct sv_vec3 o = c->shade->forest->origin;
    const double at[3] = {o.x - c->window->x0, o.y - c->window->y0, o.z - c->window->z0};
    struct box box;
    for (int a = 0; a < 3; a++) {
        box.lo[a] = at[a] + (double)node->box_min[a];
        box.hi[a] = at[a] + (double)node->box_max[a];
    }
    return box;
}

static struct box tree_box(const struct casting *c, const struct sv_tree *tree)
{
    double h = (double)tree->height_m, r = h * (double)c->shade->species[tree->species].radius;
    double x = tree->x - c->window->x0, y = tree->y - c->window->y0, z = tree->z - c->window->z0;
    return (struct box){{x - r, y - r, z}, {x + r, y + r, z + h}};
}

static int level_for(const struct sv_shade_outline *o, double height_m, double texel_m)
{
    int n = 0;
    double texel = (double)o->texel * height_m;
    while (n < o->levels - 1 && texel * FINEST <= texel_m) {
        texel *= 2;
        n++;
    }
    return n;
}

static float ground_at(const struct sv_shadow_window *w, double x, double y)
{
    int i = (int)sv_clamp(x / w->texel_m, 0, w->side - 1),
        j = (int)sv_clamp(y / w->texel_m, 0, w->side - 1);
    return w->ground[(size_t)j * (size_t)w->side + (size_t)i];
}

/* Rounds up or down by chance (of a hash, so always the same), or small trees would leave no shade at all. */
static void darken(struct sv_shadow_window *w, int i, int j, double share, uint64_t seed)
{
    if (i < 0 || j < 0 || i >= w->side || j >= w->side)
        return;
    uint8_t *light = &w->light[(size_t)j * (size_t)w->side + (size_t)i];
    double chance =
        (double)(sv_mix64(seed ^ (uint64_t)(j & 1) << 62 ^ (uint64_t)(i & 1) << 63) >> 11) * 0x1p-53;
    *light = (uint8_t)((double)*light * (1 - fmin(share, 1)) + chance);
}

/* Shade of `area_m2` (on the light's plane) at the point p (window's frame), on the ground below it. */
static void stamp(const struct casting *c, struct sv_vec3 p, double area_m2, uint64_t seed)
{
    struct sv_shadow_window *w = c->window;
    double x = p.x, y = p.y;
    for (int k = 0; k < 3;
         k++) { /* the ground's height where the shade falls, from where it was thought to */
        double drop = p.z - (double)ground_at(w, x, y);
        x = p.x + c->slope_x * drop;
        y = p.y + c->slope_y * drop;
    }
    double u = x / w->texel_m - 0.5, v = y / w->texel_m - 0.5;
    if (!(u > -1 && v > -1 && u < w->side && v < w->side))
        return;
    double share = area_m2 / (fmax(c->sun->axes.to_sun.z, LEVEL_SUN_Z) * w->texel_m * w->texel_m);
    double fu = u - floor(u), fv = v - floor(v);
    int i = (int)floor(u), j = (int)floor(v);
    darken(w, i, j, share * (1 - fu) * (1 - fv), seed);
    darken(w, i + 1, j, share * fu * (1 - fv), seed);
    darken(w, i, j + 1, share * (1 - fu) * fv, seed);
    darken(w, i + 1, j + 1, share * fu * fv, seed);
}

/* A slender tree: each row of a silhouette whose rows are about a window's texel long on the ground. */
static void stamp_tree(const struct casting *c, const struct sv_shade_outline *o, const struct sv_tree *tree)
{
    const struct sv_shade_axes *axes = &c->sun->axes;
    double h = (double)tree->height_m;
    const struct sv_silhouette *l =
        &o->level[level_for(o, h, c->window->texel_m * fmax(axes->to_sun.z, LEVEL_SUN_Z))];
    double texel = h * l->width_m / l->width;
    struct sv_vec3 foot = sv_vec3(tree->x - c->window->x0, tree->y - c->window->y0, tree->z - c->window->z0);
    for (int j = 0; j < l->height; j++) {
        double sum = 0, across = 0;
        for (int i = 0; i < l->width; i++) {
            double covered = l->coverage[(size_t)j * (size_t)l->width + (size_t)i];
            sum += covered;
            across += covered * (i + 0.5);
        }
        if (!(sum > 0))
            continue;
        double x = h * (double)o->left + across / sum * texel, y = h * (double)o->top - (j + 0.5) * texel;
        stamp(c, sv_madd(sv_madd(foot, axes->right, x), axes->up, y), sum / 255 * texel * texel,
              (uint64_t)tree->number << 8 ^ (uint64_t)j);
    }
}

static void cast_tree(const struct casting *c, const struct sv_tree *tree)
{
    const struct sv_shade_view *view = &c->sun->views[c->shade->owner[tree->species]];
    const struct sv_shade_outline *o = &view->turn[sv_shade_turn(tree->rotation_rad)];
    double h = (double)tree->height_m;
    if (o->levels == 0)
        return;
    if (h * (double)o->level[0].width * (double)o->texel < STAMP_TEXELS * c->window->texel_m) {
        stamp_tree(c, o, tree);
        return;
    }
    /* Along the light a window's texel takes sin(elevation) of the silhouette's only: shadows of a low sun
     * are as much softer there as its penumbra is longer. */
    const struct sv_silhouette *l = &o->level[level_for(o, h, c->window->texel_m)];
    sv_shadow_window_cast(c->window, l, sv_vec3(tree->x, tree->y, tree->z), h);
}

static void cast_leaf(const struct casting *c, const struct sv_forest_node *node)
{
    for (uint32_t k = node->first; k < node->first + node->count; k++) {
        const struct sv_tree *tree = &c->shade->forest->trees[k];
        struct box box = tree_box(c, tree);
        if (reaches(c, &box))
            cast_tree(c, tree);
    }
}

/* ---- light at a place ---- */

/* Whether the ray from `at` (relative to the forest's origin) towards the sun meets the node's box. */
static bool ray_meets(const struct sv_forest_node *node, const double at[3], const double to_sun[3])
{
    double from = 0, to = INFINITY;
    for (int a = 0; a < 3; a++) {
        double lo = (double)node->box_min[a] - at[a], hi = (double)node->box_max[a] - at[a];
        if (fabs(to_sun[a]) < 1e-12) {
            if (lo > 0 || hi < 0)
                return false;
            continue;
        }
        double p = lo / to_sun[a], q = hi / to_sun[a];
        from = fmax(from, fmin(p, q));
        to = fmin(to, fmax(p, q));
    }
    return from <= to;
}

/* What one tree lets through to the place; the texel of its outline that is about SHARE_TEXEL_M decides. */
static double tree_lets_through(const struct sv_tree_shade *shade, const struct sv_tree *tree,
                                struct sv_vec3 place)
{
    const struct sv_shade_sun *sun = shade->current;
    const struct sv_shade_outline *o =
        &sun->views[shade->owner[tree->species]].turn[sv_shade_turn(tree->rotation_rad)];
    double h = (double)tree->height_m;
    struct sv_vec3 d = sv_sub(place, sv_vec3(tree->x, tree->y, tree->z));
    if (o->levels == 0 || sv_dot(sv_sub(sv_vec3(0, 0, h / 2), d), sun->axes.to_sun) <= 0)
        return 1;
    int n = level_for(o, h, SHARE_TEXEL_M);
    double texel = ldexp((double)o->texel, n);
    double i = floor((sv_dot(d, sun->axes.right) / h - (double)o->left) / texel),
           j = floor(((double)o->top - sv_dot(d, sun->axes.up) / h) / texel);
    const struct sv_silhouette *s = &o->level[n];
    if (!(i >= 0 && j >= 0 && i < s->width && j < s->height))
        return 1;
    return 1 - s->coverage[(size_t)j * (size_t)s->width + (size_t)i] / 255.0;
}

double sv_tree_shade_share(const struct sv_tree_shade *shade, struct sv_vec3 place)
{
    const struct sv_forest *forest = shade->forest;
    if (shade->dark)
        return 0;
    if (!shade->current || forest->node_count == 0)
        return 1;
    struct sv_vec3 l = shade->current->axes.to_sun, p = sv_sub(place, forest->origin);
    const double at[3] = {p.x, p.y, p.z}, to_sun[3] = {l.x, l.y, l.z};
    uint32_t stack[STACK];
    int top = 0;
    double share = 1;
    stack[top++] = 1;
    while (top > 0 && share > 0) {
        uint32_t k = stack[--top];
        const struct sv_forest_node *node = &forest->nodes[k];
        if (node->count == 0 || !ray_meets(node, at, to_sun))
            continue;
        if (k >= forest->leaf_first) {
            for (uint32_t t = node->first; t < node->first + node->count; t++)
                share *= tree_lets_through(shade, &forest->trees[t], place);
            continue;
        }
        stack[top++] = 2 * k + 1;
        stack[top++] = 2 * k;
    }
    return share;
}

void sv_tree_shade_cast(void *context, struct sv_shadow_window *window)
{
    const struct sv_tree_shade *shade = context;
    const struct sv_forest *forest = shade->forest;
    if (!shade->current || forest->node_count == 0)
        return;
    struct sv_vec3 to_sun = shade->current->axes.to_sun;
    double rise = fmax(to_sun.z, LEVEL_SUN_Z);
    struct casting c = {.shade = shade,
                        .sun = shade->current,
                        .window = window,
                        .side_m = window->side * window->texel_m,
                        .slope_x = -to_sun.x / rise,
                        .slope_y = -to_sun.y / rise};
    uint32_t stack[STACK];
    int top = 0;
    stack[top++] = 1;
    while (top > 0) {
        uint32_t k = stack[--top];
        const struct sv_forest_node *node = &forest->nodes[k];
        struct box box = node_box(&c, node);
        if (node->count == 0 || !reaches(&c, &box))
            continue;
        if (k >= forest->leaf_first) {
            cast_leaf(&c, node);
            continue;
        }
        stack[top++] = 2 * k + 1;
        stack[top++] = 2 * k;
    }
}
