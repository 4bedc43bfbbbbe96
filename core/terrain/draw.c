/* draw.c - the terrain's textures and shader, and the drawing of a refined mesh (lod.h).
 *
 * Mesh vertices are relative to the eye. Texture coordinates are affine in them with offsets formed in
 * double, so nothing large is ever narrowed. Shading is terrain.frag: albedo (mip levels), normal texture,
 * detail.glsl, light.glsl. */
#include "core/terrain/draw.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "core/gl/context.h"
#include "core/gl/functions.h"
#include "core/gl/program.h"
#include "core/scene/id.h"
#include "core/terrain/detail.h"
#include "core/terrain/lod.h"

enum { UNIT_ALBEDO, UNIT_NORMAL, UNIT_DETAIL, UNIT_COUNT, UNIT_SHADOW = UNIT_COUNT };

/* Uniform locations of terrain.frag. */
enum { AT_ALBEDO_UV, AT_NORMAL_UV, AT_TEXEL_M, AT_ID, AT_DETAIL_EYE, AT_SHADOW_WINDOW = 7 };

/* Triangles by how many scales of the ground's detail can be seen in them, from all to none. Each zone has a
 * program, since llvmpipe pays for both sides of a branch. */
enum { ZONE_COUNT = SV_DETAIL_COUNT + 1 };

struct sv_terrain_draw {
    const struct sv_terrain *terrain;
    struct sv_terrain_lod *lod;
    struct sv_terrain_mesh mesh;
    unsigned programs[2][ZONE_COUNT]; /* without and with shadows */
    uint32_t *zoned; /* the mesh's indices by zone, for as many triangles as zoned_capacity */
    uint32_t zoned_capacity;
    GLuint textures[UNIT_COUNT], vertices, buffers[2];
};

/* ---- making ---- */

static int level_count(int width, int height)
{
    int side = width > height ? width : height, levels = 1;
    while (side >> levels)
        levels++;
    return levels;
}

/* Fills the bound texture with an image (any mip levels made by GL). */
static void upload_image(const struct sv_image *image, GLenum storage, GLenum format)
{
    gl.TexStorage2D(GL_TEXTURE_2D, level_count(image->width, image->height), storage, image->width,
                    image->height);
    gl.TexSubImage2D(GL_TEXTURE_2D, 0, 0, 0, image->width, image->height, format, GL_UNSIGNED_BYTE,
                     image->data);
    gl.GenerateMipmap(GL_TEXTURE_2D);
}

/* No anisotropic filter: at 2x it costs a quarter of the terrain's time (llvmpipe). Half a level of bias is
 * free. */
static void set_sampling(GLenum wrap, float bias)
{
    gl.TexParameterf(GL_TEXTURE_2D, GL_TEXTURE_LOD_BIAS, bias);
    gl.TexParameteri(GL_TEXTURE_2D, GL_TEXTURE_WRAP_S, (GLint)wrap);
    gl.TexParameteri(GL_TEXTURE_2D, GL_TEXTURE_WRAP_T, (GLint)wrap);
    gl.TexParameteri(GL_TEXTURE_2D, GL_TEXTURE_MIN_FILTER, GL_LINEAR_MIPMAP_LINEAR);
    gl.TexParameteri(GL_TEXTURE_2D, GL_TEXTURE_MAG_FILTER, GL_LINEAR);
}

/* The detail's mip levels are its own, not GL's: its CPU twin reads the same bytes. */
static void upload_detail(void)
{
    gl.TexStorage2D(GL_TEXTURE_2D, SV_TERRAIN_DETAIL_LEVELS, GL_RGBA8, SV_TERRAIN_DETAIL_SIDE,
                    SV_TERRAIN_DETAIL_SIDE);
    for (int l = 0; l < SV_TERRAIN_DETAIL_LEVELS; l++)
        gl.TexSubImage2D(GL_TEXTURE_2D, l, 0, 0, SV_TERRAIN_DETAIL_SIDE >> l, SV_TERRAIN_DETAIL_SIDE >> l,
                         GL_RGBA, GL_UNSIGNED_BYTE, sv_terrain_detail_level(l));
}

static void make_textures(struct sv_terrain_draw *draw)
{
    gl.GenTextures(UNIT_COUNT, draw->textures);
    gl.BindTexture(GL_TEXTURE_2D, draw->textures[UNIT_ALBEDO]);
    upload_image(&draw->terrain->albedo, GL_SRGB8_ALPHA8, GL_RGBA);
    set_sampling(GL_CLAMP_TO_EDGE, -0.5f);
    gl.BindTexture(GL_TEXTURE_2D, draw->textures[UNIT_NORMAL]);
    upload_image(&draw->terrain->normal, GL_RG8, GL_RG);
    set_sampling(GL_CLAMP_TO_EDGE, -0.5f);
    gl.BindTexture(GL_TEXTURE_2D, draw->textures[UNIT_DETAIL]);
    upload_detail();
    set_sampling(GL_REPEAT, 0);
}

static void make_buffers(struct sv_terrain_draw *draw)
{
    gl.GenVertexArrays(1, &draw->vertices);
    gl.BindVertexArray(draw->vertices);
    gl.GenBuffers(2, draw->buffers);
    gl.BindBuffer(GL_ARRAY_BUFFER, draw->buffers[0]);
    gl.BindBuffer(GL_ELEMENT_ARRAY_BUFFER, draw->buffers[1]);
    gl.EnableVertexAttribArray(0);
    gl.VertexAttribPointer(0, 3, GL_FLOAT, GL_FALSE, 0, NULL);
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

static double texel_m(const struct sv_terrain *terrain)
{
    const struct sv_heightfield *f = &terrain->field;
    double x = (f->width - 1) * f->dx / terrain->albedo.width,
           y = (f->height - 1) * f->dy / terrain->albedo.height;
    return sqrt(x * y);
}

static const char shadow_defines[] =
    "#define SHADOWS 1\n#define SHADOW_SIDE 1024.0\n#define SHADOW_WINDOWS 6\n";

static enum sv_status make_programs(struct sv_terrain_draw *draw, struct sv_error *error)
{
    int broad = sv_terrain_detail_end_m(SV_DETAIL_BROAD, texel_m(draw->terrain)) > 0;
    enum sv_status status = SV_OK;
    for (int k = 0; k < 2 * ZONE_COUNT && !status; k++) {
        char defines[160];
        int zone = k / 2, shadows = k % 2;
        snprintf(defines, sizeof defines, "#define DETAIL_SCALES %d\n#define DETAIL_BROAD %d\n%s",
                 SV_DETAIL_COUNT - zone, broad, shadows ? shadow_defines : "");
        status = sv_gl_program_create("terrain.vert", "terrain.frag", defines, &draw->programs[shadows][zone],
                                      error);
    }
    return status;
}

enum sv_status sv_terrain_draw_create(const struct sv_terrain *terrain, struct sv_store *store,
                                      struct sv_terrain_draw **draw, struct sv_error *error)
{
    enum sv_status status = check_images(terrain, error);
    if (status)
        return status;
    struct sv_terrain_draw *made = calloc(1, sizeof *made);
    if (!made)
        return sv_fail(error, SV_ENOMEM, "terrain", "no memory to draw the terrain");
    made->terrain = terrain;
    status = sv_terrain_detail_init(error);
    if (!status)
        status = sv_terrain_lod_create(&terrain->field, store, &made->lod, error);
    if (!status)
        status = make_programs(made, error);
    if (!status) {
        make_textures(made);
        make_buffers(made);
        status = sv_gl_check("terrain creation", error);
    }
    if (status) {
        sv_terrain_draw_destroy(made);
        return status;
    }
    *draw = made;
    return SV_OK;
}

void sv_terrain_draw_destroy(struct sv_terrain_draw *draw)
{
    if (!draw)
        return;
    for (int k = 0; k < 2 * ZONE_COUNT; k++)
        gl.DeleteProgram(draw->programs[k % 2][k / 2]);
    gl.DeleteTextures(UNIT_COUNT, draw->textures);
    gl.DeleteBuffers(2, draw->buffers);
    gl.DeleteVertexArrays(1, &draw->vertices);
    sv_terrain_mesh_finish(&draw->mesh);
    sv_terrain_lod_destroy(draw->lod);
    free(draw->zoned);
    free(draw);
}

/* ---- drawing ---- */

static void set_uniforms(const struct sv_terrain *terrain, struct sv_vec3 eye)
{
    const struct sv_heightfield *f = &terrain->field;
    double size_x = (f->width - 1) * f->dx, size_y = (f->height - 1) * f->dy, detail[SV_DETAIL_COUNT][2];
    float eye_uv[SV_DETAIL_COUNT][2];
    sv_terrain_detail_place(eye.x, eye.y, detail);
    gl.Uniform4f(AT_ALBEDO_UV, (float)(1 / size_x), (float)(1 / size_y), (float)((eye.x - f->x0) / size_x),
                 (float)((eye.y - f->y0) / size_y));
    gl.Uniform4f(AT_NORMAL_UV, (float)(1 / (f->dx * f->width)), (float)(1 / (f->dy * f->height)),
                 (float)(((eye.x - f->x0) / f->dx + 0.5) / f->width),
                 (float)(((eye.y - f->y0) / f->dy + 0.5) / f->height));
    for (int k = 0; k < SV_DETAIL_COUNT; k++)
        for (int c = 0; c < 2; c++)
            eye_uv[k][c] = (float)detail[k][c];
    gl.Uniform2fv(AT_DETAIL_EYE, SV_DETAIL_COUNT, eye_uv[0]);
    gl.Uniform1f(AT_TEXEL_M, (float)texel_m(terrain));
    gl.Uniform1ui(AT_ID, SV_ID_TERRAIN);
}

static void set_shadows(const struct sv_gl_shadows *shadows, struct sv_vec3 eye)
{
    float window[SV_GL_SHADOW_WINDOWS][4];
    for (int k = 0; k < SV_GL_SHADOW_WINDOWS; k++) {
        const struct sv_gl_shadow_window *w = &shadows->window[k];
        bool there = k < shadows->count;
        window[k][0] = there ? (float)((eye.x - w->x0) / w->side_m - 0.5) : 9;
        window[k][1] = there ? (float)((eye.y - w->y0) / w->side_m - 0.5) : 9;
        window[k][2] = there ? (float)(1 / w->side_m) : 0;
        window[k][3] = there ? (float)w->layer : 0;
    }
    gl.Uniform4fv(AT_SHADOW_WINDOW, SV_GL_SHADOW_WINDOWS, window[0]);
}

/* The depth (m) at which each zone but the last ends; orthographic pixels have one size everywhere. */
static void find_zone_ends(const struct sv_terrain_draw *draw, const struct sv_camera *camera,
                           float ends[SV_DETAIL_COUNT])
{
    double focal = sv_camera_focal_px(camera);
    for (int zone = 0; zone < SV_DETAIL_COUNT; zone++) {
        enum sv_terrain_detail_scale finest = (enum sv_terrain_detail_scale)(SV_DETAIL_FINE - zone);
        double end = sv_terrain_detail_end_m(finest, texel_m(draw->terrain));
        if (camera->projection == SV_PROJECTION_ORTHOGRAPHIC)
            ends[zone] = 1 / focal < end ? INFINITY : -INFINITY;
        else
            ends[zone] = (float)(end * focal);
    }
}

static int zone_of(const struct sv_terrain_mesh *mesh, const uint32_t *triangle, const float forward[3],
                   const float ends[SV_DETAIL_COUNT])
{
    float nearest = INFINITY;
    int zone = 0;
    for (int k = 0; k < 3; k++) {
        const float *p = mesh->vertices + 3 * (size_t)triangle[k];
        nearest = fminf(nearest, p[0] * forward[0] + p[1] * forward[1] + p[2] * forward[2]);
    }
    while (zone < SV_DETAIL_COUNT && nearest >= ends[zone])
        zone++;
    return zone;
}

/* Sorts the mesh's triangles into zones, keeping their order; first[z] .. first[z + 1] are those of zone z.
 */
static enum sv_status sort_zones(struct sv_terrain_draw *draw, const struct sv_camera *camera,
                                 uint32_t first[ZONE_COUNT + 1], struct sv_error *error)
{
    const struct sv_terrain_mesh *mesh = &draw->mesh;
    float ends[SV_DETAIL_COUNT];
    const float forward[3] = {(float)camera->forward.x, (float)camera->forward.y, (float)camera->forward.z};
    find_zone_ends(draw, camera, ends);
    if (draw->zoned_capacity < mesh->triangle_count) {
        free(draw->zoned);
        draw->zoned_capacity = mesh->triangle_capacity;
        draw->zoned = malloc((size_t)draw->zoned_capacity * 12 + draw->zoned_capacity);
        if (!draw->zoned) {
            draw->zoned_capacity = 0;
            return sv_fail(error, SV_ENOMEM, "terrain", "no memory for %u triangles", mesh->triangle_count);
        }
    }
    uint8_t *zones = (uint8_t *)(draw->zoned + 3 * (size_t)draw->zoned_capacity);
    uint32_t next[ZONE_COUNT] = {0};
    for (uint32_t t = 0; t < mesh->triangle_count; t++) {
        zones[t] = (uint8_t)zone_of(mesh, mesh->indices + 3 * (size_t)t, forward, ends);
        next[zones[t]]++;
    }
    first[0] = 0;
    for (int z = 0; z < ZONE_COUNT; z++) {
        first[z + 1] = first[z] + next[z];
        next[z] = first[z];
    }
    for (uint32_t t = 0; t < mesh->triangle_count; t++)
        memcpy(draw->zoned + 3 * (size_t)next[zones[t]]++, mesh->indices + 3 * (size_t)t, 12);
    return SV_OK;
}

static void submit(const struct sv_terrain_draw *draw, const uint32_t first[ZONE_COUNT + 1],
                   const struct sv_gl_frame *frame)
{
    bool shadows = frame->shadows && frame->shadows->count > 0;
    const struct sv_terrain_mesh *mesh = &draw->mesh;
    gl.BindVertexArray(draw->vertices);
    gl.BindBuffer(GL_ARRAY_BUFFER, draw->buffers[0]);
    gl.BufferData(GL_ARRAY_BUFFER, (GLsizeiptr)mesh->vertex_count * 12, mesh->vertices, GL_STREAM_DRAW);
    gl.BufferData(GL_ELEMENT_ARRAY_BUFFER, (GLsizeiptr)mesh->triangle_count * 12, draw->zoned,
                  GL_STREAM_DRAW);
    for (int z = 0; z < ZONE_COUNT; z++) {
        if (first[z] == first[z + 1])
            continue;
        gl.UseProgram(draw->programs[shadows][z]);
        set_uniforms(draw->terrain, frame->camera.eye);
        if (shadows)
            set_shadows(frame->shadows, frame->camera.eye);
        gl.DrawRangeElements(GL_TRIANGLES, 0, mesh->vertex_count - 1,
                             (GLsizei)((first[z + 1] - first[z]) * 3), GL_UNSIGNED_INT,
                             (const void *)((uintptr_t)first[z] * 12));
    }
    gl.BindVertexArray(0);
}

static void set_state(const struct sv_terrain_draw *draw, const struct sv_gl_shadows *shadows)
{
    gl.Enable(GL_DEPTH_TEST);
    gl.DepthFunc(GL_GREATER);
    gl.DepthMask(GL_TRUE);
    gl.Disable(GL_BLEND);
    gl.Disable(GL_CULL_FACE);
    for (unsigned k = 0; k < UNIT_COUNT; k++) {
        gl.ActiveTexture(GL_TEXTURE0 + k);
        gl.BindTexture(GL_TEXTURE_2D, draw->textures[k]);
    }
    if (shadows) {
        gl.ActiveTexture(GL_TEXTURE0 + UNIT_SHADOW);
        gl.BindTexture(GL_TEXTURE_2D_ARRAY, shadows->texture);
    }
    gl.ActiveTexture(GL_TEXTURE0);
}

enum sv_status sv_terrain_draw(struct sv_terrain_draw *draw, const struct sv_gl_frame *frame, double error_px,
                               struct sv_terrain_draw_stats *stats, struct sv_error *error)
{
    uint32_t first[ZONE_COUNT + 1];
    enum sv_status status = sv_terrain_lod_refine(draw->lod, &frame->camera, error_px, &draw->mesh, error);
    if (status)
        return status;
    if (draw->mesh.triangle_count) {
        status = sort_zones(draw, &frame->camera, first, error);
        if (status)
            return status;
        set_state(draw, frame->shadows);
        submit(draw, first, frame);
    }
    if (stats)
        *stats = (struct sv_terrain_draw_stats){draw->mesh.triangle_count, draw->mesh.max_error_px};
    return sv_gl_check("drawing the terrain", error);
}
