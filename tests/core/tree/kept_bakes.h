/* kept_bakes.h - far forms of trees in tests that are not about baking them: baked once a tree, not once a
 * scene.
 *
 * A tree takes a second or more of baking, which a test of lights, panels or patches would pay for every
 * renderer that it makes. Tests of the bakes themselves (test_sprite, test_ladder, test_impostor) do without
 * any store. */
#ifndef SV_TEST_KEPT_BAKES_H
#define SV_TEST_KEPT_BAKES_H

#include "core/base/store.h"
#include "core/tree/mesh.h"

/* The store in the folder that SILVISTA_CACHE_DIR names, which all tests of a run share; else one of this
 * process alone, gone with it. Opened at the first call, for the life of the process: the caller does not
 * close it. */
struct sv_store *kept_bakes(void);

/* A key that only this very tree has: of everything that its bakes are made from. Trees made by hand have no
 * other. */
uint64_t kept_bakes_key(const struct sv_tree_mesh *mesh);

#endif
