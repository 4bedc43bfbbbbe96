/* import.h - a tree from a model file, by assimp: OBJ, glTF, DAE, FBX, PLY, AC3D ... (import.c is the only
 * file that includes assimp). Rules in core/base/frames.h (Y up, -Z north) and api.md section 7. */
#ifndef SV_TREE_IMPORT_H
#define SV_TREE_IMPORT_H

#include "core/tree/mesh.h"

/* Reads the model at path into a heap mesh of height 1 (base at the lowest point, node transforms applied),
 * textures decoded (embedded ones too), materials merged where equal, alpha masks and leaves found. notes
 * (may be NULL) takes what a user should hear but what is no failure (a texture missing, no leaves found,
 * units guessed ...). SV_ENOENT no such file; SV_EFORMAT assimp cannot read it or it holds no triangle;
 * SV_ELIMIT over mesh.h's limits. */
SV_MUST_CHECK enum sv_status sv_tree_import(const char *path, struct sv_tree_mesh *mesh,
                                            struct sv_errors *notes, struct sv_error *error);

#endif
