/* import_parts.h - the stations of an import, private to core/tree/import*.c.
 *
 *   import.c          assimp's scene -> struct raw_model: triangles in the file's world, materials, names
 *   import_texture.c  textures -> RGBA, opacity maps put into alpha, colour spread under alpha 0
 *   import_leaves.c   which materials, or parts of them, are leaves; how many leaves there are
 *   import_shape.c    frame, trunk axis, normals, each vertex once -> struct sv_tree_mesh
 *   import_sky.c      objects only: the share of the sky that each vertex of a solid body sees */
#ifndef SV_TREE_IMPORT_PARTS_H
#define SV_TREE_IMPORT_PARTS_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "core/base/error.h"
#include "core/base/image.h"
#include "core/tree/mesh.h"

/* What says whether alpha is a mask. */
enum raw_alpha {
    RAW_ALPHA_FROM_TEXTURE, /* the texture's alpha, when it has some (everything but glTF) */
    RAW_ALPHA_OPAQUE,       /* glTF OPAQUE: alpha means nothing */
    RAW_ALPHA_MASK,         /* glTF MASK with its cutoff */
    RAW_ALPHA_BLEND,        /* glTF BLEND: drawn as a mask */
};

enum { RAW_HINT_BYTES = 256, RAW_NO_TEXTURE = -1 };

struct raw_texture {
    char *key;             /* path or "*n", with the opacity map's; heap */
    struct sv_image image; /* RGBA u8; empty when it could not be read */
    bool has_alpha;
};

struct raw_material {
    char name[64];
    char hint[RAW_HINT_BYTES];      /* material's and texture's names, lower case */
    char mesh_hint[RAW_HINT_BYTES]; /* name of the first mesh that uses it, lower case */
    float color[4];                 /* linear factor, alpha factor */
    int texture;                    /* index, or RAW_NO_TEXTURE */
    enum raw_alpha alpha;
    float cutoff;
    bool two_sided;
    bool is_leaf, masked; /* set by raw_find_leaves */
};

struct raw_vertex {
    double p[3]; /* file's world: Y up, -Z north, own units */
    float n[3];  /* as given, any length; (0,0,0): none */
    float uv[2]; /* v down */
};

struct raw_triangle {
    uint32_t v[3];
    int32_t material;
};

struct raw_model {
    bool is_object; /* a body (house, rock, vehicle), not a tree: no trunk is sought, nothing is a leaf */
    struct raw_vertex *vertices;
    uint32_t vertex_count;
    struct raw_triangle *triangles;
    uint32_t triangle_count;
    struct raw_material *materials;
    int material_count;
    struct raw_texture *textures;
    int texture_count;
    uint32_t dropped_broken;     /* triangles with a vertex that is not finite */
    uint32_t dropped_degenerate; /* triangles without area */
};

void raw_finish(struct raw_model *raw);

/* Bytes of an embedded texture, or none: then `name` is a path as the author wrote it, sought beside the
 * model. */
struct raw_texture_source {
    const char *model_path, *material, *name;
    const void *bytes;
    size_t size;
    const char *extension; /* of bytes; may be NULL */
    struct sv_image bgra;  /* embedded as plain pixels (borrowed), else empty */
};

/* Finds the texture among raw->textures or loads it; opacity (may be NULL) goes into its alpha. One that
 * cannot be read is noted once and gives RAW_NO_TEXTURE. SV_ENOMEM only. color may be NULL when there is only
 * an opacity map. */
SV_MUST_CHECK enum sv_status raw_texture_load(struct raw_model *raw, const struct raw_texture_source *color,
                                              const struct raw_texture_source *opacity, int *texture,
                                              struct sv_errors *notes, struct sv_error *error);
/* Gives texels that a mask cuts away the colour of their nearest kept neighbours, so that filtering draws no
 * halo. */
void raw_texture_bleed(struct sv_image *rgba);
/* Alpha 0..1 of the texel under (u, v), wrapped; 1 without texture. */
float raw_texture_alpha(const struct raw_texture *texture, const float uv[2]);

/* What a material's names (then its mesh's) say: 1 leaves, -1 wood, 0 nothing or both. */
int raw_name_hint(const struct raw_material *material);
/* Sets is_leaf and masked of every material, may split one in two where it holds both leaves and wood, and
 * counts leaves: connected parts where they are cards, else half the triangles. SV_ENOMEM. */
SV_MUST_CHECK enum sv_status raw_find_leaves(struct raw_model *raw, uint32_t *leaf_count,
                                             struct sv_error *error);

/* Sets masked of every material and is_leaf of none: what an object needs. SV_ENOMEM. */
SV_MUST_CHECK enum sv_status raw_find_masks(struct raw_model *raw, struct sv_error *error);

/* Share of a material's edges that belong to one triangle only (1: all, or no triangle): high for sheets, low
 * for tubes. place maps vertices that count as one; NULL: as indexed. SV_ENOMEM. */
SV_MUST_CHECK enum sv_status raw_open_share(const struct raw_model *raw, int material, const uint32_t *place,
                                            double *share, struct sv_error *error);

/* Fills the mesh but for leaf_count and what sv_tree_mesh_measure finds.
 * SV_EFORMAT (no triangle, no height), SV_ELIMIT, SV_ENOMEM; path names the file in messages. */
SV_MUST_CHECK enum sv_status raw_shape(struct raw_model *raw, const char *path, struct sv_tree_mesh *mesh,
                                       struct sv_errors *notes, struct sv_error *error);

/* Sets every vertex's occlusion to the share of ambient light that the body itself leaves it (import_sky.c),
 * and open to all lit. Deterministic. SV_ENOMEM. */
SV_MUST_CHECK enum sv_status raw_measure_sky(struct sv_tree_mesh *mesh, struct sv_error *error);

#endif
