/* import.h - a tree, or an object, from a model file, by assimp: OBJ, glTF, DAE, FBX, PLY, AC3D ... (import.c
 * is the only file that includes assimp). Rules in core/base/frames.h (Y up, -Z north) and api.md section 7.
 *
 * What a model does not say is decided so (import_shape.c, import_leaves.c, import.c give reasons, numbers):
 *   place    the trunk's foot stands on the axis, where wood near the wood's lowest point keeps together;
 *            else the model's own origin, unless that lies outside of its ground plan (then the plan's
 *            middle, and a note)
 *   leaves   alpha that cuts away a real share of what is shown; then names of material, texture and
 *            mesh (leaf, foliage, frond ...; bark, trunk, stem ... say wood); an atlas for the whole tree
 *            is split into cut cards and uncut wood
 *   alpha    in the texture, in an opacity map, or as glTF says; a mask (cutoff 0.5, or the file's)
 *   colour   factors are linear in glTF and from Blender, else sRGB; beside a texture a plain grey (not in
 *            glTF) is an exporter's default and counts as white
 *   normals  the file's; else smooth up to 60 degrees, cards flat; wood is wound to face outward
 *   sides    leaves and masks have two; wood as glTF says, else two where it is an open sheet
 * leaf_count: connected cards of up to 8 triangles, and half the triangles of larger leafy parts.
 *
 * An object (house, vehicle, rock: sv_object_import) goes the same way but for this:
 *   place    the model's own origin, where it lies in the ground plan (its border counts): whoever gave the
 *            model an anchor keeps it; else the plan's middle, and a note. A note also tells of an anchor
 *            that is far from the middle, since an exporter may have put it there by chance
 *   leaves   none, whatever the names say; alpha masks count as above
 *   light    open: all lit (who casts shadows asks a shadow map); occlusion: import_sky.c */
#ifndef SV_TREE_IMPORT_H
#define SV_TREE_IMPORT_H

#include "core/tree/mesh.h"

/* Reads the model at path into a heap mesh of height 1 (base at the lowest point, node transforms applied),
 * textures decoded (embedded ones too), materials merged where equal, alpha masks and leaves found, measured.
 * notes (may be NULL) takes what a user should hear but what is no failure (a texture missing, no leaves
 * found, triangles that are broken or without area, which are left out). One thread; 20 to 400 ms. SV_ENOENT
 * no such file; SV_EFORMAT assimp cannot read it, it holds no triangle, or no height; SV_ELIMIT over mesh.h's
 * limits or 1 GiB; SV_EIO, SV_ENOMEM. */
SV_MUST_CHECK enum sv_status sv_tree_import(const char *path, struct sv_tree_mesh *mesh,
                                            struct sv_errors *notes, struct sv_error *error);

/* Reads the model at path as an object, into a mesh of the same kind: height 1, base at the lowest point, own
 * origin or middle of the ground plan at x = y = 0, leaf_count 0, is_leaf of no material. Errors, notes,
 * thread as sv_tree_import; 10 to 300 ms. */
SV_MUST_CHECK enum sv_status sv_object_import(const char *path, struct sv_tree_mesh *mesh,
                                              struct sv_errors *notes, struct sv_error *error);

#endif
