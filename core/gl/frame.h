/* frame.h - what every drawing module needs to know of the view being drawn: one struct, one uniform block.
 *
 * The GLSL side is core/gl/shaders/frame.glsl (included by every shader), std140 block `frame` at binding 0.
 */
#ifndef SV_GL_FRAME_H
#define SV_GL_FRAME_H

#include "core/base/vec.h"
#include "core/scene/light.h"
#include "core/view/camera.h"

enum { SV_GL_SHADOW_WINDOWS = 6, SV_GL_SHADOW_SIDE = 1024 };

/* Sunlight on the ground, as core/terrain/draw_shadow.h made it: layers of an R8 texture array, each over a
 * square, SV_GL_SHADOW_SIDE texels a side, the coarsest first. */
struct sv_gl_shadows {
    unsigned texture;
    int count;
    struct sv_gl_shadow_window {
        double x0, y0, side_m; /* world place of the south-west corner */
        int layer;
    } window[SV_GL_SHADOW_WINDOWS];
};

struct sv_gl_frame {
    struct sv_camera camera;
    struct sv_light light;
    double shift_x_px, shift_y_px; /* the sample inside the pixel */
    struct sv_mat4 clip_from_local;
    double planes[5][4];
    const struct sv_gl_shadows *shadows; /* borrowed; NULL: the ground is drawn without shadows */
};

/* Derives matrices and planes from camera, light and shift, and uploads the uniform block. */
SV_MUST_CHECK enum sv_status sv_gl_frame_begin(struct sv_gl_frame *frame, struct sv_error *error);

#endif
