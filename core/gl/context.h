/* context.h - an off-screen GL 4.5 core context. The only file that knows OSMesa is context_osmesa.c.
 *
 * One context a process, made before the workers are forked and used by each child on its own (design.md
 * section 2: the context needs LP_NUM_THREADS=0 and MESA_SHADER_CACHE_DISABLE=true, which
 * sv_gl_context_create sets before OSMesa is first touched). glClipControl(GL_UPPER_LEFT, GL_ZERO_TO_ONE) is
 * set for good: it is the only flip there is, so that window row 0, gl_FragCoord.y = 0.5 and the first row of
 * glReadPixels are all the picture's top. */
#ifndef SV_GL_CONTEXT_H
#define SV_GL_CONTEXT_H

#include "core/base/error.h"

struct sv_gl_context;

/* Makes the context current and loads the entry points (functions.h). SV_EUNSUPPORTED when GL 4.5 core or an
 * entry point is not there, SV_ENOMEM. */
SV_MUST_CHECK enum sv_status sv_gl_context_create(struct sv_gl_context **context, struct sv_error *error);
void sv_gl_context_destroy(struct sv_gl_context *context); /* NULL is legal */
/* GL errors since the last call, as SV_EINTERNAL (SV_ENOMEM for GL_OUT_OF_MEMORY) naming `where`; SV_OK when
 * none. */
SV_MUST_CHECK enum sv_status sv_gl_check(const char *where, struct sv_error *error);
/* "llvmpipe (LLVM 15.0.6, 256 bits)" and the like, for logs; "none" without a context. */
const char *sv_gl_renderer_name(void);
/* Counts the contexts made in this process (0: none yet): what caches GL names in a static compares it. */
unsigned sv_gl_context_generation(void);

#endif
