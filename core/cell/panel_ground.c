/* panel_ground.c - see panel_ground.h. */
#include "core/cell/panel_ground.h"

#include <math.h>

struct sv_camera sv_panel_ground_camera(const struct sv_sweep *sweep)
{
    struct sv_camera camera = {.eye = sweep->v,
                               .projection = SV_PROJECTION_PERSPECTIVE,
                               .vfov_rad = 2 * atan(sweep->reach),
                               .width = sweep->size,
                               .height = sweep->size,
                               .near_m = sweep->distance_m};
    sv_cell_face_axes(sweep->face, &camera.right, &camera.up, &camera.forward);
    return camera;
}

/* Row of clip_from_local applied to q (V - eye) + D (xs right + ys up + forward), with q for its fourth
 * component: the point times q. */
static void map_row(const struct sv_sweep *sweep, const struct sv_camera *face, struct sv_vec3 v,
                    const double clip[4], double row[4])
{
    struct sv_vec3 c = sv_vec3(clip[0], clip[1], clip[2]);
    double d = sweep->distance_m, half = d * sweep->reach, texel = 2 * half / sweep->size;
    row[0] = texel * sv_dot(c, face->right);
    row[1] = -texel * sv_dot(c, face->up);
    row[2] = sv_dot(c, v) + clip[3];
    row[3] = d * sv_dot(c, face->forward) + half * sv_dot(c, sv_sub(face->up, face->right));
}

void sv_panel_ground_map(const struct sv_sweep *sweep, const struct sv_camera *camera, double shift_x_px,
                         double shift_y_px, struct sv_warp_map *map)
{
    struct sv_mat4 clip;
    double row[4][4];
    struct sv_camera face = sv_panel_ground_camera(sweep);
    sv_camera_clip_from_local(camera, shift_x_px, shift_y_px, &clip);
    for (int k = 0; k < 4; k++)
        map_row(sweep, &face, sv_sub(sweep->v, camera->eye), clip.m[k], row[k]);
    for (int k = 0; k < 4; k++) {
        map->m[0][k] = 0.5 * camera->width * (row[3][k] + row[0][k]);
        map->m[1][k] = 0.5 * camera->height * (row[3][k] - row[1][k]);
        map->m[2][k] = row[2][k];
        map->m[3][k] = row[3][k];
    }
}

void sv_panel_ground_make(const struct sv_panel_ground_options *options, float *q, uint8_t (*color)[4])
{
    struct sv_camera camera = sv_panel_ground_camera(&options->sweep);
    struct sv_ground_view view = {.camera = &camera,
                                  .light = options->light,
                                  .shift_x_px = options->sweep.shift_x,
                                  .shift_y_px = options->sweep.shift_y,
                                  .shadows = options->shadows,
                                  .depth = q};
    sv_sweep(&options->sweep, q);
    sv_ground_shade(options->ground, &view, &color[0][0]);
}
