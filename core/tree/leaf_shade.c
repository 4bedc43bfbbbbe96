/* leaf_shade.c - light, a pixel at a time. */
#include "core/tree/leaf_shade.h"

#include <math.h>

#include "core/base/color.h"

static float dot(const float a[3], const float b[3])
{
    return (a[0] * b[0] + a[1] * b[1]) + a[2] * b[2];
}

static float power_of_2(float t)
{
    t = sv_leaf_max(t, -120);
    float whole = floorf(t), part = t - whole, r = sv_leaf_exp2[4];
    for (int k = 3; k >= 0; k--)
        r = r * part + sv_leaf_exp2[k];
    return ldexpf(r, (int)whole);
}

/* Linear light 0..1 -> sRGB code. */
static uint32_t code_of(float c)
{
    c = sv_leaf_min(sv_leaf_max(c, 0), 1);
    uint32_t bits;
    memcpy(&bits, &c, sizeof bits);
    uint32_t mantissa = (bits & 0x007fffff) | 0x3f800000;
    float m, power = sv_leaf_root[3];
    memcpy(&m, &mantissa, sizeof m);
    for (int k = 2; k >= 0; k--)
        power = power * m + sv_leaf_root[k];
    float curve = power * sv_leaf_octave[bits >> 23 & 7] - 255 * 0.055f, line = c * (255 * 12.92f);
    return (uint32_t)lrintf(c >= 1.0f / 256 ? curve : line);
}

/* The triangle of the mesh that shows, and where in it. */
struct spot {
    const struct sv_tree_vertex *v[3];
    float w[3];
};

static struct spot spot_of(const struct sv_leaf_form *form, uint32_t piece, uint32_t place)
{
    const uint32_t *corner = form->corners[piece];
    float s = (float)(place & 0xffff) * (1.0f / 65535), r = (float)(place >> 16) * (1.0f / 65535);
    bool single = corner[3] == SV_LEAF_NO_VERTEX, first = single || s >= r;
    float b = single ? s : first ? s - r : s, c = single || first ? r : r - s;
    const struct sv_tree_vertex *v = form->mesh->vertices;
    return (struct spot){{&v[corner[0]], &v[corner[first ? 1 : 2]], &v[corner[first ? 2 : 3]]},
                         {1 - (b + c), b, c}};
}

static float mix3(const struct spot *spot, float a, float b, float c)
{
    return (spot->w[0] * a + spot->w[1] * b) + spot->w[2] * c;
}

static float open_of(const struct sv_tree_vertex *v, const float d[3])
{
    float t = ((((float)v->open[0] * d[0] + (float)v->open[1] * d[1]) + (float)v->open[2] * d[2]) +
               (float)v->open[3]) *
              (1.0f / 127);
    return sv_leaf_min(sv_leaf_max(t, 0), 1);
}

static void normal_of(const struct spot *spot, const float turn[2], float n[3])
{
    float m[3];
    for (int k = 0; k < 3; k++)
        m[k] = mix3(spot, (float)spot->v[0]->normal[k], (float)spot->v[1]->normal[k],
                    (float)spot->v[2]->normal[k]);
    n[0] = turn[0] * m[0] + turn[1] * m[1];
    n[1] = turn[0] * m[1] - turn[1] * m[0];
    n[2] = m[2];
    float inverse = 1 / sqrtf(sv_leaf_max(dot(n, n), 1e-20f));
    for (int k = 0; k < 3; k++)
        n[k] = n[k] * inverse;
}

static void albedo_of(const struct sv_tree_material *material, const struct spot *spot, float rgb[3])
{
    const struct sv_image *image = &material->albedo;
    float u = mix3(spot, spot->v[0]->uv[0], spot->v[1]->uv[0], spot->v[2]->uv[0]);
    float v = mix3(spot, spot->v[0]->uv[1], spot->v[1]->uv[1], spot->v[2]->uv[1]);
    for (int c = 0; c < 3; c++)
        rgb[c] = material->base_color[c];
    if (!image->data)
        return;
    const uint8_t(*texel)[4] = image->data;
    float x = sv_leaf_texel(u, image->width), y = sv_leaf_texel(v, image->height);
    float bx = floorf(x), by = floorf(y), fu = x - bx, fv = y - by;
    int i[2], j[2];
    sv_leaf_wrap((int)bx, image->width, i);
    sv_leaf_wrap((int)by, image->height, j);
    for (int c = 0; c < 3; c++) {
        float a[4];
        for (int k = 0; k < 4; k++)
            a[k] = sv_linear_from_srgb8[texel[j[k >> 1] * image->width + i[k & 1]][c]];
        float top = a[0] + (a[1] - a[0]) * fu, low = a[2] + (a[3] - a[2]) * fu;
        rgb[c] = (top + (low - top) * fv) * rgb[c];
    }
}

static float functional(const float f[3], float i, float j)
{
    return (f[0] * i + f[1] * j) + f[2];
}

/* Share of sunlight on the tree's grid: tree_light in tree_light.glsl. */
static float arriving(const struct sv_leaf_light *light, bool orthographic, float i, float j, float z)
{
    float z0 = orthographic ? 1 : z, z1 = orthographic ? z : 0;
    float column = (functional(light->column, i, j) * z0 + light->column[3] * z1) + light->column[4];
    float row = (functional(light->row, i, j) * z0 + light->row[3] * z1) + light->row[4];
    column = sv_leaf_min(sv_leaf_max(column, 0), SV_SHADE_COLUMNS - 1);
    row = sv_leaf_min(sv_leaf_max(row, 0), SV_SHADE_ROWS - 1);
    float first = 0, second = 0;
    for (int k = 0; k < SV_SHADE_ROWS; k++) {
        float near = sv_leaf_max(1 - fabsf(row - (float)k), 0);
        first = first + near * light->share[0][k];
        second = second + near * light->share[1][k];
    }
    return first + (second - first) * column;
}

struct sight {
    float i, j, z, distance, to_viewer[3];
};

static struct sight sight_of(const struct sv_leaf_paint *paint, int i, int j, float d)
{
    const struct sv_leaf_eye *eye = &paint->job->eye;
    const struct sv_leaf_light *light = paint->light;
    struct sight sight = {.i = (float)i, .j = (float)j};
    if (eye->orthographic) {
        sight.distance = sight.z = (1 - d) * eye->far_m;
        memcpy(sight.to_viewer, light->to_viewer, sizeof sight.to_viewer);
        return sight;
    }
    float ray[3];
    for (int k = 0; k < 3; k++)
        ray[k] = functional(light->ray[k], sight.i, sight.j);
    float length = sqrtf(dot(ray, ray)), inverse = -1 / length;
    sight.z = eye->near_m / d;
    sight.distance = sight.z * length;
    for (int k = 0; k < 3; k++)
        sight.to_viewer[k] = ray[k] * inverse;
    return sight;
}

static float visible_of(const struct sv_leaf_paint *paint, const struct sight *sight, const struct spot *spot)
{
    const struct sv_leaf_light *light = paint->light;
    float open = mix3(spot, open_of(spot->v[0], light->model_sun), open_of(spot->v[1], light->model_sun),
                      open_of(spot->v[2], light->model_sun));
    if (!light->shadows)
        return open;
    float facing = dot(sight->to_viewer, light->to_sun);
    float hot = power_of_2(sv_leaf_min((facing - 1) * SV_LEAF_HOT_EXP2, 0));
    open = sv_leaf_min(open * (light->crown * (1 + SV_LEAF_HOT * hot)), 1);
    return open * arriving(light, paint->job->eye.orthographic, sight->i, sight->j, sight->z);
}

static void shade_pixel(const struct sv_leaf_paint *paint, uint32_t at)
{
    const struct sv_leaf_light *light = paint->light;
    const struct sv_leaf_job *job = paint->job;
    int i = (int)(at & 0xffff), j = (int)(at >> 16);
    size_t p = (size_t)j * (size_t)job->eye.width + (size_t)i;
    struct spot spot = spot_of(job->form, job->seen[p].piece - 1, job->seen[p].place);
    struct sight sight = sight_of(paint, i, j, job->depth[p]);
    float n[3], rgb[3], visible = visible_of(paint, &sight, &spot);
    normal_of(&spot, light->turn, n);
    albedo_of(paint->material, &spot, rgb);
    float sign = dot(n, sight.to_viewer) < 0 ? -1.0f : 1.0f;
    for (int k = 0; k < 3; k++)
        n[k] = n[k] * sign;
    float n_l = dot(n, light->to_sun), up = 0.5f + 0.5f * n[2];
    float passes = paint->material->is_leaf ? paint->material->translucency : 0;
    float sun = (n_l >= 0 ? n_l : n_l * -passes) * visible;
    float occlusion = mix3(&spot, spot.v[0]->occlusion, spot.v[1]->occlusion, spot.v[2]->occlusion) *
                      (1.0f / 65535);
    float clear = light->air ? power_of_2(sight.distance * light->air_scale) : 1;
    uint32_t code = 0xff000000;
    for (int c = 0; c < 3; c++) {
        float ambient = (light->ground[c] + (light->sky[c] - light->ground[c]) * up) * occlusion;
        float lit = rgb[c] * (light->sun[c] * sun + ambient);
        lit = lit > 0.5f ? 1 - 0.25f / lit : lit;
        if (light->air)
            lit = light->air_rgb[c] + (lit - light->air_rgb[c]) * clear;
        code |= code_of(lit) << 8 * c;
    }
    memcpy(paint->color[p], &code, sizeof code);
    if (paint->id)
        paint->id[p] = light->id;
    if (paint->normal)
        memcpy(paint->normal[p], n, sizeof n);
    job->seen[p] = (struct sv_leaf_seen){0, 0};
}

void sv_leaf_shade_scalar(const struct sv_leaf_paint *paint, const uint32_t *pixel, int n)
{
    for (int k = 0; k < n; k++)
        shade_pixel(paint, pixel[k]);
}
