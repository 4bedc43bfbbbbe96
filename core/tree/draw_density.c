/* draw_density.c - density textures on the GL side: array textures, a layer a plane, unpacked from the file.
 */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "core/gl/context.h"
#include "core/gl/functions.h"
#include "core/tree/density_look.h"
#include "core/tree/draw_cloud_form.h"

static enum sv_status build(const struct sv_tree_mesh *mesh, const struct sv_tree_cloud *cloud,
                            enum sv_density_kind kind, void **data, size_t *bytes, struct sv_error *error)
{
    struct sv_density density = {0};
    enum sv_status status = sv_density_build(mesh, cloud, kind, &density, error);
    if (!status)
        status = sv_density_save(&density, data, bytes, error);
    sv_density_finish(&density);
    return status;
}

enum sv_status sv_form_density_build(const struct sv_tree_mesh *mesh, const struct sv_tree_cloud *cloud,
                                     void **data, size_t *bytes, struct sv_error *error)
{
    return build(mesh, cloud, SV_DENSITY_PLAIN, data, bytes, error);
}

enum sv_status sv_form_density_paper_build(const struct sv_tree_mesh *mesh, const struct sv_tree_cloud *cloud,
                                           void **data, size_t *bytes, struct sv_error *error)
{
    return build(mesh, cloud, SV_DENSITY_PAPER, data, bytes, error);
}

static void filter(GLenum target, GLenum small, GLenum wrap)
{
    gl.TexParameteri(target, GL_TEXTURE_MIN_FILTER, (GLint)small);
    gl.TexParameteri(target, GL_TEXTURE_MAG_FILTER, GL_LINEAR);
    gl.TexParameteri(target, GL_TEXTURE_WRAP_S, (GLint)wrap);
    gl.TexParameteri(target, GL_TEXTURE_WRAP_T, (GLint)wrap);
}

/* An array of the atlas' tiles; levels[0 .. count), each a picture of the whole atlas. Returns its bytes. */
static size_t upload_tiles(struct sv_cloud_textures *t, int unit, GLenum format, uint8_t *const *levels,
                           int count, int planes)
{
    size_t bytes = 0;
    gl.GenTextures(1, &t->name[unit]);
    t->target[unit] = GL_TEXTURE_2D_ARRAY;
    gl.BindTexture(GL_TEXTURE_2D_ARRAY, t->name[unit]);
    gl.TexStorage3D(GL_TEXTURE_2D_ARRAY, count, format, SV_DENSITY_TILE, SV_DENSITY_TILE, planes);
    for (int k = 0; k < count; k++) {
        int side = SV_DENSITY_TILE >> k, width = SV_DENSITY_WIDTH >> k;
        gl.PixelStorei(GL_UNPACK_ROW_LENGTH, width);
        for (int p = 0; p < planes; p++) {
            size_t at = (size_t)(p / SV_DENSITY_COLUMNS * side) * (size_t)width +
                        (size_t)(p % SV_DENSITY_COLUMNS * side);
            gl.TexSubImage3D(GL_TEXTURE_2D_ARRAY, k, 0, 0, p, side, side, 1, GL_RGBA, GL_UNSIGNED_BYTE,
                             levels[k] + 4 * at);
        }
        bytes += 4 * (size_t)side * (size_t)side * (size_t)planes;
    }
    gl.PixelStorei(GL_UNPACK_ROW_LENGTH, 0);
    filter(GL_TEXTURE_2D_ARRAY, count > 1 ? GL_LINEAR_MIPMAP_NEAREST : GL_LINEAR, GL_CLAMP_TO_EDGE);
    return bytes;
}

/* Light: layer k openness, layer planes + k occlusion. */
static size_t upload_light(struct sv_cloud_textures *t, int unit, const struct sv_density *density)
{
    enum { SIDE = SV_DENSITY_LIGHT_SIDE };
    uint8_t rgba[SIDE * SIDE * 4];
    int planes = density->plane_count;
    gl.GenTextures(1, &t->name[unit]);
    t->target[unit] = GL_TEXTURE_2D_ARRAY;
    gl.BindTexture(GL_TEXTURE_2D_ARRAY, t->name[unit]);
    gl.TexStorage3D(GL_TEXTURE_2D_ARRAY, 1, GL_RGBA8, SIDE, SIDE, 2 * planes);
    for (int k = 0; k < planes; k++) {
        sv_density_open(density, k, rgba);
        gl.TexSubImage3D(GL_TEXTURE_2D_ARRAY, 0, 0, 0, k, SIDE, SIDE, 1, GL_RGBA, GL_UNSIGNED_BYTE, rgba);
        sv_density_occlusion(density, k, rgba);
        gl.TexSubImage3D(GL_TEXTURE_2D_ARRAY, 0, 0, 0, planes + k, SIDE, SIDE, 1, GL_RGBA, GL_UNSIGNED_BYTE,
                         rgba);
    }
    filter(GL_TEXTURE_2D_ARRAY, GL_LINEAR, GL_CLAMP_TO_EDGE);
    return sizeof rgba * 2 * (size_t)planes;
}

static enum sv_status upload_leaf(struct sv_cloud_textures *t, int unit, const struct sv_density *density,
                                  const struct sv_tree_mesh *mesh, struct sv_error *error)
{
    uint8_t *levels[SV_DENSITY_LEAF_LEVELS];
    enum sv_status status = sv_density_leaf_picture(density, mesh, levels, error);
    if (status)
        return status;
    gl.GenTextures(1, &t->name[unit]);
    t->target[unit] = GL_TEXTURE_2D;
    gl.BindTexture(GL_TEXTURE_2D, t->name[unit]);
    gl.TexStorage2D(GL_TEXTURE_2D, SV_DENSITY_LEAF_LEVELS, GL_SRGB8_ALPHA8, SV_DENSITY_LEAF_SIDE,
                    SV_DENSITY_LEAF_SIDE);
    for (int k = 0; k < SV_DENSITY_LEAF_LEVELS; k++) {
        int side = SV_DENSITY_LEAF_SIDE >> k;
        gl.TexSubImage2D(GL_TEXTURE_2D, k, 0, 0, side, side, GL_RGBA, GL_UNSIGNED_BYTE, levels[k]);
        t->bytes += 4 * (size_t)side * (size_t)side;
    }
    filter(GL_TEXTURE_2D, GL_LINEAR_MIPMAP_NEAREST, GL_REPEAT);
    /* One texel has no shape that a test could keep: what is smaller than 4 x 4 is drawn from that. */
    gl.TexParameteri(GL_TEXTURE_2D, GL_TEXTURE_MAX_LEVEL, SV_DENSITY_LEAF_LEVELS - 3);
    free(levels[0]);
    return SV_OK;
}

static void set_common(const struct sv_density *density, const uint8_t *texels, struct sv_cloud_textures *t)
{
    memcpy(t->params[0], density->translucency, sizeof density->translucency);
    t->params[1][0] = (float)density->plane_count;
    for (int k = 0; k < density->plane_count; k++)
        sv_density_outline(density, texels, k, t->outline[k]);
}

static enum sv_status upload_plain(const struct sv_density *density, const uint8_t *texels,
                                   struct sv_cloud_textures *t, struct sv_error *error)
{
    struct sv_density_levels levels;
    enum sv_status status = sv_density_levels_init(density, &levels, error);
    if (status)
        return status;
    t->bytes += upload_tiles(t, 0, GL_SRGB8_ALPHA8, levels.albedo, SV_DENSITY_LEVELS, density->plane_count);
    t->bytes += upload_tiles(t, 1, GL_RGBA8, levels.normal, SV_DENSITY_LEVELS, density->plane_count);
    t->bytes += upload_light(t, 2, density);
    t->params[1][1] = sv_density_sharp_scale(density, texels);
    memcpy(t->params[1] + 2, density->finer, 2 * sizeof(float));
    memcpy(t->params[4], density->finer + 2, sizeof t->params[4]); /* the other four */
    float bars[SV_DENSITY_LEVELS];
    sv_density_bars(density, &levels, bars);
    memcpy(t->params + 2, bars, sizeof bars); /* params[2] and [3] */
    sv_density_levels_finish(&levels);
    return SV_OK;
}

static enum sv_status upload_paper(const struct sv_density *density, const struct sv_tree_mesh *mesh,
                                   uint8_t *texels, struct sv_cloud_textures *t, struct sv_error *error)
{
    /* 16 bits, so that periods are filtered as finely as a GPU does: OSMesa filters 8 bits in 8 bits, and
     * what a period is off by counts the more the farther the place is from the origin. */
    t->bytes += 2 * upload_tiles(t, 0, GL_RGBA16, &texels, 1, density->plane_count);
    t->bytes += upload_light(t, 2, density);
    memcpy(t->params[2], density->wood, sizeof density->wood);
    t->params[1][2] = density->period_min;
    t->params[1][3] = density->period_max;
    return upload_leaf(t, 1, density, mesh, error);
}

static enum sv_status upload(const struct sv_tree_mesh *mesh, const struct sv_tree_cloud *cloud,
                             const void *data, size_t bytes, enum sv_density_kind kind,
                             struct sv_cloud_textures *t, struct sv_error *error)
{
    struct sv_density density = {0};
    uint8_t *texels = malloc((size_t)SV_DENSITY_WIDTH * SV_DENSITY_HEIGHT * 4);
    enum sv_status status = sv_density_load(data, bytes, &density, error);
    if (!status && !texels)
        status = sv_fail(error, SV_ENOMEM, "density", "no memory to unpack a density texture");
    if (!status && (density.kind != kind || density.plane_count != cloud->plane_count))
        status = sv_fail(error, SV_EFORMAT, "density", "%d planes of kind %d", density.plane_count,
                         (int)density.kind);
    if (!status) {
        sv_density_texels(&density, texels);
        set_common(&density, texels, t);
        status = kind == SV_DENSITY_PAPER ? upload_paper(&density, mesh, texels, t, error)
                                          : upload_plain(&density, texels, t, error);
    }
    if (!status)
        status = sv_gl_check("uploading a density texture", error);
    free(texels);
    sv_density_finish(&density);
    return status;
}

static size_t mip_bytes(int side, int levels)
{
    size_t bytes = 0;
    for (int k = 0; k < levels; k++)
        bytes += 4 * (size_t)(side >> k) * (size_t)(side >> k);
    return bytes;
}

static size_t light_bytes(void)
{
    return 2 * mip_bytes(SV_DENSITY_LIGHT_SIDE, 1);
}

size_t sv_form_density_bytes(const struct sv_tree_mesh *mesh, int planes)
{
    (void)mesh;
    return (size_t)planes * (2 * mip_bytes(SV_DENSITY_TILE, SV_DENSITY_LEVELS) + light_bytes());
}

size_t sv_form_density_paper_bytes(const struct sv_tree_mesh *mesh, int planes)
{
    (void)mesh;
    return (size_t)planes * (2 * mip_bytes(SV_DENSITY_TILE, 1) + light_bytes()) +
           mip_bytes(SV_DENSITY_LEAF_SIDE, SV_DENSITY_LEAF_LEVELS);
}

enum sv_status sv_form_density_upload(const struct sv_tree_mesh *mesh, const struct sv_tree_cloud *cloud,
                                      const void *data, size_t bytes, struct sv_cloud_textures *textures,
                                      struct sv_error *error)
{
    return upload(mesh, cloud, data, bytes, SV_DENSITY_PLAIN, textures, error);
}

enum sv_status sv_form_density_paper_upload(const struct sv_tree_mesh *mesh,
                                            const struct sv_tree_cloud *cloud, const void *data, size_t bytes,
                                            struct sv_cloud_textures *textures, struct sv_error *error)
{
    return upload(mesh, cloud, data, bytes, SV_DENSITY_PAPER, textures, error);
}
