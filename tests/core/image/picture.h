/* picture.h - a made-up landscape for encoder tests and measurements: sky gradient, two ridges, noisy foliage
 * below; about as hard to compress as what the service draws. Deterministic. Depth grows to the horizon,
 * +infinity in the sky. */
#ifndef SV_TESTS_IMAGE_PICTURE_H
#define SV_TESTS_IMAGE_PICTURE_H

#include "core/base/image.h"

/* Heap images of width x height; any pointer may be NULL. rgba: u8; depth: f32, 1 channel; id: u32, 1
 * channel. */
void picture_make(int width, int height, struct sv_image *rgba, struct sv_image *depth, struct sv_image *id);

#endif
