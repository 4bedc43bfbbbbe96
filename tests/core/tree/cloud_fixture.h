/* cloud_fixture.h - what the tests of billboard clouds share: species, grown and imported, and a brute-force
 * rasterisation of a mesh and of its cloud from any direction. */
#ifndef SV_TEST_CLOUD_FIXTURE_H
#define SV_TEST_CLOUD_FIXTURE_H

#include "core/tree/cloud.h"

enum { CLOUD_FIXTURE_LEAVES = 38952 }; /* paper 2's tree */

/* Five grown habits, then imported models, as far as ../shared/data (or the directory SV_DATA) is there. */
int cloud_fixture_count(void);
const char *cloud_fixture_name(int species);
/* leaves: of grown ones. False when it cannot be had (a model that is not there). */
bool cloud_fixture_mesh(int species, uint32_t leaves, struct sv_tree_mesh *mesh);

/* The cloud as polygons: every piece where it lies, flat on its plane. Heap; sv_tree_mesh_finish frees it;
 * textures are copies. */
void cloud_fixture_flatten(const struct sv_tree_mesh *mesh, const struct sv_tree_cloud *cloud,
                           struct sv_tree_mesh *flat);

/* Share of a square picture that holds the unit-height tree (side 1.2 + 2 radius, SIDE samples) which the
 * mesh covers, seen from each of `count` directions of the Fibonacci sphere's upper half, the alpha test
 * included. */
void cloud_fixture_coverage(const struct sv_tree_mesh *mesh, int count, double *out);
void cloud_fixture_direction(int index, int count, double direction[3]);

#endif
