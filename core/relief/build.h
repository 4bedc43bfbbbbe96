/* build.h - relief textures from what there is: a field of heights, a drawn depth image, a mesh (GL).
 *
 * Depth buffers. Any depth buffer becomes LINEAR distance first: forward, d in [0, 1] with near n, far f: Z =
 * n f / (f - d (f - n)); reversed infinite: Z = n / d; orthographic reversed: Z = far (1 - d). With z =
 * distance - Z (displ of a plane at `distance`, f towards the eye) displ(u', v') = z(u, v) eq. (7) u' - n/2 =
 * (u - n/2) (1 - z / distance)                                              eq. (8), v likewise (9) which is
 * right for this z only (printed, it "is" the z-buffer: a test shows that fail): (u - n/2) Z / distance is
 * where the ray through (u, v) is at depth Z, and (1) brings it back to u for an eye at V. u' is no index
 * into an array (far points leave [0, n]): a panel keeps q = distance / Z at (u, v) instead, and q is affine
 * in window depth. */
#ifndef SV_RELIEF_BUILD_H
#define SV_RELIEF_BUILD_H

#include "core/relief/relief.h"
#include "core/tree/mesh.h"

enum sv_depth_kind {
    SV_DEPTH_FORWARD,
    SV_DEPTH_REVERSED_INFINITE,
    SV_DEPTH_ORTHOGRAPHIC_REVERSED,
    SV_DEPTH_LINEAR
};

struct sv_depth_form {
    enum sv_depth_kind kind;
    double near_m, far_m; /* as the kind needs them */
};

/* Metres along the view axis of a depth value; INFINITY where nothing was drawn; NaN for a value outside of
 * its range. */
double sv_depth_linear(const struct sv_depth_form *form, double value);
/* eq. (7)-(9) for one texel of a perspective picture of n x n texels on a plane at `distance`: where (u', v')
 * it stands and its displ. */
void sv_depth_relief(double distance_m, double n, double u, double v, double depth_m, double *us, double *vs,
                     double *displ);

/* A height field as a relief: displ = heights, normals by (5), (6). heights: width * height, NaN: empty.
 * color: or NULL for mid grey. */
SV_MUST_CHECK enum sv_status sv_relief_from_heights(const struct sv_relief_frame *frame, int width,
                                                    int height, const float *heights,
                                                    const uint8_t (*color)[4], float cut,
                                                    struct sv_relief *relief, struct sv_error *error);
/* An orthographic depth picture seen against f (the eye in front): frame.origin lies in the plane of
 * depth_at_plane. */
SV_MUST_CHECK enum sv_status sv_relief_from_depth(const struct sv_relief_frame *frame, int width, int height,
                                                  const float *depth, const struct sv_depth_form *form,
                                                  double depth_at_plane_m, const uint8_t (*color)[4],
                                                  float cut, struct sv_relief *relief,
                                                  struct sv_error *error);
/* A mesh (model space) seen against f, drawn by GL at samples x samples a texel and reduced: alpha is
 * coverage, albedo and normal are means of the nearest surface, displ that surface's (the median of its
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
