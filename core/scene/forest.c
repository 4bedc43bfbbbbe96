/* forest.c - Morton order of the trees and the implicit binary tree of boxes over it.
 *
 * Keys interleave 21 bits of x and of y over a square that holds all stems (the same scale on both axes, so
 * that cells are square); a stable radix sort orders them, ties keep the order of the scene file. The leaves
 * share the trees out evenly: leaf k of L holds trees [count k / L, count (k + 1) / L), so none is empty
 * while count >= L. Boxes are formed in double and narrowed outward, so that they bound every crown exactly.
 * Morton 1966; the layout is that of a binary heap. Not done here: drawing, culling. */
#include "core/scene/forest.h"

#include <float.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

enum { KEY_BITS = 21, RADIX_BITS = 11, RADIX = 1 << RADIX_BITS, PASSES = 4 };

struct keyed {
    uint64_t key;
    uint32_t index;
};

/* Moves bit k of v to bit 2k (21 bits). */
static uint64_t spread(uint64_t v)
{
    v = (v | v << 16) & UINT64_C(0x0000FFFF0000FFFF);
    v = (v | v << 8) & UINT64_C(0x00FF00FF00FF00FF);
    v = (v | v << 4) & UINT64_C(0x0F0F0F0F0F0F0F0F);
    v = (v | v << 2) & UINT64_C(0x3333333333333333);
    return (v | v << 1) & UINT64_C(0x5555555555555555);
}

static uint64_t quantise(double t)
{
    double last = (double)((1 << KEY_BITS) - 1);
    return (uint64_t)sv_clamp(t * last, 0, last);
}

struct extent {
    double min[3], max[3];
};

static enum sv_status measure(const struct sv_tree *trees, uint32_t count, struct extent *e,
                              struct sv_error *error)
{
    for (int a = 0; a < 3; a++) {
        e->min[a] = DBL_MAX;
        e->max[a] = -DBL_MAX;
    }
    for (uint32_t k = 0; k < count; k++) {
        const double p[3] = {trees[k].x, trees[k].y, trees[k].z};
        for (int a = 0; a < 3; a++) {
            if (!isfinite(p[a]) || !isfinite(trees[k].height_m))
                return sv_fail(error, SV_EINVAL, "trees", "tree %u has a place or height that is not finite",
                               k);
            e->min[a] = fmin(e->min[a], p[a]);
            e->max[a] = fmax(e->max[a], p[a]);
        }
    }
    return SV_OK;
}

static void radix_sort(struct keyed *a, struct keyed *b, uint32_t count)
{
    for (int pass = 0; pass < PASSES; pass++) {
        int shift = pass * RADIX_BITS;
        uint32_t start[RADIX] = {0}, sum = 0;
        for (uint32_t k = 0; k < count; k++)
            start[a[k].key >> shift & (RADIX - 1)]++;
        for (int d = 0; d < RADIX; d++) {
            uint32_t n = start[d];
            start[d] = sum;
            sum += n;
        }
        for (uint32_t k = 0; k < count; k++)
            b[start[a[k].key >> shift & (RADIX - 1)]++] = a[k];
        struct keyed *swap = a;
        a = b;
        b = swap;
    }
}

static enum sv_status sort_trees(struct sv_tree *trees, uint32_t count, const struct extent *e,
                                 struct sv_error *error)
{
    struct keyed *keys = malloc(2 * (size_t)count * sizeof *keys);
    struct sv_tree *copy = malloc((size_t)count * sizeof *copy);
    enum sv_status status = SV_OK;
    if (!keys || !copy) {
        status = sv_fail(error, SV_ENOMEM, "trees", "no memory to sort %u trees", count);
        goto done;
    }
    double side = fmax(e->max[0] - e->min[0], e->max[1] - e->min[1]);
    double scale = side > 0 ? 1.0 / side : 0;
    for (uint32_t k = 0; k < count; k++) {
        uint64_t x = quantise((trees[k].x - e->min[0]) * scale),
                 y = quantise((trees[k].y - e->min[1]) * scale);
        keys[k] = (struct keyed){spread(x) | spread(y) << 1, k};
    }
    radix_sort(keys, keys + count, count); /* an even number of passes ends where it began */
    memcpy(copy, trees, (size_t)count * sizeof *copy);
    for (uint32_t k = 0; k < count; k++)
        trees[k] = copy[keys[k].index];
done:
    free(copy);
    free(keys);
    return status;
}

static float narrow_down(double v)
{
    float f = (float)v;
    return (double)f > v ? nextafterf(f, -INFINITY) : f;
}

static float narrow_up(double v)
{
    float f = (float)v;
    return (double)f < v ? nextafterf(f, INFINITY) : f;
}

static void empty_box(struct sv_forest_node *n)
{
    for (int a = 0; a < 3; a++) {
        n->box_min[a] = FLT_MAX;
        n->box_max[a] = -FLT_MAX;
    }
}

static void grow_box(struct sv_forest_node *n, const double min[3], const double max[3])
{
    for (int a = 0; a < 3; a++) {
        n->box_min[a] = fminf(n->box_min[a], narrow_down(min[a]));
        n->box_max[a] = fmaxf(n->box_max[a], narrow_up(max[a]));
    }
}

static void fill_leaf(struct sv_forest_node *n, const struct sv_forest *f,
                      const struct sv_crown_bound *bounds)
{
    empty_box(n);
    for (uint32_t k = n->first; k < n->first + n->count; k++) {
        const struct sv_tree *t = &f->trees[k];
        const struct sv_crown_bound *b = &bounds[t->species];
        double h = t->height_m, r = h * b->radius;
        double x = t->x - f->origin.x, y = t->y - f->origin.y, z = t->z - f->origin.z;
        grow_box(n, (const double[3]){x - r, y - r, z + h * b->bottom},
                 (const double[3]){x + r, y + r, z + h * b->top});
    }
}

static void join(struct sv_forest_node *n, const struct sv_forest_node *a, const struct sv_forest_node *b)
{
    n->first = a->first;
    n->count = a->count + b->count;
    for (int i = 0; i < 3; i++) {
        n->box_min[i] = fminf(a->box_min[i], b->box_min[i]);
        n->box_max[i] = fmaxf(a->box_max[i], b->box_max[i]);
    }
}

enum sv_status sv_forest_build(struct sv_tree *trees, uint32_t count, const struct sv_crown_bound *bounds,
                               struct sv_arena *arena, struct sv_forest *forest, struct sv_error *error)
{
    struct sv_forest f = {.trees = trees, .count = count};
    if (count == 0) {
        *forest = f;
        return SV_OK;
    }
    if (count > SV_FOREST_TREES_MAX)
        return sv_fail(error, SV_ELIMIT, "trees", "%u trees are more than %d", count, SV_FOREST_TREES_MAX);
    struct extent e;
    enum sv_status status = measure(trees, count, &e, error);
    if (status == SV_OK)
        status = sort_trees(trees, count, &e, error);
    if (status != SV_OK)
        return status;
    f.origin = sv_vec3(0.5 * (e.min[0] + e.max[0]), 0.5 * (e.min[1] + e.max[1]), e.min[2]);

    uint32_t leaves = 1;
    while ((uint64_t)leaves * SV_FOREST_LEAF < count)
        leaves *= 2;
    struct sv_forest_node *nodes = sv_arena_alloc(arena, 2 * (size_t)leaves, sizeof *nodes);
    if (!nodes)
        return sv_fail(error, SV_ENOMEM, "trees", "no room for the hierarchy of %u trees", count);
    f.nodes = nodes;
    f.node_count = 2 * leaves;
    f.leaf_first = leaves;
    empty_box(&nodes[0]);
    for (uint32_t k = 0; k < leaves; k++) {
        uint32_t first = (uint32_t)((uint64_t)count * k / leaves);
        uint32_t end = (uint32_t)((uint64_t)count * (k + 1) / leaves);
        nodes[leaves + k].first = first;
        nodes[leaves + k].count = end - first;
        fill_leaf(&nodes[leaves + k], &f, bounds);
    }
    for (uint32_t k = leaves - 1; k > 0; k--)
        join(&nodes[k], &nodes[2 * k], &nodes[2 * k + 1]);
    *forest = f;
    return SV_OK;
}
