/* frames.h - the one place that fixes axes, handedness, pixel centres, alpha and colour space.
 *
 * World      double, metres, in the scene's projected CRS: X east, Y north, Z up (right-handed).
 * Local      what goes to GL and Embree: world minus a double origin (the eye for GL, the scene's centre for
 * Embree), then narrowed to float. Never hand an absolute world coordinate to a float. Camera     right, up,
 * forward: unit vectors in world axes. (right, up, forward) is left-handed: right x up = -forward. The
 * reflection lives in sv_camera's clip_from_local matrix and nowhere else. Picture    pixel (i, j): column i
 * from the left, row j from the TOP; its centre is at (i + 0.5, j + 0.5). Images are stored with row 0 at the
 * top. GL is told GL_UPPER_LEFT through glClipControl (core/gl/context.c), so that glReadPixels already gives
 * row 0 first: that call is the only flip there is. Heights    height-field row 0 is the SOUTH row: sample
 * (i, j) is at (x0 + i dx, y0 + j dy), dx, dy > 0. Terrain textures have row 0 at the south, too, so that v
 * grows to the north. Depth      clip z reversed in [1 (near), 0 (infinity)], 32-bit float; metres along
 * forward: Z = near / d. Heading    radians clockwise from grid north (+Y); pitch positive up; roll positive
 * lowers the right side. Sun        azimuth as heading; direction vectors point TO the sun unless named light
 * travel. Tree       model space: Z up, X east, Y north at rotation 0, base at z = 0, height 1 (multiply by
 * the tree's height); rotation is clockwise seen from above. Model files are Y up with -Z north: (x, y, z) ->
 * (x, -z, y). Relief     texel coordinates (u, v), texel (i, j) has its centre at (i + 0.5, j + 0.5); it
 * stands at O + u a + v b + displ f, f the unit normal that points to the FRONT, the side that is seen, lit
 * and shadowed; light vectors named travel point the way light goes (core/relief/relief.h). Alpha      images
 * carry straight (not premultiplied) alpha; GL blending uses premultiplied colour internally. Colour 8-bit
 * colour is sRGB-encoded; all arithmetic on light is linear; float layers are linear or metric. */
#ifndef SV_BASE_FRAMES_H
#define SV_BASE_FRAMES_H

#include "core/base/vec.h"

/* Unit vector for a heading (clockwise from north) and an elevation above the horizon, radians, world axes.
 */
static inline struct sv_vec3 sv_direction(double heading_rad, double elevation_rad)
{
    double c = cos(elevation_rad);
    return sv_vec3(c * sin(heading_rad), c * cos(heading_rad), sin(elevation_rad));
}

/* Rotates the model-space point p clockwise (seen from above) by rotation_rad about Z. */
static inline struct sv_vec3 sv_rotate_clockwise(struct sv_vec3 p, double rotation_rad)
{
    double c = cos(rotation_rad), s = sin(rotation_rad);
    return sv_vec3(c * p.x + s * p.y, -s * p.x + c * p.y, p.z);
}

#endif
