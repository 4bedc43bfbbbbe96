/* shade_fixture.h - what the tests of trees in sunlight share: level ground, a stand of grown trees on the
 * same ground, what the sun needs to know of its species, and the ray-cast truth of both.
 *
 * Truth without shadow rays: an orthographic picture of the scene from the sun shows exactly what sunlight
 * reaches first. A tree alone gives its silhouette; a stand gives, by the ids in it, which part of each
 * tree's own outline the sun still reaches. */
#ifndef SV_TESTS_TREE_SHADE_FIXTURE_H
#define SV_TESTS_TREE_SHADE_FIXTURE_H

#include "core/base/arena.h"
#include "core/scene/scene.h"
#include "core/tree/shade_private.h"
#include "core/truth/truth.h"
#include "core/view/camera.h"

enum { SHADE_SPECIES = 3 };
#define SHADE_AZIMUTH_DEG 137.0 /* of the sun in all comparisons with rays */

extern struct sv_scene *shade_ground, *shade_stand; /* flat, without trees; grown trees, close together */
extern struct sv_shade_species shade_table[SHADE_SPECIES]; /* of the stand's species */

int shade_setup(void **state); /* cmocka's: of a group of tests */
int shade_teardown(void **state);
void shade_ok(enum sv_status status, const struct sv_error *error);

struct sv_vec3 shade_middle(void); /* of the ground */
struct sv_vec3 shade_sun_at(double azimuth_deg, double elevation_deg);
/* The scene as the sun sees it: side x side px over span metres, its middle at `target`. */
struct sv_camera shade_sun_camera(double azimuth_deg, double elevation_deg, struct sv_vec3 target,
                                  double span, int side);
/* The ray-cast truth of the flat ground with these trees (borrowed for life). The scene outlives it. */
struct sv_truth *shade_truth_of(struct sv_scene *scene, const struct sv_tree *trees, uint32_t count);
/* Ids as camera sees them: heap, side * side. */
uint32_t *shade_truth_ids(const struct sv_truth *truth, const struct sv_camera *camera);
/* Distances along the rays of pixels' middles; heap. */
float *shade_truth_depths(const struct sv_truth *truth, const struct sv_camera *camera);
/* Trees side by side, square to the light's azimuth: no sun of that azimuth casts one's shade on another. */
struct sv_vec3 shade_apart(int k);
/* A tree at (x, y) from the ground's middle. */
struct sv_tree shade_tree_at(double x, double y, double height, int species, uint32_t number);

struct shade_forest {
    struct sv_arena *arena;
    struct sv_forest forest;
    struct sv_tree_shade *shade;
};
void shade_forest_init(struct shade_forest *f, const struct sv_tree *trees, uint32_t count,
                       const struct sv_shade_species *species, int species_count);
void shade_forest_finish(struct shade_forest *f);
void shade_forest_update(struct shade_forest *f, struct sv_vec3 to_sun);

#endif
