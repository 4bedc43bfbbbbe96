/* object_shadow.c - see object_shadow.h.
 *
 * Row front (default). The six faces are parts of one body, so steps (2) and (3) of 3.3.2 are taken for all
 * of them at once: what of the body faces the light is pre-warped along the light onto one plane square to
 * it, with its depth (object_casters.h): the silhouette and the heights that it hands
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

#include "core/base/simd.h"
#include "core/relief/cast.h"
#include "core/relief/object_casters.h"
#include "core/relief/object_lookup.h"
#include "core/relief/row_front.h"
#include "core/relief/self_shadow.h"

/* Found on a sphere and a box at suns of 5 to 90 degrees: below 1.2 lit texels turn dark in stripes. */
#define OFFSET_TEXELS 1.5
/* Row front: what it may darken lies between these depths under the front, texels. */
#define CREVICE_MIN 0.75
#define CREVICE_MAX 3.0

struct sv_relief_shade {
    const struct sv_relief_object *object;
    struct sv_relief_casters casters;
    int side;        /* of the map, px */
    float *depth;    /* of the map: 1 at the light's side of the body, 0 on the other */
    float *incoming; /* of one face */
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
    if (!made)
        return sv_fail(error, SV_ENOMEM, "shade", "no memory for shadows of %zu texels", largest);
    made->object = object;
    made->side = map_side(object);
    made->incoming = malloc(largest * sizeof *made->incoming);
    made->depth = malloc((size_t)made->side * (size_t)made->side * sizeof *made->depth);
    enum sv_status status = SV_OK;
    if (!made->incoming || !made->depth)
        status = sv_fail(error, SV_ENOMEM, "shade", "no memory for shadows of %zu texels", largest);
    if (status == SV_OK)
        status = sv_relief_casters_init(object, &made->casters, error);
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
    sv_relief_casters_finish(&shade->casters);
    free(shade->incoming);
    free(shade->depth);
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

static void draw_map(const struct sv_relief_shade *shade, const struct light_view *view)
{
    const bool wide = sv_simd_level() >= SV_SIMD_AVX2;
    memset(shade->depth, 0, (size_t)shade->side * (size_t)shade->side * sizeof *shade->depth);
    for (int k = 0; k < SV_RELIEF_QUAD_RUNS; k++) {
        const struct sv_relief_quad_run *run = &shade->casters.run[k];
        struct sv_relief_map map = {.du = (float)run->du,
                                    .dv = (float)run->dv,
                                    .depth = shade->depth,
                                    .width = shade->side,
                                    .height = shade->side};
        for (int r = 0; r < 3; r++) {
            double m[4];
            along(&run->frame, view->axis[r], view->at[r], m);
            for (int c = 0; c < 4; c++) /* u and v are halves of texels */
                map.at[r][c] = (float)(c < 2 ? 0.5 * m[c] : m[c]);
        }
        (wide ? sv_relief_cast_avx2 : sv_relief_cast_scalar)(&map, shade->casters.quads + run->first,
                                                             run->count);
    }
}

/* Shadow heights along the face (row_front.h), in shade->incoming; false when light comes from behind the
 * face: what is lit there slants over its rim, and only the map knows it. */
static bool run_front(struct sv_relief_shade *shade, const struct sv_relief *face, struct sv_vec3 to_sun,
                      enum sv_status *status, struct sv_error *error)
{
    struct sv_row_front front = {.width = face->width,
                                 .height = face->height,
                                 .dx = sv_length(face->frame.a),
                                 .dy = sv_length(face->frame.b),
                                 .travel = in_frame(&face->frame, sv_scale(to_sun, -1)),
                                 .height_m = face->displ};
    if (front.travel.z > 0)
        return false;
    *status = sv_row_front(&front, NULL, shade->incoming, NULL, error);
    return *status == SV_OK;
}

/* Sheet k against the map, and against its own front where there is one. */
static void look_up(const struct sv_relief_shade *shade, int k, const struct sv_relief *sheet,
                    const struct light_view *view, struct sv_vec3 to_sun, const float *incoming,
                    const uint8_t *groups, uint8_t *lit)
{
    const struct sv_relief_object *object = shade->object;
    double offset = OFFSET_TEXELS * object->texel, pitch = sv_length(sheet->frame.a);
    struct sv_relief_lookup how = {.depth = shade->depth,
                                   .width = shade->side,
                                   .height = shade->side,
                                   .low = (float)(CREVICE_MIN * object->texel),
                                   .high = (float)(CREVICE_MAX * object->texel)};
    struct sv_vec3 sun = in_frame(&sheet->frame, to_sun);
    how.sun[0] = (float)sun.x, how.sun[1] = (float)sun.y, how.sun[2] = (float)sun.z;
    for (int r = 0; r < 3; r++) {
        double m[4];
        along(&sheet->frame, view->axis[r], view->at[r] - (r < 2 ? 0.5 : 0), m);
        for (int c = 0; c < 4; c++)
            how.at[r][c] = (float)m[c];
        for (int c = 0; c < 3; c++)
            how.offset[r][c] = (float)(m[c] * offset / ((c < 2 ? pitch : 1) * 32767));
    }
    struct sv_relief_lookup_sheet of = {.width = sheet->width,
                                        .displ = sheet->displ,
                                        .incoming = incoming,
                                        .color = (const uint8_t(*)[4])sheet->color,
                                        .lit = lit};
    for (size_t c = 0; c < 3; c++)
        of.normal[c] = object->normals[k] + c * (size_t)sheet->width * (size_t)sheet->height;
    bool wide = sheet->width >= 8 && sv_simd_level() >= SV_SIMD_AVX2;
    struct sv_relief_eight list[SV_RELIEF_LIST_ROOM];
    for (int row = 0; row < sheet->height;) {
        int n = sv_relief_list_eights(groups, sheet->width, sheet->height, &row, list);
        (wide ? sv_relief_lookup_avx2 : sv_relief_lookup_scalar)(&how, &of, list, n);
    }
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
                                     const uint8_t *const *groups, uint8_t *const lit[SV_RELIEF_SHEETS],
                                     struct sv_error *error)
{
    if (form == SV_RELIEF_SHADOW_LINE_SWEEP)
        return sweep(shade, sheet, to_sun, faces, lit, error);
    struct light_view view = light_view(shade->object, to_sun, shade->side);
    enum sv_status status = SV_OK;
    draw_map(shade, &view);
    for (int k = 0; status == SV_OK && k < SV_RELIEF_SHEETS; k++) {
        if (!(faces >> k % SV_RELIEF_FACES & 1) || !sheet[k].solid_count)
            continue;
        if (groups && !groups[k])
            continue;
        bool front = k < SV_RELIEF_FACES && run_front(shade, &sheet[k], to_sun, &status, error);
        look_up(shade, k, &sheet[k], &view, to_sun, front ? shade->incoming : NULL, groups ? groups[k] : NULL,
                lit[k]);
    }
    return status;
}
