/* cloud.h - a billboard cloud: a species' mesh laid on a few planes (Decoret et al. 2003; paper 2, section
 * 2).
 *
 * The mesh is cut into pieces: a leaf is one (a card, or a connected leaf component that is flat; what is not
 * flat is cut), wood is cut into lengths of a tube. K planes are fitted to them (cloud_fit.c), each leaf goes
 * to one plane, a length of wood to two or three that stand across each other, so that it is seen from every
 * side. A leaf is turned into its plane about the line in which its own plane meets it: its outline is kept
 * whole, where an orthographic projection would lose 27 to 50 % of all leaf area (algorithms.md 4.1). Wood is
 * projected.
 *
 * Frames: model space as in mesh.h. A plane has its own axes: u right, v up, normal = u x v towards whoever
 * looks at its front; plane coordinates (x, y, z) of a model point are those along u, v, normal from the
 * plane's centre. Pictures of a plane (cloud_bake.h, textures) hold its rectangle: column 0 at x = -half[0],
 * row 0 at y = +half[1]. Seen from behind it is the same picture, mirrored.
 *
 * No GL; any thread. Everything is deterministic. */
#ifndef SV_TREE_CLOUD_H
#define SV_TREE_CLOUD_H

#include "core/tree/mesh.h"

enum {
    SV_CLOUD_PLANES_MAX = 64,
    SV_CLOUD_PIECES_MAX = 16 << 20,
    SV_CLOUD_TRIANGLES_MAX = 48 << 20,
};

/* Kind of the blob in the store; the digit is raised whenever the fit or the layout changes. */
#define SV_CLOUD_KIND "cloud1"

struct sv_cloud_options {
    int planes;      /* exactly as many, 1 .. SV_CLOUD_PLANES_MAX */
    int stem_planes; /* as many of them (at most half) stand upright through the trunk, if there is one */
    int restarts;    /* fits that are tried; the best is kept. At least 1 */
    double lambda;   /* what a piece's inclination counts against its distance (algorithms.md 4.2) */
    uint64_t seed;
};
#define SV_CLOUD_OPTIONS_DEFAULT ((struct sv_cloud_options){24, 3, 8, 0.003, 1})

struct sv_cloud_plane {
    float normal[3], centre[3];
    float u[3], v[3]; /* unit; v is the one that points more upwards */
    float half[2];    /* half sizes of the rectangle along u and v: the smallest that holds all its pieces */
    uint32_t first_piece, piece_count; /* pieces[first_piece ...] */
};

enum sv_cloud_piece_flag {
    SV_CLOUD_LEAF = 1,     /* of a leaf material */
    SV_CLOUD_TURNED = 2,   /* turned into the plane; else projected */
    SV_CLOUD_MIRRORED = 4, /* in plane coordinates the texture's u runs to v (both as seen in a picture: u
                              right, v down) against the clock */
    SV_CLOUD_PLACED = 8,   /* rotation and size mean something: the texture lies on it without shear */
    SV_CLOUD_FLAGS = 15,
};

struct sv_cloud_piece { /* 80 bytes, saved as it is */
    float centre[3];    /* model space: area-weighted middle */
    float normal[3];    /* model space, unit: area-weighted (0, 0, 0 when the piece is not flat) */
    float at[3];        /* plane coordinates of the centre; at[2] is what the plane hides: how far in front */
    float uv_lo[2], uv_hi[2]; /* box of its texture coordinates */
    float rotation; /* of the texture's u axis from the plane's x axis, counter-clockwise, -pi .. pi */
    float size[2];  /* model units, that the box's width and height take in the plane */
    float area;     /* of its polygons, model units squared, holes of the texture included */
    uint32_t first_triangle, triangle_count;
    uint16_t plane;
    uint8_t material, flags;
};

/* A triangle of the mesh, or a part of it: corner k has the barycentric weights 1 - (a + b), a, b, where
 * (a, b) = at[k] / SV_CLOUD_WEIGHT_ONE, of the mesh triangle's three vertices. */
enum { SV_CLOUD_WEIGHT_ONE = 32768 };
struct sv_cloud_triangle {
    uint32_t index; /* first of its three in sv_tree_mesh.indices */
    uint16_t at[3][2];
};

struct sv_tree_cloud {
    int plane_count;
    struct sv_cloud_plane planes[SV_CLOUD_PLANES_MAX];
    struct sv_cloud_piece *pieces; /* heap; plane by plane, in each far to near (at[2] rising) */
    uint32_t piece_count;
    struct sv_cloud_triangle *triangles; /* heap; pieces that lie on several planes share theirs */
    uint32_t triangle_count;
    float rms;      /* distance of pieces to their planes, area-weighted, model units (tree heights) */
    float view_rms; /* the same as it is seen, over all directions of view */
};

/* Cuts, fits and lays out. A mesh without a triangle that has an area gives planes without pieces. 39,000
 * leaves take some 0.4 s. SV_EINVAL for options out of range, SV_ELIMIT for more pieces than fit, SV_ENOMEM.
 */
SV_MUST_CHECK enum sv_status sv_tree_cloud_create(const struct sv_tree_mesh *mesh,
                                                  const struct sv_cloud_options *options,
                                                  struct sv_tree_cloud *cloud, struct sv_error *error);
void sv_tree_cloud_finish(struct sv_tree_cloud *cloud); /* legal on a zeroed one */

/* One block of bytes (heap, caller frees) and back. load takes any bytes: SV_EFORMAT; it checks them by
 * themselves, sv_tree_cloud_check against the mesh they were made from: every index and count. */
SV_MUST_CHECK enum sv_status sv_tree_cloud_save(const struct sv_tree_cloud *cloud, void **data, size_t *bytes,
                                                struct sv_error *error);
SV_MUST_CHECK enum sv_status sv_tree_cloud_load(const void *data, size_t bytes, struct sv_tree_cloud *cloud,
                                                struct sv_error *error);
SV_MUST_CHECK enum sv_status sv_tree_cloud_check(const struct sv_tree_cloud *cloud,
                                                 const struct sv_tree_mesh *mesh, struct sv_error *error);

/* Where a piece comes to lie: plane coordinates of the model point p are
 * at + turn[0..2] . (p - centre). Rows of turn are orthonormal. */
struct sv_cloud_placement {
    float centre[3], at[3], turn[3][3];
};
void sv_cloud_place(const struct sv_tree_cloud *cloud, const struct sv_cloud_piece *piece,
                    struct sv_cloud_placement *placement);
static inline void sv_cloud_placed(const struct sv_cloud_placement *q, const float p[3], float out[3])
{
    float d[3] = {p[0] - q->centre[0], p[1] - q->centre[1], p[2] - q->centre[2]};
    for (int r = 0; r < 3; r++)
        out[r] = q->at[r] + q->turn[r][0] * d[0] + q->turn[r][1] * d[1] + q->turn[r][2] * d[2];
}

/* The vertex of the mesh that corner k of a triangle stands for, interpolated. */
struct sv_tree_vertex sv_cloud_corner(const struct sv_tree_mesh *mesh,
                                      const struct sv_cloud_triangle *triangle, int k);

#endif
