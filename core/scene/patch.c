#include "core/scene/patch.h"

#include <stdlib.h>

void sv_scene_patch_finish(struct sv_scene_patch *patch)
{
    for (int k = 0; k < patch->add_count; k++) {
        free(patch->add[k].scatter.mix);
        free(patch->add[k].scatter.within);
    }
    for (int k = 0; k < patch->object_count; k++)
        free(patch->objects[k].model);
    free(patch->add);
    free(patch->tree_ids);
    free(patch->within);
    free(patch->objects);
    free(patch->object_ids);
    *patch = (struct sv_scene_patch){0};
}
