/* panel_ground.c - see panel_ground.h. */
#include "core/cell/panel_ground.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "core/base/color.h"

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

static void shade(const struct sv_panel_ground_options *o, const struct sv_camera *camera, double shift_x,
                  double shift_y, const float *q, uint8_t (*color)[4])
{
    struct sv_ground_view view = {.camera = camera,
                                  .light = o->light,
                                  .shift_x_px = shift_x,
                                  .shift_y_px = shift_y,
                                  .shadows = o->shadows,
                                  .depth = q};
    sv_ground_shade(o->ground, &view, &color[0][0]);
}

/* Samples of other surfaces: of use only where there is no sample of the texel's own. */
#define OTHER_SHARE 1e-6f

static void gather(const float *q, const float *sample_q, const uint8_t (*sample)[4], size_t count, float cut,
                   float (*sum)[4])
{
    for (size_t k = 0; k < count; k++) {
        if (!(sample_q[k] > 0))
            continue;
        float share = fabsf(sample_q[k] - q[k]) <= cut ? 1 : OTHER_SHARE;
        for (int c = 0; c < 3; c++)
            sum[k][c] += share * sv_linear_from_srgb8[sample[k][c]];
        sum[k][3] += share;
    }
}

static void settle(size_t count, const float (*sum)[4], float *q, uint8_t (*color)[4])
{
    for (size_t k = 0; k < count; k++) {
        bool some = q[k] > 0 && sum[k][3] > 0;
        float scale = some ? 1 / sum[k][3] : 0;
        q[k] = some ? q[k] : 0;
        for (int c = 0; c < 3; c++)
            color[k][c] = some ? sv_srgb8_from_linear(sum[k][c] * scale) : 0;
        color[k][3] = some ? 255 : 0;
    }
}

enum sv_status sv_panel_ground_make(const struct sv_panel_ground_options *options, float *q,
                                    uint8_t (*color)[4], struct sv_error *error)
{
    struct sv_sweep sweep = options->sweep;
    struct sv_camera camera = sv_panel_ground_camera(&sweep);
    size_t n = (size_t)sweep.size * (size_t)sweep.size;
    sweep.shift_x = sweep.shift_y = 0;
    sv_sweep(&sweep, q);
    if (options->samples <= 1) {
        shade(options, &camera, 0, 0, q, color);
        return SV_OK;
    }
    float(*sum)[4] = calloc(n, sizeof *sum), *sample_q = malloc(n * sizeof *sample_q);
    if (!sum || !sample_q) {
        free(sum);
        free(sample_q);
        return sv_fail(error, SV_ENOMEM, NULL, "no memory for a panel of %d x %d texels", sweep.size,
                       sweep.size);
    }
    sv_color_init();
    for (int k = 0; k < 4; k++) {
        sweep.shift_x = k & 1 ? 0.25 : -0.25;
        sweep.shift_y = k & 2 ? 0.25 : -0.25;
        sv_sweep(&sweep, sample_q);
        shade(options, &camera, sweep.shift_x, sweep.shift_y, sample_q, color);
        gather(q, sample_q, (const uint8_t(*)[4])color, n, options->cut, sum);
    }
    settle(n, (const float(*)[4])sum, q, color);
    free(sum);
    free(sample_q);
    return SV_OK;
}
