/* truth_build.c - the ray-cast reference's structure: two-level Embree scenes, a scene a species or model, an
 * instance a tree or object, terrain as user geometry; and how it follows a change of the scene.
 *
 * Coordinates are relative to the scene's centre (frames.h, "local"). */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "core/base/color.h"
#include "core/base/frames.h"
#include "core/scene/id.h"
#include "core/terrain/detail.h"
#include "core/truth/texture.h"
#include "core/truth/truth_private.h"

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

void sv_leaf_mask_uv(const struct sv_leaf_mask *mask, unsigned triangle, float u, float v, float uv[2])
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
    const struct sv_leaf_mask *mask = args->geometryUserPtr;
    const struct RTCHit *hit = (const struct RTCHit *)(const void *)args->hit;
    float uv[2];
    sv_leaf_mask_uv(mask, hit->primID, hit->u, hit->v, uv);
    if (sv_texture_alpha(&mask->material->albedo, uv[0], uv[1]) * mask->material->base_color[3] <
        mask->material->alpha_cutoff)
        args->valid[0] = 0;
}

static enum sv_status build_mesh(struct sv_truth *truth, const struct sv_tree_mesh *mesh, const char *name,
                                 struct sv_mesh_scene **out, struct sv_error *error)
{
    struct sv_mesh_scene *s = *out = calloc(1, sizeof *s);
    if (!s)
        return sv_fail(error, SV_ENOMEM, NULL, "no memory for the ray-cast mesh of %s", name);
    s->scene = rtcNewScene(truth->device);
    if (!s->scene)
        return sv_fail(error, SV_EINTERNAL, "embree", "no scene for the mesh of %s", name);
    rtcSetSceneFlags(s->scene, RTC_SCENE_FLAG_CONTEXT_FILTER_FUNCTION); /* hits on what is gone are refused */
    for (int m = 0; m < mesh->material_count; m++) {
        const struct sv_tree_material *material = &mesh->materials[m];
        if (material->index_count == 0)
            continue;
        s->masks[m] = (struct sv_leaf_mask){mesh, material};
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
static RTCGeometry make_instance(const struct sv_truth *truth, const struct sv_mesh_scene *mesh,
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

static void attach_tree(const struct sv_truth *truth, struct sv_truth_layer *layer, const struct sv_tree *tree,
                        uint32_t k)
{
    const struct sv_mesh_scene *mesh = truth->species[tree->species];
    RTCGeometry g = make_instance(truth, mesh, tree_stance(tree));
    rtcAttachGeometryByID(layer->full, g, k);
    rtcReleaseGeometry(g);
    layer->standing[k] = (struct sv_standing){mesh, tree->rotation_rad, SV_ID_TREE_FIRST + tree->number};
}

static void attach_trees(struct sv_truth *truth, struct sv_truth_layer *layer, const struct sv_tree *trees,
                         uint32_t count)
{
    for (uint32_t k = 0; k < count; k++)
        attach_tree(truth, layer, &trees[k], k);
}

static void attach_objects(struct sv_truth *truth, struct sv_truth_layer *layer, uint32_t first)
{
    for (int k = 0; k < truth->scene->object_count; k++) {
        const struct sv_scene_object *o = &truth->scene->objects[k];
        const struct sv_mesh_scene *mesh = truth->models[o->model];
        RTCGeometry g = make_instance(truth, mesh, object_stance(o));
        rtcAttachGeometryByID(layer->full, g, first + (unsigned)k);
        rtcAttachGeometryByID(layer->bare, g, first + (unsigned)k);
        rtcReleaseGeometry(g);
        layer->standing[first + (uint32_t)k] =
            (struct sv_standing){mesh, (float)o->heading_rad, SV_ID_OBJECT_FIRST + o->number};
    }
}

/* Meshes of what the scene has now and that are not there yet. */
static enum sv_status build_meshes(struct sv_truth *truth, struct sv_error *error)
{
    const struct sv_scene *scene = truth->scene;
    enum sv_status status = SV_OK;
    for (int k = 0; k < scene->species_count && !status; k++)
        if (scene->species[k].tree_count && !truth->species[k])
            status =
                build_mesh(truth, &scene->species[k].mesh, scene->species[k].name, &truth->species[k], error);
    struct sv_mesh_scene **models =
        realloc(truth->models, ((size_t)scene->model_count + 1) * sizeof(struct sv_mesh_scene *));
    if (!models)
        return sv_fail(error, SV_ENOMEM, NULL, "no memory for the ray-cast meshes");
    truth->models = models;
    for (; truth->model_count < scene->model_count && !status; truth->model_count++) {
        const struct sv_object_model *m = &scene->models[truth->model_count];
        status = build_mesh(truth, &m->mesh, m->file, &models[truth->model_count], error);
    }
    return status;
}

static enum sv_status start_layer(struct sv_truth *truth, struct sv_truth_layer *layer, uint32_t count,
                                  struct sv_error *error)
{
    layer->standing = calloc((size_t)count + 1, sizeof *layer->standing);
    layer->count = count;
    layer->full = rtcNewScene(truth->device);
    layer->bare = rtcNewScene(truth->device);
    if (layer->full && layer->bare) {
        rtcSetSceneFlags(layer->full, RTC_SCENE_FLAG_CONTEXT_FILTER_FUNCTION);
        rtcSetSceneFlags(layer->bare, RTC_SCENE_FLAG_CONTEXT_FILTER_FUNCTION);
    }
    return layer->standing && layer->full && layer->bare
               ? SV_OK
               : sv_fail(error, SV_ENOMEM, NULL, "no memory for %u ray-cast instances", count);
}

static enum sv_status build_first(struct sv_truth *truth, struct sv_error *error)
{
    const struct sv_scene *scene = truth->scene;
    struct sv_truth_layer *layer = &truth->layers[0];
    truth->species = calloc((size_t)scene->species_count + 1, sizeof(struct sv_mesh_scene *));
    if (!truth->species)
        return sv_fail(error, SV_ENOMEM, NULL, "no memory for the ray-cast meshes");
    truth->tree_count = scene->forest.count;
    truth->object_first = truth->tree_count + 1;
    enum sv_status status = build_meshes(truth, error);
    if (!status)
        status = start_layer(truth, layer, truth->object_first + (uint32_t)scene->object_count, error);
    if (status)
        return status;
    attach_trees(truth, layer, scene->forest.trees, truth->tree_count);
    attach_objects(truth, layer, truth->object_first);
    status = sv_terrain_patches_init(&truth->patches, &scene->terrain.field, truth->origin, error);
    if (status)
        return status;
    RTCGeometry terrain = sv_terrain_patches_geometry(truth->device, &truth->patches);
    rtcAttachGeometryByID(layer->full, terrain, truth->tree_count);
    rtcAttachGeometryByID(layer->bare, terrain, truth->tree_count);
    rtcReleaseGeometry(terrain);
    rtcCommitScene(layer->full);
    rtcCommitScene(layer->bare);
    return SV_OK;
}

enum sv_status sv_truth_layer_of_trees(const struct sv_truth *truth, const uint32_t *trees, uint32_t count,
                                       struct sv_truth_layer *layer, struct sv_error *error)
{
    struct device_error problem = {RTC_ERROR_NONE, ""};
    *layer = (struct sv_truth_layer){.standing = calloc((size_t)count + 1, sizeof *layer->standing),
                                     .count = count,
                                     .full = rtcNewScene(truth->device)};
    if (!layer->standing || !layer->full) {
        sv_truth_layer_release(layer);
        return sv_fail(error, SV_ENOMEM, NULL, "no memory for %u ray-cast instances", count);
    }
    rtcSetDeviceErrorFunction(truth->device, note_error, &problem);
    for (uint32_t k = 0; k < count; k++)
        attach_tree(truth, layer, &truth->scene->forest.trees[trees[k]], k);
    rtcCommitScene(layer->full);
    rtcSetDeviceErrorFunction(truth->device, NULL, NULL);
    if (problem.code == RTC_ERROR_NONE)
        return SV_OK;
    sv_truth_layer_release(layer);
    return sv_fail(error, problem.code == RTC_ERROR_OUT_OF_MEMORY ? SV_ENOMEM : SV_EINTERNAL, "embree",
                   "error %d while building: %s", (int)problem.code, problem.text);
}

/* Runs a step with Embree's errors caught. */
static enum sv_status caught(struct sv_truth *truth,
                             enum sv_status (*step)(struct sv_truth *truth, struct sv_error *error),
                             struct sv_error *error)
{
    struct device_error problem = {RTC_ERROR_NONE, ""};
    rtcSetDeviceErrorFunction(truth->device, note_error, &problem);
    enum sv_status status = step(truth, error);
    rtcSetDeviceErrorFunction(truth->device, NULL, NULL);
    if (!status && problem.code != RTC_ERROR_NONE)
        return sv_fail(error, problem.code == RTC_ERROR_OUT_OF_MEMORY ? SV_ENOMEM : SV_EINTERNAL, "embree",
                       "error %d while building: %s", (int)problem.code, problem.text);
    return status;
}

static enum sv_status build(struct sv_truth *truth, struct sv_error *error)
{
    truth->device = rtcNewDevice("threads=1,start_threads=0,set_affinity=0");
    if (!truth->device)
        return sv_fail(error, SV_EINTERNAL, "embree", "no device: error %d", (int)rtcGetDeviceError(NULL));
    return caught(truth, build_first, error);
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

/* ---- a change ---- */

static int compare_numbers(const void *a, const void *b)
{
    uint32_t p = ((const struct sv_tree *)a)->number, q = ((const struct sv_tree *)b)->number;
    return (p > q) - (p < q);
}

static bool is_gone(const struct sv_truth_change *change, uint32_t number)
{
    struct sv_tree key = {.number = number};
    const struct sv_tree *all = change->gone;
    uint32_t n = change->gone_count;
    return n > 0 && number >= all[0].number && number <= all[n - 1].number &&
           bsearch(&key, all, n, sizeof *all, compare_numbers);
}

/* Marks what goes in the first layer. */
static enum sv_status mark_gone(struct sv_truth *truth, const struct sv_truth_change *change,
                                struct sv_error *error)
{
    struct sv_truth_layer *layer = &truth->layers[0];
    if (!truth->gone)
        truth->gone = calloc((size_t)layer->count + 1, 1);
    if (!truth->gone)
        return sv_fail(error, SV_ENOMEM, NULL, "no memory to mark %u ray-cast instances", layer->count);
    for (uint32_t k = 0; k < truth->tree_count && change->gone_count > 0; k++)
        truth->gone[k] |= is_gone(change, layer->standing[k].id - SV_ID_TREE_FIRST);
    if (change->objects)
        memset(truth->gone + truth->object_first, 1, layer->count - truth->object_first);
    truth->objects_later |= change->objects;
    return SV_OK;
}

/* The trees of the second layer as they are now. */
static enum sv_status choose_later(struct sv_truth *truth, const struct sv_truth_change *change,
                                   struct sv_error *error)
{
    size_t room = (size_t)truth->later_count + change->came_count + 1;
    struct sv_tree *later = realloc(truth->later, room * sizeof *later);
    uint32_t count = 0;
    if (!later)
        return sv_fail(error, SV_ENOMEM, NULL, "no memory for %u ray-cast trees", change->came_count);
    for (uint32_t k = 0; k < truth->later_count; k++)
        if (!is_gone(change, later[k].number))
            later[count++] = later[k];
    for (uint32_t k = 0; k < change->came_count; k++)
        later[count++] = truth->scene->forest.trees[change->came[k]];
    truth->later = later;
    truth->later_count = count;
    return SV_OK;
}

void sv_truth_layer_release(struct sv_truth_layer *layer)
{
    if (layer->full)
        rtcReleaseScene(layer->full);
    if (layer->bare)
        rtcReleaseScene(layer->bare);
    free(layer->standing);
    *layer = (struct sv_truth_layer){0};
}

static enum sv_status build_later(struct sv_truth *truth, struct sv_error *error)
{
    struct sv_truth_layer *layer = &truth->layers[1];
    uint32_t objects = truth->objects_later ? (uint32_t)truth->scene->object_count : 0;
    sv_truth_layer_release(layer);
    enum sv_status status = build_meshes(truth, error);
    if (status || truth->later_count + objects == 0)
        return status;
    status = start_layer(truth, layer, truth->later_count + objects, error);
    if (status)
        return status;
    attach_trees(truth, layer, truth->later, truth->later_count);
    if (objects)
        attach_objects(truth, layer, truth->later_count);
    rtcCommitScene(layer->full);
    rtcCommitScene(layer->bare);
    return SV_OK;
}

enum sv_status sv_truth_change(struct sv_truth *truth, const struct sv_truth_change *change,
                               struct sv_error *error)
{
    enum sv_status status = change->gone_count || change->objects ? mark_gone(truth, change, error) : SV_OK;
    if (!status)
        status = choose_later(truth, change, error);
    return status ? status : caught(truth, build_later, error);
}

static void release_meshes(struct sv_mesh_scene **meshes, int count)
{
    for (int k = 0; meshes && k < count; k++) {
        if (meshes[k] && meshes[k]->scene)
            rtcReleaseScene(meshes[k]->scene);
        free(meshes[k]);
    }
    free(meshes);
}

void sv_truth_destroy(struct sv_truth *truth)
{
    if (!truth)
        return;
    for (int k = 0; k < SV_TRUTH_LAYERS; k++)
        sv_truth_layer_release(&truth->layers[k]);
    release_meshes(truth->species, truth->scene->species_count);
    release_meshes(truth->models, truth->model_count);
    if (truth->device)
        rtcReleaseDevice(truth->device);
    sv_terrain_patches_finish(&truth->patches);
    free(truth->gone);
    free(truth->later);
    free(truth);
}
