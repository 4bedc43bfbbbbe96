/* change.h - what a change of a scene came to: how much, and where. Plain values, no pointers: it goes over
 * the wire as it is.
 *
 * Whoever keeps something that was drawn of a scene asks of each box whether it can see it or the shadow that
 * it throws (frames.h: world metres); what can see none of them is as good as before. A new sun touches
 * everything that is lit. */
#ifndef SV_SCENE_CHANGE_H
#define SV_SCENE_CHANGE_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

enum { SV_CHANGE_BOXES_MAX = 256 };

struct sv_change_box {
    double min[3], max[3]; /* world, m */
};

struct sv_scene_change {
    uint32_t trees_added, trees_removed, objects_added, objects_removed;
    uint32_t first_tree, first_object; /* numbers of the first that were added (id.h); the others follow */
    uint32_t not_placed;               /* scattered trees that found no room */
    bool sun;                          /* it stands elsewhere */
    /* Boxes that hold every tree (with its crown) and object that came or went. Those near each other share
     * one. */
    uint32_t box_count;
    struct sv_change_box boxes[SV_CHANGE_BOXES_MAX];
};

/* Fills change->boxes from `count` boxes (reordered): those whose middles lie in one square of the ground are
 * joined, squares of SV_CHANGE_CELL_M a side or as much larger as it takes. Linear times log. */
#define SV_CHANGE_CELL_M 8.0
void sv_scene_change_put(struct sv_scene_change *change, struct sv_change_box *boxes, size_t count);

#endif
