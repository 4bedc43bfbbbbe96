/* imagery_tone.h - raw satellite bands made fit to be an albedo.
 *
 * A photograph has blacks and whites; its values are what a picture should show in plain daylight, not albedos: they are
 * divided by what daylight and exposure (SV_LIGHT_EXPOSURE) make of an albedo under a sun at 40 degrees. Raw bands of a scanner have neither: haze lifts
 * the darkest ground, and the brightest stays far below white. Only then: the haze of each band is its
 * darkest ground and is taken off in linear light (dark-object subtraction, Chavez 1988), and one gain for
 * all bands lifts the brightest ground to an albedo of 0.4. */
#ifndef SV_TERRAIN_IMAGERY_TONE_H
#define SV_TERRAIN_IMAGERY_TONE_H

#include <stdbool.h>
#include <stdint.h>

#include "core/base/image.h"

/* Fills table (sRGB code in, sRGB code out, a band). imagery: RGBA u8; texels with alpha 0 do not count.
 * Returns whether it does anything: the 1st percentile of every band is at least 20, the 99th at most 140.
 * sv_color_init must have been called. */
bool sv_imagery_tone(const struct sv_image *imagery, uint8_t table[3][256]);

#endif
