/* truth.c - see truth.h: tracing and shading. Coordinates are relative to the scene's centre (frames.h,
 * "local"); the terrain gets each ray in double besides. */
#include "core/truth/truth.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "core/base/color.h"
#include "core/base/frames.h"
#include "core/scene/id.h"
#include "core/truth/terrain_shade.h"
#include "core/truth/texture.h"
#include "core/truth/truth_private.h"

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

/* Refuses hits on what is no longer there. */
static void refuse_gone(const struct RTCFilterFunctionNArguments *args)
{
    const struct sv_truth_ray *ray = (const struct sv_truth_ray *)(const void *)args->context;
    const struct RTCHit *hit = (const struct RTCHit *)(const void *)args->hit;
    if (args->N == 1 && hit->instID[0] != RTC_INVALID_GEOMETRY_ID && ray->gone[hit->instID[0]])
        args->valid[0] = 0;
}

/* The context of a ray through the first layer; the second one has nothing to refuse. */
static void start_ray(const uint8_t *gone, struct sv_vec3 origin, struct sv_vec3 direction,
                      struct sv_truth_ray *ray)
{
    rtcInitIntersectContext(&ray->patch.embree);
    ray->patch.embree.filter = gone ? refuse_gone : NULL;
    ray->patch.ray = (struct sv_patch_ray){origin, direction};
    ray->gone = gone;
}

static struct sv_vec3 model_normal(const struct sv_tree_vertex *v)
{
    return sv_vec3(v->normal[0], v->normal[1], v->normal[2]);
}

static void mesh_hit(const struct sv_truth_caster *caster, const struct sv_truth_layer *layer, const struct RTCHit *h,
                     struct sv_vec3 direction, struct sv_truth_hit *hit)
{
    const struct sv_standing *standing = &layer->standing[h->instID[0]];
    double rotation_rad = (double)standing->rotation_rad;
    const struct sv_leaf_mask *mask = &standing->mesh->masks[h->geomID];
    hit->id = standing->id;
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
        sv_leaf_mask_uv(mask, h->primID, h->u, h->v, uv);
        sv_texture_rgba(&material->albedo, uv[0], uv[1], rgba);
    }
    for (int k = 0; k < 3; k++)
        hit->albedo[k] = rgba[k] * material->base_color[k];
    hit->leaf = material->is_leaf;
    hit->translucency = material->translucency;
}

static void cast(const struct sv_truth_caster *caster, struct sv_vec3 origin, struct sv_vec3 direction,
                 struct sv_truth_hit *hit)
{
    const struct sv_truth *truth = caster->truth;
    struct sv_truth_ray context;
    start_ray(caster->gone, origin, direction, &context);
    context.patch.embree.flags = RTC_INTERSECT_CONTEXT_FLAG_COHERENT;
    struct RTCRayHit rh;
    set_ray(&rh.ray, origin, direction,
            caster->camera->projection == SV_PROJECTION_PERSPECTIVE ? caster->camera->near_m : 0);
    rh.hit.geomID = RTC_INVALID_GEOMETRY_ID;
    rh.hit.instID[0] = RTC_INVALID_GEOMETRY_ID;
    const struct sv_truth_layer *layer = caster->seen[0];
    rtcIntersect1(caster->scenes[0], &context.patch.embree, &rh);
    if (caster->scenes[1]) {
        float before = rh.ray.tfar;
        context.patch.embree.filter = NULL;
        rtcIntersect1(caster->scenes[1], &context.patch.embree, &rh);
        layer = rh.ray.tfar < before ? caster->seen[1] : layer;
    }
    memset(hit, 0, sizeof *hit);
    hit->any = rh.hit.geomID != RTC_INVALID_GEOMETRY_ID;
    if (!hit->any)
        return;
    hit->depth_m = (double)rh.ray.tfar;
    hit->local = sv_madd(origin, direction, hit->depth_m);
    hit->terrain = rh.hit.instID[0] == RTC_INVALID_GEOMETRY_ID;
    if (!hit->terrain) {
        mesh_hit(caster, layer, &rh.hit, direction, hit);
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

float sv_truth_sun_visible(const struct sv_truth_caster *caster, const struct sv_truth_hit *hit)
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
    struct sv_truth_ray context;
    start_ray(caster->truth->gone, from, caster->light->to_sun, &context);
    struct RTCRay ray;
    set_ray(&ray, from, caster->light->to_sun, off);
    rtcOccluded1(caster->occluders[0], &context.patch.embree, &ray);
    context.patch.embree.filter = NULL;
    if (ray.tfar >= 0 && caster->occluders[1])
        rtcOccluded1(caster->occluders[1], &context.patch.embree, &ray);
    return ray.tfar < 0 ? 0 : 1;
}

static void shade(const struct sv_truth_caster *caster, struct sv_vec3 direction, const struct sv_truth_hit *hit, float rgba[4])
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
    float visible = sv_truth_sun_visible(caster, hit);
    if (hit->leaf)
        sv_light_leaf(caster->light, hit->normal, sv_scale(unit, -1), hit->albedo, hit->occlusion,
                      hit->translucency, visible, rgba);
    else
        sv_light_surface(caster->light, hit->normal, hit->albedo, hit->occlusion, visible, rgba);
    if (caster->light->air)
        sv_light_air(caster->light, sv_length(sv_sub(hit->local, caster->eye_local)), rgba);
}

/* Each sample is what a display of one sample would show: clipped, so that a glint does not outshine its
 * pixel. */
void sv_truth_sample(const struct sv_truth_caster *caster, double px, double py, struct sv_truth_hit *hit,
                     float rgba[4])
{
    struct sv_vec3 origin, direction;
    sv_camera_ray(caster->camera, px, py, &origin, &direction);
    cast(caster, sv_add(caster->eye_local, origin), direction, hit);
    shade(caster, direction, hit, rgba);
    for (int c = 0; c < 3; c++)
        rgba[c] = fminf(rgba[c], 1.0f) * rgba[3];
}

static void pixel_color(const struct sv_truth_caster *caster, int i, int j, uint8_t out[4])
{
    float sum[4] = {0};
    int samples = caster->options->samples;
    for (int k = 0; k < samples; k++) {
        double dx, dy;
        sv_camera_sample_offset(samples, k, &dx, &dy);
        struct sv_truth_hit hit;
        float rgba[4];
        sv_truth_sample(caster, i + 0.5 + dx, j + 0.5 + dy, &hit, rgba);
        for (int c = 0; c < 3; c++)
            sum[c] += rgba[c];
        sum[3] += rgba[3];
    }
    for (int c = 0; c < 3; c++)
        out[c] = sv_srgb8_from_linear(sum[3] > 0 ? sum[c] / sum[3] : 0);
    out[3] = (uint8_t)lrintf(sum[3] * 255.0f / (float)samples);
}

static void pixel_layers(const struct sv_truth_caster *caster, int i, int j, struct sv_truth_picture *picture)
{
    unsigned layers = caster->options->layers;
    struct sv_vec3 origin, direction;
    sv_camera_ray(caster->camera, i + 0.5, j + 0.5, &origin, &direction);
    struct sv_truth_hit hit;
    cast(caster, sv_add(caster->eye_local, origin), direction, &hit);
    size_t at = (size_t)(j - caster->options->row_first) * (size_t)caster->camera->width + (size_t)i;
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

void sv_truth_caster_init(const struct sv_truth *truth, const struct sv_camera *camera,
                          const struct sv_light *light, const struct sv_truth_options *options,
                          struct sv_truth_caster *caster)
{
    *caster = (struct sv_truth_caster){.truth = truth,
                                       .light = light,
                                       .options = options,
                                       .camera = camera,
                                       .gone = truth->gone,
                                       .eye_local = sv_sub(camera->eye, truth->origin),
                                       .pixel_angle = 1 / sv_camera_focal_px(camera)};
    for (int k = 0; k < SV_TRUTH_LAYERS; k++) {
        const struct sv_truth_layer *layer = &truth->layers[k];
        caster->seen[k] = layer;
        caster->scenes[k] = caster->occluders[k] = options->trees ? layer->full : layer->bare;
    }
}

enum sv_status sv_truth_render(const struct sv_truth *truth, const struct sv_camera *camera,
                               const struct sv_light *light, const struct sv_truth_options *options,
                               struct sv_truth_picture *picture, struct sv_error *error)
{
    if (options->row_first < 0 || options->row_count < 0 ||
        options->row_first + options->row_count > camera->height)
        return sv_fail(error, SV_EINVAL, "rows", "%d + %d is outside 0..%d", options->row_first,
                       options->row_count, camera->height);
    struct sv_truth_caster caster;
    sv_truth_caster_init(truth, camera, light, options, &caster);
    unsigned centre = options->layers & ~(1u << SV_LAYER_COLOR);
    unsigned mode = sv_truth_flush_denormals();
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
                                ((size_t)(j - options->row_first) * (size_t)camera->width + (size_t)i) * 4);
            if (centre)
                pixel_layers(&caster, i, j, picture);
        }
    }
    _mm_setcsr(mode);
    return status;
}
