/* leaf_fixture.h - flat scenes with given trees, the ray-cast truth of them, and leaf splats over the truth's
 * ground, for tests and measurements of core/tree/leaf_splat. */
#ifndef SV_TEST_LEAF_FIXTURE_H
#define SV_TEST_LEAF_FIXTURE_H

#include "core/scene/scene.h"
#include "core/tree/leaf_splat.h"
#include "core/truth/truth.h"

enum { LEAF_FIXTURE_SPECIES = 8 };

struct leaf_fixture {
    struct sv_scene *scene;
    struct sv_truth *truth;
    struct sv_leaf_splat *splat;
    struct sv_cull_entry *entries; /* all trees, nearest first after leaf_fixture_sort */
};

/* Height 1 tall meshes are copied; trees' z is the ground's 300 plus their own. */
void leaf_fixture_init(struct leaf_fixture *f, const struct sv_tree_mesh *meshes, int species,
                       const struct sv_tree *trees, uint32_t count);
void leaf_fixture_finish(struct leaf_fixture *f);
void leaf_fixture_sort(struct leaf_fixture *f, const struct sv_camera *camera);

/* The place on the ground that trees stand around. */
struct sv_vec3 leaf_fixture_middle(void);

/* All four layers by the truth: colour of `samples` samples. */
void leaf_fixture_truth(const struct leaf_fixture *f, const struct sv_leaf_view *view, int samples,
                        bool trees, bool shadows, struct sv_truth_picture *out);
void leaf_picture_finish(struct sv_truth_picture *picture);

/* A canvas over a copy of the truth's picture (depths as window depths), to be freed by leaf_canvas_finish.
 */
struct sv_canvas leaf_canvas(const struct sv_truth_picture *ground, const struct sv_camera *camera);
void leaf_canvas_finish(struct sv_canvas *canvas);

/* Depth in metres of a window depth; INFINITY for nothing. */
double leaf_depth_m(const struct sv_camera *camera, float window);

#endif
