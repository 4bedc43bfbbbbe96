/* target.h - the framebuffer that a view is drawn into: colour, id, normal, depth, and reading them back.
 *
 * Colour SRGB8_ALPHA8 with GL_FRAMEBUFFER_SRGB on (shaders write linear light, premultiplied alpha); id
 * R32UI; normal RGBA16F (xyz world, w unused); depth 32-bit float, reversed, cleared to 0 (infinity).
 * Fragment outputs: location 0 vec4 color, 1 uint id, 2 vec4 normal; those that a target lacks are simply not
 * attached. */
#ifndef SV_GL_TARGET_H
#define SV_GL_TARGET_H

#include "core/base/error.h"
#include "core/base/image.h"
#include "core/view/request.h"

struct sv_gl_target;

/* layers: bit set of 1u << enum sv_layer. Depth is always there. */
SV_MUST_CHECK enum sv_status sv_gl_target_create(int width, int height, unsigned layers,
                                                 struct sv_gl_target **target, struct sv_error *error);
void sv_gl_target_destroy(struct sv_gl_target *target);
/* Binds, sets viewport and draw buffers, clears: colour (0,0,0,0), id 0, normal 0, depth 0. */
void sv_gl_target_begin(struct sv_gl_target *target);
/* The same for rows row_first .. row_first + row_count - 1 (1 at least) alone, which come out as they do in the whole: what
 * is drawn is cut off there, not moved. The others are cleared. */
void sv_gl_target_begin_rows(struct sv_gl_target *target, int row_first, int row_count);
/* Reads one layer; row 0 at the top. COLOR: RGBA u8 (sRGB, premultiplied). DEPTH: the raw window depth, f32
 * (1 channel). NORMAL: f32 x 3. ID: u32 x 1. Image sizes and types must match (caller allocated). */
SV_MUST_CHECK enum sv_status sv_gl_target_read(struct sv_gl_target *target, enum sv_layer layer,
                                               struct sv_image *out, struct sv_error *error);
/* Reads as many rows as the image has, from row_first on. */
SV_MUST_CHECK enum sv_status sv_gl_target_read_rows(struct sv_gl_target *target, enum sv_layer layer, int row_first,
                                                    struct sv_image *out, struct sv_error *error);

/* Puts a picture (RGBA u8, sRGB as sv_gl_target_read gives it) into the colour of the target. 0.1 ms for 512
 * x 512. SV_EINVAL when it is not the target's size, or the target has no colour. */
SV_MUST_CHECK enum sv_status sv_gl_target_write(struct sv_gl_target *target, const struct sv_image *color,
                                                struct sv_error *error);
/* Puts as many rows as the image has there, from row_first on. */
SV_MUST_CHECK enum sv_status sv_gl_target_write_rows(struct sv_gl_target *target, int row_first,
                                                     const struct sv_image *color, struct sv_error *error);

#endif
