/* cloud_private.h - what the parts of the billboard cloud hand to each other: cloud_cut.c cuts the mesh into
 * parts, cloud_fit.c fits planes to them, cloud.c lays the parts on the planes. Private to core/tree. */
#ifndef SV_TREE_CLOUD_PRIVATE_H
#define SV_TREE_CLOUD_PRIVATE_H

#include "core/tree/cloud.h"

/* A piece before it has a plane. */
struct cloud_part {
    float centre[3];
    float normal[3];     /* unit when flat, else 0 */
    float axis[3];       /* unit for a length of wood that has one, else 0 */
    float area, spread2; /* spread2: mean squared extent that leaning against its plane would displace */
    float radius;        /* of a length of wood */
    uint32_t first_triangle, triangle_count;
    uint8_t material, flags; /* enum sv_cloud_piece_flag: LEAF, TURNED */
};

struct cloud_cut {
    struct cloud_part *parts; /* heap, as are the triangles */
    uint32_t part_count, part_room, leaf_parts;
    struct sv_cloud_triangle *triangles;
    uint32_t triangle_count, triangle_room;
    double wood_length; /* of what wood is cut into */
};

SV_MUST_CHECK enum sv_status sv_cloud_cut(const struct sv_tree_mesh *mesh, struct cloud_cut *cut,
                                          struct sv_error *error);
void sv_cloud_cut_finish(struct cloud_cut *cut);

/* A plane while it is fitted: points p with n.p = d. */
struct cloud_plane {
    double n[3], d;
    bool fixed; /* a stem plane */
};

/* Fits options->planes planes; of_part (part_count, caller's) gets each part's nearest by the fit's measure.
 */
SV_MUST_CHECK enum sv_status sv_cloud_fit(const struct cloud_cut *cut, const struct sv_cloud_options *options,
                                          struct cloud_plane planes[SV_CLOUD_PLANES_MAX], uint8_t *of_part,
                                          struct sv_error *error);

/* Eigenvalues, rising, and unit eigenvectors (rows of `vectors`) of the symmetric xx, yy, zz, xy, xz, yz; by
 * cyclic Jacobi rotations. */
void sv_cloud_eigen(const double m[6], double values[3], double vectors[3][3]);

#endif
