/* lighting.h - normals of a relief from its displ, and its light: diffuse and specular (paper 1,
 * section 3.2).
 *
 * Derivation of (5): X_u = 2|a| a^ + Du f and X_v = 2|b| b^ + Dv f are tangents, with Du = displ(u+1,v) -
 * displ(u-1,v), Dv = displ(u,v+1) - displ(u,v-1)  (eq. (6)); their cross product in (a^, b^, f) is (-2|b| Du,
 * -2|a| Dv, 4|a||b|) n ~ (-|b| Du, -|a| Dv, 2 |a||b|) eq. (5), CORRECTED: printed is (|b| Du, |a| Dv,
 * |a||b|): the third component lacks the factor 2 (slopes doubled), and the signs hold only if the third axis
 * is -f. One-sided at borders, at empty neighbours and across torn edges (then Du stands for one texel, not
 * two). */
#ifndef SV_RELIEF_LIGHTING_H
#define SV_RELIEF_LIGHTING_H

#include "core/relief/relief.h"
#include "core/scene/light.h"

/* Fills normal[] of all solid texels from displ, eq. (5), (6); occlusion is left as it is. */
void sv_relief_normals(struct sv_relief *relief);

/* Which texels of a relief are needed: a byte for each group of eight of a row, (width + 7) / 8 a row, 0 for
 * a group that is not; the rest may be left alone. Goes to the next run of a row from *last on (0 at first);
 * a row of eight texels or more has whole groups only, the last one then begins earlier. groups NULL: all. */
static inline bool sv_relief_next_run(const uint8_t *groups, int width, int *first, int *last)
{
    int k = (*last + 7) / 8, whole = width / 8;
    while (groups && 8 * k < width && !groups[k])
        k++;
    if (8 * k >= width)
        return false;
    *first = k < whole ? 8 * k : whole > 0 ? width - 8 : 0;
    while (k < whole && (!groups || groups[k]))
        k++;
    *last = *first + 8 <= 8 * k ? 8 * k : width;
    return true;
}

struct sv_relief_light {
    const struct sv_light *light; /* in the space that `frame` turns to: world */
    struct sv_relief_frame frame; /* of the relief in the world: a, b, f as they stand there */
    const uint8_t *lit;           /* width * height: share of sunlight, 255 all; NULL: all lit */
    bool has_viewer;              /* specular light needs it */
    struct sv_vec3 eye;           /* world */
    float specular;               /* 0: none; share of sunlight that the surface mirrors */
    float shininess;              /* Blinn's exponent, >= 1 */
    const uint8_t *groups;        /* what is needed (sv_relief_next_run); NULL: all */
};

/* rgba: width * height, the seen colour in sRGB code, alpha as in color[]: light.h's surface rule (exposure
 * and tone in it) from normal[], plus specular * sun_rgb * (n.h)^shininess before exposure and tone, h half
 * way between sun and viewer; none of it where either is behind the surface. Texels of alpha < 128 keep
 * color[]. Any numbers are legal: a displ that is not finite has no specular light. Scalar and AVX2 agree to
 * 1 level. */
void sv_relief_light(const struct sv_relief *relief, const struct sv_relief_light *options,
                     uint8_t (*rgba)[4]);

#endif
