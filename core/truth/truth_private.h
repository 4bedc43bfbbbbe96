/* truth_private.h - what the building and the tracing of the reference share.
 *
 * A layer is a pair of Embree scenes and what stands in them, by geometry id. Layer 0 was built with the
 * reference: trees, then the terrain's id, then objects. Layer 1 holds what has come since, trees first; it
 * has no terrain and no scenes while nothing has. */
#ifndef SV_TRUTH_TRUTH_PRIVATE_H
#define SV_TRUTH_TRUTH_PRIVATE_H

#include <embree3/rtcore.h>
#include <pmmintrin.h>
#include <xmmintrin.h>

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

/* What the rays of one picture share. */
struct sv_truth_caster {
    const struct sv_truth *truth;
    const struct sv_light *light;
    const struct sv_truth_options *options; /* shadows and sky of it */
    const struct sv_camera *camera;
    const struct sv_truth_layer *seen[SV_TRUTH_LAYERS]; /* what rays from the eye meet stands in these, */
    RTCScene scenes[SV_TRUTH_LAYERS];                   /* in these scenes; NULL: nothing is there */
    RTCScene occluders[SV_TRUTH_LAYERS];                /* what keeps the sun off */
    const uint8_t *gone;                                /* for rays from the eye */
    struct sv_vec3 eye_local;
    double pixel_angle; /* size of a pixel at depth 1: what the ground's detail fades by */
};

struct sv_truth_hit {
    bool any;
    bool terrain;
    double depth_m;
    struct sv_vec3 local;  /* place */
    struct sv_vec3 normal; /* shading normal, unit, turned to the viewer on trees and objects */
    float albedo[3], occlusion, translucency;
    float open; /* share of the sun that the tree's own crown is taken to let through, where no shadow is cast
                 */
    bool leaf;
    uint32_t id;
};

/* Of the whole scene; options->trees: with its trees. Borrows all. */
void sv_truth_caster_init(const struct sv_truth *truth, const struct sv_camera *camera,
                          const struct sv_light *light, const struct sv_truth_options *options,
                          struct sv_truth_caster *caster);
/* One ray through a place of the picture, px; rgba: premultiplied, linear, at most 1. */
void sv_truth_sample(const struct sv_truth_caster *caster, double px, double py, struct sv_truth_hit *hit,
                     float rgba[4]);

/* 1 where the sun is seen from the hit (its place, normal and depth), else 0; without shadows what the crown
 * lets through on the average. */
float sv_truth_sun_visible(const struct sv_truth_caster *caster, const struct sv_truth_hit *hit);

/* Embree wants denormals flushed while it traces; the caller's mode, which this returns, comes back
 * afterwards
 * (_mm_setcsr). */
static inline unsigned sv_truth_flush_denormals(void)
{
    unsigned mode = _mm_getcsr();
    _MM_SET_FLUSH_ZERO_MODE(_MM_FLUSH_ZERO_ON);
    _MM_SET_DENORMALS_ZERO_MODE(_MM_DENORMALS_ZERO_ON);
    return mode;
}

/* A layer of these trees alone, to be looked at: only `full` is made. SV_ENOMEM, SV_EINTERNAL. */
SV_MUST_CHECK enum sv_status sv_truth_layer_of_trees(const struct sv_truth *truth, const uint32_t *trees,
                                                     uint32_t count, struct sv_truth_layer *layer,
                                                     struct sv_error *error);
void sv_truth_layer_release(struct sv_truth_layer *layer);

/* Texture coordinates at a hit. */
void sv_leaf_mask_uv(const struct sv_leaf_mask *mask, unsigned triangle, float u, float v, float uv[2]);

#endif
