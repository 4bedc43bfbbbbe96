/* describe.c - see describe.h. */
#include "api/describe.h"

#include <inttypes.h>
#include <math.h>
#include <stdio.h>
#include <string.h>

#include "api/answer.h"
#include "api/json_write.h"
#include "api/number.h"

void sv_api_camera_from_world(const struct sv_camera *camera, struct sv_mat4 *m)
{
    const struct sv_vec3 rows[3] = {camera->right, camera->up, sv_scale(camera->forward, -1)};
    for (int k = 0; k < 3; k++) {
        m->m[k][0] = rows[k].x;
        m->m[k][1] = rows[k].y;
        m->m[k][2] = rows[k].z;
        m->m[k][3] = -sv_dot(rows[k], camera->eye);
        m->m[3][k] = 0;
    }
    m->m[3][3] = 1;
}

void sv_api_clip_from_camera(const struct sv_camera *camera, struct sv_mat4 *m)
{
    double aspect = (double)camera->width / camera->height;
    memset(m, 0, sizeof *m);
    if (camera->projection == SV_PROJECTION_ORTHOGRAPHIC) {
        m->m[1][1] = 2 / camera->ortho_height_m;
        m->m[0][0] = m->m[1][1] / aspect;
        m->m[2][2] = 1 / camera->far_m; /* camera z is -Z: 1 - Z/far */
        m->m[2][3] = 1;
        m->m[3][3] = 1;
        return;
    }
    m->m[1][1] = 1 / tan(camera->vfov_rad / 2);
    m->m[0][0] = m->m[1][1] / aspect;
    m->m[2][3] = camera->near_m;
    m->m[3][2] = -1;
}

static cJSON *matrix(const struct sv_mat4 *m, bool *good)
{
    cJSON *rows = cJSON_CreateArray();
    for (int k = 0; k < 4; k++)
        sv_api_json_append(rows, cJSON_CreateDoubleArray(m->m[k], 4), good);
    return rows;
}

static cJSON *matrices(const struct sv_camera *camera, bool *good)
{
    struct sv_mat4 camera_from_world, clip_from_camera;
    sv_api_camera_from_world(camera, &camera_from_world);
    sv_api_clip_from_camera(camera, &clip_from_camera);
    struct sv_mat4 clip_from_world = sv_mat4_mul(&clip_from_camera, &camera_from_world);
    cJSON *object = cJSON_CreateObject();
    sv_api_json_add(object, "camera_from_world", matrix(&camera_from_world, good), good);
    sv_api_json_add(object, "clip_from_camera", matrix(&clip_from_camera, good), good);
    sv_api_json_add(object, "clip_from_world", matrix(&clip_from_world, good), good);
    return object;
}

static cJSON *camera(const struct sv_resolved_view *resolved, bool *good)
{
    char text[SV_CAMERA_JSON_BUFFER];
    const double forward[3] = {resolved->camera.forward.x, resolved->camera.forward.y,
                               resolved->camera.forward.z};
    const double right[3] = {resolved->camera.right.x, resolved->camera.right.y, resolved->camera.right.z};
    sv_api_camera_json(resolved, text);
    cJSON *object = cJSON_Parse(text);
    sv_api_json_add(object, "forward", cJSON_CreateDoubleArray(forward, 3), good);
    sv_api_json_add(object, "right", cJSON_CreateDoubleArray(right, 3), good);
    sv_api_json_add_text(object, "projection", sv_projection_name(resolved->camera.projection), good);
    sv_api_json_add_number(object, "near_m", resolved->camera.near_m, good);
    if (resolved->camera.projection == SV_PROJECTION_ORTHOGRAPHIC)
        sv_api_json_add_number(object, "far_m", resolved->camera.far_m, good);
    return object;
}

static cJSON *picture(const struct sv_view_request *request, bool *good)
{
    cJSON *object = cJSON_CreateObject(), *layers = cJSON_CreateArray();
    sv_api_json_add_number(object, "width", request->width, good);
    sv_api_json_add_number(object, "height", request->height, good);
    sv_api_json_add_text(object, "format", sv_format_name(request->format), good);
    sv_api_json_add_text(object, "media_type", sv_format_media(request->format), good);
    for (int k = 0; layers && k < SV_LAYER_COUNT; k++)
        if (request->layers & 1u << k)
            sv_api_json_append(layers, cJSON_CreateString(sv_layer_name((enum sv_layer)k)), good);
    sv_api_json_add(object, "layers", layers, good);
    sv_api_json_add_bool(object, "sky", request->sky, good);
    return object;
}

static cJSON *plan(const struct sv_resolved_view *resolved, bool *good)
{
    const struct sv_plan *p = &resolved->plan;
    cJSON *object = cJSON_CreateObject();
    sv_api_json_add_text(object, "trees", sv_api_plan_trees(p), good);
    sv_api_json_add_text(object, "relief", sv_api_plan_relief(p), good);
    sv_api_json_add_number(object, "samples", p->samples, good);
    sv_api_json_add_bool(object, "shadows", p->shadows, good);
    sv_api_json_add_bool(object, "raycast", p->raycast, good);
    sv_api_json_add_number(object, "terrain_error_px", p->terrain_error_px, good);
    if (!p->raycast) {
        sv_api_json_add_number(object, "relief_texel_px", p->relief_texel_px,
                               good); /* of objects; 0: polygons */
        sv_api_json_add_number(object, "tree_error_px", p->tree_error_px, good);
    }
    sv_api_json_add_bool(object, "air", resolved->air, good);
    return object;
}

char *sv_api_describe(const struct sv_api_description *d, size_t *bytes)
{
    const struct sv_resolved_view *v = d->resolved;
    char route[SV_ROUTE_BUFFER], version[24];
    bool good = true;
    cJSON *root = cJSON_CreateObject();
    sv_api_route(v->cell, d->relief_distance_m, route);
    snprintf(version, sizeof version, "%016" PRIx64, d->scene_version);
    sv_api_json_add_text(root, "request", d->canonical, &good);
    sv_api_json_add(root, "camera", camera(v, &good), &good);
    sv_api_json_add(root, "matrices", matrices(&v->camera, &good), &good);
    sv_api_json_add(root, "picture", picture(d->request, &good), &good);
    sv_api_json_add(root, "sun",
                    sv_api_json_pair("azimuth", sv_api_degrees(v->sun.azimuth_rad), "elevation",
                                     sv_api_degrees(v->sun.elevation_rad), &good),
                    &good);
    sv_api_json_add(root, "plan", plan(v, &good), &good);
    sv_api_json_add(root, "predicted", sv_api_json_pair("ms", NAN, "error_px", NAN, &good),
                    &good); /* no measured table yet */
    sv_api_json_add_number(root, "ground_z", v->ground_z, &good);
    sv_api_json_add_text(root, "route", route, &good);
    sv_api_json_add_text(root, "etag", d->etag, &good);
    sv_api_json_add_text(root, "scene_version", version, &good);
    return sv_api_json_print(root, good, bytes);
}
