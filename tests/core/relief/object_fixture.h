/* object_fixture.h - scenes of the kit (tests/core/view/scene_kit.h) with objects in them, and pictures of
 * them in each form. */
#ifndef SV_TEST_OBJECT_FIXTURE_H
#define SV_TEST_OBJECT_FIXTURE_H

#include "tests/core/view/scene_kit.h"

/* A hut: walls, gabled roof that stands over, chimney; boxes by corners, no texture, three materials. Heap
 * mesh of height 1, imported as any model is. Asserts on failure. */
void object_hut(struct sv_tree_mesh *mesh);

/* What stands where. */
struct object_place {
    int model;
    double x, y, heading_rad, height_m;
    int resolution;
};
/* Puts objects into a kit scene, on its ground; meshes are copied into the scene's arena. */
void object_add(struct sv_scene *scene, const struct sv_tree_mesh *const *meshes, int mesh_count,
                const struct object_place *places, int count);

enum object_form { OBJECT_POLYGON, OBJECT_RELIEF, OBJECT_TRUTH };
/* Draws one layer of a view in a form, trees=none. relief texel: INFINITY in form RELIEF. stats may be NULL.
 */
void object_draw(struct sv_renderer *renderer, const struct sv_scene *scene, struct sv_view_request request,
                 enum object_form form, int samples, enum sv_layer layer, struct sv_image *out,
                 struct sv_draw_stats *stats);

#endif
