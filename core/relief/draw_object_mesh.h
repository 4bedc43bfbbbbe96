/* draw_object_mesh.h - objects as polygons by GL: meshes uploaded once a model, drawn nearest first, each
 * looking itself up in its own shadow map (object_sun.h). Private to core/relief/draw_object*.c. */
#ifndef SV_RELIEF_DRAW_OBJECT_MESH_H
#define SV_RELIEF_DRAW_OBJECT_MESH_H

#include "core/gl/frame.h"
#include "core/relief/object.h"
#include "core/relief/object_sun.h"
#include "core/scene/scene.h"

struct sv_object_meshes;

struct sv_object_mesh_entry {
    int model;
    int map; /* which shadow map texture: objects that share a sun share it; 0 .. map_count - 1 */
    struct sv_relief_place at;
    uint32_t id;
    const struct sv_object_sun *sun; /* NULL: nothing of it is in its own shadow */
    double shade_height_m;           /* world z below which no sun arrives; -INFINITY: nowhere */
    double taken;                    /* share of sunlight that trees keep from it */
};

/* Uploads all meshes; borrows models for life. */
SV_MUST_CHECK enum sv_status sv_object_meshes_create(const struct sv_object_model *models, int model_count,
                                                     int map_count, struct sv_object_meshes **meshes,
                                                     struct sv_error *error);
void sv_object_meshes_destroy(struct sv_object_meshes *meshes); /* NULL is legal */
/* The shadow maps that were uploaded are out of date: the sun moved. */
void sv_object_meshes_new_sun(struct sv_object_meshes *meshes);
/* Draws the entries in their order. */
SV_MUST_CHECK enum sv_status sv_object_meshes_draw(struct sv_object_meshes *meshes,
                                                   const struct sv_gl_frame *frame,
                                                   const struct sv_object_mesh_entry *entries, uint32_t count,
                                                   struct sv_error *error);

#endif
