/* sheet_kit.h - flat ground and one tree that is a square sheet: its shadow is known in closed form. */
#ifndef SV_TEST_SHEET_KIT_H
#define SV_TEST_SHEET_KIT_H

#include "core/scene/scene.h"

struct sv_scene *sheet_kit_flat_scene(void); /* 128 m from (600000, 4e6) on, at 500 m; free with kit_free */
/* The tree, of a new species, is all of the scene's forest: a horizontal square of half its size a side in
 * heights, at height 1: two triangles, uv over the texture once. masked: its east half is open. One at a
 * time. */
void sheet_kit_put(struct sv_scene *scene, double half, struct sv_tree *tree, bool masked);

#endif
