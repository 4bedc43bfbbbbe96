/* program.h - GLSL programs from the files that are embedded at build time (core/gl/shaders).
 *
 * A file is named as in the folder ("terrain.vert"). `#include "frame.glsl"` (alone on its line) is replaced
 * by that file, each at most once a stage. "#version 450 core" is put first: files carry no version. Uniforms
 * that a .c sets have an explicit location in the shader. */
#ifndef SV_GL_PROGRAM_H
#define SV_GL_PROGRAM_H

#include "core/base/error.h"

/* Compiles and links two stages. defines: lines put after the version ("#define NAME 1\n"), or NULL. The
 * program's GL name is written on success only; gl.DeleteProgram frees it. SV_ENOENT: no such file;
 * SV_EINTERNAL: the compiler's log in the message, cut to its size. */
SV_MUST_CHECK enum sv_status sv_gl_program_create(const char *vertex_file, const char *fragment_file,
                                                  const char *defines, unsigned *program,
                                                  struct sv_error *error);
/* The same from source text (tests); fragment text may include embedded files. */
SV_MUST_CHECK enum sv_status sv_gl_program_create_text(const char *vertex_text, const char *fragment_text,
                                                       unsigned *program, struct sv_error *error);
/* Text of an embedded file, or NULL. */
const char *sv_gl_shader_text(const char *file);

#endif
