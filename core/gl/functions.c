/* functions.c - loads the table of GL entry points and does what is the same for every kind of context:
 * checks the version, fixes the clip control, turns GL errors into sv_error. */
#include "core/gl/functions.h"

#include <stddef.h>
#include <string.h>

#include "core/gl/setup.h"

struct sv_gl_functions gl;

static const struct {
    const char *name;
    size_t offset;
} entries[] = {
#define X(type, name) {"gl" #name, offsetof(struct sv_gl_functions, name)},
    SV_GL_FUNCTION_LIST(X)
#undef X
};

enum sv_status sv_gl_functions_load(sv_gl_lookup lookup, struct sv_error *error)
{
    for (size_t i = 0; i < sizeof entries / sizeof entries[0]; i++) {
        sv_gl_proc proc = lookup(entries[i].name);
        if (!proc)
            return sv_fail(error, SV_EUNSUPPORTED, "gl", "the GL library has no %s (GL 4.5 core is needed)",
                           entries[i].name);
        memcpy((char *)&gl + entries[i].offset, &proc, sizeof proc);
    }
    return SV_OK;
}
