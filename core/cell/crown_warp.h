/* crown_warp.h - the crowns of panels (panel.h) straight into a view: z-buffered splats of texels, then each
 * pixel's exact place on its panel, filtered, under what light still passes.
 *
 * A source is a crowns layer and the map of its texels to the picture,
 *     (x w, y w, d w, w)^T = m (xs, ys, q, 1)^T
 * x to the right and y down in px (pixel (i, j) has its centre at (i + 0.5, j + 0.5)), d the reversed window
 * depth near / Z, w > 0 in front of the eye (algorithms.md 2.2; sv_crown_map makes it).
 *
 * Flow of a frame: begin; for each ring, nearest first: clear, splat all faces that are in view (nearest
 * texel wins a pixel), resolve into light, front to back. So a ring shows one texel a pixel, rings show
 * through one another.
 *
 * Splat. An occupied texel covers the pixel centres in a box around its own centre that holds its square:
 * half width h (|dx/dxs| + |dx/dys|), height alike, h = 1 / size being half a texel (of the two derivatives,
 * numerators over w^2, the numerators at their largest in its tile), and SV_CROWN_GROW px more on each side,
 * at most SV_CROWN_HALF_MAX in all: neighbours of one q leave no gap up to magnifications of twice that.
 * Texels with w <= 0, d outside [0, 1] or anything not finite are not drawn. Among equal d the lower source,
 * then the lower texel (tile by tile, and row by row in each) wins.
 *
 * Resolve. With q the stored one of the texel that won, the pixel's centre shows the panel at
 *
 *     xs = (r_x / r_w) (1 + q g_w) - q g_x,   ys = (r_y / r_w) (1 + q g_w) - q g_y
 *
 * exactly (own derivation; m = [a b c e] in columns, rows x, y, w; A = [a b e], r = A^-1 (x, y, 1), g = A^-1
 * c): colour is bilinear there, in linear light and premultiplied. A pixel that no texel covers takes the
 * nearest (largest d) of its eight neighbours' texels, or else of the sixteen around those: what has opened
 * beside one shows what the panel has beside it, and beyond a silhouette there is nothing to be seen
 * (coverage 0). Where the panel has something much nearer or farther there (its q off by more than
 * SV_CROWN_SAME of it), the pixel shows nothing unless texels cover pixels above, below, left and right of
 * it: else the wood behind a crown is seen a second time beside it, in the sky. (Flights over 5,000 and
 * 45,000 trees: mean 6.03 and 6.71 of 255 without, 5.95 and 6.61 with it.) So no rims of empty texels are
 * needed around crowns. (Measured on a forest, tests/experiments/cell_crowns: without that 2 to 7 % of light
 * leaks through cracks, 0.1 to 1.3 % with it; larger reaches, the farthest neighbour, a second step by the q
 * found at the place, and smoothed q gave nothing.)
 *
 * What opens. From off V a leaf uncovers some of what it hides from V, of which the panel knows nothing: the
 * sky would be seen through a crown that has no hole there. A pixel of a source that `opens`, which no texel
 * covers and which has not been filled, therefore looks along rows, columns and diagonals for the first texel
 * within SV_CROWN_OPEN px each way. Where the pixel sees that one's depth the panel has something nearer (V
 * could not see there), or nothing, or something farther (V did, and there is a gap). The farthest of those
 * of the first kind, which goes on behind, is shown. Nothing follows for a view from V. (Walks
 * among 5,000 trees, pixels brighter by 40 levels than all within 2 px in the truth, without and with it for
 * the innermost ring of crowns: 811 and 146 beside a crown 3 m away, 4 in direct drawing; 1844, 1638, 1534;
 * 229, 206, 118. Rings farther out gain next to nothing by it: their leaves are small.)
 *
 * Results do not depend on the SIMD level, on the order of tiles, or on how a picture is cut into bands: rows
 * of a band are bit for bit those of the whole picture. One thread at a time a buffer; any process. */
#ifndef SV_CELL_CROWN_WARP_H
#define SV_CELL_CROWN_WARP_H

#include "core/base/error.h"
#include "core/cell/lattice.h"
#include "core/cell/panel.h"
#include "core/view/camera.h"

enum { SV_CROWN_SOURCES_MAX = 12, SV_CROWN_HALF_MAX = 8, SV_CROWN_REACH = 2, SV_CROWN_OPEN = 8 };
/* Weights between texels rise from 0 to 1 that many times as fast about the middle as bilinear ones. At a
 * texel a pixel bilinear ones (1) leave 0.66 of a forest's gradient energy and nearest ones stagger. */
#define SV_CROWN_STEEP 2.0f
/* The same of texels that are means of many samples (core/view/panels_refine.h): they are as soft as pixels
 * already. One flight of 5,000 trees, 16 samples a texel, against 64 a pixel: 2 is off by 3.38 of 255 in the
 * mean, SSIM 0.910, gradient energy 1.26; 1.4 by 3.13, 0.918, 1.13; 1 by 2.90, 0.927, 0.98. A ray cast of
 * four samples: 5.15, 0.843, 2.35. */
#define SV_CROWN_STEEP_REFINED 1.0f
#define SV_CROWN_GROW (1.0f / 64)
#define SV_CROWN_SAME 0.1f
/* Pixels that let less light through are done. */
#define SV_CROWN_PASS_MIN (1.0f / 255)

struct sv_crown_source {
    const struct sv_panel_layer *layer;
    float steep;    /* >= 1: SV_CROWN_STEEP, SV_CROWN_STEEP_REFINED */
    bool opens;     /* what opens behind its texels is shown as what is beside it (above) */
    double m[4][4]; /* rows x, y, d, w; columns xs, ys, q, 1 */
};

/* The map of a face of the cell at v (world) with distance D to a perspective camera's picture; shift as in
 * sv_camera_clip_from_local. (Of an orthographic camera A is singular, and nothing is resolved.) */
void sv_crown_map(struct sv_vec3 v, double distance_m, enum sv_cell_face face, const struct sv_camera *camera,
                  double shift_x_px, double shift_y_px, double m[4][4]);

/* Rows row_first .. row_first + row_count - 1 of a picture. */
struct sv_crown_buffer;
struct sv_crown_stats { /* added to */
    uint64_t tiles;     /* that are occupied ... */
    uint64_t drawn;     /* ... and neither out of view nor behind what lets no light through */
    uint64_t texels;    /* occupied ones of drawn tiles */
};

/* width 1 .. 4096, row_first 0 .. 4095, row_count 1 .. 4096. SV_EINVAL, SV_ENOMEM. Starts as after begin and
 * clear. */
SV_MUST_CHECK enum sv_status sv_crown_buffer_create(int width, int row_first, int row_count,
                                                    struct sv_crown_buffer **buffer, struct sv_error *error);
void sv_crown_buffer_destroy(struct sv_crown_buffer *buffer); /* NULL is legal */
/* A new frame: whatever light is resolved into next lets all light through, as far as splats know, and the
 * buffer is empty. */
void sv_crown_buffer_begin(struct sv_crown_buffer *buffer);
/* After begin, where light (of the band) has been gathered before the first ring: what lets none through need
 * not be splatted, but for texels in front of it: front is its window depth, of the band, INFINITY where
 * nothing is to be in front; NULL: nowhere. */
void sv_crown_buffer_close(struct sv_crown_buffer *buffer, const float (*light)[4], const float *front);
/* A new ring of the same frame: empties the buffer (in next to no time). */
void sv_crown_buffer_clear(struct sv_crown_buffer *buffer);

/* Splats sources 0 .. count - 1 (at most SV_CROWN_SOURCES_MAX) of one ring, all of them in one call. Only
 * pixels that resolve found done since begin may be left out. stats may be NULL. */
void sv_crown_splat(const struct sv_crown_source *sources, unsigned count, struct sv_crown_buffer *buffer,
                    struct sv_crown_stats *stats);
/* After a splat, right before the resolve of the same sources, which ends what this begins: texels in front
 * of what has been gathered, d >= front (as in close), go over it; the rest is left to resolve. Trees of
 * which one is gathered and the other on a panel reach into each other. The nearer surface wins a pixel, not
 * the nearer stem. */
void sv_crown_resolve_front(const struct sv_crown_source *sources, unsigned count,
                            struct sv_crown_buffer *buffer, const float *front, float (*light)[4]);
/* Front to back: light[p] = {r, g, b linear gathered so far, what still passes}, p over the band, row by row.
 * depth: the window depth of opaque things (0: sky), of the band; NULL: none; a texel of d < depth (1 -
 * tolerance) is left out. The same sources as in the splat. Between begin and begin always the same light. */
void sv_crown_resolve(const struct sv_crown_source *sources, unsigned count, struct sv_crown_buffer *buffer,
                      const float *depth, float tolerance, float (*light)[4]);

#endif
