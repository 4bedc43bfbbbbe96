/* draw_object_mesh.c - see draw_object_mesh.h. One call a material and object: near objects are few. Masked
 * materials are read at level 0, the alpha rule of mesh.h, as trees and the ray-cast truth have it; the
 * others by mip levels, which is what the truth's many samples come to, and what reliefs hold. */
#include "core/relief/draw_object_mesh.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "core/base/frames.h"
#include "core/gl/context.h"
#include "core/gl/functions.h"
#include "core/gl/program.h"
#include "core/tree/draw_mesh_upload.h"

enum { UNIFORM_PLACE, UNIFORM_TURN, UNIFORM_SUN_RIGHT, UNIFORM_SUN_DOWN, UNIFORM_SUN_TRAVEL };
enum {
    UNIFORM_BASE = 8,
    UNIFORM_CUTOFF,
    UNIFORM_ID,
    UNIFORM_SHADE,
    UNIFORM_BIAS,
    UNIFORM_LEFT
}; /* object_mesh.frag */
enum { UNIT_ALBEDO, UNIT_SUN };

/* A caster must lie this many texels of the shadow map in front of what it shades; the shader adds the
 * surface's own slope. Found by eye and by test_draw_object: less leaves stripes on walls that face the sun
 * at a slant, more detaches the shadow of eaves. */
#define BIAS_TEXELS 0.75f

struct model_mesh {
    const struct sv_tree_mesh *mesh;
    struct sv_mesh_upload upload; /* textures: 0: the white one */
};

struct sun_map {
    GLuint texture;
    int width, height;
    unsigned serial; /* of the sun that it was uploaded for */
};

struct sv_object_meshes {
    int model_count, map_count;
    struct model_mesh *models;
    struct sun_map *maps;
    unsigned serial;
    GLuint plain, masked; /* programs */
    GLuint white, open;   /* textures of one texel: no albedo, no shadow map */
};

static GLuint make_depth_texture(int width, int height, const float *depth)
{
    GLuint name;
    gl.GenTextures(1, &name);
    gl.BindTexture(GL_TEXTURE_2D, name);
    gl.TexStorage2D(GL_TEXTURE_2D, 1, GL_R32F, width, height);
    gl.TexSubImage2D(GL_TEXTURE_2D, 0, 0, 0, width, height, GL_RED, GL_FLOAT, depth);
    gl.TexParameteri(GL_TEXTURE_2D, GL_TEXTURE_MIN_FILTER, GL_NEAREST);
    gl.TexParameteri(GL_TEXTURE_2D, GL_TEXTURE_MAG_FILTER, GL_NEAREST);
    return name;
}

enum sv_status sv_object_meshes_create(const struct sv_object_model *models, int model_count, int map_count,
                                       struct sv_object_meshes **out, struct sv_error *error)
{
    static const uint8_t white[4] = {255, 255, 255, 255};
    static const float open = INFINITY;
    struct sv_object_meshes *m = calloc(1, sizeof *m);
    if (m) {
        m->models = calloc((size_t)model_count + 1, sizeof *m->models);
        m->maps = calloc((size_t)map_count + 1, sizeof *m->maps);
    }
    if (!m || !m->models || !m->maps) {
        sv_object_meshes_destroy(m);
        return sv_fail(error, SV_ENOMEM, "objects", "no memory to draw %d models", model_count);
    }
    m->model_count = model_count;
    m->map_count = map_count;
    m->serial = 1;
    enum sv_status status =
        sv_gl_program_create("object_mesh.vert", "object_mesh.frag", NULL, &m->plain, error);
    if (!status)
        status = sv_gl_program_create("object_mesh.vert", "object_mesh.frag", "#define MASKED 1\n",
                                      &m->masked, error);
    if (status) {
        sv_object_meshes_destroy(m);
        return status;
    }
    m->white = sv_mesh_upload_texture(1, 1, white, true);
    m->open = make_depth_texture(1, 1, &open);
    for (int k = 0; k < model_count; k++) {
        m->models[k].mesh = &models[k].mesh;
        sv_mesh_upload_init(&models[k].mesh, true, &m->models[k].upload);
    }
    status = sv_gl_check("uploading objects", error);
    if (status)
        sv_object_meshes_destroy(m);
    else
        *out = m;
    return status;
}

void sv_object_meshes_destroy(struct sv_object_meshes *m)
{
    if (!m)
        return;
    for (int k = 0; k < m->model_count; k++)
        sv_mesh_upload_finish(&m->models[k].upload);
    for (int k = 0; k < m->map_count; k++)
        gl.DeleteTextures(1, &m->maps[k].texture);
    if (m->white) { /* else there may be no GL at all */
        gl.DeleteTextures(1, &m->white);
        gl.DeleteTextures(1, &m->open);
        gl.DeleteProgram(m->plain);
        gl.DeleteProgram(m->masked);
    }
    free(m->maps);
    free(m->models);
    free(m);
}

void sv_object_meshes_new_sun(struct sv_object_meshes *meshes)
{
    meshes->serial++;
}

/* The texture of an entry's shadow map, uploaded when it is not there yet. */
static GLuint sun_texture(struct sv_object_meshes *m, const struct sv_object_mesh_entry *e)
{
    if (!e->sun)
        return m->open;
    const struct sv_silhouette *s = &e->sun->silhouette;
    struct sun_map *map = &m->maps[e->map];
    if (map->texture && map->serial == m->serial && map->width == s->width && map->height == s->height)
        return map->texture;
    gl.DeleteTextures(1, &map->texture);
    *map =
        (struct sun_map){make_depth_texture(s->width, s->height, s->first), s->width, s->height, m->serial};
    return map->texture;
}

/* The row of (q - corner) . axis * scale as a function of q, a place in heights from the foot. */
static void set_sun_row(GLint uniform, struct sv_vec3 axis, double scale, const struct sv_silhouette *s)
{
    gl.Uniform4f(uniform, (float)(axis.x * scale), (float)(axis.y * scale), (float)(axis.z * scale),
                 (float)(-scale * sv_dot(axis, s->corner)));
}

static void set_object(GLuint program, const struct sv_object_mesh_entry *e, struct sv_vec3 eye)
{
    static const struct sv_silhouette none = {.width = 1, .height = 1};
    const struct sv_silhouette *s = e->sun ? &e->sun->silhouette : &none;
    double texel = e->sun ? e->sun->texel : 1;
    struct sv_vec3 foot = sv_sub(e->at.place, eye);
    gl.UseProgram(program);
    gl.Uniform4f(UNIFORM_PLACE, (float)foot.x, (float)foot.y, (float)foot.z, (float)e->at.height_m);
    gl.Uniform2f(UNIFORM_TURN, (float)cos(e->at.heading_rad), (float)sin(e->at.heading_rad));
    set_sun_row(UNIFORM_SUN_RIGHT, s->right, 1 / texel, s);
    set_sun_row(UNIFORM_SUN_DOWN, s->down, 1 / texel, s);
    set_sun_row(UNIFORM_SUN_TRAVEL, s->travel, 1, s);
    gl.Uniform1ui(UNIFORM_ID, e->id);
    gl.Uniform1f(UNIFORM_SHADE, (float)fmax(e->shade_height_m - eye.z, -1e30));
    gl.Uniform1f(UNIFORM_LEFT, (float)(1 - e->taken));
    gl.Uniform1f(UNIFORM_BIAS, (float)(BIAS_TEXELS * texel));
}

static void draw_entry(struct sv_object_meshes *m, const struct sv_object_mesh_entry *e, struct sv_vec3 eye)
{
    const struct model_mesh *model = &m->models[e->model];
    GLuint current = 0;
    gl.ActiveTexture(GL_TEXTURE0 + UNIT_SUN);
    gl.BindTexture(GL_TEXTURE_2D, sun_texture(m, e));
    gl.ActiveTexture(GL_TEXTURE0 + UNIT_ALBEDO);
    gl.BindVertexArray(model->upload.array);
    for (int k = 0; k < model->mesh->material_count; k++) {
        const struct sv_tree_material *material = &model->mesh->materials[k];
        if (material->index_count == 0)
            continue;
        GLuint program = material->masked && model->upload.textures[k] ? m->masked : m->plain;
        if (program != current)
            set_object(program, e, eye);
        current = program;
        gl.BindTexture(GL_TEXTURE_2D, model->upload.textures[k] ? model->upload.textures[k] : m->white);
        gl.Uniform4fv(UNIFORM_BASE, 1, material->base_color);
        gl.Uniform1f(UNIFORM_CUTOFF, material->alpha_cutoff);
        gl.DrawElements(GL_TRIANGLES, (GLsizei)material->index_count, GL_UNSIGNED_INT,
                        (const void *)((size_t)material->first_index * sizeof(uint32_t)));
    }
}

enum sv_status sv_object_meshes_draw(struct sv_object_meshes *meshes, const struct sv_gl_frame *frame,
                                     const struct sv_object_mesh_entry *entries, uint32_t count,
                                     struct sv_error *error)
{
    if (count == 0)
        return SV_OK;
    gl.Disable(GL_CULL_FACE);
    for (uint32_t k = 0; k < count; k++)
        draw_entry(meshes, &entries[k], frame->camera.eye);
    gl.BindVertexArray(0);
    gl.ActiveTexture(GL_TEXTURE0);
    return sv_gl_check("drawing objects' polygons", error);
}
