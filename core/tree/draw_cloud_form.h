/* draw_cloud_form.h - the table of forms of a billboard cloud: what differs between them. Private to
 * core/tree.
 *
 * To add a form: a row in draw_cloud_form.c, a value of enum sv_cloud_form, a file draw_NAME.c with its build
 * and upload, a fragment shader. The shader includes tree_cloud.glsl, finds its textures at units 0, 1, ...
 * in the order of sv_cloud_textures.name, its numbers in `params`, and ends with cloud_light(). */
#ifndef SV_TREE_DRAW_CLOUD_FORM_H
#define SV_TREE_DRAW_CLOUD_FORM_H

#include "core/tree/billboard.h"
#include "core/tree/cloud.h"
#include "core/tree/draw_cloud.h"

enum { SV_CLOUD_TEXTURES_MAX = 6, SV_CLOUD_PARAMS = 5, SV_CLOUD_OUTLINE = 8 };

/* A species' form on the GL side. */
struct sv_cloud_textures {
    unsigned name[SV_CLOUD_TEXTURES_MAX], target[SV_CLOUD_TEXTURES_MAX]; /* GL names and targets; 0: none */
    float params[SV_CLOUD_PARAMS][4];                     /* uniform vec4 params[] of the fragment shader */
    float outline[SV_CLOUD_PLANES_MAX][SV_CLOUD_OUTLINE]; /* billboard.h; {INFINITY ...}: the rectangle */
    float tile[SV_CLOUD_PLANES_MAX][4]; /* the plane's picture in an atlas: st_atlas = xy + zw * st; (0,0,1,1)
                                           for arrays, which have a layer a plane */
    size_t bytes;
};

struct sv_cloud_form_row {
    const char *name, *kind;        /* kind: of the blob in the store */
    const char *fragment, *defines; /* file in core/gl/shaders; lines put before it, or NULL */
    bool tested; /* drawn by an alpha test, in one pass, as papers do; else blended, and tested for depth */
    /* Any process, no GL. *data: heap. */
    enum sv_status (*build)(const struct sv_tree_mesh *mesh, const struct sv_tree_cloud *cloud, void **data,
                            size_t *bytes, struct sv_error *error);
    /* What the textures take with that many planes, built or not: sv_cloud_textures.bytes. */
    size_t (*bytes)(const struct sv_tree_mesh *mesh, int planes);
    /* Takes any bytes: SV_EFORMAT. textures comes zeroed, with tiles and outlines of whole rectangles; what
     * it holds after a failure is freed by the caller. */
    enum sv_status (*upload)(const struct sv_tree_mesh *mesh, const struct sv_tree_cloud *cloud,
                             const void *data, size_t bytes, struct sv_cloud_textures *textures,
                             struct sv_error *error);
};

extern const struct sv_cloud_form_row sv_cloud_forms[SV_CLOUD_FORM_COUNT];

/* An array texture with a part of billboards: for forms that have them beside their own. */
unsigned sv_form_billboard_part(const struct sv_billboards *billboards, enum sv_billboard_part part);

/* draw_billboard.c, draw_indirect.c, draw_density.c */
size_t sv_form_billboard_bytes(const struct sv_tree_mesh *mesh, int planes);
size_t sv_form_indirect_bytes(const struct sv_tree_mesh *mesh, int planes);
size_t sv_form_density_bytes(const struct sv_tree_mesh *mesh, int planes);
size_t sv_form_density_paper_bytes(const struct sv_tree_mesh *mesh, int planes);

/* draw_billboard.c, draw_indirect.c */
enum sv_status sv_form_billboard_build(const struct sv_tree_mesh *mesh, const struct sv_tree_cloud *cloud,
                                       void **data, size_t *bytes, struct sv_error *error);
enum sv_status sv_form_billboard_upload(const struct sv_tree_mesh *mesh, const struct sv_tree_cloud *cloud,
                                        const void *data, size_t bytes, struct sv_cloud_textures *textures,
                                        struct sv_error *error);
enum sv_status sv_form_indirect_build(const struct sv_tree_mesh *mesh, const struct sv_tree_cloud *cloud,
                                      void **data, size_t *bytes, struct sv_error *error);
enum sv_status sv_form_indirect_upload(const struct sv_tree_mesh *mesh, const struct sv_tree_cloud *cloud,
                                       const void *data, size_t bytes, struct sv_cloud_textures *textures,
                                       struct sv_error *error);

/* draw_density.c */
enum sv_status sv_form_density_build(const struct sv_tree_mesh *mesh, const struct sv_tree_cloud *cloud,
                                     void **data, size_t *bytes, struct sv_error *error);
enum sv_status sv_form_density_upload(const struct sv_tree_mesh *mesh, const struct sv_tree_cloud *cloud,
                                      const void *data, size_t bytes, struct sv_cloud_textures *textures,
                                      struct sv_error *error);
enum sv_status sv_form_density_paper_build(const struct sv_tree_mesh *mesh, const struct sv_tree_cloud *cloud,
                                           void **data, size_t *bytes, struct sv_error *error);
enum sv_status sv_form_density_paper_upload(const struct sv_tree_mesh *mesh,
                                            const struct sv_tree_cloud *cloud, const void *data, size_t bytes,
                                            struct sv_cloud_textures *textures, struct sv_error *error);

#endif
