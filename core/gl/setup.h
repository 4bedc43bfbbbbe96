/* setup.h - what a kind of context (context_osmesa.c, another one day) calls once it is current. Private to
 * core/gl; sees no GL header, since <GL/osmesa.h> and <GL/glcorearb.h> exclude each other. */
#ifndef SV_GL_SETUP_H
#define SV_GL_SETUP_H

#include "core/base/error.h"

typedef void (*sv_gl_proc)(void);
typedef sv_gl_proc (*sv_gl_lookup)(const char *name);

/* Fills the table `gl`; SV_EUNSUPPORTED names the first entry point that is missing. */
SV_MUST_CHECK enum sv_status sv_gl_functions_load(sv_gl_lookup lookup, struct sv_error *error);
/* Checks the version of the current context, sets clip control and pixel store for good, starts a new
 * generation. */
SV_MUST_CHECK enum sv_status sv_gl_context_setup(struct sv_error *error);

#endif
