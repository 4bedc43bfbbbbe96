/* sweep_avx2.c - the column kernel, eight columns side by side: the same operations in the same order as the
 * plain one in sweep.c, so that every bit agrees (no fused multiply-add). Columns that an operation does not
 * concern keep their state by masks. */
#include "core/cell/sweep_kernel.h"

#include <immintrin.h>

enum { LANES = 8 };

struct walk {
    __m256 t, inverse_s; /* t NaN: the profile begins here */
    __m256 tangent;      /* of the next row to be filled */
    int row[LANES];
    int column, open; /* open: bits of columns with rows left */
};

struct cell {
    __m256i c;
    __m256 n[2], f[2];
};

static __attribute__((noinline)) void fill(const struct sv_sweep_job *job, unsigned rising, __m256 t,
                                           __m256 inverse_s, struct walk *w)
{
    float at[LANES], from[LANES], start[LANES], slope[LANES], tangent[LANES];
    const size_t n = (size_t)job->size;
    _mm256_storeu_ps(at, t);
    _mm256_storeu_ps(from, w->t);
    _mm256_storeu_ps(start, w->inverse_s);
    _mm256_storeu_ps(slope, _mm256_div_ps(_mm256_sub_ps(inverse_s, w->inverse_s), _mm256_sub_ps(t, w->t)));
    _mm256_storeu_ps(tangent, w->tangent);
    for (; rising; rising &= rising - 1) {
        int k = __builtin_ctz(rising), row = w->row[k];
        float *to = job->q + (n - 1 - (size_t)row) * n + (size_t)(w->column + k);
        int begins = from[k] != from[k];
        for (; job->tangent[row] <= at[k]; row++, to -= n) {
            float q = (start[k] + (job->tangent[row] - from[k]) * slope[k]) * job->distance_m;
            if (!begins)
                *to = q < 1 ? q : 1;
        }
        w->row[k] = row;
        tangent[k] = job->tangent[row];
        if (row == job->size)
            w->open &= ~(1 << k);
    }
    w->tangent = _mm256_loadu_ps(tangent);
}

/* The profile goes on to (h, s), in the columns of the mask. */
static inline void go_on(const struct sv_sweep_job *job, __m256 mask, __m256 h, __m256 s, struct walk *w)
{
    __m256 inverse_s = _mm256_div_ps(_mm256_set1_ps(1), s), t = _mm256_mul_ps(h, inverse_s);
    unsigned rising =
        (unsigned)_mm256_movemask_ps(_mm256_and_ps(mask, _mm256_cmp_ps(w->tangent, t, _CMP_LE_OQ)));
    if (rising)
        fill(job, rising, t, inverse_s, w);
    w->t = _mm256_blendv_ps(w->t, t, mask);
    w->inverse_s = _mm256_blendv_ps(w->inverse_s, inverse_s, mask);
}

/* Samples of a line, heights above the eye; NaN outside of the field and of the mask. */
static inline __m256 sample(const struct sv_sweep_job *job, int line, __m256i c, __m256 mask)
{
    c = _mm256_add_epi32(c, _mm256_set1_epi32(job->base));
    __m256i out = _mm256_or_si256(_mm256_cmpgt_epi32(_mm256_setzero_si256(), c),
                                  _mm256_cmpgt_epi32(c, _mm256_set1_epi32(job->across - 1)));
    mask = _mm256_andnot_ps(_mm256_castsi256_ps(out), mask);
    const float *h = job->h + (ptrdiff_t)line * job->line;
    __m256i at = _mm256_mullo_epi32(c, _mm256_set1_epi32(job->side));
    __m256 height = _mm256_mask_i32gather_ps(_mm256_set1_ps(__builtin_nanf("")), h, at, mask, 4);
    return _mm256_sub_ps(_mm256_sub_ps(height, _mm256_set1_ps(job->eye_h)), _mm256_set1_ps(job->eye_h_low));
}

static inline __m256 all(void)
{
    return _mm256_castsi256_ps(_mm256_set1_epi32(-1));
}

static inline __m256 mix(__m256 a, __m256 b, __m256 share)
{
    return _mm256_add_ps(a, _mm256_mul_ps(_mm256_sub_ps(b, a), share));
}

/* All bits set where the diagonal of cell (g, c) goes the other way. */
static inline __m256 is_anti(const struct sv_sweep_job *job, int g, __m256i c)
{
    __m256i sum = _mm256_add_epi32(c, _mm256_set1_epi32(g + job->base + job->flip));
    return _mm256_castsi256_ps(_mm256_srai_epi32(_mm256_slli_epi32(sum, 31), 31));
}

static inline void cross_diagonal(const struct sv_sweep_job *job, __m256 mask, int g, const struct cell *cell,
                                  __m256 v0, __m256 dv, __m256 from, __m256 to, __m256 near, struct walk *w)
{
    const __m256 one = _mm256_set1_ps(1);
    __m256 anti = is_anti(job, g, cell->c);
    __m256 v = _mm256_sub_ps(v0, _mm256_cvtepi32_ps(cell->c));
    __m256 u = _mm256_div_ps(_mm256_blendv_ps(v, _mm256_sub_ps(one, v), anti),
                             _mm256_blendv_ps(_mm256_sub_ps(one, dv), _mm256_add_ps(one, dv), anti));
    __m256 p = _mm256_blendv_ps(cell->n[0], cell->n[1], anti),
           q = _mm256_blendv_ps(cell->f[1], cell->f[0], anti);
    __m256 within = _mm256_and_ps(_mm256_cmp_ps(u, from, _CMP_GT_OQ), _mm256_cmp_ps(u, to, _CMP_LT_OQ));
    go_on(job, _mm256_and_ps(mask, within), mix(p, q, u),
          _mm256_add_ps(near, _mm256_mul_ps(u, _mm256_set1_ps((float)job->step_m))), w);
}

/* Columns that turn to a neighbour cell, by a line along the view. */
static inline void turn(const struct sv_sweep_job *job, __m256 mask, __m256 rising, int g, __m256 v0,
                        __m256 dv, __m256 from, __m256 to, __m256 near, struct cell *cell, struct walk *w)
{
    const __m256i one = _mm256_set1_epi32(1);
    __m256i side = _mm256_and_si256(_mm256_castps_si256(rising), one);
    __m256 u = _mm256_div_ps(_mm256_sub_ps(_mm256_cvtepi32_ps(_mm256_add_epi32(cell->c, side)), v0), dv);
    u = _mm256_min_ps(_mm256_max_ps(u, from), to);
    cross_diagonal(job, mask, g, cell, v0, dv, from, u, near, w);
    __m256 n = _mm256_blendv_ps(cell->n[0], cell->n[1], rising),
           f = _mm256_blendv_ps(cell->f[0], cell->f[1], rising);
    go_on(job, mask, mix(n, f, u), _mm256_add_ps(near, _mm256_mul_ps(u, _mm256_set1_ps((float)job->step_m))),
          w);
    __m256i by = _mm256_sub_epi32(_mm256_add_epi32(side, side), one);
    cell->c = _mm256_add_epi32(cell->c, _mm256_and_si256(by, _mm256_castps_si256(mask)));
    __m256i outer = _mm256_add_epi32(cell->c, side);
    __m256 up = _mm256_and_ps(mask, rising), down = _mm256_andnot_ps(rising, mask);
    __m256 outer_n = sample(job, g, outer, mask), outer_f = sample(job, g + 1, outer, mask);
    cell->n[0] = _mm256_blendv_ps(_mm256_blendv_ps(cell->n[0], n, up), outer_n, down);
    cell->f[0] = _mm256_blendv_ps(_mm256_blendv_ps(cell->f[0], f, up), outer_f, down);
    cell->n[1] = _mm256_blendv_ps(_mm256_blendv_ps(cell->n[1], n, down), outer_n, up);
    cell->f[1] = _mm256_blendv_ps(_mm256_blendv_ps(cell->f[1], f, down), outer_f, up);
    cross_diagonal(job, mask, g, cell, v0, dv, u, to, near, w);
}

static inline void pass(const struct sv_sweep_job *job, int g, __m256 from, __m256 to, __m256 near, __m256 v0,
                        __m256 v, __m256 dv, struct cell *cell, struct walk *w)
{
    __m256i c = _mm256_cvttps_epi32(_mm256_floor_ps(v));
    __m256 rising = _mm256_castsi256_ps(_mm256_cmpgt_epi32(c, cell->c));
    __m256 turns = _mm256_or_ps(rising, _mm256_castsi256_ps(_mm256_cmpgt_epi32(cell->c, c)));
    int turning = _mm256_movemask_ps(turns);
    if (turning != 0xFF)
        cross_diagonal(job, _mm256_andnot_ps(turns, all()), g, cell, v0, dv, from, to, near, w);
    if (turning)
        turn(job, turns, rising, g, v0, dv, from, to, near, cell, w);
}

static inline void enter(const struct sv_sweep_job *job, int g, __m256i c, struct cell *cell)
{
    __m256i next = _mm256_add_epi32(c, _mm256_set1_epi32(1));
    *cell = (struct cell){c,
                          {sample(job, g, c, all()), sample(job, g, next, all())},
                          {sample(job, g + 1, c, all()), sample(job, g + 1, next, all())}};
}

/* Where the profiles begin, or go on after blocks that were passed over. */
static void begin(const struct sv_sweep_job *job, int g, float u, __m256 v, __m256 s, struct cell *cell,
                  struct walk *w)
{
    float n[2][LANES], f[2][LANES], at[LANES], h[LANES];
    int32_t anti[LANES];
    __m256i c = _mm256_cvttps_epi32(_mm256_floor_ps(v));
    enter(job, g, c, cell);
    for (int k = 0; k < 2; k++) {
        _mm256_storeu_ps(n[k], cell->n[k]);
        _mm256_storeu_ps(f[k], cell->f[k]);
    }
    _mm256_storeu_ps(at, _mm256_sub_ps(v, _mm256_cvtepi32_ps(c)));
    _mm256_storeu_si256((__m256i *)anti, _mm256_castps_si256(is_anti(job, g, c)));
    for (int k = 0; k < LANES; k++)
        h[k] = sv_sweep_corner((float[2]){n[0][k], n[1][k]}, (float[2]){f[0][k], f[1][k]}, u, at[k], anti[k]);
    go_on(job, all(), _mm256_loadu_ps(h), s, w);
}

static float least(__m256 v)
{
    __m128 m = _mm_min_ps(_mm256_castps256_ps128(v), _mm256_extractf128_ps(v, 1));
    m = _mm_min_ps(m, _mm_movehl_ps(m, m));
    return _mm_cvtss_f32(_mm_min_ss(m, _mm_shuffle_ps(m, m, 1)));
}

static bool hidden(const struct sv_sweep_job *job, int g, __m256 v0, __m256 drift, const struct walk *w)
{
    __m256 m = _mm256_set1_ps((float)sv_sweep_line_m(job, g + SV_SWEEP_BLOCK));
    __m256 v8 = _mm256_add_ps(_mm256_set1_ps(job->place), _mm256_mul_ps(m, drift));
    float low = least(_mm256_min_ps(v0, v8));
    float high = -least(_mm256_sub_ps(_mm256_setzero_ps(), _mm256_max_ps(v0, v8)));
    return sv_sweep_hidden(job, g, low, high, least(w->tangent));
}

static struct walk walk_of(const struct sv_sweep_job *job, int column)
{
    int count = job->size - column < LANES ? job->size - column : LANES;
    float tangent[LANES];
    struct walk w = {.t = _mm256_set1_ps(__builtin_nanf("")), .column = column, .open = (1 << count) - 1};
    for (int k = 0; k < LANES; k++) {
        w.row[k] = k < count ? 0 : job->size;
        tangent[k] = job->tangent[w.row[k]];
    }
    w.tangent = _mm256_loadu_ps(tangent);
    return w;
}

void sv_sweep_columns_avx2(const struct sv_sweep_job *job, int column)
{
    const int end = sv_sweep_end(job, column, LANES);
    const float part = 1 / (float)job->substeps;
    const __m256 drift = _mm256_loadu_ps(job->drift + column), step = _mm256_set1_ps((float)job->step_m);
    const __m256 dv = _mm256_mul_ps(drift, step), place = _mm256_set1_ps(job->place);
    struct walk w = walk_of(job, column);
    struct cell cell;
    bool entered = false;
    for (int g = job->first; g < end && w.open; g++) {
        __m256 near = _mm256_set1_ps((float)sv_sweep_line_m(job, g));
        __m256 far = _mm256_set1_ps((float)sv_sweep_line_m(job, g + 1));
        __m256 v0 = _mm256_add_ps(place, _mm256_mul_ps(near, drift));
        __m256 v1 = _mm256_add_ps(place, _mm256_mul_ps(far, drift));
        float u = g == job->first ? job->begin : 0;
        if (g > job->first && sv_sweep_at_block(job, g) && hidden(job, g, v0, drift, &w)) {
            g += SV_SWEEP_BLOCK - 1;
            entered = false;
            continue;
        }
        if (!entered) {
            __m256 from = _mm256_set1_ps(u);
            __m256 v = u > 0 ? _mm256_add_ps(v0, _mm256_mul_ps(dv, from)) : v0;
            begin(job, g, u, v, _mm256_add_ps(near, _mm256_mul_ps(from, step)), &cell, &w);
            entered = true;
        } else {
            cell.n[0] = cell.f[0];
            cell.n[1] = cell.f[1];
            cell.f[0] = sample(job, g + 1, cell.c, all());
            cell.f[1] = sample(job, g + 1, _mm256_add_epi32(cell.c, _mm256_set1_epi32(1)), all());
        }
        for (int k = 1; k <= job->substeps; k++) {
            float to = k < job->substeps ? (float)k * part : 1;
            if (to > u) {
                __m256 until = _mm256_set1_ps(to);
                __m256 v = to == 1 ? v1 : _mm256_add_ps(v0, _mm256_mul_ps(dv, until));
                pass(job, g, _mm256_set1_ps(u), until, near, v0, v, dv, &cell, &w);
                u = to;
            }
        }
        go_on(job, all(), mix(cell.f[0], cell.f[1], _mm256_sub_ps(v1, _mm256_cvtepi32_ps(cell.c))), far, &w);
    }
}
