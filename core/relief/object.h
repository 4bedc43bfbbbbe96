/* object.h - a relief object: six relief textures on the faces of a mesh's box (paper 1, sections 1 and 4).
 *
 * Model space as for trees (frames.h): Z up, base at z = 0, height 1. Faces in the order +X, -X, +Y, -Y, +Z,
 * -Z; f points outward, displ <= 0; square texels (|a| = |b|), the longest side of the box has `resolution`
 * texels, the others as many as they need (at least 1), so the frame may stand over the box by less than a
 * texel. Of a surface that several faces see, the texels of the one that sees it best are warped
 * (object_choose.c): of faces that look towards the eye, and of the others what crosses an edge and closes it
 * (object_tiles.c); the buffer's depth test joins them. What no face sees (a floor under an arch) is closed
 * by the depth hull (object_hull.c). */
#ifndef SV_RELIEF_OBJECT_H
#define SV_RELIEF_OBJECT_H

#include "core/base/store.h"
#include "core/relief/lighting.h"
#include "core/relief/relief.h"
#include "core/relief/silhouette.h"
#include "core/relief/warp.h"
#include "core/tree/mesh.h"

enum {
    SV_RELIEF_FACES = 6,
    SV_RELIEF_RESOLUTION_MIN = 8,
    SV_RELIEF_RESOLUTION_MAX = 2048,
    SV_RELIEF_HULL_MAX = 256, /* resolution of what is hidden */
    SV_RELIEF_HIDDEN = 4,     /* hidden surfaces behind a face */
    SV_RELIEF_KEPT_SPARE = 1, /* value of keep[] */
    SV_RELIEF_SHEETS = (1 + SV_RELIEF_HIDDEN) * SV_RELIEF_FACES
};
/* Kind of the blob in the store; the digit is raised whenever the bake or the layout changes. */
#define SV_RELIEF_OBJECT_KIND "relief2"

struct sv_relief_object {
    struct sv_relief face[SV_RELIEF_FACES]; /* model space */
    struct sv_vec3 box_min, box_max;
    int resolution;
    double texel; /* side of a texel, model space */
    /* What no face shows, further surfaces behind each (object_hull.c): texels of hidden_texel, the others'
     * size up to a resolution of SV_RELIEF_HULL_MAX; empty where nothing is hidden. */
    struct sv_relief hidden[SV_RELIEF_HIDDEN][SV_RELIEF_FACES];
    double hidden_texel;
    /* A byte a texel: 0 where another face shows the same surface better (sv_relief_object_choose), else the
     * face is to be warped there: SV_RELIEF_KEPT_SPARE: another one shows it as well. In `block`. */
    uint8_t *keep[SV_RELIEF_FACES];
    void *block;
    struct sv_relief_tile *tile[SV_RELIEF_SHEETS], *tiles; /* object_tiles.c */
    int16_t *normals[SV_RELIEF_SHEETS],
        *normal_block; /* likewise: normal[] in four planes; NULL for an empty sheet */
    uint8_t *rims[SV_RELIEF_SHEETS], *rim_block; /* object_rims.c */
};

/* All reliefs of an object by number: the six faces, then layer after layer what is hidden behind them. */
static inline const struct sv_relief *sv_relief_sheet(const struct sv_relief_object *object, int sheet)
{
    return sheet < SV_RELIEF_FACES ? &object->face[sheet]
                                   : &object->hidden[sheet / SV_RELIEF_FACES - 1][sheet % SV_RELIEF_FACES];
}

/* Where an object stands: world = place + height_m * turn(model), clockwise by heading_rad. */
struct sv_relief_place {
    struct sv_vec3 place;
    double height_m, heading_rad;
};

/* Draws the six faces (needs a current GL context). SV_EINVAL when resolution is out of range, SV_ENOMEM. */
SV_MUST_CHECK enum sv_status sv_relief_object_bake(const struct sv_tree_mesh *mesh, int resolution,
                                                   struct sv_relief_object *object, struct sv_error *error);
void sv_relief_object_finish(struct sv_relief_object *object);
/* One block of bytes (heap, caller frees) and back; load takes any bytes: SV_EFORMAT. */
SV_MUST_CHECK enum sv_status sv_relief_object_save(const struct sv_relief_object *object, void **data,
                                                   size_t *bytes, struct sv_error *error);
SV_MUST_CHECK enum sv_status sv_relief_object_load(const void *data, size_t bytes,
                                                   struct sv_relief_object *object, struct sv_error *error);
/* From the store, or baked and kept there (store may be NULL). key: of the mesh. */
SV_MUST_CHECK enum sv_status sv_relief_object_obtain(const struct sv_tree_mesh *mesh, uint64_t key,
                                                     int resolution, struct sv_store *store,
                                                     struct sv_relief_object *object, struct sv_error *error);

/* The parts of a bake, for those who bring their own pixels: box, resolution and texels from a box (`code`
 * when one is not finite, empty or out of range); arrays of that layout (faces empty); then, once the faces
 * hold something, which of their texels are kept, and what none of them shows. */
SV_MUST_CHECK enum sv_status sv_relief_object_set_box(struct sv_relief_object *object, struct sv_vec3 box_min,
                                                      struct sv_vec3 box_max, int resolution,
                                                      enum sv_status code, struct sv_error *error);
SV_MUST_CHECK enum sv_status sv_relief_object_alloc(struct sv_relief_object *object, struct sv_error *error);
SV_MUST_CHECK enum sv_status sv_relief_object_choose(struct sv_relief_object *object, struct sv_error *error);
SV_MUST_CHECK enum sv_status sv_relief_object_hide(struct sv_relief_object *object, struct sv_error *error);
SV_MUST_CHECK enum sv_status sv_relief_object_tile(struct sv_relief_object *object, struct sv_error *error);
SV_MUST_CHECK enum sv_status sv_relief_object_rim(struct sv_relief_object *object, struct sv_error *error);
/* hide, tile, rim: all that follows from faces and choice, and is not stored. */
SV_MUST_CHECK enum sv_status sv_relief_object_derive(struct sv_relief_object *object, struct sv_error *error);

/* Faces of which something may face an eye at a place of model space, or far away in a unit direction: bit
 * set. What it leaves out is turned away for certain. */
unsigned sv_relief_object_seen_from(const struct sv_relief_object *object, struct sv_vec3 eye, bool is_place);

/* Frame and size of a face in texels of a given side; only the object's box is read. */
void sv_relief_object_face_layout(const struct sv_relief_object *object, int face, double texel,
                                  struct sv_relief_frame *frame, int *width, int *height);
/* A place of the world in model space. */
struct sv_vec3 sv_relief_place_to_model(const struct sv_relief_place *place, struct sv_vec3 world);
/* The frame of a face in the world. displ stays in model space: it is to be multiplied by height_m. */
struct sv_relief_frame sv_relief_object_frame(const struct sv_relief_object *object, int face,
                                              const struct sv_relief_place *place);

/* What an object looks like under a light: kept from view to view while neither light nor place changes.
 * Opaque heap value. */
struct sv_relief_look;
enum sv_relief_shadow_form { SV_RELIEF_SHADOW_NONE, SV_RELIEF_SHADOW_LINE_SWEEP, SV_RELIEF_SHADOW_ROW_FRONT };
struct sv_relief_look_options {
    enum sv_relief_shadow_form shadow; /* self-shadow of each face, and of the faces on each other (cast.h) */
    bool lit;                          /* false: plain albedo (figure 6 a) */
    float specular, shininess;
    bool has_viewer;
    struct sv_vec3 eye;    /* world */
    double taken;          /* share of sunlight that the surroundings keep away from all of it, 0..1 */
    double shade_height_m; /* world z below which the surroundings keep the sun away; -INFINITY: nowhere */
    /* Light in each warp what that shows, and nothing else: for light that moves from view to view. Else all
     * is lit at once, and serves many views. */
    bool in_warp;
};
SV_MUST_CHECK enum sv_status sv_relief_look_create(const struct sv_relief_object *object,
                                                   struct sv_relief_look **look, struct sv_error *error);
void sv_relief_look_destroy(struct sv_relief_look *look);
/* Only faces in the bit set `faces` are done. */
SV_MUST_CHECK enum sv_status sv_relief_look_light(struct sv_relief_look *look,
                                                  const struct sv_relief_place *place,
                                                  const struct sv_light *light,
                                                  const struct sv_relief_look_options *options,
                                                  unsigned faces, struct sv_error *error);
/* Which faces a camera needs: bit set. Those that look towards the eye, and others that hold something across
 * an edge which no face towards the eye shows better. */
unsigned sv_relief_object_faces(const struct sv_relief_object *object, const struct sv_relief_place *place,
                                const struct sv_camera *camera);
/* Size of a texel in the picture where it is largest (nearest point of the box), px: what the choice between
 * relief and polygons goes by. */
double sv_relief_object_texel_px(const struct sv_relief_object *object, const struct sv_relief_place *place,
                                 const struct sv_camera *camera);

/* Warps the object as it looks into the buffer: clear, splat, and closing of gaps of one or two pixels
 * (stats->holes). There is no filling behind torn edges: the gaps that remain are the object's own. faces: as
 * lit. The sources stay valid until the next call; resolve with them. */
SV_MUST_CHECK enum sv_status
sv_relief_look_warp(struct sv_relief_look *look, const struct sv_relief_place *place,
                    const struct sv_camera *camera, double shift_x_px, double shift_y_px, unsigned faces,
                    struct sv_warp_buffer *buffer, const struct sv_warp_source **sources,
                    unsigned *source_count, struct sv_warp_stats *stats, struct sv_error *error);

#endif
