/* object_shadow.c - see object_shadow.h.
 *
 * Row front (default). The six faces are parts of one body, so steps (2) and (3) of 3.3.2 are taken for all
 * of them at once: what of the body faces the light is pre-warped along the light onto one plane square to
 * it, by the same splat that draws pictures, with its depth: the silhouette and the heights that it hands
 * over. A texel looks itself up there, moved off its surface by OFFSET_TEXELS along its normal, so that the
 * copy of itself in another face (or its own neighbours) cannot shade it; four comparisons are mixed. What is
 * nearer than that offset the face's own row front (3.3.1, row_front.h) adds: crevices. Deeper shadow of the
 * row front is not believed: it takes a face's surface for a solid column all the way down, which a ring or a
 * bridge is not.
 *
 * Line sweep: the paper's own way, for the record: each face's silhouette cast on every other face (cast.h,
 * at the receiver's heights), then the sweep (self_shadow.h) with that as its first S. */
#include "core/relief/object_shadow.h"

#include <stdlib.h>
#include <string.h>

#include "core/relief/cast.h"
#include "core/relief/object_splat.h"
#include "core/relief/row_front.h"
#include "core/relief/self_shadow.h"

/* Found on a sphere and a box at suns of 5 to 90 degrees: below 1.2 lit texels turn dark in stripes. */
#define OFFSET_TEXELS 1.5
/* Row front: what it may darken lies between these depths under the front, texels. */
#define CREVICE_MIN 0.75
#define CREVICE_MAX 3.0

struct sv_relief_shade {
    const struct sv_relief_object *object;
    struct sv_warp_buffer map;    /* depth: 1 at the light's side of the body, 0 on the other */
    float *incoming;              /* of one face */
    struct sv_relief_span *spans; /* room */
};

/* Side of the map: the box's diagonal in texels, and a free pixel on each side. */
static int map_side(const struct sv_relief_object *object)
{
    double diagonal = sv_length(sv_sub(object->box_max, object->box_min)) / object->texel;
    return (int)ceil(diagonal) + 4;
}

enum sv_status sv_relief_shade_create(const struct sv_relief_object *object, struct sv_relief_shade **shade,
                                      struct sv_error *error)
{
    struct sv_relief_shade *made = calloc(1, sizeof *made);
    size_t largest = 0;
    for (int k = 0; k < SV_RELIEF_SHEETS; k++) {
        const struct sv_relief *r = sv_relief_sheet(object, k);
        size_t texels = (size_t)r->width * (size_t)r->height;
        largest = texels > largest ? texels : largest;
    }
    float *incoming = malloc(largest * sizeof *incoming);
    struct sv_relief_span *spans = malloc((size_t)sv_relief_object_spans_max(object) * sizeof *spans);
    if (!made || !incoming || !spans) {
        free(made);
        free(incoming);
        free(spans);
        return sv_fail(error, SV_ENOMEM, "shade", "no memory for shadows of %zu texels", largest);
    }
    *made = (struct sv_relief_shade){.object = object, .incoming = incoming, .spans = spans};
    int side = map_side(object);
    enum sv_status status = sv_warp_buffer_create(side, side, &made->map, error);
    if (status == SV_OK)
        *shade = made;
    else
        sv_relief_shade_destroy(made);
    return status;
}

void sv_relief_shade_destroy(struct sv_relief_shade *shade)
{
    if (!shade)
        return;
    if (shade->map.depth)
        sv_warp_buffer_finish(&shade->map);
    free(shade->incoming);
    free(shade->spans);
    free(shade);
}

static struct sv_vec3 in_frame(const struct sv_relief_frame *frame, struct sv_vec3 v)
{
    return sv_vec3(sv_dot(sv_normalize(frame->a), v), sv_dot(sv_normalize(frame->b), v), sv_dot(frame->f, v));
}

/* Rows of the light's own picture of the object: x, y in px of the map, d in [0, 1]; model space. */
struct light_view {
    struct sv_vec3 axis[3];
    double at[3]; /* value = axis . place + at */
};

static struct light_view light_view(const struct sv_relief_object *object, struct sv_vec3 to_sun, int side)
{
    struct sv_vec3 aside = fabs(to_sun.z) < 0.9 ? sv_vec3(0, 0, 1) : sv_vec3(1, 0, 0);
    struct sv_vec3 right = sv_normalize(sv_cross(aside, to_sun)), down = sv_cross(right, to_sun);
    struct sv_vec3 middle = sv_scale(sv_add(object->box_min, object->box_max), 0.5);
    double reach = side * object->texel;
    struct light_view v = {.axis = {sv_scale(right, 1 / object->texel), sv_scale(down, 1 / object->texel),
                                    sv_scale(to_sun, 1 / reach)}};
    for (int k = 0; k < 3; k++)
        v.at[k] = (k < 2 ? 0.5 * side : 0.5) - sv_dot(v.axis[k], middle);
    return v;
}

/* The value of one axis as a function of (u, v, displ) of a relief: coefficients of u, v, displ, 1. */
static void along(const struct sv_relief_frame *f, struct sv_vec3 axis, double at, double row[4])
{
    row[0] = sv_dot(axis, f->a);
    row[1] = sv_dot(axis, f->b);
    row[2] = sv_dot(axis, f->f);
    row[3] = sv_dot(axis, f->origin) + at;
}

static void draw_map(struct sv_relief_shade *shade, const struct sv_relief sheet[SV_RELIEF_SHEETS],
                     const struct light_view *view, struct sv_vec3 to_sun)
{
    struct sv_warp_stats stats = {0};
    sv_warp_clear(&shade->map);
    for (int k = 0; k < SV_RELIEF_FACES; k++) {
        int count = sv_relief_object_spans(shade->object, k, to_sun, false, shade->spans);
        struct sv_warp_source source = {.width = sheet[k].width,
                                        .height = sheet[k].height,
                                        .t = sheet[k].displ,
                                        .color = (const uint8_t(*)[4])sheet[k].color,
                                        .cut = sheet[k].cut};
        for (int r = 0; r < 3; r++)
            along(&sheet[k].frame, view->axis[r], view->at[r], source.map.m[r]);
        source.map.m[3][3] = 1;
        struct sv_relief_facing facing = sv_relief_object_facing(shade->object, k, to_sun, false);
        sv_relief_splat(&source, (unsigned)k, shade->object->rims[k], &facing, shade->spans, count,
                        &shade->map, &stats);
    }
}

/* Share of the light that passes at (x, y): four comparisons, bilinear. */
static float passes(const struct sv_warp_buffer *map, float x, float y, float d)
{
    x -= 0.5f, y -= 0.5f;
    if (!(x >= 0 && y >= 0 && x < (float)(map->width - 1) && y < (float)(map->height - 1)))
        return 1;
    int i = (int)x, j = (int)y;
    float fx = x - (float)i, fy = y - (float)j;
    const float *p = map->depth + (size_t)j * (size_t)map->width + (size_t)i, *q = p + map->width;
    float upper = (d >= p[0] ? 1 - fx : 0) + (d >= p[1] ? fx : 0);
    float lower = (d >= q[0] ? 1 - fx : 0) + (d >= q[1] ? fx : 0);
    return upper + (lower - upper) * fy;
}

static void look_up(const struct sv_relief_shade *shade, const struct sv_relief *sheet,
                    const struct light_view *view, uint8_t *lit)
{
    double m[3][4];
    float f[3][4], n[3][3];
    double offset = OFFSET_TEXELS * shade->object->texel, pitch = sv_length(sheet->frame.a);
    for (int r = 0; r < 3; r++) {
        along(&sheet->frame, view->axis[r], view->at[r], m[r]);
        for (int k = 0; k < 4; k++)
            f[r][k] = (float)m[r][k];
        for (int k = 0; k < 3; k++) /* what the offset along the normal adds */
            n[r][k] = (float)(m[r][k] * offset / ((k < 2 ? pitch : 1) * 32767));
    }
    for (int j = 0; j < sheet->height; j++)
        for (int i = 0; i < sheet->width; i++) {
            size_t t = (size_t)j * (size_t)sheet->width + (size_t)i;
            lit[t] = 255;
            if (sheet->color[t][3] < 128)
                continue;
            float u = (float)i + 0.5f, v = (float)j + 0.5f, h = sheet->displ[t], at[3];
            const int16_t *normal = sheet->normal[t];
            for (int r = 0; r < 3; r++)
                at[r] = f[r][3] + f[r][0] * u + f[r][1] * v + f[r][2] * h + n[r][0] * normal[0] +
                        n[r][1] * normal[1] + n[r][2] * normal[2];
            lit[t] = (uint8_t)(255 * passes(&shade->map, at[0], at[1], at[2]) + 0.5f);
        }
}

static enum sv_status darken_crevices(struct sv_relief_shade *shade, const struct sv_relief *face,
                                      struct sv_vec3 to_sun, uint8_t *lit, struct sv_error *error)
{
    struct sv_vec3 travel = in_frame(&face->frame, sv_scale(to_sun, -1));
    if (travel.z >
        0) /* from behind the face: what is lit there, slants over its rim, and only the map knows it */
        return SV_OK;
    struct sv_row_front front = {.width = face->width,
                                 .height = face->height,
                                 .dx = sv_length(face->frame.a),
                                 .dy = sv_length(face->frame.b),
                                 .travel = travel,
                                 .height_m = face->displ};
    enum sv_status status = sv_row_front(&front, NULL, shade->incoming, NULL, error);
    float low = (float)(CREVICE_MIN * shade->object->texel),
          high = (float)(CREVICE_MAX * shade->object->texel);
    size_t texels = (size_t)face->width * (size_t)face->height;
    for (size_t t = 0; status == SV_OK && t < texels; t++) {
        float depth = shade->incoming[t] - face->displ[t];
        lit[t] = depth > low && depth < high ? 0 : lit[t];
    }
    return status;
}

/* 3.3.2 as the paper has it, between the six faces: adds to the shadow texture of one of them. */
static enum sv_status cast_on(const struct sv_relief_shade *shade, struct sv_silhouette *silhouette, int from,
                              int to, const struct sv_relief *receiver, uint8_t *dark, struct sv_error *error)
{
    /* A face's own texels are in the sweep; their copies in another face lie within the faces' common texel
     * size. */
    struct sv_silhouette moved = *silhouette;
    moved.corner = sv_madd(moved.corner, moved.travel, OFFSET_TEXELS * shade->object->texel);
    return from == to ? SV_OK : sv_cast_shadow(&moved, receiver, SV_CAST_HEIGHT, dark, error);
}

static enum sv_status sweep(const struct sv_relief_shade *shade, const struct sv_relief sheet[],
                            struct sv_vec3 to_sun, unsigned faces, uint8_t *const lit[],
                            struct sv_error *error)
{
    struct sv_vec3 travel = sv_normalize(sv_scale(to_sun, -1));
    uint8_t *initial = (uint8_t *)shade->incoming; /* room of one face */
    enum sv_status status = SV_OK;
    for (int k = 0; k < SV_RELIEF_SHEETS; k++)
        if (faces >> k % SV_RELIEF_FACES & 1)
            memset(lit[k], 255, (size_t)sheet[k].width * (size_t)sheet[k].height);
    for (int k = 0; status == SV_OK && k < SV_RELIEF_FACES; k++) {
        struct sv_silhouette silhouette;
        if (!shade->object->face[k].solid_count)
            continue;
        status =
            sv_cast_silhouette(&shade->object->face[k], travel, shade->object->texel, &silhouette, error);
        if (status != SV_OK)
            break;
        for (int to = 0; status == SV_OK && to < SV_RELIEF_SHEETS; to++)
            if ((faces >> to % SV_RELIEF_FACES & 1) && sheet[to].solid_count)
                status = cast_on(shade, &silhouette, k, to, &sheet[to], lit[to], error);
        sv_cast_silhouette_finish(&silhouette);
    }
    for (int k = 0; status == SV_OK && k < SV_RELIEF_FACES; k++) {
        if (!(faces >> k & 1))
            continue;
        struct sv_self_shadow_options options = {.travel = in_frame(&sheet[k].frame, travel),
                                                 .initial = initial,
                                                 .bias_m = (float)shade->object->texel};
        memcpy(initial, lit[k], (size_t)sheet[k].width * (size_t)sheet[k].height);
        if (options.travel.z <= 0)
            status = sv_self_shadow(&sheet[k], &options, lit[k], error);
    }
    return status;
}

enum sv_status sv_relief_shade_light(struct sv_relief_shade *shade,
                                     const struct sv_relief sheet[SV_RELIEF_SHEETS], struct sv_vec3 to_sun,
                                     enum sv_relief_shadow_form form, unsigned faces,
                                     uint8_t *const lit[SV_RELIEF_SHEETS], struct sv_error *error)
{
    if (form == SV_RELIEF_SHADOW_LINE_SWEEP)
        return sweep(shade, sheet, to_sun, faces, lit, error);
    struct light_view view = light_view(shade->object, to_sun, shade->map.width);
    enum sv_status status = SV_OK;
    draw_map(shade, sheet, &view, to_sun);
    for (int k = 0; status == SV_OK && k < SV_RELIEF_SHEETS; k++) {
        if (!(faces >> k % SV_RELIEF_FACES & 1) || !sheet[k].solid_count)
            continue;
        look_up(shade, &sheet[k], &view, lit[k]);
        if (k < SV_RELIEF_FACES)
            status = darken_crevices(shade, &sheet[k], to_sun, lit[k], error);
    }
    return status;
}
