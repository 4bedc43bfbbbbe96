/* draw.c - the drawing of a refined mesh (lod.h): depth, id and, where a view wants them, normals. Vertices
 * are relative to the eye; texture coordinates are affine in them with offsets formed in double, so nothing
 * large is ever narrowed. The colour is ground.c's. */
#include "core/terrain/draw.h"

#include <stdlib.h>

#include "core/gl/context.h"
#include "core/gl/functions.h"
#include "core/gl/program.h"
#include "core/scene/id.h"
#include "core/terrain/lod.h"

/* Uniform locations of terrain.frag. */
enum { AT_NORMAL_UV, AT_ID };

struct sv_terrain_draw {
    const struct sv_terrain *terrain;
    struct sv_terrain_lod *lod;
    struct sv_terrain_mesh mesh;
    unsigned program, depth_program; /* all layers; depth alone */
    GLuint normals, vertices, buffers[2];
};

/* ---- making ---- */

static int level_count(int width, int height)
{
    int side = width > height ? width : height, levels = 1;
    while (side >> levels)
        levels++;
    return levels;
}

/* No anisotropic filter: at 2x it costs a quarter of the terrain's time (llvmpipe). Half a level of bias is
 * free. */
static void make_normals(struct sv_terrain_draw *draw)
{
    const struct sv_image *image = &draw->terrain->normal;
    gl.GenTextures(1, &draw->normals);
    gl.BindTexture(GL_TEXTURE_2D, draw->normals);
    gl.TexStorage2D(GL_TEXTURE_2D, level_count(image->width, image->height), GL_RG8, image->width,
                    image->height);
    gl.TexSubImage2D(GL_TEXTURE_2D, 0, 0, 0, image->width, image->height, GL_RG, GL_UNSIGNED_BYTE,
                     image->data);
    gl.GenerateMipmap(GL_TEXTURE_2D);
    gl.TexParameterf(GL_TEXTURE_2D, GL_TEXTURE_LOD_BIAS, -0.5f);
    gl.TexParameteri(GL_TEXTURE_2D, GL_TEXTURE_WRAP_S, GL_CLAMP_TO_EDGE);
    gl.TexParameteri(GL_TEXTURE_2D, GL_TEXTURE_WRAP_T, GL_CLAMP_TO_EDGE);
    gl.TexParameteri(GL_TEXTURE_2D, GL_TEXTURE_MIN_FILTER, GL_LINEAR_MIPMAP_LINEAR);
    gl.TexParameteri(GL_TEXTURE_2D, GL_TEXTURE_MAG_FILTER, GL_LINEAR);
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

static enum sv_status check_normals(const struct sv_terrain *terrain, struct sv_error *error)
{
    const struct sv_image *n = &terrain->normal;
    if (n->data && n->channels == 2 && n->type == SV_PIXEL_U8 && n->width == terrain->field.width &&
        n->height == terrain->field.height)
        return SV_OK;
    return sv_fail(error, SV_EINVAL, "terrain.normal", "the terrain has no normals at its %d x %d samples",
                   terrain->field.width, terrain->field.height);
}

enum sv_status sv_terrain_draw_create(const struct sv_terrain *terrain, struct sv_store *store,
                                      struct sv_terrain_draw **draw, struct sv_error *error)
{
    enum sv_status status = check_normals(terrain, error);
    if (status)
        return status;
    struct sv_terrain_draw *made = calloc(1, sizeof *made);
    if (!made)
        return sv_fail(error, SV_ENOMEM, "terrain", "no memory to draw the terrain");
    made->terrain = terrain;
    status = sv_terrain_lod_create(&terrain->field, store, &made->lod, error);
    if (!status)
        status = sv_gl_program_create("terrain.vert", "terrain.frag", NULL, &made->program, error);
    if (!status)
        status = sv_gl_program_create("terrain.vert", "terrain.frag", "#define DEPTH_ONLY 1\n",
                                      &made->depth_program, error);
    if (!status) {
        make_normals(made);
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
    gl.DeleteProgram(draw->depth_program);
    gl.DeleteTextures(1, &draw->normals);
    gl.DeleteBuffers(2, draw->buffers);
    gl.DeleteVertexArrays(1, &draw->vertices);
    sv_terrain_mesh_finish(&draw->mesh);
    sv_terrain_lod_destroy(draw->lod);
    free(draw);
}

/* ---- drawing ---- */

static void set_uniforms(const struct sv_terrain *terrain, struct sv_vec3 eye)
{
    const struct sv_heightfield *f = &terrain->field;
    gl.Uniform4f(AT_NORMAL_UV, (float)(1 / (f->dx * f->width)), (float)(1 / (f->dy * f->height)),
                 (float)(((eye.x - f->x0) / f->dx + 0.5) / f->width),
                 (float)(((eye.y - f->y0) / f->dy + 0.5) / f->height));
    gl.Uniform1ui(AT_ID, SV_ID_TERRAIN);
}

static void submit(const struct sv_terrain_draw *draw, const struct sv_gl_frame *frame, bool depth_only)
{
    const struct sv_terrain_mesh *mesh = &draw->mesh;
    gl.BindVertexArray(draw->vertices);
    gl.BindBuffer(GL_ARRAY_BUFFER, draw->buffers[0]);
    gl.BufferData(GL_ARRAY_BUFFER, (GLsizeiptr)mesh->vertex_count * 12, mesh->vertices, GL_STREAM_DRAW);
    gl.BufferData(GL_ELEMENT_ARRAY_BUFFER, (GLsizeiptr)mesh->triangle_count * 12, mesh->indices,
                  GL_STREAM_DRAW);
    gl.UseProgram(depth_only ? draw->depth_program : draw->program);
    if (!depth_only)
        set_uniforms(draw->terrain, frame->camera.eye);
    gl.DrawRangeElements(GL_TRIANGLES, 0, mesh->vertex_count - 1, (GLsizei)(mesh->triangle_count * 3),
                         GL_UNSIGNED_INT, NULL);
    gl.BindVertexArray(0);
}

static void set_state(const struct sv_terrain_draw *draw, bool depth_only)
{
    gl.Enable(GL_DEPTH_TEST);
    gl.DepthFunc(GL_GREATER);
    gl.DepthMask(GL_TRUE);
    gl.Disable(GL_BLEND);
    gl.Disable(GL_CULL_FACE);
    for (GLuint k = 0; k < (depth_only ? 3 : 1); k++)
        gl.ColorMaski(k, GL_FALSE, GL_FALSE, GL_FALSE, GL_FALSE);
    gl.ActiveTexture(GL_TEXTURE0);
    gl.BindTexture(GL_TEXTURE_2D, draw->normals);
}

enum sv_status sv_terrain_draw(struct sv_terrain_draw *draw, const struct sv_gl_frame *frame, double error_px,
                               bool depth_only, struct sv_terrain_draw_stats *stats, struct sv_error *error)
{
    enum sv_status status = 
        sv_terrain_lod_refine(draw->lod, &frame->camera, frame->band_planes, error_px, &draw->mesh, error);
    if (status)
        return status;
    if (draw->mesh.triangle_count) {
        set_state(draw, depth_only);
        submit(draw, frame, depth_only);
        gl.ColorMask(GL_TRUE, GL_TRUE, GL_TRUE, GL_TRUE);
    }
    if (stats)
        *stats = (struct sv_terrain_draw_stats){draw->mesh.triangle_count, draw->mesh.max_error_px};
    return sv_gl_check("drawing the terrain", error);
}
