/* warp.h - relief textures straight into the final picture: one 4 x 4 map a texel, a splat into a depth
 * buffer, holes found and filled, colour looked up once a pixel. No pre-warp, no GL.
 *
 * One map serves every source and camera: with t = displ (a relief) or t = q = distance / Z (a cell's panel)
 *     (x w, y w, d w, w)^T = m (u, v, t, 1)^T
 * x to the right and y down in px (pixel (i, j) has its centre at (i + 0.5, j + 0.5)), d the reversed window
 * depth that GL would write (0: infinitely far; larger is nearer), w > 0 in front of the eye. Own derivation:
 * all of (1)-(4) of paper 1 and of algorithms.md 2.2 are such projective maps. Texels with w <= 0, d outside
 * [0, 1] or anything not finite are not drawn.
 *
 * Flow: clear -> splat each source (nearest wins) -> fill -> resolve. Between splat and resolve a pixel holds
 * a texel and a place in it, not a colour, so that the splat moves 10 bytes a pixel and colour is filtered
 * once. Scalar, SSE2 and AVX2 draw the same bits (no fused multiply-add), in whatever order sources come.
 *
 * Surface. Four neighbouring texels that are drawn and not torn along their four edges are one piece,
 * bilinear between their centres; it covers every pixel centre in its outline. Elsewhere a texel covers its
 * own footprint, half a texel to each side. Both sides of the sheet are drawn. A silhouette grows by at most
 * 1/8 of a texel where a texel takes up to 6 px, by 1/100 px where it is larger; depth stays within what the
 * corners of a piece have. Work is bounded: beyond 32 times the picture in large pieces the rest of a source
 * is left out, which no sheet seen from anywhere comes near. */
#ifndef SV_RELIEF_WARP_H
#define SV_RELIEF_WARP_H

#include <stdint.h>

#include "core/base/error.h"
#include "core/relief/relief.h"
#include "core/view/camera.h"

struct sv_warp_map {
    double m[4][4]; /* rows x, y, d, w; columns u, v, t, 1 */
};

/* The map of a relief in world space to a camera's picture (perspective or orthographic), for t = displ.
 * shift as in sv_camera_clip_from_local. Everything large is subtracted in double. */
void sv_warp_map_from_camera(const struct sv_relief_frame *frame, const struct sv_camera *camera,
                             double shift_x_px, double shift_y_px, struct sv_warp_map *map);

struct sv_warp_source {
    int width, height;
    const float *t;            /* displ or q, width * height */
    const uint8_t (*color)[4]; /* what is seen, sRGB, straight: albedo or lit; alpha >= 128: solid */
    float cut;                 /* neighbours whose t differ by more are torn apart */
    struct sv_warp_map map;
    int row0; /* number of the first row, as the map counts them: of a part of a relief */
    float t_most; /* above 0: every t is in 0 .. t_most, so that parts out of the picture are left out unseen */
};

enum { SV_WARP_SOURCES_MAX = 32, SV_WARP_TEXEL_BITS = 26 };
#define SV_WARP_EMPTY UINT32_MAX
#define SV_WARP_TEXEL_MASK ((UINT32_C(1) << SV_WARP_TEXEL_BITS) - 1)
/* Bit 31: the pixel was a hole and is filled with this texel; bits 26..30: source; the rest: row * width +
 * column. */
#define SV_WARP_FILLED UINT32_C(0x80000000)

struct sv_warp_buffer {
    int width, height;  /* px */
    int first, end;     /* rows that are drawn, byte for byte as when all are; others stay empty */
    float *depth;       /* width * height, reversed window depth; 0: nothing */
    uint32_t *texel;    /* width * height; SV_WARP_EMPTY: nothing */
    uint16_t *place;    /* where in or beside that texel the pixel's centre lies (sv_warp_locate reads it) */
    int x0, y0, x1, y1; /* what was written since the last clear: x0 <= x < x1; empty: x0 >= x1 */
    struct sv_warp_tears *tears; /* torn edges that the splats met since the last clear */
};

struct sv_warp_stats {
    uint64_t texels;     /* solid texels looked at, of those that are not left out unseen */
    uint32_t pixels;     /* that hold a surface */
    uint32_t holes;      /* pixels of disocclusions before filling ... */
    uint32_t holes_left; /* ... and after */
};

SV_MUST_CHECK enum sv_status sv_warp_buffer_create(int width, int height, struct sv_warp_buffer *buffer,
                                                   struct sv_error *error);
/* Only rows first .. end - 1 from now on, within 0 .. height. Clears. */
void sv_warp_buffer_limit(struct sv_warp_buffer *buffer, int first, int end);
void sv_warp_buffer_finish(struct sv_warp_buffer *buffer);
/* Empties what was written (only that). */
void sv_warp_clear(struct sv_warp_buffer *buffer);
/* Splats source number k (its texels are tagged k); all SIMD levels. */
void sv_warp_splat(const struct sv_warp_source *source, unsigned k, struct sv_warp_buffer *buffer,
                   struct sv_warp_stats *stats);
/* Finds what opens between torn neighbours, where no source drew a surface, and fills it with the far texel's
 * border (each pixel from the nearest far side); call once, after all sources. Cost goes with torn edges.
 * holes_left stays 0 unless memory runs out. */
void sv_warp_fill(const struct sv_warp_source *sources, unsigned count, struct sv_warp_buffer *buffer,
                  struct sv_warp_stats *stats);
/* The place on its source that the pixel's centre shows, by Newton's steps on the surface, from where the
 * splat has it (to 1 / 256 and 1 / 128 texel: what the resolves go by); in filled holes just that. False for
 * an empty pixel. */
bool sv_warp_locate(const struct sv_warp_source *sources, const struct sv_warp_buffer *buffer, int i, int j,
                    double *u, double *v);
/* Colours of the pixels that hold something: rgba is width * height * 4 of the buffer's size, sRGB straight,
 * bilinear in the source (solid texels of the same surface only); other pixels are left alone. */
void sv_warp_resolve(const struct sv_warp_source *sources, unsigned count,
                     const struct sv_warp_buffer *buffer, uint8_t (*rgba)[4]);
/* What a pixel shows, as a mean of up to four texels of one source (row * width + column) with weights that
 * add up to 1; texels of weight 0 may repeat another. False for an empty pixel. */
struct sv_warp_weights {
    uint32_t texel[4];
    float weight[4];
};
bool sv_warp_weigh(const struct sv_warp_source *sources, const struct sv_warp_buffer *buffer, int i, int j,
                   unsigned *source, struct sv_warp_weights *weights);
/* The same mean of other images of the sources' sizes (normals: a relief's normal[], not normalised again).
 * images[k] belongs to source k, NULL: its pixels are left alone. out is of the buffer's size. */
void sv_warp_resolve_int16(const struct sv_warp_source *sources, const int16_t (*const *images)[4],
                           unsigned count, const struct sv_warp_buffer *buffer, int16_t (*out)[4]);
/* Depth on the bilinear surface at each pixel's place (the buffer's own is linear over a cell); pixels that
 * are empty are left alone. */
void sv_warp_resolve_depth(const struct sv_warp_source *sources, const struct sv_warp_buffer *buffer,
                           float *depth);

#endif
