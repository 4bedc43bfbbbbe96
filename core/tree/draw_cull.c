/* draw_cull.c - see draw_cull.h. Boxes against planes by their nearest corner; order by a stable radix sort.
 */
#include "core/tree/draw_cull.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "core/base/shell.h"

enum { RADIX_BITS = 11, RADIX = 1 << RADIX_BITS, PASSES = 3, STACK = 64 };
enum relation { OUTSIDE, CROSSING, INSIDE };

/* A box by middle and half extents, relative to the eye. */
struct box {
    double middle[3], half[3];
};

static enum relation relate(const struct box *box, const double planes[5][4])
{
    enum relation result = INSIDE;
    for (int k = 0; k < 5; k++) {
        const double *p = planes[k];
        double at = p[0] * box->middle[0] + p[1] * box->middle[1] + p[2] * box->middle[2] + p[3];
        double reach = fabs(p[0]) * box->half[0] + fabs(p[1]) * box->half[1] + fabs(p[2]) * box->half[2];
        if (at + reach < 0)
            return OUTSIDE;
        if (at - reach < 0)
            result = CROSSING;
    }
    return result;
}

static struct box node_box(const struct sv_forest_node *node, const double origin[3])
{
    struct box box;
    for (int a = 0; a < 3; a++) {
        box.middle[a] = origin[a] + 0.5 * ((double)node->box_min[a] + (double)node->box_max[a]);
        box.half[a] = 0.5 * ((double)node->box_max[a] - (double)node->box_min[a]);
    }
    return box;
}

static struct box tree_box(const struct sv_tree *tree, float radius, struct sv_vec3 eye)
{
    double h = (double)tree->height_m, r = h * (double)radius;
    return (struct box){{tree->x - eye.x, tree->y - eye.y, tree->z - eye.z + 0.5 * h}, {r, r, 0.5 * h}};
}

double sv_cull_distance_m(const struct sv_camera *camera, const struct sv_tree *tree)
{
    struct sv_vec3 middle = sv_vec3(tree->x - camera->eye.x, tree->y - camera->eye.y,
                                    tree->z - camera->eye.z + 0.5 * (double)tree->height_m);
    return camera->projection == SV_PROJECTION_ORTHOGRAPHIC ? sv_dot(middle, camera->forward)
                                                            : sv_length(middle);
}

double sv_cull_height_px(const struct sv_camera *camera, const struct sv_tree *tree)
{
    double size = sv_camera_focal_px(camera) * (double)tree->height_m;
    if (camera->projection == SV_PROJECTION_ORTHOGRAPHIC)
        return size;
    double distance = sv_cull_distance_m(camera, tree);
    return size / fmax(distance, 1e-3);
}

uint32_t sv_cull_order_code(float v)
{
    uint32_t bits;
    memcpy(&bits, &v, sizeof bits);
    return bits & 0x80000000u ? ~bits : bits | 0x80000000u;
}

/* Chebyshev distance of a tree's axis from a centre. */
static double axis_distance_m(const struct sv_tree *tree, struct sv_vec3 center)
{
    double below = tree->z - center.z, above = center.z - (tree->z + (double)tree->height_m);
    return fmax(fmax(fabs(tree->x - center.x), fabs(tree->y - center.y)), fmax(fmax(below, above), 0));
}

/* radius: of the crown, in heights. */
static bool in_shell(const struct sv_tree *tree, float radius, const struct sv_tree_shell *shell)
{
    double reach = (double)tree->height_m * (double)radius;
    return axis_distance_m(tree, shell->inner) > shell->inner_m + sv_shell_growth_m(shell->inner_m, reach) &&
           axis_distance_m(tree, shell->outer) <= shell->outer_m + sv_shell_growth_m(shell->outer_m, reach);
}

/* Least and largest Chebyshev distance of a box (relative to the eye) from a centre. */
static void box_distances_m(const struct box *box, struct sv_vec3 center, struct sv_vec3 eye,
                            double distance_m[2])
{
    const double to[3] = {center.x - eye.x, center.y - eye.y, center.z - eye.z};
    distance_m[0] = distance_m[1] = 0;
    for (int a = 0; a < 3; a++) {
        double off = fabs(box->middle[a] - to[a]);
        distance_m[0] = fmax(distance_m[0], off - box->half[a]);
        distance_m[1] = fmax(distance_m[1], off + box->half[a]);
    }
}

/* Whether trees whose boxes the box holds may be in the shell. An axis is beyond the outer cube by at most
 * what its crown reaches, and the box holds that. */
static bool may_meet(const struct box *box, const struct sv_tree_shell *shell, struct sv_vec3 eye)
{
    double inner[2], outer[2];
    box_distances_m(box, shell->inner, eye, inner);
    box_distances_m(box, shell->outer, eye, outer);
    return inner[1] > shell->inner_m && outer[0] <= shell->outer_m;
}

/* What a walk asks for. */
struct cull {
    const struct sv_forest *forest;
    const struct sv_cull_species *species;
    const struct sv_camera *camera;
    const double (*planes)[4];
    const struct sv_tree_shell *shell; /* NULL: all */
};

static void add_trees(const struct cull *c, const struct sv_forest_node *node, bool all,
                      struct sv_cull_list *list)
{
    for (uint32_t k = node->first; k < node->first + node->count; k++) {
        const struct sv_tree *tree = &c->forest->trees[k];
        float radius = c->species[tree->species].radius;
        struct box box = tree_box(tree, radius, c->camera->eye);
        if ((!all && relate(&box, c->planes) == OUTSIDE) || (c->shell && !in_shell(tree, radius, c->shell)))
            continue;
        uint32_t key = sv_cull_order_code((float)sv_cull_distance_m(c->camera, tree));
        list->entries[list->count++] = (struct sv_cull_entry){key, k};
    }
}

static void walk(const struct cull *c, struct sv_cull_list *list)
{
    const struct sv_forest *forest = c->forest;
    struct sv_vec3 eye = c->camera->eye;
    const double origin[3] = {forest->origin.x - eye.x, forest->origin.y - eye.y, forest->origin.z - eye.z};
    uint32_t stack[STACK];
    int top = 0;
    stack[top++] = 1;
    while (top > 0) {
        uint32_t k = stack[--top];
        const struct sv_forest_node *node = &forest->nodes[k];
        if (node->count == 0)
            continue;
        struct box box = node_box(node, origin);
        enum relation relation = relate(&box, c->planes);
        if (relation == OUTSIDE || (c->shell && !may_meet(&box, c->shell, eye)))
            continue;
        if ((relation == INSIDE && !c->shell) || k >= forest->leaf_first) {
            add_trees(c, node, relation == INSIDE, list);
            continue;
        }
        stack[top++] = 2 * k + 1; /* the first child is walked first: order of the forest */
        stack[top++] = 2 * k;
    }
}

struct sv_cull_entry *sv_cull_sort(struct sv_cull_entry *entries, struct sv_cull_entry *swap, uint32_t count)
{
    struct sv_cull_entry *from = entries, *to = swap;
    for (int pass = 0; pass < PASSES; pass++) {
        int shift = pass * RADIX_BITS;
        uint32_t start[RADIX] = {0}, sum = 0;
        for (uint32_t k = 0; k < count; k++)
            start[from[k].key >> shift & (RADIX - 1)]++;
        for (int d = 0; d < RADIX; d++) {
            uint32_t n = start[d];
            start[d] = sum;
            sum += n;
        }
        for (uint32_t k = 0; k < count; k++)
            to[start[from[k].key >> shift & (RADIX - 1)]++] = from[k];
        struct sv_cull_entry *other = from;
        from = to;
        to = other;
    }
    return from;
}

static void sort_near_first(struct sv_cull_list *list)
{
    struct sv_cull_entry *sorted = sv_cull_sort(list->entries, list->swap, list->count);
    list->swap = sorted == list->entries ? list->swap : list->entries;
    list->entries = sorted;
}

enum sv_status sv_cull_forest(const struct sv_forest *forest, const struct sv_cull_species *species,
                              const struct sv_camera *camera, const double planes[5][4],
                              const struct sv_tree_shell *shell, struct sv_cull_list *list,
                              struct sv_error *error)
{
    const struct cull cull = {forest, species, camera, planes, shell};
    if (list->room < forest->count) {
        struct sv_cull_entry *made = malloc(2 * (size_t)forest->count * sizeof *made);
        if (!made)
            return sv_fail(error, SV_ENOMEM, "forest", "no memory to sort %u trees", forest->count);
        sv_cull_list_finish(list);
        *list = (struct sv_cull_list){.entries = made, .swap = made + forest->count, .room = forest->count};
    }
    list->count = 0;
    if (forest->node_count > 0)
        walk(&cull, list);
    list->culled = forest->count - list->count;
    sort_near_first(list);
    return SV_OK;
}

void sv_cull_list_finish(struct sv_cull_list *list)
{
    /* Both halves are one block; sorting swaps them. */
    free(list->entries < list->swap ? list->entries : list->swap);
    *list = (struct sv_cull_list){0};
}
