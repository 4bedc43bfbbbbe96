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

#include "core/base/simd.h"
#include "core/relief/cast.h"
#include "core/relief/object_lookup.h"
#include "core/relief/object_splat.h"
#include "core/relief/row_front.h"
#include "core/relief/self_shadow.h"

/* Found on a sphere and a box at suns of 5 to 90 degrees: below 1.2 lit texels turn dark in stripes. */
#define OFFSET_TEXELS 1.5
/* Row front: what it may darken lies between these depths under the front, texels. */
#define CREVICE_MIN 0.75
#define CREVICE_MAX 3.0

/* A face at half its resolution: enough for what it casts, at a quarter of the cost. Texel (i, j) is the
 * face's (2 i, 2 j). */
struct caster {
    struct sv_relief_frame frame; /* model space */
    int width, height;
    float *displ;
    uint8_t (*color)[4];
    int16_t *normal[3];
    uint8_t *rims;
    float cut;
};

struct sv_relief_shade {
    const struct sv_relief_object *object;
    struct caster caster[SV_RELIEF_FACES];
    void *casters;                /* their arrays */
    struct sv_warp_buffer map;    /* depth: 1 at the light's side of the body, 0 on the other */
    float *incoming;              /* of one face */
    struct sv_relief_span *spans; /* room */
};

static bool kept(const struct sv_relief_object *object, int face, int i, int j)
{
    const struct sv_relief *r = &object->face[face];
    size_t k = (size_t)j * (size_t)r->width + (size_t)i;
    return i < r->width && j < r->height && object->keep[face][k] && sv_relief_solid(r, k);
}

/* What a cell of a caster is: full, or a rim where the face itself has one. */
static uint8_t cell_of(const struct sv_relief_object *object, int face, const struct caster *c, int i, int j)
{
    const struct sv_relief *r = &object->face[face];
    bool full = true;
    float t[4] = {0, 0, 0, 0};
    for (int k = 0; k < 4; k++) {
        int x = i + (k & 1), y = j + (k >> 1);
        size_t at = (size_t)y * (size_t)c->width + (size_t)x;
        full = full && x >= 0 && y >= 0 && x < c->width && y < c->height && c->color[at][3];
        t[k] = full ? c->displ[at] : 0;
    }
    if (full && fabsf(t[0] - t[1]) <= c->cut && fabsf(t[2] - t[3]) <= c->cut &&
        fabsf(t[0] - t[2]) <= c->cut && fabsf(t[1] - t[3]) <= c->cut)
        return SV_RELIEF_CELL_FULL;
    for (int y = 2 * j + 1; y <= 2 * j + 2; y++) /* cells of the face have their upper left texel one less */
        for (int x = 2 * i + 1; x <= 2 * i + 2; x++)
            if (x >= 0 && y >= 0 && x <= r->width && y <= r->height &&
                object->rims[face][(size_t)y * (size_t)(r->width + 1) + (size_t)x] == SV_RELIEF_CELL_RIM)
                return SV_RELIEF_CELL_RIM;
    return SV_RELIEF_CELL_SPARE;
}

static void fill_caster(const struct sv_relief_object *object, int face, struct caster *c)
{
    const struct sv_relief *r = &object->face[face];
    c->cut = 2 * r->cut;
    c->frame = r->frame;
    c->frame.a = sv_scale(r->frame.a, 2);
    c->frame.b = sv_scale(r->frame.b, 2);
    c->frame.origin = sv_madd(sv_madd(r->frame.origin, r->frame.a, -0.5), r->frame.b, -0.5);
    for (int j = 0; j < c->height; j++)
        for (int i = 0; i < c->width; i++) {
            size_t to = (size_t)j * (size_t)c->width + (size_t)i;
            size_t from = (size_t)(2 * j) * (size_t)r->width + (size_t)(2 * i);
            bool any = kept(object, face, 2 * i, 2 * j) || kept(object, face, 2 * i + 1, 2 * j) ||
                       kept(object, face, 2 * i, 2 * j + 1) || kept(object, face, 2 * i + 1, 2 * j + 1);
            c->displ[to] = r->displ[from];
            memset(c->color[to], any && sv_relief_solid(r, from) ? 255 : 0, 4);
            for (int k = 0; k < 3; k++)
                c->normal[k][to] = r->normal[from][k];
        }
    for (int j = -1; j < c->height; j++)
        for (int i = -1; i < c->width; i++)
            c->rims[(size_t)(j + 1) * (size_t)(c->width + 1) + (size_t)(i + 1)] =
                cell_of(object, face, c, i, j);
}

enum { CASTER_BYTES = sizeof(float) + 4 + 3 * sizeof(int16_t) }; /* a texel, without its cell */

static bool make_casters(struct sv_relief_shade *shade)
{
    size_t bytes = 0, texels, cells;
    for (int k = 0; k < SV_RELIEF_FACES; k++) {
        struct caster *c = &shade->caster[k];
        c->width = (shade->object->face[k].width + 1) / 2;
        c->height = (shade->object->face[k].height + 1) / 2;
        texels = (size_t)c->width * (size_t)c->height;
        cells = (size_t)(c->width + 1) * (size_t)(c->height + 1);
        bytes += (texels * CASTER_BYTES + cells + SV_RELIEF_RIMS_SLACK + 15) / 16 * 16;
    }
    uint8_t *at = shade->casters = malloc(bytes);
    for (int k = 0; at && k < SV_RELIEF_FACES; k++) {
        struct caster *c = &shade->caster[k];
        texels = (size_t)c->width * (size_t)c->height;
        cells = (size_t)(c->width + 1) * (size_t)(c->height + 1);
        c->displ = (float *)(void *)at;
        c->color = (uint8_t(*)[4])(void *)(c->displ + texels);
        c->normal[0] = (int16_t *)(void *)(c->color + texels);
        c->normal[1] = c->normal[0] + texels;
        c->normal[2] = c->normal[1] + texels;
        c->rims = (uint8_t *)(c->normal[2] + texels);
        fill_caster(shade->object, k, c);
        at += (texels * CASTER_BYTES + cells + SV_RELIEF_RIMS_SLACK + 15) / 16 * 16;
    }
    return shade->casters != NULL;
}

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
        free(spans);
        free(incoming);
        return sv_fail(error, SV_ENOMEM, "shade", "no memory for shadows of %zu texels", largest);
    }
    *made = (struct sv_relief_shade){.object = object, .incoming = incoming, .spans = spans};
    int side = map_side(object);
    enum sv_status status = sv_warp_buffer_create(side, side, &made->map, error);
    if (status == SV_OK && !make_casters(made))
        status = sv_fail(error, SV_ENOMEM, "shade", "no memory for casters of %zu texels", largest);
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
    free(shade->casters);
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

/* The block of texels of a caster that may face the light: one, as rows beside it cost more than what faces
 * away in it. False: none does. */
static bool caster_span(const struct sv_relief_shade *shade, int face, struct sv_vec3 to_sun,
                        struct sv_relief_span *all)
{
    const struct sv_relief_span *s = shade->spans;
    int count = sv_relief_object_spans(shade->object, face, to_sun, false, shade->spans);
    for (int k = 0; k < count; k++, s++) {
        all->row0 = k > 0 && all->row0 < s->row0 / 2 ? all->row0 : s->row0 / 2;
        all->row1 = k > 0 && all->row1 > (s->row1 + 1) / 2 ? all->row1 : (s->row1 + 1) / 2;
        all->column0 = k > 0 && all->column0 < s->column0 / 2 ? all->column0 : s->column0 / 2;
        all->column1 = k > 0 && all->column1 > (s->column1 + 1) / 2 ? all->column1 : (s->column1 + 1) / 2;
    }
    return count > 0;
}

static void draw_map(struct sv_relief_shade *shade, const struct light_view *view, struct sv_vec3 to_sun)
{
    struct sv_warp_stats stats = {0};
    sv_warp_clear(&shade->map);
    for (int k = 0; k < SV_RELIEF_FACES; k++) {
        const struct caster *c = &shade->caster[k];
        struct sv_vec3 sun = in_frame(&c->frame, to_sun);
        struct sv_relief_facing facing = {.normal = {c->normal[0], c->normal[1], c->normal[2]},
                                          .eye = {(float)sun.x, (float)sun.y, (float)sun.z}};
        struct sv_warp_source source = {.width = c->width,
                                        .height = c->height,
                                        .t = c->displ,
                                        .color = (const uint8_t(*)[4])c->color,
                                        .cut = c->cut};
        for (int r = 0; r < 3; r++)
            along(&c->frame, view->axis[r], view->at[r], source.map.m[r]);
        source.map.m[3][3] = 1;
        struct sv_relief_span span;
        if (shade->object->face[k].solid_count && caster_span(shade, k, to_sun, &span))
            sv_relief_splat(&source, (unsigned)k, c->rims, &facing, &span, 1, &shade->map, &stats);
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
    struct sv_relief_lookup how = {.depth = shade->map.depth,
                                   .width = shade->map.width,
                                   .height = shade->map.height,
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
    bool wide = sv_simd_level() >= SV_SIMD_AVX2;
    size_t texels = (size_t)sheet->width * (size_t)sheet->height, stride = ((size_t)sheet->width + 7) / 8;
    for (int j = 0; j < sheet->height; j++) {
        size_t at = (size_t)j * (size_t)sheet->width;
        struct sv_relief_lookup_row row = {.displ = sheet->displ + at,
                                           .incoming = incoming ? incoming + at : NULL,
                                           .color = (const uint8_t(*)[4])sheet->color + at,
                                           .row = j,
                                           .lit = lit + at};
        for (int c = 0; c < 3; c++)
            row.normal[c] = object->normals[k] + (size_t)c * texels + at;
        while (
            sv_relief_next_run(groups ? groups + (size_t)j * stride : NULL, sheet->width, &row.first, &row.n))
            sv_relief_lookup_scalar(&how, &row, wide ? sv_relief_lookup_avx2(&how, &row) : row.first);
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
    struct light_view view = light_view(shade->object, to_sun, shade->map.width);
    enum sv_status status = SV_OK;
    draw_map(shade, &view, to_sun);
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
