/* draw_object_relief.h - objects as relief textures: warped by the CPU one after the other into one picture
 * of colour and depth (and id and normal where these are read), which GL then lays over its own by depth.
 *
 * Lit colours are kept from view to view, a slot for each class of objects that look alike (model,
 * resolution, heading), and made again when the light changes; the least recently used go when they exceed
 * SV_OBJECT_LOOKS_BYTES_MAX. Private to core/relief/draw_object*.c. */
#ifndef SV_RELIEF_DRAW_OBJECT_RELIEF_H
#define SV_RELIEF_DRAW_OBJECT_RELIEF_H

#include "core/gl/frame.h"
#include "core/relief/object.h"

enum { SV_OBJECT_LOOKS_BYTES_MAX = 96 << 20 };

struct sv_object_reliefs;

struct sv_object_relief_entry {
    const struct sv_relief_object *object; /* of the level that is to be warped */
    int slot;                              /* of its lit colours: class and level; 0 .. slot_count - 1 */
    struct sv_relief_place at;
    uint32_t id;
    double shade_height_m; /* world z below which no sun arrives; -INFINITY: nowhere */
    double taken;          /* share of sunlight that trees keep from it */
};

/* What was done, added up. */
struct sv_object_relief_stats {
    uint64_t texels;
    uint32_t holes, holes_left;
    uint32_t lit; /* looks that had to be made */
};

SV_MUST_CHECK enum sv_status sv_object_reliefs_create(int slot_count, struct sv_object_reliefs **reliefs,
                                                      struct sv_error *error);
void sv_object_reliefs_destroy(struct sv_object_reliefs *reliefs); /* NULL is legal */
/* Draws the entries into the current target; their order does not matter (but for equal depths: the first).
 * layers: what is read from the target. */
SV_MUST_CHECK enum sv_status
sv_object_reliefs_draw(struct sv_object_reliefs *reliefs, const struct sv_gl_frame *frame, unsigned layers,
                       bool shadows, const struct sv_object_relief_entry *entries, uint32_t count,
                       struct sv_object_relief_stats *stats, struct sv_error *error);

#endif
