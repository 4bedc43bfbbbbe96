/* program.c - joins embedded GLSL files, compiles, links, and puts the compiler's words into sv_error. */
#include "core/gl/program.h"

#include <stdbool.h>
#include <stdlib.h>
#include <string.h>

#include "core/gl/embedded.h"
#include "core/gl/functions.h"

enum { PIECES_MAX = 64 };

/* What glShaderSource takes: pieces of text with lengths; pieces point into embedded files, nothing is
 * copied. */
struct source {
    const char *text[PIECES_MAX];
    GLint length[PIECES_MAX];
    int count;
    const char *included[PIECES_MAX];
    int included_count;
};

const char *sv_gl_shader_text(const char *file)
{
    for (const struct sv_gl_embedded *e = sv_gl_embedded; e->name; e++)
        if (!strcmp(e->name, file))
            return e->text;
    return NULL;
}

static enum sv_status add_piece(struct source *source, const char *text, size_t length,
                                struct sv_error *error)
{
    if (source->count == PIECES_MAX)
        return sv_fail(error, SV_ELIMIT, "glsl", "a shader has more than %d pieces", PIECES_MAX);
    source->text[source->count] = text;
    source->length[source->count++] = (GLint)length;
    return SV_OK;
}

static bool was_included(struct source *source, const char *name)
{
    for (int i = 0; i < source->included_count; i++)
        if (!strcmp(source->included[i], name))
            return true;
    return false;
}

/* Adds text with its includes replaced, depth first, each file once. */
static enum sv_status add_text(struct source *source, const char *text, struct sv_error *error)
{
    static const char mark[] = "#include \"";
    const char *from = text;
    for (;;) {
        const char *at = strstr(from, mark);
        while (at && at != text && at[-1] != '\n')
            at = strstr(at + 1, mark);
        if (!at)
            return add_piece(source, from, strlen(from), error);
        const char *name_at = at + sizeof mark - 1, *end = strchr(name_at, '"');
        char name[64];
        if (!end || end - name_at >= (int)sizeof name)
            return sv_fail(error, SV_EFORMAT, "glsl", "broken #include line");
        memcpy(name, name_at, (size_t)(end - name_at));
        name[end - name_at] = 0;
        const char *file = sv_gl_shader_text(name);
        if (!file)
            return sv_fail(error, SV_ENOENT, name, "no embedded shader file of that name");
        enum sv_status status = add_piece(source, from, (size_t)(at - from), error);
        if (status)
            return status;
        if (!was_included(source, file)) {
            if (source->included_count == PIECES_MAX)
                return sv_fail(error, SV_ELIMIT, "glsl", "more than %d includes", PIECES_MAX);
            source->included[source->included_count++] = file;
            status = add_text(source, file, error);
            if (status)
                return status;
        }
        from = end + 1;
    }
}

static enum sv_status compile(GLenum stage, const char *name, const char *text, const char *defines,
                              GLuint *shader, struct sv_error *error)
{
    static const char version[] = "#version 450 core\n";
    struct source source = {.count = 0};
    enum sv_status status = add_piece(&source, version, sizeof version - 1, error);
    if (!status && defines)
        status = add_piece(&source, defines, strlen(defines), error);
    if (!status)
        status = add_text(&source, text, error);
    if (status)
        return status;
    GLuint made = gl.CreateShader(stage);
    GLint ok = 0;
    gl.ShaderSource(made, source.count, source.text, source.length);
    gl.CompileShader(made);
    gl.GetShaderiv(made, GL_COMPILE_STATUS, &ok);
    if (!ok) {
        char log[400] = "";
        gl.GetShaderInfoLog(made, sizeof log, NULL, log);
        gl.DeleteShader(made);
        return sv_fail(error, SV_EINTERNAL, name, "does not compile: %s", log);
    }
    *shader = made;
    return SV_OK;
}

static enum sv_status link_program(GLuint vertex, GLuint fragment, const char *name, unsigned *program,
                                   struct sv_error *error)
{
    GLuint made = gl.CreateProgram();
    GLint ok = 0;
    gl.AttachShader(made, vertex);
    gl.AttachShader(made, fragment);
    gl.LinkProgram(made);
    gl.GetProgramiv(made, GL_LINK_STATUS, &ok);
    if (!ok) {
        char log[400] = "";
        gl.GetProgramInfoLog(made, sizeof log, NULL, log);
        gl.DeleteProgram(made);
        return sv_fail(error, SV_EINTERNAL, name, "does not link: %s", log);
    }
    gl.DetachShader(made, vertex);
    gl.DetachShader(made, fragment);
    *program = made;
    return SV_OK;
}

struct stage {
    const char *name, *text;
};

static enum sv_status build(struct stage vert, struct stage frag, const char *defines, unsigned *program,
                            struct sv_error *error)
{
    GLuint vertex = 0, fragment = 0;
    enum sv_status status = compile(GL_VERTEX_SHADER, vert.name, vert.text, defines, &vertex, error);
    if (!status)
        status = compile(GL_FRAGMENT_SHADER, frag.name, frag.text, defines, &fragment, error);
    if (!status)
        status = link_program(vertex, fragment, frag.name, program, error);
    gl.DeleteShader(vertex);
    gl.DeleteShader(fragment);
    return status;
}

enum sv_status sv_gl_program_create(const char *vertex_file, const char *fragment_file, const char *defines,
                                    unsigned *program, struct sv_error *error)
{
    struct stage vert = {vertex_file, sv_gl_shader_text(vertex_file)};
    struct stage frag = {fragment_file, sv_gl_shader_text(fragment_file)};
    if (!vert.text || !frag.text)
        return sv_fail(error, SV_ENOENT, vert.text ? fragment_file : vertex_file,
                       "no embedded shader file of that name");
    return build(vert, frag, defines, program, error);
}

enum sv_status sv_gl_program_create_text(const char *vertex_text, const char *fragment_text,
                                         unsigned *program, struct sv_error *error)
{
    return build((struct stage){"vertex text", vertex_text}, (struct stage){"fragment text", fragment_text},
                 NULL, program, error);
}
