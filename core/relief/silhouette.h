/* silhouette.h - what a body keeps from parallel light: its outline as the light sees it, on a plane square
 * to the light (paper 1, section 3.3.2, step (2)). A plain value: made by trees, relief objects and reliefs,
 * used by whatever they shade. */
#ifndef SV_RELIEF_SILHOUETTE_H
#define SV_RELIEF_SILHOUETTE_H

#include <stdint.h>

#include "core/base/vec.h"

/* A point X is behind texel (s, t) = ((X - corner).right / width_m, (X - corner).down / height_m) * (width,
 * height), seen along the light; row 0 is the top row (up = -down is the side nearer to the zenith). Depth
 * along the light of X is (X - corner).travel. */
struct sv_silhouette {
    int width, height;
    const uint8_t *coverage; /* share of light kept away, * 255 */
    const float *first;      /* or NULL: depth along the light (m, from the corner's plane) at which the body
                                begins; receivers before it are not shaded */
    struct sv_vec3 corner;   /* body-relative (add the body's place), m */
    struct sv_vec3 right, down, travel; /* unit, world axes, mutually square; travel is the light's */
    double width_m, height_m;
    double first_m, last_m; /* depths between which the body lies */
};

#endif
