/* id.h - the values of layer=id: 32 bits that name what a pixel shows. Numbers count in the order of the
 * scene file; trees and objects that a patch adds get the next ones, and what stands keeps its own
 * (patch_apply.h). */
#ifndef SV_SCENE_ID_H
#define SV_SCENE_ID_H

#include <stdint.h>

#define SV_ID_SKY UINT32_C(0)
#define SV_ID_TERRAIN UINT32_C(1)
#define SV_ID_OBJECT_FIRST UINT32_C(0x40000000) /* + sv_scene_object.number */
#define SV_ID_TREE_FIRST UINT32_C(0x80000000)   /* + sv_tree.number */

#endif
