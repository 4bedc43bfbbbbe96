/* frame.h - what every drawing module needs to know of the view being drawn: one struct, one uniform block.
 *
 * The GLSL side is core/gl/shaders/frame.glsl (included by every shader), std140 block `frame` at binding 0.
 */
#ifndef SV_GL_FRAME_H
#define SV_GL_FRAME_H

#include "core/base/vec.h"
#include "core/scene/light.h"
#include "core/view/camera.h"

struct sv_gl_frame {
    struct sv_camera camera;
    struct sv_light light;
    double shift_x_px, shift_y_px; /* the sample inside the pixel */
    int row_first, row_count; /* of the picture, which are drawn (sv_gl_target_begin_rows); row_count 0: all */
    struct sv_mat4 clip_from_local;
    double planes[5][4];      /* of the whole picture, */
    double band_planes[5][4]; /* and of the rows */
};

/* Derives matrices and planes from camera, light and shift, and uploads the uniform block. */
SV_MUST_CHECK enum sv_status sv_gl_frame_begin(struct sv_gl_frame *frame, struct sv_error *error);

#endif
