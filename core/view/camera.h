/* camera.h - a resolved camera: where it stands, where it looks, and its matrices. Plain values, no scene. */
#ifndef SV_VIEW_CAMERA_H
#define SV_VIEW_CAMERA_H

#include "core/base/vec.h"
#include "core/view/request.h"

struct sv_camera {
    struct sv_vec3 eye;                /* world */
    struct sv_vec3 right, up, forward; /* unit, world axes; right x up = -forward (frames.h) */
    enum sv_projection projection;
    double vfov_rad;       /* perspective */
    double ortho_height_m; /* orthographic: the picture's height */
    int width, height;     /* px */
    double near_m; /* perspective near plane, m; orthographic: what lies behind the eye's plane is cut */
    double far_m;  /* orthographic only */
};

/* Axes from heading (clockwise from grid north), pitch (up positive) and roll (positive lowers the right
 * side), radians. Any finite input; pitch of +-pi/2 keeps heading as the picture's up direction (down) or its
 * opposite (up). */
void sv_camera_aim(struct sv_camera *camera, double heading_rad, double pitch_rad, double roll_rad);

/* clip_from_local for GL: local = world - eye (world axes). Row 0 at the top by GL_UPPER_LEFT, depth reversed
 * (perspective infinite: d = near / Z; orthographic: d = (far - Z) / far). shift_px moves the picture's
 * content: sample offset (sx, sy) in px, each in (-0.5, 0.5), x right, y down, is where inside the pixel the
 * sample lies relative to its centre. */
void sv_camera_clip_from_local(const struct sv_camera *camera, double shift_x_px, double shift_y_px,
                               struct sv_mat4 *clip_from_local);

/* The ray of picture position (px, py) (pixel centres at + 0.5), eye-relative: origin (0 for perspective) and
 * a direction with direction . forward = 1, so that its parameter is depth Z in metres. */
void sv_camera_ray(const struct sv_camera *camera, double px, double py, struct sv_vec3 *origin,
                   struct sv_vec3 *direction);

/* Picture position and depth of a world point; false, with nothing written, when it is not in front (Z <
 * near_m; orthographic: Z < 0) or NaN. */
bool sv_camera_project(const struct sv_camera *camera, struct sv_vec3 world, double *px, double *py,
                       double *depth_m);

/* Focal length in px of a perspective camera: (height / 2) / tan(vfov / 2). For orthographic: px per metre.
 */
double sv_camera_focal_px(const struct sv_camera *camera);

/* The five side planes of the view volume as (a, b, c, d), a x + b y + c z + d >= 0 inside, in local
 * (eye-relative) coordinates, normals of unit length: left, right, top, bottom, near (orthographic: the eye's
 * plane). The four sides stand half a pixel outside the picture, so that they hold for every sample shift. */
void sv_camera_planes(const struct sv_camera *camera, double planes[5][4]);
/* The same of rows row_first .. row_end - 1 alone: top and bottom stand half a pixel outside of these. */
void sv_camera_band_planes(const struct sv_camera *camera, int row_first, int row_end, double planes[5][4]);

/* Where the samples of one pixel lie, relative to its centre: the table that raster and ray casting share.
 * count is 1, 4, 16 or 64; offset k in px. One sample is the centre; others a jittered stratified pattern,
 * fixed. */
void sv_camera_sample_offset(int count, int k, double *dx_px, double *dy_px);

#endif
