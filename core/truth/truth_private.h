/* truth_private.h - what the building and the tracing of the reference share.
 *
 * A layer is a pair of Embree scenes and what stands in them, by geometry id. Layer 0 was built with the
 * reference: trees, then the terrain's id, then objects. Layer 1 holds what has come since, trees first; it
 * has no terrain and no scenes while nothing has. */
#ifndef SV_TRUTH_TRUTH_PRIVATE_H
#define SV_TRUTH_TRUTH_PRIVATE_H

#include <embree3/rtcore.h>

#include "core/truth/terrain_patch.h"
#include "core/truth/truth.h"

/* What a hit on a mesh's geometry needs: geometry ids of a mesh's scene are its materials' indices. */
struct sv_leaf_mask {
    const struct sv_tree_mesh *mesh;
    const struct sv_tree_material *material;
};

struct sv_mesh_scene {
    RTCScene scene;
    struct sv_leaf_mask masks[SV_TREE_MATERIALS_MAX];
};

/* An instance: of what, and how it is turned. */
struct sv_standing {
    const struct sv_mesh_scene *mesh; /* NULL: the terrain's place */
    float rotation_rad;
    uint32_t id; /* of layer=id */
};

struct sv_truth_layer {
    RTCScene full, bare; /* bare: without trees */
    struct sv_standing *standing;
    uint32_t count;
};

enum { SV_TRUTH_LAYERS = 2 };

struct sv_truth {
    const struct sv_scene *scene;
    struct sv_vec3 origin; /* world place of local (0, 0, 0) */
    RTCDevice device;
    struct sv_truth_layer layers[SV_TRUTH_LAYERS];
    struct sv_mesh_scene **species, **models; /* NULL: not built */
    int model_count;                          /* built */
    struct sv_terrain_patches patches;
    uint32_t tree_count, object_first; /* of layer 0 */
    uint8_t *gone;                     /* of layer 0, by geometry id: not 0: no longer there; NULL: all are */
    struct sv_tree *later;             /* trees of layer 1 */
    uint32_t later_count;
    bool objects_later; /* objects are in layer 1, all of them */
};

/* The context of every ray. */
struct sv_truth_ray {
    struct sv_patch_context patch; /* first: Embree passes a pointer to this */
    const uint8_t *gone;
};

/* Texture coordinates at a hit. */
void sv_leaf_mask_uv(const struct sv_leaf_mask *mask, unsigned triangle, float u, float v, float uv[2]);

#endif
