/* object_truth.h - a mesh ray cast by Embree: what a picture of a relief object is judged by. One sample a
 * pixel, at its centre; the same camera, light rule and place as the object. */
#ifndef SV_TESTS_OBJECT_TRUTH_H
#define SV_TESTS_OBJECT_TRUTH_H

#include "core/relief/object.h"

struct object_truth;

struct object_truth *object_truth_create(const struct sv_tree_mesh *mesh);
void object_truth_destroy(struct object_truth *truth);
/* depth_m: along forward, INFINITY where nothing is hit; rgba (or NULL): lit (light NULL: albedo), alpha 255
 * or 0; lit (or NULL): 255 where the sun is seen and faces the surface, 0 where not. All width * height of
 * the camera. */
void object_truth_draw(const struct object_truth *truth, const struct sv_relief_place *place,
                       const struct sv_camera *camera, const struct sv_light *light, bool shadows,
                       float *depth_m, uint8_t (*rgba)[4]);
/* Whether the sun is seen from a place of model space, with normal n (model space); bias along n. */
bool object_truth_sunlit(const struct object_truth *truth, struct sv_vec3 at, struct sv_vec3 n,
                         struct sv_vec3 to_sun, double bias);

#endif
