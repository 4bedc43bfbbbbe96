/* leaf_kernel.h - inside of the leaf splatter: what its passes hand to each other, and the kernels. Private.
 *
 * One tree is drawn at a time. Pass 1 (project) takes a cluster's blocks, moves pieces into the picture and
 * keeps those whose boxes hold a pixel centre, in queues by the boxes' size. Pass 2 (raster) finds the pixel
 * centres inside, eight pieces at a time, or eight pixels of a large piece. Pass 3 (settle) asks the alpha
 * mask and writes depth, piece and place in it. Pass 4 (shade) lights the pixels that the tree has won.
 *
 * Pixels are counted so that pixel (i, j) of the picture has its centre at (i, j): with A, B, C the projected
 * coordinates (C = depth Z in metres), perspective: i = A / C, j = B / C; orthographic: i = A, j = B. A piece
 * hits the ray of pixel offset d = (x, y, 1) from the box's first pixel where P0 + s E1 + r E2 = t d, P0, E1
 * and E2 sheared so that this pixel is the axis: s = d.(E2 x P0) / d.N, r = d.(P0 x E1) / d.N, N = E1 x E2, 1
 * / t = d.N / P0.N           (own derivation) which holds wherever the corners lie, behind the eye too:
 * nothing is clipped. Window depth is near / t. Orthographic: the same with third coordinates 1 for P0 and 0
 * for E1, E2, and depth linear in s and r.
 *
 * The same arithmetic in the same order at every level, no fused multiply-add: pictures of all levels are
 * equal bit for bit. So are bands of a picture: boxes and all that is linear in the pixel are the picture's,
 * whatever band is drawn; a band leaves rows out, and its buffers begin at its first one. */
#ifndef SV_TREE_LEAF_KERNEL_H
#define SV_TREE_LEAF_KERNEL_H

#include <math.h>
#include <stdbool.h>
#include <string.h>

#include "core/base/simd.h"
#include "core/tree/leaf_form.h"
#include "core/tree/leaf_splat.h"

/* Boxes of a queue hold at most sv_leaf_side pixels a side; the last holds what is larger. */
enum { SV_LEAF_QUEUES = 5, SV_LEAF_QUEUE = 64, SV_LEAF_QUEUE_ROOM = SV_LEAF_QUEUE + 2 * SV_LEAF_LANES };
/* Hits that may be listed before the list is settled, and what one step may add. */
enum { SV_LEAF_HITS = 512, SV_LEAF_HIT_ROOM = SV_LEAF_HITS + 72 * SV_LEAF_LANES };
/* Pixels of a tile, a side. */
enum { SV_LEAF_TILE = 16 };
/* Pixels of one material that wait for light. */
enum { SV_LEAF_LIT = 64 };

static const int sv_leaf_side[SV_LEAF_QUEUES] = {1, 2, 4, 8, 1 << 20};

/* Projected pieces that wait: P0, E1, E2 as A, B, C; the box. */
struct sv_leaf_queue {
    int count;
    _Alignas(32) float v[9][SV_LEAF_QUEUE_ROOM];
    _Alignas(32) int32_t i0[SV_LEAF_QUEUE_ROOM], j0[SV_LEAF_QUEUE_ROOM], nx[SV_LEAF_QUEUE_ROOM],
        ny[SV_LEAF_QUEUE_ROOM];
    _Alignas(32) uint32_t piece[SV_LEAF_QUEUE_ROOM];
};

struct sv_leaf_hits {
    int count;
    _Alignas(32) uint32_t pixel[SV_LEAF_HIT_ROOM], piece[SV_LEAF_HIT_ROOM];
    _Alignas(32) float d[SV_LEAF_HIT_ROOM], s[SV_LEAF_HIT_ROOM], r[SV_LEAF_HIT_ROOM];
};

/* What a pixel shows of the tree that is being drawn: piece + 1, 0 for nothing; s and r in 16 bits each. */
struct sv_leaf_seen {
    uint32_t piece, place;
};

/* The camera for one tree: model -> A, B, C; row k is m[k][0..2] . p + m[k][3]. */
struct sv_leaf_eye {
    float m[3][4];
    bool orthographic;
    float height_px;   /* of the tree at depth 1 m; orthographic: at any */
    float near_m;      /* perspective */
    float far_m;       /* orthographic */
    int width, height;        /* of the picture, px */
    int row_first, row_count; /* the band of it that is drawn */
};

/* Rows of the band that a box with ny rows from j0 has: the first and the end, counted from j0. */
static inline bool sv_leaf_rows(const struct sv_leaf_eye *eye, int j0, int ny, int rows[2])
{
    int first = eye->row_first - j0, end = first + eye->row_count;
    rows[0] = first > 0 ? first : 0;
    rows[1] = end < ny ? end : ny;
    return rows[0] < rows[1];
}

/* Thinning out: leaves of a rank below `upto` are there, those within `window` below it only begin to grow;
 * linear size at full growth is `scale`. */
struct sv_leaf_thin {
    float upto, window, scale;
};

struct sv_leaf_job {
    const struct sv_leaf_form *form;
    struct sv_leaf_eye eye;
    struct sv_leaf_thin thin;       /* of leaves */
    struct sv_leaf_thin come;       /* of what is not thinned out, while the tree fades in; scale 1 */
    const struct sv_leaf_map *mask; /* of the material that is being drawn; NULL: all is there */
    float alpha_factor, alpha_cutoff;
    bool card;    /* what is queued: parallelograms; else triangles */
    float *depth; /* the band's */
    const float *tile_far; /* by tile: no depth in it is less; pieces behind it may be left out */
    int tiles_x;
    struct sv_leaf_seen *seen;
    struct sv_leaf_queue queue[SV_LEAF_QUEUES];
    struct sv_leaf_hits hits;
};

/* Light on one tree. Functionals of a pixel: f[0] i + f[1] j + f[2]. */
struct sv_leaf_light {
    float turn[2];      /* cos, sin of the tree's rotation */
    float ray[3][3];    /* perspective: direction through pixel (i, j), world axes, . forward = 1 */
    float to_viewer[3]; /* orthographic */
    float to_sun[3], model_sun[3];
    float sun[3], sky[3], ground[3];              /* times SV_LIGHT_EXPOSURE */
    bool shadows;                                 /* what follows holds */
    float share[SV_SHADE_COLUMNS][SV_SHADE_ROWS]; /* 0..1 */
    float column[5], row[5]; /* grid coordinates: (f . pixel) * (Z, or 1 when orthographic) + [3] Z' + [4], Z'
                                = Z when orthographic, else 0 */
    float crown;             /* sv_tree_crown_light without the hot spot */
    bool air;
    float air_rgb[3], air_scale; /* exponent base 2 a metre, below 0 */
    uint32_t id;
};

struct sv_leaf_paint {
    const struct sv_tree_material *material;
    const struct sv_leaf_map *map;
    float texels; /* of the map a pixel, at depth 1 m (orthographic: at any); 0: level 0 alone */
    const struct sv_leaf_job *job;
    const struct sv_leaf_light *light;
    uint8_t (*color)[4];
    uint32_t *id;       /* NULL: not wanted */
    float (*normal)[3]; /* NULL: not wanted */
};

struct sv_leaf_kernel {
    /* Queues the pieces of a cluster's blocks whose boxes hold pixel centres; raster is called when a queue
     * is full. */
    void (*project)(struct sv_leaf_job *job, const struct sv_leaf_cluster *cluster);
    /* Empties queue q into the hits; settle is called when those are many. */
    void (*raster)(struct sv_leaf_job *job, int q);
    /* Empties the hits into the picture. */
    void (*settle)(struct sv_leaf_job *job);
    /* Lights n <= SV_LEAF_LIT listed pixels of one material. */
    void (*shade)(const struct sv_leaf_paint *paint, const uint32_t *pixel, int n);
    /* Least depth in a rectangle of the band's depths; w, h > 0. */
    float (*least)(const float *depth, int stride, int w, int h);
};

extern const struct sv_leaf_kernel sv_leaf_scalar, sv_leaf_avx2;
void sv_leaf_project_avx2(struct sv_leaf_job *job, const struct sv_leaf_cluster *cluster);

static inline const struct sv_leaf_kernel *sv_leaf_kernel_at(enum sv_simd level)
{
    return level >= SV_SIMD_AVX2 ? &sv_leaf_avx2 : &sv_leaf_scalar;
}

/* Draws at that level from now on (tests, benchmarks). */
void sv_leaf_splat_set_level(struct sv_leaf_splat *splat, enum sv_simd level);

/* Room that rounding of a box needs, px: an inside test may hold there. */
#define SV_LEAF_MARGIN (1.0f / 512)
/* What rounding may do to a place in a piece of wood or a sheet: pixels on a shared edge are drawn by both.
 */
#define SV_LEAF_EDGE (1.0f / 4096)

static inline float sv_leaf_min(float a, float b) /* as minps: b when either is NaN */
{
    return a < b ? a : b;
}
static inline float sv_leaf_max(float a, float b)
{
    return a > b ? a : b;
}

static inline const struct sv_leaf_thin *sv_leaf_thin_of(const struct sv_leaf_job *job,
                                                         const struct sv_leaf_cluster *cluster)
{
    return cluster->thins ? &job->thin : &job->come;
}

/* Whether pieces of the cluster are left out or grow; NULL: all are there as they are. */
static inline const struct sv_leaf_thin *sv_leaf_thins(const struct sv_leaf_job *job,
                                                       const struct sv_leaf_cluster *cluster)
{
    const struct sv_leaf_thin *thin = sv_leaf_thin_of(job, cluster);
    return thin->upto >= 1 + thin->window && thin->scale == 1 ? NULL : thin;
}

/* Texture coordinate -> texels from the first one's centre; NaN and infinity: 0 (core/truth/texture.c). */
static inline float sv_leaf_texel(float u, int size)
{
    float x = (u - floorf(u)) * (float)size - 0.5f;
    return x >= -1 && x <= (float)size ? x : 0;
}

/* The two texels about floor(x) = i, repeated. */
static inline void sv_leaf_wrap(int i, int size, int out[2])
{
    out[0] = i < 0 ? i + size : i;
    out[1] = i + 1 >= size ? i + 1 - size : i + 1;
}

/* Queues one projected piece v (P0, E1, E2 as A, B, C) that crosses the near plane, scalar: its box is that
 * of the part in front. */
void sv_leaf_queue_crossing(struct sv_leaf_job *job, const struct sv_leaf_kernel *kernel, const float v[9],
                            bool card, uint32_t piece);

/* Part of the kernels' contract, scalar, for ends. */
void sv_leaf_settle_run(struct sv_leaf_job *job, int from, int to);

/* Larger depth wins; of one tree's pieces at the same depth the first: no order of drawing changes the
 * picture. Depths are 0 or positive, so that their bits are in the order of their values. */
static inline void sv_leaf_put(struct sv_leaf_job *job, uint32_t pixel, float d, uint32_t piece,
                               uint32_t place)
{
    int32_t before, now;
    memcpy(&before, &job->depth[pixel], sizeof before);
    memcpy(&now, &d, sizeof now);
    struct sv_leaf_seen *seen = &job->seen[pixel];
    if (now < before || (now == before && piece + 1 >= seen->piece))
        return;
    job->depth[pixel] = d;
    *seen = (struct sv_leaf_seen){piece + 1, place};
}

#endif
