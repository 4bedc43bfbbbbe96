/* leaf_project_avx2.c - sv_leaf_scalar.project, eight pieces at a time; operation for operation the scalar
 * one. */
#include <math.h>

#include "core/tree/leaf_avx2.h"
#include "core/tree/leaf_kernel.h"

enum { TILE_BITS = 4 };
_Static_assert(1 << TILE_BITS == (int)SV_LEAF_TILE, "tiles are shifts");

/* Eight pieces in the picture: P0, E1, E2 as A, B, C. */
struct moved {
    __m256 v[9];
};

static inline __m256 row_of(const float m[4], const __m256 p[3])
{
    return add(add(mul(splat(m[0]), p[0]), mul(splat(m[1]), p[1])), mul(splat(m[2]), p[2]));
}

/* Returns the lanes that are not thinned out. */
static inline __m256 move_block(const struct sv_leaf_job *job, uint32_t at, const struct sv_leaf_thin *thin,
                                struct moved *out)
{
    const struct sv_leaf_block *b = &job->form->blocks[at];
    __m256 p[3][3], there = _mm256_castsi256_ps(_mm256_set1_epi32(-1));
    for (int c = 0; c < 3; c++) {
        p[0][c] = _mm256_load_ps(b->p0[c]);
        p[1][c] = _mm256_load_ps(b->e1[c]);
        p[2][c] = _mm256_load_ps(b->e2[c]);
    }
    if (thin) {
        const struct sv_leaf_fade *fade = &job->form->fades[at];
        __m256 growth =
            _mm256_div_ps(sub(splat(thin->upto), _mm256_load_ps(fade->rank)), splat(thin->window));
        there = _mm256_cmp_ps(growth, _mm256_setzero_ps(), _CMP_GT_OQ);
        __m256 k = mul(splat(thin->scale), _mm256_sqrt_ps(_mm256_min_ps(growth, splat(1))));
        for (int c = 0; c < 3; c++) {
            __m256 middle = _mm256_load_ps(fade->middle[c]);
            p[0][c] = add(middle, mul(k, sub(p[0][c], middle)));
            p[1][c] = mul(k, p[1][c]);
            p[2][c] = mul(k, p[2][c]);
        }
    }
    for (int c = 0; c < 3; c++) {
        const float *m = job->eye.m[c];
        out->v[c] = add(row_of(m, p[0]), splat(m[3]));
        out->v[3 + c] = row_of(m, p[1]);
        out->v[6 + c] = row_of(m, p[2]);
    }
    return there;
}

struct boxes {
    __m256 x0, x1, y0, y1;
    __m256i i0, j0, nx, ny;
};

/* sv_leaf_queue_crossing for the chosen lanes. */
static void cross_lanes(struct sv_leaf_job *job, const struct moved *moved, unsigned chosen, bool card,
                        uint32_t piece0)
{
    float lane[9][LANES];
    for (int k = 0; k < 9; k++)
        _mm256_storeu_ps(lane[k], moved->v[k]);
    for (; chosen; chosen &= chosen - 1) {
        int i = __builtin_ctz(chosen);
        float v[9];
        for (int k = 0; k < 9; k++)
            v[k] = lane[k][i];
        sv_leaf_queue_crossing(job, &sv_leaf_avx2, v, card, piece0 + (uint32_t)i);
    }
}

/* Ranges of pixels; the mask of those that hold one. */
static inline __m256 range(__m256 lo, __m256 hi, int size, __m256i *first, __m256i *count)
{
    __m256 margin = splat(SV_LEAF_MARGIN);
    __m256 a = _mm256_ceil_ps(_mm256_max_ps(sub(lo, margin), _mm256_setzero_ps()));
    __m256 b = _mm256_floor_ps(_mm256_min_ps(add(hi, margin), splat((float)(size - 1))));
    *first = _mm256_cvttps_epi32(a);
    *count = _mm256_cvttps_epi32(add(sub(b, a), splat(1)));
    return _mm256_and_ps(in_order(lo, hi), in_order(a, b));
}

/* The mask of boxes that have rows of the band. */
static inline __m256 in_band(const struct sv_leaf_eye *eye, const struct boxes *box)
{
    __m256i first = _mm256_set1_epi32(eye->row_first),
            end = _mm256_set1_epi32(eye->row_first + eye->row_count);
    __m256i above = _mm256_cmpgt_epi32(end, box->j0),
            below = _mm256_cmpgt_epi32(_mm256_add_epi32(box->j0, box->ny), first);
    return _mm256_castsi256_ps(_mm256_and_si256(above, below));
}

/* Corners' extent in the picture, in any order of corners; least and most depth. */
static inline void extent(const struct moved *m, bool card, bool orthographic, struct boxes *box,
                          __m256 *least, __m256 *most)
{
    for (int k = 0; k < (card ? 4 : 3); k++) {
        __m256 p[3];
        for (int c = 0; c < 3; c++) {
            p[c] = k == 0            ? m->v[c]
                   : k == 2 && !card ? add(m->v[c], m->v[6 + c])
                   : k == 3          ? add(m->v[c], m->v[6 + c])
                                     : add(m->v[c], m->v[3 + c]);
            if (k == 2 && card)
                p[c] = add(p[c], m->v[6 + c]);
        }
        __m256 inverse = orthographic ? splat(1) : _mm256_div_ps(splat(1), p[2]);
        __m256 x = mul(p[0], inverse), y = mul(p[1], inverse);
        box->x0 = k ? _mm256_min_ps(box->x0, x) : x;
        box->x1 = k ? _mm256_max_ps(box->x1, x) : x;
        box->y0 = k ? _mm256_min_ps(box->y0, y) : y;
        box->y1 = k ? _mm256_max_ps(box->y1, y) : y;
        *least = k ? _mm256_min_ps(p[2], *least) : p[2];
        *most = k ? _mm256_max_ps(p[2], *most) : p[2];
    }
}

static inline void enqueue(struct sv_leaf_job *job, int q, unsigned bits, const struct moved *moved,
                           const struct boxes *box, __m256i piece)
{
    struct sv_leaf_queue *queue = &job->queue[q];
    __m256i order = order_of(bits);
    int n = queue->count;
    for (int k = 0; k < 9; k++)
        store_packed(queue->v[k] + n, moved->v[k], order);
    store_packed_i(queue->i0 + n, box->i0, order);
    store_packed_i(queue->j0 + n, box->j0, order);
    store_packed_i(queue->nx + n, box->nx, order);
    store_packed_i(queue->ny + n, box->ny, order);
    store_packed_i(queue->piece + n, piece, order);
    queue->count = n + __builtin_popcount(bits);
    if (queue->count >= SV_LEAF_QUEUE)
        sv_leaf_avx2.raster(job, q);
}

/* Those of the lanes there that lie behind what each tile of their boxes holds, of boxes that touch two tiles
 * a side at most (the scalar kernel finds out pixel by pixel). least: depth Z. */
static inline __m256 hidden(const struct sv_leaf_job *job, __m256 there, const struct boxes *box,
                            __m256 least)
{
    const __m256i tiles = _mm256_set1_epi32(job->tiles_x), one = _mm256_set1_epi32(1);
    const __m256i most = _mm256_set1_epi32(SV_LEAF_TILE + 1);
    /* Tiles count from the band's first row; what of a box lies beyond the band is of no matter. */
    __m256i row_first = _mm256_set1_epi32(job->eye.row_first),
            last_row = _mm256_set1_epi32(job->eye.row_count - 1);
    __m256i j0 = _mm256_sub_epi32(box->j0, row_first),
            j1 = _mm256_sub_epi32(_mm256_add_epi32(j0, box->ny), one);
    __m256i tx0 = _mm256_srli_epi32(box->i0, TILE_BITS);
    __m256i tx1 = _mm256_srli_epi32(_mm256_sub_epi32(_mm256_add_epi32(box->i0, box->nx), one), TILE_BITS);
    __m256i ty0 = _mm256_srli_epi32(_mm256_max_epi32(j0, _mm256_setzero_si256()), TILE_BITS);
    __m256i ty1 = _mm256_srli_epi32(_mm256_min_epi32(j1, last_row), TILE_BITS);
    __m256 asked = _mm256_castsi256_ps(_mm256_cmpgt_epi32(most, _mm256_max_epi32(box->nx, box->ny)));
    asked = _mm256_and_ps(asked, there); /* boxes of the others are anything */
    ty0 = _mm256_mullo_epi32(ty0, tiles);
    ty1 = _mm256_mullo_epi32(ty1, tiles);
    __m256 held = splat(2);
    const __m256i at[4] = {_mm256_add_epi32(ty0, tx0), _mm256_add_epi32(ty0, tx1), _mm256_add_epi32(ty1, tx0),
                           _mm256_add_epi32(ty1, tx1)};
    for (int k = 0; k < 4; k++)
        held = _mm256_min_ps(held,
                             _mm256_mask_i32gather_ps(_mm256_setzero_ps(), job->tile_far, at[k], asked, 4));
    __m256 d = _mm256_div_ps(splat(job->eye.near_m * 1.00001f), least);
    return _mm256_cmp_ps(d, held, _CMP_LT_OQ);
}

static inline void project_block(struct sv_leaf_job *job, uint32_t at, bool card,
                                 const struct sv_leaf_thin *thin, bool orthographic)
{
    struct moved moved;
    struct boxes box;
    __m256 there = move_block(job, at, thin, &moved), least, most;
    extent(&moved, card, orthographic, &box, &least, &most);
    if (!orthographic) {
        __m256 near_m = splat(job->eye.near_m), behind = _mm256_cmp_ps(least, near_m, _CMP_LT_OQ);
        __m256 cross = _mm256_and_ps(_mm256_and_ps(there, behind), in_order(near_m, most));
        if (bits_of(cross))
            cross_lanes(job, &moved, bits_of(cross), card, at * LANES);
        there = _mm256_andnot_ps(behind, there);
    }
    there = _mm256_and_ps(there, range(box.x0, box.x1, job->eye.width, &box.i0, &box.nx));
    there = _mm256_and_ps(there, range(box.y0, box.y1, job->eye.height, &box.j0, &box.ny));
    there = _mm256_and_ps(there, in_band(&job->eye, &box));
    if (!orthographic && bits_of(there))
        there = _mm256_andnot_ps(hidden(job, there, &box, least), there);
    unsigned left = bits_of(there);
    if (!left)
        return;
    const __m256i lane = _mm256_setr_epi32(0, 1, 2, 3, 4, 5, 6, 7);
    __m256i piece = _mm256_add_epi32(_mm256_set1_epi32((int)(at * LANES)), lane);
    __m256i side = _mm256_max_epi32(box.nx, box.ny);
    for (int q = 0; left; q++) {
        __m256i larger = _mm256_cmpgt_epi32(side, _mm256_set1_epi32(sv_leaf_side[q]));
        unsigned bits = left & ~bits_of(_mm256_castsi256_ps(larger));
        if (bits)
            enqueue(job, q, bits, &moved, &box, piece);
        left &= ~bits;
    }
}

static inline void project_blocks(struct sv_leaf_job *job, const struct sv_leaf_cluster *cluster, bool card,
                                  const struct sv_leaf_thin *thin, bool orthographic)
{
    for (uint32_t b = cluster->block; b < cluster->block + cluster->block_count; b++) {
        if (thin && job->form->fades[b].rank[0] >= thin->upto)
            return;
        project_block(job, b, card, thin, orthographic);
    }
}

void sv_leaf_project_avx2(struct sv_leaf_job *job, const struct sv_leaf_cluster *cluster)
{
    const struct sv_leaf_thin *thin = sv_leaf_thins(job, cluster);
    bool card = cluster->card;
    if (job->eye.orthographic)
        project_blocks(job, cluster, card, thin, true);
    else if (card && thin)
        project_blocks(job, cluster, true, thin, false);
    else if (card)
        project_blocks(job, cluster, true, NULL, false);
    else
        project_blocks(job, cluster, false, thin, false);
}
