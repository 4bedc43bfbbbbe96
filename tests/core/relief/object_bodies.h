/* object_bodies.h - the bodies of tests/experiments/object_kit.h as relief objects, baked once for a test
 * program, and what tests of them share. */
#ifndef SV_TESTS_OBJECT_BODIES_H
#define SV_TESTS_OBJECT_BODIES_H

#include "core/relief/object.h"
#include "core/view/camera.h"
#include "tests/experiments/object_kit.h"
#include "tests/experiments/object_truth.h"

struct body {
    struct sv_tree_mesh mesh;
    struct sv_relief_object object;
    struct sv_relief_look *look;
    struct object_truth *truth;
};
extern struct body bodies[OBJECT_KIT_COUNT];
/* Where they stand, 12 m high. */
extern const struct sv_relief_place BODIES_PLACE;

/* A program's set-up and tear-down for cmocka: makes and frees the bodies. */
int bodies_set_up(void **state);
int bodies_tear_down(void **state);
/* A camera that looks at the object's middle from outside, angles in radians; the object fills most of the
 * picture. */
struct sv_camera bodies_orbit_camera(const struct sv_relief_object *object, double azimuth, double elevation,
                                     int side);
/* Unit normal of a texel, in the object's own coordinates. */
struct sv_vec3 bodies_texel_normal(const struct sv_relief *relief, size_t texel);
/* The memory; the test fails where there is none. */
void *must(void *memory);

#endif
