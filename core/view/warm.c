/* warm.c - the views that make llvmpipe compile what common requests need.
 *
 * A variant of a shader depends on the formats that are attached and on blending, not on the camera, the sun
 * or the air, which are uniforms. So one pose does, if it sees ground; trees of `auto` need no shader,
 * objects have a pose of their own. It is drawn with shadows and without, whose programs differ.
 * Then the scene's own sun is cast on all of the ground (terrain/shadow_page.h). */
#include "core/view/warm.h"

#include <math.h>
#include <string.h>

enum { SIDE_PX = 64 };

/* Eyes this far from a tree, at the height of its middle. */
static const double DISTANCE_HEIGHTS = 1.5;

/* Looks at the forest's middle tree, or level from the terrain's centre. */
static void choose_pose(const struct sv_scene *scene, struct sv_view_request *request)
{
    const struct sv_heightfield *f = &scene->terrain.field;
    request->eye = (struct sv_place){.form = SV_PLACE_XY,
                                     .x = 0.5 * (f->x0 + sv_heightfield_x1(f)),
                                     .y = 0.5 * (f->y0 + sv_heightfield_y1(f)),
                                     .agl = 2};
    if (scene->forest.count == 0)
        return;
    const struct sv_tree *tree = &scene->forest.trees[scene->forest.count / 2];
    double h = (double)tree->height_m, ground = tree->z, y = tree->y - DISTANCE_HEIGHTS * h;
    request->eye = (struct sv_place){.form = SV_PLACE_XY, .x = tree->x, .y = y, .has_z = true};
    request->target = (struct sv_place){
        .form = SV_PLACE_XY, .x = tree->x, .y = tree->y, .has_z = true, .z = tree->z + h / 2};
    (void)sv_heightfield_height(f, tree->x, y, &ground);
    request->eye.z = fmax(ground, tree->z) + fmax(h / 2, 0.5);
}

/* The first object from a distance of two of its heights, in one form and in the other. */
static enum sv_status warm_objects(struct sv_renderer *renderer, const struct sv_scene *scene,
                                   struct sv_view_request request, struct sv_error *error)
{
    const struct sv_scene_object *o = &scene->objects[0];
    double up = o->z + 0.5 * o->height_m, ground = up;
    request.eye =
        (struct sv_place){.form = SV_PLACE_XY, .x = o->x, .y = o->y - 2 * o->height_m, .has_z = true};
    (void)sv_heightfield_height(&scene->terrain.field, request.eye.x, request.eye.y, &ground);
    request.eye.z = fmax(ground, o->z) + o->height_m;
    request.target = (struct sv_place){.form = SV_PLACE_XY, .x = o->x, .y = o->y, .has_z = true, .z = up};
    struct sv_resolved_view view;
    enum sv_status status = sv_view_resolve(scene, &request, &view, NULL, error);
    for (int form = 0; form < 2 && !status; form++) {
        struct sv_picture picture;
        view.plan.draw_trees = false;
        view.plan.relief_texel_px = form ? INFINITY : 0;
        status = sv_renderer_draw(renderer, &request, &view, &picture, NULL, NULL, error);
        if (!status)
            sv_picture_finish(&picture);
    }
    return status;
}

enum sv_status sv_view_warm(struct sv_renderer *renderer, const struct sv_scene *scene, unsigned layers,
                            struct sv_error *error)
{
    struct sv_view_request request;
    struct sv_resolved_view view;
    struct sv_picture picture;
    memset(&request, 0, sizeof request);
    request.vfov_rad = 1;
    request.width = request.height = SIDE_PX;
    request.layers = layers;
    request.sky = true;
    request.quality = SV_QUALITY_FAST;
    request.relief = SV_RELIEF_OFF;
    choose_pose(scene, &request);
    enum sv_status status = SV_OK;
    for (int shadows = 1; shadows >= 0 && !status; shadows--) {
        request.shadows = shadows;
        status = sv_view_resolve(scene, &request, &view, NULL, error);
        if (!status)
            status = sv_renderer_draw(renderer, &request, &view, &picture, NULL, NULL, error);
        if (!status)
            sv_picture_finish(&picture);
    }
    if (!status && scene->object_count > 0)
        status = warm_objects(renderer, scene, request, error);
    return status ? status : sv_renderer_warm_shadows(renderer, error);
}
