/* light.h - the light of a scene: sun, sky, air. One struct is computed in C and feeds GLSL uniforms and the
 * ray-cast truth alike, so both shade with the same numbers.
 *
 * Radiance is relative: light on a white horizontal surface under a high sun is 1 (sun_rgb + sky_rgb). A
 * picture is exposed as a photographer does for a landscape, whose grass and leaves send back a tenth of
 * that: SV_LIGHT_EXPOSURE, with a shoulder above half of white (tone) that keeps snow and sand from clipping.
 *
 * Shading rules (the GLSL in core/gl/shaders/light.glsl and the C in light.c are twins; a test compares
 * them):
 * - ambient(n) = mix(ground_rgb, sky_rgb, 0.5 + 0.5 n.z) * occlusion
 * - surface = tone(albedo * (sun_rgb * max(0, n.l) * visible + ambient(n)) * SV_LIGHT_EXPOSURE)
 * - tone(c) = c up to 1/2, then 1/2 + t / (2 (1 + t)), t = 2 c - 1: smooth, rising, below 1
 * - visible: 1 or 0 where shadows are cast; without shadows, on trees, the share of sun that the crown lets
 *   through on the average (sv_tree_vertex.open), so that crowns have a bright and a dark side; 1 on the
 * ground
 * - leaf: n is turned to the viewer; sun term = sun_rgb * visible * (n.l >= 0 ? n.l : translucency * -n.l)
 * - sky(dir) = gradient between horizon_rgb and zenith_rgb by elevation, with the sun's disc and glow
 * - air: off by default; color = mix(color, air_rgb, 1 - exp(-distance / air_length_m)) */
#ifndef SV_SCENE_LIGHT_H
#define SV_SCENE_LIGHT_H

#include <stdbool.h>

#include "core/base/vec.h"

/* Found by eye on forests, meadows and snow under suns of 5 to 60 degrees. */
#define SV_LIGHT_EXPOSURE 2.4f

struct sv_sun {
    double azimuth_rad;   /* clockwise from grid north */
    double elevation_rad; /* above the horizon, -pi/2 .. pi/2 */
};

struct sv_light {
    struct sv_vec3 to_sun; /* unit, world */
    float sun_rgb[3];      /* 0 at and below the horizon */
    float sky_rgb[3], ground_rgb[3];
    float zenith_rgb[3], horizon_rgb[3];
    bool air;
    float air_rgb[3];
    float air_length_m;
};

/* The light of a clear day for that sun. Any finite elevation; night is dim blue, never black. */
void sv_light_from_sun(const struct sv_sun *sun, struct sv_light *light);

/* The tone curve, linear in and out; 0 for NaN and below 0. */
float sv_light_tone(float exposed);

/* CPU twins of the GLSL. n, dir, to_viewer unit; rgb linear. */
void sv_light_surface(const struct sv_light *light, struct sv_vec3 n, const float albedo[3], float occlusion,
                      float visible, float rgb[3]);
void sv_light_leaf(const struct sv_light *light, struct sv_vec3 n, struct sv_vec3 to_viewer,
                   const float albedo[3], float occlusion, float translucency, float visible, float rgb[3]);
void sv_light_sky(const struct sv_light *light, struct sv_vec3 dir, float rgb[3]);
void sv_light_air(const struct sv_light *light, double distance_m, float rgb[3]);

#endif
