#include "core/tree/draw_mesh_upload.h"

#include <stddef.h>

#include "core/gl/functions.h"

_Static_assert(sizeof(GLuint) == sizeof(unsigned), "GL names are unsigned");

unsigned sv_mesh_upload_texture(int width, int height, const void *rgba, bool mipmaps)
{
    GLuint name;
    int levels = 1;
    while (mipmaps && levels < 16 && (width >> levels || height >> levels))
        levels++;
    gl.GenTextures(1, &name);
    gl.BindTexture(GL_TEXTURE_2D, name);
    gl.TexStorage2D(GL_TEXTURE_2D, levels, GL_SRGB8_ALPHA8, width, height);
    gl.TexSubImage2D(GL_TEXTURE_2D, 0, 0, 0, width, height, GL_RGBA, GL_UNSIGNED_BYTE, rgba);
    if (mipmaps)
        gl.GenerateMipmap(GL_TEXTURE_2D);
    gl.TexParameteri(GL_TEXTURE_2D, GL_TEXTURE_MIN_FILTER, mipmaps ? GL_LINEAR_MIPMAP_LINEAR : GL_LINEAR);
    gl.TexParameteri(GL_TEXTURE_2D, GL_TEXTURE_MAG_FILTER, GL_LINEAR);
    gl.TexParameteri(GL_TEXTURE_2D, GL_TEXTURE_WRAP_S, GL_REPEAT);
    gl.TexParameteri(GL_TEXTURE_2D, GL_TEXTURE_WRAP_T, GL_REPEAT);
    return name;
}

static void set_attributes(void)
{
    static const struct {
        GLint size;
        GLenum type;
        GLboolean normalized;
        size_t offset;
    } attributes[SV_MESH_AT_INSTANCE] = {
        [SV_MESH_AT_POSITION] = {3, GL_FLOAT, GL_FALSE, offsetof(struct sv_tree_vertex, position)},
        [SV_MESH_AT_NORMAL] = {3, GL_SHORT, GL_TRUE, offsetof(struct sv_tree_vertex, normal)},
        [SV_MESH_AT_OCCLUSION] = {1, GL_UNSIGNED_SHORT, GL_TRUE, offsetof(struct sv_tree_vertex, occlusion)},
        [SV_MESH_AT_UV] = {2, GL_FLOAT, GL_FALSE, offsetof(struct sv_tree_vertex, uv)},
        [SV_MESH_AT_OPEN] = {4, GL_BYTE, GL_TRUE, offsetof(struct sv_tree_vertex, open)},
    };
    for (GLuint at = 0; at < SV_MESH_AT_INSTANCE; at++) {
        gl.EnableVertexAttribArray(at);
        gl.VertexAttribPointer(at, attributes[at].size, attributes[at].type, attributes[at].normalized,
                               sizeof(struct sv_tree_vertex), (const void *)attributes[at].offset);
    }
}

size_t sv_mesh_upload_bytes(const struct sv_tree_mesh *mesh)
{
    size_t bytes = mesh->vertex_count * sizeof *mesh->vertices + mesh->index_count * sizeof *mesh->indices;
    for (int k = 0; k < mesh->material_count; k++)
        if (mesh->materials[k].albedo.data)
            bytes += sv_image_bytes(&mesh->materials[k].albedo);
    return bytes;
}

void sv_mesh_upload_init(const struct sv_tree_mesh *mesh, bool mipmaps, struct sv_mesh_upload *upload)
{
    size_t vertex_bytes = mesh->vertex_count * sizeof *mesh->vertices;
    size_t index_bytes = mesh->index_count * sizeof *mesh->indices;
    *upload = (struct sv_mesh_upload){.array = 0};
    gl.GenVertexArrays(1, &upload->array);
    gl.GenBuffers(1, &upload->vertices);
    gl.GenBuffers(1, &upload->indices);
    gl.BindVertexArray(upload->array);
    gl.BindBuffer(GL_ARRAY_BUFFER, upload->vertices);
    gl.BufferData(GL_ARRAY_BUFFER, (GLsizeiptr)vertex_bytes, mesh->vertices, GL_STATIC_DRAW);
    gl.BindBuffer(GL_ELEMENT_ARRAY_BUFFER, upload->indices);
    gl.BufferData(GL_ELEMENT_ARRAY_BUFFER, (GLsizeiptr)index_bytes, mesh->indices, GL_STATIC_DRAW);
    set_attributes();
    gl.BindVertexArray(0);
    for (int k = 0; k < mesh->material_count; k++) {
        const struct sv_image *albedo = &mesh->materials[k].albedo;
        if (!albedo->data)
            continue;
        upload->textures[k] = sv_mesh_upload_texture(albedo->width, albedo->height, albedo->data, mipmaps);
    }
}

void sv_mesh_upload_finish(struct sv_mesh_upload *upload)
{
    if (!upload->array) /* there may be no GL at all */
        return;
    gl.DeleteVertexArrays(1, &upload->array);
    gl.DeleteBuffers(1, &upload->vertices);
    gl.DeleteBuffers(1, &upload->indices);
    gl.DeleteTextures(SV_TREE_MATERIALS_MAX, upload->textures);
    *upload = (struct sv_mesh_upload){0};
}
