/* lighting_kernel.h - the light of one relief with everything that is the same for all texels taken out: what
 * the scalar and the AVX2 kernel of lighting share. Private to lighting.c and lighting_avx2.c. */
#ifndef SV_RELIEF_LIGHTING_KERNEL_H
#define SV_RELIEF_LIGHTING_KERNEL_H

#include "core/relief/lighting.h"

struct sv_relief_light_row {
    float to_sun[3];     /* l of light.h in (a^, b^, f), divided by 32767 */
    float up[3];         /* world z in (a^, b^, f), half of it, divided by 32767 */
    float sun[3];        /* sun_rgb * exposure; divided by 255 */
    float ground[3];     /* light from below at n.z = -1, exposed; divided by 32767 */
    float ground_sky[3]; /* sky minus ground, likewise */
    bool specular;
    float mirror[3]; /* specular * sun_rgb * exposure; divided by 255 */
    float faint;     /* (n.h)^2 below which the mirror cannot be told from none; 0: every one counts */
    float shininess;
    float sun_unit[3]; /* l in (a^, b^, f) */
    float eye[3];      /* of the viewer in (a^, b^, f) from the frame's origin, m */
    float pitch[2];    /* |a|, |b|, m */
};

/* A relief, its share of sunlight (or NULL) and where its colours go: pointers to texel 0. */
struct sv_relief_light_sheet {
    int width;
    const uint8_t (*color)[4];
    const int16_t (*normal)[4];
    const int16_t *plane[4]; /* what normal holds, plane by plane; or NULL: normal is read */
    const float *displ;
    const uint8_t *lit;
    uint8_t (*rgba)[4];
};

void sv_relief_light_scalar(const struct sv_relief_light_row *light,
                            const struct sv_relief_light_sheet *sheet, const struct sv_relief_eight *list,
                            int count);
/* Of a sheet at least eight texels wide. */
void sv_relief_light_avx2(const struct sv_relief_light_row *light, const struct sv_relief_light_sheet *sheet,
                          const struct sv_relief_eight *list, int count);

#endif
