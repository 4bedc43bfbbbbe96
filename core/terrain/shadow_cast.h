/* shadow_cast.h - the row kernel of sv_shadow_window_cast. Private to core/terrain. */
#ifndef SV_TERRAIN_SHADOW_CAST_H
#define SV_TERRAIN_SHADOW_CAST_H

#include <stdint.h>

enum { SV_SHADOW_CAST_SAMPLES = 4 };

/* Silhouette coordinates of window texel i of a row are linear in i and in the ground's height g there:
 * s + i step_s + g height_s, and so for t and the depth d. s, t: texels, already less the half, so that
 * whole numbers are texel centres. d in the silhouette's lengths. */
struct sv_shadow_cast {
    const uint8_t *coverage;
    const float *first; /* or NULL: first_d everywhere */
    int width, height;
    float first_d;
    float step_s, step_t, step_d;
    float height_s, height_t, height_d;
    /* A window's texel covers more than one of the silhouette's: the mean of samples_s x samples_t of them.
     */
    int samples_s, samples_t;
    float offset_s[SV_SHADOW_CAST_SAMPLES], offset_t[SV_SHADOW_CAST_SAMPLES], share;
};

/* Spaces samples_s and samples_t samples evenly over so many texels of the silhouette. */
void sv_shadow_cast_spread(struct sv_shadow_cast *cast, double spread_s, double spread_t);

/* count texels of one row, ground[0 .. count), light[0 .. count); s, t, d at texel 0 for ground 0. */
typedef void sv_shadow_cast_row(const struct sv_shadow_cast *cast, float s, float t, float d, int count,
                                const float *ground, uint8_t *light);
sv_shadow_cast_row sv_shadow_cast_row_scalar, sv_shadow_cast_row_avx2;

/* light * (255 - coverage) / 255, rounded; what is then below this is none, so that the next casters pass it
 * over. */
enum { SV_SHADOW_DARK = 3 };
static inline uint8_t sv_shadow_darken(uint8_t light, unsigned coverage)
{
    unsigned x = light * (255u - coverage) + 128u;
    x = (x + (x >> 8)) >> 8;
    return (uint8_t)(coverage > 0 && x < SV_SHADOW_DARK ? 0 : x);
}

/* Coverage * 255 at (s, t), bilinear, nothing beyond the border, as a float; and the mean of the samples. */
float sv_shadow_cast_coverage(const struct sv_shadow_cast *cast, float s, float t, float d);
float sv_shadow_cast_mean(const struct sv_shadow_cast *cast, float s, float t, float d);

#endif
