/* draw_prewarp.c - see draw_prewarp.h.
 *
 * Near-plane clipping is off (GL_DEPTH_CLAMP): a texel behind the plane may be in front of the eye's near
 * plane where the relief's plane is not; the shader judges the texel's own depth. Colours are code values and
 * are written as such, so sRGB encoding is off while the plane is drawn. */
#include "core/relief/draw_prewarp.h"

#include <stdlib.h>
#include <string.h>

#include "core/gl/context.h"
#include "core/gl/functions.h"
#include "core/gl/program.h"

enum { UNIT_COLOR, UNIT_DISPL, UNIT_NORMAL, UNITS };
enum { AT_CORNER, AT_SIDE_U, AT_SIDE_V, AT_FACING, AT_DEPTH, AT_ID }; /* uniforms of relief_plane.* */
static const float EMPTY = 3e38f;                                     /* relief_plane.frag has the same */

static const struct {
    GLenum internal, format, type;
} kinds[UNITS] = {[UNIT_COLOR] = {GL_RGBA8, GL_RGBA, GL_UNSIGNED_BYTE},
                  [UNIT_DISPL] = {GL_R32F, GL_RED, GL_FLOAT},
                  [UNIT_NORMAL] = {GL_RGBA16_SNORM, GL_RGBA, GL_SHORT}};

struct sv_prewarp_draw {
    GLuint program, array, textures[UNITS];
    int size[UNITS][2]; /* of each texture; 0: none */
    bool has_normals;
    double u0, v0, u1, v1;
    void *staging; /* heap: 8 bytes a sample */
    size_t staging_bytes;
};

enum sv_status sv_prewarp_draw_create(struct sv_prewarp_draw **draw, struct sv_error *error)
{
    struct sv_prewarp_draw *made = calloc(1, sizeof *made);
    if (!made)
        return sv_fail(error, SV_ENOMEM, "prewarp", "no memory");
    enum sv_status status =
        sv_gl_program_create("relief_plane.vert", "relief_plane.frag", NULL, &made->program, error);
    if (status) {
        free(made);
        return status;
    }
    gl.GenVertexArrays(1, &made->array);
    gl.GenTextures(UNITS, made->textures);
    for (int k = 0; k < UNITS; k++) {
        gl.BindTexture(GL_TEXTURE_2D, made->textures[k]);
        gl.TexParameteri(GL_TEXTURE_2D, GL_TEXTURE_MIN_FILTER, GL_NEAREST);
        gl.TexParameteri(GL_TEXTURE_2D, GL_TEXTURE_MAG_FILTER, GL_NEAREST);
        gl.TexParameteri(GL_TEXTURE_2D, GL_TEXTURE_WRAP_S, GL_CLAMP_TO_EDGE);
        gl.TexParameteri(GL_TEXTURE_2D, GL_TEXTURE_WRAP_T, GL_CLAMP_TO_EDGE);
    }
    status = sv_gl_check("preparing pre-warped planes", error);
    if (status)
        sv_prewarp_draw_destroy(made);
    else
        *draw = made;
    return status;
}

void sv_prewarp_draw_destroy(struct sv_prewarp_draw *draw)
{
    if (!draw)
        return;
    gl.DeleteTextures(UNITS, draw->textures);
    gl.DeleteVertexArrays(1, &draw->array);
    gl.DeleteProgram(draw->program);
    free(draw->staging);
    free(draw);
}

static void put(struct sv_prewarp_draw *draw, int unit, int width, int height, const void *data)
{
    gl.ActiveTexture(GL_TEXTURE0 + (GLenum)unit);
    gl.BindTexture(GL_TEXTURE_2D, draw->textures[unit]);
    if (draw->size[unit][0] == width && draw->size[unit][1] == height) {
        gl.TexSubImage2D(GL_TEXTURE_2D, 0, 0, 0, width, height, kinds[unit].format, kinds[unit].type, data);
        return;
    }
    gl.TexImage2D(GL_TEXTURE_2D, 0, (GLint)kinds[unit].internal, width, height, 0, kinds[unit].format,
                  kinds[unit].type, data);
    draw->size[unit][0] = width;
    draw->size[unit][1] = height;
}

/* World normals of the samples. */
static void stage_normals(const struct sv_relief *r, const struct sv_warped *w, int16_t (*out)[4])
{
    struct sv_vec3 a = sv_normalize(r->frame.a), b = sv_normalize(r->frame.b), f = r->frame.f;
    size_t n = (size_t)w->width * (size_t)w->height;
    memset(out, 0, n * sizeof *out);
    for (size_t k = 0; k < n; k++) {
        if (w->texel[k] == SV_WARPED_NONE)
            continue;
        const int16_t *m = r->normal[w->texel[k]];
        struct sv_vec3 v = sv_madd(sv_madd(sv_scale(a, m[0]), b, m[1]), f, m[2]);
        out[k][0] = (int16_t)sv_clamp(v.x, -32767, 32767);
        out[k][1] = (int16_t)sv_clamp(v.y, -32767, 32767);
        out[k][2] = (int16_t)sv_clamp(v.z, -32767, 32767);
    }
}

static enum sv_status reserve(struct sv_prewarp_draw *draw, size_t bytes, struct sv_error *error)
{
    if (bytes <= draw->staging_bytes)
        return SV_OK;
    free(draw->staging);
    draw->staging = malloc(bytes);
    draw->staging_bytes = draw->staging ? bytes : 0;
    return draw->staging ? SV_OK : sv_fail(error, SV_ENOMEM, "prewarp", "no memory for %zu bytes", bytes);
}

enum sv_status sv_prewarp_draw_upload(struct sv_prewarp_draw *draw, const struct sv_warped *w,
                                      const struct sv_relief *relief, struct sv_error *error)
{
    GLint side = 0;
    size_t n = (size_t)w->width * (size_t)w->height;
    gl.GetIntegerv(GL_MAX_TEXTURE_SIZE, &side);
    if (w->width > side || w->height > side)
        return sv_fail(error, SV_ELIMIT, "prewarp", "%d x %d samples: GL takes %d a side", w->width,
                       w->height, side);
    draw->has_normals = relief && relief->normal;
    enum sv_status status = reserve(draw, n * (draw->has_normals ? 8 : 4), error);
    if (status)
        return status;
    gl.PixelStorei(GL_UNPACK_ALIGNMENT, 4);
    if (draw->has_normals) {
        stage_normals(relief, w, draw->staging);
        put(draw, UNIT_NORMAL, w->width, w->height, draw->staging);
    }
    float *displ = draw->staging;
    for (size_t k = 0; k < n; k++)
        displ[k] = w->color[k][3] ? w->displ[k] : EMPTY;
    put(draw, UNIT_DISPL, w->width, w->height, displ);
    put(draw, UNIT_COLOR, w->width, w->height, w->color);
    draw->u0 = w->u0;
    draw->v0 = w->v0;
    draw->u1 = w->u1;
    draw->v1 = w->v1;
    return sv_gl_check("uploading a pre-warped texture", error);
}

static void set_vec(GLint at, struct sv_vec3 v)
{
    gl.Uniform3f(at, (float)v.x, (float)v.y, (float)v.z);
}

enum sv_status sv_prewarp_draw_plane(struct sv_prewarp_draw *draw, const struct sv_gl_frame *frame,
                                     const struct sv_prewarp_plane *plane, struct sv_error *error)
{
    const struct sv_relief_frame *f = plane->frame;
    bool parallel = frame->camera.projection == SV_PROJECTION_ORTHOGRAPHIC;
    struct sv_vec3 c = sv_sub(f->origin, frame->camera.eye); /* in double: small beside world coordinates */
    double across = sv_dot(parallel ? frame->camera.forward : c, f->f);
    if (draw->size[UNIT_COLOR][0] == 0)
        return sv_fail(error, SV_EINVAL, "prewarp", "no texture was uploaded");
    if (!isnormal(1 / across) || !isnormal((float)(1 / across)))
        return sv_fail(error, SV_EINVAL, "camera", "the eye lies in the relief's plane (%g m from it)",
                       across);
    gl.UseProgram(draw->program);
    set_vec(AT_CORNER, sv_madd(sv_madd(c, f->a, draw->u0), f->b, draw->v0));
    set_vec(AT_SIDE_U, sv_scale(f->a, draw->u1 - draw->u0));
    set_vec(AT_SIDE_V, sv_scale(f->b, draw->v1 - draw->v0));
    set_vec(AT_FACING, f->f);
    gl.Uniform4f(AT_DEPTH, (float)(1 / across), plane->cut, draw->has_normals ? 1 : 0, 0);
    gl.Uniform1ui(AT_ID, plane->id);
    for (int k = 0; k < UNITS; k++) {
        gl.ActiveTexture(GL_TEXTURE0 + (GLenum)k);
        gl.BindTexture(GL_TEXTURE_2D, draw->textures[k]);
    }
    gl.ActiveTexture(GL_TEXTURE0);
    gl.Disable(GL_CULL_FACE);
    gl.Disable(GL_FRAMEBUFFER_SRGB);
    gl.Enable(GL_DEPTH_CLAMP);
    gl.BindVertexArray(draw->array);
    gl.DrawArrays(GL_TRIANGLE_STRIP, 0, 4);
    gl.BindVertexArray(0);
    gl.Disable(GL_DEPTH_CLAMP);
    gl.Enable(GL_FRAMEBUFFER_SRGB);
    return sv_gl_check("drawing a pre-warped plane", error);
}
