/* draw_mesh_upload.h - a tree mesh (or an object's: the same data) as GL has it: one vertex array over its
 * vertices and indices, and a texture for each material that has an albedo. All who draw meshes use it:
 * trees, objects, bakes of reliefs. Programs and draw calls are theirs; their vertex shaders read the
 * locations below. Current GL context needed. */
#ifndef SV_TREE_DRAW_MESH_UPLOAD_H
#define SV_TREE_DRAW_MESH_UPLOAD_H

#include <stdbool.h>

#include "core/tree/mesh.h"

/* Locations of a vertex's attributes: position (vec3), normal (vec3, -1 .. 1), occlusion (float, 0 .. 1), uv
 * (vec2), open (vec4, -1 .. 1). Instances begin at the last. */
enum {
    SV_MESH_AT_POSITION,
    SV_MESH_AT_NORMAL,
    SV_MESH_AT_OCCLUSION,
    SV_MESH_AT_UV,
    SV_MESH_AT_OPEN,
    SV_MESH_AT_INSTANCE
};

struct sv_mesh_upload {
    unsigned array, vertices, indices;        /* GL names; array holds the attributes and the indices */
    unsigned textures[SV_TREE_MATERIALS_MAX]; /* sRGB, repeated; 0: the material has no albedo */
};

/* Bytes of a mesh as uploaded without mip levels. No GL. */
size_t sv_mesh_upload_bytes(const struct sv_tree_mesh *mesh);
/* mipmaps: textures with all their levels, read trilinearly; else level 0 alone, bilinearly. Leaves no array
 * bound. GL errors are left for the caller's sv_gl_check. */
void sv_mesh_upload_init(const struct sv_tree_mesh *mesh, bool mipmaps, struct sv_mesh_upload *upload);
void sv_mesh_upload_finish(struct sv_mesh_upload *upload); /* legal on a zeroed one */
/* One such texture, of width * height RGBA8 texels; the caller's to delete. */
unsigned sv_mesh_upload_texture(int width, int height, const void *rgba, bool mipmaps);

#endif
