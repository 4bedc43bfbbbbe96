/* object.c - six reliefs on the faces of a box: where they lie, which of them a camera needs, and their bake.
 */
#include "core/relief/object.h"

#include <stdlib.h>
#include <string.h>

#include "core/base/frames.h"
#include "core/relief/build.h"

/* Axes of the faces: a to the right and b down for one who looks at the face from outside. */
static const struct {
    int axis; /* of f: 0 x, 1 y, 2 z */
    struct sv_vec3 a, b, f;
} FACES[SV_RELIEF_FACES] = {
    {0, {0, 1, 0}, {0, 0, -1}, {1, 0, 0}},  {0, {0, -1, 0}, {0, 0, -1}, {-1, 0, 0}},
    {1, {-1, 0, 0}, {0, 0, -1}, {0, 1, 0}}, {1, {1, 0, 0}, {0, 0, -1}, {0, -1, 0}},
    {2, {1, 0, 0}, {0, -1, 0}, {0, 0, 1}},  {2, {1, 0, 0}, {0, 1, 0}, {0, 0, -1}},
};

/* Neighbours whose displ differ by more than this many texels are torn apart. */
#define CUT_TEXELS 3.0
/* Model space has height 1; what is a billion times that is no model. */
#define BOX_MAX 1e9
enum { BAKE_SAMPLES = 4 };

static double extent(const struct sv_relief_object *object, struct sv_vec3 axis)
{
    return fabs(sv_dot(sv_sub(object->box_max, object->box_min), axis));
}

static int texels_along(const struct sv_relief_object *object, struct sv_vec3 axis, double texel)
{
    /* A side of exactly n texels must not become n + 1 by rounding. */
    double n = ceil(extent(object, axis) / texel - 1e-6);
    return n < 1 ? 1 : n > SV_RELIEF_RESOLUTION_MAX ? SV_RELIEF_RESOLUTION_MAX : (int)n;
}

void sv_relief_object_face_layout(const struct sv_relief_object *object, int face, double texel,
                                  struct sv_relief_frame *frame, int *width, int *height)
{
    struct sv_vec3 middle = sv_scale(sv_add(object->box_min, object->box_max), 0.5);
    struct sv_vec3 a = sv_scale(FACES[face].a, texel), b = sv_scale(FACES[face].b, texel);
    *width = texels_along(object, FACES[face].a, texel);
    *height = texels_along(object, FACES[face].b, texel);
    struct sv_vec3 origin = sv_madd(middle, FACES[face].f, 0.5 * extent(object, FACES[face].f));
    origin = sv_madd(sv_madd(origin, a, -0.5 * *width), b, -0.5 * *height);
    *frame = (struct sv_relief_frame){.origin = origin, .a = a, .b = b, .f = FACES[face].f};
}

static void place_masks(struct sv_relief_object *object)
{
    uint8_t *at = object->block;
    for (int k = 0; k < SV_RELIEF_FACES; k++) {
        size_t texels = (size_t)object->face[k].width * (size_t)object->face[k].height;
        object->keep[k] = at;
        memset(at, 255, texels);
        at += texels;
    }
}

/* Box of the vertices; false when there are none or one of them is not finite. */
static bool box_of(const struct sv_tree_mesh *mesh, struct sv_vec3 *lo, struct sv_vec3 *hi)
{
    *lo = sv_vec3(INFINITY, INFINITY, INFINITY), *hi = sv_vec3(-INFINITY, -INFINITY, -INFINITY);
    for (uint32_t i = 0; i < mesh->vertex_count; i++) {
        const float *p = mesh->vertices[i].position;
        *lo = sv_vec3(fmin(lo->x, (double)p[0]), fmin(lo->y, (double)p[1]), fmin(lo->z, (double)p[2]));
        *hi = sv_vec3(fmax(hi->x, (double)p[0]), fmax(hi->y, (double)p[1]), fmax(hi->z, (double)p[2]));
        if (!isfinite(p[0]) || !isfinite(p[1]) || !isfinite(p[2]))
            return false;
    }
    return mesh->vertex_count > 0;
}

enum sv_status sv_relief_object_set_box(struct sv_relief_object *object, struct sv_vec3 box_min,
                                        struct sv_vec3 box_max, int resolution, enum sv_status code,
                                        struct sv_error *error)
{
    if (resolution < SV_RELIEF_RESOLUTION_MIN || resolution > SV_RELIEF_RESOLUTION_MAX)
        return sv_fail(error, code, "resolution", "is %d texels, must be %d to %d", resolution,
                       SV_RELIEF_RESOLUTION_MIN, SV_RELIEF_RESOLUTION_MAX);
    struct sv_vec3 size = sv_sub(box_max, box_min);
    double longest = fmax(size.x, fmax(size.y, size.z)), reach = 0;
    const double ends[6] = {box_min.x, box_min.y, box_min.z, box_max.x, box_max.y, box_max.z};
    for (int k = 0; k < 6; k++)
        reach = isfinite(ends[k]) ? fmax(reach, fabs(ends[k])) : INFINITY;
    if (!(size.x >= 0 && size.y >= 0 && size.z >= 0 && longest > 0 && reach <= BOX_MAX))
        return sv_fail(error, code, "box",
                       "is (%g, %g, %g) to (%g, %g, %g), must have a size and stay within %g", ends[0],
                       ends[1], ends[2], ends[3], ends[4], ends[5], BOX_MAX);
    if (!(longest / resolution > reach * 1e-9))
        return sv_fail(error, code, "box",
                       "has sides of at most %g at %g from the origin: no texel is that small", longest,
                       reach);
    object->box_min = box_min;
    object->box_max = box_max;
    object->resolution = resolution;
    object->texel = longest / resolution;
    object->hidden_texel = longest / (resolution < SV_RELIEF_HULL_MAX ? resolution : SV_RELIEF_HULL_MAX);
    return SV_OK;
}

/* An empty relief where the layout of a face has it. */
static enum sv_status alloc_face(const struct sv_relief_object *object, int k, double texel,
                                 struct sv_relief *face, struct sv_error *error)
{
    struct sv_relief_frame frame;
    int width, height;
    sv_relief_object_face_layout(object, k, texel, &frame, &width, &height);
    enum sv_status status = sv_relief_alloc(width, height, face, error);
    if (status == SV_OK) {
        face->frame = frame;
        face->cut = (float)(CUT_TEXELS * texel);
    }
    return status;
}

/* Masks of the six faces, which are there, and the hidden ones, empty. */
static enum sv_status alloc_rest(struct sv_relief_object *object, struct sv_error *error)
{
    size_t texels = 0;
    enum sv_status status = SV_OK;
    for (int k = 0; status == SV_OK && k < SV_RELIEF_FACES; k++) {
        for (int layer = 0; status == SV_OK && layer < SV_RELIEF_HIDDEN; layer++)
            status = alloc_face(object, k, object->hidden_texel, &object->hidden[layer][k], error);
        texels += (size_t)object->face[k].width * (size_t)object->face[k].height;
    }
    if (status == SV_OK && !(object->block = malloc(texels)))
        status = sv_fail(error, SV_ENOMEM, "object", "no memory for %zu texels", texels);
    if (status == SV_OK)
        place_masks(object);
    return status;
}

enum sv_status sv_relief_object_alloc(struct sv_relief_object *object, struct sv_error *error)
{
    enum sv_status status = SV_OK;
    for (int k = 0; status == SV_OK && k < SV_RELIEF_FACES; k++)
        status = alloc_face(object, k, object->texel, &object->face[k], error);
    return status == SV_OK ? alloc_rest(object, error) : status;
}

static enum sv_status bake_faces(const struct sv_tree_mesh *mesh, struct sv_relief_object *object,
                                 struct sv_error *error)
{
    for (int k = 0; k < SV_RELIEF_FACES; k++) {
        struct sv_relief_frame frame;
        struct sv_relief_bake_options options = {.samples = BAKE_SAMPLES,
                                                 .front_m = 0.5 * object->texel,
                                                 .depth_m = extent(object, FACES[k].f) + 0.5 * object->texel,
                                                 .cut = (float)(CUT_TEXELS * object->texel)};
        sv_relief_object_face_layout(object, k, object->texel, &frame, &options.width, &options.height);
        enum sv_status status = sv_relief_from_mesh(mesh, &frame, &options, &object->face[k], error);
        if (status != SV_OK)
            return status;
    }
    return alloc_rest(object, error);
}

enum sv_status sv_relief_object_derive(struct sv_relief_object *object, struct sv_error *error)
{
    enum sv_status status = sv_relief_object_hide(object, error);
    if (status == SV_OK)
        status = sv_relief_object_tile(object, error);
    if (status == SV_OK)
        status = sv_relief_object_rim(object, error);
    return status;
}

enum sv_status sv_relief_object_bake(const struct sv_tree_mesh *mesh, int resolution,
                                     struct sv_relief_object *object, struct sv_error *error)
{
    struct sv_relief_object made = {0};
    struct sv_vec3 lo, hi;
    if (!box_of(mesh, &lo, &hi))
        return sv_fail(error, SV_EINVAL, "mesh", "has no vertices, or one that is not finite");
    enum sv_status status = sv_relief_object_set_box(&made, lo, hi, resolution, SV_EINVAL, error);
    if (status == SV_OK)
        status = bake_faces(mesh, &made, error);
    if (status == SV_OK)
        status = sv_relief_object_choose(&made, error);
    if (status == SV_OK)
        status = sv_relief_object_derive(&made, error);
    if (status == SV_OK)
        *object = made;
    else
        sv_relief_object_finish(&made);
    return status;
}

void sv_relief_object_finish(struct sv_relief_object *object)
{
    for (int k = 0; k < SV_RELIEF_FACES; k++) {
        sv_relief_finish(&object->face[k]);
        for (int layer = 0; layer < SV_RELIEF_HIDDEN; layer++)
            sv_relief_finish(&object->hidden[layer][k]);
    }
    free(object->block);
    free(object->tiles);
    free(object->normal_block);
    free(object->rim_block);
    *object = (struct sv_relief_object){0};
}

struct sv_relief_frame sv_relief_object_frame(const struct sv_relief_object *object, int face,
                                              const struct sv_relief_place *place)
{
    const struct sv_relief_frame *m = &object->face[face].frame;
    double h = place->height_m, r = place->heading_rad;
    return (struct sv_relief_frame){
        .origin = sv_madd(place->place, sv_rotate_clockwise(m->origin, r), h),
        .a = sv_scale(sv_rotate_clockwise(m->a, r), h),
        .b = sv_scale(sv_rotate_clockwise(m->b, r), h),
        .f = sv_rotate_clockwise(m->f, r),
    };
}

struct sv_vec3 sv_relief_place_to_model(const struct sv_relief_place *place, struct sv_vec3 world)
{
    struct sv_vec3 p = sv_rotate_clockwise(sv_sub(world, place->place), -place->heading_rad);
    return sv_scale(p, 1 / place->height_m);
}

unsigned sv_relief_object_faces(const struct sv_relief_object *object, const struct sv_relief_place *place,
                                const struct sv_camera *camera)
{
    struct sv_vec3 back = sv_rotate_clockwise(sv_scale(camera->forward, -1), -place->heading_rad);
    if (camera->projection == SV_PROJECTION_PERSPECTIVE)
        return sv_relief_object_seen_from(object, sv_relief_place_to_model(place, camera->eye), true);
    return sv_relief_object_seen_from(object, back, false);
}

double sv_relief_object_texel_px(const struct sv_relief_object *object, const struct sv_relief_place *place,
                                 const struct sv_camera *camera)
{
    double focal = sv_camera_focal_px(camera), texel = object->texel * place->height_m;
    if (camera->projection != SV_PROJECTION_PERSPECTIVE)
        return texel * focal;
    struct sv_vec3 eye = sv_relief_place_to_model(place, camera->eye), lo = object->box_min,
                   hi = object->box_max;
    struct sv_vec3 nearest =
        sv_vec3(sv_clamp(eye.x, lo.x, hi.x), sv_clamp(eye.y, lo.y, hi.y), sv_clamp(eye.z, lo.z, hi.z));
    double distance = sv_length(sv_sub(eye, nearest)) * place->height_m;
    return texel * focal / fmax(distance, camera->near_m);
}
