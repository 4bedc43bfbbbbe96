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
    float curve = power * sv_leaf_octave[bits >> 23 & 7] - 255 * 0.055f;
    float line = sv_leaf_min(c * SV_LEAF_LINE, c * SV_LEAF_CHORD + SV_LEAF_CHORD_AT_0);
    return (uint32_t)lrintf(c >= 1.0f / 256 ? curve : line);
}

/* The piece that shows, where in it, and the weights of its corners. */
struct spot {
    const struct sv_leaf_record *record;
    float s, r, w[4];
};

/* A card is two triangles that meet in P0 and P0 + E1 + E2. */
static struct spot spot_of(const struct sv_leaf_form *form, uint32_t piece, uint32_t place)
{
    struct spot spot = {.record = &form->records[piece],
                        .s = (float)(place & 0xffff) * (1.0f / 65535),
                        .r = (float)(place >> 16) * (1.0f / 65535)};
    bool card = spot.record->normal[0] & SV_LEAF_CARD;
    spot.w[1] = card ? sv_leaf_max(spot.s - spot.r, 0) : spot.s;
    spot.w[2] = card ? sv_leaf_min(spot.s, spot.r) : spot.r;
    spot.w[3] = card ? sv_leaf_max(spot.r - spot.s, 0) : 0;
    spot.w[0] = 1 - ((spot.w[1] + spot.w[2]) + spot.w[3]);
    return spot;
}

static float mix4(const float w[4], const float v[4])
{
    return (w[0] * v[0] + w[1] * v[1]) + (w[2] * v[2] + w[3] * v[3]);
}

static float open_of(const struct spot *spot, const float d[3])
{
    float open[4];
    for (int c = 0; c < 4; c++) {
        const int8_t *o = spot->record->open[c];
        float t =
            ((((float)o[0] * d[0] + (float)o[1] * d[1]) + (float)o[2] * d[2]) + (float)o[3]) * (1.0f / 127);
        open[c] = sv_leaf_min(sv_leaf_max(t, 0), 1);
    }
    return mix4(spot->w, open);
}

static float occlusion_of(const struct spot *spot)
{
    float o[4];
    for (int c = 0; c < 4; c++)
        o[c] = spot->record->occlusion[c];
    return mix4(spot->w, o) * (1.0f / 65535);
}

static void normal_of(const struct spot *spot, const float turn[2], float n[3])
{
    float m[3];
    for (int k = 0; k < 3; k++) {
        float v[4];
        for (int c = 0; c < 4; c++)
            v[c] = (float)((int32_t)(spot->record->normal[c] << (22 - 10 * k)) >> 22);
        m[k] = mix4(spot->w, v);
    }
    n[0] = turn[0] * m[0] + turn[1] * m[1];
    n[1] = turn[0] * m[1] - turn[1] * m[0];
    n[2] = m[2];
    float inverse = 1 / sqrtf(sv_leaf_max(dot(n, n), 1e-20f));
    for (int k = 0; k < 3; k++)
        n[k] = n[k] * inverse;
}

/* Level of the texture whose texels are half a pixel to one pixel large: the exponent of how many there are.
 */
static int level_of(const struct sv_leaf_paint *paint, float z)
{
    float texels = paint->texels * (paint->job->eye.orthographic ? 1 : z);
    uint32_t bits;
    memcpy(&bits, &texels, sizeof bits);
    int level = (int)(bits >> 23) - 127;
    return level < 0 ? 0 : level < paint->map->level_count ? level : paint->map->level_count - 1;
}

static void albedo_of(const struct sv_leaf_paint *paint, const struct spot *spot, float z, float rgb[3])
{
    const struct sv_leaf_map *map = paint->map;
    const float *uv = spot->record->uv;
    for (int c = 0; c < 3; c++)
        rgb[c] = paint->material->base_color[c];
    if (!map->rgba)
        return;
    int level = level_of(paint, z), w = map->widths[level], h = map->heights[level];
    const uint8_t(*texel)[4] = level ? (const uint8_t(*)[4])(map->levels + map->offset[level]) : map->rgba;
    float x = sv_leaf_texel((uv[0] + spot->s * uv[2]) + spot->r * uv[4], w);
    float y = sv_leaf_texel((uv[1] + spot->s * uv[3]) + spot->r * uv[5], h);
    float bx = floorf(x), by = floorf(y), fu = x - bx, fv = y - by;
    int i[2], j[2];
    sv_leaf_wrap((int)bx, w, i);
    sv_leaf_wrap((int)by, h, j);
    for (int c = 0; c < 3; c++) {
        float a[4];
        for (int k = 0; k < 4; k++)
            a[k] = sv_linear_from_srgb8[texel[j[k >> 1] * w + i[k & 1]][c]];
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
    float open = open_of(spot, light->model_sun);
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
    struct sight sight = sight_of(paint, i, job->eye.row_first + j, job->depth[p]);
    float n[3], rgb[3], visible = visible_of(paint, &sight, &spot);
    normal_of(&spot, light->turn, n);
    albedo_of(paint, &spot, sight.z, rgb);
    float sign = dot(n, sight.to_viewer) < 0 ? -1.0f : 1.0f;
    for (int k = 0; k < 3; k++)
        n[k] = n[k] * sign;
    float n_l = dot(n, light->to_sun), up = 0.5f + 0.5f * n[2];
    float passes = paint->material->is_leaf ? paint->material->translucency : 0;
    float sun = (n_l >= 0 ? n_l : n_l * -passes) * visible;
    float occlusion = occlusion_of(&spot);
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
