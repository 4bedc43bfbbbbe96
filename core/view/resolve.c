/* resolve.c - see resolve.h. Everything is formed in double in the scene's CRS; nothing here draws. */
#include "core/view/resolve.h"

#include <math.h>
#include <stdio.h>
#include <string.h>

#include "core/base/frames.h"
#include "core/cell/region.h"
#include "core/view/rings.h"

/* An eye farther than this from the scene's centre is a mistake in coordinates, not a view. */
static const double eye_distance_max_m = 1e7;
/* An eye this little under the surface is rounding of agl=0, not a mole. */
static const double underground_slack_m = 1e-6;
static const double near_m = 0.1;

struct place {
    struct sv_vec3 at;
    bool has_ground;
    double ground_z;
};

/* Horizontal place in the scene's CRS. */
static enum sv_status place_xy(const struct sv_scene *scene, const struct sv_view_request *request,
                               const struct sv_place *place, const char *name, double *x, double *y,
                               struct sv_error *error)
{
    *x = place->x;
    *y = place->y;
    if (place->form == SV_PLACE_LONLAT) {
        if (!sv_crs_from_lonlat(scene->crs, place->x, place->y, x, y))
            return sv_fail(error, SV_EINVAL, name,
                           sv_crs_is_local(scene->crs)
                               ? "lon %.10g, lat %.10g: the scene has no place on Earth (its CRS is local)"
                               : "lon %.10g, lat %.10g cannot be projected to the scene's CRS",
                           place->x, place->y);
        return SV_OK;
    }
    if (request->crs_epsg == 0)
        return SV_OK;
    char text[32];
    snprintf(text, sizeof text, "EPSG:%d", request->crs_epsg);
    struct sv_crs *from = NULL;
    struct sv_crs_transform *transform = NULL;
    enum sv_status status = sv_crs_create(text, &from, error);
    if (!status)
        status = sv_crs_transform_create(from, scene->crs, &transform, error);
    if (status && error)
        snprintf(error->field, sizeof error->field, "crs");
    if (!status && !sv_crs_transform_apply(transform, x, y))
        status =
            sv_fail(error, SV_EINVAL, name, "%.10g, %.10g in %s cannot be transformed to the scene's CRS",
                    place->x, place->y, text);
    sv_crs_transform_destroy(transform);
    sv_crs_destroy(from);
    return status == SV_EUNSUPPORTED || status == SV_ENOENT ? SV_EINVAL : status;
}

static enum sv_status place_resolve(const struct sv_scene *scene, const struct sv_view_request *request,
                                    const struct sv_place *place, const char *name, struct place *out,
                                    struct sv_error *error)
{
    double x, y;
    enum sv_status status = place_xy(scene, request, place, name, &x, &y, error);
    if (status)
        return status;
    const struct sv_heightfield *field = &scene->terrain.field;
    struct sv_vec3 centre = sv_vec3((field->x0 + sv_heightfield_x1(field)) / 2,
                                    (field->y0 + sv_heightfield_y1(field)) / 2, field->z0);
    double z = place->has_z ? place->z : field->z0;
    if (!(sv_length(sv_sub(sv_vec3(x, y, z), centre)) <= eye_distance_max_m))
        return sv_fail(error, SV_EOUTSIDE, name, "%.10g, %.10g, %.10g is more than %.0f km from the scene", x,
                       y, z, eye_distance_max_m / 1000);
    out->has_ground = sv_heightfield_height(field, x, y, &out->ground_z);
    if (!place->has_z) {
        if (!out->has_ground)
            return sv_fail(
                error, SV_EOUTSIDE, name,
                "%.10g, %.10g is outside the terrain (x %.10g .. %.10g, y %.10g .. %.10g in %s): a height "
                "above ground has no meaning there; give z",
                x, y, field->x0, sv_heightfield_x1(field), field->y0, sv_heightfield_y1(field),
                sv_crs_name(scene->crs));
        z = out->ground_z + place->agl;
    }
    out->at = sv_vec3(x, y, z);
    return SV_OK;
}

/* Heading and pitch from a to b; false when they coincide. A vertical line of sight keeps heading 0: north
 * up. */
static bool heading_pitch(struct sv_vec3 a, struct sv_vec3 b, double *heading, double *pitch)
{
    struct sv_vec3 d = sv_sub(b, a);
    double horizontal = hypot(d.x, d.y);
    if (!(sv_length(d) > 1e-6))
        return false;
    *heading = horizontal > 1e-9 * fabs(d.z) ? atan2(d.x, d.y) : 0;
    if (*heading < 0)
        *heading += 2 * SV_PI;
    *pitch = atan2(d.z, horizontal);
    return true;
}

static enum sv_status resolve_eye(const struct sv_scene *scene, const struct sv_view_request *request,
                                  struct sv_resolved_view *view, double *ground_z, struct sv_error *error)
{
    struct place eye = {0}, target = {0};
    enum sv_status status;
    view->has_target = request->target.form != SV_PLACE_NONE;
    if (view->has_target) {
        status = place_resolve(scene, request, &request->target, "target", &target, error);
        if (status)
            return status;
        view->target = target.at;
    }
    struct sv_vec3 at = target.at;
    if (request->eye.form != SV_PLACE_NONE) {
        status = place_resolve(scene, request, &request->eye, "eye", &eye, error);
        if (status)
            return status;
        at = eye.at;
    }
    view->convergence_rad = sv_crs_convergence_rad(scene->crs, at.x, at.y);
    double north = request->north_true ? view->convergence_rad : 0;
    view->heading_rad = request->heading_rad + north;
    view->pitch_rad = request->pitch_rad;
    view->roll_rad = request->roll_rad;
    if (request->eye.form == SV_PLACE_NONE) {
        at = sv_madd(target.at, sv_direction(view->heading_rad, view->pitch_rad), -request->range_m);
        eye.has_ground = sv_heightfield_height(&scene->terrain.field, at.x, at.y, &eye.ground_z);
    } else if (view->has_target && !heading_pitch(at, target.at, &view->heading_rad, &view->pitch_rad)) {
        return sv_fail(error, SV_EINVAL, "target", "the target is where the eye is (%.10g, %.10g, %.10g)",
                       at.x, at.y, at.z);
    }
    view->heading_rad -= 2 * SV_PI * floor(view->heading_rad / (2 * SV_PI));
    view->camera.eye = at;
    view->ground_z = eye.has_ground ? eye.ground_z : NAN;
    if (eye.has_ground && at.z < eye.ground_z - underground_slack_m) {
        if (ground_z)
            *ground_z = eye.ground_z;
        return sv_fail(error, SV_EUNDERGROUND, "z",
                       "the eye at z = %.3f m is under the ground, which is at %.3f m", at.z, eye.ground_z);
    }
    return SV_OK;
}

static void resolve_sun(const struct sv_scene *scene, const struct sv_view_request *request,
                        struct sv_resolved_view *view, struct sv_error *error, enum sv_status *status)
{
    const struct sv_heightfield *field = &scene->terrain.field;
    double cx = (field->x0 + sv_heightfield_x1(field)) / 2, cy = (field->y0 + sv_heightfield_y1(field)) / 2;
    double convergence = sv_crs_convergence_rad(scene->crs, cx, cy);
    view->sun = scene->sun;
    *status = SV_OK;
    if (request->has_time && !sv_scene_sun_at(scene, request->time_unix_s, &view->sun)) {
        *status =
            sv_fail(error, SV_EINVAL, "time",
                    "the scene has no place on Earth (its CRS is local): give sun_azimuth and sun_elevation");
        return;
    }
    if (request->has_sun_azimuth)
        view->sun.azimuth_rad = request->sun_azimuth_rad + (request->north_true ? convergence : 0);
    if (request->has_sun_elevation)
        view->sun.elevation_rad = request->sun_elevation_rad;
    view->sun.azimuth_rad -= 2 * SV_PI * floor(view->sun.azimuth_rad / (2 * SV_PI));
}

/* How much a quality may cost: the screen-space error of the ground, that of trees in their far
 * form (ladder.h), how large the texels of a relief may be, and what holes that open as the eye moves in its
 * cells may change of a picture, levels of 255 (relief_pitch). Flights over 5,000 trees whose steps are 0.2,
 * 0.1, 0.05 and 0.025 of their cells' distance are off by 6.27, 6.12, 5.91 and 5.83 levels of 64 samples, and
 * have 105, 189, 294 and 429 panels built in 33 frames. Leaves' samples, all and those before panels: walks
 * among 45,000 trees of quality `high` are off by 0.209 levels with 8 of the latter and 0.173 with 16 (SSIM
 * .9977 and .9981), for 251 and 420 ms; the ray cast of four samples by 0.190 (.9972) for 3,400. */
static const struct {
    double terrain_error_px, tree_error_px, relief_texel_px, relief_holes;
    int leaf_samples, near_samples;
} quality_table[SV_QUALITY_COUNT] = {
    [SV_QUALITY_FAST] = {2.0, 2, 2, 12, 2, 1},
    [SV_QUALITY_BALANCED] = {1.0, 1.5, 1, 6, 4, 1},
    [SV_QUALITY_HIGH] = {0.5, 0.75, 0.5, 3, 16, 16},
    [SV_QUALITY_REFERENCE] = {0.0, 0.1, 0, 3, 16, 16},
};

/* The lattice step of cells that keep the tolerance by the prediction of core/cell/region.h. It must be known
 * before any panel is, and be the same for all that share them: so from jumps of depth that panels have in
 * the mean, in shares of the picture. Sideways, up and forward those of the forest of 9,000 trees, the demo
 * scene and a DEM under 9,000 trees are 2.35, 2.49, 3.79; 2.63, 2.93, 4.41; 1.89, 2.16, 3.18; and a hole
 * counts so many levels that predictions bound what is measured (tests/experiments/cell_region). */
static double relief_pitch(double holes)
{
    static const struct sv_region_panel usual = {SV_CELL_EAST, 2, 1, {2.3, 2.3, 2.5, 2.5, 1.9, 1.9, 1}};
    static const struct sv_region_view view = {.focal_px = 1, .width = 1, .height = 1, .hole_weight = 5.8};
    return sv_region_pitch(&usual, 1, false, &view, holes);
}

/* Texels of a panel over 90 degrees: the scene's, halved as long as they are no larger than the picture's
 * pixels at the panel's middle (2 F texels for F px of focal length). Finer ones would only be picked from,
 * which is noise: of a forest at 128 x 128 px panels of 1024 are off by 3.6 of 255 in the mean, panels of 256
 * by 2.0. */
static int relief_resolution(const struct sv_scene *scene, const struct sv_view_request *request)
{
    enum { LEAST = 256 };
    int size = scene->relief_resolution;
    double focal_px = request->height / (2 * tan(request->vfov_rad / 2));
    if (request->relief_resolution > 0)
        return request->relief_resolution;
    while (size % 2 == 0 && size / 2 >= LEAST && size / 2 >= 2 * focal_px)
        size /= 2;
    return size;
}

static void resolve_plan(const struct sv_scene *scene, const struct sv_view_request *request,
                         struct sv_plan *plan)
{
    bool reference = request->quality == SV_QUALITY_REFERENCE;
    plan->raycast = reference || request->trees == SV_TREES_RAYCAST;
    plan->draw_trees = request->trees != SV_TREES_NONE;
    plan->relief = request->relief;
    plan->relief_distance_m =
        request->relief_distance_m > 0 ? request->relief_distance_m : scene->relief_distance_m;
    plan->relief_resolution = relief_resolution(scene, request);
    plan->relief_pitch = relief_pitch(quality_table[request->quality].relief_holes);
    plan->shadows = request->shadows;
    plan->samples = request->samples ? request->samples : reference ? 16 : 1;
    plan->terrain_error_px = quality_table[request->quality].terrain_error_px;
    plan->relief_texel_px =
        request->relief == SV_RELIEF_OFF ? 0 : quality_table[request->quality].relief_texel_px;
    plan->leaf_samples = quality_table[request->quality].leaf_samples;
    plan->near_samples = quality_table[request->quality].near_samples;
    plan->tree_error_px = quality_table[request->quality].tree_error_px;
    plan->trees = plan->raycast && plan->draw_trees ? SV_TREES_RAYCAST : request->trees;
}

/* Far plane of an orthographic view: past every corner of the scene's box. */
static double ortho_far(const struct sv_scene *scene, const struct sv_camera *camera)
{
    const struct sv_heightfield *f = &scene->terrain.field;
    double far = 1;
    for (int k = 0; k < 8; k++) {
        struct sv_vec3 corner =
            sv_vec3(k & 1 ? sv_heightfield_x1(f) : f->x0, k & 2 ? sv_heightfield_y1(f) : f->y0,
                    k & 4 ? f->z0 + f->h_max + 160 : f->z0 + f->h_min - 10);
        double z = sv_dot(sv_sub(corner, camera->eye), camera->forward);
        far = fmax(far, z);
    }
    return far * 1.01 + 200; /* trees at the border stand out of the box by a crown */
}

enum sv_status sv_view_resolve(const struct sv_scene *scene, const struct sv_view_request *request,
                               struct sv_resolved_view *out, double *ground_z, struct sv_error *error)
{
    struct sv_resolved_view view;
    memset(&view, 0, sizeof view); /* padding too: the struct is hashed and sent as bytes */
    resolve_plan(scene, request, &view.plan);
    enum sv_status status = SV_OK;
    if (request->north_true && sv_crs_is_local(scene->crs))
        status = sv_fail(
            error, SV_EINVAL, "north",
            "the scene has no place on Earth (its CRS is local): north=true has no meaning; use grid");
    if (!status)
        status = resolve_eye(scene, request, &view, ground_z, error);
    if (!status)
        resolve_sun(scene, request, &view, error, &status);
    if (status)
        return status;
    struct sv_camera *camera = &view.camera;
    camera->projection = request->projection;
    camera->vfov_rad = request->vfov_rad;
    camera->ortho_height_m = request->ortho_height_m;
    camera->width = request->width;
    camera->height = request->height;
    camera->near_m = near_m;
    sv_camera_aim(camera, view.heading_rad, view.pitch_rad, view.roll_rad);
    if (camera->projection == SV_PROJECTION_ORTHOGRAPHIC)
        camera->far_m = ortho_far(scene, camera);
    view.has_lonlat =
        sv_crs_to_lonlat(scene->crs, camera->eye.x, camera->eye.y, &view.lon_deg, &view.lat_deg);
    view.air = request->air;
    struct sv_view_rings rings;
    view.cell = sv_view_rings(&view, &rings) ? rings.chain[rings.rings.count - 1].v : camera->eye;
    *out = view;
    return SV_OK;
}
