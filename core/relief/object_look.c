/* object_look.c - how a relief object looks under a light, and its warp into a picture.
 *
 * light -> per face: share of sunlight (object_shadow.c; the height below which the surroundings keep the sun
 * away) -> sv_relief_light -> colours, kept. warp -> a source a face -> splat, fill. All is done in model
 * space: light, eye and height are brought there once, which spares six frames and any large number.
 *
 * What is warped is the kept texels only (sv_relief_object_choose): the look's own copy of the colours has
 * alpha 0 everywhere else. Light in the warp (options.in_warp): splat, fill -> the groups of texels
 * that pixels show (object_seen.c) -> light of those. */
#include "core/relief/object.h"

#include <stdlib.h>
#include <string.h>

#include "core/base/frames.h"
#include "core/relief/object_shadow.h"
#include "core/relief/object_splat.h"

/* Six faces, then what is hidden behind each. */
enum { SHEETS = SV_RELIEF_SHEETS };

struct sv_relief_look {
    const struct sv_relief_object *object;
    struct sv_relief face[SHEETS]; /* borrows displ and normal; color is the masked copy */
    uint8_t (*seen[SHEETS])[4];    /* lit colours */
    uint8_t *lit[SHEETS];
    const uint8_t (*color[SHEETS])[4]; /* what the last call of _light made: seen or albedo */
    struct sv_relief_shade *shade;
    struct sv_warp_source source[SHEETS];
    struct sv_relief_span *spans; /* room */
    /* What the last warp shows: groups of texels, cells (object_splat.h). */
    uint8_t *used[SHEETS], *cell[SHEETS], *used_block;
    /* Light that waits for a warp. */
    bool in_warp;
    struct sv_relief_place place;
    struct sv_light light;
    struct sv_relief_look_options options;
    void *block;
};

static size_t texels_of(const struct sv_relief *face)
{
    return (size_t)face->width * (size_t)face->height;
}

static size_t groups_of(const struct sv_relief *face)
{
    return ((size_t)face->width + 7) / 8 * (size_t)face->height;
}

static size_t cells_of(const struct sv_relief *face)
{
    return SV_RELIEF_SEEN_ROOM(face->width, face->height);
}

static void borrow_faces(struct sv_relief_look *look)
{
    uint8_t *at = look->block;
    for (int k = 0; k < SHEETS; k++) {
        const struct sv_relief *from = sv_relief_sheet(look->object, k);
        size_t texels = texels_of(from);
        look->face[k] = *from;
        look->face[k].block = NULL;
        look->face[k].color = (uint8_t(*)[4])(void *)at;
        look->seen[k] = look->face[k].color + texels;
        at += 8 * texels;
        memcpy(look->face[k].color, from->color, 4 * texels);
        for (size_t i = 0; k < SV_RELIEF_FACES && i < texels; i++)
            if (!look->object->keep[k][i])
                look->face[k].color[i][3] = 0;
        memcpy(look->seen[k], look->face[k].color, 4 * texels); /* alpha is the same from now on */
        look->color[k] = (const uint8_t(*)[4])look->face[k].color;
    }
    for (int k = 0; k < SHEETS; k++) {
        look->lit[k] = at;
        at += texels_of(&look->face[k]);
    }
}

enum sv_status sv_relief_look_create(const struct sv_relief_object *object, struct sv_relief_look **look,
                                     struct sv_error *error)
{
    size_t texels = 0, seen = 0;
    for (int k = 0; k < SHEETS; k++) {
        texels += texels_of(sv_relief_sheet(object, k));
        seen += groups_of(sv_relief_sheet(object, k)) + cells_of(sv_relief_sheet(object, k));
    }
    struct sv_relief_look *made = calloc(1, sizeof *made);
    struct sv_relief_span *spans = malloc((size_t)sv_relief_object_spans_max(object) * sizeof *spans);
    uint8_t *used = malloc(seen);
    void *block = calloc(texels, 9);
    if (!made || !block || !spans || !used) {
        free(made);
        free(block);
        free(used);
        free(spans);
        return sv_fail(error, SV_ENOMEM, "look", "no memory for %zu texels", texels);
    }
    *made = (struct sv_relief_look){.object = object, .spans = spans, .used_block = used, .block = block};
    borrow_faces(made);
    for (int k = 0; k < SHEETS; k++) {
        made->used[k] = used;
        used += groups_of(&made->face[k]);
        made->cell[k] = used + made->face[k].width + 1;
        used += cells_of(&made->face[k]);
    }
    enum sv_status status = sv_relief_shade_create(object, &made->shade, error);
    if (status == SV_OK)
        *look = made;
    else
        sv_relief_look_destroy(made);
    return status;
}

void sv_relief_look_destroy(struct sv_relief_look *look)
{
    if (!look)
        return;
    sv_relief_shade_destroy(look->shade);
    free(look->spans);
    free(look->used_block);
    free(look->block);
    free(look);
}

/* Half the height over which the shade of the surroundings fades, model space. */
static double fade_height(const struct sv_relief_object *object)
{
    return 2 * object->texel;
}

/* Takes the sun from texels below `height` (model space). */
static void shade_below(const struct sv_relief *face, double height, double fade, uint8_t *lit)
{
    const struct sv_relief_frame *f = &face->frame;
    float scale = (float)(0.5 / fade), slope_u = (float)f->a.z * scale, slope_displ = (float)f->f.z * scale;
    for (int j = 0; j < face->height; j++) {
        size_t row = (size_t)j * (size_t)face->width;
        float base = (float)((f->origin.z + f->b.z * (j + 0.5) + 0.5 * f->a.z - height) * 0.5 / fade + 0.5);
        for (int i = 0; i < face->width; i++) {
            float t = base + slope_u * (float)i + slope_displ * face->displ[row + (size_t)i];
            t = t > 0 ? t < 1 ? t : 1 : 0; /* NaN: an empty texel, any value serves */
            lit[row + (size_t)i] = (uint8_t)((float)lit[row + (size_t)i] * t * t * (3 - 2 * t) + 0.5f);
        }
    }
}

static enum sv_status check(const struct sv_relief_place *place, const struct sv_relief_look_options *options,
                            struct sv_error *error)
{
    const struct sv_vec3 p = place->place;
    if (!(place->height_m > 0 && isfinite(place->height_m)))
        return sv_fail(error, SV_EINVAL, "place.height_m", "is %g m, must be over 0", place->height_m);
    if (!isfinite(p.x) || !isfinite(p.y) || !isfinite(p.z) || !isfinite(place->heading_rad))
        return sv_fail(error, SV_EINVAL, "place", "is (%g, %g, %g), heading %g, must be finite", p.x, p.y,
                       p.z, place->heading_rad);
    if (options && !(options->specular >= 0 && options->specular <= 1))
        return sv_fail(error, SV_EINVAL, "specular", "is %g, must be 0 to 1", (double)options->specular);
    if (options && options->specular > 0 && !(options->shininess >= 1 && options->shininess <= 1000))
        return sv_fail(error, SV_EINVAL, "shininess", "is %g, must be 1 to 1000", (double)options->shininess);
    if (options && options->has_viewer &&
        (!isfinite(options->eye.x) || !isfinite(options->eye.y) || !isfinite(options->eye.z)))
        return sv_fail(error, SV_EINVAL, "eye", "is (%g, %g, %g), must be finite", options->eye.x,
                       options->eye.y, options->eye.z);
    return SV_OK;
}

static void dim(uint8_t *lit, size_t texels, double taken)
{
    unsigned left = (unsigned)lrint(256 * (1 - sv_clamp(taken, 0, 1)));
    for (size_t k = 0; k < texels; k++)
        lit[k] = (uint8_t)(lit[k] * left >> 8);
}

/* The eye of a camera, model space; the unit direction to it where there is no place. */
static struct sv_vec3 eye_of(const struct sv_relief_place *place, const struct sv_camera *camera)
{
    return camera->projection == SV_PROJECTION_PERSPECTIVE
               ? sv_relief_place_to_model(place, camera->eye)
               : sv_rotate_clockwise(sv_scale(camera->forward, -1), -place->heading_rad);
}

/* Share of sunlight of sheet k where it is below 1, in look->lit; false: it is 1 everywhere. */
static bool take_sun(struct sv_relief_look *look, int k, bool shadow)
{
    const struct sv_relief *face = &look->face[k];
    double shade_height = (look->options.shade_height_m - look->place.place.z) / look->place.height_m;
    double fade = fade_height(look->object);
    bool shaded = shade_height + fade > look->object->box_min.z, dimmed = look->options.taken > 0;
    if ((shaded || dimmed) && !shadow)
        memset(look->lit[k], 255, texels_of(face));
    if (shaded)
        shade_below(face, shade_height, fade, look->lit[k]);
    if (dimmed)
        dim(look->lit[k], texels_of(face), look->options.taken);
    return shadow || shaded || dimmed;
}

/* groups: of each sheet, what is needed (NULL: nothing); NULL: all of them. */
static enum sv_status light_sheets(struct sv_relief_look *look, unsigned faces, const uint8_t *const *groups,
                                   struct sv_error *error)
{
    const struct sv_relief_look_options *options = &look->options;
    struct sv_light turned = look->light;
    enum sv_status status = SV_OK;
    bool shadow = options->shadow != SV_RELIEF_SHADOW_NONE;
    turned.to_sun = sv_rotate_clockwise(look->light.to_sun, -look->place.heading_rad);
    if (shadow)
        status = sv_relief_shade_light(look->shade, look->face, turned.to_sun, options->shadow, faces, groups,
                                       look->lit, error);
    for (int k = 0; status == SV_OK && k < SHEETS; k++) {
        const struct sv_relief *face = &look->face[k];
        if (!(faces >> k % SV_RELIEF_FACES & 1) || !face->solid_count || (groups && !groups[k]))
            continue;
        struct sv_relief_light how = {.light = &turned,
                                      .frame = face->frame,
                                      .lit = take_sun(look, k, shadow) ? look->lit[k] : NULL,
                                      .has_viewer = options->has_viewer,
                                      .eye = sv_relief_place_to_model(&look->place, options->eye),
                                      .specular = options->specular,
                                      .shininess = options->shininess,
                                      .groups = groups ? groups[k] : NULL,
                                      .planes = look->object->normals[k]};
        sv_relief_light(face, &how, look->seen[k]);
    }
    return status;
}

enum sv_status sv_relief_look_light(struct sv_relief_look *look, const struct sv_relief_place *place,
                                    const struct sv_light *light,
                                    const struct sv_relief_look_options *options, unsigned faces,
                                    struct sv_error *error)
{
    enum sv_status status = check(place, options, error);
    if (status != SV_OK)
        return status;
    look->place = *place;
    look->light = *light;
    look->options = *options;
    look->in_warp = options->lit && options->in_warp;
    if (options->lit && !options->in_warp)
        status = light_sheets(look, faces, NULL, error);
    for (int k = 0; status == SV_OK && k < SHEETS; k++)
        if (faces >> k % SV_RELIEF_FACES & 1)
            look->color[k] = (const uint8_t(*)[4])(options->lit ? look->seen[k] : look->face[k].color);
    return status;
}

static struct sv_relief_frame world_frame(const struct sv_relief_frame *m,
                                          const struct sv_relief_place *place)
{
    double h = place->height_m, r = place->heading_rad;
    return (struct sv_relief_frame){.origin = sv_madd(place->place, sv_rotate_clockwise(m->origin, r), h),
                                    .a = sv_scale(sv_rotate_clockwise(m->a, r), h),
                                    .b = sv_scale(sv_rotate_clockwise(m->b, r), h),
                                    .f = sv_rotate_clockwise(m->f, r)};
}

static void make_source(const struct sv_relief_look *look, int k, const struct sv_relief_place *place,
                        const struct sv_camera *camera, double shift_x_px, double shift_y_px,
                        struct sv_warp_source *source)
{
    const struct sv_relief *face = &look->face[k];
    struct sv_relief_frame frame = world_frame(&face->frame, place);
    *source = (struct sv_warp_source){.width = face->width,
                                      .height = face->height,
                                      .t = face->displ,
                                      .color = (const uint8_t(*)[4])face->color,
                                      .cut = face->cut};
    sv_warp_map_from_camera(&frame, camera, shift_x_px, shift_y_px, &source->map);
    for (int row = 0; row < 4; row++) /* t is in model space, where the object is 1 high */
        source->map.m[row][2] *= place->height_m;
}

/* Lights what the picture in `buffer` shows of its sources, each a sheet. */
static enum sv_status light_seen(struct sv_relief_look *look, unsigned faces,
                                 const struct sv_warp_buffer *buffer, const int *sheet, unsigned count,
                                 struct sv_error *error)
{
    const uint8_t *groups[SHEETS] = {NULL};
    struct sv_relief_seen seen;
    for (unsigned i = 0; i < count; i++) {
        seen.width[i] = look->face[sheet[i]].width;
        seen.height[i] = look->face[sheet[i]].height;
        seen.cell[i] = look->cell[sheet[i]];
        seen.group[i] = look->used[sheet[i]];
    }
    uint32_t shown = sv_relief_find_seen(buffer, &seen, count);
    for (unsigned i = 0; i < count; i++)
        if (shown >> i & 1)
            groups[sheet[i]] = look->used[sheet[i]];
    return light_sheets(look, faces, groups, error);
}

enum sv_status sv_relief_look_warp(struct sv_relief_look *look, const struct sv_relief_place *place,
                                   const struct sv_camera *camera, double shift_x_px, double shift_y_px,
                                   unsigned faces, struct sv_warp_buffer *buffer,
                                   const struct sv_warp_source **sources, unsigned *source_count,
                                   struct sv_warp_stats *stats, struct sv_error *error)
{
    enum sv_status status = check(place, NULL, error);
    if (status != SV_OK)
        return status;
    unsigned count = 0;
    int sheet[SHEETS];
    struct sv_vec3 eye = eye_of(place, camera);
    sv_warp_clear(buffer);
    bool is_place = camera->projection == SV_PROJECTION_PERSPECTIVE;
    for (int k = 0; k < SHEETS; k++) {
        struct sv_relief_span *spans = look->spans;
        struct sv_warp_source *source = &look->source[count];
        int spanned = 0;
        if (faces >> k % SV_RELIEF_FACES & 1)
            spanned = sv_relief_object_spans(look->object, k, eye, is_place, spans);
        if (spanned == 0)
            continue;
        make_source(look, k, place, camera, shift_x_px, shift_y_px, source);
        struct sv_relief_facing facing = sv_relief_object_facing(look->object, k, eye, is_place);
        sheet[count] = k;
        sv_relief_splat(source, count++, look->object->rims[k], &facing, spans, spanned, buffer, stats);
    }
    stats->holes += sv_relief_close_gaps(buffer);
    if (look->in_warp)
        status = light_seen(look, faces, buffer, sheet, count, error);
    if (status != SV_OK)
        return status;
    for (unsigned i = 0; i < count;
         i++) /* the splat asks for alpha alone, which is the same in all of them */
        look->source[i].color = look->color[sheet[i]];
    *sources = look->source;
    *source_count = count;
    return SV_OK;
}
