/* draw_billboard.c - classical billboards on the GL side: three array textures, a layer a plane. */
#include <string.h>

#include "core/gl/context.h"
#include "core/gl/functions.h"
#include "core/tree/billboard.h"
#include "core/tree/draw_cloud_form.h"

#define SV_COMPRESSED_SRGB_ALPHA_DXT5 0x8C4F /* GL_EXT_texture_sRGB; not in glcorearb.h */

enum sv_status sv_form_billboard_build(const struct sv_tree_mesh *mesh, const struct sv_tree_cloud *cloud,
                                       void **data, size_t *bytes, struct sv_error *error)
{
    struct sv_billboards billboards = {0};
    enum sv_status status =
        sv_billboards_bake(mesh, cloud, &SV_BILLBOARD_OPTIONS_DEFAULT, &billboards, error);
    if (!status)
        status = sv_billboards_save(&billboards, data, bytes, error);
    sv_billboards_finish(&billboards);
    return status;
}

size_t sv_form_billboard_bytes(const struct sv_tree_mesh *mesh, int planes)
{
    (void)mesh;
    return sv_billboards_bytes(&SV_BILLBOARD_OPTIONS_DEFAULT, planes);
}

unsigned sv_form_billboard_part(const struct sv_billboards *b, enum sv_billboard_part part)
{
    GLuint name;
    int levels = b->levels[part];
    gl.GenTextures(1, &name);
    gl.BindTexture(GL_TEXTURE_2D_ARRAY, name);
    gl.TexStorage3D(GL_TEXTURE_2D_ARRAY, levels,
                    part == SV_BILLBOARD_COLOR ? SV_COMPRESSED_SRGB_ALPHA_DXT5 : GL_RGBA8, b->side[part],
                    b->side[part], b->plane_count);
    for (int k = 0; k < levels; k++) {
        size_t bytes;
        const uint8_t *data = sv_billboards_level(b, part, k, &bytes);
        int side = b->side[part] >> k;
        if (part == SV_BILLBOARD_COLOR)
            gl.CompressedTexSubImage3D(GL_TEXTURE_2D_ARRAY, k, 0, 0, 0, side, side, b->plane_count,
                                       SV_COMPRESSED_SRGB_ALPHA_DXT5,
                                       (GLsizei)(bytes * (size_t)b->plane_count), data);
        else
            gl.TexSubImage3D(GL_TEXTURE_2D_ARRAY, k, 0, 0, 0, side, side, b->plane_count, GL_RGBA,
                             GL_UNSIGNED_BYTE, data);
    }
    gl.TexParameteri(GL_TEXTURE_2D_ARRAY, GL_TEXTURE_MIN_FILTER,
                     levels > 1 ? GL_LINEAR_MIPMAP_NEAREST : GL_LINEAR);
    gl.TexParameteri(GL_TEXTURE_2D_ARRAY, GL_TEXTURE_MAG_FILTER, GL_LINEAR);
    gl.TexParameteri(GL_TEXTURE_2D_ARRAY, GL_TEXTURE_WRAP_S, GL_CLAMP_TO_EDGE);
    gl.TexParameteri(GL_TEXTURE_2D_ARRAY, GL_TEXTURE_WRAP_T, GL_CLAMP_TO_EDGE);
    return name;
}

enum sv_status sv_form_billboard_upload(const struct sv_tree_mesh *mesh, const struct sv_tree_cloud *cloud,
                                        const void *data, size_t bytes, struct sv_cloud_textures *t,
                                        struct sv_error *error)
{
    struct sv_billboards b = {0};
    (void)mesh;
    enum sv_status status = sv_billboards_load(data, bytes, &b, error);
    if (!status && b.plane_count != cloud->plane_count)
        status =
            sv_fail(error, SV_EFORMAT, "billboards", "%d planes, not %d", b.plane_count, cloud->plane_count);
    if (!status) {
        for (int part = 0; part < SV_BILLBOARD_PARTS; part++) {
            t->target[part] = GL_TEXTURE_2D_ARRAY;
            t->name[part] = sv_form_billboard_part(&b, (enum sv_billboard_part)part);
        }
        memcpy(t->params[0], b.translucency, sizeof b.translucency);
        memcpy(t->params[1], b.bar, 12 * sizeof *b.bar); /* coarser ones are a few texels */
        memcpy(t->outline, b.outline, sizeof t->outline);
        t->bytes = b.bytes;
        status = sv_gl_check("uploading billboards", error);
    }
    sv_billboards_finish(&b);
    return status;
}
