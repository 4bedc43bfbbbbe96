/* object_truth.c - see object_truth.h. */
#include "tests/experiments/object_truth.h"

#include <embree3/rtcore.h>
#include <stdlib.h>
#include <string.h>

#include "core/base/color.h"
#include "core/base/frames.h"

struct object_truth {
    const struct sv_tree_mesh *mesh;
    RTCDevice device;
    RTCScene scene;
};

struct object_truth *object_truth_create(const struct sv_tree_mesh *mesh)
{
    struct object_truth *t = calloc(1, sizeof *t);
    if (!t)
        abort();
    t->mesh = mesh;
    t->device = rtcNewDevice("threads=1");
    t->scene = rtcNewScene(t->device);
    rtcSetSceneFlags(t->scene, RTC_SCENE_FLAG_ROBUST); /* no leaks along shared edges */
    RTCGeometry g = rtcNewGeometry(t->device, RTC_GEOMETRY_TYPE_TRIANGLE);
    float *p =
        rtcSetNewGeometryBuffer(g, RTC_BUFFER_TYPE_VERTEX, 0, RTC_FORMAT_FLOAT3, 12, mesh->vertex_count);
    void *k =
        rtcSetNewGeometryBuffer(g, RTC_BUFFER_TYPE_INDEX, 0, RTC_FORMAT_UINT3, 12, mesh->index_count / 3);
    for (uint32_t i = 0; i < mesh->vertex_count; i++)
        memcpy(p + 3 * (size_t)i, mesh->vertices[i].position, 12);
    memcpy(k, mesh->indices, mesh->index_count * sizeof *mesh->indices);
    rtcCommitGeometry(g);
    rtcAttachGeometry(t->scene, g);
    rtcReleaseGeometry(g);
    rtcCommitScene(t->scene);
    return t;
}

void object_truth_destroy(struct object_truth *truth)
{
    rtcReleaseScene(truth->scene);
    rtcReleaseDevice(truth->device);
    free(truth);
}

static struct RTCRayHit ray_of(struct sv_vec3 o, struct sv_vec3 d)
{
    struct RTCRayHit r;
    memset(&r, 0, sizeof r);
    r.ray.org_x = (float)o.x, r.ray.org_y = (float)o.y, r.ray.org_z = (float)o.z;
    r.ray.dir_x = (float)d.x, r.ray.dir_y = (float)d.y, r.ray.dir_z = (float)d.z;
    r.ray.tfar = INFINITY;
    r.ray.mask = ~0u;
    r.hit.geomID = RTC_INVALID_GEOMETRY_ID;
    return r;
}

bool object_truth_sunlit(const struct object_truth *truth, struct sv_vec3 at, struct sv_vec3 n,
                         struct sv_vec3 to_sun, double bias)
{
    struct RTCRayHit r = ray_of(sv_madd(at, n, bias), to_sun);
    struct RTCIntersectContext context;
    rtcInitIntersectContext(&context);
    rtcOccluded1(truth->scene, &context, &r.ray);
    return r.ray.tfar > 0; /* minus infinity: occluded */
}

static void albedo_at(const struct sv_tree_mesh *mesh, double u, double v, float rgb[3])
{
    const struct sv_image *image = &mesh->materials[0].albedo;
    const uint8_t *texels = image->data;
    double x = u * image->width - 0.5, y = v * image->height - 0.5;
    int i = (int)floor(x), j = (int)floor(y);
    for (int c = 0; c < 3; c++) {
        float sum = 0;
        for (int k = 0; k < 4; k++) {
            int a = ((i + (k & 1)) % image->width + image->width) % image->width;
            int b = ((j + (k >> 1)) % image->height + image->height) % image->height;
            double wx = k & 1 ? x - i : 1 - (x - i), wy = k >> 1 ? y - j : 1 - (y - j);
            sum += (float)(wx * wy) * sv_linear_from_srgb8[texels[4 * (b * image->width + a) + c]];
        }
        rgb[c] = sum;
    }
}

/* Normal and albedo at a hit. */
static struct sv_vec3 surface_at(const struct object_truth *truth, const struct RTCHit *hit, float albedo[3])
{
    const struct sv_tree_mesh *m = truth->mesh;
    const float w[3] = {1 - hit->u - hit->v, hit->u, hit->v};
    double n[3] = {0, 0, 0}, uv[2] = {0, 0};
    for (int k = 0; k < 3; k++) {
        const struct sv_tree_vertex *x = &m->vertices[m->indices[3 * (size_t)hit->primID + (size_t)k]];
        for (int a = 0; a < 3; a++)
            n[a] += (double)w[k] * x->normal[a];
        for (int a = 0; a < 2; a++)
            uv[a] += (double)(w[k] * x->uv[a]);
    }
    albedo_at(m, uv[0], uv[1], albedo);
    return sv_normalize(sv_vec3(n[0], n[1], n[2]));
}

void object_truth_draw(const struct object_truth *truth, const struct sv_relief_place *place,
                       const struct sv_camera *camera, const struct sv_light *light, bool shadows,
                       float *depth_m, uint8_t (*rgba)[4])
{
    struct RTCIntersectContext context;
    rtcInitIntersectContext(&context);
    struct sv_light turned = light ? *light : (struct sv_light){0};
    turned.to_sun = sv_rotate_clockwise(turned.to_sun, -place->heading_rad);
    for (int j = 0; j < camera->height; j++)
        for (int i = 0; i < camera->width; i++) {
            size_t p = (size_t)j * (size_t)camera->width + (size_t)i;
            struct sv_vec3 o, d;
            sv_camera_ray(camera, i + 0.5, j + 0.5, &o, &d);
            o = sv_relief_place_to_model(place, sv_add(camera->eye, o));
            d = sv_scale(sv_rotate_clockwise(d, -place->heading_rad), 1 / place->height_m);
            struct RTCRayHit r = ray_of(o, d); /* its parameter stays metres of depth */
            rtcIntersect1(truth->scene, &context, &r);
            bool hit = r.hit.geomID != RTC_INVALID_GEOMETRY_ID;
            depth_m[p] = hit ? r.ray.tfar : INFINITY;
            if (!rgba)
                continue;
            memset(rgba[p], 0, 4);
            if (!hit)
                continue;
            float rgb[3];
            struct sv_vec3 n = surface_at(truth, &r.hit, rgb), at = sv_madd(o, d, (double)r.ray.tfar);
            if (light) {
                bool sun = !shadows || object_truth_sunlit(truth, at, n, turned.to_sun, 1e-4);
                const float albedo[3] = {rgb[0], rgb[1], rgb[2]};
                sv_light_surface(&turned, n, albedo, 1, sun, rgb);
            }
            for (int c = 0; c < 3; c++)
                rgba[p][c] = sv_srgb8_from_linear(rgb[c]);
            rgba[p][3] = 255;
        }
}
