/* build.h - relief textures from what there is: a field of heights, a drawn depth image, a mesh (GL).
 *
 * Depth buffers. Any depth buffer becomes LINEAR distance first:
 *     forward, d in [0, 1], near n, far f:   Z = n f / (f - d (f - n))
 *     reversed, infinite:                    Z = n / d
 *     orthographic, reversed:                Z = far (1 - d)
 * Then with z = distance - Z, the displ of what stands before (z > 0) or behind (z < 0) a plane at `distance`
 * from the eye, f towards the eye:
 *     displ(u', v') = z(u, v)                              eq. (7)
 *     u' - n/2 = (u - n/2) (1 - z / distance)              eq. (8)
 *     v' - n/2 = (v - n/2) (1 - z / distance)              eq. (9)
 * Derivation: texel (u, v) of the picture lies on the plane at lateral offset (u - n/2) s, s its side. The
 * ray through it is at depth Z at the lateral offset (u - n/2) s Z / distance, and Z / distance = 1 - z /
 * distance: that is (8). (1) for this eye (c.f = -distance, epipole n/2) brings u' back, n/2 + (u' - n/2) /
 * (1 + k3 z) = u; but it does so for any z, so it decides nothing. What decides is the place X(u', v') and
 * the view of every other eye, and they are right for THIS z only. Printed, z "is" the z-buffer's value: a
 * test shows that off by tens of texels. u' is no index into an array (far points leave [0, n]): a panel
 * keeps q = distance / Z at (u, v) instead, and q is affine in window depth.
 *
 * What these builders leave to the caller: normals of (5), (6). sv_relief_from_heights and
 * sv_relief_from_depth write the flat normal (0, 0, 1) and an open sky; sv_relief_normals (lighting.h) fills
 * them from displ. So this library needs nothing but the data. sv_relief_from_mesh writes the mesh's own
 * normals and sky. */
#ifndef SV_RELIEF_BUILD_H
#define SV_RELIEF_BUILD_H

#include "core/relief/relief.h"
#include "core/tree/mesh.h"

enum sv_depth_kind {
    SV_DEPTH_FORWARD,               /* 0 < near_m < far_m <= INFINITY; d = 1, the cleared value: nothing */
    SV_DEPTH_REVERSED_INFINITE,     /* near_m > 0; d = 0: nothing */
    SV_DEPTH_ORTHOGRAPHIC_REVERSED, /* far_m > 0; d = 0: nothing */
    SV_DEPTH_LINEAR                 /* metres >= 0 as they are; INFINITY: nothing */
};

struct sv_depth_form {
    enum sv_depth_kind kind;
    double near_m, far_m; /* as the kind needs them */
};

/* Metres along the view axis of a depth value; INFINITY where nothing was drawn (the value that a cleared
 * buffer holds); NaN for a value outside of its range ([0, 1]; linear: >= 0), NaN, or a form that is not
 * legal. */
double sv_depth_linear(const struct sv_depth_form *form, double value);
/* eq. (7)-(9) for one texel of a perspective picture of n x n texels on a plane at `distance` > 0: where
 * (u', v') it stands and its displ. depth_m: linear; all three are NaN where it is not finite. */
void sv_depth_relief(double distance_m, double n, double u, double v, double depth_m, double *us, double *vs,
                     double *displ);

/* A height field as a relief: displ = heights. heights: width * height, row by row; NaN, infinite: empty.
 * color: width * height, its alpha decides with them what is solid; NULL: opaque mid grey. cut > 0 m,
 * INFINITY legal. An empty texel is zero in every number. SV_EINVAL (frame, sizes, cut), SV_ENOMEM. */
SV_MUST_CHECK enum sv_status sv_relief_from_heights(const struct sv_relief_frame *frame, int width,
                                                    int height, const float *heights,
                                                    const uint8_t (*color)[4], float cut,
                                                    struct sv_relief *relief, struct sv_error *error);
/* An orthographic depth picture seen against f (the eye in front): frame.origin lies in the plane of
 * depth_at_plane_m, so that displ = depth_at_plane_m - Z. Pixels with nothing, and values that are none, are
 * empty. Otherwise as above. */
SV_MUST_CHECK enum sv_status sv_relief_from_depth(const struct sv_relief_frame *frame, int width, int height,
                                                  const float *depth, const struct sv_depth_form *form,
                                                  double depth_at_plane_m, const uint8_t (*color)[4],
                                                  float cut, struct sv_relief *relief,
                                                  struct sv_error *error);
/* A mesh (in the frame's space) seen against f, drawn by GL at samples x samples a texel and reduced: alpha
 * is coverage, albedo and normal are means of the nearest surface, displ that surface's (the median of its
 * samples: never a mean across an edge). depth_m: how far behind the frame's plane it may lie. Needs a
 * current GL context. SV_EINVAL, SV_ENOMEM, SV_EINTERNAL. */
struct sv_relief_bake_options {
    int width, height, samples; /* samples: 1 .. 8 */
    double front_m, depth_m;    /* surfaces with -depth_m <= displ <= front_m are seen */
    float cut;
};
SV_MUST_CHECK enum sv_status sv_relief_from_mesh(const struct sv_tree_mesh *mesh,
                                                 const struct sv_relief_frame *frame,
                                                 const struct sv_relief_bake_options *options,
                                                 struct sv_relief *relief, struct sv_error *error);

#endif
