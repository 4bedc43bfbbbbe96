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

/* Which texels of a relief are needed: a byte for each group of eight of a row, (width + 7) / 8 a row, 1 for
 * one that is, 0 for one that is not; the rest may be left alone. Kernels take them as a list of eights:
 * texels column .. column + 7 of a row. */
struct sv_relief_eight {
    int32_t row, column;
};
/* Lists those of rows *row and after (groups: of all rows, NULL: all), whole rows until LIST are listed, goes
 * on to the next row and returns their number. A row of eight texels or more has whole eights only, the last
 * then begins earlier; a shorter one has one, with as many texels as there are. */
enum { SV_RELIEF_LIST = 256, SV_RELIEF_LIST_ROOM = SV_RELIEF_LIST + SV_RELIEF_SIDE_MAX / 8 + 1 };
int sv_relief_list_eights(const uint8_t *groups, int width, int height, int *row,
                          struct sv_relief_eight list[SV_RELIEF_LIST_ROOM]);

struct sv_relief_light {
    const struct sv_light *light; /* in the space that `frame` turns to: world */
    struct sv_relief_frame frame; /* of the relief in the world: a, b, f as they stand there */
    const uint8_t *lit;           /* width * height: share of sunlight, 255 all; NULL: all lit */
    bool has_viewer;              /* specular light needs it */
    struct sv_vec3 eye;           /* world */
    float specular;               /* 0: none; share of sunlight that the surface mirrors */
    float shininess;              /* Blinn's exponent, >= 1 */
    const uint8_t *groups;        /* what is needed (sv_relief_list_eights); NULL: all */
    const int16_t *planes; /* the relief's normal[] as four planes, one behind the other; NULL: normal[] */
};

/* rgba: width * height, the seen colour in sRGB code, alpha as in color[]: light.h's surface rule (exposure
 * and tone in it) from normal[], plus specular * sun_rgb * (n.h)^shininess before exposure and tone, h half
 * way between sun and viewer; none of it where either is behind the surface. Texels of alpha < 128 keep
 * color[]. Any numbers are legal: a displ that is not finite has no specular light. Scalar and AVX2 agree to
 * 1 level. */
void sv_relief_light(const struct sv_relief *relief, const struct sv_relief_light *options,
                     uint8_t (*rgba)[4]);

#endif
