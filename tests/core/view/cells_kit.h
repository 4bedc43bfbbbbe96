/* cells_kit.h - a small scene of scene_kit.h with all that draws it: directly, and from relief cells. */
#ifndef SV_TEST_CELLS_KIT_H
#define SV_TEST_CELLS_KIT_H

#include "core/view/cells.h"
#include "tests/core/view/scene_kit.h"

struct cells_kit {
    struct sv_scene *scene;
    struct sv_direct *direct;
    struct sv_cells *cells;
    struct sv_cell_cache *cache;
    void *memory;
};

/* A hilly wood of so many trees. */
struct kit_options cells_kit_wood(uint32_t trees);
/* In the middle of the field: nothing more, a plain box of 6 m, or a round pit 40 m deep and 60 m wide (trees
 * stay at the height where they were). */
enum cells_kit_middle { CELLS_KIT_PLAIN, CELLS_KIT_HUT, CELLS_KIT_PIT };
/* Aborts on failure. One kit at a time: it holds the drawing context. */
void cells_kit_open(const struct kit_options *options, enum cells_kit_middle middle, struct cells_kit *kit);
void cells_kit_close(struct cells_kit *kit);

/* An eye at shares (x, y) of the field. */
struct cells_pose {
    double x, y, agl, heading_deg, pitch_deg, vfov_deg;
    int side;
};
struct sv_resolved_view cells_kit_view(const struct cells_kit *kit, const struct cells_pose *pose);
/* The same camera with its eye elsewhere. */
struct sv_resolved_view cells_kit_move(const struct sv_resolved_view *view, struct sv_vec3 eye);
/* Fresh pictures, colour alone; free with sv_image_free. */
struct sv_image cells_kit_direct(const struct cells_kit *kit, const struct sv_resolved_view *view);
struct sv_image cells_kit_draw(const struct cells_kit *kit, const struct sv_resolved_view *view,
                               struct sv_cells_report *report);
/* Mean of absolute differences over R, G, B, of 255. */
double cells_kit_off(const struct sv_image *a, const struct sv_image *b);

#endif
