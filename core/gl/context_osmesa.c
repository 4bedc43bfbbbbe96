/* context_osmesa.c - the off-screen context by OSMesa (Mesa up to 25.0), the only file that calls it.
 *
 * OSMesa's own colour buffer is a few pixels that nobody draws into: views are drawn into framebuffer objects
 * (target.h). llvmpipe is kept on the calling thread, so that the context lives on in forked children. */
#include "core/gl/context.h"

#include <stdlib.h>

#include <GL/osmesa.h>

#include "core/gl/setup.h"

enum { OWN_SIDE = 16 };

struct sv_gl_context {
    OSMesaContext mesa;
    unsigned char pixels[OWN_SIDE * OWN_SIDE * 4];
};

static sv_gl_proc lookup_osmesa(const char *name)
{
    return (sv_gl_proc)OSMesaGetProcAddress(name);
}

enum sv_status sv_gl_context_create(struct sv_gl_context **context, struct sv_error *error)
{
    static const int wanted[] = {OSMESA_FORMAT,
                                 OSMESA_RGBA,
                                 OSMESA_DEPTH_BITS,
                                 0,
                                 OSMESA_PROFILE,
                                 OSMESA_CORE_PROFILE,
                                 OSMESA_CONTEXT_MAJOR_VERSION,
                                 4,
                                 OSMESA_CONTEXT_MINOR_VERSION,
                                 5,
                                 0};
    enum sv_status status;
    if (setenv("LP_NUM_THREADS", "0", 1) || setenv("MESA_SHADER_CACHE_DISABLE", "true", 1))
        return sv_fail(error, SV_ENOMEM, "gl", "no memory for the environment of OSMesa");
    struct sv_gl_context *made = calloc(1, sizeof *made);
    if (!made)
        return sv_fail(error, SV_ENOMEM, "gl", "no memory for a GL context");
    made->mesa = OSMesaCreateContextAttribs(wanted, NULL);
    if (!made->mesa) {
        status = sv_fail(error, SV_EUNSUPPORTED, "gl", "OSMesa has no GL 4.5 core context");
        goto fail;
    }
    if (!OSMesaMakeCurrent(made->mesa, made->pixels, GL_UNSIGNED_BYTE, OWN_SIDE, OWN_SIDE)) {
        status = sv_fail(error, SV_EUNSUPPORTED, "gl", "OSMesa does not make its context current");
        goto fail;
    }
    status = sv_gl_functions_load(lookup_osmesa, error);
    if (status)
        goto fail;
    status = sv_gl_context_setup(error);
    if (status)
        goto fail;
    *context = made;
    return SV_OK;
fail:
    sv_gl_context_destroy(made);
    return status;
}

void sv_gl_context_destroy(struct sv_gl_context *context)
{
    if (!context)
        return;
    if (context->mesa) {
        OSMesaMakeCurrent(NULL, NULL, 0, 0, 0);
        OSMesaDestroyContext(context->mesa);
    }
    free(context);
}
