/* warp_kernel.h - what the files of the warp share: rows of projected texels, kernels at each SIMD level, the
 * one place where a pixel is won. Private to core/relief/warp*.c and their tests.
 *
 * Cells. Cell (c, j) is the square of the texture between the centres of texels c, c + 1 in rows j, j + 1; it
 * is FULL when all four texels are drawn and neighbours in it are not torn. A source is walked in strips of
 * cells, row by row: project a row of texels, then draw the cells between it and the row above. Nearly all
 * cells are full, small and close to parallelograms in the picture: those a kernel draws many at a time (fast
 * cells). All others it lists, and sv_warp_cell draws them one by one, exactly.
 *
 * The same arithmetic in the same order at every level (no fused multiply-add, true divisions): the pictures
 * of all three are equal bit for bit. */
#ifndef SV_RELIEF_WARP_KERNEL_H
#define SV_RELIEF_WARP_KERNEL_H

#include <string.h>

#include "core/base/simd.h"
#include "core/relief/warp.h"

/* A strip's cells, and the room of its rows: one texel more, and what a vector store may run over. */
enum { SV_WARP_STRIP = 256, SV_WARP_ROW = SV_WARP_STRIP + 16 };
/* Fast cells touch at most this many pixels a side. */
#define SV_WARP_SMALL 6
/* The corner opposite to the first may be off the parallelogram by this much of a texel in a fast cell: a
 * silhouette grows by no more than that. */
#define SV_WARP_TWIST 0.125f
/* What rounding may do to a place in a cell: a pixel on the edge of two cells is drawn by both. */
#define SV_WARP_EDGE (1.0f / 1024)
/* A fast cell fills at least this share of its box in the picture; slivers are drawn exactly. */
#define SV_WARP_SLIVER (1.0f / 1024)
/* Texels that land farther away than this (px) are not drawn. */
#define SV_WARP_FAR_PX 1e8f
/* The largest float: what is not NaN and not infinite. */
#define SV_WARP_T_MAX 3.40282347e+38f
/* Pixels that the exact cells of one splat may test: this many times the picture. A sheet seen from anywhere
 * covers a pixel a few times; maps that stack every cell over the whole picture stop there. */
enum { SV_WARP_LAYERS = 32 };

/* Projected texels of one row; t is NaN where nothing is drawn, x, y, d, r are 0 there. */
struct sv_warp_row {
    _Alignas(32) float x[SV_WARP_ROW], y[SV_WARP_ROW], d[SV_WARP_ROW], t[SV_WARP_ROW];
    float min_x, max_x, min_y, max_y; /* over drawn texels; min > max when there is none */
};

/* x w, y w, d w, w of entry e at t is (base + e * du) + t * dt. */
struct sv_warp_line {
    float base[4], du[4], dt[4];
};

struct sv_warp_tear {
    float x[4], y[4]; /* the wall, around it: two corners on the far side, then two on the near side */
    float s[2], r[2]; /* place of the far corners from the far texel's own corner, texels */
    uint32_t texel;   /* the far one, with its source */
};

struct sv_warp_tears {
    size_t count, room;
    struct sv_warp_tear *items;
    size_t hole_count, hole_room;
    uint32_t *holes; /* pixels: room for sv_warp_fill */
};

struct sv_warp_job {
    const struct sv_warp_source *source;
    struct sv_warp_buffer *buffer;
    uint32_t tag0;   /* of the strip's first texel in the upper row */
    int column, row; /* of that texel; -1 is legal: nothing is there */
    int from;        /* first cell that kernels draw, a multiple of 8 */
    uint32_t pixels; /* that came to hold a surface */
    int64_t budget;  /* pixels that exact cells may still test */
};

struct sv_warp_kernel {
    /* Projects n texels to entries at .. at + n; returns how many are solid. */
    uint32_t (*project)(const struct sv_warp_line *line, const float *t, const uint8_t (*color)[4], int n,
                        int at, struct sv_warp_row *row);
    /* Draws the fast ones of cells job->from .. n - 1; lists those that are left and returns their number. */
    int (*cells)(struct sv_warp_job *job, const struct sv_warp_row *upper, const struct sv_warp_row *lower,
                 int n, uint16_t *slow);
};

extern const struct sv_warp_kernel sv_warp_scalar, sv_warp_sse2, sv_warp_avx2;

/* Part of the kernels' contract, scalar, from entry / cell `from` on: the ends of rows. */
uint32_t sv_warp_project_scalar(const struct sv_warp_line *line, const float *t, const uint8_t (*color)[4],
                                int n, int at, struct sv_warp_row *row);
int sv_warp_cells_scalar(struct sv_warp_job *job, const struct sv_warp_row *upper,
                         const struct sv_warp_row *lower, int from, int n, uint16_t *slow);

/* Draws cell c exactly, whatever it is, and notes what is torn in it. */
void sv_warp_cell(struct sv_warp_job *job, const struct sv_warp_row *upper, const struct sv_warp_row *lower,
                  int c);

/* sv_warp_splat and sv_warp_resolve at a given level (tests, benchmarks). */
void sv_warp_splat_at(enum sv_simd level, const struct sv_warp_source *source, unsigned k,
                      struct sv_warp_buffer *buffer, struct sv_warp_stats *stats);
void sv_warp_resolve_at(enum sv_simd level, const struct sv_warp_source *sources, unsigned count,
                        const struct sv_warp_buffer *buffer, uint8_t (*rgba)[4]);
/* Pixels i0 <= i < i1 of row j, in plain loops; all that was written, eight at a time. */
void sv_warp_resolve_run(const struct sv_warp_source *sources, const struct sv_warp_buffer *buffer, int j,
                         int i0, int i1, uint8_t (*rgba)[4]);
void sv_warp_resolve_avx2(const struct sv_warp_source *sources, const struct sv_warp_buffer *buffer,
                          uint8_t (*rgba)[4]);

/* A corner of a triangle in the picture: d and 1 / w there, and its place (s, r) in texels from wherever the
 * caller counts. */
struct sv_warp_corner {
    double x, y, d, inverse_w, s, r;
};
/* One run of a triangle's pixels: pixel i of row j; values at the first pixel, and what each grows by. */
struct sv_warp_run {
    int j, i0, i1; /* i0 <= i <= i1 */
    float d, d_step, d_min, d_max, q, q_step, sq, sq_step, rq, rq_step;
};
typedef void (*sv_warp_run_sink)(void *context, const struct sv_warp_run *run);
/* Hands out the runs of pixel centres in a closed triangle (edges included: shared edges leave no gap).
 * Returns how many pixels that were. */
int64_t sv_warp_triangle(const struct sv_warp_buffer *buffer, const struct sv_warp_corner corner[3],
                         sv_warp_run_sink sink, void *context);
/* The place of pixel k of a run, perspective-correct. */
static inline void sv_warp_run_place(const struct sv_warp_run *run, int k, float *s, float *r)
{
    float q = run->q + (float)k * run->q_step;
    *s = (run->sq + (float)k * run->sq_step) / q;
    *r = (run->rq + (float)k * run->rq_step) / q;
}

/* place[] of a pixel: where its centre lies, 8 bits of u and 7 of v, and whether the cell is full. Full: (fu,
 * fv) counts from the centre of texel[], which is the cell's upper left one; otherwise from its corner. */
static inline uint32_t sv_warp_place(float fu, float fv, uint32_t full)
{
    float a = fu * 256, b = fv * 128;
    uint32_t u = (uint32_t)(a > 0 ? a < 255 ? a : 255 : 0), v = (uint32_t)(b > 0 ? b < 127 ? b : 127 : 0);
    return u << 8 | v << 1 | full;
}

/* The arrays of a buffer, as the inner loops hold them in registers. */
struct sv_warp_pixels {
    float *restrict depth;
    uint32_t *restrict texel;
    uint16_t *restrict place;
};

static inline struct sv_warp_pixels sv_warp_pixels_of(const struct sv_warp_buffer *buffer)
{
    return (struct sv_warp_pixels){buffer->depth, buffer->texel, buffer->place};
}

/* Larger d wins, then the smaller texel, then the larger place (one texel's pieces meet at the same depth):
 * no order of drawing changes the picture. Depths are 0 or positive, so that their bits are in the order of
 * their values. Returns 1 when the pixel held nothing before. */
static inline uint32_t sv_warp_put(struct sv_warp_pixels to, size_t p, float d, uint32_t texel,
                                   uint32_t place)
{
    uint32_t held = to.texel[p];
    int32_t before, now;
    memcpy(&before, &to.depth[p], sizeof before);
    memcpy(&now, &d, sizeof now);
    if (now < before || (now == before && (texel > held || (texel == held && place <= to.place[p]))))
        return 0;
    to.depth[p] = d;
    to.texel[p] = texel;
    to.place[p] = (uint16_t)place;
    return held == SV_WARP_EMPTY;
}

void sv_warp_tear_add(struct sv_warp_buffer *buffer, const struct sv_warp_tear *tear);
void sv_warp_touch(struct sv_warp_buffer *buffer, int x0, int y0, int x1, int y1);

#endif
