/* warp_pictures.h - one relief seen by one camera in every way that there is: the ray march, the direct warp
 * at each level, the two-pass pre-warp with its plane looked up along the pixel's ray. */
#ifndef SV_TESTS_RELIEF_WARP_PICTURES_H
#define SV_TESTS_RELIEF_WARP_PICTURES_H

#include "core/base/simd.h"
#include "tests/core/relief/ray_march.h"

/* How near an outline may pass by a pixel's centre for rounding to decide: twice what the warps allow
 * themselves. */
#define WARP_PICTURE_TIE_PX (1.0 / 64)

struct warp_picture {
    int width, height;
    uint8_t (*rgba)[4]; /* alpha 255: something is there, else 0 */
    uint8_t (
        *unfiltered)[4]; /* truth: in holes the far texel's own colour, else rgba once more; others: NULL */
    uint8_t *hole;       /* 1: a hole (filled or not) */
    uint8_t *edge; /* truth of small pictures: an outline passes within WARP_PICTURE_TIE_PX of the centre */
    uint32_t holes, holes_left,
        shown; /* pixels, or samples of the warped texture; shown: something is there */
};
void warp_picture_finish(struct warp_picture *picture);

void warp_picture_truth(const struct ray_field *field, const struct sv_camera *camera,
                        struct warp_picture *picture);
void warp_picture_direct(const struct sv_relief *relief, const struct sv_camera *camera, enum sv_simd level,
                         struct warp_picture *picture);
/* scale: samples of the warped texture a texel, along each side. */
void warp_picture_prewarp(const struct sv_relief *relief, const struct sv_camera *camera, double scale,
                          struct warp_picture *picture);

/* The warped texture as it is, one sample a texel, and what the march sees through its samples: the two-pass
 * warp without the second resampling that the plane's lookup is. */
void warp_picture_on_plane(const struct sv_relief *relief, const struct ray_field *field,
                           const struct sv_camera *camera, struct warp_picture *truth,
                           struct warp_picture *warped);

struct warp_difference {
    uint32_t pixels;  /* that either shows something in */
    uint32_t differ;  /* shown in one only, or off by more than `levels` in a channel */
    uint32_t in_hole; /* ... of these, where the truth has a hole */
    uint32_t holes;   /* of the truth */
};
/* Whether a pixel on an outline shows something is not judged. In a hole both colours of the truth are right:
 * what the far side has at its edge, filtered along it or not.
 */
struct warp_difference warp_picture_compare(const struct warp_picture *truth,
                                            const struct warp_picture *other, int levels);

#endif
