/* forest.c - Morton order of the trees and the implicit binary tree of boxes over it.
 *
 * Keys interleave 32 bits of x and of y on a lattice of the world (KEYS_A_M steps a metre), so that the order
 * of two trees is the same whatever else stands there; a stable radix sort orders them, ties keep the order
 * of the scene file. So a forest that changes is merged, not sorted again. The leaves share the trees out
 * evenly: leaf k of L holds trees [count k / L, count (k + 1) / L), so none is empty while count >= L. Boxes
 * are formed in double and narrowed outward, so that they bound every crown exactly. The origin is snapped to
 * a lattice, too: it seldom moves when trees come and go. Morton 1966; the layout is that of a binary heap.
 * Not done here: drawing, culling. */
#include "core/scene/forest.h"

#include <float.h>
#include <math.h>
#include <stdbool.h>
#include <stdlib.h>
#include <string.h>

enum { RADIX_BITS = 11, RADIX = 1 << RADIX_BITS, KEY_BITS = 64 };

/* Steps of the lattice a metre; 2^32 of them reach 33,000 km to either side of 0. What lies beyond has the
 * key of the rim: it is culled badly, and drawn. */
static const double KEYS_A_M = 64;
/* Spacings of the places that the origin may have, m. */
static const double ORIGIN_XY_M = 4096, ORIGIN_Z_M = 1024;

struct keyed {
    uint64_t key;
    uint32_t index;
};

/* Moves bit k of v to bit 2k (32 bits). */
static uint64_t spread(uint64_t v)
{
    v = (v | v << 16) & UINT64_C(0x0000FFFF0000FFFF);
    v = (v | v << 8) & UINT64_C(0x00FF00FF00FF00FF);
    v = (v | v << 4) & UINT64_C(0x0F0F0F0F0F0F0F0F);
    v = (v | v << 2) & UINT64_C(0x3333333333333333);
    return (v | v << 1) & UINT64_C(0x5555555555555555);
}

static uint64_t quantise(double v)
{
    return (uint64_t)sv_clamp(floor(v * KEYS_A_M) + 0x1p31, 0, 0x1p32 - 1);
}

static uint64_t key_of(const struct sv_tree *tree)
{
    return spread(quantise(tree->x)) | spread(quantise(tree->y)) << 1;
}

struct extent {
    double min[3], max[3];
};

static void extent_init(struct extent *e)
{
    for (int a = 0; a < 3; a++) {
        e->min[a] = DBL_MAX;
        e->max[a] = -DBL_MAX;
    }
}

static enum sv_status measure(const struct sv_tree *trees, uint32_t count, struct extent *e,
                              struct sv_error *error)
{
    for (uint32_t k = 0; k < count; k++) {
        const double p[3] = {trees[k].x, trees[k].y, trees[k].z};
        for (int a = 0; a < 3; a++) {
            if (!isfinite(p[a]) || !isfinite(trees[k].height_m))
                return sv_fail(error, SV_EINVAL, "trees", "tree %u has a place or height that is not finite",
                               k);
            e->min[a] = p[a] < e->min[a] ? p[a] : e->min[a];
            e->max[a] = p[a] > e->max[a] ? p[a] : e->max[a];
        }
    }
    return SV_OK;
}

/* The sorted keys lie in a or in b. Digits that all keys share are passed over. */
static struct keyed *radix_sort(struct keyed *a, struct keyed *b, uint32_t count)
{
    for (int shift = 0; shift < KEY_BITS; shift += RADIX_BITS) {
        uint32_t start[RADIX] = {0}, sum = 0;
        for (uint32_t k = 0; k < count; k++)
            start[a[k].key >> shift & (RADIX - 1)]++;
        if (start[a[0].key >> shift & (RADIX - 1)] == count)
            continue;
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
    return a;
}

static enum sv_status sort_trees(struct sv_tree *trees, uint32_t count, struct sv_error *error)
{
    if (count == 0)
        return SV_OK;
    struct keyed *keys = malloc(2 * (size_t)count * sizeof *keys);
    struct sv_tree *copy = malloc((size_t)count * sizeof *copy);
    enum sv_status status = SV_OK;
    if (!keys || !copy) {
        status = sv_fail(error, SV_ENOMEM, "trees", "no memory to sort %u trees", count);
        goto done;
    }
    for (uint32_t k = 0; k < count; k++)
        keys[k] = (struct keyed){key_of(&trees[k]), k};
    const struct keyed *sorted = radix_sort(keys, keys + count, count);
    memcpy(copy, trees, (size_t)count * sizeof *copy);
    for (uint32_t k = 0; k < count; k++)
        trees[k] = copy[sorted[k].index];
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

static void fill_leaf(struct sv_forest_node *n, const struct sv_forest *f,
                      const struct sv_crown_bound *bounds)
{
    double min[3] = {DBL_MAX, DBL_MAX, DBL_MAX}, max[3] = {-DBL_MAX, -DBL_MAX, -DBL_MAX};
    empty_box(n);
    for (uint32_t k = n->first; k < n->first + n->count; k++) {
        const struct sv_tree *t = &f->trees[k];
        const struct sv_crown_bound *b = &bounds[t->species];
        double h = t->height_m, r = h * b->radius;
        double x = t->x - f->origin.x, y = t->y - f->origin.y, z = t->z - f->origin.z;
        const double lo[3] = {x - r, y - r, z + h * b->bottom}, hi[3] = {x + r, y + r, z + h * b->top};
        for (int a = 0; a < 3; a++) {
            min[a] = lo[a] < min[a] ? lo[a] : min[a];
            max[a] = hi[a] > max[a] ? hi[a] : max[a];
        }
    }
    for (int a = 0; a < 3 && n->count > 0; a++) {
        n->box_min[a] = narrow_down(min[a]);
        n->box_max[a] = narrow_up(max[a]);
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

/* Origin, leaves and nodes over trees that are in order. */
static enum sv_status build_nodes(struct sv_forest *f, const struct extent *e,
                                  const struct sv_crown_bound *bounds, struct sv_arena *arena,
                                  struct sv_error *error)
{
    uint32_t leaves = 1;
    while ((uint64_t)leaves * SV_FOREST_LEAF < f->count)
        leaves *= 2;
    struct sv_forest_node *nodes = sv_arena_alloc_pages(arena, 2 * (size_t)leaves, sizeof *nodes);
    if (!nodes)
        return sv_fail(error, SV_ENOMEM, "trees", "no room for the hierarchy of %u trees", f->count);
    f->origin = sv_vec3(ORIGIN_XY_M * round(0.5 * (e->min[0] + e->max[0]) / ORIGIN_XY_M),
                        ORIGIN_XY_M * round(0.5 * (e->min[1] + e->max[1]) / ORIGIN_XY_M),
                        ORIGIN_Z_M * floor(e->min[2] / ORIGIN_Z_M));
    f->nodes = nodes;
    f->node_count = 2 * leaves;
    f->leaf_first = leaves;
    empty_box(&nodes[0]);
    for (uint32_t k = 0; k < leaves; k++) {
        uint32_t first = (uint32_t)((uint64_t)f->count * k / leaves);
        uint32_t end = (uint32_t)((uint64_t)f->count * (k + 1) / leaves);
        nodes[leaves + k].first = first;
        nodes[leaves + k].count = end - first;
        fill_leaf(&nodes[leaves + k], f, bounds);
    }
    for (uint32_t k = leaves - 1; k > 0; k--)
        join(&nodes[k], &nodes[2 * k], &nodes[2 * k + 1]);
    return SV_OK;
}

static enum sv_status check_count(uint64_t count, struct sv_error *error)
{
    return count <= SV_FOREST_TREES_MAX ? SV_OK
                                        : sv_fail(error, SV_ELIMIT, "trees", "%llu trees are more than %d",
                                                  (unsigned long long)count, SV_FOREST_TREES_MAX);
}

enum sv_status sv_forest_build(struct sv_tree *trees, uint32_t count, const struct sv_crown_bound *bounds,
                               struct sv_arena *arena, struct sv_forest *forest, struct sv_error *error)
{
    struct sv_forest f = {.trees = trees, .count = count};
    struct extent e;
    extent_init(&e);
    enum sv_status status = check_count(count, error);
    if (status == SV_OK)
        status = measure(trees, count, &e, error);
    if (status == SV_OK)
        status = sort_trees(trees, count, error);
    if (status == SV_OK && count > 0)
        status = build_nodes(&f, &e, bounds, arena, error);
    if (status == SV_OK)
        *forest = f;
    return status;
}

/* The first of the trees, from `first` on, whose key is above it. */
static uint32_t first_above(const struct sv_forest *f, uint32_t first, uint64_t key)
{
    uint32_t end = f->count;
    while (first < end) {
        uint32_t middle = first + (end - first) / 2;
        if (key_of(&f->trees[middle]) > key)
            end = middle;
        else
            first = middle + 1;
    }
    return first;
}

/* Trees first .. end - 1 of the old ones, without those that go; returns how many those are. */
static uint32_t copy_stretch(const struct sv_forest_turnover *t, uint32_t first, uint32_t end,
                             struct sv_tree *out, uint32_t *from)
{
    uint32_t count = 0;
    while (first < end) {
        const uint8_t *gone = memchr(t->gone + first, 1, end - first);
        uint32_t stop = gone ? (uint32_t)(gone - t->gone) : end, n = stop - first;
        memcpy(out + count, t->old->trees + first, n * sizeof *out);
        for (uint32_t k = 0; k < n; k++)
            from[count + k] = first + k;
        count += n;
        first = stop + 1;
    }
    return count;
}

/* Trees of both in one order; come's are younger. Stretches of the old ones stay together. */
static void merge(const struct sv_forest_turnover *t, struct sv_tree *out, uint32_t *from)
{
    uint32_t first = 0, count = 0;
    for (uint32_t j = 0; j <= t->come_count; j++) {
        uint32_t end = j < t->come_count ? first_above(t->old, first, key_of(&t->come[j])) : t->old->count;
        count += copy_stretch(t, first, end, out + count, from + count);
        first = end;
        if (j < t->come_count) {
            out[count] = t->come[j];
            from[count++] = SV_FOREST_CAME;
        }
    }
}

enum sv_status sv_forest_turn_over(const struct sv_forest_turnover *t, const struct sv_crown_bound *bounds,
                                   struct sv_arena *arena, struct sv_forest *forest, uint32_t *from,
                                   struct sv_error *error)
{
    uint32_t stay = 0;
    struct extent e;
    extent_init(&e);
    for (uint32_t k = 0; k < t->old->count; k++)
        stay += t->gone[k] == 0;
    struct sv_forest f = {.count = stay + t->come_count};
    enum sv_status status = check_count((uint64_t)stay + t->come_count, error);
    if (status == SV_OK)
        status = measure(t->come, t->come_count, &e, error);
    if (status == SV_OK)
        status = sort_trees(t->come, t->come_count, error);
    struct sv_tree *trees =
        status == SV_OK && f.count > 0 ? sv_arena_alloc_pages(arena, f.count, sizeof *trees) : NULL;
    if (status == SV_OK && f.count > 0 && !trees)
        status = sv_fail(error, SV_ENOMEM, "trees", "no room for %u trees", f.count);
    if (status == SV_OK && f.count > 0) {
        merge(t, trees, from);
        f.trees = trees;
        extent_init(&e);
        status = measure(trees, f.count, &e, error);
    }
    if (status == SV_OK && f.count > 0)
        status = build_nodes(&f, &e, bounds, arena, error);
    if (status == SV_OK)
        *forest = f;
    return status;
}

size_t sv_forest_bytes(uint32_t count)
{
    enum { ALIGN = 64 };
    size_t leaves = 1;
    while (leaves * SV_FOREST_LEAF < count)
        leaves *= 2;
    return (size_t)count * sizeof(struct sv_tree) + 2 * leaves * sizeof(struct sv_forest_node) +
           2 * (size_t)ALIGN;
}
