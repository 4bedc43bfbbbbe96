/* ground.c - see ground.h: mip levels of the terrain's images, and a view as the row kernels take it. */
#include "core/terrain/ground.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "core/base/color.h"
#include "core/base/simd.h"
#include "core/terrain/ground_rows.h"

struct sv_ground {
    const struct sv_terrain *terrain;
    struct sv_ground_map albedo, normal;
    uint8_t *own[4]; /* what the maps hold of the heap */
    uint8_t *tile;   /* the detail's levels, each row with its first texel once more */
    int32_t tile_first[SV_TERRAIN_DETAIL_LEVELS];
    uint8_t codes[SV_GROUND_CODES + 3];
    float linear[SV_GROUND_CODES];
};

/* ---- mip levels ---- */

/* Two bilinear taps: where texel k of `to` has its middle among `from` texels. */
struct tap {
    int a, b;
    float share; /* of b */
};

static struct tap tap_of(int k, int to, int from)
{
    float at = ((float)k + 0.5f) * (float)from / (float)to - 0.5f;
    int a = at > 0 ? (int)at : 0;
    a = a < from - 1 ? a : from - 1;
    float share = at - (float)a;
    return (struct tap){a, a + 1 < from ? a + 1 : a, share > 0 ? share : 0};
}

/* sRGB: the colours are mixed as light; else as they are. */
static void shrink(const uint8_t *from, int from_w, int from_h, uint8_t *to, int w, int h, int channels,
                   bool srgb)
{
    for (int j = 0; j < h; j++)
        for (int i = 0; i < w; i++) {
            struct tap x = tap_of(i, w, from_w), y = tap_of(j, h, from_h);
            for (int c = 0; c < channels; c++) {
                float v[4];
                const size_t at[4] = {
                    (size_t)y.a * (size_t)from_w + (size_t)x.a, (size_t)y.a * (size_t)from_w + (size_t)x.b,
                    (size_t)y.b * (size_t)from_w + (size_t)x.a, (size_t)y.b * (size_t)from_w + (size_t)x.b};
                for (int k = 0; k < 4; k++) {
                    uint8_t code = from[at[k] * (size_t)channels + (size_t)c];
                    v[k] = srgb ? sv_linear_from_srgb8[code] : (float)code;
                }
                float low = v[0] + (v[1] - v[0]) * x.share, high = v[2] + (v[3] - v[2]) * x.share;
                float mean = low + (high - low) * y.share;
                *to++ = srgb ? sv_srgb8_from_linear(mean) : (uint8_t)(mean + 0.5f);
            }
        }
}

/* An image of one texel across is laid out twice, so that bilinear taps have two. */
static const uint8_t *at_least_two(const struct sv_image *image, int *width, int *height, uint8_t **own)
{
    *width = image->width;
    *height = image->height;
    if (image->width > 1 && image->height > 1)
        return image->data;
    *width = image->width > 1 ? image->width : 2;
    *height = image->height > 1 ? image->height : 2;
    size_t bytes = (size_t)image->channels;
    *own = malloc((size_t)*width * (size_t)*height * bytes);
    for (int j = 0; *own && j < *height; j++)
        for (int i = 0; i < *width; i++)
            memcpy(*own + ((size_t)j * (size_t)*width + (size_t)i) * bytes,
                   (const uint8_t *)image->data +
                       ((size_t)(j % image->height) * (size_t)image->width + (size_t)(i % image->width)) *
                           bytes,
                   bytes);
    return *own;
}

static enum sv_status make_map(const struct sv_image *image, bool srgb, struct sv_ground_map *map,
                               uint8_t **own_base, uint8_t **own_rest, struct sv_error *error)
{
    int w, h, channels = image->channels;
    size_t texels = 0, first[SV_GROUND_LEVELS] = {0};
    map->base = at_least_two(image, &w, &h, own_base);
    for (map->levels = 0; map->levels < SV_GROUND_LEVELS && w >= 2 && h >= 2; map->levels++, w /= 2, h /= 2) {
        int l = map->levels;
        map->width[l] = w;
        map->height[l] = h;
        first[l] = texels;
        map->first[l] = (int32_t)texels;
        texels += l > 0 ? (size_t)w * (size_t)h : 0;
    }
    *own_rest = malloc(texels * (size_t)channels + 1);
    if (!map->base || !*own_rest)
        return sv_fail(error, SV_ENOMEM, "terrain", "no memory for the mip levels of %d x %d texels",
                       image->width, image->height);
    map->rest = *own_rest;
    for (int l = 1; l < map->levels; l++)
        shrink(l == 1 ? map->base : *own_rest + first[l - 1] * (size_t)channels, map->width[l - 1],
               map->height[l - 1], *own_rest + first[l] * (size_t)channels, map->width[l], map->height[l],
               channels, srgb);
    return SV_OK;
}

static enum sv_status check_images(const struct sv_terrain *terrain, struct sv_error *error)
{
    const struct sv_image *a = &terrain->albedo, *n = &terrain->normal;
    if (!a->data || a->channels != 4 || a->type != SV_PIXEL_U8)
        return sv_fail(error, SV_EINVAL, "terrain.albedo", "the terrain has no RGBA u8 colours");
    if (!n->data || n->channels != 2 || n->type != SV_PIXEL_U8 || n->width != terrain->field.width ||
        n->height != terrain->field.height)
        return sv_fail(error, SV_EINVAL, "terrain.normal",
                       "the terrain has no normals at its %d x %d samples", terrain->field.width,
                       terrain->field.height);
    return SV_OK;
}

static enum sv_status lay_out_tile(struct sv_ground *ground, struct sv_error *error)
{
    size_t bytes = 0;
    for (int l = 0; l < SV_TERRAIN_DETAIL_LEVELS; l++) {
        size_t side = SV_TERRAIN_DETAIL_SIDE >> l;
        ground->tile_first[l] = (int32_t)bytes;
        bytes += side * (side + 1) * 4;
    }
    ground->tile = malloc(bytes);
    if (!ground->tile)
        return sv_fail(error, SV_ENOMEM, "terrain", "no memory for the ground's detail");
    uint8_t *to = ground->tile;
    for (int l = 0; l < SV_TERRAIN_DETAIL_LEVELS; l++) {
        const uint8_t *from = sv_terrain_detail_level(l);
        size_t row = (size_t)4 * (SV_TERRAIN_DETAIL_SIDE >> l);
        for (int j = 0; j < SV_TERRAIN_DETAIL_SIDE >> l; j++, from += row, to += row + 4) {
            memcpy(to, from, row);
            memcpy(to + row, from, 4);
        }
    }
    return SV_OK;
}

enum sv_status sv_ground_create(const struct sv_terrain *terrain, struct sv_ground **ground,
                                struct sv_error *error)
{
    enum sv_status status = check_images(terrain, error);
    if (status)
        return status;
    struct sv_ground *made = calloc(1, sizeof *made);
    if (!made)
        return sv_fail(error, SV_ENOMEM, "terrain", "no memory to shade the ground");
    made->terrain = terrain;
    sv_color_init();
    status = sv_terrain_detail_init(error);
    if (!status)
        status = lay_out_tile(made, error);
    if (!status)
        status = make_map(&terrain->albedo, true, &made->albedo, &made->own[0], &made->own[1], error);
    if (!status)
        status = make_map(&terrain->normal, false, &made->normal, &made->own[2], &made->own[3], error);
    if (status) {
        sv_ground_destroy(made);
        return status;
    }
    for (int k = 0; k < SV_GROUND_CODES; k++) {
        made->codes[k] = sv_srgb8_from_linear((float)k / (SV_GROUND_CODES - 1));
        made->linear[k] = sv_linear_from_srgb((float)k / (SV_GROUND_CODES - 1));
    }
    *ground = made;
    return SV_OK;
}

void sv_ground_destroy(struct sv_ground *ground)
{
    if (!ground)
        return;
    for (int k = 0; k < 4; k++)
        free(ground->own[k]);
    free(ground->tile);
    free(ground);
}

/* ---- a view ---- */

static void put_vec(float out[3], struct sv_vec3 v)
{
    out[0] = (float)v.x;
    out[1] = (float)v.y;
    out[2] = (float)v.z;
}

static void set_camera(struct sv_ground_job *job, const struct sv_ground_view *view)
{
    const struct sv_camera *c = view->camera;
    job->width = c->width;
    job->depth = view->depth;
    job->hidden = view->hidden;
    job->sky = view->sky;
    job->orthographic = c->projection == SV_PROJECTION_ORTHOGRAPHIC;
    job->near_m = (float)c->near_m;
    job->far_m = (float)c->far_m;
    job->pixel = (float)(1 / sv_camera_focal_px(c));
    job->centre_x = (float)(0.5 * c->width - view->shift_x_px);
    job->centre_y = (float)(0.5 * c->height - view->shift_y_px);
    put_vec(job->right, c->right);
    put_vec(job->up, c->up);
    put_vec(job->forward, c->forward);
}

static void set_light(struct sv_ground_job *job, const struct sv_light *light)
{
    put_vec(job->to_sun, light->to_sun);
    for (int c = 0; c < 3; c++) {
        job->sun[c] = light->sun_rgb[c];
        job->sky_light[c] = light->sky_rgb[c];
        job->bounce[c] = light->ground_rgb[c];
        job->zenith[c] = light->zenith_rgb[c];
        job->horizon[c] = light->horizon_rgb[c];
        job->air[c] = light->air_rgb[c];
    }
    job->air_per_m = light->air ? 1.0f / light->air_length_m : 0;
}

static void set_maps(struct sv_ground_job *job, const struct sv_ground *ground, struct sv_vec3 eye)
{
    const struct sv_heightfield *f = &ground->terrain->field;
    double size_x = (f->width - 1) * f->dx, size_y = (f->height - 1) * f->dy;
    double texel_m = sqrt(size_x / ground->terrain->albedo.width * (size_y / ground->terrain->albedo.height));
    job->albedo = &ground->albedo;
    job->normal = &ground->normal;
    job->codes = ground->codes;
    job->linear = ground->linear;
    job->albedo_uv[0] = (float)(1 / size_x);
    job->albedo_uv[1] = (float)(1 / size_y);
    job->albedo_uv[2] = (float)((eye.x - f->x0) / size_x);
    job->albedo_uv[3] = (float)((eye.y - f->y0) / size_y);
    job->normal_uv[0] = (float)(1 / (f->dx * f->width));
    job->normal_uv[1] = (float)(1 / (f->dy * f->height));
    job->normal_uv[2] = (float)(((eye.x - f->x0) / f->dx + 0.5) / f->width);
    job->normal_uv[3] = (float)(((eye.y - f->y0) / f->dy + 0.5) / f->height);
    job->texel_m = (float)texel_m;
    job->albedo_lod = (float)log2(texel_m);
    job->normal_lod = (float)log2(sqrt(f->dx * f->dy));
}

static void set_detail(struct sv_ground_job *job, const struct sv_ground *ground, struct sv_vec3 eye)
{
    double at[SV_DETAIL_COUNT][2];
    job->tile = ground->tile;
    memcpy(job->tile_first, ground->tile_first, sizeof job->tile_first);
    sv_terrain_detail_place(eye.x, eye.y, at);
    for (int k = 0; k < SV_DETAIL_COUNT; k++) {
        struct sv_terrain_detail_form form =
            sv_terrain_detail_form((enum sv_terrain_detail_scale)k, (double)job->texel_m);
        double period = sv_terrain_detail_period_m[k];
        job->tile_eye[k][0] = (float)at[k][0];
        job->tile_eye[k][1] = (float)at[k][1];
        job->tile_turn[k][0] = (float)(form.cosine / period);
        job->tile_turn[k][1] = (float)(form.sine / period);
        job->tile_share[k] = form.share;
        job->tile_lod[k] = (float)log2(SV_TERRAIN_DETAIL_SIDE / period);
        job->tile_fade[k][0] = form.fade_from;
        job->tile_fade[k][1] = form.fade_to;
    }
}

/* Places of the eye on each level's lattice: the page that it stands in, and where in it. */
static void set_shadows(struct sv_ground_job *job, const struct sv_ground *ground,
                        struct sv_shadow_pages *pages, struct sv_vec3 eye)
{
    const struct sv_heightfield *f = &ground->terrain->field;
    job->pages = pages;
    if (!pages)
        return;
    job->light = sv_shadow_pages_light(pages);
    job->refined = sv_shadow_pages_refines(pages);
    job->noting = sv_shadow_pages_notes(pages);
    job->finest = sv_shadow_pages_finest(pages);
    for (int l = 0; l < SV_GROUND_PAGE_LEVELS; l++) {
        double side = ldexp(SV_SHADOW_PAGE_TEXEL_M, l - SV_SHADOW_PAGE_FINER) * SV_SHADOW_PAGE_STEP;
        /* An eye that stands very far off the field sees it in coarse levels only. */
        double i = sv_clamp((eye.x - f->x0) / side, -1e9, 1e9),
               j = sv_clamp((eye.y - f->y0) / side, -1e9, 1e9);
        job->page_i[l] = (int32_t)floor(i);
        job->page_j[l] = (int32_t)floor(j);
        job->page_x[l] = (float)((i - floor(i)) * SV_SHADOW_PAGE_STEP);
        job->page_y[l] = (float)((j - floor(j)) * SV_SHADOW_PAGE_STEP);
    }
}

void sv_ground_shade_by(const struct sv_ground *ground, const struct sv_ground_view *view, sv_ground_row *row,
                        uint8_t *rgba)
{
    struct sv_ground_job job;
    memset(&job, 0, sizeof job);
    job.rgba = rgba;
    set_camera(&job, view);
    set_light(&job, view->light);
    set_maps(&job, ground, view->camera->eye);
    set_detail(&job, ground, view->camera->eye);
    set_shadows(&job, ground, view->shadows, view->camera->eye);
    size_t skip = (size_t)view->row_first * (size_t)view->camera->width; /* rows count from the picture's top */
    job.rgba -= 4 * skip;
    job.depth -= skip;
    if (job.hidden)
        job.hidden -= skip;
    int end = view->row_count > 0 ? view->row_first + view->row_count : view->camera->height;
    for (int y = view->row_first; y < end; y++)
        row(&job, y);
}

void sv_ground_shade(const struct sv_ground *ground, const struct sv_ground_view *view, uint8_t *rgba)
{
    sv_ground_shade_by(ground, view,
                       sv_simd_level() >= SV_SIMD_AVX2 ? sv_ground_row_avx2 : sv_ground_row_plain, rgba);
}
