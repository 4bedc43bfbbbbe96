/* cloud_order.c - see cloud_order.h. */
#include "core/tree/cloud_order.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

enum { NONE = -1, DEPTH_MAX = 256 };

struct sv_cloud_order_node {
    int plane;        /* that divides; NONE: a list that is sorted by middles */
    int near, far;    /* nodes on the side of the plane's normal, and behind; NONE */
    int first, count; /* parts that lie on it, parts[first ..] */
};

/* What is still to be divided. */
struct heap {
    struct sv_cloud_part *parts;
    int count, room;
};

struct builder {
    const struct sv_tree_cloud *cloud;
    struct sv_cloud_order *out;
    int part_room, node_room;
    float reach;
    bool failed;
};

static float dot3(const float a[3], const float b[3])
{
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

static void *grown(void *old, int *room, int count, size_t size)
{
    if (count < *room)
        return old;
    *room = *room ? 2 * *room : 64;
    return realloc(old, (size_t)*room * size);
}

static bool push(struct heap *heap, const struct sv_cloud_part *part)
{
    struct sv_cloud_part *parts = grown(heap->parts, &heap->room, heap->count, sizeof *parts);
    if (!parts)
        return false;
    heap->parts = parts;
    heap->parts[heap->count++] = *part;
    return true;
}

/* Signed distance of a part's corner from a plane. */
static float beside(const struct sv_tree_cloud *cloud, const struct sv_cloud_part *part, int corner,
                    int plane)
{
    const struct sv_cloud_plane *p = &cloud->planes[part->plane], *by = &cloud->planes[plane];
    float d[3];
    for (int c = 0; c < 3; c++)
        d[c] = p->centre[c] + part->at[corner][0] * p->u[c] + part->at[corner][1] * p->v[c] - by->centre[c];
    return dot3(by->normal, d);
}

/* 1 wholly before the plane, -1 behind, 0 to be cut. */
static int side_of(const struct builder *b, const struct sv_cloud_part *part, int plane)
{
    float low = 0, high = 0;
    for (int k = 0; k < part->count; k++) {
        float d = beside(b->cloud, part, k, plane);
        low = d < low ? d : low;
        high = d > high ? d : high;
    }
    return low >= -b->reach ? 1 : high <= b->reach ? -1 : 0;
}

/* The part of `part` on one side (1 or -1) of the plane. */
static void cut(const struct sv_tree_cloud *cloud, const struct sv_cloud_part *part, int plane, float side,
                struct sv_cloud_part *out)
{
    *out = (struct sv_cloud_part){.plane = part->plane};
    for (int k = 0; k < part->count; k++) {
        int next = (k + 1) % part->count;
        float a = side * beside(cloud, part, k, plane), b = side * beside(cloud, part, next, plane);
        if (a >= 0 && out->count < SV_CLOUD_PART_CORNERS)
            memcpy(out->at[out->count++], part->at[k], sizeof out->at[0]);
        if ((a >= 0) != (b >= 0) && out->count < SV_CLOUD_PART_CORNERS) {
            float t = a / (a - b);
            for (int c = 0; c < 2; c++)
                out->at[out->count][c] = part->at[k][c] + t * (part->at[next][c] - part->at[k][c]);
            out->count++;
        }
    }
}

/* The plane among the parts' own that cuts fewest, then divides best. */
static int best_divider(const struct builder *b, const struct heap *heap)
{
    int best = NONE, least = 1 << 30;
    bool tried[SV_CLOUD_PLANES_MAX] = {false};
    for (int i = 0; i < heap->count; i++) {
        int plane = heap->parts[i].plane, cuts = 0, before = 0, behind = 0;
        if (tried[plane])
            continue;
        tried[plane] = true;
        for (int k = 0; k < heap->count; k++) {
            if (heap->parts[k].plane == plane)
                continue;
            int side = side_of(b, &heap->parts[k], plane);
            cuts += side == 0;
            before += side > 0;
            behind += side < 0;
        }
        int cost = 4 * cuts + abs(before - behind);
        if (cost < least) {
            least = cost;
            best = plane;
        }
    }
    return best;
}

static int add_node(struct builder *b, int plane, const struct heap *own)
{
    struct sv_cloud_order *out = b->out;
    struct sv_cloud_order_node *nodes = grown(out->nodes, &b->node_room, out->node_count, sizeof *nodes);
    if (!nodes) {
        b->failed = true;
        return NONE;
    }
    out->nodes = nodes;
    out->nodes[out->node_count] =
        (struct sv_cloud_order_node){plane, NONE, NONE, out->part_count, own->count};
    for (int k = 0; k < own->count; k++) {
        struct sv_cloud_part *parts = grown(out->parts, &b->part_room, out->part_count, sizeof *parts);
        if (!parts) {
            b->failed = true;
            return NONE;
        }
        out->parts = parts;
        out->parts[out->part_count++] = own->parts[k];
    }
    return out->node_count++;
}

/* Sorts the heap's parts to the plane's two sides and onto it. */
static void divide(struct builder *b, const struct heap *heap, int plane, struct heap *own,
                   struct heap *before, struct heap *behind)
{
    for (int k = 0; k < heap->count && !b->failed; k++) {
        const struct sv_cloud_part *part = &heap->parts[k];
        struct sv_cloud_part halves[2];
        int side = part->plane == plane ? 2 : side_of(b, part, plane);
        bool kept = true;
        if (side == 0) {
            cut(b->cloud, part, plane, 1, &halves[0]);
            cut(b->cloud, part, plane, -1, &halves[1]);
            kept = (halves[0].count < 3 || push(before, &halves[0])) &&
                   (halves[1].count < 3 || push(behind, &halves[1]));
        } else {
            kept = push(side == 2 ? own : side > 0 ? before : behind, part);
        }
        b->failed = b->failed || !kept;
    }
}

static int build(struct builder *b, struct heap *heap, int depth)
{
    struct heap own = {0}, before = {0}, behind = {0};
    int node = NONE;
    if (heap->count == 0 || b->failed)
        return NONE;
    if (isinf(b->reach) || b->out->part_count + heap->count >= SV_CLOUD_PARTS_MAX / 2 || depth >= DEPTH_MAX)
        return add_node(b, NONE, heap);
    int plane = best_divider(b, heap);
    divide(b, heap, plane, &own, &before, &behind);
    if (!b->failed)
        node = add_node(b, plane, &own);
    if (node != NONE) {
        int near = build(b, &before, depth + 1), far = build(b, &behind, depth + 1);
        b->out->nodes[node].near = near;
        b->out->nodes[node].far = far;
    }
    free(own.parts);
    free(before.parts);
    free(behind.parts);
    return node;
}

enum sv_status sv_cloud_order_build(const struct sv_tree_cloud *cloud, const struct sv_cloud_part *outlines,
                                    int count, float reach, struct sv_cloud_order *order,
                                    struct sv_error *error)
{
    struct sv_cloud_order made = {.root = NONE};
    struct builder b = {.cloud = cloud, .out = &made, .reach = reach};
    struct heap all = {0};
    for (int k = 0; k < count && !b.failed; k++)
        b.failed = !push(&all, &outlines[k]);
    made.root = build(&b, &all, 0);
    free(all.parts);
    if (b.failed) {
        sv_cloud_order_finish(&made);
        return sv_fail(error, SV_ENOMEM, "cloud", "no memory to order %d planes", count);
    }
    *order = made;
    return SV_OK;
}

void sv_cloud_order_finish(struct sv_cloud_order *order)
{
    free(order->parts);
    free(order->nodes);
    memset(order, 0, sizeof *order);
}

/* Parts of a node that is no divider: by their middles. */
static void sort_list(const struct sv_cloud_order *order, const struct sv_tree_cloud *cloud,
                      const struct sv_cloud_order_node *node, const float d[3], uint16_t *out)
{
    float keys[SV_CLOUD_PARTS_MAX];
    for (int k = 0; k < node->count; k++) {
        const struct sv_cloud_part *part = &order->parts[node->first + k];
        const struct sv_cloud_plane *p = &cloud->planes[part->plane];
        float mid[2] = {0}, key;
        int at = k;
        for (int i = 0; i < part->count; i++)
            for (int c = 0; c < 2; c++)
                mid[c] += part->at[i][c] / (float)part->count;
        key = dot3(p->centre, d) + mid[0] * dot3(p->u, d) + mid[1] * dot3(p->v, d);
        for (; at > 0 && keys[at - 1] > key; at--) {
            keys[at] = keys[at - 1];
            out[at] = out[at - 1];
        }
        keys[at] = key;
        out[at] = (uint16_t)(node->first + k);
    }
}

static int visit(const struct sv_cloud_order *order, const struct sv_tree_cloud *cloud, int index,
                 const float d[3], uint16_t *out)
{
    if (index == NONE)
        return 0;
    const struct sv_cloud_order_node *node = &order->nodes[index];
    if (node->plane == NONE) {
        sort_list(order, cloud, node, d, out);
        return node->count;
    }
    bool before = dot3(cloud->planes[node->plane].normal, d) >= 0; /* the viewer is on the normal's side */
    int made = visit(order, cloud, before ? node->far : node->near, d, out);
    for (int k = 0; k < node->count; k++)
        out[made++] = (uint16_t)(node->first + k);
    return made + visit(order, cloud, before ? node->near : node->far, d, out + made);
}

void sv_cloud_order_sort(const struct sv_cloud_order *order, const struct sv_tree_cloud *cloud,
                         const float to_viewer[3], uint16_t *out)
{
    visit(order, cloud, order->root, to_viewer, out);
}
