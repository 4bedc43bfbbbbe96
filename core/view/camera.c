/* camera.c - axes, matrices, rays and planes of a resolved camera; the reflection between (right, up,
 * forward) and clip space is in sv_camera_clip_from_local and nowhere else. */
#include "core/view/camera.h"

#include <assert.h>
#include <stdint.h>

void sv_camera_aim(struct sv_camera *camera, double heading_rad, double pitch_rad, double roll_rad)
{
    double ch = cos(heading_rad), sh = sin(heading_rad), cp = cos(pitch_rad), sp = sin(pitch_rad);
    double cr = cos(roll_rad), sr = sin(roll_rad);
    struct sv_vec3 level = sv_vec3(ch, -sh, 0);
    struct sv_vec3 above = sv_vec3(-sp * sh, -sp * ch, cp); /* level x forward */
    camera->forward = sv_vec3(cp * sh, cp * ch, sp);
    camera->right = sv_normalize(sv_madd(sv_scale(level, cr), above, -sr));
    camera->up = sv_normalize(sv_madd(sv_scale(above, cr), level, sr));
}

static int is_orthographic(const struct sv_camera *camera)
{
    return camera->projection == SV_PROJECTION_ORTHOGRAPHIC;
}

double sv_camera_focal_px(const struct sv_camera *camera)
{
    return is_orthographic(camera) ? camera->height / camera->ortho_height_m
                                   : 0.5 * camera->height / tan(0.5 * camera->vfov_rad);
}

static void set_row(struct sv_mat4 *m, int row, struct sv_vec3 v, double w)
{
    m->m[row][0] = v.x;
    m->m[row][1] = v.y;
    m->m[row][2] = v.z;
    m->m[row][3] = w;
}

/* With X, Y, Z along right, up, forward and f the focal length in px, a point is drawn at px = w/2 + f X/Z -
 * sx, py = h/2 - f Y/Z - sy, which must be (1 + x/w_clip) w/2 and (1 - y/w_clip) h/2 (window origin upper
 * left). */
void sv_camera_clip_from_local(const struct sv_camera *camera, double shift_x_px, double shift_y_px,
                               struct sv_mat4 *clip_from_local)
{
    double f = sv_camera_focal_px(camera), sx = 2.0 / camera->width, sy = 2.0 / camera->height;
    double ox = -shift_x_px * sx, oy = shift_y_px * sy;
    struct sv_vec3 x = sv_scale(camera->right, f * sx), y = sv_scale(camera->up, f * sy), z = camera->forward;
    if (is_orthographic(camera)) {
        set_row(clip_from_local, 0, x, ox);
        set_row(clip_from_local, 1, y, oy);
        set_row(clip_from_local, 2, sv_scale(z, -1.0 / camera->far_m), 1);
        set_row(clip_from_local, 3, sv_vec3(0, 0, 0), 1);
        return;
    }
    set_row(clip_from_local, 0, sv_madd(x, z, ox), 0);
    set_row(clip_from_local, 1, sv_madd(y, z, oy), 0);
    set_row(clip_from_local, 2, sv_vec3(0, 0, 0), camera->near_m);
    set_row(clip_from_local, 3, z, 0);
}

void sv_camera_ray(const struct sv_camera *camera, double px, double py, struct sv_vec3 *origin,
                   struct sv_vec3 *direction)
{
    double f = sv_camera_focal_px(camera);
    double x = (px - 0.5 * camera->width) / f, y = (0.5 * camera->height - py) / f;
    struct sv_vec3 side = sv_madd(sv_scale(camera->right, x), camera->up, y);
    *origin = is_orthographic(camera) ? side : sv_vec3(0, 0, 0);
    *direction = is_orthographic(camera) ? camera->forward : sv_add(camera->forward, side);
}

bool sv_camera_project(const struct sv_camera *camera, struct sv_vec3 world, double *px, double *py,
                       double *depth_m)
{
    struct sv_vec3 p = sv_sub(world, camera->eye);
    double z = sv_dot(p, camera->forward);
    int ortho = is_orthographic(camera);
    if (!(z >= (ortho ? 0 : camera->near_m)))
        return false;
    double f = sv_camera_focal_px(camera) / (ortho ? 1 : z);
    *px = 0.5 * camera->width + f * sv_dot(p, camera->right);
    *py = 0.5 * camera->height - f * sv_dot(p, camera->up);
    *depth_m = z;
    return true;
}

static void set_plane(double plane[4], struct sv_vec3 n, double d)
{
    double length = sv_length(n);
    plane[0] = n.x / length;
    plane[1] = n.y / length;
    plane[2] = n.z / length;
    plane[3] = d / length;
}

void sv_camera_band_planes(const struct sv_camera *camera, int row_first, int row_end, double planes[5][4])
{
    double f = sv_camera_focal_px(camera), middle = 0.5 * camera->height;
    /* How far the sides are from the axis, outwards. */
    double a = 0.5 * (camera->width + 1) / f, top = (middle - row_first + 0.5) / f,
           bottom = (row_end - middle + 0.5) / f;
    struct sv_vec3 r = camera->right, u = camera->up, z = camera->forward;
    int ortho = is_orthographic(camera);
    double turn = ortho ? 0 : 1, move = ortho ? 1 : 0;
    set_plane(planes[0], sv_add(sv_scale(z, turn * a), r), move * a);
    set_plane(planes[1], sv_sub(sv_scale(z, turn * a), r), move * a);
    set_plane(planes[2], sv_sub(sv_scale(z, turn * top), u), move * top);
    set_plane(planes[3], sv_add(sv_scale(z, turn * bottom), u), move * bottom);
    set_plane(planes[4], z, ortho ? 0 : -camera->near_m);
}

void sv_camera_planes(const struct sv_camera *camera, double planes[5][4])
{
    sv_camera_band_planes(camera, 0, camera->height, planes);
}

/* Owen's nested scrambling of the leading bits of v: every bit is flipped or not by a hash of those above it.
 */
static uint32_t scramble(uint32_t v, int bits, uint32_t seed)
{
    uint32_t out = 0;
    for (int b = bits - 1; b >= 0; b--) {
        uint32_t h = (v >> (b + 1)) * 0x9E3779B9u ^ seed * 0x85EBCA6Bu ^ (uint32_t)(b + 1) * 0xC2B2AE35u;
        h ^= h >> 15;
        h *= 0x2C1B3C6Du;
        h ^= h >> 12;
        h *= 0x297A2D39u;
        h ^= h >> 15;
        out = out << 1 | ((v >> b & 1u) ^ (h & 1u));
    }
    return out;
}

static uint32_t reverse_bits(uint32_t v, int bits)
{
    uint32_t out = 0;
    for (int b = 0; b < bits; b++)
        out = out << 1 | (v >> b & 1u);
    return out;
}

/* A scrambled (0, m, 2)-net (Owen 1995): n samples, one in every row and column of n and in every elementary
 * interval; each stands in the middle of its n x n cell, so that the mean offset is exactly 0. */
void sv_camera_sample_offset(int count, int k, double *dx_px, double *dy_px)
{
    int bits = count == 4 ? 2 : count == 16 ? 4 : count == 64 ? 6 : 0;
    assert((bits > 0 || count == 1) && k >= 0 && k < count);
    uint32_t x = scramble((uint32_t)k, bits, 5), y = scramble(reverse_bits((uint32_t)k, bits), bits, 11);
    *dx_px = (x + 0.5) / count - 0.5;
    *dy_px = (y + 0.5) / count - 0.5;
}
