/* ground.h - the colour of the ground and of the sky, pixel by pixel, from the depth of a drawn terrain.
 *
 * The terrain's triangles are small (36 pixels at the mean), and llvmpipe shades whole blocks of 4 x 4 pixels
 * of each: three times what is seen. So they are drawn for their depth alone (draw.h), and every pixel is
 * shaded once, here: albedo and normal with mip levels, detail.h, sunlight of shadow_page.h, the rules of
 * core/scene/light.h. Pages of shadow are asked for by the pixels that see them: what no pixel sees is never
 * cast. TWIN: core/truth/terrain_shade.c with core/scene/light.c; a test compares the two. No GL.
 *
 * Eight pixels at a time, written once in terms of vectors of eight and compiled twice: for every x86-64, and
 * with AVX2. Both give the same bytes. */
#ifndef SV_TERRAIN_GROUND_H
#define SV_TERRAIN_GROUND_H

#include "core/base/error.h"
#include "core/scene/light.h"
#include "core/terrain/shadow_page.h"
#include "core/terrain/terrain.h"
#include "core/view/camera.h"

struct sv_ground;

/* Borrows terrain for life; makes mip levels of its images: 1.4 bytes an albedo texel, 0.7 a sample.
 * SV_EINVAL when the terrain has no albedo or normals (coloring.h); SV_ENOMEM. */
SV_MUST_CHECK enum sv_status sv_ground_create(const struct sv_terrain *terrain, struct sv_ground **ground,
                                              struct sv_error *error);
void sv_ground_destroy(struct sv_ground *ground); /* NULL is legal */

struct sv_ground_view {
    const struct sv_camera *camera;
    const struct sv_light *light;
    double shift_x_px, shift_y_px;   /* the sample inside the pixel */
    struct sv_shadow_pages *shadows; /* with a scene in use (sv_shadow_pages_use); NULL: no shadows */
    bool sky;                        /* pixels of depth 0 show the sky; else they become 0, transparent */
    int row_first, row_count; /* the band of rows that is shaded; its planes hold no others; row_count 0: all of the
                                 picture, row_first is then 0 */
    const float *depth;    /* camera's width * rows: window depth as GL has it (reversed), 0: no ground */
    const uint8_t *hidden; /* pixels that are not 0 are left as they are, at next to no cost; NULL: none */
};

/* Shades every pixel into rgba (camera's width * rows * 4, sRGB, alpha 255 on ground and sky). About 15 ns
 * a pixel. */
void sv_ground_shade(const struct sv_ground *ground, const struct sv_ground_view *view, uint8_t *rgba);

#endif
