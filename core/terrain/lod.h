/* lod.h - view-dependent level of detail of a height field: a 4-8 mesh refined top-down, without cracks by
 * construction (Lindstrom and Pascucci, "Terrain simplification simplified", TVCG 8(3), 2002).
 *
 * Triangles are right and isosceles; a split puts the midpoint v of the hypotenuse in. The two triangles that
 * share that hypotenuse (the diamond of v) ask the same question of v, and every diamond's error and bounding
 * sphere contain those of its children, so that a vertex is never split before those it hangs on. Departures
 * from the paper: the error of a diamond is a true bound, the largest vertical distance between its two
 * triangles and the full-detail surface over them (since levels nest, the largest over the samples),
 * saturated over its children; and a field need not be (2^k + 1) squared: the grid is padded to that in
 * thought, and vertices beyond the field's last column or row are moved onto it. That map is monotone in each
 * axis, so triangles keep their orientation or lie in the border line, where they are dropped, and the mesh
 * covers the field's rectangle exactly; errors of squeezed triangles are measured over every cell they touch.
 * The finest level is the triangulation of heightfield.h.
 *
 * Memory: 4 bytes a sample (error and radius, 16 bits each, rounded up) and about 8 bytes a border sample. No
 * GL. */
#ifndef SV_TERRAIN_LOD_H
#define SV_TERRAIN_LOD_H

#include "core/base/store.h"
#include "core/terrain/heightfield.h"
#include "core/view/camera.h"

struct sv_terrain_lod;

/* Measures the errors, or takes them from the store (kind "lod1", a key of sizes, spacing and heights; kept
 * there when the field has 2^21 samples or more, which take 0.3 s). Borrows field for life.
 * store may be NULL. */
SV_MUST_CHECK enum sv_status sv_terrain_lod_create(const struct sv_heightfield *field, struct sv_store *store,
                                                   struct sv_terrain_lod **lod, struct sv_error *error);
void sv_terrain_lod_destroy(struct sv_terrain_lod *lod); /* NULL is legal */
size_t sv_terrain_lod_bytes(const struct sv_terrain_lod *lod);

/* A refined mesh; grows as needed and is used again from view to view. Zero-initialised by the caller. */
struct sv_terrain_mesh {
    float *vertices;   /* x, y, z relative to the eye, m, world axes */
    uint32_t *samples; /* j * width + i of each vertex */
    uint32_t vertex_count, vertex_capacity;
    uint32_t *indices; /* three a triangle, counter-clockwise seen from above; triangles from near to far */
    uint32_t triangle_count, triangle_capacity;
    double max_error_px; /* bound of the projected error that is left in the triangles; 0 for full detail */
    void *table;         /* private: sample -> vertex */
    uint32_t table_size;
};
void sv_terrain_mesh_finish(struct sv_terrain_mesh *mesh);

/* Refines for a camera until no triangle that may be seen can be off by more than error_px (>= 0; 0: full
 * detail) on the picture: for a vertical error e at depth Z at most e f s / Z px, where s is the largest
 * length in the picture, in focal lengths, of a unit vertical at depth 1 (never taken below 1), and Z is
 * bounded from below over the diamond's sphere. Orthographic: e times px per metre. Only triangles whose
 * sphere touches the view volume are there: planes (NULL: the camera's) are its sides, as sv_camera_planes gives
 * them. Which they are decides nothing about the triangles that are there. SV_EINVAL for a bad error_px, SV_ELIMIT above 2^25 triangles,
 * SV_ENOMEM. */
SV_MUST_CHECK enum sv_status sv_terrain_lod_refine(const struct sv_terrain_lod *lod,
                                                   const struct sv_camera *camera, const double (*planes)[4],
                                                   double error_px,
                                                   struct sv_terrain_mesh *mesh, struct sv_error *error);

#endif
