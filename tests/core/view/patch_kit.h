/* patch_kit.h - a small scene of a scene file, in a folder that goes with the test, and patches of it as they
 * come over HTTP. Everything asserts. */
#ifndef SV_TEST_PATCH_KIT_H
#define SV_TEST_PATCH_KIT_H

#include "core/scene/patch_apply.h"
#include "core/view/renderer.h"

enum { PATCH_KIT_TREES = 260 };
extern const char PATCH_KIT_HUT[];

int patch_kit_setup(void **state);
int patch_kit_teardown(void **state);
void patch_kit_write(const char *name, const char *format, ...) SV_PRINTF(2, 3);
/* The first `trees` of the trees on 220 m x 220 m, a hut at (110, 118). forest, objects: more entries of the
 * lists, with a comma before; azimuth_deg: of the sun. */
struct sv_scene *patch_kit_load(uint32_t trees, const char *forest, const char *objects, double azimuth_deg);
/* r may be NULL. */
struct sv_scene_change patch_kit_patch(struct sv_scene *scene, struct sv_renderer *r, const char *format, ...)
    SV_PRINTF(3, 4);

#endif
