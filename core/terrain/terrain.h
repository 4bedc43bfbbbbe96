/* terrain.h - a terrain as a scene holds it: geometry and the colours that lie on it. Plain data; no GL, no GDAL. */
#ifndef SV_TERRAIN_TERRAIN_H
#define SV_TERRAIN_TERRAIN_H

#include "core/base/image.h"
#include "core/terrain/heightfield.h"

enum { SV_TERRAIN_TEXTURE_SIDE_MAX = 8192 }; /* texels; larger imagery is averaged down, and the log says so */

struct sv_terrain {
    struct sv_heightfield field;
    /* Colour over exactly the field's rectangle, RGBA u8 sRGB (alpha 255), row 0 at the south, texel centres at (i + 0.5) /
     * width of the rectangle: imagery where there is any, natural colouring elsewhere. Arena. */
    struct sv_image albedo;
    /* Smooth normals at the field's samples, field.width x field.height, two int8-style u8 channels: (x, y) * 127 + 128 of the unit normal
     * in world axes, z = sqrt(1 - x^2 - y^2). Arena. Sampled bilinearly at sample positions. */
    struct sv_image normal;
    bool has_imagery;
};

#endif
