/* cloud_order.h - in which order the planes of a billboard cloud are painted: they cross each other, so none
 * lies before another as a whole.
 *
 * A binary space partition (Fuchs, Kedem, Naylor 1980): planes are cut along each other, and for every
 * direction of view the parts come out from the farthest to the nearest. Without it blending by whole planes
 * shows what lies deep in the crown: seen from 60 degrees above, 14 % too dark. Area, and so what is filled,
 * stays as it is. No GL; deterministic. */
#ifndef SV_TREE_CLOUD_ORDER_H
#define SV_TREE_CLOUD_ORDER_H

#include "core/tree/cloud.h"

enum { SV_CLOUD_PART_CORNERS = 24, SV_CLOUD_PARTS_MAX = 4096 };

/* A convex part of a plane, plane coordinates. */
struct sv_cloud_part {
    int plane, count;
    float at[SV_CLOUD_PART_CORNERS][2];
};

struct sv_cloud_order {
    struct sv_cloud_part *parts; /* heap */
    int part_count;
    struct sv_cloud_order_node *nodes; /* heap; private to cloud_order.c */
    int node_count, root;
};

/* reach: a part that reaches less than this past another plane (tree heights) is not cut by it; INFINITY:
 * none is, and order is that of middles. Oak and spruce: 0.001 makes 4,000 triangles a tree, 0.04 1,400, 0.1
 * 470 (uncut octagons 144), and the error against the truth is the same to a hundredth. */
#define SV_CLOUD_ORDER_REACH 0.1f

/* Cuts outlines (one a plane that shows anything: convex, at least three corners) along each other. Beyond
 * SV_CLOUD_PARTS_MAX parts no more are cut, and order is that of their middles. SV_ENOMEM. */
SV_MUST_CHECK enum sv_status sv_cloud_order_build(const struct sv_tree_cloud *cloud,
                                                  const struct sv_cloud_part *outlines, int count,
                                                  float reach, struct sv_cloud_order *order,
                                                  struct sv_error *error);
void sv_cloud_order_finish(struct sv_cloud_order *order); /* legal on a zeroed one */
/* Indices of all parts from the farthest to the nearest, for a viewer far off in that direction (model
 * space); out: part_count. */
void sv_cloud_order_sort(const struct sv_cloud_order *order, const struct sv_tree_cloud *cloud,
                         const float to_viewer[3], uint16_t *out);

#endif
