/* draw.c - the terrain's textures and shader, and the drawing of a refined mesh (lod.h).
 *
 * Mesh vertices are relative to the eye. Texture coordinates are affine in them with offsets formed in
 * double, so nothing large is ever narrowed. Shading is terrain.frag: albedo (mip levels), normal texture,
 * detail.glsl, light.glsl. */
#include "core/terrain/draw.h"

#include <stdlib.h>

#include "core/gl/context.h"
#include "core/gl/functions.h"
#include "core/gl/program.h"
#include "core/scene/id.h"
#include "core/terrain/detail.h"
#include "core/terrain/lod.h"

enum { UNIT_ALBEDO, UNIT_NORMAL, UNIT_DETAIL, UNIT_COUNT };

/* Uniform locations of terrain.frag. */
enum { AT_ALBEDO_UV, AT_NORMAL_UV, AT_DETAIL_UV, AT_TEXEL_M, AT_ID };

struct sv_terrain_draw {
    const struct sv_terrain *terrain;
    struct sv_terrain_lod *lod;
    struct sv_terrain_mesh mesh;
    unsigned program;
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

static void set_sampling(GLenum wrap)
{
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
    set_sampling(GL_CLAMP_TO_EDGE);
    gl.BindTexture(GL_TEXTURE_2D, draw->textures[UNIT_NORMAL]);
    upload_image(&draw->terrain->normal, GL_RG8, GL_RG);
    set_sampling(GL_CLAMP_TO_EDGE);
    gl.BindTexture(GL_TEXTURE_2D, draw->textures[UNIT_DETAIL]);
    upload_detail();
    set_sampling(GL_REPEAT);
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
        status = sv_gl_program_create("terrain.vert", "terrain.frag", NULL, &made->program, error);
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
    gl.DeleteProgram(draw->program);
    gl.DeleteTextures(UNIT_COUNT, draw->textures);
    gl.DeleteBuffers(2, draw->buffers);
    gl.DeleteVertexArrays(1, &draw->vertices);
    sv_terrain_mesh_finish(&draw->mesh);
    sv_terrain_lod_destroy(draw->lod);
    free(draw);
}

/* ---- drawing ---- */

static void set_uniforms(const struct sv_terrain_draw *draw, struct sv_vec3 eye)
{
    const struct sv_heightfield *f = &draw->terrain->field;
    double size_x = (f->width - 1) * f->dx, size_y = (f->height - 1) * f->dy, detail[4];
    const struct sv_image *albedo = &draw->terrain->albedo;
    sv_terrain_detail_place(eye.x, eye.y, detail);
    gl.Uniform4f(AT_ALBEDO_UV, (float)(1 / size_x), (float)(1 / size_y), (float)((eye.x - f->x0) / size_x),
                 (float)((eye.y - f->y0) / size_y));
    gl.Uniform4f(AT_NORMAL_UV, (float)(1 / (f->dx * f->width)), (float)(1 / (f->dy * f->height)),
                 (float)(((eye.x - f->x0) / f->dx + 0.5) / f->width),
                 (float)(((eye.y - f->y0) / f->dy + 0.5) / f->height));
    gl.Uniform4f(AT_DETAIL_UV, (float)detail[0], (float)detail[1], (float)detail[2], (float)detail[3]);
    gl.Uniform1f(AT_TEXEL_M, (float)sqrt(size_x / albedo->width * (size_y / albedo->height)));
    gl.Uniform1ui(AT_ID, SV_ID_TERRAIN);
}

static void submit(const struct sv_terrain_draw *draw)
{
    const struct sv_terrain_mesh *mesh = &draw->mesh;
    gl.BindVertexArray(draw->vertices);
    gl.BindBuffer(GL_ARRAY_BUFFER, draw->buffers[0]);
    gl.BufferData(GL_ARRAY_BUFFER, (GLsizeiptr)mesh->vertex_count * 12, mesh->vertices, GL_STREAM_DRAW);
    gl.BufferData(GL_ELEMENT_ARRAY_BUFFER, (GLsizeiptr)mesh->triangle_count * 12, mesh->indices,
                  GL_STREAM_DRAW);
    gl.DrawRangeElements(GL_TRIANGLES, 0, mesh->vertex_count - 1, (GLsizei)(mesh->triangle_count * 3),
                         GL_UNSIGNED_INT, NULL);
    gl.BindVertexArray(0);
}

enum sv_status sv_terrain_draw(struct sv_terrain_draw *draw, const struct sv_gl_frame *frame, double error_px,
                               struct sv_terrain_draw_stats *stats, struct sv_error *error)
{
    enum sv_status status = sv_terrain_lod_refine(draw->lod, &frame->camera, error_px, &draw->mesh, error);
    if (status)
        return status;
    if (draw->mesh.triangle_count) {
        gl.Enable(GL_DEPTH_TEST);
        gl.DepthFunc(GL_GREATER);
        gl.DepthMask(GL_TRUE);
        gl.Disable(GL_BLEND);
        gl.Disable(GL_CULL_FACE);
        gl.UseProgram(draw->program);
        for (unsigned k = 0; k < UNIT_COUNT; k++) {
            gl.ActiveTexture(GL_TEXTURE0 + k);
            gl.BindTexture(GL_TEXTURE_2D, draw->textures[k]);
        }
        gl.ActiveTexture(GL_TEXTURE0);
        set_uniforms(draw, frame->camera.eye);
        submit(draw);
    }
    if (stats)
        *stats = (struct sv_terrain_draw_stats){draw->mesh.triangle_count, draw->mesh.max_error_px};
    return sv_gl_check("drawing the terrain", error);
}
