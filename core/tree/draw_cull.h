/* draw_cull.h - which trees a view can see, nearest first. No GL.
 *
 * The forest's hierarchy of boxes against the view's five planes, then each tree's own box. A function of the
 * view and the forest alone. Private to core/tree. */
#ifndef SV_TREE_DRAW_CULL_H
#define SV_TREE_DRAW_CULL_H

#include "core/scene/forest.h"
#include "core/tree/draw.h"
#include "core/view/camera.h"

struct sv_cull_species {
    float radius; /* in heights */
};

struct sv_cull_entry {
    uint32_t key;  /* order-preserving code of the distance */
    uint32_t tree; /* index in forest.trees */
};

/* Caller's, zeroed at first, used again from view to view. */
struct sv_cull_list {
    struct sv_cull_entry *entries, *swap; /* heap */
    uint32_t room;
    uint32_t count; /* entries[0 .. count), nearest first */
    uint32_t culled;
};

/* planes as sv_camera_planes gives them; shell: only trees whose axis, foot to top, lies in it (draw.h), for
 * the price of what is near it; NULL: all. SV_ENOMEM. */
SV_MUST_CHECK enum sv_status sv_cull_forest(const struct sv_forest *forest,
                                            const struct sv_cull_species *species,
                                            const struct sv_camera *camera, const double planes[5][4],
                                            const struct sv_tree_shell *shell, struct sv_cull_list *list,
                                            struct sv_error *error);
void sv_cull_list_finish(struct sv_cull_list *list);

/* Floats as unsigned integers of the same order. */
uint32_t sv_cull_order_code(float v);
/* Sorts by key, rising, order among equals kept; the result lies in entries or in swap (count each). */
struct sv_cull_entry *sv_cull_sort(struct sv_cull_entry *entries, struct sv_cull_entry *swap, uint32_t count);

/* Distance that decides form and order: perspective: from the eye to the tree's middle; orthographic: depth.
 */
double sv_cull_distance_m(const struct sv_camera *camera, const struct sv_tree *tree);
/* Height of the tree in the picture, px, were it square to the view. */
double sv_cull_height_px(const struct sv_camera *camera, const struct sv_tree *tree);

#endif
