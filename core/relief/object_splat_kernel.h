/* object_splat_kernel.h - what object_splat.c and its AVX2 kernels share. Scalar front and drop:
 * object_front.c. Private to them.
 *
 * A full cell of at most SV_WARP_SMALL pixels a side is put off until eight of them are together: no order of
 * drawing changes the picture. All others are drawn where they are met. */
#ifndef SV_RELIEF_OBJECT_SPLAT_KERNEL_H
#define SV_RELIEF_OBJECT_SPLAT_KERNEL_H

#include "core/base/simd.h"
#include "core/relief/object_splat.h"
#include "core/relief/warp_kernel.h"

/* |e1 x e2| over the area of the box, below which a cell is seen edge-on: 0.05 px wide at 10 px. */
#define SV_RELIEF_EDGE_ON (1.0f / 4096)

/* Cells that are put off are drawn when there are this many; a row adds as many as a strip has. */
enum { SV_RELIEF_WAITING = 64, SV_RELIEF_WAITING_ROOM = SV_RELIEF_WAITING + SV_WARP_STRIP + 8 };

/* Cells larger than this are rare, and drawn row by row. */
#define SV_RELIEF_LARGE_PX 64.0f
/* What rounding may do to the outline of a quarter, px. */
#define SV_RELIEF_QUARTER_SLACK (1.0f / 1024)

/* Of two: the second when they are equal or one is NaN, as the vector instructions have it. */
static inline float sv_relief_min2(float a, float b)
{
    return a < b ? a : b;
}

static inline float sv_relief_max2(float a, float b)
{
    return a > b ? a : b;
}

static inline float sv_relief_least(const float v[4])
{
    return sv_relief_min2(sv_relief_min2(v[0], v[1]), sv_relief_min2(v[2], v[3]));
}

static inline float sv_relief_most(const float v[4])
{
    return sv_relief_max2(sv_relief_max2(v[0], v[1]), sv_relief_max2(v[2], v[3]));
}

/* Corner k of a full cell is texel k & 1 of row k >> 1. */
struct sv_relief_corners {
    float x[4], y[4], d[4];
    uint32_t texel;
};

/* A quadrilateral as it is asked for pixels: (s, r) = (dx sx - dy sy, dy ry - dx rx) from corner 0; its
 * corners are (0, 0), (1, 0), (0, 1), (s3, r3). In where s, r, a_r r - a_s (s - s1) and e_s s - e_r (r - r1)
 * are at least -SV_WARP_EDGE. Depth: d + ds s + dr r, s and r held at `last`, the whole within d_min ..
 * d_max; place (place_s + scale_s s, place_r + scale_r r). */
struct sv_relief_quad {
    float x0, y0, sx, sy, rx, ry, s3, r3, det, a_r, a_s, s1, e_s, e_r, r1, last;
    float d, ds, dr, d_min, d_max, place_s, place_r, scale_s, scale_r;
    uint32_t texel, full;
    int i0, j0, nx, ny;
};

/* A full cell that the kernels leave (large, or far from a parallelogram), by its own coordinates. False: it
 * is neither convex nor small, or folded in the picture. wide: AVX2, here and below. */
bool sv_relief_draw_quad(struct sv_warp_job *job, const struct sv_relief_corners *c, bool wide);
/* The quarter of a cell that texel k of it has; corner 0 is the texel's centre. */
void sv_relief_draw_quarter(struct sv_warp_job *job, const struct sv_relief_corners *c, int k, bool wide);
/* A full cell that draw_quad leaves: two triangles. False: too large. */
bool sv_relief_draw_full(struct sv_warp_job *job, const struct sv_relief_corners *c);
/* The pixels of a quadrilateral, eight of a row at a time. */
void sv_relief_quad_pixels_avx2(struct sv_warp_job *job, const struct sv_relief_quad *q);

/* Corner k of a cell is texel k & 1 of row k >> 1. needed: all ones unless it is SPARE. Of a quarter: corner
 * 0 is the texel's centre, 1 and 2 the middles of its edges, and needed the number of the texel in the cell.
 */
struct sv_relief_waiting {
    int count;
    float x[4][SV_RELIEF_WAITING_ROOM], y[4][SV_RELIEF_WAITING_ROOM], d[4][SV_RELIEF_WAITING_ROOM];
    uint32_t texel[SV_RELIEF_WAITING_ROOM], needed[SV_RELIEF_WAITING_ROOM];
};

/* Which texels of a row face the eye, a byte each (255 or 0), columns first .. first + count - 1: n . (eye -
 * place) > 0 (NaN: no). What lies outside of the sheet does not. */
enum { SV_RELIEF_FRONT = SV_WARP_ROW + 48 };
void sv_relief_front_scalar(const struct sv_relief_facing *facing, const struct sv_warp_source *source,
                            int first, int count, int j, uint8_t out[SV_RELIEF_FRONT]);
void sv_relief_front_avx2(const struct sv_relief_facing *facing, const struct sv_warp_source *source,
                          int first, int count, int j, uint8_t out[SV_RELIEF_FRONT]);
/* Entries of a row without a neighbour (or themselves) that faces the eye are nothing: no cell at them does.
 * front: the rows above, at and below, from the column before the first entry. */
void sv_relief_drop_scalar(uint8_t *const front[3], int n, struct sv_warp_row *row);
void sv_relief_drop_avx2(uint8_t *const front[3], int n, struct sv_warp_row *row);

/* Puts off the small full cells among n; lists those that are to be drawn now, and returns their number:
 * large ones, and needed ones that are not full. rim: of the first cell. */
int sv_relief_put_off_avx2(const struct sv_warp_job *job, const struct sv_warp_row *upper,
                           const struct sv_warp_row *lower, int n, const uint8_t *rim,
                           struct sv_relief_waiting *waiting, uint16_t *now);
/* Draws the first `count` that wait; lists those that are not convex and needed, and returns their number. */
int sv_relief_draw_waiting_avx2(struct sv_warp_job *job, const struct sv_relief_waiting *waiting, int count,
                                uint16_t *left);

/* Draws the first `count` quarters that wait. */
void sv_relief_draw_quarters_avx2(struct sv_warp_job *job, const struct sv_relief_waiting *waiting,
                                  int count);

/* Names of a row's pixels: texel[] << 1 | 1 in a full cell, 0 elsewhere. above: those of the row above, or
 * NO_NAME; becomes the row's own. Lists the names that are neither those of the pixel above nor of the one to
 * the left (and perhaps some that are), and returns their number; `names` has room for SLACK more. */
#define SV_RELIEF_NO_NAME UINT32_MAX
enum { SV_RELIEF_NAMES_SLACK = 8 };
int sv_relief_names_scalar(const uint32_t *texel, const uint16_t *place, int count, uint32_t *above,
                           uint32_t *names);
int sv_relief_names_avx2(const uint32_t *texel, const uint16_t *place, int count, uint32_t *above,
                         uint32_t *names);
/* For groups of eight of a row of `width` cells whether one of them is marked, or one to their left or above;
 * in whole fours, returns the cell where it stopped. */
int sv_relief_beside_avx2(const uint8_t *cell, int width, uint8_t *group);

/* sv_relief_find_seen and sv_relief_splat at a given level (tests). */
uint32_t sv_relief_find_seen_at(enum sv_simd level, const struct sv_warp_buffer *buffer,
                                const struct sv_relief_seen *seen, unsigned count);
void sv_relief_splat_at(enum sv_simd level, const struct sv_warp_source *source, unsigned k,
                        const uint8_t *rims, const struct sv_relief_facing *facing,
                        const struct sv_relief_span *spans, int span_count, struct sv_warp_buffer *buffer,
                        struct sv_warp_stats *stats);

#endif
