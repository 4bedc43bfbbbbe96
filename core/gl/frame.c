/* frame.c - from camera, light and shift to matrices, planes and the uniform block that every shader reads.
 */
#include "core/gl/frame.h"

#include <string.h>

#include "core/gl/context.h"
#include "core/gl/functions.h"

enum { FRAME_BINDING = 0 };

/* std140 twin of shaders/frame.glsl: vec4 and mat4 only, so that both sides agree without padding rules. */
struct frame_block {
    float clip_from_local[16];
    float right[4], up[4], forward[4];
    float picture[4];    /* width, height px, shift x, y px */
    float projection[4]; /* 1: orthographic; focal px (px per metre); near m; far m */
    float to_sun[4], sun_rgb[4], sky_rgb[4], ground_rgb[4], zenith_rgb[4], horizon_rgb[4];
    float air_rgb[4]; /* w: 1 / air_length_m, 0 when the air is off */
};

static void put_vec(float out[4], struct sv_vec3 v)
{
    out[0] = (float)v.x;
    out[1] = (float)v.y;
    out[2] = (float)v.z;
    out[3] = 0;
}

static void put_rgb(float out[4], const float rgb[3])
{
    memcpy(out, rgb, 3 * sizeof(float));
    out[3] = 0;
}

static void fill_camera(const struct sv_gl_frame *frame, struct frame_block *block)
{
    const struct sv_camera *c = &frame->camera;
    sv_mat4_to_float(&frame->clip_from_local, block->clip_from_local);
    put_vec(block->right, c->right);
    put_vec(block->up, c->up);
    put_vec(block->forward, c->forward);
    block->picture[0] = (float)c->width;
    block->picture[1] = (float)c->height;
    block->picture[2] = (float)frame->shift_x_px;
    block->picture[3] = (float)frame->shift_y_px;
    block->projection[0] = c->projection == SV_PROJECTION_ORTHOGRAPHIC ? 1 : 0;
    block->projection[1] = (float)sv_camera_focal_px(c);
    block->projection[2] = (float)c->near_m;
    block->projection[3] = (float)c->far_m;
}

static void fill_light(const struct sv_light *light, struct frame_block *block)
{
    put_vec(block->to_sun, light->to_sun);
    put_rgb(block->sun_rgb, light->sun_rgb);
    put_rgb(block->sky_rgb, light->sky_rgb);
    put_rgb(block->ground_rgb, light->ground_rgb);
    put_rgb(block->zenith_rgb, light->zenith_rgb);
    put_rgb(block->horizon_rgb, light->horizon_rgb);
    put_rgb(block->air_rgb, light->air_rgb);
    block->air_rgb[3] = light->air ? 1.0f / light->air_length_m : 0;
}

/* The one buffer of this process's context; a new context (tests) gets a new one. */
static GLuint frame_buffer(void)
{
    static GLuint buffer;
    static unsigned made_for;
    if (made_for != sv_gl_context_generation()) {
        gl.GenBuffers(1, &buffer);
        made_for = sv_gl_context_generation();
    }
    return buffer;
}

enum sv_status sv_gl_frame_begin(struct sv_gl_frame *frame, struct sv_error *error)
{
    struct frame_block block;
    sv_camera_clip_from_local(&frame->camera, frame->shift_x_px, frame->shift_y_px, &frame->clip_from_local);
    sv_camera_planes(&frame->camera, frame->planes);
    int end = frame->row_count > 0 ? frame->row_first + frame->row_count : frame->camera.height;
    sv_camera_band_planes(&frame->camera, frame->row_count > 0 ? frame->row_first : 0, end, frame->band_planes);
    fill_camera(frame, &block);
    fill_light(&frame->light, &block);
    gl.BindBuffer(GL_UNIFORM_BUFFER, frame_buffer());
    gl.BufferData(GL_UNIFORM_BUFFER, sizeof block, &block, GL_DYNAMIC_DRAW);
    gl.BindBufferBase(GL_UNIFORM_BUFFER, FRAME_BINDING, frame_buffer());
    return sv_gl_check("frame begin", error);
}
