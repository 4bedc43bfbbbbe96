/* draw_sky.c - the sky: one triangle over the picture at depth 0 (infinity), drawn where nothing else was. */
#include "core/terrain/draw.h"

#include "core/gl/context.h"
#include "core/gl/functions.h"
#include "core/gl/program.h"

/* The sky has no object of its own: program and vertex array live as long as the process's context. */
static struct {
    unsigned made_for; /* sv_gl_context_generation */
    unsigned program;
    GLuint vertices;
} sky;

static enum sv_status prepare(struct sv_error *error)
{
    if (sky.made_for == sv_gl_context_generation())
        return SV_OK;
    enum sv_status status = sv_gl_program_create("sky.vert", "sky.frag", NULL, &sky.program, error);
    if (status)
        return status;
    gl.GenVertexArrays(1, &sky.vertices);
    sky.made_for = sv_gl_context_generation();
    return SV_OK;
}

enum sv_status sv_sky_draw(const struct sv_gl_frame *frame, struct sv_error *error)
{
    (void)frame; /* its uniform block is bound */
    enum sv_status status = prepare(error);
    if (status)
        return status;
    gl.Enable(GL_DEPTH_TEST);
    gl.DepthFunc(GL_EQUAL);
    gl.DepthMask(GL_FALSE);
    gl.Disable(GL_BLEND);
    gl.Disable(GL_CULL_FACE);
    gl.ColorMaski(1, GL_FALSE, GL_FALSE, GL_FALSE, GL_FALSE);
    gl.ColorMaski(2, GL_FALSE, GL_FALSE, GL_FALSE, GL_FALSE);
    gl.UseProgram(sky.program);
    gl.BindVertexArray(sky.vertices);
    gl.DrawArrays(GL_TRIANGLES, 0, 3);
    gl.BindVertexArray(0);
    gl.ColorMask(GL_TRUE, GL_TRUE, GL_TRUE, GL_TRUE);
    gl.DepthMask(GL_TRUE);
    gl.DepthFunc(GL_GREATER);
    return sv_gl_check("drawing the sky", error);
}
