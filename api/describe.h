/* describe.h - the answer to f=json: what the picture would be, without drawing it. */
#ifndef SV_API_DESCRIBE_H
#define SV_API_DESCRIBE_H

#include <stddef.h>
#include <stdint.h>

#include "core/view/request.h"
#include "core/view/resolved.h"

struct sv_api_description {
    const struct sv_view_request *request;
    const struct sv_resolved_view *resolved;
    const char *canonical; /* the request's text (canonical.h) */
    const char *etag;      /* of the picture */
    uint64_t scene_version;
    double relief_distance_m; /* the scene's, for the route */
};

/* {"request", "camera", "matrices", "picture", "sun", "plan", "predicted", "ground_z", "route", "etag",
 * "scene_version"}: heap text, caller frees; NULL only when memory is out. Angles in degrees, lengths in
 * metres.
 *
 * Matrices are lists of four rows that act on column vectors, named dst_from_src: camera_from_world (camera
 * axes: x right, y up, z backward; right-handed), clip_from_camera, clip_from_world. Clip space: x, y in
 * -1..1 over the picture, y up; depth z/w reversed, near/Z in perspective (0 at infinity), 1 - Z/far in
 * orthographic views. */
char *sv_api_describe(const struct sv_api_description *description, size_t *bytes);

/* The matrices by themselves, for tests and other answers. */
void sv_api_camera_from_world(const struct sv_camera *camera, struct sv_mat4 *camera_from_world);
void sv_api_clip_from_camera(const struct sv_camera *camera, struct sv_mat4 *clip_from_camera);

#endif
