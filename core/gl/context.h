/* context.h - an off-screen GL 4.5 core context. The only header that knows OSMesa is context_osmesa.c's.
 *
 * One context a process, made before the workers are forked and used by each child on its own (design.md section 2: the
 * context needs LP_NUM_THREADS=0 and MESA_SHADER_CACHE_DISABLE=true, which sv_gl_context_create sets before OSMesa is
 * first touched). glClipControl(GL_UPPER_LEFT, GL_ZERO_TO_ONE) is set for good. */
#ifndef SV_GL_CONTEXT_H
#define SV_GL_CONTEXT_H

#include "core/base/error.h"

struct sv_gl_context;

/* Makes the context current. SV_EUNSUPPORTED when GL 4.5 core or a needed extension is not there. */
SV_MUST_CHECK enum sv_status sv_gl_context_create(struct sv_gl_context **context, struct sv_error *error);
void sv_gl_context_destroy(struct sv_gl_context *context);
/* GL errors since the last call, as SV_EINTERNAL naming `where`; SV_OK when none. */
SV_MUST_CHECK enum sv_status sv_gl_check(const char *where, struct sv_error *error);
/* "llvmpipe (LLVM 15.0.6, 256 bits)" and the like, for logs. */
const char *sv_gl_renderer_name(void);

#endif
