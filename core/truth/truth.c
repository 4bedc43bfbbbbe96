/* truth.c - see truth.h. Two-level Embree scene: one scene a species or model, an instance a tree or object,
 * terrain as user geometry. Geometry ids: trees by their place in the forest, then the terrain, then objects.
 *
 * Coordinates are relative to the scene's centre (frames.h, "local"); the terrain gets each ray in double
 * besides. */
#include "core/truth/truth.h"

#include <math.h>
#include <pmmintrin.h>
#include <stdlib.h>
#include <string.h>
#include <xmmintrin.h>

#include "core/base/color.h"
#include "core/base/frames.h"
#include "core/scene/id.h"
#include "core/terrain/detail.h"
#include "core/truth/terrain_patch.h"
#include "core/truth/terrain_shade.h"
#include "core/truth/texture.h"

/* What a hit on a mesh's geometry needs: geometry ids of a mesh's scene are its materials' indices. */
struct leaf_mask {
    const struct sv_tree_mesh *mesh;
    const struct sv_tree_material *material;
};

struct mesh_scene {
    RTCScene scene;
    struct leaf_mask masks[SV_TREE_MATERIALS_MAX];
};

struct sv_truth {
    const struct sv_scene *scene;
    struct sv_vec3 origin; /* world place of local (0, 0, 0) */
    RTCDevice device;
    RTCScene full, terrain_only; /* objects are in both */
    struct mesh_scene *species, *models;
    struct sv_terrain_patches patches;
    unsigned terrain_id; /* geometry id of the terrain: above every tree's */
    unsigned object_id;  /* of the first object: above the terrain's */
};

struct device_error {
    enum RTCError code;
    char text[256];
};

static void note_error(void *context, enum RTCError code, const char *text)
{
    struct device_error *e = context;
    if (e->code == RTC_ERROR_NONE) {
        e->code = code;
        strncpy(e->text, text ? text : "", sizeof e->text - 1);
    }
}

static void interpolate_uv(const struct leaf_mask *mask, unsigned triangle, float u, float v, float uv[2])
{
    const uint32_t *index = mask->mesh->indices + mask->material->first_index + (size_t)triangle * 3;
    const struct sv_tree_vertex *a = &mask->mesh->vertices[index[0]], *b = &mask->mesh->vertices[index[1]],
                                *c = &mask->mesh->vertices[index[2]];
    for (int k = 0; k < 2; k++)
        uv[k] = a->uv[k] * (1 - u - v) + b->uv[k] * u + c->uv[k] * v;
}

/* Alpha test: a hit where the mask is open is no hit. Same rule as the fragment shader (mesh.h, masked). */
static void filter(const struct RTCFilterFunctionNArguments *args)
{
    if (args->N != 1 || !args->valid[0])
        return;
    const struct leaf_mask *mask = args->geometryUserPtr;
    const struct RTCHit *hit = (const struct RTCHit *)(const void *)args->hit;
    float uv[2];
    interpolate_uv(mask, hit->primID, hit->u, hit->v, uv);
    if (sv_texture_alpha(&mask->material->albedo, uv[0], uv[1]) * mask->material->base_color[3] <
        mask->material->alpha_cutoff)
        args->valid[0] = 0;
}

static enum sv_status build_mesh(struct sv_truth *truth, const struct sv_tree_mesh *mesh, const char *name,
                                 struct mesh_scene *s, struct sv_error *error)
{
    s->scene = rtcNewScene(truth->device);
    if (!s->scene)
        return sv_fail(error, SV_EINTERNAL, "embree", "no scene for the mesh of %s", name);
    for (int m = 0; m < mesh->material_count; m++) {
        const struct sv_tree_material *material = &mesh->materials[m];
        if (material->index_count == 0)
            continue;
        s->masks[m] = (struct leaf_mask){mesh, material};
        RTCGeometry g = rtcNewGeometry(truth->device, RTC_GEOMETRY_TYPE_TRIANGLE);
        rtcSetSharedGeometryBuffer(g, RTC_BUFFER_TYPE_VERTEX, 0, RTC_FORMAT_FLOAT3, mesh->vertices, 0,
                                   sizeof *mesh->vertices, mesh->vertex_count);
        rtcSetSharedGeometryBuffer(g, RTC_BUFFER_TYPE_INDEX, 0, RTC_FORMAT_UINT3, mesh->indices,
                                   material->first_index * sizeof *mesh->indices, 3 * sizeof *mesh->indices,
                                   material->index_count / 3);
        rtcSetGeometryUserData(g, &s->masks[m]);
        if (material->masked && material->albedo.data) {
            rtcSetGeometryIntersectFilterFunction(g, filter);
            rtcSetGeometryOccludedFilterFunction(g, filter);
        }
        rtcCommitGeometry(g);
        rtcAttachGeometryByID(s->scene, g, (unsigned)m);
        rtcReleaseGeometry(g);
    }
    rtcCommitScene(s->scene);
    return SV_OK;
}

/* Where a mesh stands. */
struct stance {
    struct sv_vec3 place; /* world */
    float height_m, rotation_rad;
};

static struct stance tree_stance(const struct sv_tree *tree)
{
    return (struct stance){sv_vec3(tree->x, tree->y, tree->z), tree->height_m, tree->rotation_rad};
}

static struct stance object_stance(const struct sv_scene_object *o)
{
    return (struct stance){sv_vec3(o->x, o->y, o->z), (float)o->height_m, (float)o->heading_rad};
}

/* local_from_model, 3 x 4 column-major: scale, clockwise rotation, place. */
static void stance_transform(const struct sv_truth *truth, const struct stance *at, float m[12])
{
    float c = cosf(at->rotation_rad) * at->height_m, s = sinf(at->rotation_rad) * at->height_m;
    struct sv_vec3 local = sv_sub(at->place, truth->origin);
    const float t[12] = {
        c, -s, 0, s, c, 0, 0, 0, at->height_m, (float)local.x, (float)local.y, (float)local.z};
    memcpy(m, t, sizeof t);
}

/* A new instance; the caller attaches and releases it. */
static RTCGeometry make_instance(const struct sv_truth *truth, const struct mesh_scene *mesh,
                                 struct stance at)
{
    RTCGeometry g = rtcNewGeometry(truth->device, RTC_GEOMETRY_TYPE_INSTANCE);
    float m[12];
    stance_transform(truth, &at, m);
    rtcSetGeometryInstancedScene(g, mesh->scene);
    rtcSetGeometryTransform(g, 0, RTC_FORMAT_FLOAT3X4_COLUMN_MAJOR, m);
    rtcCommitGeometry(g);
    return g;
}

static void attach_trees(struct sv_truth *truth)
{
    const struct sv_forest *forest = &truth->scene->forest;
    for (uint32_t k = 0; k < forest->count; k++) {
        const struct sv_tree *tree = &forest->trees[k];
        RTCGeometry g = make_instance(truth, &truth->species[tree->species], tree_stance(tree));
        rtcAttachGeometryByID(truth->full, g, k);
        rtcReleaseGeometry(g);
    }
}

static void attach_objects(struct sv_truth *truth)
{
    for (int k = 0; k < truth->scene->object_count; k++) {
        const struct sv_scene_object *o = &truth->scene->objects[k];
        RTCGeometry g = make_instance(truth, &truth->models[o->model], object_stance(o));
        rtcAttachGeometryByID(truth->full, g, truth->object_id + (unsigned)k);
        rtcAttachGeometryByID(truth->terrain_only, g, truth->object_id + (unsigned)k);
        rtcReleaseGeometry(g);
    }
}

static enum sv_status build_meshes(struct sv_truth *truth, struct sv_error *error)
{
    const struct sv_scene *scene = truth->scene;
    enum sv_status status = SV_OK;
    for (int k = 0; k < scene->species_count && !status; k++)
        if (scene->species[k].tree_count)
            status =
                build_mesh(truth, &scene->species[k].mesh, scene->species[k].name, &truth->species[k], error);
    for (int k = 0; k < scene->model_count && !status; k++)
        status = build_mesh(truth, &scene->models[k].mesh, scene->models[k].file, &truth->models[k], error);
    return status;
}

static enum sv_status build(struct sv_truth *truth, struct sv_error *error)
{
    const struct sv_scene *scene = truth->scene;
    struct device_error problem = {RTC_ERROR_NONE, ""};
    truth->device = rtcNewDevice("threads=1,start_threads=0,set_affinity=0");
    if (!truth->device)
        return sv_fail(error, SV_EINTERNAL, "embree", "no device: error %d", (int)rtcGetDeviceError(NULL));
    rtcSetDeviceErrorFunction(truth->device, note_error, &problem);
    truth->species = calloc((size_t)scene->species_count + 1, sizeof *truth->species);
    truth->models = calloc((size_t)scene->model_count + 1, sizeof *truth->models);
    if (!truth->species || !truth->models)
        return sv_fail(error, SV_ENOMEM, NULL, "no memory for the ray-cast meshes");
    truth->full = rtcNewScene(truth->device);
    truth->terrain_only = rtcNewScene(truth->device);
    enum sv_status status = build_meshes(truth, error);
    if (status)
        return status;
    truth->terrain_id = scene->forest.count;
    truth->object_id = truth->terrain_id + 1;
    attach_trees(truth);
    attach_objects(truth);
    status = sv_terrain_patches_init(&truth->patches, &scene->terrain.field, truth->origin, error);
    if (status)
        return status;
    RTCGeometry terrain = sv_terrain_patches_geometry(truth->device, &truth->patches);
    rtcAttachGeometryByID(truth->full, terrain, truth->terrain_id);
    rtcAttachGeometryByID(truth->terrain_only, terrain, truth->terrain_id);
    rtcReleaseGeometry(terrain);
    rtcCommitScene(truth->full);
    rtcCommitScene(truth->terrain_only);
    rtcSetDeviceErrorFunction(truth->device, NULL, NULL);
    if (problem.code != RTC_ERROR_NONE)
        return sv_fail(error, problem.code == RTC_ERROR_OUT_OF_MEMORY ? SV_ENOMEM : SV_EINTERNAL, "embree",
                       "error %d while building: %s", (int)problem.code, problem.text);
    return SV_OK;
}

enum sv_status sv_truth_create(const struct sv_scene *scene, struct sv_truth **out, struct sv_error *error)
{
    struct sv_truth *truth = calloc(1, sizeof *truth);
    if (!truth)
        return sv_fail(error, SV_ENOMEM, NULL, "no memory for the ray-cast reference");
    const struct sv_heightfield *f = &scene->terrain.field;
    truth->scene = scene;
    truth->origin = sv_vec3((f->x0 + sv_heightfield_x1(f)) / 2, (f->y0 + sv_heightfield_y1(f)) / 2, f->z0);
    sv_color_init();
    enum sv_status status = sv_terrain_detail_init(error);
    if (!status)
        status = build(truth, error);
    if (status) {
        sv_truth_destroy(truth);
        return status;
    }
    *out = truth;
    return SV_OK;
}

static void release_scene(RTCScene scene)
{
    if (scene)
        rtcReleaseScene(scene);
}

void sv_truth_destroy(struct sv_truth *truth)
{
    if (!truth)
        return;
    release_scene(truth->full);
    release_scene(truth->terrain_only);
    for (int k = 0; truth->species && k < truth->scene->species_count; k++)
        release_scene(truth->species[k].scene);
    for (int k = 0; truth->models && k < truth->scene->model_count; k++)
        release_scene(truth->models[k].scene);
    if (truth->device)
        rtcReleaseDevice(truth->device);
    sv_terrain_patches_finish(&truth->patches);
    free(truth->species);
    free(truth->models);
    free(truth);
}

/* ---- one ray ---- */

struct caster {
    const struct sv_truth *truth;
    const struct sv_light *light;
    const struct sv_truth_options *options;
    const struct sv_camera *camera;
    RTCScene scene;
    struct sv_vec3 eye_local;
    double pixel_angle; /* size of a pixel at depth 1: what the ground's detail fades by */
};

struct hit {
    bool any;
    bool terrain;
    double depth_m;
    struct sv_vec3 local;  /* place */
    struct sv_vec3 normal; /* shading normal, unit, turned to the viewer on trees and objects */
    float albedo[3], occlusion, translucency;
    float open; /* share of the sun that the tree's own crown is taken to let through, where no shadow is cast
                 */
    bool leaf;
    uint32_t id;
};

static void set_ray(struct RTCRay *ray, struct sv_vec3 origin, struct sv_vec3 direction, double t_min)
{
    ray->org_x = (float)origin.x;
    ray->org_y = (float)origin.y;
    ray->org_z = (float)origin.z;
    ray->dir_x = (float)direction.x;
    ray->dir_y = (float)direction.y;
    ray->dir_z = (float)direction.z;
    ray->tnear = (float)t_min;
    ray->tfar = INFINITY;
    ray->time = 0;
    ray->mask = ~0u;
    ray->id = 0;
    ray->flags = 0;
}

static struct sv_vec3 model_normal(const struct sv_tree_vertex *v)
{
    return sv_vec3(v->normal[0], v->normal[1], v->normal[2]);
}

/* The mesh that was hit, and its stance; writes the id. */
static const struct leaf_mask *hit_instance(const struct sv_truth *truth, const struct RTCHit *h,
                                            double *rotation_rad, uint32_t *id)
{
    if (h->instID[0] >= truth->object_id) {
        unsigned k = h->instID[0] - truth->object_id;
        const struct sv_scene_object *o = &truth->scene->objects[k];
        *rotation_rad = o->heading_rad;
        *id = SV_ID_OBJECT_FIRST + k;
        return &truth->models[o->model].masks[h->geomID];
    }
    const struct sv_tree *tree = &truth->scene->forest.trees[h->instID[0]];
    *rotation_rad = (double)tree->rotation_rad;
    *id = SV_ID_TREE_FIRST + tree->number;
    return &truth->species[tree->species].masks[h->geomID];
}

static void mesh_hit(const struct caster *caster, const struct RTCHit *h, struct sv_vec3 direction,
                     struct hit *hit)
{
    double rotation_rad;
    const struct leaf_mask *mask = hit_instance(caster->truth, h, &rotation_rad, &hit->id);
    const struct sv_tree_material *material = mask->material;
    const uint32_t *index = mask->mesh->indices + material->first_index + (size_t)h->primID * 3;
    const struct sv_tree_vertex *a = &mask->mesh->vertices[index[0]], *b = &mask->mesh->vertices[index[1]],
                                *c = &mask->mesh->vertices[index[2]];
    double u = (double)h->u, v = (double)h->v, w = 1 - u - v;
    struct sv_vec3 n = sv_scale(model_normal(a), w);
    n = sv_madd(sv_madd(n, model_normal(b), u), model_normal(c), v);
    n = sv_normalize(sv_rotate_clockwise(n, rotation_rad));
    hit->normal = sv_dot(n, direction) > 0 ? sv_scale(n, -1) : n;
    hit->occlusion = (float)((w * a->occlusion + u * b->occlusion + v * c->occlusion) / 65535);
    struct sv_vec3 sun = sv_rotate_clockwise(caster->light->to_sun, -rotation_rad);
    const float d[3] = {(float)sun.x, (float)sun.y, (float)sun.z};
    hit->open = (float)(w * (double)sv_tree_vertex_open(a, d) + u * (double)sv_tree_vertex_open(b, d) +
                        v * (double)sv_tree_vertex_open(c, d));
    float rgba[4] = {1, 1, 1, 1};
    if (material->albedo.data) {
        float uv[2];
        interpolate_uv(mask, h->primID, h->u, h->v, uv);
        sv_texture_rgba(&material->albedo, uv[0], uv[1], rgba);
    }
    for (int k = 0; k < 3; k++)
        hit->albedo[k] = rgba[k] * material->base_color[k];
    hit->leaf = material->is_leaf;
    hit->translucency = material->translucency;
}

static void cast(const struct caster *caster, struct sv_vec3 origin, struct sv_vec3 direction,
                 struct hit *hit)
{
    const struct sv_truth *truth = caster->truth;
    struct sv_patch_context context;
    rtcInitIntersectContext(&context.embree);
    context.embree.flags = RTC_INTERSECT_CONTEXT_FLAG_COHERENT;
    context.ray = (struct sv_patch_ray){origin, direction};
    struct RTCRayHit rh;
    set_ray(&rh.ray, origin, direction,
            caster->camera->projection == SV_PROJECTION_PERSPECTIVE ? caster->camera->near_m : 0);
    rh.hit.geomID = RTC_INVALID_GEOMETRY_ID;
    rh.hit.instID[0] = RTC_INVALID_GEOMETRY_ID;
    rtcIntersect1(caster->scene, &context.embree, &rh);
    memset(hit, 0, sizeof *hit);
    hit->any = rh.hit.geomID != RTC_INVALID_GEOMETRY_ID;
    if (!hit->any)
        return;
    hit->depth_m = (double)rh.ray.tfar;
    hit->local = sv_madd(origin, direction, hit->depth_m);
    hit->terrain = rh.hit.instID[0] == RTC_INVALID_GEOMETRY_ID;
    if (!hit->terrain) {
        mesh_hit(caster, &rh.hit, direction, hit);
        return;
    }
    double pixel_m = caster->camera->projection == SV_PROJECTION_PERSPECTIVE
                         ? caster->pixel_angle * hit->depth_m
                         : caster->pixel_angle;
    sv_terrain_shade(&truth->scene->terrain, hit->local.x + truth->origin.x, hit->local.y + truth->origin.y,
                     pixel_m, sv_scale(sv_normalize(direction), -1), hit->albedo, &hit->normal);
    hit->occlusion = hit->open = 1;
    hit->id = SV_ID_TERRAIN;
}

/* 1 where the sun is seen from the hit, else 0; without shadows what the crown lets through on the average.
 */
static float sun_visible(const struct caster *caster, const struct hit *hit)
{
    if (!caster->options->shadows)
        return hit->open;
    if (caster->light->to_sun.z <= 0)
        return 0;
    /* Off the surface by more than what float rays may miss: a part of the distance, and a millimetre. */
    double off = 1e-3 + 2e-6 * (hit->depth_m + sv_length(hit->local));
    struct sv_vec3 side =
        sv_dot(hit->normal, caster->light->to_sun) >= 0 ? hit->normal : sv_scale(hit->normal, -1);
    struct sv_vec3 from = sv_madd(hit->local, side, off);
    struct sv_patch_context context;
    rtcInitIntersectContext(&context.embree);
    context.ray = (struct sv_patch_ray){from, caster->light->to_sun};
    struct RTCRay ray;
    set_ray(&ray, from, caster->light->to_sun, off);
    rtcOccluded1(caster->scene, &context.embree, &ray);
    return ray.tfar < 0 ? 0 : 1;
}

static void shade(const struct caster *caster, struct sv_vec3 direction, const struct hit *hit, float rgba[4])
{
    struct sv_vec3 unit = sv_normalize(direction);
    rgba[3] = 1;
    if (!hit->any) {
        if (caster->options->sky)
            sv_light_sky(caster->light, unit, rgba);
        else
            rgba[0] = rgba[1] = rgba[2] = rgba[3] = 0;
        return;
    }
    float visible = sun_visible(caster, hit);
    if (hit->leaf)
        sv_light_leaf(caster->light, hit->normal, sv_scale(unit, -1), hit->albedo, hit->occlusion,
                      hit->translucency, visible, rgba);
    else
        sv_light_surface(caster->light, hit->normal, hit->albedo, hit->occlusion, visible, rgba);
    if (caster->light->air)
        sv_light_air(caster->light, sv_length(sv_sub(hit->local, caster->eye_local)), rgba);
}

static void pixel_color(const struct caster *caster, int i, int j, uint8_t out[4])
{
    float sum[4] = {0};
    int samples = caster->options->samples;
    for (int k = 0; k < samples; k++) {
        double dx, dy;
        sv_camera_sample_offset(samples, k, &dx, &dy);
        struct sv_vec3 origin, direction;
        sv_camera_ray(caster->camera, i + 0.5 + dx, j + 0.5 + dy, &origin, &direction);
        struct hit hit;
        cast(caster, sv_add(caster->eye_local, origin), direction, &hit);
        float rgba[4];
        shade(caster, direction, &hit, rgba);
        /* Each sample is what a display of one sample would show: clipped, so that a glint does not outshine
         * its pixel. */
        for (int c = 0; c < 3; c++)
            sum[c] += fminf(rgba[c], 1.0f) * rgba[3];
        sum[3] += rgba[3];
    }
    for (int c = 0; c < 3; c++)
        out[c] = sv_srgb8_from_linear(sum[3] > 0 ? sum[c] / sum[3] : 0);
    out[3] = (uint8_t)lrintf(sum[3] * 255.0f / (float)samples);
}

static void pixel_layers(const struct caster *caster, int i, int j, struct sv_truth_picture *picture)
{
    unsigned layers = caster->options->layers;
    struct sv_vec3 origin, direction;
    sv_camera_ray(caster->camera, i + 0.5, j + 0.5, &origin, &direction);
    struct hit hit;
    cast(caster, sv_add(caster->eye_local, origin), direction, &hit);
    size_t at = (size_t)j * (size_t)caster->camera->width + (size_t)i;
    if (layers & 1u << SV_LAYER_DEPTH)
        ((float *)picture->depth.data)[at] = hit.any ? (float)hit.depth_m : INFINITY;
    if (layers & 1u << SV_LAYER_NORMAL) {
        float *n = (float *)picture->normal.data + at * 3;
        n[0] = (float)hit.normal.x;
        n[1] = (float)hit.normal.y;
        n[2] = (float)hit.normal.z;
    }
    if (layers & 1u << SV_LAYER_ID)
        ((uint32_t *)picture->id.data)[at] = hit.any ? hit.id : SV_ID_SKY;
}

enum sv_status sv_truth_render(const struct sv_truth *truth, const struct sv_camera *camera,
                               const struct sv_light *light, const struct sv_truth_options *options,
                               struct sv_truth_picture *picture, struct sv_error *error)
{
    if (options->row_first < 0 || options->row_count < 0 ||
        options->row_first + options->row_count > camera->height)
        return sv_fail(error, SV_EINVAL, "rows", "%d + %d is outside 0..%d", options->row_first,
                       options->row_count, camera->height);
    struct caster caster = {truth, light, options, camera, NULL, sv_sub(camera->eye, truth->origin), 0};
    caster.scene = options->trees ? truth->full : truth->terrain_only;
    caster.pixel_angle = 1 / sv_camera_focal_px(camera);
    unsigned centre = options->layers & ~(1u << SV_LAYER_COLOR);
    /* Embree wants denormals flushed while it traces; the caller's mode comes back afterwards. */
    unsigned mode = _mm_getcsr();
    _MM_SET_FLUSH_ZERO_MODE(_MM_FLUSH_ZERO_ON);
    _MM_SET_DENORMALS_ZERO_MODE(_MM_DENORMALS_ZERO_ON);
    enum sv_status status = SV_OK;
    for (int j = options->row_first; j < options->row_first + options->row_count; j++) {
        if (options->stop && options->stop(options->stop_context)) {
            status = sv_fail(error, SV_ETIMEOUT, NULL, "stopped at row %d of %d", j, camera->height);
            break;
        }
        for (int i = 0; i < camera->width; i++) {
            if (options->layers & 1u << SV_LAYER_COLOR)
                pixel_color(&caster, i, j,
                            (uint8_t *)picture->color.data +
                                ((size_t)j * (size_t)camera->width + (size_t)i) * 4);
            if (centre)
                pixel_layers(&caster, i, j, picture);
        }
    }
    _mm_setcsr(mode);
    return status;
}
