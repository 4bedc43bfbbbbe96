/* draw_object_relief.c - see draw_object_relief.h. */
#include "core/relief/draw_object_relief.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "core/base/frames.h"
#include "core/gl/context.h"
#include "core/gl/functions.h"
#include "core/gl/program.h"

enum { UNIT_COLOR, UNIT_DEPTH, UNIT_ID, UNIT_NORMAL, UNITS };
enum { SHADE_STEPS = 64 }; /* of its height in which an object's shade is told apart */
enum { TAKEN_STEPS = 32 }; /* of sunlight that trees keep from it */
#define LOOK_BYTES_A_TEXEL 9

/* Lit colours of one class at one level. */
struct slot {
    struct sv_relief_look *look; /* NULL: not made */
    struct sv_vec3 to_sun;
    int shade; /* step; see shade_step */
    int taken; /* by trees, in TAKEN_STEPS */
    bool shadows;
    unsigned faces; /* lit for that light */
    size_t bytes;
    uint64_t used; /* when: count of draws */
};

struct rect {
    int x0, y0, x1, y1;
};

/* The picture that reliefs are put together in. */
struct composite {
    int width, height;
    uint8_t (*color)[4];
    float *depth; /* 0: nothing */
    uint32_t *id;
    int16_t (*normal)[4];
    void *block;
};

struct sv_object_reliefs {
    struct slot *slots;
    int slot_count;
    size_t look_bytes;
    uint64_t draws;
    struct sv_warp_buffer buffer;
    uint8_t (*resolved)[4]; /* of the buffer's size */
    struct composite picture;
    struct rect *rects; /* heap, of the entries */
    uint32_t room;
    GLuint color_only, all_layers; /* programs */
    GLuint array, textures[UNITS];
};

enum sv_status sv_object_reliefs_create(int slot_count, struct sv_object_reliefs **out,
                                        struct sv_error *error)
{
    struct sv_object_reliefs *r = calloc(1, sizeof *r);
    if (r)
        r->slots = calloc((size_t)slot_count + 1, sizeof *r->slots);
    if (!r || !r->slots) {
        free(r);
        return sv_fail(error, SV_ENOMEM, "objects", "no memory for %d looks", slot_count);
    }
    r->slot_count = slot_count;
    enum sv_status status =
        sv_gl_program_create("relief_object.vert", "relief_object.frag", NULL, &r->color_only, error);
    if (!status)
        status = sv_gl_program_create("relief_object.vert", "relief_object.frag", "#define LAYERS 1\n",
                                      &r->all_layers, error);
    if (!status) {
        gl.GenVertexArrays(1, &r->array);
        status = sv_gl_check("preparing reliefs", error);
    }
    if (status)
        sv_object_reliefs_destroy(r);
    else
        *out = r;
    return status;
}

static void drop_picture(struct sv_object_reliefs *r)
{
    sv_warp_buffer_finish(&r->buffer);
    r->buffer = (struct sv_warp_buffer){0};
    free(r->picture.block);
    r->picture = (struct composite){0};
    if (r->textures[0])
        gl.DeleteTextures(UNITS, r->textures);
    memset(r->textures, 0, sizeof r->textures);
}

void sv_object_reliefs_destroy(struct sv_object_reliefs *r)
{
    if (!r)
        return;
    drop_picture(r);
    for (int k = 0; k < r->slot_count; k++)
        sv_relief_look_destroy(r->slots[k].look);
    if (r->color_only)
        gl.DeleteProgram(r->color_only);
    if (r->all_layers)
        gl.DeleteProgram(r->all_layers);
    if (r->array)
        gl.DeleteVertexArrays(1, &r->array);
    free(r->rects);
    free(r->slots);
    free(r);
}

/* ---- the picture ---- */

static void make_texture(GLuint name, GLenum format, int width, int height)
{
    gl.BindTexture(GL_TEXTURE_2D, name);
    gl.TexStorage2D(GL_TEXTURE_2D, 1, format, width, height);
    gl.TexParameteri(GL_TEXTURE_2D, GL_TEXTURE_MIN_FILTER, GL_NEAREST);
    gl.TexParameteri(GL_TEXTURE_2D, GL_TEXTURE_MAG_FILTER, GL_NEAREST);
}

static enum sv_status want_picture(struct sv_object_reliefs *r, int width, int height, struct sv_error *error)
{
    static const GLenum formats[UNITS] = {GL_SRGB8_ALPHA8, GL_R32F, GL_R32UI, GL_RGBA16_SNORM};
    if (r->picture.block && r->picture.width == width && r->picture.height == height)
        return SV_OK;
    drop_picture(r);
    enum sv_status status = sv_warp_buffer_create(width, height, &r->buffer, error);
    if (status)
        return status;
    size_t pixels = (size_t)width * (size_t)height;
    uint8_t *at = calloc(pixels, 8 + 4 + 4 + 4 + 4);
    if (!at)
        return sv_fail(error, SV_ENOMEM, "objects", "no memory for %d x %d px", width, height);
    struct composite *p = &r->picture;
    *p = (struct composite){.width = width, .height = height, .block = at};
    p->normal = (int16_t(*)[4])(void *)at, at += 8 * pixels;
    p->depth = (float *)(void *)at, at += 4 * pixels;
    p->id = (uint32_t *)(void *)at, at += 4 * pixels;
    p->color = (uint8_t(*)[4])(void *)at, at += 4 * pixels;
    r->resolved = (uint8_t(*)[4])(void *)at;
    gl.GenTextures(UNITS, r->textures);
    for (int k = 0; k < UNITS; k++)
        make_texture(r->textures[k], formats[k], width, height);
    return sv_gl_check("textures of reliefs", error);
}

/* ---- looks ---- */

static size_t look_bytes(const struct sv_relief_object *object)
{
    size_t texels = 0;
    for (int k = 0; k < SV_RELIEF_FACES; k++)
        texels += (size_t)object->face[k].width * (size_t)object->face[k].height;
    return texels * LOOK_BYTES_A_TEXEL;
}

/* How much of an object is in the shade, in steps: 0 nothing, SHADE_STEPS all. */
static int shade_step(const struct sv_relief_place *at, double shade_height_m)
{
    double part = (shade_height_m - at->place.z) / at->height_m;
    return part > 0 ? (int)lrint(fmin(part, 1) * SHADE_STEPS) : 0;
}

static void drop_look(struct sv_object_reliefs *r, struct slot *s)
{
    sv_relief_look_destroy(s->look);
    r->look_bytes -= s->bytes;
    *s = (struct slot){0};
}

/* Makes room, least recently used first; slots of this very draw stay while there are others. */
static void make_room(struct sv_object_reliefs *r, size_t bytes, const struct slot *keep)
{
    while (r->look_bytes + bytes > SV_OBJECT_LOOKS_BYTES_MAX) {
        struct slot *oldest = NULL;
        for (int k = 0; k < r->slot_count; k++) {
            struct slot *s = &r->slots[k];
            if (s->look && s != keep && (!oldest || s->used < oldest->used))
                oldest = s;
        }
        if (!oldest)
            return;
        drop_look(r, oldest);
    }
}

/* The entry's lit colours, with those faces. */
static enum sv_status want_look(struct sv_object_reliefs *r, const struct sv_gl_frame *frame, bool shadows,
                                const struct sv_object_relief_entry *e, unsigned faces,
                                struct sv_relief_look **look, struct sv_object_relief_stats *stats,
                                struct sv_error *error)
{
    struct slot *s = &r->slots[e->slot];
    const struct sv_vec3 sun = frame->light.to_sun;
    int shade = shadows ? shade_step(&e->at, e->shade_height_m) : 0;
    int taken = shadows ? (int)lrint(e->taken * TAKEN_STEPS) : 0;
    if (!s->look) {
        size_t bytes = look_bytes(e->object);
        make_room(r, bytes, s);
        enum sv_status status = sv_relief_look_create(e->object, &s->look, error);
        if (status)
            return status;
        s->bytes = bytes;
        s->faces = 0;
        r->look_bytes += bytes;
    }
    if (s->to_sun.x != sun.x || s->to_sun.y != sun.y || s->to_sun.z != sun.z || s->shade != shade ||
        s->taken != taken || s->shadows != shadows)
        s->faces = 0;
    s->used = r->draws;
    if (faces & ~s->faces) {
        bool cast = shadows && sun.z > 0;
        struct sv_relief_look_options options = {
            .shadow = cast ? SV_RELIEF_SHADOW_ROW_FRONT : SV_RELIEF_SHADOW_NONE,
            .lit = true,
            .taken = (double)taken / TAKEN_STEPS,
            .shade_height_m = shade ? e->at.place.z + e->at.height_m * shade / SHADE_STEPS : -INFINITY};
        enum sv_status status =
            sv_relief_look_light(s->look, &e->at, &frame->light, &options, faces & ~s->faces, error);
        if (status)
            return status;
        stats->lit++;
        s->to_sun = sun;
        s->shade = shade;
        s->taken = taken;
        s->shadows = shadows;
        s->faces |= faces;
    }
    *look = s->look;
    return SV_OK;
}

/* ---- putting together ---- */

static bool is_empty(struct rect a)
{
    return a.x0 >= a.x1 || a.y0 >= a.y1;
}

static struct rect unite(struct rect a, struct rect b)
{
    if (is_empty(a))
        return b;
    if (is_empty(b))
        return a;
    return (struct rect){a.x0 < b.x0 ? a.x0 : b.x0, a.y0 < b.y0 ? a.y0 : b.y0, a.x1 > b.x1 ? a.x1 : b.x1,
                         a.y1 > b.y1 ? a.y1 : b.y1};
}

static long area(struct rect a)
{
    return is_empty(a) ? 0 : (long)(a.x1 - a.x0) * (a.y1 - a.y0);
}

/* Normals of the texels that pixels show, to world axes, turned to the viewer. */
static void put_normal(const struct sv_object_relief_entry *e, const int *face_of, uint32_t texel,
                       struct sv_vec3 to_viewer, int16_t out[4])
{
    const struct sv_relief *face = &e->object->face[face_of[texel >> SV_WARP_TEXEL_BITS & 31]];
    const int16_t *n = face->normal[texel & ((UINT32_C(1) << SV_WARP_TEXEL_BITS) - 1)];
    struct sv_vec3 v = sv_scale(sv_normalize(face->frame.a), n[0]);
    v = sv_madd(sv_madd(v, sv_normalize(face->frame.b), n[1]), face->frame.f, n[2]);
    v = sv_normalize(sv_rotate_clockwise(v, e->at.heading_rad));
    double turn = sv_dot(v, to_viewer) < 0 ? -32767 : 32767;
    out[0] = (int16_t)lrint(v.x * turn);
    out[1] = (int16_t)lrint(v.y * turn);
    out[2] = (int16_t)lrint(v.z * turn);
}

/* Takes over what of the buffer is nearer than the picture. */
static void merge(struct sv_object_reliefs *r, const struct sv_camera *camera, unsigned layers,
                  const struct sv_object_relief_entry *e, const int *face_of)
{
    const struct sv_warp_buffer *b = &r->buffer;
    struct composite *p = &r->picture;
    bool normals = layers & 1u << SV_LAYER_NORMAL;
    for (int y = b->y0; y < b->y1; y++)
        for (int x = b->x0; x < b->x1; x++) {
            size_t i = (size_t)y * (size_t)b->width + (size_t)x;
            if (b->texel[i] == SV_WARP_EMPTY || !(b->depth[i] > p->depth[i]))
                continue;
            p->depth[i] = b->depth[i];
            memcpy(p->color[i], r->resolved[i], 4);
            p->id[i] = e->id;
            if (normals) {
                struct sv_vec3 origin, ray;
                sv_camera_ray(camera, x + 0.5, y + 0.5, &origin, &ray);
                put_normal(e, face_of, b->texel[i] & ~SV_WARP_FILLED, sv_scale(ray, -1), p->normal[i]);
            }
        }
}

static enum sv_status warp_entry(struct sv_object_reliefs *r, const struct sv_gl_frame *frame,
                                 unsigned layers, bool shadows, const struct sv_object_relief_entry *e,
                                 struct rect *rect, struct sv_object_relief_stats *stats,
                                 struct sv_error *error)
{
    struct sv_relief_look *look = NULL;
    unsigned faces = sv_relief_object_faces(e->object, &e->at, &frame->camera);
    if (!faces)
        return SV_OK;
    enum sv_status status = want_look(r, frame, shadows, e, faces, &look, stats, error);
    if (status)
        return status;
    const struct sv_warp_source *sources = NULL;
    unsigned source_count = 0;
    struct sv_warp_stats warp = {0};
    status = sv_relief_look_warp(look, &e->at, &frame->camera, frame->shift_x_px, frame->shift_y_px, faces,
                                 &r->buffer, &sources, &source_count, &warp, error);
    if (status)
        return status;
    *rect = (struct rect){r->buffer.x0, r->buffer.y0, r->buffer.x1, r->buffer.y1};
    stats->texels += warp.texels;
    stats->holes += warp.holes;
    stats->holes_left += warp.holes_left;
    if (is_empty(*rect))
        return SV_OK;
    int face_of[SV_WARP_SOURCES_MAX] = {0};
    for (int k = 0, n = 0; k < SV_RELIEF_FACES; k++)
        if (faces >> k & 1)
            face_of[n++] = k;
    sv_warp_resolve(sources, source_count, &r->buffer, r->resolved);
    merge(r, &frame->camera, layers, e, face_of);
    return SV_OK;
}

/* ---- into GL ---- */

static void upload_rect(const struct sv_object_reliefs *r, unsigned layers, struct rect a)
{
    static const struct {
        GLenum format, type;
    } form[UNITS] = {{GL_RGBA, GL_UNSIGNED_BYTE},
                     {GL_RED, GL_FLOAT},
                     {GL_RED_INTEGER, GL_UNSIGNED_INT},
                     {GL_RGBA, GL_SHORT}};
    const struct composite *p = &r->picture;
    const void *const data[UNITS] = {p->color, p->depth, p->id, p->normal};
    bool wanted[UNITS] = {true, true, (layers & 1u << SV_LAYER_ID) != 0,
                          (layers & 1u << SV_LAYER_NORMAL) != 0};
    for (int k = 0; k < UNITS; k++) {
        if (!wanted[k])
            continue;
        gl.ActiveTexture(GL_TEXTURE0 + (GLenum)k);
        gl.BindTexture(GL_TEXTURE_2D, r->textures[k]);
        gl.TexSubImage2D(GL_TEXTURE_2D, 0, a.x0, a.y0, a.x1 - a.x0, a.y1 - a.y0, form[k].format, form[k].type,
                         data[k]);
    }
}

/* Empties the picture where something was put. */
static void wipe_rect(struct composite *p, struct rect a)
{
    for (int y = a.y0; y < a.y1; y++)
        memset(&p->depth[(size_t)y * (size_t)p->width + (size_t)a.x0], 0, (size_t)(a.x1 - a.x0) * 4);
}

/* One rectangle of the picture over GL's own, by depth. Pixels that two rectangles share are drawn twice, the
 * same. */
static void lay_over(struct sv_object_reliefs *r, unsigned layers, struct rect a)
{
    const struct composite *p = &r->picture;
    gl.PixelStorei(GL_UNPACK_ROW_LENGTH, p->width);
    gl.PixelStorei(GL_UNPACK_SKIP_PIXELS, a.x0);
    gl.PixelStorei(GL_UNPACK_SKIP_ROWS, a.y0);
    upload_rect(r, layers, a);
    gl.PixelStorei(GL_UNPACK_ROW_LENGTH, 0);
    gl.PixelStorei(GL_UNPACK_SKIP_PIXELS, 0);
    gl.PixelStorei(GL_UNPACK_SKIP_ROWS, 0);
    gl.Uniform4f(0, (float)a.x0, (float)a.y0, (float)a.x1, (float)a.y1);
    gl.DrawArrays(GL_TRIANGLE_STRIP, 0, 4);
}

static enum sv_status lay_all(struct sv_object_reliefs *r, unsigned layers, uint32_t count,
                              struct sv_error *error)
{
    struct rect whole = {0};
    long sum = 0;
    for (uint32_t k = 0; k < count; k++) {
        whole = unite(whole, r->rects[k]);
        sum += area(r->rects[k]);
    }
    if (is_empty(whole))
        return SV_OK;
    gl.UseProgram(layers & ~(1u << SV_LAYER_COLOR) ? r->all_layers : r->color_only);
    gl.BindVertexArray(r->array);
    gl.Disable(GL_CULL_FACE);
    if (sum >= area(whole)) {
        lay_over(r, layers, whole);
        wipe_rect(&r->picture, whole);
    } else {
        for (uint32_t k = 0; k < count; k++)
            if (!is_empty(r->rects[k]))
                lay_over(r, layers, r->rects[k]);
        for (uint32_t k = 0; k < count; k++)
            if (!is_empty(r->rects[k]))
                wipe_rect(&r->picture, r->rects[k]);
    }
    gl.BindVertexArray(0);
    gl.ActiveTexture(GL_TEXTURE0);
    return sv_gl_check("laying reliefs over the picture", error);
}

enum sv_status sv_object_reliefs_draw(struct sv_object_reliefs *r, const struct sv_gl_frame *frame,
                                      unsigned layers, bool shadows,
                                      const struct sv_object_relief_entry *entries, uint32_t count,
                                      struct sv_object_relief_stats *stats, struct sv_error *error)
{
    if (count == 0)
        return SV_OK;
    enum sv_status status = want_picture(r, frame->camera.width, frame->camera.height, error);
    if (status)
        return status;
    if (r->room < count) {
        struct rect *grown = realloc(r->rects, count * sizeof *grown);
        if (!grown)
            return sv_fail(error, SV_ENOMEM, "objects", "no memory for %u reliefs", count);
        r->rects = grown;
        r->room = count;
    }
    memset(r->rects, 0, count * sizeof *r->rects);
    r->draws++;
    for (uint32_t k = 0; k < count && !status; k++)
        status = warp_entry(r, frame, layers, shadows, &entries[k], &r->rects[k], stats, error);
    enum sv_status laid = lay_all(r, layers, count, status ? NULL : error); /* which wipes, too */
    return status ? status : laid;
}
