/* target.c - the framebuffer object behind target.h. Renderbuffers, but for colour, which is a texture so
 * that it can be written; nobody samples it. */
#include "core/gl/target.h"

#include <stdlib.h>

#include "core/gl/context.h"
#include "core/gl/functions.h"

enum { TARGET_SIDE_MAX = 16384 };

struct sv_gl_target {
    int width, height;
    unsigned layers;
    GLuint framebuffer;
    GLuint buffers[SV_LAYER_COUNT]; /* 0: not attached */
};

/* One row a layer: how it is stored, where attached, and how it is read. */
static const struct layer_format {
    GLenum storage, attachment, read_format, read_type;
    int output; /* fragment output location; -1: depth */
    int channels;
    enum sv_pixel_type type;
} formats[SV_LAYER_COUNT] = {
    [SV_LAYER_COLOR] = {GL_SRGB8_ALPHA8, GL_COLOR_ATTACHMENT0, GL_RGBA, GL_UNSIGNED_BYTE, 0, 4, SV_PIXEL_U8},
    [SV_LAYER_ID] = {GL_R32UI, GL_COLOR_ATTACHMENT1, GL_RED_INTEGER, GL_UNSIGNED_INT, 1, 1, SV_PIXEL_U32},
    [SV_LAYER_NORMAL] = {GL_RGBA16F, GL_COLOR_ATTACHMENT2, GL_RGB, GL_FLOAT, 2, 3, SV_PIXEL_F32},
    [SV_LAYER_DEPTH] = {GL_DEPTH_COMPONENT32F, GL_DEPTH_ATTACHMENT, GL_DEPTH_COMPONENT, GL_FLOAT, -1, 1,
                        SV_PIXEL_F32},
};

static void attach(struct sv_gl_target *target, enum sv_layer layer)
{
    const struct layer_format *f = &formats[layer];
    if (layer == SV_LAYER_COLOR) {
        gl.GenTextures(1, &target->buffers[layer]);
        gl.BindTexture(GL_TEXTURE_2D, target->buffers[layer]);
        gl.TexStorage2D(GL_TEXTURE_2D, 1, f->storage, target->width, target->height);
        gl.BindTexture(GL_TEXTURE_2D, 0);
        gl.FramebufferTexture2D(GL_FRAMEBUFFER, f->attachment, GL_TEXTURE_2D, target->buffers[layer], 0);
        return;
    }
    gl.GenRenderbuffers(1, &target->buffers[layer]);
    gl.BindRenderbuffer(GL_RENDERBUFFER, target->buffers[layer]);
    gl.RenderbufferStorage(GL_RENDERBUFFER, f->storage, target->width, target->height);
    gl.FramebufferRenderbuffer(GL_FRAMEBUFFER, f->attachment, GL_RENDERBUFFER, target->buffers[layer]);
}

static void set_draw_buffers(const struct sv_gl_target *target)
{
    GLenum draw[3] = {GL_NONE, GL_NONE, GL_NONE};
    for (int layer = 0; layer < SV_LAYER_COUNT; layer++)
        if (target->buffers[layer] && formats[layer].output >= 0)
            draw[formats[layer].output] = formats[layer].attachment;
    gl.DrawBuffers(3, draw);
}

enum sv_status sv_gl_target_create(int width, int height, unsigned layers, struct sv_gl_target **target,
                                   struct sv_error *error)
{
    if (width < 1 || height < 1 || width > TARGET_SIDE_MAX || height > TARGET_SIDE_MAX)
        return sv_fail(error, SV_EINVAL, "target", "%d x %d px is outside 1 .. %d a side", width, height,
                       TARGET_SIDE_MAX);
    struct sv_gl_target *made = calloc(1, sizeof *made);
    if (!made)
        return sv_fail(error, SV_ENOMEM, "target", "no memory for a framebuffer");
    made->width = width;
    made->height = height;
    made->layers = layers | 1u << SV_LAYER_DEPTH;
    gl.GenFramebuffers(1, &made->framebuffer);
    gl.BindFramebuffer(GL_FRAMEBUFFER, made->framebuffer);
    for (int layer = 0; layer < SV_LAYER_COUNT; layer++)
        if (made->layers >> layer & 1u)
            attach(made, (enum sv_layer)layer);
    set_draw_buffers(made);
    GLenum complete = gl.CheckFramebufferStatus(GL_FRAMEBUFFER);
    enum sv_status status = sv_gl_check("target creation", error);
    if (!status && complete != GL_FRAMEBUFFER_COMPLETE)
        status = sv_fail(error, SV_EUNSUPPORTED, "target",
                         "a framebuffer of %d x %d px is not complete (0x%x)", width, height, complete);
    if (status) {
        sv_gl_target_destroy(made);
        return status;
    }
    *target = made;
    return SV_OK;
}

void sv_gl_target_destroy(struct sv_gl_target *target)
{
    if (!target)
        return;
    for (int layer = 0; layer < SV_LAYER_COUNT; layer++)
        if (target->buffers[layer] && layer == SV_LAYER_COLOR)
            gl.DeleteTextures(1, &target->buffers[layer]);
        else if (target->buffers[layer])
            gl.DeleteRenderbuffers(1, &target->buffers[layer]);
    gl.DeleteFramebuffers(1, &target->framebuffer);
    free(target);
}

void sv_gl_target_begin(struct sv_gl_target *target)
{
    static const GLfloat zero[4] = {0, 0, 0, 0};
    static const GLuint zero_id[4] = {0, 0, 0, 0};
    gl.BindFramebuffer(GL_FRAMEBUFFER, target->framebuffer);
    set_draw_buffers(target);
    gl.Viewport(0, 0, target->width, target->height);
    gl.Disable(GL_SCISSOR_TEST);
    gl.Disable(GL_BLEND);
    gl.Disable(GL_CULL_FACE);
    gl.Enable(GL_FRAMEBUFFER_SRGB);
    gl.Enable(GL_DEPTH_TEST);
    gl.DepthFunc(GL_GREATER);
    gl.DepthMask(GL_TRUE);
    gl.ColorMask(GL_TRUE, GL_TRUE, GL_TRUE, GL_TRUE);
    if (target->buffers[SV_LAYER_COLOR])
        gl.ClearBufferfv(GL_COLOR, 0, zero);
    if (target->buffers[SV_LAYER_ID])
        gl.ClearBufferuiv(GL_COLOR, 1, zero_id);
    if (target->buffers[SV_LAYER_NORMAL])
        gl.ClearBufferfv(GL_COLOR, 2, zero);
    gl.ClearBufferfv(GL_DEPTH, 0, zero);
}

/* Clearing all costs less than clearing through scissors. The window's origin is the picture's upper left corner
 * (context.h), so that rows count downwards. */
void sv_gl_target_begin_rows(struct sv_gl_target *target, int row_first, int row_count)
{
    sv_gl_target_begin(target);
    if (row_first == 0 && row_count == target->height)
        return;
    gl.Enable(GL_SCISSOR_TEST);
    gl.Scissor(0, row_first, target->width, row_count);
}

static bool holds_rows(const struct sv_gl_target *target, enum sv_layer layer, int row_first,
                       const struct sv_image *image)
{
    const struct layer_format *f = &formats[layer];
    return image->width == target->width && row_first >= 0 && image->height >= 1 &&
           image->height <= target->height - row_first && image->channels == f->channels && image->type == f->type;
}

enum sv_status sv_gl_target_read_rows(struct sv_gl_target *target, enum sv_layer layer, int row_first,
                                      struct sv_image *out, struct sv_error *error)
{
    if (layer < 0 || layer >= SV_LAYER_COUNT || !target->buffers[layer])
        return sv_fail(error, SV_EINVAL, "target", "the framebuffer has no layer %d", (int)layer);
    const struct layer_format *f = &formats[layer];
    if (!holds_rows(target, layer, row_first, out))
        return sv_fail(error, SV_EINVAL, "target",
                       "the image to read into is %d x %d x %d from row %d on, the framebuffer %d x %d x %d", out->width,
                       out->height, out->channels, row_first, target->width, target->height, f->channels);
    gl.BindFramebuffer(GL_FRAMEBUFFER, target->framebuffer);
    if (f->output >= 0)
        gl.ReadBuffer(f->attachment);
    gl.ReadPixels(0, row_first, out->width, out->height, f->read_format, f->read_type, out->data);
    return sv_gl_check("reading a target", error);
}

static enum sv_status check_whole(const struct sv_gl_target *target, const struct sv_image *image,
                                  struct sv_error *error)
{
    return image->height == target->height ? SV_OK
                                           : sv_fail(error, SV_EINVAL, "target", "the image has %d rows, not %d",
                                                     image->height, target->height);
}

enum sv_status sv_gl_target_read(struct sv_gl_target *target, enum sv_layer layer, struct sv_image *out,
                                 struct sv_error *error)
{
    enum sv_status status = check_whole(target, out, error);
    return status ? status : sv_gl_target_read_rows(target, layer, 0, out, error);
}

enum sv_status sv_gl_target_write(struct sv_gl_target *target, const struct sv_image *color,
                                  struct sv_error *error)
{
    enum sv_status status = check_whole(target, color, error);
    return status ? status : sv_gl_target_write_rows(target, 0, color, error);
}

enum sv_status sv_gl_target_write_rows(struct sv_gl_target *target, int row_first, const struct sv_image *color,
                                       struct sv_error *error)
{
    const struct layer_format *f = &formats[SV_LAYER_COLOR];
    if (!target->buffers[SV_LAYER_COLOR] || !holds_rows(target, SV_LAYER_COLOR, row_first, color))
        return sv_fail(error, SV_EINVAL, "target",
                       "an image of %d x %d x %d from row %d on is not this framebuffer's colour", color->width,
                       color->height, color->channels, row_first);
    gl.ActiveTexture(GL_TEXTURE0);
    gl.BindTexture(GL_TEXTURE_2D, target->buffers[SV_LAYER_COLOR]);
    gl.TexSubImage2D(GL_TEXTURE_2D, 0, 0, row_first, color->width, color->height, f->read_format, f->read_type,
                     color->data);
    gl.BindTexture(GL_TEXTURE_2D, 0);
    return sv_gl_check("writing a target", error);
}
