/* draw_indirect.c - indirect textures on the GL side. */
#include <math.h>
#include <string.h>

#include "core/gl/context.h"
#include "core/gl/functions.h"
#include "core/tree/draw_cloud_form.h"
#include "core/tree/indirect.h"

/* Leaves of fewer pixels than the first are told by the base, of more than the second by themselves: below,
 * which leaf a texel names is chance. */
static const float BASE_PX = 1.5f, LEAF_PX = 3;

enum sv_status sv_form_indirect_build(const struct sv_tree_mesh *mesh, const struct sv_tree_cloud *cloud,
                                      void **data, size_t *bytes, struct sv_error *error)
{
    struct sv_indirect made = {0};
    enum sv_status status = sv_indirect_bake(mesh, cloud, &SV_INDIRECT_OPTIONS_DEFAULT, &made, error);
    if (!status)
        status = sv_indirect_save(&made, data, bytes, error);
    sv_indirect_finish(&made);
    return status;
}

static void set_sampler(GLenum target, GLint min, GLint mag, GLint wrap)
{
    gl.TexParameteri(target, GL_TEXTURE_MIN_FILTER, min);
    gl.TexParameteri(target, GL_TEXTURE_MAG_FILTER, mag);
    gl.TexParameteri(target, GL_TEXTURE_WRAP_S, wrap);
    gl.TexParameteri(target, GL_TEXTURE_WRAP_T, wrap);
}

static GLuint upload_codes(const struct sv_indirect *t)
{
    GLuint name;
    gl.GenTextures(1, &name);
    gl.BindTexture(GL_TEXTURE_2D_ARRAY, name);
    gl.TexStorage3D(GL_TEXTURE_2D_ARRAY, 1, GL_RGBA8, t->side, t->side, t->plane_count);
    gl.TexSubImage3D(GL_TEXTURE_2D_ARRAY, 0, 0, 0, 0, t->side, t->side, t->plane_count, GL_RGBA,
                     GL_UNSIGNED_BYTE, t->texels);
    set_sampler(GL_TEXTURE_2D_ARRAY, GL_NEAREST, GL_NEAREST, GL_CLAMP_TO_EDGE);
    return name;
}

static GLuint upload_leaves(const struct sv_indirect *t)
{
    GLuint name;
    int levels = 1, layers = t->layer_count > 0 ? t->layer_count : 1;
    const uint8_t *at = t->leaves;
    while (SV_INDIRECT_LEAF_SIDE >> levels)
        levels++;
    gl.GenTextures(1, &name);
    gl.BindTexture(GL_TEXTURE_2D_ARRAY, name);
    gl.TexStorage3D(GL_TEXTURE_2D_ARRAY, levels, GL_SRGB8_ALPHA8, SV_INDIRECT_LEAF_SIDE,
                    SV_INDIRECT_LEAF_SIDE, layers);
    for (int k = 0; t->layer_count > 0 && k < levels; k++) {
        int side = SV_INDIRECT_LEAF_SIDE >> k;
        gl.TexSubImage3D(GL_TEXTURE_2D_ARRAY, k, 0, 0, 0, side, side, layers, GL_RGBA, GL_UNSIGNED_BYTE, at);
        at += 4 * (size_t)side * (size_t)side * (size_t)layers;
    }
    set_sampler(GL_TEXTURE_2D_ARRAY, GL_LINEAR_MIPMAP_NEAREST, GL_LINEAR, GL_REPEAT);
    return name;
}

static GLuint upload_kinds(const struct sv_indirect *t)
{
    GLuint name;
    gl.GenTextures(1, &name);
    gl.BindTexture(GL_TEXTURE_2D, name);
    gl.TexStorage2D(GL_TEXTURE_2D, 1, GL_RGBA32F, 2, SV_INDIRECT_KINDS);
    gl.TexSubImage2D(GL_TEXTURE_2D, 0, 0, 0, 2, SV_INDIRECT_KINDS, GL_RGBA, GL_FLOAT, t->kinds);
    set_sampler(GL_TEXTURE_2D, GL_NEAREST, GL_NEAREST, GL_CLAMP_TO_EDGE);
    return name;
}

/* Mean narrow side of the leaves, over what texels name, model units. */
static float leaf_size(const struct sv_indirect *t)
{
    double sum = 0, count = 0;
    size_t bytes = 4 * (size_t)t->plane_count * (size_t)t->side * (size_t)t->side;
    for (size_t k = 3; k < bytes; k += 4) {
        const struct sv_indirect_kind *kind = &t->kinds[t->texels[k]];
        if (t->texels[k] == 0)
            continue;
        sum += 2 * fmin((double)kind->half[0], (double)kind->half[1]);
        count++;
    }
    return count > 0 ? (float)(sum / count) : 1;
}

size_t sv_form_indirect_bytes(const struct sv_tree_mesh *mesh, int planes)
{
    return sv_indirect_most_bytes(mesh, &SV_INDIRECT_OPTIONS_DEFAULT, planes);
}

enum sv_status sv_form_indirect_upload(const struct sv_tree_mesh *mesh, const struct sv_tree_cloud *cloud,
                                       const void *data, size_t bytes, struct sv_cloud_textures *t,
                                       struct sv_error *error)
{
    struct sv_indirect i = {0};
    (void)mesh;
    enum sv_status status = sv_indirect_load(data, bytes, &i, error);
    if (!status && i.plane_count != cloud->plane_count)
        status =
            sv_fail(error, SV_EFORMAT, "indirect", "%d planes, not %d", i.plane_count, cloud->plane_count);
    if (!status) {
        const GLuint names[] = {upload_codes(&i),
                                upload_leaves(&i),
                                upload_kinds(&i),
                                sv_form_billboard_part(&i.base, SV_BILLBOARD_COLOR),
                                sv_form_billboard_part(&i.base, SV_BILLBOARD_NORMAL),
                                sv_form_billboard_part(&i.base, SV_BILLBOARD_LIGHT)};
        for (int k = 0; k < SV_CLOUD_TEXTURES_MAX; k++) {
            t->name[k] = names[k];
            t->target[k] = k == 2 ? GL_TEXTURE_2D : GL_TEXTURE_2D_ARRAY;
        }
        const float numbers[4] = {(float)i.side, BASE_PX, LEAF_PX, leaf_size(&i)};
        memcpy(t->params[0], i.base.translucency, sizeof t->params[0]);
        memcpy(t->params[1], numbers, sizeof numbers);
        memcpy(t->outline, i.base.outline, sizeof t->outline);
        t->bytes = sv_indirect_bytes(&i);
        status = sv_gl_check("uploading indirect textures", error);
    }
    sv_indirect_finish(&i);
    return status;
}
