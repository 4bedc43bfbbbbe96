/* context.c - what is the same for every kind of context: checks the version, fixes the clip control, turns
 * GL errors into sv_error. Making one is context_osmesa.c's. */
#include "core/gl/context.h"

#include <stddef.h>

#include "core/gl/functions.h"
#include "core/gl/setup.h"

static unsigned generation;

enum sv_status sv_gl_context_setup(struct sv_error *error)
{
    GLint major = 0, minor = 0;
    gl.GetIntegerv(GL_MAJOR_VERSION, &major);
    gl.GetIntegerv(GL_MINOR_VERSION, &minor);
    if (major * 10 + minor < 45)
        return sv_fail(error, SV_EUNSUPPORTED, "gl", "the context is GL %d.%d, and 4.5 is needed", major,
                       minor);
    gl.ClipControl(GL_UPPER_LEFT, GL_ZERO_TO_ONE);
    gl.PixelStorei(GL_PACK_ALIGNMENT, 1);
    gl.PixelStorei(GL_UNPACK_ALIGNMENT, 1);
    gl.Enable(GL_TEXTURE_CUBE_MAP_SEAMLESS);
    generation++;
    return sv_gl_check("context setup", error);
}

unsigned sv_gl_context_generation(void)
{
    return generation;
}

static const char *error_name(GLenum code)
{
    static const struct {
        GLenum code;
        const char *name;
    } names[] = {
        {GL_INVALID_ENUM, "GL_INVALID_ENUM"},
        {GL_INVALID_VALUE, "GL_INVALID_VALUE"},
        {GL_INVALID_OPERATION, "GL_INVALID_OPERATION"},
        {GL_INVALID_FRAMEBUFFER_OPERATION, "GL_INVALID_FRAMEBUFFER_OPERATION"},
        {GL_OUT_OF_MEMORY, "GL_OUT_OF_MEMORY"},
    };
    for (size_t i = 0; i < sizeof names / sizeof names[0]; i++)
        if (names[i].code == code)
            return names[i].name;
    return "an unknown GL error";
}

enum sv_status sv_gl_check(const char *where, struct sv_error *error)
{
    GLenum first = gl.GetError();
    if (first == GL_NO_ERROR)
        return SV_OK;
    for (int i = 0; i < 16 && gl.GetError() != GL_NO_ERROR; i++) {
    }
    return sv_fail(error, first == GL_OUT_OF_MEMORY ? SV_ENOMEM : SV_EINTERNAL, "gl", "%s in %s",
                   error_name(first), where);
}

const char *sv_gl_renderer_name(void)
{
    const char *name = gl.GetString ? (const char *)gl.GetString(GL_RENDERER) : NULL;
    return name ? name : "none";
}
