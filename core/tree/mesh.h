/* mesh.h - one species' polygons in model space (frames.h: Z up, base at z = 0, height 1), with its
 * materials.
 *
 * Made by import.c (assimp) or grow.c (procedural); kept on disk by sv_tree_mesh_save/load; read by OSMesa
 * drawing, by Embree and by every bake. Triangles are grouped by material, in the order of materials[]. A
 * mesh knows its leaves: a material with is_leaf holds leaf cards (found by alpha, or grown), the rest is
 * wood. */
#ifndef SV_TREE_MESH_H
#define SV_TREE_MESH_H

#include <stdbool.h>
#include <stdint.h>

#include "core/base/arena.h"
#include "core/base/error.h"
#include "core/base/image.h"
#include "core/base/vec.h"

enum {
    SV_TREE_VERTICES_MAX = 8 << 20,
    SV_TREE_TRIANGLES_MAX = 8 << 20,
    SV_TREE_MATERIALS_MAX = 64,
    SV_TREE_TEXTURE_SIDE_MAX = 4096,
};

struct sv_tree_vertex { /* 32 bytes: uploaded to GL as it is */
    float position[3];  /* model space */
    int16_t
        normal[3]; /* unit * 32767, model space; faces the outside of wood; on leaf cards the card's front */
    uint16_t occlusion; /* share of the sky that the crown leaves open here, * 65535 (65535 = open): ambient
                           light is scaled by it */
    float uv[2];        /* v down: (0,0) is the texture's first row and column */
    int8_t open[4];     /* share of sunlight that the crown lets through to here from direction d (unit, model
                           space, to the sun):     clamp((open[0] dx + open[1] dy + open[2] dz + open[3]) / 127, 0,
                           1); see sv_tree_vertex_open */
};

/* The value that open[] stands for; d unit, model space. Twin: sun_open in core/gl/shaders/tree_mesh.vert. */
static inline float sv_tree_vertex_open(const struct sv_tree_vertex *v, const float d[3])
{
    float t =
        ((float)v->open[0] * d[0] + (float)v->open[1] * d[1] + (float)v->open[2] * d[2] + (float)v->open[3]) /
        127.0f;
    return t < 0 ? 0 : t > 1 ? 1 : t;
}

struct sv_tree_material {
    char name[64];
    float base_color[4]; /* linear RGB factor on the texture, and alpha factor */
    struct sv_image
        albedo;     /* RGBA u8 sRGB, row 0 at the top; empty: base_color alone. Wraps (repeat) in u and v */
    bool is_leaf;   /* lit as foliage: two-sided normal, translucent */
    bool masked;    /* alpha test: a fragment exists where bilinear alpha (level 0) * base_color[3] >=
                       alpha_cutoff */
    bool two_sided; /* drawn from behind as well (always so for leaves) */
    float alpha_cutoff;                /* 0..1 */
    float translucency;                /* share of sunlight that passes a leaf, 0 for wood */
    uint32_t first_index, index_count; /* its triangles: indices[first_index ...], a multiple of 3 */
};

struct sv_tree_mesh {
    struct sv_tree_vertex *vertices;
    uint32_t vertex_count;
    uint32_t *indices;
    uint32_t index_count;
    struct sv_tree_material materials[SV_TREE_MATERIALS_MAX];
    int material_count;
    uint32_t leaf_count;  /* leaves (cards or grown leaves); 0 for a dead tree */
    float radius;         /* largest horizontal distance from the Z axis, in heights */
    float crown_base;     /* lowest leaf's z (0 when leafless) */
    float crown_color[3]; /* linear mean leaf colour (mean wood colour when leafless) */
    float model_height;   /* what 1 was in the model's own units, for the log */
};

/* Frees heap parts; legal on a zeroed mesh. Not for meshes in an arena. */
void sv_tree_mesh_finish(struct sv_tree_mesh *mesh);
/* Checks every count, range and index above, whatever the bytes: SV_EFORMAT names the first breach. load and
 * measure end with it. Pointers must be as large as the counts say. */
SV_MUST_CHECK enum sv_status sv_tree_mesh_check(const struct sv_tree_mesh *mesh, struct sv_error *error);
/* Deep copy into the arena. SV_ENOMEM. */
SV_MUST_CHECK enum sv_status sv_tree_mesh_to_arena(const struct sv_tree_mesh *mesh, struct sv_arena *arena,
                                                   struct sv_tree_mesh *out, struct sv_error *error);
/* One self-describing block of bytes (heap, caller frees) and back (heap mesh). load checks every count and
 * offset: any bytes are legal input; SV_EFORMAT. */
SV_MUST_CHECK enum sv_status sv_tree_mesh_save(const struct sv_tree_mesh *mesh, void **data, size_t *bytes,
                                               struct sv_error *error);
SV_MUST_CHECK enum sv_status sv_tree_mesh_load(const void *data, size_t bytes, struct sv_tree_mesh *mesh,
                                               struct sv_error *error);
/* Fills radius, crown_base, crown_color and every vertex's occlusion and open from the geometry (voxel
 * estimate of leaf density: own derivation in mesh_measure.c), then checks the invariants above (finite, in
 * range; base at 0 and height 1 to 1e-3). Vertices, indices, materials and leaf_count must be there; what
 * is_leaf, masked and albedo say is used. Deterministic; some 50 ms and 3 MB, and 1 s per 3 million vertices.
 * SV_EFORMAT names the breach, SV_ENOMEM. */
SV_MUST_CHECK enum sv_status sv_tree_mesh_measure(struct sv_tree_mesh *mesh, struct sv_error *error);

#endif
